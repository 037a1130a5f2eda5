"""Layer 1, world offset: the root's place and heading."""

from typing import ClassVar

from crowd.controllers.controller import Step
from crowd.state import IntArray, State
from crowd_kernels.locomotion import integrate_root_crowd


class WorldOffset:
    """Moves roots by what the locomotion blend realises."""

    state_fields: ClassVar[tuple[str, ...]] = (
        "position_world",
        "previous_position_world",
        "yaw",
        "locomotion_parameter",
    )

    def activate(self, state: State, characters: IntArray) -> None:
        """Start people at rest, which an empty slot already is."""

    def evaluate(self, step: Step) -> None:
        """Integrate position and heading over the step."""
        state, people = step.state, step.model.people
        state.previous_position_world[step.active] = state.position_world[step.active]
        integrate_root_crowd(
            state.library_parameter,
            people.stride_scale,
            people.tempo,
            step.active,
            step.dt,
            state.position_world,
            state.yaw,
            state.locomotion_parameter,
        )
