"""Fingers written into poses by their closure, and objects that follow hands."""

from typing import Any

import numpy as np

from crowd_kernels._jit import IS_THREADED, inlined_kernel, parallel_kernel, prange
from crowd_kernels.easing import minimum_jerk
from crowd_kernels.grasp import CHUNKS
from crowd_kernels.hand import (
    FINGERS,
    SEGMENTS,
    HandTable,
    relative_frame,
    row_quaternion,
    row_vector,
)
from crowd_kernels.ik_layout import put_quaternion, quaternion_at, vector_at
from crowd_kernels.lanes import LANES
from crowd_kernels.polynomial import sine_cosine
from crowd_kernels.pose import joint_rotation, set_joint_rotation
from crowd_kernels.quaternion import from_yaw, multiply, nlerp, normalized, rotate
from crowd_kernels.vector import add

WHOLE = 1.0 - 1e-6
"""A share above this leaves nothing of the pose below."""
FINGER_ROW = 5 * LANES
"""Length of a chunk's scratch row for `pose_hands`: closures and rotations of the segments."""
HALF: Any = np.float32(0.5)
TINY: Any = np.float32(1e-12)


@inlined_kernel
def turn_fingers_row(segments: Any, closure: Any, out_rotation: Any) -> None:
    """Turn all segments of a hand from open to their closures, as `finger_rotation` does one.

    Parameters
    ----------
    segments : (112,) float32
        See `HandTable.segment_lanes`.
    closure : (16,) float32
        0 open to 1 closed.
    out_rotation : (64,) float32
        Local rotations.
    """
    for lane in range(LANES):
        share = closure[lane]
        way = vector_at(segments, 4 * LANES, lane)
        x, y, z = share * way[0], share * way[1], share * way[2]
        angle = np.sqrt(x * x + y * y + z * z + TINY)
        sine, cosine = sine_cosine(HALF * angle)
        scale = sine / angle
        turn = (cosine, x * scale, y * scale, z * scale)
        put_quaternion(out_rotation, 0, lane, multiply(quaternion_at(segments, 0, lane), turn))


@parallel_kernel
def pose_hands(
    hand: HandTable,
    grab_object: Any,
    style: Any,
    change: float,
    active: Any,
    finger_closure: Any,
    scratch: Any,
    weight: Any,
    pose_rotation: Any,
) -> None:
    """Mix the fingers of hands at work into their poses, and let their share rise or fade.

    Parameters
    ----------
    hand : HandTable
    grab_object : (N, 2) int32
        What right and left hand are at; -1 nothing.
    style : (N, 2) int32
        Style of the grip.
    change : float
        By how much the share of a hand rises that is at something, and falls of one that is not.
    active : (A,) int32
        Characters to process, each once.
    finger_closure : (N, 2, 15) float32
        0 open to 1 closed.
    scratch : (32, 80) float32
        One row of `FINGER_ROW` numbers for each chunk.
    weight : (N, 2) float64
        In and out: progress of the hand's own pose from 0 to 1, eased by minimum jerk.
    pose_rotation : (N, 256) float32
        In and out: pose rows; the finger joints of hands with a share are written.

    Notes
    -----
    **Source:** Feng, Xu, Shapiro 2012, section 5.3: fingers between an open and a closed pose.
    """
    count = active.shape[0]
    for k in prange(CHUNKS):
        chunk = (k * 37) % CHUNKS
        own = scratch[chunk if IS_THREADED else 0]
        closure, rotation = own[:LANES], own[LANES:FINGER_ROW]
        for index in range(chunk * count // CHUNKS, (chunk + 1) * count // CHUNKS):
            row = active[index]
            pose = pose_rotation[row]
            for side in range(2):
                is_at_work = grab_object[row, side] >= 0
                if not is_at_work and weight[row, side] <= 0.0:
                    continue
                risen = weight[row, side] + (change if is_at_work else -change)
                weight[row, side] = min(max(risen, 0.0), 1.0)
                share = minimum_jerk(weight[row, side])
                for segment in range(FINGERS * SEGMENTS):
                    closure[segment] = finger_closure[row, side, segment]
                turn_fingers_row(hand.segment_lanes[style[row, side], side], closure, rotation)
                for segment in range(FINGERS * SEGMENTS):
                    joint = hand.joint[side, segment]
                    turned = quaternion_at(rotation, 0, segment)
                    if share < WHOLE:
                        turned = nlerp(joint_rotation(pose, joint), turned, share)
                    set_joint_rotation(pose, joint, turned)


@parallel_kernel
def hands_in_world(
    joint: Any,
    character: Any,
    side: Any,
    position_model: Any,
    rotation_model: Any,
    position_world: Any,
    yaw: Any,
    out_position_world: Any,
    out_rotation_world: Any,
) -> None:
    """Bring hand joints from the root frames of their characters to the world.

    Parameters
    ----------
    joint : (2,) int32
        Joint of the right and of the left hand; or any other pair.
    character : (A,) int32
    side : (A,) int32
        0 or 1.
    position_model : (N, J, 3) float32
        Joints in the root frame, m.
    rotation_model : (N, J, 4) float32
    position_world : (N, 3) float64
        Roots, m.
    yaw : (N,) float64
        rad.
    out_position_world : (A, 3) float64
        m.
    out_rotation_world : (A, 4) float64
        Unit quaternions.

    Notes
    -----
    **Source:** none.
    """
    count = character.shape[0]
    for k in prange(CHUNKS):
        chunk = (k * 37) % CHUNKS
        for row in range(chunk * count // CHUNKS, (chunk + 1) * count // CHUNKS):
            own = character[row]
            at = joint[side[row]]
            turn = from_yaw(yaw[own])
            place = add(row_vector(position_world, own), rotate(turn, row_vector(position_model[own], at)))
            turned = normalized(multiply(turn, row_quaternion(rotation_model[own], at)))
            for axis in range(3):
                out_position_world[row, axis] = place[axis]
            for axis in range(4):
                out_rotation_world[row, axis] = turned[axis]


@parallel_kernel
def compose_frames(
    position: Any, rotation: Any, inner_position: Any, inner_rotation: Any, is_inverse: bool,
    out_position: Any, out_rotation: Any,
) -> None:  # fmt: skip
    """Chain frames, or express frames in others.

    Parameters
    ----------
    position : (A, 3) float64
        Outer frames, m.
    rotation : (A, 4) float64
    inner_position : (A, 3) float64
        Frames in the outer ones; with `is_inverse` beside them, m.
    inner_rotation : (A, 4) float64
    is_inverse : bool
        Express the second frames in the first ones instead.
    out_position : (A, 3) float64
        m.
    out_rotation : (A, 4) float64
        Unit quaternions.

    Notes
    -----
    **Source:** none.
    """
    count = position.shape[0]
    for k in prange(CHUNKS):
        chunk = (k * 37) % CHUNKS
        for row in range(chunk * count // CHUNKS, (chunk + 1) * count // CHUNKS):
            outer = row_quaternion(rotation, row)
            inner = row_vector(inner_position, row)
            turned = row_quaternion(inner_rotation, row)
            if is_inverse:
                place, turn = relative_frame(inner, turned, row_vector(position, row), outer)
            else:
                place = add(row_vector(position, row), rotate(outer, inner))
                turn = multiply(outer, turned)
            turn = normalized(turn)
            for axis in range(3):
                out_position[row, axis] = place[axis]
            for axis in range(4):
                out_rotation[row, axis] = turn[axis]
