"""Fingers written into poses by their closure, and objects that follow hands."""

from typing import Any

from crowd_kernels._jit import parallel_kernel, prange
from crowd_kernels.grasp import CHUNKS
from crowd_kernels.hand import (
    FINGERS,
    SEGMENTS,
    HandTable,
    finger_rotation,
    relative_frame,
    row_quaternion,
    row_vector,
)
from crowd_kernels.pose import joint_rotation, set_joint_rotation
from crowd_kernels.quaternion import from_yaw, multiply, nlerp, normalized, rotate
from crowd_kernels.vector import add

WHOLE = 1.0 - 1e-6
"""A share above this leaves nothing of the pose below."""


@parallel_kernel
def pose_hands(
    hand: HandTable,
    character: Any,
    side: Any,
    style: Any,
    weight: Any,
    finger_closure: Any,
    pose_rotation: Any,
) -> None:
    """Mix the fingers of many hands into their poses.

    Parameters
    ----------
    hand : HandTable
    character : (A,) int32
        Whose hands; all hands of a character stand together.
    side : (A,) int32
        0 right, 1 left.
    style : (A,) int32
        Style of the grip.
    weight : (A,) float64
        Share of the hand's own pose, 0 to 1.
    finger_closure : (N, 2, 15) float32
        0 open to 1 closed.
    pose_rotation : (N, 256) float32
        In and out: pose rows; the finger joints are written.

    Notes
    -----
    **Source:** Feng, Xu, Shapiro 2012, section 5.3: fingers between an open and a closed pose.
    """
    count = character.shape[0]
    for k in prange(CHUNKS):
        chunk = (k * 37) % CHUNKS
        for row in range(chunk * count // CHUNKS, (chunk + 1) * count // CHUNKS):
            pose = pose_rotation[character[row]]
            closure = finger_closure[character[row], side[row]]
            share = weight[row]
            for segment in range(FINGERS * SEGMENTS):
                joint = hand.joint[side[row], segment]
                turned = finger_rotation(hand, side[row], style[row], segment, float(closure[segment]))
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
