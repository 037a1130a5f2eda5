"""What all tables of a scenario file have in common: the base, the numbers, the errors of validators."""

from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field
from pydantic_core import PydanticCustomError

# Text in quotes and true are no numbers, though pydantic would make some of them.
Number = Annotated[float, Field(strict=True)]
WholeNumber = Annotated[int, Field(strict=True)]
YesOrNo = Annotated[bool, Field(strict=True)]
Coordinate = Annotated[Number, Field(ge=-10_000.0, le=10_000.0)]
Point = tuple[Coordinate, Coordinate]
Positive = Annotated[Number, Field(gt=0.0)]
NotNegative = Annotated[Number, Field(ge=0.0)]


class Table(BaseModel):
    """Base of all tables: read-only, no unknown keys, no NaN and no infinity."""

    model_config = ConfigDict(
        frozen=True, extra="forbid", allow_inf_nan=False, use_attribute_docstrings=True, validate_default=True
    )


def refuse(message: str, allowed: str | None = None, key: str | None = None, got: object = None) -> Exception:
    """Make the error that a validator raises: what is wrong, what is allowed, and the key it concerns."""
    context: dict[str, Any] = {"text": message}
    if allowed is not None:
        context["allowed"] = allowed
    if key is not None:
        context["key"] = key
    if got is not None:
        context["got"] = got
    return PydanticCustomError("scenario", "{text}", context)
