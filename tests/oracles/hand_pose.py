"""Slow twins of the kernels that pose fingers and chain frames."""

import numpy as np
from scipy.spatial.transform import Rotation


def rotation(quaternion):
    return Rotation.from_quat(np.asarray(quaternion, float)[..., [1, 2, 3, 0]])


def quaternion(turned):
    return turned.as_quat()[..., [3, 0, 1, 2]]


def fingers(hand, side, style, closure):
    """Local rotations of the finger joints, (15, 4)."""
    turn = Rotation.from_rotvec(np.asarray(closure)[:, None] * hand.sweep[style, side])
    return quaternion(rotation(hand.open_rotation[style, side]) * turn)


def mixed(below, above, weight):
    """Normalised linear mix of quaternions (15, 4), the short way."""
    sign = np.where((below * above).sum(axis=1) < 0, -1, 1)[:, None]
    value = (1 - weight) * below + weight * sign * above
    return value / np.linalg.norm(value, axis=1, keepdims=True)


def in_world(position_model, rotation_model, position_world, yaw):
    """A joint in the world: position and rotation matrix."""
    heading = Rotation.from_rotvec([0, yaw, 0])
    return position_world + heading.apply(position_model), (heading * rotation(rotation_model)).as_matrix()


def composed(position, turned, inner_position, inner_turned, is_inverse):
    """Chained frames, or the second in the first: position and rotation matrix."""
    outer, inner = rotation(turned), rotation(inner_turned)
    if is_inverse:
        return outer.inv().apply(inner_position - position), (outer.inv() * inner).as_matrix()
    return position + outer.apply(inner_position), (outer * inner).as_matrix()
