"""Slow twin of routing: the shortest way over the visibility graph of inflated obstacles."""

import heapq

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
