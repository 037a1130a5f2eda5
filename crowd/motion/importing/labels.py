"""Labels that a user corrects: a small text file beside the clips, read and written."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from crowd.errors import MotionError, describe, nearest_first
from crowd.motion.clip import ClipKind

if TYPE_CHECKING:
    from crowd.motion.importing.importer import Imported

FILE_NAME = "crowd-labels.toml"
Seconds = Annotated[float, Field(ge=0.0, allow_inf_nan=False)]
Number = Annotated[float, Field(allow_inf_nan=False)]
EventName = Literal["RHS", "RTS", "RHO", "RTO", "LHS", "LTS", "LHO", "LTO"]


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class JumpCorrection(_Table):
    """Times of a jump, s."""

    take_off: Seconds | None = None
    apex: Seconds | None = None
    landing: Seconds | None = None


class ReachCorrection(_Table):
    """Hand of a reach, and when it is there, s."""

    side: Literal["left", "right"] | None = None
    apex: Seconds | None = None


class Correction(_Table):
    """What a user says of one clip; what is left out is found from the motion."""

    use: bool = True
    """False leaves the clip out of the library."""
    kind: ClipKind | None = None
    begin: Seconds | None = None
    """Times before this are cut off, s."""
    end: Seconds | None = None
    """Times after this are cut off, s."""
    cyclic: bool | None = None
    """Whether the last frame is the first one again."""
    events: tuple[tuple[Seconds, EventName], ...] | None = None
    """Foot events, s from the first frame that is not cut off."""
    forward: Number | None = None
    """m/s, in the scale of the source."""
    turn: Number | None = None
    """deg/s, left positive."""
    side: Number | None = None
    """m/s, left positive, in the scale of the source."""
    mirror: bool = True
    """Whether a mirror image may fill the other side."""
    jump: JumpCorrection | None = None
    reach: ReachCorrection | None = None


def read_labels(path: Path) -> dict[str, Correction]:
    """Read corrections by clip name.

    Raises
    ------
    MotionError
        The file cannot be read, or a key or a value is not allowed.
    """
    try:
        tables = tomllib.loads(path.read_text("utf-8"))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise MotionError(describe(str(path), "is not a file of labels", str(error))) from error
    found = {}
    for name, table in tables.items():
        try:
            found[name] = Correction.model_validate(table)
        except ValidationError as error:
            first = error.errors()[0]
            key = ".".join(str(part) for part in first["loc"])
            if first["type"] == "extra_forbidden":
                allowed = nearest_first(str(first["loc"][-1]), Correction.model_fields)
                raise MotionError(describe(f"{path}: {name}.{key}", "is no label", key, allowed)) from error
            raise MotionError(describe(f"{path}: {name}.{key}", first["msg"], first.get("input"))) from error
    return found


def check_names(path: Path, labels: Mapping[str, Correction], names: Iterable[str]) -> None:
    """Refuse labels of clips that are not there.

    Raises
    ------
    MotionError
    """
    known = set(names)
    for name in labels:
        if name not in known:
            raise MotionError(describe(str(path), "no clip has this name", name, nearest_first(name, known)))


def write_labels(path: Path, found: Iterable[Imported]) -> None:
    """Write what was found, ready to be corrected; reading it back changes nothing.

    Speeds are in the scale of the source, times from its first frame.
    """
    blocks = ["# What was found in each clip. Change what is wrong, delete what need not be told.\n"]
    for entry in found:
        clip = entry.clip
        lines = [f'["{clip.name}"]', f'kind = "{clip.kind.value}"']
        if clip.kind is ClipKind.LOCOMOTION:
            forward, turn, side = clip.parameters
            lines += [
                f"forward = {forward / entry.scale:.6f}",
                f"turn = {math.degrees(turn):.4f}",
                f"side = {side / entry.scale:.6f}",
            ]
        if entry.stances:
            events = sorted(event for stance in entry.stances for event in stance.events)
            listed = ", ".join(f'[{time:.4f}, "{event.name}"]' for time, event in events)
            lines.append(f"events = [{listed}]")
        if clip.jump:
            jump = clip.jump
            lines.append(
                f"jump = {{ take_off = {jump.take_off:.4f}, apex = {jump.apex:.4f}, "
                f"landing = {jump.landing:.4f} }}"
            )
        if clip.reach:
            lines.append(f'reach = {{ side = "{clip.reach.side}", apex = {clip.reach.apex:.4f} }}')
        blocks.append("\n".join(lines) + "\n")
    path.write_text("\n".join(blocks), "utf-8")
