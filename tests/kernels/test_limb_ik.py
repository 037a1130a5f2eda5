"""Two-bone limbs meet their targets, bend the right way, and say when they cannot."""

import numpy as np
import pytest

from crowd_kernels.limb_ik import DEGENERATE, REACHED, TOO_CLOSE, TOO_FAR, bend_rotations, crowd_two_bone_ik
from tests.oracles import limb_ik as oracle

UPPER, LOWER = 0.43, 0.41
COUNT = 400


def solve(target, pole, root=None):
    root = np.zeros_like(target) if root is None else root
    middle, end = root + (0.0, -UPPER, 0.0), root + (0.0, -UPPER - LOWER * 0.8, LOWER * 0.6)
    out = np.empty_like(target), np.empty_like(target), np.empty(len(target), np.int64)
    crowd_two_bone_ik(root, middle, end, target, pole, *out)
    return out


def reachable_targets(rng):
    direction = rng.normal(size=(COUNT, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    return direction * rng.uniform(abs(UPPER - LOWER) + 0.01, UPPER + LOWER - 1e-3, (COUNT, 1))


def test_reachable_targets_are_met_exactly_with_rigid_bones(rng):
    root, pole = rng.normal(size=(COUNT, 3)), rng.normal(size=(COUNT, 3))
    target = root + reachable_targets(rng)
    middle, end, status = solve(target, pole, root)
    assert (status == REACHED).all()
    np.testing.assert_allclose(end, target, atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(middle - root, axis=1), UPPER, atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(end - middle, axis=1), LOWER, atol=1e-9)


@pytest.mark.parametrize("pole", [(0.0, -1.0, 0.0), (0.3, -0.5, 0.7), (0.0, 1e-13, 0.0)])
def test_straight_limbs_meet_targets_to_any_side(rng, pole):
    side = np.array([[0.0, 0.0, 0.5], [0.0, 0.5, 0.0], [0.5, 0.0, 0.0], [0.0, -0.5, 0.0]])
    target = np.concatenate([reachable_targets(rng), side])
    root = np.zeros_like(target)
    for axis in np.eye(3):
        out = np.empty_like(target), np.empty_like(target), np.empty(len(target), np.int64)
        poles = np.tile(pole, (len(target), 1))
        crowd_two_bone_ik(root, root + UPPER * axis, root + (UPPER + LOWER) * axis, target, poles, *out)
        middle, end, status = out
        assert (status == REACHED).all()
        np.testing.assert_allclose(end, target, atol=1e-9)
        np.testing.assert_allclose(np.linalg.norm(middle, axis=1), UPPER, atol=1e-9)


def test_the_middle_joint_stands_where_the_oracle_puts_it(rng):
    target, pole = reachable_targets(rng), rng.normal(size=(COUNT, 3))
    middle, _, _ = solve(target, pole)
    for index in range(COUNT):
        wanted = oracle.middle_joint(np.zeros(3), target[index], pole[index], UPPER, LOWER)
        np.testing.assert_allclose(middle[index], wanted, atol=1e-7)


def test_targets_out_of_reach_are_approached():
    far, near, none = np.array([[0.0, -3.0, 0.0], [0.0, -0.001, 0.0], [0.0, 0.0, 0.0]])[:, None]
    pole = np.array([[0.0, 0.0, 1.0]])
    _, end, status = solve(far, pole)
    assert status[0] == TOO_FAR
    np.testing.assert_allclose(end[0], [0, -UPPER - LOWER, 0], atol=1e-9)
    _, end, status = solve(near, pole)
    assert status[0] == TOO_CLOSE
    assert np.linalg.norm(end[0]) == pytest.approx(UPPER - LOWER, abs=1e-9)
    _, end, status = solve(none, pole)
    assert status[0] == DEGENERATE
    assert np.isfinite(end).all()


def test_a_bone_without_length_turns_nothing():
    first, second, status = bend_rotations(
        (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, -1.0, 0.0), (1.0, 0.0, 0.0), (1.0, 0.0, 0.0), 1.0
    )
    assert status == DEGENERATE
    assert first == second == (1.0, 0.0, 0.0, 0.0)


def test_a_straight_leg_bends_about_the_hinge_so_that_the_knee_comes_forward():
    first, second, status = bend_rotations(
        (0.0, 0.0, 0.0), (0.0, -0.43, 0.0), (0.0, -0.84, 0.0), (0.0, -0.7, 0.0), (1.0, 0.0, 0.0), 1.0
    )
    assert status == REACHED
    knee = oracle.rotate(first, [0.0, -0.43, 0.0])
    ankle = knee + oracle.rotate(first, oracle.rotate(second, [0.0, -0.41, 0.0]))
    np.testing.assert_allclose(ankle, [0.0, -0.7, 0.0], atol=1e-12)
    assert knee[2] > 0.1


def test_equal_bits_on_one_and_many_threads(rng):
    target, pole = reachable_targets(rng), rng.normal(size=(COUNT, 3))
    root = np.zeros((COUNT, 3))
    arguments = (root, root + (0, -UPPER, 0), root + (0, -UPPER - LOWER, 0.01), target, pole)
    results = []
    for build in (crowd_two_bone_ik.serial, crowd_two_bone_ik.threaded):
        out = np.zeros((COUNT, 3)), np.zeros((COUNT, 3)), np.zeros(COUNT, np.int64)
        build(*arguments, *out)
        results.append(out)
    for one, other in zip(*results, strict=True):
        np.testing.assert_array_equal(one, other)
