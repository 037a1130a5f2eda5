"""Row leaves of the inverse kinematics: one joint, one effector or one element, sixteen characters as lanes.

A joint is one flat row of `JOINT_ROW` numbers, an effector one of `EFFECTOR_ROW`; the constants below name
where each of their parts begins. All vectors and world rotations are in the root frame.
"""

from typing import Any

import numpy as np

from crowd_kernels._jit import inlined_kernel
from crowd_kernels.joint_limit import (
    into_limit,
    join,
    out_of_limit,
    split,
    swing_normal,
    twist_normal,
)
from crowd_kernels.lanes import LANES
from crowd_kernels.quaternion import Quaternion, conjugate, multiply, rotate
from crowd_kernels.vector import Vector, cross, dot, subtract

# A joint.
ROTATION = 0
"""Local rotation, 4."""
REFERENCE = 4 * LANES
"""Local rotation of the reference pose, 4."""
PLACE = 8 * LANES
"""Position, m, 3."""
FRAME = 11 * LANES
"""World rotation, 4."""
MOBILITY = 15 * LANES
"""Symmetric matrix that turns a torque into a rotation: xx, xy, xz, yy, yz, zz. Only where `IS_FIXED`; joints
that turn freely have their weight in its place."""
DRIFT = 21 * LANES
"""Rotation vector that the joint turns by without any torque, rad, 3."""
STEP = 24 * LANES
"""Rotation vector of this iteration, rad, 3."""
NEXT = 27 * LANES
"""Local rotation after this iteration, 4."""
SWING_BOUND = 31 * LANES
"""Largest value of the swing ellipse, 1 and more."""
TWIST_BOUND = 32 * LANES
"""Least and largest twist, 2."""
HELD = 34 * LANES
"""Swing x and y and twist of the reference pose, 3."""
NEXT_SWING = 37 * LANES
"""Swing x and y and twist of the next rotation, 3."""
ROOM = 40 * LANES
"""Bounds of this iteration: largest value of the swing ellipse, least and largest twist, 3."""
IS_FIXED = 43 * LANES
"""Not 0 in the first lane where some direction does not turn freely in some lane."""
JOINT_ROW = 44 * LANES

# An effector.
POINT = 0
"""The point of the joint that has a target, in the joint's frame, m, 3."""
TARGET = 3 * LANES
"""Where the point should be, m, 3."""
TARGET_FRAME = 6 * LANES
"""World rotation that its joint should have, 4."""
WANTS_PLACE = 10 * LANES
"""1 where the position is asked for, else 0."""
WANTS_FRAME = 11 * LANES
"""1 where the rotation is asked for, else 0."""
TIP = 12 * LANES
"""Where the point is, m, 3."""
MISS = 15 * LANES
"""Step wanted now: position, m, and rotation vector, rad, 6."""
DISTANCE = 21 * LANES
"""Distance to the target, m."""
ANGLE = 22 * LANES
"""Angle to the target's rotation, rad."""
LENGTH = 23 * LANES
"""Length of the chain that can bring the point to the target, m."""
IS_FAR = 24 * LANES
"""1 where the target lies beyond that length."""
TURNS = 25 * LANES
"""1 where the rotation is sought in this iteration, else 0."""
EFFECTOR_ROW = 26 * LANES

PUSH = 6 * LANES
"""Right side of the system at an effector, and then its solution: 3 for the position, 3 for the rotation."""
BLOCK = 9 * LANES
"""A block of the system, 3 rows and 3 columns."""

ZERO: Any = np.float32(0.0)
ONE: Any = np.float32(1.0)
HALF: Any = np.float32(0.5)
TWO: Any = np.float32(2.0)
TINY: Any = np.float32(1e-12)
LEAST_PIVOT: Any = np.float32(1e-9)
FREE_SHARE: Any = np.float32(1e-3)
SLACK: Any = np.float32(2e-5)
SIXTH: Any = np.float32(1.0 / 6.0)
ASIN_FIFTH: Any = np.float32(0.075)
ANGLE_LENGTH: Any = np.float32(0.3)
PROGRESS: Any = np.float32(0.99)


@inlined_kernel
def vector_at(row: Any, begin: int, lane: int) -> Vector:
    """Read a vector of one lane."""
    first = begin + lane
    return row[first], row[first + LANES], row[first + 2 * LANES]


@inlined_kernel
def quaternion_at(row: Any, begin: int, lane: int) -> Quaternion:
    """Read a quaternion of one lane."""
    first = begin + lane
    return row[first], row[first + LANES], row[first + 2 * LANES], row[first + 3 * LANES]


@inlined_kernel
def put_vector(row: Any, begin: int, lane: int, value: Vector) -> None:
    """Write a vector of one lane."""
    first = begin + lane
    row[first] = value[0]
    row[first + LANES] = value[1]
    row[first + 2 * LANES] = value[2]


@inlined_kernel
def put_quaternion(row: Any, begin: int, lane: int, value: Quaternion) -> None:
    """Write a quaternion of one lane."""
    first = begin + lane
    row[first] = value[0]
    row[first + LANES] = value[1]
    row[first + 2 * LANES] = value[2]
    row[first + 3 * LANES] = value[3]


