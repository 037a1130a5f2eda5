"""Forward kinematics and conversions against slow twins, and the properties that runs rely on."""

import numpy as np
import pytest

from crowd_kernels.pose import (
    CHUNKS,
    child_joint,
    joint_rotation,
    kinematics,
    local_rotations,
    scratch_length,
    set_joint_rotation,
)
from tests.oracles import pose as oracle

LEG = 6
PER_CHARACTER = ("segment_scale", "pose_rotation", "pose_pelvis")


def make(rng, count, joints=56):
    """Arguments of `kinematics` by name, in order: a random tree in random poses."""
    return {
        "parent": np.array([-1, *(rng.integers(max(0, i - 4), i) for i in range(1, joints))], np.int32),
        "offset": rng.normal(0, 0.2, (joints, 3)).astype(np.float32),
        "segment": rng.integers(0, 8, joints).astype(np.int32),
        "leg_segment": LEG,
        "segment_scale": rng.uniform(0.8, 1.2, (count, 8)).astype(np.float32),
        "pose_rotation": oracle.random_rows(rng, count, joints),
        "pose_pelvis": rng.normal(0, 1, (count, 3)).astype(np.float32),
        "active": np.arange(count, dtype=np.int32),
        "scratch": np.full((CHUNKS, scratch_length(joints, 8)), np.nan, np.float32),
        "out_joint_position_model": np.full((count, joints, 3), 9, np.float32),
        "out_joint_rotation_model": np.full((count, joints, 4), 9, np.float32),
    }


def run(arguments, build=kinematics):
    """Compute, and return positions and rotations."""
    build(*arguments.values())
    return arguments["out_joint_position_model"], arguments["out_joint_rotation_model"]


def assert_matches_oracle(a, characters):
    for c in characters:
        position, rotation = oracle.kinematics(
            a["parent"],
            a["offset"],
            a["segment"],
            LEG,
            a["segment_scale"][c],
            oracle.row_to_quaternions(a["pose_rotation"][c]),
            a["pose_pelvis"][c],
        )
        np.testing.assert_allclose(a["out_joint_position_model"][c], position, atol=1e-5)
        got = [oracle.matrix(q) for q in a["out_joint_rotation_model"][c]]
        np.testing.assert_allclose(got, rotation, atol=1e-5)


@pytest.mark.parametrize("count", [0, 1, 15, 16, 17, 40])
def test_matches_oracle_with_any_tail(rng, count):
    a = make(rng, count)
    run(a)
    assert_matches_oracle(a, range(count))


@pytest.mark.parametrize("joints", [1, 2, 20, 64])
def test_matches_oracle_with_any_skeleton(rng, joints):
    a = make(rng, 18, joints)
    run(a)
    assert_matches_oracle(a, range(18))


def test_only_active_rows_are_written(rng):
    a = make(rng, 50)
    a["active"] = np.flatnonzero(rng.random(50) < 0.4).astype(np.int32)
    position, rotation = run(a)
    assert_matches_oracle(a, a["active"])
    others = np.setdiff1d(np.arange(50), a["active"])
    np.testing.assert_array_equal(position[others], 9)
    np.testing.assert_array_equal(rotation[others], 9)


def test_nobody_active_writes_nothing(rng):
    a = make(rng, 5)
    a["active"] = np.zeros(0, np.int32)
    np.testing.assert_array_equal(run(a)[0], 9)


def test_rotations_are_of_unit_length(rng):
    length = np.linalg.norm(run(make(rng, 64))[1].astype(float), axis=2)
    np.testing.assert_allclose(length, 1, atol=1e-5)


def test_bones_keep_the_length_of_their_segment(rng):
    a = make(rng, 33)
    position, _ = run(a)
    bone = np.linalg.norm(position[:, 1:] - position[:, a["parent"][1:]], axis=2)
    wanted = np.linalg.norm(a["offset"][1:], axis=1) * a["segment_scale"][:, a["segment"][1:]]
    np.testing.assert_allclose(bone, wanted, atol=1e-5)


def test_a_person_twice_as_large_stands_twice_as_high(rng):
    once, twice = (make(np.random.default_rng(5), 16) for _ in range(2))
    twice["segment_scale"] *= np.float32(2)
    np.testing.assert_array_equal(run(twice)[0], 2 * run(once)[0])


