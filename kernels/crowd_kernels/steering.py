"""Reciprocal collision avoidance: the velocity nearest to the preferred one that stays safe for a while."""

import math
from typing import Any, NamedTuple

import numpy as np

from crowd_kernels._jit import kernel, parallel_kernel, prange
from crowd_kernels.linear_program import solve_least_violation, solve_nearest
from crowd_kernels.neighbors import CHUNKS, NUMBER_MASK, find_nearest
from crowd_kernels.random import mix
from crowd_kernels.walls import WallTable, wall_lines

VELOCITY_X, VELOCITY_Z, RADIUS, RESPONSIBILITY = 0, 1, 2, 3
PREFERRED_X, PREFERRED_Z, MAXIMUM_SPEED, INVERSE_PREFERRED = 4, 5, 6, 7
BODY_COLUMNS = 8
"""One cache line for each character."""
PURPOSE_SYMMETRY = 0x5E7
PURPOSE_COINCIDENCE = 0xC01
NO_LENGTH = 1e-9
JAM_DENSITY = 5.4
WEIDMANN_GAMMA = 1.913
SLOWEST_SHARE = 0.1
SMALLEST_SHARE = 0.05
"""Who would take on less than this of an avoidance leaves all of it to the other."""


class AvoidanceLimits(NamedTuple):
    """Numbers that govern avoidance."""

    neighbor_count: int
    """Nearest others that are avoided."""
    neighbor_distance: float
    """Others farther away are ignored, m."""
    time_horizon: float
    """Time ahead for which others are avoided, s."""
    wall_time_horizon: float
    """Time ahead for which walls are avoided, s."""
    contact_horizon: float
    """Time within which overlapping characters want to be apart, s."""
    perturbation: float
    """Size of the deterministic disturbance of the preferred velocity, m/s."""
    maximum_acceleration: float
    """Largest change of velocity, m/s^2."""
    follower_share: float
    """How much more those behind give way to those in front than the other way round, 0 to 1."""
    crowd_slowdown: float
    """0 no slowing down in a crowd, 1 as measured by Weidmann."""


