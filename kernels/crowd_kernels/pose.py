"""Forward kinematics, with sixteen characters as lanes, and access to single joints of a pose.

Inside a block every joint is one flat row: components outermost, 16 lanes each.
"""

from typing import Any

import numpy as np

from crowd_kernels._jit import IS_THREADED, inlined_kernel, kernel, parallel_kernel, prange
from crowd_kernels.clip import PADDED_JOINTS
from crowd_kernels.lanes import COMPONENT, LANES, gather_block, interleave, scatter_block
from crowd_kernels.quaternion import Quaternion, multiply, rotate
from crowd_kernels.vector import Vector

CHUNKS = 32
TWO = np.float32(2.0)


def scratch_length(joint_count: int, segment_count: int) -> int:
    """Length of one chunk's scratch row for `kinematics`.

    Parameters
    ----------
    joint_count : int
        Joints of the skeleton, at most 64.
    segment_count : int
        Columns of the proportions.

    Returns
    -------
    int
        Number of float32.
    """
    return 5 * COMPONENT + (7 * joint_count + segment_count) * LANES


@inlined_kernel
def child_row(
    parent_rotation: Any,
    parent_position: Any,
    local: Any,
    scale: Any,
    x: Any,
    y: Any,
    z: Any,
    out_rotation: Any,
    out_position: Any,
) -> None:
    """Place one joint below its parent for 16 characters.

    Parameters
    ----------
    parent_rotation : (64,) float32
        Unit quaternions in the root frame, components outermost.
    parent_position : (48,) float32
        m, components outermost.
    local : (>= 3088,) float32
        Local rotations of the joint: w from 0, x from 1024, y from 2048, z from 3072.
    scale : (16,) float32
        Proportions of the joint's segment.
    x, y, z : float32
        Rest offset in the parent's frame, m.
    out_rotation : (64,) float32
        Written, as `parent_rotation`.
    out_position : (48,) float32
        Written, as `parent_position`.
    """
    for lane in range(LANES):
        pw = parent_rotation[lane]
        px = parent_rotation[LANES + lane]
        py = parent_rotation[2 * LANES + lane]
        pz = parent_rotation[3 * LANES + lane]
        lw = local[lane]
        lx = local[COMPONENT + lane]
        ly = local[2 * COMPONENT + lane]
        lz = local[3 * COMPONENT + lane]
        out_rotation[lane] = pw * lw - px * lx - py * ly - pz * lz
        out_rotation[LANES + lane] = pw * lx + px * lw + py * lz - pz * ly
        out_rotation[2 * LANES + lane] = pw * ly - px * lz + py * lw + pz * lx
        out_rotation[3 * LANES + lane] = pw * lz + px * ly - py * lx + pz * lw
        ox = x * scale[lane]
        oy = y * scale[lane]
        oz = z * scale[lane]
        tx = TWO * (py * oz - pz * oy)
        ty = TWO * (pz * ox - px * oz)
        tz = TWO * (px * oy - py * ox)
        out_position[lane] = parent_position[lane] + ox + pw * tx + py * tz - pz * ty
        out_position[LANES + lane] = parent_position[LANES + lane] + oy + pw * ty + pz * tx - px * tz
        out_position[2 * LANES + lane] = parent_position[2 * LANES + lane] + oz + pw * tz + px * ty - py * tx


