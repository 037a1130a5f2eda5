"""Row leaves of inverse kinematics for one joint: where it is, where it drifts, how far it turns."""

from typing import Any

import numpy as np

from crowd_kernels._jit import inlined_kernel
from crowd_kernels.ik_layout import (
    DRIFT,
    FRAME,
    HALF,
    IS_FIXED,
    MOBILITY,
    NEXT,
    ONE,
    PLACE,
    REFERENCE,
    ROTATION,
    STEP,
    TINY,
    TWO,
    ZERO,
    put_quaternion,
    put_vector,
    quaternion_at,
    unit_quaternion,
    vector_at,
)
from crowd_kernels.lanes import LANES
from crowd_kernels.quaternion import Quaternion, conjugate, multiply, rotate
from crowd_kernels.vector import Vector


@inlined_kernel
def moved(row: Any, lane: int, torque: Vector) -> Vector:
    """Find the rotation that a torque gives a joint."""
    first = MOBILITY + lane
    xx, xy, xz = row[first], row[first + LANES], row[first + 2 * LANES]
    yy, yz, zz = row[first + 3 * LANES], row[first + 4 * LANES], row[first + 5 * LANES]
    return (
        xx * torque[0] + xy * torque[1] + xz * torque[2],
        xy * torque[0] + yy * torque[1] + yz * torque[2],
        xz * torque[0] + yz * torque[1] + zz * torque[2],
    )


@inlined_kernel
def lost_mobility_at(joint: Any, weight: Any, lane: int) -> tuple[Vector, Vector, Vector]:
    """Find the rows of what a joint's mobility lacks of its weight in every direction."""
    first = MOBILITY + lane
    xx, xy, xz = weight - joint[first], -joint[first + LANES], -joint[first + 2 * LANES]
    yy, yz, zz = (
        weight - joint[first + 3 * LANES],
        -joint[first + 4 * LANES],
        weight - joint[first + 5 * LANES],
    )
    return (xx, xy, xz), (xy, yy, yz), (xz, yz, zz)


@inlined_kernel
def forward_row(above: Any, scale: Any, x: Any, y: Any, z: Any, row: Any) -> None:
    """Let a joint's next rotation be its rotation, and place it below its parent.

    Parameters
    ----------
    above : (JOINT_ROW,) float32
        The parent.
    scale : (16,) float32
        Proportions of the joint's segment.
    x, y, z : float32
        Rest offset in the parent's frame, m.
    row : (JOINT_ROW,) float32
        The joint: rotation, place and frame are written.
    """
    for lane in range(LANES):
        rotation = quaternion_at(row, NEXT, lane)
        put_quaternion(row, ROTATION, lane, rotation)
        outer = quaternion_at(above, FRAME, lane)
        ahead = rotate(outer, (x * scale[lane], y * scale[lane], z * scale[lane]))
        base = vector_at(above, PLACE, lane)
        put_vector(row, PLACE, lane, (base[0] + ahead[0], base[1] + ahead[1], base[2] + ahead[2]))
        put_quaternion(row, FRAME, lane, multiply(outer, rotation))


@inlined_kernel
def pull_row(above: Any, gain: Any, bound: Any, row: Any) -> None:
    """Free a joint, and let it drift towards the reference pose.

    Parameters
    ----------
    above : (JOINT_ROW,) float32
        The parent.
    gain : float32
        Share of the way to the reference.
    bound : float32
        Largest drift, rad.
    row : (JOINT_ROW,) float32
        The joint: its drift is written.
    """
    for lane in range(LANES):
        way = multiply(quaternion_at(row, REFERENCE, lane), conjugate(quaternion_at(row, ROTATION, lane)))
        sine = np.sqrt(way[1] * way[1] + way[2] * way[2] + way[3] * way[3] + TINY)
        share = min(TWO * gain, bound / sine)
        share = share if way[0] >= ZERO else -share
        drift = rotate(quaternion_at(above, FRAME, lane), (way[1] * share, way[2] * share, way[3] * share))
        put_vector(row, DRIFT, lane, drift)
    row[IS_FIXED] = ZERO


@inlined_kernel
def rest_row(joint: Any) -> None:
    """Let no torque stand in the step of a joint that moves no effector.

    Parameters
    ----------
    joint : (JOINT_ROW,) float32
        The joint: its step is written.
    """
    for lane in range(LANES):
        put_vector(joint, STEP, lane, (ZERO, ZERO, ZERO))


@inlined_kernel
def turned_by(outer: Quaternion, rotation: Quaternion, step: Vector) -> Quaternion:
    """Turn a local rotation by a small rotation vector of the root frame, to second order."""
    x, y, z = rotate(conjugate(outer), (HALF * step[0], HALF * step[1], HALF * step[2]))
    return unit_quaternion(multiply((ONE, x, y, z), rotation))


@inlined_kernel
def put_step(above: Any, turn: Vector, run: Any, lane: int, row: Any) -> None:
    """Write a joint's step, its drift and a rotation vector together, and where it leads."""
    drift = vector_at(row, DRIFT, lane)
    step = (run * (drift[0] + turn[0]), run * (drift[1] + turn[1]), run * (drift[2] + turn[2]))
    put_vector(row, STEP, lane, step)
    before = quaternion_at(row, ROTATION, lane)
    after = turned_by(quaternion_at(above, FRAME, lane), before, step)
    # Scaling to unit length again and again would change the bits of those who wait.
    is_still = run == ZERO
    put_quaternion(
        row,
        NEXT,
        lane,
        (
            before[0] if is_still else after[0],
            before[1] if is_still else after[1],
            before[2] if is_still else after[2],
            before[3] if is_still else after[3],
        ),
    )


@inlined_kernel
def step_row(above: Any, is_running: Any, row: Any) -> None:
    """Turn the torque in a joint's step into a rotation, and find the joint's next rotation.

    Parameters
    ----------
    above : (JOINT_ROW,) float32
        The parent.
    is_running : (16,) float32
        0 where the character stays as it is.
    row : (JOINT_ROW,) float32
        The joint: step and next rotation are written.
    """
    for lane in range(LANES):
        put_step(above, moved(row, lane, vector_at(row, STEP, lane)), is_running[lane], lane, row)


@inlined_kernel
def free_step_row(above: Any, weight: Any, is_running: Any, row: Any) -> None:
    """Do the same as `step_row` for a joint that turns freely, with the same bits.

    Parameters
    ----------
    weight : float32
        How easily the joint turns.

    Notes
    -----
    All other arguments are those of `step_row`.
    """
    for lane in range(LANES):
        torque = vector_at(row, STEP, lane)
        turn = (weight * torque[0], weight * torque[1], weight * torque[2])
        put_step(above, turn, is_running[lane], lane, row)
