"""Fingers in poses, and frames that follow each other."""

import numpy as np
import pytest

from crowd_kernels import _jit
from crowd_kernels.clip import PADDED_JOINTS
from crowd_kernels.hand_pose import compose_frames, hands_in_world, pose_hands
from tests.crowd.hand_scenes import HAND, unit_quaternions
from tests.oracles import hand_pose as oracle


def random_pose(rng, count):
    """Pose rows with unit rotations."""
    rotation = rng.normal(size=(count, 4, PADDED_JOINTS))
    return (rotation / np.linalg.norm(rotation, axis=1, keepdims=True)).reshape(count, -1).astype(np.float32)


@pytest.mark.parametrize("weight", [0.0, 0.4, 1.0])
def test_fingers_are_mixed_into_the_pose(weight, rng):
    pose = random_pose(rng, 6)
    before = pose.copy().reshape(6, 4, -1)
    closure = rng.uniform(0, 1, (6, 2, 15)).astype(np.float32)
    character, side = np.array([1, 1, 4], np.int32), np.array([0, 1, 1], np.int32)
    style = np.array([0, 1, 1], np.int32)
    pose_hands(HAND, character, side, style, np.full(3, weight), closure, pose)
    after = pose.reshape(6, 4, -1)
    for row, hand, grip in zip(character, side, style, strict=True):
        joints = HAND.joint[hand]
        wanted = oracle.fingers(HAND, hand, grip, closure[row, hand])
        expected = oracle.mixed(before[row][:, joints].T.astype(float), wanted, weight)
        found = after[row][:, joints].T
        assert np.abs((found * expected).sum(axis=1)) == pytest.approx(1, abs=1e-6)
    touched = np.zeros((6, PADDED_JOINTS), bool)
    touched[character[:, None], HAND.joint[side]] = True
    untouched = np.broadcast_to(~touched[:, None], after.shape)
    assert np.array_equal(after[untouched], before[untouched])


def test_hands_are_brought_to_the_world(rng):
    joint = np.array([3, 5], np.int32)
    place, turn = rng.normal(size=(4, 7, 3)), unit_quaternions(rng, 28).reshape(4, 7, 4)
    root, yaw = rng.normal(size=(4, 3)), rng.uniform(-3, 3, 4)
    character, side = np.array([0, 3, 3], np.int32), np.array([1, 0, 1], np.int32)
    position, rotation = np.zeros((3, 3)), np.zeros((3, 4))
    joints = place.astype(np.float32), turn.astype(np.float32)
    hands_in_world(joint, character, side, *joints, root, yaw, position, rotation)
    for row, (own, hand) in enumerate(zip(character, side, strict=True)):
        expected = oracle.in_world(place[own, joint[hand]], turn[own, joint[hand]], root[own], yaw[own])
        assert np.allclose(position[row], expected[0], atol=1e-6)
        assert np.allclose(oracle.rotation(rotation[row]).as_matrix(), expected[1], atol=1e-6)


@pytest.mark.parametrize("is_inverse", [False, True])
def test_frames_are_chained_and_taken_apart(is_inverse, rng):
    place, inner = rng.normal(size=(2, 20, 3))
    turn, inner_turn = unit_quaternions(rng, 20), unit_quaternions(rng, 20)
    position, rotation = np.zeros((20, 3)), np.zeros((20, 4))
    compose_frames(place, turn, inner, inner_turn, is_inverse, position, rotation)
    for row in range(20):
        expected = oracle.composed(place[row], turn[row], inner[row], inner_turn[row], is_inverse)
        assert np.allclose(position[row], expected[0], atol=1e-12)
        assert np.allclose(oracle.rotation(rotation[row]).as_matrix(), expected[1], atol=1e-12)
    back, back_turn = np.zeros((20, 3)), np.zeros((20, 4))
    compose_frames(place, turn, position, rotation, not is_inverse, back, back_turn)
    assert np.allclose(back, inner, atol=1e-12)


def test_threads_do_not_change_a_bit(rng):
    pose, closure = random_pose(rng, 200), rng.uniform(0, 1, (200, 2, 15)).astype(np.float32)
    rows = np.repeat(np.arange(200, dtype=np.int32), 2)
    side, style = np.tile(np.array([0, 1], np.int32), 200), rng.integers(0, 2, 400).astype(np.int32)
    results = []
    for threads in (1, min(2, _jit.maximum_thread_count())):
        _jit.set_thread_count(threads)
        own = pose.copy()
        pose_hands(HAND, rows, side, style, np.full(400, 0.7), closure, own)
        results.append(own)
    _jit.set_thread_count(1)
    assert np.array_equal(*results)
