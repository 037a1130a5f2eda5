"""Where to put a hand on an object, so that its fingers can close around it."""

import math
from typing import Any

from crowd_kernels._jit import kernel, parallel_kernel, prange
from crowd_kernels.capsule import BOX, CAPSULE, SPHERE, ShapeTable, nearest_on_mesh, triangle_corners
from crowd_kernels.grasp import CHUNKS
from crowd_kernels.hand import (
    LEFT,
    PINCH,
    POWER,
    HandTable,
    hand_axes,
    relative_frame,
    row_quaternion,
    row_vector,
)
from crowd_kernels.quaternion import Quaternion, from_axes, rotate
from crowd_kernels.vector import Vector, add, cross, dot, norm, scaled, subtract, unit

PLACED = 0
TOO_BIG = 1
PALM_GAP = 5e-4
"""Gap that is left between palm and object, m."""
ALONG_AXIS = 0.25
"""The back of the hand counts as parallel to an axis when its part across it is shorter than this."""
TURNS = 12
"""Directions of the fingers that are tried on a mesh."""
SLIM = 0.5
"""How much a width that one hand can span counts against a turn of the fingers."""
PINCH_DEPTH = 0.018
"""Depth below the top at which tall thin things are pinched, m."""

Grip = tuple[Vector, Vector, Vector, float, float]
"""Middle of the grip, back of the hand, fingers, half thickness along the back and along the fingers."""


@kernel
def across(direction: Vector, axis: Vector) -> Vector:
    """Take the part of a direction that is perpendicular to a unit axis."""
    return subtract(direction, scaled(axis, dot(direction, axis)))


@kernel
def hand_rotation(back: Vector, fingers: Vector, side: int) -> Quaternion:
    """Find the rotation of a hand joint from its back and its fingers, unit vectors across each other."""
    x = back if side == LEFT else scaled(back, -1.0)
    y = scaled(fingers, -1.0)
    return from_axes(x, y, cross(x, y))


@kernel
def clamped(value: float, bound: float) -> float:
    """Limit a value to [-bound, bound]; a negative bound counts as 0."""
    return min(max(value, -max(bound, 0.0)), max(bound, 0.0))


@kernel
def grip_capsule(half: Vector, palm: Vector, back: Vector, thumb: Vector, side: int, room: float) -> Grip:
    """Grip a capsule across its axis, the thumb's side along it, at the point nearest to the palm.

    Parameters
    ----------
    half : tuple of float
        Half sides of its box, m.
    palm : tuple of float
        Where the palm would be, in the object's frame, m.
    back, thumb : tuple of float
        How the hand would be turned.
    side : int
    room : float
        Half the breadth of the palm, m.
    """
    axis = (0.0, 1.0 if thumb[1] >= 0.0 else -1.0, 0.0)
    up = across(back, axis)
    if norm(up) < ALONG_AXIS:
        # The hand comes along the axis: it turns to the side that its fingers ask for.
        up = across(cross(thumb, back), axis) if side == LEFT else across(cross(back, thumb), axis)
    up = unit(up) if norm(up) > 1e-9 else (1.0, 0.0, 0.0)
    fingers = cross(up, axis) if side == LEFT else cross(axis, up)
    along = clamped(palm[1], half[1] - half[0] - room)
    return (0.0, along, 0.0), up, fingers, half[0], half[0]


@kernel
def width_cost(half_width: float, span_half: float) -> float:
    """Weigh a half width across the fingers, more than 1 for what cannot be spanned."""
    share = half_width / span_half
    return SLIM * share if share <= 1.0 else SLIM * share + 1.0


