"""Reaching: poses of many characters, and the targets that inverse kinematics takes their hands to."""

import math
from typing import Any

from crowd_kernels._jit import inlined_kernel, parallel_kernel, prange
from crowd_kernels.clip import PADDED_JOINTS
from crowd_kernels.easing import minimum_jerk
from crowd_kernels.quaternion import (
    Quaternion,
    conjugate,
    from_rotation_vector,
    multiply,
    normalized,
    rotate,
    rotation_vector,
    slerp,
)
from crowd_kernels.reach_blend import (
    CHAIN,
    ROW,
    ReachKeys,
    blend_body,
    bone_of,
    local_rotation,
    pelvis_of,
    place_hand,
)
from crowd_kernels.reach_correction import LANES as CORRECTED
from crowd_kernels.reach_examples import find_examples, follow_weights
from crowd_kernels.reach_glide import (
    glide,
    is_elsewhere,
    place_apex,
    plan_glide,
    shortened,
    still_to_come,
    take_over,
)
from crowd_kernels.reach_goal import (
    APEX,
    END,
    NONE,
    RETURN,
    ReachLimits,
    ReachState,
    advance_course,
    course_shares,
    follow_rotation,
    quaternion_of,
    set_quaternion,
    set_vector,
    track_target,
    vector_of,
)
from crowd_kernels.reach_missing import spare_missing_place, spare_missing_turn
from crowd_kernels.reach_space import ReachArrays
from crowd_kernels.vector import Vector, add, norm, scaled, subtract

CHUNKS = 32
SHARED_TRUNK = 0.25
"""How much farther hands may be from their goals where both share the trunk, m."""


@inlined_kernel
def carried_hand(
    keys: ReachKeys, arm: int, scale: Any, pelvis: Vector, pose: Any, correction: Any
) -> tuple[Vector, Quaternion]:
    """Find where a hand would be if only the trunk were corrected, as it was in the last step.

    Parameters
    ----------
    keys : ReachKeys
    arm : int
    scale : (G,) float32
        Proportions.
    pelvis : tuple of float
        Root frame, m.
    pose : (256,) float32
        Pose row, blended.
    correction : (96,) float32
        Row of `reach_correction`.

    Returns
    -------
    tuple of float, tuple of float
        Position, m, and rotation of the hand, root frame.
    """
    place = pelvis
    turned = (1.0, 0.0, 0.0, 0.0)
    for k in range(CHAIN):
        if k > 0:
            place = add(place, rotate(turned, bone_of(keys, arm, k, scale)))
        if keys.chain[0, k] == keys.chain[1, k]:
            at = keys.chain_place[arm, k]
            x, y, z = (
                float(correction[at]),
                float(correction[CORRECTED + at]),
                float(correction[2 * CORRECTED + at]),
            )
            w = math.sqrt(max(1.0 - x * x - y * y - z * z, 0.0))
            turned = multiply(turned, (w, x, y, z))
        turned = multiply(turned, local_rotation(pose, keys.joint[keys.chain[arm, k]], PADDED_JOINTS))
    return place, normalized(turned)


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
def kept_share(course: float, advance: float, lead: float) -> float:
    """Find how much of its last correction a hand keeps: on its way back less in each step, at rest nothing.

    Parameters
    ----------
    course : float
    advance : float
        How far the course went in this step.
    lead : float
        See `ReachLimits`.
    """
    _, now = course_shares(course, lead)
    _, before = course_shares(course - advance, lead)
    return min(now / before, 1.0) if before > 0.0 else 1.0


