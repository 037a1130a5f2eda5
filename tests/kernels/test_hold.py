"""Holds: against a slow twin, for any pose and any stage, and only where something is held."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from crowd.motion.body import build_skeleton
from crowd.motion.joint_tree import joint_tree
from crowd_kernels.clip import PADDED_JOINTS
from crowd_kernels.hold import aim_holds, apply_holds, hold_effectors
from tests.oracles import hold as oracle

TREE = joint_tree(build_skeleton(), ("right_hand", "left_hand", "head"))
COUNT, EFFECTORS = 6, 3
RATE, DT = 25.0, 1.0 / 60.0
ACTIVE = np.array([4, 1, 2, 5], np.int32)
INACTIVE = [0, 3]
SEEDS = st.integers(0, 2**32 - 1)


def unit(q):
    return (q / np.linalg.norm(q, axis=-1, keepdims=True)).astype(np.float32)


class People:
    """Random poses, places, holds in all states of fading."""

    def __init__(self, seed):
        rng = np.random.default_rng(seed)
        per_effector = (COUNT, EFFECTORS)
        self.scale = rng.uniform(0.8, 1.2, (COUNT, 8)).astype(np.float32)
        pose = np.moveaxis(unit(rng.normal(size=(COUNT, PADDED_JOINTS, 4))), 2, 1)
        self.pose = np.ascontiguousarray(pose.reshape(COUNT, -1))
        self.pelvis = rng.normal(0, 1, (COUNT, 3)).astype(np.float32)
        self.position, self.yaw = rng.normal(0, 10, (COUNT, 3)), rng.uniform(-4, 4, COUNT)
        self.task = rng.integers(0, 4, per_effector).astype(np.uint8)
        self.target = self.position[:, None] + rng.normal(0, 1, (*per_effector, 3))
        self.target_rotation = unit(rng.normal(size=(*per_effector, 4)))
        self.point = rng.normal(0, 0.1, (*per_effector, 3)).astype(np.float32)
        self.last_task = rng.integers(1, 4, per_effector).astype(np.uint8)
        self.weight = rng.choice([0.0, 0.0, 0.0005, 0.4, 1.0], per_effector).astype(np.float32)
        self.speed = np.where(self.weight > 0, rng.normal(0, 1, per_effector), 0).astype(np.float32)
        self.held = rng.normal(size=self.pose.shape).astype(np.float32)
        self.stage = rng.integers(0, 4, (COUNT, 2)).astype(np.uint8)
        self.out_target = np.full((*per_effector, 3), np.nan, np.float32)
        self.out_rotation = np.full((*per_effector, 4), np.nan, np.float32)
        self.status = np.full(per_effector, 9, np.uint8)
        self.mask = np.full(COUNT, 99, np.uint8)

    def hold(self, point):
        hold_effectors(
            TREE, self.scale, self.pose, self.pelvis, self.position, self.yaw, self.stage, point, ACTIVE,
            self.task, self.target, self.target_rotation, self.point,
        )  # fmt: skip

    def aim(self):
        aim_holds(
            TREE, RATE, DT, self.scale, self.pose, self.pelvis, self.position, self.yaw, self.task,
            self.target, self.target_rotation, self.point, ACTIVE, self.last_task, self.weight,
            self.speed, self.held,
            self.out_target, self.out_rotation, self.status, self.mask,
        )  # fmt: skip


def same_rotation(a, b):
    assert abs(float(np.dot(a, b))) == pytest.approx(1.0, abs=1e-6)


@given(SEEDS)
def test_hands_that_reach_are_held_where_they_are_and_those_on_their_way_back_are_followed(seed):
    people, before = People(seed), People(seed)
    point = np.array([0.02, -0.08, 0.01], np.float32)
    people.hold(point)
    for i in ACTIVE:
        places, frames = oracle.where_they_are(
            TREE, people.scale[i], people.pose[i], people.pelvis[i], people.position[i], people.yaw[i], point
        )
        for e in range(EFFECTORS):
            if e == 2 or people.stage[i, e] == oracle.NONE:
                assert people.task[i, e] == before.task[i, e]
                np.testing.assert_array_equal(people.target[i, e], before.target[i, e])
                continue
            assert people.task[i, e] == (0 if people.stage[i, e] == oracle.RETURN else 3)
            np.testing.assert_allclose(people.target[i, e], places[e], atol=1e-5)
            np.testing.assert_array_equal(people.point[i, e], point)
            same_rotation(people.target_rotation[i, e], frames[e])
    np.testing.assert_array_equal(people.target[INACTIVE], before.target[INACTIVE])
    np.testing.assert_array_equal(people.task[INACTIVE], before.task[INACTIVE])


@given(SEEDS)
def test_holds_fade_and_aim_as_the_slow_twin(seed):
    people, before = People(seed), People(seed)
    people.aim()
    for i in ACTIVE:
        places, frames = oracle.effectors(
            TREE, people.scale[i], people.pose[i], people.pelvis[i], people.point[i]
        )
        mask = 0
        for e in range(EFFECTORS):
            goal = float(before.task[i, e] != 0)
            weight, speed = oracle.faded(
                float(before.weight[i, e]), float(before.speed[i, e]), goal, RATE, DT
            )
            assert people.weight[i, e] == pytest.approx(weight, abs=1e-6)
            assert people.speed[i, e] == pytest.approx(speed, abs=1e-4)
            assert people.status[i, e] == 0
            if weight <= 0:
                assert people.last_task[i, e] == 0
                continue
            mask |= 1 << e
            task = before.task[i, e] or before.last_task[i, e]
            assert people.last_task[i, e] == task
            place, _ = oracle.aimed(
                task, weight, places[e], frames[e], people.position[i], people.yaw[i],
                people.target[i, e], people.target_rotation[i, e].astype(float),
            )  # fmt: skip
            np.testing.assert_allclose(people.out_target[i, e], place, atol=2e-5)
            assert np.linalg.norm(people.out_rotation[i, e]) == pytest.approx(1.0, abs=1e-6)
        assert people.mask[i] == mask
    assert (people.mask[INACTIVE] == 99).all()
    np.testing.assert_array_equal(people.weight[INACTIVE], before.weight[INACTIVE])


@given(SEEDS)
def test_targets_turn_as_the_slow_twin(seed):
    people = People(seed)
    people.aim()
    for i in ACTIVE:
        places, frames = oracle.effectors(
            TREE, people.scale[i], people.pose[i], people.pelvis[i], people.point[i]
        )
        for e in np.flatnonzero(people.weight[i] > 0):
            wanted = oracle.aimed(
                people.last_task[i, e], float(people.weight[i, e]), places[e], frames[e], people.position[i],
                people.yaw[i], people.target[i, e], people.target_rotation[i, e].astype(float),
            )[1]  # fmt: skip
            # Half a turn away both ways are as short, and rounding decides.
            own = oracle.quaternion(frames[e])
            turned = people.target_rotation[i, e].astype(float)
            back = oracle.Rotation.from_rotvec([0.0, -people.yaw[i], 0.0])
            if abs(own @ oracle.quaternion(back * oracle.rotation(turned))) > 1e-4:
                same_rotation(people.out_rotation[i, e].astype(float), wanted)


@given(SEEDS)
def test_solves_start_where_the_last_one_ended_and_only_held_joints_are_applied(seed):
    people, before = People(seed), People(seed)
    people.aim()
    apply_holds(TREE, people.held, people.mask, ACTIVE, people.pose)
    pose, held_pose, old_pose, old_held = (
        row.reshape(COUNT, 4, -1) for row in (people.pose, people.held, before.pose, before.held)
    )
    for i in range(COUNT):
        is_active = i in ACTIVE
        held = [e for e in range(EFFECTORS) if is_active and people.mask[i] >> e & 1]
        was_held = [e for e in range(EFFECTORS) if before.weight[i, e] > 0]
        turned = TREE.moves[held].any(axis=0)
        was_turned = TREE.moves[was_held].any(axis=0)
        for k, joint in enumerate(TREE.joint):
            if turned[k]:
                source = old_held if was_turned[k] else old_pose
                np.testing.assert_array_equal(held_pose[i, :, joint], source[i, :, joint])
                np.testing.assert_array_equal(pose[i, :, joint], source[i, :, joint])
            else:
                np.testing.assert_array_equal(pose[i, :, joint], old_pose[i, :, joint])
                if held and TREE.weight[k] == 0:
                    np.testing.assert_array_equal(held_pose[i, :, joint], old_pose[i, :, joint])
    others = np.setdiff1d(np.arange(PADDED_JOINTS), TREE.joint)
    np.testing.assert_array_equal(pose[:, :, others], old_pose[:, :, others])


def test_a_target_that_is_no_rotation_stays_none():
    people = People(1)
    people.task[:], people.weight[:] = 3, 1.0
    people.target_rotation[1, 0] = np.nan
    people.target[2, 1] = np.inf
    people.aim()
    assert np.isnan(people.out_rotation[1, 0]).all()
    assert not np.isfinite(people.out_target[2, 1]).all()
    assert np.isfinite(people.out_target[4]).all()


def test_nobody_active_changes_nothing():
    people, before = People(2), People(2)
    nobody = np.zeros(0, np.int32)
    hold_effectors(
        TREE, people.scale, people.pose, people.pelvis, people.position, people.yaw, people.stage,
        np.zeros(3, np.float32), nobody, people.task, people.target, people.target_rotation, people.point,
    )  # fmt: skip
    apply_holds(TREE, people.held, people.mask, nobody, people.pose)
    np.testing.assert_array_equal(people.target, before.target)
    np.testing.assert_array_equal(people.pose, before.pose)
