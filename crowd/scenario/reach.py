"""Check that everybody can walk to all goals."""

import numpy as np

from crowd.scenario.placement import PlacedCharacters
from crowd.scenario.schema import Scenario
from crowd.scenario.source import Location, Problems
from crowd.world.world import RADIUS_STEP, World, radius_class


def check_reachable(scenario: Scenario, placed: PlacedCharacters, world: World) -> None:
    """Check that obstacles which are always there leave a way from each start to each goal.

    Parameters
    ----------
    scenario : Scenario
        Named in messages.
    placed : PlacedCharacters
    world : World
        With permanent obstacles only.

    Raises
    ------
    ScenarioError
        With a line for each goal that somebody cannot reach.
    """
    problems = Problems(scenario.source)
    person = np.repeat(np.arange(placed.count), placed.goal_count)
    start = placed.position_world[person]
    size = np.array([radius_class(radius) for radius in placed.radius], np.int64)[person]
    is_reachable = np.zeros(len(person), np.bool_)
    for step in np.unique(size):
        rows = np.flatnonzero(size == step)
        is_reachable[rows] = world.is_reachable(
            start[rows], placed.goal_world[rows], float(step) * RADIUS_STEP
        )
    reported: set[Location] = set()
    for goal in np.flatnonzero(~is_reachable):
        row = int(person[goal])
        location = (*placed.location[row], "goals", int(goal - placed.first_goal[row]))
        if location in reported:
            continue
        reported.add(location)
        x, z = start[goal, [0, 2]].round(3).tolist()
        radius = f"{placed.radius[row]:.3g} m"
        problems.add(
            location,
            "goal cannot be reached",
            placed.goal_world[goal, [0, 2]].round(3).tolist(),
            f"a point to which a way leads from [{x:g}, {z:g}] for a body of radius {radius}",
        )
    problems.raise_if_any()
