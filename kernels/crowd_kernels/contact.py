"""Bodies pushed apart: pairs that overlap are separated one after the other until no overlap is deep."""

import math
from typing import Any, NamedTuple

import numpy as np

from crowd_kernels._jit import kernel, parallel_kernel, prange
from crowd_kernels.cells import is_point
from crowd_kernels.neighbors import CHUNKS, NUMBER_MASK, find_nearest, squared_distance_of
from crowd_kernels.steering import hashed_direction
from crowd_kernels.wall_contact import hold_at_walls, wall_distance
from crowd_kernels.walls import WallTable

MOST_PARTNERS = 12
"""Partners with larger numbers that a character keeps; nearer ones go first."""
PURPOSE_PARTING = 0xA7
NO_DISTANCE = 1e-6
TOUCH_GAP = 1e-3
"""Bodies this near count as touching when velocities are corrected, m."""


class ContactLimits(NamedTuple):
    """Numbers that govern contact."""

    full_passes: int
    """Passes that separate every overlapping pair."""
    most_passes: int
    """Largest number of passes; those after the full ones separate only pairs deeper than `wanted_depth`."""
    wanted_depth: float
    """Overlap that is left alone after the full passes, m."""
    margin: float
    """Pairs up to this far apart are watched, m."""


@parallel_kernel
def find_pairs_crowd(
    cell_start: Any,
    point: Any,
    character: Any,
    sorted_count: int,
    columns: int,
    rows: int,
    cell_size: float,
    radius: Any,
    largest_radius: float,
    margin: float,
    keys: Any,
    out_partner: Any,
    out_partner_count: Any,
) -> None:
    """List for every character the partners that it touches or nearly touches; each pair appears once.

    Parameters
    ----------
    cell_start, point, character, sorted_count, columns, rows, cell_size
        From `sort_into_cells`.
    radius : (N,) float64
        m.
    largest_radius : float
        Largest radius of a sorted character, m.
    margin : float
        Pairs with a gap up to this are listed, m.
    keys : (CHUNKS, >= MOST_PARTNERS) int64
        Scratch.
    out_partner : (N, MOST_PARTNERS) int32
        Written in rows of sorted characters: partners with larger numbers, nearest first.
    out_partner_count : (N,) int32
        How many.

    Notes
    -----
    **Source:** cell lists as in `crowd_kernels.neighbors`; each pair is kept by its smaller number.
    """
    for k in prange(CHUNKS):
        chunk = (k * 37) % CHUNKS
        chunk_keys = keys[chunk]
        for slot in range(chunk * sorted_count // CHUNKS, (chunk + 1) * sorted_count // CHUNKS):
            own = character[slot]
            reach = radius[own] + largest_radius + margin
            found = find_nearest(
                cell_start, point, character, columns, rows, cell_size,
                point[2 * slot], point[2 * slot + 1], own, own, reach, MOST_PARTNERS, chunk_keys,
            )  # fmt: skip
            count = 0
            for entry in range(found):
                other = np.int32(chunk_keys[entry] & NUMBER_MASK)
                squared = squared_distance_of(chunk_keys[entry])
                near = radius[own] + radius[other] + margin
                if squared <= near * near:
                    out_partner[own, count] = other
                    count += 1
            out_partner_count[own] = count


@kernel
def separate_pair(
    first: int,
    second: int,
    threshold: float,
    position_world: Any,
    radius: Any,
    mobility: Any,
    seed: int,
) -> float:
    """Move two characters apart until they touch, if they overlap by more than a threshold.

    Parameters
    ----------
    first, second : int
        Characters, `first` < `second`.
    threshold : float
        Overlaps up to this are left alone, m.
    position_world : (N, 3) float64
        In and out, m.
    radius : (N,) float64
        m.
    mobility : (N,) float64
        Share in the motion, >= 0; 0 stays where it is.
    seed : int
        Key of the direction in which coincident characters part.

    Returns
    -------
    float
        Depth of the overlap before, m; negative when apart, -inf when neither can move.
    """
    total = mobility[first] + mobility[second]
    if not total > 0.0:
        return -math.inf
    dx = position_world[second, 0] - position_world[first, 0]
    dz = position_world[second, 2] - position_world[first, 2]
    sum_of_radii = float(radius[first] + radius[second])
    squared = float(dx * dx + dz * dz)
    nearest = max(sum_of_radii - threshold, 0.0)
    if squared >= nearest * nearest:
        return sum_of_radii - math.sqrt(squared)
    distance = math.sqrt(squared)
    depth = sum_of_radii - distance
    if distance > NO_DISTANCE:
        dx, dz = dx / distance, dz / distance
    else:
        dx, dz = hashed_direction(seed, first, second, PURPOSE_PARTING)
    push = depth * mobility[first] / total
    position_world[first, 0] -= push * dx
    position_world[first, 2] -= push * dz
    push = depth - push
    position_world[second, 0] += push * dx
    position_world[second, 2] += push * dz
    return depth


@kernel
def list_near_walls(
    position_world: Any,
    previous_position_world: Any,
    radius: Any,
    active: Any,
    slot_of_character: Any,
    walls: WallTable,
    margin: float,
    out_near: Any,
) -> int:
    """List the characters whose motion in this step may be limited by a wall.

    Parameters
    ----------
    position_world, previous_position_world : (N, 3) float64
        After and before the step, m.
    radius : (N,) float64
        m.
    active : (A,) int32
    slot_of_character : (N,) int32
        -1 marks characters that are left out.
    walls : WallTable
    margin : float
        Characters up to this far from a wall are listed, m.
    out_near : (>= A,) int32
        Written, ascending.

    Returns
    -------
    int
        How many.
    """
    count = 0
    if walls.cell_edge.shape[0] == 0:
        return count
    for index in range(active.shape[0]):
        own = active[index]
        x, z = previous_position_world[own, 0], previous_position_world[own, 2]
        if slot_of_character[own] < 0 or not is_point(x, z):
            continue
        dx, dz = position_world[own, 0] - x, position_world[own, 2] - z
        needed = radius[own] + margin + math.sqrt(dx * dx + dz * dz)
        if needed >= walls.reach or wall_distance(walls, x, z) < needed:
            out_near[count] = own
            count += 1
    return count


@kernel
def relax_contacts(
    position_world: Any,
    previous_position_world: Any,
    radius: Any,
    mobility: Any,
    active: Any,
    slot_of_character: Any,
    partner: Any,
    partner_count: Any,
    near: Any,
    near_count: int,
    walls: WallTable,
    limits: ContactLimits,
    full_passes: int,
    dt: float,
    seed: int,
) -> float:
    """Separate overlapping pairs one after the other, pass by pass, with walls holding at the end of each.

    Parameters
    ----------
    position_world : (N, 3) float64
        In and out, m.
    previous_position_world : (N, 3) float64
        Before the step, on the right side of every wall, m.
    radius, mobility : (N,) float64
        See `separate_pair`.
    active : (A,) int32
        Characters in ascending order; this is the order of the passes, so that it depends on nothing else.
    slot_of_character : (N,) int32
        -1 marks characters that are left out.
    partner, partner_count
        From `find_pairs_crowd`.
    near, near_count
        From `list_near_walls`.
    walls : WallTable
    limits : ContactLimits
    full_passes : int
        Passes that separate every overlapping pair, however shallow.
    dt : float
        s.
    seed : int

    Returns
    -------
    float
        Deepest overlap met in the last pass, m; at most `limits.wanted_depth` when the work is done.

    Notes
    -----
    **Source:** position-based dynamics (Mueller et al. 2007) with Gauss-Seidel order.
    **Differs from the source:** after the full passes only deep pairs are touched, so a group of characters
    that is in order is not affected by how many passes another group needs.
    """
    count = active.shape[0]
    deepest = 0.0
    for sweep in range(limits.most_passes):
        threshold = 0.0 if sweep < full_passes else limits.wanted_depth
        deepest = 0.0
        for index in range(count):
            # Alternating directions carry a push through a crowd in both.
            own = active[index] if sweep % 2 == 0 else active[count - 1 - index]
            if slot_of_character[own] < 0:
                continue
            for entry in range(partner_count[own]):
                depth = separate_pair(
                    own, partner[own, entry], threshold, position_world, radius, mobility, seed
                )
                deepest = max(deepest, depth)
        for entry in range(near_count):
            own = near[entry]
            if mobility[own] > 0.0:
                hold_at_walls(own, position_world, previous_position_world, radius[own], walls, dt)
        if deepest <= limits.wanted_depth and sweep + 1 >= full_passes:
            break
        if deepest <= 0.0:
            break
    return deepest


@kernel
def measure_contacts(
    position_world: Any,
    radius: Any,
    mobility: Any,
    active: Any,
    slot_of_character: Any,
    point: Any,
    partner: Any,
    partner_count: Any,
) -> Any:
    """Measure the deepest overlap of the listed pairs and how far anyone moved since they were listed.

    Parameters
    ----------
    position_world : (N, 3) float64
        m.
    radius, mobility : (N,) float64
    active : (A,) int32
    slot_of_character : (N,) int32
        -1 marks characters that are left out.
    point : (>= 2 S,) float64
        Positions by slot when the pairs were listed, m.
    partner, partner_count
        From `find_pairs_crowd`.

    Returns
    -------
    tuple of float
        Deepest overlap and largest displacement, m, both >= 0.
    """
    deepest, farthest = 0.0, 0.0
    for index in range(active.shape[0]):
        own = active[index]
        slot = slot_of_character[own]
        if slot < 0:
            continue
        x, z = position_world[own, 0], position_world[own, 2]
        moved_x, moved_z = x - point[2 * slot], z - point[2 * slot + 1]
        farthest = max(farthest, moved_x * moved_x + moved_z * moved_z)
        for entry in range(partner_count[own]):
            other = partner[own, entry]
            dx, dz = position_world[other, 0] - x, position_world[other, 2] - z
            if mobility[own] + mobility[other] > 0.0:
                deepest = max(deepest, radius[own] + radius[other] - math.sqrt(dx * dx + dz * dz))
    return deepest, math.sqrt(farthest)


@kernel
def stop_approach(
    velocity_world: Any,
    position_world: Any,
    radius: Any,
    mobility: Any,
    active: Any,
    slot_of_character: Any,
    partner: Any,
    partner_count: Any,
) -> None:
    """Take away the velocity with which touching characters press into each other.

    Parameters
    ----------
    velocity_world : (N, 3) float64
        In and out, m/s.
    position_world : (N, 3) float64
        m.
    radius, mobility : (N,) float64
    active : (A,) int32
    slot_of_character : (N,) int32
        -1 marks characters that are left out.
    partner, partner_count
        From `find_pairs_crowd`.
    """
    for index in range(active.shape[0]):
        own = active[index]
        if slot_of_character[own] < 0:
            continue
        for entry in range(partner_count[own]):
            other = partner[own, entry]
            total = mobility[own] + mobility[other]
            dx = position_world[other, 0] - position_world[own, 0]
            dz = position_world[other, 2] - position_world[own, 2]
            distance = math.sqrt(dx * dx + dz * dz)
            touching = radius[own] + radius[other] + TOUCH_GAP
            if not (total > 0.0 and NO_DISTANCE < distance <= touching):
                continue
            dx, dz = dx / distance, dz / distance
            approach = (velocity_world[own, 0] - velocity_world[other, 0]) * dx
            approach += (velocity_world[own, 2] - velocity_world[other, 2]) * dz
            if not approach > 0.0:
                continue
            share = approach * mobility[own] / total
            velocity_world[own, 0] -= share * dx
            velocity_world[own, 2] -= share * dz
            share = approach - share
            velocity_world[other, 0] += share * dx
            velocity_world[other, 2] += share * dz
