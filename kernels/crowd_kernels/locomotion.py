"""From a desired velocity to root motion: what a character asks of its locomotion, within limits."""

import math
from typing import Any, NamedTuple

from crowd_kernels._jit import kernel, parallel_kernel, prange

CHUNKS = 32
TURN_ROUND_ANGLE = math.radians(165.0)
LEFT_FOOT_LIFTS = 0.04
RIGHT_FOOT_LIFTS = 0.54
DOUBLE_SUPPORT = 0.16


class CommandLimits(NamedTuple):
    """How a desired velocity becomes a command, and how fast the command may change."""

    heading_time: float
    """Time constant of the velocity that a character turns to, s."""
    heading_speed: float
    """Above this smoothed speed a character faces where it goes, below it turns to its way point, m/s."""
    turn_gain: float
    """Turn rate per heading error, 1/s."""
    largest_turn_rate: float
    """rad/s."""
    forward_acceleration: float
    """m/s^2."""
    braking: float
    """m/s^2."""
    side_acceleration: float
    """m/s^2."""
    turn_acceleration: float
    """rad/s^2."""


class GaitLimits(NamedTuple):
    """When a character starts and stops moving."""

    start_speed: float
    """Wanted speed from which on a standing character starts, m/s."""
    start_turn_rate: float
    """Wanted turn rate from which on a standing character starts, rad/s."""
    stop_speed: float
    """Wanted and present speed below which a moving character may stop, m/s."""
    stop_turn_rate: float
    """Wanted and present turn rate below which a moving character may stop, rad/s."""
    ease_rate: float
    """Rate of the critically damped change between idle and locomotion, 1/s."""


@kernel
def wrapped_angle(angle: float) -> float:
    """Bring an angle into (-pi, pi].

    Parameters
    ----------
    angle : float
        Any finite angle, rad.

    Returns
    -------
    float
        Equivalent angle, rad.
    """
    wrapped = angle - 2.0 * math.pi * math.floor((angle + math.pi) / (2.0 * math.pi))
    return wrapped if wrapped > -math.pi else math.pi


@kernel
def alignment(heading_error: float, full_angle: float, zero_angle: float) -> float:
    """Find the share of its speed that a character uses while it must still turn.

    Parameters
    ----------
    heading_error : float
        Angle between facing and way, rad.
    full_angle, zero_angle : float
        Full speed up to the first, none beyond the second, smooth between, rad.

    Returns
    -------
    float
        Share in [0, 1].
    """
    share = min(max((zero_angle - abs(heading_error)) / (zero_angle - full_angle), 0.0), 1.0)
    return share * share * (3.0 - 2.0 * share)


@kernel
def approach(value: float, goal: float, largest_change: float) -> float:
    """Move a value towards a goal by at most `largest_change`.

    Parameters
    ----------
    value, goal : float
    largest_change : float
        >= 0, in the unit of the value.

    Returns
    -------
    float
        The goal, or the value moved by `largest_change`.
    """
    return value + min(max(goal - value, -largest_change), largest_change)


@kernel
def ease(value: float, rate: float, goal: float, stiffness: float, dt: float) -> tuple[float, float]:
    """Step a critically damped spring exactly over `dt`.

    Parameters
    ----------
    value, rate : float
        Present value and its rate of change per second.
    goal : float
        Where the value settles.
    stiffness : float
        Natural frequency, 1/s; the larger, the faster.
    dt : float
        s.

    Returns
    -------
    tuple of float
        New value and rate.

    Notes
    -----
    **Source:** closed form of x'' = -2 w x' - w^2 (x - goal).
    """
    offset = value - goal
    slope = rate + stiffness * offset
    decay = math.exp(-stiffness * dt)
    return goal + (offset + slope * dt) * decay, (rate - stiffness * slope * dt) * decay


