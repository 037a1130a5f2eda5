"""What can be said about a scenario as a whole before anybody is placed."""

from collections.abc import Collection

import numpy as np
import shapely

from crowd.errors import nearest_first
from crowd.scenario.geometry import Ground, is_within, obstacles, overlapping_pairs
from crowd.scenario.objects import place_objects
from crowd.scenario.schema import Goal, Scenario
from crowd.scenario.source import Location, Problems
from crowd.scenario.table import Point

TOUCHING = 1e-3
"""Overlap of bodies with bodies or walls at the start that does not count, m."""

METRIC_KEYS = (
    "characters",
    "seconds",
    "frames",
    "dt",
    "seed",
    "threads",
    "wall_seconds",
    "compile_seconds",
    "real_time_factor",
    "finished",
    "overlap.max_depth_m",
    "overlap.p99_depth_m",
    "wall.max_depth_m",
    "wall.crossings",
    "foot_slip.mean_m",
    "foot_slip.p95_m",
    "foot_slip.max_m",
    "foot_slip.stances",
    "locomotion.speed_rms_relative",
    "locomotion.turn_rms_deg_s",
    "locomotion.windows",
    "tasks.done",
    "tasks.failed",
    "reach.attempted",
    "reach.completed",
    "reach.error_mm.p50",
    "reach.error_mm.p99",
    "reach.error_mm.max",
    "reach.finger_depth_mm.max",
    "held.apart_mm.max",
    "placed.error_mm.max",
)
"""Metrics that a run reports and a scenario may bound."""


def check(scenario: Scenario) -> None:
    """Check everything that needs no random draws.

    Raises
    ------
    ScenarioError
        With a line for each problem.
    """
    problems = Problems(scenario.source)
    if not (scenario.characters or scenario.regions or scenario.flows):
        problems.add((), "has nobody in it", allowed="at least one of characters, regions, flows")
    _check_shapes(scenario, problems)
    problems.raise_if_any()
    _check_places(scenario, problems)
    _check_goals(scenario, problems)
    _check_individuals(scenario, problems)
    _check_names(scenario, problems)
    problems.raise_if_any()
    place_objects(scenario)


def check_clips(scenario: Scenario, known: Collection[str]) -> None:
    """Check that the clips a scenario plays exist.

    Parameters
    ----------
    scenario : Scenario
    known : collection of str
        Names of the clips that can be played.

    Raises
    ------
    ScenarioError
        With a line for each unknown name.
    """
    problems = Problems(scenario.source)
    named: list[tuple[Location, str]] = []
    for table in ("characters", "regions", "flows"):
        for index, owner in enumerate(getattr(scenario, table)):
            named.extend(((table, index, "gestures", n), clip) for n, clip in enumerate(owner.gestures))
    named.extend((("plays", index, "clip"), play.clip) for index, play in enumerate(scenario.plays))
    for location, clip in named:
        if clip not in known:
            problems.add(location, "unknown clip", clip, nearest_first(clip, known))
    problems.raise_if_any()


def _check_shapes(scenario: Scenario, problems: Problems) -> None:
    for location, item, shape in obstacles(scenario.world):
        if location[1] == "boxes":
            continue
        points = np.array(item.points)  # type: ignore[attr-defined]
        steps = np.hypot(*np.diff(points, axis=0).T)
        if (steps == 0.0).any():
            index = int(np.flatnonzero(steps == 0.0)[0]) + 1
            problems.add(
                (*location, "points", index), "repeats the point before it", list(map(float, points[index]))
            )
        elif not shapely.is_valid(shape):
            reason = str(shapely.is_valid_reason(shape)).replace("[", " at x, z = ").replace("]", "")
            problems.add((*location, "points"), "edges cross", reason, "a polygon whose edges do not meet")


def _check_places(scenario: Scenario, problems: Problems) -> None:
    bounds = scenario.world.bounds
    allowed = f"x {bounds.x[0]:g} to {bounds.x[1]:g}, z {bounds.z[0]:g} to {bounds.z[1]:g}"
    for index, region in enumerate(scenario.regions):
        if region.area is not None and not is_within(region.area, bounds):
            problems.add(("regions", index, "area"), "reaches outside the bounds", allowed=allowed)
    for index, flow in enumerate(scenario.flows):
        if not is_within(flow.source, bounds):
            problems.add(("flows", index, "source"), "reaches outside the bounds", allowed=allowed)


