"""Corrections of reaches: against a slow twin, back and forth, and only for who is active."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from crowd.motion.body import build_skeleton
from crowd.motion.joint_tree import joint_tree
from crowd_kernels.clip import PADDED_JOINTS
from crowd_kernels.reach_correction import LANES, keep_corrections, start_solves
from tests.oracles import reach_correction as oracle
from tests.oracles.ik import violation

TREE = joint_tree(build_skeleton(), ("right_hand", "left_hand"))
COUNT = 6
ACTIVE = np.array([4, 1, 2, 5], np.int32)
INACTIVE = [0, 3]
BOTH = np.full((COUNT, 2), 1, np.uint8)
WHOLE = np.ones((COUNT, 2), np.float32)
WAITED = np.ones(COUNT)
WAITED[ACTIVE[1]] = 0.0
SEEDS = st.integers(0, 2**32 - 1)


def poses(rng):
    """Pose rows (N, 256) of random unit quaternions."""
    q = rng.normal(size=(COUNT, PADDED_JOINTS, 4))
    q /= np.linalg.norm(q, axis=-1, keepdims=True)
    return np.ascontiguousarray(np.moveaxis(q, 2, 1).reshape(COUNT, -1).astype(np.float32))


def local(row):
    """Rotations (K, 4) of the tree's joints."""
    return row.reshape(4, -1)[:, TREE.joint].T.astype(float)


def vectors(row):
    """Corrections (K, 3)."""
    return row.reshape(3, LANES)[:, : len(TREE.joint)].T.astype(float)


def keep(solution, pose, correction, last, change=None, most=10.0, slowest=0.0, bound=WHOLE, waited=WAITED):
    """Keep corrections; gives the distances of hands, 0 where joints are as solved."""
    change = np.zeros_like(correction) if change is None else change
    distance = np.zeros((COUNT, 2), np.float32)
    keep_corrections(
        TREE, most, slowest, BOTH, bound, waited, solution, ACTIVE, pose, correction, change, last, distance
    )
    return distance


def near(rows, angle, rng):
    """Pose rows turned by up to an angle, rad, about any axis."""
    turn = Rotation.from_rotvec(rng.uniform(-1, 1, (COUNT * PADDED_JOINTS, 3)) * angle / np.sqrt(3))
    q = rows.reshape(COUNT, 4, -1).transpose(0, 2, 1).reshape(-1, 4).astype(float)
    turned = (turn * Rotation.from_quat(q[:, [1, 2, 3, 0]])).as_quat()[:, [3, 0, 1, 2]]
    rows = np.moveaxis(turned.reshape(COUNT, PADDED_JOINTS, 4), 2, 1).reshape(COUNT, -1)
    return np.ascontiguousarray(rows.astype(np.float32))


@given(SEEDS)
def test_solves_start_from_the_corrected_blend(seed):
    rng = np.random.default_rng(seed)
    pose, start = poses(rng), np.full((COUNT, 4 * PADDED_JOINTS), np.nan, np.float32)
    correction = rng.uniform(-0.5, 0.5, (COUNT, 3 * LANES)).astype(np.float32)
    task = rng.integers(0, 4, (COUNT, 2)).astype(np.uint8)
    share, bound = rng.uniform(0.0, 1.0, (2, COUNT, 2)).astype(np.float32)
    last = poses(rng)
    last[2] = 0.0
    before = last.copy()
    start_solves(TREE, task, share, bound, correction, pose, ACTIVE, last, start)
    for i in ACTIVE:
        wanted = oracle.started(TREE, task[i], share[i], vectors(correction[i]), local(pose[i]))
        same = np.abs(np.sum(wanted * local(start[i]), axis=1))
        np.testing.assert_allclose(same, 1.0, atol=1e-6)
        wanted = oracle.last(TREE, task[i], bound[i], local(before[i]), local(start[i]))
        same = np.abs(np.sum(wanted * local(last[i]), axis=1))
        np.testing.assert_allclose(same, 1.0, atol=1e-5)
    assert np.isnan(start[INACTIVE]).all()
    np.testing.assert_array_equal(last[INACTIVE], before[INACTIVE])


