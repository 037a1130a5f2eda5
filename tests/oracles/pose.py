"""Slow twins of `crowd_kernels.pose`: one joint at a time with rotation matrices."""

import numpy as np
from scipy.spatial.transform import Rotation

PADDED = 64


def row_to_quaternions(row):
    """Quaternions (64, 4) of a pose row."""
    return np.asarray(row, float).reshape(4, PADDED).T


def quaternions_to_row(quaternions):
    """Pose row of (J, 4) quaternions."""
    row = np.zeros((4, PADDED), np.float32)
    row[0] = 1
    row[:, : len(quaternions)] = np.asarray(quaternions).T
    return row.ravel()


def random_rows(rng, count, joint_count):
    """Pose rows of random rotations up to about a right angle."""
    rows = []
    for _ in range(count):
        quaternions = rng.normal(0, 0.4, (joint_count, 4)) + np.array([1, 0, 0, 0])
        rows.append(quaternions_to_row(quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True)))
    return np.array(rows, np.float32).reshape(count, 4 * PADDED)


def matrix(q):
    """Matrix of a quaternion."""
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
