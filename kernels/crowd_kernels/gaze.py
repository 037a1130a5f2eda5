"""Gaze: eyes, head, neck, chest and waist share the turn towards a target, over the pose of other layers."""

import math
from typing import Any

import numpy as np

from crowd_kernels._jit import IS_THREADED, inlined_kernel, kernel, parallel_kernel, prange
from crowd_kernels.gaze_chain import (
    GazeArrays,
    GazeLimits,
    gather_gaze,
    gather_root,
    scatter_gaze,
    turn_block,
)
from crowd_kernels.gaze_rows import (
    CARRY_ROW,
    ERROR,
    EXCESS,
    EYE_ROW,
    GOAL,
    SUM,
    WEIGHT,
    WEIGHT_RATE,
)
from crowd_kernels.lanes import LANES
from crowd_kernels.polynomial import ONE, ZERO
from crowd_kernels.pose import child_joint, joint_rotation
from crowd_kernels.quaternion import from_yaw, rotate
from crowd_kernels.vector import add

CHUNKS = 32

NOTHING, POINT, CHARACTER, OBJECT = 0, 1, 2, 3
"""Kinds of targets."""
IDLE, TURNING, ON_TARGET, OUT_OF_REACH, REFUSED = 0, 1, 2, 3, 4
"""What has become of a gaze."""
ON_TARGET_ERROR = np.float32(np.radians(1.0))
FADED_WEIGHT, FADED_TURN, RESTING_WEIGHT = 1e-3, 1e-3, 1e-6
"""A gaze is over below this weight and this sum of turns, rad; before, its weight stays above nothing."""


@kernel
def split_gazing(
    active: Any, kind: Any, weight: Any, saccade: Any, out_turned: Any, out_resting: Any
) -> tuple[int, int]:
    """List who is turned by gaze, and who only moves the eyes.

    Parameters
    ----------
    active : (A,) int32
        Characters, each once; 0 to N - 1.
    kind : (N,) uint8
        0 for nobody to look at.
    weight : (N,) float32
        Share of the gaze in the pose.
    saccade : (N, 2) float32
        Turn of the eyes, rad.
    out_turned : (>= A,) int32
        Written: characters who look at something, or whose turn is fading.
    out_resting : (>= A,) int32
        Written: others whose eyes are beside their middle.

    Returns
    -------
    tuple of int
        How many there are of both.
    """
    turned, resting = 0, 0
    for index in range(active.shape[0]):
        character = active[index]
        if kind[character] != NOTHING or weight[character] > ZERO:
            out_turned[turned] = character
            turned += 1
        elif saccade[character, 0] != ZERO or saccade[character, 1] != ZERO:
            out_resting[resting] = character
            resting += 1
    return turned, resting


@kernel
def gaze_chunk(
    arrays: GazeArrays,
    limits: GazeLimits,
    segment_scale: Any,
    position_world: Any,
    yaw: Any,
    trunk: Any,
    follow: Any,
    kind: Any,
    target_world: Any,
    saccade: Any,
    active: Any,
    dt: float,
    begin: int,
    end: int,
    scratch: Any,
    pose_rotation: Any,
    pose_pelvis: Any,
    turn: Any,
    turn_rate: Any,
    eye_turn: Any,
    weight: Any,
    weight_rate: Any,
    out_error: Any,
    out_status: Any,
) -> None:
    """Turn one run of blocks of 16 active characters.

    Parameters
    ----------
    begin, end : int
        Range of blocks.
    scratch : (scratch_length(K),) float32
        Row of this chunk.

    Notes
    -----
    All other arguments are those of `gaze_crowd`.
    """
    count = active.shape[0]
    carry = scratch[:CARRY_ROW]
    eyes = scratch[CARRY_ROW : CARRY_ROW + 2 * EYE_ROW]
    joints = scratch[CARRY_ROW + 2 * EYE_ROW :]
    for block in range(begin, end):
        first = block * LANES
        gather_root(
            arrays,
            segment_scale,
            position_world,
            yaw,
            trunk,
            follow,
            kind,
            target_world,
            pose_pelvis,
            weight,
            weight_rate,
            active,
            first,
            carry,
        )
        gather_gaze(
            arrays,
            segment_scale,
            pose_rotation,
            turn,
            turn_rate,
            eye_turn,
            saccade,
            active,
            first,
            carry,
            eyes,
            joints,
        )
        turn_block(arrays, limits, dt, carry, eyes, joints)
        scatter_gaze(arrays, active, first, carry, eyes, joints, pose_rotation, turn, turn_rate, eye_turn)
        for lane in range(min(LANES, count - first)):
            character = active[first + lane]
            weight[character] = carry[WEIGHT + lane]
            weight_rate[character] = carry[WEIGHT_RATE + lane]
            error = max(eyes[ERROR + lane], eyes[EYE_ROW + ERROR + lane])
            out_error[character] = error if carry[GOAL + lane] > ZERO else ZERO
            if kind[character] == NOTHING:
                out_status[character] = IDLE
                if weight[character] < FADED_WEIGHT and carry[SUM + lane] < FADED_TURN:
                    weight[character] = ZERO
                    weight_rate[character] = ZERO
                    turn[character, :] = ZERO
                    turn_rate[character, :] = ZERO
                    eye_turn[character, :] = ZERO
                else:
                    weight[character] = max(weight[character], RESTING_WEIGHT)
            elif carry[GOAL + lane] < ZERO:
                out_status[character] = REFUSED
            elif error <= ON_TARGET_ERROR:
                out_status[character] = ON_TARGET
            elif carry[EXCESS + lane] > ONE:
                out_status[character] = OUT_OF_REACH
            else:
                out_status[character] = TURNING


