"""From a way of cells to the few corners between which one goes straight."""

import math
from typing import Any

from crowd_kernels._jit import kernel
from crowd_kernels.free_line import is_free_line
from crowd_kernels.random import uniform
from crowd_kernels.walkable import GroundGrid
from crowd_kernels.walls import WallTable

STRIDE = 16
NARROWINGS = 4
"""A character's lane is tried at its full width and at halves, quarters, ... of it."""
STRAIGHT_ON = 0.02
PURPOSE_LANE = 401


@kernel
def pull_string(
    grid: GroundGrid,
    walls: WallTable,
    cells: Any,
    count: int,
    is_backward: bool,
    start_x: float,
    start_z: float,
    goal_x: float,
    goal_z: float,
    out_corner: Any,
) -> int:
    """Shorten a way of cells to the corners between which a body can go straight.

    Parameters
    ----------
    grid : GroundGrid
    walls : WallTable
    cells : (L,) int32
        Cells of the way.
    count : int
        Number of cells.
    is_backward : bool
        The goal's cell comes first.
    start_x, start_z, goal_x, goal_z : float
        Ends of the way, m.
    out_corner : (C, 2) float64
        Corners, the goal last, m.

    Returns
    -------
    int
        Corners written, 1 to C. A way with more corners than there is room for ends at its last one.

    Notes
    -----
    **Source:** greedy line-of-sight smoothing of grid paths (string pulling), with strides that double and
    halve.
    """
    room = out_corner.shape[0]
    corner_count = 0
    x = start_x
    z = start_z
    index = -1
    while index < count - 1 and corner_count < room:
        if is_free_line(walls, grid.radius, x, z, goal_x, goal_z):
            break
        seen = index + 1
        stride = STRIDE
        while stride >= 1:
            ahead = seen + stride
            if ahead < count:
                cell = cells[count - 1 - ahead] if is_backward else cells[ahead]
                if is_free_line(walls, grid.radius, x, z, grid.point[cell, 0], grid.point[cell, 1]):
                    seen = ahead
                    stride *= 2
                    continue
            stride //= 2
        cell = cells[count - 1 - seen] if is_backward else cells[seen]
        x = grid.point[cell, 0]
        z = grid.point[cell, 1]
        out_corner[corner_count, 0] = x
        out_corner[corner_count, 1] = z
        corner_count += 1
        index = seen
    if corner_count < room:
        out_corner[corner_count, 0] = goal_x
        out_corner[corner_count, 1] = goal_z
        corner_count += 1
    return corner_count


@kernel
def tighten_string(
    grid: GroundGrid, walls: WallTable, start_x: float, start_z: float, corner: Any, count: int
) -> int:
    """Leave out corners whose neighbours see each other.

    Parameters
    ----------
    grid : GroundGrid
    walls : WallTable
    start_x, start_z : float
        Start of the way, m.
    corner : (C, 2) float64
        In and out: corners, m.
    count : int
        Number of corners.

    Returns
    -------
    int
        Number of corners left.
    """
    kept = 0
    x = start_x
    z = start_z
    for index in range(count):
        if index < count - 1 and is_free_line(
            walls, grid.radius, x, z, corner[index + 1, 0], corner[index + 1, 1]
        ):
            continue
        x = corner[index, 0]
        z = corner[index, 1]
        corner[kept, 0] = x
        corner[kept, 1] = z
        kept += 1
    return kept


@kernel
def widen_corners(
    grid: GroundGrid, walls: WallTable, lane: float, start_x: float, start_z: float, corner: Any, count: int
) -> None:
    """Move corners away from the walls that the way turns about, so that many do not aim at one point.

    Parameters
    ----------
    grid : GroundGrid
    walls : WallTable
    lane : float
        Wanted distance from the corner, m; less where the gap is narrower.
    start_x, start_z : float
        Start of the way, m.
    corner : (C, 2) float64
        In and out: corners, m; the last one stays.
    count : int
        Number of corners.
    """
    before_x = start_x
    before_z = start_z
    for index in range(count - 1):
        x = corner[index, 0]
        z = corner[index, 1]
        after_x = corner[index + 1, 0]
        after_z = corner[index + 1, 1]
        in_x, in_z = x - before_x, z - before_z
        out_x, out_z = after_x - x, after_z - z
        in_length = math.sqrt(in_x * in_x + in_z * in_z)
        out_length = math.sqrt(out_x * out_x + out_z * out_z)
        if in_length > 0.0 and out_length > 0.0:
            away_x = in_x / in_length - out_x / out_length
            away_z = in_z / in_length - out_z / out_length
            away = math.sqrt(away_x * away_x + away_z * away_z)
            if away > STRAIGHT_ON:
                shift = lane / away
                for _ in range(NARROWINGS):
                    to_x = x + shift * away_x
                    to_z = z + shift * away_z
                    if (
                        grid.low_x <= to_x <= grid.high_x
                        and grid.low_z <= to_z <= grid.high_z
                        and is_free_line(walls, grid.radius, x, z, to_x, to_z)
                        and is_free_line(walls, grid.radius, before_x, before_z, to_x, to_z)
                        and is_free_line(walls, grid.radius, to_x, to_z, after_x, after_z)
                    ):
                        corner[index, 0] = to_x
                        corner[index, 1] = to_z
                        break
                    shift *= 0.5
        before_x = corner[index, 0]
        before_z = corner[index, 1]


@kernel
def write_way(
    grid: GroundGrid,
    walls: WallTable,
    character: int,
    cells: Any,
    count: int,
    is_backward: bool,
    widest_lane: float,
    position_world: Any,
    goal_world: Any,
    out_corner: Any,
    out_rest: Any,
    out_corner_count: Any,
) -> None:
    """Write the corners of one character's way from its cells.

    Parameters
    ----------
    grid : GroundGrid
    walls : WallTable
    character : int
        Row.
    cells, count, is_backward
        See `pull_string`.
    widest_lane : float
        Largest distance from corners, m; each character has its own share of it.
    position_world, goal_world : (N, 3) float64
        Ends of the way, m.
    out_corner, out_rest, out_corner_count
        See `route_by_search`.
    """
    x = position_world[character, 0]
    z = position_world[character, 2]
    corner = out_corner[character]
    found = pull_string(
        grid,
        walls,
        cells,
        count,
        is_backward,
        x,
        z,
        goal_world[character, 0],
        goal_world[character, 2],
        corner,
    )
    found = tighten_string(grid, walls, x, z, corner, found)
    lane = widest_lane * uniform(0, character, 0, PURPOSE_LANE)
    widen_corners(grid, walls, lane, x, z, corner, found)
    out_corner_count[character] = found
    end_x = corner[found - 1, 0] - goal_world[character, 0]
    end_z = corner[found - 1, 1] - goal_world[character, 2]
    # Not 0 only where a way had too many corners and is cut.
    out_rest[character, found - 1] = math.sqrt(end_x * end_x + end_z * end_z)
    for index in range(found - 2, -1, -1):
        way_x = corner[index + 1, 0] - corner[index, 0]
        way_z = corner[index + 1, 1] - corner[index, 1]
        out_rest[character, index] = out_rest[character, index + 1] + math.sqrt(way_x * way_x + way_z * way_z)
