"""The locomotion space: tessellation, calibration, reach, and weights that never jump."""

from collections import Counter
from itertools import combinations

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from crowd.blending.parameter_space import ParameterSpace
from crowd.blending.tessellation import tessellate, volumes
from crowd.errors import MotionError
from crowd.motion.clip import ClipKind
from crowd.motion.procedural import built_in_library
from tests.oracles.example_sets import (
    HARMONY,
    MARINE,
    ONLY_TURNS,
    POCKETS,
    UTAH,
    dense_weights,
    make_space,
    sample,
    spaces,
)


def built_in_space():
    clips = built_in_library().of_kind(ClipKind.LOCOMOTION)
    return ParameterSpace.build(
        np.array([clip.parameters for clip in clips], float),
        np.array([clip.cycle_duration for clip in clips]),
        [clip.name for clip in clips],
    )


SPACES = spaces()


@pytest.fixture(scope="module", params=[*SPACES, "built_in"])
def space(request):
    return built_in_space() if request.param == "built_in" else SPACES[request.param]


@pytest.mark.parametrize(("table", "count"), [(UTAH, 58), (MARINE, 56), (HARMONY, 12)])
def test_number_of_tetrahedra_of_published_sets(table, count):
    assert make_space(table).simplex_count == count


def test_tetrahedra_fill_their_hull_and_share_whole_faces(space):
    points, simplex = space.arrays.example, space.arrays.simplex
    hull = ConvexHull(points)
    uses = Counter(face for cell in simplex for face in combinations(sorted(cell.tolist()), 3))
    assert set(uses.values()) <= {1, 2}
    alone = np.array([face for face, count in uses.items() if count == 1])
    is_on_hull = (points[alone].mean(axis=1) @ hull.equations[:, :3].T + hull.equations[:, 3]).max(
        axis=1
    ) > -1e-9
    volume = volumes(points, simplex).sum()
    if len(space.arrays.cone_face) == 0:
        assert volume == pytest.approx(hull.volume, rel=1e-9)
        assert is_on_hull.all(), "a face without neighbour lies on the outside"
    else:
        assert 0.9 * hull.volume < volume < hull.volume
        assert not is_on_hull.all()
        # Seen from the centre, the faces without neighbour enclose exactly the tetrahedra.
        cones = np.abs(np.linalg.det(points[alone] - space.arrays.centre)).sum() / 6
        assert cones == pytest.approx(volume, rel=1e-9)


def test_opposite_sides_are_mixed_only_where_quadrants_cannot_do_it(space):
    corners = space.parameters[space.arrays.simplex]
    mixes = [
        ((corners[..., axis] > 0).any(axis=1) & (corners[..., axis] < 0).any(axis=1)).any() for axis in (1, 2)
    ]
    has_straight_example = (space.parameters[:, 1:] == 0).all(axis=1).any()
    assert any(mixes) != has_straight_example


@pytest.mark.parametrize("name", ["marine", "harmony", "lattice"])
def test_left_and_right_are_mirror_images(name, rng):
    parameters = SPACES[name].parameters
    mirrored = parameters * (1, -1, -1)
    mirror = [int(np.abs(parameters - row).sum(axis=1).argmin()) for row in mirrored]
    np.testing.assert_array_equal(parameters[mirror], mirrored)
    duration = SPACES[name].arrays.cycle_duration
    space = ParameterSpace.build(parameters, duration + duration[mirror], SPACES[name].names)
    points = sample(space, rng, 1000, 1.3)
    other_side = dense_weights(space, points * (1, -1, -1))
    np.testing.assert_allclose(other_side[:, mirror], dense_weights(space, points), atol=1e-7)


def test_a_tessellation_does_not_depend_on_the_order_of_the_examples(rng):
    parameters, duration = SPACES["utah"].parameters, SPACES["utah"].arrays.cycle_duration
    order = rng.permutation(len(parameters))
    other = ParameterSpace.build(parameters[order], duration[order], [str(index) for index in order])
    points = sample(other, rng, 500, 1.3)
    np.testing.assert_allclose(
        dense_weights(other, points), dense_weights(SPACES["utah"], points)[:, order], atol=1e-9
    )