@inlined_kernel
def unit_quaternion(q: Quaternion) -> Quaternion:
    """Scale a quaternion that is not zero to unit length."""
    scale = ONE / np.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    return q[0] * scale, q[1] * scale, q[2] * scale, q[3] * scale


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
def forward_row(above: Any, scale: Any, x: Any, y: Any, z: Any, row: Any) -> None:
    """Place a joint below its parent.

    Parameters
    ----------
    above : (JOINT_ROW,) float32
        The parent.
    scale : (16,) float32
        Proportions of the joint's segment.
    x, y, z : float32
        Rest offset in the parent's frame, m.
    row : (JOINT_ROW,) float32
        The joint: place and frame are written.
    """
    for lane in range(LANES):
        outer = quaternion_at(above, FRAME, lane)
        ahead = rotate(outer, (x * scale[lane], y * scale[lane], z * scale[lane]))
        base = vector_at(above, PLACE, lane)
        put_vector(row, PLACE, lane, (base[0] + ahead[0], base[1] + ahead[1], base[2] + ahead[2]))
        put_quaternion(row, FRAME, lane, multiply(outer, quaternion_at(row, ROTATION, lane)))


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
def begin_fixing_row(weight: Any, row: Any) -> None:
    """Give a joint that turns freely the mobility from which directions can be taken.

    Parameters
    ----------
    weight : float32
        How easily the joint turns.
    row : (JOINT_ROW,) float32
        The joint: its mobility is written.
    """
    for lane in range(LANES):
        first = MOBILITY + lane
        row[first] = weight
        row[first + LANES] = ZERO
        row[first + 2 * LANES] = ZERO
        row[first + 3 * LANES] = weight
        row[first + 4 * LANES] = ZERO
        row[first + 5 * LANES] = weight
    row[IS_FIXED] = ONE


@inlined_kernel
def fix_direction(row: Any, lane: int, normal: Vector, motion: Any, weight: Any, share: Any) -> None:
    """Let a joint turn along one direction by a given amount, whatever the torque.

    Parameters
    ----------
    row : (JOINT_ROW,) float32
        The joint: its mobility loses the direction, its drift gets the motion.
    lane : int
    normal : tuple of float32
        The direction, of any length, root frame.
    motion : float32
        Scalar product of the normal and the rotation vector that is wanted.
    weight : float32
        How easily the joint turns while nothing is fixed. A direction that has hardly any of it left is
        fixed already.
    share : float32
        1 to do it, 0 to leave the joint as it is.
    """
    first = MOBILITY + lane
    mx, my, mz = moved(row, lane, normal)
    pivot = normal[0] * mx + normal[1] * my + normal[2] * mz
    least = FREE_SHARE * weight * dot(normal, normal) + TINY
    inverse = share / max(pivot, least) if pivot > least else ZERO
    drift = vector_at(row, DRIFT, lane)
    factor = (motion - dot(normal, drift)) * inverse
    put_vector(row, DRIFT, lane, (drift[0] + mx * factor, drift[1] + my * factor, drift[2] + mz * factor))
    row[first] -= mx * mx * inverse
    row[first + LANES] -= mx * my * inverse
    row[first + 2 * LANES] -= mx * mz * inverse
    row[first + 3 * LANES] -= my * my * inverse
    row[first + 4 * LANES] -= my * mz * inverse
    row[first + 5 * LANES] -= mz * mz * inverse


@inlined_kernel
def hold_reference_row(
    parent_frame: Quaternion,
    joint_frame: Quaternion,
    inverse_x: Any,
    inverse_y: Any,
    low: Any,
    high: Any,
    row: Any,
) -> None:
    """Note swing and twist of the reference pose, and widen limits that it leaves.

    Parameters
    ----------
    parent_frame, joint_frame : tuple of float32
    inverse_x, inverse_y : float32
        See `LimitArrays.inverse_swing`.
    low, high : float32
        See `LimitArrays.twist`.
    row : (JOINT_ROW,) float32
        The joint: bounds and held values are written.
    """
    for lane in range(LANES):
        x, y, twist = split(into_limit(parent_frame, quaternion_at(row, REFERENCE, lane), joint_frame))
        row[SWING_BOUND + lane] = max(ONE, x * inverse_x * x * inverse_x + y * inverse_y * y * inverse_y)
        row[TWIST_BOUND + lane] = min(low, twist)
        row[TWIST_BOUND + LANES + lane] = max(high, twist)
        put_vector(row, HELD, lane, (x, y, twist))


@inlined_kernel
def lock_axis_row(
    above: Any, weight: Any, parent_frame: Quaternion, joint_frame: Quaternion, axis: int, row: Any
) -> None:
    """Take one axis of a joint out of its mobility and drift.

    Parameters
    ----------
    above : (JOINT_ROW,) float32
        The parent.
    weight : float32
        How easily the joint turns.
    parent_frame, joint_frame : tuple of float32
    axis : int
        0 swing about x, 1 swing about y, 2 twist.
    row : (JOINT_ROW,) float32
        The joint.
    """
    along_x = ONE if axis == 0 else ZERO
    along_y = ONE if axis == 1 else ZERO
    twisting = ONE if axis == 2 else ZERO
    for lane in range(LANES):
        x, y, _ = split(into_limit(parent_frame, quaternion_at(row, ROTATION, lane), joint_frame))
        swing = swing_normal(x, y, along_x, along_y)
        twist = twist_normal(x, y)
        normal = rotate(
            multiply(quaternion_at(above, FRAME, lane), parent_frame),
            (
                swing[0] + twisting * (twist[0] - swing[0]),
                swing[1] + twisting * (twist[1] - swing[1]),
                swing[2] + twisting * (twist[2] - swing[2]),
            ),
        )
        fix_direction(row, lane, normal, ZERO, weight, ONE)


