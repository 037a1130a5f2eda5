"""Layer 1, world offset: the root's place and heading."""

from typing import ClassVar

import numpy as np

from crowd.controllers.controller import IntArray, Step
from crowd.state import State
from crowd_kernels.locomotion import integrate_root_crowd


class WorldOffset:
    """Moves roots by what the locomotion blend realises."""

    state_fields: ClassVar[tuple[str, ...]] = ("position_world", "previous_position_world", "yaw", "locomotion_parameter")

    def __init__(self, capacity: int) -> None:
        self.library_parameter = np.zeros((capacity, 3))
        """Parameters inside the locomotion hull, as the library knows them. (character, 3)"""

    def activate(self, state: State, characters: IntArray) -> None:
        """Start people at rest."""
        self.library_parameter[characters] = 0.0

    def evaluate(self, step: Step) -> None:
        """Integrate position and heading over the step."""
        state, people = step.state, step.model.people
        state.previous_position_world[step.active] = state.position_world[step.active]
        integrate_root_crowd(
            self.library_parameter,
            people.stride_scale,
            people.tempo,
            step.active,
            step.dt,
            state.position_world,
            state.yaw,
            state.locomotion_parameter,
        )
