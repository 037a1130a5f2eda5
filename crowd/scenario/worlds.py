"""Build a scenario's world, and let obstacles come and go by its timetable."""

import math
from dataclasses import dataclass

from crowd.scenario.schema import Box, Polygon, Scenario, TimedObstacle, Wall
from crowd.world import World
from crowd.world import obstacles as shapes


@dataclass(frozen=True)
class TimedShape:
    """An obstacle that is there from `appear_at` until `disappear_at` (s; infinite for ever)."""

    shape: shapes.Shape
    appear_at: float
    disappear_at: float


class TimedObstacles:
    """Obstacles that come and go. What is there is a function of time alone."""

    def __init__(self, timed: tuple[TimedShape, ...]) -> None:
        self._timed = timed
        self._present: dict[int, int] = {}

    def changes_after(self, time: float) -> bool:
        """Whether something comes or goes after a time, s."""
        return any(timed.appear_at > time or time < timed.disappear_at < math.inf for timed in self._timed)

    def update(self, world: World, time: float) -> bool:
        """Add and remove what `time` (s) asks for; returns whether the world changed."""
        changed = False
        for number, timed in enumerate(self._timed):
            is_due = timed.appear_at <= time < timed.disappear_at
            if is_due and number not in self._present:
                self._present[number] = world.add_obstacle(timed.shape)
                changed = True
            elif not is_due and number in self._present:
                world.remove_obstacle(self._present.pop(number))
                changed = True
        return changed


def obstacle_shapes(obstacle: TimedObstacle) -> list[shapes.Shape]:
    """Shapes of one obstacle of a scenario."""
    match obstacle:
        case Box():
            return [
                shapes.Box(*obstacle.x, *obstacle.z, height=obstacle.height, has_boards=bool(obstacle.boards))
            ]
        case Polygon():
            return [shapes.Polygon(obstacle.points, height=obstacle.height)]
        case Wall():
            pairs = zip(obstacle.points, obstacle.points[1:], strict=False)
            return [shapes.Wall(start, end, height=obstacle.height) for start, end in pairs]
    raise TypeError(type(obstacle).__name__)


def build_world(scenario: Scenario) -> tuple[World, TimedObstacles]:
    """Make the world of a scenario with what is always there, and the timetable of the rest."""
    ground = scenario.world
    permanent: list[shapes.Shape] = []
    timed: list[TimedShape] = []
    for obstacle in (*ground.boxes, *ground.polygons, *ground.walls):
        made = obstacle_shapes(obstacle)
        if obstacle.is_permanent:
            permanent.extend(made)
        else:
            end = math.inf if obstacle.disappear_at is None else obstacle.disappear_at
            timed.extend(TimedShape(shape, obstacle.appear_at, end) for shape in made)
    bounds = (*ground.bounds.x, *ground.bounds.z)
    return World(bounds, permanent), TimedObstacles(tuple(timed))
