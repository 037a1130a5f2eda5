"""When which clips are played: at given times, and now and then as gestures.

The schedule is a pure function of time and seed, so nothing of it needs to be saved with a run.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from crowd.scenario.schema import GoalList, Scenario
from crowd_kernels.random import uniform

PURPOSE_GESTURE_TIME = 121
PURPOSE_GESTURE_CLIP = 122
PURPOSE_PLAY_SHARE = 123

IntArray = npt.NDArray[np.int64]


@dataclass(frozen=True)
class Gesturing:
    """Characters that play one of some clips now and then.

    Attributes
    ----------
    characters : (C,) int64
        Rows.
    clips : tuple of str
    period : float
        Each of these spans of time holds one gesture of each character, s.
    """

    characters: IntArray
    clips: tuple[str, ...]
    period: float


@dataclass(frozen=True)
class TimedPlay:
    """A clip played once by some characters."""

    time: float
    characters: IntArray
    clip: str


@dataclass(frozen=True)
class PlaySchedule:
    """All plays of a run."""

    seed: int
    gesturing: tuple[Gesturing, ...]
    timed: tuple[TimedPlay, ...]

    @property
    def clips(self) -> frozenset[str]:
        """Names of all clips that may be played."""
        return frozenset(clip for group in self.gesturing for clip in group.clips) | {
            play.clip for play in self.timed
        }

    def between(self, start: float, end: float) -> list[tuple[str, IntArray]]:
        """Plays that begin at times in (start, end], s; at time 0 in a first step that starts at 0.

        Returns
        -------
        list of (str, (C,) int64)
            Clip and characters, in a fixed order.
        """
        found: list[tuple[str, IntArray]] = []
        for play in self.timed:
            if start < play.time <= end or start == play.time == 0.0:
                found.append((play.clip, play.characters))
        for group in self.gesturing:
            found.extend(self._gestures(group, start, end))
        return found

    def _gestures(self, group: Gesturing, start: float, end: float) -> list[tuple[str, IntArray]]:
        chosen: dict[str, list[int]] = {}
        for span in range(math.floor(start / group.period), math.floor(end / group.period) + 1):
            for row in group.characters.tolist():
                time = (span + float(uniform(self.seed, row, span, PURPOSE_GESTURE_TIME))) * group.period
                if start < time <= end:
                    pick = float(uniform(self.seed, row, span, PURPOSE_GESTURE_CLIP))
                    chosen.setdefault(group.clips[int(pick * len(group.clips))], []).append(row)
        return [(clip, np.array(rows, np.int64)) for clip, rows in sorted(chosen.items())]


def build_plays(
    scenario: Scenario, seed: int, members: Mapping[str, Sequence[int]], character_count: int
) -> PlaySchedule:
    """Collect the plays of a scenario.

    Parameters
    ----------
    scenario : Scenario
    seed : int
    members : mapping of str to rows
        Rows of each name, and of each table as ``"regions[2]"``.
    character_count : int
        Rows in all.
    """
    gesturing: list[Gesturing] = []
    for table in ("characters", "regions", "flows"):
        owners: tuple[GoalList, ...] = getattr(scenario, table)
        for index, owner in enumerate(owners):
            rows = members.get(f"{table}[{index}]", ())
            if owner.gestures and rows:
                gesturing.append(Gesturing(np.array(rows, np.int64), owner.gestures, owner.gesture_every))
    timed: list[TimedPlay] = []
    for index, play in enumerate(scenario.plays):
        rows = members.get(play.who, ()) if play.who is not None else range(character_count)
        drawn = [row for row in rows if uniform(seed, row, index, PURPOSE_PLAY_SHARE) < play.share]
        timed.append(TimedPlay(play.at, np.array(drawn, np.int64), play.clip))
    return PlaySchedule(seed, tuple(gesturing), tuple(timed))
