"""Walls as directed edges: which are near, and which velocities lead into them.

All geometry is in the plane (x, z) with x drawn to the right and z drawn upwards, so "left" and
"counter-clockwise" are those of that drawing. Seen from above in the world it is the mirror image. Since
every formula here uses the same drawing, nothing else needs to know.

An edge runs from its start to its end with the walkable side on its **right**. A solid polygon is a closed
counter-clockwise chain of edges; a thin wall is two edges back to back.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from crowd_kernels._jit import kernel
from crowd_kernels.neighbors import NUMBER_MASK, neighbor_key

START_X, START_Z, END_X, END_Z = 0, 1, 2, 3
ALONG_X, ALONG_Z, LENGTH = 4, 5, 6
BEFORE_X, BEFORE_Z, AFTER_X, AFTER_Z = 7, 8, 9, 10
START_IS_CONVEX, END_IS_CONVEX, KIND = 11, 12, 13
EDGE_COLUMNS = 14
SOLID, THIN, BACK_OF_THIN = 0.0, 1.0, 2.0
MOST_EDGES = 16
"""Edges nearest to a character that it takes into account."""
COVERED_SLACK = 1e-5
FEATURE_START, FEATURE_INTERIOR, FEATURE_END = -1, 0, 1


class WallTable(NamedTuple):
    """All walls, and lists of those near each cell of a grid. Outside the grid no wall is near."""

    edge: Any
    """(W, EDGE_COLUMNS) float64: start, end, unit direction, length, unit directions of the edges before and
    after it in its chain, convexity (1 or 0) of its corners, kind."""
    cell_start: Any
    """(columns * rows + 1,) int32: where the list of each cell begins."""
    cell_edge: Any
    """(L,) int32: edges of the lists, ascending."""
    origin_x: float
    """Low corner of the grid, m."""
    origin_z: float
    """Low corner of the grid, m."""
    cell_size: float
    """m."""
    columns: int
    """Cells along x."""
    rows: int
    """Cells along z."""
    reach: float
    """Every edge within this of any point of a cell is in the cell's list, m."""


@kernel
def cell_list(walls: WallTable, x: float, z: float) -> Any:
    """Find the list of edges near a point.

    Parameters
    ----------
    walls : WallTable
    x, z : float
        Point, m.

    Returns
    -------
    tuple of int
        First and last + 1 entry in `walls.cell_edge`; equal when no edge is near.
    """
    column = math.floor((x - walls.origin_x) / walls.cell_size)
    row = math.floor((z - walls.origin_z) / walls.cell_size)
    if not (0 <= column < walls.columns and 0 <= row < walls.rows):
        return np.int32(0), np.int32(0)
    cell = int(row) * walls.columns + int(column)
    return walls.cell_start[cell], walls.cell_start[cell + 1]


@kernel
def nearest_on_edge(edge: Any, index: int, x: float, z: float) -> Any:
    """Find the point of an edge nearest to a point.

    Parameters
    ----------
    edge : (W, EDGE_COLUMNS) float64
    index : int
        Edge.
    x, z : float
        Point, m.

    Returns
    -------
    tuple
        x and z of the nearest point, and whether it is the start, the interior or the end (FEATURE_*).
    """
    sx, sz = edge[index, START_X], edge[index, START_Z]
    along = (x - sx) * edge[index, ALONG_X] + (z - sz) * edge[index, ALONG_Z]
    if along <= 0.0:
        return sx, sz, FEATURE_START
    if along >= edge[index, LENGTH]:
        return edge[index, END_X], edge[index, END_Z], FEATURE_END
    return sx + along * edge[index, ALONG_X], sz + along * edge[index, ALONG_Z], FEATURE_INTERIOR


@kernel
def side_of_edge(edge: Any, index: int, x: float, z: float) -> float:
    """Measure how far a point lies to the walkable side of an edge's line.

    Parameters
    ----------
    edge : (W, EDGE_COLUMNS) float64
    index : int
        Edge.
    x, z : float
        Point, m.

    Returns
    -------
    float
        m, positive on the walkable side.
    """
    dx, dz = x - edge[index, START_X], z - edge[index, START_Z]
    return float(edge[index, ALONG_Z] * dx - edge[index, ALONG_X] * dz)


