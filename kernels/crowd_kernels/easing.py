"""How a share rises from nothing to everything."""

from crowd_kernels._jit import kernel


@kernel
def minimum_jerk(progress: float) -> float:
    """Rise from 0 to 1 with the least jerk, at rest at both ends.

    Parameters
    ----------
    progress : float
        Time over the time of the rise, 0 to 1.

    Returns
    -------
    float
        0 to 1; its first two derivatives are 0 at both ends.

    Notes
    -----
    **Source:** Flash and Hogan, "The coordination of arm movements", 1985, equation 4.
    """
    return progress * progress * progress * (progress * (6.0 * progress - 15.0) + 10.0)
