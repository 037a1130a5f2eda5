"""Nearest neighbours on the ground, by a search in growing rings of cells.

Results depend neither on the size of the cells nor on the order of visits, because neighbours are ordered by
distance and then by number.
"""

import math
from typing import Any

import numpy as np

from crowd_kernels._jit import inlined_kernel, parallel_kernel, prange

CHUNKS = 32
NUMBER_BITS = 32
NUMBER_MASK = (1 << NUMBER_BITS) - 1
ROUNDED_UP = 1.0 + 1e-6
"""Squared distances in keys are rounded; bounds made from them are widened by this."""


@inlined_kernel
def neighbor_key(squared_distance: float, number: int) -> int:
    """Pack distance and number into one integer that sorts by distance, then by number.

    Parameters
    ----------
    squared_distance : float
        m^2, >= 0; rounded to float32.
    number : int
        Character, 0 <= number < 2^32.

    Returns
    -------
    int
    """
    # A non-negative float and its bits read as an integer have the same order.
    bits = np.int64(np.float32(squared_distance).view(np.int32))
    return (bits << NUMBER_BITS) | np.int64(number)  # type: ignore[return-value]


@inlined_kernel
def squared_distance_of(key: int) -> float:
    """Read the squared distance from a key.

    Parameters
    ----------
    key : int
        From `neighbor_key`.

    Returns
    -------
    float
        m^2.
    """
    return np.float64(np.int32(key >> NUMBER_BITS).view(np.float32))


@inlined_kernel
def insert_run(
    point: Any,
    character: Any,
    begin: int,
    end: int,
    x: float,
    z: float,
    own: int,
    above: int,
    wanted: int,
    keys: Any,
) -> None:
    """Insert the characters of a run of slots into the sorted list of nearest ones.

    Parameters
    ----------
    point : (>= 2 S,) float64
        x, z by slot, m.
    character : (>= S,) int32
        Character by slot.
    begin, end : int
        Run of slots.
    x, z : float
        Where the search stands, m.
    own : int
        Character that is left out.
    above : int
        Only characters with numbers above this are taken.
    wanted : int
        Length of the list.
    keys : (>= wanted,) int64
        The list, ascending; only keys below its last one are taken. In and out.
    """
    limit_key = keys[wanted - 1]
    for slot in range(begin, end):
        dx = point[2 * slot] - x
        dz = point[2 * slot + 1] - z
        key = neighbor_key(dx * dx + dz * dz, character[slot])
        if key >= limit_key or character[slot] == own or character[slot] <= above:
            continue
        # A pass over the whole list without a branch beats a search for the place, which is mispredicted.
        for place in range(wanted):
            other = keys[place]
            keys[place] = min(other, key)
            key = max(other, key)
        limit_key = keys[wanted - 1]


@inlined_kernel
def insert_row(
    cell_start: Any,
    point: Any,
    character: Any,
    columns: int,
    first_cell: int,
    column: int,
    count: int,
    x: float,
    z: float,
    own: int,
    above: int,
    wanted: int,
    keys: Any,
) -> None:
    """Insert the characters of some cells side by side; the row of cells closes into a ring.

    Parameters
    ----------
    cell_start : (>= cells + 1,) int32
    point, character
        By slot, see `insert_run`.
    columns : int
        Cells in a row.
    first_cell : int
        Cell in column 0 of the row.
    column : int
        First column, -columns <= column < columns.
    count : int
        Number of cells, <= columns.
    x, z, own, above, wanted, keys
        See `insert_run`.
    """
    if column < 0:
        column += columns
    rest = column + count - columns
    if rest > 0:
        count -= rest
    begin = cell_start[first_cell + column]
    end = cell_start[first_cell + column + count]
    insert_run(point, character, begin, end, x, z, own, above, wanted, keys)
    if rest > 0:
        begin, end = cell_start[first_cell], cell_start[first_cell + rest]
        insert_run(point, character, begin, end, x, z, own, above, wanted, keys)


