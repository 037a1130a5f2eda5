"""How hands glide from one target to the next: their pose from blend to blend, what blends miss likewise.

In between neither target has a say: places on the straight line from one to the other may lie where no pose
is near to those before and after, as in the own body or behind the shoulder. So the weights of the examples
go from those of the one target to those of the other, and what the blend misses of the hand's place, its
*offset*, from the one miss to the other; a rotation that is asked for keeps in step with that of the blend.
"""

import math
from typing import Any

from crowd_kernels._jit import inlined_kernel
from crowd_kernels.easing import hump, minimum_jerk, settle_vector
from crowd_kernels.quaternion import (
    Quaternion,
    conjugate,
    multiply,
    rotation_vector,
    slerp,
)
from crowd_kernels.reach_blend import JOINTS, ROW, ReachKeys, blend_apex, unit_row
from crowd_kernels.reach_place import place_apex, place_point
from crowd_kernels.reach_state import (
    APEX,
    ReachLimits,
    ReachState,
    quaternion_of,
    set_quaternion,
    set_vector,
    vector_of,
)
from crowd_kernels.reach_time import largest_turn, time_to_turn
from crowd_kernels.vector import Vector, add, norm, scaled, subtract

TURNING_ROUND = 0.7
"""Further time for a hand that glides already, over that since its glide began or until it ends."""
ON_THE_WAY = 0.4
"""Share of the acceleration of joints that glides have beside the apex, where examples have their own."""
SPARED = 0.65
"""What hopeless ways are shorter by than the longest that there is, over `longest`, see `shortened`."""


@inlined_kernel
def shortened(vector: Vector, longest: float) -> Vector:
    """Shorten a way that is longer than inverse kinematics goes, smoothly, more so for what is hopeless.

    Parameters
    ----------
    vector : tuple of float
        m.
    longest : float
        Ways up to this length are left as they are, m, > 0.

    Returns
    -------
    tuple of float
        At most 1.2 times the longest; from twice the longest on 0.85 times it.
    """
    length = max(norm(vector), 1e-9)
    beyond = min(max(length / longest - 1.0, 0.0), 1.0)
    if beyond == 0.0:
        return vector
    # The slope falls from 1 to 0 along a minimum-jerk curve.
    square = beyond * beyond
    risen = beyond - square * square * (2.5 - beyond * (3.0 - beyond))
    return scaled(vector, longest * (1.0 + risen - SPARED * minimum_jerk(beyond)) / length)


@inlined_kernel
def away_from_body(place: Vector, begin: Vector, end: Vector, limits: ReachLimits) -> Vector:
    """Find how the middle of a way must be moved so as to be no nearer to the body's axis than its ends.

    Parameters
    ----------
    place, begin, end : tuple of float
        Middle and ends, root frame, m.
    limits : ReachLimits

    Returns
    -------
    tuple of float
        Horizontal, m; not farther than inverse kinematics takes a hand.
    """
    near = math.hypot(place[0], place[2])
    wanted = min(math.hypot(begin[0], begin[2]), math.hypot(end[0], end[2]), limits.clearance)
    length = min(max(wanted - near, 0.0), limits.farthest)
    # From the axis itself hands go round in front.
    x, z = (place[0] / near, place[2] / near) if near > 0.05 else (0.0, 1.0)
    return length * x, 0.0, length * z


