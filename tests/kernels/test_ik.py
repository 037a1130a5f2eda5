"""Inverse kinematics: against a slow twin, reachable targets reached, limits kept, nothing ever broken."""

import numpy as np
import pytest

from crowd.motion.body import build_skeleton
from crowd.motion.joint_tree import joint_tree
from crowd_kernels.ik import (
    CHUNKS,
    NONE,
    OUT_OF_REACH,
    REACHED,
    REFUSED,
    SETTINGS,
    scratch_length,
    solve_crowd,
)
from crowd_kernels.ik_tree import plain_tree
from tests.oracles import ik as oracle

SKELETON = build_skeleton()
POINT = np.array([0.0, -0.08, 0.0])


def random_pose(tree, rng):
    """Local rotations (K, 4) within the limits of a tree."""
    local = np.tile([1.0, 0.0, 0.0, 0.0], (len(tree.joint), 1))
    for k in np.flatnonzero(tree.weight > 0):
        if not tree.is_limited[k]:
            local[k] = oracle.quaternion(oracle.Rotation.from_rotvec(rng.normal(0, 0.3, 3)))
            continue
        angle, radius = rng.uniform(0, 2 * np.pi), np.sqrt(rng.random())
        share = np.array([np.cos(angle), np.sin(angle)]) * radius
        if 0 in tree.is_free[k, :2]:
            share = np.full(2, rng.uniform(-1, 1))
        inverse = tree.inverse_swing[k]
        swing = np.where(inverse > 0, share / np.where(inverse > 0, inverse, 1), 0)
        is_twisting = tree.is_free[k, 2] > 0
        low, high = 2 * np.arctan(np.asarray(tree.twist[k], float)) if is_twisting else (0, 0)
        local[k] = oracle.quaternion(oracle.join(tree, k, swing, rng.uniform(low, high)))
    return local


def resting(tree):
    """Arms hanging, elbows a little bent."""
    local = np.tile([1.0, 0.0, 0.0, 0.0], (len(tree.joint), 1))
    for k, joint in enumerate(tree.joint):
        if tree.component_step > 1 and "forearm" in SKELETON.joint_names[joint]:
            local[k] = (np.cos(0.4), -np.sin(0.4), 0.0, 0.0)
    return local


class Crowd:
    """Arguments of `solve_crowd` for one tree and given poses (N, K, 4)."""

    def __init__(self, tree, start, reference=None, last=None):
        self.tree, self.count = tree, len(start)
        effectors = len(tree.effector)
        segments = 8 if tree.component_step > 1 else 1
        self.scale = np.ones((self.count, segments), np.float32)
        self.task = np.full((self.count, effectors), 3, np.uint8)
        self.point = np.tile(POINT, (self.count, effectors, 1)).astype(np.float32)
        self.target = np.zeros((self.count, effectors, 3), np.float32)
        self.target_rotation = np.tile(np.array([1, 0, 0, 0], np.float32), (self.count, effectors, 1))
        self.pose = self.rows(start)
        self.reference = self.rows(start if reference is None else reference)
        self.last = self.pose if last is None else self.rows(last)
        self.root = np.zeros((self.count, 3), np.float32)
        self.active = np.arange(self.count, dtype=np.int32)
        length = scratch_length(len(tree.joint), effectors, segments)
        self.scratch = np.full((CHUNKS, length), np.nan, np.float32)
        self.status = np.full((self.count, effectors), 9, np.uint8)
        self.distance = np.zeros((self.count, effectors), np.float32)
        self.angle = np.zeros((self.count, effectors), np.float32)
        self.iterations = np.zeros(self.count, np.int32)

    def rows(self, local):
        """Pose rows of plain quaternions."""
        local = np.asarray(local, np.float32)
        if self.tree.component_step == 1:
            return local.reshape(self.count, -1).copy()
        rows = np.zeros((self.count, 4, self.tree.component_step), np.float32)
        rows[:, 0] = 1
        rows[:, :, self.tree.joint] = np.moveaxis(local, 1, 2)
        return rows.reshape(self.count, -1)

    def local(self):
        """Plain quaternions (N, K, 4) of the pose rows."""
        if self.tree.component_step == 1:
            return self.pose.reshape(self.count, -1, 4).astype(float)
        rows = self.pose.reshape(self.count, 4, -1)[:, :, self.tree.joint]
        return np.moveaxis(rows, 1, 2).astype(float)

    def aim_at(self, poses):
        """Take the effectors of poses (N, K, 4) as targets."""
        for character, local in enumerate(poses):
            tips, frames = self.tips(character, local)
            self.target[character] = tips
            self.target_rotation[character] = [oracle.quaternion(frame) for frame in frames]

    def tips(self, character, local):
        """Effectors of a pose: places and rotations."""
        scale = self.scale[character][self.tree.segment]
        places, frames = oracle.kinematics(self.tree.parent, self.tree.offset * scale[:, None], local)
        carriers = [frames[e] for e in self.tree.effector]
        ahead = [f.apply(p) for f, p in zip(carriers, self.point[character], strict=True)]
        return places[self.tree.effector] + ahead, carriers

    def errors(self):
        """Largest distance and angle to the targets of each character, by the twin's kinematics."""
        result = np.zeros((self.count, 2))
        for character, local in enumerate(self.local()):
            tips, frames = self.tips(character, local)
            result[character, 0] = np.linalg.norm(tips - self.target[character], axis=1).max()
            for frame, wanted in zip(frames, self.target_rotation[character], strict=True):
                angle = (oracle.rotation(wanted) * frame.inv()).magnitude()
                result[character, 1] = max(result[character, 1], angle)
        return result

    def solve(self, build=solve_crowd, **settings):
        build(
            self.tree, SETTINGS._replace(**settings), self.scale, self.task, self.point, self.target,
            self.target_rotation, self.reference, self.root, self.last, self.active, self.scratch, self.pose,
            self.root, self.status, self.distance, self.angle, self.iterations,
        )  # fmt: skip
        return self


