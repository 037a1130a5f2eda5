"""Sine, cosine and arc tangent as float32 polynomials, for loops over lanes.

There is no vector maths library behind these loops: a call of the C library would keep them scalar. All
numbers are float32; a constant of another type would lift the loop to float64.
"""

from typing import Any

import numpy as np

from crowd_kernels._jit import inlined_kernel

ZERO = np.float32(0.0)
HALF = np.float32(0.5)
ONE = np.float32(1.0)
TWO = np.float32(2.0)
PI = np.float32(np.pi)
HALF_PI = np.float32(np.pi / 2.0)
INVERSE_PI = np.float32(1.0 / np.pi)
PI_HIGH, PI_LOW = np.float32(3.140625), np.float32(9.67653589793e-4)
"""Pi in two parts, so that whole turns are taken off exactly."""
SMALLEST = np.float32(1e-30)
S1, S2, S3, S4 = (np.float32(c) for c in (-0.16666657, 8.3330255e-3, -1.9809573e-4, 2.6052e-6))
C2, C3, C4, C5 = (np.float32(c) for c in (4.1666638e-2, -1.3888378e-3, 2.4760495e-5, -2.6051615e-7))
T0, T1, T2, T3 = (np.float32(c) for c in (0.999999911, -0.333320938, 0.199713781, -0.140294341))
T4, T5, T6, T7 = (np.float32(c) for c in (0.0994279487, -0.0599051912, 0.0245574457, -0.00478054197))


@inlined_kernel
def acute_sine_cosine(x: Any) -> tuple[Any, Any]:
    """Find sine and cosine of an acute angle.

    Parameters
    ----------
    x : float32
        rad, -pi/2 to pi/2.

    Returns
    -------
    tuple of float32
        Both within 5e-7.

    Notes
    -----
    **Source:** minimax polynomials.
    """
    s = x * x
    sine = x * (ONE + s * (S1 + s * (S2 + s * (S3 + s * S4))))
    cosine = ONE + s * (-HALF + s * (C2 + s * (C3 + s * (C4 + s * C5))))
    return sine, cosine


@inlined_kernel
def sine_cosine(x: Any) -> tuple[Any, Any]:
    """Find sine and cosine.

    Parameters
    ----------
    x : float32
        rad, -100 to 100.

    Returns
    -------
    tuple of float32
        Both within 5e-7.

    Notes
    -----
    **Source:** `acute_sine_cosine` after taking off whole half turns (Cody and Waite, 1980).
    """
    turns = np.floor(x * INVERSE_PI + HALF)
    sign = ONE - TWO * (turns - TWO * np.floor(turns * HALF))
    sine, cosine = acute_sine_cosine((x - turns * PI_HIGH) - turns * PI_LOW)
    return sign * sine, sign * cosine


@inlined_kernel
def arc_tangent(y: Any, x: Any) -> Any:
    """Find the angle of the direction (x, y).

    Parameters
    ----------
    y, x : float32
        Of any size.

    Returns
    -------
    float32
        rad in [-pi, pi] within 4e-7; 0 where both are 0.

    Notes
    -----
    **Source:** minimax polynomial on the first octant, then reflections.
    """
    across, along = abs(y), abs(x)
    t = min(across, along) / max(max(across, along), SMALLEST)
    s = t * t
    angle = t * (T0 + s * (T1 + s * (T2 + s * (T3 + s * (T4 + s * (T5 + s * (T6 + s * T7)))))))
    angle = HALF_PI - angle if across > along else angle
    angle = PI - angle if x < ZERO else angle
    return -angle if y < ZERO else angle
