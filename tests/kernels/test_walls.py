"""Wall lines, lists and following of motion against brute force."""

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from crowd.world.walls import Walls
from crowd_kernels.wall_contact import hold_at_walls, wall_distance
from crowd_kernels.walls import MOST_EDGES, find_edges, nearest_on_edge, wall_lines
from tests.oracles import walls as oracle

SQUARE = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
NOTCH = [(-3, -3), (3, -3), (3, 3), (0.5, 3), (0.5, 0), (-0.5, 0), (-0.5, 3), (-3, 3)]
WALL = [(-1.5, 0.0), (1.5, 0.5)]
RADIUS = 0.3
HORIZON = 1.0

MAZE = Walls.build([SQUARE, np.array(NOTCH) + (7.0, 0.0)], [WALL + np.array((0.0, 3.0)), [(-4, -5), (-4, 5)]])


def lines_at(walls, x, z, vx, vz, reach=3.0):
    lines = np.zeros(4 * MOST_EDGES)
    count = wall_lines(
        walls.table, x, z, vx, vz, RADIUS, reach, 1 / HORIZON, np.zeros(MOST_EDGES, np.int64), lines
    )
    return lines[: 4 * count].reshape(count, 4)


def is_admissible(lines, velocity, slack=0.0):
    side = lines[:, 2] * (velocity[1] - lines[:, 1]) - lines[:, 3] * (velocity[0] - lines[:, 0])
    return bool((side >= -slack).all())


@given(st.integers(0, 2**32 - 1), st.floats(-6, 6), st.floats(-6, 6))
@settings(max_examples=100)
def test_nearest_point_of_an_edge(seed, x, z):
    rng = np.random.default_rng(seed)
    walls = Walls.build([], [rng.uniform(-3, 3, (2, 2))])
    px, pz, feature = nearest_on_edge(walls.table.edge, 0, x, z)
    along = np.linspace(0, 1, 20_001)[:, None]
    points = walls.start[0] + along * (walls.end[0] - walls.start[0])
    distance = np.linalg.norm(points - (x, z), axis=1)
    assert math.hypot(px - x, pz - z) == pytest.approx(distance.min(), abs=1e-4)
    assert feature == {0: -1, 20_000: 1}.get(int(distance.argmin()), 0)


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=30)
def test_lists_hold_every_edge_in_reach(seed):
    rng = np.random.default_rng(seed)
    walls = Walls.build([], rng.uniform(-20, 20, (rng.integers(1, 12), 2, 2)), reach=2.0)
    keys = np.zeros(MOST_EDGES, np.int64)
    for x, z in rng.uniform(-24, 24, (30, 2)):
        found = find_edges(walls.table, x, z, 2.0, keys)
        edge_distance = np.array(
            [
                oracle.distance_to_segments([(x, z)], walls.start[e : e + 1], walls.end[e : e + 1])[0]
                for e in range(walls.count)
            ]
        )
        side = (walls.end - walls.start)[:, 1] * (x - walls.start[:, 0])
        side -= (walls.end - walls.start)[:, 0] * (z - walls.start[:, 1])
        expected = np.flatnonzero((edge_distance < 2.0) & (side > 0))
        assert sorted(keys[:found] & 0xFFFFFFFF) == expected.tolist()
        assert (np.diff(keys[:found]) > 0).all()
        nearest = edge_distance.min()
        assert wall_distance(walls.table, x, z) == pytest.approx(nearest) or nearest > 2.0


@pytest.mark.parametrize("shape", ["square", "wall", "notch"])
@given(seed=st.integers(0, 2**32 - 1))
@settings(max_examples=150)
def test_admissible_velocities_touch_no_wall(shape, seed):
    walls = {
        "square": Walls.build([SQUARE]),
        "wall": Walls.build([], [WALL]),
        "notch": Walls.build([NOTCH]),
    }[shape]
    rng = np.random.default_rng(seed)
    position = rng.uniform(-4, 4, 2)
    assume(oracle.distance_to_segments([position], walls.start, walls.end)[0] > RADIUS)
    assume(not any(oracle.is_inside(position, outline) for outline in walls.polygons))
    velocity = rng.uniform(-1, 1, 2)
    lines = lines_at(walls, *position, *velocity)
    for candidate in rng.uniform(-1.6, 1.6, (60, 2)):
        if is_admissible(lines, candidate, -1e-6):
            assert not oracle.hits(position, candidate, RADIUS - 1e-4, HORIZON, walls.start, walls.end)


@given(seed=st.integers(0, 2**32 - 1))
@settings(max_examples=150)
def test_a_free_velocity_stays_allowed(seed):
    # A velocity outside every velocity obstacle satisfies the lines made for it.
    rng = np.random.default_rng(seed)
    position, velocity = rng.uniform(-3, 3, 2), rng.uniform(-1.2, 1.2, 2)
    walls = Walls.build([SQUARE])
    assume(not oracle.is_inside(position, walls.polygons[0]))
    assume(oracle.distance_to_segments([position], walls.start, walls.end)[0] > RADIUS + 0.01)
    assume(not oracle.hits(position, velocity, RADIUS + 1e-3, HORIZON, walls.start, walls.end))
    assert is_admissible(lines_at(walls, *position, *velocity), velocity, 1e-9)


