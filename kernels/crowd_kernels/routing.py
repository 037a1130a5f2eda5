"""From ways of cells to corners, and from corners to the way point that a character walks to."""

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from crowd_kernels._jit import kernel, parallel_kernel, prange
from crowd_kernels.grid_search import FOUND, descend, search_cells, trace_back

CHUNKS = 32
STRIDE = 8
UNREACHABLE = 1
TOO_LONG = 2


class GridArrays(NamedTuple):
    """A walkable grid as kernels read it."""

    mask: npt.NDArray[np.uint8]
    """(cells,) Moves of each cell."""
    is_open: npt.NDArray[np.uint8]
    """(cells,) Straight lines may cross the cell."""
    point: npt.NDArray[np.float64]
    """(cells, 2) Place in the cell with most room, m."""
    low_x: float
    """Lowest corner of the grid, m."""
    low_z: float
    cell_size: float
    """m."""
    columns: int
    rows: int


@kernel
def cell_at(grid: GridArrays, x: float, z: float) -> int:
    """Find the cell of a point; points outside belong to the nearest border cell."""
    column = min(max(int((x - grid.low_x) / grid.cell_size), 0), grid.columns - 1)
    row = min(max(int((z - grid.low_z) / grid.cell_size), 0), grid.rows - 1)
    return row * grid.columns + column


