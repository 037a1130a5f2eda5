"""Slow twin of the walkable grid: exact distances to the obstacles' shapes."""

import numpy as np
import shapely


def clearance(obstacles, points):
    """Distance of ground points (P, 2) to the nearest obstacle, m."""
    blocked = shapely.union_all([shape.geometry() for shape in obstacles])
    return shapely.distance(shapely.points(points), blocked)


def roomiest(obstacles, low, high, lines=25):
    """Largest distance to obstacles of any point of a cell, on a fine raster, m."""
    x, z = np.linspace(low[0], high[0], lines), np.linspace(low[1], high[1], lines)
    points = np.stack(np.meshgrid(x, z), axis=-1).reshape(-1, 2)
    return clearance(obstacles, points).max()
