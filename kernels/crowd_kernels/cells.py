"""A counting sort of characters into square ground cells.

The plane is lined with square cells at fixed places (a cell's corner is always a multiple of its size). The
cell table has a limited number of rows and columns and repeats over the plane, so one character far away
costs nothing and no character is ever outside it; whoever shares a cell from afar is rejected by distance.
"""

import math
from typing import Any

from crowd_kernels._jit import kernel

FARTHEST_COORDINATE = 1e7
"""Positions beyond this are no positions: the character is left out, m."""


@kernel
def is_point(x: float, z: float) -> bool:
    """Tell whether two coordinates are finite and within reach of the cells.

    Parameters
    ----------
    x, z : float
        Ground coordinates, m.

    Returns
    -------
    bool
    """
    return abs(x) <= FARTHEST_COORDINATE and abs(z) <= FARTHEST_COORDINATE


@kernel
def find_extent(position_world: Any, active: Any, cell_size: float, reach: float, cell_limit: int) -> Any:
    """Choose rows and columns of the cell table.

    Parameters
    ----------
    position_world : (N, 3) float64
        m.
    active : (A,) int32
        Characters that take part.
    cell_size : float
        m, > 0.
    reach : float
        Largest distance that will be searched, m.
    cell_limit : int
        Largest number of cells, >= 1.

    Returns
    -------
    tuple of int
        Columns (along x) and rows (along z). Both are wider than a search, so that it meets no cell twice;
        if the crowd is larger than the table, the table repeats.
    """
    low_x, low_z, high_x, high_z = math.inf, math.inf, -math.inf, -math.inf
    for index in range(active.shape[0]):
        x, z = position_world[active[index], 0], position_world[active[index], 2]
        if is_point(x, z):
            low_x, high_x = min(low_x, x), max(high_x, x)
            low_z, high_z = min(low_z, z), max(high_z, z)
    fewest = 2 * math.ceil(reach / cell_size) + 3
    if low_x > high_x:
        return fewest, fewest
    columns = max(int((high_x - low_x) / cell_size) + 2, fewest)
    rows = max(int((high_z - low_z) / cell_size) + 2, fewest)
    while columns * rows > cell_limit and (columns > fewest or rows > fewest):
        if columns >= rows:
            columns = max((columns + 1) // 2, fewest)
        else:
            rows = max((rows + 1) // 2, fewest)
    return columns, rows


@kernel
def sort_into_cells(
    position_world: Any,
    radius: Any,
    active: Any,
    cell_size: float,
    columns: int,
    rows: int,
    cell_of_index: Any,
    out_cell_start: Any,
    out_character: Any,
    out_slot: Any,
    out_point: Any,
) -> int:
    """Sort characters by cell, stably, and copy their positions in that order.

    Parameters
    ----------
    position_world : (N, 3) float64
        m. A character without a finite position or without a finite, non-negative radius is left out.
    radius : (N,) float64
        m.
    active : (A,) int32
        Characters to sort.
    cell_size : float
        m.
    columns, rows : int
        Of the cell table, see `find_extent`.
    cell_of_index : (>= A,) int32
        Scratch.
    out_cell_start : (>= columns * rows + 1,) int32
        First slot of each cell; the entry after the last cell is the number of sorted characters.
    out_character : (>= A,) int32
        Character in each slot.
    out_slot : (N,) int32
        Slot of each sorted character, -1 for active ones that were left out.
    out_point : (>= 2 A,) float64
        x and z of each slot, m.

    Returns
    -------
    int
        Number of sorted characters.
    """
    cell_count = columns * rows
    out_cell_start[: cell_count + 1] = 0
    scale = 1.0 / cell_size
    for index in range(active.shape[0]):
        character = active[index]
        x, z = position_world[character, 0], position_world[character, 2]
        if not (is_point(x, z) and 0.0 <= radius[character] < math.inf):
            cell_of_index[index] = -1
            out_slot[character] = -1
            continue
        column = math.floor(x * scale) % columns
        row = math.floor(z * scale) % rows
        cell = row * columns + column
        cell_of_index[index] = cell
        out_cell_start[cell + 1] += 1
    for cell in range(cell_count):
        out_cell_start[cell + 1] += out_cell_start[cell]
    sorted_count = int(out_cell_start[cell_count])
    for index in range(active.shape[0] - 1, -1, -1):
        cell = cell_of_index[index]
        if cell < 0:
            continue
        out_cell_start[cell + 1] -= 1
        slot = out_cell_start[cell + 1]
        character = active[index]
        out_character[slot] = character
        out_slot[character] = slot
        out_point[2 * slot] = position_world[character, 0]
        out_point[2 * slot + 1] = position_world[character, 2]
    # Filling from the back has moved every start to where its cell begins, one entry too late.
    for cell in range(cell_count):
        out_cell_start[cell] = out_cell_start[cell + 1]
    out_cell_start[cell_count] = sorted_count
    return sorted_count


@kernel
def mean_company(cell_start: Any, cell_count: int) -> float:
    """Average, over characters, how many others share the cell.

    Parameters
    ----------
    cell_start : (>= cell_count + 1,) int32
        From `sort_into_cells`.
    cell_count : int

    Returns
    -------
    float
        >= 0; it equals the mean number per cell when characters are spread evenly at random.
    """
    total = 0.0
    for cell in range(cell_count):
        count = cell_start[cell + 1] - cell_start[cell]
        total += count * (count - 1.0)
    return total / float(max(cell_start[cell_count], 1))
