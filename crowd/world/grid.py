"""The walkable grid of a world for one body radius."""

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from crowd_kernels.distance_field import fill_field, label_components
from crowd_kernels.free_line import is_free_line
from crowd_kernels.grid_search import BUCKETS, OVERFLOW, UNSEEN
from crowd_kernels.walkable import (
    GroundGrid,
    cover_samples,
    find_places,
    link_places,
    mask_links,
    nearest_cells,
)
from crowd_kernels.wall_cells import list_edges
from crowd_kernels.walls import WallTable

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int32]
ByteArray = npt.NDArray[np.uint8]
WordArray = npt.NDArray[np.uint32]
Bounds = tuple[float, float, float, float]
Window = tuple[int, int, int, int]
"""First column, last column + 1, first row, last row + 1."""

MOST_CELLS = 4_000_000
CELLS_PER_LIST = 4
"""Walls are listed for squares of so many cells by so many."""
LANDMARKS = 4


@dataclass(frozen=True)
class Layout:
    """Where the cells of a grid lie; the same for all radii of a world.

    Attributes
    ----------
    low_x, low_z : float
        Lowest corner, m.
    high_x, high_z : float
        Highest corner of the ground, m; the last cells may reach beyond.
    cell_size : float
        m.
    columns, rows : int
        Cells along x and z.
    """

    low_x: float
    low_z: float
    high_x: float
    high_z: float
    cell_size: float
    columns: int
    rows: int

    @classmethod
    def over(cls, bounds: Bounds, cell_size: float) -> "Layout":
        """Cover bounds (x low, x high, z low, z high), with larger cells in huge worlds."""
        width, depth = bounds[1] - bounds[0], bounds[3] - bounds[2]
        size = max(cell_size, float(np.sqrt(width * depth / MOST_CELLS)))
        columns, rows = (max(int(np.ceil(extent / size - 1e-9)), 1) for extent in (width, depth))
        low_x, high_x, low_z, high_z = (float(side) for side in bounds)
        return cls(low_x, low_z, high_x, high_z, size, columns, rows)

    @property
    def cell_count(self) -> int:
        """Number of cells."""
        return self.columns * self.rows

    @property
    def everything(self) -> Window:
        """The window of all cells."""
        return 0, self.columns, 0, self.rows

    def cells_at(self, points: FloatArray) -> IntArray:
        """Cells of ground points (P, 2); points outside belong to the nearest border cell."""
        column = np.clip((points[:, 0] - self.low_x) / self.cell_size, 0, self.columns - 1).astype(np.int32)
        row = np.clip((points[:, 1] - self.low_z) / self.cell_size, 0, self.rows - 1).astype(np.int32)
        return row * np.int32(self.columns) + column

    def window(self, low: FloatArray, high: FloatArray) -> Window:
        """Cells that touch the rectangle from `low` to `high` (x, z), m; may be empty."""
        size = np.array([self.columns, self.rows])
        origin = np.array([self.low_x, self.low_z])
        first = np.clip(np.floor((low - origin) / self.cell_size), 0, size).astype(int)
        last = np.clip(np.floor((high - origin) / self.cell_size) + 1, 0, size).astype(int)
        return int(first[0]), int(last[0]), int(first[1]), int(last[1])


def cover_ground(
    layout: Layout, outlines: list[FloatArray], cover: WordArray, window: Window | None = None
) -> None:
    """Mark which samples of the cells of a window lie inside solids.

    Parameters
    ----------
    layout : Layout
    outlines : list of (K, 2)
        Solids, m.
    cover : (cells,) uint32
        Changed in place, see `crowd_kernels.walkable.cover_samples`.
    window : Window, optional
        All cells when left out.
    """
    area = window or layout.everything
    whole = cover.reshape(layout.rows, layout.columns)
    whole[area[2] : area[3], area[0] : area[1]] = 0
    for outline in outlines:
        own = layout.window(outline.min(axis=0), outline.max(axis=0))
        first_column, last_column = max(own[0], area[0]), min(own[1], area[1])
        first_row, last_row = max(own[2], area[2]), min(own[3], area[3])
        if first_column >= last_column or first_row >= last_row:
            continue
        inside = np.zeros((last_row - first_row, last_column - first_column), np.uint32)
        cover_samples(outline, layout.low_x, layout.low_z, layout.cell_size, first_column, first_row, inside)
        whole[first_row:last_row, first_column:last_column] |= inside


