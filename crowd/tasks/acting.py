"""What people do in tasks: go, settle, reach, grasp, put down, sit, play. The moves after a choice.

All have the form ``act(tasks, row, time) -> Outcome``; they start something that `Wait` ends.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from crowd.controllers.grab import HOLDING
from crowd.motion.rotation import about, conjugate, multiply, yaw_of
from crowd.people import HANDING_HEIGHT, SEATED_HANDING_HEIGHT
from crowd.state import FloatArray
from crowd.tasks.events import EventKind
from crowd.tasks.present_task import (
    are_empty,
    free_hand,
    hands_of,
    held_object,
    holding_hand,
    is_too_big,
    rows_of,
    task_of,
    wanted_hand,
)
from crowd.tasks.settle import settle_parameters
from crowd.tasks.task_list import Hand, Target, TaskKind
from crowd.tasks.waits import Outcome
from crowd_kernels.reach_state import NONE

if TYPE_CHECKING:
    from crowd.tasks.execution import Tasks

CARRYING_CLIPS = ("carry_right", "carry_left")
ARRIVAL_RADIUS = 0.3
"""Distance at which walking to a place ends and settling there begins, m."""
OFFER_DISTANCE = 0.45
"""How far ahead something is held out, m."""
OTHER_HEADINGS = (0.0, -0.45, 0.45, -0.9, 0.9)
"""Turns of an object that is put down, for each try, rad."""
FINGER_TIPS = 0.155
"""From the wrist to the finger tips, a little short of the hand's length, m, at a stature of 1.75 m."""


# ---- going there


def rise(tasks: Tasks, row: int, time: float) -> Outcome:
    """Stand up, unless the target is in reach of the seat."""
    state = tasks.simulation.state
    if not state.is_seated[row] or not tasks.has_place[row]:
        return Outcome.NEXT
    tasks.simulation.sitting.stand(state, rows_of(row))
    return Outcome.WAIT


def walk(tasks: Tasks, row: int, time: float) -> Outcome:
    """Walk to the place."""
    if not tasks.has_place[row]:
        return Outcome.NEXT
    simulation = tasks.simulation
    away = np.linalg.norm(simulation.state.position_world[row] - tasks.place_world[row])
    if away < ARRIVAL_RADIUS:
        return Outcome.NEXT
    simulation.population.send(
        simulation.state, rows_of(row), tasks.place_world[row : row + 1].copy(), np.array([ARRIVAL_RADIUS])
    )
    return Outcome.WAIT


def settle(tasks: Tasks, row: int, time: float) -> Outcome:
    """Take the last steps, turn the right way, and look at what comes next."""
    simulation, state = tasks.simulation, tasks.simulation.state
    if tasks.lists.kind[row, tasks.index[row]] not in (TaskKind.WALK_TO, TaskKind.SIT):
        look_at_target(tasks, row, time)
    if not tasks.has_place[row]:
        return Outcome.NEXT
    if np.linalg.norm(state.position_world[row] - tasks.place_world[row]) > 3.0 * ARRIVAL_RADIUS:
        return Outcome.FAIL
    # The way that is left, at once: a command to rest in between, for one frame only, would jerk the legs.
    simulation.commands.set_locomotion(
        row,
        settle_parameters(
            state.position_world[[row]],
            state.yaw[[row]],
            tasks.place_world[[row]],
            tasks.place_yaw[[row]],
        ),
    )
    return Outcome.WAIT


def stand_still(tasks: Tasks, row: int, time: float) -> Outcome:
    """Let the last step end."""
    tasks.simulation.state.is_directed[row] = False
    return Outcome.WAIT if tasks.has_place[row] else Outcome.NEXT


def look_at_target(tasks: Tasks, row: int, time: float) -> Outcome:
    """Look at what the task is about."""
    simulation, rows = tasks.simulation, rows_of(row)
    kind, target, _ = task_of(tasks, row)
    if kind is Target.CHARACTER:
        simulation.gaze.look_at_character(simulation.state, rows, target)
    elif kind is Target.OBJECTS and tasks.object[row] >= 0:
        simulation.gaze.look_at_object(simulation.state, rows, int(tasks.object[row]))
    else:
        simulation.gaze.look_at_point(simulation.state, rows, tasks.target_world[row])
    return Outcome.WAIT


