"""Read SteerBench test cases (XML, version 1.0 of the format, as in SteerSuite 1.3).

Everybody starts standing and faces the given direction; a goal counts as reached at less than 0.5 m, and
people leave the scene after their last goal, because several of them may share one goal point.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from crowd.errors import ScenarioError, describe, nearest_first
from crowd.scenario.schema import Scenario
from crowd.scenario.source import Location, ScenarioSource
from crowd.scenario.steerbench_placement import ReaderPlacement, ReaderRandom
from crowd.scenario.xml_tree import Element, parse_xml

NAMESPACE = "http://www.magix.ucla.edu/steerbench"
VERSION = "1.0"
GOAL_RADIUS = 0.5
RANDOM_GOAL_CLEARANCE = 1.0
DEFAULT_DURATION = 100_000.0
LONGEST_RUN = 900.0
SIDES = ("xmin", "xmax", "ymin", "ymax", "zmin", "zmax")
CHILDREN = {
    "SteerBenchTestCase": (
        "header",
        "suggestedCameraView",
        "agent",
        "agentRegion",
        "obstacle",
        "obstacleRegion",
    ),
    "header": ("version", "name", "worldBounds", "description", "passingCriteria"),
    "agent": ("name", "initialConditions", "goalSequence"),
    "agentRegion": ("numAgents", "regionBounds", "initialConditions", "goalSequence"),
    "obstacleRegion": ("numObstacles", "regionBounds", "obstacleSize", "obstacleHeight"),
}
GOAL_CHILDREN = {
    "seekStaticTarget": ("targetLocation",),
    "fleeStaticTarget": ("targetLocation",),
    "seekDynamicTarget": ("targetName", "random"),
    "fleeDynamicTarget": ("targetName", "random"),
    "flowStaticDirection": ("targetDirection",),
    "flowDynamicDirection": ("type",),
    "idle": (),
}
RUN_GOALS = ("seekStaticTarget", "flowStaticDirection", "idle")

Bounds = dict[str, float]


@dataclass(frozen=True)
class _Agent:
    """What an agent or an agent region says about one person."""

    element: Element
    name: str | None
    position: tuple[float, float] | None
    direction: tuple[float, float] | None
    radius: float
    goals: Sequence[dict[str, Any]]
    goal_elements: Sequence[Element]


def read_steerbench(path: Path) -> Scenario:
    """Read a test case; the recipe for random starts is the original reader's, random goals are our own.

    Parameters
    ----------
    path : Path

    Returns
    -------
    Scenario
        Named after the file, with everybody as an individual in file order.

    Raises
    ------
    ScenarioError
        The file is not a test case of version 1.0, a region is too small, or a goal is of a kind that is not
        run.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise ScenarioError(describe(str(path), "cannot be read", error.strerror or str(error))) from error
    return _Reader(path).read(data)


