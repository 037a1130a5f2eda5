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


def angle(a, b):
    """Angle between two rotations given as matrices, rad, also exact for small angles."""
    return 2 * np.arcsin(np.clip(np.linalg.norm(a - b) / np.sqrt(8), 0, 1))