@kernel
def grip_box(
    half: Vector, palm: Vector, back: Vector, fingers: Vector, hand: HandTable, scale: float
) -> Grip:
    """Grip a box by the face that the back of the hand is nearest to, fingers along one of its edges.

    Parameters
    ----------
    half : tuple of float
        Half sides, m.
    palm : tuple of float
        Where the palm would be, in the object's frame, m.
    back, fingers : tuple of float
        How the hand would be turned.
    hand : HandTable
    scale : float
    """
    face = 0
    for axis in range(1, 3):
        if abs(back[axis]) > abs(back[face]):
            face = axis
    best = -math.inf
    edge = (face + 1) % 3
    for step in range(1, 3):
        axis = (face + step) % 3
        score = abs(fingers[axis]) - width_cost(half[axis], scale * hand.span_half)
        if half[3 - face - axis] < scale * hand.pinch_half:
            # Few fingers would lie over it.
            score -= 1.0
        if score > best:
            best = score
            edge = axis
    other = 3 - face - edge
    room = scale * hand.palm_half_width
    is_spanned = half[edge] <= scale * hand.span_half
    along_edge = 0.0 if is_spanned else clamped(palm[edge], half[edge] - scale * hand.farthest_grip)
    along_other = clamped(palm[other], half[other] - room)
    middle = (
        along_edge if edge == 0 else (along_other if other == 0 else 0.0),
        along_edge if edge == 1 else (along_other if other == 1 else 0.0),
        along_edge if edge == 2 else (along_other if other == 2 else 0.0),
    )
    up_sign = 1.0 if back[face] >= 0.0 else -1.0
    way_sign = 1.0 if fingers[edge] >= 0.0 else -1.0
    up = (up_sign * (face == 0), up_sign * (face == 1), up_sign * (face == 2))
    way = (way_sign * (edge == 0), way_sign * (edge == 1), way_sign * (edge == 2))
    return middle, up, way, half[face], half[edge]


@kernel
def mesh_extent(table: ShapeTable, item: int, direction: Vector) -> tuple[float, float]:
    """Find the lowest and the highest place of a mesh along a direction, m."""
    low = math.inf
    high = -math.inf
    for node in range(table.first_node[item], table.last_node[item]):
        first = table.first_triangle[node]
        if first >= 0:
            for triangle in range(first, first + table.triangle_count[node]):
                a, b, c = triangle_corners(table, triangle)
                for corner in (a, b, c):
                    place = dot(corner, direction)
                    low = min(low, place)
                    high = max(high, place)
    return low, high


@kernel
def grip_mesh(
    table: ShapeTable, item: int, palm: Vector, back: Vector, fingers: Vector, hand: HandTable, scale: float
) -> Grip:
    """Grip a mesh where its surface is nearest to the palm, fingers across its narrow side.

    Parameters
    ----------
    table : ShapeTable
    item : int
        Row of the mesh.
    palm : tuple of float
        Where the palm would be, in the object's frame, m.
    back, fingers : tuple of float
        How the hand would be turned.
    hand : HandTable
    scale : float

    Notes
    -----
    The palm is laid on the highest point of the whole mesh above the surface that it faces, so that the open
    hand touches nothing else.
    """
    point, triangle = nearest_on_mesh(palm, table, item)
    a, b, c = triangle_corners(table, triangle)
    normal = unit(cross(subtract(b, a), subtract(c, a)))
    up = normal if dot(normal, back) >= 0.0 else scaled(normal, -1.0)
    away = subtract(palm, point)
    if norm(away) > 1e-6:
        up = unit(away)
    side_way = across(fingers, up)
    if norm(side_way) < 1e-6:
        side_way = across((up[1], up[2], up[0]), up)
    first = unit(side_way)
    second = cross(up, first)
    best = -math.inf
    way = first
    for turn in range(TURNS):
        angle = 2.0 * math.pi * turn / TURNS
        tried = add(scaled(first, math.cos(angle)), scaled(second, math.sin(angle)))
        low, high = mesh_extent(table, item, tried)
        score = math.cos(angle) - width_cost(0.5 * (high - low), scale * hand.span_half)
        if score > best:
            best = score
            way = tried
    low, high = mesh_extent(table, item, way)
    half_way = 0.5 * (high - low)
    bottom, top = mesh_extent(table, item, up)
    other = cross(up, way)
    near, far = mesh_extent(table, item, other)
    room = scale * hand.palm_half_width
    beside = 0.5 * (near + far) + clamped(dot(point, other) - 0.5 * (near + far), 0.5 * (far - near) - room)
    is_spanned = half_way <= scale * hand.span_half
    along = 0.5 * (low + high)
    if not is_spanned:
        along += clamped(dot(point, way) - along, half_way - scale * hand.farthest_grip)
    half_up = 0.5 * (top - bottom)
    middle = add(add(scaled(way, along), scaled(other, beside)), scaled(up, top - half_up))
    return middle, up, way, half_up, half_way


