"""Choose what a task is about and where to stand for it: the first moves of tasks.

All have the form ``choose(tasks, row, time) -> Outcome``.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from crowd.state import BoolArray, FloatArray
from crowd.tasks.present_task import (
    are_empty,
    free_hand,
    held_object,
    holding_hand,
    is_too_big,
    task_of,
    wanted_hand,
)
from crowd.tasks.standing_place import find_standing_place, is_behind_walls
from crowd.tasks.support import is_carried
from crowd.tasks.task_list import Hand, Target, TaskKind
from crowd.tasks.waits import Outcome
from crowd.world.furniture import Furniture

if TYPE_CHECKING:
    from crowd.tasks.execution import Tasks

SEAT_CLEARANCE = 0.02
"""Distance of a seated person's disc from the seat, m."""
SEATED_REACH = 0.48
"""Ground distance from the feet within which seated people reach things without standing up, m."""
SEATED_SIDE = 1.1
"""Angle to a side within which they do, rad."""
SPOT_GAP = 0.16
"""Least distance between things on a board, m."""
SPOT_ROOM = 0.06
"""Distance that large things keep from the middles of others, m."""
NEIGHBORHOOD = 3.0
"""People farther than this from a target do not stand in the way, m."""
HIGHEST = 1.0
"""Height over stature above which people take other things of the kind first."""
MOST_CONSIDERED = 10
"""Objects or places on boards that are tried, the nearest first."""
TOUCHING = 1e-3
"""Overlap of two things that stand side by side, m."""


def choose_walk(tasks: Tasks, row: int, time: float) -> Outcome:
    """Find the point to walk to: given, or next to a piece of furniture."""
    simulation = tasks.simulation
    if tasks.lists.kind[row, tasks.index[row]] == TaskKind.CARRY_TO and held_object(tasks, row) < 0:
        return Outcome.EMPTY_HANDED
    kind, target, point = task_of(tasks, row)
    tasks.target_world[row] = point
    radius = float(simulation.model.radius[row])
    if kind is Target.FURNITURE:
        tasks.hand[row] = Hand.RIGHT
        spots = _nearest_furniture(tasks, row, target).spots()
        return _take_first_place(tasks, row, spots[_nearest(tasks, row, spots)])
    place = simulation.model.world.nearest_walkable(point[None].copy(), radius)[0]
    if np.isnan(place).any():
        return Outcome.FAIL
    tasks.place_world[row] = place
    tasks.has_place[row] = True
    return Outcome.NEXT


