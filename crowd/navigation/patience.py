"""Patience of people who get nowhere: who waits long enough gets, now and then, the right of way."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from crowd.errors import SettingsError, describe
from crowd_kernels.patience import PatienceLimits, rank_waiting_crowd

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int32]


@dataclass(frozen=True)
class PatienceSettings:
    """When people insist; every field can be set in a scenario."""

    memory: float = 1.0
    """Time over which progress is averaged, s, 0.1 to 10. A larger value notices a jam later."""
    least_progress: float = 0.3
    """Share of the preferred speed below which a person waits, 0 to 1. A larger value makes slow queues
    insist too."""
    patience: float = 1.0
    """Waiting time after which right of way is drawn, s, 0 to 60."""
    turn_time: float = 2.0
    """Time for which a rank is kept, s, 0.2 to 60. A larger value lets people through longer ways and makes
    others wait longer."""
    spread: float = 14.0
    """Logarithm of the ratio between the largest and the smallest responsibility, 0 (no right of way) to 20.
    With a larger value fewer pairs share an avoidance."""
    sidestep_after: float = 8.0
    """Waiting time after which a person also tries other directions, s, 0 to 600."""
    sidestep_angle: float = 1.0
    """Largest angle of these directions to the way, rad, 0 to 3.1416."""

    def __post_init__(self) -> None:
        """Refuse values outside the documented ranges."""
        for name, (low, high) in _RANGES.items():
            value = getattr(self, name)
            if not low <= value <= high:
                allowed = f"{low:g} to {high:g}"
                raise SettingsError(describe(f"patience.{name}", "out of range", value, allowed))


_RANGES: dict[str, tuple[float, float]] = {
    "memory": (0.1, 10.0),
    "least_progress": (0.0, 1.0),
    "patience": (0.0, 60.0),
    "turn_time": (0.2, 60.0),
    "spread": (0.0, 20.0),
    "sidestep_after": (0.0, 600.0),
    "sidestep_angle": (0.0, math.pi),
}


class Patience:
    """Progress and waiting times of a crowd.

    Parameters
    ----------
    capacity : int
        Length N of all arrays.
    settings : PatienceSettings, optional
    """

    def __init__(self, capacity: int, settings: PatienceSettings | None = None) -> None:
        self.settings = settings or PatienceSettings()
        self.last_position_world: FloatArray = np.full((capacity, 3), np.inf)
        self.progress: FloatArray = np.ones(capacity)
        self.waiting: FloatArray = np.zeros(capacity)
        self._limits = PatienceLimits(
            self.settings.memory,
            self.settings.least_progress,
            self.settings.patience,
            self.settings.turn_time,
            self.settings.spread,
            self.settings.sidestep_after,
            self.settings.sidestep_angle,
        )

    def state_fields(self) -> dict[str, FloatArray]:
        """Arrays that change in a run, by name."""
        return {
            "last_position_world": self.last_position_world,
            "progress": self.progress,
            "waiting": self.waiting,
        }

    def update(
        self,
        position_world: FloatArray,
        preferred_velocity_world: FloatArray,
        active: IntArray,
        dt: float,
        seed: int,
        step: int,
        responsibility: FloatArray,
        mobility: FloatArray,
    ) -> None:
        """Rank those who wait, once a step before steering.

        Parameters
        ----------
        position_world : (N, 3) float64
            m.
        preferred_velocity_world : (N, 3) float64
            In and out, m/s; turned for those who have waited very long.
        active : (A,) int32
        dt : float
            s.
        seed, step : int
            Keys of the ranks.
        responsibility, mobility : (N,) float64
            In and out, in rows of `active`: reduced for those who wait and have a high rank. The caller sets
            both to their normal values before each step.
        """
        rank_waiting_crowd(
            position_world,
            active,
            self._limits,
            dt,
            seed,
            step,
            self.last_position_world,
            self.progress,
            self.waiting,
            preferred_velocity_world,
            responsibility,
            mobility,
        )
