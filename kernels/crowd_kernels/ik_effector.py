"""Row leaves of inverse kinematics for one effector: what it misses, and what its push does to joints."""

from typing import Any

import numpy as np

from crowd_kernels._jit import inlined_kernel
from crowd_kernels.ik_layout import (
    ANGLE,
    DISTANCE,
    FRAME,
    IS_FAR,
    LENGTH,
    MISS,
    ONE,
    PLACE,
    POINT,
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