@kernel
def find_edges(walls: WallTable, x: float, z: float, reach: float, keys: Any) -> int:
    """Find the nearest edges that show their walkable side to a point.

    Parameters
    ----------
    walls : WallTable
    x, z : float
        Point, m.
    reach : float
        Only edges nearer than this, m; at most `walls.reach`.
    keys : (>= MOST_EDGES,) int64
        Written: `neighbor_key` of squared distance and edge, ascending.

    Returns
    -------
    int
        Number found.
    """
    begin, end = cell_list(walls, x, z)
    found = 0
    limit_key = neighbor_key(reach * reach, 0)
    for entry in range(begin, end):
        index = walls.cell_edge[entry]
        if side_of_edge(walls.edge, index, x, z) <= 0.0:
            continue
        px, pz, _ = nearest_on_edge(walls.edge, index, x, z)
        key = neighbor_key((px - x) * (px - x) + (pz - z) * (pz - z), index)
        if key >= limit_key:
            continue
        place = found
        if found < MOST_EDGES:
            found += 1
        else:
            place -= 1
        while place > 0 and keys[place - 1] > key:
            keys[place] = keys[place - 1]
            place -= 1
        keys[place] = key
        if found == MOST_EDGES:
            limit_key = keys[MOST_EDGES - 1]
    return found


@kernel
def touching_line(edge: Any, index: int, x: float, z: float, radius: float) -> Any:
    """Form the line of an edge that the body already touches: come no nearer.

    Parameters
    ----------
    edge : (W, EDGE_COLUMNS) float64
    index : int
        Edge.
    x, z : float
        Centre of the body, m.
    radius : float
        m.

    Returns
    -------
    tuple
        Whether the body touches the edge; whether there is a line; its direction x, z (it passes through the
        velocity 0).
    """
    px, pz, feature = nearest_on_edge(edge, index, x, z)
    to_x, to_z = px - x, pz - z
    squared = to_x * to_x + to_z * to_z
    if squared > radius * radius:
        return False, False, 0.0, 0.0
    if feature == FEATURE_INTERIOR:
        return True, True, -edge[index, ALONG_X], -edge[index, ALONG_Z]
    is_relevant = edge[index, START_IS_CONVEX] > 0.0
    if feature == FEATURE_END:
        # If the next edge faces the body too, that edge speaks for the corner.
        faces_next = to_x * edge[index, AFTER_Z] - to_z * edge[index, AFTER_X] < 0.0
        is_relevant = edge[index, END_IS_CONVEX] > 0.0 and not faces_next
    distance = math.sqrt(squared)
    if not is_relevant or distance < 1e-12:
        return True, False, 0.0, 0.0
    return True, True, -to_z / distance, to_x / distance


@kernel
def is_covered(
    lines: Any, line_count: int, start_x: float, start_z: float, end_x: float, end_z: float, margin: float
) -> bool:
    """Tell whether an earlier line already keeps velocities away from a cut-off segment.

    Parameters
    ----------
    lines : (>= 4 line_count,) float64
        Point and unit direction of each line.
    line_count : int
    start_x, start_z, end_x, end_z : float
        Ends of the segment in velocity space, m/s.
    margin : float
        Distance to keep, m/s.

    Returns
    -------
    bool
    """
    for index in range(line_count):
        px, pz = lines[4 * index], lines[4 * index + 1]
        dx, dz = lines[4 * index + 2], lines[4 * index + 3]
        if (
            (start_x - px) * dz - (start_z - pz) * dx - margin >= -COVERED_SLACK
            and (end_x - px) * dz - (end_z - pz) * dx - margin >= -COVERED_SLACK
        ):  # fmt: skip
            return True
    return False


@kernel
def left_tangent(to_x: float, to_z: float, radius: float) -> Any:
    """Find the direction from the origin that leaves a disc just to its right.

    Parameters
    ----------
    to_x, to_z : float
        Centre of the disc, m, farther away than `radius`.
    radius : float
        m.

    Returns
    -------
    tuple of float
        Unit direction x, z. The other tangent is that of the mirrored disc.
    """
    squared = to_x * to_x + to_z * to_z
    leg = math.sqrt(max(squared - radius * radius, 0.0))
    return (to_x * leg - to_z * radius) / squared, (to_x * radius + to_z * leg) / squared


