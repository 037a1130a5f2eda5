"""Ways of characters: found by search or down a field, and followed from corner to corner."""

import math
from typing import Any

from crowd_kernels._jit import kernel, parallel_kernel, prange
from crowd_kernels.cells import is_point
from crowd_kernels.distance_field import descend
from crowd_kernels.free_line import is_free_line
from crowd_kernels.grid_search import FOUND, OVERFLOW, search_cells, trace_back
from crowd_kernels.string_pulling import write_way
from crowd_kernels.walkable import GroundGrid
from crowd_kernels.walls import WallTable

CHUNKS = 32
UNREACHABLE = 1
PASSED = 0.25
RETRY = 8
"""Characters without a way ask again after so many times the period."""


@parallel_kernel
def route_by_search(
    grid: GroundGrid,
    walls: WallTable,
    landmark_cost: Any,
    characters: Any,
    start_cell: Any,
    goal_cell: Any,
    position_world: Any,
    goal_world: Any,
    widest_lane: float,
    generation: int,
    record: Any,
    head: Any,
    queue: Any,
    cells: Any,
    out_corner: Any,
    out_rest: Any,
    out_corner_count: Any,
    out_status: Any,
) -> None:
    """Find the corners of each character's own way by A*.

    Parameters
    ----------
    grid : GroundGrid
    walls : WallTable
    landmark_cost : (L, cells) int32
        See `search_cells`.
    characters : (M,) int32
        Rows.
    start_cell, goal_cell : (M,) int32
        Cells in which the body fits.
    position_world, goal_world : (N, 3) float64
        Ends of the ways, m.
    widest_lane : float
        See `widen_corners`, m.
    generation : int
        Query q uses ``generation + q``, see `search_cells`.
    record : (chunks, cells) int64
        Scratch, see `search_cells`.
    head : (chunks, 256) int32
        Scratch.
    queue : (chunks, entries) int64
        Scratch.
    cells : (chunks, cells) int32
        Scratch.
    out_corner : (N, C, 2) float64
        Corners, m.
    out_rest : (N, C) float64
        Length of the way from each corner, m.
    out_corner_count : (N,) int32
        Number of corners; 0 without a way.
    out_status : (N,) uint8
        0, `UNREACHABLE`, or `OVERFLOW` when the queue was too short: search again with a longer one.

    Notes
    -----
    **Source:** see `search_cells` and `write_way`. A free straight line needs no search.
    """
    chunks = record.shape[0]
    total = characters.shape[0]
    for k in prange(chunks):
        chunk = (k * 37) % chunks
        for index in range(chunk * total // chunks, (chunk + 1) * total // chunks):
            character = characters[index]
            count = 0
            out_status[character] = 0
            out_corner_count[character] = 0
            if not is_free_line(
                walls,
                grid.radius,
                position_world[character, 0],
                position_world[character, 2],
                goal_world[character, 0],
                goal_world[character, 2],
            ):
                status, _, _ = search_cells(
                    grid.mask,
                    grid.columns,
                    start_cell[index],
                    goal_cell[index],
                    generation + index,
                    landmark_cost,
                    record[chunk],
                    head[chunk],
                    queue[chunk],
                )
                if status != FOUND:
                    out_status[character] = OVERFLOW if status == OVERFLOW else UNREACHABLE
                    continue
                count = trace_back(record[chunk], grid.columns, goal_cell[index], cells[chunk])
            write_way(
                grid,
                walls,
                character,
                cells[chunk],
                count,
                True,
                widest_lane,
                position_world,
                goal_world,
                out_corner,
                out_rest,
                out_corner_count,
            )


@parallel_kernel
def route_by_field(
    grid: GroundGrid,
    walls: WallTable,
    field: Any,
    characters: Any,
    start_cell: Any,
    position_world: Any,
    goal_world: Any,
    widest_lane: float,
    cells: Any,
    out_corner: Any,
    out_rest: Any,
    out_corner_count: Any,
    out_status: Any,
) -> None:
    """Find the corners of the ways of characters that share a goal, down its distance field.

    Parameters
    ----------
    grid : GroundGrid
    walls : WallTable
    field : (cells,) int32
        Costs of `fill_field`.
    characters : (M,) int32
        Rows.
    start_cell : (M,) int32
        Cells in which the body fits.
    position_world, goal_world : (N, 3) float64
        Ends of the ways, m.
    widest_lane : float
        See `widen_corners`, m.
    cells : (chunks, cells) int32
        Scratch.
    out_corner : (N, C, 2) float64
        Corners, m.
    out_rest : (N, C) float64
        Length of the way from each corner, m.
    out_corner_count : (N,) int32
        Number of corners; 0 without a way.
    out_status : (N,) uint8
        0 or `UNREACHABLE`.

    Notes
    -----
    **Source:** see `descend` and `write_way`.
    """
    chunks = cells.shape[0]
    total = characters.shape[0]
    for k in prange(chunks):
        chunk = (k * 37) % chunks
        for index in range(chunk * total // chunks, (chunk + 1) * total // chunks):
            character = characters[index]
            count = descend(grid.mask, grid.columns, field, start_cell[index], cells[chunk])
            out_status[character] = 0 if count > 0 else UNREACHABLE
            out_corner_count[character] = 0
            if count > 0:
                write_way(
                    grid,
                    walls,
                    character,
                    cells[chunk],
                    count,
                    False,
                    widest_lane,
                    position_world,
                    goal_world,
                    out_corner,
                    out_rest,
                    out_corner_count,
                )


@kernel
def look_ahead(
    walls: WallTable, radius: float, x: float, z: float, corner: Any, last: int, index: int, reach: float
) -> int:
    """Find the farthest corner that a character can go to straight.

    Parameters
    ----------
    walls : WallTable
    radius : float
        m.
    x, z : float
        Where the character is, m.
    corner : (C, 2) float64
        Corners, m.
    last : int
        Last corner.
    index : int
        Corner that the character walks to.
    reach : float
        A corner a quarter as far counts as passed, one as far as hardly left, m.

    Returns
    -------
    int
        Corner to walk to; -1 when none of the next, this and the one before is in sight.
    """
    found = index
    while found < last and is_free_line(walls, radius, x, z, corner[found + 1, 0], corner[found + 1, 1]):
        found += 1
    if found > index:
        return found
    if is_free_line(walls, radius, x, z, corner[index, 0], corner[index, 1]):
        to_x, to_z = corner[index, 0] - x, corner[index, 1] - z
        is_passed = to_x * to_x + to_z * to_z < PASSED * PASSED * reach * reach
        return index + 1 if is_passed and index < last else index
    if index > 0 and is_free_line(walls, radius, x, z, corner[index - 1, 0], corner[index - 1, 1]):
        to_x, to_z = corner[index - 1, 0] - x, corner[index - 1, 1] - z
        return index if to_x * to_x + to_z * to_z < reach * reach else index - 1
    return -1


@parallel_kernel
def follow_crowd(
    walls: WallTable,
    radius: float,
    position_world: Any,
    corner: Any,
    rest: Any,
    corner_count: Any,
    active: Any,
    step: int,
    period: int,
    corner_reach: float,
    corner_index: Any,
    out_way_point_world: Any,
    out_remaining_distance: Any,
    out_is_lost: Any,
) -> None:
    """Find the farthest corner of its way that each character can go to straight.

    Parameters
    ----------
    walls : WallTable
        Lists reach at least to the radius.
    radius : float
        m.
    position_world : (N, 3) float64
        m.
    corner : (N, C, 2) float64
        Corners of the ways, m.
    rest : (N, C) float64
        Length of the way from each corner, m.
    corner_count : (N,) int32
        Number of corners; characters with 0 stand.
    active : (A,) int32
        Characters to process.
    step, period : int
        Each character looks ahead every `period` steps.
    corner_reach : float
        A corner this near is passed as soon as the next one is in sight, m.
    corner_index : (N,) int32
        In and out: corner that the character walks to.
    out_way_point_world : (N, 3) float64
        That corner, m; y is left alone.
    out_remaining_distance : (N,) float64
        Length of the way to the goal, m; infinite without a way.
    out_is_lost : (N,) uint8
        1 when the way must be found anew: out of sight, or cut for want of room and nearly at its end.

    Notes
    -----
    **Source:** way points by visibility along a smoothed path. Between two looks the way point stays.
    """
    count = active.shape[0]
    for k in prange(CHUNKS):
        chunk = (k * 37) % CHUNKS
        for place in range(chunk * count // CHUNKS, (chunk + 1) * count // CHUNKS):
            character = active[place]
            x = position_world[character, 0]
            z = position_world[character, 2]
            last = corner_count[character] - 1
            out_is_lost[character] = 0
            if last < 0 or not is_point(x, z):
                out_way_point_world[character, 0] = x
                out_way_point_world[character, 2] = z
                out_remaining_distance[character] = math.inf
                if is_point(x, z) and (character + step) % (RETRY * period) == 0:
                    out_is_lost[character] = 1
                continue
            index = corner_index[character]
            way_x = corner[character, index, 0] - x
            way_z = corner[character, index, 1] - z
            is_near = way_x * way_x + way_z * way_z < corner_reach * corner_reach
            is_cut = index == last and rest[character, last] > 0.0
            if (is_near and index < last) or (character + step) % period == 0:
                index = look_ahead(walls, radius, x, z, corner[character], last, index, corner_reach)
                if index < 0 or (is_cut and is_near):
                    out_is_lost[character] = 1
                    index = corner_index[character]
                corner_index[character] = index
                way_x = corner[character, index, 0] - x
                way_z = corner[character, index, 1] - z
            out_way_point_world[character, 0] = corner[character, index, 0]
            out_way_point_world[character, 2] = corner[character, index, 1]
            length = math.sqrt(way_x * way_x + way_z * way_z)
            out_remaining_distance[character] = length + rest[character, index]


@kernel
def mark_crossing_ways(
    position_world: Any,
    corner: Any,
    corner_count: Any,
    corner_index: Any,
    active: Any,
    low_x: float,
    low_z: float,
    high_x: float,
    high_z: float,
    out_is_marked: Any,
) -> None:
    """Mark characters whose way ahead touches a rectangle, and those without a way.

    Parameters
    ----------
    position_world : (N, 3) float64
        m.
    corner : (N, C, 2) float64
        Corners of the ways, m.
    corner_count, corner_index : (N,) int32
        Number of corners; the next one.
    active : (A,) int32
        Characters to look at.
    low_x, low_z, high_x, high_z : float
        Rectangle, m.
    out_is_marked : (N,) bool
        Set where the way touches it; left as it is elsewhere.

    Notes
    -----
    **Source:** clipping of segments by slabs (Liang, Barsky, 1984).
    """
    for place in range(active.shape[0]):
        character = active[place]
        if corner_count[character] == 0:
            out_is_marked[character] = True
        x = position_world[character, 0]
        z = position_world[character, 2]
        for index in range(corner_index[character], corner_count[character]):
            to_x = corner[character, index, 0]
            to_z = corner[character, index, 1]
            if (
                max(x, to_x) >= low_x
                and min(x, to_x) <= high_x
                and max(z, to_z) >= low_z
                and min(z, to_z) <= high_z
            ):
                first, final = 0.0, 1.0
                if to_x != x:
                    a, b = (low_x - x) / (to_x - x), (high_x - x) / (to_x - x)
                    first, final = max(first, min(a, b)), min(final, max(a, b))
                if to_z != z:
                    a, b = (low_z - z) / (to_z - z), (high_z - z) / (to_z - z)
                    first, final = max(first, min(a, b)), min(final, max(a, b))
                if first <= final:
                    out_is_marked[character] = True
                    break
            x = to_x
            z = to_z
