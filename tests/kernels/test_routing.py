"""Corners of ways, and the way points on them: straight ways are free, lengths are near the shortest."""

from itertools import pairwise

import numpy as np
import pytest

from crowd.navigation.routing import Routing, RoutingSettings
from crowd.world import World
from crowd.world.obstacles import Box, Wall
from crowd_kernels.distance_field import descend, fill_field
from crowd_kernels.free_line import SLACK
from crowd_kernels.grid_search import BUCKETS, FRESH_RECORD, OVERFLOW
from crowd_kernels.routing import (
    UNREACHABLE,
    follow_crowd,
    mark_crossing_ways,
    route_by_field,
    route_by_search,
)
from crowd_kernels.string_pulling import pull_string, tighten_string, widen_corners
from tests.oracles import routing as oracle

RADIUS = 0.25
WORLD = World(
    (-8.0, 8.0, -8.0, 8.0),
    [Box(-8, 4, -4.2, -3.8), Box(-4, 8, -0.2, 0.2), Box(-2, -1, 2, 6), Wall((1, 3), (6, 5)), Box(3, 4, 1, 2)],
)
GRID = WORLD.grid(RADIUS)
COUNT = 30


@pytest.fixture
def crowd(rng):
    """Positions and goals where bodies fit, everybody's rows."""
    ends = np.zeros((2, COUNT, 3))
    ends[:, :, [0, 2]] = rng.uniform(-7.5, 7.5, (2, COUNT, 2))
    position, goal = (WORLD.nearest_walkable(places, RADIUS) for places in ends)
    return position, goal, np.arange(COUNT, dtype=np.int32)


def outputs(corners=12):
    """Corner, rest, corner count, status."""
    return (
        np.full((COUNT, corners, 2), np.nan),
        np.full((COUNT, corners), np.nan),
        np.zeros(COUNT, np.int32),
        np.zeros(COUNT, np.uint8),
    )


def search(position, goal, rows, *, chunks=1, entries=20_000, lane=0.0, corners=12, driver=route_by_search):
    cells = GRID.layout.cell_count
    out = outputs(corners)
    driver(
        GRID.arrays,
        GRID.walls,
        np.zeros((0, cells), np.int32),
        rows,
        GRID.nearest_cells(position[rows][:, [0, 2]]),
        GRID.nearest_cells(goal[rows][:, [0, 2]]),
        position,
        goal,
        lane,
        1,
        np.full((chunks, cells), FRESH_RECORD),
        np.zeros((chunks, BUCKETS), np.int32),
        np.zeros((chunks, entries), np.int64),
        np.zeros((chunks, cells), np.int32),
        *out,
    )
    return out


def assert_free(position, corner, count, rows):
    """Every leg of every way is free for the body."""
    for row in rows:
        legs = np.vstack([position[row, [0, 2]], corner[row, : count[row]]])
        for start, end in pairwise(legs):
            assert GRID.is_free_line(start, end)


@pytest.mark.parametrize("lane", [0.0, 1.5])
def test_searched_ways_are_free_and_short(crowd, lane):
    position, goal, rows = crowd
    corner, rest, count, status = search(position, goal, rows, lane=lane)
    assert (status == 0).all()
    assert_free(position, corner, count, rows)
    for row in rows:
        np.testing.assert_array_equal(corner[row, count[row] - 1], goal[row, [0, 2]])
        length = oracle.way_length(position[row, [0, 2]], corner[row, : count[row]])
        first = np.linalg.norm(corner[row, 0] - position[row, [0, 2]])
        np.testing.assert_allclose(first + rest[row, 0], length)
        best = oracle.shortest_way(WORLD, position[row], goal[row], RADIUS)
        assert length <= 1.06 * best + 0.3 + 1.5 * lane * (count[row] - 1)


def test_ways_down_a_field_are_as_good_as_searched_ones(crowd):
    position, goal, rows = crowd
    goal[:] = goal[0]
    cell = GRID.nearest_cells(goal[:1, [0, 2]])
    field = GRID.field(cell)
    out = outputs()
    cells = np.zeros((2, GRID.layout.cell_count), np.int32)
    start = GRID.nearest_cells(position[:, [0, 2]])
    route_by_field(GRID.arrays, GRID.walls, field, rows, start, position, goal, 0.0, cells, *out)
    corner, _, count, status = out
    assert (status == 0).all()
    assert_free(position, corner, count, rows)
    searched = search(position, goal, rows)
    for row in rows:
        lengths = [
            oracle.way_length(position[row, [0, 2]], way[0][row, : way[2][row]]) for way in (out, searched)
        ]
        assert lengths[0] <= 1.05 * lengths[1] + 0.3


