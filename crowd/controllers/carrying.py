"""Before layer 5: what both hands hold is kept before the body, and both hands on it."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from crowd.controllers.controller import Step
from crowd.controllers.grab import HOLDING, Grab
from crowd.model import Model
from crowd.motion.easing import minimum_jerk
from crowd.motion.rotation import about, multiply, rotate
from crowd.state import BoolArray, IntArray, State
from crowd_kernels.reach_goal import HOLD, MOVE


@dataclass(frozen=True)
class CarryingSettings:
    """Where people carry things with both hands."""

    height: float = 0.60
    """Height of the middle of the object, over stature."""
    gap: float = 0.17
    """m, at a stature of 1.75 m. From the middle of the body to the near side of the object."""
    move_time: float = 0.9
    """s, > 0. From where the object was taken to where it is carried."""


class Carrying:
    """Gives both hands their targets while they hold one thing and nobody else moves them.

    The place is fixed against the root, not the chest: the hands move the chest, which would move them again.
    """

    state_fields: ClassVar[tuple[str, ...]] = (
        "is_carrying",
        "carry_progress",
        "carry_position",
        "carry_rotation",
        "carry_target_world",
    )

    def __init__(self, model: Model, grab: Grab, settings: CarryingSettings | None = None) -> None:
        self.settings = settings or CarryingSettings()
        self._grab = grab
        self._stature = model.people.stature
        self._size = model.people.stature / model.skeleton.stature

    def activate(self, state: State, characters: IntArray) -> None:
        """Start people with empty hands."""
        state.is_carrying[characters] = False

    def evaluate(self, step: Step) -> None:
        """Move the targets of both hands with the body.

        Whoever lets both hands return while they hold something starts it; whoever gives them other targets
        ends it.
        """
        state, objects = step.state, self._grab.objects
        items = np.flatnonzero(objects.holder_hand.all(axis=1))
        rows = objects.holder[items]
        if rows.size == 0:
            state.is_carrying[step.active] = False
            return
        held = (state.grab_stage[rows] == HOLDING).all(axis=1)
        rows, items = rows[held], items[held]
        moved = (state.reach_target_world[rows] != state.carry_target_world[rows]).any(axis=(1, 2))
        is_reaching = np.isin(state.reach_stage[rows], (HOLD, MOVE)).all(axis=1)
        goes_on = state.is_carrying[rows] & ~moved & is_reaching
        state.is_carrying[step.active] = False
        begins = ~goes_on & ~is_reaching
        self._begin(state, rows[begins], items[begins])
        carries = goes_on | begins
        state.is_carrying[rows[carries]] = True
        self._aim(state, rows[carries], items[carries], begins[carries], step.dt)

    def _begin(self, state: State, rows: IntArray, items: IntArray) -> None:
        """Note where objects are against roots."""
        back = about(1, -state.yaw[rows])
        objects = self._grab.objects
        state.carry_position[rows] = rotate(back, objects.position_world[items] - state.position_world[rows])
        state.carry_rotation[rows] = multiply(back, objects.rotation_world[items])
        state.carry_progress[rows] = 0.0

    def _aim(self, state: State, rows: IntArray, items: IntArray, begins: BoolArray, dt: float) -> None:
        """Bring both hands to where they hold the object before the body."""
        if rows.size == 0:
            return
        progress = np.minimum(state.carry_progress[rows] + dt / self.settings.move_time, 1.0)
        state.carry_progress[rows] = progress
        share = minimum_jerk(progress)
        heading = about(1, state.yaw[rows])
        goal = np.zeros((rows.size, 3))
        goal[:, 1] = self.settings.height * self._stature[rows]
        goal[:, 2] = self.settings.gap * self._size[rows] + self._grab.placement.depths(
            items, state.carry_rotation[rows]
        )
        inner = state.carry_position[rows] + share[:, None] * (goal - state.carry_position[rows])
        position = state.position_world[rows] + rotate(heading, inner)
        rotation = multiply(heading, state.carry_rotation[rows])
        for hand in (0, 1):
            hands = rows, np.full(rows.size, hand, np.int32)
            place, wanted = self._grab.holding.hand_targets(hands, items, position, rotation)
            state.carry_target_world[rows, hand] = place
            if begins.any():
                self._grab.reach.start(state, rows[begins], hand, place[begins], wanted[begins], is_own=True)
            state.reach_is_own[rows, hand] = True
            state.reach_target_world[rows, hand] = place
            state.reach_target_rotation_world[rows, hand] = wanted