@inlined_kernel
def effector_row(
    joint: Any,
    base: Any,
    clamp: Any,
    steps: Any,
    waiting_distance: Any,
    tolerances: Any,
    damping: Any,
    row: Any,
    out_totals: Any,
) -> None:
    """Find where an effector is and what is missing to its target.

    Parameters
    ----------
    joint : (JOINT_ROW,) float32
        The joint that carries the effector.
    base : (JOINT_ROW,) float32
        The first joint of its chain that can turn.
    clamp : float32
        Share of the chain's length within which targets are sought.
    steps : tuple of float32
        Largest step, m and rad.
    waiting_distance : float32
        Distance beyond which the rotation waits for the position, m.
    tolerances : tuple of float32
        What counts as reached, m and rad.
    damping : tuple of float32
        Factors of the position step and of the turn in the damping, m and 1/rad.
    row : (EFFECTOR_ROW,) float32
        The effector: tip, miss, distance, angle, `IS_FAR` and `TURNS` are written.
    out_totals : (64,) float32
        Sums over effectors, in and out: error (distances and 0.3 m per rad of the angles), number of
        effectors that are not at their targets, damping of positions in m^2 and of rotations.
    """
    for lane in range(LANES):
        frame = quaternion_at(joint, FRAME, lane)
        place = vector_at(joint, PLACE, lane)
        ahead = rotate(frame, vector_at(row, POINT, lane))
        tip = (place[0] + ahead[0], place[1] + ahead[1], place[2] + ahead[2])
        put_vector(row, TIP, lane, tip)
        origin = vector_at(base, PLACE, lane)
        way = subtract(vector_at(row, TARGET, lane), origin)
        longest = clamp * row[LENGTH + lane]
        distance = np.sqrt(dot(way, way) + TINY)
        row[IS_FAR + lane] = ONE if distance > longest else ZERO
        share = min(ONE, longest / distance)
        wants = row[WANTS_PLACE + lane]
        miss = (
            wants * (origin[0] + way[0] * share - tip[0]),
            wants * (origin[1] + way[1] * share - tip[1]),
            wants * (origin[2] + way[2] * share - tip[2]),
        )
        square = dot(miss, miss)
        distance = np.sqrt(square + TINY)
        row[DISTANCE + lane] = distance
        share = min(ONE, steps[0] / distance)
        put_vector(row, MISS, lane, (miss[0] * share, miss[1] * share, miss[2] * share))
        out_totals[2 * LANES + lane] += damping[0] * distance * share
        turn = multiply(quaternion_at(row, TARGET_FRAME, lane), conjugate(frame))
        square = turn[1] * turn[1] + turn[2] * turn[2] + turn[3] * turn[3]
        # The angle is twice the arc sine of the vector part.
        factor = row[WANTS_FRAME + lane] * TWO * (ONE + square * SIXTH + square * square * ASIN_FIFTH)
        factor = factor if turn[0] >= ZERO else -factor
        angle = np.sqrt(factor * factor * square + TINY)
        row[ANGLE + lane] = angle
        turns = row[WANTS_FRAME + lane] * (ONE - wants * (ONE if distance > waiting_distance else ZERO))
        row[TURNS + lane] = turns
        share = turns * min(ONE, steps[1] / angle)
        out_totals[3 * LANES + lane] += damping[1] * angle * share
        share *= factor
        put_vector(row, MISS + 3 * LANES, lane, (turn[1] * share, turn[2] * share, turn[3] * share))
        out_totals[lane] += distance + ANGLE_LENGTH * angle
        is_there = (distance < tolerances[0]) & (angle < tolerances[1])
        out_totals[LANES + lane] += ZERO if is_there else ONE


@inlined_kernel
def subtract_drift_row(joint: Any, effector: Any, out_push: Any) -> None:
    """Take away from an effector's step what the drift of a joint already does.

    Parameters
    ----------
    joint : (JOINT_ROW,) float32
    effector : (EFFECTOR_ROW,) float32
    out_push : (PUSH,) float32
        Right side of the system at the effector, in and out.
    """
    for lane in range(LANES):
        drift = vector_at(joint, DRIFT, lane)
        lever = subtract(vector_at(effector, TIP, lane), vector_at(joint, PLACE, lane))
        x, y, z = cross(drift, lever)
        share = effector[WANTS_PLACE + lane]
        place = vector_at(out_push, 0, lane)
        put_vector(out_push, 0, lane, (place[0] - share * x, place[1] - share * y, place[2] - share * z))
        share = effector[TURNS + lane]
        turn = vector_at(out_push, 3 * LANES, lane)
        put_vector(
            out_push,
            3 * LANES,
            lane,
            (turn[0] - share * drift[0], turn[1] - share * drift[1], turn[2] - share * drift[2]),
        )


@inlined_kernel
def mobility_at(joint: Any, lane: int) -> tuple[Vector, Vector, Vector]:
    """Read the rows of a joint's mobility."""
    first = MOBILITY + lane
    xx, xy, xz = joint[first], joint[first + LANES], joint[first + 2 * LANES]
    yy, yz, zz = joint[first + 3 * LANES], joint[first + 4 * LANES], joint[first + 5 * LANES]
    return (xx, xy, xz), (xy, yy, yz), (xz, yz, zz)


