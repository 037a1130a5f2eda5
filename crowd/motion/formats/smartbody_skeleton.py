"""SmartBody skeletons (.sk)."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from crowd.motion.formats.euler import AXES
from crowd.motion.formats.joint_list import IDENTITY, JointList
from crowd.motion.formats.smartbody_channels import (
    CANONICAL_TYPE,
    CHANNEL_TYPES,
    POSITIONS,
    Channel,
    SmartBodySkeleton,
)
from crowd.motion.formats.text import TextFile, Tokens
from crowd.motion.rotation import from_vector, multiply
from crowd.motion.source import FloatArray

WORD = re.compile(r'"[^"]*"|[{}]|[^\s{}"]+')
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?")
_UNITS = re.compile(r"#.*\bUnits:\s*(mm|cm|m)\b", re.IGNORECASE)
_METRES = {"mm": 0.001, "cm": 0.01, "m": 1.0}
_HEADER_LINES = 20
DEFAULT_EULER = (1, 0, 2)
_CHANNEL_WORDS = ("free", "lim", "axis", "ang", "frozen")
_GEOMETRY = ("align", "modelmat", "modelrot", "visgeo", "colgeo")
_ITEMS = (
    "offset",
    "center",
    "prerot",
    "framerot",
    "postrot",
    "channel",
    "channels",
    "euler",
    "joint",
    "}",
    *_GEOMETRY,
)


def header_unit(text: TextFile) -> float | None:
    """Metres per unit by the comment at the top; None when it says nothing."""
    for line in text.lines[:_HEADER_LINES]:
        found = _UNITS.search(line)
        if found:
            return _METRES[found.group(1).lower()]
    return None


@dataclass
class _Joints:
    """Joints read so far."""

    joints: JointList
    before: list[FloatArray] = field(default_factory=list)
    after: list[FloatArray] = field(default_factory=list)
    start: list[list[float]] = field(default_factory=list)
    euler_axes: list[tuple[int, ...]] = field(default_factory=list)
    channels: set[Channel] = field(default_factory=set)

    def add(self, name: str, parent: int, line: int) -> int:
        """Add a joint without rotations and channels."""
        self.before.append(np.array(IDENTITY))
        self.after.append(np.array(IDENTITY))
        self.start.append([0.0, 0.0, 0.0])
        self.euler_axes.append(DEFAULT_EULER)
        return self.joints.add(name, parent, line)


def read_sk(path: Path) -> SmartBodySkeleton:
    """Read a .sk file.

    Raises
    ------
    MotionError
        The file is broken; names the line.
    """
    text = TextFile(path)
    tokens = Tokens(text, WORD, comment="#")
    found = _Joints(JointList(text.fail))
    scale = 1.0
    while tokens.peek() is not None:
        word = tokens.take("a root")
        match word.lower():
            case "set_name" | "name" | "path":
                tokens.take("a name")
            case "skeleton" | "hierarchy":
                pass
            case "set_scale":
                scale = tokens.take_number("a scale")
                if scale <= 0.0:
                    tokens.fail("the scale must be positive", scale)
            case "root" if not found.joints.names:
                _read_joints(tokens, found)
            case "end" if found.joints.names:
                break
            case _ if not found.joints.names:
                tokens.fail("unknown word", word, "set_name, skeleton, set_scale, path, root")
            case "root" | "joint" | "}" | "{":
                tokens.fail("stands outside the root", word)
            case _:
                pass  # Postures and pairs for collisions.
    skeleton = found.joints.build(tokens.line)
    before, after = np.array(found.before), np.array(found.after)
    offset = scale * skeleton.offset
    skeleton.offset[:] = offset + scale * np.array(found.start)
    skeleton.rest_rotation[:] = multiply(before, after)
    return SmartBodySkeleton(
        path,
        skeleton,
        offset,
        before,
        after,
        tuple(found.euler_axes),
        frozenset(found.channels),
        header_unit(text),
    )


def _read_joints(tokens: Tokens, found: _Joints) -> None:
    """Read the block of the root, with all joints in it."""
    line = tokens.line
    open_joints = [found.add(tokens.take_name("the name of the root"), -1, line)]
    while open_joints:
        joint = open_joints[-1]
        word = tokens.take(f'an item or the closing brace of joint "{found.joints.names[joint]}"')
        match word.lower():
            case "}":
                open_joints.pop()
            case "joint":
                line = tokens.line
                open_joints.append(found.add(tokens.take_name("the name of a joint"), joint, line))
            case "offset" | "center":
                found.joints.offset[joint] = tokens.take_numbers(3, "an offset")
            case "prerot" | "framerot":
                found.before[joint] = multiply(found.before[joint], _read_rotation(tokens))
            case "postrot":
                found.after[joint] = multiply(found.after[joint], _read_rotation(tokens))
            case "channel":
                _read_channel(tokens, found, joint, tokens.take("a channel"))
            case "channels":
                for _ in range(tokens.take_integer("the number of channels")):
                    name = tokens.take("a channel")
                    _read_channel(tokens, found, joint, re.sub("(?i)(osition|otation)$", _shorter, name))
            case "euler":
                order = tokens.take("an order of axes")
                if not order or len(set(order.upper())) != len(order) or set(order.upper()) - set(AXES):
                    tokens.fail("unknown order of axes", order, "such as XYZ, YXZ, ZY")
                found.euler_axes[joint] = tuple(AXES.index(axis) for axis in order.upper())
            case geometry if geometry in _GEOMETRY:
                _skip_geometry(tokens)
            case _:
                tokens.fail("unknown item", word, ", ".join(_ITEMS))


def _shorter(ending: re.Match[str]) -> str:
    """Ending of a channel name of BVH as a .sk file spells it."""
    return "os" if ending.group(1).lower() == "osition" else "ot"


def _read_rotation(tokens: Tokens) -> FloatArray:
    """``axis x y z ang degrees``; a zero axis is no rotation."""
    if tokens.take("axis").lower() != "axis":
        tokens.fail('"axis x y z ang degrees" should stand here')
    axis = np.array(tokens.take_numbers(3, "an axis"))
    if tokens.take("ang").lower() != "ang":
        tokens.fail('"ang" should follow the axis')
    angle = math.radians(tokens.take_number("an angle"))
    length = float(np.linalg.norm(axis))
    return from_vector(axis / length * angle) if length > 1e-9 else np.array(IDENTITY)


def _read_channel(tokens: Tokens, found: _Joints, joint: int, name: str) -> None:
    """The rest of a channel: start value, limits, rotation; only start positions matter."""
    kind = CANONICAL_TYPE.get(name.lower())
    if kind is None:
        tokens.fail("unknown channel", name, ", ".join(CHANNEL_TYPES))
    values: list[float] = []
    words: list[str] = []
    while (ahead := tokens.peek()) is not None and (
        ahead.lower() in _CHANNEL_WORDS or _NUMBER.fullmatch(ahead)
    ):
        token = tokens.take("a value")
        if token.lower() in _CHANNEL_WORDS:
            words.append(token.lower())
        else:
            values.append(tokens.text.number(token, tokens.line, "a value of a channel"))
    if kind in POSITIONS:
        found.start[joint][POSITIONS.index(kind)] = values[0] if values else 0.0
    elif "frozen" in words:
        return
    else:
        found.joints.is_animated[joint] = True
    found.channels.add((found.joints.names[joint], kind))


def _skip_geometry(tokens: Tokens) -> None:
    """Skip what stands after a word for geometry, up to the next item."""
    depth = 0
    while (ahead := tokens.peek()) is not None and (depth or ahead.lower() not in _ITEMS):
        token = tokens.take("geometry")
        depth += {"{": 1, "}": -1}.get(token, 0)
