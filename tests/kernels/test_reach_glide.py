"""Glides of hands from target to target: smooth in time, exact at their end, and around the body."""

import math
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from crowd.controllers.reach import REACH_LIMITS
from crowd_kernels.reach_course import paced
from crowd_kernels.reach_examples import LEAST_WEIGHT, follow_weights
from crowd_kernels.reach_glide import away_from_body, glide, shortened
from tests.kernels.reach_states import state_of
from tests.oracles import reach as oracle

DT = 1 / 60
STILL = (0.0, 0.0, 0.0)
length = st.floats(0.0, 1.5)
metre = st.floats(-0.4, 0.4)


@given(size=length, longest=st.floats(0.05, 0.5))
def test_shortened_ways_match_oracle(size, longest):
    found = shortened((0.6 * size, 0.0, -0.8 * size), longest)
    wanted = oracle.shortened(size, longest)
    np.testing.assert_allclose(found, (0.6 * wanted, 0.0, -0.8 * wanted), atol=1e-6)


def test_ways_within_reach_are_not_shortened_and_no_speed_jumps_where_they_begin_to_be():
    assert shortened((0.03, 0.1, 0.04), 0.13) == (0.03, 0.1, 0.04)
    sizes = np.linspace(0.0, 0.6, 6001)
    ways = np.array([shortened((0.0, 0.0, size), 0.13)[2] for size in sizes])
    slope = np.gradient(ways, sizes)
    assert np.abs(np.diff(slope)).max() < 2e-2
    assert ways.max() < 1.2 * 0.13
    assert ways[-1] == pytest.approx(0.85 * 0.13)


@given(middle=st.tuples(metre, metre, metre), begin=st.tuples(metre, metre, metre))
def test_the_middle_of_a_way_is_no_nearer_to_the_body_than_its_ends_as_far_as_hands_get(middle, begin):
    end = (0.3, 1.2, 0.4)
    x, y, z = away_from_body(middle, begin, end, REACH_LIMITS)
    assert y == 0.0
    assert math.hypot(x, z) <= REACH_LIMITS.farthest + 1e-12
    kept = min(math.hypot(begin[0], begin[2]), REACH_LIMITS.clearance)
    near = math.hypot(middle[0], middle[2])
    after = math.hypot(middle[0] + x, middle[2] + z)
    if near > 0.05:
        assert after == pytest.approx(max(near, min(kept, near + REACH_LIMITS.farthest)), abs=1e-9)


@given(
    offset=st.tuples(metre, metre, metre),
    velocity=st.tuples(metre, metre, metre),
    steps=st.integers(8, 90),
)
def test_a_glide_goes_on_from_where_the_hand_is_and_ends_in_time_at_what_is_wished_for(
    offset, velocity, steps
):
    wish, time = (0.05, -0.02, 0.01), steps * DT
    state = state_of(
        0, offset=offset, offset_velocity=velocity, time_left=time, plan_time=time, bulge=(0.0, 0.0, 0.05)
    )
    places = [offset]
    for _ in range(steps + 1):
        places.append(glide(0, 0, wish, STILL, 2.0, False, DT, state))
    assert places[-1] == wish
    assert state.time_left[0, 0] == 0.0
    first = np.subtract(places[1], places[0]) / DT
    # Least jerk from this velocity, which the acceleration of one step may have changed.
    largest = np.abs(np.subtract(offset, wish)).max() + 0.05
    assert np.abs(first - velocity).max() < DT * (60.0 * largest / time + 40.0 * 0.4) / time


@given(
    offset=st.tuples(metre, metre, metre),
    velocity=st.tuples(metre, metre, metre),
    speed=st.tuples(metre, metre, metre),
)
def test_a_glide_to_what_moves_begins_as_fast_as_the_hand_was(offset, velocity, speed):
    """As where the other hand moves the trunk, against which the offset moves, while a target jumps."""
    time, wish = 1.5, np.array([0.05, -0.02, 0.01])
    state = state_of(0, offset=offset, offset_velocity=velocity, time_left=time, plan_time=time)
    places = [np.array(offset)]
    step = tuple(np.multiply(speed, DT))
    for frame in range(4):
        moved = tuple(wish + np.multiply(speed, frame * DT))
        places.append(np.array(glide(0, 0, moved, step, 2.0, False, DT, state)))
    velocities = np.diff(places, axis=0) / DT
    # Least jerk over so long a time hardly changes a velocity in a step, but a jump would.
    before = np.vstack([velocity, velocities[:-1]])
    assert np.abs(velocities - before).max() < 0.12
    assert np.abs(state.offset_velocity[0, 0] - velocities[-1]).max() < 1e-9


