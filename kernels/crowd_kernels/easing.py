"""How a share rises from nothing to everything."""

from crowd_kernels._jit import kernel


@kernel
def minimum_jerk(progress: float) -> float:
    """Rise from 0 to 1 with the least jerk, at rest at both ends; clamped.

    Parameters
    ----------
    progress : float
        Time over the time of the rise.

    Returns
    -------
    float
        0 before the rise, 1 after it; its first two derivatives are 0 at both ends.

    Notes
    -----
    **Source:** Flash and Hogan, "The coordination of arm movements", 1985, equation 4.
    """
    u = min(max(progress, 0.0), 1.0)
    return u * u * u * (u * (6.0 * u - 15.0) + 10.0)
