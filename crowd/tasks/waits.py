"""What the moves of tasks wait for, found for everyone at once."""

from __future__ import annotations

from enum import Enum, IntEnum
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from crowd.controllers.controller import Step
from crowd.controllers.grab import HOLDING, OPEN, GrabStatus
from crowd.state import BoolArray, CarryStage, IntArray
from crowd.tasks.present_task import does
from crowd.tasks.settle import is_settled
from crowd.tasks.task_list import Hand, TaskKind
from crowd_kernels.reach_state import HOLD, NONE, OUT_OF_REACH, REACHED, REFUSED

if TYPE_CHECKING:
    from crowd.tasks.execution import Tasks

MEETING_NEAR = 1.6
"""Distance at which two people have met, m."""
HOPELESS = (
    GrabStatus.REFUSED,
    GrabStatus.TAKEN,
    GrabStatus.TOO_BIG,
    GrabStatus.MISSED,
    GrabStatus.TOO_LATE,
)
"""Statuses of a grasp that waiting does not change."""
LONG_ENOUGH = 2.5
"""Time after which a hand that has not come to its target will not do so, s."""
STANDING_WEIGHT = 0.02
"""Share of locomotion below which a person stands still."""


class Outcome(Enum):
    """What the beginning of a move leads to."""

    NEXT = 0
    WAIT = 1
    FAIL = 2
    """Nothing suitable is there now; worth another look."""
    EMPTY_HANDED = 3
    """There is nothing in the hands to do it with."""
    BEHIND_WALLS = 4
    """Obstacles keep the hands away from it, wherever one stands."""
    ALONE = 5
    """The other person has no task for it."""
    NOWHERE = 6
    """The object has no place."""
    HANDS_FULL = 7
    """The hands that are to do it hold something else."""
    DONE = 8
    """It is so already."""
    NOTHING_LEFT = 9
    """All of the kind have been put down, and stay where they are."""
    TOO_BIG = 10
    """The hands that are to do it cannot hold it."""
    IN_THE_AIR = 11
    """Nothing carries what is put down there."""
    NO_WAY = 12
    """Obstacles keep the person away from the place."""


class Wait(IntEnum):
    """What ends a move."""

    TIME = 0
    ARRIVED = 1
    SETTLED = 2
    STANDING = 3
    REACHED = 4
    HOLDING = 5
    OPEN = 6
    WITHDRAWN = 7
    SEATED = 8
    RISEN = 9
    PLAYED = 10
    GIVER_NEAR = 11
    TAKER_READY = 12
    OFFERED = 13
    TAKEN = 14
    TOUCHING = 15
    TAKER_THERE = 16


WAITS_FOR_SOMEBODY = (Wait.GIVER_NEAR, Wait.TAKER_THERE, Wait.TAKER_READY, Wait.OFFERED, Wait.TAKEN)
"""Waits that only the other person's task ends."""


def is_over(tasks: Tasks, step: Step, doing: IntArray) -> BoolArray:
    """Whose present move has got what it waits for. (D,)"""
    state, wait = step.state, tasks.wait[doing]
    over = np.zeros(doing.size, np.bool_)
    for kind in np.unique(wait):
        here = np.flatnonzero(wait == kind)
        rows = doing[here]
        over[here] = _has(Wait(int(kind)), tasks, step, rows)
    return over & state.is_active[doing]


def has_no_way(tasks: Tasks, step: Step, doing: IntArray) -> BoolArray:
    """Who walks to a place to which there is no way, and will be none by the scenario. (D,)"""
    is_cut_off = (tasks.wait[doing] == Wait.ARRIVED) & step.state.wants_to_walk[doing]
    is_cut_off &= tasks.simulation.navigator.routing.is_cut_off(doing)
    return np.asarray(is_cut_off & (not step.model.timetable.changes_after(step.time)))


