"""Walls and obstacles as triangles: upright prisms over outlines on the ground."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import shapely
from shapely.geometry.base import BaseGeometry

from crowd.scenario.geometry import obstacles
from crowd.scenario.schema import Box, WorldTable

FloatArray = npt.NDArray[np.float64]
Float32Array = npt.NDArray[np.float32]

WALL_THICKNESS, DOOR_THICKNESS = 0.12, 0.06
DOOR_GAP = 0.01
"""Between the top of a door and what is beside it, m."""
BEVEL = 0.025
"""Width of the slanted rim, which catches light as edges of real things do, m."""
UNKNOWN_HEIGHT = 1.0
BOARD_THICKNESS, POST_THICKNESS = 0.03, 0.04
"""Of furniture, m."""


@dataclass(frozen=True)
class Solid:
    """Triangles of something solid, and when it is there.

    Attributes
    ----------
    vertex : (T * 3, 7) float32
        Position, normal, and height of the whole thing, m; three rows make a triangle, anticlockwise from
        outside.
    appear_at, disappear_at : float
        s; infinite for ever.
    """

    vertex: Float32Array
    appear_at: float = 0.0
    disappear_at: float = math.inf


def scenario_solids(world: WorldTable) -> Iterator[Solid]:
    """Everything solid in a scenario's world."""
    for _, item, shape in obstacles(world):
        last = math.inf if item.disappear_at is None else item.disappear_at
        if isinstance(item, Box) and item.boards:
            yield Solid(furniture(shape, item.boards, item.height), item.appear_at, last)
        elif item.height > 0.0:
            outline = _thickened(shape) if item.is_permanent else _door(shape)
            height = item.height - (0.0 if item.is_permanent else DOOR_GAP)
            yield Solid(prism(outline, max(height, 0.5 * item.height)), item.appear_at, last)


def wall_solids(walls: FloatArray, appear_at: FloatArray, disappear_at: FloatArray) -> Iterator[Solid]:
    """Segments (W, 2, 3) as walls of a recording, which knows no heights."""
    for index, ends in enumerate(walls):
        line = shapely.LineString(ends[:, [0, 2]])
        vertex = prism(_thickened(line), UNKNOWN_HEIGHT)
        yield Solid(vertex, float(appear_at[index]), float(disappear_at[index]))


def _thickened(shape: BaseGeometry) -> BaseGeometry:
    """Walls get a thickness; what has an area stays."""
    if shape.area > 0.0:
        return shape
    return shape.buffer(0.5 * WALL_THICKNESS, cap_style="square", join_style="mitre")


def _door(shape: BaseGeometry) -> BaseGeometry:
    """Walls that come or go are thinner, so that they end inside of those that stay."""
    return shape if shape.area > 0.0 else shape.buffer(0.5 * DOOR_THICKNESS, cap_style="flat")


def furniture(outline: BaseGeometry, boards: tuple[float, ...], height: float) -> Float32Array:
    """Triangles (T * 3, 7) of boards on four posts over a rectangle."""
    low_x, low_z, high_x, high_z = outline.bounds
    top = max(height, boards[-1])
    parts = [prism(outline, board, board - BOARD_THICKNESS) for board in boards]
    for x in (low_x, high_x - POST_THICKNESS):
        for z in (low_z, high_z - POST_THICKNESS):
            parts.append(prism(shapely.box(x, z, x + POST_THICKNESS, z + POST_THICKNESS), top))
    return np.concatenate(parts)


def prism(outline: BaseGeometry, height: float, base: float = 0.0) -> Float32Array:
    """Triangles (T * 3, 7) of a prism with a slanted rim at its top, and a bottom if it is off the ground."""
    parts: list[FloatArray] = []
    for polygon in getattr(outline, "geoms", [outline]):
        ring = shapely.geometry.polygon.orient(polygon, -1.0)
        rim = min(BEVEL, 0.25 * (height - base))
        top = ring.buffer(-rim, join_style="mitre")
        if top.is_empty or top.geom_type != "Polygon" or len(top.interiors) != len(ring.interiors):
            top, rim = ring, 0.0
        top = shapely.geometry.polygon.orient(top, -1.0)
        parts.append(_top(top, height))
        if base > 0.0:
            parts.append(_bottom(ring, base))
        for lower, upper in zip(_rings(ring), _rings(top), strict=True):
            parts.append(_band(lower, base, lower, height - rim))
            if rim > 0.0 and len(lower) == len(upper):
                start = np.argmin(((upper[:-1] - lower[0]) ** 2).sum(axis=1))
                turned = np.roll(upper[:-1], -start, axis=0)
                parts.append(_band(lower, height - rim, np.vstack([turned, turned[:1]]), height))
    points = np.concatenate(parts)
    return np.hstack([points, np.full((len(points), 1), height)]).astype(np.float32)


def _rings(polygon: BaseGeometry) -> list[FloatArray]:
    return [np.array(ring.coords) for ring in (polygon.exterior, *polygon.interiors)]


def _top(polygon: BaseGeometry, height: float) -> FloatArray:
    """Triangles of a level surface."""
    rows: list[list[float]] = []
    for triangle in shapely.constrained_delaunay_triangles(polygon).geoms:
        corners = np.array(shapely.geometry.polygon.orient(triangle, -1.0).exterior.coords)[:3]
        rows.extend([x, height, z, 0.0, 1.0, 0.0] for x, z in corners)
    return np.array(rows).reshape(-1, 6)


def _bottom(polygon: BaseGeometry, height: float) -> FloatArray:
    """Triangles of a level surface seen from below."""
    rows = _top(polygon, height).reshape(-1, 3, 6)[:, ::-1].reshape(-1, 6)
    rows[:, 4] = -1.0
    return rows


def _band(low: FloatArray, low_y: float, high: FloatArray, high_y: float) -> FloatArray:
    """Faces between a ring (K, 2) and one above it, with the solid on the right of each edge."""
    a, b = _raised(low[:-1], low_y), _raised(low[1:], low_y)
    c, d = _raised(high[:-1], high_y), _raised(high[1:], high_y)
    normal = np.cross(b - a, c - a)
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    normal /= np.where(length > 0.0, length, 1.0)
    corners = np.stack([a, b, c, b, d, c], axis=1)
    return np.concatenate([corners, np.repeat(normal[:, None], 6, axis=1)], axis=2).reshape(-1, 6)


def _raised(points: FloatArray, y: float) -> FloatArray:
    return np.stack([points[:, 0], np.full(len(points), y), points[:, 1]], axis=1)
