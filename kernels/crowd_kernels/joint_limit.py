"""Limits of ball joints: an ellipse for the direction of the bone, and a range for the turn about it.

A local rotation q is looked at in the frames of its limit: l = conj(P) q C, with P in the parent, which
holds the centre of the range, and C in the joint. The z axis of C lies along the bone. l is split into a
twist t about z and the swing s that follows it, l = s t. No angle is ever computed: swings are measured by
the sine of half their angle, twists by the tangent of half theirs.

Axes that are not free (the sideways swing of an elbow, the twist of a wrist) keep the value that they have in
the reference pose. A reference pose outside a limit widens it for itself, so that nothing jumps.
"""

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from crowd_kernels._jit import inlined_kernel
from crowd_kernels.quaternion import Quaternion, conjugate, multiply
from crowd_kernels.vector import Vector

ONE: Any = np.float32(1.0)
ZERO: Any = np.float32(0.0)
TINY: Any = np.float32(1e-12)
LEAST_COSINE: Any = np.float32(1e-6)
LEAST_SWING_COSINE: Any = np.float32(0.02)


class LimitArrays(NamedTuple):
    """Limits of K joints."""

    parent_frame: npt.NDArray[np.float32]
    """(K, 4) Frame of the limit in the parent joint, unit quaternions (P above)."""
    joint_frame: npt.NDArray[np.float32]
    """(K, 4) Frame of the limit in the joint, unit quaternions (C above): its z axis lies along the bone."""
    inverse_swing: npt.NDArray[np.float32]
    """(K, 2) 1 / sin(e / 2) of the ellipse's semi-axes e about x and y; 0 for axes that are not free."""
    twist: npt.NDArray[np.float32]
    """(K, 2) Tangents of half the least and half the largest twist."""
    is_free: npt.NDArray[np.float32]
    """(K, 3) 1 where the joint can swing about x, about y, and twist; 0 where it keeps its reference."""


@inlined_kernel
def split(rotation: Quaternion) -> tuple[Any, Any, Any]:
    """Find swing (x and y components) and twist (tangent of half the angle) of a rotation in limit frames."""
    sign = ONE if rotation[0] >= ZERO else -ONE
    norm = np.sqrt(rotation[0] * rotation[0] + rotation[3] * rotation[3] + TINY)
    cosine = sign * rotation[0] / norm
    sine = sign * rotation[3] / norm
    x = sign * rotation[1]
    y = sign * rotation[2]
    return x * cosine - y * sine, y * cosine + x * sine, sine / max(cosine, LEAST_COSINE)


@inlined_kernel
def join(x: Any, y: Any, twist: Any) -> Quaternion:
    """Build the rotation in limit frames, the inverse of `split`."""
    w = np.sqrt(max(ONE - x * x - y * y, ZERO))
    cosine = ONE / np.sqrt(ONE + twist * twist)
    sine = twist * cosine
    return w * cosine, x * cosine + y * sine, y * cosine - x * sine, w * sine


@inlined_kernel
def bone_direction(x: Any, y: Any) -> Vector:
    """Find the direction of the bone in the parent's limit frame for a swing."""
    square = x * x + y * y
    w = np.sqrt(max(ONE - square, ZERO))
    return (y + y) * w, -(x + x) * w, ONE - square - square


@inlined_kernel
def swing_normal(x: Any, y: Any, along_x: Any, along_y: Any) -> Vector:
    """Find the angular velocity that changes a swing fastest along a direction of its plane.

    Parameters
    ----------
    x, y : float32
        The swing.
    along_x, along_y : float32
        The direction in which its components change.

    Returns
    -------
    tuple of float32
        Any length, in the parent's limit frame. Rotations across it leave the component unchanged.

    Notes
    -----
    **Source:** derivative of s = (-B_y, B_x) / sqrt(2 + 2 B_z) for the bone direction B, whose velocity is
    the cross product of the angular velocity and B.
    """
    bx, by, bz = bone_direction(x, y)
    w = max(np.sqrt(max(ONE - x * x - y * y, ZERO)), LEAST_SWING_COSINE)
    down = (along_x * x + along_y * y) / (w + w)
    # u = (along_y, -along_x, -down); the normal is B x u.
    return along_x * bz - by * down, along_y * bz + bx * down, -along_x * bx - along_y * by


@inlined_kernel
def twist_normal(x: Any, y: Any) -> Vector:
    """Find the angular velocity that changes the twist fastest: along the sum of both z axes."""
    bx, by, bz = bone_direction(x, y)
    return bx, by, bz + ONE


@inlined_kernel
def into_limit(parent_frame: Quaternion, rotation: Quaternion, joint_frame: Quaternion) -> Quaternion:
    """Take a local rotation into limit frames."""
    return multiply(conjugate(parent_frame), multiply(rotation, joint_frame))


@inlined_kernel
def out_of_limit(parent_frame: Quaternion, rotation: Quaternion, joint_frame: Quaternion) -> Quaternion:
    """Take a rotation in limit frames back to the local rotation."""
    return multiply(parent_frame, multiply(rotation, conjugate(joint_frame)))
