"""Tell of hands and eyes that were sent to what they cannot go to."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from crowd.controllers.grab import GrabStatus
from crowd.state import BoolArray, IntArray
from crowd.tasks.events import EventKind

if TYPE_CHECKING:
    from crowd.simulation import Simulation

BLOCKED = "a wall is in the way"
REASONS = {
    GrabStatus.REFUSED: "there is no such object, or the hand holds something else",
    GrabStatus.TAKEN: "somebody else holds the object",
    GrabStatus.TOO_BIG: "the object is too big for the hands that were asked",
    GrabStatus.MISSED: "the fingers met nothing",
    GrabStatus.TOO_LATE: "the hand has not come to the object for long",
    GrabStatus.EMPTY: "there is nothing in the hand",
    GrabStatus.TIED: "the other hand holds the object too",
    GrabStatus.TOO_FAR: "the other person is too far away",
}
"""What the refusals of grasps mean."""


class Refusals:
    """Compares how often hands and eyes were refused with what has been told.

    Attributes
    ----------
    reach, grab : (N, 2) int32
        Refusals of hands until the step before.
    gaze : (N,) int32
        Likewise of the eyes.
    is_cut_off : (N,) bool
        Who has been told that there is no way to the goal.
    """

    def __init__(self, simulation: Simulation) -> None:
        self._simulation = simulation
        capacity = simulation.model.capacity
        self.reach: IntArray = np.zeros((capacity, 2), np.int32)
        self.grab: IntArray = np.zeros((capacity, 2), np.int32)
        self.gaze: IntArray = np.zeros(capacity, np.int32)
        self.is_cut_off: BoolArray = np.zeros(capacity, np.bool_)

    def state_fields(self) -> dict[str, npt.NDArray[Any]]:
        """Arrays that change in a run."""
        return {"reach": self.reach, "grab": self.grab, "gaze": self.gaze, "is_cut_off": self.is_cut_off}

    def tell(self, time: float) -> None:
        """Add an event for each refusal since the last step."""
        self._tell_of_ways(time)
        state = self._simulation.state
        reach, grab = state.reach_refusals - self.reach, state.grab_refusals - self.grab
        eyes = state.gaze_refusals - self.gaze
        if not (reach.any() or grab.any() or eyes.any()):
            return
        for row, hand in np.argwhere((grab > 0) & state.is_active[:, None]):
            why = GrabStatus(int(state.grab_refusal[row, hand]))
            # A hand that could not go to the object: the layer that moves it knows more.
            by_reach = why is GrabStatus.REFUSED and reach[row, hand] > 0
            reason = self._reach_reason(row, hand) if by_reach else REASONS[why]
            self._add(time, int(row), "grab", reason, int(grab[row, hand]))
        for row, hand in np.argwhere((reach > 0) & (grab <= 0) & state.is_active[:, None]):
            self._add(time, int(row), "reach", self._reach_reason(row, hand), int(reach[row, hand]))
        for row in np.flatnonzero((eyes > 0) & state.is_active):
            is_finite = np.isfinite(state.gaze_target_world[row]).all()
            why_not = "the target is too near" if is_finite else "there is no target"
            self._add(time, int(row), "gaze", why_not, int(eyes[row]))
        self.reach[:], self.grab[:], self.gaze[:] = (
            state.reach_refusals,
            state.grab_refusals,
            state.gaze_refusals,
        )

    def _tell_of_ways(self, time: float) -> None:
        """Add an event for each walker who no longer finds a way to its goal; those of tasks give up."""
        simulation, state = self._simulation, self._simulation.state
        routing = simulation.navigator.routing
        rows = np.flatnonzero(routing.status).astype(np.int32)
        if rows.size == 0 and not self.is_cut_off.any():
            return
        is_cut_off = np.zeros_like(self.is_cut_off)
        is_cut_off[rows] = (state.is_active & state.wants_to_walk)[rows] & routing.is_cut_off(rows)
        for row in np.flatnonzero(is_cut_off & ~self.is_cut_off):
            if not simulation.tasks.has_more(np.array([row], np.int32))[0]:
                self._add(time, int(row), "walk", "there is no way to the goal", 1)
        self.is_cut_off[:] = is_cut_off

    def _add(self, time: float, row: int, layer: str, why: str, count: int) -> None:
        tasks = self._simulation.tasks
        has_task = bool(tasks.has_more(np.array([row], np.int32))[0])
        for _ in range(count):
            tasks.events.add(
                time, row, EventKind.TARGET_REFUSED, tasks.present(row) if has_task else layer, why
            )

    def _reach_reason(self, row: int, hand: int) -> str:
        """Why the reach layer refuses the target of a hand."""
        state = self._simulation.state
        if state.reach_is_blocked[row, hand]:
            return BLOCKED
        if not np.isfinite(state.reach_target_world[row, hand]).all():
            return "the target is not finite"
        turned = state.reach_target_rotation_world[row, hand]
        if state.reach_has_rotation[row, hand] and not abs(np.linalg.norm(turned) - 1.0) < 0.2:
            return "the rotation is none"
        return "the target is inside the body"
