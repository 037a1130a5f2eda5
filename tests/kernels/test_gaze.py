"""Gaze against its twin; eyes that meet their targets, limits and speeds that hold, whatever the target."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from crowd.controllers.gaze import Gaze
from crowd.controllers.gaze_settings import GazeKey, GazeSettings, gaze_arrays, gaze_limits
from crowd.motion.body import build_skeleton
from crowd.state import State
from crowd_kernels.gaze import (
    CHUNKS,
    ON_TARGET,
    OUT_OF_REACH,
    REFUSED,
    eye_point_crowd,
    gaze_crowd,
)
from crowd_kernels.gaze_chain import scratch_length
from crowd_kernels.polynomial import arc_tangent, sine_cosine
from tests.oracles import gaze as oracle
from tests.oracles.pose import matrix, quaternions_to_row, row_to_quaternions

DT = 1 / 60
SKELETON = build_skeleton()
SETTINGS = GazeSettings()
ARRAYS, LIMITS = gaze_arrays(SKELETON, SETTINGS), gaze_limits(SETTINGS)
REST = quaternions_to_row(np.tile([1.0, 0, 0, 0], (SKELETON.joint_count, 1)))
EYE_HEIGHT = 0.936 * SKELETON.stature


def poses(rng, count, size=0.12):
    """Pose rows of people whose joints are all a little turned; eyes are not."""
    quaternions = rng.normal(0, size, (count, SKELETON.joint_count, 4)) + [1, 0, 0, 0]
    quaternions[:, ARRAYS.eye] = [1, 0, 0, 0]
    quaternions /= np.linalg.norm(quaternions, axis=2, keepdims=True)
    return np.array([quaternions_to_row(q) for q in quaternions])


class Watchers:
    """People in a pose that stays, who look at points."""

    def __init__(self, count=1, pose=None, settings=SETTINGS, scale=None):
        self.gaze = Gaze(SKELETON, count, settings=settings)
        self.state = State.create(count)
        self.pose = np.tile(REST, (count, 1)) if pose is None else pose
        self.state.pose_pelvis[:] = SKELETON.offset[0]
        self.scale = np.ones((count, 8), np.float32) if scale is None else scale
        self.trunk, self.follow = np.ones(count, np.float32), np.ones(count, np.float32)
        self.active = np.arange(count, dtype=np.int32)
        self.scratch = np.zeros((CHUNKS, scratch_length(len(ARRAYS.joint))), np.float32)

    def look(self, target):
        self.gaze.look_at_point(self.state, self.active, target)

    def step(self, dt=DT, active=None):
        s, count = self.state, self.state.capacity
        active = self.active if active is None else active
        s.pose_rotation[active] = self.pose[active]
        turn, rate = s.gaze_turn.reshape(count, -1), s.gaze_turn_rate.reshape(count, -1)
        gaze_crowd(
            self.gaze.arrays, self.gaze.limits, self.scale, s.position_world, s.yaw, self.trunk, self.follow,
            s.gaze_kind, s.gaze_target_world, s.saccade_offset, active, dt, self.scratch, s.pose_rotation,
            s.pose_pelvis, turn, rate, s.gaze_eye_turn.reshape(count, -1), s.gaze_weight,
            s.gaze_weight_rate, s.gaze_error, s.gaze_status,
        )  # fmt: skip

    def run(self, seconds, dt=DT):
        for _ in range(round(seconds / dt)):
            self.step(dt)

    def eye_rays(self, character=0):
        """Eyes and their rays in the world, by the twin's kinematics, saccades included."""
        s = self.state
        chain = oracle.Chain(
            self.gaze.arrays, self.scale[character], s.pose_rotation[character], s.pose_pelvis[character]
        )
        rotation, position = chain.head(np.zeros((len(chain.local), 3)))
        facing = oracle.turned([0, s.yaw[character], 0])
        eyes = [
            facing @ (position + rotation @ offset) + s.position_world[character]
            for offset in chain.eye_offset
        ]
        return [
            (eye, facing @ rotation @ local[:, 2]) for eye, local in zip(eyes, chain.eye_local, strict=True)
        ]

    def misses(self, target, character=0):
        """Angles between the eyes' rays and a target, degrees."""
        return [
            math.degrees(math.acos(min((target - eye) @ ray / np.linalg.norm(target - eye), 1.0)))
            for eye, ray in self.eye_rays(character)
        ]