@inlined_kernel
def accumulate_place_row(joint: Any, a: Any, b: Any, out_block: Any) -> None:
    """Add a joint's share to the block of two effectors' positions.

    Parameters
    ----------
    joint : (JOINT_ROW,) float32
    a, b : (EFFECTOR_ROW,) float32
        Effectors of the block's rows and columns.
    out_block : (144,) float32
        Block of J W J^T, in and out.
    """
    for lane in range(LANES):
        place = vector_at(joint, PLACE, lane)
        lever = subtract(vector_at(a, TIP, lane), place)
        other = subtract(vector_at(b, TIP, lane), place)
        share = a[WANTS_PLACE + lane] * b[WANTS_PLACE + lane]
        mx, my, mz = mobility_at(joint, lane)
        x, y, z = cross(mx, other), cross(my, other), cross(mz, other)
        u, v, w = lever[0] * share, lever[1] * share, lever[2] * share
        out_block[lane] += w * y[0] - v * z[0]
        out_block[LANES + lane] += w * y[1] - v * z[1]
        out_block[2 * LANES + lane] += w * y[2] - v * z[2]
        out_block[3 * LANES + lane] += u * z[0] - w * x[0]
        out_block[4 * LANES + lane] += u * z[1] - w * x[1]
        out_block[5 * LANES + lane] += u * z[2] - w * x[2]
        out_block[6 * LANES + lane] += v * x[0] - u * y[0]
        out_block[7 * LANES + lane] += v * x[1] - u * y[1]
        out_block[8 * LANES + lane] += v * x[2] - u * y[2]


@inlined_kernel
def accumulate_free_place_row(joint: Any, weight: Any, a: Any, b: Any, out_block: Any) -> None:
    """Add the share of a joint that turns freely to the block of two effectors' positions.

    Parameters
    ----------
    joint : (JOINT_ROW,) float32
    weight : float32
        How easily it turns.
    a, b : (EFFECTOR_ROW,) float32
        Effectors of the block's rows and columns.
    out_block : (144,) float32
        Block of J W J^T, in and out.

    Notes
    -----
    Sums have the bits of `accumulate_place_row`.
    """
    for lane in range(LANES):
        place = vector_at(joint, PLACE, lane)
        lever = subtract(vector_at(a, TIP, lane), place)
        other = subtract(vector_at(b, TIP, lane), place)
        share = a[WANTS_PLACE + lane] * b[WANTS_PLACE + lane]
        x, y, z = weight * other[0], weight * other[1], weight * other[2]
        u, v, w = lever[0] * share, lever[1] * share, lever[2] * share
        out_block[lane] += w * z + v * y
        out_block[LANES + lane] -= v * x
        out_block[2 * LANES + lane] -= w * x
        out_block[3 * LANES + lane] -= u * y
        out_block[4 * LANES + lane] += u * x + w * z
        out_block[5 * LANES + lane] -= w * y
        out_block[6 * LANES + lane] -= u * z
        out_block[7 * LANES + lane] -= v * z
        out_block[8 * LANES + lane] += v * y + u * x


@inlined_kernel
def accumulate_free_frame_row(joint: Any, weight: Any, a: Any, b: Any, out_blocks: Any) -> None:
    """Add the share of a joint that turns freely to the blocks of one effector's rotation with another's.

    Parameters
    ----------
    joint : (JOINT_ROW,) float32
    weight : float32
        How easily it turns.
    a, b : (EFFECTOR_ROW,) float32
        Effectors of the blocks' rows and columns.
    out_blocks : (288,) float32
        Two neighbouring blocks of J W J^T, in and out.
    """
    for lane in range(LANES):
        other = subtract(vector_at(b, TIP, lane), vector_at(joint, PLACE, lane))
        share = a[TURNS + lane] * b[WANTS_PLACE + lane]
        x, y, z = weight * other[0], weight * other[1], weight * other[2]
        out_blocks[LANES + lane] -= share * z
        out_blocks[2 * LANES + lane] += share * y
        out_blocks[3 * LANES + lane] += share * z
        out_blocks[5 * LANES + lane] -= share * x
        out_blocks[6 * LANES + lane] -= share * y
        out_blocks[7 * LANES + lane] += share * x
        share = weight * a[TURNS + lane] * b[TURNS + lane]
        out_blocks[9 * LANES + lane] += share
        out_blocks[13 * LANES + lane] += share
        out_blocks[17 * LANES + lane] += share


@inlined_kernel
def accumulate_frame_row(joint: Any, a: Any, b: Any, out_blocks: Any) -> None:
    """Add a joint's share to the blocks of one effector's rotation with another's position and rotation.

    Parameters
    ----------
    joint : (JOINT_ROW,) float32
    a, b : (EFFECTOR_ROW,) float32
        Effectors of the blocks' rows and columns.
    out_blocks : (288,) float32
        Two neighbouring blocks of J W J^T, in and out.
    """
    for lane in range(LANES):
        other = subtract(vector_at(b, TIP, lane), vector_at(joint, PLACE, lane))
        frame = a[TURNS + lane]
        mx, my, mz = mobility_at(joint, lane)
        x, y, z = cross(mx, other), cross(my, other), cross(mz, other)
        share = frame * b[WANTS_PLACE + lane]
        out_blocks[lane] += share * x[0]
        out_blocks[LANES + lane] += share * x[1]
        out_blocks[2 * LANES + lane] += share * x[2]
        out_blocks[3 * LANES + lane] += share * y[0]
        out_blocks[4 * LANES + lane] += share * y[1]
        out_blocks[5 * LANES + lane] += share * y[2]
        out_blocks[6 * LANES + lane] += share * z[0]
        out_blocks[7 * LANES + lane] += share * z[1]
        out_blocks[8 * LANES + lane] += share * z[2]
        share = frame * b[TURNS + lane]
        out_blocks[9 * LANES + lane] += share * mx[0]
        out_blocks[10 * LANES + lane] += share * mx[1]
        out_blocks[11 * LANES + lane] += share * mx[2]
        out_blocks[12 * LANES + lane] += share * my[0]
        out_blocks[13 * LANES + lane] += share * my[1]
        out_blocks[14 * LANES + lane] += share * my[2]
        out_blocks[15 * LANES + lane] += share * mz[0]
        out_blocks[16 * LANES + lane] += share * mz[1]
        out_blocks[17 * LANES + lane] += share * mz[2]