@kernel
def place_hand(
    hand: HandTable, side: int, scale: float, table: ShapeTable, item: int, position: Vector,
    rotation: Quaternion,
) -> tuple[Vector, Quaternion, int, int]:  # fmt: skip
    """Find where the hand goes to grip an object, near to where it would be by itself.

    Parameters
    ----------
    hand : HandTable
    side : int
    scale : float
        Of the character's hand.
    table : ShapeTable
    item : int
        Row of the object.
    position, rotation : tuple of float
        Hand joint as it would be, in the object's frame; m.

    Returns
    -------
    position, rotation : tuple of float
        Hand joint on the object, in the object's frame; m.
    style : int
        `POWER` or `PINCH`.
    status : int
        `PLACED`, or `TOO_BIG` for one hand: the palm lies on the object all the same.

    Notes
    -----
    **Source:** Feng, Xu, Shapiro 2012, section 5.3: a sphere keeps the hand's orientation, a box gives it the
    normal of the nearest face, a capsule turns it across its axis.
    **Differs from the source:** the palm touches instead of the hand's joint; the hand slides along an axis
    or a face to the point nearest to it; fingers go across the narrow side; thin things are held between
    the tips; meshes take part.
    """
    back, fingers, thumb = hand_axes(rotation, side)
    palm = add(position, scaled(fingers, 0.5 * scale * (hand.nearest_grip + hand.farthest_grip)))
    half = (table.half_size[item, 0], table.half_size[item, 1], table.half_size[item, 2])
    middle = (0.0, 0.0, 0.0)
    half_up = half[0]
    half_way = half[0]
    kind = table.kind[item]
    if kind == CAPSULE:
        middle, back, fingers, half_up, half_way = grip_capsule(
            half, palm, back, thumb, side, scale * hand.palm_half_width
        )
    elif kind == BOX:
        middle, back, fingers, half_up, half_way = grip_box(half, palm, back, fingers, hand, scale)
    elif kind != SPHERE:
        middle, back, fingers, half_up, half_way = grip_mesh(table, item, palm, back, fingers, hand, scale)
    turned = hand_rotation(back, fingers, side)
    outward = 1.0 if side == LEFT else -1.0
    if half_way <= scale * hand.pinch_half:
        held = add(middle, scaled(back, half_up - min(half_up, PINCH_DEPTH)))
        pinch = (
            scale * hand.pinch_point[side, 0],
            scale * hand.pinch_point[side, 1],
            scale * hand.pinch_point[side, 2],
        )
        return subtract(held, rotate(turned, pinch)), turned, PINCH, PLACED
    along = min(
        max(scale * hand.thumb_clearance + half_way, scale * hand.nearest_grip), scale * hand.farthest_grip
    )
    on_palm = (-outward * scale * hand.palm_depth, -along, 0.0)
    top = add(middle, scaled(back, half_up + PALM_GAP))
    status = PLACED if half_way <= scale * hand.span_half else TOO_BIG
    return subtract(top, rotate(turned, on_palm)), turned, POWER, status


@parallel_kernel
def place_hands(
    hand: HandTable,
    table: ShapeTable,
    side: Any,
    item: Any,
    scale: Any,
    hand_position_world: Any,
    hand_rotation_world: Any,
    object_position_world: Any,
    object_rotation_world: Any,
    out_position: Any,
    out_rotation: Any,
    out_style: Any,
    out_status: Any,
) -> None:
    """Place many hands on their objects.

    Parameters
    ----------
    hand : HandTable
    table : ShapeTable
    side : (A,) int32
        `RIGHT` or `LEFT`.
    item : (A,) int32
        Rows of the objects.
    scale : (A,) float64
        Of the characters' hands.
    hand_position_world : (A, 3) float64
        Hand joints as they would be, m.
    hand_rotation_world : (A, 4) float64
    object_position_world : (M, 3) float64
        m.
    object_rotation_world : (M, 4) float64
    out_position : (A, 3) float64
        Hand joints on the objects, in the objects' frames, m.
    out_rotation : (A, 4) float64
    out_style : (A,) int32
        `POWER` or `PINCH`.
    out_status : (A,) int32
        `PLACED` or `TOO_BIG`.

    Notes
    -----
    **Source:** see `place_hand`.
    """
    count = side.shape[0]
    for k in prange(CHUNKS):
        chunk = (k * 37) % CHUNKS
        for row in range(chunk * count // CHUNKS, (chunk + 1) * count // CHUNKS):
            thing = item[row]
            position, rotation = relative_frame(
                row_vector(hand_position_world, row),
                row_quaternion(hand_rotation_world, row),
                row_vector(object_position_world, thing),
                row_quaternion(object_rotation_world, thing),
            )
            place, turned, style, status = place_hand(
                hand, side[row], scale[row], table, thing, position, rotation
            )
            for axis in range(3):
                out_position[row, axis] = place[axis]
            for axis in range(4):
                out_rotation[row, axis] = turned[axis]
            out_style[row] = style
            out_status[row] = status
