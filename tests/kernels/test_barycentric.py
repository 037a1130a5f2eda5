"""Look-up of locomotion parameters against a slow twin, and what holds for any input."""

import math

import numpy as np
import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st

from crowd_kernels.barycentric import CHUNKS, locate_crowd
from crowd_kernels.triangle import nearest_on_triangle
from tests.oracles import barycentric as oracle
from tests.oracles import example_sets

coordinate = st.floats(-2, 2)
vector = st.tuples(coordinate, coordinate, coordinate)
SPACES = example_sets.spaces()


def locate(space, parameter, active=None, build=locate_crowd):
    """Run the kernel; returns its outputs by name. Rows that are not processed hold -7."""
    count = len(parameter)
    active = np.arange(count, dtype=np.int32) if active is None else np.array(active, np.int32)
    out = {
        "example": np.full((count, 4), -7, np.int32),
        "weight": np.full((count, 4), -7.0),
        "cycle_rate": np.full(count, -7.0),
        "parameter": np.full((count, 3), -7.0),
        "is_inside": np.full(count, 7, np.uint8),
    }
    build(space.arrays, np.ascontiguousarray(parameter, np.float64), active, *out.values())
    return out


@given(a=vector, b=vector, c=vector, p=vector)
def test_nearest_on_triangle_matches_oracle(a, b, c, p):
    corners = np.array([a, b, c])
    assume(np.linalg.norm(np.cross(corners[1] - corners[0], corners[2] - corners[0])) > 1e-3)
    weights = np.array(nearest_on_triangle(*p, *a, *b, *c))
    assert weights.min() >= 0
    assert weights.sum() == pytest.approx(1, abs=1e-12)
    wanted = oracle.nearest_in_hull(corners, np.array(p)) @ corners
    np.testing.assert_allclose(weights @ corners, wanted, atol=1e-6)


@pytest.mark.parametrize("name", SPACES)
def test_matches_oracle_inside_and_outside(name, rng):
    space = SPACES[name]
    points = np.concatenate(
        [
            example_sets.sample(space, rng, 25),
            example_sets.sample(space, rng, 12, spread=2),
            # Just outside, where pockets below the hull are met.
            space.parameters[rng.integers(0, len(space.names), 12)] * 1.01,
        ]
    )
    out = locate(space, points)
    duration = space.arrays.cycle_duration
    for row, point in enumerate(points):
        barycentric, realised, is_inside = oracle.locate(space.arrays, point)
        dense = np.zeros(len(space.names))
        np.add.at(dense, out["example"][row], out["weight"][row])
        np.testing.assert_allclose(dense, oracle.calibrated(barycentric, duration), atol=1e-6)
        np.testing.assert_allclose(out["parameter"][row], realised, atol=1e-6)
        assert out["cycle_rate"][row] == pytest.approx((barycentric / duration).sum(), abs=1e-6)
        assert out["is_inside"][row] == is_inside


@given(
    name=st.sampled_from(sorted(SPACES)),
    parameter=st.tuples(*[st.floats(allow_nan=True, allow_infinity=True)] * 3),
)
@example(name="utah", parameter=(math.nan, 1.0, 0.0))
@example(name="pockets", parameter=(math.inf, -math.inf, 0.0))
@example(name="lattice", parameter=(1e308, -1e308, 5e-324))
def test_any_input_gets_valid_weights(name, parameter):
    space = SPACES[name]
    out = locate(space, np.array([parameter]))
    weight = out["weight"][0]
    assert weight.min() >= 0
    assert weight.sum() == pytest.approx(1, abs=1e-12)
    assert 0 <= out["example"][0].min() <= out["example"][0].max() < len(space.names)
    assert out["is_inside"][0] in (0, 1)
    shortest, longest = space.arrays.cycle_duration.min(), space.arrays.cycle_duration.max()
    assert 1 / longest - 1e-9 <= out["cycle_rate"][0] <= 1 / shortest + 1e-9
    again = locate(space, out["parameter"])
    np.testing.assert_allclose(again["parameter"], out["parameter"], atol=1e-6)


def test_a_row_with_nan_rests_and_says_so():
    space = SPACES["utah"]
    out = locate(space, np.array([[1.0, np.nan, 0.0], [0.0, 0.0, 0.0]]))
    np.testing.assert_array_equal(out["parameter"], 0)
    assert out["is_inside"].tolist() == [0, 1]
    assert space.names[out["example"][0][out["weight"][0].argmax()]] == "1", "the example that stands"


def test_inside_the_blend_realises_what_is_asked(rng):
    space = SPACES["utah"]
    points = example_sets.sample(space, rng, 2000)
    out = locate(space, points)
    inside = out["is_inside"] == 1
    duration = space.arrays.cycle_duration[out["example"]]
    travelled = ((out["weight"] * duration)[..., None] * space.parameters[out["example"]]).sum(axis=1)
    mean = travelled / (out["weight"] * duration).sum(axis=1)[:, None]
    assert inside.sum() > 200
    np.testing.assert_allclose(mean[inside], points[inside], atol=1e-9)


@pytest.mark.parametrize("count", [1, CHUNKS - 1, CHUNKS + 1])
def test_a_character_does_not_depend_on_how_many_there_are(count, rng):
    points = example_sets.sample(SPACES["pockets"], rng, 200, 1.5)
    many, few = locate(SPACES["pockets"], points), locate(SPACES["pockets"], points[:count])
    for name, values in few.items():
        np.testing.assert_array_equal(values, many[name][:count])


def test_only_active_rows_are_written(rng):
    space = SPACES["marine"]
    points = example_sets.sample(space, rng, 50, 1.5)
    everyone, some = locate(space, points), locate(space, points, active=[3, 17, 41])
    for name, values in some.items():
        np.testing.assert_array_equal(values[[3, 17, 41]], everyone[name][[3, 17, 41]])
        untouched = np.delete(values, [3, 17, 41], axis=0)
        assert (untouched == (7 if name == "is_inside" else -7)).all()
    assert (locate(space, points, active=[])["weight"] == -7).all()


def test_equal_bits_on_one_and_many_threads(rng):
    space = SPACES["pockets"]
    points = example_sets.sample(space, rng, 999, 1.5)
    serial, threaded = (
        locate(space, points, build=build) for build in (locate_crowd.serial, locate_crowd.threaded)
    )
    for name, values in serial.items():
        np.testing.assert_array_equal(values, threaded[name])