def test_examples_are_reproduced_exactly(space):
    example, weight, realised, is_inside = space.locate(space.parameters)
    np.testing.assert_allclose(realised, space.parameters, atol=1e-9)
    assert is_inside.all()
    heaviest = example[np.arange(len(example)), weight.argmax(axis=1)]
    np.testing.assert_allclose(space.parameters[heaviest], space.parameters, atol=1e-9)


def test_weights_do_not_jump_along_straight_lines(space, rng):
    starts, ends = sample(space, rng, 60, 1.5), sample(space, rng, 60, 1.5)
    steps = np.linspace(0, 1, 1500)
    for start, end in zip(starts, ends, strict=True):
        line = start + steps[:, None] * (end - start)
        jumps = np.abs(np.diff(dense_weights(space, line), axis=0)).max(axis=1)
        worst = int(jumps.argmax())
        # Halve the step where weights change most: a continuous change shrinks, a jump stays.
        low, high = steps[worst], steps[worst + 1]
        for _ in range(24):
            points = start + np.array([low, 0.5 * (low + high), high])[:, None] * (end - start)
            change = np.abs(np.diff(dense_weights(space, points), axis=0)).max(axis=1)
            low, high = (low, 0.5 * (low + high)) if change[0] >= change[1] else (0.5 * (low + high), high)
        assert change.max() < 1e-5


STEEPEST = 100.0
"""Change of a weight for a change of parameters by their whole range, where no example is in the way."""


def steepness(space):
    """Largest change of a weight in each tetrahedron for a change of parameters by their whole range."""
    corners = space.parameters[space.arrays.simplex] / space.arrays.axis_range
    squares = np.concatenate([corners, np.ones((*corners.shape[:2], 1))], axis=2)
    return np.abs(np.linalg.inv(squares)[:, :3]).max(axis=(1, 2))


def test_a_small_step_changes_weights_little(space, rng):
    # Points in every tetrahedron, however thin, and points all around.
    shares = rng.dirichlet(np.ones(4), (100, space.simplex_count))
    inside = np.einsum("nsc,sca->nsa", shares, space.parameters[space.arrays.simplex]).reshape(-1, 3)
    points = np.concatenate([inside, sample(space, rng, 10_000, 1.3)])
    # A weight counts more the shorter its cycle is against the others'.
    duration = space.arrays.cycle_duration[space.arrays.simplex]
    steep = steepness(space) * duration.max(axis=1) / duration.min(axis=1)
    allowed = max(STEEPEST, steep.max())
    for axis in range(3):
        step = np.zeros(3)
        step[axis] = 1e-3 * space.arrays.axis_range[axis]
        change = np.abs(dense_weights(space, points + step) - dense_weights(space, points))
        assert change.max() < 1.001e-3 * allowed


@pytest.mark.parametrize("name", ["utah", "marine", "harmony", "built_in"])
def test_tetrahedra_are_thin_only_where_examples_leave_no_choice(name):
    """Where an example lies just inside an edge of the hull, what fills the hull and uses it is thin."""
    space = built_in_space() if name == "built_in" else SPACES[name]
    points = space.parameters / space.arrays.axis_range
    edges = {edge for face in ConvexHull(points).simplices.tolist() for edge in combinations(sorted(face), 2)}
    steep = steepness(space)
    for cell, slope in zip(space.arrays.simplex.tolist(), steep, strict=True):
        if slope <= STEEPEST:
            continue
        nearest = 1.0
        for first, second in edges.intersection(combinations(sorted(cell), 2)):
            along = points[second] - points[first]
            for other in set(cell) - {first, second}:
                way = points[other] - points[first]
                if 0.0 < way @ along < along @ along:
                    nearest = min(nearest, np.linalg.norm(np.cross(way, along)) / np.linalg.norm(along))
        assert nearest < 0.02
    assert (steep > STEEPEST).sum() <= 4


def test_nothing_inside_is_nearer_than_what_is_realised(space, rng):
    points = sample(space, rng, 400, 1.8)
    _, _, realised, is_inside = space.locate(points)
    scale = space.arrays.axis_range
    # Any mixture of the corners of any tetrahedron is inside.
    shares = rng.dirichlet(np.full(4, 0.4), 4000)
    chosen = space.arrays.simplex[rng.integers(0, space.simplex_count, 4000)]
    inside = np.einsum("nc,nca->na", shares, space.arrays.example[chosen])
    slack = 0.05 if len(space.arrays.cone_face) else 1e-9
    assert (~is_inside).sum() > 100
    for point, got in zip(points[~is_inside] / scale, realised[~is_inside] / scale, strict=True):
        nearest = np.sqrt(((inside - point) ** 2).sum(axis=1).min())
        assert np.linalg.norm(got - point) <= nearest + slack


