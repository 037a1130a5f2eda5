"""What a scenario file may say: one frozen model for each table, with units and allowed ranges.

Ground points are ``[x, z]`` in metres, angles are degrees about the vertical: 0 faces
+z, positive turns left.
"""

from dataclasses import fields
from itertools import pairwise
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BeforeValidator, ConfigDict, Field, PrivateAttr, model_validator

from crowd.errors import SettingsError, nearest_first
from crowd.navigation.avoidance import AvoidanceSettings
from crowd.scenario.object_table import ObjectTable
from crowd.scenario.source import ScenarioSource
from crowd.scenario.table import (
    Coordinate,
    NotNegative,
    Number,
    Point,
    Positive,
    Table,
    WholeNumber,
    YesOrNo,
    refuse,
)
from crowd.scenario.task_table import TaskTable

DEFAULT_DT = 1.0 / 60.0

Share = Annotated[Number, Field(gt=0.0, le=1.0)]
BodyRadius = Annotated[Number, Field(ge=0.1, le=2.0)]
Speed = Annotated[Number, Field(gt=0.0, le=8.0)]
Stature = Annotated[Number, Field(ge=1.0, le=2.3)]
BoardHeight = Annotated[Number, Field(gt=0.0, le=2.5)]
OnArrival = Literal["stay", "leave"]
Attention = Literal["listening", "talking", "thinking", "none"]
Altitude = Annotated[Number, Field(ge=0.0, le=1000.0)]


class Area(Table):
    """A rectangle on the ground."""

    x: tuple[Coordinate, Coordinate]
    """Lowest and highest x, m."""
    z: tuple[Coordinate, Coordinate]
    """Lowest and highest z, m."""

    @model_validator(mode="after")
    def _is_not_empty(self) -> "Area":
        for key in ("x", "z"):
            low, high = getattr(self, key)
            if not low < high:
                raise refuse("must rise", "[low, high] with low < high", key, [low, high])
        return self


class Circle(Table):
    """A circle on the ground."""

    center: Point
    radius: Annotated[Number, Field(gt=0.0, le=1000.0)]
    """m, > 0."""


class Spread(Table):
    """How a quantity differs between people: the same for all, even between two bounds, or a bell curve.

    A plain number means the same for all.
    """

    min: Number | None = None
    """Lower bound."""
    max: Number | None = None
    """Upper bound."""
    mean: Number | None = None
    """Centre of a bell curve; needs `deviation`."""
    deviation: Positive | None = None
    """Standard deviation, > 0; values beyond 2.5 of them are redrawn."""

    @model_validator(mode="after")
    def _is_complete(self) -> "Spread":
        if (self.mean is None) != (self.deviation is None):
            raise refuse("a bell curve needs both mean and deviation", "mean and deviation, or min and max")
        if self.mean is None and (self.min is None or self.max is None):
            raise refuse("needs two numbers", "a number, min and max, or mean and deviation")
        if self.min is not None and self.max is not None and self.min > self.max:
            raise refuse("must not be above max", f"at most {self.max:g}", "min", self.min)
        return self

    @property
    def bounds(self) -> tuple[float, float]:
        """Lowest and highest value that can be drawn."""
        reach = 2.5 * (self.deviation or 0.0)
        center = self.mean if self.mean is not None else 0.0
        low = self.min if self.min is not None else center - reach
        high = self.max if self.max is not None else center + reach
        return low, high


def _spread_of_number(value: Any) -> Any:
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    return {"min": value, "max": value} if is_number else value


def _spread_within(low: float, high: float, unit: str) -> Any:
    def check(value: Spread) -> Spread:
        lowest, highest = value.bounds
        if not (low <= lowest and highest <= high):
            raise refuse("is out of range", f"{low:g} to {high:g} {unit}", got=f"{lowest:g} to {highest:g}")
        return value

    return AfterValidator(check)


def _one_of(*words: str) -> BeforeValidator:
    """Accept a number or one of some words, with one message instead of one for each alternative."""
    choices = ", ".join(f'"{word}"' for word in words)

    def check(value: Any) -> Any:
        is_number = isinstance(value, int | float) and not isinstance(value, bool)
        if not is_number and value not in words:
            raise refuse("is neither a number nor a known word", f"degrees, {choices}", got=value)
        return value

    return BeforeValidator(check)