def reachable_targets(rng, count):
    """Points round about, up to 110 degrees to a side and 50 up or down, 0.4 to 30 m away."""
    heading, rise = rng.uniform(-1.9, 1.9, count), rng.uniform(-0.85, 0.85, count)
    away = 0.4 * (30 / 0.4) ** rng.random(count)
    level = away * np.cos(rise)
    return np.stack(
        [level * np.sin(heading), EYE_HEIGHT + away * np.sin(rise), level * np.cos(heading)], axis=1
    )


def test_the_polynomials_agree_with_the_library():
    angles = np.linspace(-7, 7, 4001).astype(np.float32)
    for angle in angles:
        sine, cosine = sine_cosine(angle)
        assert abs(sine - math.sin(angle)) < 1e-6
        assert abs(cosine - math.cos(angle)) < 1e-6
        y, x = np.float32(3 * math.sin(angle)), np.float32(3 * math.cos(angle))
        wanted = math.atan2(y, x)
        assert abs(math.remainder(arc_tangent(y, x) - wanted, 2 * math.pi)) < 1e-6
    assert arc_tangent(np.float32(0), np.float32(0)) == 0


def test_steps_agree_with_the_slow_twin(rng):
    count = 37
    pose, scale = poses(rng, count), rng.uniform(0.9, 1.1, (count, 8)).astype(np.float32)
    people = Watchers(count, pose, scale=scale)
    s = people.state
    s.position_world[:, [0, 2]] = rng.normal(0, 30, (count, 2))
    s.yaw[:] = rng.uniform(-np.pi, np.pi, count)
    people.trunk[:], people.follow[:] = rng.random(count), 1 - 0.8 * (rng.random(count) < 0.3)
    s.saccade_offset[:] = rng.normal(0, 0.15, (count, 2))
    targets = s.position_world + rng.normal(0, 2, (count, 3)) + [0, 1.5, 0]
    targets[::9] = np.nan
    people.look(targets)
    s.gaze_kind[::7] = 0
    slow = [oracle.Person.at_rest() for _ in range(count)]
    for index in range(40):
        if index == 25:
            targets = targets + rng.normal(0, 3, (count, 3))
            s.gaze_target_world[:] = targets
        people.step()
        for character, person in enumerate(slow):
            looks = s.gaze_kind[character] != 0
            local, error = oracle.gaze(
                ARRAYS, LIMITS, scale[character], s.position_world[character], s.yaw[character],
                people.trunk[character], people.follow[character], targets[character] if looks else None,
                s.saccade_offset[character], DT, pose[character], s.pose_pelvis[character], person,
            )  # fmt: skip
            if index % 13 == 0:
                got = row_to_quaternions(s.pose_rotation[character])[[*ARRAYS.joint, *ARRAYS.eye]]
                for q, wanted in zip(got, local, strict=True):
                    np.testing.assert_allclose(matrix(q), wanted, atol=2e-3 if index > 25 else 5e-4)
                assert s.gaze_error[character] == pytest.approx(error, abs=2e-3)
                assert s.gaze_weight[character] == pytest.approx(person.weight, abs=1e-5)


def test_equal_parts_are_equal_parts_of_the_whole():
    key = GazeKey(tuple(SKELETON.joint_names[j] for j in ARRAYS.joint), (9.0, 9.0, 9.0), share=1.0, rate=30.0)
    people = Watchers(1, settings=GazeSettings(keys=(key,), head_speed=100.0))
    people.look([8000 * np.sin(0.8), EYE_HEIGHT, 8000 * np.cos(0.8)])
    people.run(2.0)
    np.testing.assert_allclose(people.state.gaze_turn[0, :, 1], 0.1, atol=1e-3)
    np.testing.assert_allclose(people.state.gaze_eye_turn[0, :, 1], 0.1, atol=1e-3)


def test_settled_eyes_meet_every_target_in_reach(rng):
    count = 2000
    people = Watchers(count, poses(rng, count, 0.03))
    targets = reachable_targets(rng, count)
    people.look(targets)
    people.run(2.5)
    assert (people.state.gaze_status == ON_TARGET).mean() > 0.995
    for character in np.flatnonzero(people.state.gaze_status == ON_TARGET)[::10]:
        assert max(people.misses(targets[character], character)) < 1.0
    assert np.degrees(people.state.gaze_error[people.state.gaze_status == ON_TARGET]).max() < 1.0


def test_eyes_follow_a_moving_target():
    people = Watchers()
    worst = 0.0
    for index in range(400):
        t = index * DT
        target = np.array([2.5 * np.sin(0.8 * t), 1.5 + 0.4 * np.sin(1.7 * t), 2.0])
        people.look(target)
        people.step()
        if t > 1.0:
            worst = max(worst, *people.misses(target))
    assert worst < 1.0