@inlined_kernel
def bulge_now(character: int, arm: int, state: ReachState) -> tuple[Vector, Vector]:
    """Find the bulge of one hand's way at this time, m, with its acceleration, m/s^2."""
    if state.time_left[character, arm] <= 0.0:
        return (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    plan = state.plan_time[character, arm]
    rise, _, bend = hump(1.0 - state.time_left[character, arm] / plan)
    bulge = vector_of(state.bulge, character, arm)
    return scaled(bulge, rise), scaled(bulge, bend / (plan * plan))


@inlined_kernel
def goal_now(
    character: int,
    arm: int,
    apex: Vector,
    apex_turned: Quaternion,
    scale: Any,
    live_pelvis: Vector,
    live_rotation: Quaternion,
    keys: ReachKeys,
    state: ReachState,
    row: Any,
) -> tuple[Vector, Quaternion]:
    """Find the goal of one hand, and its rotation, less what the examples will still do while it glides.

    The blend of now goes on to the wanted one. Towards the end less and less is left to that, as examples
    follow targets that move with a delay.

    Parameters
    ----------
    character, arm : int
    apex : tuple of float
        Point of the hand where its blend is at the apex, root frame, m.
    apex_turned : tuple of float
        Rotation of the hand there.
    state : ReachState
        In and out: `glide_turn`.
    row : (96,) float32
        Scratch.

    Returns
    -------
    tuple of float, tuple of float
        Root frame, m.

    Notes
    -----
    All other arguments are those of `plan_glide`.
    """
    goal = vector_of(state.seen, character, arm)
    wanted = quaternion_of(state.rotation, character, arm)
    if state.time_left[character, arm] <= 0.0:
        return goal, wanted
    end, end_turned = place_apex(
        character, arm, state.example_wanted, scale, live_pelvis, live_rotation, keys, state, row
    )
    progress = 1.0 - state.time_left[character, arm] / state.plan_time[character, arm]
    ending = minimum_jerk(min(max(2.0 * progress - 1.0, 0.0), 1.0))
    aside = slerp(multiply(conjugate(end_turned), apex_turned), (1.0, 0.0, 0.0, 0.0), ending)
    set_quaternion(state.glide_turn, character, arm, aside)
    return subtract(goal, scaled(subtract(end, apex), 1.0 - ending)), multiply(wanted, aside)


@inlined_kernel
def plan_glide(
    character: int,
    arm: int,
    rotation: Quaternion,
    before: Vector,
    shared: float,
    begins: bool,
    scale: Any,
    live_pelvis: Vector,
    live_rotation: Quaternion,
    keys: ReachKeys,
    limits: ReachLimits,
    state: ReachState,
    rows: Any,
) -> None:
    """Set how long one hand glides to its target, which has jumped, and how its way bulges from the body.

    Parameters
    ----------
    character, arm : int
    rotation : tuple of float
        Rotation asked for, root frame.
    before : tuple of float
        Where the target was before it jumped, root frame, m.
    shared : float
        How much farther inverse kinematics may take the hand as the trunk is shared with the other one, m.
    begins : bool
        The glide begins. Else it keeps its time: only the examples at its end are others.
    scale : (G,) float32
        Proportions.
    live_pelvis, live_rotation : tuple of float
        Pelvis of the pose below this layer, root frame, m.
    keys : ReachKeys
    limits : ReachLimits
    state : ReachState
        In: weights of the examples and those wanted. In and out: the glide.
    rows : (192,) float32
        Scratch.
    """
    now, then = rows[:ROW], rows[ROW : 2 * ROW]
    body, body_turned = blend_apex(
        character, arm, state.example_weight, scale, live_pelvis, live_rotation, keys, state, now
    )
    end_body, end_body_turned = blend_apex(
        character, arm, state.example_wanted, scale, live_pelvis, live_rotation, keys, state, then
    )
    here, turned = place_point(character, arm, scale, body, body_turned, keys, state, now, JOINTS)
    end, end_turned = place_point(character, arm, scale, end_body, end_body_turned, keys, state, then, JOINTS)
    turn = largest_turn(now, then)
    offset = vector_of(state.offset, character, arm)
    _, bulging = bulge_now(character, arm, state)
    acceleration = add(vector_of(state.lag_acceleration, character, arm), bulging)
    set_vector(state.lag_acceleration, character, arm, acceleration)
    aside = multiply(conjugate(end_turned), turned)
    goal = multiply(
        quaternion_of(state.rotation, character, arm), quaternion_of(state.glide_turn, character, arm)
    )
    goal = multiply(goal, conjugate(aside))
    set_quaternion(state.rotation, character, arm, goal)
    set_quaternion(state.glide_turn, character, arm, aside)
    moved = subtract(vector_of(state.seen, character, arm), before)
    wish = shortened(add(offset, subtract(moved, subtract(end, here))), limits.farthest + shared)
    end = add(end, wish)
    begin = add(here, offset)
    way = max(norm(subtract(end, begin)), norm(subtract(wish, offset)))
    time = limits.least_time + limits.time_per_metre * way
    if shared > 0.0:
        time += limits.time_shared * max(norm(offset), norm(wish))
    bend = limits.turn_acceleration * (1.0 if state.course[character, arm] == APEX else ON_THE_WAY)
    time = max(time, time_to_turn(turn, bend), limits.far_turn_time * turn * turn)
    if state.rotation_share[character, arm] > 0.0:
        turning = multiply(goal, conjugate(rotation))
        time = max(time, limits.time_per_radian * norm(rotation_vector(turning)))
    left = state.time_left[character, arm]
    # Hands that are fast now, in the middle of a glide, need more time.
    time = max(time + TURNING_ROUND * min(left, state.plan_time[character, arm] - left), left)
    time = time if begins else left
    state.time_left[character, arm] = time
    state.plan_time[character, arm] = time
    for lane in range(ROW):
        now[lane] += then[lane]
    unit_row(now)
    middle, _ = place_point(
        character,
        arm,
        scale,
        scaled(add(body, end_body), 0.5),
        slerp(body_turned, end_body_turned, 0.5),
        keys,
        state,
        now,
        JOINTS,
    )
    middle = add(middle, scaled(add(offset, wish), 0.5))
    set_vector(state.bulge, character, arm, away_from_body(middle, begin, end, limits))


@inlined_kernel
def glide(
    character: int,
    arm: int,
    wish: Vector,
    step: Vector,
    farthest: float,
    is_first: bool,
    dt: float,
    state: ReachState,
) -> Vector:
    """Advance the offset of one hand: what is wished for, and what is left of its glide there.

    Parameters
    ----------
    character, arm : int
    wish : tuple of float
        Offset of a hand that does not glide, m.
    step : tuple of float
        How it has moved in this step, m.
    farthest : float
        Farthest that inverse kinematics takes a hand, m. A hand that is sent back from a fast glide swings
        on, but not farther than that.
    is_first : bool
        The reach has just begun.
    dt : float
        s.
    state : ReachState
        In and out: `offset` and its velocity, `lag` and its derivatives, `time_left`.

    Returns
    -------
    tuple of float
        m.
    """
    before = vector_of(state.offset, character, arm)
    offset = wish
    left = state.time_left[character, arm]
    if left > 0.0:
        if left == state.plan_time[character, arm]:
            # The glide begins now, where the hand was, as fast as it was.
            set_vector(state.lag, character, arm, add(subtract(before, wish), step))
            speed = subtract(vector_of(state.offset_velocity, character, arm), scaled(step, 1.0 / dt))
            set_vector(state.lag_velocity, character, arm, speed)
        lag, velocity, acceleration = settle_vector(
            vector_of(state.lag, character, arm),
            vector_of(state.lag_velocity, character, arm),
            vector_of(state.lag_acceleration, character, arm),
            left,
            dt,
        )
        set_vector(state.lag, character, arm, lag)
        set_vector(state.lag_velocity, character, arm, velocity)
        set_vector(state.lag_acceleration, character, arm, acceleration)
        state.time_left[character, arm] = left - dt if left > dt else 0.0
        if left <= dt:
            set_quaternion(state.glide_turn, character, arm, (1.0, 0.0, 0.0, 0.0))
        bulge, _ = bulge_now(character, arm, state)
        offset = add(wish, add(lag, bulge))
    set_vector(state.offset, character, arm, offset)
    rate = 0.0 if is_first else 1.0 / dt
    set_vector(state.offset_velocity, character, arm, scaled(subtract(offset, before), rate))
    # Wishes are shortened already, to less than 1.2 times the farthest.
    return shortened(offset, 1.2 * farthest) if left > 0.0 else offset