@kernel
def edge_legs(edge: Any, index: int, x: float, z: float, radius: float) -> Any:
    """Find the two legs of the velocity obstacle of an edge that the body does not touch.

    Parameters
    ----------
    edge : (W, EDGE_COLUMNS) float64
    index : int
        Edge.
    x, z : float
        Centre of the body, m.
    radius : float
        m.

    Returns
    -------
    tuple
        Corner that cuts the left leg and corner that cuts the right leg, as FEATURE_START or FEATURE_END
        (the same one when the edge is seen from its end, FEATURE_INTERIOR twice when there is no obstacle);
        left leg x, z; right leg x, z; whether the left and the right leg belong to a neighbouring edge.
    """
    along_x, along_z = edge[index, ALONG_X], edge[index, ALONG_Z]
    start_x, start_z = edge[index, START_X] - x, edge[index, START_Z] - z
    end_x, end_z = edge[index, END_X] - x, edge[index, END_Z] - z
    along = -(start_x * along_x + start_z * along_z)
    line_distance = abs(start_x * along_z - start_z * along_x)
    start_is_convex = edge[index, START_IS_CONVEX] > 0.0
    end_is_convex = edge[index, END_IS_CONVEX] > 0.0
    left, right = FEATURE_START, FEATURE_END
    # Seen almost along the edge, only its nearer corner counts.
    if line_distance <= radius and along < 0.0:
        right = FEATURE_START
    elif line_distance <= radius and along > edge[index, LENGTH]:
        left = FEATURE_END
    left_is_convex = start_is_convex if left == FEATURE_START else end_is_convex
    right_is_convex = start_is_convex if right == FEATURE_START else end_is_convex
    if left == right and not left_is_convex:
        return FEATURE_INTERIOR, FEATURE_INTERIOR, 0.0, 0.0, 0.0, 0.0, False, False
    left_x, left_z, right_x, right_z = -along_x, -along_z, along_x, along_z
    if left_is_convex:
        cx, cz = (start_x, start_z) if left == FEATURE_START else (end_x, end_z)
        left_x, left_z = left_tangent(cx, cz, radius)
    if right_is_convex:
        cx, cz = (start_x, start_z) if right == FEATURE_START else (end_x, end_z)
        mirrored_x, mirrored_z = left_tangent(cx, -cz, radius)
        right_x, right_z = mirrored_x, -mirrored_z
    # A leg that points into the neighbouring edge gives way to that edge.
    if left == FEATURE_START:
        before_x, before_z = edge[index, BEFORE_X], edge[index, BEFORE_Z]
    else:
        before_x, before_z = along_x, along_z
    if right == FEATURE_END:
        after_x, after_z = edge[index, AFTER_X], edge[index, AFTER_Z]
    else:
        after_x, after_z = along_x, along_z
    left_is_foreign = left_is_convex and left_z * before_x - left_x * before_z >= 0.0
    right_is_foreign = right_is_convex and right_x * after_z - right_z * after_x <= 0.0
    if left_is_foreign:
        left_x, left_z = -before_x, -before_z
    if right_is_foreign:
        right_x, right_z = after_x, after_z
    return left, right, left_x, left_z, right_x, right_z, left_is_foreign, right_is_foreign


