"""Motions of least jerk: how a share rises from nothing to everything, and how coordinates come to rest."""

from crowd_kernels._jit import inlined_kernel, kernel
from crowd_kernels.vector import Vector, add, scaled


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


@inlined_kernel
def settle_shares(time: float, dt: float) -> tuple[Vector, Vector, Vector]:
    """Find the linear map of `settle`.

    Parameters
    ----------
    time, dt : float
        Until rest, and the step, s, > 0.

    Returns
    -------
    tuple of tuple of float
        What place, velocity and acceleration each add to the three after `dt`.
    """
    if time <= dt:
        return (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    u = dt / time
    return (
        (
            1.0 - u * u * u * (10.0 - u * (15.0 - 6.0 * u)),
            -30.0 * u * u * (1.0 - u) * (1.0 - u) / time,
            -60.0 * u * (1.0 - u) * (1.0 - 2.0 * u) / (time * time),
        ),
        (
            dt * (1.0 - u * u * (6.0 - u * (8.0 - 3.0 * u))),
            1.0 - u * u * (18.0 - u * (32.0 - 15.0 * u)),
            -12.0 * u * (3.0 - u * (8.0 - 5.0 * u)) / time,
        ),
        (
            0.5 * dt * dt * (1.0 - u) * (1.0 - u) * (1.0 - u),
            dt * (1.0 - u * (4.5 - u * (6.0 - 2.5 * u))),
            1.0 - u * (9.0 - u * (18.0 - 10.0 * u)),
        ),
    )


@kernel
def settle(
    place: float, velocity: float, acceleration: float, time: float, dt: float
) -> tuple[float, float, float]:
    """Advance a coordinate that comes to rest at 0 after a time, with least jerk.

    Parameters
    ----------
    place, velocity, acceleration : float
        Now, in any unit and its rates, 1/s and 1/s^2.
    time : float
        Until it rests, s, > 0.
    dt : float
        s.

    Returns
    -------
    tuple of float
        The three after `dt`.

    Notes
    -----
    **Source:** Flash, Hogan, "The coordination of arm movements", 1985: minimum-jerk motion is a quintic;
    planned anew from the present state in each step.
    """
    own, per_rate, per_bend = settle_shares(time, dt)
    return (
        own[0] * place + per_rate[0] * velocity + per_bend[0] * acceleration,
        own[1] * place + per_rate[1] * velocity + per_bend[1] * acceleration,
        own[2] * place + per_rate[2] * velocity + per_bend[2] * acceleration,
    )


@inlined_kernel
def settle_vector(
    place: Vector, velocity: Vector, acceleration: Vector, time: float, dt: float
) -> tuple[Vector, Vector, Vector]:
    """Advance a vector that comes to rest at 0 after a time, with least jerk: `settle` of each component."""
    own, per_rate, per_bend = settle_shares(time, dt)
    return (
        add(scaled(place, own[0]), add(scaled(velocity, per_rate[0]), scaled(acceleration, per_bend[0]))),
        add(scaled(place, own[1]), add(scaled(velocity, per_rate[1]), scaled(acceleration, per_bend[1]))),
        add(scaled(place, own[2]), add(scaled(velocity, per_rate[2]), scaled(acceleration, per_bend[2]))),
    )


@kernel
def hump(progress: float) -> tuple[float, float, float]:
    """Rise from 0 to 1 in the middle and back, smooth at both ends: value, slope, bend over progress."""
    q = min(max(progress, 0.0), 1.0)
    r = q * (1.0 - q)
    d = 1.0 - 2.0 * q
    return 64.0 * r * r * r, 192.0 * r * r * d, 384.0 * r * (d * d - r)
