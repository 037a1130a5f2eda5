"""Carry out task lists: each task is a fixed sequence of moves, and each move waits for something.

What people wait for is found for everyone at once; Python runs for a person only when a move ends.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from crowd.controllers.controller import Step
from crowd.controllers.sitting import SittingSettings
from crowd.motion.library import MotionLibrary
from crowd.state import BoolArray, FloatArray, IntArray
from crowd.tasks.acting import CARRYING_CLIPS, let_go_of_everything
from crowd.tasks.events import EventKind, Events
from crowd.tasks.partners import check_partners, missing_half
from crowd.tasks.programs import PROGRAMS
from crowd.tasks.settle import settle_parameters
from crowd.tasks.task_list import TaskArrays, TaskEncoder, TaskKind, TaskNames, scenario_tasks
from crowd.tasks.waits import WAITS_FOR_SOMEBODY, Outcome, Wait, has_failed, has_no_way, is_over

if TYPE_CHECKING:
    from crowd.simulation import Simulation

MOST_ATTEMPTS = 5
"""Times that a task is tried from another place before it fails."""
RETRY_AFTER = 0.5
"""Rest between two tries, s."""
MOST_WAITS = 120
"""Times that a person looks for a free object, seat or place before the task fails."""
LOOK_AGAIN_AFTER = 1.0
"""Time between two of these, s."""
HOPELESS = {
    Outcome.EMPTY_HANDED: "the hands are empty",
    Outcome.NOWHERE: "the object is nowhere",
    Outcome.HANDS_FULL: "the hands hold something else",
    Outcome.BEHIND_WALLS: "obstacles are in the way from every place to stand",
    Outcome.NOTHING_LEFT: "all of the kind have been put down already",
    Outcome.TOO_BIG: "the object is too big for the hands that were asked",
    Outcome.IN_THE_AIR: "there is nothing to put it on",
    Outcome.NO_WAY: "there is no way there",
}
"""Why tasks fail without another look."""
RESTING = 255
"""Value of `move` of a person who rests before the next try."""


class Tasks:
    """The task lists of everyone.

    Attributes
    ----------
    lists : TaskArrays
    index : (N,) int32
        Task that the character is at; as large as the list's count when all are done.
    move : (N,) uint8
        Move of the task that the character is at.
    attempt, look : (N,) uint8
        Tries of the present task that have failed; times that nothing free was found.
    wait : (N,) uint8
        `Wait`: what ends the present move.
    since, until : (N,) float64
        Times at which the present move began, and at which it ends or fails, s.
    object : (N,) int32
        Object that the present task is about, -1 for none.
    hand : (N,) int8
        0 right, 1 left, 2 both.
    target_world : (N, 3) float64
        Point to reach, m.
    place_world : (N, 3) float64
        Where the character stands for the task, m.
    place_yaw : (N,) float64
        Heading there, rad.
    has_place : (N,) bool
        The place is taken until the task ends.
    has_changed : (N,) bool
        Something of the list was done since it began, and was not so already.
    done, failed : (N,) int32
        Tasks that were done, and that failed for good.
    claimed_by : (M,) int32
        Character that is about to take an object, -1 for none.
    held_heading : (M,) float64
        Heading of an object against the direction in which a person has reached for it, rad.
    is_delivered : (M,) bool
        Somebody has put the object down; the name of its kind does not mean it any more, its own does.
    """

    def __init__(self, simulation: Simulation) -> None:
        model = simulation.model
        self.simulation = simulation
        self.events = Events()
        self.names = TaskNames.build(model.placed, model.objects, model.furniture, model.playable_clips())
        self.lists: TaskArrays = scenario_tasks(simulation.scenario, model.placed, self.names)
        if self.lists.count.any():
            require_clips(model.library)
            check_partners(self.lists, model.placed, simulation.scenario.source)
        capacity = model.capacity
        self.index: IntArray = np.zeros(capacity, np.int32)
        self.move: npt.NDArray[np.uint8] = np.zeros(capacity, np.uint8)
        self.attempt: npt.NDArray[np.uint8] = np.zeros(capacity, np.uint8)
        self.look: npt.NDArray[np.uint8] = np.zeros(capacity, np.uint8)
        self.wait: npt.NDArray[np.uint8] = np.zeros(capacity, np.uint8)
        self.since: FloatArray = np.zeros(capacity)
        self.until: FloatArray = np.zeros(capacity)
        self.object: IntArray = np.full(capacity, -1, np.int32)
        self.hand: npt.NDArray[np.int8] = np.zeros(capacity, np.int8)
        self.target_world: FloatArray = np.zeros((capacity, 3))
        self.place_world: FloatArray = np.zeros((capacity, 3))
        self.place_yaw: FloatArray = np.zeros(capacity)
        self.has_place: BoolArray = np.zeros(capacity, np.bool_)
        self.has_changed: BoolArray = np.zeros(capacity, np.bool_)
        self.done: IntArray = np.zeros(capacity, np.int32)
        self.failed: IntArray = np.zeros(capacity, np.int32)
        self.claimed_by: IntArray = np.full(model.objects.count, -1, np.int32)
        self.held_heading: FloatArray = np.zeros(model.objects.count)
        self.is_delivered: BoolArray = np.zeros(model.objects.count, np.bool_)

    def state_fields(self) -> dict[str, npt.NDArray[Any]]:
        """Arrays that change in a run."""
        own = {name: array for name, array in vars(self).items() if isinstance(array, np.ndarray)}
        return own | {f"lists_{name}": array for name, array in vars(self.lists).items()}

    def has_more(self, rows: IntArray) -> BoolArray:
        """Which of these people have tasks left."""
        return np.asarray(self.index[rows] < self.lists.count[rows])

    def enter(self, rows: IntArray) -> None:
        """Start the lists of people who have just entered."""
        self.index[rows] = 0
        self.has_place[rows] = False
        self.has_changed[rows] = False
        self._rewind(rows)
        busy = rows[self.has_more(rows)]
        self.simulation.state.is_finished[busy] = False
        self.simulation.population.has_tasks[busy] = True

    def give(self, row: int, arrays: TaskArrays) -> None:
        """Let a character do one list of tasks after those it has.

        Parameters
        ----------
        row : int
        arrays : TaskArrays
            With one row, at most as long as there is room.
        """
        done = int(self.index[row])
        left = int(self.lists.count[row]) - done
        added = int(arrays.count[0])
        for name, array in vars(self.lists).items():
            if name != "count":
                array[row, :left] = array[row, done : done + left].copy()
                array[row, left : left + added] = getattr(arrays, name)[0, :added]
        self.lists.count[row] = left + added
        self.index[row] = 0
        if left == 0:
            self._rewind(np.array([row], np.int32))
        self.simulation.state.is_finished[row] = False
        self.simulation.population.has_tasks[row] = True

    def room(self, row: int) -> int:
        """How many more tasks a character's list can hold."""
        return self.lists.length - int(self.lists.count[row] - self.index[row])

    def figures(self) -> dict[str, float | int]:
        """Tasks that were done, and that failed, when there are any."""
        if not self.lists.count.any():
            return {}
        return {"tasks.done": int(self.done.sum()), "tasks.failed": int(self.failed.sum())}

    def decide(self, step: Step) -> None:
        """Let people go on whose present move has ended."""
        doing = step.active[self.has_more(step.active)]
        if doing.size == 0:
            return
        self._settle(step, doing)
        # Each person has one outcome; the first of these counts.
        ended = is_over(self, step, doing)
        is_cut_off = has_no_way(self, step, doing) & ~ended
        has_failed_now = has_failed(self, step, doing) & ~(ended | is_cut_off)
        is_late = (self.until[doing] <= step.time) & ~(ended | is_cut_off | has_failed_now)
        for row in doing[ended]:
            self._advance(int(row), step.time)
        for row in doing[is_cut_off]:
            self._break_off(int(row), step.time, Outcome.NO_WAY)
        for row in doing[has_failed_now]:
            self._retry(int(row), step.time, "the hand cannot do it")
        for row in doing[is_late]:
            self._time_out(int(row), step.time)
        for row in doing[np.isin(self.wait[doing], WAITS_FOR_SOMEBODY)]:
            if why := missing_half(self, int(row)):
                let_go_of_everything(self, int(row))
                self._give_up(int(row), step.time, why)

    # ---- one person

    def _rewind(self, rows: IntArray) -> None:
        self.move[rows] = RESTING
        self.attempt[rows] = 0
        self.look[rows] = 0
        self.wait[rows] = Wait.TIME
        self.until[rows] = 0.0

    def _advance(self, row: int, time: float) -> None:
        """Begin the next moves of a person until one has to be waited for."""
        while True:
            program = PROGRAMS[TaskKind(int(self.lists.kind[row, self.index[row]]))]
            self.move[row] = 0 if self.move[row] == RESTING else self.move[row] + 1
            if self.move[row] >= len(program):
                self.has_changed[row] = True
                self._finish(row, time)
                return
            move = program[self.move[row]]
            outcome = move.begin(self, row, time)
            if outcome is Outcome.WAIT:
                self.wait[row] = move.wait
                self.since[row] = time
                self.until[row] = time + move.limit(self, row)
                return
            if outcome is Outcome.DONE:
                self._finish(row, time)
                return
            if outcome is not Outcome.NEXT:
                self._break_off(row, time, outcome)
                return

    def _break_off(self, row: int, time: float, outcome: Outcome) -> None:
        """Look again later for what may be there then, or give the task up."""
        may_change = self.simulation.model.timetable.changes_after(time)
        if outcome is Outcome.FAIL or (outcome is Outcome.BEHIND_WALLS and may_change):
            self._look_again(row, time)
            return
        let_go_of_everything(self, row)
        why = missing_half(self, row) if outcome is Outcome.ALONE else HOPELESS[outcome]
        self._give_up(row, time, why)

    def _time_out(self, row: int, time: float) -> None:
        """End a move whose time is over: waiting for time ends so, everything else has failed."""
        if self.wait[row] in (Wait.TIME, Wait.SETTLED, Wait.STANDING):
            self._advance(row, time)
        else:
            self._retry(row, time, f"waited too long: {Wait(int(self.wait[row])).name.lower()}")

    def _look_again(self, row: int, time: float) -> None:
        """Wait until something suitable is free, or give the task up."""
        let_go_of_everything(self, row)
        self.look[row] += 1
        if self.look[row] < MOST_WAITS:
            self._rest(row, time + LOOK_AGAIN_AFTER)
        else:
            self._give_up(row, time, "nothing suitable was free")

    def _retry(self, row: int, time: float, why: str) -> None:
        """Try the task again from another place, or give it up."""
        let_go_of_everything(self, row)
        self.attempt[row] += 1
        if self.attempt[row] < MOST_ATTEMPTS:
            self.events.add(time, row, EventKind.TASK_RETRIED, self.present(row), why)
            self._rest(row, time + RETRY_AFTER)
        else:
            self._give_up(row, time, why)

    def _rest(self, row: int, until: float) -> None:
        self.move[row] = RESTING
        self.wait[row] = Wait.TIME
        self.until[row] = until

    def _give_up(self, row: int, time: float, why: str) -> None:
        self.events.add(time, row, EventKind.TASK_FAILED, self.present(row), why)
        self.failed[row] += 1
        self._next(row, time)

    def present(self, row: int) -> str:
        """Action of a person's present task."""
        return TaskKind(int(self.lists.kind[row, self.index[row]])).name.lower()

    def _finish(self, row: int, time: float) -> None:
        self.events.add(time, row, EventKind.TASK_DONE, self.present(row))
        self.done[row] += 1
        self._next(row, time)

    def _next(self, row: int, time: float) -> None:
        """Go on to the next task; a list of which nothing could be done rests before it begins again."""
        self.has_place[row] = False
        rows = np.array([row], np.int32)
        self.index[row] += 1
        placed, state = self.simulation.model.placed, self.simulation.state
        self._rewind(rows)
        if self.index[row] >= self.lists.count[row] and placed.repeats_goals[row]:
            self.index[row] = 0
            if not self.has_changed[row]:
                self._rest(row, time + LOOK_AGAIN_AFTER)
            self.has_changed[row] = False
        if self.index[row] >= self.lists.count[row]:
            state.is_finished[row] = True
            state.is_active[row] = not placed.leaves_at_goal[row]

    def _settle(self, step: Step, doing: IntArray) -> None:
        """Move people who are nearly there to the very place and heading."""
        settling = doing[self.wait[doing] == Wait.SETTLED]
        if settling.size:
            step.state.directed_parameter[settling] = settle_parameters(
                step.state.position_world[settling],
                step.state.yaw[settling],
                self.place_world[settling],
                self.place_yaw[settling],
            )


def require_clips(library: MotionLibrary) -> None:
    """Check that a library has what tasks play.

    Raises
    ------
    MotionError
        It lacks one of the clips; importing it anew fills it from the built-in library.
    """
    for name in (*CARRYING_CLIPS, SittingSettings().clip):
        library.clip(name)


def encode_tasks(tasks: Tasks, entries: Any, label: str) -> TaskArrays:
    """Turn task tables as in a scenario file into a row of arrays.

    Raises
    ------
    ScenarioError
        With a line for each problem.
    MotionError
        The motion library lacks a clip that tasks play.
    """
    from crowd.scenario.load import read_tasks
    from crowd.scenario.source import Problems, ScenarioSource

    require_clips(tasks.simulation.model.library)
    source = ScenarioSource(label=label)
    tables = read_tasks(entries, source)
    problems = Problems(source)
    arrays = TaskArrays.empty(1, len(tables))
    arrays.count[0] = len(tables)
    encoder = TaskEncoder(tasks.names, problems)
    for column, table in enumerate(tables):
        encoder.encode(table, (column,), arrays, 0, column)
    problems.raise_if_any()
    return arrays
