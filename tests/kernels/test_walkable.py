"""Walkable grids and straight ways: checked with exact geometry by shapely."""

import numpy as np
import pytest
import shapely
from hypothesis import given, settings, strategies

from crowd.world import World
from crowd.world.grid import Grid, Layout, cover_ground
from crowd.world.obstacles import Box, Polygon, Wall
from crowd_kernels.free_line import SLACK, is_free_line, segment_gap
from crowd_kernels.grid_search import COLUMN_STEP, ROW_STEP
from crowd_kernels.walkable import MARGIN, SAMPLES, find_places, link_places
from tests.oracles import grid_search as search_oracle
from tests.oracles import walkable as oracle

BOUNDS = (-3.0, 3.1, -2.0, 2.0)


def random_shapes(rng, count=5):
    """Boxes, slanted polygons and thin walls in and around the bounds."""
    shapes = []
    for _ in range(count):
        x, z = rng.uniform(-3, 3), rng.uniform(-2, 2)
        kind = rng.integers(3)
        if kind == 0:
            shapes.append(Box(x, x + rng.uniform(0.05, 1.5), z, z + rng.uniform(0.05, 1.5)))
        elif kind == 1:
            angle = np.sort(rng.uniform(0, 2 * np.pi, 5)) + np.arange(5) * 1e-3
            size = rng.uniform(0.2, 1.0)
            points = zip(x + size * np.cos(angle), z + size * np.sin(angle), strict=True)
            shapes.append(Polygon(tuple((float(a), float(b)) for a, b in points)))
        else:
            shapes.append(Wall((x, z), (x + rng.uniform(-2, 2), z + rng.uniform(0.1, 2))))
    return shapes


@pytest.fixture(params=range(4), ids=lambda seed: f"scene {seed}")
def scene(request):
    """Shapes and the grid of a body of random radius among them."""
    rng = np.random.default_rng(request.param)
    shapes = random_shapes(rng)
    return shapes, World(BOUNDS, shapes).grid(float(rng.uniform(0.1, 0.4)))


def cell_corner(grid, cell):
    row, column = divmod(cell, grid.layout.columns)
    size = grid.layout.cell_size
    return np.array([grid.layout.low_x + column * size, grid.layout.low_z + row * size])


def test_a_cell_is_walkable_when_the_body_fits_somewhere_in_it(scene):
    shapes, grid = scene
    for cell in range(grid.layout.cell_count):
        low = cell_corner(grid, cell)
        high = np.minimum(low + grid.layout.cell_size, [BOUNDS[1], BOUNDS[3]])
        if grid.is_walkable[cell]:
            place = grid.point[cell]
            assert (place >= low - 1e-9).all()
            assert (place <= high + 1e-9).all()
            assert oracle.clearance(shapes, place) >= grid.radius - MARGIN - 1e-9
        else:
            assert oracle.roomiest(shapes, low, high) < grid.radius + 0.02


def test_cells_are_linked_where_the_straight_way_is_free(scene):
    shapes, grid = scene
    columns, rows = grid.layout.columns, grid.layout.rows
    np.testing.assert_array_equal(grid.mask, search_oracle.mask_of_links(grid.link, columns, rows))
    wrong = 0
    for cell in range(grid.layout.cell_count):
        row, column = divmod(cell, columns)
        for bit, others in ((1, [(cell, 1, 0)]), (2, [(cell, 0, 1)]), (4, [(cell, 1, 1), (cell + 1, -1, 1)])):
            is_free = True
            for start, across, along in others:
                i, j = start % columns + across, row + along
                if column + max(across, 0) >= columns or (bit == 4 and column + 1 >= columns) or j >= rows:
                    is_free = False
                    continue
                ends = (start, j * columns + i)
                room = oracle.line_room(shapes, *grid.point[list(ends)])
                fits = grid.is_walkable[list(ends)].all()
                is_free &= bool(fits) and all(gap >= grid.radius - SLACK for gap, _ in room)
            wrong += is_free != bool(grid.link[cell] & bit)
    assert wrong == 0


def test_covered_samples_match_oracle(scene):
    shapes, grid = scene
    solids = [shape for shape in shapes if not isinstance(shape, Wall)]
    cover = np.zeros(grid.layout.cell_count, np.uint32)
    cover_ground(grid.layout, [shape.outline() for shape in solids], cover)
    for cell in range(0, grid.layout.cell_count, 3):
        wanted = oracle.covered_samples(solids, cell_corner(grid, cell), grid.layout.cell_size)
        assert cover[cell] == wanted
    assert SAMPLES == 5


def test_components_hold_together_what_moves_connect(scene):
    _, grid = scene
    columns = grid.layout.columns
    np.testing.assert_array_equal(grid.component < 0, grid.is_walkable == 0)
    for cell in np.flatnonzero(grid.mask):
        for move in range(8):
            if grid.mask[cell] >> move & 1:
                other = cell + COLUMN_STEP[move] + ROW_STEP[move] * columns
                assert grid.component[other] == grid.component[cell]


