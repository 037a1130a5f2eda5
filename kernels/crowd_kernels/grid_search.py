"""Shortest ways on a grid for goals of one's own: A*.

Cells are numbered ``row * columns + column``. A mask holds one bit for each of the eight moves that a cell
allows, with borders and the corner rule baked in, so that searches test neither. Moves go both ways, and a
diagonal move needs the four straight moves around its block of four cells; `crowd_kernels.walkable` makes
such masks, also for walls thinner than a cell.

Moves that cannot be needed are left out: those to cells that the cell before reaches as cheaply without the
one between. No shortest way is lost by that: a move that is left out although it ends a shortest way has a
partner, diagonal first and straight second, whose straight move is never left out.
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
"""Cost of cells that cannot be reached."""
COLUMN_STEP = (1, -1, 0, 0, 1, 1, -1, -1)
ROW_STEP = (0, 0, 1, -1, 1, -1, 1, -1)
MOVE_COST = (STRAIGHT, STRAIGHT, STRAIGHT, STRAIGHT, DIAGONAL, DIAGONAL, DIAGONAL, DIAGONAL)
ANY_MOVE = 8
"""Arrival at cells where ways begin."""
LAST_GENERATION = 2**30
FRESH_RECORD = np.int64(2**62)
"""What records hold before the first search."""


def useful_moves(arrival: int, moves: int) -> int:
    """Find the moves that may continue a shortest way.

    Parameters
    ----------
    arrival : int
        Move by which the way came to the cell; `ANY_MOVE` where it begins.
    moves : int
        Bits of the moves that the cell allows.

    Returns
    -------
    int
        Bits of the moves to try.
    """
    if arrival == ANY_MOVE:
        return moves
    steps = list(zip(COLUMN_STEP, ROW_STEP, strict=True))
    along = steps[arrival]
    useful = 0
    for move, (column, row) in enumerate(steps):
        if not moves >> move & 1:
            continue
        if arrival >= 4:
            is_useful = (column, row) in ((along[0], 0), (0, along[1]), along)
        elif (column, row) == along:
            is_useful = True
        elif column * along[0] + row * along[1] < 0:
            is_useful = False
        else:
            # To the side, or ahead and to the side: the cell before could do that with its own diagonal move,
            # which exists when this cell could go back to the side.
            side = (column, 0) if along[0] == 0 else (0, row)
            back = steps.index((side[0] - along[0], side[1] - along[1]))
            is_useful = not moves >> back & 1
        if is_useful:
            useful |= 1 << move
    return useful


USEFUL_MOVES = np.array([[useful_moves(a, m) for m in range(256)] for a in range(9)], np.uint8)
MOVE_COUNT = np.array([bin(m).count("1") for m in range(256)], np.int8)
MOVE_LIST = np.array(
    [[b for b in range(8) if m >> b & 1] + [0] * (8 - bin(m).count("1")) for m in range(256)], np.int8
)


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


@kernel
def best_landmark(landmark_cost: Any, start: int, goal: int) -> int:
    """Find the landmark whose distance field promises the longest way between two cells.

    Parameters
    ----------
    landmark_cost : (L, cells) int32
        Costs of `crowd_kernels.distance_field.fill_field`, one row for each landmark.
    start, goal : int
        Cells.

    Returns
    -------
    int
        Row; -1 without landmarks.
    """
    best = -1
    most = -1
    for landmark in range(landmark_cost.shape[0]):
        difference = abs(landmark_cost[landmark, start] - landmark_cost[landmark, goal])
        if difference > most:
            best = landmark
            most = difference
    return best


@kernel
def search_cells(
    mask: Any,
    columns: int,
    start: int,
    goal: int,
    generation: int,
    landmark_cost: Any,
    record: Any,
    head: Any,
    queue: Any,
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
        From 1 to `LAST_GENERATION`, larger than in all earlier searches with the same record.
    landmark_cost : (L, cells) int32
        Distance fields of some cells, which shorten the search; L may be 0.
    record : (cells,) int64
        Scratch and result for `trace_back`: generation, cost and arrival of each cell; at first
        `FRESH_RECORD`.
    head : (256,) int32
        Scratch: newest entry of each bucket.
    queue : (entries,) int64
        Scratch: cell and next entry of the same bucket.

    Returns
    -------
    status, cost, expansions : int
        `FOUND`, `UNREACHABLE`, or `OVERFLOW` when there are too few entries; cost in units of a straight
        move / 70; cells taken from the queue.

    Notes
    -----
    **Source:** Hart, Nilsson, Raphael, 1968; buckets after Dial, 1969; landmarks after Goldberg, Harrelson,
    "Computing the shortest path: A* search meets graph theory", 2005; pruned moves after Harabor, Grastien,
    "Online graph pruning for pathfinding on grid maps", 2011, and Sturtevant, Rabin, "Canonical orderings on
    grids", 2016. With a consistent estimate f grows by at most 198 along a move, so 256 circular buckets hold
    all open cells.
    **Differs from the source:** no jumps, and pruning reads the move masks, so that thin walls may lie
    between cells; of equal f the newest first, which prefers deep cells and needs no queue; lazy deletion;
    one record holds generation, cost and arrival such that the smaller record is the better.
    """
    for bucket in range(BUCKETS):
        head[bucket] = -1
    prefix = np.int64(LAST_GENERATION - generation) << 32
    goal_column = goal % columns
    goal_row = goal // columns
    landmark = best_landmark(landmark_cost, start, goal)
    goal_mark = np.int64(0)
    f = np.int64(octile(columns, start, goal))
    if landmark >= 0:
        goal_mark = np.int64(landmark_cost[landmark, goal])
        f = max(f, abs(landmark_cost[landmark, start] - goal_mark))
    # Costs are stored plus 1: 0 is left for cells that are done, which no cost can improve.
    record[start] = prefix | (1 << 4) | ANY_MOVE
    used = 0
    waiting = 0
    expansions = 0
    held = np.int64(start)
    while True:
        if held >= 0:
            cell = held
            held = np.int64(-1)
        elif waiting == 0:
            return UNREACHABLE, 0, expansions
        else:
            top = head[f & 255]
            while top < 0:
                f += 1
                top = head[f & 255]
            head[f & 255] = np.int32(queue[top] & 0xFFFFFFFF)
            cell = queue[top] >> 32
            waiting -= 1
        word = record[cell] & 0xFFFFFFFF
        reached = word >> 4
        if reached == 0:
            continue
        expansions += 1
        record[cell] = prefix | (word & 15)
        if cell == goal:
            return FOUND, reached - 1, expansions
        row = cell // columns
        across = cell - row * columns - goal_column
        along = row - goal_row
        moves = USEFUL_MOVES[word & 15, mask[cell]]
        for index in range(MOVE_COUNT[moves]):
            move = MOVE_LIST[moves, index]
            other = cell + COLUMN_STEP[move] + ROW_STEP[move] * columns
            cost = reached + MOVE_COST[move]
            new_record = prefix | (cost << 4) | move
            if new_record >= record[other]:
                continue
            record[other] = new_record
            x = abs(across + COLUMN_STEP[move])
            z = abs(along + ROW_STEP[move])
            estimate = STRAIGHT * max(x, z) + (DIAGONAL - STRAIGHT) * min(x, z)
            if landmark >= 0:
                estimate = max(estimate, abs(landmark_cost[landmark, other] - goal_mark))
            new_f = cost - 1 + estimate
            if new_f == f:
                other, held = held, other
                if other < 0:
                    continue
            if used >= queue.shape[0]:
                return OVERFLOW, 0, expansions
            bucket = new_f & 255
            queue[used] = (other << 32) | np.int64(np.uint32(head[bucket]))
            head[bucket] = used
            used += 1
            waiting += 1


