"""Which examples a reaching hand blends: those of its target, taken up as gradually as it goes there."""

import math
from typing import Any

from crowd_kernels._jit import inlined_kernel
from crowd_kernels.easing import settle_shares
from crowd_kernels.quaternion import Quaternion, rotate
from crowd_kernels.reach_blend import ReachKeys
from crowd_kernels.reach_space import FAR, NEAREST, SCRATCH, ReachArrays, weigh_examples
from crowd_kernels.reach_state import ReachLimits, ReachState, set_vector, vector_of
from crowd_kernels.vector import Vector, add, norm, scaled, subtract

SLOTS = 72
"""Most examples that are blended for one hand: all that the built-in library has, standing and seated. Hands
that are sent on again and again blend more and more of them."""
STRAYED = 0.05
"""Examples of a gliding hand are looked up again when its target has moved as far as this, m."""
SHARE_STEP = 0.5
"""Share of the upper body's examples that comes or goes in one step when people sit down."""
LEAST_WEIGHT = 1e-4
"""Weights that fade end here."""
SAME_PLACE = 0.004
"""A look-up serves places this close to its own, m; a tenth of the spacing of pseudo-examples."""
SAME_SHARE = 0.01
"""Likewise for the share of the upper body's examples."""


@inlined_kernel
def wrist_of_goal(
    keys: ReachKeys,
    arm: int,
    goal: Vector,
    rotation: Quaternion,
    has_rotation: bool,
    point: Vector,
    size: float,
) -> Vector:
    """Estimate where the wrist is when a point of the hand is at its goal, root frame, m."""
    length = norm(point)
    if length == 0.0:
        return goal
    if has_rotation:
        return subtract(goal, rotate(rotation, point))
    shoulder = (size * keys.shoulder[arm, 0], size * keys.shoulder[arm, 1], size * keys.shoulder[arm, 2])
    way = subtract(goal, shoulder)
    distance = max(norm(way), 1e-6)
    return subtract(goal, scaled(way, min(length / distance, 0.5)))


@inlined_kernel
def look_up(
    part: int,
    arm: int,
    wrist: Vector,
    pelvis: Vector,
    size: float,
    space: ReachArrays,
    keys: ReachKeys,
    number: Any,
    real: Any,
) -> int:
    """Find the examples of a set for a wrist; those of seated people relative to the pelvis as it is.

    Parameters
    ----------
    part : int
        0 the whole body, 1 the upper body.
    arm : int
    wrist, pelvis : tuple of float
        Root frame, m.
    size : float
        Stature over the library's.
    space : ReachArrays
    keys : ReachKeys
    number : (20,) int32
        Scratch; the examples are written from `NEAREST` on, some of them more than once.
    real : (100 + E,) float64
        Scratch; the weights of the examples are added from `SCRATCH` on.

    Returns
    -------
    int
        How many examples are written.
    """
    place = scaled(wrist, 1.0 / size)
    if part == 1:
        rest = (keys.pelvis_rest[2 + arm, 0], keys.pelvis_rest[2 + arm, 1], keys.pelvis_rest[2 + arm, 2])
        place = add(scaled(subtract(wrist, pelvis), 1.0 / size), rest)
    return weigh_examples(space, 2 * part + arm, place[0], place[1], place[2], number, real, real[SCRATCH:])


@inlined_kernel
def is_looked_up(
    character: int,
    arm: int,
    wrist: Vector,
    pelvis: Vector,
    upper_share: float,
    limits: ReachLimits,
    state: ReachState,
) -> bool:
    """Tell whether the last look-up serves, as nothing that it depends on has moved away from it.

    While a hand glides its target may move farther, and at last anywhere: the glide ends where the wanted
    examples have the hand, and has a kink where others are wanted.

    Parameters
    ----------
    character, arm : int
    wrist, pelvis : tuple of float
        Root frame, m.
    upper_share : float
        0: the whole body reaches; 1: only the upper body.
    limits : ReachLimits
    state : ReachState
    """
    share = state.looked_up_share[character, arm]
    if (upper_share <= 0.0) != (share <= 0.0) or (upper_share >= 1.0) != (share >= 1.0):
        return False
    if abs(upper_share - share) > SAME_SHARE:
        return False
    moved = subtract(wrist, vector_of(state.looked_up, character, arm))
    largest = SAME_PLACE
    if state.time_left[character, arm] > 0.0:
        largest = STRAYED if state.time_left[character, arm] > limits.least_time else FAR
    if norm(moved) > largest:
        return False
    if upper_share <= 0.0:
        return True
    moved = subtract(moved, subtract(pelvis, vector_of(state.looked_up_pelvis, character, arm)))
    return norm(moved) <= largest