def test_lanes_spread_people_but_keep_their_ways_free():
    start, goal = np.array([-6.0, -6.0]), np.array([-6.0, -2.0])
    corners = np.array([[4.4, -4.6], [4.4, -3.4], goal])
    places = []
    for lane in np.linspace(0, 3, 7):
        corner = corners.copy()
        widen_corners(GRID.arrays, GRID.walls, lane, *start, corner, 3)
        np.testing.assert_array_equal(corner[2], goal)
        legs = np.vstack([start, corner])
        assert all(GRID.is_free_line(a, b) for a, b in pairwise(legs))
        places.append(corner[0, 0])
    assert np.ptp(places) > 1.0, "lanes lie beside each other"


def test_a_pulled_string_keeps_its_ends_and_the_room_it_has():
    cell_goal = int(GRID.nearest_cells(np.array([[-6.0, 6.0]]))[0])
    cells = np.zeros(GRID.layout.cell_count, np.int32)
    field = np.zeros(GRID.layout.cell_count, np.int32)
    queue = np.zeros(20_000, np.int64)
    goals = np.array([cell_goal], np.int32)
    fill_field(GRID.mask, GRID.layout.columns, goals, np.zeros(BUCKETS, np.int32), queue, field)
    start_cell = int(GRID.nearest_cells(np.array([[-6.0, -6.0]]))[0])
    count = descend(GRID.mask, GRID.layout.columns, field, start_cell, cells)
    whole = np.zeros((20, 2))
    found = pull_string(GRID.arrays, GRID.walls, cells, count, False, -6.0, -6.0, -6.0, 6.0, whole)
    np.testing.assert_array_equal(whole[found - 1], [-6.0, 6.0])
    assert 3 <= found <= 10
    backward = np.zeros((20, 2))
    reversed_cells = cells[:count][::-1].copy()
    pull_string(GRID.arrays, GRID.walls, reversed_cells, count, True, -6.0, -6.0, -6.0, 6.0, backward)
    np.testing.assert_array_equal(whole, backward)
    short = np.zeros((2, 2))
    assert pull_string(GRID.arrays, GRID.walls, cells, count, False, -6.0, -6.0, -6.0, 6.0, short) == 2
    np.testing.assert_array_equal(short, whole[:2])


def test_needless_corners_are_left_out():
    corner = np.array([[-7.0, -6.5], [-6.0, -6.0], [-4.0, -6.5], [0.0, -6.0]])
    assert tighten_string(GRID.arrays, GRID.walls, -7.5, -7.0, corner, 4) == 1
    np.testing.assert_array_equal(corner[0], [0.0, -6.0])


def test_an_unreachable_goal_and_a_short_queue_are_told_apart(crowd):
    position, goal, rows = crowd
    position[0], goal[0] = [-6, 0, -6], [-6, 0, 6]
    assert (search(position, goal, rows[:1], entries=20)[3][0], search(position, goal, rows[:1])[3][0]) == (
        OVERFLOW,
        0,
    )
    field = np.full(GRID.layout.cell_count, 2**30, np.int32)
    out = outputs()
    cells = np.zeros((1, GRID.layout.cell_count), np.int32)
    start = GRID.nearest_cells(position[:1, [0, 2]])
    route_by_field(GRID.arrays, GRID.walls, field, rows[:1], start, position, goal, 0.0, cells, *out)
    assert out[3][0] == UNREACHABLE
    assert out[2][0] == 0


def test_chunks_and_threads_do_not_matter(crowd):
    position, goal, rows = crowd
    wanted = search(position, goal, rows, lane=0.6)
    for chunks, driver in ((4, route_by_search.serial), (4, route_by_search.threaded)):
        for a, b in zip(
            wanted, search(position, goal, rows, lane=0.6, chunks=chunks, driver=driver), strict=True
        ):
            np.testing.assert_array_equal(a, b)


