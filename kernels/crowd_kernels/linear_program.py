"""The velocity nearest to a preferred one that satisfies half-planes and a largest speed.

A line is four numbers: a point x, z and a unit direction x, z; velocities on its **left** (in the drawing of
`crowd_kernels.walls`) are admissible: ``direction x (velocity - point) >= 0``.
"""

import math
from typing import Any

from crowd_kernels._jit import inlined_kernel

PARALLEL = 1e-5
"""Sine of the angle below which two lines count as parallel."""


@inlined_kernel
def violation(lines: Any, index: int, vx: float, vz: float) -> float:
    """Measure how far a velocity lies on the wrong side of a line.

    Parameters
    ----------
    lines : (>= 4 (index + 1),) float64
        Lines.
    index : int
        Which line.
    vx, vz : float
        Velocity, m/s.

    Returns
    -------
    float
        m/s; negative or 0 when admissible.
    """
    first = 4 * index
    dx, dz = lines[first + 2], lines[first + 3]
    return float(dx * (lines[first + 1] - vz) - dz * (lines[first] - vx))


@inlined_kernel
def solve_on_line(lines: Any, index: int, speed: float, x: float, z: float, goes_far: bool) -> Any:
    """Find the best velocity on one line that satisfies the lines before it.

    Parameters
    ----------
    lines : (>= 4 (index + 1),) float64
        Lines.
    index : int
        The line to stay on.
    speed : float
        Largest speed, m/s.
    x, z : float
        Preferred velocity, m/s, or a unit direction.
    goes_far : bool
        Go as far as possible in the direction instead of near to the preferred velocity.

    Returns
    -------
    tuple
        Whether there is an admissible velocity, and its x and z, m/s.
    """
    px, pz, dx, dz = lines[4 * index], lines[4 * index + 1], lines[4 * index + 2], lines[4 * index + 3]
    middle = -(px * dx + pz * dz)
    squared = middle * middle + speed * speed - px * px - pz * pz
    if not squared >= 0.0:
        return False, 0.0, 0.0
    half = math.sqrt(squared)
    low, high = middle - half, middle + half
    for other in range(index):
        ox, oz = lines[4 * other + 2], lines[4 * other + 3]
        sine = dx * oz - dz * ox
        offset = ox * (pz - lines[4 * other + 1]) - oz * (px - lines[4 * other])
        if abs(sine) <= PARALLEL:
            if offset < 0.0:
                return False, 0.0, 0.0
            continue
        crossing = offset / sine
        if sine >= 0.0:
            high = min(high, crossing)
        else:
            low = max(low, crossing)
        if low > high:
            return False, 0.0, 0.0
    if goes_far:
        place = high if x * dx + z * dz > 0.0 else low
    else:
        place = min(max(dx * (x - px) + dz * (z - pz), low), high)
    return True, px + place * dx, pz + place * dz


@inlined_kernel
def solve_nearest(lines: Any, line_count: int, speed: float, x: float, z: float, goes_far: bool) -> Any:
    """Find the admissible velocity nearest to a preferred one, line by line.

    Parameters
    ----------
    lines : (>= 4 line_count,) float64
        Lines.
    line_count : int
    speed : float
        Largest speed, m/s, >= 0.
    x, z : float
        Preferred velocity, m/s, or a unit direction.
    goes_far : bool
        Go as far as possible in the direction instead of near to the preferred velocity.

    Returns
    -------
    tuple
        Number of lines satisfied, in order: `line_count` if all; velocity x and z, m/s.

    Notes
    -----
    **Source:** incremental linear programming in the plane (de Berg et al., Computational Geometry, chapter
    4), as used by van den Berg et al. 2011.
    **Differs from the source:** lines are taken in the given order, not at random, for equal results.
    """
    squared = x * x + z * z
    vx, vz = x, z
    if goes_far:
        vx, vz = speed * x, speed * z
    elif squared > speed * speed:
        scale = speed / math.sqrt(squared)
        vx, vz = scale * x, scale * z
    for index in range(line_count):
        if violation(lines, index, vx, vz) > 0.0:
            is_possible, new_x, new_z = solve_on_line(lines, index, speed, x, z, goes_far)
            if not is_possible:
                return index, vx, vz
            vx, vz = new_x, new_z
    return line_count, vx, vz


@inlined_kernel
def solve_least_violation(
    lines: Any,
    line_count: int,
    hard_count: int,
    begin: int,
    speed: float,
    vx: float,
    vz: float,
    projected: Any,
) -> Any:
    """Find the velocity that violates the soft lines least while the hard ones hold.

    Parameters
    ----------
    lines : (>= 4 line_count,) float64
        Lines, hard ones first.
    line_count : int
    hard_count : int
        Lines that are never violated.
    begin : int
        First line that `solve_nearest` could not satisfy.
    speed : float
        Largest speed, m/s.
    vx, vz : float
        Velocity that `solve_nearest` stopped at, m/s.
    projected : (>= 4 line_count,) float64
        Scratch.

    Returns
    -------
    tuple of float
        Velocity x and z, m/s.

    Notes
    -----
    **Source:** van den Berg et al. 2011, section 5.3: the three-dimensional program solved by its bisectors.
    """
    worst = 0.0
    for place in range(4 * hard_count):
        projected[place] = lines[place]
    for index in range(begin, line_count):
        if violation(lines, index, vx, vz) <= worst:
            continue
        px, pz, dx, dz = lines[4 * index], lines[4 * index + 1], lines[4 * index + 2], lines[4 * index + 3]
        count = hard_count
        for other in range(hard_count, index):
            qx, qz = lines[4 * other], lines[4 * other + 1]
            ox, oz = lines[4 * other + 2], lines[4 * other + 3]
            sine = dx * oz - dz * ox
            if abs(sine) <= PARALLEL:
                if dx * ox + dz * oz > 0.0:
                    continue
                mx, mz = 0.5 * (px + qx), 0.5 * (pz + qz)
            else:
                place_on_line = (ox * (pz - qz) - oz * (px - qx)) / sine
                mx, mz = px + place_on_line * dx, pz + place_on_line * dz
            bx, bz = ox - dx, oz - dz
            length = math.sqrt(bx * bx + bz * bz)
            projected[4 * count] = mx
            projected[4 * count + 1] = mz
            projected[4 * count + 2] = bx / length
            projected[4 * count + 3] = bz / length
            count += 1
        satisfied, new_x, new_z = solve_nearest(projected, count, speed, -dz, dx, True)
        if satisfied == count:
            vx, vz = new_x, new_z
        worst = violation(lines, index, vx, vz)
    return vx, vz
