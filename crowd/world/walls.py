"""Walls of a world as directed edges, listed by ground cell for avoidance and contact."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from crowd.errors import SettingsError, describe
from crowd_kernels import walls as kernels
from crowd_kernels.wall_cells import list_edges, measure_wall_distance
from crowd_kernels.walls import EDGE_COLUMNS, WallTable

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int32]
BoolArray = npt.NDArray[np.bool_]
Bounds = tuple[float, float, float, float]

DEFAULT_REACH = 3.0
CELL_SIZE = 1.0
MOST_CELLS = 1 << 20
SHORTEST_EDGE = 1e-6


@dataclass(frozen=True)
class Walls:
    """Immutable walls; edits give new ones.

    Points are ground coordinates (x, z) in m. The walkable side of an edge is on its right in a drawing with
    x to the right and z upwards; `build` takes care of that for any winding of what it is given.

    Attributes
    ----------
    polygons : tuple of (K, 2) float64
        Outlines of solid obstacles as they were given.
    segments : tuple of (2, 2) float64
        Thin walls with two sides.
    boundaries : tuple of (K, 2) float64
        Outlines whose inside is walkable.
    start, end : (W, 2) float64
        Ends of the directed edges.
    before, after : (W,) int32
        Neighbouring edges in the chain of each edge.
    is_convex : (W,) bool
        The corner at the start of the edge is convex, seen from outside.
    table : WallTable
        What kernels read.
    """

    polygons: tuple[FloatArray, ...]
    segments: tuple[FloatArray, ...]
    boundaries: tuple[FloatArray, ...]
    start: FloatArray
    end: FloatArray
    before: IntArray
    after: IntArray
    is_convex: BoolArray
    table: WallTable

    @classmethod
    def build(
        cls,
        polygons: Sequence[npt.ArrayLike] = (),
        segments: Sequence[npt.ArrayLike] = (),
        bounds: Bounds | None = None,
        reach: float = DEFAULT_REACH,
        boundaries: Sequence[npt.ArrayLike] = (),
    ) -> Walls:
        """Make walls from outlines.

        Parameters
        ----------
        polygons : sequence of (K, 2)
            Closed outlines of solids, any winding; they do not cross themselves.
        segments : sequence of (2, 2)
            Thin walls.
        bounds : tuple of float, optional
            x_min, z_min, x_max, z_max of an area beyond whose `reach` walls are of no interest, m. All walls
            count when it is left out.
        reach : float
            Distance up to which walls are listed, m: at least the wall horizon times the largest speed plus
            the largest radius.
        boundaries : sequence of (K, 2)
            Closed outlines whose inside is walkable, any winding.

        Returns
        -------
        Walls

        Raises
        ------
        SettingsError
            For an outline with fewer than three different points, without area, or with coordinates that are
            not finite; for a segment without length; for a reach that is not positive.
        """
        if not (math.isfinite(reach) and reach > 0.0):
            raise SettingsError(describe("walls", "reach is wrong", reach, "a positive number of metres"))
        solids = tuple(_outline(points, f"polygon {k}") for k, points in enumerate(polygons))
        open_areas = tuple(_outline(points, f"boundary {k}") for k, points in enumerate(boundaries))
        thin = tuple(_segment(points, f"segment {k}") for k, points in enumerate(segments))
        chains = [(points, kernels.SOLID) for points in solids]
        chains += [(points[::-1], kernels.SOLID) for points in open_areas]
        chains += [(points, kernels.THIN) for points in thin]
        start, end, before, after = _connect([points for points, _ in chains])
        is_convex, edge = _describe_edges(start, end, before, after)
        kinds = [np.full(len(points), kind) for points, kind in chains]
        if kinds:
            edge[:, kernels.KIND] = np.concatenate(kinds)
            backs = np.flatnonzero(edge[:, kernels.KIND] == kernels.THIN)[1::2]
            edge[backs, kernels.KIND] = kernels.BACK_OF_THIN
        table = _list_by_cell(edge, bounds, reach)
        for array in (start, end, before, after, is_convex):
            array.flags.writeable = False
        return cls(solids, thin, open_areas, start, end, before, after, is_convex, table)

    @property
    def count(self) -> int:
        """Number of directed edges."""
        return int(self.start.shape[0])

    @property
    def reach(self) -> float:
        """Distance up to which walls are listed, m."""
        return float(self.table.reach)

    def added(self, polygons: Sequence[npt.ArrayLike] = (), segments: Sequence[npt.ArrayLike] = ()) -> Walls:
        """Return these walls and some more; the new ones come last."""
        return Walls.build(
            [*self.polygons, *polygons],
            [*self.segments, *segments],
            reach=self.reach,
            boundaries=self.boundaries,
        )

    def removed(self, polygons: Iterable[int] = (), segments: Iterable[int] = ()) -> Walls:
        """Return these walls without some, named by their places in `polygons` and `segments`."""
        gone_polygons, gone_segments = set(polygons), set(segments)
        return Walls.build(
            [points for k, points in enumerate(self.polygons) if k not in gone_polygons],
            [points for k, points in enumerate(self.segments) if k not in gone_segments],
            reach=self.reach,
            boundaries=self.boundaries,
        )

    def distance(self, position_world: FloatArray, active: IntArray) -> FloatArray:
        """Distance from characters to the nearest wall, m; infinite where none is listed near.

        Parameters
        ----------
        position_world : (N, 3) float64
        active : (A,) int32

        Returns
        -------
        (A,) float64
        """
        distance = np.full(position_world.shape[0], np.inf)
        measure_wall_distance(position_world, active, self.table, distance)
        return distance[active]


def _outline(points: npt.ArrayLike, name: str) -> FloatArray:
    """Return a closed outline counter-clockwise in the drawing (x right, z up), without repeated points."""
    outline = np.array(points, dtype=np.float64)
    if outline.ndim != 2 or outline.shape[1] != 2 or not np.isfinite(outline).all():
        raise SettingsError(
            describe(f"walls: {name}", "no outline", outline.tolist(), "finite points (K, 2)")
        )
    step = np.linalg.norm(outline - np.roll(outline, 1, axis=0), axis=1)
    outline = outline[step > SHORTEST_EDGE]
    if len(outline) < 3:
        raise SettingsError(describe(f"walls: {name}", "too few different points", len(outline), "3 or more"))
    following = np.roll(outline, -1, axis=0)
    area = 0.5 * float(np.sum(outline[:, 0] * following[:, 1] - outline[:, 1] * following[:, 0]))
    if abs(area) <= SHORTEST_EDGE * SHORTEST_EDGE:
        raise SettingsError(describe(f"walls: {name}", "the outline encloses no area", outline.tolist()))
    outline = np.ascontiguousarray(outline if area > 0.0 else outline[::-1])
    outline.flags.writeable = False
    return outline


def _segment(points: npt.ArrayLike, name: str) -> FloatArray:
    """Return the two ends of a thin wall."""
    ends = np.array(points, dtype=np.float64)
    if ends.shape != (2, 2) or not np.isfinite(ends).all():
        raise SettingsError(describe(f"walls: {name}", "no wall", ends.tolist(), "two finite points (2, 2)"))
    if np.linalg.norm(ends[1] - ends[0]) <= SHORTEST_EDGE:
        raise SettingsError(describe(f"walls: {name}", "no length", ends.tolist(), "two different points"))
    ends.flags.writeable = False
    return ends


def _connect(chains: Sequence[FloatArray]) -> tuple[FloatArray, FloatArray, IntArray, IntArray]:
    """Return starts, ends, and neighbours of the edges of closed chains of points."""
    if not chains:
        empty = np.zeros((0, 2))
        return empty, empty.copy(), np.zeros(0, np.int32), np.zeros(0, np.int32)
    first = np.cumsum([0] + [len(points) for points in chains])
    start = np.concatenate(chains)
    end = np.concatenate([np.roll(points, -1, axis=0) for points in chains])
    ranges = [np.arange(first[k], first[k + 1], dtype=np.int32) for k in range(len(chains))]
    before = np.concatenate([np.roll(numbers, 1) for numbers in ranges])
    after = np.concatenate([np.roll(numbers, -1) for numbers in ranges])
    return start, end, before, after


def _describe_edges(
    start: FloatArray, end: FloatArray, before: IntArray, after: IntArray
) -> tuple[BoolArray, FloatArray]:
    """Return the convexity of the corners and the rows that kernels read."""
    step = end - start
    length = np.hypot(step[:, 0], step[:, 1])
    along = step / length[:, None]
    turn = step[before, 0] * step[:, 1] - step[before, 1] * step[:, 0]
    # The ends of a thin wall turn by half a circle.
    is_convex = turn >= -1e-12 * length * length[before]
    edge = np.zeros((len(start), EDGE_COLUMNS))
    edge[:, kernels.START_X : kernels.START_Z + 1] = start
    edge[:, kernels.END_X : kernels.END_Z + 1] = end
    edge[:, kernels.ALONG_X : kernels.ALONG_Z + 1] = along
    edge[:, kernels.LENGTH] = length
    edge[:, kernels.BEFORE_X : kernels.BEFORE_Z + 1] = along[before]
    edge[:, kernels.AFTER_X : kernels.AFTER_Z + 1] = along[after]
    edge[:, kernels.START_IS_CONVEX] = is_convex
    edge[:, kernels.END_IS_CONVEX] = is_convex[after]
    return is_convex, edge


def _list_by_cell(edge: FloatArray, bounds: Bounds | None, reach: float) -> WallTable:
    """List the edges near each cell of a grid that holds everything within reach of a wall."""
    edge = np.ascontiguousarray(edge)
    if len(edge) == 0:
        cell_start, cell_edge = np.zeros(2, np.int32), np.zeros(0, np.int32)
        columns, rows, cell_size, low = 1, 1, CELL_SIZE, np.zeros(2)
    else:
        corners = np.concatenate([edge[:, 0:2], edge[:, 2:4]])
        low, high = corners.min(axis=0) - reach, corners.max(axis=0) + reach
        if bounds is not None:
            low = np.maximum(low, np.array(bounds[:2]) - reach)
            high = np.maximum(np.minimum(high, np.array(bounds[2:]) + reach), low)
        size = high - low
        cell_size = max(CELL_SIZE, math.sqrt(float(size[0] * size[1]) / MOST_CELLS))
        columns, rows = (int(count) + 1 for count in size // cell_size)
        cell_start = np.zeros(columns * rows + 1, np.int32)
        grid = (edge, float(low[0]), float(low[1]), cell_size, columns, rows, reach, cell_start)
        cell_edge = np.zeros(list_edges(*grid, np.zeros(0, np.int32)), np.int32)
        list_edges(*grid, cell_edge)
    for array in (edge, cell_start, cell_edge):
        array.flags.writeable = False
    low_x, low_z = float(low[0]), float(low[1])
    return WallTable(edge, cell_start, cell_edge, low_x, low_z, float(cell_size), columns, rows, float(reach))