@inlined_kernel
def add_wanted(share: float, example: Any, weight: Any, character: int, arm: int, state: ReachState) -> None:
    """Add the weights that examples shall have to their slots, or to free ones.

    Where none is free, the example that weighs least of those that fade makes room.

    Parameters
    ----------
    share : float
        Factor of the weights.
    example : (S,) int32
        Examples, some of them more than once.
    weight : (E,) float64
        In and out: weights of all examples; then 0 for these.
    character, arm : int
    state : ReachState
        In and out: `example`, `example_wanted`, `example_count`.
    """
    count = state.example_count[character, arm]
    for slot in range(count):
        clip = state.example[character, arm, slot]
        if is_slot_used(character, arm, slot, state):
            state.example_wanted[character, arm, slot] += share * weight[clip]
            weight[clip] = 0.0
    free = 0
    for sample in range(example.shape[0]):
        clip = example[sample]
        wanted = share * weight[clip]
        weight[clip] = 0.0
        if not wanted > 0.0:
            continue
        while free < count and is_slot_used(character, arm, free, state):
            free += 1
        slot = free if free < SLOTS else lightest_slot(character, arm, state)
        state.example[character, arm, slot] = clip
        state.example_weight[character, arm, slot] = 0.0
        state.example_weight_rate[character, arm, slot] = 0.0
        state.example_weight_acceleration[character, arm, slot] = 0.0
        state.example_wanted[character, arm, slot] = wanted
        count = max(count, slot + 1)
    state.example_count[character, arm] = count


@inlined_kernel
def lightest_slot(character: int, arm: int, state: ReachState) -> int:
    """Find the slot whose example weighs least of those that shall have no weight."""
    lightest = 0
    least = FAR
    for slot in range(SLOTS):
        weight = abs(state.example_weight[character, arm, slot])
        if state.example_wanted[character, arm, slot] == 0.0 and weight < least:
            lightest = slot
            least = weight
    return lightest


@inlined_kernel
def is_slot_used(character: int, arm: int, slot: int, state: ReachState) -> bool:
    """Tell whether a slot holds an example: one that has a weight or shall have one."""
    has_weight = state.example_weight[character, arm, slot] != 0.0
    return bool(has_weight or state.example_wanted[character, arm, slot] != 0.0)


@inlined_kernel
def look_up_examples(
    character: int,
    arm: int,
    wrist: Vector,
    pelvis: Vector,
    size: float,
    upper_share: float,
    space: ReachArrays,
    keys: ReachKeys,
    state: ReachState,
    number: Any,
    real: Any,
) -> None:
    """Set the weights that one hand's examples come to, of both sets that are needed.

    Parameters
    ----------
    character, arm : int
    upper_share : float
        0: the whole body reaches; 1: only the upper body.
    state : ReachState
        In and out: `example` and what belongs to it, `looked_up` likewise.

    Notes
    -----
    All other arguments are those of `look_up`.
    """
    for slot in range(state.example_count[character, arm]):
        state.example_wanted[character, arm, slot] = 0.0
    for part in range(2):
        share = upper_share if part == 1 else 1.0 - upper_share
        if share <= 0.0:
            continue
        found = look_up(part, arm, wrist, pelvis, size, space, keys, number, real)
        add_wanted(share, number[NEAREST : NEAREST + found], real[SCRATCH:], character, arm, state)
    set_vector(state.looked_up, character, arm, wrist)
    set_vector(state.looked_up_pelvis, character, arm, pelvis)
    state.looked_up_share[character, arm] = upper_share


