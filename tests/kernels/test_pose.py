"""Blending and forward kinematics against slow twins, and the properties that runs rely on."""

import numpy as np
import pytest

from crowd_kernels import _jit
from crowd_kernels.clip import blend_samples
from crowd_kernels.pose import CHUNKS, kinematics, scratch_length
from tests.oracles import pose as oracle

JOINTS = 20
KEYS = 40
PARENT = np.array([-1, *(max(0, i - 1 - i % 3) for i in range(1, JOINTS))], np.int32)


def random_rows(rng, count):
    rows = []
    for _ in range(count):
        q = rng.normal(0, 0.4, (JOINTS, 4)) + (1, 0, 0, 0)
        rows.append(oracle.quaternions_to_row(q / np.linalg.norm(q, axis=1, keepdims=True)))
    return np.array(rows, np.float32).reshape(count, 256)


def make_blend(rng, count, samples=4):
    weight = rng.random((count, samples)).astype(np.float32)
    weight[rng.random((count, samples)) < 0.2] = 0
    weight[:, 0] += 0.1
    weight /= weight.sum(axis=1, keepdims=True)
    mask = np.ones((2, 64), np.float32)
    mask[1] = rng.random(64)
    mask[1, 3] = 0
    return {
        "key_rotation": random_rows(rng, KEYS),
        "key_pelvis": rng.normal(0, 1, (KEYS, 3)).astype(np.float32),
        "active": np.arange(count, dtype=np.int32),
        "frame": rng.integers(0, KEYS, (count, samples)).astype(np.int32),
        "next_frame": rng.integers(0, KEYS, (count, samples)).astype(np.int32),
        "fraction": rng.random((count, samples)).astype(np.float32),
        "weight": weight,
        "layer_weight": np.ones(count, np.float32),
        "mask_index": np.zeros(count, np.int32),
        "joint_mask": mask,
        "pelvis_mask": np.array([1, 0.5], np.float32),
        "pose_rotation": random_rows(rng, count),
        "pose_pelvis": rng.normal(0, 1, (count, 3)).astype(np.float32),
        "scratch": np.zeros((32, 256), np.float32),
    }


@pytest.mark.parametrize("layer_weight", [1.0, 0.3, 0.0])
@pytest.mark.parametrize("mask", [0, 1])
def test_blend_matches_oracle(rng, layer_weight, mask):
    a = make_blend(rng, 9)
    a["layer_weight"][:] = layer_weight
    a["mask_index"][:] = mask
    before, pelvis_before = a["pose_rotation"].copy(), a["pose_pelvis"].copy()
    blend_samples(*a.values())
    for c in range(9):
        keys = (a["frame"][c], a["next_frame"][c], a["fraction"][c], a["weight"][c])
        summed = oracle.row_to_quaternions(oracle.blend(a["key_rotation"], *keys))
        share = layer_weight * a["joint_mask"][mask].astype(float)
        wanted = oracle.mix(oracle.row_to_quaternions(before[c]), summed, share)
        got = oracle.row_to_quaternions(a["pose_rotation"][c])
        np.testing.assert_allclose(np.abs((wanted * got).sum(axis=1)), 1, atol=3e-6)
        pelvis_share = layer_weight * a["pelvis_mask"][mask]
        pelvis = (1 - pelvis_share) * pelvis_before[c] + pelvis_share * oracle.blend(a["key_pelvis"], *keys)
        np.testing.assert_allclose(a["pose_pelvis"][c], pelvis, atol=1e-5)


def test_masked_joints_keep_their_pose(rng):
    a = make_blend(rng, 5)
    a["mask_index"][:] = 1
    before = oracle.row_to_quaternions(a["pose_rotation"][2])[3].copy()
    blend_samples(*a.values())
    np.testing.assert_allclose(oracle.row_to_quaternions(a["pose_rotation"][2])[3], before, atol=1e-6)


def test_zero_weights_and_inactive_rows_keep_their_pose(rng):
    a = make_blend(rng, 5)
    a["weight"][1] = 0
    a["active"] = np.array([1, 3], np.int32)
    before = a["pose_rotation"].copy()
    blend_samples(*a.values())
    np.testing.assert_array_equal(a["pose_rotation"][[0, 1, 2, 4]], before[[0, 1, 2, 4]])
    assert (a["pose_rotation"][3] != before[3]).any()


def make_kinematics(rng, count):
    return {
        "parent": PARENT,
        "offset": rng.normal(0, 0.3, (JOINTS, 3)).astype(np.float32),
        "segment": rng.integers(0, 8, JOINTS).astype(np.int32),
        "leg_segment": 6,
        "segment_scale": rng.uniform(0.8, 1.2, (count, 8)).astype(np.float32),
        "pose_rotation": random_rows(rng, count),
        "pose_pelvis": rng.normal(0, 1, (count, 3)).astype(np.float32),
        "active": np.arange(count, dtype=np.int32),
        "scratch": np.zeros((CHUNKS, scratch_length(JOINTS, 8)), np.float32),
        "out_joint_position_model": np.zeros((count, JOINTS, 3), np.float32),
        "out_joint_rotation_model": np.zeros((count, JOINTS, 4), np.float32),
    }


@pytest.mark.parametrize("count", [0, 1, 15, 16, 17, 40])
def test_kinematics_matches_oracle_with_any_tail(rng, count):
    a = make_kinematics(rng, count)
    kinematics(*a.values())
    for c in range(count):
        position, rotation = oracle.kinematics(
            PARENT,
            a["offset"],
            a["segment"],
            6,
            a["segment_scale"][c],
            oracle.row_to_quaternions(a["pose_rotation"][c]),
            a["pose_pelvis"][c],
        )
        np.testing.assert_allclose(a["out_joint_position_model"][c], position, atol=2e-5)
        for joint in range(JOINTS):
            got = oracle.matrix(a["out_joint_rotation_model"][c, joint])
            np.testing.assert_allclose(got, rotation[joint], atol=2e-5)


def test_results_do_not_depend_on_threads_order_or_number(rng):
    one, other = (make_kinematics(np.random.default_rng(2), 333) for _ in range(2))
    order = rng.permutation(333)
    for name in ("segment_scale", "pose_rotation", "pose_pelvis"):
        other[name] = np.ascontiguousarray(other[name][order])
    other["active"] = np.arange(200, dtype=np.int32)
    kinematics.serial(*one.values())
    kinematics.threaded(*other.values())
    inverse = np.argsort(order)
    here = np.flatnonzero(inverse < 200)
    np.testing.assert_array_equal(
        one["out_joint_position_model"][here], other["out_joint_position_model"][inverse[here]]
    )


def test_blend_is_equal_on_one_and_many_threads():
    one, other = (make_blend(np.random.default_rng(4), 333) for _ in range(2))
    blend_samples.serial(*one.values())
    blend_samples.threaded(*other.values())
    np.testing.assert_array_equal(one["pose_rotation"], other["pose_rotation"])
    assert _jit.maximum_thread_count() >= 1
