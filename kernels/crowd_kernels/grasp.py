"""How far fingers close before they touch an object."""

from typing import Any

from crowd_kernels._jit import kernel, parallel_kernel, prange
from crowd_kernels.capsule import ShapeTable, segment_shape
from crowd_kernels.hand import (
    FINGERS,
    SEGMENTS,
    HandTable,
    motion_bound,
    relative_frame,
    row_quaternion,
    row_vector,
    segment_end,
)
from crowd_kernels.quaternion import Quaternion
from crowd_kernels.vector import Vector

CHUNKS = 32
GRAZE = 4e-4
"""Depth at which a segment that closes may pass by an edge, m."""
TOUCH = 5e-5
"""Gap that is left at a contact, m."""
HORIZON = 0.08
"""Largest step of a closure."""
FAR = 1e6
ALL_SEGMENTS = 7
MOST_ADVANCES = 256
MOST_REFINEMENTS = 12


@kernel
def locked_segments(contact: Any, finger: int) -> int:
    """Count the segments of a finger that are locked: the outermost one that touches, and its parents."""
    first = SEGMENTS * finger
    for segment in range(SEGMENTS - 1, -1, -1):
        if contact[first + segment] != 0:
            return segment + 1
    return 0


@kernel
def survey_finger(
    hand: HandTable, side: int, style: int, scale: float, finger: int, rotation: Quaternion,
    position: Vector, table: ShapeTable, item: int, closure: Any, locked: int, now: float, horizon: float,
    watched: int,
) -> tuple[float, int, float]:  # fmt: skip
    """Look how near the free segments of a finger are to the object, and how far they may close on.

    Parameters
    ----------
    closure : (15,) float
        Of the locked joints.
    locked : int
        Segments that are locked, 0 to 2.
    now : float
        Closure of the free joints.
    horizon : float
        Largest step of interest.
    watched : int
        Bits of the segments that are looked at.

    Returns
    -------
    gap : float
        Least gap of a watched free segment, m; negative inside.
    inside : int
        Bits of those that are inside the object.
    step : float
        No free segment gets deeper than `GRAZE` in a step of this size that ends outside.

    Notes
    -----
    All other arguments are those of `close_finger`.
    """
    least = FAR
    inside = 0
    step = horizon
    turned = rotation
    end = position
    for part in range(SEGMENTS):
        segment = SEGMENTS * finger + part
        share = now if part >= locked else float(closure[segment])
        turned, start, tip = segment_end(hand, side, style, scale, segment, share, turned, end)
        end = start
        if part < locked or not watched & (1 << part):
            continue
        bound = scale * motion_bound(hand, side, style, finger, locked, part)
        radius = scale * hand.radius[segment]
        gap = segment_shape(start, tip, table, item, radius + bound * step) - radius
        least = min(least, gap)
        if gap < 0.0:
            inside |= 1 << part
        step = min(step, max(gap + 2.0 * GRAZE, GRAZE) / bound)
    return least, inside, step


@kernel
def first_contact(
    hand: HandTable, side: int, style: int, scale: float, finger: int, rotation: Quaternion,
    position: Vector, table: ShapeTable, item: int, closure: Any, locked: int, now: float, ahead: float,
    inside: int,
) -> tuple[float, int]:  # fmt: skip
    """Find where free segments enter the object between two closures.

    Parameters
    ----------
    now : float
        Closure at which none is inside.
    ahead : float
        Closure at which some are.
    inside : int
        Bits of these.

    Returns
    -------
    closure : float
        Just outside.
    inside : int
        Bits of the segments that enter first.

    Notes
    -----
    All other arguments are those of `survey_finger`. **Source:** the Illinois rule (Dowell and Jarratt 1971).
    """
    span = ahead - now
    gap, _, _ = survey_finger(
        hand, side, style, scale, finger, rotation, position, table, item, closure, locked, now, span, inside
    )
    gap_ahead, _, _ = survey_finger(
        hand, side, style, scale, finger, rotation, position, table, item, closure, locked, ahead, span,
        inside,
    )  # fmt: skip
    for _ in range(MOST_REFINEMENTS):
        if gap <= TOUCH:
            break
        middle = now + (ahead - now) * min(max(gap / (gap - gap_ahead), 0.05), 0.95)
        found_gap, found, _ = survey_finger(
            hand, side, style, scale, finger, rotation, position, table, item, closure, locked, middle, span,
            inside,
        )  # fmt: skip
        if found & inside:
            ahead = middle
            gap_ahead = found_gap
            inside = found & inside
        else:
            now = middle
            gap = found_gap
            gap_ahead *= 0.5
    return now, inside


