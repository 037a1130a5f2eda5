"""Turn a scenario into people: who starts where, with which body, speed and goals.

Every draw depends on (seed, table, index, attempt) only, so that people added to one region leave all others
where they are.
"""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from crowd.scenario.geometry import Ground, overlapping_pairs
from crowd.scenario.goals import GoalPlaces, PlacedGoal, Walker
from crowd.scenario.plays import PlaySchedule, build_plays
from crowd.scenario.scaling import scaled
from crowd.scenario.schema import (
    ADULT_STATURE,
    Area,
    Character,
    Flow,
    GoalList,
    Region,
    Scenario,
    Spread,
)
from crowd.scenario.source import Location, Problems
from crowd.scenario.starts import Starts, on_circle
from crowd.scenario.table import Point
from crowd_kernels.random import normal, uniform

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]
BoolArray = npt.NDArray[np.bool_]

PURPOSE_RADIUS = 101
PURPOSE_SPEED = 102
PURPOSE_STATURE = 103
PURPOSE_FACING = 104
PEOPLE_PER_TABLE = 1 << 20


@dataclass(frozen=True)
class PlacedFlow:
    """People who keep coming in.

    Attributes
    ----------
    name : str
    slots : (S,) int64
        Rows that people of this flow may take, one person at a time in each.
    source : Area
        Where they appear.
    rate : float
        People per second.
    start_at : float
        Time of the first person, s.
    limit : int or None
        People in all.
    """

    name: str
    slots: IntArray
    source: Area
    rate: float
    start_at: float
    limit: int | None


@dataclass(frozen=True)
class PlacedCharacters:
    """Arrays with one row for each person; slots of flows come last.

    Attributes
    ----------
    name : tuple of str
        ``"regions[0][17]"`` where nobody gave a name; for messages.
    location : tuple of location
        Table of the scenario that each person comes from, such as ``("regions", 0)``.
    key : (N,) int64
        Stable number of each person for draws, whoever else is there.
    position_world : (N, 3) float64
        Start, m. For slots of flows, the middle of the source.
    yaw : (N,) float64
        Heading at the start, rad.
    radius, preferred_speed, stature : (N,) float64
        m, m/s, m.
    is_from_flow : (N,) bool
        Not there at the start.
    leaves_at_goal : (N,) bool
        Leaves the scene after the last goal.
    repeats_goals : (N,) bool
        Begins again after the last goal.
    glances : (N,) bool
        Looks at people who come near.
    look_at_world : (N, 3) float64
        Point looked at from the start, m; NaN for none.
    attention : tuple of str
        How the eyes jump.
    first_goal, goal_count : (N,) int64
        Range of rows of the goal arrays.
    goal_world : (G, 3) float64
        Point, m; the middle of an area.
    goal_radius, goal_wait : (G,) float64
        Distance at which it is reached, m; time to stay there, s.
    goal_speed : (G,) float64
        m/s; NaN for the person's own.
    goal_is_area : (G,) bool
        Each visit draws its own point in the area.
    goal_area : (G, 4) float64
        Lowest and highest x, lowest and highest z, m.
    flows : tuple of PlacedFlow
    plays : PlaySchedule
        Clips that the scenario plays.
    """

    name: tuple[str, ...]
    location: tuple[Location, ...]
    key: IntArray
    position_world: FloatArray
    yaw: FloatArray
    radius: FloatArray
    preferred_speed: FloatArray
    stature: FloatArray
    is_from_flow: BoolArray
    leaves_at_goal: BoolArray
    repeats_goals: BoolArray
    glances: BoolArray
    look_at_world: FloatArray
    attention: tuple[str, ...]
    first_goal: IntArray
    goal_count: IntArray
    goal_world: FloatArray
    goal_radius: FloatArray
    goal_wait: FloatArray
    goal_speed: FloatArray
    goal_is_area: BoolArray
    goal_area: FloatArray
    flows: tuple[PlacedFlow, ...]
    plays: PlaySchedule

    @property
    def count(self) -> int:
        """People and slots."""
        return len(self.name)


def place(scenario: Scenario, seed: int, characters: int | None = None) -> PlacedCharacters:
    """Place everybody and draw what differs between people.

    Parameters
    ----------
    scenario : Scenario
    seed : int
        Key of all draws.
    characters : int, optional
        Number of people at the start, instead of the scenario's own.

    Returns
    -------
    PlacedCharacters
        No two bodies overlap, and none is in a wall.

    Raises
    ------
    ScenarioError
        A region is too small for its people, or a start or a goal is in a wall.
    """
    if characters is not None:
        scenario = scaled(scenario, characters)
    builder = _Builder(scenario, seed)
    builder.take_circles()
    for index, person in enumerate(scenario.characters):
        builder.add_individual(index, person)
    for index, region in enumerate(scenario.regions):
        if region.count:
            builder.add_region(index, region)
    builder.check_overlaps()
    for index, flow in enumerate(scenario.flows):
        builder.add_flow(index, flow)
    builder.problems.raise_if_any()
    return builder.result()


