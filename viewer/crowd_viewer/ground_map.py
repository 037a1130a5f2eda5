"""A map on the ground: where a body fits, and how far it is from there to the goal."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from crowd.simulation import Simulation
from crowd.world.grid import Grid
from crowd_kernels.grid_search import STRAIGHT, UNSEEN
from crowd_viewer.programs import compile_program

if TYPE_CHECKING:
    import moderngl

FloatArray = npt.NDArray[np.float64]
Cells = npt.NDArray[np.uint8]

BLOCKED, FREE, CUT_OFF = (215, 60, 45, 150), (60, 200, 120, 70), (120, 120, 120, 130)
NEAR_GOAL, FAR_AWAY = np.array([250, 230, 90]), np.array([60, 30, 140])
BAND, BAND_DARKNESS = 1.0, 0.82
"""Every other band of so many metres is darker."""
ALPHA = 150
COMMON_RADIUS = 0.25


class GroundMap:
    """Cells drawn on the ground, below the people."""

    def __init__(self, context: moderngl.Context, origin: FloatArray) -> None:
        self.context = context
        self.origin = origin
        self._texture: moderngl.Texture | None = None
        self._shown: tuple[Any, ...] = ()
        self._program = compile_program(context, ("view.glsl", "ground_map.vert"), ("ground_map.frag",))
        corners = context.buffer(np.array([0, 0, 0, 1, 1, 0, 1, 1], np.float32).tobytes())
        self._array = context.vertex_array(self._program, [(corners, "2f4", "corner")])

    def update(self, simulation: Simulation, picked: int) -> None:
        """Show the grid of the picked person and the distance to its goal, or where anybody fits."""
        world = simulation.model.world
        radius = COMMON_RADIUS if picked < 0 else float(simulation.model.people.radius[picked])
        grid = world.grid(radius)
        goal = -1
        if picked >= 0 and simulation.state.wants_to_walk[picked]:
            goal = int(grid.nearest_cells(simulation.state.goal_world[[picked]][:, [0, 2]])[0])
        shown = (world.version, round(grid.radius, 3), goal)
        if shown != self._shown:
            self._shown = shown
            self._fill(grid, cells_of(grid, goal))

    def _fill(self, grid: Grid, cells: Cells) -> None:
        size = (grid.layout.columns, grid.layout.rows)
        if self._texture is None or self._texture.size != size:
            if self._texture is not None:
                self._texture.release()
            self._texture = self.context.texture(size, 4)
            self._texture.filter = (self.context.NEAREST, self.context.NEAREST)
        self._texture.write(cells.tobytes())
        layout = grid.layout
        low_x, low_z = layout.low_x - self.origin[0], layout.low_z - self.origin[2]
        extent = (layout.columns * layout.cell_size, layout.rows * layout.cell_size)
        self._program["area"] = (low_x, low_z, *extent)

    def draw(self) -> None:
        """Draw the map; the view is written, blending is on."""
        if self._texture is not None:
            self._texture.use(0)
            self._program["cells"] = 0
            self._array.render(self.context.TRIANGLE_STRIP)


def cells_of(grid: Grid, goal_cell: int) -> Cells:
    """Colours of the cells, with the distance to a goal cell unless it is -1. (rows, columns, 4)."""
    layout = grid.layout
    free = np.asarray(grid.is_walkable).reshape(layout.rows, layout.columns) != 0
    cells = np.empty((*free.shape, 4), np.uint8)
    cells[:] = FREE
    if goal_cell >= 0:
        cost = grid.field(np.array([goal_cell], np.int32)).reshape(free.shape)
        is_reached = cost < UNSEEN
        metres = np.where(is_reached, cost, 0) * (layout.cell_size / STRAIGHT)
        share = (metres / max(float(metres.max()), 1e-9))[..., None] ** 0.6
        dark = np.where(np.floor(metres / BAND) % 2 == 1, BAND_DARKNESS, 1.0)[..., None]
        cells[..., :3] = dark * (NEAR_GOAL + share * (FAR_AWAY - NEAR_GOAL))
        cells[..., 3] = ALPHA
        cells[~is_reached] = CUT_OFF
    cells[~free] = BLOCKED
    return cells
