"""Slow twins of `crowd_kernels.grid_search`: Dijkstra's algorithm with a heap and exact costs."""

import heapq
import math

import numpy as np

STEPS = [(1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (1, -1), (-1, 1), (-1, -1)]


def moves(is_walkable, column, row):
    """Cells one can go to from a cell, with costs; diagonally only past two walkable cells."""
    rows, columns = is_walkable.shape

    def free(c, r):
        return 0 <= c < columns and 0 <= r < rows and bool(is_walkable[r, c])

    if not free(column, row):
        return
    for number, (dc, dr) in enumerate(STEPS):
        c, r = column + dc, row + dr
        if free(c, r) and (number < 4 or (free(c, row) and free(column, r))):
            yield number, (c, r), 1.0 if number < 4 else math.sqrt(2.0)


def distances(is_walkable, goal):
    """Exact length of the shortest way from every cell to a goal (column, row); infinite without one."""
    result = np.full(is_walkable.shape, np.inf)
    if not is_walkable[goal[1], goal[0]]:
        return result
    result[goal[1], goal[0]] = 0.0
    queue = [(0.0, goal)]
    while queue:
        length, cell = heapq.heappop(queue)
        if length > result[cell[1], cell[0]]:
            continue
        for _, (c, r), cost in moves(is_walkable, *cell):
            if length + cost < result[r, c] - 1e-12:
                result[r, c] = length + cost
                heapq.heappush(queue, (length + cost, (c, r)))
    return result