@inlined_kernel
def accumulate_cross_row(joint: Any, a: Any, b: Any, out_block: Any) -> None:
    """Add a joint's share to the block of one effector's position with another's rotation.

    Parameters
    ----------
    joint : (JOINT_ROW,) float32
    a, b : (EFFECTOR_ROW,) float32
        Effectors of the block's rows and columns.
    out_block : (144,) float32
        Block of J W J^T, in and out.
    """
    for lane in range(LANES):
        lever = subtract(vector_at(a, TIP, lane), vector_at(joint, PLACE, lane))
        share = a[WANTS_PLACE + lane] * b[TURNS + lane]
        mx, my, mz = mobility_at(joint, lane)
        x, y, z = cross(mx, lever), cross(my, lever), cross(mz, lever)
        out_block[lane] += share * x[0]
        out_block[LANES + lane] += share * y[0]
        out_block[2 * LANES + lane] += share * z[0]
        out_block[3 * LANES + lane] += share * x[1]
        out_block[4 * LANES + lane] += share * y[1]
        out_block[5 * LANES + lane] += share * z[1]
        out_block[6 * LANES + lane] += share * x[2]
        out_block[7 * LANES + lane] += share * y[2]
        out_block[8 * LANES + lane] += share * z[2]


@inlined_kernel
def accumulate_free_cross_row(joint: Any, weight: Any, a: Any, b: Any, out_block: Any) -> None:
    """Add the share of a joint that turns freely to the block of a position with another's rotation.

    Parameters
    ----------
    joint : (JOINT_ROW,) float32
    weight : float32
        How easily it turns.
    a, b : (EFFECTOR_ROW,) float32
        Effectors of the block's rows and columns.
    out_block : (144,) float32
        Block of J W J^T, in and out.
    """
    for lane in range(LANES):
        lever = subtract(vector_at(a, TIP, lane), vector_at(joint, PLACE, lane))
        share = a[WANTS_PLACE + lane] * b[TURNS + lane]
        x, y, z = weight * lever[0], weight * lever[1], weight * lever[2]
        out_block[LANES + lane] += share * z
        out_block[2 * LANES + lane] -= share * y
        out_block[3 * LANES + lane] -= share * z
        out_block[5 * LANES + lane] += share * x
        out_block[6 * LANES + lane] += share * y
        out_block[7 * LANES + lane] -= share * x


@inlined_kernel
def factor_block(damping: Any, block: Any) -> None:
    """Damp a block on the diagonal and factor it by Cholesky, in place.

    Parameters
    ----------
    damping : (16,) float32
        Added to the diagonal.
    block : (144,) float32
        Its lower triangle is read and written; the diagonal then holds the inverse pivots.
    """
    for lane in range(LANES):
        extra = damping[lane]
        a = ONE / np.sqrt(max(block[lane] + extra, LEAST_PIVOT))
        b = block[3 * LANES + lane] * a
        c = block[6 * LANES + lane] * a
        d = ONE / np.sqrt(max(block[4 * LANES + lane] + extra - b * b, LEAST_PIVOT))
        e = (block[7 * LANES + lane] - c * b) * d
        f = ONE / np.sqrt(max(block[8 * LANES + lane] + extra - c * c - e * e, LEAST_PIVOT))
        block[lane] = a
        block[3 * LANES + lane] = b
        block[4 * LANES + lane] = d
        block[6 * LANES + lane] = c
        block[7 * LANES + lane] = e
        block[8 * LANES + lane] = f


@inlined_kernel
def divide_block(pivot: Any, block: Any) -> None:
    """Divide a block below the diagonal by the factor of its column.

    Parameters
    ----------
    pivot : (144,) float32
        Block of the same column on the diagonal, after `factor_block`.
    block : (144,) float32
        In and out.
    """
    for lane in range(LANES):
        a, b, c = pivot[lane], pivot[3 * LANES + lane], pivot[6 * LANES + lane]
        d, e, f = pivot[4 * LANES + lane], pivot[7 * LANES + lane], pivot[8 * LANES + lane]
        x0 = block[lane] * a
        x1 = (block[LANES + lane] - x0 * b) * d
        x2 = (block[2 * LANES + lane] - x0 * c - x1 * e) * f
        y0 = block[3 * LANES + lane] * a
        y1 = (block[4 * LANES + lane] - y0 * b) * d
        y2 = (block[5 * LANES + lane] - y0 * c - y1 * e) * f
        z0 = block[6 * LANES + lane] * a
        z1 = (block[7 * LANES + lane] - z0 * b) * d
        z2 = (block[8 * LANES + lane] - z0 * c - z1 * e) * f
        put_vector(block, 0, lane, (x0, x1, x2))
        put_vector(block, 3 * LANES, lane, (y0, y1, y2))
        put_vector(block, 6 * LANES, lane, (z0, z1, z2))


