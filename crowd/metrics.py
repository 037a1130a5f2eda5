"""Figures of a run: bodies against bodies and walls, feet that slip, motion against command.

The same code measures a running simulation and a recording. All keys are those of the table in the README.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
import shapely
from scipy.spatial import cKDTree

from crowd.hand_metrics import HandMetrics
from crowd_kernels.gait import HEEL

if TYPE_CHECKING:
    from crowd.recording import Recording
    from crowd.simulation import Simulation

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]

SAMPLE_PERIOD = 0.1
"""Bodies are compared with each other and with walls at these intervals, s."""
WINDOW = 1.0
"""Realised and commanded motion are compared over windows of this length, s."""
STEADY_SPEED = 0.05
"""A command that changes less than this over a window is steady, m/s."""
STEADY_TURN = 0.05
"""The same for the turn rate, rad/s."""
SLOWEST = 0.3
"""Speeds below this are too small for a relative error, m/s."""
SHORTEST_STANCE = 0.05
"""Contacts shorter than this are no stances, s."""
FULL_TURN = 2.0 * np.pi


@dataclass(frozen=True)
class Observation:
    """One frame as metrics see it; arrays as in `State`."""

    time: float
    is_active: BoolArray
    is_finished: BoolArray
    spawn_count: npt.NDArray[np.integer[Any]]
    position_world: FloatArray
    yaw: FloatArray
    radius: FloatArray
    locomotion_parameter: FloatArray
    locomotion_weight: FloatArray
    foot_contact: npt.NDArray[np.uint8]
    foot_point_world: FloatArray
    obstacles: shapely.STRtree
    deepest_overlap: float


class Histogram:
    """Counts of values, for percentiles in bounded memory; bins of equal width, exact mean and maximum."""

    def __init__(self, width: float, largest: float) -> None:
        self._width = width
        self._counts = np.zeros(int(np.ceil(largest / width)) + 1, np.int64)
        self.count = 0
        self.total = 0.0
        self.maximum = 0.0

    def add(self, values: FloatArray, weight: int = 1) -> None:
        """Count values, each `weight` times."""
        if values.size == 0:
            return
        bins = np.minimum((values / self._width).astype(np.int64), len(self._counts) - 1)
        np.add.at(self._counts, bins, weight)
        self.count += weight * values.size
        self.total += weight * float(values.sum())
        self.maximum = max(self.maximum, float(values.max()))

    @property
    def mean(self) -> float:
        """Mean of all values; 0 without any."""
        return self.total / self.count if self.count else 0.0

    def percentile(self, share: float) -> float:
        """Upper end of the bin below which a share of the values lies, at most the maximum."""
        if self.count == 0:
            return 0.0
        index = int(np.searchsorted(np.cumsum(self._counts), share * self.count))
        return min((index + 1) * self._width, self.maximum)


class Metrics:
    """Accumulates figures frame by frame; memory does not grow with the length of a run."""

    def __init__(self) -> None:
        self._bodies = BodyMetrics()
        self._feet = FootMetrics()
        self._motion = MotionMetrics()
        self._hands = HandMetrics()
        self._tasks: dict[str, float | int] = {}
        self._entered = 0
        self._finished = 0
        self._last_time: float | None = None

    def observe(self, simulation: Simulation) -> None:
        """Take the state after a step into account."""
        state, model = simulation.state, simulation.model
        if simulation.bodies == "people":
            self._hands.observe(simulation)
            self._tasks = simulation.tasks.figures()
        self.add(
            Observation(
                simulation.time + simulation.dt,
                state.is_active,
                state.is_finished,
                state.spawn_count,
                state.position_world,
                state.yaw,
                model.radius,
                state.locomotion_parameter,
                state.locomotion_weight,
                state.foot_contact,
                state.foot_point_world,
                model.world.tree,
                simulation.navigator.deepest_overlap,
            )
        )

    def add(self, frame: Observation) -> None:
        """Take one frame into account."""
        self._bodies.add(frame)
        self._feet.add(frame)
        self._motion.add(frame)
        has_entered = frame.spawn_count > 0
        self._entered = int(has_entered.sum())
        self._finished = int((frame.is_finished & has_entered).sum())

    def as_dict(self) -> dict[str, float | int]:
        """All figures that the run exercised, by dotted key."""
        result: dict[str, float | int] = {}
        if self._entered:
            result["finished"] = self._finished / self._entered
        parts = (self._bodies, self._feet, self._motion, self._hands)
        for part in parts:
            result |= part.as_dict()
        return result | self._tasks


class BodyMetrics:
    """Overlap of body discs with each other and with walls, and walls that were crossed."""

    def __init__(self) -> None:
        self._overlap = Histogram(1e-4, 1.0)
        self._deepest_overlap = 0.0
        self._deepest_wall = 0.0
        self._crossings = 0
        self._has_walls = False
        self._next_sample = 0.0
        self._last_position: FloatArray | None = None
        self._last_spawn: npt.NDArray[np.integer[Any]] | None = None

    def add(self, frame: Observation) -> None:
        """Note the deepest overlap of the frame; compare everything at each sample."""
        self._deepest_overlap = max(self._deepest_overlap, frame.deepest_overlap)
        if frame.time + 1e-9 < self._next_sample:
            return
        self._next_sample = frame.time + SAMPLE_PERIOD
        rows = np.flatnonzero(frame.is_active)
        position, radius = frame.position_world[rows][:, [0, 2]], frame.radius[rows]
        self._add_overlaps(position, radius)
        if len(frame.obstacles.geometries):
            self._has_walls = True
            self._add_walls(frame, rows, position, radius)
        self._last_position = frame.position_world[:, [0, 2]].copy()
        self._last_spawn = np.where(frame.is_active, frame.spawn_count, -1)

    def _add_overlaps(self, position: FloatArray, radius: FloatArray) -> None:
        depth = np.zeros(len(position))
        if len(position) > 1:
            pairs = cKDTree(position).query_pairs(2.0 * float(radius.max()), output_type="ndarray")
            first, second = pairs[:, 0], pairs[:, 1]
            gap = np.hypot(*(position[first] - position[second]).T)
            pair_depth = np.maximum(radius[first] + radius[second] - gap, 0.0)
            np.maximum.at(depth, first, pair_depth)
            np.maximum.at(depth, second, pair_depth)
        self._overlap.add(depth)

    def _add_walls(
        self, frame: Observation, rows: npt.NDArray[np.intp], position: FloatArray, radius: FloatArray
    ) -> None:
        if len(rows) == 0:
            return
        (asked, _), gap = frame.obstacles.query_nearest(
            shapely.points(position),
            max_distance=float(radius.max()),
            return_distance=True,
            all_matches=False,
        )
        if len(asked):
            self._deepest_wall = max(self._deepest_wall, float((radius[asked] - gap).max()))
        if self._last_position is None or self._last_spawn is None:
            return
        stayed = self._last_spawn[rows] == frame.spawn_count[rows]
        before = self._last_position[rows[stayed]]
        ways = shapely.linestrings(np.stack([before, position[stayed]], axis=1))
        crossed, _ = frame.obstacles.query(ways, predicate="intersects")
        self._crossings += len(np.unique(crossed))

    def as_dict(self) -> dict[str, float | int]:
        """Figures by key."""
        deepest = max(self._deepest_overlap, self._overlap.maximum)
        result: dict[str, float | int] = {
            "overlap.max_depth_m": deepest,
            "overlap.p99_depth_m": self._overlap.percentile(0.99),
        }
        if self._has_walls:
            result |= {"wall.max_depth_m": max(self._deepest_wall, 0.0), "wall.crossings": self._crossings}
        return result


class FootMetrics:
    """Net drift of planted feet: of the heel until the foot is flat, then of the ball."""

    def __init__(self) -> None:
        self._drift = Histogram(1e-5, 1.0)
        self._contact: npt.NDArray[np.uint8] = np.zeros((0, 2), np.uint8)
        self._spawn: npt.NDArray[np.integer[Any]] = np.zeros(0, np.int64)
        self._point: FloatArray = np.zeros((0, 2, 2, 3))
        self._anchor: FloatArray = np.zeros((0, 2, 2))
        self._total: FloatArray = np.zeros((0, 2))
        self._since: FloatArray = np.zeros((0, 2))
        self._time = 0.0

    def add(self, frame: Observation) -> None:
        """Follow every planted foot: nothing is to be done while its contact stays what it is."""
        contact = frame.foot_contact * frame.is_active[:, None]
        if len(self._contact) == 0:
            self._contact = np.zeros_like(contact)
            self._spawn = frame.spawn_count.copy()
            self._point = frame.foot_point_world.copy()
            self._anchor = np.zeros((*contact.shape, 2))
            self._total, self._since = np.zeros(contact.shape), np.zeros(contact.shape)
        is_other = frame.spawn_count != self._spawn
        rows, feet = np.nonzero((contact != self._contact) | is_other[:, None])
        before, now = self._contact[rows, feet], contact[rows, feet]
        ended = before > 0
        self._total[rows[ended], feet[ended]] += self._drift_of(rows[ended], feet[ended])
        over = ended & ((now == 0) | is_other[rows])
        self._count_stances(rows[over], feet[over])
        began = now > 0
        fresh = began & ((before == 0) | is_other[rows])
        self._total[rows[fresh], feet[fresh]] = 0.0
        self._since[rows[fresh], feet[fresh]] = frame.time
        np.copyto(self._point, frame.foot_point_world)
        self._contact, self._time = contact, frame.time
        self._spawn = frame.spawn_count.copy()
        self._anchor[rows[began], feet[began]] = self._planted_point(rows[began], feet[began])

    def _planted_point(self, rows: npt.NDArray[np.intp], feet: npt.NDArray[np.intp]) -> FloatArray:
        """Where heel or ball of planted feet were in the last frame, x and z, m. (K, 2)"""
        part = (self._contact[rows, feet] != HEEL).astype(np.intp)
        return np.asarray(self._point[rows, feet, part][:, [0, 2]])

    def _drift_of(self, rows: npt.NDArray[np.intp], feet: npt.NDArray[np.intp]) -> FloatArray:
        """How far planted feet have come from where their contact began, m. (K,)"""
        away = self._planted_point(rows, feet) - self._anchor[rows, feet]
        return np.asarray(np.hypot(away[:, 0], away[:, 1]))

    def _count_stances(self, rows: npt.NDArray[np.intp], feet: npt.NDArray[np.intp]) -> None:
        lasting = self._time - self._since[rows, feet] >= SHORTEST_STANCE
        self._drift.add(self._total[rows[lasting], feet[lasting]])

    def as_dict(self) -> dict[str, float | int]:
        """Figures by key; feet that are still planted count as they stand."""
        everything = Histogram(1e-5, 1.0)
        everything._counts[:] = self._drift._counts
        everything.count, everything.total = self._drift.count, self._drift.total
        everything.maximum = self._drift.maximum
        planted = np.nonzero((self._contact > 0) & (self._time - self._since >= SHORTEST_STANCE))
        everything.add(self._total[planted] + self._drift_of(*planted))
        if everything.count == 0:
            return {}
        return {
            "foot_slip.mean_m": everything.mean,
            "foot_slip.p95_m": everything.percentile(0.95),
            "foot_slip.max_m": everything.maximum,
            "foot_slip.stances": everything.count,
        }


class MotionMetrics:
    """Realised motion of the root against the command, over windows in which the command is steady."""

    def __init__(self) -> None:
        self._begin: float | None = None
        self._time = 0.0
        self._position: FloatArray = np.zeros((0, 3))
        self._yaw: FloatArray = np.zeros(0)
        self._spawn: npt.NDArray[np.integer[Any]] = np.zeros(0, np.int64)
        self._path: FloatArray = np.zeros(0)
        self._turn: FloatArray = np.zeros(0)
        self._asked_path: FloatArray = np.zeros(0)
        self._asked_turn: FloatArray = np.zeros(0)
        self._lowest: FloatArray = np.zeros((0, 3))
        self._highest: FloatArray = np.zeros((0, 3))
        self._is_steady: BoolArray = np.zeros(0, np.bool_)
        self._windows = 0
        self._speed_windows = 0
        self._speed_square = 0.0
        self._turn_square = 0.0

    def add(self, frame: Observation) -> None:
        """Extend the window, and judge it when it is full."""
        if self._begin is None:
            self._start(frame)
            return
        step = frame.position_world - self._position
        self._path += np.hypot(step[:, 0], step[:, 2])
        turned = frame.yaw - self._yaw
        self._turn += turned - FULL_TURN * np.round(turned / FULL_TURN)
        self._position, self._yaw = frame.position_world.copy(), frame.yaw.copy()
        dt = frame.time - self._time
        self._time = frame.time
        parameter = frame.locomotion_parameter
        speed = np.hypot(parameter[:, 0], parameter[:, 2])
        self._asked_path += dt * speed
        self._asked_turn += dt * parameter[:, 1]
        np.minimum(self._lowest, parameter, out=self._lowest)
        np.maximum(self._highest, parameter, out=self._highest)
        self._is_steady &= frame.is_active & (frame.locomotion_weight >= 1.0)
        self._is_steady &= frame.spawn_count == self._spawn
        if self._time - self._begin >= WINDOW - 1e-9:
            self._judge()
            self._start(frame)

    def _start(self, frame: Observation) -> None:
        count = len(frame.yaw)
        self._begin = self._time = frame.time
        self._position, self._yaw = frame.position_world.copy(), frame.yaw.copy()
        self._spawn = frame.spawn_count.copy()
        self._path, self._turn = np.zeros(count), np.zeros(count)
        self._asked_path, self._asked_turn = np.zeros(count), np.zeros(count)
        self._lowest = frame.locomotion_parameter.copy()
        self._highest = frame.locomotion_parameter.copy()
        self._is_steady = frame.is_active & (frame.locomotion_weight >= 1.0)

    def _judge(self) -> None:
        assert self._begin is not None
        length = self._time - self._begin
        change = self._highest - self._lowest
        limit = np.array([STEADY_SPEED, STEADY_TURN, STEADY_SPEED])
        steady = self._is_steady & (change < limit).all(axis=1)
        turn_error = (self._turn - self._asked_turn)[steady] / length
        self._windows += int(steady.sum())
        self._turn_square += float((turn_error**2).sum())
        walking = steady & (self._asked_path > SLOWEST * length)
        relative = self._path[walking] / self._asked_path[walking] - 1.0
        self._speed_windows += int(walking.sum())
        self._speed_square += float((relative**2).sum())

    def as_dict(self) -> dict[str, float | int]:
        """Figures by key."""
        result: dict[str, float | int] = {}
        if self._speed_windows:
            result["locomotion.speed_rms_relative"] = float(np.sqrt(self._speed_square / self._speed_windows))
        if self._windows:
            result["locomotion.turn_rms_deg_s"] = float(
                np.degrees(np.sqrt(self._turn_square / self._windows))
            )
            result["locomotion.windows"] = self._windows
        return result


def measure(recording: Recording | str | os.PathLike[str]) -> dict[str, float | int]:
    """Compute the figures of a recorded run.

    Parameters
    ----------
    recording : Recording or path
        The finer it is, the closer the figures are to those of the run itself: contacts and overlaps between
        two recorded frames are not seen.

    Returns
    -------
    dict
        As `Metrics.as_dict`.

    Raises
    ------
    RecordingError
        The file is not a recording.
    """
    from crowd.recording import Recording

    if not isinstance(recording, Recording):
        with Recording(recording) as opened:
            return measure(opened)
    metrics = Metrics()
    lines = (
        shapely.linestrings(recording.walls[:, :, [0, 2]]) if len(recording.walls) else np.zeros(0, object)
    )
    present: BoolArray | None = None
    for time, fields in recording.frames():
        is_there = (recording.wall_appear_at <= time) & (time < recording.wall_disappear_at)
        if present is None or not np.array_equal(is_there, present):
            present, tree = is_there, shapely.STRtree(list(lines[is_there]))
        metrics.add(
            Observation(
                time,
                fields["is_active"],
                fields["is_finished"],
                fields["spawn_count"],
                fields["position_world"],
                fields["yaw"],
                recording.radius,
                fields["locomotion_parameter"].astype(np.float64),
                fields["locomotion_weight"],
                fields["foot_contact"],
                fields["foot_point_world"].astype(np.float64),
                tree,
                0.0,
            )
        )
    return metrics.as_dict()
