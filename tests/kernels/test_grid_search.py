"""Shortest ways on grids: as short as Dijkstra's, no cut corners, fields, and published optimal lengths."""

from itertools import pairwise

import numpy as np
import pytest

from benchmarks.movingai import read_queries
from crowd_kernels.distance_field import descend, fill_field, label_components
from crowd_kernels.grid_search import (
    BUCKETS,
    FOUND,
    FRESH_RECORD,
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
    """Record, head and queue of a search."""
    entries = entries or 8 * cells
    return (
        np.full((chunks, cells), FRESH_RECORD),
        np.zeros((chunks, BUCKETS), np.int32),
        np.zeros((chunks, entries), np.int64),
    )


def mask_of(is_walkable):
    rows, columns = is_walkable.shape
    link, mask = np.zeros(rows * columns, np.uint8), np.zeros(rows * columns, np.uint8)
    link_cells(np.ascontiguousarray(is_walkable.ravel()), columns, rows, link)
    mask_links(link, columns, rows, 0, columns, 0, rows, mask)
    return mask


@pytest.fixture(params=[0.1, 0.35, 0.5])
def random_map(request, rng):
    return (rng.random((ROWS, COLUMNS)) > request.param).astype(np.uint8)


def field_of(mask, columns, *goals):
    """Distance field of some goal cells."""
    field = np.zeros(len(mask), np.int32)
    _, head, queue = (array[0] for array in scratch(len(mask)))
    assert fill_field(mask, columns, np.array(goals, np.int32), head, queue, field) == FOUND
    return field


def search(mask, columns, start, goal, chunks=1, landmarks=()):
    count = len(start)
    fields = [field_of(mask, columns, cell) for cell in landmarks]
    landmark_cost = np.array(fields, np.int32).reshape(len(fields), len(mask))
    out = np.zeros(count, np.int32), np.zeros(count), np.zeros(count, np.int32)
    search_ways(mask, columns, start, goal, 1, landmark_cost, *scratch(len(mask), chunks), *out)
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
        status, length, _ = search(mask, COLUMNS, start, np.full(40, cell, np.int32))
        is_reachable = np.isfinite(exact[start])
        np.testing.assert_array_equal(status, np.where(is_reachable, FOUND, UNREACHABLE))
        np.testing.assert_allclose(length[is_reachable], exact[start][is_reachable], rtol=5.1e-5)
        field = field_of(mask, COLUMNS, cell)
        with_landmarks = search(mask, COLUMNS, start, np.full(40, cell, np.int32), landmarks=goal[:3])
        np.testing.assert_array_equal(with_landmarks[0], status)
        np.testing.assert_allclose(with_landmarks[1], length, rtol=1e-9)
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
    none = np.zeros((0, len(mask)), np.int32)
    assert search_cells(mask, COLUMNS, start, goal, 1, none, record, head, queue)[0] == FOUND
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
    record, head, queue = (array[0] for array in scratch(400, entries=30))
    none = np.zeros((0, 400), np.int32)
    assert search_cells(mask, 20, 0, 399, 1, none, record, head, queue)[0] == OVERFLOW
    assert fill_field(mask, 20, np.array([0], np.int32), head, queue, np.zeros(400, np.int32)) == OVERFLOW


def test_octile_is_the_length_on_free_ground():
    mask = mask_of(np.ones((15, 15), np.uint8))
    record, head, queue = (array[0] for array in scratch(225))
    none = np.zeros((0, 225), np.int32)
    for number, goal in enumerate((0, 7, 112, 224)):
        found = search_cells(mask, 15, 30, goal, 1 + number, none, record, head, queue)
        assert found[1] == octile(15, 30, goal)


def test_any_number_of_chunks_and_threads_gives_the_same_answer(rng):
    is_walkable = (rng.random((ROWS, COLUMNS)) > 0.3).astype(np.uint8)
    mask = mask_of(is_walkable)
    free = np.flatnonzero(is_walkable.ravel()).astype(np.int32)
    start, goal = rng.choice(free, 50), rng.choice(free, 50)
    one, four = search(mask, COLUMNS, start, goal), search(mask, COLUMNS, start, goal, 4)
    for a, b in zip(one, four, strict=True):
        np.testing.assert_array_equal(a, b)


def test_published_optimal_lengths(shared_data):
    maps = sorted((shared_data / "movingai").glob("*.map"))
    assert maps
    for path in maps:
        queries = read_queries(path, path.with_name(path.name + ".scen"))
        chosen = slice(None, None, 10)
        mask = mask_of(queries.is_walkable)
        status, length, _ = search(
            mask, queries.is_walkable.shape[1], queries.start[chosen], queries.goal[chosen]
        )
        assert (status == FOUND).all()
        np.testing.assert_allclose(length, queries.optimal_length[chosen], rtol=1e-4, err_msg=path.stem)
