"""Bodies that never pass a wall: motion is followed from where it began and slides along what it meets."""

import math
from typing import Any

from crowd_kernels._jit import kernel
from crowd_kernels.cells import is_point
from crowd_kernels.walls import (
    ALONG_X,
    ALONG_Z,
    BACK_OF_THIN,
    END_X,
    END_Z,
    FEATURE_INTERIOR,
    KIND,
    LENGTH,
    SOLID,
    START_X,
    START_Z,
    WallTable,
    cell_list,
    nearest_on_edge,
    side_of_edge,
)

SLACK = 5e-4
"""A body may be this much nearer to a wall than its radius, m."""
MOST_SLIDES = 4
MOST_PIECES = 256
SHORTEST_PIECE = 0.05
MOST_PUSHES = 4
LEAVING_SPEED = 2.0
"""Speed at which a character leaves the inside of a solid, m/s."""
TOUCH_GAP = 1e-3
ON_EDGE = 1e-6
"""A point this near to the edge of a solid counts as inside, m."""
THIN_MARGIN = 1e-7


@kernel
def wall_distance(walls: WallTable, x: float, z: float) -> float:
    """Measure the distance from a point to the nearest wall.

    Parameters
    ----------
    walls : WallTable
    x, z : float
        Point, m.

    Returns
    -------
    float
        m; infinite when no wall is listed near the point.
    """
    begin, end = cell_list(walls, x, z)
    squared = math.inf
    for entry in range(begin, end):
        px, pz, _ = nearest_on_edge(walls.edge, walls.cell_edge[entry], x, z)
        squared = min(squared, (px - x) * (px - x) + (pz - z) * (pz - z))
    return math.sqrt(squared)


@kernel
def time_to_corner(
    x: float, z: float, dx: float, dz: float, corner_x: float, corner_z: float, near: float
) -> float:
    """Find when a moving point comes within a distance of a corner.

    Parameters
    ----------
    x, z : float
        Start, m, not within `near` of the corner.
    dx, dz : float
        Motion, m.
    corner_x, corner_z : float
        m.
    near : float
        m.

    Returns
    -------
    float
        Share of the motion; infinite when it never does.
    """
    from_x, from_z = x - corner_x, z - corner_z
    along = from_x * dx + from_z * dz
    if along >= 0.0:
        return math.inf
    squared = dx * dx + dz * dz
    root = along * along - squared * (from_x * from_x + from_z * from_z - near * near)
    return (-along - math.sqrt(root)) / squared if root >= 0.0 else math.inf


@kernel
def time_to_edge(edge: Any, index: int, x: float, z: float, dx: float, dz: float, near: float) -> Any:
    """Find when a moving point is stopped by an edge that it must keep a distance from.

    Parameters
    ----------
    edge : (W, EDGE_COLUMNS) float64
    index : int
        Edge; it stops from both sides.
    x, z : float
        Start, m. If it is nearer than `near` already, it is stopped at once if it comes nearer still.
    dx, dz : float
        Motion, m.
    near : float
        Distance to keep, m.

    Returns
    -------
    tuple of float
        Share of the motion, infinite if not stopped; unit direction x, z away from the edge there.
    """
    px, pz, _ = nearest_on_edge(edge, index, x, z)
    away_x, away_z = x - px, z - pz
    distance = math.sqrt(away_x * away_x + away_z * away_z)
    along_x, along_z = edge[index, ALONG_X], edge[index, ALONG_Z]
    if distance <= near:
        if distance > 1e-9:
            away_x, away_z = away_x / distance, away_z / distance
        else:
            away_x, away_z = along_z, -along_x
        return (0.0 if away_x * dx + away_z * dz < 0.0 else math.inf), away_x, away_z
    if distance - near > math.sqrt(dx * dx + dz * dz):
        return math.inf, 0.0, 0.0
    side = side_of_edge(edge, index, x, z)
    facing = 1.0 if side >= 0.0 else -1.0
    closing = -facing * (along_z * dx - along_x * dz)
    first = math.inf
    if closing > 0.0:
        share = max((facing * side - near) / closing, 0.0)
        hit_x, hit_z = x + share * dx - edge[index, START_X], z + share * dz - edge[index, START_Z]
        place = hit_x * along_x + hit_z * along_z
        if 0.0 <= place <= edge[index, LENGTH]:
            first = share
    first = min(first, time_to_corner(x, z, dx, dz, edge[index, START_X], edge[index, START_Z], near))
    first = min(first, time_to_corner(x, z, dx, dz, edge[index, END_X], edge[index, END_Z], near))
    if first > 1.0:
        return math.inf, 0.0, 0.0
    px, pz, _ = nearest_on_edge(edge, index, x + first * dx, z + first * dz)
    away_x, away_z = x + first * dx - px, z + first * dz - pz
    distance = max(math.sqrt(away_x * away_x + away_z * away_z), 1e-12)
    return first, away_x / distance, away_z / distance


