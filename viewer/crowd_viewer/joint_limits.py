"""Arcs at the joints of one person: how far each may turn, and how far it has turned."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from crowd.motion.rotation import about, conjugate, multiply, rotate, to_vector
from crowd.motion.skeleton import Skeleton
from crowd_viewer.lines import Colour

FloatArray = npt.NDArray[np.float64]

STEPS = 12
LARGEST_ARC, SMALLEST_BONE = 0.13, 0.05
"""Radius of the arcs, m; bones shorter than this, as those of fingers, get none."""
NEAR = 0.1
"""Share of the range within which a limit counts as near."""
FREE, CLOSE, BEYOND = (0.4, 1.0, 0.5, 0.9), (1.0, 0.8, 0.2, 1.0), (1.0, 0.2, 0.2, 1.0)


def limit_arcs(
    skeleton: Skeleton, position: FloatArray, rotation: FloatArray
) -> Iterator[tuple[FloatArray, FloatArray, Colour]]:
    """Go through the axes about which joints may turn.

    Parameters
    ----------
    skeleton : Skeleton
    position : (J, 3) float64
        Joints of one person in world space, m.
    rotation : (J, 4) float64
        In world space.

    Yields
    ------
    start, end : (S, 3) float64
        Segments of the arc, and of the tick at the present angle, m.
    colour : tuple of float
        Green; yellow near a limit, red beyond it.
    """
    for joint in range(1, skeleton.joint_count):
        children = np.flatnonzero(skeleton.parent == joint)
        if children.size == 0:
            continue
        bone = skeleton.offset[children[0]]
        length = float(np.linalg.norm(bone))
        if length < SMALLEST_BONE:
            continue
        parent = rotation[skeleton.parent[joint]]
        turn = to_vector(multiply(conjugate(parent), rotation[joint]))
        radius = min(0.45 * length, LARGEST_ARC)
        for axis in range(3):
            low, high = float(skeleton.limit_lower[joint, axis]), float(skeleton.limit_upper[joint, axis])
            # A bone that points along the axis only twists about it.
            arm = bone / length
            unit = np.eye(3)[axis]
            arm = arm - unit * float(arm @ unit)
            if high - low < 0.02 or float(np.linalg.norm(arm)) < 0.3:
                continue
            angles = np.append(np.linspace(low, high, STEPS + 1), turn[axis])
            points = position[joint] + radius * rotate(parent, rotate(about(axis, angles), arm))
            start = np.concatenate([points[:STEPS], position[[joint]]])
            end = np.concatenate([points[1 : STEPS + 1], points[-1:]])
            yield start, end, _colour(float(turn[axis]), low, high)


def _colour(angle: float, low: float, high: float) -> Colour:
    margin = NEAR * (high - low)
    if not low - 1e-3 <= angle <= high + 1e-3:
        return BEYOND
    return FREE if low + margin <= angle <= high - margin else CLOSE
