"""Signed distances of simple shapes, and how shapes are joined and cut: the clay that bodies are made of.

Points are (P, 3), distances (P,), both in metres; distances are negative inside. They are exact for round
cones and right near the surface for the others, which is what meshing needs.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import numpy.typing as npt
from scipy.interpolate import PchipInterpolator

Points = npt.NDArray[np.float32]
Values = npt.NDArray[np.float32]
Field = Callable[[Points], Values]
Triple = Sequence[float]


def round_cone(
    points: Points,
    start: Triple,
    end: Triple,
    start_radius: float,
    end_radius: float,
    stretch: Triple = (1, 1, 1),
) -> Values:
    """A line whose radius changes from one end to the other, stretched about its start."""
    factor = np.asarray(stretch, np.float32)
    away = (points - np.asarray(start, np.float32)) / factor
    along = (np.asarray(end, np.float32) - np.asarray(start, np.float32)) / factor
    share = np.clip(away @ along / (along @ along), 0.0, 1.0)
    distance = np.linalg.norm(away - share[:, None] * along, axis=1)
    grown: Values = (distance - (start_radius + share * (end_radius - start_radius))) * factor.min()
    return grown


def ellipsoid(points: Points, centre: Triple, radius: Triple) -> Values:
    """An ellipsoid along the axes."""
    away = points - np.asarray(centre, np.float32)
    r = np.asarray(radius, np.float32)
    near = np.linalg.norm(away / r, axis=1)
    slope = np.linalg.norm(away / (r * r), axis=1)
    value: Values = near * (near - 1.0) / np.maximum(slope, 1e-6)
    return value


def rounded_box(points: Points, centre: Triple, half: Triple, radius: float) -> Values:
    """A box along the axes with round edges; `half` includes them."""
    away = np.abs(points - np.asarray(centre, np.float32)) - (np.asarray(half, np.float32) - radius)
    outside = np.linalg.norm(np.maximum(away, 0.0), axis=1)
    value: Values = outside + np.minimum(away.max(axis=1), 0.0) - radius
    return value


def loft(points: Points, rings: npt.NDArray[np.float64], corner: float = 2.0) -> Values:
    """Level rings joined by a smooth curve.

    Parameters
    ----------
    points : (P, 3) float32
    rings : (K, 4) float64
        Height, half width, half depth, and place of the middle along z; heights ascend.
    corner : float
        2 for ellipses, more for rings with flatter sides.
    """
    low, high = rings[0, 0], rings[-1, 0]
    height = np.clip(points[:, 1], low, high)
    width, depth, middle = PchipInterpolator(rings[:, 0], rings[:, 1:])(height).T
    across, ahead = np.abs(points[:, 0]) / width, np.abs(points[:, 2] - middle) / depth
    ring = ((across**corner + ahead**corner) ** (1.0 / corner) - 1.0) * np.minimum(width, depth)
    beyond = np.maximum(points[:, 1] - high, low - points[:, 1])
    return np.asarray(np.where(beyond > 0.0, np.hypot(np.maximum(ring, 0.0), beyond), ring), np.float32)


def join(first: Values, second: Values, radius: float) -> Values:
    """Both, with a fillet: the polynomial smooth minimum."""
    if radius <= 0.0:
        return np.minimum(first, second)
    near = np.maximum(radius - np.abs(first - second), 0.0) / radius
    value: Values = np.minimum(first, second) - near * near * (0.25 * radius)
    return value


def cut(first: Values, second: Values, radius: float) -> Values:
    """What is in both, with a rounded edge."""
    return -join(-first, -second, radius)


def joined(parts: Sequence[tuple[Values, float]]) -> Values:
    """Parts joined one after the other, each with its own fillet."""
    value = parts[0][0]
    for part, radius in parts[1:]:
        value = join(value, part, radius)
    return value