@given(SEEDS)
def test_what_is_kept_brings_the_blend_to_the_solution_again(seed):
    rng = np.random.default_rng(seed)
    solution, pose = poses(rng), poses(rng)
    before, correction = pose.copy(), np.zeros((COUNT, 3 * LANES), np.float32)
    last = np.zeros_like(pose)
    keep(solution, pose, correction, last)
    turning = TREE.weight > 0
    for i in ACTIVE:
        wanted = oracle.kept(TREE, local(solution[i]), local(before[i]))
        # Half a turn away both signs are as good.
        clear = np.linalg.norm(wanted, axis=1) < 0.999
        np.testing.assert_allclose(vectors(correction[i])[clear], wanted[clear], atol=1e-5)
        np.testing.assert_array_equal(local(pose[i])[turning], local(solution[i])[turning])
        np.testing.assert_array_equal(local(last[i])[turning], local(solution[i])[turning])
        np.testing.assert_array_equal(local(pose[i])[~turning], local(before[i])[~turning])
        again = oracle.started(TREE, BOTH[i], WHOLE[i], vectors(correction[i]), local(before[i]))
        same = np.abs(np.sum(again * local(pose[i]), axis=1))
        np.testing.assert_allclose(same[clear], 1.0, atol=1e-4)
    others = np.setdiff1d(np.arange(PADDED_JOINTS), TREE.joint)
    rows, old = pose.reshape(COUNT, 4, -1), before.reshape(COUNT, 4, -1)
    np.testing.assert_array_equal(rows[:, :, others], old[:, :, others])
    np.testing.assert_array_equal(rows[INACTIVE], old[INACTIVE])
    assert not correction[INACTIVE].any()


def test_no_correction_leaves_the_pose_as_it_is(rng):
    pose, start = poses(rng), np.zeros((COUNT, 4 * PADDED_JOINTS), np.float32)
    correction = np.zeros((COUNT, 3 * LANES), np.float32)
    last = np.zeros_like(pose)
    start_solves(TREE, BOTH, WHOLE, WHOLE, correction, pose, ACTIVE, last, start)
    for i in ACTIVE:
        np.testing.assert_allclose(local(start[i]), local(pose[i]), atol=1e-6)
    keep(pose.copy(), pose, correction, last)
    assert np.abs(correction).max() < 1e-6


def test_an_arm_without_a_task_keeps_no_correction(rng):
    """What is left of a reach that has ended would otherwise stay while the other hand goes on reaching."""
    pose, start = poses(rng), np.zeros((COUNT, 4 * PADDED_JOINTS), np.float32)
    correction = np.full((COUNT, 3 * LANES), 0.2, np.float32)
    right = np.tile(np.array([1, 0], np.uint8), (COUNT, 1))
    last = np.zeros_like(pose)
    start_solves(TREE, right, WHOLE, WHOLE, correction, pose, ACTIVE, last, start)
    keep(start, pose, correction, last)
    only_left = (TREE.moves[1] > 0) & (TREE.moves[0] == 0)
    for i in ACTIVE:
        kept = np.abs(vectors(correction[i])).max(axis=1)
        assert kept[only_left].max() < 1e-6
        np.testing.assert_allclose(kept[TREE.moves[0] > 0], 0.2, atol=1e-5)


