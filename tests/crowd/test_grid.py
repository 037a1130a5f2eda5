"""Cells of the walkable grid against exact distances."""

import numpy as np
import pytest

from crowd.world import World
from crowd.world.grid import Grid
from crowd.world.obstacles import Box, Polygon, Wall
from tests.oracles import walkable as oracle

OBSTACLES = [
    Box(-3.13, -1.02, -2.2, 1.4),
    Polygon(((1.0, 1.0), (4.0, 1.7), (3.1, 4.2), (0.6, 3.0))),
    Wall((1.2, -4.0), (3.7, -0.3)),
]
SLACK = 0.05


@pytest.mark.parametrize("radius", [0.25, 0.5])
def test_a_cell_is_walkable_where_the_body_fits_in_it(radius):
    world = World((-5.0, 5.0, -5.0, 5.0), OBSTACLES)
    grid: Grid = world.grid(radius)
    layout = grid.layout
    room = np.array(
        [
            oracle.roomiest(
                OBSTACLES,
                (layout.low_x + column * layout.cell_size, layout.low_z + row * layout.cell_size),
                (layout.low_x + (column + 1) * layout.cell_size, layout.low_z + (row + 1) * layout.cell_size),
            )
            for row in range(layout.rows)
            for column in range(layout.columns)
        ]
    )
    is_walkable = grid.component >= 0
    inner = np.ones((layout.rows, layout.columns), bool)
    inner[[0, -1]] = inner[:, [0, -1]] = False
    for cell in np.flatnonzero(inner.ravel()):
        if room[cell] > radius + SLACK:
            assert is_walkable[cell], cell
        if room[cell] < radius - SLACK:
            assert not is_walkable[cell], cell


@pytest.mark.parametrize("radius", [0.25, 0.5])
def test_places_of_linked_cells_can_be_walked_between(radius):
    world = World((-5.0, 5.0, -5.0, 5.0), OBSTACLES)
    grid = world.grid(radius)
    walkable = np.flatnonzero(grid.component >= 0)
    assert oracle.clearance(OBSTACLES, grid.point[walkable]).min() > radius - SLACK
    columns = grid.layout.columns
    starts = walkable[(grid.mask[walkable] & 1) == 1]
    middle = 0.5 * (grid.point[starts] + grid.point[starts + 1])
    assert oracle.clearance(OBSTACLES, middle).min() > radius - SLACK
    assert columns == layout_columns(world)


def layout_columns(world):
    """Cells along x that cover the bounds."""
    low, high = world.bounds[:2]
    return int(np.ceil((high - low) / world.layout.cell_size - 1e-9))
