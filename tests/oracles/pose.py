"""Slow twins of `crowd_kernels.clip` and `crowd_kernels.pose`: one joint at a time with rotation matrices."""

import numpy as np
from scipy.spatial.transform import Rotation

PADDED = 64


def row_to_quaternions(row):
    return np.asarray(row, float).reshape(4, PADDED).T


def quaternions_to_row(quaternions):
    row = np.zeros((4, PADDED), np.float32)
    row[0] = 1
    row[:, : len(quaternions)] = np.asarray(quaternions).T
    return row.ravel()


def blend(keys, frame, next_frame, fraction, weight):
    """Weighted sum of (row or vector) keys."""
    total = 0
    for a, b, f, w in zip(frame, next_frame, fraction, weight, strict=True):
        total = total + w * ((1 - f) * keys[a].astype(float) + f * keys[b].astype(float))
    return total


def mix(pose, rotation, share):
    """Mix (J, 4) rotations onto a pose by (J,) shares, the short way."""
    mixed = []
    for old, new, s in zip(pose, rotation, share, strict=True):
        new = new / np.linalg.norm(new)
        if old @ new < 0:
            new = -new
        both = (1 - s) * old + s * new
        mixed.append(both / np.linalg.norm(both))
    return np.array(mixed)


def matrix(q):
    return Rotation.from_quat([q[1], q[2], q[3], q[0]]).as_matrix()


def kinematics(parent, offset, segment, leg_segment, segment_scale, rotation_local, pelvis):
    """Positions (J, 3) and rotation matrices (J, 3, 3) of one character."""
    rotations = [matrix(rotation_local[0])]
    positions = [np.asarray(pelvis, float) * segment_scale[leg_segment]]
    for joint in range(1, len(parent)):
        above = parent[joint]
        positions.append(
            positions[above] + rotations[above] @ (offset[joint] * segment_scale[segment[joint]])
        )
        rotations.append(rotations[above] @ matrix(rotation_local[joint]))
    return np.array(positions), np.array(rotations)
