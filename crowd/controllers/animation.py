"""Layer 4, animation: clips played over the pose, on the whole body or on the joints of a mask."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from crowd.controllers.controller import KeySamples, Step
from crowd.state import IntArray, State
from crowd_kernels.layers import play_crowd


@dataclass(frozen=True)
class AnimationSettings:
    """How played clips come and go."""

    ease_rate: float = 9.0
    """1/s, > 0. Rate of the critically damped fade; larger: quicker, less soft."""
    fade_time: float = 0.45
    """s, > 0. A clip starts to fade out this long before its end."""


class Animation:
    """Plays one clip at a time on each character; a new play eases over from the present one."""

    state_fields: ClassVar[tuple[str, ...]] = (
        "play_clip",
        "play_time",
        "play_end",
        "play_weight",
        "play_weight_rate",
        "play_queued",
        "play_queued_length",
    )

    def __init__(self, capacity: int, settings: AnimationSettings | None = None) -> None:
        self.settings = settings or AnimationSettings()
        self._samples = KeySamples.create(capacity, 1)

    def activate(self, state: State, characters: IntArray) -> None:
        """Start people without a play."""
        state.play_clip[characters] = -1
        state.play_queued[characters] = -1
        state.play_weight[characters] = 0.0

    def play(self, state: State, characters: IntArray, clip: int, length: float) -> None:
        """Play a clip; where one is playing, fade that one out first.

        Parameters
        ----------
        state : State
        characters : (M,) int32
        clip : int
            Index in the clip table.
        length : float
            s; infinite for a play without end.
        """
        is_free = state.play_clip[characters] < 0
        free, busy = characters[is_free], characters[~is_free]
        state.play_clip[free] = clip
        state.play_time[free] = 0.0
        state.play_end[free] = length
        state.play_queued[busy] = clip
        state.play_queued_length[busy] = length
        self.stop(state, busy)

    def stop(self, state: State, characters: IntArray) -> None:
        """Let the present play fade out from now on."""
        latest_end = state.play_time[characters] + self.settings.fade_time
        state.play_end[characters] = np.minimum(state.play_end[characters], latest_end)

    def evaluate(self, step: Step) -> None:
        """Advance plays and blend them over the pose."""
        state, table = step.state, step.model.clip_table
        playing = step.active[state.play_clip[step.active] >= 0]
        if playing.size == 0:
            return
        samples = self._samples
        samples.mask_index[playing] = table.mask_index[state.play_clip[playing]]
        play_crowd(
            table.first_key,
            table.key_count,
            table.key_rate,
            table.is_cyclic,
            playing,
            step.dt,
            self.settings.ease_rate,
            self.settings.fade_time,
            state.play_clip,
            state.play_time,
            state.play_end,
            state.play_weight,
            state.play_weight_rate,
            state.play_queued,
            state.play_queued_length,
            samples.frame,
            samples.next_frame,
            samples.fraction,
            samples.weight,
            samples.layer_weight,
        )
        samples.blend_onto_pose(step, playing)
