"""The chain from waist to eyes: its numbers, and one step of a block of 16 characters."""

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from crowd_kernels._jit import inlined_kernel, kernel
from crowd_kernels.clip import PADDED_JOINTS
from crowd_kernels.gaze_rows import (
    AHEAD,
    CARRY_ROW,
    EYE,
    EYE_ROW,
    EYE_SCALE,
    FOLLOW,
    GOAL,
    JOINT_ROW,
    OFFSET,
    POSITION,
    RATE,
    ROTATION,
    SCALE,
    SIDE,
    SUM,
    TARGET,
    TRUNK,
    TURN,
    WEIGHT,
    WEIGHT_RATE,
    aim_eye_row,
    aim_joint_row,
    begin_row,
    excess_row,
    look_back_row,
    settle_row,
    swing_row,
    turn_eye_row,
)
from crowd_kernels.lanes import LANES
from crowd_kernels.polynomial import ONE, ZERO, sine_cosine

TURNED = np.float32(0.1)
"""From this turn on people keep to the side that they have turned to, rad."""


class GazeArrays(NamedTuple):
    """The joints from waist to head and both eyes, as the kernel reads them. Angles in rad."""

    joint: npt.NDArray[np.int32]
    """(K,) Joints of the chain, each the parent of the next, from below the pelvis to the head."""
    offset: npt.NDArray[np.float32]
    """(K, 3) Their rest offsets, m."""
    segment: npt.NDArray[np.int32]
    """(K,) Columns of the proportions that stretch the offsets."""
    share: npt.NDArray[np.float32]
    """(K,) Relative parts in the turn; all equal: equal parts of the whole."""
    is_trunk: npt.NDArray[np.bool_]
    """(K,) The joint's part depends on the character's posture."""
    limit: npt.NDArray[np.float32]
    """(K, 3) Largest turn about x (pitch), y (heading), z (roll)."""
    bias: npt.NDArray[np.float32]
    """(K, 3) Turn that is added: posture, such as a bowed head."""
    rate: npt.NDArray[np.float32]
    """(K,) Natural frequency of the joint's motion, 1/s."""
    eye: npt.NDArray[np.int32]
    """(2,) Joints of the eyes, children of the head."""
    eye_offset: npt.NDArray[np.float32]
    """(2, 3) Their rest offsets, m."""
    eye_segment: npt.NDArray[np.int32]
    """(2,) Columns of the proportions."""
    leg_segment: int
    """Column that stretches the pelvis position."""


class GazeLimits(NamedTuple):
    """Limits of the eyes, speeds and times. float32."""

    eye_share: Any
    """Relative part of the eyes in the turn, > 0."""
    eye_pitch: Any
    """Largest turn of an eye up or down, rad."""
    eye_heading: Any
    """Largest turn of an eye to a side, rad."""
    eye_speed: Any
    """Largest speed of an eye against the head, apart from saccades, rad/s."""
    head_speed: Any
    """Largest speed of the head by gaze, which all joints share, rad/s."""
    fade_rate: Any
    """Natural frequency with which gaze comes and goes, 1/s."""


def scratch_length(joint_count: int) -> int:
    """Number of float32 in one chunk's scratch row for `gaze_crowd` and a chain of `joint_count` joints."""
    return joint_count * JOINT_ROW + 2 * EYE_ROW + CARRY_ROW + JOINT_ROW


@inlined_kernel
def gather_root(
    arrays: GazeArrays,
    segment_scale: Any,
    position_world: Any,
    yaw: Any,
    trunk: Any,
    follow: Any,
    kind: Any,
    target_world: Any,
    pose_pelvis: Any,
    weight: Any,
    weight_rate: Any,
    active: Any,
    first: int,
    carry: Any,
) -> None:
    """Write pelvis, target in the root frame, and weight of 16 characters.

    Parameters
    ----------
    first : int
        Place in `active` of the first lane.
    carry : (CARRY_ROW,) float32
        Written.

    Notes
    -----
    All other arguments are those of `gaze_crowd`.
    """
    last = active.shape[0] - 1
    for lane in range(LANES):
        character = active[min(first + lane, last)]
        carry[SIDE + lane] = yaw[character]
        carry[TARGET + lane] = target_world[character, 0] - position_world[character, 0]
        carry[TARGET + LANES + lane] = target_world[character, 1]
        carry[TARGET + 2 * LANES + lane] = target_world[character, 2] - position_world[character, 2]
        leg = segment_scale[character, arrays.leg_segment]
        for axis in range(3):
            carry[POSITION + axis * LANES + lane] = pose_pelvis[character, axis] * leg
        carry[GOAL + lane] = ONE if kind[character] > 0 else ZERO
        carry[TRUNK + lane] = trunk[character]
        carry[FOLLOW + lane] = follow[character]
        carry[WEIGHT + lane] = weight[character]
        carry[WEIGHT_RATE + lane] = weight_rate[character]
    for lane in range(LANES):
        sine, cosine = sine_cosine(carry[SIDE + lane])
        x, z = carry[TARGET + lane], carry[TARGET + 2 * LANES + lane]
        carry[TARGET + lane] = cosine * x - sine * z
        carry[TARGET + 2 * LANES + lane] = sine * x + cosine * z