def arm(side="right", **options):
    return joint_tree(SKELETON, [f"{side}_hand"], **options)


def both_arms(**options):
    return joint_tree(SKELETON, ["right_hand", "left_hand"], **options)


def crowd_of(tree, rng, count):
    crowd = Crowd(tree, np.tile(resting(tree), (count, 1, 1)))
    crowd.aim_at([random_pose(tree, rng) for _ in range(count)])
    return crowd


@pytest.mark.parametrize("task", [1, 2, 3])
@pytest.mark.parametrize("is_limited", [False, True])
@pytest.mark.parametrize("make", [arm, both_arms])
@pytest.mark.parametrize(
    ("place_first", "approach", "turn_error_damping"), [(0, 1.0, 0.0), (1, 1.0, 0.0), (1, 0.2, 6.0)]
)
def test_one_iteration_matches_the_slow_twin(
    rng, place_first, approach, turn_error_damping, make, is_limited, task
):
    tree = make(is_limited=is_limited)
    crowd = crowd_of(tree, rng, 24)
    start = np.array([random_pose(tree, rng) for _ in range(24)])
    crowd.pose = crowd.rows(start)
    crowd.reference = crowd.rows(np.tile(resting(tree), (24, 1, 1)))
    last = np.array([random_pose(tree, rng) for _ in range(24)])
    crowd.last = crowd.rows(last)
    crowd.task[:] = task
    settings = SETTINGS._replace(
        most_iterations=1,
        place_first=place_first,
        approach=approach,
        turn_error_damping=turn_error_damping,
    )
    crowd.solve(**settings._asdict())
    for character, got in enumerate(crowd.local()):
        wanted = oracle.iterate(
            tree, settings, start[character], resting(tree), last[character], crowd.point[character],
            crowd.target[character], crowd.target_rotation[character], crowd.task[character],
        )  # fmt: skip
        for k in np.flatnonzero(tree.weight > 0):
            off = (oracle.rotation(got[k]) * oracle.rotation(wanted[k]).inv()).magnitude()
            assert off < 1e-4, (character, k)


@pytest.mark.parametrize("side", ["right", "left"])
def test_all_positions_of_poses_in_limits_are_reached(rng, side):
    crowd = crowd_of(arm(side), rng, 1000)
    crowd.task[:] = 1
    crowd.solve()
    assert (crowd.status == REACHED).all()
    assert crowd.errors()[:, 0].max() < 1.05e-3
    assert max(oracle.violation(crowd.tree, local) for local in crowd.local()) < 1e-5


