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


def mask_distances(mask, columns, goal):
    """Exact costs (70 and 99) from every cell to a goal by the moves of a mask; infinite without a way."""
    result = np.full(len(mask), np.inf)
    result[goal] = 0
    queue = [(0, goal)]
    while queue:
        cost, cell = heapq.heappop(queue)
        if cost > result[cell]:
            continue
        for move, (across, along) in enumerate(STEPS):
            if mask[cell] >> move & 1:
                other, new = cell + across + along * columns, cost + (70 if move < 4 else 99)
                if new < result[other]:
                    result[other] = new
                    heapq.heappush(queue, (new, other))
    return result


def mask_of_links(link, columns, rows):
    """Moves from links (1 next column, 2 next row, 4 both diagonals of the block)."""
    link = np.asarray(link).reshape(rows, columns)
    mask = np.zeros((rows, columns), np.uint8)
    for row in range(rows):
        for column in range(columns):
            for move, (across, along) in enumerate(STEPS):
                if not (0 <= column + across < columns and 0 <= row + along < rows):
                    continue
                i, j = column + min(across, 0), row + min(along, 0)
                if along == 0:
                    is_free = link[j, i] & 1
                elif across == 0:
                    is_free = link[j, i] & 2
                else:
                    sides = (link[j, i] & 1, link[j, i] & 2, link[j + 1, i] & 1, link[j, i + 1] & 2)
                    is_free = all(sides) and link[j, i] & 4
                if is_free:
                    mask[row, column] |= 1 << move
    return mask.ravel()