@inlined_kernel
def subtract_block(left: Any, right: Any, block: Any) -> None:
    """Subtract the product of a block and the transpose of another.

    Parameters
    ----------
    left, right : (144,) float32
    block : (144,) float32
        In and out.
    """
    for lane in range(LANES):
        a = vector_at(right, 0, lane)
        b = vector_at(right, 3 * LANES, lane)
        c = vector_at(right, 6 * LANES, lane)
        x = vector_at(left, 0, lane)
        y = vector_at(left, 3 * LANES, lane)
        z = vector_at(left, 6 * LANES, lane)
        block[lane] -= dot(x, a)
        block[LANES + lane] -= dot(x, b)
        block[2 * LANES + lane] -= dot(x, c)
        block[3 * LANES + lane] -= dot(y, a)
        block[4 * LANES + lane] -= dot(y, b)
        block[5 * LANES + lane] -= dot(y, c)
        block[6 * LANES + lane] -= dot(z, a)
        block[7 * LANES + lane] -= dot(z, b)
        block[8 * LANES + lane] -= dot(z, c)


@inlined_kernel
def solve_lower(pivot: Any, out_values: Any) -> None:
    """Divide three elements of the right side by a factored block.

    Parameters
    ----------
    pivot : (144,) float32
        After `factor_block`.
    out_values : (48,) float32
        In and out.
    """
    for lane in range(LANES):
        x, y, z = vector_at(out_values, 0, lane)
        x *= pivot[lane]
        y = (y - pivot[3 * LANES + lane] * x) * pivot[4 * LANES + lane]
        z = (z - pivot[6 * LANES + lane] * x - pivot[7 * LANES + lane] * y) * pivot[8 * LANES + lane]
        put_vector(out_values, 0, lane, (x, y, z))


@inlined_kernel
def solve_upper(pivot: Any, out_values: Any) -> None:
    """Divide three elements of the right side by the transpose of a factored block.

    Parameters
    ----------
    pivot : (144,) float32
        After `factor_block`.
    out_values : (48,) float32
        In and out.
    """
    for lane in range(LANES):
        x, y, z = vector_at(out_values, 0, lane)
        z *= pivot[8 * LANES + lane]
        y = (y - pivot[7 * LANES + lane] * z) * pivot[4 * LANES + lane]
        x = (x - pivot[3 * LANES + lane] * y - pivot[6 * LANES + lane] * z) * pivot[lane]
        put_vector(out_values, 0, lane, (x, y, z))


@inlined_kernel
def subtract_lower(block: Any, values: Any, out_values: Any) -> None:
    """Subtract the product of a block and three elements.

    Parameters
    ----------
    block : (144,) float32
    values : (48,) float32
    out_values : (48,) float32
        In and out.
    """
    for lane in range(LANES):
        v = vector_at(values, 0, lane)
        x, y, z = vector_at(out_values, 0, lane)
        x -= dot(vector_at(block, 0, lane), v)
        y -= dot(vector_at(block, 3 * LANES, lane), v)
        z -= dot(vector_at(block, 6 * LANES, lane), v)
        put_vector(out_values, 0, lane, (x, y, z))


@inlined_kernel
def subtract_upper(block: Any, values: Any, out_values: Any) -> None:
    """Subtract the product of a block's transpose and three elements.

    Parameters
    ----------
    block : (144,) float32
    values : (48,) float32
    out_values : (48,) float32
        In and out.
    """
    for lane in range(LANES):
        a, b, c = vector_at(values, 0, lane)
        u = vector_at(block, 0, lane)
        v = vector_at(block, 3 * LANES, lane)
        w = vector_at(block, 6 * LANES, lane)
        x, y, z = vector_at(out_values, 0, lane)
        x -= u[0] * a + v[0] * b + w[0] * c
        y -= u[1] * a + v[1] * b + w[1] * c
        z -= u[2] * a + v[2] * b + w[2] * c
        put_vector(out_values, 0, lane, (x, y, z))


@inlined_kernel
def add_torque_row(effector: Any, push: Any, is_first: bool, joint: Any) -> None:
    """Add the torque that an effector's push gives a joint to what stands in its step.

    Parameters
    ----------
    effector : (EFFECTOR_ROW,) float32
    push : (PUSH,) float32
        Force and torque at the effector.
    is_first : bool
        Nothing stands there yet.
    joint : (JOINT_ROW,) float32
        The joint: its step is changed.
    """
    for lane in range(LANES):
        lever = subtract(vector_at(effector, TIP, lane), vector_at(joint, PLACE, lane))
        x, y, z = cross(lever, vector_at(push, 0, lane))
        turn = vector_at(push, 3 * LANES, lane)
        place, frame = effector[WANTS_PLACE + lane], effector[TURNS + lane]
        torque = vector_at(joint, STEP, lane)
        put_vector(
            joint,
            STEP,
            lane,
            (
                (ZERO if is_first else torque[0]) + place * x + frame * turn[0],
                (ZERO if is_first else torque[1]) + place * y + frame * turn[1],
                (ZERO if is_first else torque[2]) + place * z + frame * turn[2],
            ),
        )


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


