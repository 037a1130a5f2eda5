"""Forward kinematics. Sixteen characters are the lanes of a block."""

from typing import Any

import numpy as np

from crowd_kernels._jit import kernel, parallel_kernel, prange
from crowd_kernels.clip import PADDED_JOINTS

CHUNKS = 32
LANES = 16
TWO = np.float32(2.0)


@kernel
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
    """Place one joint below its parent for 16 characters; flat float32 rows, components outermost.

    Rotations are (64,), positions (48,), `scale` (16,); x, y, z is the rest offset in the parent's frame.
    """
    for lane in range(LANES):
        pw = parent_rotation[lane]
        px = parent_rotation[LANES + lane]
        py = parent_rotation[2 * LANES + lane]
        pz = parent_rotation[3 * LANES + lane]
        lw = local[lane]
        lx = local[LANES + lane]
        ly = local[2 * LANES + lane]
        lz = local[3 * LANES + lane]
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
    local: Any,
    rotation: Any,
    position: Any,
    scale: Any,
    out_joint_position_model: Any,
    out_joint_rotation_model: Any,
) -> None:
    """Process one run of blocks of 16 active characters; arguments as in `kinematics`, with one chunk's scratch."""
    count = active.shape[0]
    joint_count = parent.shape[0]
    for block in range(begin, end):
        first = block * LANES
        for lane in range(LANES):
            character = active[min(first + lane, count - 1)]
            for joint in range(joint_count):
                local[joint * 64 + lane] = pose_rotation[character, joint]
                local[joint * 64 + LANES + lane] = pose_rotation[character, PADDED_JOINTS + joint]
                local[joint * 64 + 2 * LANES + lane] = pose_rotation[character, 2 * PADDED_JOINTS + joint]
                local[joint * 64 + 3 * LANES + lane] = pose_rotation[character, 3 * PADDED_JOINTS + joint]
            for part in range(segment_scale.shape[1]):
                scale[part * LANES + lane] = segment_scale[character, part]
            leg = segment_scale[character, leg_segment]
            position[lane] = pose_pelvis[character, 0] * leg
            position[LANES + lane] = pose_pelvis[character, 1] * leg
            position[2 * LANES + lane] = pose_pelvis[character, 2] * leg
        rotation[:64] = local[:64]
        for joint in range(1, joint_count):
            above = parent[joint]
            part = segment[joint]
            child_row(
                rotation[above * 64 : above * 64 + 64],
                position[above * 48 : above * 48 + 48],
                local[joint * 64 : joint * 64 + 64],
                scale[part * LANES : part * LANES + LANES],
                offset[joint, 0],
                offset[joint, 1],
                offset[joint, 2],
                rotation[joint * 64 : joint * 64 + 64],
                position[joint * 48 : joint * 48 + 48],
            )
        for lane in range(min(LANES, count - first)):
            character = active[first + lane]
            for joint in range(joint_count):
                for component in range(3):
                    out_joint_position_model[character, joint, component] = position[
                        joint * 48 + component * LANES + lane
                    ]
                for component in range(4):
                    out_joint_rotation_model[character, joint, component] = rotation[
                        joint * 64 + component * LANES + lane
                    ]


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
        Parents, each before its children; joint 0 is the pelvis.
    offset : (J, 3) float32
        Rest offsets in the parent's frame, m.
    segment : (J,) int32
        Column of `segment_scale` that stretches each offset.
    leg_segment : int
        Column that stretches the pelvis position.
    segment_scale : (N, G) float32
        Proportions.
    pose_rotation : (N, 256) float32
        Local rotations, components outermost.
    pose_pelvis : (N, 3) float32
        Pelvis in the root frame at leg scale 1, m.
    active : (A,) int32
        Characters to process.
    scratch : (32, J * 176 + G * 16) float32
        Blocks of the chunks.
    out_joint_position_model : (N, J, 3) float32
        Written in rows of `active`, m.
    out_joint_rotation_model : (N, J, 4) float32
        Written in rows of `active`, unit quaternions.

    Notes
    -----
    **Source:** forward kinematics of a tree with rest rotations aligned to the root frame.
    """
    count = active.shape[0]
    joint_count = parent.shape[0]
    block_count = (count + LANES - 1) // LANES
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
            scratch[chunk, : joint_count * 64],
            scratch[chunk, joint_count * 64 : joint_count * 128],
            scratch[chunk, joint_count * 128 : joint_count * 176],
            scratch[chunk, joint_count * 176 :],
            out_joint_position_model,
            out_joint_rotation_model,
        )