def look_away(tasks: Tasks, row: int, time: float) -> Outcome:
    """Look where one likes."""
    tasks.simulation.gaze.release(tasks.simulation.state, rows_of(row))
    return Outcome.NEXT


# ---- with the hands


def grasp(tasks: Tasks, row: int, time: float) -> Outcome:
    """Reach for the object and close the hand around it."""
    grab, state, item = tasks.simulation.grab, tasks.simulation.state, int(tasks.object[row])
    if tasks.hand[row] == Hand.BOTH:
        grab.grasp_both(state, rows_of(row), item)
    else:
        grab.grasp(state, rows_of(row), int(tasks.hand[row]), item)
    return Outcome.WAIT


def grasp_offered(tasks: Tasks, row: int, time: float) -> Outcome:
    """Take what the other person holds out."""
    _, other, _ = task_of(tasks, row)
    item = held_object(tasks, other)
    if item < 0:
        return Outcome.FAIL
    tasks.object[row] = item
    if wanted_hand(tasks, row) == Hand.ANY:
        both = holding_hand(tasks, item) == Hand.BOTH
        tasks.hand[row] = Hand.BOTH if both else free_hand(tasks, row, item)
    if is_too_big(tasks, row, item):
        return Outcome.TOO_BIG
    return grasp(tasks, row, time) if are_empty(tasks, row) else Outcome.HANDS_FULL


def lift(tasks: Tasks, row: int, time: float) -> Outcome:
    """Take the hand back with what it holds, and carry it before the body."""
    simulation, rows = tasks.simulation, rows_of(row)
    item = int(tasks.object[row])
    tasks.claimed_by[item] = -1
    here = simulation.objects.position_world[item]
    tasks.held_heading[item] = heading_of(tasks, item) - direction_to(tasks, row, here)
    name = simulation.model.objects.name[item]
    simulation.tasks.events.add(time, row, EventKind.OBJECT_TAKEN, "pick_up", name)
    for hand in hands_of(tasks, row):
        simulation.reach.end(simulation.state, rows, hand)
    simulation.commands.stop_play(row)
    if tasks.hand[row] != Hand.BOTH:
        simulation.commands.play(row, CARRYING_CLIPS[tasks.hand[row]], seconds=math.inf)
    return Outcome.WAIT


def lay(tasks: Tasks, row: int, time: float) -> Outcome:
    """Bring the held object to its place, upright, turned against the body as it is held."""
    simulation = tasks.simulation
    rotation = resting_rotation(tasks, row, int(tasks.object[row]))
    hand = hands_of(tasks, row)[0]
    simulation.grab.put(simulation.state, rows_of(row), hand, tasks.target_world[row], rotation)
    simulation.commands.stop_play(row)
    return Outcome.WAIT


def resting_rotation(tasks: Tasks, row: int, item: int) -> FloatArray:
    """Rotation in which the object is put down: upright as at the start, turned as it was taken.

    The arm swings about the body, so the heading is kept against the direction in which the person reaches.
    Another try turns it a little, since the wrist may not turn so far there.
    """
    heading = direction_to(tasks, row, tasks.target_world[row]) + float(tasks.held_heading[item])
    heading += OTHER_HEADINGS[int(tasks.attempt[row]) % len(OTHER_HEADINGS)]
    return multiply(about(1, heading), tasks.simulation.model.objects.start_rotation_world[item])


def direction_to(tasks: Tasks, row: int, point_world: FloatArray) -> float:
    """Heading from a person to a point, rad."""
    way = point_world - tasks.simulation.state.position_world[row]
    return math.atan2(way[0], way[2])


def heading_of(tasks: Tasks, item: int) -> float:
    """How far the object has been turned about the vertical since the start, rad."""
    start = tasks.simulation.model.objects.start_rotation_world[item]
    turned = multiply(tasks.simulation.objects.rotation_world[item], conjugate(start))
    return float(yaw_of(turned))


