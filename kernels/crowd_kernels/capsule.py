"""Distances of line segments, the axes of capsules, to spheres, boxes, capsules and triangle meshes.

All shapes stand in their own frame, centred at the origin. The distance of a capsule to a shape is that of
its axis less its radius.
"""

import math
from typing import Any, NamedTuple

from crowd_kernels._jit import kernel
from crowd_kernels.triangle import nearest_on_triangle
from crowd_kernels.vector import Vector, add, cross, dot, norm, scaled, subtract

SPHERE = 0
BOX = 1
CAPSULE = 2
MESH = 3
TINY = 1e-18


class ShapeTable(NamedTuple):
    """Shapes of objects; meshes as trees of boxes, each node before its children."""

    kind: Any
    """(M,) int32: `SPHERE`, `BOX`, `CAPSULE` (along y) or `MESH`."""
    half_size: Any
    """(M, 3) float64: half the sides of the box around it, m: radius, half a capsule's length."""
    first_node: Any
    """(M,) int32: root of a mesh's tree."""
    last_node: Any
    """(M,) int32: one behind the tree's last node."""
    low: Any
    """(K, 3) float64: lowest corner of each node's box, m."""
    high: Any
    """(K, 3) float64: highest corner, m."""
    skip: Any
    """(K,) int32: node that follows when the children are passed over."""
    first_triangle: Any
    """(K,) int32: first triangle of a leaf, -1 for inner nodes."""
    triangle_count: Any
    """(K,) int32: triangles of a leaf."""
    corner: Any
    """(T, 9) float64: corners of the triangles in the order of the leaves, m."""


@kernel
def segment_point(start: Vector, end: Vector, point: Vector) -> float:
    """Find the distance between a segment and a point, m."""
    along = subtract(end, start)
    square = dot(along, along)
    share = 0.0
    if square > TINY:
        share = min(max(dot(subtract(point, start), along) / square, 0.0), 1.0)
    return norm(subtract(point, add(start, scaled(along, share))))


@kernel
def segment_segment(start: Vector, end: Vector, other_start: Vector, other_end: Vector) -> float:
    """Find the distance between two segments.

    Parameters
    ----------
    start, end, other_start, other_end : tuple of float
        m; either segment may be a point.

    Returns
    -------
    float
        m.

    Notes
    -----
    **Source:** Ericson, Real-Time Collision Detection, 2005, section 5.1.9.
    """
    first = subtract(end, start)
    second = subtract(other_end, other_start)
    between = subtract(start, other_start)
    a = dot(first, first)
    e = dot(second, second)
    f = dot(second, between)
    if a <= TINY:
        return segment_point(other_start, other_end, start)
    if e <= TINY:
        return segment_point(start, end, other_start)
    b = dot(first, second)
    c = dot(first, between)
    denominator = a * e - b * b
    s = 0.0
    if denominator > 1e-12 * a * e:
        s = min(max((b * f - c * e) / denominator, 0.0), 1.0)
    t = (b * s + f) / e
    if t < 0.0:
        t = 0.0
        s = min(max(-c / a, 0.0), 1.0)
    elif t > 1.0:
        t = 1.0
        s = min(max((b - c) / a, 0.0), 1.0)
    return norm(subtract(add(start, scaled(first, s)), add(other_start, scaled(second, t))))


@kernel
def box_slope(start: Vector, along: Vector, half: Vector, share: float) -> float:
    """Find half the slope of the squared distance to a box along a segment, at a share of its length."""
    slope = 0.0
    for axis in range(3):
        place = start[axis] + share * along[axis]
        if place > half[axis]:
            slope += (place - half[axis]) * along[axis]
        elif place < -half[axis]:
            slope += (place + half[axis]) * along[axis]
    return slope