@inlined_kernel
def gather_gaze(
    arrays: GazeArrays,
    segment_scale: Any,
    pose_rotation: Any,
    turn: Any,
    turn_rate: Any,
    eye_turn: Any,
    saccade: Any,
    active: Any,
    first: int,
    carry: Any,
    eyes: Any,
    joints: Any,
) -> None:
    """Write pelvis rotation, chain and eyes of 16 characters.

    Parameters
    ----------
    first : int
        Place in `active` of the first lane.
    carry, eyes, joints
        Rows of the block, written.

    Notes
    -----
    All other arguments are those of `gaze_crowd`.
    """
    last = active.shape[0] - 1
    for lane in range(LANES):
        character = active[min(first + lane, last)]
        for component in range(4):
            carry[ROTATION + component * LANES + lane] = pose_rotation[character, component * PADDED_JOINTS]
        heading = ZERO
        for place in range(arrays.joint.shape[0]):
            at = place * JOINT_ROW + lane
            joint = arrays.joint[place]
            for component in range(4):
                value = pose_rotation[character, component * PADDED_JOINTS + joint]
                joints[at + ROTATION + component * LANES] = value
            for axis in range(3):
                joints[at + TURN + axis * LANES] = turn[character, 3 * place + axis]
                joints[at + RATE + axis * LANES] = turn_rate[character, 3 * place + axis]
            joints[at + SCALE] = segment_scale[character, arrays.segment[place]]
            heading += turn[character, 3 * place + 1]
        side = ONE if heading > ZERO else -ONE
        carry[SIDE + lane] = side if abs(heading) > TURNED else ZERO
        for eye in range(2):
            at = eye * EYE_ROW + lane
            joint = arrays.eye[eye]
            for component in range(4):
                value = pose_rotation[character, component * PADDED_JOINTS + joint]
                eyes[at + ROTATION + component * LANES] = value
            for axis in range(2):
                eyes[at + TURN + axis * LANES] = eye_turn[character, 2 * eye + axis]
                eyes[at + OFFSET + axis * LANES] = saccade[character, axis]
            eyes[at + EYE_SCALE] = segment_scale[character, arrays.eye_segment[eye]]


@inlined_kernel
def scatter_gaze(
    arrays: GazeArrays,
    active: Any,
    first: int,
    carry: Any,
    eyes: Any,
    joints: Any,
    out_pose_rotation: Any,
    out_turn: Any,
    out_turn_rate: Any,
    out_eye_turn: Any,
) -> None:
    """Write chain and eyes back, and sum up all turns that gaze holds into `SUM`; arguments as above."""
    for lane in range(min(LANES, active.shape[0] - first)):
        character = active[first + lane]
        held = ZERO
        for place in range(arrays.joint.shape[0]):
            at = place * JOINT_ROW + lane
            joint = arrays.joint[place]
            for component in range(4):
                value = joints[at + ROTATION + component * LANES]
                out_pose_rotation[character, component * PADDED_JOINTS + joint] = value
            for axis in range(3):
                value = joints[at + TURN + axis * LANES]
                out_turn[character, 3 * place + axis] = value
                out_turn_rate[character, 3 * place + axis] = joints[at + RATE + axis * LANES]
                held += abs(value)
        for eye in range(2):
            at = eye * EYE_ROW + lane
            joint = arrays.eye[eye]
            for component in range(4):
                value = eyes[at + ROTATION + component * LANES]
                out_pose_rotation[character, component * PADDED_JOINTS + joint] = value
            for axis in range(2):
                value = eyes[at + TURN + axis * LANES]
                out_eye_turn[character, 2 * eye + axis] = value
                held += abs(value)
        carry[SUM + lane] = held