@given(SEEDS)
def test_corrections_change_their_speed_gradually_and_joints_stay_within_limits(seed):
    """Hands out of reach come into reach with straight elbows, which would bend at any speed."""
    rng = np.random.default_rng(seed)
    upright = np.zeros((COUNT, 4 * PADDED_JOINTS), np.float32)
    upright[:, :PADDED_JOINTS] = 1.0
    pose = near(upright, 0.8, rng)
    solution, before, most = near(pose, 0.3, rng), pose.copy(), 0.02
    correction = rng.uniform(-0.1, 0.1, (COUNT, 3 * LANES)).astype(np.float32)
    change = rng.uniform(-0.02, 0.02, correction.shape).astype(np.float32)
    expected, old = correction + change, correction.copy()
    last = np.zeros_like(pose)
    distance = keep(solution, pose, correction, last, change, most)
    turning = TREE.weight > 0
    for i in ACTIVE:
        for k in np.flatnonzero(turning):
            place = vectors(expected[i])[k]
            solved, blended = local(solution[i])[k], local(before[i])[k]
            wanted = oracle.eased(TREE, k, solved, blended, place, most)
            assert abs(wanted @ local(pose[i])[k]) > 1 - 1e-5
            if not TREE.is_limited[k]:
                assert np.linalg.norm(vectors(correction[i])[k] - place) < most + 1e-5
        worst = max(violation(TREE, local(solution[i])), 1e-4)
        assert violation(TREE, local(pose[i])) < worst + 1e-4
        moved = vectors(correction[i] - old[i])[turning]
        np.testing.assert_allclose(vectors(change[i])[turning], moved, atol=1e-6)
        np.testing.assert_array_equal(local(last[i])[turning], local(pose[i])[turning])
    assert (distance[ACTIVE] > 1.0).all(), "hands are found anew"
    assert not distance[INACTIVE].any()
    np.testing.assert_array_equal(pose[INACTIVE], before[INACTIVE])


def test_corrections_that_go_on_as_they_did_are_left_alone(rng):
    pose = poses(rng)
    solution, correction = near(pose, 0.05, rng), np.zeros((COUNT, 3 * LANES), np.float32)
    distance = keep(solution, pose, correction, np.zeros_like(pose), most=0.06)
    assert not distance.any()
    turning = TREE.weight > 0
    for i in ACTIVE:
        np.testing.assert_array_equal(local(pose[i])[turning], local(solution[i])[turning])


def test_people_who_only_creep_rest_where_both_hands_wait(rng):
    pose = poses(rng)
    last, correction = near(pose, 0.3, rng), np.zeros((COUNT, 3 * LANES), np.float32)
    still, moving = ACTIVE[0], ACTIVE[2]
    solution, before = near(last, 0.001, rng), last.copy()
    solution[moving] = near(last, 0.1, rng)[moving]
    distance = keep(solution, pose, correction, last, slowest=0.001)
    turning = TREE.weight > 0
    for person in (still, ACTIVE[3]):
        np.testing.assert_array_equal(local(pose[person])[turning], local(before[person])[turning])
        assert (distance[person] > 1.0).all(), "hands are found anew"
    for person in (moving, ACTIVE[1]):
        np.testing.assert_array_equal(local(pose[person])[turning], local(solution[person])[turning])
        assert not distance[person].any()


def test_the_longer_people_wait_the_faster_joints_come_to_rest(rng):
    pose = poses(rng)
    last, correction = near(pose, 0.3, rng), np.zeros((COUNT, 3 * LANES), np.float32)
    solution, before = near(last, 0.02, rng), last.copy()
    waited = np.array([0.0, 1.0, 8.0, 0.0, 4.0, 2.0])
    keep(solution, pose, correction, last, slowest=0.002, waited=waited)
    turning = TREE.weight > 0
    for person in ACTIVE:
        half = np.linalg.norm(local(solution[person]) - local(before[person]), axis=1)[turning].max()
        rests = half < 0.002 * waited[person]
        wanted = before if rests else solution
        np.testing.assert_array_equal(local(pose[person])[turning], local(wanted[person])[turning])
    assert not np.array_equal(pose[2], solution[2])
    assert np.array_equal(local(pose[1])[turning], local(solution[1])[turning])


def test_joints_that_are_not_bound_turn_as_solved(rng):
    """What is left of the correction of a hand that is back would otherwise be dropped in one step."""
    pose = poses(rng)
    solution, correction = near(pose, 0.3, rng), np.zeros((COUNT, 3 * LANES), np.float32)
    bound = np.tile(np.array([1.0, 1e-5], np.float32), (COUNT, 1))
    keep(solution, pose, correction, np.zeros_like(pose), most=0.001, bound=bound)
    only_left = (TREE.moves[1] > 0) & (TREE.moves[0] == 0)
    for person in ACTIVE:
        same = (local(pose[person]) == local(solution[person])).all(axis=1)
        assert same[only_left].all()
        assert not same[TREE.moves[0] > 0].any()
