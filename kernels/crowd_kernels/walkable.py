"""Where a body fits and how it can move: from walls and solids to the cells and moves of a walkable grid.

A body fits into a cell when it fits at one of 25 samples in it, so that a gap is passed wherever the grid
lies. Between two such places the straight way must be free as well, which keeps ways from passing through
thin walls and gaps that are too narrow.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from crowd_kernels._jit import kernel, parallel_kernel, prange
from crowd_kernels.cells import is_point
from crowd_kernels.free_line import is_free_line
from crowd_kernels.grid_search import COLUMN_STEP, ROW_STEP
from crowd_kernels.wall_contact import wall_distance
from crowd_kernels.walls import WallTable

SAMPLES = 5
"""Samples on a side of a cell."""
CENTER_BIT = 12
ROW_OF_SAMPLES = 31
IMPROVEMENTS = 8
MARGIN = 0.01
"""A gap may be narrower than the body by this much, m: rounding of what a user wrote."""
LINK_COLUMN, LINK_ROW, LINK_DIAGONALS = 1, 2, 4


class GroundGrid(NamedTuple):
    """A walkable grid for one body radius, as kernels read it."""

    mask: Any
    """(cells,) uint8: moves of each cell."""
    point: Any
    """(cells, 2) float64: place in the cell where the body fits, m."""
    component: Any
    """(cells,) int32: connected part of the grid; -1 where the body does not fit."""
    radius: float
    """m."""
    low_x: float
    """Lowest corner, m."""
    low_z: float
    """Lowest corner, m."""
    high_x: float
    """Highest corner of the walkable ground, m; the last cells may reach beyond."""
    high_z: float
    """Highest corner of the walkable ground, m."""
    cell_size: float
    """m."""
    columns: int
    rows: int


@kernel
def cover_samples(
    outline: Any,
    low_x: float,
    low_z: float,
    cell_size: float,
    first_column: int,
    first_row: int,
    out_inside: Any,
) -> None:
    """Mark the samples of cells that lie inside a polygon.

    Parameters
    ----------
    outline : (K, 2) float64
        Corners in order, either way round, m.
    low_x, low_z : float
        Lowest corner of the grid, m.
    cell_size : float
        m.
    first_column, first_row : int
        First cell of the window.
    out_inside : (rows, columns) uint32
        The cells of the window, 0 on entry. Bit ``5 * i + j`` for sample i along z and j along x.

    Notes
    -----
    **Source:** even-odd rule; every edge flips the samples to its right.
    """
    rows, columns = out_inside.shape
    step = cell_size / SAMPLES
    for index in range(outline.shape[0]):
        ax, az = outline[index, 0], outline[index, 1]
        following = (index + 1) % outline.shape[0]
        bx, bz = outline[following, 0], outline[following, 1]
        first = math.floor((min(az, bz) - low_z) / step - 0.5)
        last = math.ceil((max(az, bz) - low_z) / step - 0.5)
        for line in range(max(first, first_row * SAMPLES), min(last + 1, (first_row + rows) * SAMPLES)):
            z = low_z + (line + 0.5) * step
            if (az <= z) == (bz <= z):
                continue
            x = ax + (bx - ax) * ((z - az) / (bz - az))
            # Number of the first sample to the right of the edge.
            sample = max(math.ceil((x - low_x) / step - 0.5), first_column * SAMPLES)
            column = sample // SAMPLES - first_column
            shift = (line % SAMPLES) * SAMPLES
            row = line // SAMPLES - first_row
            if column < columns:
                part = (ROW_OF_SAMPLES << (sample % SAMPLES)) & ROW_OF_SAMPLES
                out_inside[row, column] ^= np.uint32(part << shift)
            for rest in range(column + 1, columns):
                out_inside[row, rest] ^= np.uint32(ROW_OF_SAMPLES << shift)


@kernel
def improve_place(
    grid: GroundGrid, walls: WallTable, column: int, row: int, x: float, z: float, room: float
) -> tuple[float, float, float]:
    """Look around the best sample of a cell for a place with more room.

    Parameters
    ----------
    grid : GroundGrid
    walls : WallTable
    column, row : int
        The cell.
    x, z : float
        Best sample, m, outside all solids.
    room : float
        Distance from walls there, m.

    Returns
    -------
    x, z, room : float
        Best place found, inside the cell, and its distance from walls, m.

    Notes
    -----
    **Source:** compass search (Kolda, Lewis, Torczon, "Optimization by direct search", 2003), from half the
    distance of samples down to 1 / 32 of it.
    """
    low_x = grid.low_x + column * grid.cell_size
    low_z = grid.low_z + row * grid.cell_size
    high_x = min(low_x + grid.cell_size, grid.high_x)
    high_z = min(low_z + grid.cell_size, grid.high_z)
    step = 0.5 * grid.cell_size / SAMPLES
    for _ in range(IMPROVEMENTS):
        from_x, from_z = x, z
        for move in range(4):
            try_x = min(max(from_x + step * COLUMN_STEP[move], low_x), high_x)
            try_z = min(max(from_z + step * ROW_STEP[move], low_z), high_z)
            here = wall_distance(walls, try_x, try_z)
            # A place farther from walls than the step is on the same side of all of them.
            if here > room and here > step:
                x, z, room = try_x, try_z, here
        if x == from_x and z == from_z:
            step *= 0.5
    return x, z, room


@parallel_kernel
def find_places(
    grid: GroundGrid,
    walls: WallTable,
    cover: Any,
    first_column: int,
    last_column: int,
    first_row: int,
    last_row: int,
    out_is_walkable: Any,
    out_point: Any,
    out_room: Any,
) -> None:
    """Find the cells of a window in which the body fits, and where in them.

    Parameters
    ----------
    grid : GroundGrid
    walls : WallTable
        Lists reach at least to the radius and a cell more.
    cover : (cells,) uint32
        Samples of each cell inside solids, see `cover_samples`.
    first_column, last_column, first_row, last_row : int
        Window, last ones excluded.
    out_is_walkable : (cells,) uint8
        1 where the body fits.
    out_point : (cells, 2) float64
        Place in the cell: its centre where the body fits there or nowhere, else where it has most room, m.
    out_room : (cells,) float64
        Distance of that place from walls, at most the radius and a cell more, m.

    Notes
    -----
    **Source:** sampling of the configuration space of a disc (Lozano-Perez, "Spatial planning: a
    configuration space approach", 1983).
    """
    half_diagonal = 0.7072 * grid.cell_size
    for row in prange(first_row, last_row):
        for column in range(first_column, last_column):
            cell = row * grid.columns + column
            x = grid.low_x + (column + 0.5) * grid.cell_size
            z = grid.low_z + (row + 0.5) * grid.cell_size
            out_point[cell, 0] = x
            out_point[cell, 1] = z
            # Walls farther away count as equal, so that a cell depends on near ones only.
            farthest = grid.radius + grid.cell_size
            room = min(wall_distance(walls, x, z), farthest)
            out_room[cell] = room
            is_free = ((cover[cell] >> CENTER_BIT) & 1) == 0 and x <= grid.high_x and z <= grid.high_z
            if is_free and room >= grid.radius:
                out_is_walkable[cell] = 1
                continue
            out_is_walkable[cell] = 0
            if room + half_diagonal < grid.radius:
                continue
            best = 0.0
            for sample in range(SAMPLES * SAMPLES):
                if (cover[cell] >> sample) & 1:
                    continue
                place_x = grid.low_x + (column + (sample % SAMPLES + 0.5) / SAMPLES) * grid.cell_size
                place_z = grid.low_z + (row + (sample // SAMPLES + 0.5) / SAMPLES) * grid.cell_size
                if place_x > grid.high_x or place_z > grid.high_z:
                    continue
                here = min(wall_distance(walls, place_x, place_z), farthest)
                if here > best:
                    best = here
                    out_point[cell, 0] = place_x
                    out_point[cell, 1] = place_z
            if grid.radius - grid.cell_size / SAMPLES < best < grid.radius:
                place_x, place_z, best = improve_place(
                    grid, walls, column, row, out_point[cell, 0], out_point[cell, 1], best
                )
                out_point[cell, 0] = place_x
                out_point[cell, 1] = place_z
            if best >= grid.radius - MARGIN:
                out_is_walkable[cell] = 1
                out_room[cell] = best
            else:
                out_point[cell, 0] = x
                out_point[cell, 1] = z


@kernel
def is_free_link(grid: GroundGrid, walls: WallTable, is_walkable: Any, room: Any, a: int, b: int) -> bool:
    """Tell whether a body can go straight between its places in two neighbouring cells."""
    if not (is_walkable[a] and is_walkable[b]):
        return False
    ax, az, bx, bz = grid.point[a, 0], grid.point[a, 1], grid.point[b, 0], grid.point[b, 1]
    # Nowhere between two places is there less room than half of what they have beyond the way itself.
    way = math.sqrt((bx - ax) * (bx - ax) + (bz - az) * (bz - az))
    if room[a] + room[b] - way >= 2.0 * grid.radius:
        return True
    return is_free_line(walls, grid.radius, ax, az, bx, bz)


@parallel_kernel
def link_places(
    grid: GroundGrid,
    walls: WallTable,
    is_walkable: Any,
    room: Any,
    first_column: int,
    last_column: int,
    first_row: int,
    last_row: int,
    out_link: Any,
) -> None:
    """Find between which neighbouring cells of a window the body can go straight.

    Parameters
    ----------
    grid : GroundGrid
    walls : WallTable
        Lists reach at least to the radius.
    is_walkable : (cells,) uint8
    room : (cells,) float64
        Room at the place in each cell, see `find_places`, m.
    first_column, last_column, first_row, last_row : int
        Window, last ones excluded.
    out_link : (cells,) uint8
        Bits: 1 to the next column, 2 to the next row, 4 both diagonals between this cell and the one in the
        next row and column.

    Notes
    -----
    **Source:** local planner of a roadmap, see `crowd_kernels.free_line`.
    """
    for row in prange(first_row, last_row):
        for column in range(first_column, last_column):
            cell = row * grid.columns + column
            link = 0
            has_next_column = column + 1 < grid.columns
            has_next_row = row + 1 < grid.rows
            if has_next_column and is_free_link(grid, walls, is_walkable, room, cell, cell + 1):
                link |= LINK_COLUMN
            if has_next_row and is_free_link(grid, walls, is_walkable, room, cell, cell + grid.columns):
                link |= LINK_ROW
            if (
                has_next_column
                and has_next_row
                and is_free_link(grid, walls, is_walkable, room, cell, cell + grid.columns + 1)
                and is_free_link(grid, walls, is_walkable, room, cell + 1, cell + grid.columns)
            ):
                link |= LINK_DIAGONALS
            out_link[cell] = link


@parallel_kernel
def mask_links(
    link: Any,
    columns: int,
    rows: int,
    first_column: int,
    last_column: int,
    first_row: int,
    last_row: int,
    out_mask: Any,
) -> None:
    """Find the moves of the cells of a window: diagonal ones only where the whole block of four is linked.

    Parameters
    ----------
    link : (cells,) uint8
        See `link_places`.
    columns, rows : int
        Size of the grid.
    first_column, last_column, first_row, last_row : int
        Window, last ones excluded.
    out_mask : (cells,) uint8
        Bit d for the move (COLUMN_STEP[d], ROW_STEP[d]).

    Notes
    -----
    **Source:** rules of the Moving AI benchmarks (Sturtevant, "Benchmarks for grid-based pathfinding", 2012):
    eight moves, no cutting of corners.
    """
    for row in prange(first_row, last_row):
        for column in range(first_column, last_column):
            cell = row * columns + column
            mask = 0
            for move in range(8):
                across, along = COLUMN_STEP[move], ROW_STEP[move]
                if not (0 <= column + across < columns and 0 <= row + along < rows):
                    continue
                # The cell of the move's edge or block with the lowest column and row.
                low = cell + min(across, 0) + min(along, 0) * columns
                if along == 0:
                    is_free = link[low] & LINK_COLUMN
                elif across == 0:
                    is_free = link[low] & LINK_ROW
                else:
                    is_free = link[low] & link[low + columns] & LINK_COLUMN
                    if not (link[low] & link[low + 1] & LINK_ROW) or not (link[low] & LINK_DIAGONALS):
                        is_free = 0
                if is_free:
                    mask |= 1 << move
            out_mask[cell] = mask


@kernel
def link_cells(is_walkable: Any, columns: int, rows: int, out_link: Any) -> None:
    """Link all neighbouring walkable cells of a map without thin walls.

    Parameters
    ----------
    is_walkable : (cells,) uint8
    columns, rows : int
        Size of the grid.
    out_link : (cells,) uint8
        See `link_places`.
    """
    for cell in range(columns * rows):
        link = LINK_DIAGONALS
        if is_walkable[cell]:
            if (cell + 1) % columns != 0 and is_walkable[cell + 1]:
                link |= LINK_COLUMN
            if cell + columns < columns * rows and is_walkable[cell + columns]:
                link |= LINK_ROW
        out_link[cell] = link


@kernel
def nearest_cell(grid: GroundGrid, x: float, z: float, part: int, reach: float) -> int:
    """Find the cell whose place is nearest to a point.

    Parameters
    ----------
    grid : GroundGrid
    x, z : float
        m.
    part : int
        Component in which to look; -1 for all.
    reach : float
        Farthest place, m.

    Returns
    -------
    int
        Cell; -1 when there is none. Between equally near cells, the one found first in rings of cells.
    """
    if not is_point(x, z):
        return -1
    column = min(max(int((x - grid.low_x) / grid.cell_size), 0), grid.columns - 1)
    row = min(max(int((z - grid.low_z) / grid.cell_size), 0), grid.rows - 1)
    cell = row * grid.columns + column
    if grid.component[cell] >= 0 and (part < 0 or grid.component[cell] == part):
        return cell
    best = -1
    least = reach * reach
    for ring in range(1, max(grid.columns, grid.rows)):
        bound = (ring - 1) * grid.cell_size
        if bound * bound > least:
            break
        for j in range(max(row - ring, 0), min(row + ring, grid.rows - 1) + 1):
            # Full rows at the top and bottom of the ring, else its two ends.
            stride = 1 if abs(j - row) == ring else 2 * ring
            for i in range(column - ring, column + ring + 1, stride):
                if i < 0 or i >= grid.columns:
                    continue
                other = j * grid.columns + i
                if grid.component[other] < 0 or (part >= 0 and grid.component[other] != part):
                    continue
                gap_x, gap_z = grid.point[other, 0] - x, grid.point[other, 1] - z
                gap = gap_x * gap_x + gap_z * gap_z
                if gap < least:
                    least = gap
                    best = other
    return best


@kernel
def nearest_cells(grid: GroundGrid, points: Any, part: Any, reach: float, out_cell: Any) -> None:
    """Find the cells whose places are nearest to points.

    Parameters
    ----------
    grid : GroundGrid
    points : (P, 2) float64
        m.
    part : (P,) int32
        Component in which to look; -1 for all.
    reach : float
        Farthest place, m.
    out_cell : (P,) int32
        Cells; -1 where there is none.
    """
    for index in range(points.shape[0]):
        out_cell[index] = nearest_cell(grid, points[index, 0], points[index, 1], part[index], reach)
