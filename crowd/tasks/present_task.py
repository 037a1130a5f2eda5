"""Questions about a person's present task: what it is about, which hands do it, what they hold."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from crowd.state import FloatArray, IntArray
from crowd.tasks.task_list import Hand, Target, TaskKind

if TYPE_CHECKING:
    from crowd.tasks.execution import Tasks


def rows_of(row: int) -> IntArray:
    return np.array([row], np.int32)


def task_of(tasks: Tasks, row: int) -> tuple[Target, int, FloatArray]:
    """What the present task is about: kind of target, its index, its point."""
    column = tasks.index[row]
    lists = tasks.lists
    return (
        Target(int(lists.target_kind[row, column])),
        int(lists.target[row, column]),
        lists.point[row, column],
    )


def does(tasks: Tasks, row: int, kind: TaskKind, target: int) -> bool:
    """Whether a person is at a task of this kind about this target."""
    lists, column = tasks.lists, tasks.index[row]
    is_busy = column < lists.count[row]
    return bool(is_busy and lists.kind[row, column] == kind and lists.target[row, column] == target)


def hands_of(tasks: Tasks, row: int) -> tuple[int, ...]:
    """The hands that do the present task."""
    hand = int(tasks.hand[row])
    return (0, 1) if hand == Hand.BOTH else (hand,)


def wanted_hand(tasks: Tasks, row: int) -> int:
    """The hand that the present task asks for."""
    return int(tasks.lists.hand[row, tasks.index[row]])


def held_object(tasks: Tasks, row: int, hand: int = Hand.ANY) -> int:
    """The object that the person holds, in a certain hand if one is given; -1 for none."""
    objects = tasks.simulation.objects
    is_held = objects.holder == row
    if hand in (Hand.RIGHT, Hand.LEFT):
        is_held &= objects.holder_hand[:, hand]
    held = np.flatnonzero(is_held)
    return int(held[0]) if held.size else -1


def holding_hand(tasks: Tasks, item: int) -> int:
    right, left = tasks.simulation.objects.holder_hand[item]
    return Hand.BOTH if right and left else Hand.LEFT if left else Hand.RIGHT


def takes_seated(tasks: Tasks, giver: int, taker: int) -> bool:
    """Whether somebody sits and takes what another one gives without standing up: what one hand holds."""
    item = held_object(tasks, giver)
    return bool(tasks.simulation.state.is_seated[taker]) and holding_hand(tasks, item) != Hand.BOTH


def free_hand(tasks: Tasks, row: int, item: int = -1) -> int:
    """The hand that the task asks for; without a wish both for what is too big for one, or an empty one."""
    wanted = wanted_hand(tasks, row)
    if wanted != Hand.ANY:
        return wanted
    simulation, objects = tasks.simulation, tasks.simulation.objects
    mine = objects.holder == row
    hand = Hand.LEFT if (objects.holder_hand[mine, 0]).any() else Hand.RIGHT
    if item >= 0 and simulation.grab.is_too_big(simulation.state, rows_of(row), hand, item)[0]:
        return Hand.BOTH
    return hand


def is_too_big(tasks: Tasks, row: int, item: int) -> bool:
    """The hands that do the present task cannot hold the object."""
    grab, state = tasks.simulation.grab, tasks.simulation.state
    if tasks.hand[row] == Hand.BOTH:
        return bool(grab.is_too_big_for_both(state, rows_of(row), item)[0])
    return bool(grab.is_too_big(state, rows_of(row), tasks.hand[row], item)[0])


def are_empty(tasks: Tasks, row: int) -> bool:
    """The hands that do the present task hold nothing."""
    return all(held_object(tasks, row, hand) < 0 for hand in hands_of(tasks, row))
