"""Slow twins of `crowd_kernels.barycentric`: dense linear algebra over all tetrahedra, quadratic programs outside."""

import numpy as np
from scipy.optimize import minimize


def simplex_weights(corners, point):
    """Barycentric weights of a point in one tetrahedron (4, 3), by solving the 4 x 4 system."""
    system = np.vstack([np.asarray(corners).T, np.ones(4)])
    return np.linalg.solve(system, np.append(point, 1.0))


def contains(points, simplices, point, tolerance=1e-9):
    return any(simplex_weights(points[cell], point).min() >= -tolerance for cell in simplices)


def nearest_in_hull(points, point):
    """Nearest point of the convex hull of `points`, by a constrained least squares over all weights."""
    count = len(points)
    result = minimize(
        lambda w: ((w @ points - point) ** 2).sum(),
        np.full(count, 1 / count),
        jac=lambda w: 2 * points @ (w @ points - point),
        bounds=[(0, 1)] * count,
        constraints={"type": "eq", "fun": lambda w: w.sum() - 1, "jac": lambda w: np.ones(count)},
        options={"maxiter": 500, "ftol": 1e-14},
    )
    return result.x @ points


def calibrated(barycentric, cycle_duration):
    """Pose weights of barycentric weights."""
    shares = np.asarray(barycentric) / np.asarray(cycle_duration)
    return shares / shares.sum()
