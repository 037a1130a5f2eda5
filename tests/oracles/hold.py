"""Slow twin of `crowd_kernels.hold`: one character after another, rotations as SciPy's, float64."""

import numpy as np
from scipy.spatial.transform import Rotation

from tests.oracles.ik import kinematics, quaternion, rotation

POSITION, ROTATION_TOO = 1, 2
NONE, RETURN = 0, 3
GONE = 1e-3


def effectors(tree, scale, pose, pelvis, point):
    """Places (E, 3) and rotations of the effectors of one character in the root frame."""
    local = pose.reshape(4, -1)[:, tree.joint].T.astype(float)
    offset = tree.offset * scale[tree.segment][:, None]
    places, frames = kinematics(tree.parent, offset, local, pelvis * scale[tree.root_segment])
    held = [frames[k] for k in tree.effector]
    return [places[k] + frames[k].apply(p) for k, p in zip(tree.effector, point, strict=True)], held


def where_they_are(tree, scale, pose, pelvis, position, yaw, point):
    """World places (E, 3) and quaternions (E, 4) of the effectors of one character."""
    places, frames = effectors(tree, scale, pose, pelvis, np.tile(point, (len(tree.effector), 1)))
    facing = Rotation.from_rotvec([0.0, yaw, 0.0])
    return facing.apply(places) + position, np.array([quaternion(facing * frame) for frame in frames])


def faded(weight, speed, goal, rate, dt):
    """Critically damped spring towards a goal, in closed form."""
    away = weight - goal
    after = goal + (away + (speed + rate * away) * dt) * np.exp(-rate * dt)
    if abs(after - goal) < GONE:
        return goal, 0.0
    return after, (speed - rate * (speed + rate * away) * dt) * np.exp(-rate * dt)


def aimed(task, weight, place, frame, position, yaw, target, target_rotation):
    """Target place and quaternion of one effector in the root frame."""
    back = Rotation.from_rotvec([0.0, -yaw, 0.0])
    own = quaternion(frame)
    if task & POSITION:
        place = (1 - weight) * place + weight * back.apply(target - position)
    if task & ROTATION_TOO:
        wanted = quaternion(back * rotation(target_rotation))
        own = (1 - weight) * own + weight * wanted * (1 if wanted @ own >= 0 else -1)
    return place, own / np.linalg.norm(own)
