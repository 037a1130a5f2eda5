"""How long hands take: by their examples, by how far joints turn, and by the other hand."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from crowd.bench.reachers import Reachers
from crowd.controllers.reach import REACH_LIMITS
from crowd_kernels.reach_blend import JOINTS, ROW
from crowd_kernels.reach_state import APEX, END, MOVE, RETURN
from crowd_kernels.reach_time import SHARED_TIME, largest_turn, reach_time, set_out, time_to_turn
from tests.kernels.reach_states import state_of
from tests.oracles import reach as oracle


def test_the_largest_turn_is_that_of_the_joint_that_turns_most(rng):
    for _ in range(50):
        first, second = rng.normal(size=(2, JOINTS, 4)) * 0.3 + (1.0, 0.0, 0.0, 0.0)
        first /= np.linalg.norm(first, axis=1, keepdims=True)
        second /= np.linalg.norm(second, axis=1, keepdims=True)
        wanted = 2.0 * np.arccos((first * second).sum(axis=1).min())
        rows = [rotation.T.ravel().astype(np.float32) for rotation in (first, second)]
        assert largest_turn(*rows) == pytest.approx(wanted, abs=2e-3)


@given(turn=st.floats(0.05, 3.0), acceleration=st.floats(5.0, 60.0))
def test_joints_that_turn_with_least_jerk_in_this_time_accelerate_as_much_as_said(turn, acceleration):
    time = time_to_turn(turn, acceleration)
    progress = np.linspace(0.0, 1.0, 4001)
    bend = np.gradient(np.gradient(turn * oracle.minimum_jerk(progress), time / 4000), time / 4000)
    assert np.abs(bend).max() == pytest.approx(acceleration, rel=1e-3)


@pytest.fixture(scope="module")
def keys():
    return Reachers(1, seed=0).space.keys


def live_row(keys, rng):
    """Rotations (J, 4) of a pose far from the examples, and its compact row."""
    live = rng.normal(size=(len(keys.joint), 4)) + (2.0, 0.0, 0.0, 0.0)
    live /= np.linalg.norm(live, axis=1, keepdims=True)
    row = np.zeros((4, JOINTS), np.float32)
    row[:, : len(live)] = live.T
    return live, row.ravel()


@pytest.mark.parametrize("arm", [0, 1])
@pytest.mark.parametrize(("upper", "walking"), [(0.0, 0.0), (1.0, 1.0), (1.0, 0.0), (0.3, 0.3)])
@pytest.mark.parametrize("returns", [False, True])
@pytest.mark.parametrize("other", [0.0, 0.6])
def test_hands_that_set_out_take_the_time_of_joints_that_are_far_from_the_examples(
    keys, arm, upper, walking, returns, other, rng
):
    weights = {2: 1.0 - upper, keys.first_seated + 1: upper}
    state = state_of(arm, example_count=2, course=APEX if returns else 0.0, stage=RETURN if returns else MOVE)
    state.example[0, arm, :2] = list(weights)
    state.example_weight[0, arm, :2] = list(weights.values())
    live, row = live_row(keys, rng)
    set_out(0, arm, 1.3, other, walking, keys, REACH_LIMITS, state, row, np.zeros(ROW, np.float32))
    weights = {clip: weight for clip, weight in weights.items() if weight > 0.0}
    turn = oracle.turn_to_examples(keys, weights, END if returns else 0.0, live, arm, upper, walking, other)
    # A way back that takes longer than the way there anyway need not be slowed down as much.
    wanted = (
        time_to_turn(turn, REACH_LIMITS.lead_acceleration) / REACH_LIMITS.lead / (1.3 if returns else 1.0)
    )
    assert state.lead_time[0, arm] == pytest.approx(wanted, rel=1e-3)


@pytest.mark.parametrize(("course", "stage"), [(0.4, MOVE), (0.4, RETURN), (APEX, MOVE), (1.5, RETURN)])
def test_hands_on_their_way_keep_the_time_with_which_they_set_out(keys, course, stage, rng):
    state = state_of(0, example_count=1, course=course, stage=stage, lead_time=7.0)
    state.example_weight[0, 0, 0] = 1.0
    row = live_row(keys, rng)[1]
    set_out(0, 0, 1.0, 0.0, 0.0, keys, REACH_LIMITS, state, row, np.zeros(ROW, np.float32))
    assert state.lead_time[0, 0] == 7.0


@given(
    there=st.floats(0.3, 1.5), lead=st.floats(0.0, 2.0), turn=st.floats(0.0, 3.0), size=st.floats(0.8, 1.2),
    other=st.floats(0.0, 1.0), offset=st.floats(0.0, 0.1),
)  # fmt: skip
def test_the_time_is_the_longest_that_anything_needs_and_longer_with_the_other_hand(
    there, lead, turn, size, other, offset
):
    state = state_of(0, lead_time=lead, turn=turn, offset=(0.0, offset, 0.0), course=APEX)
    alone = max(there * math.sqrt(size), lead, REACH_LIMITS.time_per_radian * turn)
    wanted = alone + other * (SHARED_TIME * alone + REACH_LIMITS.time_shared * offset)
    assert reach_time(0, 0, there, size, other, REACH_LIMITS, state) == pytest.approx(wanted)


def test_a_time_that_is_asked_for_is_kept_but_for_a_glide_that_lasts_longer():
    state = state_of(0, seconds=0.5, lead_time=2.0, course=0.5, stage=MOVE)
    assert reach_time(0, 0, 1.0, 1.0, 1.0, REACH_LIMITS, state) == 0.5
    state.time_left[0, 0] = 0.4
    assert reach_time(0, 0, 1.0, 1.0, 1.0, REACH_LIMITS, state) == pytest.approx(0.8)
    state.stage[0, 0] = RETURN
    assert reach_time(0, 0, 1.0, 1.0, 1.0, REACH_LIMITS, state) == 0.5