@kernel
def close_finger(
    hand: HandTable, side: int, style: int, scale: float, finger: int, rotation: Quaternion,
    position: Vector, table: ShapeTable, item: int, closure: Any, contact: Any,
) -> None:  # fmt: skip
    """Close one finger until its segments touch the object, or all the way.

    A segment that touches stops with all joints before it; those farther out go on.

    Parameters
    ----------
    hand : HandTable
    side, style : int
    scale : float
        Of the character's hand.
    finger : int
        0 (thumb) to 4.
    rotation, position : tuple of float
        Hand joint in the object's frame; m.
    table : ShapeTable
    item : int
        Row of the object.
    closure : (15,) float
        In: where the finger is now. Out: where it ends.
    contact : (15,) uint8
        In and out: 1 where the segment touches.

    Notes
    -----
    **Source:** Feng, Xu, Shapiro 2012, section 5.3: the segment in contact and its parents are locked.
    **Differs from the source:** the whole way is looked at before the finger moves, in steps as long as gap
    and speed of the segments allow (conservative advancement, Mirtich 1996), with the first contact found by
    the Illinois rule from outside: the end does not depend on the frame rate, and nothing is inside.
    """
    first = SEGMENTS * finger
    locked = locked_segments(contact, finger)
    now = float(closure[first + SEGMENTS - 1])
    if locked == SEGMENTS or now >= 1.0:
        return
    _, inside, step = survey_finger(
        hand, side, style, scale, finger, rotation, position, table, item, closure, locked, now,
        min(1.0 - now, HORIZON), ALL_SEGMENTS,
    )  # fmt: skip
    for _ in range(MOST_ADVANCES):
        if inside == 0:
            if now >= 1.0:
                return
            ahead = min(now + step, 1.0)
            _, inside, step = survey_finger(
                hand, side, style, scale, finger, rotation, position, table, item, closure, locked, ahead,
                min(1.0 - ahead, HORIZON), ALL_SEGMENTS,
            )  # fmt: skip
            if inside == 0:
                now = ahead
            else:
                now, inside = first_contact(
                    hand, side, style, scale, finger, rotation, position, table, item, closure, locked, now,
                    ahead, inside,
                )  # fmt: skip
            for part in range(locked, SEGMENTS):
                closure[first + part] = now
        if inside != 0:
            touching = 2 if inside & 4 else (1 if inside & 2 else 0)
            contact[first + touching] = 1
            locked = touching + 1
            if locked == SEGMENTS:
                return
            _, inside, step = survey_finger(
                hand, side, style, scale, finger, rotation, position, table, item, closure, locked, now,
                min(1.0 - now, HORIZON), ALL_SEGMENTS,
            )  # fmt: skip


@kernel
def finger_gap(
    hand: HandTable, side: int, style: int, scale: float, finger: int, rotation: Quaternion,
    position: Vector, table: ShapeTable, item: int, cutoff: float, closure: Any,
) -> float:  # fmt: skip
    """Find the least gap between a finger and the object, m; negative inside. See `close_finger`."""
    gap = cutoff
    turned = rotation
    end = position
    for part in range(SEGMENTS):
        segment = SEGMENTS * finger + part
        turned, start, tip = segment_end(
            hand, side, style, scale, segment, float(closure[segment]), turned, end
        )
        end = start
        radius = scale * hand.radius[segment]
        gap = min(gap, segment_shape(start, tip, table, item, radius + cutoff) - radius)
    return gap


@parallel_kernel
def close_hands(
    hand: HandTable,
    table: ShapeTable,
    character: Any,
    side: Any,
    style: Any,
    item: Any,
    scale: Any,
    hand_position_world: Any,
    hand_rotation_world: Any,
    object_position_world: Any,
    object_rotation_world: Any,
    finger_closure: Any,
    finger_contact: Any,
) -> None:
    """Find how far the fingers of many hands close on their objects.

    Parameters
    ----------
    hand : HandTable
    table : ShapeTable
    character : (A,) int32
        Whose hands; a character may appear once with each hand.
    side : (A,) int32
        `RIGHT` or `LEFT`.
    style : (A,) int32
        `POWER` or `PINCH`.
    item : (A,) int32
        Rows of the objects.
    scale : (A,) float64
        Of the characters' hands.
    hand_position_world : (A, 3) float64
        Hand joints, m.
    hand_rotation_world : (A, 4) float64
    object_position_world : (M, 3) float64
        m.
    object_rotation_world : (M, 4) float64
    finger_closure : (N, 2, 15) float32
        In: closure of each finger joint now, 0 to 1. Out: where it ends.
    finger_contact : (N, 2, 15) uint8
        In and out: 1 where a segment touches.

    Notes
    -----
    **Source:** see `close_finger`.
    """
    count = character.shape[0]
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
            closure = finger_closure[character[row], side[row]]
            contact = finger_contact[character[row], side[row]]
            for finger in range(FINGERS):
                close_finger(
                    hand, side[row], style[row], scale[row], finger, rotation, position, table, thing,
                    closure, contact,
                )  # fmt: skip


@parallel_kernel
def measure_gaps(
    hand: HandTable,
    table: ShapeTable,
    side: Any,
    style: Any,
    item: Any,
    scale: Any,
    hand_position_world: Any,
    hand_rotation_world: Any,
    object_position_world: Any,
    object_rotation_world: Any,
    closure: Any,
    cutoff: float,
    out_gap: Any,
) -> None:
    """Measure the gap between fingers and objects.

    Parameters
    ----------
    hand, table, side, style, item, scale, hand_position_world, hand_rotation_world, object_position_world, \
object_rotation_world
        See `close_hands`.
    closure : (A, 15) float32
        0 to 1.
    cutoff : float
        Greatest gap of interest, m.
    out_gap : (A, 5) float64
        Least gap of each finger's segments, at most `cutoff`; negative inside, m.

    Notes
    -----
    **Source:** none.
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
            for finger in range(FINGERS):
                out_gap[row, finger] = finger_gap(
                    hand, side[row], style[row], scale[row], finger, rotation, position, table, thing,
                    cutoff, closure[row],
                )  # fmt: skip