def draw(spread: Spread, seed: int, key: int, purpose: int) -> float:
    """Draw one person's value."""
    low, high = spread.bounds
    if spread.mean is None or spread.deviation is None:
        return low + (high - low) * uniform(seed, key, 0, purpose)
    for attempt in range(100):
        value = spread.mean + spread.deviation * float(normal(seed, key, attempt, purpose))
        if low <= value <= high:
            return value
    return min(max(spread.mean, low), high)


@dataclass
class _Person:
    """One row while it is built."""

    location: Location
    name: str
    key: int
    position: Point
    radius: float
    speed: float
    stature: float
    goals: GoalList
    leaves: bool
    facing: float | str | None
    center: Point
    is_from_flow: bool = False


class _Builder:
    """Collects people row by row."""

    def __init__(self, scenario: Scenario, seed: int) -> None:
        self.scenario = scenario
        self.seed = seed
        self.ground = Ground(scenario.world)
        self.problems = Problems(scenario.source)
        self.goal_places = GoalPlaces(Ground(scenario.world, only_permanent=True), seed, self.problems)
        self.starts = Starts(self.ground, seed)
        self.people: list[_Person] = []
        self.flows: list[PlacedFlow] = []
        self.members: dict[str, list[int]] = {}

    def add_individual(self, index: int, person: Character) -> None:
        """Add one person whose start is given."""
        key = index
        stature = person.height or draw(ADULT_STATURE, self.seed, key, PURPOSE_STATURE)
        self.starts.take(person.position, person.radius)
        self._append(
            _Person(
                ("characters", index),
                person.name or f"characters[{index}]",
                key,
                person.position,
                person.radius,
                person.speed,
                stature,
                person,
                person.on_arrival == "leave",
                person.facing,
                person.position,
            )
        )

    def take_circles(self) -> None:
        """Reserve the places around circles, so that random starts keep clear of them."""
        for index, region in enumerate(self.scenario.regions):
            if region.circle is not None:
                for number, point in enumerate(on_circle(region)):
                    key = (index + 1) * PEOPLE_PER_TABLE + number
                    self.starts.take(point, draw(region.radius, self.seed, key, PURPOSE_RADIUS))

    def add_region(self, index: int, region: Region) -> None:
        """Add the people of a region."""
        location: Location = ("regions", index)
        first_key = (index + 1) * PEOPLE_PER_TABLE
        keys = range(first_key, first_key + region.count)
        radius = [draw(region.radius, self.seed, key, PURPOSE_RADIUS) for key in keys]
        if region.circle is not None:
            places = on_circle(region)
            center = region.circle.center
            for place_index, (point, r) in enumerate(zip(places, radius, strict=True)):
                self._check_start(location, place_index, point, r)
        else:
            assert region.area is not None
            center = (sum(region.area.x) / 2, sum(region.area.z) / 2)
            find = self.starts.on_grid if region.arrangement == "grid" else self.starts.at_random
            places = find(region.area, keys, radius, region.spacing)
            if len(places) < region.count:
                self.problems.add(
                    (*location, "count"),
                    "region is too small for its people",
                    region.count,
                    f"about {len(places)} with this area, spacing and radius",
                )
                return
        for number, (key, point, r) in enumerate(zip(keys, places, radius, strict=True)):
            self._append(
                _Person(
                    location,
                    f"{region.name or f'regions[{index}]'}[{number}]",
                    key,
                    point,
                    r,
                    draw(region.speed, self.seed, key, PURPOSE_SPEED),
                    draw(region.height, self.seed, key, PURPOSE_STATURE),
                    region,
                    region.on_arrival == "leave",
                    region.facing,
                    center,
                )
            )

    def add_flow(self, index: int, flow: Flow) -> None:
        """Add the slots of a flow."""
        location: Location = ("flows", index)
        slot_count = min(flow.most_present, flow.limit or flow.most_present)
        first_key = (index + 1 + len(self.scenario.regions)) * PEOPLE_PER_TABLE
        center = (sum(flow.source.x) / 2, sum(flow.source.z) / 2)
        first_row = len(self.people)
        largest = flow.radius.bounds[1]
        if min(flow.source.x[1] - flow.source.x[0], flow.source.z[1] - flow.source.z[0]) < 2 * largest:
            self.problems.add(
                (*location, "source"),
                "is too small for a body",
                allowed=f"sides of at least {2 * largest:g} m",
            )
        for number in range(slot_count):
            key = first_key + number
            self._append(
                _Person(
                    location,
                    f"{flow.name or f'flows[{index}]'}[{number}]",
                    key,
                    center,
                    draw(flow.radius, self.seed, key, PURPOSE_RADIUS),
                    draw(flow.speed, self.seed, key, PURPOSE_SPEED),
                    draw(flow.height, self.seed, key, PURPOSE_STATURE),
                    flow,
                    flow.on_arrival == "leave",
                    flow.facing,
                    center,
                    is_from_flow=True,
                )
            )
        slots = np.arange(first_row, first_row + slot_count, dtype=np.int64)
        name = flow.name or f"flows[{index}]"
        self.flows.append(PlacedFlow(name, slots, flow.source, flow.rate, flow.start_at, flow.limit))

    def check_overlaps(self) -> None:
        """Report bodies that overlap although their places were given."""
        position = np.array([person.position for person in self.people]).reshape(-1, 2)
        radius = np.array([person.radius for person in self.people])
        for first, second in overlapping_pairs(position, radius, 1e-3):
            distance = float(np.hypot(*(position[first] - position[second])))
            person = self.people[second]
            self.problems.add(
                person.location,
                f"start of {person.name} overlaps {self.people[first].name}, {distance:.3g} m away",
                [round(value, 3) for value in person.position],
                f"at least {radius[first] + radius[second]:.3g} m away",
            )

    def result(self) -> PlacedCharacters:
        """Pack everything into arrays."""
        people = self.people
        points = np.array([person.position for person in people], np.float64).reshape(-1, 2)
        position_world = np.zeros((len(people), 3))
        position_world[:, [0, 2]] = points
        goals, first_goal, goal_count = self._goals()
        self.problems.raise_if_any()
        goal_world = np.zeros((len(goals), 3))
        goal_world[:, [0, 2]] = np.array([goal.position for goal in goals], np.float64).reshape(-1, 2)
        yaw = np.array(
            [
                self._yaw(person, goal_world[start] if n else None)
                for person, start, n in zip(people, first_goal, goal_count, strict=True)
            ],
            np.float64,
        )
        areas = [
            (*goal.area.x, *goal.area.z)
            if goal.area is not None
            else (goal.position[0],) * 2 + (goal.position[1],) * 2
            for goal in goals
        ]
        return PlacedCharacters(
            name=tuple(person.name for person in people),
            location=tuple(person.location for person in people),
            key=np.array([person.key for person in people], np.int64),
            position_world=position_world,
            yaw=yaw,
            radius=np.array([person.radius for person in people], np.float64),
            preferred_speed=np.array([person.speed for person in people], np.float64),
            stature=np.array([person.stature for person in people], np.float64),
            is_from_flow=np.array([person.is_from_flow for person in people], np.bool_),
            leaves_at_goal=np.array([person.leaves for person in people], np.bool_),
            repeats_goals=np.array([person.goals.repeat for person in people], np.bool_),
            glances=np.array([person.goals.glances for person in people], np.bool_),
            look_at_world=np.array(
                [person.goals.look_at or (math.nan,) * 3 for person in people], np.float64
            ).reshape(-1, 3),
            attention=tuple(person.goals.attention for person in people),
            first_goal=first_goal,
            goal_count=goal_count,
            goal_world=goal_world,
            goal_radius=np.array([goal.goal.radius for goal in goals], np.float64),
            goal_wait=np.array([goal.goal.wait_seconds for goal in goals], np.float64),
            goal_speed=np.array([goal.goal.speed or math.nan for goal in goals], np.float64),
            goal_is_area=np.array([goal.area is not None for goal in goals], np.bool_),
            goal_area=np.array(areas, np.float64).reshape(-1, 4),
            flows=tuple(self.flows),
            plays=build_plays(self.scenario, self.seed, self.members, len(people)),
        )

    def _append(self, person: _Person) -> None:
        row = len(self.people)
        table, index = person.location[:2]
        self.people.append(person)
        self.members.setdefault(f"{table}[{index}]", []).append(row)
        if person.goals.name is not None:
            self.members.setdefault(person.goals.name, []).append(row)

    def _check_start(self, location: Location, number: int, point: Point, radius: float) -> None:
        if self.ground.clearance(np.array([point]))[0] < radius - 1e-3:
            self.problems.add(
                (*location, "circle"),
                f"start of person {number} is inside a wall or outside the bounds",
                [round(value, 3) for value in point],
                f"at least the radius away from walls, {radius:.3g} m",
            )

    def _yaw(self, person: _Person, goal: FloatArray | None) -> float:
        """Heading at the start, rad."""
        facing = person.facing
        if isinstance(facing, int | float):
            return math.radians(facing)
        if facing == "random" or (facing == "goal" and goal is None):
            return 2.0 * math.pi * float(uniform(self.seed, person.key, 0, PURPOSE_FACING)) - math.pi
        target = person.center if facing == "center" or goal is None else (goal[0], goal[2])
        x, z = target[0] - person.position[0], target[1] - person.position[1]
        return math.atan2(x, z) if (x, z) != (0.0, 0.0) else 0.0

    def _goals(self) -> tuple[list[PlacedGoal], IntArray, IntArray]:
        goals: list[PlacedGoal] = []
        first = np.zeros(len(self.people), np.int64)
        count = np.zeros(len(self.people), np.int64)
        for row, person in enumerate(self.people):
            first[row] = len(goals)
            count[row] = len(person.goals.goals)
            for number, goal in enumerate(person.goals.goals):
                location = (*person.location, "goals", number)
                is_drawn_again = person.goals.repeat or person.is_from_flow
                walker = Walker(person.name, person.key, person.position, person.radius, is_drawn_again)
                goals.append(self.goal_places.place(walker, number, goal, location))
        return goals, first, count
