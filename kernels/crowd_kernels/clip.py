"""Sample key frames, blend them by weights, and mix the result onto a pose. Joints are the lanes."""

from typing import Any

import numpy as np

from crowd_kernels._jit import kernel, parallel_kernel, prange

CHUNKS = 32
PADDED_JOINTS = 64
ROW = 4 * PADDED_JOINTS
ZERO = np.float32(0.0)
ONE = np.float32(1.0)


@kernel
def start_row(key: Any, following: Any, weight: Any, next_weight: Any, out_sum: Any) -> None:
    """Set a row to the weighted sum of two key rows; all (256,) float32."""
    for lane in range(ROW):
        out_sum[lane] = weight * key[lane] + next_weight * following[lane]


@kernel
def add_row(key: Any, following: Any, weight: Any, next_weight: Any, out_sum: Any) -> None:
    """Add the weighted sum of two key rows to a row; all (256,) float32."""
    for lane in range(ROW):
        out_sum[lane] += weight * key[lane] + next_weight * following[lane]


@kernel
def normalize_row(rotation: Any, out_rotation: Any) -> None:
    """Scale the quaternions of a row to unit length; (256,) float32, w[64] x[64] y[64] z[64]."""
    for lane in range(PADDED_JOINTS):
        w = rotation[lane]
        x = rotation[PADDED_JOINTS + lane]
        y = rotation[2 * PADDED_JOINTS + lane]
        z = rotation[3 * PADDED_JOINTS + lane]
        scale = ONE / np.sqrt(w * w + x * x + y * y + z * z)
        out_rotation[lane] = w * scale
        out_rotation[PADDED_JOINTS + lane] = x * scale
        out_rotation[2 * PADDED_JOINTS + lane] = y * scale
        out_rotation[3 * PADDED_JOINTS + lane] = z * scale


@kernel
def mix_row(rotation: Any, share: Any, mask: Any, pose: Any) -> None:
    """Mix quaternions onto a pose row by share times mask, in place; rows of (256,) float32.

    `rotation` is overwritten with its own normalised values.
    """
    normalize_row(rotation, rotation)
    for lane in range(PADDED_JOINTS):
        w = pose[lane]
        x = pose[PADDED_JOINTS + lane]
        y = pose[2 * PADDED_JOINTS + lane]
        z = pose[3 * PADDED_JOINTS + lane]
        new_w = rotation[lane]
        new_x = rotation[PADDED_JOINTS + lane]
        new_y = rotation[2 * PADDED_JOINTS + lane]
        new_z = rotation[3 * PADDED_JOINTS + lane]
        weight = share * mask[lane]
        keep = ONE - weight
        weight = weight if w * new_w + x * new_x + y * new_y + z * new_z >= ZERO else -weight
        w = keep * w + weight * new_w
        x = keep * x + weight * new_x
        y = keep * y + weight * new_y
        z = keep * z + weight * new_z
        scale = ONE / np.sqrt(w * w + x * x + y * y + z * z)
        pose[lane] = w * scale
        pose[PADDED_JOINTS + lane] = x * scale
        pose[2 * PADDED_JOINTS + lane] = y * scale
        pose[3 * PADDED_JOINTS + lane] = z * scale