@parallel_kernel
def gaze_crowd(
    arrays: GazeArrays,
    limits: GazeLimits,
    segment_scale: Any,
    position_world: Any,
    yaw: Any,
    trunk: Any,
    follow: Any,
    kind: Any,
    target_world: Any,
    saccade: Any,
    active: Any,
    dt: float,
    scratch: Any,
    pose_rotation: Any,
    pose_pelvis: Any,
    turn: Any,
    turn_rate: Any,
    eye_turn: Any,
    weight: Any,
    weight_rate: Any,
    out_error: Any,
    out_status: Any,
) -> None:
    """Turn trunk, neck, head and eyes towards targets.

    Parameters
    ----------
    arrays : GazeArrays
    limits : GazeLimits
    segment_scale : (N, G) float32
        Proportions.
    position_world : (N, 3) float64
        Root, m.
    yaw : (N,) float64
        Heading, rad.
    trunk : (N,) float32
        Share of the trunk that takes part, 0 to 1.
    follow : (N,) float32
        How readily joints follow, 0 to 1; less lets gestures move the head, while the eyes stay on target.
    kind : (N,) uint8
        0: look at nothing, any turn that is left fades; else there is a target.
    target_world : (N, 3) float64
        Target, m; refused where it is not finite, within 0.1 m of the eyes, or 1,000 km away.
    saccade : (N, 2) float32
        Added to the turn of both eyes about x and y, within their limits, rad.
    active : (A,) int32
        Characters to process, each once; 0 to N - 1.
    dt : float
        s.
    scratch : (32, scratch_length(K)) float32
        One row for each chunk.
    pose_rotation : (N, 256) float32
        In and out: joints of the chain and eyes are turned.
    pose_pelvis : (N, 3) float32
        Pelvis in the root frame at leg scale 1, m; not changed.
    turn, turn_rate : (N, 3 K) float32
        In and out: rotation vector that gaze adds to each joint, in the joint's frame, and its rate; rad,
        rad/s.
    eye_turn : (N, 4) float32
        In and out: turn about x and y of the left and the right eye, rad.
    weight, weight_rate : (N,) float32
        In and out: share of the gaze in the body's pose, 0 to 1, and its rate, 1/s; 0 once all turns have
        faded.
    out_error : (N,) float32
        Largest angle between an eye's ray without saccade and its target, rad; 0 without one.
    out_status : (N,) uint8
        0 no target, 1 turning, 2 on target (both rays within 1 degree), 3 out of reach of all limits
        together, 4 refused.

    Notes
    -----
    **Source:** Feng, Xu, Shapiro, section 6; Thiebaux, Lance, Marsella, "Real-time expressive gaze animation
    for virtual humans", 2009: shares of what is missing, limits, bias, speeds.
    **Differs from the source:** joints swing as critically damped springs instead of exponential smoothing,
    which would start with a jump in speed; heads stay level; eyes are aimed exactly after the body has
    turned.
    """
    block_count = (active.shape[0] + LANES - 1) // LANES
    for k in prange(CHUNKS):
        chunk = (k * 37) % CHUNKS
        gaze_chunk(
            arrays,
            limits,
            segment_scale,
            position_world,
            yaw,
            trunk,
            follow,
            kind,
            target_world,
            saccade,
            active,
            dt,
            chunk * block_count // CHUNKS,
            (chunk + 1) * block_count // CHUNKS,
            scratch[chunk if IS_THREADED else 0],
            pose_rotation,
            pose_pelvis,
            turn,
            turn_rate,
            eye_turn,
            weight,
            weight_rate,
            out_error,
            out_status,
        )


