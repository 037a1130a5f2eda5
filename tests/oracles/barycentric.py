"""Slow twins of `crowd_kernels.barycentric` and `crowd_kernels.triangle`.

Dense linear algebra over all tetrahedra inside, all corners, edges and triangles of examples outside.
"""

from itertools import combinations

import numpy as np


def simplex_weights(corners, point):
    """Barycentric weights of a point in one tetrahedron (4, 3), by solving the 4 x 4 system."""
    system = np.vstack([np.asarray(corners).T, np.ones(4)])
    return np.linalg.solve(system, np.append(point, 1.0))


def best_simplex(points, simplices, point):
    """Weights over all points, from the tetrahedron with the largest least weight; and that weight."""
    best, margin = None, -np.inf
    for cell in simplices:
        weights = simplex_weights(points[cell], point)
        if weights.min() > margin:
            best, margin = np.zeros(len(points)), weights.min()
            best[cell] = weights
    return best, margin


def nearest_in_hull(points, point):
    """Weights over `points` of the nearest point of their hull, for a point outside.

    That point lies on a corner, an edge or a triangle: project on all of them, keep what falls within.
    """
    best, square = None, np.inf
    for size in (1, 2, 3):
        for chosen in combinations(range(len(points)), size):
            corners = points[list(chosen)]
            edges = (corners[1:] - corners[0]).T
            share = np.linalg.lstsq(edges, point - corners[0], rcond=None)[0] if size > 1 else np.zeros(0)
            weights = np.append(1 - share.sum(), share)
            miss = ((weights @ corners - point) ** 2).sum()
            if weights.min() >= -1e-12 and miss < square:
                best, square = np.zeros(len(points)), miss
                best[list(chosen)] = weights
    return best


def locate(space, parameter, tolerance=1e-7):
    """Barycentric weights over all examples, realised parameters and whether the point is inside."""
    points, simplices = space.example, space.simplex
    is_number = not np.isnan(parameter).any()
    point = np.clip(parameter / space.axis_range, -1e3, 1e3) if is_number else np.zeros(3)
    weights, margin = best_simplex(points, simplices, point)
    is_inside = margin >= -tolerance
    if not is_inside:
        hull = space.hull_face
        on_hull = np.unique(hull)
        beyond = (space.hull_plane[:, :3] @ point + space.hull_plane[:, 3]).max() > 0
        if beyond:
            point = nearest_in_hull(points[on_hull], point) @ points[on_hull]
        weights, margin = best_simplex(points, simplices, point)
        if margin < -tolerance:
            low, high = 0.0, 1.0
            for _ in range(50):
                middle = 0.5 * (low + high)
                _, margin = best_simplex(points, simplices, space.centre + middle * (point - space.centre))
                low, high = (middle, high) if margin >= 0 else (low, middle)
            weights, _ = best_simplex(points, simplices, space.centre + low * (point - space.centre))
    weights = np.maximum(weights, 0)
    weights /= weights.sum()
    return weights, weights @ points * space.axis_range, is_inside and is_number


def calibrated(barycentric, cycle_duration):
    """Pose weights of barycentric weights."""
    shares = np.asarray(barycentric) / np.asarray(cycle_duration)
    return shares / shares.sum()
