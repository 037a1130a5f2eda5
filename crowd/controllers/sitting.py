"""Sitting, between idle and locomotion: people sit down on seats, stay there and stand up again."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from crowd.controllers.controller import KeySamples, Step
from crowd.motion.easing import minimum_jerk
from crowd.state import IntArray, State


@dataclass(frozen=True)
class SittingSettings:
    """How people sit."""

    clip: str = "sit_down"
    """Clip from standing to sitting; standing up is the same backwards."""
    ease: float = 0.35
    """s, > 0. Start of the clip in which it takes over from idle standing."""


class Sitting:
    """Writes the whole body of everyone who sits, sits down or stands up."""

    state_fields: ClassVar[tuple[str, ...]] = ("is_seated", "sitting_time")

    def __init__(self, capacity: int, settings: SittingSettings | None = None) -> None:
        self.settings = settings or SittingSettings()
        self._samples = KeySamples.create(capacity, 1)

    def activate(self, state: State, characters: IntArray) -> None:
        """Start people standing."""
        state.is_seated[characters] = False
        state.sitting_time[characters] = 0.0

    def sit(self, state: State, characters: IntArray) -> None:
        """Let people sit down on the seat behind them."""
        state.is_seated[characters] = True

    def stand(self, state: State, characters: IntArray) -> None:
        """Let people stand up."""
        state.is_seated[characters] = False

    def seconds(self, step: Step) -> float:
        """Time that sitting down takes, s."""
        table = step.model.clip_table
        clip = table.index(self.settings.clip)
        return float(table.key_count[clip] - 1) / float(table.key_rate[clip])

    def evaluate(self, step: Step) -> None:
        """Advance those who sit down or stand up, and write the pose of all who do not stand."""
        state, table = step.state, step.model.clip_table
        sitting = step.active[state.is_off_feet[step.active]]
        if sitting.size == 0:
            return
        clip = table.index(self.settings.clip)
        last = int(table.key_count[clip]) - 1
        rate = float(table.key_rate[clip])
        direction = np.where(state.is_seated[sitting], 1.0, -1.0)
        time = np.clip(state.sitting_time[sitting] + direction * step.dt, 0.0, last / rate)
        state.sitting_time[sitting] = time
        place = np.minimum(time * rate, last - 1e-6)
        key = place.astype(np.int32)
        samples = self._samples
        samples.frame[sitting, 0] = table.first_key[clip] + key
        samples.next_frame[sitting, 0] = table.first_key[clip] + key + 1
        samples.fraction[sitting, 0] = place - key
        samples.weight[sitting, 0] = 1.0
        samples.layer_weight[sitting] = minimum_jerk(time / self.settings.ease)
        samples.mask_index[sitting] = table.mask_index[clip]
        samples.blend_onto_pose(step, sitting)
