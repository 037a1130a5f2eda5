"""Slow twins of `crowd_kernels.view`: one character at a time with plain NumPy."""

import numpy as np


def level_of(position, stature, planes, eye, pixels, is_perspective, least_height, before):
    """Level of detail of one character in the scene, or -1."""
    centre = position + np.array([0.0, 0.9, 0.0])
    if (planes[:, :3] @ centre + planes[:, 3] <= -1.1).any():
        return -1
    height = stature * pixels
    if is_perspective:
        height /= max(np.linalg.norm(centre - eye), 0.01)
    margin = np.ones(len(least_height))
    if before >= 0:
        margin = np.where(before <= np.arange(len(least_height)), 0.9, 1.1)
    return int(max(np.flatnonzero(height < least_height * margin) + 1, default=0))


def sorted_rows(level, build, build_count, level_count):
    """Rows by level and build, and where each bucket begins."""
    seen = np.flatnonzero(level >= 0)
    bucket = level[seen] * build_count + build[seen]
    order = seen[np.argsort(bucket, kind="stable")]
    counts = np.bincount(bucket, minlength=level_count * build_count)
    return order, np.concatenate([[0], np.cumsum(counts)])


def packed_row(position, rotation, scale, joints):
    """Texels of some joints of one character, before rounding."""
    return np.concatenate(
        [np.r_[rotation[j] * 32767.0, np.clip(position[j], -4, 4) * 32767.0 / 4.0, scale[j]] for j in joints]
    )
