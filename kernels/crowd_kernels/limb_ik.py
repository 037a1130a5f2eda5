"""Two-bone inverse kinematics in closed form."""

import math
from typing import Any

from crowd_kernels._jit import kernel, parallel_kernel, prange
from crowd_kernels.quaternion import Quaternion, between, multiply, normalized, rotate
from crowd_kernels.vector import Vector, add, cross, dot, norm, scaled, subtract

CHUNKS = 32
REACHED = 0
TOO_FAR = 1
TOO_CLOSE = 2
DEGENERATE = 3
TINY = 1e-12
ALONG = 1e-6
"""Sine of the angle to a bone up to which a hinge lies along it."""


@kernel
def bend_rotations(
    root: Vector, middle: Vector, end: Vector, target: Vector, hinge: Vector, stretch: float
) -> tuple[Quaternion, Quaternion, int]:
    """Find how to turn both bones of a limb so that its end meets a target, with the bend in its own plane.

    Parameters
    ----------
    root, middle, end : tuple of float
        Joint positions now (hip, knee, ankle), m.
    target : tuple of float
        Where the end should be, m.
    hinge : tuple of float
        Axis about which the limb bends when it is now straight; any length. What of it lies across the limb
        counts, and where nothing does, the limb bends anywhere.
    stretch : float
        Largest share of the limb's length that may be used, (0, 1].

    Returns
    -------
    first : tuple of float
        Rotation of both bones about the root, applied last.
    second : tuple of float
        Rotation of the lower bone about the middle joint, applied first.
    status : int
        `REACHED`, `TOO_FAR`, `TOO_CLOSE` (the nearest reachable point is met) or `DEGENERATE` (a bone has no
        length, or the target is at the root; nothing turns).

    Notes
    -----
    **Source:** law of cosines; Tolani, Goswami, Badler, "Real-time inverse kinematics techniques for
    anthropomorphic limbs", 2000, section 3.
    **Differs from the source:** the swivel angle is that of the given pose, kept by the shortest rotation.
    """
    upper = subtract(middle, root)
    lower = subtract(end, middle)
    upper_length = norm(upper)
    lower_length = norm(lower)
    way = subtract(target, root)
    distance = norm(way)
    if not (upper_length > TINY and lower_length > TINY and distance > TINY):
        return (1.0, 0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0), DEGENERATE
    status = REACHED
    longest = stretch * (upper_length + lower_length)
    shortest = abs(upper_length - lower_length)
    if distance > longest:
        distance = longest
        status = TOO_FAR
    elif distance < shortest:
        distance = shortest
        status = TOO_CLOSE
    axis = cross(upper, lower)
    sine = norm(axis)
    product = upper_length * lower_length
    now_cosine, now_sine = half_angle(dot(upper, lower) / product, sine / product)
    if not sine > 1e-6 * product:
        axis = _across(upper, hinge)
        sine = norm(axis)
    cosine = (distance * distance - upper_length * upper_length - lower_length * lower_length) / (
        2.0 * product
    )
    cosine = min(max(cosine, -1.0), 1.0)
    then_cosine, then_sine = math.sqrt(0.5 * (1.0 + cosine)), math.sqrt(0.5 * (1.0 - cosine))
    # The bone turns by the difference of the two angles, of which a rotation takes one half.
    share = (then_sine * now_cosine - then_cosine * now_sine) / sine
    second = (
        then_cosine * now_cosine + then_sine * now_sine,
        axis[0] * share,
        axis[1] * share,
        axis[2] * share,
    )
    first = between(add(upper, rotate(second, lower)), way)
    return first, second, status


@kernel
def half_angle(cosine: float, sine: float) -> tuple[float, float]:
    """Find cosine and sine of half an angle from 0 to pi, exact at both ends."""
    if cosine >= 0.0:
        half = math.sqrt(0.5 * (1.0 + cosine))
        return half, 0.5 * sine / half
    half = math.sqrt(0.5 * (1.0 - cosine))
    return 0.5 * sine / half, half


@kernel
def _across(bone: Vector, hinge: Vector) -> Vector:
    """Find the part of a hinge that stands across a bone, or some vector that does."""
    across = subtract(hinge, scaled(bone, dot(hinge, bone) / dot(bone, bone)))
    if norm(across) > ALONG * norm(hinge):
        return across
    if abs(bone[0]) > abs(bone[2]):
        return -bone[1], bone[0], 0.0
    return 0.0, -bone[2], bone[1]


@parallel_kernel
def crowd_two_bone_ik(
    root: Any, middle: Any, end: Any, target: Any, pole: Any, out_middle: Any, out_end: Any, out_status: Any
) -> None:
    """Bend many limbs to their targets, with the middle joint towards a pole.

    Parameters
    ----------
    root, middle, end : (N, 3) float64
        Joint positions now, m.
    target : (N, 3) float64
        Where the ends should be, m.
    pole : (N, 3) float64
        Direction in which the middle joint should stand out from the line between root and target.
    out_middle, out_end : (N, 3) float64
        New positions, m.
    out_status : (N,) int64
        See `bend_rotations`.

    Notes
    -----
    **Source:** see `bend_rotations`.
    """
    count = root.shape[0]
    for k in prange(CHUNKS):
        chunk = (k * 37) % CHUNKS
        for item in range(chunk * count // CHUNKS, (chunk + 1) * count // CHUNKS):
            a = (root[item, 0], root[item, 1], root[item, 2])
            b = (middle[item, 0], middle[item, 1], middle[item, 2])
            c = (end[item, 0], end[item, 1], end[item, 2])
            goal = (target[item, 0], target[item, 1], target[item, 2])
            towards = (pole[item, 0], pole[item, 1], pole[item, 2])
            way = subtract(goal, a)
            first, second, status = bend_rotations(a, b, c, goal, cross(towards, way), 1.0)
            upper = rotate(first, subtract(b, a))
            lower = rotate(first, rotate(second, subtract(c, b)))
            if status != DEGENERATE:
                # Turn the bend about the line to the target until it stands towards the pole.
                square = dot(way, way)
                bend = subtract(upper, scaled(way, dot(upper, way) / square))
                wanted = subtract(towards, scaled(way, dot(towards, way) / square))
                if norm(bend) > 1e-9 and norm(wanted) > 1e-9:
                    swivel = between(bend, wanted)
                    if dot(bend, wanted) < -0.999999 * norm(bend) * norm(wanted):
                        swivel = normalized((0.0, way[0], way[1], way[2]))
                    upper = rotate(swivel, upper)
                    lower = rotate(swivel, lower)
            for axis in range(3):
                out_middle[item, axis] = a[axis] + upper[axis]
                out_end[item, axis] = a[axis] + upper[axis] + lower[axis]
            out_status[item] = status


@kernel
def turned(first: Quaternion, second: Quaternion, rotation: Quaternion) -> Quaternion:
    """Apply `second`, then `first`, to a rotation."""
    return normalized(multiply(first, multiply(second, rotation)))
