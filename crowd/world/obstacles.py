"""Shapes that block the ground."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import shapely
from shapely.geometry.base import BaseGeometry

FloatArray = npt.NDArray[np.float64]
Point = tuple[float, float]


@dataclass(frozen=True)
class Box:
    """A rectangle along the axes, m."""

    xmin: float
    xmax: float
    zmin: float
    zmax: float
    height: float = 2.5
    has_boards: bool = False
    """What lies in it can be reached from outside, as in a shelf."""

    def outline(self) -> FloatArray:
        """Corners in order, (4, 2)."""
        x = (self.xmin, self.xmax, self.xmax, self.xmin)
        z = (self.zmin, self.zmin, self.zmax, self.zmax)
        return np.array([x, z], dtype=np.float64).T

    def geometry(self) -> BaseGeometry:
        """The blocked ground."""
        return shapely.box(self.xmin, self.zmin, self.xmax, self.zmax)


@dataclass(frozen=True)
class Polygon:
    """A solid polygon; corners in order, either way round, m."""

    points: Sequence[Point]
    height: float = 2.5

    def __post_init__(self) -> None:
        shape = shapely.Polygon(self.points)
        if not shape.is_valid:
            raise ValueError(f"polygon: {shapely.is_valid_reason(shape)}; allowed edges that do not cross")

    def outline(self) -> FloatArray:
        """Corners in order, (K, 2)."""
        return np.array(self.points, dtype=np.float64)

    def geometry(self) -> BaseGeometry:
        """The blocked ground."""
        return shapely.Polygon(self.points)


@dataclass(frozen=True)
class Wall:
    """A thin wall between two points, m."""

    start: Point
    end: Point
    height: float = 2.5

    def __post_init__(self) -> None:
        if not math.dist(self.start, self.end) > 0:
            raise ValueError(f"wall: both ends are at {self.start}; allowed two different points")

    def outline(self) -> FloatArray:
        """Both ends, (2, 2)."""
        return np.array([self.start, self.end], dtype=np.float64)

    def geometry(self) -> BaseGeometry:
        """The blocked ground."""
        return shapely.LineString([self.start, self.end])


Shape = Box | Polygon | Wall