@kernel
def turn_block(arrays: GazeArrays, limits: GazeLimits, dt: float, carry: Any, eyes: Any, joints: Any) -> None:
    """Turn the 16 characters of a block.

    Parameters
    ----------
    arrays : GazeArrays
    limits : GazeLimits
    dt : float
        s.
    carry : (CARRY_ROW,) float32
        In and out.
    eyes : (2 * EYE_ROW,) float32
        In and out.
    joints : ((K + 1) * JOINT_ROW,) float32
        In and out; the last row is the pelvis.

    Notes
    -----
    **Source:** the chain of Thiebaux, Lance, Marsella, "Real-time expressive gaze animation for virtual
    humans", 2009.
    """
    count = arrays.joint.shape[0]
    step = np.float32(dt)
    head = joints[(count - 1) * JOINT_ROW : count * JOINT_ROW]
    pelvis = joints[count * JOINT_ROW :]
    eye_x = np.float32(0.5) * (arrays.eye_offset[0, 0] + arrays.eye_offset[1, 0])
    eye_y = np.float32(0.5) * (arrays.eye_offset[0, 1] + arrays.eye_offset[1, 1])
    eye_z = np.float32(0.5) * (arrays.eye_offset[0, 2] + arrays.eye_offset[1, 2])
    for lane in range(LANES):
        head[AHEAD + lane] = ZERO
        head[AHEAD + LANES + lane] = ZERO
        head[AHEAD + 2 * LANES + lane] = ONE
        head[EYE + lane] = eye_x * eyes[EYE_SCALE + lane]
        head[EYE + LANES + lane] = eye_y * eyes[EYE_SCALE + lane]
        head[EYE + 2 * LANES + lane] = eye_z * eyes[EYE_SCALE + lane]
        carry[SUM + lane] = limits.eye_share
    for place in range(count - 1, -1, -1):
        above = joints[(place - 1) * JOINT_ROW : place * JOINT_ROW] if place > 0 else pelvis
        look_back_row(
            joints[place * JOINT_ROW : (place + 1) * JOINT_ROW],
            carry,
            arrays.offset[place, 0],
            arrays.offset[place, 1],
            arrays.offset[place, 2],
            arrays.share[place],
            arrays.is_trunk[place],
            above,
        )
    decay = np.float32(math.exp(-limits.fade_rate * dt))
    begin_row(pelvis, carry, limits.fade_rate, decay, step)
    # The pelvis as it is, to which the second walk along the chain returns.
    for component in range(7 * LANES):
        pelvis[component] = carry[component]
    for place in range(count):
        row = joints[place * JOINT_ROW : (place + 1) * JOINT_ROW]
        aim_joint_row(
            row,
            carry,
            arrays.offset[place, 0],
            arrays.offset[place, 1],
            arrays.offset[place, 2],
            arrays.limit[place, 0],
            arrays.limit[place, 1],
            arrays.limit[place, 2],
            arrays.bias[place, 0],
            arrays.bias[place, 1],
            arrays.bias[place, 2],
        )
    excess_row(eye_x, eye_y, eye_z, eyes, limits.eye_pitch, limits.eye_heading, carry)
    for place in range(count):
        decay = np.float32(math.exp(-arrays.rate[place] * dt))
        swing_row(joints[place * JOINT_ROW : (place + 1) * JOINT_ROW], carry, arrays.rate[place], decay, step)
    for component in range(7 * LANES):
        carry[component] = pelvis[component]
    for place in range(count):
        row = joints[place * JOINT_ROW : (place + 1) * JOINT_ROW]
        settle_row(
            row,
            carry,
            arrays.offset[place, 0],
            arrays.offset[place, 1],
            arrays.offset[place, 2],
            limits.head_speed,
        )
    for side in range(2):
        eye = eyes[side * EYE_ROW : (side + 1) * EYE_ROW]
        aim_eye_row(
            eye,
            carry,
            arrays.eye_offset[side, 0],
            arrays.eye_offset[side, 1],
            arrays.eye_offset[side, 2],
            limits.eye_pitch,
            limits.eye_heading,
            limits.eye_speed * step,
        )
        turn_eye_row(eye, limits.eye_pitch, limits.eye_heading)
