"""Row leaves of inverse kinematics for one effector: what it misses, and what joints can do about it."""

from typing import Any

import numpy as np

from crowd_kernels._jit import inlined_kernel
from crowd_kernels.ik_joint import mobility_at
from crowd_kernels.ik_layout import (
    ANGLE,
    DISTANCE,
    DRIFT,
    FRAME,
    IS_FAR,
    LENGTH,
    MISS,
    ONE,
    PLACE,
    POINT,
    PUSH,
    STEP,
    TARGET,
    TARGET_FRAME,
    TINY,
    TIP,
    TURNS,
    TWO,
    WANTS_FRAME,
    WANTS_PLACE,
    ZERO,
    put_vector,
    quaternion_at,
    vector_at,
)
from crowd_kernels.lanes import LANES
from crowd_kernels.quaternion import conjugate, multiply, rotate
from crowd_kernels.vector import cross, dot, subtract

SIXTH: Any = np.float32(1.0 / 6.0)
ASIN_FIFTH: Any = np.float32(0.075)
ANGLE_LENGTH: Any = np.float32(0.3)


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
