"""SteerBench scores: the classic ones at 20 Hz, and ones that do not depend on the step.

Definitions: Singh, Kapadia, Faloutsos, Reinman, "SteerBench: a benchmark suite for evaluating steering
behaviors", 2009, as its 1.3 release computes them. Lower is better.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import shapely
from scipy.spatial import cKDTree

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]

CLASSIC_RATE = 20.0
"""The suite's own clock, Hz."""
COLLISION_WEIGHT = 50.0
BEGIN_DEPTH = 0.001
"""A collision of the step-free scores begins deeper than this, m."""
END_GAP = 0.01
"""It ends when the gap is wider than this, m."""


@dataclass(frozen=True)
class Scores:
    """Means over all characters.

    Attributes
    ----------
    composite_01 : float
        50 collisions + time + sum over frames of kinetic energy.
    composite_02 : float
        The same and the sum over frames of acceleration.
    collisions, seconds : float
        Unique collisions and time in the scene.
    """

    composite_01: float
    composite_02: float
    collisions: float
    seconds: float


class Score:
    """Accumulates one kind of score frame by frame.

    Parameters
    ----------
    radius : (N,) float64
        Discs, m.
    begin_depth, end_gap : float
        Hysteresis of collisions, m; 0 for the classic scores.
    """

    def __init__(
        self, radius: FloatArray, begin_depth: float, end_gap: float, obstacles: shapely.STRtree
    ) -> None:
        self._radius = radius
        self._begin_depth = begin_depth
        self._end_gap = end_gap
        self._obstacles = obstacles
        count = len(radius)
        self._position: FloatArray | None = None
        self._velocity = np.zeros((count, 2))
        self._frames = np.zeros(count, np.int64)
        self._energy = np.zeros(count)
        self._change = np.zeros(count)
        self._seconds = np.zeros(count)
        self._collisions = np.zeros(count, np.int64)
        self._touching: set[tuple[int, int]] = set()
        self.deepest = 0.0
        """Deepest penetration so far, m."""

    def add(self, position: FloatArray, is_enabled: BoolArray, dt: float) -> None:
        """Take a frame into account.

        Parameters
        ----------
        position : (N, 2) float64
            Ground points after the frame, m.
        is_enabled : (N,) bool
            In the scene after the frame; the frame in which somebody leaves is not measured.
        dt : float
            Length of the frame, s.
        """
        if self._position is None:
            self._position = position.copy()
            return
        velocity = (position - self._position) / dt
        has_two = is_enabled & (self._frames > 0)
        change = np.hypot(*(velocity - self._velocity).T)
        self._change[has_two] += change[has_two]
        self._energy[is_enabled] += 0.5 * (velocity[is_enabled] ** 2).sum(axis=1) * dt
        self._seconds[is_enabled] += dt
        self._frames[is_enabled] += 1
        self._velocity, self._position = velocity, position.copy()
        self._count_collisions(position, np.flatnonzero(is_enabled))

    def _count_collisions(self, position: FloatArray, rows: npt.NDArray[np.intp]) -> None:
        """Count entries into penetration of discs with each other and with obstacles."""
        depths: dict[tuple[int, int], float] = {}
        here, radius = position[rows], self._radius[rows]
        if len(rows) > 1:
            pairs = cKDTree(here).query_pairs(
                2.0 * float(radius.max()) + self._end_gap, output_type="ndarray"
            )
            gap = np.hypot(*(here[pairs[:, 0]] - here[pairs[:, 1]]).T)
            depth = radius[pairs].sum(axis=1) - gap
            depths |= {
                (int(rows[a]), int(rows[b])): d for (a, b), d in zip(pairs, depth.tolist(), strict=True)
            }
        if len(rows) and len(self._obstacles.geometries):
            near, obstacle = self._obstacles.query(
                shapely.points(here), predicate="dwithin", distance=radius + self._end_gap
            )
            if len(near):
                gap = shapely.distance(shapely.points(here[near]), self._obstacles.geometries.take(obstacle))
                depth = radius[near] - gap
                depths |= {
                    (int(rows[a]), -1 - int(b)): d
                    for a, b, d in zip(near, obstacle, depth.tolist(), strict=True)
                }
        still = {pair for pair in self._touching if depths.get(pair, -np.inf) > -self._end_gap}
        begun = {pair for pair, depth in depths.items() if depth > self._begin_depth} - still
        for first, second in begun:
            self._collisions[first] += 1
            if second >= 0:
                self._collisions[second] += 1
        self._touching = still | begun
        self.deepest = max(self.deepest, max(depths.values(), default=0.0))

    def scores(self, sum_scale: float = CLASSIC_RATE) -> Scores:
        """Means over all characters; sums over frames are taken at `sum_scale` frames a second."""
        collisions = float(self._collisions.mean())
        seconds = float(self._seconds.mean())
        first = COLLISION_WEIGHT * collisions + seconds + sum_scale * float(self._energy.mean())
        return Scores(first, first + sum_scale * float(self._change.mean()), collisions, seconds)


class SteerBenchScores:
    """Both kinds of scores of one run.

    The classic one samples positions at exactly 20 Hz, interpolated linearly where steps do not fit.
    """

    def __init__(self, radius: FloatArray, obstacles: shapely.STRtree) -> None:
        self._classic = Score(radius, 0.0, 0.0, obstacles)
        self._step_free = Score(radius, BEGIN_DEPTH, END_GAP, obstacles)
        self._time = 0.0
        self._next_sample = 0.0
        self._position: FloatArray | None = None

    def add(self, time: float, position: FloatArray, is_enabled: BoolArray) -> None:
        """Take the state at a time into account; the first call gives the start."""
        self._step_free.add(position, is_enabled, time - self._time if time > self._time else 1.0)
        while self._next_sample <= time + 1e-9:
            share = 1.0
            if self._position is not None and time > self._time:
                share = (self._next_sample - self._time) / (time - self._time)
            before = position if self._position is None else self._position
            self._classic.add(before + share * (position - before), is_enabled, 1.0 / CLASSIC_RATE)
            self._next_sample += 1.0 / CLASSIC_RATE
        self._time, self._position = time, position.copy()

    @property
    def classic(self) -> Scores:
        """Scores as the suite computes them at 20 Hz."""
        return self._classic.scores()

    @property
    def step_free(self) -> Scores:
        """Scores with integrals instead of sums over frames; equal to the classic ones for smooth motion."""
        return self._step_free.scores()

    @property
    def deepest(self) -> float:
        """Deepest penetration, m."""
        return self._step_free.deepest