@parallel_kernel
def prefer_crowd(
    position_world: Any,
    yaw: Any,
    way_point_world: Any,
    remaining_distance: Any,
    wanted_speed: Any,
    slows_at_goal: Any,
    active: Any,
    braking_time: float,
    full_angle: float,
    zero_angle: float,
    out_preferred_velocity_world: Any,
) -> None:
    """Compute the velocity that each character would have if it were alone.

    It points to the way point. It falls linearly to 0 before a goal at which the character stays, and it is
    reduced while the character faces away, so that people turn before they walk off.

    Parameters
    ----------
    position_world : (N, 3) float64
        Roots on the ground, m.
    yaw : (N,) float64
        Heading, rad.
    way_point_world : (N, 3) float64
        Next points of the ways, m.
    remaining_distance : (N,) float64
        Way to the goal, m, >= 0.
    wanted_speed : (N,) float64
        Speed on a free way, m/s; a character with 0 stands.
    slows_at_goal : (N,) bool
        The character stops at the goal instead of leaving there.
    active : (A,) int32
        Characters to process.
    braking_time : float
        Remaining distance over speed from which on the character slows down, s.
    full_angle, zero_angle : float
        See `alignment`, rad.
    out_preferred_velocity_world : (N, 3) float64
        Written in rows of `active`, m/s; y is left alone.

    Notes
    -----
    **Source:** Reynolds, Steering behaviors for autonomous characters, 1999, "Arrival".
    **Differs from the source:** linear in the length of the way, and reduced by the heading error.
    """
    count = active.shape[0]
    for k in prange(CHUNKS):
        chunk = (k * 37) % CHUNKS
        for index in range(chunk * count // CHUNKS, (chunk + 1) * count // CHUNKS):
            character = active[index]
            x = way_point_world[character, 0] - position_world[character, 0]
            z = way_point_world[character, 2] - position_world[character, 2]
            distance = math.sqrt(x * x + z * z)
            speed = wanted_speed[character]
            if slows_at_goal[character]:
                speed = min(speed, remaining_distance[character] / braking_time)
            if distance > 1e-9 and speed > 0.0:
                heading_error = wrapped_angle(math.atan2(x, z) - yaw[character])
                speed *= alignment(heading_error, full_angle, zero_angle) / distance
                out_preferred_velocity_world[character, 0] = speed * x
                out_preferred_velocity_world[character, 2] = speed * z
            else:
                out_preferred_velocity_world[character, 0] = 0.0
                out_preferred_velocity_world[character, 2] = 0.0


@kernel
def wanted_turn_rate(
    character: int,
    yaw: Any,
    heading_velocity_world: Any,
    position_world: Any,
    way_point_world: Any,
    turning_side: Any,
    limits: CommandLimits,
) -> float:
    """Find the turn rate that brings a character to face where it goes; `turning_side` is updated in place.

    Slow motion says little about the way, so a person who is pushed about keeps facing the way point. With
    the way straight behind, the side of the turn is kept, so that nobody wavers.

    Parameters
    ----------
    character : int
        Row.
    yaw : (N,) float64
        Heading, rad.
    heading_velocity_world : (N, 3) float64
        Smoothed desired velocity, m/s.
    position_world, way_point_world : (N, 3) float64
        Root and next point of the way, m.
    turning_side : (N,) int8
        In and out: 1 left, -1 right, 0 not yet turned.
    limits : CommandLimits

    Returns
    -------
    float
        rad/s, left positive.
    """
    hx = heading_velocity_world[character, 0]
    hz = heading_velocity_world[character, 2]
    way_x = way_point_world[character, 0] - position_world[character, 0]
    way_z = way_point_world[character, 2] - position_world[character, 2]
    way = math.sqrt(way_x * way_x + way_z * way_z)
    trust = min((hx * hx + hz * hz) / (limits.heading_speed * limits.heading_speed), 1.0)
    if not way > 1e-6:
        return 0.0
    pull = (1.0 - trust) * limits.heading_speed / way
    error = wrapped_angle(math.atan2(trust * hx + pull * way_x, trust * hz + pull * way_z) - yaw[character])
    if abs(error) > TURN_ROUND_ANGLE and turning_side[character] != 0:
        error = abs(error) * turning_side[character]
    turning_side[character] = 1 if error >= 0.0 else -1
    return min(max(limits.turn_gain * error, -limits.largest_turn_rate), limits.largest_turn_rate)


@parallel_kernel
def wish_crowd(
    yaw: Any,
    position_world: Any,
    way_point_world: Any,
    desired_velocity_world: Any,
    wants_to_walk: Any,
    is_directed: Any,
    directed_parameter: Any,
    stride_scale: Any,
    tempo: Any,
    active: Any,
    limits: CommandLimits,
    dt: float,
    heading_velocity_world: Any,
    turning_side: Any,
    out_wanted_parameter: Any,
    out_library_parameter: Any,
) -> None:
    """Express desired velocities as locomotion parameters: what characters wish, within reach or not.

    Parameters
    ----------
    yaw : (N,) float64
        Heading, rad.
    position_world, way_point_world : (N, 3) float64
        Root and next point of the way, m.
    desired_velocity_world : (N, 3) float64
        Velocity after avoidance, m/s.
    wants_to_walk : (N,) bool
        The character is on its way; others keep their heading.
    is_directed : (N,) bool
        Parameters are commanded directly and steering is ignored.
    directed_parameter : (N, 3) float64
        Forward speed m/s, turn rate rad/s, side speed m/s where `is_directed`.
    stride_scale : (N,) float64
        Leg length over that of the motion library's skeleton.
    tempo : (N,) float64
        Cadence over that of the motion library at equal parameters.
    active : (A,) int32
        Characters to process.
    limits : CommandLimits
    dt : float
        s.
    heading_velocity_world : (N, 3) float64
        In and out: smoothed desired velocity, m/s.
    turning_side : (N,) int8
        In and out, see `wanted_turn_rate`.
    out_wanted_parameter : (N, 3) float64
        Forward speed m/s, turn rate rad/s, side speed m/s.
    out_library_parameter : (N, 3) float64
        The same as the motion library knows it: speeds over `stride_scale` and `tempo`, turn over `tempo`.

    Notes
    -----
    **Source:** Feng, Xu, Shapiro, section 4.2: steering drives the parameters of locomotion.
    **Differs from the source:** the body turns to a smoothed velocity while the feet follow the present one,
    sideways if need be.
    """
    count = active.shape[0]
    smoothing = min(dt / limits.heading_time, 1.0)
    for k in prange(CHUNKS):
        chunk = (k * 37) % CHUNKS
        for index in range(chunk * count // CHUNKS, (chunk + 1) * count // CHUNKS):
            character = active[index]
            facing_x = math.sin(yaw[character])
            facing_z = math.cos(yaw[character])
            vx = desired_velocity_world[character, 0]
            vz = desired_velocity_world[character, 2]
            heading_velocity_world[character, 0] += smoothing * (vx - heading_velocity_world[character, 0])
            heading_velocity_world[character, 2] += smoothing * (vz - heading_velocity_world[character, 2])
            forward = vx * facing_x + vz * facing_z
            turn = 0.0
            side = vx * facing_z - vz * facing_x
            if is_directed[character]:
                forward = directed_parameter[character, 0]
                turn = directed_parameter[character, 1]
                side = directed_parameter[character, 2]
            elif wants_to_walk[character]:
                turn = wanted_turn_rate(
                    character,
                    yaw,
                    heading_velocity_world,
                    position_world,
                    way_point_world,
                    turning_side,
                    limits,
                )
            out_wanted_parameter[character, 0] = forward
            out_wanted_parameter[character, 1] = turn
            out_wanted_parameter[character, 2] = side
            speed_scale = stride_scale[character] * tempo[character]
            out_library_parameter[character, 0] = forward / speed_scale
            out_library_parameter[character, 1] = turn / tempo[character]
            out_library_parameter[character, 2] = side / speed_scale


@parallel_kernel
def approach_crowd(
    library_wish: Any,
    stride_scale: Any,
    tempo: Any,
    active: Any,
    limits: CommandLimits,
    dt: float,
    locomotion_parameter: Any,
    out_library_parameter: Any,
) -> None:
    """Move locomotion parameters towards what is wished, no faster than people can.

    Parameters
    ----------
    library_wish : (N, 3) float64
        Wished parameters inside the locomotion hull, as the motion library knows them.
    stride_scale, tempo : (N,) float64
        See `wish_crowd`.
    active : (A,) int32
        Characters to process.
    limits : CommandLimits
    dt : float
        s.
    locomotion_parameter : (N, 3) float64
        In and out: forward speed m/s, turn rate rad/s, side speed m/s.
    out_library_parameter : (N, 3) float64
        The new parameters as the motion library knows them.

    Notes
    -----
    **Source:** the weakness stated by Feng, Xu, Shapiro, section 4.2, that steering asks for motion which the
    animation cannot do; limits after Glardon et al. (0.7 m/s^2 in steady walking).
    **Differs from the source:** neither paper limits the command before it is blended.
    """
    count = active.shape[0]
    for k in prange(CHUNKS):
        chunk = (k * 37) % CHUNKS
        for index in range(chunk * count // CHUNKS, (chunk + 1) * count // CHUNKS):
            character = active[index]
            speed_scale = stride_scale[character] * tempo[character]
            forward = library_wish[character, 0] * speed_scale
            turn = library_wish[character, 1] * tempo[character]
            side = library_wish[character, 2] * speed_scale
            now = locomotion_parameter[character, 0]
            slows = abs(forward) < abs(now) or forward * now < 0.0
            acceleration = limits.braking if slows else limits.forward_acceleration
            forward = approach(now, forward, acceleration * dt)
            turn = approach(locomotion_parameter[character, 1], turn, limits.turn_acceleration * dt)
            side = approach(locomotion_parameter[character, 2], side, limits.side_acceleration * dt)
            locomotion_parameter[character, 0] = forward
            locomotion_parameter[character, 1] = turn
            locomotion_parameter[character, 2] = side
            out_library_parameter[character, 0] = forward / speed_scale
            out_library_parameter[character, 1] = turn / tempo[character]
            out_library_parameter[character, 2] = side / speed_scale


@parallel_kernel
def gait_crowd(
    wanted_parameter: Any,
    locomotion_parameter: Any,
    cycle_rate: Any,
    tempo: Any,
    active: Any,
    limits: GaitLimits,
    dt: float,
    is_moving: Any,
    locomotion_weight: Any,
    locomotion_weight_rate: Any,
    phase: Any,
) -> None:
    """Start and stop the locomotion layer, ease its weight and advance the gait phase.

    A standing character starts with the foot on the side to which it turns or steps. A moving one stops just
    after a foot has landed, so that no foot freezes in the air.

    Parameters
    ----------
    wanted_parameter, locomotion_parameter : (N, 3) float64
        Wanted and present forward speed m/s, turn rate rad/s, side speed m/s.
    cycle_rate : (N,) float64
        Cycles per second of the blend at tempo 1.
    tempo : (N,) float64
        Factor on the cadence.
    active : (A,) int32
        Characters to process.
    limits : GaitLimits
    dt : float
        s.
    is_moving : (N,) bool
        In and out: the locomotion layer is wanted.
    locomotion_weight, locomotion_weight_rate : (N,) float64
        In and out: share of the layer in [0, 1] and its rate, 1/s.
    phase : (N,) float64
        In and out: gait phase in cycles, [0, 2).

    Notes
    -----
    **Source:** state changes of the paper's locomotion (idle is left and entered by a crossfade), Feng, Xu,
    Shapiro, section 3.
    **Differs from the source:** the crossfade has continuous rate, and waits for double support.
    """
    count = active.shape[0]
    for k in prange(CHUNKS):
        chunk = (k * 37) % CHUNKS
        for index in range(chunk * count // CHUNKS, (chunk + 1) * count // CHUNKS):
            character = active[index]
            turn = wanted_parameter[character, 1]
            side = wanted_parameter[character, 2]
            speed = math.hypot(wanted_parameter[character, 0], side)
            weight = locomotion_weight[character]
            if not is_moving[character]:
                if speed > limits.start_speed or abs(turn) > limits.start_turn_rate:
                    is_moving[character] = True
                    if weight < 0.02:
                        leads_left = turn + side > 0.0
                        phase[character] = LEFT_FOOT_LIFTS if leads_left else RIGHT_FOOT_LIFTS
            else:
                present = math.hypot(locomotion_parameter[character, 0], locomotion_parameter[character, 2])
                slow = max(speed, present) < limits.stop_speed
                straight = max(abs(turn), abs(locomotion_parameter[character, 1])) < limits.stop_turn_rate
                half_phase = 2.0 * phase[character]
                if slow and straight and half_phase - math.floor(half_phase) < DOUBLE_SUPPORT:
                    is_moving[character] = False
            goal = 1.0 if is_moving[character] else 0.0
            weight, rate = ease(weight, locomotion_weight_rate[character], goal, limits.ease_rate, dt)
            if abs(weight - goal) < 1e-3 and abs(rate) < 1e-1:
                weight = goal
                rate = 0.0
            locomotion_weight[character] = weight
            locomotion_weight_rate[character] = rate
            if weight > 0.0:
                advanced = phase[character] + cycle_rate[character] * tempo[character] * dt
                phase[character] = advanced - 2.0 * math.floor(0.5 * advanced)


@parallel_kernel
def integrate_root_crowd(
    library_parameter: Any,
    stride_scale: Any,
    tempo: Any,
    active: Any,
    dt: float,
    position_world: Any,
    yaw: Any,
    out_locomotion_parameter: Any,
) -> None:
    """Move roots over one step along the arc of constant body velocity and turn rate.

    Parameters
    ----------
    library_parameter : (N, 3) float64
        Parameters that the blend realises, as the library knows them; m/s, rad/s, m/s.
    stride_scale, tempo : (N,) float64
        Scale of lengths and of cadence.
    active : (A,) int32
        Characters to process.
    dt : float
        s.
    position_world : (N, 3) float64
        In and out, m; y is left alone.
    yaw : (N,) float64
        In and out, rad in (-pi, pi].
    out_locomotion_parameter : (N, 3) float64
        The realised parameters in the character's own scale.

    Notes
    -----
    **Source:** exact integral of a body-fixed twist over `dt`.
    **Differs from the source:** the chord uses the second-order series of the sine, exact to 1e-8 at 3 rad/s.
    """
    count = active.shape[0]
    for k in prange(CHUNKS):
        chunk = (k * 37) % CHUNKS
        for index in range(chunk * count // CHUNKS, (chunk + 1) * count // CHUNKS):
            character = active[index]
            speed_scale = stride_scale[character] * tempo[character]
            forward = library_parameter[character, 0] * speed_scale
            turn = library_parameter[character, 1] * tempo[character]
            side = library_parameter[character, 2] * speed_scale
            out_locomotion_parameter[character, 0] = forward
            out_locomotion_parameter[character, 1] = turn
            out_locomotion_parameter[character, 2] = side
            half_turn = 0.5 * turn * dt
            chord = dt * (1.0 - half_turn * half_turn / 6.0)
            middle = yaw[character] + half_turn
            facing_x = math.sin(middle)
            facing_z = math.cos(middle)
            position_world[character, 0] += chord * (forward * facing_x + side * facing_z)
            position_world[character, 2] += chord * (forward * facing_z - side * facing_x)
            yaw[character] = wrapped_angle(middle + half_turn)
