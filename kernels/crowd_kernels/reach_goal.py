"""Where reaching hands want to be: targets that move and jump, and the course of each reach.

A reach runs along a *course*: 0 at rest, 1 with the hand at the target, 2 at rest again. When its target
jumps, the hand *glides* to the new one, see `reach_glide`.
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
LEAST_SHARE = 0.01
"""Share of a rotation that stays until a hand has glided to its target; hardly anything shows of it."""


class ReachLimits(NamedTuple):
    """How hands go from target to target."""

    least_time: float
    """Shortest time to another target, s."""
    time_per_metre: float
    """Further time by distance, s/m."""
    time_per_radian: float
    """Shortest time by how far a hand turns, against the examples or from one target to another, s/rad."""
    time_shared: float
    """Further time where both hands pull at the trunk, over how far inverse kinematics takes a hand, s/m."""
    acceleration: float
    """A hand that is at its target follows accelerations up to this exactly, m/s^2."""
    target_speed: float
    """Targets that move faster than this are taken to have jumped, m/s."""
    turn_acceleration: float
    """Largest angular acceleration of joints between the blends of two targets, rad/s^2."""
    far_turn_time: float
    """Shortest time over the square of how far joints turn between two blends, s/rad^2: blends of far poses
    are fast in their middle, and come beside the limits of joints there."""
    clearance: float
    """Distance from the body's axis that ways between targets keep in their middle, m."""
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
    example_time: float
    """Time in which the examples' weights follow those of a look-up, s."""


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
    nearest: npt.NDArray[np.float64]
    lag: npt.NDArray[np.float64]
    lag_velocity: npt.NDArray[np.float64]
    lag_acceleration: npt.NDArray[np.float64]
    time_left: npt.NDArray[np.float64]
    plan_time: npt.NDArray[np.float64]
    bulge: npt.NDArray[np.float64]
    glide_turn: npt.NDArray[np.float64]
    """(N, 2, 4) How the blend turns the hand now against where the glide ends, in the frame of the latter."""
    rotation: npt.NDArray[np.float64]
    turn_velocity: npt.NDArray[np.float64]
    turn_acceleration: npt.NDArray[np.float64]
    rotation_share: npt.NDArray[np.float64]
    rotation_rate: npt.NDArray[np.float64]
    turn: npt.NDArray[np.float64]
    """(N, 2) How far hands must turn at the apex against the examples, rad."""
    turn_before: npt.NDArray[np.float64]
    """(N, 2, 3) How hands were turned against the examples when a rotation came to be asked for, rad."""
    missing_place: npt.NDArray[np.float64]
    missing_turn: npt.NDArray[np.float64]
    example: npt.NDArray[np.int32]
    """(N, 2, 72) Examples that are blended; slots of weight 0 are free."""
    example_weight: npt.NDArray[np.float64]
    example_weight_rate: npt.NDArray[np.float64]
    example_weight_acceleration: npt.NDArray[np.float64]
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


