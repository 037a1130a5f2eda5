"""Reaching: poses of many characters, and the targets that inverse kinematics takes their hands to."""

from typing import Any

from crowd_kernels._jit import inlined_kernel, parallel_kernel, prange
from crowd_kernels.reach_aim import SHARED_TRUNK, aim_hand
from crowd_kernels.reach_blend import ROW, ReachKeys, blend_body, read_joints
from crowd_kernels.reach_course import advance_course, course_shares
from crowd_kernels.reach_examples import find_examples, follow_weights
from crowd_kernels.reach_glide import plan_glide
from crowd_kernels.reach_goal import follow_rotation, track_target
from crowd_kernels.reach_place import pelvis_of
from crowd_kernels.reach_space import ReachArrays
from crowd_kernels.reach_state import (
    HOLD,
    NONE,
    OUT_OF_REACH,
    ReachLimits,
    ReachState,
    vector_of,
)
from crowd_kernels.reach_time import reach_time, set_out
from crowd_kernels.vector import Vector, norm

CHUNKS = 32
STILL, STILL_TURN = 1e-5, 1e-2
"""Targets slower than this stand still, m/s and rad/s."""
FAR_OFF = 0.008
"""Hands closer than this to their goals still come there, m."""
LONGEST_WAIT = 3.0
"""People wait no longer for joints to come to rest, s."""


@inlined_kernel
def is_waiting(character: int, state: ReachState) -> bool:
    """Tell whether both hands of a character wait for what stands still, one of them far from its goal."""
    is_far = False
    for arm in range(2):
        if state.stage[character, arm] != HOLD:
            return False
        moves = norm(vector_of(state.seen_velocity, character, arm)) > STILL
        if moves or norm(vector_of(state.turn_velocity, character, arm)) > STILL_TURN:
            return False
        missing = norm(vector_of(state.missing_place, character, arm))
        is_far = is_far or (state.status[character, arm] == OUT_OF_REACH and missing > FAR_OFF)
    return is_far


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
    change: Any,
    last: Any,
    out_task: Any,
    out_target: Any,
    out_target_rotation: Any,
    out_kept: Any,
    out_bound: Any,
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
    correction, change : (96,) float32
        Last corrections of the character's joints and how they changed, see `reach_correction`.
    last : (256,) float32
        Last solution of inverse kinematics, see `start_solves`.

    Notes
    -----
    All other arguments are those of `reach_crowd`.
    """
    live_pelvis, live_rotation = pelvis_of(keys, scale, pose, pelvis)
    live = rows[2 * ROW : 3 * ROW]
    read_joints(keys, pose, live)
    own = (0.0, 0.0)
    begin = (False, False)
    weight = (state.weight[character, 0], state.weight[character, 1])
    for arm in range(2):
        if state.stage[character, arm] == NONE:
            continue
        before = vector_of(state.seen, character, arm)
        shared = SHARED_TRUNK * weight[1 - arm]
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
        slower, other = back / there, weight[1 - arm]
        set_out(character, arm, slower, other, walking_share, keys, limits, state, live, rows[:ROW])
        time = reach_time(character, arm, there, size, other, limits, state)
        advance_course(character, arm, 1.0 / time, there / (back * time), limits, dt, state)
        if state.stage[character, arm] != NONE:
            share, _ = course_shares(state.course[character, arm], limits.lead)
            state.weight[character, arm] = share
            own = (share, own[1]) if arm == 0 else (own[0], share)
    # Where people walk or sit, hands that are at their goals must make up for what moves them.
    waits = upper_share <= 0.0 and is_waiting(character, state)
    state.waited[character] = min(state.waited[character] + dt, LONGEST_WAIT) if waits else 0.0
    blend_body(character, walking_share, keys, own, state, rows, pose, pelvis)
    for arm in range(2):
        out_task[character, arm] = 0
        if state.stage[character, arm] != NONE:
            aim_hand(
                character,
                arm,
                own[1 - arm],
                begin[arm],
                walking_share,
                scale,
                live_pelvis,
                live_rotation,
                keys,
                limits,
                state,
                dt,
                rows,
                pose,
                pelvis,
                correction,
                change,
                last,
                out_task,
                out_target,
                out_target_rotation,
                out_kept,
                out_bound,
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
    change: Any,
    last_rotation: Any,
    pose_rotation: Any,
    pose_pelvis: Any,
    out_task: Any,
    out_target: Any,
    out_target_rotation: Any,
    out_kept: Any,
    out_bound: Any,
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
    correction, change : (N, 96) float32
        Last corrections and how they changed, see `reach_correction`.
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
    out_bound : (N, 2) float32
        How far joints are bound to approach their limits slowly: hardly where a hand begins or ends, as its
        joints are where the blended motion has them.

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
                change[character],
                last_rotation[character],
                out_task,
                out_target,
                out_target_rotation,
                out_kept,
                out_bound,
            )