@kernel
def kinematics_chunk(
    parent: Any,
    offset: Any,
    segment: Any,
    leg_segment: int,
    segment_scale: Any,
    pose_rotation: Any,
    pose_pelvis: Any,
    active: Any,
    begin: int,
    end: int,
    scratch: Any,
    out_joint_position_model: Any,
    out_joint_rotation_model: Any,
) -> None:
    """Compute the joints of one run of blocks of 16 active characters.

    Parameters
    ----------
    begin, end : int
        Range of blocks.
    scratch : (scratch_length(J, G),) float32
        Row of this chunk.

    Notes
    -----
    All other arguments are those of `kinematics`.
    """
    count = active.shape[0]
    joint_count = parent.shape[0]
    position_begin = 5 * COMPONENT + joint_count * 4 * LANES
    scale_begin = position_begin + joint_count * 3 * LANES
    local = scratch[: 4 * COMPONENT]
    spare = scratch[4 * COMPONENT : 5 * COMPONENT]
    rotation = scratch[5 * COMPONENT : position_begin]
    position = scratch[position_begin:scale_begin]
    scale = scratch[scale_begin:]
    position_rows = out_joint_position_model.reshape(out_joint_position_model.shape[0], joint_count * 3)
    rotation_rows = out_joint_rotation_model.reshape(out_joint_rotation_model.shape[0], joint_count * 4)
    for block in range(begin, end):
        first = block * LANES
        gather_block(pose_rotation, active, first, spare, local)
        for lane in range(LANES):
            character = active[min(first + lane, count - 1)]
            for part in range(segment_scale.shape[1]):
                scale[part * LANES + lane] = segment_scale[character, part]
            leg = segment_scale[character, leg_segment]
            for component in range(3):
                position[component * LANES + lane] = pose_pelvis[character, component] * leg
            for component in range(4):
                rotation[component * LANES + lane] = local[component * COMPONENT + lane]
        for joint in range(1, joint_count):
            above = parent[joint]
            part = segment[joint]
            child_row(
                rotation[above * 4 * LANES : (above + 1) * 4 * LANES],
                position[above * 3 * LANES : (above + 1) * 3 * LANES],
                local[joint * LANES :],
                scale[part * LANES : (part + 1) * LANES],
                offset[joint, 0],
                offset[joint, 1],
                offset[joint, 2],
                rotation[joint * 4 * LANES : (joint + 1) * 4 * LANES],
                position[joint * 3 * LANES : (joint + 1) * 3 * LANES],
            )
        scatter_block(position, joint_count * 3, active, first, local, position_rows)
        scatter_block(rotation, joint_count * 4, active, first, local, rotation_rows)


@parallel_kernel
def kinematics(
    parent: Any,
    offset: Any,
    segment: Any,
    leg_segment: int,
    segment_scale: Any,
    pose_rotation: Any,
    pose_pelvis: Any,
    active: Any,
    scratch: Any,
    out_joint_position_model: Any,
    out_joint_rotation_model: Any,
) -> None:
    """Compute joint positions and rotations in the root frame.

    Parameters
    ----------
    parent : (J,) int32
        Parents, each before its children; joint 0 is the pelvis. At most 64 joints.
    offset : (J, 3) float32
        Rest offsets in the parent's frame, m; row 0 is not read.
    segment : (J,) int32
        Column of `segment_scale` that stretches each offset, 0 to G - 1.
    leg_segment : int
        Column that stretches the pelvis position.
    segment_scale : (N, G) float32
        Proportions, about 1.
    pose_rotation : (N, 256) float32
        Pose rows: unit local rotations.
    pose_pelvis : (N, 3) float32
        Pelvis in the root frame at leg scale 1, m.
    active : (A,) int32
        Characters to process, each once; 0 to N - 1.
    scratch : (32, scratch_length(J, G)) float32
        One row for each chunk.
    out_joint_position_model : (N, J, 3) float32
        Written in rows of `active`, m.
    out_joint_rotation_model : (N, J, 4) float32
        Written in rows of `active`, unit quaternions (w, x, y, z).

    Notes
    -----
    **Source:** forward kinematics of a tree with rest rotations aligned to the root frame.
    **Differs from the source:** offsets are stretched by the character's proportions.
    """
    block_count = (active.shape[0] + LANES - 1) // LANES
    for k in prange(CHUNKS):
        chunk = (k * 37) % CHUNKS
        kinematics_chunk(
            parent,
            offset,
            segment,
            leg_segment,
            segment_scale,
            pose_rotation,
            pose_pelvis,
            active,
            chunk * block_count // CHUNKS,
            (chunk + 1) * block_count // CHUNKS,
            scratch[chunk if IS_THREADED else 0],
            out_joint_position_model,
            out_joint_rotation_model,
        )


