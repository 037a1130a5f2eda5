"""Slow twin of `crowd_kernels.limb_ik`: circle of possible middle joints, nearest to the pole."""

import numpy as np
from scipy.spatial.transform import Rotation


def rotate(quaternion, vector):
    w, x, y, z = quaternion
    return Rotation.from_quat([x, y, z, w]).apply(vector)


def middle_joint(root, target, pole, upper, lower):
    """Where the middle joint is when it stands towards the pole as far as it can."""
    way = target - root
    distance = np.linalg.norm(way)
    along = (upper**2 - lower**2 + distance**2) / (2 * distance)
    height = np.sqrt(max(upper**2 - along**2, 0))
    axis = way / distance
    across = pole - (pole @ axis) * axis
    return root + along * axis + height * across / np.linalg.norm(across)
