"""How long reaching hands take: as in the examples, and longer where joints turn farther than there."""

import math
from typing import Any

from crowd_kernels._jit import inlined_kernel
from crowd_kernels.reach_blend import (
    JOINTS,
    LEFT_ARM,
    LOWER,
    RIGHT_ARM,
    ZERO,
    ReachKeys,
    sum_examples,
    unit_row,
)
from crowd_kernels.reach_state import APEX, END, RETURN, ReachLimits, ReachState, vector_of
from crowd_kernels.vector import norm

PEAK = 5.7735
"""Largest acceleration of minimum-jerk motion, over its way and its time squared."""
SHARED_TIME = 0.2
"""Further share of its time that a hand takes while the other one shares the trunk."""


@inlined_kernel
def joint_cosine(row: Any, other: Any, k: int) -> float:
    """Find the cosine of half the angle between a joint of two compact rows (96,)."""
    cosine = (
        row[k] * other[k]
        + row[JOINTS + k] * other[JOINTS + k]
        + row[2 * JOINTS + k] * other[2 * JOINTS + k]
        + row[3 * JOINTS + k] * other[3 * JOINTS + k]
    )
    return max(min(float(cosine), 1.0), -1.0)


@inlined_kernel
def largest_turn(row: Any, other: Any) -> float:
    """Find the largest angle between joints of two compact rows (96,), as blends go from one to the other."""
    least = 1.0
    for k in range(JOINTS):
        least = min(least, joint_cosine(row, other, k))
    return 2.0 * math.acos(least)


@inlined_kernel
def time_to_turn(turn: float, acceleration: float) -> float:
    """Find the time in which joints turn by an angle, rad, with least jerk and at most an acceleration; s.

    Notes
    -----
    **Source:** the acceleration of minimum-jerk motion; Flash, Hogan, 1985.
    """
    return math.sqrt(PEAK * turn / acceleration)


@inlined_kernel
def turn_to_examples(
    character: int,
    arm: int,
    course: float,
    other: float,
    walking_share: float,
    keys: ReachKeys,
    state: ReachState,
    live: Any,
    row: Any,
) -> float:
    """Find how far joints must turn from the pose below to the examples of one hand, as far as these count.

    Parameters
    ----------
    character, arm : int
    course : float
        0 or `END`: the examples are at rest.
    other : float
        Share of the other hand's examples.
    walking_share : float
        Share of locomotion in the pose.
    keys : ReachKeys
    state : ReachState
    live : (96,) float32
        Compact row of the pose below.
    row : (96,) float32
        Scratch.

    Returns
    -------
    float
        The largest of all joints, rad.
    """
    row[:] = ZERO
    _, whole = sum_examples(character, arm, 0, course, state.example_weight, keys, state, row)
    _, upper = sum_examples(character, arm, 1, course, state.example_weight, keys, state, row)
    unit_row(row)
    own_arm, other_arm = (RIGHT_ARM, LEFT_ARM) if arm == 0 else (LEFT_ARM, RIGHT_ARM)
    largest = 0.0
    for k in range(keys.joint.shape[0]):
        # As in `blend_shares`: trunk and legs are shared, the other arm balances where it is free.
        share = 1.0 / (1.0 + other)
        if keys.group[LOWER * JOINTS + k] > ZERO:
            share *= whole / (whole + upper)
        elif keys.group[other_arm * JOINTS + k] > ZERO:
            share = (1.0 - other) * (1.0 - walking_share)
        elif keys.group[own_arm * JOINTS + k] > ZERO:
            share = 1.0
        largest = max(largest, share * 2.0 * math.acos(abs(joint_cosine(row, live, k))))
    return largest


@inlined_kernel
def set_out(
    character: int,
    arm: int,
    slower: float,
    other: float,
    walking_share: float,
    keys: ReachKeys,
    limits: ReachLimits,
    state: ReachState,
    live: Any,
    row: Any,
) -> None:
    """Find the least time between rest and goal of one hand that sets out from either one.

    Examples at rest may be far from the pose below, as from folded arms, and come and go no faster for that.

    Parameters
    ----------
    slower : float
        Time of the way back over that of the way there.
    limits : ReachLimits
    state : ReachState
        In and out: `lead_time`.

    Notes
    -----
    All other arguments are those of `turn_to_examples`.
    """
    course = state.course[character, arm]
    returns = course == APEX and state.stage[character, arm] == RETURN
    if course == 0.0 or returns:
        rest = END if returns else 0.0
        turn = turn_to_examples(character, arm, rest, other, walking_share, keys, state, live, row)
        time = time_to_turn(turn, limits.lead_acceleration) / limits.lead
        state.lead_time[character, arm] = time / slower if returns else time


@inlined_kernel
def reach_time(
    character: int, arm: int, there: float, size: float, other: float, limits: ReachLimits, state: ReachState
) -> float:
    """Find the time of one hand from rest to its goal, s.

    Parameters
    ----------
    character, arm : int
    there : float
        That of the blended examples, s.
    size : float
        Stature over the library's.
    other : float
        Share of the other hand's examples.
    limits : ReachLimits
    state : ReachState
    """
    time = float(state.seconds[character, arm])
    if time <= 0.0:
        # Long limbs move more slowly (dynamic similarity).
        time = max(there * math.sqrt(size), limits.time_per_radian * state.turn[character, arm])
        time = max(time, state.lead_time[character, arm])
        far = norm(vector_of(state.offset, character, arm))
        time += other * (SHARED_TIME * time + limits.time_shared * far)
    ahead = APEX - state.course[character, arm]
    if ahead > 0.0 and state.stage[character, arm] != RETURN:
        # On its way there a hand is not at the apex before it has glided to its new target.
        time = max(time, state.time_left[character, arm] / ahead)
    return time
