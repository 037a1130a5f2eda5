"""Distances on a grid from everywhere to a goal that many share, and the connected parts of a grid.

Cells, moves and masks are those of `crowd_kernels.grid_search`.
"""

from typing import Any

import numpy as np

from crowd_kernels._jit import kernel
from crowd_kernels.grid_search import (
    ANY_MOVE,
    BUCKETS,
    COLUMN_STEP,
    FOUND,
    MOVE_COST,
    MOVE_COUNT,
    MOVE_LIST,
    OVERFLOW,
    ROW_STEP,
    UNSEEN,
    USEFUL_MOVES,
)

FRESH_WORD = np.int32(2**31 - 1)


@kernel
def fill_field(mask: Any, columns: int, goals: Any, head: Any, queue: Any, out_cost: Any) -> int:
    """Compute the cost from every cell to the nearest of some goal cells.

    Parameters
    ----------
    mask : (cells,) uint8
        Moves of each cell.
    columns : int
        Cells in a row.
    goals : (G,) int32
        Goal cells.
    head : (256,) int32
        Scratch.
    queue : (entries,) int64
        Scratch.
    out_cost : (cells,) int32
        70 for a straight move, 99 for a diagonal one; `UNSEEN` where no goal can be reached. Below 2^27.

    Returns
    -------
    int
        `FOUND`, or `OVERFLOW` when there are too few entries.

    Notes
    -----
    **Source:** Dial, "Algorithm 360: shortest-path forest with topological ordering", 1969.
    **Differs from the source:** moves that cannot be needed are left out, see `search_cells`.
    """
    for bucket in range(BUCKETS):
        head[bucket] = -1
    # Until the end the low bits hold the arrival at each cell.
    out_cost[:] = FRESH_WORD
    waiting = 0
    if goals.shape[0] > queue.shape[0]:
        return OVERFLOW
    for index in range(goals.shape[0]):
        out_cost[goals[index]] = ANY_MOVE
        queue[waiting] = (np.int64(goals[index]) << 32) | np.int64(np.uint32(head[0]))
        head[0] = waiting
        waiting += 1
    used = waiting
    reached = 0
    while waiting > 0:
        top = head[reached & 255]
        while top < 0:
            reached += 1
            top = head[reached & 255]
        head[reached & 255] = np.int32(queue[top] & 0xFFFFFFFF)
        cell = queue[top] >> 32
        waiting -= 1
        word = out_cost[cell]
        if word >> 4 != reached:
            continue
        moves = USEFUL_MOVES[word & 15, mask[cell]]
        for index in range(MOVE_COUNT[moves]):
            move = MOVE_LIST[moves, index]
            other = cell + COLUMN_STEP[move] + ROW_STEP[move] * columns
            cost = reached + MOVE_COST[move]
            # An equal cost keeps the arrival that was first.
            if cost >= out_cost[other] >> 4:
                continue
            if used >= queue.shape[0]:
                return OVERFLOW
            out_cost[other] = (cost << 4) | move
            bucket = cost & 255
            queue[used] = (other << 32) | np.int64(np.uint32(head[bucket]))
            head[bucket] = used
            used += 1
            waiting += 1
    for cell in range(out_cost.shape[0]):
        word = out_cost[cell]
        out_cost[cell] = UNSEEN if word == FRESH_WORD else word >> 4
    return FOUND


@kernel
def descend(mask: Any, columns: int, field: Any, start: int, out_cells: Any) -> int:
    """Write the cells from a start down a distance field to its goal.

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
        # A diagonal move has straight ones beside it, and moves go both ways: two of eight are enough.
        for move in range(0, 4, 2):
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
        # Labels only point to smaller cells, which are final already.
        out_label[cell] = out_label[out_label[cell]]
