"""Trajectories: where some points were at which times."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt
from shapely.geometry.base import BaseGeometry

from crowd.errors import RecordingError, describe

FloatArray = npt.NDArray[np.float64]
LongArray = npt.NDArray[np.int64]

LONGEST_GAP = 2.0
"""Somebody not seen for longer, s, has left and come back."""
FASTEST = 12.0
"""Nobody is faster, m/s: a jump, as where a corridor ends and begins again."""


@dataclass(frozen=True)
class Way:
    """Where one point was, from when it came until it went.

    Attributes
    ----------
    number : int
        As the file names it; a point that leaves and comes back has several ways.
    time : (K,) float64
        Ascending, s.
    position : (K, 2) float64
        Ground points x, z, m.
    """

    number: int
    time: FloatArray
    position: FloatArray


@dataclass(frozen=True)
class Trajectories:
    """What a file of trajectories holds.

    Attributes
    ----------
    name : str
    ways : tuple of Way
        By the time at which they begin.
    area : BaseGeometry or None
        Ground that can be walked on, in x and z, m; None where the file has none.
    """

    name: str
    ways: tuple[Way, ...]
    area: BaseGeometry | None = None

    def __repr__(self) -> str:
        people = len({way.number for way in self.ways})
        times = np.unique(np.concatenate([np.zeros(0), *(way.time for way in self.ways)]))
        seconds = float(np.ptp(times)) if times.size else 0.0
        return f"Trajectories of {self.name}: {people} people, {times.size} frames, {seconds:.2f} s"

    @cached_property
    def first_time(self) -> float:
        """Time of the first sample, s."""
        return min(float(way.time[0]) for way in self.ways)

    @cached_property
    def last_time(self) -> float:
        """Time of the last sample, s."""
        return max(float(way.time[-1]) for way in self.ways)

    def steps(self, way: Way, dt: float) -> tuple[int, int]:
        """First and last step, from 0, of a simulation that begins at the first sample; `dt` in s."""
        first, last = (
            max(round((float(time) - self.first_time) / dt) - 1, 0) for time in (way.time[0], way.time[-1])
        )
        return first, last

    def most_present(self, dt: float) -> int:
        """Largest number of ways that go on in one step of `dt`, s."""
        spans = np.sort([self.steps(way, dt) for way in self.ways], axis=0)
        first, last = spans.T
        return int((np.arange(1, len(first) + 1) - np.searchsorted(last, first, side="left")).max())


def split_into_ways(name: str, number: LongArray, time: FloatArray, position: FloatArray) -> list[Way]:
    """Sort rows by point and time, and cut where somebody was away or jumped.

    Parameters
    ----------
    name : str
        Of the file, for messages.
    number : (R,) int64
    time : (R,) float64
        s.
    position : (R, 2) float64
        x, z, m.
    """
    order = np.lexsort((time, number))
    number, time, position = number[order], time[order], position[order]
    step = np.diff(time)
    is_same = number[1:] == number[:-1]
    twice = np.flatnonzero(is_same & (step <= 0.0))
    if twice.size:
        row = int(twice[0])
        got = f"id {number[row]} at {time[row]:g} s"
        raise RecordingError(describe(name, "holds a point twice at one time", got, "one row for each"))
    length = np.hypot(*np.diff(position, axis=0).T) if len(time) > 1 else np.zeros(0)
    is_cut = ~is_same | (step > LONGEST_GAP) | (length > FASTEST * np.abs(step))
    bounds = np.concatenate([[0], np.flatnonzero(is_cut) + 1, [len(time)]])
    ways = [
        Way(int(number[low]), time[low:high], position[low:high])
        for low, high in zip(bounds[:-1].tolist(), bounds[1:].tolist(), strict=True)
    ]
    return sorted(ways, key=lambda way: (float(way.time[0]), way.number))