@pytest.mark.parametrize("driver", [follow_crowd.serial, follow_crowd.threaded], ids=["serial", "threaded"])
def test_way_points_match_oracle(crowd, rng, driver):
    position, goal, rows = crowd
    corner, rest, count, _ = search(position, goal, rows, lane=0.6)
    index = np.array([rng.integers(0, n) for n in count], np.int32)
    count[3] = 0
    # Somewhere near the corner that they walk to, as people are who are pushed about.
    position[:, [0, 2]] = corner[rows, index] + rng.normal(0, 0.4, (COUNT, 2)) * (
        rng.random((COUNT, 1)) < 0.8
    )
    position[5] = np.nan
    walking = rows[rows != 7]
    way_point, remaining = np.full((COUNT, 3), 9.0), np.full(COUNT, 9.0)
    is_lost, before, step, period, reach = np.zeros(COUNT, np.uint8), index.copy(), 12, 2, 0.3
    driver(
        GRID.walls, RADIUS, position, corner, rest, count, walking, step, period, reach, index, way_point,
        remaining, is_lost,
    )  # fmt: skip
    for row in walking:
        place, corners = position[row, [0, 2]], corner[row, : count[row]]
        if row in (3, 5):
            np.testing.assert_array_equal(way_point[row, [0, 2]], place)
            assert np.isinf(remaining[row])
            continue
        wanted = before[row]
        is_near = np.linalg.norm(corners[wanted] - place) < reach and wanted < len(corners) - 1
        if is_near or (row + step) % period == 0:
            found = oracle.next_corner(GRID.is_free_line, place, corners, wanted, reach)
            assert is_lost[row] == (found is None)
            wanted = wanted if found is None else found
        assert index[row] == wanted
        np.testing.assert_array_equal(way_point[row, [0, 2]], corners[wanted])
        np.testing.assert_allclose(remaining[row], oracle.way_length(place, corners[wanted:]))
    assert way_point[7, 0] == remaining[7] == 9.0
    assert (index != before).any()


def test_ways_across_a_change_are_marked(crowd):
    position, goal, rows = crowd
    corner, _, count, _ = search(position, goal, rows)
    index = np.minimum(1, count - 1).astype(np.int32)
    for low, high in (((-5, -5), (-4, -3)), ((3.5, 2.0), (5, 7)), ((20, 20), (21, 21))):
        is_marked = np.zeros(COUNT, np.bool_)
        mark_crossing_ways(position, corner, count, index, rows[1:], *map(float, low + high), is_marked)
        for row in rows:
            wanted = oracle.touches(position[row, [0, 2]], corner[row, index[row] : count[row]], low, high)
            assert is_marked[row] == (wanted and row > 0)


def test_nobody_is_no_problem(crowd):
    position, goal, rows = crowd
    corner, rest, count, _ = search(position, goal, rows[:0])
    assert (count == 0).all()
    follow_crowd(
        GRID.walls, RADIUS, position, corner, rest, count, rows[:0], 0, 8, 0.3, count.copy(),
        np.zeros((COUNT, 3)), np.zeros(COUNT), np.zeros(COUNT, np.uint8),
    )  # fmt: skip


def test_ways_with_too_many_corners_are_walked_in_parts():
    combs = [
        Box(-8, 6.5, z, z + 0.2) if k % 2 else Box(-6.5, 8, z, z + 0.2) for k, z in enumerate(range(-7, 8))
    ]
    world = World((-8.0, 8.0, -8.0, 8.0), combs)
    routing = Routing(world, 1, settings=RoutingSettings(most_corners=4))
    place, goal, one = np.array([[0.0, 0, -7.5]]), np.array([[0.0, 0, 7.7]]), np.zeros(1, np.int32)
    routing.set_goals(one, goal, np.array([RADIUS]), place)
    assert routing.corner_count[0] == 4
    assert routing.rest[0, 3] > 1.0, "the way is cut"
    way_point, remaining = place.copy(), np.zeros(1)
    for step in range(12_000):
        routing.way_points(place, one, step, way_point, remaining)
        way = way_point - place
        place = place + way * min(1.0, 0.05 / max(np.linalg.norm(way), 1e-9))
        assert world.clearance_at(place)[0] > RADIUS - SLACK - 0.01
        if np.linalg.norm(place - goal) < 0.1:
            break
    assert np.linalg.norm(place - goal) < 0.1
