"""Points of goals: given, opposite to the start, or drawn in an area."""

from dataclasses import dataclass

import numpy as np

from crowd.scenario.geometry import Ground
from crowd.scenario.schema import Area, Goal
from crowd.scenario.source import Location, Problems
from crowd.scenario.table import Point
from crowd_kernels.random import uniform

PURPOSE_GOAL = 105
GOAL_ATTEMPTS = 2000


@dataclass(frozen=True)
class Walker:
    """What a goal's place depends on.

    Attributes
    ----------
    name : str
        For messages.
    key : int
        Key of the person's draws.
    start : Point
    radius : float
        Body disc, m.
    visits_again : bool
        The goal is visited more than once, so that an area is drawn in anew each time.
    """

    name: str
    key: int
    start: Point
    radius: float
    visits_again: bool


@dataclass(frozen=True)
class PlacedGoal:
    """A goal with its point; `area` is kept where each visit draws its own."""

    goal: Goal
    position: Point
    area: Area | None


class GoalPlaces:
    """Finds the points of goals on ground that is always free."""

    def __init__(self, ground: Ground, seed: int, problems: Problems) -> None:
        self._ground = ground
        self._seed = seed
        self._problems = problems

    def place(self, walker: Walker, number: int, goal: Goal, location: Location) -> PlacedGoal:
        """Find the point of a walker's goal of a given number; what is wrong becomes a problem."""
        if goal.position is not None:
            return PlacedGoal(goal, goal.position, None)
        if goal.swap_through is not None:
            return PlacedGoal(goal, self._opposite(walker, goal.swap_through, location), None)
        assert goal.area is not None
        clearance = goal.clearance if goal.clearance is not None else walker.radius
        point = self._draw(goal.area, clearance, walker.key, number)
        if point is None:
            room = f"room for {clearance:g} m"
            self._problems.add((*location, "area"), "no free ground in the area", allowed=room)
            return PlacedGoal(goal, walker.start, None)
        return PlacedGoal(goal, point, goal.area if walker.visits_again else None)

    def _opposite(self, walker: Walker, center: Point, location: Location) -> Point:
        point = (2.0 * center[0] - walker.start[0], 2.0 * center[1] - walker.start[1])
        if self._ground.clearance(np.array([point]))[0] < walker.radius - 1e-3:
            self._problems.add(
                (*location, "swap_through"),
                f"goal of {walker.name} is inside a wall or outside the bounds",
                [round(value, 3) for value in point],
                "free ground",
            )
        return point

    def _draw(self, area: Area, clearance: float, key: int, number: int) -> Point | None:
        """Draw points until one is clear of obstacles."""
        for attempt in range(GOAL_ATTEMPTS):
            step = number * GOAL_ATTEMPTS + attempt
            u = float(uniform(self._seed, key, step, PURPOSE_GOAL))
            v = float(uniform(self._seed, key, step, ~PURPOSE_GOAL))
            point = (area.x[0] + u * (area.x[1] - area.x[0]), area.z[0] + v * (area.z[1] - area.z[0]))
            if self._ground.clearance(np.array([point]))[0] >= clearance:
                return point
        return None
