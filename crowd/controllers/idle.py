"""Layer 2, idle: standing, with variations."""

from dataclasses import dataclass
from typing import ClassVar

from crowd.controllers.controller import KeySamples, Step
from crowd.state import IntArray, State
from crowd_kernels.layers import idle_crowd


@dataclass(frozen=True)
class IdleSettings:
    """How people stand."""

    crossfade: float = 1.4
    """s, > 0. Length of the passage from one idle variation to the next."""
    shortest_dwell: float = 5.0
    """s, >= crossfade. Least time with one variation."""
    longest_dwell: float = 14.0
    """s. Greatest time with one variation; larger: calmer crowds."""


class Idle:
    """Writes the whole body of everyone who is not fully moving."""

    state_fields: ClassVar[tuple[str, ...]] = ("idle_clip", "idle_time", "idle_mix", "idle_until")

    def __init__(self, capacity: int, settings: IdleSettings | None = None) -> None:
        self.settings = settings or IdleSettings()
        self._samples = KeySamples.create(capacity, 2)

    def activate(self, state: State, characters: IntArray) -> None:
        """Start people in the neutral variation, each at its own time of it."""
        state.idle_clip[characters] = 0
        offset = (characters * 0.61803398875) % 1.0
        state.idle_time[characters] = 10.0 * offset[:, None]
        state.idle_until[characters] = self.settings.longest_dwell * offset

    def evaluate(self, step: Step) -> None:
        """Advance the idle clocks of standing people and write their pose."""
        state, table = step.state, step.model.clip_table
        standing = step.active[state.locomotion_weight[step.active] < 1.0]
        if standing.size == 0:
            return
        samples = self._samples
        idle_crowd(
            step.model.idle_clips,
            table.first_key,
            table.key_count,
            table.key_rate,
            standing,
            step.seed,
            step.index,
            step.time,
            step.dt,
            self.settings.crossfade,
            self.settings.shortest_dwell,
            self.settings.longest_dwell,
            state.idle_clip,
            state.idle_time,
            state.idle_mix,
            state.idle_until,
            samples.frame,
            samples.next_frame,
            samples.fraction,
            samples.weight,
        )
        samples.blend_onto_pose(step, standing)