@inlined_kernel
def find_limit_row(
    parent_frame: Quaternion,
    joint_frame: Quaternion,
    inverse_x: Any,
    inverse_y: Any,
    approach: Any,
    row: Any,
) -> bool:
    """Find swing and twist of a joint's next rotation, and how far they may go in this iteration.

    Parameters
    ----------
    parent_frame, joint_frame : tuple of float32
    inverse_x, inverse_y : float32
        See `LimitArrays.inverse_swing`.
    approach : float32
        Largest share of the way to a limit that the joint goes now.
    row : (JOINT_ROW,) float32
        The joint: next swing and room are written.

    Returns
    -------
    bool
        Someone's joint would leave its limits.
    """
    is_outside = False
    for lane in range(LANES):
        x, y, twist = split(into_limit(parent_frame, quaternion_at(row, ROTATION, lane), joint_frame))
        value = x * inverse_x * x * inverse_x + y * inverse_y * y * inverse_y
        bound = row[SWING_BOUND + lane]
        # Up to a share of the way to the limit, so that joints come to rest there softly.
        radius = np.sqrt(value) + approach * max(np.sqrt(bound) - np.sqrt(value), ZERO)
        bound = min(radius * radius, bound)
        low, high = row[TWIST_BOUND + lane], row[TWIST_BOUND + LANES + lane]
        low = max(low, twist + approach * min(low - twist, ZERO))
        high = min(high, twist + approach * max(high - twist, ZERO))
        put_vector(row, ROOM, lane, (bound, low, high))
        x, y, twist = split(into_limit(parent_frame, quaternion_at(row, NEXT, lane), joint_frame))
        put_vector(row, NEXT_SWING, lane, (x, y, twist))
        value = x * inverse_x * x * inverse_x + y * inverse_y * y * inverse_y
        is_outside |= (value > bound) | (twist > high) | (twist < low)
    return is_outside


@inlined_kernel
def limit_row(
    above: Any,
    weight: Any,
    parent_frame: Quaternion,
    joint_frame: Quaternion,
    inverse_x: Any,
    inverse_y: Any,
    free_x: Any,
    free_y: Any,
    free_twist: Any,
    is_running: Any,
    row: Any,
    out_violations: Any,
) -> None:
    """Bring a joint's next rotation into its limits, and fix the directions that would have left them.

    Parameters
    ----------
    above : (JOINT_ROW,) float32
        The parent.
    weight : float32
        How easily the joint turns.
    parent_frame, joint_frame : tuple of float32
    inverse_x, inverse_y : float32
        See `LimitArrays.inverse_swing`.
    free_x, free_y, free_twist : float32
        See `LimitArrays.is_free`.
    is_running : (16,) float32
        0 where the character stays as it is.
    row : (JOINT_ROW,) float32
        The joint, after `find_limit_row`: its next rotation is projected; drift and mobility lose what is
        fixed.
    out_violations : (16,) float32
        Grows by the number of directions that were fixed.

    Notes
    -----
    Rotations within their limits keep their bits, so that nobody's pose depends on who shares the row.
    """
    is_free = free_x * free_y * free_twist
    for lane in range(LANES):
        x, y, twist = vector_at(row, NEXT_SWING, lane)
        bound, low, high = vector_at(row, ROOM, lane)
        held = vector_at(row, HELD, lane)
        value = x * inverse_x * x * inverse_x + y * inverse_y * y * inverse_y
        is_inside = (value <= bound) & (twist >= low) & (twist <= high) & (is_free > ZERO)
        share = np.sqrt(bound / max(value, bound))
        swings_out = is_running[lane] if value > bound + SLACK * bound else ZERO
        twists_out = is_running[lane] if (twist > high + SLACK) | (twist < low - SLACK) else ZERO
        twists_out *= free_twist
        x = held[0] + free_x * (x * share - held[0])
        y = held[1] + free_y * (y * share - held[1])
        twist = held[2] + free_twist * (min(max(twist, low), high) - held[2])
        inside = out_of_limit(parent_frame, join(x, y, twist), joint_frame)
        before = quaternion_at(row, ROTATION, lane)
        sign = (
            ONE
            if before[0] * inside[0] + before[1] * inside[1] + before[2] * inside[2] + before[3] * inside[3]
            >= ZERO
            else -ONE
        )
        run = sign * is_running[lane]
        stays = ONE - is_running[lane]
        after = quaternion_at(row, NEXT, lane)
        put_quaternion(
            row,
            NEXT,
            lane,
            (
                after[0] if is_inside else run * inside[0] + stays * before[0],
                after[1] if is_inside else run * inside[1] + stays * before[1],
                after[2] if is_inside else run * inside[2] + stays * before[2],
                after[3] if is_inside else run * inside[3] + stays * before[3],
            ),
        )
        # The rotation vector to the projection, as the update measures it.
        way = multiply(inside, conjugate(before))
        scale = TWO / (way[0] if way[0] * way[0] > TINY else ONE)
        outer = quaternion_at(above, FRAME, lane)
        motion = rotate(outer, (way[1] * scale, way[2] * scale, way[3] * scale))
        frame = multiply(outer, parent_frame)
        normal = rotate(frame, swing_normal(x, y, x * inverse_x * inverse_x, y * inverse_y * inverse_y))
        fix_direction(row, lane, normal, dot(normal, motion), weight, swings_out)
        normal = rotate(frame, twist_normal(x, y))
        fix_direction(row, lane, normal, dot(normal, motion), weight, twists_out)
        out_violations[lane] += swings_out + twists_out


