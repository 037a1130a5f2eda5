"""Exact geometry of a scenario's ground: what is free at the start, before any grid is laid over it."""

import math
from collections.abc import Iterator
from itertools import pairwise

import numpy as np
import numpy.typing as npt
import shapely
from shapely.geometry import LineString, box
from shapely.geometry import Polygon as ShapelyPolygon
from shapely.geometry.base import BaseGeometry

from crowd.scenario.schema import Area, TimedObstacle, WorldTable
from crowd.scenario.source import Location
from crowd.scenario.table import Point

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]


def obstacles(world: WorldTable) -> Iterator[tuple[Location, TimedObstacle, BaseGeometry]]:
    """All obstacles with their place in the file and their shape on the ground."""
    for index, item in enumerate(world.boxes):
        yield ("world", "boxes", index), item, box(item.x[0], item.z[0], item.x[1], item.z[1])
    for index, polygon in enumerate(world.polygons):
        yield ("world", "polygons", index), polygon, ShapelyPolygon(polygon.points)
    for index, wall in enumerate(world.walls):
        yield ("world", "walls", index), wall, LineString(wall.points)


class Ground:
    """Bounds and obstacles of a world, for questions about points.

    Parameters
    ----------
    world : WorldTable
    only_permanent : bool
        Leave out obstacles that appear later or go away; otherwise those that are there at the start.
    """

    def __init__(self, world: WorldTable, *, only_permanent: bool = False) -> None:
        self.bounds = world.bounds
        shapes = [
            shape
            for _, item, shape in obstacles(world)
            if (item.is_permanent if only_permanent else item.appear_at == 0.0)
        ]
        self._shape_count = len(shapes)
        self._tree = shapely.STRtree(shapes)

    def clearance(self, points: FloatArray) -> FloatArray:
        """Distance from points to the nearest obstacle or edge of the ground.

        Parameters
        ----------
        points : (P, 2) float64
            Ground points x, z, m.

        Returns
        -------
        (P,) float64
            m; 0 inside an obstacle, negative outside the ground.
        """
        x, z = points[:, 0], points[:, 1]
        bounds = self.bounds
        distance = np.minimum.reduce([x - bounds.x[0], bounds.x[1] - x, z - bounds.z[0], bounds.z[1] - z])
        if self._shape_count and len(points):
            (asked, _), gap = self._tree.query_nearest(
                shapely.points(points), return_distance=True, all_matches=False
            )
            distance[asked] = np.minimum(distance[asked], gap)
        return np.asarray(distance, np.float64)

    def is_inside_obstacle(self, points: FloatArray) -> BoolArray:
        """Which points are inside an obstacle or on its edge. (P,) bool."""
        inside = np.zeros(len(points), np.bool_)
        if self._shape_count and len(points):
            asked, _ = self._tree.query(shapely.points(points), predicate="intersects")
            inside[asked] = True
        return inside

    def is_outside(self, points: FloatArray) -> BoolArray:
        """Which points are outside the bounds. (P,) bool."""
        x, z = points[:, 0], points[:, 1]
        bounds = self.bounds
        return (x < bounds.x[0]) | (x > bounds.x[1]) | (z < bounds.z[0]) | (z > bounds.z[1])


def is_within(area: Area, bounds: Area) -> bool:
    """The area lies inside the bounds."""
    return (
        bounds.x[0] <= area.x[0]
        and area.x[1] <= bounds.x[1]
        and bounds.z[0] <= area.z[0]
        and area.z[1] <= bounds.z[1]
    )


def overlapping_pairs(position: FloatArray, radius: FloatArray, tolerance: float) -> npt.NDArray[np.intp]:
    """Pairs of discs that overlap by more than a tolerance.

    Parameters
    ----------
    position : (P, 2) float64
        Centres, m.
    radius : (P,) float64
        m.
    tolerance : float
        Depth that does not count, m.

    Returns
    -------
    (O, 2) intp
        Rows, the smaller first, in ascending order.
    """
    if len(position) < 2:
        return np.zeros((0, 2), np.intp)
    tree = shapely.STRtree(shapely.points(position))
    reach = radius + radius.max()
    asked, found = tree.query(shapely.points(position), predicate="dwithin", distance=reach)
    keep = asked < found
    asked, found = asked[keep], found[keep]
    gap = np.hypot(*(position[asked] - position[found]).T) - radius[asked] - radius[found]
    pairs = np.stack([asked, found], axis=1)[gap < -tolerance]
    return np.asarray(pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))], np.intp)


def wall_segments(world: WorldTable) -> dict[str, FloatArray]:
    """Edges of all obstacles as line segments, with the times at which they are there.

    Returns
    -------
    dict
        ``wall`` (W, 2, 3): both ends, m; ``appear_at`` (W,) and ``disappear_at`` (W,): s, infinite for ever.
    """
    ends: list[tuple[Point, Point]] = []
    times: list[tuple[float, float]] = []
    for _, item, shape in obstacles(world):
        line = shape.exterior if isinstance(shape, ShapelyPolygon) else shape
        points = list(line.coords)
        ends.extend(pairwise(points))
        last = math.inf if item.disappear_at is None else item.disappear_at
        times.extend([(item.appear_at, last)] * (len(points) - 1))
    wall = np.zeros((len(ends), 2, 3))
    wall[:, :, [0, 2]] = np.array(ends, np.float64).reshape(-1, 2, 2)
    appear_at, disappear_at = np.array(times, np.float64).reshape(-1, 2).T.copy()
    return {"wall": wall, "appear_at": appear_at, "disappear_at": disappear_at}
