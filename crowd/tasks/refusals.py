"""Tell of hands and eyes that were sent to what they cannot go to."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from crowd.controllers.grab import GrabStatus
from crowd.state import BoolArray
from crowd.tasks.events import EventKind
from crowd_kernels import gaze, reach_goal

if TYPE_CHECKING:
    from crowd.simulation import Simulation

BLOCKED = "a wall is in the way"
REASONS = {
    GrabStatus.REFUSED: "there is no such object, or the hand holds something else",
    GrabStatus.TAKEN: "somebody else holds the object",
    GrabStatus.TOO_BIG: "the object is too big for one hand",
    GrabStatus.MISSED: "the fingers met nothing",
}
"""What the refusals of grasps mean."""


class Refusals:
    """Compares the statuses of hands and eyes with those of the step before.

    Attributes
    ----------
    reach, grab : (N, 2) bool
        Hands that were refused in the step before.
    gaze : (N,) bool
        Likewise the eyes.
    """

    def __init__(self, simulation: Simulation) -> None:
        self._simulation = simulation
        capacity = simulation.model.capacity
        self.reach: BoolArray = np.zeros((capacity, 2), np.bool_)
        self.grab: BoolArray = np.zeros((capacity, 2), np.bool_)
        self.gaze: BoolArray = np.zeros(capacity, np.bool_)

    def state_fields(self) -> dict[str, npt.NDArray[Any]]:
        """Arrays that change in a run."""
        return {"reach": self.reach, "grab": self.grab, "gaze": self.gaze}

    def tell(self, time: float) -> None:
        """Add an event for each hand or pair of eyes that has been refused since the last step."""
        state = self._simulation.state
        reach = (state.reach_status == reach_goal.REFUSED) & state.is_active[:, None]
        grab = np.isin(state.grab_status, tuple(REASONS)) & state.is_active[:, None]
        eyes = (state.gaze_status == gaze.REFUSED) & ~state.is_glancing & state.is_active
        new_grab = grab & ~self.grab
        for row, hand in np.argwhere(new_grab):
            status = GrabStatus(int(state.grab_status[row, hand]))
            self._add(time, int(row), "grab", self._reach_reason(row, hand) or REASONS[status])
        for row, hand in np.argwhere(reach & ~self.reach & ~new_grab):
            self._add(time, int(row), "reach", self._reach_reason(row, hand))
        for row in np.flatnonzero(eyes & ~self.gaze):
            is_finite = np.isfinite(state.gaze_target_world[row]).all()
            self._add(time, int(row), "gaze", "the target is too near" if is_finite else "there is no target")
        self.reach[:], self.grab[:], self.gaze[:] = reach, grab, eyes

    def _add(self, time: float, row: int, layer: str, why: str) -> None:
        tasks = self._simulation.tasks
        has_task = bool(tasks.has_more(np.array([row], np.int32))[0])
        tasks.events.add(time, row, EventKind.TARGET_REFUSED, tasks.present(row) if has_task else layer, why)

    def _reach_reason(self, row: int, hand: int) -> str:
        """Why the reach layer refuses the target of a hand; empty when it does not."""
        state = self._simulation.state
        if state.reach_status[row, hand] != reach_goal.REFUSED:
            return ""
        if state.reach_is_blocked[row, hand]:
            return BLOCKED
        if not np.isfinite(state.reach_target_world[row, hand]).all():
            return "the target is not finite"
        turned = state.reach_target_rotation_world[row, hand]
        if state.reach_has_rotation[row, hand] and not abs(np.linalg.norm(turned) - 1.0) < 0.2:
            return "the rotation is none"
        return "the target is inside the body"
