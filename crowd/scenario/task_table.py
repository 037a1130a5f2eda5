"""The entries of ``tasks``: what a person does, one thing after the other."""

from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Discriminator, Field, Tag, model_validator

from crowd.scenario.table import Coordinate, NotNegative, Number, Point, Table, refuse

Height = Annotated[Number, Field(ge=0.0, le=3.0)]
SpacePoint = tuple[Coordinate, Height, Coordinate]

ACTIONS = (
    "walk_to",
    "carry_to",
    "pick_up",
    "put_down",
    "touch",
    "hand_over",
    "take_from",
    "look_at",
    "wait",
    "sit",
    "stand_up",
    "play",
)
"""Keys that say what a task is; each task has exactly one of them."""
ALTERNATIVES = NAME, POINT = "a name", "a point"
"""What may stand for one key; they are parts of pydantic's locations, not of ours."""
USES_A_HAND = frozenset({"pick_up", "put_down", "touch", "hand_over", "take_from"})
USES_SECONDS = frozenset({"touch", "look_at"})
DEFAULT_SECONDS = 1.0


def _name_or(count: int) -> BeforeValidator:
    """Accept a name or a point, with one message instead of one for each alternative."""

    def check(value: Any) -> Any:
        if isinstance(value, str) and value:
            return value
        is_point = isinstance(value, list | tuple) and len(value) == count
        if not is_point:
            axes = "[x, z]" if count == 2 else "[x, y, z]"
            raise refuse("is neither a name nor a point", f"a name, or {axes}, m", got=value)
        return value

    return BeforeValidator(check)


def _alternative(value: Any) -> str:
    return NAME if isinstance(value, str) else POINT


Name = Annotated[str, Field(min_length=1)]
Somewhere = Annotated[
    Annotated[Name, Tag(NAME)] | Annotated[Point, Tag(POINT)], Discriminator(_alternative), _name_or(2)
]
Something = Annotated[
    Annotated[Name, Tag(NAME)] | Annotated[SpacePoint, Tag(POINT)], Discriminator(_alternative), _name_or(3)
]


class TaskTable(Table):
    """One task: exactly one action, and how it is done."""

    walk_to: Somewhere | None = None
    """Walk to a point [x, z], or next to a piece of furniture."""
    carry_to: Somewhere | None = None
    """The same with something in the hands; fails with empty ones."""
    pick_up: Name | None = None
    """Walk to an object, reach and grasp it; a name without number means the nearest free one of its kind
    that nobody has put down yet."""
    put_down: Something | None = None
    """Walk to a free place on a piece of furniture, or to a point [x, y, z] of the ground, a board, the top
    of an obstacle or of another object, and put down what the hand holds."""
    touch: Something | None = None
    """Walk to an object or a point [x, y, z] and touch it with the finger tips."""
    hand_over: Name | None = None
    """Walk to another person, as soon as this one is at a task `take_from`, and give away what the hand
    holds."""
    take_from: Name | None = None
    """Wait for another person, who has a task `hand_over`, and take what is held out."""
    look_at: Something | None = None
    """Look at an object, a person or a point [x, y, z]."""
    wait: NotNegative | None = None
    """Stand or sit for a time, s."""
    sit: Name | None = None
    """Walk to a seat and sit down."""
    stand_up: Literal[True] | None = None
    """Stand up from the seat; people also do so before they walk."""
    play: str | None = None
    """Play a clip of the motion library to its end."""
    hand: Literal["any", "right", "left", "both"] = "any"
    """Which hand does it."""
    seconds: NotNegative = DEFAULT_SECONDS
    """How long to touch or to look, s."""

    @property
    def action(self) -> str:
        """The key that says what the task is."""
        return next(key for key in ACTIONS if getattr(self, key) is not None)

    @model_validator(mode="after")
    def _has_one_action(self) -> "TaskTable":
        given = [key for key in ACTIONS if getattr(self, key) is not None]
        if len(given) != 1:
            raise refuse("needs exactly one action", ", ".join(ACTIONS), got=" and ".join(given) or "none")
        if self.hand != "any" and given[0] not in USES_A_HAND:
            raise refuse(f"means nothing for {given[0]}", "no hand", "hand", self.hand)
        if self.seconds != DEFAULT_SECONDS and given[0] not in USES_SECONDS:
            raise refuse(f"means nothing for {given[0]}", "touch or look_at", "seconds", self.seconds)
        return self
