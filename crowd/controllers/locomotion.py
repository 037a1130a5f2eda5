"""Layer 3, locomotion: example-based blending in phase, over the idle pose."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from crowd.controllers.controller import KeySamples, Step
from crowd.state import FloatArray, IntArray, State
from crowd_kernels.aligned import aligned_zeros
from crowd_kernels.barycentric import locate_crowd
from crowd_kernels.gait import contact_crowd, sample_crowd
from crowd_kernels.locomotion import (
    CommandLimits,
    GaitLimits,
    approach_crowd,
    gait_crowd,
    wish_crowd,
)

COMMAND_LIMITS = CommandLimits(
    heading_time=0.35,
    heading_speed=0.5,
    turn_gain=2.6,
    largest_turn_rate=2.5,
    forward_acceleration=1.6,
    braking=2.6,
    side_acceleration=2.2,
    turn_acceleration=8.0,
)
GAIT_LIMITS = GaitLimits(
    start_speed=0.12, start_turn_rate=0.3, stop_speed=0.08, stop_turn_rate=0.12, ease_rate=14.0
)


@dataclass(frozen=True)
class LocomotionSettings:
    """How people follow a desired velocity."""

    command: CommandLimits = COMMAND_LIMITS
    """Limits of a command and of its changes; larger accelerations avoid more closely but look hastier."""
    gait: GaitLimits = GAIT_LIMITS
    """When people start and stop moving."""


class Locomotion:
    """Blends the examples around the wanted parameters, in phase, and tells which feet are planted."""

    state_fields: ClassVar[tuple[str, ...]] = (
        "heading_velocity_world",
        "turning_side",
        "is_moving",
        "locomotion_weight",
        "locomotion_weight_rate",
        "phase",
        "cycle_rate",
        "example",
        "example_weight",
    )

    def __init__(self, capacity: int, settings: LocomotionSettings | None = None) -> None:
        self.settings = settings or LocomotionSettings()
        self.wanted_parameter = aligned_zeros((capacity, 3))
        self.contact_wanted = aligned_zeros((capacity, 2), np.uint8)
        """Contact of each foot as the layers want it, before foot locking. (character, 2)"""
        self._library_wish = aligned_zeros((capacity, 3))
        self._library_parameter = aligned_zeros((capacity, 3))
        self._is_inside = aligned_zeros(capacity, np.uint8)
        self._samples = KeySamples.create(capacity, 4)

    def activate(self, state: State, characters: IntArray) -> None:
        """Start people standing, each with its own gait phase."""
        state.phase[characters] = (characters * 1.2360679775) % 2.0
        state.locomotion_weight[characters] = 0.0
        state.is_moving[characters] = False

    def command(self, step: Step) -> None:
        """Turn desired velocities into parameters inside the hull, and advance gait state and phase."""
        state, people = step.state, step.model.people
        # Who stands up first neither turns nor moves on the seat.
        stands = ~state.is_off_feet
        wish_crowd(
            state.yaw,
            state.position_world,
            state.way_point_world,
            state.desired_velocity_world,
            state.wants_to_walk & stands,
            state.is_directed & stands,
            state.directed_parameter,
            people.stride_scale,
            people.tempo,
            step.active,
            self.settings.command,
            step.dt,
            state.heading_velocity_world,
            state.turning_side,
            self.wanted_parameter,
            self._library_parameter,
        )
        self._locate(step, self._library_wish)
        approach_crowd(
            self._library_wish,
            people.stride_scale,
            people.tempo,
            step.active,
            self.settings.command,
            step.dt,
            state.locomotion_parameter,
            self._library_parameter,
        )
        self._locate(step, state.library_parameter)
        gait_crowd(
            self.wanted_parameter,
            state.locomotion_parameter,
            state.cycle_rate,
            people.tempo,
            step.active,
            self.settings.gait,
            step.dt,
            state.is_moving,
            state.locomotion_weight,
            state.locomotion_weight_rate,
            state.phase,
        )

    def _locate(self, step: Step, out_library_parameter: FloatArray) -> None:
        """Bring `_library_parameter` inside the hull, and find the examples to blend."""
        state = step.state
        locate_crowd(
            step.model.space.arrays,
            self._library_parameter,
            step.active,
            state.example,
            state.example_weight,
            state.cycle_rate,
            out_library_parameter,
            self._is_inside,
        )

    def evaluate(self, step: Step) -> None:
        """Write the pose of moving people and the wanted contacts of everyone."""
        state, table = step.state, step.model.clip_table
        self.contact_wanted[step.active] = 2
        moving = step.active[state.locomotion_weight[step.active] > 0.0]
        if moving.size == 0:
            return
        samples = self._samples
        np.copyto(samples.layer_weight, state.locomotion_weight, casting="same_kind")
        sample_crowd(
            table.example_clip,
            table.first_key,
            table.key_count,
            state.example,
            state.example_weight,
            state.phase,
            moving,
            samples.frame,
            samples.next_frame,
            samples.fraction,
            samples.weight,
        )
        samples.blend_onto_pose(step, moving)
        stepping = moving[state.locomotion_weight[moving] > 0.5]
        contact_crowd(
            table.contact_phase,
            state.example,
            state.example_weight,
            state.phase,
            stepping,
            self.contact_wanted,
        )
