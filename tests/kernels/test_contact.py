"""Overlapping bodies pushed apart, against a slow twin and against what people would notice."""

import numba
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from crowd.navigation.avoidance import Avoidance, AvoidanceSettings
from crowd.world.walls import Walls
from tests.oracles import contact as oracle
from tests.oracles import walls as wall_oracle

NO_WALLS = Walls.build()
WANTED_DEPTH = 0.02
DEEPEST = 0.05


def everyone(count):
    return np.arange(count, dtype=np.int32)


def pile(rng, count, size):
    position = np.zeros((count, 3))
    position[:, [0, 2]] = rng.uniform(-size, size, (count, 2))
    return position


def project(position, radius, *, previous=None, mobility=None, active=None, walls=NO_WALLS, **changes):
    """Return pushed positions and the report."""
    count = len(position)
    avoidance = Avoidance(AvoidanceSettings(**changes), count)
    pushed = position.copy()
    report = avoidance.project(
        pushed,
        position.copy() if previous is None else previous,
        radius,
        np.ones(count) if mobility is None else mobility,
        everyone(count) if active is None else active,
        walls,
        0.05,
    )
    return pushed, report


@given(st.integers(0, 2**32 - 1), st.integers(2, 30))
@settings(max_examples=60)
def test_passes_equal_the_slow_twin(seed, count):
    rng = np.random.default_rng(seed)
    position = pile(rng, count, 0.45 * np.sqrt(count))
    radius, mobility = rng.uniform(0.15, 0.3, count), rng.choice([0.0, 0.5, 1.0], count)
    pushed, _ = project(
        position, radius, mobility=mobility, contact_rounds=1, contact_passes=3, most_contact_passes=7,
        contact_margin=0.05,
    )  # fmt: skip
    lists = oracle.pairs_by_character(position, radius, 0.05)
    if max(map(len, lists)) <= 12:
        expected = oracle.relax(position, radius, mobility, 0.05, 3, 7, WANTED_DEPTH)
        np.testing.assert_allclose(pushed, expected, atol=1e-12)


@given(st.integers(0, 2**32 - 1), st.integers(2, 60), st.floats(0.0, 1.0))
@settings(max_examples=50)
def test_piles_come_apart(seed, count, density_scale):
    rng = np.random.default_rng(seed)
    position = pile(rng, count, density_scale * 0.5 * np.sqrt(count))
    radius = rng.uniform(0.15, 0.4, count)
    for _ in range(4):
        position, report = project(position, radius)
    assert oracle.deepest_overlap(position, radius) <= DEEPEST
    assert report.deepest_overlap == pytest.approx(oracle.deepest_overlap(position, radius), abs=1e-9)


def test_a_shallow_crowd_is_settled_in_one_step(rng):
    position = pile(rng, 400, 10.0)
    radius = np.full(400, 0.25)
    pushed, _ = project(position, radius)
    assert oracle.deepest_overlap(position, radius) > 0.3
    assert oracle.deepest_overlap(pushed, radius) <= WANTED_DEPTH + 1e-9


def test_coincident_characters_part():
    position = np.zeros((5, 3))
    pushed, _ = project(position, np.full(5, 0.25))
    assert oracle.deepest_overlap(pushed, np.full(5, 0.25)) <= DEEPEST
    again, _ = project(position, np.full(5, 0.25))
    np.testing.assert_array_equal(pushed, again)


def test_who_cannot_be_moved_stays(rng):
    position = np.array([[0.0, 0.0, 0.0], [0.2, 0.0, 0.0], [-0.1, 0.0, 0.3]])
    pushed, _ = project(position, np.full(3, 0.25), mobility=np.array([0.0, 1.0, 1.0]))
    np.testing.assert_array_equal(pushed[0], position[0])
    assert oracle.deepest_overlap(pushed, np.full(3, 0.25)) <= WANTED_DEPTH
    pushed, report = project(position, np.full(3, 0.25), mobility=np.zeros(3))
    np.testing.assert_array_equal(pushed, position)
    assert report.deepest_overlap == 0.0