@inlined_kernel
def eyes_of(
    arrays: GazeArrays, scale: Any, place: Any, yaw: float, pose: Any, pelvis: Any
) -> tuple[float, float, float]:
    """Find the point between the eyes of one character, m; arguments are its rows of `eye_point_crowd`."""
    leg = float(scale[arrays.leg_segment])
    position = (float(pelvis[0]) * leg, float(pelvis[1]) * leg, float(pelvis[2]) * leg)
    rotation = joint_rotation(pose, 0)
    for k in range(arrays.joint.shape[0]):
        size = float(scale[arrays.segment[k]])
        offset = (
            arrays.offset[k, 0] * size,
            arrays.offset[k, 1] * size,
            arrays.offset[k, 2] * size,
        )
        rotation, position = child_joint(rotation, position, offset, joint_rotation(pose, arrays.joint[k]))
    size = 0.5 * float(scale[arrays.eye_segment[0]])
    between = (
        (arrays.eye_offset[0, 0] + arrays.eye_offset[1, 0]) * size,
        (arrays.eye_offset[0, 1] + arrays.eye_offset[1, 1]) * size,
        (arrays.eye_offset[0, 2] + arrays.eye_offset[1, 2]) * size,
    )
    eyes = rotate(from_yaw(yaw), add(position, rotate(rotation, between)))
    return eyes[0] + place[0], eyes[1] + place[1], eyes[2] + place[2]


@parallel_kernel
def eye_point_crowd(
    arrays: GazeArrays,
    segment_scale: Any,
    position_world: Any,
    yaw: Any,
    pose_rotation: Any,
    pose_pelvis: Any,
    is_active: Any,
    index: Any,
    active: Any,
    out_target_world: Any,
) -> None:
    """Aim characters at the eyes of other characters.

    Parameters
    ----------
    arrays : GazeArrays
    segment_scale : (N, G) float32
        Proportions.
    position_world : (N, 3) float64
        Root, m.
    yaw : (N,) float64
        Heading, rad.
    pose_rotation : (N, 256) float32
        Pose rows, before anybody's gaze.
    pose_pelvis : (N, 3) float32
        Pelvis in the root frame at leg scale 1, m.
    is_active : (N,) bool
        The row holds somebody who can be looked at.
    index : (N,) int32
        Who is looked at.
    active : (A,) int32
        Characters who look at others, each once; 0 to N - 1.
    out_target_world : (N, 3) float64
        Written in rows of `active`: point between the eyes, m; NaN where nobody is there or it is oneself.

    Notes
    -----
    **Source:** forward kinematics of the chain from pelvis to head.
    """
    count = active.shape[0]
    for k in prange(CHUNKS):
        chunk = (k * 37) % CHUNKS
        for place in range(chunk * count // CHUNKS, (chunk + 1) * count // CHUNKS):
            character = active[place]
            other = index[character]
            is_there = 0 <= other < is_active.shape[0] and other != character
            if is_there and is_active[other]:
                x, y, z = eyes_of(
                    arrays,
                    segment_scale[other],
                    position_world[other],
                    yaw[other],
                    pose_rotation[other],
                    pose_pelvis[other],
                )
            else:
                x, y, z = math.nan, math.nan, math.nan
            out_target_world[character, 0] = x
            out_target_world[character, 1] = y
            out_target_world[character, 2] = z
