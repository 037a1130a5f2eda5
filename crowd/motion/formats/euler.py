"""Axis angles of many joints and frames into quaternions."""

import numpy as np

from crowd.motion.source import FloatArray

AXES = "XYZ"


def compose(axes: tuple[int, ...], angles: FloatArray) -> FloatArray:
    """Compose rotations about fixed axes; the first listed acts last.

    Parameters
    ----------
    axes : tuple of int
        0 to 2 for x to z, one for each angle.
    angles : (..., len(axes)) float64
        rad.

    Returns
    -------
    (..., 4) float64
        Unit quaternions (w, x, y, z).
    """
    half = 0.5 * angles
    cosine, sine = np.cos(half), np.sin(half)
    parts = [np.zeros(angles.shape[:-1]) for _ in range(4)]
    parts[0] += 1.0
    for number, axis in enumerate(axes):
        c, s = cosine[..., number], sine[..., number]
        w, i, j, k = parts[0], parts[1 + axis], parts[1 + (axis + 1) % 3], parts[1 + (axis + 2) % 3]
        parts[0], parts[1 + axis] = c * w - s * i, c * i + s * w
        parts[1 + (axis + 1) % 3], parts[1 + (axis + 2) % 3] = c * j + s * k, c * k - s * j
    return np.stack(parts, axis=-1)