def choose_object(tasks: Tasks, row: int, time: float) -> Outcome:
    """Claim the nearest free object of the name, and a place from which to reach it."""
    simulation = tasks.simulation
    _, group, _ = task_of(tasks, row)
    objects = simulation.objects
    items = _that_are_somewhere(tasks, group)
    if items.size == 0:
        return Outcome.NOWHERE
    if (outcome := _with_own(tasks, row, items)) is not Outcome.FAIL:
        return outcome
    is_free = (objects.holder[items] < 0) & ((tasks.claimed_by[items] < 0) | (tasks.claimed_by[items] == row))
    if tasks.names.groups[group].is_kind:
        is_left = ~tasks.is_delivered[items]
        if not is_left.any():
            return Outcome.NOTHING_LEFT
        items, is_free = items[is_left], is_free[is_left]
    has_taken = not is_free.all()
    items = items[is_free]
    away = np.linalg.norm(objects.position_world[items] - simulation.state.position_world[row], axis=1)
    is_high = objects.position_world[items, 1] > HIGHEST * simulation.model.people.stature[row]
    nearest = items[np.lexsort((away, is_high))][:MOST_CONSIDERED]
    # What could not be taken from one place may be taken from another; so may its neighbour.
    nearest = np.roll(nearest, -((int(tasks.attempt[row]) + 1) // 2))
    met = set()
    for item in nearest:
        tasks.hand[row] = free_hand(tasks, row, int(item))
        tasks.target_world[row] = objects.position_world[item]
        if not are_empty(tasks, row):
            outcome = Outcome.HANDS_FULL
        else:
            outcome = Outcome.TOO_BIG if is_too_big(tasks, row, int(item)) else _take_place(tasks, row)
        if outcome is Outcome.NEXT:
            tasks.object[row] = item
            tasks.claimed_by[item] = row
            return outcome
        met.add(outcome)
    outcome = met.pop() if len(met) == 1 else Outcome.FAIL
    return Outcome.FAIL if outcome is Outcome.BEHIND_WALLS and has_taken else outcome


def _with_own(tasks: Tasks, row: int, items: npt.NDArray[np.intp]) -> Outcome:
    """What to do with an object of the name that the person holds itself, when no other one is free.

    What is held as wanted needs nothing, and what the other hand holds goes from hand to hand.
    """
    objects, wanted = tasks.simulation.objects, wanted_hand(tasks, row)
    mine = items[objects.holder[items] == row]
    if mine.size == 0 or (objects.holder[items] < 0).any():
        return Outcome.FAIL
    for item in mine:
        holding = holding_hand(tasks, int(item))
        if wanted in (Hand.ANY, holding) or holding == Hand.BOTH:
            tasks.object[row] = item
            return Outcome.DONE
    tasks.hand[row], tasks.object[row] = wanted, mine[0]
    tasks.target_world[row] = objects.position_world[mine[0]]
    tasks.has_place[row] = False
    return Outcome.NEXT if wanted != Hand.BOTH and are_empty(tasks, row) else Outcome.HANDS_FULL


def _that_are_somewhere(tasks: Tasks, group: int) -> npt.NDArray[np.intp]:
    """Objects of a name, without those whose position is not finite."""
    items = np.array(tasks.names.groups[group].rows, np.intp)
    return items[np.isfinite(tasks.simulation.objects.position_world[items]).all(axis=1)]


def choose_touch(tasks: Tasks, row: int, time: float) -> Outcome:
    """Find the point to touch and a place from which to reach it."""
    simulation = tasks.simulation
    kind, group, point = task_of(tasks, row)
    tasks.hand[row] = free_hand(tasks, row)
    tasks.object[row] = -1
    if kind is Target.OBJECTS:
        items = _that_are_somewhere(tasks, group)
        if items.size == 0:
            return Outcome.NOWHERE
        position = simulation.objects.position_world[items]
        nearest = int(np.argmin(np.linalg.norm(position - simulation.state.position_world[row], axis=1)))
        tasks.object[row] = items[nearest]
        point = position[nearest]
    return _take_first_place(tasks, row, point[None])


def choose_spot(tasks: Tasks, row: int, time: float) -> Outcome:
    """Find a free place for what the hand holds, and a place to stand."""
    simulation = tasks.simulation
    item = held_object(tasks, row, wanted_hand(tasks, row))
    if item < 0:
        return Outcome.EMPTY_HANDED
    tasks.object[row] = item
    tasks.hand[row] = holding_hand(tasks, item)
    kind, group, point = task_of(tasks, row)
    rotation = simulation.model.objects.start_rotation_world[item]
    lift = np.array([0.0, -simulation.model.objects.lowest_point(item, rotation), 0.0])
    places = (point[None] if kind is Target.POINT else _free_spots(tasks, row, group)) + lift
    outcome = _take_first_place(tasks, row, places[~_are_in_others(tasks, item, places)])
    if outcome is Outcome.NEXT and kind is Target.POINT and not is_carried(simulation, item, point):
        return Outcome.IN_THE_AIR
    return outcome


def _are_in_others(tasks: Tasks, item: int, places_world: FloatArray) -> BoolArray:
    """At which places (P, 3) an object would certainly be inside another one: balls within both overlap."""
    objects = tasks.simulation.objects
    inner = tasks.simulation.model.objects.half_size.min(axis=1)
    others = np.flatnonzero((objects.holder < 0) & np.isfinite(objects.position_world).all(axis=1))
    others = others[others != item]
    away = np.linalg.norm(places_world[:, None] - objects.position_world[others], axis=2)
    return np.asarray((away < inner[item] + inner[others] - TOUCHING).any(axis=1))


def _nearest_furniture(tasks: Tasks, row: int, group: int) -> Furniture:
    pieces = [tasks.simulation.model.furniture[index] for index in tasks.names.groups[group].rows]
    here = tasks.simulation.state.position_world[row]
    return min(pieces, key=lambda piece: float(np.linalg.norm(piece.center - here)))


def _nearest(tasks: Tasks, row: int, points_world: FloatArray) -> npt.NDArray[np.intp]:
    """Rows of the points nearest to the person, the nearest first, at most ten."""
    away = np.linalg.norm(points_world - tasks.simulation.state.position_world[row], axis=1)
    return np.argsort(away, kind="stable")[:MOST_CONSIDERED]


def _free_spots(tasks: Tasks, row: int, group: int) -> FloatArray:
    """Free places on the furniture of a name, the nearest to the person first, at most ten. (P, 3)"""
    simulation = tasks.simulation
    spots = np.concatenate([simulation.model.furniture[i].spots() for i in tasks.names.groups[group].rows])
    objects = simulation.objects
    used = [objects.position_world[objects.holder < 0]]
    putting = (
        tasks.lists.kind[np.arange(len(tasks.index)), tasks.index.clip(max=tasks.lists.length - 1)]
    ) == (TaskKind.PUT_DOWN)
    putting[row] = False
    used.append(tasks.target_world[putting & tasks.has_place])
    taken = np.concatenate(used)
    if len(taken):
        away = np.linalg.norm(spots[:, None, [0, 2]] - taken[None, :, [0, 2]], axis=2)
        spots = spots[(away > _gap_around(tasks, row)).all(axis=1)]
    return np.asarray(spots[_nearest(tasks, row, spots)])


def _gap_around(tasks: Tasks, row: int) -> float:
    """Least distance of other things from the one that the person puts down, m."""
    half = tasks.simulation.model.objects.half_size[int(tasks.object[row])]
    return max(SPOT_GAP, SPOT_ROOM + float(half[[0, 2]].max()))


def choose_seat(tasks: Tasks, row: int, time: float) -> Outcome:
    """Find a free seat and the place of the feet before it."""
    simulation = tasks.simulation
    _, group, _ = task_of(tasks, row)
    radius = float(simulation.model.radius[row])
    here = simulation.state.position_world[row]
    found = []
    has_room = False
    for index in tasks.names.groups[group].rows:
        place, yaw = simulation.model.furniture[index].sitting_place(radius + SEAT_CLEARANCE)
        if not simulation.model.world.is_walkable(place[None], radius)[0]:
            continue
        has_room = True
        if not _is_place_taken(tasks, row, place):
            is_cut_off = not simulation.model.world.is_reachable(here[None], place[None], radius)[0]
            found.append((is_cut_off, float(np.linalg.norm(place - here)), index, place, yaw))
    if not found:
        return Outcome.FAIL if has_room else Outcome.BEHIND_WALLS
    _, _, _, place, yaw = min(found, key=lambda entry: entry[:3])
    tasks.place_world[row], tasks.place_yaw[row] = place, yaw
    tasks.has_place[row] = True
    return Outcome.NEXT


def _is_place_taken(tasks: Tasks, row: int, place: FloatArray) -> bool:
    others = tasks.has_place.copy()
    others[row] = False
    seated = tasks.simulation.state.is_seated.copy()
    seated[row] = False
    at = [tasks.place_world[others], tasks.simulation.state.position_world[seated]]
    return bool((np.linalg.norm(np.concatenate(at) - place, axis=1) < 0.3).any())


def choose_look(tasks: Tasks, row: int, time: float) -> Outcome:
    """Find what to look at."""
    simulation = tasks.simulation
    kind, target, point = task_of(tasks, row)
    tasks.target_world[row] = point
    tasks.object[row] = -1
    if kind is Target.OBJECTS:
        items = _that_are_somewhere(tasks, target)
        if items.size == 0:
            return Outcome.NOWHERE
        away = simulation.objects.position_world[items] - simulation.state.position_world[row]
        tasks.object[row] = items[int(np.argmin(np.linalg.norm(away, axis=1)))]
    return Outcome.NEXT


def _is_in_seated_reach(tasks: Tasks, row: int, target_world: FloatArray) -> bool:
    """A seated person reaches the point without standing up."""
    state = tasks.simulation.state
    if not state.is_seated[row]:
        return False
    way = target_world - state.position_world[row]
    angle = (math.atan2(way[0], way[2]) - state.yaw[row] + math.pi) % (2.0 * math.pi) - math.pi
    return math.hypot(way[0], way[2]) < SEATED_REACH and abs(angle) < SEATED_SIDE


def _take_first_place(tasks: Tasks, row: int, targets_world: FloatArray) -> Outcome:
    """Choose where to stand for the first of the targets (P, 3) for which there is a place."""
    met = set()
    for target in targets_world:
        tasks.target_world[row] = target
        outcome = _take_place(tasks, row)
        if outcome is Outcome.NEXT:
            return outcome
        met.add(outcome)
    return Outcome.BEHIND_WALLS if met == {Outcome.BEHIND_WALLS} else Outcome.FAIL


def _take_place(tasks: Tasks, row: int) -> Outcome:
    """Choose where to stand for the target; seated people who reach it stay where they are."""
    simulation = tasks.simulation
    state, model = simulation.state, simulation.model
    if _is_in_seated_reach(tasks, row, tasks.target_world[row]):
        tasks.has_place[row] = False
        return Outcome.NEXT
    asked = (
        model.world,
        tasks.target_world[row],
        state.position_world[row],
        float(model.people.stature[row]),
        float(model.radius[row]),
        int(tasks.hand[row]),
    )
    place = find_standing_place(*asked, _taken_places(tasks, row), int(tasks.attempt[row]))
    if place is None:
        return Outcome.BEHIND_WALLS if is_behind_walls(*asked) else Outcome.FAIL
    tasks.place_world[row], tasks.place_yaw[row] = place.position_world, place.yaw
    tasks.has_place[row] = True
    return Outcome.NEXT


def _taken_places(tasks: Tasks, row: int) -> list[tuple[FloatArray, float]]:
    """Where others stand for their tasks, or will, and where people stand without any."""
    state, radius = tasks.simulation.state, tasks.simulation.model.radius
    others = np.flatnonzero(state.is_active)
    others = others[others != row]
    near = np.linalg.norm(
        np.where(tasks.has_place[others, None], tasks.place_world[others], state.position_world[others])
        - tasks.target_world[row],
        axis=1,
    )
    found = []
    for other in others[near < NEIGHBORHOOD]:
        if tasks.has_place[other]:
            found.append((tasks.place_world[other], float(radius[other])))
        elif not state.wants_to_walk[other]:
            found.append((state.position_world[other], float(radius[other])))
    return found