@kernel
def local_rotation_chunk(
    pose_rotation: Any, active: Any, begin: int, end: int, row: Any, out_rotation_local: Any
) -> None:
    """Convert one run of active characters.

    Parameters
    ----------
    begin, end : int
        Range of `active`.
    row : (256,) float32
        Scratch.

    Notes
    -----
    All other arguments are those of `local_rotations`.
    """
    length = out_rotation_local.shape[1] * 4
    out_rows = out_rotation_local.reshape(out_rotation_local.shape[0], length)
    for index in range(begin, end):
        character = active[index]
        pose = pose_rotation[character]
        interleave(
            pose[:PADDED_JOINTS],
            pose[PADDED_JOINTS : 2 * PADDED_JOINTS],
            pose[2 * PADDED_JOINTS : 3 * PADDED_JOINTS],
            pose[3 * PADDED_JOINTS :],
            PADDED_JOINTS,
            row,
        )
        for place in range(length):
            out_rows[character, place] = row[place]


@parallel_kernel
def local_rotations(pose_rotation: Any, active: Any, scratch: Any, out_rotation_local: Any) -> None:
    """Convert pose rows to plain quaternions, for recordings and exporters.

    Parameters
    ----------
    pose_rotation : (N, 256) float32
        Pose rows.
    active : (A,) int32
        Characters to process, each once; 0 to N - 1.
    scratch : (32, 256) float32
        One row for each chunk.
    out_rotation_local : (N, J, 4) float32
        Written in rows of `active`: the same values as (w, x, y, z), J at most 64.

    Notes
    -----
    **Source:** none; the bits stay, only their order in memory changes.
    """
    count = active.shape[0]
    for k in prange(CHUNKS):
        chunk = (k * 37) % CHUNKS
        local_rotation_chunk(
            pose_rotation,
            active,
            chunk * count // CHUNKS,
            (chunk + 1) * count // CHUNKS,
            scratch[chunk if IS_THREADED else 0],
            out_rotation_local,
        )


@inlined_kernel
def joint_rotation(pose_row: Any, joint: int) -> Quaternion:
    """Read the local rotation of a joint.

    Parameters
    ----------
    pose_row : (256,) float32
    joint : int
        0 to 63.

    Returns
    -------
    tuple of float
        (w, x, y, z).
    """
    return (
        float(pose_row[joint]),
        float(pose_row[PADDED_JOINTS + joint]),
        float(pose_row[2 * PADDED_JOINTS + joint]),
        float(pose_row[3 * PADDED_JOINTS + joint]),
    )


@inlined_kernel
def set_joint_rotation(pose_row: Any, joint: int, rotation: Quaternion) -> None:
    """Write the local rotation of a joint.

    Parameters
    ----------
    pose_row : (256,) float32
        Written at one joint.
    joint : int
        0 to 63.
    rotation : tuple of float
        (w, x, y, z), unit length.
    """
    pose_row[joint] = rotation[0]
    pose_row[PADDED_JOINTS + joint] = rotation[1]
    pose_row[2 * PADDED_JOINTS + joint] = rotation[2]
    pose_row[3 * PADDED_JOINTS + joint] = rotation[3]


@kernel
def child_joint(
    parent_rotation: Quaternion, parent_position: Vector, offset: Vector, local: Quaternion
) -> tuple[Quaternion, Vector]:
    """Place one joint below its parent, to walk along a short chain such as a leg.

    Parameters
    ----------
    parent_rotation, parent_position : tuple of float
        Parent in any frame; m.
    offset : tuple of float
        Rest offset in the parent's frame in the character's own proportions, m.
    local : tuple of float
        Local rotation of the joint.

    Returns
    -------
    rotation, position : tuple of float
        The joint in the parent's outer frame.
    """
    ahead = rotate(parent_rotation, offset)
    position = parent_position[0] + ahead[0], parent_position[1] + ahead[1], parent_position[2] + ahead[2]
    return multiply(parent_rotation, local), position
