"""Shortest ways on a grid: A* for one goal, distance fields for a goal that many share.

Cells are numbered ``row * columns + column``. A mask holds one bit for each of the eight moves that a cell
allows, with the corner rule and thin walls baked in, so that the searches need no tests of borders.
"""

import math
from typing import Any

import numpy as np

from crowd_kernels._jit import kernel, parallel_kernel, prange

STRAIGHT = 70
DIAGONAL = 99
BUCKETS = 256
FOUND = 0
UNREACHABLE = 1
OVERFLOW = 2
UNSEEN = np.int32(2**30)
COLUMN_STEP = (1, -1, 0, 0, 1, 1, -1, -1)
ROW_STEP = (0, 0, 1, -1, 1, -1, 1, -1)
MOVE_COST = (STRAIGHT, STRAIGHT, STRAIGHT, STRAIGHT, DIAGONAL, DIAGONAL, DIAGONAL, DIAGONAL)


@kernel
def octile(columns: int, a: int, b: int) -> int:
    """Find the cost between two cells on a grid without obstacles.

    Parameters
    ----------
    columns : int
        Cells in a row.
    a, b : int
        Cells.

    Returns
    -------
    int
        In units of a straight move / 70.
    """
    across = abs(a % columns - b % columns)
    along = abs(a // columns - b // columns)
    return STRAIGHT * max(across, along) + (DIAGONAL - STRAIGHT) * min(across, along)


@parallel_kernel
def mask_moves(is_walkable: Any, columns: int, rows: int, out_mask: Any) -> None:
    """Find the moves that each cell allows: to walkable cells, diagonally only past two walkable ones.

    Parameters
    ----------
    is_walkable : (rows * columns,) uint8
        1 where one can be.
    columns, rows : int
        Size of the grid.
    out_mask : (rows * columns,) uint8
        Bit d for the move (COLUMN_STEP[d], ROW_STEP[d]).

    Notes
    -----
    **Source:** rules of the Moving AI benchmarks (Sturtevant, 2012): eight moves, no cutting of corners.
    """
    for row in prange(rows):
        for column in range(columns):
            mask = 0
            cell = row * columns + column
            if is_walkable[cell]:
                for move in range(8):
                    i = column + COLUMN_STEP[move]
                    j = row + ROW_STEP[move]
                    if i < 0 or j < 0 or i >= columns or j >= rows:
                        continue
                    free = is_walkable[j * columns + i]
                    if move >= 4:
                        free = free and is_walkable[row * columns + i] and is_walkable[j * columns + column]
                    if free:
                        mask |= 1 << move
            out_mask[cell] = mask


@kernel
def search_cells(
    mask: Any,
    columns: int,
    start: int,
    goal: int,
    generation: int,
    cost: Any,
    arrival: Any,
    stamp: Any,
    head: Any,
    following: Any,
    entry: Any,
) -> tuple[int, int, int]:
    """Find a shortest way from one cell to another by A* with a bucket queue.

    Parameters
    ----------
    mask : (cells,) uint8
        Moves of each cell.
    columns : int
        Cells in a row.
    start, goal : int
        Cells.
    generation : int
        Even number, larger by 2 or more than in the last search with the same scratch.
    cost : (cells,) int32
        Scratch: cost from the start.
    arrival : (cells,) uint8
        Scratch and result: move by which each cell was reached.
    stamp : (cells,) int32
        Scratch: generation in which the cell was seen, plus 1 when it is done.
    head : (256,) int32
        Scratch: newest entry of each bucket.
    following, entry : (entries,) int32
        Scratch: links and cells of queue entries.

    Returns
    -------
    status, cost, expansions : int
        `FOUND`, `UNREACHABLE`, or `OVERFLOW` when there are too few entries.

    Notes
    -----
    **Source:** Hart, Nilsson, Raphael, 1968; buckets after Dial, 1969. With the consistent octile heuristic f
    grows by at most 198 along a move, so 256 circular buckets hold all open cells.
    **Differs from the source:** newest first among equal f, which prefers deep cells; lazy deletion.
    """
    for bucket in range(BUCKETS):
        head[bucket] = -1
    used = 1
    waiting = 1
    expansions = 0
    f = octile(columns, start, goal)
    cost[start] = 0
    stamp[start] = generation
    head[f & 255] = 0
    following[0] = -1
    entry[0] = start
    goal_column = goal % columns
    goal_row = goal // columns
    while waiting > 0:
        while head[f & 255] < 0:
            f += 1
        top = head[f & 255]
        head[f & 255] = following[top]
        waiting -= 1
        cell = entry[top]
        if stamp[cell] == generation + 1:
            continue
        stamp[cell] = generation + 1
        expansions += 1
        if cell == goal:
            return FOUND, int(cost[cell]), expansions
        moves = mask[cell]
        reached = cost[cell]
        column = cell % columns
        row = cell // columns
        for move in range(8):
            if not (moves >> move) & 1:
                continue
            other = cell + COLUMN_STEP[move] + ROW_STEP[move] * columns
            seen = stamp[other]
            if seen == generation + 1:
                continue
            new_cost = reached + MOVE_COST[move]
            if seen == generation and cost[other] <= new_cost:
                continue
            if used >= entry.shape[0]:
                return OVERFLOW, 0, expansions
            cost[other] = new_cost
            stamp[other] = generation
            arrival[other] = move
            across = abs(column + COLUMN_STEP[move] - goal_column)
            along = abs(row + ROW_STEP[move] - goal_row)
            estimate = new_cost + STRAIGHT * max(across, along) + (DIAGONAL - STRAIGHT) * min(across, along)
            bucket = estimate & 255
            entry[used] = other
            following[used] = head[bucket]
            head[bucket] = used
            used += 1
            waiting += 1
    return UNREACHABLE, 0, expansions


@kernel
def trace_back(arrival: Any, columns: int, start: int, goal: int, out_cells: Any) -> int:
    """Write the cells of a way that was found, goal first; returns their number, or 0 without room."""
    cell = goal
    count = 0
    while True:
        if count >= out_cells.shape[0]:
            return 0
        out_cells[count] = cell
        count += 1
        if cell == start:
            return count
        move = arrival[cell]
        cell -= COLUMN_STEP[move] + ROW_STEP[move] * columns


@parallel_kernel
def search_ways(
    mask: Any,
    columns: int,
    start: Any,
    goal: Any,
    generation: int,
    cost: Any,
    arrival: Any,
    stamp: Any,
    head: Any,
    following: Any,
    entry: Any,
    out_status: Any,
    out_length: Any,
    out_expansions: Any,
) -> None:
    """Find the lengths of many shortest ways, one set of scratch arrays for each chunk of queries.

    Parameters
    ----------
    mask : (cells,) uint8
        Moves of each cell.
    columns : int
        Cells in a row.
    start, goal : (Q,) int32
        Cells.
    generation : int
        Even, larger than any used with this scratch by 2 or more; query q uses ``generation + 2 q``.
    cost, arrival, stamp : (chunks, cells)
        Scratch of int32, uint8, int32.
    head : (chunks, 256) int32
        Scratch.
    following, entry : (chunks, entries) int32
        Scratch.
    out_status : (Q,) int32
        See `search_cells`.
    out_length : (Q,) float64
        Length with moves of 1 and the root of 2, in cells; NaN when there is no way.
    out_expansions : (Q,) int32
        Cells taken from the queue.

    Notes
    -----
    **Source:** see `search_cells`.
    """
    chunks = cost.shape[0]
    count = start.shape[0]
    for chunk in prange(chunks):
        for query in range(chunk * count // chunks, (chunk + 1) * count // chunks):
            status, _, expansions = search_cells(
                mask,
                columns,
                start[query],
                goal[query],
                generation + 2 * query,
                cost[chunk],
                arrival[chunk],
                stamp[chunk],
                head[chunk],
                following[chunk],
                entry[chunk],
            )
            out_status[query] = status
            out_expansions[query] = expansions
            out_length[query] = math.nan
            if status == FOUND:
                straight = 0
                diagonal = 0
                cell = goal[query]
                while cell != start[query]:
                    move = arrival[chunk, cell]
                    if move < 4:
                        straight += 1
                    else:
                        diagonal += 1
                    cell -= COLUMN_STEP[move] + ROW_STEP[move] * columns
                out_length[query] = straight + diagonal * math.sqrt(2.0)


@kernel
def fill_field(
    mask: Any, columns: int, goals: Any, head: Any, following: Any, entry: Any, out_cost: Any
) -> int:
    """Compute the cost from every cell to the nearest of some goal cells.

    Parameters
    ----------
    mask : (cells,) uint8
        Moves of each cell; moves must be possible both ways.
    columns : int
        Cells in a row.
    goals : (G,) int32
        Goal cells.
    head : (256,) int32
        Scratch.
    following, entry : (entries,) int32
        Scratch.
    out_cost : (cells,) int32
        70 for a straight move, 99 for a diagonal one; `UNSEEN` where no goal can be reached.

    Returns
    -------
    int
        `FOUND`, or `OVERFLOW` when there are too few entries.

    Notes
    -----
    **Source:** Dial, "Algorithm 360: shortest-path forest with topological ordering", 1969.
    """
    for bucket in range(BUCKETS):
        head[bucket] = -1
    out_cost[:] = UNSEEN
    used = 0
    for index in range(goals.shape[0]):
        out_cost[goals[index]] = 0
        entry[used] = goals[index]
        following[used] = head[0]
        head[0] = used
        used += 1
    waiting = used
    reached = 0
    while waiting > 0:
        while head[reached & 255] < 0:
            reached += 1
        top = head[reached & 255]
        head[reached & 255] = following[top]
        waiting -= 1
        cell = entry[top]
        if out_cost[cell] != reached:
            continue
        moves = mask[cell]
        for move in range(8):
            if not (moves >> move) & 1:
                continue
            other = cell + COLUMN_STEP[move] + ROW_STEP[move] * columns
            new_cost = reached + MOVE_COST[move]
            if new_cost < out_cost[other]:
                if used >= entry.shape[0]:
                    return OVERFLOW
                out_cost[other] = new_cost
                bucket = new_cost & 255
                entry[used] = other
                following[used] = head[bucket]
                head[bucket] = used
                used += 1
                waiting += 1
    return FOUND


@kernel
def descend(mask: Any, columns: int, field: Any, start: int, out_cells: Any) -> int:
    """Write the cells from a start down a distance field to its goal; returns their number.

    Parameters
    ----------
    mask : (cells,) uint8
        Moves of each cell.
    columns : int
        Cells in a row.
    field : (cells,) int32
        Costs of `fill_field`.
    start : int
        Cell.
    out_cells : (L,) int32
        Start first; the way is cut when there is no more room.

    Returns
    -------
    int
        Cells written; 0 when the start is cut off from the goal.
    """
    if field[start] >= UNSEEN:
        return 0
    cell = start
    count = 0
    while count < out_cells.shape[0]:
        out_cells[count] = cell
        count += 1
        if field[cell] == 0:
            break
        best = -1
        for move in range(8):
            if (mask[cell] >> move) & 1:
                other = cell + COLUMN_STEP[move] + ROW_STEP[move] * columns
                if field[other] + MOVE_COST[move] == field[cell]:
                    best = other
                    break
        if best < 0:
            break
        cell = best
    return count


@kernel
def label_components(mask: Any, columns: int, out_label: Any) -> None:
    """Number the connected parts of a grid; cells without moves keep their own number.

    Parameters
    ----------
    mask : (cells,) uint8
        Moves of each cell.
    columns : int
        Cells in a row.
    out_label : (cells,) int32
        Smallest cell of the part that each cell belongs to.

    Notes
    -----
    **Source:** union-find with path halving (Tarjan, van Leeuwen, 1984).
    """
    for cell in range(mask.shape[0]):
        out_label[cell] = cell
    for cell in range(mask.shape[0]):
        for move in range(8):
            if not (mask[cell] >> move) & 1:
                continue
            a = cell
            while out_label[a] != a:
                out_label[a] = out_label[out_label[a]]
                a = out_label[a]
            b = cell + COLUMN_STEP[move] + ROW_STEP[move] * columns
            while out_label[b] != b:
                out_label[b] = out_label[out_label[b]]
                b = out_label[b]
            if a < b:
                out_label[b] = a
            else:
                out_label[a] = b
    for cell in range(mask.shape[0]):
        a = cell
        while out_label[a] != a:
            a = out_label[a]
        out_label[cell] = a