@kernel
def edge_line(
    edge: Any, index: int, x: float, z: float, vx: float, vz: float, radius: float, inverse_horizon: float
) -> Any:
    """Form the line that keeps a velocity out of the velocity obstacle of an edge not touched yet.

    Parameters
    ----------
    edge : (W, EDGE_COLUMNS) float64
    index : int
        Edge.
    x, z : float
        Centre of the body, m.
    vx, vz : float
        Its velocity, m/s.
    radius : float
        m.
    inverse_horizon : float
        1/s.

    Returns
    -------
    tuple
        Whether there is a line; its point x, z, m/s; its unit direction x, z. Admissible on its left.
    """
    left, right, left_x, left_z, right_x, right_z, left_is_foreign, right_is_foreign = edge_legs(
        edge, index, x, z, radius
    )
    if left == FEATURE_INTERIOR:
        return False, 0.0, 0.0, 0.0, 0.0
    margin = radius * inverse_horizon
    corner = START_X if left == FEATURE_START else END_X
    left_cut_x = inverse_horizon * (edge[index, corner] - x)
    left_cut_z = inverse_horizon * (edge[index, corner + 1] - z)
    corner = START_X if right == FEATURE_START else END_X
    right_cut_x = inverse_horizon * (edge[index, corner] - x)
    right_cut_z = inverse_horizon * (edge[index, corner + 1] - z)
    from_left_x, from_left_z = vx - left_cut_x, vz - left_cut_z
    from_right_x, from_right_z = vx - right_cut_x, vz - right_cut_z
    share = 0.5
    if left != right:
        cut_x, cut_z = right_cut_x - left_cut_x, right_cut_z - left_cut_z
        share = (from_left_x * cut_x + from_left_z * cut_z) / (cut_x * cut_x + cut_z * cut_z)
    on_left = from_left_x * left_x + from_left_z * left_z
    on_right = from_right_x * right_x + from_right_z * right_z
    # Round the corners of the cut-off: away from the corner.
    if (share < 0.0 and on_left < 0.0) or (left == right and on_left < 0.0 and on_right < 0.0):
        length = max(math.sqrt(from_left_x * from_left_x + from_left_z * from_left_z), 1e-12)
        ux, uz = from_left_x / length, from_left_z / length
        return True, left_cut_x + margin * ux, left_cut_z + margin * uz, uz, -ux
    if share > 1.0 and on_right < 0.0:
        length = max(math.sqrt(from_right_x * from_right_x + from_right_z * from_right_z), 1e-12)
        ux, uz = from_right_x / length, from_right_z / length
        return True, right_cut_x + margin * ux, right_cut_z + margin * uz, uz, -ux
    # Otherwise to the nearest of the cut-off segment and the two legs.
    to_cut, to_left, to_right = math.inf, math.inf, math.inf
    if left != right and 0.0 <= share <= 1.0:
        dx = vx - left_cut_x - share * (right_cut_x - left_cut_x)
        dz = vz - left_cut_z - share * (right_cut_z - left_cut_z)
        to_cut = dx * dx + dz * dz
    if on_left >= 0.0:
        dx, dz = from_left_x - on_left * left_x, from_left_z - on_left * left_z
        to_left = dx * dx + dz * dz
    if on_right >= 0.0:
        dx, dz = from_right_x - on_right * right_x, from_right_z - on_right * right_z
        to_right = dx * dx + dz * dz
    cut_x, cut_z = left_cut_x, left_cut_z
    if to_cut <= to_left and to_cut <= to_right:
        dx, dz = -edge[index, ALONG_X], -edge[index, ALONG_Z]
    elif to_left <= to_right:
        if left_is_foreign:
            return False, 0.0, 0.0, 0.0, 0.0
        dx, dz = left_x, left_z
    else:
        if right_is_foreign:
            return False, 0.0, 0.0, 0.0, 0.0
        dx, dz = -right_x, -right_z
        cut_x, cut_z = right_cut_x, right_cut_z
    return True, cut_x - margin * dz, cut_z + margin * dx, dx, dz


@kernel
def wall_lines(
    walls: WallTable,
    x: float,
    z: float,
    vx: float,
    vz: float,
    radius: float,
    reach: float,
    inverse_horizon: float,
    keys: Any,
    out_lines: Any,
) -> int:
    """Form the lines of all walls near a character: half-planes of velocities that stay clear of them.

    Parameters
    ----------
    walls : WallTable
    x, z : float
        Centre of the body, m.
    vx, vz : float
        Its velocity, m/s.
    radius : float
        m.
    reach : float
        Distance at which walls are ignored, m.
    inverse_horizon : float
        1 / time ahead for which walls are avoided, 1/s.
    keys : (>= MOST_EDGES,) int64
        Scratch.
    out_lines : (>= 4 MOST_EDGES,) float64
        Written: point x, z (m/s) and unit direction x, z of each line; admissible on the left.

    Returns
    -------
    int
        Number of lines.

    Notes
    -----
    **Source:** van den Berg, Guy, Lin, Manocha, Reciprocal n-body collision avoidance, 2011, section 4.3 and
    5.2 (static obstacles); the treatment of corners follows the authors' RVO2.
    **Differs from the source:** at most `MOST_EDGES` nearest edges.
    """
    edge_count = find_edges(walls, x, z, min(reach, walls.reach), keys)
    edge = walls.edge
    line_count = 0
    for entry in range(edge_count):
        index = int(keys[entry] & NUMBER_MASK)
        if is_covered(
            out_lines,
            line_count,
            inverse_horizon * (edge[index, START_X] - x),
            inverse_horizon * (edge[index, START_Z] - z),
            inverse_horizon * (edge[index, END_X] - x),
            inverse_horizon * (edge[index, END_Z] - z),
            inverse_horizon * radius,
        ):
            continue
        touches, has_line, dx, dz = touching_line(edge, index, x, z, radius)
        px, pz = 0.0, 0.0
        if not touches:
            has_line, px, pz, dx, dz = edge_line(edge, index, x, z, vx, vz, radius, inverse_horizon)
        if has_line:
            out_lines[4 * line_count] = px
            out_lines[4 * line_count + 1] = pz
            out_lines[4 * line_count + 2] = dx
            out_lines[4 * line_count + 3] = dz
            line_count += 1
    return line_count