@dataclass
class Grid:
    """Where a body of one radius can be, and how it can move.

    Attributes
    ----------
    layout : Layout
    radius : float
        m.
    is_walkable : (cells,) uint8
        1 where the body fits.
    room : (cells,) float64
        Distance of the place in each cell from walls, at most the radius and a cell more, m.
    link : (cells,) uint8
        Between which cells it can go straight, see `crowd_kernels.walkable.link_places`.
    arrays : GroundGrid
        What kernels read: moves, places and components of the cells.
    walls : WallTable
        Walls near each place, up to the radius and a cell more.
    """

    layout: Layout
    radius: float
    is_walkable: ByteArray
    room: FloatArray
    link: ByteArray
    arrays: GroundGrid
    walls: WallTable
    _landmarks: IntArray | None = field(default=None, repr=False)

    @classmethod
    def build(cls, layout: Layout, edge: FloatArray, cover: WordArray, radius: float) -> "Grid":
        """Find where a body fits.

        Parameters
        ----------
        layout : Layout
        edge : (W, EDGE_COLUMNS) float64
            Edges of all walls, see `crowd_kernels.walls.WallTable`.
        cover : (cells,) uint32
            See `cover_ground`.
        radius : float
            m.
        """
        cells = layout.cell_count
        arrays = GroundGrid(
            np.zeros(cells, np.uint8),
            np.zeros((cells, 2)),
            np.zeros(cells, np.int32),
            radius,
            layout.low_x,
            layout.low_z,
            layout.high_x,
            layout.high_z,
            layout.cell_size,
            layout.columns,
            layout.rows,
        )
        walls = wall_table(layout, edge, radius)
        is_walkable, link = np.zeros((2, cells), np.uint8)
        grid = cls(layout, radius, is_walkable, np.zeros(cells), link, arrays, walls)
        grid._measure(cover, layout.everything)
        return grid

    @property
    def mask(self) -> ByteArray:
        """Moves of each cell, see `crowd_kernels.grid_search`. (cells,)"""
        mask: ByteArray = self.arrays.mask
        return mask

    @property
    def point(self) -> FloatArray:
        """Place in each cell where the body fits best, m. (cells, 2)"""
        point: FloatArray = self.arrays.point
        return point

    @property
    def component(self) -> IntArray:
        """Connected part that each cell belongs to; -1 where the body does not fit. (cells,)"""
        component: IntArray = self.arrays.component
        return component

    @property
    def landmark_cost(self) -> IntArray:
        """Distance fields of cells far from each other, which shorten many searches. (L, cells)"""
        if self._landmarks is None:
            self._landmarks = self._find_landmarks()
        return self._landmarks

    def update(self, edge: FloatArray, cover: WordArray, low: FloatArray, high: FloatArray) -> None:
        """Find anew where the body fits, after walls have changed between `low` and `high` (x, z), m."""
        reach = self.radius + self.layout.cell_size
        self.walls = wall_table(self.layout, edge, self.radius)
        self._measure(cover, self.layout.window(low - reach, high + reach))

    def nearest_cells(
        self, points: FloatArray, component: IntArray | None = None, reach: float = np.inf
    ) -> IntArray:
        """Nearest cells in which the body fits, for ground points (P, 2); -1 when there are none."""
        cells = np.zeros(len(points), np.int32)
        part = np.full(len(points), -1, np.int32) if component is None else component
        nearest_cells(self.arrays, np.ascontiguousarray(points), part, reach, cells)
        return cells

    def is_free_line(self, start: FloatArray, end: FloatArray, radius: float | None = None) -> bool:
        """Tell whether a body, of the grid's radius when left out, can go straight between points (x, z)."""
        body = self.radius if radius is None else radius
        return bool(is_free_line(self.walls, body, *start.tolist(), *end.tolist()))

    def field(self, goal_cells: IntArray) -> IntArray:
        """Cost from each cell to the nearest goal cell, (cells,). See `crowd_kernels.distance_field`."""
        cells = self.layout.cell_count
        cost = np.zeros(cells, np.int32)
        head = np.zeros(BUCKETS, np.int32)
        entries = cells + goal_cells.size
        while (
            fill_field(self.mask, self.layout.columns, goal_cells, head, np.zeros(entries, np.int64), cost)
            == OVERFLOW
        ):
            entries *= 2
        return cost

    def _measure(self, cover: WordArray, window: Window) -> None:
        """Compute all arrays in a window and what depends on them."""
        first_column, last_column, first_row, last_row = window
        self._landmarks = None
        find_places(self.arrays, self.walls, cover, *window, self.is_walkable, self.point, self.room)
        # A link belongs to its lower cell, a move to both.
        low_column, low_row = max(first_column - 1, 0), max(first_row - 1, 0)
        high_column = min(last_column + 1, self.layout.columns)
        high_row = min(last_row + 1, self.layout.rows)
        around = (low_column, high_column, low_row, high_row)
        link_places(self.arrays, self.walls, self.is_walkable, self.room, *around, self.link)
        mask_links(self.link, self.layout.columns, self.layout.rows, *around, self.mask)
        label_components(self.mask, self.layout.columns, self.component)
        self.component[self.is_walkable == 0] = -1

    def _find_landmarks(self) -> IntArray:
        """Compute the fields of cells that are far from each other, in the largest part of the grid."""
        known = self.component[self.component >= 0]
        if known.size == 0:
            return np.zeros((0, self.layout.cell_count), np.int32)
        first = np.argmax(np.bincount(known)).astype(np.int32)
        cost = np.zeros((LANDMARKS, self.layout.cell_count), np.int32)
        nearest = self.field(np.array([first], np.int32))
        for landmark in range(LANDMARKS):
            far = np.argmax(np.where(nearest < UNSEEN, nearest, -1)).astype(np.int32)
            cost[landmark] = self.field(np.array([far], np.int32))
            nearest = cost[0].copy() if landmark == 0 else np.minimum(nearest, cost[landmark])
        return cost


def wall_table(layout: Layout, edge: FloatArray, radius: float) -> WallTable:
    """List the walls near each square of cells, up to the radius and a cell more."""
    reach = radius + layout.cell_size
    size = layout.cell_size * CELLS_PER_LIST
    # One more than needed: the upper border of the ground belongs to the next square.
    columns, rows = layout.columns // CELLS_PER_LIST + 1, layout.rows // CELLS_PER_LIST + 1
    place = (layout.low_x, layout.low_z, size, columns, rows, reach)
    cell_start = np.zeros(columns * rows + 1, np.int32)
    edge = np.ascontiguousarray(edge)
    cell_edge = np.zeros(list_edges(edge, *place, cell_start, np.zeros(0, np.int32)), np.int32)
    list_edges(edge, *place, cell_start, cell_edge)
    for array in (edge, cell_start, cell_edge):
        array.flags.writeable = False
    return WallTable(edge, cell_start, cell_edge, *place)
