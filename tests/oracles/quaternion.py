"""Slow twins of `crowd_kernels.quaternion`: rotation matrices."""

import numpy as np
from scipy.linalg import expm


def matrix(q):
    """Matrix of a unit quaternion, column by column the images of the axes under q v q*."""
    w, x, y, z = np.asarray(q, float)
    left = np.array([[w, -x, -y, -z], [x, w, -z, y], [y, z, w, -x], [z, -y, x, w]])
    right = np.array([[w, x, y, z], [-x, w, -z, y], [-y, z, w, -x], [-z, -y, x, w]])
    return (left @ right)[1:, 1:]


def rotation_matrix(vector):
    """Matrix of a rotation vector, by the exponential of its cross-product matrix."""
    x, y, z = vector
    return expm(np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]], float))


def angular_velocity(vector, rate, step=1e-6):
    """Angular velocity of the matrix of a rotation vector that changes, from how the matrix does."""
    before, after = (rotation_matrix(np.add(vector, np.multiply(rate, part))) for part in (-step, step))
    turning = (after - before) / (2 * step) @ rotation_matrix(vector).T
    return np.array([turning[2, 1], turning[0, 2], turning[1, 0]])


def angle(a, b):
    """Angle between two rotations given as matrices, rad, also exact for small angles."""
    return 2 * np.arcsin(np.clip(np.linalg.norm(a - b) / np.sqrt(8), 0, 1))
