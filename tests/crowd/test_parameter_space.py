"""The locomotion space: tessellation, look-up, calibration, and weights that never jump."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from crowd.blending.parameter_space import ParameterSpace, boundary_faces
from crowd.errors import MotionError
from tests.oracles import barycentric as oracle

# Published parameters of three captured and key-framed sets of a public character animation system:
# forward m/s, turn deg/s, side m/s.
UTAH = [
    (1.349, 0, 0), (0, 0, 0), (0, 168.8, 0), (0, -168.8, 0), (0.938, 0, 0), (0.422, 0, 0), (2.875, 0, 0),
    (4.125, 0, 0), (1.413, 72.2, 0), (1.392, -76.9, 0), (1.105, 168.8, 0), (1.064, -168.8, 0),
    (3.959, 67.5, 0), (3.882, -60, 0), (3.12, 270, 0), (3.166, -270, 0), (0, 0, -1.003), (0, 0, 1.003),
    (0, 0, -2.125), (0, 0, 2.375),
]  # fmt: skip
MARINE = [
    (0, 0, 0), (2.105, 0, 0), (0.844, 0, 0), (3.911, 0, 0), (2.271, 78.8, 0), (2.271, -78.8, 0),
    (1.631, 144.3, 0), (1.631, -144.3, 0), (0, 0, 0.346), (0, 0, -0.346), (1.105, 0, 0), (0.793, 44.3, 0),
    (0.793, -44.3, 0), (0.539, 94.9, 0), (0.539, -94.9, 0), (0, 168.8, 0), (0, -168.8, 0), (0, 0, 2.041),
    (0, 0, -2.041),
]  # fmt: skip
HARMONY = [
    (0.549, 0, 0), (0, 0, 0), (0.437, 47.7, 0), (0.437, -47.7, 0), (0.359, 87.4, 0), (0.359, -87.4, 0),
    (0, 0, -0.22), (0, 0, 0.22),
]  # fmt: skip


def make_space(table):
    parameters = np.array(table, float)
    parameters[:, 1] = np.radians(parameters[:, 1])
    duration = np.linspace(1.5, 0.6, len(table))
    return ParameterSpace.build(parameters, duration, [str(number) for number in range(len(table))])


@pytest.fixture(scope="module", params=[UTAH, MARINE, HARMONY], ids=["utah", "marine", "harmony"])
def space(request):
    return make_space(request.param)


@pytest.mark.parametrize(("table", "count"), [(UTAH, 58), (MARINE, 56), (HARMONY, 12)])
def test_number_of_tetrahedra_of_published_sets(table, count):
    assert make_space(table).simplex_count == count


def test_tetrahedra_fill_the_hull_without_gaps_or_inner_walls(space):
    points = space.arrays.example
    for face in boundary_faces(space.arrays.simplex):
        corners = points[face]
        normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
        sides = (points - corners[0]) @ normal / np.linalg.norm(normal)
        assert sides.max() < 0.03 or sides.min() > -0.03, "a face without neighbour lies on the outside"


def test_no_tetrahedron_mixes_opposite_sides(space):
    corners = space.parameters[space.arrays.simplex]
    for axis in (1, 2):
        assert not ((corners[..., axis] > 0).any(axis=1) & (corners[..., axis] < 0).any(axis=1)).any()


def sample(space, rng, count, spread=1.0):
    low, high = space.parameters.min(axis=0), space.parameters.max(axis=0)
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    return middle + spread * half * rng.uniform(-1, 1, (count, 3))


def test_weights_are_valid_everywhere(space, rng):
    points = sample(space, rng, 20_000, spread=2.0)
    points[:3] = [[0, 0, 0], [1e9, -1e9, 1e9], [np.nan, 1, 0]]
    example, weight, realised, _ = space.locate(points)
    assert (weight >= 0).all()
    np.testing.assert_allclose(weight.sum(axis=1), 1, atol=1e-12)
    assert np.isfinite(realised).all()
    assert example.min() >= 0
    assert example.max() < len(space.names)


def test_inside_the_point_itself_is_realised_and_weights_are_calibrated(space, rng):
    points = sample(space, rng, 3000)
    example, weight, realised, is_inside = space.locate(points)
    assert 0.02 < is_inside.mean() < 1
    np.testing.assert_allclose(realised[is_inside], points[is_inside], atol=1e-9)
    duration = space.arrays.cycle_duration[example]
    mean = (weight * duration)[..., None] * space.parameters[example]
    mean = mean.sum(axis=1) / (weight * duration).sum(axis=1)[:, None]
    np.testing.assert_allclose(
        mean, realised, atol=1e-9, err_msg="a blend realises the duration-weighted mean"
    )
    for index in np.flatnonzero(is_inside)[:20]:
        barycentric = oracle.simplex_weights(
            space.arrays.example[example[index]], points[index] / space.arrays.axis_range
        )
        np.testing.assert_allclose(weight[index], oracle.calibrated(barycentric, duration[index]), atol=1e-8)


def test_inside_flag_agrees_with_slow_search(space, rng):
    points = sample(space, rng, 200)
    is_inside = space.locate(points)[3]
    for point, flag in zip(points / space.arrays.axis_range, is_inside, strict=True):
        assert flag == oracle.contains(space.arrays.example, space.arrays.simplex, point)


def test_outside_the_nearest_point_of_the_hull_is_realised(space, rng):
    points = sample(space, rng, 300, spread=1.8)
    _, _, realised, is_inside = space.locate(points)
    for index in np.flatnonzero(~is_inside)[:25]:
        wanted = oracle.nearest_in_hull(space.arrays.example, points[index] / space.arrays.axis_range)
        got = realised[index] / space.arrays.axis_range
        distance = np.linalg.norm(got - points[index] / space.arrays.axis_range)
        best = np.linalg.norm(wanted - points[index] / space.arrays.axis_range)
        assert distance < best + 0.02


def test_examples_are_reproduced_exactly(space):
    example, weight, realised, is_inside = space.locate(space.parameters)
    np.testing.assert_allclose(realised, space.parameters, atol=1e-9)
    assert is_inside.all()
    heaviest = example[np.arange(len(example)), weight.argmax(axis=1)]
    np.testing.assert_allclose(space.parameters[heaviest], space.parameters, atol=1e-9)


def dense_weights(space, points):
    """Weights as (N, E) over all examples."""
    example, weight, _, _ = space.locate(points)
    dense = np.zeros((len(points), len(space.names)))
    np.add.at(dense, (np.arange(len(points))[:, None], example), weight)
    return dense


def test_weights_do_not_jump_along_straight_lines(space, rng):
    starts, ends = sample(space, rng, 150, 1.5), sample(space, rng, 150, 1.5)
    steps = np.linspace(0, 1, 1500)
    for start, end in zip(starts, ends, strict=True):
        line = start + steps[:, None] * (end - start)
        dense = dense_weights(space, line)
        jumps = np.abs(np.diff(dense, axis=0)).max(axis=1)
        worst = int(jumps.argmax())
        # Halve the step where weights change most: a continuous change shrinks, a jump stays.
        low, high = steps[worst], steps[worst + 1]
        for _ in range(24):
            points = start + np.array([low, 0.5 * (low + high), high])[:, None] * (end - start)
            change = np.abs(np.diff(dense_weights(space, points), axis=0)).max(axis=1)
            low, high = (low, 0.5 * (low + high)) if change[0] >= change[1] else (0.5 * (low + high), high)
        assert change.max() < 1e-3


@given(x=st.floats(-10, 10), y=st.floats(-10, 10), z=st.floats(-10, 10))
def test_any_point_gets_valid_weights(x, y, z):
    _, weight, realised, _ = UTAH_SPACE.locate([[x, y, z]])
    assert abs(weight.sum() - 1) < 1e-12
    assert (weight >= 0).all()
    assert UTAH_SPACE.locate(realised)[3][0] or np.allclose(
        UTAH_SPACE.locate(realised)[2], realised, atol=1e-6
    )


UTAH_SPACE = make_space(UTAH)


def test_reach_agrees_with_published_hull():
    assert UTAH_SPACE.maximum_forward_speed == pytest.approx(4.125, abs=1e-3)
    assert np.degrees(UTAH_SPACE.maximum_turn_rate(1.35)) == pytest.approx(212, abs=1)
    assert UTAH_SPACE.maximum_side_speed(1.0) == pytest.approx(1.61, abs=0.01)


def test_examples_in_a_plane_are_refused():
    with pytest.raises(MotionError, match="side speed"):
        make_space([row for row in UTAH if row[2] == 0])


def test_locate_is_equal_on_one_and_many_threads(rng):
    from crowd_kernels.barycentric import locate_crowd

    points = sample(UTAH_SPACE, rng, 999, 1.5)
    results = []
    for build in (locate_crowd.serial, locate_crowd.threaded):
        out = (
            np.zeros((999, 4), np.int32),
            np.zeros((999, 4)),
            np.zeros(999),
            np.zeros((999, 3)),
            np.zeros(999, np.uint8),
        )
        build(UTAH_SPACE.arrays, points, np.arange(999, dtype=np.int32), *out)
        results.append(out)
    for one, other in zip(*results, strict=True):
        np.testing.assert_array_equal(one, other)
