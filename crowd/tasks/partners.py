"""Tasks about others: who hands over and who takes need each other, and nobody means oneself."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from crowd.errors import nearest_first
from crowd.scenario import PlacedCharacters
from crowd.scenario.source import Problems, ScenarioSource
from crowd.tasks.task_list import Target, TaskArrays, TaskKind

if TYPE_CHECKING:
    from crowd.tasks.execution import Tasks

OTHER_HALF = {TaskKind.HAND_OVER: TaskKind.TAKE_FROM, TaskKind.TAKE_FROM: TaskKind.HAND_OVER}
WITH_ONESELF = "nobody does this with oneself"


def check_partners(arrays: TaskArrays, placed: PlacedCharacters, source: ScenarioSource) -> None:
    """Check that nobody waits for somebody who has no task for it, and that no task is about oneself.

    Parameters
    ----------
    arrays : TaskArrays
    placed : PlacedCharacters
        Whose lists these are.
    source : ScenarioSource
        Used in messages.

    Raises
    ------
    ScenarioError
        With a line for each `hand_over` and `take_from` without its other half, and for each task about
        oneself.
    """
    problems = Problems(source)
    is_there = np.arange(arrays.length) < arrays.count[:, None]
    is_shared = np.isin(arrays.kind, tuple(OTHER_HALF)) & is_there
    is_own = (arrays.target_kind == Target.CHARACTER) & (
        arrays.target == np.arange(len(arrays.count))[:, None]
    )
    for row, column in np.argwhere(is_own & is_there):
        # A list that many people have may name one of them: the others look at that one.
        if is_shared[row, column] or placed.location[row][0] == "characters":
            kind, name = TaskKind(int(arrays.kind[row, column])), placed.name[row]
            problems.add(
                (*placed.location[row], "tasks", int(column), kind.name.lower()),
                WITH_ONESELF,
                name,
                nearest_first(name, set(placed.name) - {name}) or "somebody else, but there is nobody",
            )
    for row, column in np.argwhere(is_shared & ~is_own):
        kind, other = TaskKind(int(arrays.kind[row, column])), int(arrays.target[row, column])
        same = is_shared[row, : column + 1] & (arrays.kind[row, : column + 1] == kind)
        wanted = int((same & (arrays.target[row, : column + 1] == other)).sum())
        found = _count(arrays, other, OTHER_HALF[kind], row)
        begins_again = placed.repeats_goals[other] or placed.is_from_flow[other]
        if found >= wanted or (found and begins_again):
            continue
        half = _written(OTHER_HALF[kind], placed.name[row])
        others = [person for person in range(len(arrays.count)) if person != row]
        halves = {placed.name[other] for other in others if _count(arrays, other, OTHER_HALF[kind], row)}
        known = nearest_first(placed.name[other], halves)
        problems.add(
            (*placed.location[row], "tasks", int(column), kind.name.lower()),
            f"this person has {'only ' + str(found) if found else 'no'} task {half}",
            placed.name[other],
            f"somebody who has: {known or 'nobody here'}",
        )
    problems.raise_if_any()


def missing_half(tasks: Tasks, row: int) -> str:
    """Why nobody will do the other half of a person's present task; empty when somebody will."""
    kind = TaskKind(int(tasks.lists.kind[row, tasks.index[row]]))
    other = int(tasks.lists.target[row, tasks.index[row]])
    placed = tasks.simulation.model.placed
    if other == row:
        return WITH_ONESELF
    if not tasks.simulation.state.is_active[other]:
        return f"{placed.name[other]} is not there"
    first = 0 if placed.repeats_goals[other] else int(tasks.index[other])
    if _count(tasks.lists, other, OTHER_HALF[kind], row, first):
        return ""
    return f"{placed.name[other]} has no task {_written(OTHER_HALF[kind], placed.name[row])}"


def _written(kind: TaskKind, name: str) -> str:
    """A task about a person as a scenario file has it."""
    return f'{kind.name.lower()} = "{name}"'


def _count(arrays: TaskArrays, row: int, kind: TaskKind, target: int, first: int = 0) -> int:
    """Tasks of a kind about a person in a list, from a place on."""
    column = slice(first, int(arrays.count[row]))
    return int(((arrays.kind[row, column] == kind) & (arrays.target[row, column] == target)).sum())
