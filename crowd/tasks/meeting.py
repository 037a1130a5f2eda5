"""Where two people meet who hand something over, and who turns to whom: the first moves of their tasks.

All have the form ``choose(tasks, row, time) -> Outcome``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from crowd.tasks.partners import missing_half
from crowd.tasks.present_task import (
    free_hand,
    held_object,
    holding_hand,
    takes_seated,
    task_of,
    wanted_hand,
)
from crowd.tasks.waits import Outcome

if TYPE_CHECKING:
    from crowd.tasks.execution import Tasks

MEETING_DISTANCE = 0.95
"""Distance of two people who hand something over, m."""
SEATED_MEETING = 0.62
"""Distance from the feet of somebody who sits at which others give something, m."""
SEATED_TURN = 1.75
"""Angle to a side up to which they do, rad: who sits at a table is given things from beside."""
CHEST = 0.7
"""Height over stature at which no wall may be between them."""
LOOKS_FOR_SOMEBODY = 5
"""Times that a person looks for the other one of two who hand something over before the task fails."""


def find_taker(tasks: Tasks, row: int, time: float) -> Outcome:
    """Wait until the person who takes what the hand holds has nothing else to do, nor another way to go."""
    item = held_object(tasks, row, wanted_hand(tasks, row))
    if item < 0:
        return Outcome.EMPTY_HANDED
    if (outcome := find_partner(tasks, row, time)) is not Outcome.NEXT:
        return outcome
    tasks.object[row] = item
    tasks.hand[row] = holding_hand(tasks, item)
    return Outcome.WAIT


def choose_meeting(tasks: Tasks, row: int, time: float) -> Outcome:
    """Find a place before the person who takes what the hand holds."""
    simulation, state = tasks.simulation, tasks.simulation.state
    _, other, _ = task_of(tasks, row)
    # Who sits does not turn round.
    stays_seated = takes_seated(tasks, row, other)
    widest, distance = (SEATED_TURN, SEATED_MEETING) if stays_seated else (math.pi, MEETING_DISTANCE)
    aside = np.linspace(0.0, widest, 7).repeat(2) * np.tile([1.0, -1.0], 7)
    yaw = state.yaw[other] + aside
    places = state.position_world[other] + distance * np.stack(
        [np.sin(yaw), np.zeros_like(yaw), np.cos(yaw)], axis=1
    )
    world, radius = simulation.model.world, float(simulation.model.radius[row])
    fits = world.is_walkable(places, radius)
    chest = [0.0, CHEST * float(simulation.model.people.stature[other]), 0.0]
    fits &= ~world.is_blocked(
        places + chest, np.broadcast_to(state.position_world[other] + chest, places.shape)
    )
    if not fits.any():
        return Outcome.FAIL
    here = np.broadcast_to(state.position_world[row], places.shape)
    is_cut_off = ~world.is_reachable(here, places, radius)
    away = np.linalg.norm(places - here, axis=1)
    best = np.lexsort((away, np.abs(aside), is_cut_off, ~fits))[0]
    chosen = places[best]
    tasks.place_world[row] = chosen
    way = state.position_world[other] - chosen
    tasks.place_yaw[row] = math.atan2(way[0], way[2])
    tasks.has_place[row] = True
    return Outcome.NEXT


def find_partner(tasks: Tasks, row: int, time: float) -> Outcome:
    """See whether the other person has a task for the other half; programs may give it a little later."""
    if not missing_half(tasks, row):
        return Outcome.NEXT
    return Outcome.FAIL if tasks.look[row] < LOOKS_FOR_SOMEBODY else Outcome.ALONE


def face_giver(tasks: Tasks, row: int, time: float) -> Outcome:
    """Turn to the person who gives."""
    state = tasks.simulation.state
    _, other, _ = task_of(tasks, row)
    tasks.hand[row] = free_hand(tasks, row)
    if takes_seated(tasks, other, row):
        tasks.has_place[row] = False
        return Outcome.NEXT
    way = state.position_world[other] - state.position_world[row]
    tasks.place_world[row] = state.position_world[row]
    tasks.place_yaw[row] = math.atan2(way[0], way[2])
    tasks.has_place[row] = True
    return Outcome.NEXT
