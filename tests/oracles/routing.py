"""Slow twins of routing: the shortest way over the visibility graph of inflated obstacles; way points."""

import heapq

import numpy as np
import shapely


def shortest_way(world, start, goal, radius):
    """Length of the shortest way of a disc among obstacles, m."""
    blocked = shapely.union_all(
        [shape.geometry().buffer(0.98 * radius, quad_segs=4) for shape in world.obstacles]
    )
    outlines = [blocked] if blocked.geom_type == "Polygon" else list(blocked.geoms)
    low_x, high_x, low_z, high_z = world.bounds
    corners = [
        corner
        for outline in outlines
        for corner in outline.exterior.coords[:-1]
        if low_x <= corner[0] <= high_x and low_z <= corner[1] <= high_z
    ]
    nodes = [(start[0], start[2]), (goal[0], goal[2]), *corners]
    inside = blocked.buffer(-1e-6)
    best = {0: 0.0}
    queue = [(0.0, 0)]
    while queue:
        length, node = heapq.heappop(queue)
        if node == 1:
            return length
        if length > best[node]:
            continue
        for other, place in enumerate(nodes):
            line = shapely.LineString([nodes[node], place])
            new = length + line.length
            if new < best.get(other, float("inf")) and not line.intersects(inside):
                best[other] = new
                heapq.heappush(queue, (new, other))
    return float("inf")


def way_length(start, corners):
    """Length of the way from a start over corners, m."""
    points = np.vstack([start, corners])
    return float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())


def next_corner(is_free, place, corners, index, reach):
    """Farthest corner in sight, going on one by one; None when none of the next, this, the last is."""
    last = len(corners) - 1
    found = index
    while found < last and is_free(place, corners[found + 1]):
        found += 1
    if found > index:
        return found
    if is_free(place, corners[index]):
        is_passed = np.linalg.norm(corners[index] - place) < 0.25 * reach
        return min(index + 1, last) if is_passed else index
    if index > 0 and is_free(place, corners[index - 1]):
        return index if np.linalg.norm(corners[index - 1] - place) < reach else index - 1
    return None


def touches(start, corners, low, high):
    """A way over corners touches a rectangle."""
    return shapely.LineString(np.vstack([start, corners])).intersects(shapely.box(*low, *high))
