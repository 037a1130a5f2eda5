"""Where reaching hands want to be: targets that move and jump, and the course of each reach.

A reach runs along a *course*: 0 at rest, 1 with the hand at the target, 2 at rest again. The hand seeks its
*goal*, which glides from one target to the next with least jerk, bending away from the body.
"""

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from crowd_kernels._jit import inlined_kernel, kernel, parallel_kernel, prange
from crowd_kernels.easing import minimum_jerk
from crowd_kernels.quaternion import (
    Quaternion,
    conjugate,
    from_rotation_vector,
    from_yaw,
    multiply,
    normalized,
    rotate,
    rotation_vector,
)
from crowd_kernels.vector import Vector, add, norm, scaled, subtract

CHUNKS = 32
NONE, MOVE, HOLD, RETURN = 0, 1, 2, 3
"""Stages."""
MOVING, REACHED, OUT_OF_REACH, REFUSED = 1, 2, 3, 4
"""Statuses, as those of inverse kinematics."""
APEX, END = 1.0, 2.0
JUMPED = 0.8
"""A rotation asked for that is farther away than this has jumped, and the hand is on its way again; one that
turns at up to 4 rad/s is followed closer, rad."""


class ReachLimits(NamedTuple):
    """How hands go from target to target."""

    least_time: float
    """Shortest time to another target, s."""
    time_per_metre: float
    """Further time by distance, s/m."""
    time_per_radian: float
    """Shortest time by how far a hand turns, against the examples or from one target to another, s/rad."""
    acceleration: float
    """A hand that is at its target follows accelerations up to this exactly, m/s^2."""
    target_speed: float
    """Targets that move faster than this are taken to have jumped, m/s."""
    bulge: float
    """How far a way between targets bends away from the body, over its length."""
    clearance: float
    """Distance from the body's axis that ways between targets keep, m."""
    body_radius: float
    """Targets closer to the spine than this are refused, m at the library's size."""
    turn_back: float
    """Change of the course's rate when a reach turns back or slows down, over the square of that rate."""
    lead: float
    """Share of the way to the apex in which the examples take over the pose."""
    rotation_rate: float
    """Largest rate with which a rotation that is asked for on the way comes and goes, 1/s."""
    farthest: float
    """Farthest that inverse kinematics takes a hand from where the examples bring it, m."""
    missing_rate: float
    """Rate with which what could not be had is made up for, 1/s."""
    example_rate: float
    """Rate of the critically damped change of the examples' weights, 1/s."""


class ReachState(NamedTuple):
    """What changes: fields of the state, (N, 2, ...) for right and left hand."""

    stage: npt.NDArray[np.uint8]
    status: npt.NDArray[np.uint8]
    refusals: npt.NDArray[np.int32]
    """(N, 2) How often targets were refused."""
    is_own: npt.NDArray[np.bool_]
    """(N, 2) Targets move with the body: no wall comes between."""
    is_blocked: npt.NDArray[np.bool_]
    """(N, 2) A wall lies between the shoulder and the target."""
    target_world: npt.NDArray[np.float64]
    target_rotation_world: npt.NDArray[np.float64]
    has_rotation: npt.NDArray[np.bool_]
    point_hand: npt.NDArray[np.float64]
    seconds: npt.NDArray[np.float64]
    hold_left: npt.NDArray[np.float64]
    course: npt.NDArray[np.float64]
    course_rate: npt.NDArray[np.float64]
    weight: npt.NDArray[np.float64]
    seen: npt.NDArray[np.float64]
    seen_velocity: npt.NDArray[np.float64]
    offset: npt.NDArray[np.float64]
    offset_velocity: npt.NDArray[np.float64]
    offset_acceleration: npt.NDArray[np.float64]
    time_left: npt.NDArray[np.float64]
    plan_time: npt.NDArray[np.float64]
    bulge: npt.NDArray[np.float64]
    rotation: npt.NDArray[np.float64]
    turn_velocity: npt.NDArray[np.float64]
    turn_acceleration: npt.NDArray[np.float64]
    rotation_share: npt.NDArray[np.float64]
    turn: npt.NDArray[np.float64]
    """(N, 2) How far hands must turn at the apex against the examples, rad."""
    turn_before: npt.NDArray[np.float64]
    """(N, 2, 3) How hands were turned against the examples when a rotation came to be asked for, rad."""
    missing_place: npt.NDArray[np.float64]
    missing_turn: npt.NDArray[np.float64]
    example: npt.NDArray[np.int32]
    """(N, 2, 24) Examples that are blended; slots of weight 0 are free."""
    example_weight: npt.NDArray[np.float64]
    example_weight_rate: npt.NDArray[np.float64]
    example_wanted: npt.NDArray[np.float64]
    example_count: npt.NDArray[np.int32]
    """(N, 2) Slots from here on are free."""
    looked_up: npt.NDArray[np.float64]
    """(N, 2, 3) Where the wrist was when examples were last looked up, root frame, m."""
    looked_up_pelvis: npt.NDArray[np.float64]
    looked_up_share: npt.NDArray[np.float64]