def test_limits_and_speeds_hold_whatever_jumps_about(rng):
    count = 200
    people = Watchers(count, poses(rng, count, 0.05))
    before, last = None, None
    for index in range(240):
        if index % 20 == 0:
            people.look(rng.normal(0, 3, (count, 3)) + [0, 1.5, 0])
        people.step()
        s = people.state
        ellipse = np.hypot(s.gaze_turn[..., 0] / ARRAYS.limit[:, 0], s.gaze_turn[..., 1] / ARRAYS.limit[:, 1])
        assert ellipse.max() < 1.05, "springs follow goals on a line, and never leave the limits"
        assert (np.abs(s.gaze_turn[..., 2]) <= ARRAYS.limit[:, 2] + 1e-5).all()
        eyes = np.hypot(
            s.gaze_eye_turn[..., 0] / LIMITS.eye_pitch, s.gaze_eye_turn[..., 1] / LIMITS.eye_heading
        )
        assert eyes.max() < 1 + 1e-5
        if before is not None:
            speed = np.linalg.norm(s.gaze_turn - before, axis=2).sum(axis=1) / DT
            assert np.degrees(speed).max() < 180.1
            assert np.degrees(np.linalg.norm(s.gaze_eye_turn - last, axis=2)).max() / DT < 1000.5
        before, last = s.gaze_turn.copy(), s.gaze_eye_turn.copy()


@pytest.mark.parametrize("heading", [-60, 20, 75])
def test_the_frame_rate_does_not_matter(heading):
    target = [4 * np.sin(np.radians(heading)), 1.2, 4 * np.cos(np.radians(heading))]
    slow, quick = Watchers(), Watchers()
    slow.look(target)
    quick.look(target)
    for _ in range(45):
        slow.step(1 / 30)
        quick.run(1 / 30, 1 / 120)
        np.testing.assert_allclose(
            np.degrees(slow.state.gaze_turn[0].sum(axis=0)),
            np.degrees(quick.state.gaze_turn[0].sum(axis=0)),
            atol=1,
        )


def test_eyes_arrive_before_the_head():
    people = Watchers()
    target = np.array([3 * np.sin(np.radians(30)), EYE_HEIGHT, 3 * np.cos(np.radians(30))])
    people.look(target)
    arrival, headings = None, []
    for index in range(90):
        people.step()
        if arrival is None and people.state.gaze_status[0] == ON_TARGET:
            arrival = index
        headings.append(people.state.gaze_turn[0, :, 1].sum())
    head_arrival = next(i for i, heading in enumerate(headings) if heading > 0.95 * headings[-1])
    assert arrival is not None
    assert arrival * DT < 0.1
    assert head_arrival - arrival > 10


def test_the_head_keeps_level_when_it_looks_up_and_aside():
    people = Watchers()
    people.look([2.0, 3.2, 1.2])
    people.run(3.0)
    chain = oracle.Chain(ARRAYS, people.scale[0], people.state.pose_rotation[0], people.state.pose_pelvis[0])
    rotation, _ = chain.head(np.zeros((7, 3)))
    assert abs(np.degrees(np.arcsin(rotation[1, 0]))) < 4.0


@pytest.mark.parametrize(
    "target",
    [(np.nan, 1, 1), (0, np.inf, 0), (0, EYE_HEIGHT, 0.1), (1e9, 0, 0)],
    ids=["nan", "inf", "head", "far"],
)
def test_bad_targets_are_refused_and_leave_the_pose(target):
    people = Watchers()
    people.look(target)
    people.run(1.0)
    assert people.state.gaze_status[0] == REFUSED
    assert people.state.gaze_error[0] == 0
    np.testing.assert_allclose(people.state.pose_rotation[0], REST, atol=1e-5)


def test_what_is_straight_behind_is_out_of_reach_and_nobody_wavers():
    people = Watchers()
    turned = []
    for index in range(300):
        people.look([0.3 * np.sin(0.4 * index) + 0.1, 1.5, -3.0])
        people.step()
        turned.append(people.state.gaze_turn[0, :, 1].sum())
    assert people.state.gaze_status[0] == OUT_OF_REACH
    assert min(turned[60:]) > 1.5, "over the left shoulder, where it began"
    assert np.degrees(people.state.gaze_error[0]) > 1


