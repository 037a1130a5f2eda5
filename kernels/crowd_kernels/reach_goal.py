"""Where reaching hands want to be: targets that move, turn and jump.

When its target jumps, the hand *glides* to the new one, see `reach_glide`.
"""

import math

from crowd_kernels._jit import inlined_kernel, kernel
from crowd_kernels.easing import settle_vector
from crowd_kernels.quaternion import (
    Quaternion,
    angular_velocity,
    conjugate,
    from_rotation_vector,
    from_yaw,
    multiply,
    normalized,
    rotate,
    rotation_vector,
    rotation_vector_rate,
)
from crowd_kernels.reach_course import paced
from crowd_kernels.reach_state import (
    MOVING,
    REFUSED,
    RETURN,
    ReachLimits,
    ReachState,
    quaternion_of,
    set_quaternion,
    set_vector,
    vector_of,
)
from crowd_kernels.vector import Vector, add, norm, scaled, subtract

JUMPED = 0.8
"""A rotation asked for that is farther away than this has jumped, and the hand is on its way again; one that
turns at up to 4 rad/s is followed closer, rad."""
AFTER_JUMP = 0.25
"""Share of the largest acceleration that hands follow in the step after their target has jumped."""
LEAST_SHARE = 0.01
"""Share of a rotation that stays until a hand has glided to its target; hardly anything shows of it."""


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
    left = state.time_left[character, arm]
    goes_on = left > 0.0 and state.plan_time[character, arm] - left < 1.5 * dt
    # One that has just jumped has got another velocity, which the glide must know as well.
    is_unknown = goes_on and norm(vector_of(state.seen_velocity, character, arm)) == 0.0
    largest = limits.acceleration * (AFTER_JUMP if is_unknown else 1.0)
    has_jumped = norm(subtract(target, expected)) > largest * dt * dt
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
    left, rate, acceleration = settle_vector(
        left,
        rotation_vector_rate(left, vector_of(state.turn_velocity, character, arm)),
        vector_of(state.turn_acceleration, character, arm),
        time,
        dt,
    )
    rotation = normalized(multiply(from_rotation_vector(left), turned))
    set_quaternion(state.rotation, character, arm, rotation)
    set_vector(state.turn_velocity, character, arm, angular_velocity(left, rate))
    set_vector(state.turn_acceleration, character, arm, acceleration)


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