def has_failed(tasks: Tasks, step: Step, doing: IntArray) -> BoolArray:
    """Whose hands say that they will not get what they wait for. (D,)"""
    state, wait = step.state, tasks.wait[doing]
    hands = _hand_columns(tasks.hand[doing])
    refused = np.isin(state.grab_status[doing], HOPELESS) & hands
    refused[~np.isin(wait, (Wait.HOLDING, Wait.TOUCHING))] = False
    unwilling = (state.reach_status[doing] == REFUSED) & hands
    unwilling[~np.isin(wait, (Wait.HOLDING, Wait.TOUCHING, Wait.REACHED))] = False
    too_far = (state.reach_status[doing] == OUT_OF_REACH) & (state.reach_stage[doing] == HOLD) & hands
    too_far[~np.isin(wait, (Wait.HOLDING, Wait.TOUCHING, Wait.REACHED))] = False
    too_far[tasks.since[doing] + LONG_ENOUGH > step.time] = False
    return np.asarray((refused | unwilling | too_far).any(axis=1))


def _has(wait: Wait, tasks: Tasks, step: Step, rows: IntArray) -> BoolArray:
    """Who of these has got what all of them wait for."""
    state, simulation = step.state, tasks.simulation
    hands = _hand_columns(tasks.hand[rows])
    match wait:
        case Wait.ARRIVED:
            return ~state.wants_to_walk[rows]
        case Wait.SETTLED:
            return is_settled(
                state.position_world[rows], state.yaw[rows], tasks.place_world[rows], tasks.place_yaw[rows]
            )
        case Wait.STANDING:
            return state.locomotion_weight[rows] < STANDING_WEIGHT
        case Wait.REACHED:
            return _all_hands(state.reach_status[rows] == REACHED, hands)
        case Wait.TOUCHING:
            touches = state.grab_status[rows] == GrabStatus.TOUCHING
            return _all_hands(touches | (state.reach_status[rows] == REACHED), hands)
        case Wait.HOLDING:
            holds = (state.grab_stage[rows] == HOLDING) & (
                state.grab_object[rows] == tasks.object[rows, None]
            )
            return _all_hands(holds, hands)
        case Wait.OPEN:
            return _all_hands(state.grab_stage[rows] == OPEN, hands)
        case Wait.WITHDRAWN:
            # What both hands hold is before the body then, and the hands at it.
            carries = (state.carry_stage[rows] == CarryStage.CARRYING) & (state.carry_progress[rows] >= 1.0)
            return np.asarray(_all_hands(state.reach_stage[rows] == NONE, hands) | carries)
        case Wait.SEATED:
            return state.sitting_time[rows] >= simulation.sitting.seconds(step)
        case Wait.RISEN:
            return state.sitting_time[rows] <= 0.0
        case Wait.PLAYED:
            return state.play_clip[rows] < 0
        case Wait.GIVER_NEAR | Wait.TAKER_THERE | Wait.TAKER_READY | Wait.OFFERED:
            other = tasks.lists.target[rows, tasks.index[rows]]
            return np.array(
                [_is_met(wait, tasks, int(row), int(o)) for row, o in zip(rows, other, strict=True)]
            )
        case Wait.TAKEN:
            return np.asarray(simulation.objects.holder[tasks.object[rows]] != rows)
        case _:
            return np.zeros(rows.size, np.bool_)


def _hand_columns(hand: npt.NDArray[np.int8]) -> BoolArray:
    """Which hands work, (M, 2): right, left."""
    return np.stack([hand != Hand.LEFT, hand != Hand.RIGHT], axis=1)


def _all_hands(is_so: BoolArray, hands: BoolArray) -> BoolArray:
    return np.asarray((is_so | ~hands).all(axis=1))


def _is_met(wait: Wait, tasks: Tasks, row: int, other: int) -> bool:
    """Two people who hand something over wait for each other."""
    state = tasks.simulation.state
    if wait is Wait.TAKER_THERE:
        return does(tasks, other, TaskKind.TAKE_FROM, row)
    near = float(np.linalg.norm(state.position_world[row] - state.position_world[other])) < MEETING_NEAR
    if wait is Wait.GIVER_NEAR:
        return near and tasks.wait[other] in (Wait.SETTLED, Wait.STANDING, Wait.TAKER_READY, Wait.TAKEN)
    if wait is Wait.TAKER_READY:
        return near and tasks.wait[other] == Wait.OFFERED
    return near and tasks.wait[other] == Wait.TAKEN and bool((state.reach_stage[other] == HOLD).any())