def test_a_gaze_that_is_released_fades_softly_and_then_costs_nothing():
    people = Watchers()
    people.look([2.0, 1.0, 2.0])
    people.run(1.5)
    people.gaze.release(people.state, people.active)
    people.run(0.6)
    assert np.degrees(np.abs(people.state.gaze_turn).sum()) < 8
    people.run(2.0)
    assert people.state.gaze_weight[0] == 0
    assert not people.state.gaze_turn.any()
    np.testing.assert_allclose(people.state.pose_rotation[0], REST, atol=1e-6)


@given(
    st.tuples(*[st.floats(-50, 50)] * 3),
    st.floats(0, 1),
    st.floats(-np.pi, np.pi),
    st.tuples(*[st.floats(-0.5, 0.5)] * 2),
)
def test_poses_stay_whole_for_any_target(target, trunk, yaw, saccade):
    people = Watchers()
    people.trunk[:], people.state.yaw[:] = trunk, yaw
    people.state.saccade_offset[:] = saccade
    people.look(target)
    for _ in range(12):
        people.step()
    quaternions = row_to_quaternions(people.state.pose_rotation[0])
    np.testing.assert_allclose(np.linalg.norm(quaternions, axis=1)[: SKELETON.joint_count], 1, atol=1e-5)
    for eye in ARRAYS.eye:
        angle = 2 * math.degrees(math.acos(min(abs(quaternions[eye, 0]), 1)))
        assert angle < 40.1, "gaze and saccade together stay within the eye's limit"


def test_lanes_do_not_see_each_other(rng):
    count = 21
    pose, targets = poses(rng, count), rng.normal(0, 3, (count, 3)) + [0, 1.5, 0]
    together, alone = Watchers(count, pose), Watchers(count, pose)
    together.look(targets)
    alone.look(targets)
    order = rng.permutation(count).astype(np.int32)
    for _ in range(10):
        together.step()
        alone.step(active=order[:8])
        alone.step(active=order[8:])
    for field in ("pose_rotation", "gaze_turn", "gaze_eye_turn", "gaze_weight", "gaze_error", "gaze_status"):
        np.testing.assert_array_equal(getattr(together.state, field), getattr(alone.state, field))


def test_nobody_active_is_fine_and_others_are_left_alone():
    people = Watchers(3)
    people.look([1.0, 1.0, 1.0])
    people.step(active=np.zeros(0, np.int32))
    people.state.pose_rotation[:] = people.pose
    people.step(active=np.array([1], np.int32))
    np.testing.assert_array_equal(people.state.pose_rotation[[0, 2]], people.pose[[0, 2]])
    assert people.state.gaze_status.tolist() == [0, 1, 0]


def test_points_between_eyes_agree_with_the_twin(rng):
    count = 9
    pose, scale = poses(rng, count, 0.3), rng.uniform(0.9, 1.1, (count, 8)).astype(np.float32)
    place, yaw = rng.normal(0, 20, (count, 3)) * [1, 0, 1], rng.uniform(-3, 3, count)
    pelvis = np.tile(SKELETON.offset[0], (count, 1)).astype(np.float32)
    index = np.array([1, 2, 3, 4, 5, 6, 6, 99, -1], np.int32)
    is_active = np.ones(count, bool)
    is_active[5] = False
    out = np.zeros((count, 3))
    eye_point_crowd(
        ARRAYS, scale, place, yaw, pose, pelvis, is_active, index, np.arange(count, dtype=np.int32), out
    )
    for character in (0, 1, 2, 3, 5):
        other = index[character]
        wanted = oracle.eye_point(ARRAYS, scale[other], place[other], yaw[other], pose[other], pelvis[other])
        np.testing.assert_allclose(out[character], wanted, atol=1e-5)
    assert np.isnan(out[[4, 6, 7, 8]]).all(), "not there, oneself, no such row"


def test_the_head_alone_comes_within_two_degrees(rng):
    count = 300
    people = Watchers(count, poses(rng, count, 0.03), GazeSettings(eye_share=1e-6))
    heading, rise, away = (
        rng.uniform(-1.4, 1.4, count),
        rng.uniform(-0.5, 0.5, count),
        rng.uniform(2, 20, count),
    )
    level = away * np.cos(rise)
    targets = np.stack([level * np.sin(heading), 1.55 + away * np.sin(rise), level * np.cos(heading)], axis=1)
    people.look(targets)
    people.run(3.0)
    for character in range(count):
        pose, pelvis = people.state.pose_rotation[character], people.state.pose_pelvis[character]
        chain = oracle.Chain(ARRAYS, people.scale[character], pose, pelvis)
        rotation, position = chain.head(np.zeros((7, 3)))
        way = targets[character] - position - rotation @ chain.between
        assert math.degrees(math.acos(rotation[:, 2] @ way / np.linalg.norm(way))) < 2.0