@kernel
def segment_box(start: Vector, end: Vector, half: Vector) -> float:
    """Find the distance between a segment and a solid box.

    Parameters
    ----------
    start, end : tuple of float
        In the box's frame, m.
    half : tuple of float
        Half the sides, m.

    Returns
    -------
    float
        m; 0 where they meet.

    Notes
    -----
    **Source:** the squared distance to a convex solid is convex along a line, and for a box its slope is
    piecewise linear with kinks where the line passes the planes of the faces: the zero between two
    neighbouring kinks is exact.
    """
    along = subtract(end, start)
    low = 0.0
    high = 1.0
    share = 0.0
    if box_slope(start, along, half, 0.0) >= 0.0:
        share = 0.0
    elif box_slope(start, along, half, 1.0) <= 0.0:
        share = 1.0
    else:
        for axis in range(3):
            if along[axis] != 0.0:
                for side in range(2):
                    plane = half[axis] if side == 1 else -half[axis]
                    kink = (plane - start[axis]) / along[axis]
                    if low < kink < high:
                        if box_slope(start, along, half, kink) > 0.0:
                            high = kink
                        else:
                            low = kink
        below = box_slope(start, along, half, low)
        above = box_slope(start, along, half, high)
        share = low if above <= below else low - below * (high - low) / (above - below)
    square = 0.0
    for axis in range(3):
        beyond = max(abs(start[axis] + share * along[axis]) - half[axis], 0.0)
        square += beyond * beyond
    return math.sqrt(square)


@kernel
def crosses_triangle(start: Vector, end: Vector, a: Vector, b: Vector, c: Vector) -> bool:
    """Tell whether a segment passes through a triangle; touching its plane from one side does not count."""
    normal = cross(subtract(b, a), subtract(c, a))
    from_start = dot(normal, subtract(start, a))
    from_end = dot(normal, subtract(end, a))
    if from_start * from_end > 0.0 or from_start == from_end:
        return False
    share = from_start / (from_start - from_end)
    point = add(start, scaled(subtract(end, start), share))
    return (
        dot(normal, cross(subtract(b, a), subtract(point, a))) >= 0.0
        and dot(normal, cross(subtract(c, b), subtract(point, b))) >= 0.0
        and dot(normal, cross(subtract(a, c), subtract(point, c))) >= 0.0
    )


@kernel
def triangle_point(point: Vector, a: Vector, b: Vector, c: Vector) -> Vector:
    """Find the point of a triangle nearest to a point."""
    u, v, w = nearest_on_triangle(
        point[0], point[1], point[2], a[0], a[1], a[2], b[0], b[1], b[2], c[0], c[1], c[2]
    )
    return (
        u * a[0] + v * b[0] + w * c[0],
        u * a[1] + v * b[1] + w * c[1],
        u * a[2] + v * b[2] + w * c[2],
    )


@kernel
def segment_triangle(start: Vector, end: Vector, a: Vector, b: Vector, c: Vector) -> float:
    """Find the distance between a segment and a triangle.

    Parameters
    ----------
    start, end : tuple of float
        m.
    a, b, c : tuple of float
        Corners, m.

    Returns
    -------
    float
        m; 0 where they meet.

    Notes
    -----
    **Source:** Ericson, Real-Time Collision Detection, 2005, section 5.1.10: the nearest pair is an end and
    the triangle, or the segment and an edge, unless they cross.
    """
    if crosses_triangle(start, end, a, b, c):
        return 0.0
    distance = min(
        norm(subtract(start, triangle_point(start, a, b, c))),
        norm(subtract(end, triangle_point(end, a, b, c))),
    )
    distance = min(distance, segment_segment(start, end, a, b))
    distance = min(distance, segment_segment(start, end, b, c))
    return min(distance, segment_segment(start, end, c, a))


@kernel
def gap_to_node(low: Vector, high: Vector, table: ShapeTable, node: int) -> float:
    """Find the squared gap between an upright box and the box of a tree's node, m2."""
    square = 0.0
    for axis in range(3):
        gap = max(table.low[node, axis] - high[axis], low[axis] - table.high[node, axis])
        if gap > 0.0:
            square += gap * gap
    return square