@inlined_kernel
def settle_shares(time: float, dt: float) -> tuple[Vector, Vector, Vector]:
    """Find the linear map of `settle`.

    Parameters
    ----------
    time, dt : float
        Until rest, and the step, s, > 0.

    Returns
    -------
    tuple of tuple of float
        What place, velocity and acceleration each add to the three after `dt`.
    """
    if time <= dt:
        return (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    u = dt / time
    return (
        (
            1.0 - u * u * u * (10.0 - u * (15.0 - 6.0 * u)),
            -30.0 * u * u * (1.0 - u) * (1.0 - u) / time,
            -60.0 * u * (1.0 - u) * (1.0 - 2.0 * u) / (time * time),
        ),
        (
            dt * (1.0 - u * u * (6.0 - u * (8.0 - 3.0 * u))),
            1.0 - u * u * (18.0 - u * (32.0 - 15.0 * u)),
            -12.0 * u * (3.0 - u * (8.0 - 5.0 * u)) / time,
        ),
        (
            0.5 * dt * dt * (1.0 - u) * (1.0 - u) * (1.0 - u),
            dt * (1.0 - u * (4.5 - u * (6.0 - 2.5 * u))),
            1.0 - u * (9.0 - u * (18.0 - 10.0 * u)),
        ),
    )


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
    own, per_rate, per_bend = settle_shares(time, dt)
    return (
        own[0] * place + per_rate[0] * velocity + per_bend[0] * acceleration,
        own[1] * place + per_rate[1] * velocity + per_bend[1] * acceleration,
        own[2] * place + per_rate[2] * velocity + per_bend[2] * acceleration,
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
def see_target(
    character: int, arm: int, target: Vector, limits: ReachLimits, dt: float, state: ReachState
) -> bool:
    """Note where the target of one hand is now; tells whether it has jumped or abruptly changed its velocity.

    Parameters
    ----------
    character, arm : int
    target : tuple of float
        Root frame, m.
    limits : ReachLimits
    dt : float
        s.
    state : ReachState
        In and out: `seen` and `seen_velocity`.

    Returns
    -------
    bool
    """
    seen = vector_of(state.seen, character, arm)
    expected = add(seen, scaled(vector_of(state.seen_velocity, character, arm), dt))
    velocity = scaled(subtract(target, seen), 1.0 / dt)
    has_jumped = norm(subtract(target, expected)) > limits.acceleration * dt * dt
    left = state.time_left[character, arm]
    # One that leaves its path in two steps running has got another velocity.
    goes_on = left > 0.0 and state.plan_time[character, arm] - left < 1.5 * dt
    if has_jumped and (not goes_on or norm(velocity) > limits.target_speed):
        velocity = (0.0, 0.0, 0.0)
    set_vector(state.seen, character, arm, target)
    set_vector(state.seen_velocity, character, arm, velocity)
    return has_jumped


@inlined_kernel
def follow_rotation(
    character: int, arm: int, turned: Quaternion, limits: ReachLimits, dt: float, state: ReachState
) -> None:
    """Turn the goal of one hand towards the rotation that is asked for, together with its glide.

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
) -> tuple[bool, Quaternion]:
    """Bring the target of one hand into the root frame; bad targets are refused.

    Hands on their way back no longer follow their targets.

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

    Returns
    -------
    bool
        The target has jumped, or turned far at once.
    tuple of float
        Rotation asked for, root frame.
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
    is_left = state.stage[character, arm] == RETURN
    if is_bad or is_left:
        if not is_left and state.status[character, arm] != REFUSED:
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
    turned = normalized(turned)
    has_jumped = see_target(character, arm, target, limits, dt, state)
    if state.time_left[character, arm] <= 0.0:
        left = rotation_vector(multiply(quaternion_of(state.rotation, character, arm), conjugate(turned)))
        has_jumped = has_jumped or norm(left) > JUMPED
    asked = share if is_bad or is_left else (1.0 if wants else 0.0)
    time = max(limits.time_per_radian * state.turn[character, arm], 1.0 / limits.rotation_rate)
    if state.time_left[character, arm] > 0.0:
        time = max(time, state.plan_time[character, arm])
    wanted_rate = 0.0 if asked == share else math.copysign(1.0 / time, asked - share)
    glides = has_jumped or state.time_left[character, arm] > 0.0
    if share <= 0.0 and glides:
        wanted_rate = 0.0
    rate = state.rotation_rate[character, arm]
    rate = paced(rate, wanted_rate, 1.0 / time, share in (0.0, 1.0), limits, dt)
    state.rotation_rate[character, arm] = rate
    moved = share + rate * dt
    if asked != share and (moved - asked) * (share - asked) <= 0.0:
        moved = asked
    # Hands that are held to a rotation, or no longer, in midway would turn on with another velocity.
    least = LEAST_SHARE if share > 0.0 and glides else 0.0
    state.rotation_share[character, arm] = min(max(moved, least), 1.0)
    return has_jumped, turned


@inlined_kernel
def paced(now: float, wanted: float, usual: float, is_at_rest: bool, limits: ReachLimits, dt: float) -> float:
    """Change the rate of a course towards another one: at once where it is at rest, else gradually.

    Parameters
    ----------
    now, wanted : float
        1/s.
    usual : float
        Rate of the way there, 1/s: the faster, the faster rates change.
    is_at_rest : bool
    limits : ReachLimits
    dt : float
        s.

    Returns
    -------
    float
        1/s.
    """
    if is_at_rest:
        return wanted
    fastest = max(usual, abs(now))
    change = limits.turn_back * fastest * fastest * dt
    return now + min(max(wanted - now, -change), change)


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
    now = paced(now, wanted, rate, course in (0.0, APEX), limits, dt)
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
