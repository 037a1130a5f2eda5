"""Where inverse kinematics takes reaching hands: from the blended motion exactly to their goals."""

import math
from typing import Any

from crowd_kernels._jit import inlined_kernel
from crowd_kernels.clip import PADDED_JOINTS
from crowd_kernels.easing import minimum_jerk
from crowd_kernels.quaternion import (
    Quaternion,
    conjugate,
    from_rotation_vector,
    multiply,
    normalized,
    rotation_vector,
    slerp,
)
from crowd_kernels.reach_blend import CHAIN, JOINTS, ROW, ReachKeys, read_joints
from crowd_kernels.reach_correction import LANES as CORRECTED
from crowd_kernels.reach_course import course_shares, kept_share
from crowd_kernels.reach_glide import glide, goal_now, shortened
from crowd_kernels.reach_missing import BOTH, spare_missing_place, spare_missing_turn
from crowd_kernels.reach_place import (
    local_rotation,
    pelvis_of,
    place_alone,
    place_apex,
    place_hand,
    place_point,
)
from crowd_kernels.reach_state import APEX, END, NONE, ReachLimits, ReachState, set_vector, vector_of
from crowd_kernels.vector import Vector, add, norm, scaled, subtract

PLACE = 1
"""Task of a hand: position; with rotation it is `BOTH`."""
BOUND = 0.5
"""Course from which on joints are bound to approach their limits slowly."""
USUAL_STEP = 1.0 / 60.0
"""Time in which joints are bound by as much as their course says, s."""
LATE = 0.5
"""From this course on hands go by where the trunk is that they share, not by their own examples' alone."""
SHARED_TRUNK = 0.25
"""How much farther hands may be from their goals where both share the trunk, m."""


@inlined_kernel
def turn_trunk(keys: ReachKeys, correction: Any, change: Any, row: Any) -> None:
    """Turn the joints that both hands share as they will be corrected if that goes on as it did.

    Parameters
    ----------
    keys : ReachKeys
    correction, change : (96,) float32
        Rows of `reach_correction` and `reach_correction_change`.
    row : (96,) float32
        In and out: compact row.
    """
    for k in range(CHAIN):
        joint = keys.chain[0, k]
        if joint == keys.chain[1, k]:
            at = keys.chain_place[0, k]
            x, y, z = (
                float(correction[at] + change[at]),
                float(correction[CORRECTED + at] + change[CORRECTED + at]),
                float(correction[2 * CORRECTED + at] + change[2 * CORRECTED + at]),
            )
            w = math.sqrt(max(1.0 - x * x - y * y - z * z, 0.0))
            turned = multiply(normalized((w, x, y, z)), local_rotation(row, joint, JOINTS))
            row[joint] = turned[0]
            row[JOINTS + joint] = turned[1]
            row[2 * JOINTS + joint] = turned[2]
            row[3 * JOINTS + joint] = turned[3]


@inlined_kernel
def share_of_other(character: int, arm: int, risen: float, limits: ReachLimits, state: ReachState) -> float:
    """Find how much of a shared trunk's correction a hand leaves to the other one.

    All of it at rest, nothing at the apex, where the hand must be at its goal whatever the trunk does.
    """
    if state.stage[character, 1 - arm] == NONE:
        return 0.0
    _, other = course_shares(state.course[character, 1 - arm], limits.lead)
    return (1.0 - risen) * other / (risen + other) if other > 0.0 else 0.0


@inlined_kernel
def leave_trunk(
    character: int,
    arm: int,
    here: Vector,
    turned: Quaternion,
    scale: Any,
    pelvis: Vector,
    keys: ReachKeys,
    limits: ReachLimits,
    state: ReachState,
    row: Any,
    pose: Any,
    correction: Any,
    change: Any,
) -> tuple[Vector, Quaternion]:
    """Let a hand that is hardly on its way go along with the trunk that the other hand turns.

    Parameters
    ----------
    character, arm : int
    here : tuple of float
        Point of the hand as blended, root frame, m.
    turned : tuple of float
        Rotation of the hand likewise.
    pelvis : tuple of float
        Root frame, m.
    row : (96,) float32
        Scratch.

    Returns
    -------
    tuple of float, tuple of float
        Both with the other hand's part in the correction of the trunk.

    Notes
    -----
    All other arguments are those of `aim_hand`.
    """
    _, risen = course_shares(state.course[character, arm], limits.lead)
    left = share_of_other(character, arm, risen, limits, state)
    if left <= 0.0:
        return here, turned
    read_joints(keys, pose, row)
    turn_trunk(keys, correction, change, row)
    carried, carried_turn = place_point(
        character, arm, scale, pelvis, local_rotation(row, 0, JOINTS), keys, state, row, JOINTS
    )
    return add(here, scaled(subtract(carried, here), left)), slerp(turned, carried_turn, left)