def test_a_line_is_as_near_as_possible():
    # Straight at the middle of a face from 2 m away: the largest safe speed, and no less.
    lines = lines_at(Walls.build([SQUARE]), 0.0, -3.0, 0.0, 2.5)
    assert len(lines) == 1
    assert lines[0, 1] == pytest.approx(2.0 - RADIUS)
    assert lines[0, 2:] == pytest.approx((-1.0, 0.0))


def test_a_thin_wall_has_two_sides():
    walls = Walls.build([], [[(-5, 0), (5, 0)]])
    assert lines_at(walls, 0.0, -1.0, 0.0, 1.0)[0, 2:] == pytest.approx((-1.0, 0.0))
    assert lines_at(walls, 0.0, 1.0, 0.0, -1.0)[0, 2:] == pytest.approx((1.0, 0.0))


def test_a_touched_wall_lets_go_but_not_nearer():
    lines = lines_at(Walls.build([SQUARE]), 0.0, -1.2, 0.0, 0.0)
    assert is_admissible(lines, (0.3, -0.5))
    assert not is_admissible(lines, (0.3, 0.1))


def test_far_from_walls_there_are_no_lines():
    walls = Walls.build([SQUARE])
    assert len(lines_at(walls, 50.0, 0.0, 1.0, 0.0)) == 0
    assert len(lines_at(Walls.build(), 0.0, 0.0, 1.0, 0.0)) == 0


def follow(walls, before, after, radius=RADIUS, dt=0.1):
    position = np.array([[after[0], 0.7, after[1]]], float)
    hold_at_walls(0, position, np.array([[before[0], 0.7, before[1]]], float), radius, walls.table, dt)
    assert position[0, 1] == 0.7
    return position[0, [0, 2]]


@given(seed=st.integers(0, 2**32 - 1), size=st.sampled_from([0.05, 0.5, 3.0, 30.0]))
@settings(max_examples=300)
def test_no_motion_passes_a_wall(seed, size):
    rng = np.random.default_rng(seed)
    before = rng.uniform((-6, -6), (12, 6))
    assume(not any(oracle.is_inside(before, outline) for outline in MAZE.polygons))
    assume(oracle.distance_to_segments([before], MAZE.start, MAZE.end)[0] >= RADIUS)
    after = before + rng.normal(0, size, 2)
    end = follow(MAZE, before, after)
    assert np.isfinite(end).all()
    assert not any(oracle.is_inside(end, outline) for outline in MAZE.polygons)
    assert oracle.distance_to_segments([end], MAZE.start, MAZE.end)[0] >= RADIUS - 1e-3
    assert np.linalg.norm(end - before) <= np.linalg.norm(after - before) + 1e-3
    path = before + np.linspace(0, 1, 200)[:, None] * (after - before)
    if oracle.distance_to_segments(path, MAZE.start, MAZE.end).min() > RADIUS:
        np.testing.assert_allclose(end, after, atol=1e-9)


@given(seed=st.integers(0, 2**32 - 1), radius=st.floats(0.05, 0.9))
@settings(max_examples=100)
def test_a_long_fast_walk_never_gets_through(seed, radius):
    rng = np.random.default_rng(seed)
    room = Walls.build([SQUARE], boundaries=[[(-4, -4), (4, -4), (5, 4), (-4, 4)]])
    position = np.array([0.0, -3.0])
    for _ in range(60):
        new = follow(room, position, position + rng.normal(0, 2.0, 2), radius)
        assert not oracle.crosses(position, new, room.start, room.end)
        assert oracle.distance_to_segments([new], room.start, room.end)[0] >= min(radius, 0.95) - 1e-3
        position = new


def test_motion_slides_along_a_wall():
    walls = Walls.build([], [[(-50, 0), (50, 0)]])
    assert follow(walls, (0, -1), (3, 2)) == pytest.approx((3.0, -RADIUS), abs=1e-3)
    corner = Walls.build(boundaries=[[(0, 0), (9, 0), (9, 9), (0, 9)]])
    assert follow(corner, (1, 1), (-2, -3)) == pytest.approx((RADIUS, RADIUS), abs=1e-3)


def test_a_start_too_near_is_pushed_off():
    walls = Walls.build([], [[(-50, 0), (50, 0)]])
    assert follow(walls, (0, -0.1), (0, -0.1)) == pytest.approx((0.0, -RADIUS), abs=1e-3)


def test_a_gap_too_narrow_is_endured():
    walls = Walls.build([], [[(-5, 0), (5, 0)], [(-5, 0.4), (5, 0.4)]])
    end = follow(walls, (0.0, 0.2), (0.5, 0.2))
    assert 0.0 < end[1] < 0.4
    assert end[0] == pytest.approx(0.5, abs=0.01)


def test_the_inside_of_an_appeared_solid_is_left():
    walls = Walls.build([SQUARE])
    position = np.array([0.6, 0.1])
    for _ in range(12):
        new = follow(walls, position, position)
        assert np.linalg.norm(new - position) <= 0.2 + 1e-3
        position = new
    assert position == pytest.approx((1.0 + RADIUS, 0.1), abs=1e-3)


def test_positions_that_are_none_are_left_alone():
    for before, after in (((np.nan, 0), (1, 1)), ((0, -3), (np.nan, 1)), ((0, -3), (np.inf, 1))):
        np.testing.assert_array_equal(follow(Walls.build([SQUARE]), before, after), after)