@kernel
def slide(walls: WallTable, x: float, z: float, dx: float, dz: float, near: float, most_slides: int) -> Any:
    """Move a point; where it meets a wall it slides along.

    Parameters
    ----------
    walls : WallTable
    x, z : float
        Start, m.
    dx, dz : float
        Motion, m; so short that the list of the start's cell holds every wall it can meet.
    near : float
        Distance to keep from walls, m.
    most_slides : int
        The motion ends where it meets a wall for this many times.

    Returns
    -------
    tuple of float
        x and z of the end, m.
    """
    begin, end = cell_list(walls, x, z)
    for _ in range(most_slides):
        first, away_x, away_z = math.inf, 0.0, 0.0
        for entry in range(begin, end):
            index = walls.cell_edge[entry]
            if walls.edge[index, KIND] == BACK_OF_THIN:
                continue
            share, ax, az = time_to_edge(walls.edge, index, x, z, dx, dz, near)
            if share < first:
                first, away_x, away_z = share, ax, az
        if first > 1.0:
            return x + dx, z + dz
        x, z = x + first * dx, z + first * dz
        dx, dz = (1.0 - first) * dx, (1.0 - first) * dz
        into = min(away_x * dx + away_z * dz, 0.0)
        dx, dz = dx - into * away_x, dz - into * away_z
    return x, z


@kernel
def way_out_of_solid(walls: WallTable, x: float, z: float) -> Any:
    """Find the shortest way out of a solid that a point is inside of.

    Parameters
    ----------
    walls : WallTable
    x, z : float
        Point, m.

    Returns
    -------
    tuple
        Whether the point is inside, as far as walls are listed; depth, m; unit direction x, z out.
    """
    begin, end = cell_list(walls, x, z)
    nearest, squared = -1, math.inf
    is_interior = False
    for entry in range(begin, end):
        index = walls.cell_edge[entry]
        px, pz, feature = nearest_on_edge(walls.edge, index, x, z)
        candidate = (px - x) * (px - x) + (pz - z) * (pz - z)
        if candidate < squared:
            nearest, squared, is_interior = index, candidate, feature == FEATURE_INTERIOR
    if nearest < 0 or not is_interior or walls.edge[nearest, KIND] != SOLID:
        return False, 0.0, 0.0, 0.0
    if side_of_edge(walls.edge, nearest, x, z) > ON_EDGE:
        return False, 0.0, 0.0, 0.0
    return True, math.sqrt(squared), walls.edge[nearest, ALONG_Z], -walls.edge[nearest, ALONG_X]


@kernel
def push_off_walls(walls: WallTable, x: float, z: float, near: float) -> Any:
    """Move a point that is too near to a wall away from it, without passing another.

    Parameters
    ----------
    walls : WallTable
    x, z : float
        Point, m.
    near : float
        Distance to keep, m.

    Returns
    -------
    tuple of float
        x and z, m; unchanged when the point is far enough from every wall.
    """
    for _ in range(MOST_PUSHES):
        begin, end = cell_list(walls, x, z)
        squared, away_x, away_z = math.inf, 0.0, 0.0
        for entry in range(begin, end):
            px, pz, _ = nearest_on_edge(walls.edge, walls.cell_edge[entry], x, z)
            candidate = (x - px) * (x - px) + (z - pz) * (z - pz)
            if candidate < squared:
                squared, away_x, away_z = candidate, x - px, z - pz
        distance = math.sqrt(squared)
        if distance >= near - 1e-9 or distance < 1e-9:
            return x, z
        scale = (near - distance) / distance
        x, z = slide(walls, x, z, scale * away_x, scale * away_z, near, MOST_SLIDES)
    return x, z