def _tuple_of_text(value: Any) -> Any:
    """Accept one text or a list of them."""
    found = (value,) if isinstance(value, str) else value
    if not isinstance(found, list | tuple) or not all(isinstance(name, str) and name for name in found):
        raise refuse(
            "is no file", 'a file in quotes, or a list of them; "built-in" is the engine\'s own body'
        )
    return tuple(found)


CharacterFiles = Annotated[tuple[str, ...], BeforeValidator(_tuple_of_text)]
RadiusSpread = Annotated[Spread, BeforeValidator(_spread_of_number), _spread_within(0.1, 2.0, "m")]
SpeedSpread = Annotated[Spread, BeforeValidator(_spread_of_number), _spread_within(0.05, 8.0, "m/s")]
StatureSpread = Annotated[Spread, BeforeValidator(_spread_of_number), _spread_within(1.0, 2.3, "m")]

ADULT_SPEED = Spread(mean=1.34, deviation=0.15, min=1.0, max=1.6)
ADULT_RADIUS = Spread(min=0.22, max=0.28)
ADULT_STATURE = Spread(mean=1.70, deviation=0.09, min=1.48, max=1.95)


class TimedObstacle(Table):
    """What all obstacles have in common."""

    name: str | None = None
    """For messages and for removing the obstacle while running."""
    height: NotNegative = 2.5
    """Height above the ground, m. For pictures; people never step over an obstacle."""
    appear_at: NotNegative = 0.0
    """Time at which the obstacle appears, s."""
    disappear_at: Positive | None = None
    """Time at which it is taken away, s; never when left out."""

    @model_validator(mode="after")
    def _appears_before_it_disappears(self) -> "TimedObstacle":
        if self.disappear_at is not None and self.disappear_at <= self.appear_at:
            raise refuse(
                "must be after appear_at", f"> {self.appear_at:g} s", "disappear_at", self.disappear_at
            )
        return self

    @property
    def is_permanent(self) -> bool:
        """There from the start and for ever."""
        return self.appear_at == 0.0 and self.disappear_at is None


class Box(TimedObstacle):
    """A rectangle that nobody can enter."""

    x: tuple[Coordinate, Coordinate]
    """Lowest and highest x, m."""
    z: tuple[Coordinate, Coordinate]
    """Lowest and highest z, m."""
    boards: Annotated[tuple[BoardHeight, ...], Field(max_length=20)] = ()
    """Heights of the upper sides of its boards, ascending, m: furniture such as a shelf, a table or a stool,
    with objects on it. Solid when left out."""
    facing: Number | None = None
    """Direction in which people sit on the lowest board, degrees; no seat when left out."""

    @model_validator(mode="after")
    def _is_not_empty(self) -> "Box":
        for key in ("x", "z"):
            low, high = getattr(self, key)
            if not low < high:
                raise refuse("must rise", "[low, high] with low < high", key, [low, high])
        if any(upper <= lower for lower, upper in pairwise(self.boards)):
            raise refuse("must rise", "ascending heights", "boards", list(self.boards))
        if self.facing is not None and not self.boards:
            raise refuse("needs a board to sit on", "boards = [0.45]", "facing", self.facing)
        return self


class Polygon(TimedObstacle):
    """A solid polygon."""

    points: Annotated[tuple[Point, ...], Field(min_length=3)]
    """Corners in order, either way round, m; edges must not cross."""


class Wall(TimedObstacle):
    """A thin wall along a line of points."""

    points: Annotated[tuple[Point, ...], Field(min_length=2)]
    """Corners in order, m."""


class WorldTable(Table):
    """Ground and obstacles."""

    bounds: Area
    """The ground; nobody leaves it."""
    boxes: tuple[Box, ...] = ()
    polygons: tuple[Polygon, ...] = ()
    walls: tuple[Wall, ...] = ()


