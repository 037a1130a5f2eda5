"""Lists of the points that can be among the four nearest, against a slow twin and by places."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from crowd.blending.reach_cubes import LONGEST, along_curve, divide_space
from crowd_kernels.reach_cubes import RIVALS, list_candidates
from crowd_kernels.reach_space import COARSEST, HALVINGS
from tests.oracles import reach_space as oracle


def lists_of(point, centre, half):
    """Run the kernel on cubes that all begin with all points."""
    out, start = np.zeros(len(centre) * len(point), np.int32), np.zeros(len(centre) + 1, np.int64)
    list_candidates(
        np.ascontiguousarray(point.T), centre, half, np.zeros(len(centre), np.int64),
        np.arange(len(point), dtype=np.int32), np.array([0, len(point)]),
        np.zeros(len(point)), np.zeros(RIVALS, np.int32), np.zeros(RIVALS), out, start,
    )  # fmt: skip
    return [out[start[cube] : start[cube + 1]] for cube in range(len(centre))]


@given(count=st.integers(1, 300), half=st.floats(1e-3, 2.0), seed=st.integers(0, 10_000))
def test_lists_hold_all_that_the_twin_finds_and_few_more(count, half, seed):
    rng = np.random.default_rng(seed)
    point, centre = rng.random((count, 3)), rng.uniform(-1, 2, (3, 3))
    for middle, found in zip(centre, lists_of(point, centre, half), strict=True):
        wanted = oracle.candidates(point, middle, half)
        assert set(wanted) <= set(found.tolist())
        assert len(found) <= max(3 * len(wanted), len(wanted) + RIVALS)
        assert (np.diff(found) > 0).all()


@given(count=st.integers(1, 300), half=st.floats(1e-3, 1.0), seed=st.integers(0, 10_000))
def test_the_nearest_of_places_in_a_cube_are_in_its_list(count, half, seed):
    rng = np.random.default_rng(seed)
    # Coordinates of few digits make ties.
    point, centre = rng.random((count, 3)).round(1 + seed % 3), rng.uniform(-1, 2, (1, 3))
    (found,) = lists_of(point, centre, half)
    corners = np.array(np.meshgrid(*[[-1, 0, 1]] * 3)).reshape(3, -1).T
    for place in centre[0] + half * np.concatenate([corners, rng.uniform(-1, 1, (50, 3))]):
        distance = np.linalg.norm(point - place, axis=1)
        nearest = np.sort(distance)[:4]
        np.testing.assert_allclose(np.sort(distance[found])[:4], nearest, atol=1e-9)


def test_lists_are_divided_while_they_are_long(rng):
    point = 0.3 * rng.random((2000, 3))
    divided = divide_space(point, point.min(axis=0) - 0.5, point.max(axis=0) + 0.5)
    length = np.diff(divided.start)
    assert length.min() >= 4
    is_finest = divided.shift == 0
    assert is_finest.any()
    assert not is_finest.all()
    parts = 8 ** (HALVINGS - divided.shift // 3)
    assert parts.sum() == len(length)
    for first, count in zip(divided.first[~is_finest], parts[~is_finest], strict=True):
        assert length[first : first + count].max() <= LONGEST
    np.testing.assert_array_equal(divided.along, np.ceil((np.ptp(point, axis=0) + 1.0) / COARSEST))


def test_points_along_a_curve_are_near_the_ones_before(rng):
    point = rng.random((4000, 3))
    order = along_curve(point, 0.04)
    assert sorted(order) == list(range(4000))
    step = np.linalg.norm(np.diff(point[order], axis=0), axis=1)
    assert np.median(step) < 0.15