def test_nearest_cells_match_oracle(scene, rng):
    _, grid = scene
    points = rng.uniform(-4, 4, (60, 2))
    parts = np.where(rng.random(60) < 0.5, -1, grid.component[rng.integers(0, len(grid.component), 60)])
    for reach in (np.inf, 0.5):
        found = grid.nearest_cells(points, parts.astype(np.int32), reach)
        for point, part, cell in zip(points, parts, found, strict=True):
            own = grid.layout.cells_at(point[None])[0]
            if grid.component[own] >= 0 and part in (-1, grid.component[own]):
                assert cell == own
                continue
            gap = oracle.nearest_cell(point, grid.component, grid.point, part, reach)
            if not np.isfinite(reach):
                assert (cell >= 0) == np.isfinite(gap)
            if cell >= 0:
                np.testing.assert_allclose(np.hypot(*(grid.point[cell] - point)), gap)


def test_straight_ways_match_oracle(scene, rng):
    shapes, grid = scene
    decided = 0
    for _ in range(300):
        start, end = rng.uniform((-3, -2), (3.1, 2), (2, 2))
        room = oracle.line_room(shapes, start, end)
        need = grid.radius - SLACK
        if any(abs(gap - need) < 1e-6 or abs(gap - least) < 1e-3 for gap, least in room if gap < need):
            continue
        decided += 1
        wanted = all(gap >= need for gap, _ in room)
        assert grid.is_free_line(start, end) == wanted
    assert decided > 100


def test_whoever_stands_close_to_a_wall_may_leave_but_not_pass_it():
    grid = World(BOUNDS, [Wall((-2.0, 0.0), (2.0, 0.0))]).grid(0.4)
    start = np.array([0.0, 0.1])
    assert grid.is_free_line(start, np.array([0.0, 1.0]))
    assert grid.is_free_line(start, np.array([1.0, 0.1])), "along the wall"
    assert not grid.is_free_line(start, np.array([0.0, -1.0]))
    assert not grid.is_free_line(np.array([-3.0, 1.0]), np.array([3.0, 0.2])), "too near before its ends"
    assert not grid.is_free_line(np.array([np.nan, 0.0]), start)


@settings(max_examples=200)
@given(strategies.lists(strategies.integers(-4, 4).map(float), min_size=8, max_size=8))
def test_gaps_between_segments_match_oracle(ends):
    a, b, c, d = (tuple(ends[k : k + 2]) for k in (0, 2, 4, 6))
    wanted = shapely.LineString([a, b]).distance(shapely.LineString([c, d]))
    np.testing.assert_allclose(np.sqrt(segment_gap(*a, *b, *c, *d)), wanted, atol=1e-7)


def test_walls_count_on_the_border_of_the_ground():
    grid = World(BOUNDS, [Box(-3, 3.1, 1.8, 1.9)]).grid(0.3)
    assert not grid.is_free_line(np.array([0.0, 2.0]), np.array([0.0, 1.5]))
    assert (grid.room <= 0.3 + 0.25 + 1e-9).all()


def test_worlds_without_walls_are_free_everywhere():
    grid = World(BOUNDS, []).grid(0.3)
    assert grid.is_walkable.all()
    assert is_free_line(grid.walls, 0.3, -100.0, 50.0, 3.0, 4.0)
    corner, side, middle = grid.mask[0], grid.mask[1], grid.mask[grid.layout.columns + 1]
    assert [bin(mask).count("1") for mask in (corner, side, middle)] == [3, 5, 8]


def test_one_and_two_threads_give_the_same_grid(scene):
    shapes, grid = scene
    cover = np.zeros(grid.layout.cell_count, np.uint32)
    cover_ground(grid.layout, [s.outline() for s in shapes if not isinstance(s, Wall)], cover)
    window = grid.layout.everything
    for places, links in (
        (find_places.serial, link_places.serial),
        (find_places.threaded, link_places.threaded),
    ):
        is_walkable, point = np.zeros_like(grid.is_walkable), np.zeros_like(grid.point)
        room = np.zeros_like(grid.room)
        places(grid.arrays, grid.walls, cover, *window, is_walkable, point, room)
        np.testing.assert_array_equal(room, grid.room)
        link = np.zeros_like(grid.link)
        links(grid.arrays, grid.walls, is_walkable, room, *window, link)
        np.testing.assert_array_equal(is_walkable, grid.is_walkable)
        np.testing.assert_array_equal(point, grid.point)
        np.testing.assert_array_equal(link, grid.link)


def test_a_grid_updated_in_part_equals_one_built_anew(rng):
    shapes = random_shapes(rng, 8)
    world = World(BOUNDS, shapes[:4])
    first = world.grid(0.2)
    numbers = [world.add_obstacle(shape) for shape in shapes[4:]]
    world.remove_obstacle(numbers[1])
    world.remove_obstacle(0)
    fresh = World(BOUNDS, world.obstacles).grid(0.2)
    assert world.grid(0.2) is first
    for name in ("is_walkable", "point", "room", "link", "mask", "component", "landmark_cost"):
        np.testing.assert_array_equal(getattr(first, name), getattr(fresh, name), err_msg=name)


def test_bounds_may_end_inside_a_cell():
    layout = Layout.over((0.0, 1.1, 0.0, 0.6), 0.25)
    assert (layout.columns, layout.rows) == (5, 3)
    grid = Grid.build(layout, World(BOUNDS).walls.table.edge, np.zeros(15, np.uint32), 0.2)
    assert grid.is_walkable.all()
    assert (grid.point <= [1.1, 0.6]).all()
