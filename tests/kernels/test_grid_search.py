"""Shortest ways on grids: as short as Dijkstra's, no cut corners, fields, and published optimal lengths."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings, strategies
from hypothesis.extra.numpy import arrays

from benchmarks.movingai import read_queries
from crowd_kernels.distance_field import descend, fill_field, label_components
from crowd_kernels.grid_search import (
    BUCKETS,
    FOUND,
    FRESH_RECORD,
    LAST_GENERATION,
    OVERFLOW,
    UNREACHABLE,
    UNSEEN,
    octile,
    search_cells,
    search_ways,
    trace_back,
)
from crowd_kernels.walkable import link_cells, mask_links
from tests.oracles import grid_search as oracle

COLUMNS, ROWS = 40, 30


def scratch(cells, chunks=1, entries=None):
    """Record, head and queue."""
    return (
        np.full((chunks, cells), FRESH_RECORD),
        np.zeros((chunks, BUCKETS), np.int32),
        np.zeros((chunks, entries or 4 * cells), np.int64),
    )


def mask_of(is_walkable):
    rows, columns = is_walkable.shape
    link, mask = np.zeros((2, rows * columns), np.uint8)
    link_cells(np.ascontiguousarray(is_walkable.ravel()), columns, rows, link)
    mask_links(link, columns, rows, 0, columns, 0, rows, mask)
    return mask


def no_landmarks(mask):
    return np.zeros((0, len(mask)), np.int32)


def field_of(mask, columns, *goals):
    cost = np.zeros(len(mask), np.int32)
    _, head, queue = scratch(len(mask))
    assert fill_field(mask, columns, np.array(goals, np.int32), head[0], queue[0], cost) == FOUND
    return cost


@pytest.fixture(params=[0.0, 0.1, 0.35, 0.5])
def random_map(request, rng):
    return (rng.random((ROWS, COLUMNS)) > request.param).astype(np.uint8)


def search(mask, columns, start, goal, chunks=1, landmark_cost=None, driver=search_ways):
    count = len(start)
    out = np.zeros(count, np.int32), np.zeros(count), np.zeros(count, np.int32)
    if landmark_cost is None:
        landmark_cost = no_landmarks(mask)
    driver(mask, columns, start, goal, 1, landmark_cost, *scratch(len(mask), chunks), *out)
    return out


def test_masks_match_oracle(random_map):
    mask = mask_of(random_map)
    for row in range(ROWS):
        for column in range(COLUMNS):
            wanted = sum(1 << number for number, _, _ in oracle.moves(random_map, column, row))
            assert mask[row * COLUMNS + column] == wanted


def test_ways_and_fields_are_as_short_as_dijkstra_says(random_map, rng):
    mask = mask_of(random_map)
    free = np.flatnonzero(random_map.ravel()).astype(np.int32)
    goal = rng.choice(free, 6)
    for cell in goal:
        exact = oracle.distances(random_map, (cell % COLUMNS, cell // COLUMNS)).ravel()
        start = rng.choice(free, 40)
        is_reachable = np.isfinite(exact[start])
        landmark_cost = np.array([field_of(mask, COLUMNS, mark) for mark in rng.choice(free, 3)])
        for landmarks in (no_landmarks(mask), landmark_cost):
            goals = np.full(40, cell, np.int32)
            status, length, _ = search(mask, COLUMNS, start, goals, landmark_cost=landmarks)
            np.testing.assert_array_equal(status, np.where(is_reachable, FOUND, UNREACHABLE))
            np.testing.assert_allclose(length[is_reachable], exact[start][is_reachable], rtol=5.1e-5)
        field = field_of(mask, COLUMNS, cell)
        np.testing.assert_array_equal(field == UNSEEN, ~np.isfinite(exact))
        seen = np.isfinite(exact)
        np.testing.assert_allclose(field[seen] / 70, exact[seen], rtol=2e-4, atol=1e-9)


def test_components_agree_with_reachability(random_map):
    mask = mask_of(random_map)
    label = np.zeros(len(mask), np.int32)
    label_components(mask, COLUMNS, label)
    free = np.flatnonzero(random_map.ravel())
    first = free[0]
    exact = oracle.distances(random_map, (first % COLUMNS, first // COLUMNS)).ravel()
    np.testing.assert_array_equal(label[free] == label[first], np.isfinite(exact[free]))


def test_traced_and_descended_ways_are_chains_of_allowed_moves(random_map):
    mask = mask_of(random_map)
    label = np.zeros(len(mask), np.int32)
    label_components(mask, COLUMNS, label)
    start, goal = np.flatnonzero(label == np.bincount(label).argmax())[[0, -1]]
    record, head, queue = (array[0] for array in scratch(len(mask)))
    assert search_cells(mask, COLUMNS, start, goal, 1, no_landmarks(mask), record, head, queue)[0] == FOUND
    cells = np.zeros(len(mask), np.int32)
    traced = cells[: trace_back(record, COLUMNS, goal, cells)][::-1].copy()
    field = field_of(mask, COLUMNS, goal)
    descended = cells[: descend(mask, COLUMNS, field, start, cells)].copy()
    for way in (traced, descended):
        assert way[0] == start
        assert way[-1] == goal
        for here, there in pairwise(way):
            near = {
                r * COLUMNS + c for _, (c, r), _ in oracle.moves(random_map, here % COLUMNS, here // COLUMNS)
            }
            assert there in near


def test_start_at_goal_and_walled_in():
    is_walkable = np.ones((5, 5), np.uint8)
    is_walkable[1:4, 1:4] = [[0, 0, 0], [0, 1, 0], [0, 0, 0]]
    mask = mask_of(is_walkable)
    status, length, _ = search(mask, 5, np.array([12, 12], np.int32), np.array([12, 0], np.int32))
    assert list(status) == [FOUND, UNREACHABLE]
    assert length[0] == 0
    assert np.isnan(length[1])


def test_too_few_queue_entries_are_reported():
    mask = mask_of(np.ones((20, 20), np.uint8))
    record, head, queue = (array[0] for array in scratch(400, entries=10))
    # The walled goal keeps the search going until the queue is full.
    mask[399] = 0
    assert search_cells(mask, 20, 210, 399, 1, no_landmarks(mask), record, head, queue)[0] == OVERFLOW
    assert fill_field(mask, 20, np.array([0], np.int32), head, queue, np.zeros(400, np.int32)) == OVERFLOW


def test_too_little_room_for_a_way_is_reported():
    mask = mask_of(np.ones((1, 20), np.uint8))
    record, head, queue = (array[0] for array in scratch(20))
    assert search_cells(mask, 20, 0, 19, 1, no_landmarks(mask), record, head, queue)[0] == FOUND
    assert trace_back(record, 20, 19, np.zeros(19, np.int32)) == 0
    assert trace_back(record, 20, 19, np.zeros(20, np.int32)) == 20


def test_octile_is_the_length_on_free_ground_in_any_generation():
    mask = mask_of(np.ones((15, 15), np.uint8))
    record, head, queue = (array[0] for array in scratch(225))
    for generation, goal in [(1, 0), (2, 7), (3, 112), (LAST_GENERATION - 1, 224), (LAST_GENERATION, 30)]:
        status, cost, _ = search_cells(
            mask, 15, 30, goal, generation, no_landmarks(mask), record, head, queue
        )
        assert (status, cost) == (FOUND, octile(15, 30, goal))


def test_a_field_has_the_nearest_of_several_goals(random_map):
    mask = mask_of(random_map)
    goals = np.flatnonzero(random_map.ravel())[[0, 5, -1]]
    single = [field_of(mask, COLUMNS, goal) for goal in goals]
    np.testing.assert_array_equal(field_of(mask, COLUMNS, *goals), np.min(single, axis=0))


@settings(max_examples=60)
@given(
    is_walkable=arrays(np.uint8, (7, 8), elements=strategies.integers(0, 3).map(lambda n: min(n, 1))),
    ends=strategies.tuples(strategies.integers(0, 55), strategies.integers(0, 55)),
)
def test_pruning_loses_no_shortest_way(is_walkable, ends):
    mask = mask_of(is_walkable)
    start, goal = (np.array([end], np.int32) for end in ends)
    exact = oracle.distances(is_walkable, (ends[1] % 8, ends[1] // 8)).ravel()[ends[0]]
    status, length, _ = search(mask, 8, start, goal)
    if start == goal:
        assert length[0] == 0
    elif np.isfinite(exact):
        assert status[0] == FOUND
        np.testing.assert_allclose(length[0], exact, rtol=5.1e-5)
    else:
        assert status[0] == UNREACHABLE


@settings(max_examples=60)
@given(
    link=arrays(np.uint8, 42, elements=strategies.sampled_from([7, 7, 7, 3, 5, 6, 0])),
    goal=strategies.integers(0, 41),
)
def test_pruning_loses_no_shortest_way_between_thin_walls(link, goal):
    mask = np.zeros(42, np.uint8)
    mask_links(link, 7, 6, 0, 7, 0, 6, mask)
    np.testing.assert_array_equal(mask, oracle.mask_of_links(link, 7, 6))
    exact = oracle.mask_distances(mask, 7, goal)
    field = field_of(mask, 7, goal)
    np.testing.assert_array_equal(field, np.where(np.isfinite(exact), exact, UNSEEN))
    record, head, queue = (array[0] for array in scratch(42))
    for start in range(42):
        status, cost, _ = search_cells(
            mask, 7, start, goal, start + 1, no_landmarks(mask), record, head, queue
        )
        assert (status, cost) == ((FOUND, exact[start]) if np.isfinite(exact[start]) else (UNREACHABLE, 0))


def test_any_number_of_chunks_and_threads_gives_the_same_answer(rng):
    is_walkable = (rng.random((ROWS, COLUMNS)) > 0.3).astype(np.uint8)
    mask = mask_of(is_walkable)
    free = np.flatnonzero(is_walkable.ravel()).astype(np.int32)
    start, goal = rng.choice(free, 50), rng.choice(free, 50)
    wanted = search(mask, COLUMNS, start, goal)
    for chunks in (1, 4):
        for driver in (search_ways.serial, search_ways.threaded):
            for a, b in zip(wanted, search(mask, COLUMNS, start, goal, chunks, driver=driver), strict=True):
                np.testing.assert_array_equal(a, b)


def test_no_queries_are_no_problem():
    mask = mask_of(np.ones((4, 4), np.uint8))
    nobody = np.zeros(0, np.int32)
    assert search(mask, 4, nobody, nobody)[0].size == 0


def test_published_optimal_lengths(shared_data):
    maps = sorted((shared_data / "movingai").glob("*.map"))
    assert maps
    for path in maps:
        queries = read_queries(path, path.with_name(path.name + ".scen"))
        chosen = slice(None, None, 4)
        mask = mask_of(queries.is_walkable)
        status, length, _ = search(
            mask, queries.is_walkable.shape[1], queries.start[chosen], queries.goal[chosen]
        )
        assert (status == FOUND).all()
        np.testing.assert_allclose(length, queries.optimal_length[chosen], rtol=1e-4, err_msg=path.stem)