def test_positions_with_rotations_are_reached(rng):
    crowd = crowd_of(arm(), rng, 1000).solve()
    errors = crowd.errors()
    is_reached = (errors[:, 0] < 1.05e-3) & (errors[:, 1] < np.radians(1.05))
    assert is_reached.mean() >= 0.98
    assert ((crowd.status[:, 0] == REACHED) == is_reached).mean() > 0.998
    assert max(oracle.violation(crowd.tree, local) for local in crowd.local()) < 1e-5


def test_characters_reach_in_their_own_proportions(rng):
    crowd = crowd_of(arm(), rng, 100)
    crowd.scale[:] = rng.uniform(0.9, 1.1, crowd.scale.shape)
    crowd.aim_at([random_pose(crowd.tree, rng) for _ in range(100)])
    crowd.task[:] = 1
    crowd.solve()
    assert crowd.errors()[:, 0].max() < 1.05e-3


@pytest.mark.parametrize("task", [1, 3])
@pytest.mark.parametrize("is_limited", [False, True])
@pytest.mark.parametrize("make", [arm, both_arms])
def test_equal_bits_on_one_and_many_threads_and_in_any_order(make, is_limited, task):
    results = []
    for build in (solve_crowd.serial, solve_crowd.threaded):
        crowd = crowd_of(make(is_limited=is_limited), np.random.default_rng(4), 200)
        crowd.task[:] = task
        if build is solve_crowd.threaded:
            crowd.active = crowd.active[::-1].copy()
        results.append(crowd.solve(build).pose)
    np.testing.assert_array_equal(*results)


def test_bad_targets_are_refused_and_leave_the_pose_as_it_is(rng):
    crowd = crowd_of(arm(), rng, 20)
    before = crowd.pose.copy()
    crowd.target[3, 0, 1] = np.nan
    crowd.target[4, 0, 1] = np.inf
    crowd.target_rotation[5, 0] = 0
    crowd.task[6] = 0
    crowd.solve()
    assert (crowd.status[3:6] == REFUSED).all()
    assert (crowd.status[6] == NONE).all()
    np.testing.assert_allclose(crowd.pose[3:7], before[3:7], atol=1e-6)
    assert np.isfinite(crowd.pose).all()


def test_far_targets_are_approached_and_said_to_be_out_of_reach(rng):
    tree = plain_tree([-1, 0, 1], [[0, 0, 0], [0, -0.3, 0], [0, -0.3, 0]], [2])
    start = np.tile([1.0, 0.0, 0.0, 0.0], (40, 3, 1))
    crowd = Crowd(tree, start)
    crowd.task[:] = 1
    direction = rng.normal(size=(40, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    crowd.target[:, 0] = direction * rng.uniform(0.8, 5.0, (40, 1))
    crowd.solve(pull=0.0)
    assert (crowd.status == OUT_OF_REACH).all()
    for character, local in enumerate(crowd.local()):
        tips, _ = crowd.tips(character, local)
        np.testing.assert_allclose(tips[0], direction[character] * 0.995 * 0.68, atol=2e-3)


def test_a_straight_arm_and_a_chain_without_length_break_nothing(rng):
    tree = plain_tree([-1, 0, 1], [[0, 0, 0], [0, -0.3, 0], [0, -0.3, 0]], [2])
    crowd = Crowd(tree, np.tile([1.0, 0.0, 0.0, 0.0], (16, 3, 1)))
    crowd.task[:] = 1
    crowd.target[:, 0] = (0.02, -0.5, 0.01)
    crowd.solve()
    assert (crowd.status == REACHED).all()
    tree = plain_tree([-1, 0], np.zeros((2, 3)), [1])
    crowd = Crowd(tree, np.tile([1.0, 0.0, 0.0, 0.0], (16, 2, 1)))
    crowd.point[:] = 0
    crowd.target[:, 0] = (0.3, 0.0, 0.0)
    crowd.solve()
    assert np.isfinite(crowd.pose).all()