@inlined_kernel
def find_examples(
    character: int,
    arm: int,
    rotation: Quaternion,
    has_jumped: bool,
    pelvis: Vector,
    size: float,
    upper_share: float,
    limits: ReachLimits,
    space: ReachArrays,
    keys: ReachKeys,
    state: ReachState,
    number: Any,
    real: Any,
) -> tuple[bool, bool]:
    """Find the weights that one hand's examples shall come to; at the start of a reach they have them.

    Parameters
    ----------
    rotation : tuple of float
        Rotation asked for, root frame.
    has_jumped : bool
        The target has jumped.
    upper_share : float
        0: the whole body reaches; 1: only the upper body.

    Returns
    -------
    bool
        A glide begins: the target has jumped, or the person sits down or stands up.
    bool
        Others are wanted than before where the hand glides.

    Notes
    -----
    All other arguments are those of `look_up` and `reach_character`.
    """
    wrist = wrist_of_goal(
        keys,
        arm,
        vector_of(state.seen, character, arm),
        rotation,
        state.rotation_share[character, arm] > 0.0,
        vector_of(state.point_hand, character, arm),
        size,
    )
    is_first = state.course[character, arm] <= 0.0
    if is_first:
        state.example_count[character, arm] = 0
    is_gliding = state.time_left[character, arm] > 0.0
    change = abs(upper_share - state.looked_up_share[character, arm])
    begins = has_jumped or change > (SAME_SHARE if is_gliding else SHARE_STEP)
    is_new = is_first or begins or not is_looked_up(character, arm, wrist, pelvis, upper_share, limits, state)
    if is_new:
        look_up_examples(character, arm, wrist, pelvis, size, upper_share, space, keys, state, number, real)
    if is_first:
        for slot in range(state.example_count[character, arm]):
            state.example_weight[character, arm, slot] = state.example_wanted[character, arm, slot]
            state.example_weight_rate[character, arm, slot] = 0.0
            state.example_weight_acceleration[character, arm, slot] = 0.0
        return False, False
    return begins, is_gliding and is_new


@inlined_kernel
def follow_weights(
    character: int, arm: int, limits: ReachLimits, keys: ReachKeys, dt: float, state: ReachState
) -> tuple[float, float]:
    """Bring the weights of one hand's examples nearer to those that are wanted.

    They are there when its glide ends, but no sooner than in `example_time`, which is longer where much is to
    change.

    The weights of a look-up have kinks as a target moves; those of the blend follow them smoothly.

    Parameters
    ----------
    character, arm : int
    limits : ReachLimits
    keys : ReachKeys
    dt : float
        s.
    state : ReachState
        In and out: `example_weight`, its derivatives, `example_count`.

    Returns
    -------
    float, float
        Times of the blended examples to their apex and from there to their end, s.

    Notes
    -----
    **Source:** `easing.settle`, which is linear in place, velocity and acceleration.
    """
    change = 0.0
    for slot in range(state.example_count[character, arm]):
        change += abs(state.example_wanted[character, arm, slot] - state.example_weight[character, arm, slot])
    # Where much is to change, as from one tetrahedron of examples to another, joints turn far.
    time = limits.example_time * math.sqrt(max(0.5 * change / limits.weight_change, 1.0))
    time = max(time, state.time_left[character, arm])
    own, per_rate, per_bend = settle_shares(time, dt)
    total = 0.0
    there = 0.0
    back = 0.0
    count = 0
    for slot in range(state.example_count[character, arm]):
        wanted = state.example_wanted[character, arm, slot]
        away = state.example_weight[character, arm, slot] - wanted
        rate = state.example_weight_rate[character, arm, slot]
        bend = state.example_weight_acceleration[character, arm, slot]
        weight = wanted + own[0] * away + per_rate[0] * rate + per_bend[0] * bend
        next_rate = own[1] * away + per_rate[1] * rate + per_bend[1] * bend
        next_bend = own[2] * away + per_rate[2] * rate + per_bend[2] * bend
        if wanted == 0.0 and abs(weight) + abs(next_rate) * time < LEAST_WEIGHT:
            weight = 0.0
            next_rate = 0.0
            next_bend = 0.0
        state.example_weight[character, arm, slot] = weight
        state.example_weight_rate[character, arm, slot] = next_rate
        state.example_weight_acceleration[character, arm, slot] = next_bend
        if weight != 0.0 or wanted != 0.0:
            count = slot + 1
        clip = state.example[character, arm, slot]
        total += weight
        there += weight * keys.apex_time[clip]
        back += weight * (keys.end_time[clip] - keys.apex_time[clip])
    state.example_count[character, arm] = count
    return there / total, back / total