@kernel
def triangle_corners(table: ShapeTable, triangle: int) -> tuple[Vector, Vector, Vector]:
    """Read the corners of a triangle of a mesh."""
    row = table.corner[triangle]
    return (row[0], row[1], row[2]), (row[3], row[4], row[5]), (row[6], row[7], row[8])


@kernel
def segment_mesh(start: Vector, end: Vector, table: ShapeTable, item: int, cutoff: float) -> float:
    """Find the distance between a segment and the triangles of a mesh.

    Parameters
    ----------
    start, end : tuple of float
        In the mesh's frame, m.
    table : ShapeTable
    item : int
        Row of the mesh.
    cutoff : float
        Greatest distance of interest, m.

    Returns
    -------
    float
        m, at most `cutoff`; 0 where they meet. What is inside a closed mesh counts by its surface.

    Notes
    -----
    **Source:** depth-first bounding boxes with escape indices (Ericson 2005, section 6.6.2): no stack.
    """
    low = (min(start[0], end[0]), min(start[1], end[1]), min(start[2], end[2]))
    high = (max(start[0], end[0]), max(start[1], end[1]), max(start[2], end[2]))
    best = cutoff
    node = table.first_node[item]
    last = table.last_node[item]
    while node < last:
        if gap_to_node(low, high, table, node) >= best * best:
            node = table.skip[node]
            continue
        first = table.first_triangle[node]
        if first >= 0:
            for triangle in range(first, first + table.triangle_count[node]):
                a, b, c = triangle_corners(table, triangle)
                best = min(best, segment_triangle(start, end, a, b, c))
        node += 1
    return best


@kernel
def nearest_on_mesh(point: Vector, table: ShapeTable, item: int) -> tuple[Vector, int]:
    """Find the nearest point of a mesh, and the triangle that it lies on.

    Parameters
    ----------
    point : tuple of float
        In the mesh's frame, m.
    table : ShapeTable
    item : int
        Row of the mesh.

    Returns
    -------
    point : tuple of float
        m.
    triangle : int
        Row of `table.corner`.
    """
    best = math.inf
    nearest = (0.0, 0.0, 0.0)
    chosen = 0
    node = table.first_node[item]
    last = table.last_node[item]
    while node < last:
        if gap_to_node(point, point, table, node) >= best:
            node = table.skip[node]
            continue
        first = table.first_triangle[node]
        if first >= 0:
            for triangle in range(first, first + table.triangle_count[node]):
                a, b, c = triangle_corners(table, triangle)
                found = triangle_point(point, a, b, c)
                away = subtract(found, point)
                if dot(away, away) < best:
                    best = dot(away, away)
                    nearest = found
                    chosen = triangle
        node += 1
    return nearest, chosen


@kernel
def segment_shape(start: Vector, end: Vector, table: ShapeTable, item: int, cutoff: float) -> float:
    """Find the distance between a segment and an object.

    Parameters
    ----------
    start, end : tuple of float
        In the object's frame, m.
    table : ShapeTable
    item : int
        Row of the object.
    cutoff : float
        Greatest distance of interest, m.

    Returns
    -------
    float
        m, at most `cutoff`. Inside spheres and capsules negative, inside boxes and on surfaces of meshes 0.
    """
    kind = table.kind[item]
    half = (table.half_size[item, 0], table.half_size[item, 1], table.half_size[item, 2])
    if kind == SPHERE:
        return min(segment_point(start, end, (0.0, 0.0, 0.0)) - float(half[0]), cutoff)
    if kind == CAPSULE:
        reach = half[1] - half[0]
        return min(
            segment_segment(start, end, (0.0, -reach, 0.0), (0.0, reach, 0.0)) - float(half[0]), cutoff
        )
    if kind == BOX:
        return min(segment_box(start, end, half), cutoff)
    return segment_mesh(start, end, table, item, cutoff)
