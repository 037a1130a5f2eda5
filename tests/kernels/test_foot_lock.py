"""Planted feet stay in place under bodies that slip, turn and sway, and are let go softly."""

import numpy as np
import pytest

from crowd.controllers.foot_lock import FootLock
from crowd.motion.body import build_skeleton
from tests.oracles import pose as oracle

DT = 1 / 60
SKELETON = build_skeleton()
SIDES = ("right", "left")


class Puppet:
    """People on slightly bent legs whose root is moved about."""

    def __init__(self, count=1, scale=1.0, dt=DT):
        self.count, self.dt = count, dt
        self.lock = FootLock(SKELETON, capacity=count, dt=dt)
        self.scale = np.full((count, 8), scale, np.float32)
        self.position, self.yaw = np.zeros((count, 3)), np.zeros(count)
        self.contact = np.full((count, 2), 2, np.uint8)
        self.point, self.effective = np.zeros((count, 2, 2, 3)), np.zeros((count, 2), np.uint8)
        self.pose, self.pelvis = np.zeros((count, 256), np.float32), np.zeros((count, 3), np.float32)

    def step(self, sink=0.04, stride=0.0):
        """Lock legs that are bent as far as the pelvis sinks, m; a stride, rad, puts the left one forward."""
        quaternions = np.zeros((SKELETON.joint_count, 4))
        quaternions[:, 0] = 1
        bend = np.arccos(1 - sink / 0.86)
        standing = (("thigh", -bend), ("shank", 2 * bend), ("foot", -bend))
        striding = (("thigh", -stride), ("shank", 0.01), ("foot", stride))
        for side, angles in (("right", standing), ("left", striding if stride else standing)):
            for part, angle in angles:
                quaternions[SKELETON.joint(f"{side}_{part}")] = [np.cos(angle / 2), np.sin(angle / 2), 0, 0]
        self.pose[:] = oracle.quaternions_to_row(quaternions)
        self.pelvis[:] = SKELETON.offset[0] - (0, sink, 0)
        self.lock.evaluate(
            self.pose,
            self.pelvis,
            self.scale,
            self.position,
            self.yaw,
            self.contact,
            np.arange(self.count, dtype=np.int32),
            self.dt,
            self.point,
            self.effective,
        )
        return self.point[..., [0, 2]].copy()


def ankle_from_pose(puppet, side):
    """Ankle in the world by the kinematics oracle, from the pose that the lock wrote."""
    position, _ = oracle.kinematics(
        SKELETON.parent,
        SKELETON.offset,
        SKELETON.segment,
        6,
        puppet.scale[0],
        oracle.row_to_quaternions(puppet.pose[0])[: SKELETON.joint_count],
        puppet.pelvis[0],
    )
    return position[SKELETON.joint(f"{side}_foot")] + puppet.position[0]


@pytest.mark.parametrize("scale", [0.85, 1.0, 1.12])
def test_a_planted_foot_stays_while_the_root_slips(scale):
    puppet = Puppet(scale=scale)
    planted = puppet.step()
    for step in range(50):
        puppet.position[0, 2] += 0.15 * DT
        puppet.position[0, 0] = 0.02 * np.sin(0.3 * step)
        now = puppet.step()
        assert np.abs(now[:, :, 1] - planted[:, :, 1]).max() < 1e-4
    assert (puppet.effective == 2).all()
    assert np.abs(puppet.point[..., 1]).max() < 2e-3, "the sole is on the ground"


def test_the_reported_points_are_those_of_the_pose_that_is_written():
    puppet = Puppet()
    puppet.step()
    puppet.position[0] = (0.03, 0, 0.08)
    puppet.step()
    for leg, side in enumerate(("right", "left")):
        ankle = ankle_from_pose(puppet, side)
        reach = np.linalg.norm(puppet.point[0, leg, 0] - ankle)
        heel = np.linalg.norm(puppet.lock.legs.sole[leg, 0])
        assert reach == pytest.approx(heel, abs=1e-4)


def test_a_planted_foot_keeps_its_heading_until_it_must_pivot():
    puppet = Puppet()
    planted = puppet.step()
    for _ in range(25):
        puppet.yaw[0] += 0.4 * DT
        now = puppet.step()
    assert np.abs(now - planted).max() < 1e-3
    for _ in range(200):
        puppet.yaw[0] += 0.4 * DT
        puppet.step()
    turned = puppet.lock.yaw_offset[0]
    assert (np.abs(turned) <= 0.6 + 1e-9).all()


def test_a_foot_that_is_dragged_too_far_is_let_go_without_a_jump():
    puppet = Puppet()
    last = puppet.step()
    moved = []
    for _ in range(80):
        puppet.position[0, 2] += 0.5 * DT
        now = puppet.step()
        moved.append(np.linalg.norm(now - last, axis=-1).max())
        last = now
    assert puppet.lock.is_released.any()
    assert max(moved) < 0.06, "the foot glides back"
    offset = np.linalg.norm(puppet.lock.offset[0], axis=1)
    assert (offset[puppet.lock.is_released[0]] < 0.03).all()


def test_a_lifted_foot_finds_back_smoothly_and_is_planted_anew():
    puppet = Puppet()
    puppet.step()
    for _ in range(30):
        puppet.position[0, 2] += 0.1 / 30
        puppet.step()
    puppet.contact[0, 1] = 0
    offsets = []
    for _ in range(40):
        puppet.step()
        offsets.append(np.linalg.norm(puppet.lock.offset[0, 1]))
    steps = np.diff(offsets)
    assert offsets[-1] < 0.003
    assert np.abs(np.diff(steps)).max() < 0.004, "no jump in speed"
    puppet.contact[0, 1] = 1
    planted = puppet.step()[0, 1, 0]
    puppet.position[0, 2] += 0.05
    assert np.abs(puppet.step()[0, 1, 0] - planted).max() < 1e-4