class Goal(Table):
    """Where to go next: exactly one of position, area and swap_through."""

    position: Point | None = None
    """Point, m."""
    area: Area | None = None
    """A random point in this rectangle, drawn anew for each visit."""
    swap_through: Point | None = None
    """The point opposite to the start, mirrored at this point, m."""
    radius: Positive = 0.4
    """Distance at which the goal counts as reached, m, > 0. Larger: less crowding around a shared goal."""
    speed: Speed | None = None
    """Speed on the way there, m/s, > 0; the person's own when left out."""
    wait_seconds: NotNegative = 0.0
    """Time to stand there before the next goal, s."""
    clearance: NotNegative | None = None
    """Least distance of a point drawn in `area` from obstacles, m; the body radius when left out."""

    @model_validator(mode="after")
    def _has_one_place(self) -> "Goal":
        given = [key for key in ("position", "area", "swap_through") if getattr(self, key) is not None]
        if len(given) != 1:
            found = " and ".join(given) or "none of them"
            raise refuse("needs exactly one place", "one of position, area, swap_through", got=found)
        return self


class GoalList(Table):
    """What individuals, regions and flows have in common: goals, gestures, and what people are drawn as."""

    goals: tuple[Goal, ...] = ()
    """Done one after the other; without goals people stand."""
    tasks: tuple[TaskTable, ...] = ()
    """Instead of goals: what they do, one thing after the other."""
    repeat: YesOrNo = False
    """Start again with the first goal or task after the last."""
    gestures: tuple[str, ...] = ()
    """Clips of the motion library that are played now and then, in random order."""
    gesture_every: Positive = 8.0
    """Mean time from one gesture to the next, s, > 0."""
    character: CharacterFiles = ()
    """Skinned glTF file that they are drawn and exported as, beside the scenario; or a list, from which each
    person draws one. ``"built-in"`` is the engine's own body."""
    glances: YesOrNo = True
    """Now and then look at people who come near."""
    look_at: tuple[Coordinate, Altitude, Coordinate] | None = None
    """Point [x, y, z] that they look at from the start, m."""
    attention: Attention = "listening"
    """How the eyes jump about what is looked at; "none": not at all."""
    name: str | None = None
    """For messages, for `plays` and for tasks of others."""

    @model_validator(mode="after")
    def _has_goals_or_tasks(self) -> "GoalList":
        if self.goals and self.tasks:
            found = f"{len(self.tasks)} tasks"
            raise refuse("cannot be given beside goals", "goals or tasks", "tasks", found)
        return self


class Character(GoalList):
    """One person."""

    position: Point
    """Start, m."""
    facing: Number | None = None
    """Heading at the start, degrees; towards the first goal when left out."""
    radius: BodyRadius = 0.25
    """Body disc, m."""
    speed: Speed = 1.34
    """Preferred speed, m/s."""
    height: Stature | None = None
    """Stature, m; drawn when left out."""
    on_arrival: OnArrival = "stay"
    """After the last goal: stay there, or leave the scene."""


class Region(GoalList):
    """Many people at random places of an area, or around a circle."""

    count: Annotated[WholeNumber, Field(ge=1, le=200_000)]
    """Number of people; `characters` of a run scales it."""
    area: Area | None = None
    """Where they start."""
    circle: Circle | None = None
    """Start evenly spaced on this circle instead."""
    arrangement: Literal["random", "grid"] = "random"
    """In an area: anywhere, or on a loose grid, which also fills dense crowds."""
    spacing: NotNegative = 0.1
    """Least gap between bodies at the start, m."""
    facing: Annotated[Number | Literal["goal", "random", "center"], _one_of("goal", "random", "center")] = (
        "goal"
    )
    """Degrees, or towards the first goal, anywhere, or towards the centre of the place."""
    radius: RadiusSpread = ADULT_RADIUS
    """Body disc, m."""
    speed: SpeedSpread = ADULT_SPEED
    """Preferred speed, m/s."""
    height: StatureSpread = ADULT_STATURE
    """Stature, m."""
    on_arrival: OnArrival = "stay"

    @model_validator(mode="after")
    def _has_one_place(self) -> "Region":
        if (self.area is None) == (self.circle is None):
            found = "none of them" if self.area is None else "both"
            raise refuse("needs exactly one place", "one of area, circle", got=found)
        return self