def test_only_active_characters_move(rng):
    position = pile(rng, 30, 1.0)
    active = np.arange(0, 30, 2, dtype=np.int32)
    pushed, _ = project(position, np.full(30, 0.25), active=active)
    np.testing.assert_array_equal(pushed[1::2], position[1::2])
    assert not (pushed[::2] == position[::2]).all()
    nobody, report = project(position, np.full(30, 0.25), active=everyone(0))
    np.testing.assert_array_equal(nobody, position)
    assert report.deepest_overlap == 0.0


def test_a_bad_position_harms_nobody_else(rng):
    position = pile(rng, 30, 1.5)
    radius = np.full(30, 0.25)
    position[4], position[9, 0] = np.nan, np.inf
    kept = np.setdiff1d(everyone(30), [4, 9]).astype(np.int32)
    pushed, _ = project(position, radius)
    expected, _ = project(position, radius, active=kept)
    np.testing.assert_array_equal(pushed, expected)
    assert np.isfinite(pushed[kept]).all()


def test_a_pile_against_a_wall_stays_on_its_side(rng):
    walls = Walls.build([], [[(-20, 0), (20, 0)]])
    previous = pile(rng, 150, 4.0)
    previous[:, 2] = -0.3 - np.abs(previous[:, 2])
    radius = np.full(150, 0.25)
    previous, _ = project(previous, radius, walls=walls)
    for _ in range(10):
        position = previous.copy()
        position[:, 2] += rng.uniform(0.0, 0.5, 150)
        position, _ = project(position, radius, previous=previous, walls=walls)
        assert (position[:, 2] <= -0.25 + 1e-3).all()
        assert oracle.deepest_overlap(position, radius) <= DEEPEST
        previous = position


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=20)
def test_fuzzed_fast_motion_crosses_no_wall(seed):
    rng = np.random.default_rng(seed)
    walls = Walls.build(
        [[(-1, -1), (1, -1), (1, 1)]],
        [[(-3, -2), (2, -3)], [(-3, 3), (3, 2.5)]],
        boundaries=[[(-5, -5), (5, -5), (5, 5), (-5, 5)]],
    )
    position = pile(rng, 40, 4.6)
    inside = [wall_oracle.is_inside(p, walls.polygons[0]) for p in position[:, [0, 2]]]
    position = position[~np.array(inside)]
    radius = rng.uniform(0.1, 0.3, len(position))
    for _ in range(15):
        previous = position
        moved = previous + rng.normal(0, 1.5, previous.shape) * (1, 0, 1)
        position, _ = project(moved, radius, previous=previous, walls=walls)
        for before, after in zip(previous[:, [0, 2]], position[:, [0, 2]], strict=True):
            assert not wall_oracle.crosses(before, after, walls.start, walls.end) or wall_oracle.hits(
                before, after - before, 0.2, 1.0, walls.start, walls.end
            )
            assert not wall_oracle.is_inside(after, walls.polygons[0])
            assert max(abs(after)) <= 5.0


def test_touching_characters_lose_the_speed_into_each_other_and_into_walls():
    position = np.array([[0.0, 0.0, 0.0], [0.49, 0.0, 0.0], [9.0, 0.0, 0.2]])
    velocity = np.array([[1.0, 0.0, 0.3], [-0.5, 0.0, 0.0], [1.0, 0.0, -1.0]])
    walls = Walls.build([], [[(5, 0), (15, 0)]])
    Avoidance(AvoidanceSettings(), 3).project(
        position, position.copy(), np.full(3, 0.25), np.ones(3), everyone(3), walls, 0.05, velocity
    )
    assert velocity[0] == pytest.approx((0.25, 0.0, 0.3))
    assert velocity[1] == pytest.approx((0.25, 0.0, 0.0))
    assert velocity[2] == pytest.approx((1.0, 0.0, 0.0), abs=1e-12)


def test_far_characters_and_threads_change_no_bit(rng):
    position = pile(rng, 600, 8.0)
    position[500:, 0] += 900.0
    radius = np.full(600, 0.25)
    walls = Walls.build([], [[(-9, 0), (9, 1)]])
    together, _ = project(position, radius, walls=walls)
    alone, _ = project(position, radius, walls=walls, active=everyone(500))
    np.testing.assert_array_equal(together[:500], alone[:500])
    threads = numba.get_num_threads()
    try:
        numba.set_num_threads(1)
        serial, _ = project(position, radius, walls=walls)
    finally:
        numba.set_num_threads(threads)
    np.testing.assert_array_equal(together, serial)
