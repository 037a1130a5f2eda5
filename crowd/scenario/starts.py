"""Free places for bodies in an area."""

import math
from collections import defaultdict
from collections.abc import Sequence

import numpy as np

from crowd.scenario.geometry import Ground
from crowd.scenario.schema import Area, Region
from crowd.scenario.table import Point
from crowd_kernels.random import uniform

PURPOSE_START_X = 111
PURPOSE_START_Z = 112
PURPOSE_START_ORDER = 113
CELL = 1.0
ATTEMPTS = 1024
BATCH = 32


def on_circle(region: Region) -> list[Point]:
    """Space the people of a region evenly around its circle, and around wider ones when it is full."""
    assert region.circle is not None
    pitch = 2.0 * region.radius.bounds[1] + region.spacing
    center, radius = region.circle.center, region.circle.radius
    places: list[Point] = []
    while len(places) < region.count:
        left = region.count - len(places)
        # Neighbours are a chord of one pitch apart.
        fitting = (
            math.floor(math.pi / math.asin(pitch / (2.0 * radius)) + 1e-9) if pitch < 2.0 * radius else 1
        )
        count = min(left, fitting)
        for number in range(count):
            angle = 2.0 * math.pi * number / count
            places.append((center[0] + radius * math.sin(angle), center[1] + radius * math.cos(angle)))
        radius += pitch
    return places


class Starts:
    """Places taken so far, in square cells, and ways to find more."""

    def __init__(self, ground: Ground, seed: int) -> None:
        self.ground = ground
        self.seed = seed
        self._cells: dict[tuple[int, int], list[tuple[float, float, float]]] = defaultdict(list)
        self._largest_radius = 0.0

    def take(self, point: Point, radius: float) -> None:
        """Note that a body stands at a point."""
        self._cells[math.floor(point[0] / CELL), math.floor(point[1] / CELL)].append((*point, radius))
        self._largest_radius = max(self._largest_radius, radius)

    def is_free(self, point: Point, radius: float, spacing: float) -> bool:
        """A body fits at a point with a gap to all others."""
        reach = radius + self._largest_radius + spacing
        low_x, high_x = math.floor((point[0] - reach) / CELL), math.floor((point[0] + reach) / CELL)
        low_z, high_z = math.floor((point[1] - reach) / CELL), math.floor((point[1] + reach) / CELL)
        for cell_x in range(low_x, high_x + 1):
            for cell_z in range(low_z, high_z + 1):
                for x, z, other_radius in self._cells.get((cell_x, cell_z), ()):
                    if math.hypot(x - point[0], z - point[1]) < radius + other_radius + spacing:
                        return False
        return True

    def at_random(
        self, area: Area, keys: Sequence[int], radius: Sequence[float], spacing: float
    ) -> list[Point]:
        """Find a random place for each body; the list ends early when there is no more room.

        Parameters
        ----------
        area : Area
        keys : sequence of int
            Key of each person's draws.
        radius : sequence of float
            Body discs, m.
        spacing : float
            Least gap between bodies, m.
        """
        places: list[Point] = []
        for key, r in zip(keys, radius, strict=True):
            point = self._random_place(area, key, r, spacing)
            if point is None:
                break
            self.take(point, r)
            places.append(point)
        return places

    def _random_place(self, area: Area, key: int, radius: float, spacing: float) -> Point | None:
        for first in range(0, ATTEMPTS, BATCH):
            # Few attempts are needed where there is room, so the first batch is small.
            attempts = range(first, first + BATCH) if first else range(4)
            draws = np.array(
                [
                    [
                        uniform(self.seed, key, attempt, purpose)
                        for purpose in (PURPOSE_START_X, PURPOSE_START_Z)
                    ]
                    for attempt in attempts
                ]
            )
            low = np.array([area.x[0] + radius, area.z[0] + radius])
            high = np.array([area.x[1] - radius, area.z[1] - radius])
            if (high < low).any():
                return None
            points = low + draws * (high - low)
            for point, gap in zip(points.tolist(), self.ground.clearance(points).tolist(), strict=True):
                if gap >= radius and self.is_free((point[0], point[1]), radius, spacing):
                    return point[0], point[1]
        return None

    def on_grid(
        self, area: Area, keys: Sequence[int], radius: Sequence[float], spacing: float
    ) -> list[Point]:
        """Put bodies on a loose square grid over the area, in random order of its points.

        Parameters and result are those of `at_random`.
        """
        largest = max(radius)
        width = area.x[1] - area.x[0] - 2 * largest
        depth = area.z[1] - area.z[0] - 2 * largest
        if width < 0 or depth < 0:
            return []
        tightest = 2 * largest + spacing
        # The widest pitch that still has a free point for everybody.
        pitch = max(tightest, math.sqrt((width + tightest) * (depth + tightest) / len(keys)))
        points = self._grid_points(area, largest, spacing, pitch)
        while len(points) < len(keys) and pitch > tightest:
            pitch = max(tightest, 0.98 * pitch)
            points = self._grid_points(area, largest, spacing, pitch)
        order = np.argsort(
            [uniform(self.seed, keys[0], index, PURPOSE_START_ORDER) for index in range(len(points))]
        )
        slack = max(0.0, pitch - tightest)
        places: list[Point] = []
        for index, key, r in zip(order.tolist(), keys, radius, strict=False):
            x, z = points[index]
            shifted = (
                x + slack * (uniform(self.seed, key, 0, PURPOSE_START_X) - 0.5),
                z + slack * (uniform(self.seed, key, 0, PURPOSE_START_Z) - 0.5),
            )
            is_inside = (
                area.x[0] + r <= shifted[0] <= area.x[1] - r and area.z[0] + r <= shifted[1] <= area.z[1] - r
            )
            can_shift = is_inside and self.ground.clearance(np.array([shifted]))[0] >= r
            place = shifted if can_shift and self.is_free(shifted, r, spacing) else (x, z)
            self.take(place, r)
            places.append(place)
        return places

    def _grid_points(self, area: Area, radius: float, spacing: float, pitch: float) -> list[Point]:
        columns = np.arange(area.x[0] + radius, area.x[1] - radius + 1e-9, pitch)
        rows = np.arange(area.z[0] + radius, area.z[1] - radius + 1e-9, pitch)
        points = np.stack([axis.ravel() for axis in np.meshgrid(columns, rows, indexing="ij")], axis=1)
        points = points[self.ground.clearance(points) >= radius]
        return [(x, z) for x, z in points.tolist() if self.is_free((x, z), radius, spacing)]