def test_rest_pose_adds_up_offsets(rng):
    a = make(rng, 3)
    a["segment_scale"][:] = 1
    a["pose_rotation"][:] = oracle.quaternions_to_row([[1, 0, 0, 0]] * 56)
    position, rotation = run(a)
    wanted = a["pose_pelvis"][:, None].repeat(56, axis=1).astype(float)
    for joint in range(1, 56):
        wanted[:, joint] = wanted[:, a["parent"][joint]] + a["offset"][joint]
    np.testing.assert_allclose(position, wanted, atol=1e-6)
    np.testing.assert_array_equal(rotation, np.broadcast_to(np.float32([1, 0, 0, 0]), (3, 56, 4)))


def test_a_bad_pose_stays_with_its_character(rng):
    good, bad = (make(np.random.default_rng(6), 20) for _ in range(2))
    bad["pose_rotation"][6, 0] = np.nan
    wanted, got = run(good)[0], run(bad)[0]
    others = np.arange(20) != 6
    np.testing.assert_array_equal(got[others], wanted[others])
    assert np.isnan(got[6]).any()


def test_bits_do_not_depend_on_threads_order_or_number_of_characters(rng):
    serial, threaded, few, shuffled = (make(np.random.default_rng(2), 333) for _ in range(4))
    order = rng.permutation(333)
    for name in PER_CHARACTER:
        shuffled[name] = np.ascontiguousarray(shuffled[name][order])
    few["active"] = np.arange(0, 333, 7, dtype=np.int32)
    for index in range(2):
        wanted = run(serial, kinematics.serial)[index]
        np.testing.assert_array_equal(run(threaded, kinematics.threaded)[index], wanted)
        np.testing.assert_array_equal(run(shuffled, kinematics.serial)[index], wanted[order])
        np.testing.assert_array_equal(run(few, kinematics.serial)[index][::7], wanted[::7])


@pytest.mark.parametrize("joints", [1, 20, 64])
def test_local_rotations_are_those_of_the_rows(rng, joints):
    rows = oracle.random_rows(rng, 40, joints)
    active = np.flatnonzero(rng.random(40) < 0.6).astype(np.int32)
    serial, threaded = (np.full((40, joints, 4), 9, np.float32) for _ in range(2))
    local_rotations.serial(rows, active, np.zeros((CHUNKS, 256), np.float32), serial)
    local_rotations.threaded(rows, active, np.zeros((CHUNKS, 256), np.float32), threaded)
    np.testing.assert_array_equal(serial, threaded)
    for character in range(40):
        wanted = oracle.row_to_quaternions(rows[character])[:joints] if character in active else 9
        np.testing.assert_array_equal(serial[character], np.float32(wanted))


def test_kernels_count_no_references(rng):
    """Counting them would take longer than the work on short rows."""
    rows, out = oracle.random_rows(rng, 4, 20), np.empty((4, 20, 4), np.float32)
    local_rotations.serial(rows, np.arange(4, dtype=np.int32), np.zeros((CHUNKS, 256), np.float32), out)
    for text in local_rotations.serial.inspect_llvm().values():
        assert "call void @NRT_incref" not in text
        assert "call void @NRT_decref" not in text


def test_one_joint_is_read_and_written(rng):
    row = oracle.random_rows(rng, 1, 56)[0]
    wanted = oracle.row_to_quaternions(row)
    assert joint_rotation(row, 11) == tuple(wanted[11])
    wanted[11] = (0.5, -0.5, 0.5, 0.5)
    set_joint_rotation(row, 11, (0.5, -0.5, 0.5, 0.5))
    np.testing.assert_array_equal(oracle.row_to_quaternions(row), wanted)


def test_walking_along_a_chain_gives_the_joints_of_the_tree(rng):
    a = make(rng, 3)
    position, rotation = run(a)
    row, scale = a["pose_rotation"][2], a["segment_scale"][2].astype(float)
    chain = [55]
    while a["parent"][chain[0]] >= 0:
        chain.insert(0, int(a["parent"][chain[0]]))
    turn, place = joint_rotation(row, 0), tuple(a["pose_pelvis"][2] * scale[LEG])
    for joint in chain[1:]:
        offset = tuple(a["offset"][joint] * scale[a["segment"][joint]])
        turn, place = child_joint(turn, place, offset, joint_rotation(row, joint))
        np.testing.assert_allclose(place, position[2, joint], atol=1e-5)
        np.testing.assert_allclose(turn, rotation[2, joint], atol=1e-5)
