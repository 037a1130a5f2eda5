"""The hand: segments of its fingers and how they lie at a closure.

A finger is three segments, thumb first, each a capsule; closure 0 is the open hand, 1 the closed one. All
arrays over hands are ordered right, left.
"""

from typing import Any, NamedTuple

from crowd_kernels._jit import kernel
from crowd_kernels.quaternion import Quaternion, conjugate, from_rotation_vector, multiply, rotate
from crowd_kernels.vector import Vector, add, subtract

FINGERS = 5
SEGMENTS = 3
RIGHT = 0
LEFT = 1
POWER = 0
PINCH = 1


class HandTable(NamedTuple):
    """Both hands of a skeleton in rest proportions; m."""

    joint: Any
    """(2, 15) int32: joints of the segments, thumb to little finger."""
    offset: Any
    """(2, 15, 3) float64: joint in the frame of the joint before it, of the hand for the first ones."""
    tip: Any
    """(2, 15, 3) float64: end of the segment's axis in its joint's frame."""
    radius: Any
    """(15,) float64: of the capsules."""
    open_rotation: Any
    """(S, 2, 15, 4) float64: local rotations of the open hand for each style of grip."""
    sweep: Any
    """(S, 2, 15, 3) float64: rotation vector from the open to the closed hand, applied first."""
    length: Any
    """(2, 15) float64: of the segments' axes."""
    angle: Any
    """(S, 2, 15) float64: size of `sweep`, rad."""
    pinch_point: Any
    """(2, 3) float64: where the tips meet in the frame of the hand."""
    palm_depth: float
    """Palm below the plane of the joints."""
    palm_half_width: float
    """Half the breadth of the palm."""
    nearest_grip: float
    """Least distance of the middle of a grip from the wrist."""
    farthest_grip: float
    """Greatest one."""
    thumb_clearance: float
    """Room for the thumb between wrist and object."""
    pinch_half: float
    """Objects up to this half thickness are held between the tips."""
    span_half: float
    """Half thickness of the largest objects that one hand can hold."""
    segment_lanes: Any
    """(S, 2, 112) float32: `open_rotation` and `sweep`, 7 numbers, for loops with all segments and one more
    as 16 lanes."""


@kernel
def hand_axes(rotation: Quaternion, side: int) -> tuple[Vector, Vector, Vector]:
    """Find where the back of the hand, the fingers and the thumb's side point.

    Parameters
    ----------
    rotation : tuple of float
        Of the hand joint.
    side : int
        `RIGHT` or `LEFT`.

    Returns
    -------
    back, fingers, thumb : tuple of float
        Unit vectors.
    """
    outward = 1.0 if side == LEFT else -1.0
    return (
        rotate(rotation, (outward, 0.0, 0.0)),
        rotate(rotation, (0.0, -1.0, 0.0)),
        rotate(rotation, (0.0, 0.0, 1.0)),
    )


@kernel
def segment_end(
    hand: HandTable, side: int, style: int, scale: float, segment: int, closure: float,
    rotation: Quaternion, position: Vector,
) -> tuple[Quaternion, Vector, Vector]:  # fmt: skip
    """Walk from one joint of a finger to the next.

    Parameters
    ----------
    hand : HandTable
    side, style : int
    scale : float
        Of the character's hand.
    segment : int
        0 to 14.
    closure : float
        Of the segment's joint, 0 to 1.
    rotation, position : tuple of float
        Of the joint before, in any frame; m.

    Returns
    -------
    rotation, start, end : tuple of float
        Rotation of the segment and both ends of its axis.
    """
    offset = hand.offset[side, segment]
    start = add(position, rotate(rotation, (scale * offset[0], scale * offset[1], scale * offset[2])))
    turned = multiply(rotation, finger_rotation(hand, side, style, segment, closure))
    tip = hand.tip[side, segment]
    return turned, start, add(start, rotate(turned, (scale * tip[0], scale * tip[1], scale * tip[2])))


@kernel
def finger_rotation(hand: HandTable, side: int, style: int, segment: int, closure: float) -> Quaternion:
    """Find the local rotation of a finger joint at a closure from 0, open, to 1, closed."""
    opened = hand.open_rotation[style, side, segment]
    way = hand.sweep[style, side, segment]
    turn = from_rotation_vector((closure * way[0], closure * way[1], closure * way[2]))
    return multiply((opened[0], opened[1], opened[2], opened[3]), turn)


@kernel
def motion_bound(hand: HandTable, side: int, style: int, finger: int, locked: int, segment: int) -> float:
    """Bound the way that points of a segment's axis make for each unit of closure, in rest proportions, m."""
    first = SEGMENTS * finger
    reach = 0.0
    bound = 0.0
    for part in range(segment, locked - 1, -1):
        reach += hand.length[side, first + part]
        bound += reach * hand.angle[style, side, first + part]
    return bound


@kernel
def relative_frame(
    position: Vector, rotation: Quaternion, frame_position: Vector, frame_rotation: Quaternion
) -> tuple[Vector, Quaternion]:
    """Express a frame in another one that both are given against."""
    back = conjugate(frame_rotation)
    return rotate(back, subtract(position, frame_position)), multiply(back, rotation)


@kernel
def row_vector(rows: Any, row: int) -> Vector:
    """Read a vector of an array (M, 3)."""
    return float(rows[row, 0]), float(rows[row, 1]), float(rows[row, 2])


@kernel
def row_quaternion(rows: Any, row: int) -> Quaternion:
    """Read a rotation of an array (M, 4)."""
    return float(rows[row, 0]), float(rows[row, 1]), float(rows[row, 2]), float(rows[row, 3])