class _Reader:
    """Reads one file."""

    def __init__(self, path: Path) -> None:
        self.label = path.name
        self.name = path.stem
        self.lines: dict[Location, int] = {}
        self.bounds: Bounds = {}

    def read(self, data: bytes) -> Scenario:
        root = parse_xml(data, self.label)
        if root.name != "SteerBenchTestCase" or root.namespace != NAMESPACE:
            found = f"{{{root.namespace}}}{root.name}"
            raise self._error(
                root, "is not a SteerBench test case", found, f"{{{NAMESPACE}}}SteerBenchTestCase"
            )
        self._expect_children(root)
        header = self._child(root, "header")
        self._expect_children(header)
        version = self._child(header, "version")
        if version.text != VERSION:
            raise self._error(version, "unknown version", version.text, VERSION)
        self.bounds = self._box(self._child(header, "worldBounds"))
        description = header.child("description")
        placement = ReaderPlacement(ReaderRandom())
        boxes = self._fixed_boxes(root, placement)
        # The order of the draws: whatever the file's own, regions of people come last.
        fixed = self._fixed_people(root, placement)
        self._add_random_boxes(boxes, root, placement)
        people = fixed + self._region_people(root, placement)
        if not people:
            raise self._error(root, "has no agents", allowed="at least one agent or agentRegion")
        return self._scenario(description.text if description else "", boxes, people, data)

    def _scenario(
        self, description: str, boxes: list[dict[str, Any]], people: list[dict[str, Any]], data: bytes
    ) -> Scenario:
        from crowd.scenario.load import scenario_from

        source = ScenarioSource(
            self.label, data.decode("utf-8", errors="replace"), find_lines=lambda: self.lines
        )
        bounds = {
            "x": (self.bounds["xmin"], self.bounds["xmax"]),
            "z": (self.bounds["zmin"], self.bounds["zmax"]),
        }
        content = {
            "name": self.name,
            "description": " ".join(description.split()),
            "seconds": self._run_seconds(people),
            "world": {"bounds": bounds, "boxes": boxes},
            "characters": people,
        }
        return scenario_from(content, source)

    def _run_seconds(self, people: list[dict[str, Any]]) -> float:
        """Twice the ideal time and a minute; jams of many people need up to fifteen minutes."""
        if len(people) > 50:
            return LONGEST_RUN
        longest = 0.0
        for person in people:
            x, z = person["position"]
            time = 0.0
            for goal in person["goals"]:
                if "position" not in goal:
                    return LONGEST_RUN
                next_x, next_z = goal["position"]
                time += math.hypot(next_x - x, next_z - z) / goal["speed"] + goal.get("wait_seconds", 0.0)
                x, z = next_x, next_z
            longest = max(longest, time)
        return 2.0 * longest + 60.0

    # ---- obstacles

    def _fixed_boxes(self, root: Element, placement: ReaderPlacement) -> list[dict[str, Any]]:
        boxes: list[dict[str, Any]] = []
        for element in root.all("obstacle"):
            self._add_box(boxes, self._box(element), element, placement)
        return boxes

    def _add_random_boxes(
        self, boxes: list[dict[str, Any]], root: Element, placement: ReaderPlacement
    ) -> None:
        for element in root.all("obstacleRegion"):
            self._expect_children(element)
            region = self._box(self._child(element, "regionBounds"))
            count = self._whole_number(self._child(element, "numObstacles"))
            size = self._number(self._child(element, "obstacleSize"), positive=True)
            height = self._number(self._child(element, "obstacleHeight"))
            for _ in range(count):
                x, z = self._free_place(element, region, size, placement, "obstacles")
                half = 0.5 * size
                box = {"xmin": x - half, "xmax": x + half, "zmin": z - half, "zmax": z + half, "ymin": 0.0}
                self._add_box(boxes, box | {"ymax": height}, element, placement)

    def _add_box(
        self, boxes: list[dict[str, Any]], box: Bounds, element: Element, placement: ReaderPlacement
    ) -> None:
        placement.add_box(box["xmin"], box["xmax"], box["zmin"], box["zmax"])
        # A box without height is a wall all the same.
        height = box["ymax"] - box["ymin"] or 1.0
        self.lines["world", "boxes", len(boxes)] = element.line
        boxes.append(
            {"x": (box["xmin"], box["xmax"]), "z": (box["zmin"], box["zmax"]), "height": max(height, 0.0)}
        )

    # ---- people

    def _fixed_people(self, root: Element, placement: ReaderPlacement) -> list[dict[str, Any]]:
        people: list[dict[str, Any]] = []
        for element in root.all("agent"):
            agent = self._agent(element, has_position=True)
            position = agent.position
            if position is None:
                position = self._free_place(element, self.bounds, agent.radius, placement, "agents")
            direction = agent.direction or placement.direction()
            placement.add_disc(*position, agent.radius)
            people.append(self._person(agent, position, direction, len(people)))
        return people

    def _region_people(self, root: Element, placement: ReaderPlacement) -> list[dict[str, Any]]:
        people: list[dict[str, Any]] = []
        first = sum(1 for _ in root.all("agent"))
        for element in root.all("agentRegion"):
            count = self._whole_number(self._child(element, "numAgents"))
            region = self._box(self._child(element, "regionBounds"))
            agent = self._agent(element, has_position=False)
            for _ in range(count):
                position = self._free_place(element, region, agent.radius, placement, "agents")
                direction = agent.direction or placement.direction()
                placement.add_disc(*position, agent.radius)
                people.append(self._person(agent, position, direction, first + len(people)))
        return people

    def _free_place(
        self, element: Element, region: Bounds, radius: float, placement: ReaderPlacement, what: str
    ) -> tuple[float, float]:
        x, z = (region["xmin"], region["xmax"]), (region["zmin"], region["zmax"])
        has_room = x[1] - x[0] >= 2 * radius and z[1] - z[0] >= 2 * radius
        place = placement.free_place(x, z, radius) if has_room else None
        if place is None:
            size = f"{x[1] - x[0]:g} x {z[1] - z[0]:g} m"
            raise self._error(
                element, f"region is too small for its {what}", size, "room for all without overlap"
            )
        return place

    def _agent(self, element: Element, *, has_position: bool) -> _Agent:
        self._expect_children(element)
        conditions = self._child(element, "initialConditions")
        wanted = (
            ("position", "direction", "radius", "speed") if has_position else ("direction", "radius", "speed")
        )
        self._expect_children(conditions, wanted)
        name = element.child("name")
        direction_element = self._child(conditions, "direction")
        direction = self._point_or_random(direction_element)
        if direction is not None:
            length = math.hypot(*direction)
            if length == 0.0:
                raise self._error(direction_element, "direction has no length", "0, 0", "any other vector")
            direction = (direction[0] / length, direction[1] / length)
        self._number(self._child(conditions, "speed"))
        sequence = self._child(element, "goalSequence")
        goals = [self._goal(goal) for goal in sequence.children]
        return _Agent(
            element,
            name.text if name is not None else None,
            self._point_or_random(self._child(conditions, "position")) if has_position else None,
            direction,
            self._number(self._child(conditions, "radius"), positive=True),
            goals,
            sequence.children,
        )

    def _person(
        self, agent: _Agent, position: tuple[float, float], direction: tuple[float, float], index: int
    ) -> dict[str, Any]:
        self.lines["characters", index] = agent.element.line
        goals: list[dict[str, Any]] = []
        for number, (goal, element) in enumerate(zip(agent.goals, agent.goal_elements, strict=True)):
            self.lines["characters", index, "goals", number] = element.line
            goals.append(self._placed_goal(goal, position if not goals else None, agent.radius))
        person: dict[str, Any] = {
            "position": position,
            "facing": math.degrees(math.atan2(direction[0], direction[1])),
            "radius": agent.radius,
            "goals": goals,
            "on_arrival": "leave" if goals else "stay",
        }
        if agent.name is not None:
            person["name"] = agent.name
        if goals:
            person["speed"] = goals[0]["speed"]
        return person

    # ---- goals

    def _goal(self, element: Element) -> dict[str, Any]:
        """Read one goal of any kind; `heading` and `stays` stand for what depends on the start."""
        if element.name not in GOAL_CHILDREN:
            raise self._error(
                element, "unknown goal", element.name, nearest_first(element.name, GOAL_CHILDREN)
            )
        own = GOAL_CHILDREN[element.name]
        self._expect_children(element, (*own, "desiredSpeed", "timeDuration"))
        speed_element = self._child(element, "desiredSpeed")
        duration_element = element.child("timeDuration")
        duration = self._number(duration_element) if duration_element is not None else DEFAULT_DURATION
        if element.name not in RUN_GOALS:
            raise self._error(element, "goal of this kind is not run", element.name, ", ".join(RUN_GOALS))
        if element.name == "idle":
            return {"stays": True, "speed": 1.0, "wait_seconds": duration, "radius": GOAL_RADIUS}
        speed = self._number(speed_element, positive=True)
        place_element = self._child(element, own[0])
        place = self._point_or_random(place_element)
        goal: dict[str, Any] = {"speed": speed, "radius": GOAL_RADIUS}
        if element.name == "flowStaticDirection":
            if place is None or math.hypot(*place) == 0.0:
                raise self._error(place_element, "heading must be given", allowed="x and z, not both 0")
            length = math.hypot(*place)
            return goal | {"heading": (place[0] / length, place[1] / length), "way": speed * duration}
        return goal | ({"position": place} if place is not None else {"area": True})

    def _placed_goal(
        self, goal: dict[str, Any], start: tuple[float, float] | None, radius: float
    ) -> dict[str, Any]:
        """Fill in what depends on the world and on the place where the goal begins."""
        placed = {key: value for key, value in goal.items() if key not in ("stays", "heading", "way")}
        if "area" in goal:
            edge = RANDOM_GOAL_CLEARANCE
            low_x, high_x = self.bounds["xmin"] + edge, self.bounds["xmax"] - edge
            low_z, high_z = self.bounds["zmin"] + edge, self.bounds["zmax"] - edge
            return placed | {"area": {"x": (low_x, high_x), "z": (low_z, high_z)}, "clearance": edge}
        if "position" in goal:
            return placed
        if start is None:
            raise ScenarioError(
                describe(self.label, "idle and flowStaticDirection are run as the first goal only")
            )
        if "stays" in goal:
            return placed | {"position": start}
        way = min(goal["way"], self._way_to_edge(start, goal["heading"], radius))
        return placed | {
            "position": (start[0] + way * goal["heading"][0], start[1] + way * goal["heading"][1])
        }

    def _way_to_edge(self, start: tuple[float, float], heading: tuple[float, float], radius: float) -> float:
        ways = [math.inf]
        for axis, low, high in ((0, "xmin", "xmax"), (1, "zmin", "zmax")):
            if heading[axis] > 0.0:
                ways.append((self.bounds[high] - radius - start[axis]) / heading[axis])
            elif heading[axis] < 0.0:
                ways.append((self.bounds[low] + radius - start[axis]) / heading[axis])
        return max(0.0, min(ways))

    # ---- elements

    def _error(
        self, element: Element, what: str, got: object = None, allowed: str | None = None
    ) -> ScenarioError:
        return ScenarioError(
            describe(f"{self.label}: line {element.line}: {element.name}", what, got, allowed)
        )

    def _child(self, element: Element, name: str) -> Element:
        child = element.child(name)
        if child is None:
            raise self._error(element, f"{name} is missing")
        return child

    def _expect_children(self, element: Element, known: Sequence[str] | None = None) -> None:
        allowed = known if known is not None else CHILDREN[element.name]
        for child in element.children:
            if child.name not in allowed:
                raise self._error(child, "unknown element", child.name, nearest_first(child.name, allowed))

    def _number(self, element: Element, *, positive: bool = False) -> float:
        try:
            value = float(element.text)
        except ValueError:
            raise self._error(element, "must be a number", element.text) from None
        if not math.isfinite(value):
            raise self._error(element, "must be finite", element.text)
        if positive and value <= 0.0:
            raise self._error(element, "is out of range", value, "> 0")
        return value

    def _whole_number(self, element: Element) -> int:
        if not element.text.isascii() or not element.text.isdigit():
            raise self._error(element, "must be a whole number", element.text, "0 or more")
        return int(element.text)

    def _box(self, element: Element) -> Bounds:
        self._expect_children(element, SIDES)
        box = {side: self._number(self._child(element, side)) for side in SIDES}
        for axis in ("x", "z"):
            if not box[f"{axis}min"] < box[f"{axis}max"]:
                got = f"{box[f'{axis}min']:g} and {box[f'{axis}max']:g}"
                raise self._error(element, f"{axis}min must be below {axis}max", got)
        return box

    def _point_or_random(self, element: Element) -> tuple[float, float] | None:
        """Ground point or vector; None when it is to be drawn."""
        self._expect_children(element, ("x", "y", "z", "random"))
        random = element.child("random")
        if random is not None:
            if random.text not in ("true", "1"):
                raise self._error(random, "must be true", random.text, "true, or x, y and z instead")
            return None
        self._number(self._child(element, "y"))
        return self._number(self._child(element, "x")), self._number(self._child(element, "z"))