def let_go(tasks: Tasks, row: int, time: float) -> Outcome:
    """Open the hand; the object stays where it is."""
    simulation = tasks.simulation
    item = int(tasks.object[row])
    rotation = resting_rotation(tasks, row, item)
    for hand in hands_of(tasks, row):
        simulation.grab.release(simulation.state, rows_of(row), hand, tasks.target_world[row], rotation)
    tasks.is_delivered[item] = True
    name = simulation.model.objects.name[item]
    tasks.events.add(time, row, EventKind.OBJECT_PUT_DOWN, "put_down", name)
    return Outcome.WAIT


def extend(tasks: Tasks, row: int, time: float) -> Outcome:
    """Lay the hand on the object, or reach for the point with the finger tips."""
    simulation, state = tasks.simulation, tasks.simulation.state
    tips = np.array([0.0, -FINGER_TIPS * float(simulation.model.people.stature[row]) / 1.75, 0.0])
    for hand in hands_of(tasks, row):
        if tasks.object[row] >= 0:
            simulation.grab.touch(state, rows_of(row), hand, int(tasks.object[row]))
        else:
            simulation.reach.start(state, rows_of(row), hand, tasks.target_world[row], None, tips)
    return Outcome.WAIT


def offer(tasks: Tasks, row: int, time: float) -> Outcome:
    """Hold out the object between both people."""
    simulation, state = tasks.simulation, tasks.simulation.state
    ahead = np.array([math.sin(state.yaw[row]), 0.0, math.cos(state.yaw[row])])
    point = state.position_world[row] + OFFER_DISTANCE * ahead
    stature = simulation.model.people.stature
    _, taker, _ = task_of(tasks, row)
    is_low = state.is_seated[taker]
    point[1] = SEATED_HANDING_HEIGHT * stature[taker] if is_low else HANDING_HEIGHT * stature[row]
    hand = hands_of(tasks, row)[0]
    if tasks.hand[row] == Hand.BOTH:
        turn = simulation.objects.rotation_world[int(tasks.object[row])]
        simulation.grab.put(state, rows_of(row), hand, point, turn)
        return Outcome.WAIT
    grip = simulation.objects.grip_position[int(tasks.object[row]), hand]
    simulation.reach.start(state, rows_of(row), hand, point, None, grip)
    simulation.commands.stop_play(row)
    return Outcome.WAIT


def withdraw(tasks: Tasks, row: int, time: float) -> Outcome:
    """Take the hands back."""
    simulation = tasks.simulation
    for hand in hands_of(tasks, row):
        if simulation.state.grab_stage[row, hand] != HOLDING and simulation.state.grab_object[row, hand] >= 0:
            simulation.grab.release(simulation.state, rows_of(row), hand)
        simulation.reach.end(simulation.state, rows_of(row), hand)
    return Outcome.WAIT


# ---- with the rest of the body


def wait(tasks: Tasks, row: int, time: float) -> Outcome:
    """Do nothing for a while."""
    return Outcome.WAIT


def sit(tasks: Tasks, row: int, time: float) -> Outcome:
    """Sit down."""
    tasks.simulation.state.is_directed[row] = False
    tasks.simulation.sitting.sit(tasks.simulation.state, rows_of(row))
    return Outcome.WAIT


def stand_up(tasks: Tasks, row: int, time: float) -> Outcome:
    """Stand up."""
    tasks.simulation.sitting.stand(tasks.simulation.state, rows_of(row))
    return Outcome.WAIT


def play(tasks: Tasks, row: int, time: float) -> Outcome:
    """Play the clip."""
    simulation = tasks.simulation
    _, clip, _ = task_of(tasks, row)
    simulation.commands.play(row, simulation.model.clip_table.names[clip])
    return Outcome.WAIT


def let_go_of_everything(tasks: Tasks, row: int) -> None:
    """Give up what the present task was about; what is held stays held."""
    simulation, state = tasks.simulation, tasks.simulation.state
    rows = rows_of(row)
    tasks.claimed_by[tasks.claimed_by == row] = -1
    tasks.has_place[row] = False
    state.is_directed[row] = False
    state.wants_to_walk[row] = False
    for hand in (0, 1):
        if state.reach_stage[row, hand] != NONE:
            simulation.reach.end(state, rows, hand)
        if state.grab_object[row, hand] >= 0 and state.grab_stage[row, hand] != HOLDING:
            simulation.grab.release(state, rows, hand)
    simulation.gaze.release(state, rows)