def test_the_hand_over_from_heel_to_ball_keeps_the_foot():
    puppet = Puppet()
    puppet.contact[:] = 1
    puppet.step()
    puppet.position[0, 2] = 0.06
    before = puppet.step()
    puppet.contact[:] = 2
    after = puppet.step()
    assert np.abs(after - before).max() < 1e-6


def test_the_pelvis_comes_down_for_feet_out_of_reach():
    puppet = Puppet()
    puppet.step(sink=0.01)
    for _ in range(30):
        puppet.position[0, 2] += 0.3 * DT
        puppet.step(sink=0.01)
    assert 0.0 < puppet.lock.drop[0] < 0.12


def knee_angles(puppet):
    """Angle of each knee, rad."""
    rows = oracle.row_to_quaternions(puppet.pose[0])
    return np.array([2 * np.arccos(abs(rows[SKELETON.joint(f"{side}_shank")][0])) for side in SIDES])


def straighten(puppet, seconds=0.8, deep=0.30, high=0.0):
    """Knee angles (F, 2) and ankle heights (F, 2) while the body rises until it hangs above its feet."""
    angles, heights = [], []
    for time in np.arange(0, seconds + 0.5, puppet.dt):
        share = min(time / seconds, 1)
        rise = share**3 * (share * (6 * share - 15) + 10)
        puppet.step(sink=deep + (high - deep) * rise)
        angles.append(knee_angles(puppet))
        heights.append([ankle_from_pose(puppet, side)[1] for side in SIDES])
    return np.array(angles), np.array(heights)


@pytest.mark.parametrize("frame_rate", [60, 120, 240])
def test_knees_do_not_stop_dead_when_legs_straighten(frame_rate):
    puppet = Puppet(dt=1 / frame_rate)
    angles, _ = straighten(puppet)
    speed = np.diff(angles, axis=0) * frame_rate
    free = 2 * np.arccos(1 - 0.3 / 0.86) / 0.8
    assert np.abs(speed).max() > free, "the knees move"
    assert np.abs(np.diff(speed, axis=0)).max() * frame_rate < 60
    assert angles[-1] == pytest.approx(2 * np.arccos(0.99), abs=0.02)


def test_planted_feet_stay_down_when_legs_straighten():
    _, heights = straighten(Puppet())
    assert np.abs(heights - heights[0]).max() < 1e-4


def test_the_pelvis_does_not_jump_when_an_outstretched_leg_lands_and_the_other_one_leaves():
    puppet = Puppet()
    puppet.contact[:] = (2, 0)
    heights = []
    for step in range(60):
        if step == 20:
            puppet.contact[:] = (2, 2)
        if step == 40:
            puppet.contact[:] = (2, 0)
        puppet.step(sink=0.86 * (1 - np.cos(0.35)), stride=0.35)
        heights.append(puppet.pelvis[0, 1])
    velocity = np.diff(heights) / DT
    assert np.ptp(heights) > 0.004, "the second leg needs more"
    assert np.abs(np.diff(velocity)).max() < 0.1


def test_the_pelvis_does_not_plunge_for_feet_that_are_dragged_off():
    puppet = Puppet()
    heights = []
    for _ in range(40):
        puppet.position[0, 2] -= 1.5 * DT
        puppet.step(sink=0.86 * (1 - np.cos(0.35)), stride=0.35)
        heights.append(puppet.pelvis[0, 1])
    assert puppet.lock.is_released.any()
    assert np.abs(np.diff(heights)).max() / DT < 0.8


def test_people_enter_standing_as_deep_as_they_stay():
    puppet = Puppet()
    puppet.step(sink=0.0)
    entered = puppet.pelvis[0, 1]
    for _ in range(30):
        puppet.step(sink=0.0)
    assert puppet.pelvis[0, 1] == pytest.approx(entered, abs=1e-6)
    assert entered < SKELETON.offset[0, 1] - 0.005


def test_reset_forgets_and_only_active_people_change():
    puppet = Puppet(count=3)
    puppet.step()
    puppet.position[:, 2] = 0.1
    puppet.step()
    puppet.lock.reset(np.array([1], np.int32))
    assert (puppet.lock.contact[1] == 0).all()
    assert (puppet.lock.contact[0] == 2).all()
    planted = puppet.step()
    np.testing.assert_allclose(planted[1] - planted[0], 0.1 * np.array([0, 1]) + 0 * planted[0], atol=1e-3)


def test_equal_bits_on_one_and_many_threads():
    from crowd_kernels.foot_lock import lock_feet_crowd

    results = []
    for build in (lock_feet_crowd.serial, lock_feet_crowd.threaded):
        puppet = Puppet(count=100)
        rng = np.random.default_rng(1)
        original = lock_feet_crowd.__class__.__call__
        try:
            lock_feet_crowd.__class__.__call__ = lambda self, *args, build=build: build(*args)
            for _ in range(10):
                puppet.position += rng.normal(0, 0.01, puppet.position.shape) * (1, 0, 1)
                puppet.step()
        finally:
            lock_feet_crowd.__class__.__call__ = original
        results.append((puppet.pose.copy(), puppet.point.copy()))
    for one, other in zip(*results, strict=True):
        np.testing.assert_array_equal(one, other)
