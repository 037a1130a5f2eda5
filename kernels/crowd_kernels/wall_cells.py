"""Lists of the wall edges near each cell of a grid, and questions to them from outside."""

import math
from typing import Any

import numpy as np

from crowd_kernels._jit import kernel
from crowd_kernels.cells import is_point
from crowd_kernels.wall_contact import wall_distance
from crowd_kernels.walls import WallTable, nearest_on_edge


@kernel
def list_edges(
    edge: Any,
    origin_x: float,
    origin_z: float,
    cell_size: float,
    columns: int,
    rows: int,
    reach: float,
    out_cell_start: Any,
    out_cell_edge: Any,
) -> int:
    """List for each cell the edges within reach of any of its points.

    Parameters
    ----------
    edge : (W, EDGE_COLUMNS) float64
        Edges of `WallTable`.
    origin_x, origin_z : float
        Low corner of the grid, m.
    cell_size : float
        m.
    columns, rows : int
        Cells along x and z.
    reach : float
        m.
    out_cell_start : (columns * rows + 1,) int32
        Written: where the list of each cell begins.
    out_cell_edge : (L,) int32
        Written up to its length: the lists, each ascending.

    Returns
    -------
    int
        Length of all lists together; call again with more room if it exceeds L.

    Notes
    -----
    An edge is near a cell when it is within `reach` of the circle around the cell.
    """
    near = reach + cell_size * math.sqrt(0.5)
    out_cell_start[:] = 0
    for is_filling in range(2):
        for index in range(edge.shape[0]):
            low_x, high_x = min(edge[index, 0], edge[index, 2]), max(edge[index, 0], edge[index, 2])
            low_z, high_z = min(edge[index, 1], edge[index, 3]), max(edge[index, 1], edge[index, 3])
            first_column = max(math.floor((low_x - near - origin_x) / cell_size), 0)
            last_column = min(math.floor((high_x + near - origin_x) / cell_size), columns - 1)
            first_row = max(math.floor((low_z - near - origin_z) / cell_size), 0)
            last_row = min(math.floor((high_z + near - origin_z) / cell_size), rows - 1)
            for row in range(first_row, last_row + 1):
                z = origin_z + (row + 0.5) * cell_size
                for column in range(first_column, last_column + 1):
                    x = origin_x + (column + 0.5) * cell_size
                    px, pz, _ = nearest_on_edge(edge, index, x, z)
                    if (px - x) * (px - x) + (pz - z) * (pz - z) > near * near:
                        continue
                    cell = row * columns + column
                    if is_filling == 0:
                        out_cell_start[cell + 1] += 1
                    else:
                        out_cell_edge[out_cell_start[cell]] = index
                        out_cell_start[cell] += 1
        if is_filling == 0:
            for cell in range(columns * rows):
                out_cell_start[cell + 1] += out_cell_start[cell]
            if out_cell_start[columns * rows] > out_cell_edge.shape[0]:
                return int(out_cell_start[columns * rows])
    # Filling has moved every start to the end of its list.
    for cell in range(columns * rows, 0, -1):
        out_cell_start[cell] = out_cell_start[cell - 1]
    out_cell_start[0] = 0
    return int(out_cell_start[columns * rows])


@kernel
def measure_wall_distance(position_world: Any, active: Any, walls: WallTable, out_distance: Any) -> None:
    """Measure how far characters are from the nearest wall.

    Parameters
    ----------
    position_world : (N, 3) float64
        m.
    active : (A,) int32
    walls : WallTable
    out_distance : (N,) float64
        Written in rows of `active`, m; infinite when no wall is listed near.
    """
    for index in range(active.shape[0]):
        own = active[index]
        x, z = position_world[own, 0], position_world[own, 2]
        out_distance[own] = wall_distance(walls, x, z) if is_point(x, z) else np.inf