def test_reach_agrees_with_published_hull():
    space = SPACES["utah"]
    assert space.maximum_forward_speed == pytest.approx(4.125, abs=1e-3)
    speed = np.array([0, 0.5, 1.0, 1.35, 2.0, 2.9, 4.0])
    turn = np.degrees(space.maximum_turn_rate(speed))
    np.testing.assert_allclose(turn, [169, 184, 200, 212, 232, 262, 35], atol=1.1)
    side = space.maximum_side_speed(speed)
    np.testing.assert_allclose(side, [2.12, 1.86, 1.61, 1.43, 1.09, 0.63, 0.06], atol=0.011)
    marine = SPACES["marine"]
    turn = np.degrees(marine.maximum_turn_rate(speed[:6]))
    np.testing.assert_allclose(turn, [169, 161, 154, 148, 121, 64], atol=1.1)


def test_extent_ends_on_the_border(space, rng):
    on_axis = space.parameters[(space.parameters[:, 1:] == 0).all(axis=1)]
    origin = on_axis.mean(axis=0) if len(on_axis) else space.parameters.mean(axis=0)
    direction = rng.normal(size=(200, 3)) * space.arrays.axis_range
    extent = space.extent(origin, direction)
    assert extent.shape == (200,)
    assert space.locate(origin + 0.999 * extent[:, None] * direction)[3].all()
    assert not space.locate(origin + 1.001 * extent[:, None] * direction)[3].any()


def test_extent_is_zero_where_the_space_is_missed():
    space = SPACES["utah"]
    assert space.extent((9, 0, 0), (1, 0, 0)) == 0
    assert space.extent((9, 9, 0), (1, 0, 0)) == 0
    assert space.maximum_turn_rate(99.0) == 0


def random_set(seed):
    """Examples on the planes between quadrants, with some anywhere: the quadrants seldom fill the hull."""
    rng = np.random.default_rng(seed)
    points = rng.uniform(-1, 1, (28, 3)) * (2.5, 80, 0.8) + (1.5, 0, 0)
    points[:12, 1] = 0
    points[6:18, 2] = 0
    return points


@pytest.mark.parametrize("seed", range(6))
def test_random_sets_are_filled_without_overlap(seed):
    points = random_set(seed)
    points /= np.ptp(points, axis=0)
    tessellation = tessellate(points)
    volume, hull_volume = volumes(points, tessellation.simplex).sum(), ConvexHull(points).volume
    if len(tessellation.cone_face) == 0:
        assert volume == pytest.approx(hull_volume, rel=1e-7)
    hits = np.zeros(300, int)
    probes = np.random.default_rng(seed).dirichlet(np.ones(len(points)), 300) @ points
    for cell in tessellation.simplex:
        weights = np.linalg.solve(
            np.vstack([points[cell].T, np.ones(4)]), np.vstack([probes.T, np.ones(300)])
        )
        hits += (weights.min(axis=0) > 0).astype(int)
    assert hits.max() == 1
    assert (hits == 1).mean() >= volume / hull_volume - 0.1


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ([], "same forward speed"),
        ([row for row in UTAH if row[2] == 0], "same side speed"),
        ([(0, 0, 0), (1, 10, 0.5), (2, 20, 1.0), (3, 30, 1.5), (1, 0, 1), (2, 10, 1.5)], "one plane"),
        ([*UTAH, (np.nan, 0, 0)], 'clip "20": has parameters that are not finite'),
    ],
)
def test_unusable_sets_are_refused_with_the_reason(table, message):
    with pytest.raises(MotionError, match=message):
        make_space(table)


def test_an_unusable_duration_is_refused_by_name():
    with pytest.raises(MotionError, match=r'clip "walk": has an unusable cycle duration; got 0.0'):
        ParameterSpace.build(np.eye(3), np.array([1.0, 0.0, 1.0]), ["stand", "walk", "turn"])


def test_pockets_and_fallback_are_exercised():
    assert len(make_space(POCKETS).arrays.cone_face) > 0
    assert len(make_space(ONLY_TURNS).arrays.cone_face) == 0