def _all_goals(scenario: Scenario) -> list[tuple[Location, Goal]]:
    found: list[tuple[Location, Goal]] = []
    for key in ("characters", "regions", "flows"):
        for index, owner in enumerate(getattr(scenario, key)):
            found.extend(((key, index, "goals", number), goal) for number, goal in enumerate(owner.goals))
    return found


def _task_points(scenario: Scenario, actions: tuple[str, ...]) -> list[tuple[Location, Point]]:
    """Ground points of tasks with these actions."""
    found: list[tuple[Location, Point]] = []
    for key in ("characters", "regions", "flows"):
        for index, owner in enumerate(getattr(scenario, key)):
            for number, task in enumerate(owner.tasks):
                for action in actions:
                    point = getattr(task, action)
                    if isinstance(point, tuple):
                        found.append(((key, index, "tasks", number, action), (point[0], point[-1])))
    return found


def _check_goals(scenario: Scenario, problems: Problems) -> None:
    ground = Ground(scenario.world, only_permanent=True)
    bounds = scenario.world.bounds
    allowed = f"x {bounds.x[0]:g} to {bounds.x[1]:g}, z {bounds.z[0]:g} to {bounds.z[1]:g}"
    goals = _all_goals(scenario)
    pointed = [((*loc, "position"), goal.position) for loc, goal in goals if goal.position is not None]
    pointed += _task_points(scenario, ("walk_to", "carry_to"))
    points = np.array([point for _, point in pointed]).reshape(-1, 2)
    is_outside, is_inside = ground.is_outside(points), ground.is_inside_obstacle(points)
    for (location, point), outside, inside in zip(pointed, is_outside, is_inside, strict=True):
        if outside:
            problems.add(location, "goal is outside the bounds", list(point), allowed)
        elif inside:
            problems.add(location, "goal is inside a wall", list(point), "a point on free ground")
    for location, point in _task_points(scenario, ("put_down", "touch")):
        if ground.is_outside(np.array([point]))[0]:
            problems.add(location, "point is outside the bounds", list(point), allowed)
    for location, goal in goals:
        if goal.area is not None and not is_within(goal.area, bounds):
            problems.add((*location, "area"), "reaches outside the bounds", allowed=allowed)


def _check_individuals(scenario: Scenario, problems: Problems) -> None:
    people = scenario.characters
    if not people:
        return
    ground = Ground(scenario.world)
    bounds = scenario.world.bounds
    allowed = f"x {bounds.x[0]:g} to {bounds.x[1]:g}, z {bounds.z[0]:g} to {bounds.z[1]:g}"
    position = np.array([person.position for person in people])
    radius = np.array([person.radius for person in people])
    outside, gap = ground.is_outside(position), ground.clearance(position)
    for index in np.flatnonzero(outside):
        problems.add(
            ("characters", int(index), "position"),
            "start is outside the bounds",
            list(people[index].position),
            allowed,
        )
    for index in np.flatnonzero(~outside & (gap < radius - TOUCHING)):
        problems.add(
            ("characters", int(index), "position"),
            f"start is inside a wall, or {gap[index]:.3g} m from it",
            list(people[index].position),
            f"at least the radius away, {radius[index]:g} m",
        )
    reported: set[int] = set()
    for first, second in overlapping_pairs(position, radius, TOUCHING):
        if int(second) in reported:
            continue
        reported.add(int(second))
        distance = float(np.hypot(*(position[first] - position[second])))
        problems.add(
            ("characters", int(second), "position"),
            f"start overlaps characters[{first}], {distance:.3g} m away",
            list(people[second].position),
            f"at least {radius[first] + radius[second]:g} m away",
        )


def _check_names(scenario: Scenario, problems: Problems) -> None:
    for key in scenario.expect:
        if key not in METRIC_KEYS:
            problems.add(("expect", key), "unknown metric", allowed=nearest_first(key, METRIC_KEYS))
    names = {
        owner.name
        for owner in (*scenario.characters, *scenario.regions, *scenario.flows)
        if owner.name is not None
    }
    for index, play in enumerate(scenario.plays):
        if play.who is not None and play.who not in names:
            allowed = nearest_first(play.who, names) if names else "nothing here has a name"
            problems.add(("plays", index, "who"), "nobody has this name", play.who, allowed)
