"""Gaits captured in place: the ground that glides back under the feet tells how fast somebody walks."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from crowd.motion.importing.axes import PosedSource
from crowd.motion.importing.contacts import BALL, find_contacts, foot_points_of
from crowd.motion.importing.joint_names import JointMap

FloatArray = npt.NDArray[np.float64]

STAYS = 0.15
"""Hips that get on faster over the ground are not in place, m/s."""
SLOWEST = 0.25
"""Feet that glide back more slowly stand, m/s."""
LOW_SHARE = 0.25
"""A foot is on the ground in this share of its frames at least: those in which it is lowest."""
AGREES, MOST = 0.5, 0.55
"""Most frames of both feet glide within this share of the common velocity."""


def ground_velocity(source: PosedSource, joints: JointMap) -> FloatArray | None:
    """Velocity (3,) of the ground under somebody who walks in place, m/s; None for others."""
    frames, rate = len(source.position), source.frame_rate
    if frames < 8:
        return None
    hips = source.position[:, joints.joint["pelvis"]]
    if np.hypot(*(hips[-1] - hips[0])[[0, 2]]) * rate / (frames - 1) > STAYS:
        return None
    feet = foot_points_of(source, joints)[:, :, BALL]
    glides = []
    for foot in range(2):
        velocity = np.gradient(feet[:, foot], 1.0 / rate, axis=0) * (1.0, 0.0, 1.0)
        height = feet[:, foot, 1]
        glides.append(velocity[height <= np.quantile(height, LOW_SHARE)])
    common = np.median(np.concatenate(glides), axis=0)
    speed = float(np.linalg.norm(common))
    if speed < SLOWEST:
        return None
    agree = [np.linalg.norm(glide - common, axis=1) < AGREES * speed for glide in glides]
    if min(float(foot.mean()) for foot in agree) <= MOST:
        return None
    return np.asarray(common + gliding_left(carried_along(source, common), joints))


def gliding_left(source: PosedSource, joints: JointMap) -> FloatArray:
    """Velocity (3,) at which the balls of flat feet still glide, m/s: before and after, feet roll."""
    contacts = find_contacts(source, joints, is_loop=False)
    velocity = np.gradient(contacts.points[:, :, BALL], 1.0 / source.frame_rate, axis=0) * (1.0, 0.0, 1.0)
    is_flat = contacts.foot_is_flat
    return np.asarray(np.median(velocity[is_flat], axis=0)) if is_flat.any() else np.zeros(3)


def carried_along(source: PosedSource, ground: FloatArray) -> PosedSource:
    """Move somebody who walks in place against the ground's velocity (3,), m/s, so that feet stay."""
    time = np.arange(len(source.position)) / source.frame_rate
    return replace(source, position=source.position - time[:, None, None] * ground)
