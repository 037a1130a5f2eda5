"""Fingers in poses, and frames that follow each other."""

import numpy as np
import pytest

from crowd.motion.easing import minimum_jerk
from crowd_kernels.aligned import aligned_full
from crowd_kernels.clip import PADDED_JOINTS
from crowd_kernels.grasp import CHUNKS
from crowd_kernels.hand_pose import FINGER_ROW, compose_frames, hands_in_world, pose_hands
from tests.crowd.hand_scenes import HAND, unit_quaternions
from tests.oracles import hand_pose as oracle


def random_pose(rng, count):
    """Pose rows with unit rotations."""
    rotation = rng.normal(size=(count, 4, PADDED_JOINTS))
    return (rotation / np.linalg.norm(rotation, axis=1, keepdims=True)).reshape(count, -1).astype(np.float32)


SCRATCH = aligned_full((CHUNKS, FINGER_ROW), np.nan, np.float32)


@pytest.mark.parametrize("weight", [0.0, 0.4, 1.0])
def test_fingers_are_mixed_into_the_pose(weight, rng):
    pose = random_pose(rng, 6)
    before = pose.copy().reshape(6, 4, -1)
    closure = rng.uniform(0, 1, (6, 2, 15)).astype(np.float32)
    item, style = np.full((6, 2), -1, np.int32), rng.integers(0, 2, (6, 2)).astype(np.int32)
    hands = np.array([1, 1, 4]), np.array([0, 1, 1])
    item[hands] = [7, 7, 0]
    share = np.where(item >= 0, weight, 0.0)
    pose_hands(HAND, item, style, 0.0, np.arange(6, dtype=np.int32), closure, SCRATCH, share, pose)
    after = pose.reshape(6, 4, -1)
    for row, hand in zip(*hands, strict=True):
        joints = HAND.joint[hand]
        wanted = oracle.fingers(HAND, hand, style[row, hand], closure[row, hand])
        expected = oracle.mixed(before[row][:, joints].T.astype(float), wanted, minimum_jerk(weight))
        found = after[row][:, joints].T
        assert np.abs((found * expected).sum(axis=1)) == pytest.approx(1, abs=1e-6)
        assert np.linalg.norm(found, axis=1) == pytest.approx(1, abs=1e-6)
    touched = np.zeros((6, PADDED_JOINTS), bool)
    touched[hands[0][:, None], HAND.joint[hands[1]]] = True
    untouched = np.broadcast_to(~touched[:, None], after.shape)
    assert np.array_equal(after[untouched], before[untouched])


def test_the_share_of_a_hand_rises_while_it_is_at_something_and_fades_after(rng):
    item = np.array([[3, -1], [-1, -1], [3, 3]], np.int32)
    share = np.array([[0.95, 0.04], [0.0, 0.5], [0.2, 0.2]])
    pose, closure = random_pose(rng, 3), np.zeros((3, 2, 15), np.float32)
    active, style = np.array([0, 1], np.int32), np.zeros((3, 2), np.int32)
    pose_hands(HAND, item, style, 0.1, active, closure, SCRATCH, share, pose)
    assert share == pytest.approx(np.array([[1.0, 0.0], [0.0, 0.4], [0.2, 0.2]]))


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


def test_one_chunk_after_another_takes_one_scratch_row_and_all_at_once_their_own(rng):
    pose, closure = random_pose(rng, 200), rng.uniform(0, 1, (200, 2, 15)).astype(np.float32)
    rows, item = np.arange(200, dtype=np.int32), rng.integers(-1, 3, (200, 2)).astype(np.int32)
    style, results = rng.integers(0, 2, (200, 2)).astype(np.int32), []
    for build, used in ((pose_hands.serial, 1), (pose_hands.threaded, CHUNKS)):
        scratch, own = np.full_like(SCRATCH, np.nan), pose.copy()
        build(HAND, item, style, 0.1, rows, closure, scratch, np.full((200, 2), 0.6), own)
        assert np.isfinite(scratch).any(axis=1).sum() == used
        results.append(own)
    assert np.isfinite(results[0]).all()
    assert np.array_equal(*results)
