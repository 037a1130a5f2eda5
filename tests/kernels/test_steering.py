"""Lines and linear programs against plain geometry, and what they promise."""

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from crowd_kernels.linear_program import solve_least_violation, solve_nearest
from crowd_kernels.steering import hashed_direction, limited_change, pair_line, share_of
from tests.oracles import steering as oracle

coordinate = st.floats(-4.0, 4.0)
speed_component = st.floats(-2.0, 2.0)


@given(coordinate, coordinate, speed_component, speed_component, st.floats(0.1, 1.5), st.floats(0.2, 5.0))
@settings(max_examples=300)
def test_pair_line_is_the_nearest_way_out(x, z, vx, vz, radius_sum, horizon):
    distance = math.hypot(x, z)
    assume(distance > 1e-3 and abs(distance - radius_sum) > 1e-6)
    rate = 1 / horizon if distance > radius_sum else 1 / 0.1
    assume(math.hypot(vx - rate * x, vz - rate * z) > 1e-6)
    change_x, change_z, dx, dz = pair_line(x, z, vx, vz, radius_sum, 1 / horizon, 1 / 0.1, 0.0, 0.0)
    expected = oracle.smallest_change((x, z), (vx, vz), radius_sum, horizon if distance > radius_sum else 0.1)
    assert math.hypot(change_x, change_z) == pytest.approx(np.linalg.norm(expected), abs=1e-9)
    assert math.hypot(dx, dz) == pytest.approx(1.0, abs=1e-9)
    # The change is along the normal of the line.
    assert abs(change_x * dx + change_z * dz) < 1e-9


@given(coordinate, coordinate, speed_component, speed_component, st.floats(0.1, 1.0), st.floats(0.5, 4.0))
@settings(max_examples=200)
def test_two_that_both_obey_do_not_touch_within_the_horizon(x, z, vx, vz, radius_sum, horizon):
    assume(math.hypot(x, z) > radius_sum * 1.01)
    change_x, change_z, dx, dz = pair_line(x, z, vx, vz, radius_sum, 1 / horizon, 10.0, 0.0, 0.0)
    # Any relative velocity on the left of the line is safe, for example some along it and some beyond it.
    for along in (-2.0, 0.0, 2.0):
        for beyond in (1e-9, 0.5):
            relative = np.array(
                [vx + change_x + along * dx - beyond * dz, vz + change_z + along * dz + beyond * dx]
            )
            times = np.linspace(0.0, horizon, 300)[:, None]
            gap = np.linalg.norm(np.array([x, z]) - times * relative, axis=1).min() - radius_sum
            assert gap > -1e-6


def test_coincident_pair_parts_in_the_given_direction():
    change_x, change_z, dx, dz = pair_line(0.0, 0.0, 0.0, 0.0, 0.5, 0.5, 10.0, 0.6, 0.8)
    assert (change_x, change_z) == pytest.approx((3.0, 4.0))
    assert (dx, dz) == pytest.approx((0.8, -0.6))


def test_shares_add_up():
    assert share_of(0.5, 0.5) == 0.5
    assert share_of(0.0, 0.5) == 0.0
    assert share_of(0.5, 0.0) == 1.0
    assert share_of(0.0, 0.0) == 0.5
    assert share_of(0.2, 0.7) + share_of(0.7, 0.2) == pytest.approx(1.0)


def random_lines(rng, count, reach=1.2):
    angle = rng.uniform(0, 2 * np.pi, count)
    lines = np.zeros((count, 4))
    lines[:, :2] = rng.uniform(-reach, reach, (count, 2))
    lines[:, 2], lines[:, 3] = np.cos(angle), np.sin(angle)
    return lines


@given(st.integers(0, 2**32 - 1), st.integers(0, 12), st.booleans())
@settings(max_examples=300)
def test_linear_program_finds_the_best_velocity(seed, count, is_easy):
    rng = np.random.default_rng(seed)
    lines = random_lines(rng, count)
    if is_easy:
        # Turned so that one velocity is admissible for all.
        inner = rng.uniform(-0.8, 0.8, 2)
        wrong = lines[:, 2] * (inner[1] - lines[:, 1]) - lines[:, 3] * (inner[0] - lines[:, 0]) < 0
        lines[wrong, 2:] *= -1
    preferred = rng.uniform(-2, 2, 2)
    satisfied, x, z = solve_nearest(lines.ravel(), count, 1.5, *preferred, False)
    best = oracle.nearest_admissible(lines, 1.5, preferred)
    assert (satisfied == count) == (best is not None)
    if best is not None:
        assert np.hypot(x - preferred[0], z - preferred[1]) == pytest.approx(
            np.linalg.norm(best - preferred), abs=1e-6
        )
        assert oracle.is_admissible(lines, np.array([x, z]), 1e-9)
        assert np.hypot(x, z) <= 1.5 + 1e-9
    else:
        assert oracle.nearest_admissible(lines[:satisfied], 1.5, preferred) is not None


@given(st.integers(0, 2**32 - 1), st.integers(3, 10), st.integers(0, 2))
@settings(max_examples=100)
def test_least_violation_is_least_and_walls_stay_hard(seed, soft_count, hard_count):
    rng = np.random.default_rng(seed)
    hard = random_lines(rng, hard_count)
    hard[:, :2] *= 0.3
    lines = np.concatenate([hard, random_lines(rng, soft_count)])
    count = len(lines)
    satisfied, x, z = solve_nearest(lines.ravel(), count, 1.5, 0.3, 0.2, False)
    assume(hard_count <= satisfied < count)
    x, z = solve_least_violation(lines.ravel(), count, hard_count, satisfied, 1.5, x, z, np.zeros(4 * count))
    violation = lines[:, 2] * (lines[:, 1] - z) - lines[:, 3] * (lines[:, 0] - x)
    assert np.hypot(x, z) <= 1.5 + 1e-6
    assert (violation[:hard_count] <= 1e-6).all()
    possible = oracle.least_violation(lines, hard_count, 1.5)
    if possible is not None:
        assert violation[hard_count:].max() <= possible + 1e-3


def test_limited_change_keeps_direction():
    assert limited_change(1.0, 0.0, 1.05, 0.0, 0.1) == (1.05, 0.0)
    assert limited_change(1.0, 0.0, 1.0, 2.0, 0.1) == pytest.approx((1.0, 0.1))
    assert limited_change(1.0, 0.0, 1.0, 2.0, math.inf) == (1.0, 2.0)


def test_hashed_directions_are_spread_and_repeatable():
    directions = np.array([hashed_direction(1, k, 2, 3) for k in range(2000)])
    np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1.0, atol=1e-12)
    assert np.linalg.norm(directions.mean(axis=0)) < 0.06
    assert hashed_direction(1, 5, 2, 3) == hashed_direction(1, 5, 2, 3)
    assert hashed_direction(1, 5, 2, 3) != hashed_direction(2, 5, 2, 3)
