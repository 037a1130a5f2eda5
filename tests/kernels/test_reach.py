"""Kernels of reaching against slow twins, and what holds for any target."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from crowd.bench.reachers import Reachers
from crowd.controllers.reach import REACH_LIMITS
from crowd.motion.rotation import multiply
from crowd_kernels.easing import hump, settle
from crowd_kernels.reach import is_waiting, reach_crowd
from crowd_kernels.reach_aim import turn_trunk
from crowd_kernels.reach_blend import JOINTS, ROW, key_shares, read_joints
from crowd_kernels.reach_correction import LANES as CORRECTED
from crowd_kernels.reach_goal import is_inside_body
from crowd_kernels.reach_place import local_rotation, place_hand
from crowd_kernels.reach_state import (
    HOLD,
    MOVE,
    MOVING,
    NONE,
    OUT_OF_REACH,
    REACHED,
    REFUSED,
    RETURN,
    ReachState,
)
from crowd_kernels.reach_status import reach_status_crowd
from tests.kernels.reach_states import state_of
from tests.oracles import reach as oracle
from tests.oracles import reach_space as space_oracle

number = st.floats(-3, 3)


@given(place=number, velocity=number, acceleration=number, time=st.floats(0.05, 2), dt=st.floats(0.001, 0.05))
def test_settle_matches_oracle(place, velocity, acceleration, time, dt):
    found = settle(place, velocity, acceleration, time, dt)
    wanted = oracle.settle(place, velocity, acceleration, time, dt)
    np.testing.assert_allclose(found, wanted, rtol=1e-6, atol=1e-6 * (1 + 10 / time**2))


@given(place=number, velocity=number, acceleration=number, steps=st.integers(5, 90))
def test_settling_step_by_step_comes_to_rest_in_time(place, velocity, acceleration, steps):
    dt = 1 / 60
    motion = (place, velocity, acceleration)
    for step in range(steps):
        motion = settle(*motion, (steps - step) * dt, dt)
    assert motion == (0.0, 0.0, 0.0)


@given(place=st.floats(0.0, 11.0), count=st.integers(3, 12))
def test_shares_of_keys_are_those_of_quadratic_splines(place, count):
    place = min(place, count - 1.0)
    first, *shares = key_shares(place, count)
    assert sum(shares) == pytest.approx(1.0)
    wanted = oracle.spline_shares(place, count - 1)
    assert sorted(wanted) == [first, first + 1, first + 2]
    np.testing.assert_allclose(shares, list(wanted.values()), atol=1e-9)


@given(line=st.tuples(number, number), place=st.floats(0.0, 8.0))
def test_keys_on_a_straight_line_give_that_line_to_its_very_ends(line, place):
    first, *shares = key_shares(place, 9)
    found = sum(share * (line[0] + line[1] * (first + k)) for k, share in enumerate(shares))
    assert found == pytest.approx(line[0] + line[1] * place, abs=1e-9)


def test_hump_rises_to_one_and_is_smooth_at_its_ends():
    assert hump(0.5)[0] == pytest.approx(1.0)
    assert hump(0.0) == (0.0, 0.0, 0.0)
    progress = np.linspace(0.01, 0.99, 50)
    slope = [(hump(q + 1e-6)[0] - hump(q - 1e-6)[0]) / 2e-6 for q in progress]
    bend = [(hump(q + 1e-5)[1] - hump(q - 1e-5)[1]) / 2e-5 for q in progress]
    np.testing.assert_allclose([hump(q)[1] for q in progress], slope, atol=1e-6)
    np.testing.assert_allclose([hump(q)[2] for q in progress], bend, atol=1e-4)


def test_the_own_body_is_trunk_and_head():
    pelvis = (0.0, 0.97, 0.0)
    for inside in ((0.0, 1.2, 0.0), (0.05, 1.0, 0.05), (0.0, 1.6, 0.05)):
        assert is_inside_body(inside, pelvis, 1.0, 0.1)
    for outside in ((0.3, 1.2, 0.0), (0.0, 1.2, 0.2), (0.0, 0.4, 0.0), (0.0, 2.0, 0.0)):
        assert not is_inside_body(outside, pelvis, 1.0, 0.1)


@pytest.fixture(scope="module")
def reachers():
    return Reachers(24, seed=3)


@pytest.mark.parametrize("hand", [0, 1])
@pytest.mark.parametrize("course", [0.15, 0.6, 1.0, 1.4])
def test_reach_matches_oracle(reachers, hand, course, rng):
    simulation, space = reachers.simulation, reachers.space
    state, keys, reach = simulation.state, space.keys, simulation.reach
    point = space.pseudo[hand].point
    target = (point[rng.integers(0, len(point), 24)] + rng.normal(0, 0.02, (24, 3))) * reachers.size[:, None]
    state.reach_stage[:] = 0
    reachers.reach(hand, target)
    # The first step takes the weights over, then the reach is set to its course.
    reachers.step()
    state.reach_course[:, hand] = course
    state.reach_course_rate[:, hand] = 0.0
    if course > 1:
        state.reach_stage[:, hand] = RETURN
    live = state.pose_rotation.copy().reshape(24, 4, 64)[:, :, keys.joint].transpose(0, 2, 1).astype(float)
    live = np.tile([1.0, 0.0, 0.0, 0.0], (24, len(keys.joint), 1)) + 0.1 * rng.normal(size=live.shape)
    live /= np.linalg.norm(live, axis=2, keepdims=True)
    rows = np.zeros((24, 4, 64), np.float32)
    rows[:, 0] = 1
    rows[:, :, keys.joint] = live.transpose(0, 2, 1)
    live_pelvis = np.tile([0.01, 0.95, -0.02], (24, 1)) + 0.01 * rng.normal(size=(24, 3))
    pose, pelvis = rows.reshape(24, 256).copy(), live_pelvis.astype(np.float32)
    task, out = np.zeros((24, 2), np.uint8), np.zeros((24, 2, 3), np.float32)
    reach_crowd(
        space.arrays, keys, REACH_LIMITS, simulation.model.people.segment_scale, reachers.size,
        state.position_world, state.yaw, state.is_seated, np.zeros(24), reachers.rows, 1e-5,
        ReachState(*(getattr(state, f"reach_{name}") for name in ReachState._fields)),
        reach._number, reach._real, reach._rows, state.reach_correction,
        state.reach_correction_change, state.reach_last_rotation,
        pose, pelvis, task, out, np.zeros((24, 2, 4), np.float32), *np.zeros((2, 24, 2), np.float32),
    )  # fmt: skip
    first = [0, len(space.examples[0].clips)][hand]
    for row in range(24):
        weights = space_oracle.find_examples(
            point,
            space.pseudo[hand].clip + first,
            space.pseudo[hand].weight,
            target[row] / reachers.size[row],
        )
        wanted = oracle.reach(
            keys, weights, hand, course, REACH_LIMITS.lead, target[row],
            simulation.model.people.segment_scale[row].astype(float), live[row], live_pelvis[row],
        )  # fmt: skip
        found = pose[row].reshape(4, 64)[:, keys.joint].T
        sign = np.sign((found * wanted[0]).sum(axis=1, keepdims=True))
        np.testing.assert_allclose(found * sign, wanted[0], atol=2e-5)
        np.testing.assert_allclose(pelvis[row], wanted[1], atol=1e-5)
        np.testing.assert_allclose(out[row, hand], wanted[2], atol=5e-5)
        assert task[row].tolist() == [int(hand == 0), int(hand == 1)]


@pytest.mark.parametrize("arm", [0, 1])
def test_a_hand_hangs_on_the_corrected_trunk(reachers, arm, rng):
    simulation, keys = reachers.simulation, reachers.space.keys
    tree = simulation.reach._tree
    np.testing.assert_array_equal(tree.joint[keys.chain_place], keys.joint[keys.chain])
    pose = simulation.state.pose_rotation[0].copy()
    correction = rng.uniform(-0.2, 0.2, 3 * CORRECTED).astype(np.float32)
    change = rng.uniform(-0.02, 0.02, 3 * CORRECTED).astype(np.float32)
    local = pose.reshape(4, 64)[:, keys.joint].T.astype(float)
    for compact in set(keys.chain[0]) & set(keys.chain[1]):
        at = np.flatnonzero(tree.joint == keys.joint[compact])[0]
        x, y, z = (correction + change)[at::CORRECTED].astype(float)
        local[compact] = multiply([np.sqrt(1 - x * x - y * y - z * z), x, y, z], local[compact])
    scale = simulation.model.people.segment_scale[0]
    row = np.zeros(ROW, np.float32)
    read_joints(keys, pose, row)
    turn_trunk(keys, correction, change, row)
    first = local_rotation(row, 0, JOINTS)
    place, turned = place_hand(keys, arm, scale, (0.1, 0.9, 0.0), first, row, JOINTS)
    wanted, frame = oracle.place_hand(keys, arm, scale.astype(float), (0.1, 0.9, 0.0), local)
    np.testing.assert_allclose(place, wanted, atol=1e-6)
    np.testing.assert_allclose(abs(np.dot(turned, frame)), 1.0, atol=1e-6)


@pytest.mark.parametrize(
    ("stage", "status", "missing", "speed", "waits"),
    [
        ((HOLD, HOLD), (OUT_OF_REACH, REACHED), (0.05, 0.0), 0.0, True),
        ((HOLD, HOLD), (REACHED, OUT_OF_REACH), (0.0, 0.05), 0.0, True),
        ((HOLD, MOVE), (OUT_OF_REACH, MOVING), (0.05, 0.0), 0.0, False),
        ((HOLD, HOLD), (REACHED, REACHED), (0.0, 0.0), 0.0, False),
        ((HOLD, HOLD), (OUT_OF_REACH, REACHED), (0.005, 0.0), 0.0, False),
        ((HOLD, HOLD), (OUT_OF_REACH, REACHED), (0.05, 0.0), 0.1, False),
        ((HOLD, NONE), (OUT_OF_REACH, 0), (0.05, 0.0), 0.0, False),
    ],
)
def test_people_wait_with_both_hands_where_nothing_moves_and_one_is_far_off(
    stage, status, missing, speed, waits
):
    state = state_of(0, stage=stage[0], status=status[0], missing_place=(missing[0], 0.0, 0.0))
    state.stage[0, 1], state.status[0, 1] = stage[1], status[1]
    state.missing_place[0, 1, 2] = missing[1]
    state.seen_velocity[0, 1, 0] = speed
    assert is_waiting(0, state) == waits
    state.turn_velocity[0, 0, 1] = 0.3
    assert not is_waiting(0, state), "it turns"


def status_after(stage, status, distance, angle, has_rotation=False, hold=math.inf):
    arrays = {name: np.zeros((1, 2)) for name in ReachState._fields}
    arrays["seen"] = np.zeros((1, 2, 3))
    arrays["stage"] = np.full((1, 2), stage, np.uint8)
    arrays["status"] = np.full((1, 2), status, np.uint8)
    arrays["has_rotation"] = np.full((1, 2), has_rotation)
    arrays["hold_left"] = np.full((1, 2), hold)
    state = ReachState(**arrays)
    far, turned = np.full((1, 2), distance, np.float32), np.full((1, 2), angle, np.float32)
    reach_status_crowd(
        np.zeros((1, 2, 3), np.float32), far, turned, np.zeros(1, np.int32), 0.1, 1e-3, 0.0175, state
    )
    return int(state.status[0, 0]), int(state.stage[0, 0])


@given(
    stage=st.sampled_from((NONE, MOVE, HOLD, RETURN)),
    status=st.sampled_from((0, MOVING, REACHED, OUT_OF_REACH, REFUSED)),
    distance=st.sampled_from((0.0, 5e-4, 2e-3, math.inf)),
    angle=st.sampled_from((0.0, 1.0)),
    has_rotation=st.booleans(),
    hold=st.sampled_from((0.0, 0.05, 0.15, math.inf)),
)
def test_status_matches_oracle(stage, status, distance, angle, has_rotation, hold):
    wanted = oracle.status(stage, status, distance < 1e-3, angle < 0.0175 or not has_rotation, hold - 0.1)
    assert status_after(stage, status, distance, angle, has_rotation, hold) == wanted


def test_status_tells_how_a_reach_stands():
    assert status_after(MOVE, 1, 0.0, 0.0) == (1, MOVE)
    assert status_after(HOLD, 1, 0.0005, 1.0) == (REACHED, HOLD)
    assert status_after(HOLD, 1, 0.0005, 1.0, has_rotation=True) == (OUT_OF_REACH, HOLD)
    assert status_after(HOLD, 1, 0.002, 0.0) == (OUT_OF_REACH, HOLD)
    assert status_after(HOLD, 1, math.inf, 0.0) == (OUT_OF_REACH, HOLD)
    assert status_after(HOLD, REFUSED, 0.0, 0.0) == (REFUSED, HOLD)
    assert status_after(HOLD, 1, 0.0, 0.0, hold=0.05) == (REACHED, RETURN)
    assert status_after(MOVE, REFUSED, 0.0, 0.0, hold=0.05) == (REFUSED, MOVE)
    assert status_after(HOLD, REFUSED, 0.0, 0.0, hold=0.05) == (REFUSED, RETURN)
    assert status_after(HOLD, REFUSED, 0.0, 0.0, hold=0.15) == (REFUSED, HOLD)
    assert status_after(RETURN, REACHED, 0.5, 0.0) == (REACHED, RETURN)
