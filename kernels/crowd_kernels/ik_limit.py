"""Row leaves of inverse kinematics that keep one joint within its limits, by fixing directions."""

from typing import Any

import numpy as np

from crowd_kernels._jit import inlined_kernel
from crowd_kernels.ik_joint import moved
from crowd_kernels.ik_layout import (
    DRIFT,
    EXCESS,
    FRAME,
    HELD,
    IS_FIXED,
    LAST,
    MOBILITY,
    NEXT,
    NEXT_SWING,
    ONE,
    REFERENCE,
    ROOM,
    ROTATION,
    SWING_BOUND,
    TINY,
    TWIST_BOUND,
    TWO,
    WAY_SHARE,
    ZERO,
    put_quaternion,
    put_vector,
    quaternion_at,
    vector_at,
)
from crowd_kernels.joint_limit import into_limit, join, out_of_limit, split, swing_normal, twist_normal
from crowd_kernels.lanes import LANES
from crowd_kernels.quaternion import Quaternion, conjugate, multiply, rotate
from crowd_kernels.vector import Vector, dot

FREE_SHARE: Any = np.float32(0.1)
"""Share of a direction that must be left to be fixed. Beside the end of a curved limit another direction, at
a small angle to the first, would be fixed as well, and the joint would not slide along the limit."""
SLACK: Any = np.float32(2e-5)
"""What rounding may leave of an excess: share of the swing ellipse's value, and of half the twist in rad."""
GRAVE: Any = np.float32(0.6)
"""Share of the largest excess from which directions are fixed: lesser ones often come back by themselves.
Where this is smaller, joints are held that would, and jump when they are let go; where it is larger, those
at many limits at once are not all fixed in the passes that there are."""
ENLARGED: Any = np.float32(1.1)
"""Size of the ellipse ahead of which joints slow down along their motion, over that of the limit. Joints
could not slide along their limits if it were 1."""


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
def fix_direction(row: Any, lane: int, normal: Vector, motion: Any, weight: Any, share: Any) -> Any:
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

    Returns
    -------
    float32
        1 where it was done, else 0.
    """
    first = MOBILITY + lane
    mx, my, mz = moved(row, lane, normal)
    pivot = normal[0] * mx + normal[1] * my + normal[2] * mz
    least = FREE_SHARE * weight * dot(normal, normal) + TINY
    share = share if pivot > least else ZERO
    inverse = share / max(pivot, least)
    drift = vector_at(row, DRIFT, lane)
    factor = (motion - dot(normal, drift)) * inverse
    put_vector(row, DRIFT, lane, (drift[0] + mx * factor, drift[1] + my * factor, drift[2] + mz * factor))
    row[first] -= mx * mx * inverse
    row[first + LANES] -= mx * my * inverse
    row[first + 2 * LANES] -= mx * mz * inverse
    row[first + 3 * LANES] -= my * my * inverse
    row[first + 4 * LANES] -= my * mz * inverse
    row[first + 5 * LANES] -= mz * mz * inverse
    return share


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
    """Note swing and twist of the reference and of the last pose, and widen limits that the reference leaves.

    Parameters
    ----------
    parent_frame, joint_frame : tuple of float32
    inverse_x, inverse_y : float32
        See `LimitArrays.inverse_swing`.
    low, high : float32
        See `LimitArrays.twist`.
    row : (JOINT_ROW,) float32
        The joint, with the last pose's rotation as its frame: bounds, held and last values are written.
    """
    for lane in range(LANES):
        x, y, twist = split(into_limit(parent_frame, quaternion_at(row, FRAME, lane), joint_frame))
        put_vector(row, LAST, lane, (x, y, twist))
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
def find_room_row(approach: Any, inverse_x: Any, inverse_y: Any, row: Any) -> None:
    """Find how near to its limits a joint may come in this iteration, so that it comes to rest there softly.

    Parameters
    ----------
    approach : float32
        Largest share of the way from the last pose to a limit.
    inverse_x, inverse_y : float32
        See `LimitArrays.inverse_swing`.
    row : (JOINT_ROW,) float32
        The joint: its room is written.
    """
    for lane in range(LANES):
        bound = row[SWING_BOUND + lane]
        x, y, last = vector_at(row, LAST, lane)
        radius = np.sqrt(x * inverse_x * x * inverse_x + y * inverse_y * y * inverse_y)
        radius += approach * max(np.sqrt(bound) - radius, ZERO)
        low, high = row[TWIST_BOUND + lane], row[TWIST_BOUND + LANES + lane]
        low = max(low, last + approach * min(low - last, ZERO))
        high = min(high, last + approach * max(high - last, ZERO))
        put_vector(row, ROOM, lane, (min(radius * radius, bound), low, high))


@inlined_kernel
def find_limit_row(
    approach: Any, parent_frame: Quaternion, joint_frame: Quaternion, inverse_x: Any, inverse_y: Any, row: Any
) -> bool:
    """Find swing and twist of a joint's next rotation, and how much of the way to that swing it goes.

    Parameters
    ----------
    approach : float32
        Largest share of the way from the last pose to a limit.
    parent_frame, joint_frame : tuple of float32
    inverse_x, inverse_y : float32
        See `LimitArrays.inverse_swing`.
    row : (JOINT_ROW,) float32
        The joint, after `find_room_row`: next swing and the share of its way are written.

    Returns
    -------
    bool
        Someone's joint would leave its room, or goes less than its whole way.

    Notes
    -----
    A bone that crosses a long ellipse beside the middle comes close to the limit only at the very end. So its
    way to the limit is also measured along its motion.
    """
    is_outside = False
    for lane in range(LANES):
        bound, low, high = vector_at(row, ROOM, lane)
        x, y, twist = split(into_limit(parent_frame, quaternion_at(row, NEXT, lane), joint_frame))
        put_vector(row, NEXT_SWING, lane, (x, y, twist))
        value = x * inverse_x * x * inverse_x + y * inverse_y * y * inverse_y
        last = vector_at(row, LAST, lane)
        u, v = last[0] * inverse_x, last[1] * inverse_y
        du, dv = x * inverse_x - u, y * inverse_y - v
        # The ray from the last swing through the next one leaves the ellipse at `leaving` of its way.
        square = du * du + dv * dv + TINY
        along = u * du + v * dv
        left = max(ENLARGED * ENLARGED * row[SWING_BOUND + lane] - u * u - v * v, ZERO)
        leaving = (np.sqrt(along * along + square * left) - along) / square
        share = min(approach * leaving, ONE)
        row[WAY_SHARE + lane] = share
        is_outside |= (share < ONE) | (value > bound) | (twist > high) | (twist < low)
    return is_outside


@inlined_kernel
def excess_row(inverse_x: Any, inverse_y: Any, free_twist: Any, row: Any, out_largest: Any) -> None:
    """Find how far a joint's next rotation is beyond its room.

    Parameters
    ----------
    inverse_x, inverse_y : float32
        See `LimitArrays.inverse_swing`.
    free_twist : float32
        See `LimitArrays.is_free`.
    row : (JOINT_ROW,) float32
        The joint, after `find_limit_row`: its excess is written, 0 within the room.
    out_largest : (16,) float32
        Largest excess of all joints, in and out, rad.
    """
    for lane in range(LANES):
        x, y, twist = vector_at(row, NEXT_SWING, lane)
        bound, low, high = vector_at(row, ROOM, lane)
        value = x * inverse_x * x * inverse_x + y * inverse_y * y * inverse_y
        swing = TWO * np.sqrt(x * x + y * y) * (ONE - np.sqrt(bound / max(value, bound)))
        swing = swing if value > bound + SLACK * bound else ZERO
        twist = max(twist - high, low - twist)
        twist = TWO * free_twist * twist if twist > SLACK else ZERO
        row[EXCESS + lane] = swing
        row[EXCESS + LANES + lane] = twist
        out_largest[lane] = max(out_largest[lane], swing, twist)


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
    largest: Any,
    row: Any,
    out_violations: Any,
) -> None:
    """Bring a joint's next rotation into its room, and fix the gravest of the directions that would leave it.

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
    largest : (16,) float32
        Largest excess of all joints, rad. Directions are fixed where it is not much more than their own:
        others may come back by themselves when the worst ones are fixed.
    row : (JOINT_ROW,) float32
        The joint, after `excess_row`: its next rotation is projected; drift and mobility lose what is fixed.
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
        last = vector_at(row, LAST, lane)
        share = row[WAY_SHARE + lane]
        is_whole = share >= ONE
        x = x if is_whole else last[0] + share * (x - last[0])
        y = y if is_whole else last[1] + share * (y - last[1])
        value = x * inverse_x * x * inverse_x + y * inverse_y * y * inverse_y
        is_inside = is_whole & (value <= bound) & (twist >= low) & (twist <= high) & (is_free > ZERO)
        share = np.sqrt(bound / max(value, bound))
        swing_excess, twist_excess = row[EXCESS + lane], row[EXCESS + LANES + lane]
        least = max(GRAVE * largest[lane], TINY)
        swings_out = is_running[lane] if swing_excess >= least else ZERO
        twists_out = is_running[lane] if twist_excess >= least else ZERO
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
        swings_out = fix_direction(row, lane, normal, dot(normal, motion), weight, swings_out)
        normal = rotate(frame, twist_normal(x, y))
        twists_out = fix_direction(row, lane, normal, dot(normal, motion), weight, twists_out)
        out_violations[lane] += swings_out + twists_out