@inlined_kernel
def vector_of(array: Any, character: int, arm: int) -> Vector:
    """Read a vector of a hand."""
    return array[character, arm, 0], array[character, arm, 1], array[character, arm, 2]


@inlined_kernel
def set_vector(array: Any, character: int, arm: int, value: Vector) -> None:
    """Write a vector of a hand."""
    array[character, arm, 0] = value[0]
    array[character, arm, 1] = value[1]
    array[character, arm, 2] = value[2]


@inlined_kernel
def quaternion_of(array: Any, character: int, arm: int) -> Quaternion:
    """Read a rotation of a hand."""
    return (
        array[character, arm, 0],
        array[character, arm, 1],
        array[character, arm, 2],
        array[character, arm, 3],
    )


@inlined_kernel
def set_quaternion(array: Any, character: int, arm: int, value: Quaternion) -> None:
    """Write a rotation of a hand."""
    for component in range(4):
        array[character, arm, component] = value[component]


@kernel
def settle(
    place: float, velocity: float, acceleration: float, time: float, dt: float
) -> tuple[float, float, float]:
    """Advance a coordinate that comes to rest at 0 after a time, with least jerk.

    Parameters
    ----------
    place, velocity, acceleration : float
        Now, in any unit and its rates, 1/s and 1/s^2.
    time : float
        Until it rests, s, > 0.
    dt : float
        s.

    Returns
    -------
    tuple of float
        The three after `dt`.

    Notes
    -----
    **Source:** Flash, Hogan, "The coordination of arm movements", 1985: minimum-jerk motion is a quintic;
    planned anew from the present state in each step.
    """
    if time <= dt:
        return 0.0, 0.0, 0.0
    u = dt / time
    v = velocity * time
    a = acceleration * time * time
    distance = -place - v - 0.5 * a
    slope = -v - a
    c3 = 10.0 * distance - 4.0 * slope - 0.5 * a
    c4 = -15.0 * distance + 7.0 * slope + a
    c5 = 6.0 * distance - 3.0 * slope - 0.5 * a
    return (
        place + u * (v + u * (0.5 * a + u * (c3 + u * (c4 + u * c5)))),
        (v + u * (a + u * (3.0 * c3 + u * (4.0 * c4 + u * 5.0 * c5)))) / time,
        (a + u * (6.0 * c3 + u * (12.0 * c4 + u * 20.0 * c5))) / (time * time),
    )


@kernel
def hump(progress: float) -> tuple[float, float, float]:
    """Rise from 0 to 1 in the middle and back, smooth at both ends: value, slope, bend over progress."""
    q = min(max(progress, 0.0), 1.0)
    r = q * (1.0 - q)
    d = 1.0 - 2.0 * q
    return 64.0 * r * r * r, 192.0 * r * r * d, 384.0 * r * (d * d - r)


@kernel
def is_inside_body(place: Vector, pelvis: Vector, size: float, radius: float) -> bool:
    """Tell whether a place is in the own trunk or head: around the spine of a person who is upright."""
    x = place[0] - pelvis[0]
    z = place[2] - pelvis[2]
    up = place[1] - pelvis[1]
    beyond = max(max(-up, up - 0.66 * size), 0.0)
    return x * x + z * z + beyond * beyond < radius * radius * size * size


@inlined_kernel
def away_from_body(place: Vector, way: Vector, limits: ReachLimits) -> Vector:
    """Find how a straight way of a hand must bend: away from the body's axis, more where it comes close.

    Parameters
    ----------
    place : tuple of float
        Where it begins, root frame, m.
    way : tuple of float
        m.
    limits : ReachLimits

    Returns
    -------
    tuple of float
        Farthest departure from the straight way, horizontal, m.
    """
    flat = way[0] * way[0] + way[2] * way[2]
    share = 0.5
    if flat > 1e-12:
        share = min(max(-(place[0] * way[0] + place[2] * way[2]) / flat, 0.15), 0.85)
    x = place[0] + share * way[0]
    z = place[2] + share * way[2]
    near = math.sqrt(x * x + z * z)
    length = limits.bulge * norm(way) + max(limits.clearance - near, 0.0)
    # A way through the axis goes round in front.
    x, z = (x / near, z / near) if near > 0.05 else (0.0, 1.0)
    return length * x, 0.0, length * z


