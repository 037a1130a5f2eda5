"""The walkable grid of a world for one body radius."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import shapely
from scipy import ndimage

from crowd_kernels.grid_search import COLUMN_STEP, ROW_STEP, label_components, mask_moves

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int32]
ByteArray = npt.NDArray[np.uint8]
Bounds = tuple[float, float, float, float]

SUBCELLS = 7
"""A body's place is looked for on so many lines across a cell."""
MARGIN = 0.01
"""A gap may be narrower than the body by this much, m: rounding of what a user wrote."""
MOST_CELLS = 4_000_000


@dataclass(frozen=True)
class Layout:
    """Where the cells of a grid lie; the same for all radii of a world.

    Attributes
    ----------
    low_x, low_z : float
        Lowest corner, m.
    cell_size : float
        m.
    columns, rows : int
        Cells along x and z.
    """

    low_x: float
    low_z: float
    cell_size: float
    columns: int
    rows: int

    @classmethod
    def over(cls, bounds: Bounds, cell_size: float) -> "Layout":
        """Cover bounds (x low, x high, z low, z high), with larger cells in huge worlds."""
        width, depth = bounds[1] - bounds[0], bounds[3] - bounds[2]
        size = max(cell_size, float(np.sqrt(width * depth / MOST_CELLS)))
        columns, rows = (max(int(np.ceil(extent / size - 1e-9)), 1) for extent in (width, depth))
        return cls(bounds[0], bounds[2], size, columns, rows)

    @property
    def cell_count(self) -> int:
        """Number of cells."""
        return self.columns * self.rows

    def centers(self) -> FloatArray:
        """Centres of all cells, (cells, 2), m."""
        x = self.low_x + (np.arange(self.columns) + 0.5) * self.cell_size
        z = self.low_z + (np.arange(self.rows) + 0.5) * self.cell_size
        grid_x, grid_z = np.meshgrid(x, z)
        return np.column_stack([grid_x.ravel(), grid_z.ravel()])

    def cells_at(self, points: FloatArray) -> IntArray:
        """Cells of ground points (P, 2); points outside belong to the nearest border cell."""
        column = np.clip((points[:, 0] - self.low_x) / self.cell_size, 0, self.columns - 1).astype(np.int32)
        row = np.clip((points[:, 1] - self.low_z) / self.cell_size, 0, self.rows - 1).astype(np.int32)
        return row * np.int32(self.columns) + column


@dataclass(frozen=True)
class Grid:
    """Where a body of one radius can be, and how it can move.

    Attributes
    ----------
    layout : Layout
    radius : float
        m.
    mask : (cells,) uint8
        Moves of each cell, see `crowd_kernels.grid_search`.
    is_open : (cells,) uint8
        The body fits with its centre at the centre of the cell: straight lines may cross it.
    point : (cells, 2) float64
        Place in the cell with most room, m.
    component : (cells,) int32
        Connected part that the cell belongs to; -1 where the body does not fit.
    """

    layout: Layout
    radius: float
    mask: ByteArray
    is_open: ByteArray
    point: FloatArray
    component: IntArray

    @classmethod
    def build(cls, layout: Layout, tree: shapely.STRtree, radius: float) -> "Grid":
        """Find where a body fits.

        A cell counts as walkable when the body fits somewhere in it, so that a gap is passed wherever the
        grid lies. Between two such cells the straight way must be free as well, which keeps ways from passing
        through thin walls and gaps that are too narrow.
        """
        centers = layout.centers()
        close = cells_near(layout, tree, radius + layout.cell_size)
        room, nearby = np.full(layout.cell_count, np.inf), np.zeros(layout.cell_count, np.bool_)
        room[close], nearby[close] = clearance(tree, centers[close], reach=radius + layout.cell_size)
        is_open = room >= radius
        point = centers.copy()
        best_room = room.copy()
        doubtful = np.flatnonzero(~is_open & (room + 0.71 * layout.cell_size >= radius))
        shift = (np.arange(SUBCELLS) + 0.5) / SUBCELLS - 0.5
        for dx in shift * layout.cell_size:
            for dz in shift * layout.cell_size:
                candidates = centers[doubtful] + (dx, dz)
                here, _ = clearance(tree, candidates, reach=radius + layout.cell_size)
                better = here > best_room[doubtful]
                chosen = doubtful[better]
                point[chosen], best_room[chosen] = candidates[better], here[better]
        is_walkable = (best_room >= radius - MARGIN).astype(np.uint8)
        mask = np.zeros(layout.cell_count, np.uint8)
        mask_moves(is_walkable, layout.columns, layout.rows, mask)
        close_narrow_moves(layout, tree, radius, is_walkable, nearby, point, mask)
        component = np.zeros(layout.cell_count, np.int32)
        label_components(mask, layout.columns, component)
        component[is_walkable == 0] = -1
        return cls(layout, radius, mask, is_open.astype(np.uint8), point, component)

    def nearest_cells(self, points: FloatArray, component: int | None = None) -> IntArray:
        """Nearest cells in which the body fits, for ground points (P, 2); -1 when there are none."""
        usable = self.component >= 0 if component is None else self.component == component
        cells = self.layout.cells_at(points)
        missing = ~usable[cells]
        if missing.any():
            if not usable.any():
                return np.full(len(points), -1, np.int32)
            shape = (self.layout.rows, self.layout.columns)
            nearest = ndimage.distance_transform_edt(
                ~usable.reshape(shape), return_distances=False, return_indices=True
            )
            flat = (nearest[0] * self.layout.columns + nearest[1]).ravel().astype(np.int32)
            cells[missing] = flat[cells[missing]]
        return cells