@kernel
def is_free_line(grid: GridArrays, x: float, z: float, to_x: float, to_z: float, needs_open: bool) -> bool:
    """Tell whether a body can go straight from one point to another.

    Parameters
    ----------
    grid : GridArrays
    x, z, to_x, to_z : float
        Ends of the line, m.
    needs_open : bool
        All cells between the ends must be open; otherwise every allowed move will do.

    Returns
    -------
    bool

    Notes
    -----
    **Source:** Amanatides, Woo, "A fast voxel traversal algorithm for ray tracing", 1987.
    **Differs from the source:** each step must be a move that the cell allows, so that thin walls stop the
    line; a start in a cell where the body does not fit may be left.
    """
    cell = cell_at(grid, x, z)
    last = cell_at(grid, to_x, to_z)
    if cell == last:
        return True
    column = cell % grid.columns
    row = cell // grid.columns
    dx = to_x - x
    dz = to_z - z
    step_x = 1 if dx > 0.0 else -1
    step_z = 1 if dz > 0.0 else -1
    next_x = math.inf
    next_z = math.inf
    delta_x = math.inf
    delta_z = math.inf
    if dx != 0.0:
        delta_x = abs(grid.cell_size / dx)
        border = grid.low_x + (column + (1 if dx > 0.0 else 0)) * grid.cell_size
        next_x = (border - x) / dx
    if dz != 0.0:
        delta_z = abs(grid.cell_size / dz)
        border = grid.low_z + (row + (1 if dz > 0.0 else 0)) * grid.cell_size
        next_z = (border - z) / dz
    limit = abs(last % grid.columns - column) + abs(last // grid.columns - row)
    is_leaving = grid.mask[cell] == 0
    for _ in range(limit):
        if next_x < next_z:
            move = 0 if step_x > 0 else 1
            other = cell + step_x
            next_x += delta_x
        else:
            move = 2 if step_z > 0 else 3
            other = cell + step_z * grid.columns
            next_z += delta_z
        if is_leaving:
            # Beyond a second blocked cell may lie the other side of a wall.
            if grid.mask[other] == 0:
                return False
            is_leaving = False
        elif not (grid.mask[cell] >> move) & 1:
            return False
        cell = other
        if cell == last:
            return not is_leaving
        if needs_open and not is_leaving and not grid.is_open[cell]:
            return False
    return cell == last


@kernel
def pull_string(
    grid: GridArrays,
    cells: Any,
    count: int,
    is_backward: bool,
    start_x: float,
    start_z: float,
    goal_x: float,
    goal_z: float,
    out_corner: Any,
    out_rest: Any,
) -> int:
    """Shorten a way of cells to the corners between which one can go straight.

    Parameters
    ----------
    grid : GridArrays
    cells : (L,) int32
        Cells of the way.
    count : int
        Number of cells.
    is_backward : bool
        The goal's cell comes first.
    start_x, start_z, goal_x, goal_z : float
        Ends of the way, m.
    out_corner : (C, 2) float64
        Corners, the goal last unless there is no room, m.
    out_rest : (C,) float64
        Length of the way from each corner to the goal, m.

    Returns
    -------
    int
        Corners written. A way with more corners than there is room for is cut.

    Notes
    -----
    **Source:** greedy line-of-sight smoothing of grid paths (string pulling).
    """
    corner_count = 0
    x = start_x
    z = start_z
    index = 0
    while index < count - 1 and corner_count < out_corner.shape[0] - 1:
        if is_free_line(grid, x, z, goal_x, goal_z, True):
            break
        seen = index + 1
        stride = STRIDE
        while stride >= 1:
            ahead = seen + stride
            if ahead < count:
                cell = cells[count - 1 - ahead] if is_backward else cells[ahead]
                if is_free_line(grid, x, z, grid.point[cell, 0], grid.point[cell, 1], True):
                    seen = ahead
                    continue
            stride //= 2
        cell = cells[count - 1 - seen] if is_backward else cells[seen]
        x = grid.point[cell, 0]
        z = grid.point[cell, 1]
        out_corner[corner_count, 0] = x
        out_corner[corner_count, 1] = z
        corner_count += 1
        index = seen
    out_corner[corner_count, 0] = goal_x
    out_corner[corner_count, 1] = goal_z
    corner_count += 1
    out_rest[corner_count - 1] = 0.0
    for corner in range(corner_count - 2, -1, -1):
        way_x = out_corner[corner + 1, 0] - out_corner[corner, 0]
        way_z = out_corner[corner + 1, 1] - out_corner[corner, 1]
        out_rest[corner] = out_rest[corner + 1] + math.sqrt(way_x * way_x + way_z * way_z)
    return corner_count


@kernel
def route_by_search(
    grid: GridArrays,
    characters: Any,
    start_cell: Any,
    goal_cell: Any,
    position_world: Any,
    goal_world: Any,
    generation: int,
    cost: Any,
    arrival: Any,
    stamp: Any,
    head: Any,
    following: Any,
    entry: Any,
    cells: Any,
    out_corner: Any,
    out_rest: Any,
    out_corner_count: Any,
    out_status: Any,
) -> None:
    """Find the corners of each character's own way by A*.

    Parameters
    ----------
    grid : GridArrays
    characters : (M,) int32
        Rows.
    start_cell, goal_cell : (M,) int32
        Cells in which the body fits.
    position_world, goal_world : (N, 3) float64
        Ends of the ways, m.
    generation : int
        See `search_cells`; query q uses ``generation + 2 q``.
    cost, arrival, stamp, head, following, entry, cells
        Scratch, see `search_cells` and `trace_back`.
    out_corner : (N, C, 2) float64
        Corners, m.
    out_rest : (N, C) float64
        Length of the way from each corner, m.
    out_corner_count : (N,) int32
        Number of corners.
    out_status : (N,) uint8
        0, `UNREACHABLE` or `TOO_LONG`.

    Notes
    -----
    **Source:** see `search_cells` and `pull_string`. A free straight line needs no search.
    """
    for index in range(characters.shape[0]):
        character = characters[index]
        x = position_world[character, 0]
        z = position_world[character, 2]
        goal_x = goal_world[character, 0]
        goal_z = goal_world[character, 2]
        count = 0
        out_status[character] = 0
        if not is_free_line(grid, x, z, goal_x, goal_z, True):
            status, _, _ = search_cells(
                grid.mask,
                grid.columns,
                start_cell[index],
                goal_cell[index],
                generation + 2 * index,
                cost,
                arrival,
                stamp,
                head,
                following,
                entry,
            )
            if status != FOUND:
                out_status[character] = UNREACHABLE
                out_corner_count[character] = 0
                continue
            count = trace_back(arrival, grid.columns, start_cell[index], goal_cell[index], cells)
            if count == 0:
                out_status[character] = TOO_LONG
                out_corner_count[character] = 0
                continue
        out_corner_count[character] = pull_string(
            grid, cells, count, True, x, z, goal_x, goal_z, out_corner[character], out_rest[character]
        )


@kernel
def route_by_field(
    grid: GridArrays,
    field: Any,
    characters: Any,
    start_cell: Any,
    position_world: Any,
    goal_world: Any,
    cells: Any,
    out_corner: Any,
    out_rest: Any,
    out_corner_count: Any,
    out_status: Any,
) -> None:
    """Find the corners of the ways of characters that share a goal, down its distance field.

    Parameters
    ----------
    grid : GridArrays
    field : (cells,) int32
        Costs of `fill_field`.
    characters : (M,) int32
        Rows.
    start_cell : (M,) int32
        Cells in which the body fits.
    position_world, goal_world : (N, 3) float64
        Ends of the ways, m.
    cells : (L,) int32
        Scratch.
    out_corner : (N, C, 2) float64
        Corners, m.
    out_rest : (N, C) float64
        Length of the way from each corner, m.
    out_corner_count : (N,) int32
        Number of corners.
    out_status : (N,) uint8
        0 or `UNREACHABLE`.

    Notes
    -----
    **Source:** see `fill_field` and `pull_string`.
    """
    for index in range(characters.shape[0]):
        character = characters[index]
        count = descend(grid.mask, grid.columns, field, start_cell[index], cells)
        out_status[character] = 0 if count > 0 else UNREACHABLE
        out_corner_count[character] = 0
        if count > 0:
            out_corner_count[character] = pull_string(
                grid,
                cells,
                count,
                False,
                position_world[character, 0],
                position_world[character, 2],
                goal_world[character, 0],
                goal_world[character, 2],
                out_corner[character],
                out_rest[character],
            )


@parallel_kernel
def follow_crowd(
    grid: GridArrays,
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
    grid : GridArrays
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
        A corner this near is passed, m.
    corner_index : (N,) int32
        In and out: corner that the character walks to.
    out_way_point_world : (N, 3) float64
        That corner, m; y is left alone.
    out_remaining_distance : (N,) float64
        Length of the way to the goal, m; infinite without a way.
    out_is_lost : (N,) uint8
        1 when the corner is out of sight: the way must be found anew.

    Notes
    -----
    **Source:** way points by visibility along a smoothed path.
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
            if last < 0:
                out_way_point_world[character, 0] = x
                out_way_point_world[character, 2] = z
                out_remaining_distance[character] = math.inf
                continue
            index = corner_index[character]
            way_x = corner[character, index, 0] - x
            way_z = corner[character, index, 1] - z
            is_near = way_x * way_x + way_z * way_z < corner_reach * corner_reach
            if is_near or (character + step) % period == 0:
                while index < last and is_free_line(
                    grid, x, z, corner[character, index + 1, 0], corner[character, index + 1, 1], True
                ):
                    index += 1
                if is_near and index == corner_index[character] and index < last:
                    index += 1
                corner_x = corner[character, index, 0]
                corner_z = corner[character, index, 1]
                if not is_free_line(grid, x, z, corner_x, corner_z, False):
                    out_is_lost[character] = 1
                corner_index[character] = index
                way_x = corner[character, index, 0] - x
                way_z = corner[character, index, 1] - z
            out_way_point_world[character, 0] = corner[character, index, 0]
            out_way_point_world[character, 2] = corner[character, index, 1]
            length = math.sqrt(way_x * way_x + way_z * way_z)
            out_remaining_distance[character] = length + rest[character, index]