@inlined_kernel
def goal_of(state: ReachState, character: int, arm: int) -> Vector:
    """Find where the goal of a hand is now, root frame, m."""
    goal = add(vector_of(state.seen, character, arm), vector_of(state.offset, character, arm))
    if state.time_left[character, arm] > 0.0:
        rise, _, _ = hump(1.0 - state.time_left[character, arm] / state.plan_time[character, arm])
        goal = add(goal, scaled(vector_of(state.bulge, character, arm), rise))
    return goal


@inlined_kernel
def follow_target(
    character: int,
    arm: int,
    target: Vector,
    turned: Quaternion,
    limits: ReachLimits,
    dt: float,
    state: ReachState,
) -> None:
    """Advance the goal of one hand: it glides to the target, and stays with it once there.

    Parameters
    ----------
    character, arm : int
    target : tuple of float
        Root frame, m.
    turned : tuple of float
        Rotation asked for, root frame.
    limits : ReachLimits
    dt : float
        s.
    state : ReachState
        In and out.
    """
    seen = vector_of(state.seen, character, arm)
    speed = vector_of(state.seen_velocity, character, arm)
    expected = add(seen, scaled(speed, dt))
    velocity = scaled(subtract(target, seen), 1.0 / dt)
    if norm(subtract(target, expected)) > limits.acceleration * dt * dt:
        if norm(velocity) > limits.target_speed:
            velocity = (0.0, 0.0, 0.0)
        offset = vector_of(state.offset, character, arm)
        rate = vector_of(state.offset_velocity, character, arm)
        bend = vector_of(state.offset_acceleration, character, arm)
        if state.time_left[character, arm] > 0.0:
            # The present bend of the way becomes part of the offset, so that nothing jumps.
            plan = state.plan_time[character, arm]
            rise, slope, curve = hump(1.0 - state.time_left[character, arm] / plan)
            bulge = vector_of(state.bulge, character, arm)
            offset = add(offset, scaled(bulge, rise))
            rate = add(rate, scaled(bulge, slope / plan))
            bend = add(bend, scaled(bulge, curve / (plan * plan)))
        offset = add(offset, subtract(expected, target))
        rate = add(rate, subtract(speed, velocity))
        time = limits.least_time + limits.time_per_metre * norm(offset)
        time = max(time, state.time_left[character, arm])
        state.time_left[character, arm] = time
        state.plan_time[character, arm] = time
        is_far = norm(offset) > 0.08
        bulge = (0.0, 0.0, 0.0)
        if is_far:
            bulge = away_from_body(add(target, offset), scaled(offset, -1.0), limits)
        set_vector(state.bulge, character, arm, bulge)
        set_vector(state.offset, character, arm, offset)
        set_vector(state.offset_velocity, character, arm, rate)
        set_vector(state.offset_acceleration, character, arm, bend)
    set_vector(state.seen, character, arm, target)
    set_vector(state.seen_velocity, character, arm, velocity)
    left = state.time_left[character, arm]
    for axis in range(3):
        place, rate_now, bend_now = settle(
            state.offset[character, arm, axis],
            state.offset_velocity[character, arm, axis],
            state.offset_acceleration[character, arm, axis],
            left,
            dt,
        )
        state.offset[character, arm, axis] = place
        state.offset_velocity[character, arm, axis] = rate_now
        state.offset_acceleration[character, arm, axis] = bend_now
    state.time_left[character, arm] = left - dt if left > dt else 0.0
    follow_rotation(character, arm, turned, limits, dt, state)


