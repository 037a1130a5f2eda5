"""Sampling and blending against a slow twin, and the properties that runs rely on."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from crowd_kernels.clip import CHUNKS, ROW, blend_samples
from tests.oracles import clip as oracle
from tests.oracles.pose import quaternions_to_row, random_rows, row_to_quaternions

JOINTS = 56
KEYS = 40
FULL, PARTIAL = 0, 1
UNTOUCHED_JOINT, TAKEN_JOINT = 3, 4


def make(rng, count, samples=4):
    """Arguments of `blend_samples` by name, in order: a full layer over random poses."""
    weight = rng.random((count, samples))
    weight[:, 1:][rng.random((count, samples - 1)) < 0.2] = 0
    weight[:, 0] += 0.1
    mask = np.ones((2, 64), np.float32)
    mask[PARTIAL] = rng.random(64)
    mask[PARTIAL, UNTOUCHED_JOINT] = 0
    mask[PARTIAL, TAKEN_JOINT] = 1
    return {
        "key_rotation": random_rows(rng, KEYS, JOINTS),
        "key_pelvis": rng.normal(0, 1, (KEYS, 3)).astype(np.float32),
        "active": np.arange(count, dtype=np.int32),
        "frame": rng.integers(0, KEYS, (count, samples)).astype(np.int32),
        "next_frame": rng.integers(0, KEYS, (count, samples)).astype(np.int32),
        "fraction": rng.random((count, samples)).astype(np.float32),
        "weight": (weight / weight.sum(axis=1, keepdims=True)).astype(np.float32),
        "layer_weight": np.ones(count, np.float32),
        "mask_index": np.zeros(count, np.int32),
        "joint_mask": mask,
        "pelvis_mask": np.array([1, 0.5], np.float32),
        "pose_rotation": random_rows(rng, count, JOINTS),
        "pose_pelvis": rng.normal(0, 1, (count, 3)).astype(np.float32),
        "scratch": np.zeros((CHUNKS, ROW), np.float32),
    }


def run(arguments, build=blend_samples):
    """Blend, and return the new poses."""
    build(*arguments.values())
    return arguments["pose_rotation"], arguments["pose_pelvis"]


def permuted(arguments, order):
    """The same characters in other rows."""
    per_character = {
        "frame",
        "next_frame",
        "fraction",
        "weight",
        "layer_weight",
        "mask_index",
        "pose_rotation",
        "pose_pelvis",
    }
    return {
        name: np.ascontiguousarray(value[order]) if name in per_character else value.copy()
        for name, value in arguments.items()
    }


def mixed_layers(rng, count):
    """Arguments with full and partial layers side by side."""
    arguments = make(rng, count)
    arguments["layer_weight"][:] = rng.choice([0.0, 0.25, 0.8, 1.0], count)
    arguments["mask_index"][:] = rng.integers(0, 2, count)
    return arguments


@pytest.mark.parametrize("samples", [1, 2, 4, 5])
@pytest.mark.parametrize("mask", [FULL, PARTIAL])
@pytest.mark.parametrize("layer_weight", [1.0, 0.3])
def test_matches_oracle(rng, samples, mask, layer_weight):
    a = make(rng, 9, samples)
    a["layer_weight"][:] = layer_weight
    a["mask_index"][:] = mask
    before, pelvis_before = a["pose_rotation"].copy(), a["pose_pelvis"].copy()
    rotation, pelvis = run(a)
    for c in range(9):
        keys = (a["frame"][c], a["next_frame"][c], a["fraction"][c], a["weight"][c])
        new = row_to_quaternions(oracle.blend(a["key_rotation"], *keys))
        share = layer_weight * a["joint_mask"][mask].astype(float)
        wanted = oracle.mix(row_to_quaternions(before[c]), new, share)
        got = row_to_quaternions(rotation[c])
        got *= np.where((got * wanted).sum(axis=1, keepdims=True) < 0, -1, 1)
        np.testing.assert_allclose(got, wanted, atol=1e-5)
        pelvis_share = layer_weight * a["pelvis_mask"][mask]
        wanted = (1 - pelvis_share) * pelvis_before[c] + pelvis_share * oracle.blend(a["key_pelvis"], *keys)
        np.testing.assert_allclose(pelvis[c], wanted, atol=1e-5)


@settings(max_examples=30)
@given(
    seed=st.integers(0, 2**32 - 1),
    layer_weight=st.floats(0, 1, width=32),
    weight=st.lists(st.floats(0, 1, width=32), min_size=3, max_size=3).filter(lambda w: sum(w) > 1e-3),
    fraction=st.floats(0, 1, width=32),
)
def test_rotations_stay_of_unit_length(seed, layer_weight, weight, fraction):
    a = mixed_layers(np.random.default_rng(seed), 3)
    a["layer_weight"][:] = layer_weight
    a["weight"][:, :3] = weight
    a["weight"][:, 3] = 0
    a["fraction"][:] = fraction
    rotation, _ = run(a)
    length = np.linalg.norm(rotation.reshape(3, 4, 64).astype(float), axis=1)
    np.testing.assert_allclose(length, 1, atol=1e-6)


def test_one_key_is_given_back(rng):
    a = make(rng, 5, samples=1)
    a["fraction"][:] = 0
    rotation, pelvis = run(a)
    np.testing.assert_allclose(rotation, a["key_rotation"][a["frame"][:, 0]], atol=1e-7)
    np.testing.assert_array_equal(pelvis, a["key_pelvis"][a["frame"][:, 0]])


def test_only_ratios_of_weights_matter(rng):
    once, twice = (make(np.random.default_rng(3), 5) for _ in range(2))
    twice["weight"] *= np.float32(2)
    for one, other in zip(run(once), run(twice), strict=True):
        np.testing.assert_array_equal(one, other)


def test_layer_of_weight_zero_keeps_the_bits(rng):
    a = mixed_layers(rng, 6)
    a["layer_weight"][:] = 0
    before, pelvis_before = a["pose_rotation"].copy(), a["pose_pelvis"].copy()
    rotation, pelvis = run(a)
    np.testing.assert_array_equal(rotation, before)
    np.testing.assert_array_equal(pelvis, pelvis_before)


def test_mask_keeps_the_bits_of_a_joint_or_takes_those_of_the_layer(rng):
    full, masked = (make(np.random.default_rng(8), 5) for _ in range(2))
    masked["mask_index"][:] = PARTIAL
    before = masked["pose_rotation"].reshape(5, 4, 64).copy()
    wanted = run(full)[0].reshape(5, 4, 64)
    got = run(masked)[0].reshape(5, 4, 64)
    np.testing.assert_array_equal(got[:, :, UNTOUCHED_JOINT], before[:, :, UNTOUCHED_JOINT])
    np.testing.assert_array_equal(got[:, :, TAKEN_JOINT], wanted[:, :, TAKEN_JOINT])


def test_full_layer_does_not_read_the_old_pose(rng):
    fresh, spoilt = (make(np.random.default_rng(9), 5) for _ in range(2))
    spoilt["pose_rotation"][:] = np.nan
    spoilt["pose_pelvis"][:] = np.nan
    for one, other in zip(run(fresh), run(spoilt), strict=True):
        np.testing.assert_array_equal(one, other)


def test_mixing_takes_the_short_way():
    """Half way from -1 degree, written with the other sign, to +1 degree is no rotation."""
    half = np.deg2rad(0.5)
    a = make(np.random.default_rng(0), 1, samples=1)
    a["key_rotation"][:] = quaternions_to_row([[np.cos(half), np.sin(half), 0, 0]] * JOINTS)
    a["pose_rotation"][:] = -quaternions_to_row([[np.cos(half), -np.sin(half), 0, 0]] * JOINTS)
    a["layer_weight"][:] = 0.5
    got = row_to_quaternions(run(a)[0][0])[:JOINTS]
    np.testing.assert_allclose(np.abs(got), [[1, 0, 0, 0]] * JOINTS, atol=1e-6)


def test_samples_of_weight_zero_are_not_read(rng):
    a = make(rng, 4)
    a["key_rotation"][7] = np.nan
    a["key_pelvis"][7] = np.nan
    a["frame"][:] = np.where(a["frame"] == 7, 8, a["frame"])
    a["next_frame"][:] = np.where(a["next_frame"] == 7, 8, a["next_frame"])
    a["weight"][:, 2] = 0
    a["frame"][:, 2] = 7
    rotation, pelvis = run(a)
    assert np.isfinite(rotation).all()
    assert np.isfinite(pelvis).all()


def test_characters_without_weights_and_others_keep_their_pose(rng):
    a = make(rng, 5)
    a["weight"][1] = 0
    a["active"] = np.array([1, 3], np.int32)
    before = a["pose_rotation"].copy()
    rotation, _ = run(a)
    np.testing.assert_array_equal(rotation[[0, 1, 2, 4]], before[[0, 1, 2, 4]])
    assert (rotation[3] != before[3]).any()


def test_nobody_active_changes_nothing(rng):
    a = make(rng, 5)
    a["active"] = np.zeros(0, np.int32)
    before = a["pose_rotation"].copy()
    np.testing.assert_array_equal(run(a)[0], before)


def test_rotations_that_cancel_leave_the_joint_at_rest():
    a = make(np.random.default_rng(0), 1, samples=2)
    a["key_rotation"][0] = quaternions_to_row([[0, 1, 0, 0]] * JOINTS)
    a["key_rotation"][1] = quaternions_to_row([[0, -1, 0, 0]] * JOINTS)
    a["frame"][0] = a["next_frame"][0] = [0, 1]
    a["fraction"][:] = 0
    a["weight"][:] = 0.5
    np.testing.assert_array_equal(row_to_quaternions(run(a)[0][0]), [[1, 0, 0, 0]] * 64)


def test_a_bad_weight_shows_and_stays_with_its_character(rng):
    good, bad = (mixed_layers(np.random.default_rng(10), 20) for _ in range(2))
    for arguments in (good, bad):
        arguments["layer_weight"][6] = 0.5
    bad["weight"][6, 0] = np.nan
    wanted, got = run(good)[0], run(bad)[0]
    others = np.arange(20) != 6
    np.testing.assert_array_equal(got[others], wanted[others])
    assert np.isnan(got[6]).any()


def test_bits_do_not_depend_on_threads_order_or_number_of_characters(rng):
    serial, threaded = (mixed_layers(np.random.default_rng(4), 333) for _ in range(2))
    order = rng.permutation(333)
    shuffled = permuted(serial, order)
    few = permuted(serial, np.arange(333))
    few["active"] = np.arange(0, 333, 7, dtype=np.int32)
    wanted, pelvis = run(serial, blend_samples.serial)
    np.testing.assert_array_equal(run(threaded, blend_samples.threaded)[0], wanted)
    got, got_pelvis = run(shuffled, blend_samples.serial)
    np.testing.assert_array_equal(got, wanted[order])
    np.testing.assert_array_equal(got_pelvis, pelvis[order])
    np.testing.assert_array_equal(run(few, blend_samples.serial)[0][::7], wanted[::7])
