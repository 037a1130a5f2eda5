"""Look-up of reach examples against a slow twin, and what holds for any place."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from crowd.blending.reach_space import PseudoExamples, pack
from crowd_kernels.reach_space import CHUNKS, MOST_SAMPLES, NUMBERS, SCRATCH, find_examples_crowd
from tests.oracles import reach_space as oracle


def make_set(count, seed):
    """Random points that blend four of six examples each."""
    rng = np.random.default_rng(seed)
    clip = np.array([rng.permutation(6)[:4] for _ in range(count)], np.int32)
    return PseudoExamples(rng.random((count, 3)), clip, rng.dirichlet(np.ones(4), count), clip)


SETS = (make_set(500, 1), make_set(37, 2), make_set(3, 3))
ARRAYS = pack(SETS, np.array([0, 6, 12, 18]))


def find(part, position, build=find_examples_crowd):
    """Run the kernel: a dictionary of weights for each place."""
    position = np.ascontiguousarray(np.atleast_2d(position), np.float64)
    count = len(position)
    clip, weight = np.full((count, MOST_SAMPLES), -7, np.int32), np.full((count, MOST_SAMPLES), -7.0)
    number = np.zeros(count, np.int32)
    scratch = np.zeros((CHUNKS, NUMBERS), np.int32), np.zeros((CHUNKS, SCRATCH + 18))
    build(ARRAYS, np.full(count, part, np.int32), position, *scratch, clip, weight, number)
    return [dict(zip(clip[i, :n].tolist(), weight[i, :n], strict=True)) for i, n in enumerate(number)]


@pytest.mark.parametrize("part", [0, 1, 2])
def test_matches_oracle_inside_and_outside(part, rng):
    positions = np.concatenate([rng.random((500, 3)), rng.normal(0.5, 0.8, (500, 3)).clip(-0.9, 1.9)])
    # Places farther off are brought in before they are looked up.
    positions = positions.clip(ARRAYS.low[part], ARRAYS.high[part])
    chosen = SETS[part]
    for position, found in zip(positions, find(part, positions), strict=True):
        wanted = oracle.find_examples(chosen.point, chosen.clip + 6 * part, chosen.weight, position)
        assert found.keys() == wanted.keys()
        assert found == pytest.approx(wanted, abs=1e-9)


def test_a_point_of_the_set_takes_all_the_weight():
    for number in (0, 17, 499):
        found = find(0, SETS[0].point[number])[0]
        wanted = dict(zip(SETS[0].clip[number].tolist(), SETS[0].weight[number], strict=True))
        assert {clip: found.get(clip, 0.0) for clip in wanted} == pytest.approx(wanted, abs=1e-4)


coordinate = st.floats(-3, 4)


@given(place=st.tuples(coordinate, coordinate, coordinate), part=st.integers(0, 2))
def test_weights_are_positive_and_sum_to_one(place, part):
    found = find(part, place)[0]
    assert sum(found.values()) == pytest.approx(1.0, abs=1e-12)
    assert min(found.values()) > 0
    assert all(6 * part <= clip < 6 * part + 6 for clip in found)


@given(place=st.tuples(*[st.floats(-0.4, 1.4)] * 3), seed=st.integers(0, 1000))
def test_weights_follow_moving_places_without_jumps(place, seed):
    way = np.random.default_rng(seed).normal(size=3)
    path = np.array(place) + np.linspace(0, 0.1, 2001)[:, None] * way / np.linalg.norm(way)
    dense = np.zeros((len(path), 6))
    for row, found in enumerate(find(0, path)):
        dense[row, list(found)] = list(found.values())
    assert np.abs(np.diff(dense, axis=0)).max() < 0.06


def test_far_places_are_finite():
    for far in (1e6, -1e12, 1e300):
        assert sum(find(0, (far, 0.0, -far))[0].values()) == pytest.approx(1.0)


def test_both_builds_give_equal_bits(rng):
    places = rng.normal(0.5, 0.5, (300, 3))
    assert find(0, places, find_examples_crowd.serial) == find(0, places, find_examples_crowd.threaded)
