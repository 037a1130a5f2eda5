"""Slow twins of `crowd_kernels.walkable` and `crowd_kernels.free_line`, by exact geometry."""

import numpy as np
import shapely


def clearance(obstacles, points):
    """Distance of ground points (P, 2) to the nearest obstacle, 0 inside, m."""
    blocked = shapely.union_all([shape.geometry() for shape in obstacles])
    return shapely.distance(shapely.points(points), blocked)


def roomiest(obstacles, low, high, lines=25):
    """Largest distance to obstacles of any point of a cell, on a fine raster, m."""
    x, z = np.linspace(low[0], high[0], lines), np.linspace(low[1], high[1], lines)
    points = np.stack(np.meshgrid(x, z), axis=-1).reshape(-1, 2)
    return clearance(obstacles, points).max()


def edges_of(shapes):
    """All edges as lines."""
    lines = []
    for shape in shapes:
        outline = shape.outline()
        ends = range(len(outline)) if len(outline) > 2 else range(1)
        lines += [shapely.LineString([outline[k], outline[(k + 1) % len(outline)]]) for k in ends]
    return lines


def line_room(shapes, start, end):
    """Distance of a line from the nearest edge, and by how much an end is nearer already for that edge."""
    line = shapely.LineString([start, end])
    return [
        (line.distance(edge), min(shapely.Point(start).distance(edge), shapely.Point(end).distance(edge)))
        for edge in edges_of(shapes)
    ]


def covered_samples(shapes, low, cell_size):
    """Bits of the 5 x 5 samples of a cell that lie inside solids."""
    word = 0
    for i in range(5):
        for j in range(5):
            place = shapely.Point(low[0] + (j + 0.5) / 5 * cell_size, low[1] + (i + 0.5) / 5 * cell_size)
            if any(shape.geometry().contains(place) for shape in shapes):
                word |= 1 << (5 * i + j)
    return word


def nearest_cell(point, component, place, part, reach):
    """Distance to the nearest usable cell's place, infinite when none is within reach."""
    usable = (component >= 0) & ((part < 0) | (component == part))
    gap = np.where(usable, np.hypot(*(point - np.asarray(place)).T), np.inf)
    return gap.min() if gap.min() <= reach else np.inf
