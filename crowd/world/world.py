"""The world: bounds, obstacles that may come and go, walls for avoidance, grids for finding ways."""

import hashlib
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import shapely

from crowd.world.grid import Bounds, Grid, Layout, cover_ground
from crowd.world.obstacles import Box, Shape, Wall
from crowd.world.walls import Walls

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]

CELL_SIZE = 0.25
RADIUS_STEP = 0.05
"""Bodies share a grid with others whose radius rounds up to the same multiple of this, m."""
TOUCHING = 1e-6
"""Distances below this are none, m."""
TOUCH_DEPTH = 0.02
"""Ways of arms end this much before their targets, m: what is on a wall is not behind it."""
MOST_CHANGES = 256
"""Changes that the world remembers."""


@dataclass(frozen=True)
class Change:
    """An obstacle that has come or gone.

    Attributes
    ----------
    version : int
        Version of the world since then.
    low, high : (2,) float64
        Corners of the rectangle around it (x, z), m.
    is_gone : bool
        It was taken away.
    """

    version: int
    low: FloatArray
    high: FloatArray
    is_gone: bool


class World:
    """Ground with obstacles.

    Parameters
    ----------
    bounds : tuple of float
        Lowest and highest x, lowest and highest z, m. Nobody walks outside.
    obstacles : sequence of Shape
    cell_size : float
        Cells of the walkable grids, m; larger in huge worlds.
    """

    def __init__(self, bounds: Bounds, obstacles: Sequence[Shape] = (), cell_size: float = CELL_SIZE) -> None:
        if not (math.isfinite(sum(bounds)) and bounds[0] < bounds[1] and bounds[2] < bounds[3]):
            raise ValueError(f"world: bounds are {bounds}; allowed x low < x high, z low < z high, finite")
        if not (math.isfinite(cell_size) and cell_size > 0.0):
            raise ValueError(f"world: cell size is {cell_size}; allowed a positive number of metres")
        self.bounds = bounds
        self.layout = Layout.over(bounds, cell_size)
        self.version = 0
        """Grows with every obstacle that comes or goes."""
        self._changes: list[Change] = []
        self._obstacles: dict[int, Shape] = dict(enumerate(obstacles))
        self._next_number = len(self._obstacles)
        self._grids: dict[int, Grid] = {}
        self._cover = np.zeros(0, np.uint32)
        self._list_obstacles()

    @property
    def obstacles(self) -> tuple[Shape, ...]:
        """Obstacles that are there now."""
        return tuple(self._obstacles.values())

    @property
    def has_obstacles(self) -> bool:
        """Whether anything is in the way now."""
        return bool(self._obstacles)

    def add_obstacle(self, shape: Shape) -> int:
        """Put an obstacle down; returns its number for `remove_obstacle`."""
        number = self._next_number
        self._next_number += 1
        self._obstacles[number] = shape
        self._change(shape, is_gone=False)
        return number

    def remove_obstacle(self, number: int) -> None:
        """Take an obstacle away.

        Raises
        ------
        KeyError
            There is none of this number.
        """
        self._change(self._obstacles.pop(number), is_gone=True)

    def changes_since(self, version: int) -> list[Change] | None:
        """Obstacles that have come and gone since a version; None when that is too long ago."""
        if self.version - version > len(self._changes):
            return None
        return self._changes[len(self._changes) - (self.version - version) :]

    def grid(self, radius: float) -> Grid:
        """The walkable grid for a body radius, m."""
        step = radius_class(radius)
        if step not in self._grids:
            if self._cover.size == 0:
                self._cover = np.zeros(self.layout.cell_count, np.uint32)
                cover_ground(self.layout, self._solids(), self._cover)
            edge = self.walls.table.edge
            self._grids[step] = Grid.build(self.layout, edge, self._cover, step * RADIUS_STEP)
        return self._grids[step]

    def clearance_at(self, points_world: FloatArray) -> FloatArray:
        """Distance of points (P, 3) to the nearest obstacle, m; 0 inside, infinite without obstacles."""
        points = np.ascontiguousarray(points_world[:, [0, 2]])
        distance = np.full(len(points), np.inf)
        if self._obstacles and len(points):
            (asked, _), gap = self.tree.query_nearest(
                shapely.points(points), return_distance=True, all_matches=False
            )
            distance[asked] = gap
        return distance

    def is_inside_bounds(self, points_world: FloatArray) -> BoolArray:
        """Which points (P, 3) lie inside the bounds."""
        x, z = points_world[:, 0], points_world[:, 2]
        low_x, high_x, low_z, high_z = self.bounds
        return (x >= low_x) & (x <= high_x) & (z >= low_z) & (z <= high_z)

    def is_walkable(self, points_world: FloatArray, radius: float) -> BoolArray:
        """At which points (P, 3) a body fits."""
        return self.is_inside_bounds(points_world) & (self.clearance_at(points_world) >= radius - 1e-6)

    def nearest_walkable(self, points_world: FloatArray, radius: float) -> FloatArray:
        """The points (P, 3) where a body fits, else the nearest places of the grid; NaN if none."""
        result = np.array(points_world, dtype=np.float64)
        wrong = np.flatnonzero(~self.is_walkable(result, radius))
        if len(wrong):
            grid = self.grid(radius)
            cells = grid.nearest_cells(result[wrong][:, [0, 2]])
            result[wrong[:, None], [0, 2]] = np.where(cells[:, None] >= 0, grid.point[cells], np.nan)
        return result

    def is_reachable(self, start_world: FloatArray, goal_world: FloatArray, radius: float) -> BoolArray:
        """Between which pairs of points (P, 3) a body finds a way."""
        grid = self.grid(radius)
        starts = grid.nearest_cells(start_world[:, [0, 2]])
        goals = grid.nearest_cells(goal_world[:, [0, 2]])
        is_known = (starts >= 0) & (goals >= 0)
        is_reachable: BoolArray = is_known & (grid.component[starts] == grid.component[goals])
        return is_reachable

    def is_blocked(self, start_world: FloatArray, end_world: FloatArray) -> BoolArray:
        """Between which pairs of points an arm would go through an obstacle, below its height.

        Parameters
        ----------
        start_world, end_world : (P, 3) float64
            Shoulder and target, m. What touches an obstacle at its near side is free, and so is what lies in
            a box with boards. Pairs that are not finite are not blocked.

        Returns
        -------
        (P,) bool
        """
        blocked = np.zeros(len(end_world), np.bool_)
        way = end_world - start_world
        known = np.flatnonzero(np.isfinite(way).all(axis=1))
        if not self._obstacles or known.size == 0:
            return blocked
        length = np.linalg.norm(way[known], axis=1, keepdims=True)
        way = way[known] * (1.0 - np.minimum(TOUCH_DEPTH / np.maximum(length, TOUCH_DEPTH), 1.0))
        start = start_world[known]
        lines = shapely.linestrings(np.stack([start, start + way], axis=1)[:, :, [0, 2]])
        asked, found = self.tree.query(lines, predicate="intersects")
        geometry = self.tree.geometries[found]
        lowest = _lowest_inside(start[asked], way[asked], shapely.intersection(lines[asked], geometry))
        height = np.array([shape.height for shape in self._obstacles.values()])[found]
        has_boards = np.array([isinstance(s, Box) and s.has_boards for s in self._obstacles.values()])[found]
        targets = shapely.points(end_world[known][asked][:, [0, 2]])
        is_in_shelf = has_boards & (shapely.distance(geometry, targets) < TOUCHING)
        blocked[known[asked[(lowest < height - TOUCHING) & ~is_in_shelf]]] = True
        return blocked

    def _change(self, shape: Shape, *, is_gone: bool) -> None:
        """Update everything that depends on an obstacle that has come or gone."""
        self._list_obstacles()
        self.version += 1
        outline = shape.outline()
        change = Change(self.version, outline.min(axis=0), outline.max(axis=0), is_gone)
        self._changes = [*self._changes, change][-MOST_CHANGES:]
        if self._cover.size:
            window = self.layout.window(change.low, change.high)
            cover_ground(self.layout, self._solids(), self._cover, window)
        for grid in self._grids.values():
            grid.update(self.walls.table.edge, self._cover, change.low, change.high)

    def _solids(self) -> list[FloatArray]:
        """Outlines of obstacles with an inside."""
        return [shape.outline() for shape in self._obstacles.values() if not isinstance(shape, Wall)]

    def _list_obstacles(self) -> None:
        """Rebuild the tree and the walls."""
        shapes = self._obstacles.values()
        outlines = b"".join(shape.outline().tobytes() + b";" for shape in shapes)
        self.digest = np.frombuffer(hashlib.blake2s(outlines, digest_size=16).digest(), np.uint8)
        """Sixteen bytes that differ between different obstacles."""
        self.tree = shapely.STRtree([shape.geometry() for shape in shapes])
        self.walls = Walls.build(
            polygons=self._solids(),
            segments=[shape.outline() for shape in shapes if isinstance(shape, Wall)],
        )


def _lowest_inside(start_world: FloatArray, way: FloatArray, inside: npt.NDArray[np.object_]) -> FloatArray:
    """Lowest height of straight ways (P, 3) over their parts inside obstacles, m. (P,)"""
    corners, pair = shapely.get_coordinates(inside, return_index=True)
    flat = np.maximum((way[:, [0, 2]] ** 2).sum(axis=1), TOUCHING**2)
    share = ((corners - start_world[pair][:, [0, 2]]) * way[pair][:, [0, 2]]).sum(axis=1) / flat[pair]
    # What goes straight up or down is inside as a whole.
    is_steep = flat <= TOUCHING**2
    lowest = np.where(is_steep, start_world[:, 1] + np.minimum(way[:, 1], 0.0), np.inf)
    np.minimum.at(lowest, pair, start_world[pair, 1] + way[pair, 1] * share)
    return lowest


def radius_class(radius: float) -> int:
    """Number of the grid that a body shares with others of nearly its radius."""
    return max(math.ceil(radius / RADIUS_STEP - 1e-6), 1)
