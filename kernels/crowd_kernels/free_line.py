"""Whether a body can go straight from one point to another, by exact distances from walls."""

import math
from typing import Any

from crowd_kernels._jit import kernel
from crowd_kernels.cells import is_point
from crowd_kernels.walls import WallTable, nearest_on_edge

SLACK = 0.02
"""Straight ways may have so much less room than the body, m: places in two cells lie on different lines."""
TOUCH = 1e-4
"""A line that comes this near to a wall crosses it, m."""


@kernel
def segment_gap(
    ax: float, az: float, bx: float, bz: float, cx: float, cz: float, dx: float, dz: float
) -> float:
    """Measure the squared distance between two segments.

    Parameters
    ----------
    ax, az, bx, bz : float
        Ends of one, m.
    cx, cz, dx, dz : float
        Ends of the other, m.

    Returns
    -------
    float
        m^2; 0 when they cross.

    Notes
    -----
    **Source:** segments that do not cross are nearest at an end of one of them.
    """
    ux, uz = bx - ax, bz - az
    vx, vz = dx - cx, dz - cz
    wx, wz = cx - ax, cz - az
    cross = ux * vz - uz * vx
    if cross != 0.0:
        s = (wx * vz - wz * vx) / cross
        t = (wx * uz - wz * ux) / cross
        if 0.0 <= s <= 1.0 and 0.0 <= t <= 1.0:
            return 0.0
    u2 = ux * ux + uz * uz
    v2 = vx * vx + vz * vz
    least = math.inf
    for end in range(4):
        # Offset of the end from the start of the other segment, and that segment.
        if end == 0:
            px, pz, qx, qz, q2 = wx, wz, ux, uz, u2
        elif end == 1:
            px, pz, qx, qz, q2 = dx - ax, dz - az, ux, uz, u2
        elif end == 2:
            px, pz, qx, qz, q2 = -wx, -wz, vx, vz, v2
        else:
            px, pz, qx, qz, q2 = bx - cx, bz - cz, vx, vz, v2
        along = 0.0
        if q2 > 0.0:
            along = min(max((px * qx + pz * qz) / q2, 0.0), 1.0)
        gap_x = px - along * qx
        gap_z = pz - along * qz
        least = min(least, gap_x * gap_x + gap_z * gap_z)
    return least


@kernel
def passes_edge(edge: Any, index: int, x: float, z: float, to_x: float, to_z: float, need: float) -> bool:
    """Tell whether a straight way keeps its distance from one wall edge.

    Parameters
    ----------
    edge : (W, EDGE_COLUMNS) float64
    index : int
        Edge.
    x, z, to_x, to_z : float
        Ends of the way, m.
    need : float
        Distance to keep, m; less where an end is nearer already.

    Returns
    -------
    bool
    """
    cx, cz, dx, dz = edge[index, 0], edge[index, 1], edge[index, 2], edge[index, 3]
    if min(cx, dx) - max(x, to_x) >= need or min(x, to_x) - max(cx, dx) >= need:
        return True
    if min(cz, dz) - max(z, to_z) >= need or min(z, to_z) - max(cz, dz) >= need:
        return True
    gap = segment_gap(x, z, to_x, to_z, cx, cz, dx, dz)
    if gap >= need * need:
        return True
    if gap < TOUCH * TOUCH:
        return False
    px, pz, _ = nearest_on_edge(edge, index, x, z)
    qx, qz, _ = nearest_on_edge(edge, index, to_x, to_z)
    from_start = (px - x) * (px - x) + (pz - z) * (pz - z)
    from_end = (qx - to_x) * (qx - to_x) + (qz - to_z) * (qz - to_z)
    return bool(gap >= min(from_start, from_end) - TOUCH * TOUCH)


@kernel
def is_free_line(walls: WallTable, radius: float, x: float, z: float, to_x: float, to_z: float) -> bool:
    """Tell whether a body can go straight from one point to another.

    Parameters
    ----------
    walls : WallTable
        Lists reach at least to the radius. Outside their cells nothing is in the way.
    radius : float
        m.
    x, z, to_x, to_z : float
        Ends of the line, m. Where an end lies nearer to a wall than the radius, the line may be as near.

    Returns
    -------
    bool

    Notes
    -----
    **Source:** cells along a line after Amanatides, Woo, "A fast voxel traversal algorithm for ray tracing",
    1987; the distance from the walls listed there is exact.
    """
    if not (is_point(x, z) and is_point(to_x, to_z)):
        return False
    need = radius - SLACK
    size = walls.cell_size
    column = math.floor((x - walls.origin_x) / size)
    row = math.floor((z - walls.origin_z) / size)
    last_column = math.floor((to_x - walls.origin_x) / size)
    last_row = math.floor((to_z - walls.origin_z) / size)
    across = to_x - x
    along = to_z - z
    column_step = 1 if across > 0.0 else -1
    row_step = 1 if along > 0.0 else -1
    next_x = math.inf
    next_z = math.inf
    delta_x = math.inf
    delta_z = math.inf
    if last_column != column:
        delta_x = abs(size / across)
        next_x = (walls.origin_x + (column + (1 if across > 0.0 else 0)) * size - x) / across
    if last_row != row:
        delta_z = abs(size / along)
        next_z = (walls.origin_z + (row + (1 if along > 0.0 else 0)) * size - z) / along
    for _ in range(abs(last_column - column) + abs(last_row - row) + 1):
        if 0 <= column < walls.columns and 0 <= row < walls.rows:
            cell = row * walls.columns + column
            for entry in range(walls.cell_start[cell], walls.cell_start[cell + 1]):
                if not passes_edge(walls.edge, walls.cell_edge[entry], x, z, to_x, to_z, need):
                    return False
        if next_x < next_z:
            column += column_step
            next_x += delta_x
        else:
            row += row_step
            next_z += delta_z
    return True