@kernel
def is_in_sight(
    walls: WallTable, x: float, z: float, target_x: float, target_z: float, longest: float
) -> bool:
    """Tell whether the straight line between two points passes no wall.

    Parameters
    ----------
    walls : WallTable
    x, z, target_x, target_z : float
        Points, m.
    longest : float
        The line is looked at in pieces of this length, at most `walls.reach`, m.

    Returns
    -------
    bool
    """
    dx, dz = target_x - x, target_z - z
    pieces = math.ceil(math.sqrt(dx * dx + dz * dz) / longest)
    for piece in range(pieces):
        from_x, from_z = x + dx * piece / pieces, z + dz * piece / pieces
        end_x, end_z = slide(walls, from_x, from_z, dx / pieces, dz / pieces, THIN_MARGIN, 1)
        if abs(end_x - from_x - dx / pieces) + abs(end_z - from_z - dz / pieces) > ON_EDGE:
            return False
    return True


@kernel
def hold_at_walls(
    own: int, position_world: Any, previous_position_world: Any, radius: float, walls: WallTable, dt: float
) -> None:
    """Replace the motion of a step by one that passes no wall and keeps the body out of walls.

    Parameters
    ----------
    own : int
        Character.
    position_world : (N, 3) float64
        Row `own` in and out, m.
    previous_position_world : (N, 3) float64
        Where the motion began, m.
    radius : float
        m, less than `walls.reach`.
    walls : WallTable
    dt : float
        s.

    Notes
    -----
    **Source:** collide and slide (Fauerby 2003), for discs.
    **Differs from the source:** a start that is too near already may move anywhere but nearer; the inside of
    a solid, as when an obstacle appears on top of a character, is left the short way at a limited speed.
    """
    x, z = previous_position_world[own, 0], previous_position_world[own, 2]
    target_x, target_z = position_world[own, 0], position_world[own, 2]
    if not (is_point(x, z) and is_point(target_x, target_z)):
        return
    is_inside, depth, out_x, out_z = way_out_of_solid(walls, x, z)
    if is_inside:
        step = min(depth + radius, LEAVING_SPEED * dt)
        position_world[own, 0] = x + step * out_x
        position_world[own, 2] = z + step * out_z
        return
    near = max(radius - SLACK, 0.0)
    longest = max(walls.reach - radius, SHORTEST_PIECE)
    dx, dz = target_x - x, target_z - z
    length = math.sqrt(dx * dx + dz * dz)
    pieces = int(min(math.ceil(length / longest), float(MOST_PIECES)))
    share = min(1.0, longest * pieces / max(length, 1e-12)) / max(pieces, 1)
    for _ in range(pieces):
        x, z = slide(walls, x, z, share * dx, share * dz, near, MOST_SLIDES)
    x, z = push_off_walls(walls, x, z, near)
    if x != target_x or z != target_z:
        # Who slid round a corner must not have cut it; if so, the motion ends where it first met a wall.
        start_x, start_z = previous_position_world[own, 0], previous_position_world[own, 2]
        if not is_in_sight(walls, start_x, start_z, x, z, longest):
            x, z = slide(walls, start_x, start_z, share * dx, share * dz, near, 1)
    position_world[own, 0] = x
    position_world[own, 2] = z


@kernel
def stop_at_walls(
    velocity_world: Any, position_world: Any, radius: Any, near: Any, near_count: int, walls: WallTable
) -> None:
    """Take away the velocity with which characters press into walls that they touch.

    Parameters
    ----------
    velocity_world : (N, 3) float64
        In and out, m/s.
    position_world : (N, 3) float64
        m.
    radius : (N,) float64
        m.
    near : (>= near_count,) int32
        Characters near walls.
    near_count : int
    walls : WallTable
    """
    for entry in range(near_count):
        own = near[entry]
        x, z = position_world[own, 0], position_world[own, 2]
        begin, end = cell_list(walls, x, z)
        for place in range(begin, end):
            px, pz, _ = nearest_on_edge(walls.edge, walls.cell_edge[place], x, z)
            away_x, away_z = x - px, z - pz
            distance = math.sqrt(away_x * away_x + away_z * away_z)
            if not 1e-9 < distance <= radius[own] + TOUCH_GAP:
                continue
            away_x, away_z = away_x / distance, away_z / distance
            into = min(away_x * velocity_world[own, 0] + away_z * velocity_world[own, 2], 0.0)
            velocity_world[own, 0] -= into * away_x
            velocity_world[own, 2] -= into * away_z