@inlined_kernel
def find_nearest(
    cell_start: Any,
    point: Any,
    character: Any,
    columns: int,
    rows: int,
    cell_size: float,
    x: float,
    z: float,
    own: int,
    above: int,
    reach: float,
    wanted: int,
    keys: Any,
) -> int:
    """Find the nearest characters to a point.

    Parameters
    ----------
    cell_start, point, character
        From `crowd_kernels.cells.sort_into_cells`.
    columns, rows : int
        Of the cell table.
    cell_size : float
        m.
    x, z : float
        Point, m.
    own : int
        Character that is left out, or -1.
    above : int
        Only characters with numbers above this are taken; -1 for all.
    reach : float
        Only characters nearer than this are taken, m; the cell table was made for at least this.
    wanted : int
        Largest number to find, >= 1.
    keys : (>= wanted,) int64
        Written: `neighbor_key` of those found, ascending, then numbers without meaning.

    Returns
    -------
    int
        Number found.

    Notes
    -----
    **Source:** ring search over a uniform grid, as in cell lists of molecular dynamics.
    **Differs from the source:** rows and single cells of a ring that lie beyond the farthest neighbour found
    so far are skipped.
    """
    own_column, own_row = math.floor(x / cell_size), math.floor(z / cell_size)
    inner_x, inner_z = x - own_column * cell_size, z - own_row * cell_size
    edge = min(min(inner_x, cell_size - inner_x), min(inner_z, cell_size - inner_z))
    column, row = own_column % columns, own_row % rows
    last_ring = min(math.ceil(reach / cell_size) + 1, (min(columns, rows) - 1) // 2)
    # With number 0, whoever is exactly at `reach` is out.
    reach_key = neighbor_key(reach * reach, 0)
    for place in range(wanted):
        keys[place] = reach_key
    # The own cell and the ring around it are taken in one go, as three rows.
    for ring in range(1, last_ring + 1):
        gap = (ring - 1) * cell_size + edge
        if ring > 1 and gap * gap > ROUNDED_UP * squared_distance_of(keys[wanted - 1]):
            break
        for turn in range(2 * ring + 1):
            # The nearest rows come first, so that the list soon refuses most of the others.
            step = (turn + 1) // 2 if turn % 2 == 1 else -(turn // 2)
            gap = step * cell_size - inner_z if step > 0 else inner_z - (step + 1) * cell_size
            if step != 0 and gap * gap > ROUNDED_UP * squared_distance_of(keys[wanted - 1]):
                continue
            line = row + step
            if line < 0:
                line += rows
            elif line >= rows:
                line -= rows
            is_whole = ring == 1 or abs(step) == ring
            width = 2 * ring + 1 if is_whole else 1
            insert_row(
                cell_start, point, character, columns, line * columns, column - ring, width,
                x, z, own, above, wanted, keys,
            )  # fmt: skip
            if not is_whole:
                right = column + ring if column + ring < columns else column + ring - columns
                insert_row(
                    cell_start, point, character, columns, line * columns, right, 1,
                    x, z, own, above, wanted, keys,
                )  # fmt: skip
    found = 0
    while found < wanted and keys[found] < reach_key:
        found += 1
    return found


@parallel_kernel
def find_neighbors_crowd(
    cell_start: Any,
    point: Any,
    character: Any,
    sorted_count: int,
    columns: int,
    rows: int,
    cell_size: float,
    reach: float,
    keys: Any,
    out_neighbor: Any,
    out_distance: Any,
    out_neighbor_count: Any,
) -> None:
    """Find the nearest others of every sorted character.

    Parameters
    ----------
    cell_start, point, character
        From `crowd_kernels.cells.sort_into_cells`.
    sorted_count : int
        Number of sorted characters.
    columns, rows : int
        Of the cell table.
    cell_size : float
        m.
    reach : float
        Only neighbours nearer than this are taken, m.
    keys : (CHUNKS, >= K) int64
        Scratch.
    out_neighbor : (N, K) int32
        Written in rows of sorted characters: neighbours by distance, then by number.
    out_distance : (N, K) float64
        Their distances, m, rounded to float32.
    out_neighbor_count : (N,) int32
        How many were found.

    Notes
    -----
    **Source:** ring search over sorted cells (Green, "Particle simulation using CUDA", 2010, section 3).
    **Differs from the source:** rings end as soon as nothing nearer can follow, and ties go to the smaller
    number.
    """
    wanted = out_neighbor.shape[1]
    for k in prange(CHUNKS):
        chunk = (k * 37) % CHUNKS
        chunk_keys = keys[chunk]
        for slot in range(chunk * sorted_count // CHUNKS, (chunk + 1) * sorted_count // CHUNKS):
            own = character[slot]
            found = find_nearest(
                cell_start, point, character, columns, rows, cell_size,
                point[2 * slot], point[2 * slot + 1], own, -1, reach, wanted, chunk_keys,
            )  # fmt: skip
            out_neighbor_count[own] = found
            for index in range(found):
                out_neighbor[own, index] = np.int32(chunk_keys[index] & NUMBER_MASK)
                out_distance[own, index] = math.sqrt(squared_distance_of(chunk_keys[index]))