@parallel_kernel
def gather_bodies_crowd(
    character: Any,
    sorted_count: int,
    velocity_world: Any,
    preferred_velocity_world: Any,
    radius: Any,
    maximum_speed: Any,
    responsibility: Any,
    out_body: Any,
) -> None:
    """Copy what avoidance reads of each character into cell order.

    Parameters
    ----------
    character : (>= S,) int32
        Character by slot.
    sorted_count : int
        Number of slots.
    velocity_world, preferred_velocity_world : (N, 3) float64
        m/s; values that are not finite count as 0.
    radius : (N,) float64
        m.
    maximum_speed : (N,) float64
        m/s; negative or not finite counts as 0.
    responsibility : (N,) float64
        In [0, 1]; not finite counts as 0.5.
    out_body : (>= BODY_COLUMNS S,) float64
        Written: BODY_COLUMNS numbers for each slot.

    Notes
    -----
    **Source:** structure of arrays in cell order, so that neighbours lie side by side in memory.
    """
    for k in prange(CHUNKS):
        for slot in range(k * sorted_count // CHUNKS, (k + 1) * sorted_count // CHUNKS):
            own = character[slot]
            first = slot * BODY_COLUMNS
            vx, vz = velocity_world[own, 0], velocity_world[own, 2]
            is_known = math.isfinite(vx) and math.isfinite(vz)
            out_body[first + VELOCITY_X] = vx if is_known else 0.0
            out_body[first + VELOCITY_Z] = vz if is_known else 0.0
            px, pz = preferred_velocity_world[own, 0], preferred_velocity_world[own, 2]
            is_known = math.isfinite(px) and math.isfinite(pz)
            out_body[first + PREFERRED_X] = px if is_known else 0.0
            out_body[first + PREFERRED_Z] = pz if is_known else 0.0
            speed = math.sqrt(px * px + pz * pz)
            out_body[first + INVERSE_PREFERRED] = 1.0 / speed if is_known and speed > NO_LENGTH else 0.0
            out_body[first + RADIUS] = radius[own]
            share = responsibility[own]
            out_body[first + RESPONSIBILITY] = min(max(share, 0.0), 1.0) if math.isfinite(share) else 0.5
            speed = maximum_speed[own]
            out_body[first + MAXIMUM_SPEED] = max(speed, 0.0) if math.isfinite(speed) else 0.0


@kernel
def hashed_direction(seed: int, first: int, second: int, purpose: int) -> Any:
    """Draw a unit vector that depends on its keys only.

    Parameters
    ----------
    seed, first, second, purpose : int
        Keys.

    Returns
    -------
    tuple of float
        x and z.
    """
    bits = mix(mix(mix(mix(np.uint64(0), seed), first), second), purpose)
    angle = 2.0 * math.pi * (np.float64(bits >> np.uint64(11)) * 2.0**-53)
    return math.cos(angle), math.sin(angle)


@kernel
def share_of(own_responsibility: float, other_responsibility: float) -> float:
    """Find the share of a mutual avoidance that a character takes on.

    Parameters
    ----------
    own_responsibility, other_responsibility : float
        In [0, 1].

    Returns
    -------
    float
        In [0, 1]; the two shares of a pair add up to 1. Half each if neither wants to yield.
    """
    total = own_responsibility + other_responsibility
    return own_responsibility / total if total > 0.0 else 0.5


@kernel
def pair_line(
    to_x: float,
    to_z: float,
    relative_x: float,
    relative_z: float,
    radius_sum: float,
    inverse_horizon: float,
    inverse_contact_horizon: float,
    apart_x: float,
    apart_z: float,
) -> Any:
    """Find the smallest change of relative velocity that takes a pair out of its velocity obstacle.

    Parameters
    ----------
    to_x, to_z : float
        From the character to the other, m.
    relative_x, relative_z : float
        Velocity of the character minus that of the other, m/s.
    radius_sum : float
        m.
    inverse_horizon : float
        1 / time ahead, 1/s.
    inverse_contact_horizon : float
        1 / time in which an overlap is to be resolved, 1/s.
    apart_x, apart_z : float
        Unit direction in which to part if nothing else tells one.

    Returns
    -------
    tuple of float
        Change x, z (m/s) and unit direction x, z of the boundary there, admissible on the left.

    Notes
    -----
    **Source:** van den Berg, Guy, Lin, Manocha, Reciprocal n-body collision avoidance, 2011, section 4.
    **Differs from the source:** overlaps are resolved within their own horizon instead of one step, so that
    small steps do not ask for large velocities; coincident characters part in a given direction.
    """
    squared = to_x * to_x + to_z * to_z
    is_apart = squared > radius_sum * radius_sum
    rate = inverse_horizon if is_apart else inverse_contact_horizon
    wx, wz = relative_x - rate * to_x, relative_z - rate * to_z
    w_squared = wx * wx + wz * wz
    inward = wx * to_x + wz * to_z
    if not is_apart or (inward < 0.0 and inward * inward > radius_sum * radius_sum * w_squared):
        length = math.sqrt(w_squared)
        if length > NO_LENGTH:
            ux, uz = wx / length, wz / length
        else:
            ux, uz = apart_x, apart_z
        size = radius_sum * rate - length
        return size * ux, size * uz, uz, -ux
    leg = math.sqrt(squared - radius_sum * radius_sum)
    if to_x * wz - to_z * wx > 0.0:
        dx, dz = (to_x * leg - to_z * radius_sum) / squared, (to_x * radius_sum + to_z * leg) / squared
    else:
        dx, dz = -(to_x * leg + to_z * radius_sum) / squared, (to_x * radius_sum - to_z * leg) / squared
    along = relative_x * dx + relative_z * dz
    return along * dx - relative_x, along * dz - relative_z, dx, dz


@kernel
def neighbor_lines(
    slot: int,
    point: Any,
    body: Any,
    slot_of_character: Any,
    character: Any,
    keys: Any,
    found: int,
    limits: AvoidanceLimits,
    seed: int,
    line_count: int,
    out_lines: Any,
) -> int:
    """Append one line for each neighbour that the character yields to.

    Parameters
    ----------
    slot : int
        Of the character.
    point, body : float64
        By slot, see `sort_into_cells` and `gather_bodies_crowd`.
    slot_of_character : (N,) int32
    character : (>= S,) int32
        Character by slot.
    keys : (>= found,) int64
        Neighbours, nearest first.
    found : int
        Number of neighbours.
    limits : AvoidanceLimits
    seed : int
    line_count : int
        Lines so far.
    out_lines : (>= 4 (line_count + found),) float64
        Appended to.

    Returns
    -------
    int
        Lines now.
    """
    inverse_horizon = 1.0 / limits.time_horizon
    inverse_contact_horizon = 1.0 / limits.contact_horizon
    first = slot * BODY_COLUMNS
    x, z = point[2 * slot], point[2 * slot + 1]
    vx, vz, radius = body[first + VELOCITY_X], body[first + VELOCITY_Z], body[first + RADIUS]
    for entry in range(found):
        other = slot_of_character[keys[entry] & NUMBER_MASK]
        theirs = other * BODY_COLUMNS
        to_x, to_z = point[2 * other] - x, point[2 * other + 1] - z
        own_weight, their_weight = body[first + RESPONSIBILITY], body[theirs + RESPONSIBILITY]
        if limits.follower_share > 0.0:
            scale = limits.follower_share / math.sqrt(max(to_x * to_x + to_z * to_z, NO_LENGTH))
            along = to_x * body[first + PREFERRED_X] + to_z * body[first + PREFERRED_Z]
            own_weight *= 1.0 + scale * along * body[first + INVERSE_PREFERRED]
            along = to_x * body[theirs + PREFERRED_X] + to_z * body[theirs + PREFERRED_Z]
            their_weight *= 1.0 - scale * along * body[theirs + INVERSE_PREFERRED]
        share = share_of(own_weight, their_weight)
        if share < SMALLEST_SHARE:
            continue
        apart_x, apart_z = 0.0, 0.0
        if to_x * to_x + to_z * to_z < NO_LENGTH * NO_LENGTH:
            low, high = min(character[slot], character[other]), max(character[slot], character[other])
            apart_x, apart_z = hashed_direction(seed, low, high, PURPOSE_COINCIDENCE)
            if character[slot] == high:
                apart_x, apart_z = -apart_x, -apart_z
        change_x, change_z, dx, dz = pair_line(
            to_x,
            to_z,
            vx - body[theirs + VELOCITY_X],
            vz - body[theirs + VELOCITY_Z],
            radius + body[theirs + RADIUS],
            inverse_horizon,
            inverse_contact_horizon,
            apart_x,
            apart_z,
        )
        place = 4 * line_count
        out_lines[place] = vx + share * change_x
        out_lines[place + 1] = vz + share * change_z
        out_lines[place + 2] = dx
        out_lines[place + 3] = dz
        line_count += 1
    return line_count


@kernel
def crowd_speed_share(
    slot: int, point: Any, body: Any, slot_of_character: Any, keys: Any, found: int, limits: AvoidanceLimits
) -> float:
    """Find the share of its preferred speed that a person keeps in a crowd.

    Parameters
    ----------
    slot : int
        Of the character.
    point, body, slot_of_character, keys, found, limits
        See `neighbor_lines`.

    Returns
    -------
    float
        In [SLOWEST_SHARE, 1].

    Notes
    -----
    **Source:** Weidmann, Transporttechnik der Fussgaenger, 1993: speed over density.
    **Differs from the source:** density is that of the half-disc ahead that holds the neighbours found.
    """
    first = slot * BODY_COLUMNS
    px, pz = body[first + PREFERRED_X], body[first + PREFERRED_Z]
    ahead_count = 0
    squared = 0.0
    for entry in range(found):
        other = slot_of_character[keys[entry] & NUMBER_MASK]
        to_x, to_z = point[2 * other] - point[2 * slot], point[2 * other + 1] - point[2 * slot + 1]
        squared = max(squared, to_x * to_x + to_z * to_z)
        if to_x * px + to_z * pz > 0.0:
            ahead_count += 1
    if found < limits.neighbor_count:
        squared = limits.neighbor_distance * limits.neighbor_distance
    density = ahead_count / max(0.5 * math.pi * squared, 1e-3)
    if density <= 0.2:
        return 1.0
    free = 1.0 - math.exp(-WEIDMANN_GAMMA * (1.0 / density - 1.0 / JAM_DENSITY))
    return 1.0 - limits.crowd_slowdown * (1.0 - max(free, SLOWEST_SHARE))


@kernel
def limited_change(vx: float, vz: float, new_x: float, new_z: float, largest: float) -> Any:
    """Move from one velocity towards another by at most `largest`.

    Parameters
    ----------
    vx, vz, new_x, new_z : float
        m/s.
    largest : float
        m/s.

    Returns
    -------
    tuple of float
        x and z, m/s.
    """
    dx, dz = new_x - vx, new_z - vz
    length = math.sqrt(dx * dx + dz * dz)
    if length <= largest:
        return new_x, new_z
    scale = largest / length
    return vx + scale * dx, vz + scale * dz


@kernel
def steer_chunk(
    cell_start: Any,
    point: Any,
    character: Any,
    slot_of_character: Any,
    body: Any,
    begin: int,
    end: int,
    columns: int,
    rows: int,
    cell_size: float,
    walls: WallTable,
    limits: AvoidanceLimits,
    dt: float,
    seed: int,
    step: int,
    keys: Any,
    lines: Any,
    projected: Any,
    out_velocity_world: Any,
) -> None:
    """Choose the velocities of a run of slots; arguments as in `steer_crowd`, scratch of one chunk.

    Parameters
    ----------
    cell_start, point, character, slot_of_character, body
        See `steer_crowd`.
    begin, end : int
        Run of slots.
    columns, rows, cell_size, walls, limits, dt, seed, step
        See `steer_crowd`.
    keys : (>= max(K, MOST_EDGES),) int64
        Scratch.
    lines, projected : (>= 4 (K + MOST_EDGES),) float64
        Scratch.
    out_velocity_world : (N, 3) float64
        Written in rows of the characters in these slots.
    """
    inverse_wall_horizon = 1.0 / limits.wall_time_horizon
    has_walls = walls.cell_edge.shape[0] > 0
    for slot in range(begin, end):
        own = character[slot]
        first = slot * BODY_COLUMNS
        x, z = point[2 * slot], point[2 * slot + 1]
        vx, vz = body[first + VELOCITY_X], body[first + VELOCITY_Z]
        speed = body[first + MAXIMUM_SPEED]
        hard_count = 0
        if has_walls:
            radius = body[first + RADIUS]
            reach = limits.wall_time_horizon * speed + radius
            hard_count = wall_lines(walls, x, z, vx, vz, radius, reach, inverse_wall_horizon, keys, lines)
        found = find_nearest(
            cell_start, point, character, columns, rows, cell_size,
            x, z, own, -1, limits.neighbor_distance, limits.neighbor_count, keys,
        )  # fmt: skip
        line_count = neighbor_lines(
            slot, point, body, slot_of_character, character, keys, found, limits, seed, hard_count, lines
        )
        share = 1.0
        if limits.crowd_slowdown > 0.0:
            share = crowd_speed_share(slot, point, body, slot_of_character, keys, found, limits)
        px, pz = share * body[first + PREFERRED_X], share * body[first + PREFERRED_Z]
        if limits.perturbation > 0.0:
            turn_x, turn_z = hashed_direction(seed, own, step, PURPOSE_SYMMETRY)
            px += limits.perturbation * turn_x
            pz += limits.perturbation * turn_z
        satisfied, new_x, new_z = solve_nearest(lines, line_count, speed, px, pz, False)
        if satisfied < line_count:
            new_x, new_z = solve_least_violation(
                lines, line_count, hard_count, satisfied, speed, new_x, new_z, projected
            )
        new_x, new_z = limited_change(vx, vz, new_x, new_z, limits.maximum_acceleration * dt)
        out_velocity_world[own, 0] = new_x
        out_velocity_world[own, 2] = new_z


@parallel_kernel
def steer_crowd(
    cell_start: Any,
    point: Any,
    character: Any,
    slot_of_character: Any,
    body: Any,
    sorted_count: int,
    columns: int,
    rows: int,
    cell_size: float,
    walls: WallTable,
    limits: AvoidanceLimits,
    dt: float,
    seed: int,
    step: int,
    keys: Any,
    lines: Any,
    projected: Any,
    out_velocity_world: Any,
) -> None:
    """Choose for each character the velocity nearest to the preferred one that avoids others and walls.

    Parameters
    ----------
    cell_start, point, character, slot_of_character
        From `sort_into_cells`.
    body : (>= BODY_COLUMNS S,) float64
        From `gather_bodies_crowd`.
    sorted_count : int
        Number of slots S.
    columns, rows : int
        Of the cell table.
    cell_size : float
        m.
    walls : WallTable
    limits : AvoidanceLimits
    dt : float
        s.
    seed, step : int
        Keys of the disturbance that breaks symmetry.
    keys : (CHUNKS, >= max(K, MOST_EDGES)) int64
        Scratch.
    lines, projected : (CHUNKS, >= 4 (K + MOST_EDGES)) float64
        Scratch.
    out_velocity_world : (N, 3) float64
        Written in rows of sorted characters, m/s; y is left alone.

    Notes
    -----
    **Source:** van den Berg, Guy, Lin, Manocha, Reciprocal n-body collision avoidance, 2011.
    **Differs from the source:** shares of responsibility per character, a disturbance that breaks symmetry,
    a speed that falls in a crowd and a limit to the change of velocity.
    """
    for k in prange(CHUNKS):
        chunk = (k * 37) % CHUNKS
        begin, end = chunk * sorted_count // CHUNKS, (chunk + 1) * sorted_count // CHUNKS
        steer_chunk(
            cell_start, point, character, slot_of_character, body, begin, end, columns, rows, cell_size,
            walls, limits, dt, seed, step, keys[chunk], lines[chunk], projected[chunk], out_velocity_world,
        )  # fmt: skip
