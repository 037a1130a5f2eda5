"""Figures of a run about hands: reaches that were asked and met, objects held and put down."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from crowd.controllers.grab import HOLDING
from crowd.motion.rotation import rotate
from crowd_kernels.reach_state import REACHED

if TYPE_CHECKING:
    from crowd.simulation import Simulation

FloatArray = npt.NDArray[np.float64]

MILLIMETRE = 1e3
SAMPLE_PERIOD = 0.1
"""Fingers are compared with what they hold at these intervals, s."""


class HandMetrics:
    """Accumulates figures frame by frame.

    Every target that a hand is sent to is *attempted*, also one on the way to another, and one that is
    refused. It is *completed* in the first frame in which the hand is there; the error is taken then.
    """

    def __init__(self) -> None:
        self._sent: npt.NDArray[np.int32] | None = None
        self._completed: npt.NDArray[np.int32] | None = None
        self._attempted = 0
        self._errors: list[float] = []
        self._apart = 0.0
        self._finger_depth = 0.0
        self._measured_holder: npt.NDArray[np.int32] | None = None
        self._sampled_at = -np.inf
        self._was_held = False
        self._placed_error = np.nan

    def observe(self, simulation: Simulation) -> None:
        """Take the state after a step into account."""
        state = simulation.state
        if self._sent is None or self._completed is None:
            self._sent, self._completed = np.zeros_like(state.reach_count), np.zeros_like(state.reach_count)
        self._attempted += int((state.reach_count != self._sent).sum())
        self._sent[:] = state.reach_count
        is_new = (state.reach_status == REACHED) & (state.reach_count != self._completed)
        if is_new.any():
            self._errors.extend(hand_errors(simulation, *np.nonzero(is_new)))
            self._completed[is_new] = state.reach_count[is_new]
        if simulation.objects.count:
            self._observe_objects(simulation)

    def _observe_objects(self, simulation: Simulation) -> None:
        objects = simulation.objects
        apart = simulation.grab.holding.apart(simulation.state)
        if apart.size:
            self._was_held = True
            self._apart = max(self._apart, float(apart.max()))
        if self._was_held and simulation.time - self._sampled_at >= SAMPLE_PERIOD:
            self._sampled_at = simulation.time
            self._finger_depth = max(self._finger_depth, self._deepest_finger(simulation))
        self._placed_error = float(np.fmax(self._placed_error, np.fmax.reduce(objects.release_error)))

    def _deepest_finger(self, simulation: Simulation) -> float:
        """How deep the deepest finger is in the object that its hand holds, m; 0 outside.

        A hand that alone holds an object keeps its fingers where they are, and is measured once.
        """
        objects, state = simulation.objects, simulation.state
        if self._measured_holder is None:
            self._measured_holder = np.full(objects.count, -1, np.int32)
        is_alone = objects.holder_hand.sum(axis=1) == 1
        is_known = is_alone & (self._measured_holder == objects.holder)
        item, hand = np.nonzero(objects.holder_hand & ~is_known[:, None])
        rows = objects.holder[item]
        is_still = is_alone[item] & (state.grab_stage[rows, hand] == HOLDING)
        self._measured_holder[~is_known] = -1
        self._measured_holder[item[is_still]] = rows[is_still]
        gaps = simulation.grab.finger_gaps(state, rows, hand.astype(np.int32))
        return max(0.0, -float(gaps.min(initial=0.0)))

    def as_dict(self) -> dict[str, float | int]:
        """Figures that the run exercised, by dotted key."""
        result: dict[str, float | int] = {}
        if self._attempted:
            result["reach.attempted"] = self._attempted
            result["reach.completed"] = len(self._errors)
        if self._errors:
            errors = MILLIMETRE * np.array(self._errors)
            result["reach.error_mm.p50"] = float(np.quantile(errors, 0.5))
            result["reach.error_mm.p99"] = float(np.quantile(errors, 0.99))
            result["reach.error_mm.max"] = float(errors.max())
        if self._was_held:
            result["held.apart_mm.max"] = MILLIMETRE * self._apart
            result["reach.finger_depth_mm.max"] = MILLIMETRE * self._finger_depth
        if np.isfinite(self._placed_error):
            result["placed.error_mm.max"] = MILLIMETRE * self._placed_error
        return result


def hand_errors(
    simulation: Simulation, characters: npt.NDArray[np.intp], hands: npt.NDArray[np.intp]
) -> FloatArray:
    """Distances of points of hands from their targets, m. (K,)"""
    state = simulation.state
    own = characters.astype(np.int32), hands.astype(np.int32)
    position, rotation = simulation.grab.holding.hands_in_world(state, own)
    point = position + rotate(rotation, state.reach_point_hand[characters, hands])
    return np.asarray(np.linalg.norm(point - state.reach_target_world[characters, hands], axis=1))
