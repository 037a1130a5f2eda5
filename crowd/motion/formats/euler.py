"""Rotations about coordinate axes, as motion files state them."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from crowd.motion.rotation import about, multiply

FloatArray = npt.NDArray[np.float64]


def from_euler(angles: FloatArray, axes: str) -> FloatArray:
    """Compose rotations (..., 4) from angles (..., n) in rad; the first listed axis is the outermost."""
    result = about("XYZ".index(axes[0]), angles[..., 0])
    for place, axis in enumerate(axes[1:], 1):
        result = multiply(result, about("XYZ".index(axis), angles[..., place]))
    return result