def test_a_hand_that_does_not_glide_is_where_it_is_wished_and_its_velocity_is_noted():
    state = state_of(0, offset=(0.1, 0.0, 0.0))
    assert glide(0, 0, (0.1, 0.02, 0.0), STILL, 2.0, False, DT, state) == (0.1, 0.02, 0.0)
    np.testing.assert_allclose(state.offset_velocity[0, 0], (0.0, 0.02 / DT, 0.0))
    glide(0, 0, (0.5, 0.0, 0.0), STILL, 2.0, True, DT, state)
    assert not state.offset_velocity.any(), "a reach that begins comes from nowhere"


class Times(NamedTuple):
    """Times of examples, as `follow_weights` reads them."""

    apex_time: np.ndarray
    end_time: np.ndarray


KEYS = Times(np.array([0.8, 1.0, 0.6]), np.array([1.8, 2.2, 1.5]))


@given(wanted=st.tuples(*[st.floats(0.1, 1.0)] * 3), time=st.floats(0.0, 1.2))
def test_weights_follow_what_is_wanted_as_the_oracle_says(wanted, time):
    wanted = np.array(wanted) / np.sum(wanted)
    weight, rate, bend = np.array([1.0, 0.0, 0.0]), np.array([-1.0, 1.0, 0.0]), np.array([2.0, 0.0, -2.0])
    state = state_of(0, time_left=time, example_count=3)
    for name, value in (
        ("example_wanted", wanted),
        ("example_weight", weight),
        ("example_weight_rate", rate),
        ("example_weight_acceleration", bend),
    ):
        getattr(state, name)[0, 0, :3] = value
    state.example[0, 0, :3] = (0, 1, 2)
    there, back = follow_weights(0, 0, REACH_LIMITS, KEYS, DT, state)
    horizon = max(time, oracle.time_of_weights(wanted, weight, REACH_LIMITS))
    after = [
        oracle.settle(weight[k] - wanted[k], rate[k], bend[k], horizon, DT)[0] + wanted[k] for k in range(3)
    ]
    np.testing.assert_allclose(state.example_weight[0, 0, :3], after, atol=1e-9)
    assert sum(after) == pytest.approx(1.0)
    assert there == pytest.approx(np.dot(after, KEYS.apex_time))
    assert back == pytest.approx(np.dot(after, KEYS.end_time - KEYS.apex_time))


def test_weights_that_have_faded_leave_their_slots():
    state = state_of(0, example_count=2)
    state.example_wanted[0, 0, 0] = state.example_weight[0, 0, 0] = 1.0
    state.example[0, 0, :2] = (0, 1)
    state.example_weight[0, 0, 1] = 0.5 * LEAST_WEIGHT
    follow_weights(0, 0, REACH_LIMITS, KEYS, DT, state)
    assert state.example_count[0, 0] == 1
    assert not state.example_weight[0, 0, 1:].any()


@given(now=st.floats(-3, 3), wanted=st.floats(-3, 3), usual=st.floats(0.5, 3))
def test_courses_change_their_pace_gradually_but_from_rest_at_once(now, wanted, usual):
    assert paced(now, wanted, usual, True, REACH_LIMITS, DT) == wanted
    after = paced(now, wanted, usual, False, REACH_LIMITS, DT)
    largest = REACH_LIMITS.turn_back * max(abs(now), usual) ** 2 * DT
    assert abs(after - now) == pytest.approx(min(largest, abs(wanted - now)))
    assert min(now, wanted) - 1e-12 <= after <= max(now, wanted) + 1e-12