@kernel
def trace_back(record: Any, columns: int, goal: int, out_cells: Any) -> int:
    """Write the cells of a way that was found, goal first.

    Parameters
    ----------
    record : (cells,) int64
        Left by `search_cells`.
    columns : int
        Cells in a row.
    goal : int
        Cell.
    out_cells : (L,) int32
        Cells of the way.

    Returns
    -------
    int
        Number of cells; 0 when there is too little room.
    """
    cell = goal
    count = 0
    while count < out_cells.shape[0]:
        out_cells[count] = cell
        count += 1
        move = record[cell] & 15
        if move == ANY_MOVE:
            return count
        cell -= COLUMN_STEP[move] + ROW_STEP[move] * columns
    return 0


@parallel_kernel
def search_ways(
    mask: Any,
    columns: int,
    start: Any,
    goal: Any,
    generation: int,
    landmark_cost: Any,
    record: Any,
    head: Any,
    queue: Any,
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
        Query q uses ``generation + q``, see `search_cells`.
    landmark_cost : (L, cells) int32
        See `search_cells`.
    record : (chunks, cells) int64
        Scratch, see `search_cells`.
    head : (chunks, 256) int32
        Scratch.
    queue : (chunks, entries) int64
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
    chunks = record.shape[0]
    count = start.shape[0]
    for k in prange(chunks):
        chunk = (k * 37) % chunks
        for query in range(chunk * count // chunks, (chunk + 1) * count // chunks):
            status, _, expansions = search_cells(
                mask,
                columns,
                start[query],
                goal[query],
                generation + query,
                landmark_cost,
                record[chunk],
                head[chunk],
                queue[chunk],
            )
            out_status[query] = status
            out_expansions[query] = expansions
            out_length[query] = math.nan
            if status == FOUND:
                straight = 0
                diagonal = 0
                cell = goal[query]
                move = record[chunk, cell] & 15
                while move != ANY_MOVE:
                    if move < 4:
                        straight += 1
                    else:
                        diagonal += 1
                    cell -= COLUMN_STEP[move] + ROW_STEP[move] * columns
                    move = record[chunk, cell] & 15
                out_length[query] = straight + diagonal * math.sqrt(2.0)
