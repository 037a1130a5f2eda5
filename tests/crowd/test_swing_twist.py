"""Limits by swing and twist: the built-in motion lies inside, sides mirror, ranges are those of people."""

import numpy as np
import pytest

from crowd.errors import MotionError
from crowd.motion.joint_tree import joint_tree
from crowd.motion.procedural import built_in_library
from crowd.motion.rotation import about, conjugate, multiply
from crowd.motion.swing_twist import swing_twist_limits

LIBRARY = built_in_library()
SKELETON = LIBRARY.skeleton
LIMITS, IS_LIMITED = swing_twist_limits(SKELETON)


def measure(rotation):
    """Share of the swing ellipse, and twist in rad, of rotations (..., J, 4)."""
    inner = multiply(
        conjugate(LIMITS.parent_frame.astype(float)), multiply(rotation, LIMITS.joint_frame.astype(float))
    )
    inner *= np.where(inner[..., :1] < 0, -1.0, 1.0)
    w, x, y, z = np.moveaxis(inner, -1, 0)
    norm = np.hypot(w, z)
    swing = np.stack([x * w - y * z, y * w + x * z], axis=-1) / norm[..., None]
    return np.linalg.norm(swing * LIMITS.inverse_swing, axis=-1), 2 * np.arctan2(z, w)


def is_inside(name, rotation):
    joint = SKELETON.joint(name)
    pose = np.tile([1.0, 0.0, 0.0, 0.0], (SKELETON.joint_count, 1))
    pose[joint] = rotation
    share, twist = measure(pose)
    low, high = 2 * np.arctan(LIMITS.twist[joint].astype(float))
    return share[joint] <= 1 and (not LIMITS.is_free[joint, 2] or low <= twist[joint] <= high)


@pytest.mark.parametrize("clip", LIBRARY.clips, ids=lambda clip: clip.name)
def test_the_motion_library_lies_inside(clip):
    share, twist = measure(clip.rotation_local.astype(float))
    low, high = 2 * np.arctan(LIMITS.twist.astype(float)).T
    for joint in np.flatnonzero(IS_LIMITED):
        name = SKELETON.joint_names[joint]
        assert share[:, joint].max() <= 1.001, name
        if LIMITS.is_free[joint, 2]:
            assert twist[:, joint].min() >= low[joint] - 1e-3, name
            assert twist[:, joint].max() <= high[joint] + 1e-3, name


def test_every_joint_but_the_pelvis_has_a_limit():
    assert [SKELETON.joint_names[j] for j in np.flatnonzero(IS_LIMITED == 0)] == ["pelvis"]


def test_the_right_side_mirrors_the_left(rng):
    for _ in range(200):
        rotation = rng.normal(size=4) * (0.6, 1, 1, 1)
        rotation /= np.linalg.norm(rotation)
        for part in ("clavicle", "upper_arm", "forearm", "hand", "thigh", "shank", "foot", "toe"):
            mirrored = rotation * (1, 1, -1, -1)
            assert is_inside(f"left_{part}", rotation) == is_inside(f"right_{part}", mirrored), part


@pytest.mark.parametrize(
    ("joint", "axis", "inside", "outside"),
    [
        ("left_upper_arm", 0, (-140, 60), (-160, 100)),
        ("left_upper_arm", 2, (-60, 120), (-90, 140)),
        ("left_forearm", 0, (-148, 2), (-155, 10)),
        ("left_forearm", 1, (-85, 85), (-95, 95)),
        ("left_hand", 2, (-70, 70), (-80, 80)),
        ("left_shank", 0, (0, 140), (-10, 150)),
        ("left_thigh", 0, (-115, 40), (-130, 50)),
        ("spine_2", 0, (-8, 20), (-15, 25)),
    ],
)
def test_ranges_are_those_of_people(joint, axis, inside, outside):
    assert all(is_inside(joint, about(axis, np.radians(angle))) for angle in inside)
    assert not any(is_inside(joint, about(axis, np.radians(angle))) for angle in outside)


def test_trees_name_unknown_joints():
    with pytest.raises(MotionError, match="left_hand"):
        joint_tree(SKELETON, ["left_hnad"])
