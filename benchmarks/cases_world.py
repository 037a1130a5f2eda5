"""Building the walkable grid of a large world with many boxes."""

from dataclasses import dataclass

import numpy as np

from benchmarks.case import Case
from crowd.world import World
from crowd.world.grid import Grid
from crowd.world.obstacles import Box
from crowd_kernels import _jit

RADIUS = 0.5
EXTENT = 100.0


@dataclass
class Town:
    """Boxes, and the grid that was built last."""

    boxes: list[Box]
    grid: Grid | None = None


def set_up(size: int, rng: np.random.Generator) -> Town:
    """Scatter boxes of one metre over 200 m by 200 m."""
    _jit.set_thread_count(1)
    low = rng.uniform(-EXTENT + 2.0, EXTENT - 3.0, (size, 2))
    return Town([Box(x, x + 0.98, z, z + 0.98) for x, z in low])


def build(town: Town) -> None:
    """Build the world and the grid for one radius."""
    town.grid = World((-EXTENT, EXTENT, -EXTENT, EXTENT), town.boxes).grid(RADIUS)


def is_right(town: Town) -> str | None:
    """Boxes are blocked, and most of the ground is one part."""
    assert town.grid is not None
    middle = np.array([[box.xmin + 0.49, box.zmin + 0.49] for box in town.boxes])
    cells = town.grid.layout.cells_at(middle)
    if (town.grid.component[cells] >= 0).any():
        return "a box can be walked into"
    part = np.unique(town.grid.component[town.grid.component >= 0], return_counts=True)[1].max()
    return None if part > 0.8 * town.grid.component.size else "the ground is cut to pieces"


CASES = [
    Case(
        "world: grid of 640,000 cells, 700 boxes",
        (700,),
        set_up,
        build,
        is_right,
        items=lambda town: 640_000,
    )
]
