"""What is drawn of a crowd: levels of detail, lists by level, packed poses."""

import numpy as np
import pytest

from crowd_kernels.view import levels_crowd, pack_crowd, sort_rows
from tests.oracles import view as twin

LIMITS = np.array([150.0, 70.0, 34.0, 14.0])


def crowd_of(rng, count):
    position = np.zeros((count, 3))
    position[:, [0, 2]] = rng.uniform(-40, 40, (count, 2))
    return position, rng.random(count) < 0.9, rng.uniform(1.5, 2.0, count)


def planes_of(rng):
    normal = rng.normal(size=(6, 3))
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    return np.c_[normal, rng.uniform(5, 30, 6)]


@pytest.mark.parametrize("is_perspective", [True, False])
@pytest.mark.parametrize("build", ["serial", "threaded"])
def test_levels_are_those_of_the_twin_and_keep_still_near_a_limit(rng, is_perspective, build):
    position, is_active, stature = crowd_of(rng, 400)
    planes, eye = planes_of(rng), np.array([3.0, 4.0, 45.0])
    before = rng.integers(-1, 5, 400).astype(np.int32)
    level = before.copy()
    pixels = 800.0 if is_perspective else 40.0
    getattr(levels_crowd, build)(
        position, is_active, stature, planes, eye, pixels, is_perspective, LIMITS, level
    )
    expected = [
        twin.level_of(position[k], stature[k], planes, eye, pixels, is_perspective, LIMITS, before[k])
        if is_active[k]
        else -1
        for k in range(400)
    ]
    assert level.tolist() == expected
    assert len(set(expected)) > 2 or not is_perspective


def test_nobody_changes_level_twice_on_one_way_back_and_forth():
    planes, eye = np.array([[0.0, 1.0, 0.0, 100.0]]), np.zeros(3)
    level = np.full(1, -1, np.int32)
    seen = []
    # A step of 1 % to and fro across a limit.
    for distance in (10.0, 20.01, 19.9, 20.1, 19.9, 20.1):
        position = np.array([[0.0, -0.9, distance]])
        levels_crowd(position, np.ones(1, bool), np.ones(1), planes, eye, 1400.0, True, LIMITS, level)
        seen.append(int(level[0]))
    assert seen == [1, 1, 1, 1, 1, 1]
    levels_crowd(
        np.array([[0.0, -0.9, 23.0]]), np.ones(1, bool), np.ones(1), planes, eye, 1400.0, True, LIMITS, level
    )
    assert level[0] == 2


def test_rows_are_listed_by_level_and_build(rng):
    level = rng.integers(-1, 5, 300).astype(np.int32)
    build = rng.integers(0, 4, 300).astype(np.int32)
    begin, row = np.zeros(21, np.int32), np.zeros(300, np.int32)
    sort_rows(level, build, 4, begin, row)
    order, bounds = twin.sorted_rows(level, build, 4, 5)
    assert begin.tolist() == bounds.tolist()
    assert row[: begin[-1]].tolist() == order.tolist()


def test_an_empty_scene_lists_nobody():
    begin, row = np.ones(6, np.int32), np.zeros(3, np.int32)
    sort_rows(np.full(3, -1, np.int32), np.zeros(3, np.int32), 1, begin, row)
    assert begin.tolist() == [0] * 6


@pytest.mark.parametrize("build", ["serial", "threaded"])
def test_packed_poses_are_right_to_half_a_step(rng, build):
    count, joint_count = 70, 56
    position = rng.normal(scale=30, size=(count, 3))
    yaw = rng.uniform(-np.pi, np.pi, count)
    joint = rng.uniform(-1.5, 2.5, (count, joint_count, 3)).astype(np.float32)
    joint[3, 7] = 9.0
    rotation = rng.normal(size=(count, joint_count, 4))
    rotation = (rotation / np.linalg.norm(rotation, axis=2, keepdims=True)).astype(np.float32)
    rotation[5, 2] = -1.0, 0.0, 0.0, 0.0
    scale = rng.integers(6000, 11000, (count, joint_count)).astype(np.int16)
    body = rng.integers(0, 4, count).astype(np.int32)
    drawn = rng.permutation(count)[:40].astype(np.int32)
    joints = np.array([0, 7, 2, 55], np.int32)
    origin = np.array([5.0, 0.0, -3.0])
    root, palette = np.full((50, 8), 9.0, np.float32), np.full((50, 32), 9, np.int16)
    getattr(pack_crowd, build)(
        position, yaw, joint, rotation, scale, body, drawn, joints, origin, root, palette
    )
    expected = np.array([twin.packed_row(joint[k], rotation[k], scale[k], joints) for k in drawn])
    assert np.abs(palette[:40] - expected).max() <= 0.51
    assert np.allclose(root[:40, :3], position[drawn] - origin, atol=1e-5)
    assert root[:40, 3].tolist() == drawn.tolist()
    assert np.allclose(root[:40, 4:6], np.c_[np.sin(yaw), np.cos(yaw)][drawn], atol=1e-6)
    assert root[:40, 6].tolist() == body[drawn].tolist()
    assert (root[40:] == 9.0).all()
    assert (palette[40:] == 9).all()


def test_nobody_drawn_writes_nothing():
    nothing = np.zeros(0, np.int32)
    root, palette = np.ones((1, 8), np.float32), np.ones((1, 8), np.int16)
    pack_crowd(
        np.zeros((1, 3)), np.zeros(1), np.zeros((1, 2, 3), np.float32), np.zeros((1, 2, 4), np.float32),
        np.zeros((1, 2), np.int16), np.zeros(1, np.int32), nothing, np.zeros(1, np.int32), np.zeros(3),
        root, palette,
    )  # fmt: skip
    assert (root == 1).all()
    assert (palette == 1).all()
