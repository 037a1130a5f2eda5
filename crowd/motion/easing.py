"""How a share rises from nothing to everything."""

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]


def smoother(progress: npt.ArrayLike) -> FloatArray:
    """Rise from 0 to 1 with zero velocity and acceleration at both ends; clamped.

    **Source:** Perlin, "Improving noise", 2002, section 3.
    """
    u = np.clip(np.asarray(progress, np.float64), 0.0, 1.0)
    return np.asarray(u**3 * (u * (6.0 * u - 15.0) + 10.0))