def clearance(
    tree: shapely.STRtree, points: FloatArray, reach: float
) -> tuple[FloatArray, npt.NDArray[np.bool_]]:
    """Distance of points (P, 2) to the nearest obstacle, m; infinite beyond `reach`, and who is within it."""
    distance = np.full(len(points), np.inf)
    if len(tree.geometries) and len(points):
        (asked, _), gap = tree.query_nearest(
            shapely.points(points), max_distance=reach, return_distance=True, all_matches=False
        )
        distance[asked] = gap
    return distance, np.isfinite(distance)


def cells_near(layout: Layout, tree: shapely.STRtree, reach: float) -> npt.NDArray[np.intp]:
    """Cells whose centre may be within `reach` of an obstacle: those near the boxes around obstacles."""
    is_near = np.zeros((layout.rows, layout.columns), np.bool_)
    for low_x, low_z, high_x, high_z in shapely.bounds(tree.geometries).reshape(-1, 4):
        first = np.floor(
            np.array([low_x - layout.low_x, low_z - layout.low_z]) / layout.cell_size
            - reach / layout.cell_size
        )
        last = np.ceil(
            np.array([high_x - layout.low_x, high_z - layout.low_z]) / layout.cell_size
            + reach / layout.cell_size
        )
        column, row = np.maximum(first, 0).astype(int)
        end_column, end_row = np.maximum(last, 0).astype(int)
        is_near[row : end_row + 1, column : end_column + 1] = True
    return np.flatnonzero(is_near.ravel())


def close_narrow_moves(
    layout: Layout,
    tree: shapely.STRtree,
    radius: float,
    is_walkable: ByteArray,
    nearby: npt.NDArray[np.bool_],
    point: FloatArray,
    mask: ByteArray,
) -> None:
    """Take out moves, in place, whose straight way has less room than the body needs."""
    border = np.flatnonzero(nearby & (is_walkable == 1))
    for move, (column_step, row_step) in enumerate(zip(COLUMN_STEP, ROW_STEP, strict=True)):
        starts = border[(mask[border] >> move) & 1 == 1]
        if len(starts) == 0 or len(tree.geometries) == 0:
            continue
        ends = starts + column_step + row_step * layout.columns
        lines = shapely.linestrings(np.stack([point[starts], point[ends]], axis=1))
        near, _ = tree.query(lines, predicate="dwithin", distance=radius - 2 * MARGIN)
        blocked = np.unique(near)
        mask[starts[blocked]] &= np.uint8(255 - (1 << move))
        mask[ends[blocked]] &= np.uint8(255 - (1 << opposite_move(move)))


def opposite_move(move: int) -> int:
    """Number of the move back."""
    steps = list(zip(COLUMN_STEP, ROW_STEP, strict=True))
    return steps.index((-COLUMN_STEP[move], -ROW_STEP[move]))
