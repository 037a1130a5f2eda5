"""Walls by brute force: distances to points along them, and what a moving disc would touch."""

import numpy as np


def distance_to_segments(points, starts, ends):
    """Distance from each point to the nearest of some segments, (P,) m."""
    points = np.asarray(points, float)[:, None, :]
    starts, ends = np.asarray(starts, float)[None], np.asarray(ends, float)[None]
    step = ends - starts
    share = np.clip(((points - starts) * step).sum(-1) / (step * step).sum(-1), 0.0, 1.0)
    return np.linalg.norm(points - starts - share[..., None] * step, axis=-1).min(axis=1)


def hits(position, velocity, radius, horizon, starts, ends, samples=400):
    """Tell whether a disc that keeps its velocity touches a segment within the horizon."""
    times = np.linspace(0.0, horizon, samples)[:, None]
    path = np.asarray(position) + times * np.asarray(velocity)
    return bool((distance_to_segments(path, starts, ends) < radius).any())


def crosses(before, after, starts, ends):
    """Tell whether a straight motion passes through a segment."""
    before, after = np.asarray(before, float), np.asarray(after, float)
    move = after - before
    for start, end in zip(np.asarray(starts), np.asarray(ends), strict=True):
        wall = end - start
        sine = move[0] * wall[1] - move[1] * wall[0]
        if abs(sine) < 1e-15:
            continue
        offset = start - before
        along_move = (offset[0] * wall[1] - offset[1] * wall[0]) / sine
        along_wall = (offset[0] * move[1] - offset[1] * move[0]) / sine
        if 0.0 <= along_move <= 1.0 and 0.0 <= along_wall <= 1.0:
            return True
    return False


def is_inside(point, outline):
    """Tell whether a point lies inside a closed outline, by counting crossings of a ray."""
    inside = False
    for (ax, az), (bx, bz) in zip(outline, np.roll(outline, -1, axis=0), strict=True):
        if (az > point[1]) != (bz > point[1]) and point[0] < (bx - ax) * (point[1] - az) / (bz - az) + ax:
            inside = not inside
    return inside