@inlined_kernel
def commit_row(row: Any) -> None:
    """Let a joint's next rotation be its rotation.

    Parameters
    ----------
    row : (JOINT_ROW,) float32
        The joint.
    """
    # One long loop: short ones are unrolled and stay scalar.
    for index in range(4 * LANES):
        row[ROTATION + index] = row[NEXT + index]


@inlined_kernel
def clear_row(row: Any) -> None:
    """Set 16 numbers to zero.

    Parameters
    ----------
    row : (16,) float32
        Written.
    """
    for lane in range(LANES):
        row[lane] = ZERO


@inlined_kernel
def add_row(values: Any, out: Any) -> None:
    """Add 16 numbers to others.

    Parameters
    ----------
    values : (16,) float32
    out : (16,) float32
        In and out.
    """
    for lane in range(LANES):
        out[lane] += values[lane]


@inlined_kernel
def running_row(
    error: Any, missing: Any, is_early: Any, patience: Any, best: Any, stalled: Any, out_running: Any
) -> None:
    """Decide which characters take another step.

    Parameters
    ----------
    error, missing : (16,) float32
        See `effector_row`.
    is_early : float32
        1 while everyone takes steps, reached or not.
    patience : float32
        Iterations with less than 1 % of progress after which a character stops.
    best, stalled : (16,) float32
        In and out: least error so far, and iterations since it fell.
    out_running : (16,) float32
        In and out: 1 for those who go on; who has stopped stays.
    """
    for lane in range(LANES):
        is_better = error[lane] < PROGRESS * best[lane]
        best[lane] = error[lane] if is_better else best[lane]
        stalled[lane] = ZERO if is_better else stalled[lane] + ONE
        goes_on = ONE if (missing[lane] > HALF) & (stalled[lane] <= patience) else ZERO
        out_running[lane] *= max(goes_on, is_early)


@inlined_kernel
def root_pull_row(reference: Any, gain: Any, bound: Any, root: Any) -> None:
    """Let the root drift towards its reference.

    Parameters
    ----------
    reference : (48,) float32
        Wanted place, m.
    gain : float32
        Share of the way.
    bound : float32
        Largest drift, m.
    root : (JOINT_ROW,) float32
        The root: its drift is written.
    """
    for lane in range(LANES):
        way = subtract(vector_at(reference, 0, lane), vector_at(root, PLACE, lane))
        share = min(gain, bound / np.sqrt(dot(way, way) + TINY))
        put_vector(root, DRIFT, lane, (way[0] * share, way[1] * share, way[2] * share))


@inlined_kernel
def root_accumulate_row(a: Any, b: Any, weight: Any, out_block: Any) -> None:
    """Add the root's moves to the system of two effectors.

    Parameters
    ----------
    a, b : (EFFECTOR_ROW,) float32
    weight : float32
        How easily the root moves.
    out_block : (144,) float32
        In and out.
    """
    for lane in range(LANES):
        share = weight * a[WANTS_PLACE + lane] * b[WANTS_PLACE + lane]
        out_block[lane] += share
        out_block[4 * LANES + lane] += share
        out_block[8 * LANES + lane] += share


@inlined_kernel
def root_subtract_row(root: Any, effector: Any, out_right: Any) -> None:
    """Take away from an effector's step what the drift of the root already does.

    Parameters
    ----------
    root : (JOINT_ROW,) float32
    effector : (EFFECTOR_ROW,) float32
    out_right : (96,) float32
        In and out.
    """
    for lane in range(LANES):
        drift = vector_at(root, DRIFT, lane)
        place = effector[WANTS_PLACE + lane]
        out_right[lane] -= place * drift[0]
        out_right[LANES + lane] -= place * drift[1]
        out_right[2 * LANES + lane] -= place * drift[2]


@inlined_kernel
def root_push_row(effector: Any, force: Any, weight: Any, root: Any) -> None:
    """Add what a force at an effector moves the root to its drift.

    Parameters
    ----------
    effector : (EFFECTOR_ROW,) float32
    force : (48,) float32
    weight : float32
        How easily the root moves.
    root : (JOINT_ROW,) float32
        The root: its drift is changed.
    """
    for lane in range(LANES):
        drift = vector_at(root, DRIFT, lane)
        push = vector_at(force, 0, lane)
        share = weight * effector[WANTS_PLACE + lane]
        put_vector(
            root,
            DRIFT,
            lane,
            (drift[0] + share * push[0], drift[1] + share * push[1], drift[2] + share * push[2]),
        )


@inlined_kernel
def root_commit_row(is_running: Any, root: Any) -> None:
    """Move the root by its drift.

    Parameters
    ----------
    is_running : (16,) float32
        0 where the character stays as it is.
    root : (JOINT_ROW,) float32
        The root: its place is changed.
    """
    for lane in range(LANES):
        drift, place, run = vector_at(root, DRIFT, lane), vector_at(root, PLACE, lane), is_running[lane]
        put_vector(
            root,
            PLACE,
            lane,
            (place[0] + run * drift[0], place[1] + run * drift[1], place[2] + run * drift[2]),
        )


@inlined_kernel
def sum_row(row: Any) -> Any:
    """Add up 16 numbers."""
    total = ZERO
    for lane in range(LANES):
        total += row[lane]
    return total


@inlined_kernel
def start_push_row(effector: Any, out_push: Any) -> None:
    """Begin the right side with what is missing.

    Parameters
    ----------
    effector : (EFFECTOR_ROW,) float32
    out_push : (PUSH,) float32
        Written.
    """
    for index in range(PUSH):
        out_push[index] = effector[MISS + index]