@inlined_kernel
def leave_other(
    character: int,
    arm: int,
    other: float,
    walking_share: float,
    here: Vector,
    turned: Quaternion,
    apex: Vector,
    apex_turned: Quaternion,
    scale: Any,
    live_pelvis: Vector,
    keys: ReachKeys,
    limits: ReachLimits,
    state: ReachState,
    rows: Any,
) -> tuple[Vector, Quaternion]:
    """Find how far the other hand's examples take a hand close to its goal and shall not follow them.

    A trunk that both hands share does not do what the examples of either one foresee.

    Parameters
    ----------
    character, arm : int
    here, turned : tuple of float
        Point of the hand as blended, root frame, m, and rotation of the hand.
    apex, apex_turned : tuple of float
        Both where its own blend is at the apex.

    Returns
    -------
    tuple of float, tuple of float
        Way over the share of the correction at this course, m, and rotation of the hand without the other's
        examples; both as far as they count.

    Notes
    -----
    All other arguments are those of `aim_hand`.
    """
    course = state.course[character, arm]
    side = course if course <= APEX else END - course
    late = minimum_jerk(max((side - LATE) / (1.0 - LATE), 0.0))
    if other <= 0.0 or late <= 0.0:
        return (0.0, 0.0, 0.0), turned
    share, risen = course_shares(course, limits.lead)
    alone, alone_turned = apex, apex_turned
    if course != APEX:
        alone, alone_turned = place_alone(
            character, arm, share, walking_share, scale, live_pelvis, keys, state, rows
        )
    return scaled(subtract(here, alone), late / risen), slerp(turned, alone_turned, late)


@inlined_kernel
def begin_turn(
    character: int,
    arm: int,
    begins: bool,
    asked: float,
    before: Quaternion,
    turned: Quaternion,
    state: ReachState,
) -> Quaternion:
    """Let a rotation that comes to be asked for on the way begin with that which the hand had.

    Parameters
    ----------
    character, arm : int
    begins : bool
        It is asked for from now on.
    asked : float
        Share of what is asked for.
    before, turned : tuple of float
        Rotation of the hand in the last step, and as blended.
    state : ReachState
        In and out: `turn_before`.

    Returns
    -------
    tuple of float
        Rotation that is turned by the share of what is missing.
    """
    if begins:
        set_vector(state.turn_before, character, arm, rotation_vector(multiply(before, conjugate(turned))))
    if asked <= 0.0 or asked >= 1.0:
        return turned
    turn = scaled(vector_of(state.turn_before, character, arm), 1.0 - asked)
    return multiply(from_rotation_vector(turn), turned)


@inlined_kernel
def offset_now(
    character: int,
    arm: int,
    other: float,
    way: Vector,
    away: Vector,
    limits: ReachLimits,
    dt: float,
    state: ReachState,
) -> Vector:
    """Find what inverse kinematics shall move one hand by at its apex, which glides where targets jump.

    Parameters
    ----------
    character, arm : int
    other : float
        Share of the other hand's examples.
    way : tuple of float
        From the point of the hand at the apex of its blend to its goal, m.
    away : tuple of float
        What of it the other hand's examples do, see `leave_other`.
    limits : ReachLimits
    dt : float
        s.
    state : ReachState
        In and out: `away`, and what `glide` changes.

    Returns
    -------
    tuple of float
        m.
    """
    # Beyond the blends inverse kinematics would find nothing that looks human.
    farthest = limits.farthest + SHARED_TRUNK * other
    wish = shortened(subtract(way, away), farthest)
    moved = scaled(vector_of(state.seen_velocity, character, arm), dt)
    before = subtract(subtract(way, moved), vector_of(state.away, character, arm))
    step = subtract(wish, shortened(before, farthest))
    set_vector(state.away, character, arm, away)
    is_first = state.course[character, arm] <= state.course_rate[character, arm] * dt
    return glide(character, arm, wish, step, farthest, is_first, dt, state)


