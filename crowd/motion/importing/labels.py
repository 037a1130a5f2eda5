"""Labels that a user corrects: a small text file beside the clips, read and written."""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from crowd.errors import MotionError, describe, nearest_first
from crowd.motion.clip import Clip, ClipKind, FootEvent

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
    """Foot events of the cut clip."""
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


def write_labels(path: Path, clips: Iterable[Clip], scale: Mapping[str, float]) -> None:
    """Write what was found, ready to be corrected.

    Parameters
    ----------
    path : Path
    clips : iterable of Clip
    scale : mapping of str to float
        Leg ratio by clip name; speeds are written in the scale of the source.
    """
    blocks = ["# What was found in each clip. Change what is wrong, delete what need not be told.\n"]
    for clip in clips:
        lines = [f'["{clip.name}"]', f'kind = "{clip.kind.value}"']
        if clip.kind is ClipKind.LOCOMOTION:
            forward, turn, side = clip.parameters
            ratio = scale.get(clip.name, 1.0)
            lines += [
                f"forward = {forward / ratio:.4f}",
                f"turn = {turn * 180 / 3.141592653589793:.3f}",
                f"side = {side / ratio:.4f}",
            ]
        if clip.foot_events:
            events = ", ".join(f'[{time:.4f}, "{FootEvent(event).name}"]' for time, event in clip.foot_events)
            lines.append(f"# events from the first right heel strike: {events}")
        if clip.jump:
            jump = clip.jump
            lines.append(
                f"jump = {{ take_off = {jump.take_off:.3f}, apex = {jump.apex:.3f}, "
                f"landing = {jump.landing:.3f} }}"
            )
        if clip.reach:
            lines.append(f'reach = {{ side = "{clip.reach.side}", apex = {clip.reach.apex:.3f} }}')
        blocks.append("\n".join(lines) + "\n")
    path.write_text("\n".join(blocks), "utf-8")