@inlined_kernel
def follow_rotation(
    character: int, arm: int, turned: Quaternion, limits: ReachLimits, dt: float, state: ReachState
) -> None:
    """Turn the goal of one hand towards the rotation that is asked for, together with its way.

    Parameters
    ----------
    character, arm : int
    turned : tuple of float
        Rotation asked for, root frame.
    limits : ReachLimits
    dt : float
        s.
    state : ReachState
        In and out.
    """
    left = rotation_vector(multiply(quaternion_of(state.rotation, character, arm), conjugate(turned)))
    # A rotation that only drifts, as of a carried object, is followed within the least time.
    time = max(limits.time_per_radian * norm(left), limits.least_time)
    if norm(left) > JUMPED and state.time_left[character, arm] <= 0.0:
        state.time_left[character, arm] = time
        state.plan_time[character, arm] = time
        set_vector(state.bulge, character, arm, (0.0, 0.0, 0.0))
    time = max(state.time_left[character, arm], time)
    if norm(left) < 1e-4 and norm(vector_of(state.turn_velocity, character, arm)) < 1e-2:
        set_quaternion(state.rotation, character, arm, turned)
        set_vector(state.turn_velocity, character, arm, (0.0, 0.0, 0.0))
        set_vector(state.turn_acceleration, character, arm, (0.0, 0.0, 0.0))
        return
    x, vx, ax = settle(
        left[0], state.turn_velocity[character, arm, 0], state.turn_acceleration[character, arm, 0], time, dt
    )
    y, vy, ay = settle(
        left[1], state.turn_velocity[character, arm, 1], state.turn_acceleration[character, arm, 1], time, dt
    )
    z, vz, az = settle(
        left[2], state.turn_velocity[character, arm, 2], state.turn_acceleration[character, arm, 2], time, dt
    )
    rotation = normalized(multiply(from_rotation_vector((x, y, z)), turned))
    set_quaternion(state.rotation, character, arm, rotation)
    set_vector(state.turn_velocity, character, arm, (vx, vy, vz))
    set_vector(state.turn_acceleration, character, arm, (ax, ay, az))


@inlined_kernel
def track_target(
    character: int,
    arm: int,
    position_world: Vector,
    yaw: float,
    pelvis: Vector,
    size: float,
    limits: ReachLimits,
    dt: float,
    state: ReachState,
) -> None:
    """Bring the target of one hand into the root frame, and let the goal follow it; bad targets are refused.

    Parameters
    ----------
    character, arm : int
    position_world : tuple of float
        Root, m.
    yaw : float
        rad.
    pelvis : tuple of float
        Root frame, m.
    size : float
        Stature over the library's.
    limits : ReachLimits
    dt : float
        s.
    state : ReachState
        In and out.
    """
    facing = from_yaw(-yaw)
    target = rotate(facing, subtract(vector_of(state.target_world, character, arm), position_world))
    wants = state.has_rotation[character, arm]
    turned = quaternion_of(state.rotation, character, arm)
    if wants:
        turned = multiply(facing, quaternion_of(state.target_rotation_world, character, arm))
    length = turned[0] * turned[0] + turned[1] * turned[1] + turned[2] * turned[2] + turned[3] * turned[3]
    is_bad = state.is_blocked[character, arm] and not state.is_own[character, arm]
    is_bad = is_bad or not math.isfinite(target[0] + target[1] + target[2])
    is_bad = is_bad or not (length > 0.5 and length < 2.0)
    is_bad = is_bad or is_inside_body(target, pelvis, size, limits.body_radius)
    if is_bad:
        if state.status[character, arm] != REFUSED:
            state.status[character, arm] = REFUSED
            state.refusals[character, arm] += 1
        target = vector_of(state.seen, character, arm)
        turned = quaternion_of(state.rotation, character, arm)
    elif state.status[character, arm] == REFUSED:
        state.status[character, arm] = MOVING
    share = state.rotation_share[character, arm]
    if share <= 0.0:
        # Nothing shows of the rotation yet, so it need not be sought from an old one.
        set_quaternion(state.rotation, character, arm, normalized(turned))
        set_vector(state.turn_velocity, character, arm, (0.0, 0.0, 0.0))
        set_vector(state.turn_acceleration, character, arm, (0.0, 0.0, 0.0))
    follow_target(character, arm, target, normalized(turned), limits, dt, state)
    asked = share if is_bad else (1.0 if wants else 0.0)
    time = max(limits.time_per_radian * state.turn[character, arm], 1.0 / limits.rotation_rate)
    step = dt / time
    state.rotation_share[character, arm] = share + min(max(asked - share, -step), step)


