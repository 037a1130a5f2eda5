"""Nearest neighbours against measuring every pair, wherever the crowd stands."""

import numba
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from crowd.navigation.avoidance import Avoidance, AvoidanceSettings
from crowd.navigation.cell_table import CellTable
from crowd_kernels.neighbors import find_neighbors_crowd
from tests.oracles import neighbors as oracle


def everyone(count):
    return np.arange(count, dtype=np.int32)


def ground_points(rng, count, size):
    points = rng.uniform(-size, size, (count, 3))
    points[:, 1] = rng.normal(size=count)
    return points


def search(position, active, wanted=10, reach=5.0):
    avoidance = Avoidance(AvoidanceSettings(), len(position))
    return avoidance.neighbors(position, np.full(len(position), 0.25), active, wanted, reach)


def assert_same(found, expected):
    assert expected
    for own, pairs in expected.items():
        count = found.count[own]
        assert found.character[own, :count].tolist() == [number for number, _ in pairs]
        np.testing.assert_allclose(found.distance[own, :count], [d for _, d in pairs], rtol=1e-6)


@given(
    seed=st.integers(0, 2**32 - 1),
    count=st.integers(1, 80),
    size=st.sampled_from([0.3, 2.0, 8.0, 300.0]),
    wanted=st.integers(1, 16),
    reach=st.sampled_from([0.5, 2.0, 5.0]),
)
@settings(max_examples=60)
def test_finds_the_nearest_in_order(seed, count, size, wanted, reach):
    rng = np.random.default_rng(seed)
    position = ground_points(rng, count, size)
    active = np.flatnonzero(rng.random(count) < 0.8).astype(np.int32)
    if not len(active):
        active = everyone(1)
    assert_same(search(position, active, wanted, reach), oracle.nearest(position, active, reach, wanted))


def test_equal_distances_are_ordered_by_number(rng):
    side = np.arange(9) - 4.0
    x, z = (a.ravel() for a in np.meshgrid(side, side))
    position = np.stack([x, 0 * x, z], axis=1)[rng.permutation(81)]
    assert_same(search(position, everyone(81)), oracle.nearest(position, everyone(81), 5.0, 10))


@pytest.mark.parametrize("offset", [(0, 0), (-1000.5, 2000.25), (9e6, -9e6)])
def test_the_place_of_the_crowd_does_not_matter(rng, offset):
    position = ground_points(rng, 150, 6.0)
    position[:, [0, 2]] += offset
    assert_same(search(position, everyone(150)), oracle.nearest(position, everyone(150), 5.0, 10))


def test_far_groups_and_characters_do_not_disturb(rng):
    position = ground_points(rng, 120, 5.0)
    position[40:80, 0] += 4000.0
    position[119] = (1e6, 0.0, -3e6)
    assert_same(search(position, everyone(120)), oracle.nearest(position, everyone(120), 5.0, 10))


def test_positions_that_are_none_are_left_out(rng):
    position = ground_points(rng, 40, 3.0)
    position[3, 0], position[7, 2], position[9, 0] = np.nan, np.inf, 1e300
    kept = np.setdiff1d(everyone(40), [3, 7, 9]).astype(np.int32)
    found = search(position, everyone(40))
    assert_same(found, oracle.nearest(position, kept, 5.0, 10))
    assert found.count[[3, 7, 9]].tolist() == [0, 0, 0]


def test_nobody_and_one_alone():
    position = np.zeros((3, 3))
    assert search(position, everyone(0)).count.tolist() == [0, 0, 0]
    assert search(position, everyone(1)).count.tolist() == [0, 0, 0]
    found = search(position, everyone(3))
    assert found.character[:, :2].tolist() == [[1, 2], [0, 2], [0, 1]]


@pytest.mark.parametrize("cell_size", [0.3, 0.77, 1.0, 5.0])
@pytest.mark.parametrize("table_size", [1, 400, 100_000])
def test_the_cells_do_not_change_the_answer(rng, cell_size, table_size):
    position = ground_points(rng, 100, 9.0)
    cells = CellTable(100, cell_size, cell_size)
    cells.cell_size = cell_size
    cells._cell_limit = table_size
    cells.sort(position, np.full(100, 0.25), everyone(100), 3.0)
    neighbor, distance = np.zeros((100, 6), np.int32), np.zeros((100, 6))
    count = np.zeros(100, np.int32)
    find_neighbors_crowd(
        cells.cell_start, cells.point, cells.character, cells.sorted_count, cells.columns, cells.rows,
        cells.cell_size, 3.0, np.zeros((32, 6), np.int64), neighbor, distance, count,
    )  # fmt: skip
    for own, pairs in oracle.nearest(position, everyone(100), 3.0, 6).items():
        assert neighbor[own, : count[own]].tolist() == [number for number, _ in pairs]


def test_cells_follow_the_density(rng):
    for density, low, high in ((0.05, 3.5, 5.0), (1.0, 1.2, 2.6), (6.0, 0.4, 1.1)):
        size = np.sqrt(2000 / density) / 2
        cells = CellTable(2000, 0.25, 5.0)
        for _ in range(3):
            cells.sort(ground_points(rng, 2000, size), np.full(2000, 0.2), everyone(2000), 5.0)
        assert low <= cells.cell_size <= high


def test_threads_give_equal_answers(rng):
    position = ground_points(rng, 600, 12.0)
    threads = numba.get_num_threads()
    try:
        numba.set_num_threads(1)
        one = search(position, everyone(600))
        numba.set_num_threads(min(2, threads))
        two = search(position, everyone(600))
    finally:
        numba.set_num_threads(threads)
    assert (one.character == two.character).all()
    assert (one.distance == two.distance).all()