@inlined_kernel
def aim_hand(
    character: int,
    arm: int,
    other: float,
    begins: bool,
    walking_share: float,
    scale: Any,
    live_pelvis: Vector,
    live_rotation: Quaternion,
    keys: ReachKeys,
    limits: ReachLimits,
    state: ReachState,
    dt: float,
    rows: Any,
    pose: Any,
    pelvis: Any,
    correction: Any,
    change: Any,
    last: Any,
    out_task: Any,
    out_target: Any,
    out_target_rotation: Any,
    out_kept: Any,
    out_bound: Any,
) -> None:
    """Set where inverse kinematics takes one hand: exactly to the goal at the apex.

    The blended motion is moved by a growing share of what it will miss at its apex.

    Parameters
    ----------
    other : float
        Share of the other hand's examples.
    begins : bool
        A rotation is asked for from now on.
    walking_share : float
        Share of locomotion in the pose.
    scale : (G,) float32
        Proportions.
    live_pelvis, live_rotation : tuple of float
        Pelvis of the pose below this layer, root frame, m.
    rows : (SCRATCH_ROW,) float32
        Scratch, after `blend_body`.
    pose : (256,) float32
        Pose row, blended.
    pelvis : (3,) float32
        Pelvis at leg scale 1, m.
    correction, change : (96,) float32
        Last corrections of the character's joints and how they changed, see `reach_correction`.
    last : (256,) float32
        Last solution of inverse kinematics, see `start_solves`.

    Notes
    -----
    All other arguments are those of `reach_character`.

    **Source:** Feng, Xu, Shapiro, section 5.2, the target that varies in time.
    **Differs from the source:** the share rises along a minimum-jerk curve instead of evenly, so that the
    hand neither starts nor stops abruptly.
    """
    course = state.course[character, arm]
    _, risen = course_shares(course, limits.lead)
    asked = minimum_jerk(state.rotation_share[character, arm])
    kept = kept_share(course, state.course_rate[character, arm] * dt, limits.lead)
    out_kept[character, arm] = kept
    beginning = minimum_jerk(min(course / BOUND, 1.0))
    out_bound[character, arm] = kept * kept * math.pow(beginning, dt / USUAL_STEP)
    kept *= math.exp(-limits.missing_rate * dt)
    body, rotation = pelvis_of(keys, scale, pose, pelvis)
    here, turned = place_point(character, arm, scale, body, rotation, keys, state, pose, PADDED_JOINTS)
    row = rows[:ROW]
    apex, apex_turned = here, turned
    if course != APEX or state.time_left[character, arm] > 0.0 or other > 0.0:
        apex, apex_turned = place_apex(
            character, arm, state.example_weight, scale, live_pelvis, live_rotation, keys, state, row
        )
    away, turned = leave_other(
        character,
        arm,
        other,
        walking_share,
        here,
        turned,
        apex,
        apex_turned,
        scale,
        live_pelvis,
        keys,
        limits,
        state,
        rows,
    )
    here, turned = leave_trunk(
        character, arm, here, turned, scale, body, keys, limits, state, row, pose, correction, change
    )
    goal, wanted = goal_now(
        character, arm, apex, apex_turned, scale, live_pelvis, live_rotation, keys, state, row
    )
    offset = offset_now(character, arm, other, subtract(goal, apex), away, limits, dt, state)
    target = add(here, scaled(offset, risen))
    out_task[character, arm] = PLACE
    state.turn[character, arm] = 0.0
    if asked > 0.0 or state.has_rotation[character, arm]:
        turn = rotation_vector(multiply(wanted, conjugate(apex_turned)))
        state.turn[character, arm] = norm(turn)
        before = turned
        if begins:
            _, before = place_hand(keys, arm, scale, body, rotation, last, PADDED_JOINTS)
        turned = begin_turn(character, arm, begins, asked, before, turned, state)
        turned = multiply(from_rotation_vector(scaled(turn, risen * asked)), turned)
    if asked > 0.0:
        out_task[character, arm] = BOTH
        turned = spare_missing_turn(turned, character, arm, kept, dt, state)
    target = spare_missing_place(target, character, arm, kept, dt, state)
    for axis in range(3):
        out_target[character, arm, axis] = target[axis]
    for component in range(4):
        out_target_rotation[character, arm, component] = turned[component]