class Flow(GoalList):
    """People who keep coming in through an area."""

    source: Area
    """Where they appear; a person waits outside while the place is taken."""
    rate: Annotated[Number, Field(gt=0.0, le=1000.0)]
    """People per second."""
    start_at: NotNegative = 0.0
    """Time of the first person, s."""
    limit: Annotated[WholeNumber, Field(ge=1, le=200_000)] | None = None
    """People in all; no end when left out."""
    most_present: Annotated[WholeNumber, Field(ge=1, le=20_000)] = 100
    """Most people of this flow in the scene at once."""
    facing: Annotated[Number | Literal["goal"], _one_of("goal")] = "goal"
    """Heading at the start, degrees, or towards the first goal."""
    radius: RadiusSpread = ADULT_RADIUS
    speed: SpeedSpread = ADULT_SPEED
    height: StatureSpread = ADULT_STATURE
    on_arrival: OnArrival = "leave"
    """A sink is a last goal at which people leave."""


class Play(Table):
    """A clip that is played at a given time."""

    clip: str
    """A clip of the motion library."""
    at: NotNegative
    """Time, s."""
    who: str | None = None
    """Name of a character, region or flow; everyone when left out."""
    share: Share = 1.0
    """Share of them that plays it, drawn at random, > 0 to 1."""


class Bound(Table):
    """Bounds of one metric."""

    min: Number | None = None
    max: Number | None = None

    @model_validator(mode="after")
    def _is_a_range(self) -> "Bound":
        if self.min is None and self.max is None:
            raise refuse("needs a bound", "min, max, or both")
        if self.min is not None and self.max is not None and self.min > self.max:
            raise refuse("must not be above max", f"at most {self.max:g}", "min", self.min)
        return self


class Avoidance(Table):
    """Fields of `crowd.navigation.avoidance.AvoidanceSettings` that differ from the engine's own."""

    model_config = ConfigDict(extra="allow")

    @model_validator(mode="after")
    def _is_understood(self) -> "Avoidance":
        kinds = {declared.name: type(declared.default) for declared in fields(AvoidanceSettings)}
        for name, value in self.changed.items():
            if name not in kinds:
                raise refuse("unknown key", nearest_first(name, kinds), name)
            is_whole = isinstance(value, int) and not isinstance(value, bool)
            if not is_whole and (kinds[name] is int or not isinstance(value, float)):
                kind = "a whole number" if kinds[name] is int else "a number"
                raise refuse(f"must be {kind}", kind, name, value)
            try:
                AvoidanceSettings(**{name: value})
            except SettingsError as error:
                raise refuse("is out of range", str(error).rpartition("; allowed ")[2], name, value) from None
        return self

    @property
    def changed(self) -> dict[str, Any]:
        """Settings that were given."""
        return dict(self.model_extra or {})


class Scenario(Table):
    """A whole scene: ground, people, what they do, and what is expected of the run."""

    name: str = "scenario"
    description: str = ""
    seconds: Annotated[Number, Field(gt=0.0, le=86_400.0)] = 30.0
    """Length of a run when none is asked for, s, > 0."""
    dt: Annotated[Number, Field(ge=1.0 / 240.0, le=0.1)] = DEFAULT_DT
    """Length of one step, s, 1/240 to 0.1."""
    world: WorldTable
    characters: tuple[Character, ...] = ()
    regions: tuple[Region, ...] = ()
    flows: tuple[Flow, ...] = ()
    plays: tuple[Play, ...] = ()
    objects: tuple[ObjectTable, ...] = ()
    expect: dict[str, Bound] = Field(default_factory=dict)
    """Metric key to bounds; a run with a metric outside them has failed."""
    avoidance: Avoidance = Avoidance()

    _source: ScenarioSource = PrivateAttr(default_factory=ScenarioSource)

    @property
    def source(self) -> ScenarioSource:
        """Where the scenario was read from."""
        return self._source

    @property
    def character_count(self) -> int:
        """People at the start."""
        return len(self.characters) + sum(region.count for region in self.regions)
