"""Task lists as arrays, and the names that tasks may use."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
import numpy.typing as npt

from crowd.errors import nearest_first
from crowd.scenario import PlacedCharacters, Scenario
from crowd.scenario.source import Location, Problems
from crowd.scenario.task_table import TaskTable
from crowd.world.furniture import Furniture
from crowd.world.objects import Objects

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int32]


class TaskKind(IntEnum):
    """What a task is; named and ordered as `crowd.scenario.task_table.ACTIONS`."""

    WALK_TO = 0
    CARRY_TO = 1
    PICK_UP = 2
    PUT_DOWN = 3
    TOUCH = 4
    HAND_OVER = 5
    TAKE_FROM = 6
    LOOK_AT = 7
    WAIT = 8
    SIT = 9
    STAND_UP = 10
    PLAY = 11


class Target(IntEnum):
    """What a task is about."""

    NOTHING = 0
    POINT = 1
    OBJECTS = 2
    FURNITURE = 3
    CHARACTER = 4
    CLIP = 5


NOUNS = {
    Target.OBJECTS: "object",
    Target.FURNITURE: "furniture",
    Target.CHARACTER: "person",
    Target.CLIP: "gesture or idle clip",
}
"""What messages call targets."""


class Hand(IntEnum):
    """Which hand does a task."""

    ANY = -1
    RIGHT = 0
    LEFT = 1
    BOTH = 2


FIRST_LENGTH = 8
"""Room for tasks of each person when the scenario gives shorter lists; programs may add longer ones."""


@dataclass(frozen=True, order=True)
class Group:
    """What one name stands for.

    Attributes
    ----------
    rows : tuple of int
        Of objects or of furniture.
    is_kind : bool
        It is the name of a kind, of which there may be one thing only; otherwise a thing's full name.
    """

    rows: tuple[int, ...]
    is_kind: bool


def groups_of(names: Sequence[str]) -> dict[str, Group]:
    """What each full name stands for, and each one without numbers at its end: ``cup_2`` and ``cup``.

    The full name of a thing means this thing only, also where others are called so with a number.
    """
    things: dict[str, list[int]] = {}
    kinds: dict[str, list[int]] = {}
    for row, name in enumerate(names):
        things.setdefault(name, []).append(row)
        while (kind := re.sub(r"(_\d+|\[\d+\])$", "", name)) != name:
            kinds.setdefault(kind, []).append(row)
            name = kind
    return {name: Group(tuple(rows), True) for name, rows in kinds.items()} | {
        name: Group(tuple(rows), False) for name, rows in things.items()
    }


@dataclass(frozen=True)
class TaskNames:
    """Everything that tasks can name.

    Attributes
    ----------
    groups : tuple of Group
    objects, furniture, seats : dict of str to int
        Index in `groups`; of full names and of kinds.
    characters, clips : dict of str to int
        Row of the character, or of the clip table.
    """

    groups: tuple[Group, ...]
    objects: Mapping[str, int]
    furniture: Mapping[str, int]
    seats: Mapping[str, int]
    characters: Mapping[str, int]
    clips: Mapping[str, int]

    @classmethod
    def build(
        cls,
        placed: PlacedCharacters,
        objects: Objects,
        furniture: Sequence[Furniture],
        clips: Mapping[str, int],
    ) -> "TaskNames":
        """Collect the names of a scene."""
        named = groups_of(objects.name)
        pieces = groups_of([piece.name for piece in furniture])
        seats = {
            name: Group(seat_rows, piece.is_kind)
            for name, piece in pieces.items()
            if (seat_rows := tuple(row for row in piece.rows if furniture[row].facing is not None))
        }
        groups = tuple(sorted({*named.values(), *pieces.values(), *seats.values()}))
        index = {group: number for number, group in enumerate(groups)}
        return cls(
            groups,
            {name: index[group] for name, group in named.items()},
            {name: index[group] for name, group in pieces.items()},
            {name: index[group] for name, group in seats.items()},
            {name: row for row, name in enumerate(placed.name)},
            clips,
        )

    def choices(self, action: str) -> tuple[tuple[Target, Mapping[str, int]], ...]:
        """What the name in a task with this action may stand for."""
        match action:
            case "pick_up" | "touch":
                return ((Target.OBJECTS, self.objects),)
            case "walk_to" | "carry_to" | "put_down":
                return ((Target.FURNITURE, self.furniture),)
            case "sit":
                return ((Target.FURNITURE, self.seats),)
            case "hand_over" | "take_from":
                return ((Target.CHARACTER, self.characters),)
            case "look_at":
                return (Target.OBJECTS, self.objects), (Target.CHARACTER, self.characters)
            case "play":
                return ((Target.CLIP, self.clips),)
        return ()


@dataclass
class TaskArrays:
    """Lists of tasks; leading axes: character, place in the list.

    Attributes
    ----------
    kind : (N, T) uint8
        `TaskKind`.
    target_kind : (N, T) uint8
        `Target`.
    target : (N, T) int32
        Row of the character or clip, or index in `TaskNames.groups`.
    point : (N, T, 3) float64
        m.
    hand : (N, T) int8
        `Hand`.
    seconds : (N, T) float64
        s.
    count : (N,) int32
        Tasks in the list.
    """

    kind: npt.NDArray[np.uint8]
    target_kind: npt.NDArray[np.uint8]
    target: IntArray
    point: FloatArray
    hand: npt.NDArray[np.int8]
    seconds: FloatArray
    count: IntArray

    @classmethod
    def empty(cls, capacity: int, length: int) -> "TaskArrays":
        """Make room for lists of a length."""
        shape = (capacity, length)
        return cls(
            np.zeros(shape, np.uint8),
            np.zeros(shape, np.uint8),
            np.zeros(shape, np.int32),
            np.zeros((*shape, 3)),
            np.zeros(shape, np.int8),
            np.zeros(shape),
            np.zeros(capacity, np.int32),
        )

    @property
    def length(self) -> int:
        """Most tasks that a list can hold."""
        return int(self.kind.shape[1])


class TaskEncoder:
    """Turns tasks into rows of arrays; what is wrong becomes a problem with file, line and key."""

    def __init__(self, names: TaskNames, problems: Problems) -> None:
        self._names = names
        self._problems = problems

    def encode(self, task: TaskTable, location: Location, arrays: TaskArrays, row: int, column: int) -> None:
        """Write one task."""
        action = task.action
        value = getattr(task, action)
        kind, target, point = Target.NOTHING, 0, (0.0, 0.0, 0.0)
        if isinstance(value, str):
            kind, target = self._named(action, value, (*location, action))
        elif isinstance(value, tuple):
            kind = Target.POINT
            point = value if len(value) == 3 else (value[0], 0.0, value[1])
        arrays.kind[row, column] = TaskKind[action.upper()]
        arrays.target_kind[row, column] = kind
        arrays.target[row, column] = target
        arrays.point[row, column] = point
        arrays.hand[row, column] = Hand[task.hand.upper()]
        arrays.seconds[row, column] = task.wait if task.wait is not None else task.seconds

    def _named(self, action: str, name: str, location: Location) -> tuple[Target, int]:
        choices = self._names.choices(action)
        for kind, known in choices:
            if name in known:
                return kind, known[name]
        known_names = [key for _, known in choices for key in known]
        what = "seat" if action == "sit" else " or ".join(NOUNS[kind] for kind, _ in choices)
        allowed = nearest_first(name, known_names) if known_names else f"there is no {what} here"
        self._problems.add(location, f"no {what} has this name", name, allowed)
        return Target.NOTHING, 0


def scenario_tasks(scenario: Scenario, placed: PlacedCharacters, names: TaskNames) -> TaskArrays:
    """Write the task lists of everyone in a scenario.

    Raises
    ------
    ScenarioError
        With a line for each name that nothing has.
    """
    problems = Problems(scenario.source)
    encoder = TaskEncoder(names, problems)
    owners = (*scenario.characters, *scenario.regions, *scenario.flows)
    longest = max((len(owner.tasks) for owner in owners), default=0)
    arrays = TaskArrays.empty(placed.count, max(longest, FIRST_LENGTH))
    written: dict[Location, int] = {}
    for row, location in enumerate(placed.location):
        table, index = str(location[0]), int(location[1])
        tasks = getattr(scenario, table)[index].tasks
        arrays.count[row] = len(tasks)
        if location in written:
            for name in ("kind", "target_kind", "target", "point", "hand", "seconds"):
                getattr(arrays, name)[row] = getattr(arrays, name)[written[location]]
            continue
        written[location] = row
        for column, task in enumerate(tasks):
            encoder.encode(task, (*location, "tasks", column), arrays, row, column)
    problems.raise_if_any()
    return arrays
