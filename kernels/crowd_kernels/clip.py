"""Sample key frames, blend them by weights, and mix the result onto a pose. Joints are the lanes.

A *pose row* holds the local rotations of one character or key frame: 256 float32, the quaternion components
w, x, y, z outermost, each over 64 joints of which the last ones may be padding.
"""

from typing import Any

import numpy as np

from crowd_kernels._jit import IS_THREADED, inlined_kernel, kernel, parallel_kernel, prange

CHUNKS = 32
PADDED_JOINTS = 64
ROW = 4 * PADDED_JOINTS
ZERO = np.float32(0.0)
ONE = np.float32(1.0)
TINY_SQUARE = np.float32(1e-12)


@inlined_kernel
def start_row(key: Any, next_key: Any, weight: Any, next_weight: Any, out_sum: Any) -> None:
    """Set a row to the weighted sum of two key rows.

    Parameters
    ----------
    key, next_key : (256,) float32
        Pose rows.
    weight, next_weight : float32
    out_sum : (256,) float32
        Written.
    """
    for lane in range(ROW):
        out_sum[lane] = weight * key[lane] + next_weight * next_key[lane]


@inlined_kernel
def add_row(key: Any, next_key: Any, weight: Any, next_weight: Any, out_sum: Any) -> None:
    """Add the weighted sum of two key rows to a row.

    Parameters
    ----------
    key, next_key : (256,) float32
        Pose rows.
    weight, next_weight : float32
    out_sum : (256,) float32
        In and out.
    """
    for lane in range(ROW):
        out_sum[lane] += weight * key[lane] + next_weight * next_key[lane]


@inlined_kernel
def normalize_row(rotation: Any, out_rotation: Any) -> None:
    """Scale the quaternions of a row to unit length; one without length becomes the identity.

    Parameters
    ----------
    rotation : (256,) float32
        Weighted sum of pose rows.
    out_rotation : (256,) float32
        Written: a pose row. May be `rotation` itself.
    """
    for lane in range(PADDED_JOINTS):
        w = rotation[lane]
        x = rotation[PADDED_JOINTS + lane]
        y = rotation[2 * PADDED_JOINTS + lane]
        z = rotation[3 * PADDED_JOINTS + lane]
        square = w * w + x * x + y * y + z * z
        scale = ONE / np.sqrt(square)
        is_lost = square < TINY_SQUARE
        out_rotation[lane] = ONE if is_lost else w * scale
        out_rotation[PADDED_JOINTS + lane] = ZERO if is_lost else x * scale
        out_rotation[2 * PADDED_JOINTS + lane] = ZERO if is_lost else y * scale
        out_rotation[3 * PADDED_JOINTS + lane] = ZERO if is_lost else z * scale


@inlined_kernel
def mix_row(rotation: Any, share: Any, mask: Any, pose: Any) -> None:
    """Mix a pose row onto another the short way, each joint by share times mask.

    Where the product is 0 the old bits stay, where it is 1 the new ones are taken over.

    Parameters
    ----------
    rotation : (256,) float32
        New pose row.
    share : float32
        0 to 1.
    mask : (64,) float32
        0 to 1 for each joint.
    pose : (256,) float32
        In and out: old pose row.
    """
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
        signed = weight if w * new_w + x * new_x + y * new_y + z * new_z >= ZERO else -weight
        mixed_w = keep * w + signed * new_w
        mixed_x = keep * x + signed * new_x
        mixed_y = keep * y + signed * new_y
        mixed_z = keep * z + signed * new_z
        scale = ONE / np.sqrt(mixed_w * mixed_w + mixed_x * mixed_x + mixed_y * mixed_y + mixed_z * mixed_z)
        is_old = weight <= ZERO
        is_new = weight >= ONE
        pose[lane] = w if is_old else (new_w if is_new else mixed_w * scale)
        pose[PADDED_JOINTS + lane] = x if is_old else (new_x if is_new else mixed_x * scale)
        pose[2 * PADDED_JOINTS + lane] = y if is_old else (new_y if is_new else mixed_y * scale)
        pose[3 * PADDED_JOINTS + lane] = z if is_old else (new_z if is_new else mixed_z * scale)


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
    """Blend one run of active characters.

    Parameters
    ----------
    begin, end : int
        Range of `active`.
    row : (256,) float32
        Scratch.

    Notes
    -----
    All other arguments are those of `blend_samples`.
    """
    for index in range(begin, end):
        character = active[index]
        layer_share = layer_weight[character]
        if layer_share <= ZERO:
            continue
        total = ZERO
        pelvis_x = ZERO
        pelvis_y = ZERO
        pelvis_z = ZERO
        is_empty = True
        for sample in range(frame.shape[1]):
            share = weight[character, sample]
            if share == ZERO:
                continue
            before = frame[character, sample]
            after = next_frame[character, sample]
            after_share = share * fraction[character, sample]
            before_share = share - after_share
            if is_empty:
                start_row(key_rotation[before], key_rotation[after], before_share, after_share, row)
                is_empty = False
            else:
                add_row(key_rotation[before], key_rotation[after], before_share, after_share, row)
            total += share
            pelvis_x += before_share * key_pelvis[before, 0] + after_share * key_pelvis[after, 0]
            pelvis_y += before_share * key_pelvis[before, 1] + after_share * key_pelvis[after, 1]
            pelvis_z += before_share * key_pelvis[before, 2] + after_share * key_pelvis[after, 2]
        if is_empty:
            continue
        pelvis_x /= total
        pelvis_y /= total
        pelvis_z /= total
        mask = mask_index[character]
        if layer_share >= ONE and mask == 0:
            normalize_row(row, pose_rotation[character])
        else:
            normalize_row(row, row)
            mix_row(row, layer_share, joint_mask[mask], pose_rotation[character])
            share = layer_share * pelvis_mask[mask]
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
        Key frames as pose rows, signs aligned over all keys, so that a weighted sum followed by normalisation
        is a blend.
    key_pelvis : (K, 3) float32
        Pelvis in the root frame, m.
    active : (A,) int32
        Characters to process, each once; 0 to N - 1.
    frame, next_frame : (N, S) int32
        Key rows before and after each of S samples, 0 to K - 1.
    fraction : (N, S) float32
        Place between them, 0 to 1.
    weight : (N, S) float32
        Weights of the samples, not negative; only their ratios matter. Samples of weight 0 are not read. A
        character whose weights are all 0 keeps its pose.
    layer_weight : (N,) float32
        Share of the blend in the new pose, 0 to 1.
    mask_index : (N,) int32
        Row of `joint_mask`, 0 to M - 1; row 0 must be all ones.
    joint_mask : (M, 64) float32
        Share of the layer on each joint, 0 to 1.
    pelvis_mask : (M,) float32
        Share of the layer on the pelvis position, 0 to 1.
    pose_rotation : (N, 256) float32
        In and out, rows in `active`: local rotations. Not read where the layer replaces the whole pose.
    pose_pelvis : (N, 3) float32
        In and out, rows in `active`: pelvis in the root frame, m.
    scratch : (32, 256) float32
        One row for each chunk.

    Notes
    -----
    **Source:** Feng, Xu, Shapiro, section 4.1, blending of sub-motions by barycentric weights.
    **Differs from the source:** normalised weighted sums of sign-aligned quaternions in a fixed order, in
    place of sequential spherical interpolation, whose result depends on the order. Where opposite rotations
    cancel, the joint is at rest.
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
            scratch[chunk if IS_THREADED else 0],
        )