@inlined_kernel
def aim_hand(
    character: int,
    arm: int,
    other: float,
    begins: bool,
    has_passed: bool,
    scale: Any,
    live_pelvis: Vector,
    live_rotation: Quaternion,
    keys: ReachKeys,
    limits: ReachLimits,
    state: ReachState,
    dt: float,
    row: Any,
    pose: Any,
    pelvis: Any,
    correction: Any,
    last: Any,
    out_task: Any,
    out_target: Any,
    out_target_rotation: Any,
    out_kept: Any,
) -> None:
    """Set where inverse kinematics takes one hand: exactly to the goal at the apex.

    The blended motion is moved by a growing share of what it will miss at its apex.

    Parameters
    ----------
    other : float
        Share of the other hand's examples.
    begins : bool
        A rotation is asked for from now on.
    has_passed : bool
        The course has come to the apex in this step, or left it.
    scale : (G,) float32
        Proportions.
    live_pelvis, live_rotation : tuple of float
        Pelvis of the pose below this layer, root frame, m.
    row : (96,) float32
        Scratch.
    pose : (256,) float32
        Pose row, blended.
    pelvis : (3,) float32
        Pelvis at leg scale 1, m.
    correction : (96,) float32
        Last corrections of the character's joints, see `reach_correction`.
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
    side = course if course <= APEX else END - course
    _, risen = course_shares(course, limits.lead)
    asked = minimum_jerk(state.rotation_share[character, arm])
    has_rotation = state.has_rotation[character, arm] or asked > 0.0
    advance = state.course_rate[character, arm] * dt
    kept = kept_share(course, advance, limits.lead)
    out_kept[character, arm] = kept
    kept *= math.exp(-limits.missing_rate * dt)
    body, rotation = pelvis_of(keys, scale, pose, pelvis)
    hand, turned = place_hand(keys, arm, scale, body, rotation, pose, PADDED_JOINTS)
    point = vector_of(state.point_hand, character, arm)
    goal = vector_of(state.seen, character, arm)
    here = add(hand, rotate(turned, point))
    left = share_of_other(character, arm, risen, limits, state)
    if left > 0.0:
        carried, carried_turn = carried_hand(keys, arm, scale, body, pose, correction)
        carried = add(carried, rotate(carried_turn, point))
        here = add(here, scaled(subtract(carried, here), left))
        turned = slerp(turned, carried_turn, left)
    if begins:
        _, before = place_hand(keys, arm, scale, body, rotation, last, PADDED_JOINTS)
        turn_before = rotation_vector(multiply(before, conjugate(turned)))
        set_vector(state.turn_before, character, arm, turn_before)
    if 0.0 < asked < 1.0:
        turn_before = scaled(vector_of(state.turn_before, character, arm), 1.0 - asked)
        turned = multiply(from_rotation_vector(turn_before), turned)
    wanted = quaternion_of(state.rotation, character, arm)
    apex, apex_turned = here, turned
    is_gliding = state.time_left[character, arm] > 0.0
    if course != APEX or is_gliding:
        apex, apex_turned = place_apex(
            character, arm, state.example_weight, scale, live_pelvis, live_rotation, keys, state, row
        )
    if is_gliding:
        end, end_turned = place_apex(
            character, arm, state.example_wanted, scale, live_pelvis, live_rotation, keys, state, row
        )
        shift, aside = still_to_come(character, arm, apex, end, apex_turned, end_turned, state)
        goal = subtract(goal, shift)
        wanted = multiply(wanted, aside)
        set_quaternion(state.glide_turn, character, arm, aside)
    # Beyond the blends inverse kinematics would find nothing that looks human.
    farthest = limits.farthest + SHARED_TRUNK * other
    nearest = shortened(subtract(goal, here), farthest)
    offset = nearest
    late = 1.0
    out_task[character, arm] = 1
    if course != APEX:
        # A trunk that is shared with the other hand does not do what was foreseen.
        late = minimum_jerk(min(max((side - 0.5) / 0.5, 0.0), 1.0)) * minimum_jerk(min(5.0 * other, 1.0))
        offset = shortened(subtract(goal, apex), farthest)
        if late > 0.0:
            offset = add(offset, scaled(subtract(scaled(nearest, 1.0 / risen), offset), late))
        turn = rotation_vector(multiply(wanted, conjugate(apex_turned)))
        state.turn[character, arm] = norm(turn) if has_rotation else 0.0
        turned = multiply(from_rotation_vector(scaled(turn, risen * asked)), turned)
    elif not has_rotation:
        state.turn[character, arm] = 0.0
    elif state.rotation_share[character, arm] < 1.0:
        state.turn[character, arm] = norm(rotation_vector(multiply(wanted, conjugate(turned))))
    if has_passed and not is_gliding and other > 0.0 and is_elsewhere(character, arm, state):
        offset = take_over(character, arm, nearest, limits, dt, state)
    else:
        offset = glide(character, arm, offset, farthest, course <= advance, dt, state)
    set_vector(state.nearest, character, arm, nearest)
    target = add(here, scaled(offset, risen))
    if asked > 0.0:
        out_task[character, arm] = 3
        turned = slerp(turned, wanted, late * asked)
        turned = spare_missing_turn(turned, character, arm, kept, dt, state)
    target = spare_missing_place(target, character, arm, kept, dt, state)
    for axis in range(3):
        out_target[character, arm, axis] = target[axis]
    for component in range(4):
        out_target_rotation[character, arm, component] = turned[component]


@inlined_kernel
def reach_character(
    character: int,
    space: ReachArrays,
    keys: ReachKeys,
    limits: ReachLimits,
    scale: Any,
    size: float,
    position_world: Vector,
    yaw: float,
    upper_share: float,
    walking_share: float,
    dt: float,
    state: ReachState,
    pose: Any,
    pelvis: Any,
    number: Any,
    real: Any,
    rows: Any,
    correction: Any,
    last: Any,
    out_task: Any,
    out_target: Any,
    out_target_rotation: Any,
    out_kept: Any,
) -> None:
    """Advance both hands of one character, blend its pose, and set the targets of inverse kinematics.

    Parameters
    ----------
    character : int
    scale : (G,) float32
        Proportions.
    size : float
        Stature over the library's.
    position_world : tuple of float
        Root, m.
    yaw : float
        rad.
    upper_share : float
        0: the whole body reaches; 1: only the upper body, as of people who sit or walk.
    walking_share : float
        Share of locomotion in the pose.
    pose : (256,) float32
        In and out: pose row.
    pelvis : (3,) float32
        In and out: pelvis at leg scale 1, m.
    number : (20,) int32
        Scratch.
    real : (100 + E,) float64
        Scratch.
    rows : (SCRATCH_ROW,) float32
        Scratch.
    correction : (96,) float32
        Last corrections of the character's joints, see `reach_correction`.
    last : (256,) float32
        Last solution of inverse kinematics, see `start_solves`.

    Notes
    -----
    All other arguments are those of `reach_crowd`.
    """
    live_pelvis, live_rotation = pelvis_of(keys, scale, pose, pelvis)
    own = (0.0, 0.0)
    begin = (False, False)
    passed = (False, False)
    for arm in range(2):
        if state.stage[character, arm] == NONE:
            continue
        course = state.course[character, arm]
        before = vector_of(state.seen, character, arm)
        shared = SHARED_TRUNK * state.weight[character, 1 - arm]
        is_free = state.rotation_share[character, arm] <= 0.0
        has_jumped, turned = track_target(
            character, arm, position_world, yaw, live_pelvis, size, limits, dt, state
        )
        is_asked = is_free and state.rotation_share[character, arm] > 0.0
        begin = (is_asked, begin[1]) if arm == 0 else (begin[0], is_asked)
        begins, is_new = find_examples(
            character,
            arm,
            turned,
            has_jumped,
            live_pelvis,
            size,
            upper_share,
            limits,
            space,
            keys,
            state,
            number,
            real,
        )
        if begins or is_new:
            plan_glide(
                character,
                arm,
                turned,
                before,
                shared,
                begins,
                scale,
                live_pelvis,
                live_rotation,
                keys,
                limits,
                state,
                rows,
            )
        follow_rotation(character, arm, turned, limits, dt, state)
        there, back = follow_weights(character, arm, limits, keys, dt, state)
        # Long limbs move more slowly (dynamic similarity).
        time = state.seconds[character, arm]
        if time <= 0.0:
            time = max(there * math.sqrt(size), limits.time_per_radian * state.turn[character, arm])
            if shared > 0.0:
                time += limits.time_shared * norm(vector_of(state.offset, character, arm))
        ahead = APEX - course
        if ahead > 0.0 and state.stage[character, arm] != RETURN:
            # On its way there a hand is not at the apex before it has glided to its new target.
            time = max(time, state.time_left[character, arm] / ahead)
        advance_course(character, arm, 1.0 / time, there / (back * time), limits, dt, state)
        has_passed = (course == APEX) != (state.course[character, arm] == APEX)
        passed = (has_passed, passed[1]) if arm == 0 else (passed[0], has_passed)
        if state.stage[character, arm] != NONE:
            share, _ = course_shares(state.course[character, arm], limits.lead)
            state.weight[character, arm] = share
            own = (share, own[1]) if arm == 0 else (own[0], share)
    blend_body(character, walking_share, keys, own, state, rows, pose, pelvis)
    for arm in range(2):
        out_task[character, arm] = 0
        if state.stage[character, arm] != NONE:
            aim_hand(
                character,
                arm,
                own[1 - arm],
                begin[arm],
                passed[arm],
                scale,
                live_pelvis,
                live_rotation,
                keys,
                limits,
                state,
                dt,
                rows[:ROW],
                pose,
                pelvis,
                correction,
                last,
                out_task,
                out_target,
                out_target_rotation,
                out_kept,
            )


@parallel_kernel
def reach_crowd(
    space: ReachArrays,
    keys: ReachKeys,
    limits: ReachLimits,
    segment_scale: Any,
    size: Any,
    position_world: Any,
    yaw: Any,
    is_seated: Any,
    locomotion_weight: Any,
    active: Any,
    dt: float,
    state: ReachState,
    number: Any,
    real: Any,
    rows: Any,
    correction: Any,
    last_rotation: Any,
    pose_rotation: Any,
    pose_pelvis: Any,
    out_task: Any,
    out_target: Any,
    out_target_rotation: Any,
    out_kept: Any,
) -> None:
    """Advance the reaches of many characters, blend their poses, and set the targets of inverse kinematics.

    Parameters
    ----------
    space : ReachArrays
        Sets: standing right and left, seated right and left.
    keys : ReachKeys
    limits : ReachLimits
    segment_scale : (N, G) float32
        Proportions.
    size : (N,) float64
        Stature over that of the library's skeleton.
    position_world : (N, 3) float64
        Root, m.
    yaw : (N,) float64
        rad.
    is_seated : (N,) bool
        The character sits: only the upper body reaches.
    locomotion_weight : (N,) float64
        Share of locomotion in the pose: the more, the more only the upper body reaches.
    active : (A,) int32
        Characters of whom a hand reaches, each once.
    dt : float
        s.
    state : ReachState
        In and out.
    number : (32, 20) int32
        Scratch.
    real : (32, 100 + E) float64
        Scratch; 0 from `SCRATCH` on before and after.
    rows : (32, SCRATCH_ROW) float32
        Scratch.
    correction : (N, 96) float32
        Last corrections, see `reach_correction`.
    last_rotation : (N, 256) float32
        Last solutions, see `start_solves`.
    pose_rotation : (N, 256) float32
        In and out: pose rows.
    pose_pelvis : (N, 3) float32
        In and out: pelvis in the root frame at leg scale 1, m.
    out_task : (N, 2) uint8
        What inverse kinematics is asked: 0 nothing, 1 position, 3 position and rotation.
    out_target : (N, 2, 3) float32
        Places for the points of the hands, root frame, m.
    out_target_rotation : (N, 2, 4) float32
        Rotations of the hands, root frame.
    out_kept : (N, 2) float32
        Share of the last corrections from which inverse kinematics starts.

    Notes
    -----
    **Source:** Feng, Xu, Shapiro, section 5.1 and 5.2.
    **Differs from the source:** the two sections of each example are stretched by themselves, so that apexes
    coincide; from one target to another the weights of the examples, and what they miss, settle with least
    jerk instead of a linear interpolation of poses.
    """
    count = active.shape[0]
    for k in prange(CHUNKS):
        chunk = (k * 37) % CHUNKS
        for index in range(chunk * count // CHUNKS, (chunk + 1) * count // CHUNKS):
            character = active[index]
            walking = min(max(locomotion_weight[character], 0.0), 1.0)
            reach_character(
                character,
                space,
                keys,
                limits,
                segment_scale[character],
                size[character],
                (position_world[character, 0], position_world[character, 1], position_world[character, 2]),
                yaw[character],
                1.0 if is_seated[character] else walking,
                walking,
                dt,
                state,
                pose_rotation[character],
                pose_pelvis[character],
                number[chunk],
                real[chunk],
                rows[chunk],
                correction[character],
                last_rotation[character],
                out_task,
                out_target,
                out_target_rotation,
                out_kept,
            )
