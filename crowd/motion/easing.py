"""How a share rises from nothing to everything."""

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]


def minimum_jerk(progress: npt.ArrayLike) -> FloatArray:
    """Rise from 0 to 1 with the least jerk, at rest at both ends; clamped.

    **Source:** Flash and Hogan, "The coordination of arm movements", 1985, equation 4.
    """
    u = np.clip(np.asarray(progress, np.float64), 0.0, 1.0)
    return np.asarray(u**3 * (u * (6.0 * u - 15.0) + 10.0))