@kernel
def blend_chunk(
    key_rotation: Any,
    key_pelvis: Any,
    active: Any,
    begin: int,
    end: int,
    frame: Any,
    next_frame: Any,
    fraction: Any,
    weight: Any,
    layer_weight: Any,
    mask_index: Any,
    joint_mask: Any,
    pelvis_mask: Any,
    pose_rotation: Any,
    pose_pelvis: Any,
    row: Any,
) -> None:
    """Blend one run of active characters; arguments as in `blend_samples`, `row` is scratch of (256,) float32."""
    for index in range(begin, end):
        character = active[index]
        pelvis_x = ZERO
        pelvis_y = ZERO
        pelvis_z = ZERO
        is_first = True
        for sample in range(frame.shape[1]):
            share = weight[character, sample]
            if share == ZERO:
                continue
            before = frame[character, sample]
            after = next_frame[character, sample]
            after_share = share * fraction[character, sample]
            before_share = share - after_share
            if is_first:
                start_row(key_rotation[before], key_rotation[after], before_share, after_share, row)
                is_first = False
            else:
                add_row(key_rotation[before], key_rotation[after], before_share, after_share, row)
            pelvis_x += before_share * key_pelvis[before, 0] + after_share * key_pelvis[after, 0]
            pelvis_y += before_share * key_pelvis[before, 1] + after_share * key_pelvis[after, 1]
            pelvis_z += before_share * key_pelvis[before, 2] + after_share * key_pelvis[after, 2]
        if is_first:
            continue
        share = layer_weight[character]
        mask = mask_index[character]
        if share >= ONE and mask == 0:
            normalize_row(row, pose_rotation[character])
        else:
            mix_row(row, share, joint_mask[mask], pose_rotation[character])
            share *= pelvis_mask[mask]
            pelvis_x = (ONE - share) * pose_pelvis[character, 0] + share * pelvis_x
            pelvis_y = (ONE - share) * pose_pelvis[character, 1] + share * pelvis_y
            pelvis_z = (ONE - share) * pose_pelvis[character, 2] + share * pelvis_z
        pose_pelvis[character, 0] = pelvis_x
        pose_pelvis[character, 1] = pelvis_y
        pose_pelvis[character, 2] = pelvis_z


@parallel_kernel
def blend_samples(
    key_rotation: Any,
    key_pelvis: Any,
    active: Any,
    frame: Any,
    next_frame: Any,
    fraction: Any,
    weight: Any,
    layer_weight: Any,
    mask_index: Any,
    joint_mask: Any,
    pelvis_mask: Any,
    pose_rotation: Any,
    pose_pelvis: Any,
    scratch: Any,
) -> None:
    """Blend key frames by weight and mix the result onto the pose, in place.

    Parameters
    ----------
    key_rotation : (K, 256) float32
        Key frames, quaternion components outermost, signs aligned over all keys, so that a weighted sum
        followed by normalisation is a blend.
    key_pelvis : (K, 3) float32
        Pelvis in the root frame, m.
    active : (A,) int32
        Characters to process.
    frame, next_frame : (N, S) int32
        Key rows before and after each of S samples.
    fraction : (N, S) float32
        Place between them, 0 to 1.
    weight : (N, S) float32
        Weights of the samples, sum 1. A character whose weights are all 0 keeps its pose.
    layer_weight : (N,) float32
        Share of the blend in the new pose, 0 to 1.
    mask_index : (N,) int32
        Row of `joint_mask`; row 0 must be all ones.
    joint_mask : (M, 64) float32
        Share of the layer on each joint.
    pelvis_mask : (M,) float32
        Share of the layer on the pelvis position.
    pose_rotation : (N, 256) float32
        In and out: local rotations.
    pose_pelvis : (N, 3) float32
        In and out: pelvis in the root frame, m.
    scratch : (32, 256) float32
        One row for each chunk.

    Notes
    -----
    **Source:** Feng, Xu, Shapiro, section 4.1, blending of sub-motions by barycentric weights.
    **Differs from the source:** normalised weighted sums of sign-aligned quaternions in a fixed order, instead
    of sequential spherical interpolation that depends on the order.
    """
    count = active.shape[0]
    for k in prange(CHUNKS):
        chunk = (k * 37) % CHUNKS
        blend_chunk(
            key_rotation,
            key_pelvis,
            active,
            chunk * count // CHUNKS,
            (chunk + 1) * count // CHUNKS,
            frame,
            next_frame,
            fraction,
            weight,
            layer_weight,
            mask_index,
            joint_mask,
            pelvis_mask,
            pose_rotation,
            pose_pelvis,
            scratch[chunk],
        )