@inlined_kernel
def advance_course(
    character: int,
    arm: int,
    rate: float,
    return_rate: float,
    limits: ReachLimits,
    dt: float,
    state: ReachState,
) -> None:
    """Advance the course of one hand and change its stage.

    Parameters
    ----------
    character, arm : int
    rate, return_rate : float
        Rates of the course to the apex and back, 1/s.
    limits : ReachLimits
    dt : float
        s.
    state : ReachState
        In and out.
    """
    stage = state.stage[character, arm]
    course = state.course[character, arm]
    now = state.course_rate[character, arm]
    wanted = 0.0
    if stage == RETURN:
        wanted = return_rate if course >= APEX else -rate
        if course < APEX and now > 0.0 and course + now * dt >= APEX:
            wanted = now
    elif course < APEX:
        wanted = rate
    elif course > APEX:
        wanted = -return_rate
    if course in (0.0, APEX):
        now = wanted
    else:
        fastest = max(rate, abs(now))
        change = limits.turn_back * fastest * fastest * dt
        now += min(max(wanted - now, -change), change)
    moved = course + now * dt
    # Courses stop at the apex, whose pose all sections share.
    if (course < APEX and moved > APEX - 1e-9) or (course > APEX and moved < APEX + 1e-9):
        moved = APEX
        now = 0.0
    state.course[character, arm] = min(max(moved, 0.0), END)
    state.course_rate[character, arm] = now
    if stage == RETURN:
        if moved <= 0.0 or moved >= END:
            state.stage[character, arm] = NONE
            state.status[character, arm] = NONE
            state.course[character, arm] = 0.0
            state.course_rate[character, arm] = 0.0
            state.weight[character, arm] = 0.0
        return
    is_turned = not state.has_rotation[character, arm] or state.rotation_share[character, arm] >= 1.0
    is_turned = is_turned or state.status[character, arm] == REFUSED
    is_there = moved == APEX and state.time_left[character, arm] <= 0.0 and is_turned
    state.stage[character, arm] = HOLD if is_there else MOVE


@inlined_kernel
def course_shares(course: float, lead: float) -> tuple[float, float]:
    """Find the share of the examples in the pose, and that of the correction of the hand, on a course."""
    side = course if course <= APEX else END - course
    return minimum_jerk(side / lead), minimum_jerk(side)


@inlined_kernel
def judge_hand(
    character: int,
    arm: int,
    distance: float,
    angle: float,
    dt: float,
    tolerance: float,
    angle_tolerance: float,
    state: ReachState,
) -> None:
    """Tell how the reach of one hand stands.

    Parameters
    ----------
    character, arm : int
    distance : float
        m.
    angle : float
        rad.

    Notes
    -----
    All other arguments are those of `reach_status_crowd`.
    """
    stage = state.stage[character, arm]
    if stage in (NONE, RETURN):
        return
    is_refused = state.status[character, arm] == REFUSED
    if stage == MOVE:
        if not is_refused:
            state.status[character, arm] = MOVING
        return
    is_met = distance < tolerance
    if state.has_rotation[character, arm] and angle >= angle_tolerance:
        is_met = False
    if not is_refused:
        state.status[character, arm] = REACHED if is_met else OUT_OF_REACH
    state.hold_left[character, arm] -= dt
    if state.hold_left[character, arm] < 0.0:
        state.stage[character, arm] = RETURN


@parallel_kernel
def reach_status_crowd(
    target: Any,
    distance: Any,
    angle: Any,
    active: Any,
    dt: float,
    tolerance: float,
    angle_tolerance: float,
    state: ReachState,
) -> None:
    """Tell how each reach stands after inverse kinematics, and count down how long hands hold.

    Parameters
    ----------
    target : (N, 2, 3) float32
        Where inverse kinematics took the hands, root frame, m.
    distance : (N, 2) float32
        How far the points of the hands are from there, m.
    angle : (N, 2) float32
        How far the hands' rotations are from those asked for, rad.
    active : (A,) int32
        Characters of whom a hand reaches, each once.
    dt : float
        s.
    tolerance : float
        Distance at which a target is reached, m.
    angle_tolerance : float
        rad.
    state : ReachState
        In and out.

    Notes
    -----
    **Source:** the stages of Feng, Xu, Shapiro, section 5.1.
    """
    count = active.shape[0]
    for k in prange(CHUNKS):
        chunk = (k * 37) % CHUNKS
        for index in range(chunk * count // CHUNKS, (chunk + 1) * count // CHUNKS):
            character = active[index]
            for arm in range(2):
                missing = subtract(vector_of(state.seen, character, arm), vector_of(target, character, arm))
                judge_hand(
                    character,
                    arm,
                    distance[character, arm] + norm(missing),
                    angle[character, arm],
                    dt,
                    tolerance,
                    angle_tolerance,
                    state,
                )
