"""BVH: a hierarchy with offsets and channels, then one row of numbers for each frame."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from crowd.errors import MotionError, describe
from crowd.motion.formats.euler import from_euler
from crowd.motion.formats.text import at_line, number, read_rows, read_text, whole_number
from crowd.motion.source import SourceMotion, SourceSkeleton

CHANNELS = ("Xposition", "Yposition", "Zposition", "Xrotation", "Yrotation", "Zrotation")
_CHANNEL_OF = {name.lower(): name for name in CHANNELS}


@dataclass
class _Joint:
    name: str
    parent: int
    line: int
    offset: list[float] = field(default_factory=list)
    channels: list[str] = field(default_factory=list)


def read_bvh(path: Path) -> SourceMotion:
    """Read a BVH file.

    Parameters
    ----------
    path : Path

    Returns
    -------
    SourceMotion
        End sites are joints named ``PARENT_end``.

    Raises
    ------
    MotionError
        The file is broken; its line is named.

    Notes
    -----
    Rotations multiply in listed order, first listed outermost; position channels replace the offset. Of the
    declared count of frames and the rows, which many programs let differ by one, the rows are right.
    """
    lines = read_text(path).splitlines()
    joints, motion_line = _read_hierarchy(lines, path)
    width = sum(len(joint.channels) for joint in joints)
    frames, frame_time, first = _read_header(lines, motion_line, path)
    values = read_rows(lines[first:], range(first + 1, len(lines) + 1), width, path)
    if len(values) == 0:
        raise MotionError(describe(at_line(path, len(lines)), "there are no frames"))
    if frames > 0 and abs(frames - len(values)) > 1:
        raise MotionError(
            describe(
                at_line(path, motion_line + 2), "declares another count of frames than it has rows",
                frames, f"{len(values)} rows",
            )
        )  # fmt: skip
    count = len(joints)
    offset = np.array([joint.offset for joint in joints])
    if not np.any(offset[1:]):
        raise MotionError(describe(at_line(path, joints[0].line), "all offsets are zero"))
    rotation = np.zeros((len(values), count, 4))
    rotation[..., 0] = 1.0
    position = np.broadcast_to(offset, (len(values), count, 3)).copy()
    column = 0
    for index, joint in enumerate(joints):
        part = values[:, column : column + len(joint.channels)]
        column += len(joint.channels)
        turns = [place for place, channel in enumerate(joint.channels) if channel.endswith("rotation")]
        if turns:
            axes = "".join(joint.channels[place][0] for place in turns)
            rotation[:, index] = from_euler(np.radians(part[:, turns]), axes)
        for place, channel in enumerate(joint.channels):
            if channel.endswith("position"):
                position[:, index, "XYZ".index(channel[0])] = part[:, place]
    skeleton = SourceSkeleton(
        tuple(joint.name for joint in joints),
        np.array([joint.parent for joint in joints], np.int32),
        offset,
        np.tile([1.0, 0.0, 0.0, 0.0], (count, 1)),
        np.array([any(name.endswith("rotation") for name in joint.channels) for joint in joints]),
    )
    return SourceMotion(path, path.stem, skeleton, 1.0 / frame_time, rotation, position)


def _read_hierarchy(lines: list[str], path: Path) -> tuple[list[_Joint], int]:
    """Read joints; also returns the index of the line ``MOTION``."""
    joints: list[_Joint] = []
    open_joints: list[int] = []
    names: set[str] = set()
    awaits_brace = False
    saw_hierarchy = False
    for index, text in enumerate(lines):
        tokens = text.split()
        if not tokens:
            continue
        line, word = index + 1, tokens[0].upper()
        if word == "HIERARCHY":
            saw_hierarchy = True
        elif not saw_hierarchy:
            raise MotionError(describe(at_line(path, line), "is no BVH file", tokens[0][:40], "HIERARCHY"))
        elif word in ("ROOT", "JOINT", "END"):
            if (word == "ROOT") != (not open_joints) or (word == "ROOT" and joints):
                raise MotionError(describe(at_line(path, line), f"{tokens[0]} is misplaced"))
            parent = open_joints[-1] if open_joints else -1
            name = " ".join(tokens[1:]) if word != "END" else f"{joints[parent].name}_end"
            if word == "END" and name in names:
                name = f"{name}{len(joints)}"
            if not name or name in names:
                raise MotionError(describe(at_line(path, line), "joint name is missing or used twice", name))
            names.add(name)
            joints.append(_Joint(name, parent, line))
            awaits_brace = True
            if tokens[-1] == "{":
                raise MotionError(describe(at_line(path, line), "a brace belongs on a line of its own"))
        elif word == "{":
            if not awaits_brace:
                raise MotionError(describe(at_line(path, line), "an opening brace is misplaced"))
            open_joints.append(len(joints) - 1)
            awaits_brace = False
        elif word == "}":
            if not open_joints or awaits_brace:
                raise MotionError(describe(at_line(path, line), "a closing brace is misplaced"))
            closed = joints[open_joints.pop()]
            if not closed.offset:
                raise MotionError(describe(at_line(path, closed.line), "joint has no OFFSET", closed.name))
        elif word in ("OFFSET", "CHANNELS") and open_joints and not awaits_brace:
            _read_item(tokens, joints[open_joints[-1]], path, line)
        elif word == "MOTION":
            if open_joints or awaits_brace or not joints:
                raise MotionError(
                    describe(at_line(path, line), "MOTION comes before the hierarchy is closed")
                )
            return joints, index
        else:
            raise MotionError(describe(at_line(path, line), "cannot be understood", tokens[0][:40]))
    raise MotionError(describe(at_line(path, len(lines)), "ends before MOTION"))


def _read_item(tokens: list[str], joint: _Joint, path: Path, line: int) -> None:
    if tokens[0].upper() == "OFFSET":
        if len(tokens) != 4 or joint.offset:
            raise MotionError(describe(at_line(path, line), "OFFSET takes three numbers, once for a joint"))
        joint.offset = [number(token, path, line, "offset") for token in tokens[1:]]
        return
    if joint.channels:
        raise MotionError(describe(at_line(path, line), "joint has CHANNELS twice", joint.name))
    count = whole_number(tokens[1] if len(tokens) > 1 else "", path, line, "count of channels")
    if len(tokens) - 2 != count:
        raise MotionError(
            describe(at_line(path, line), "lists another count of channels", len(tokens) - 2, str(count))
        )
    for token in tokens[2:]:
        if token.lower() not in _CHANNEL_OF:
            allowed = ", ".join(CHANNELS)
            raise MotionError(describe(at_line(path, line), "unknown channel", token, allowed))
        joint.channels.append(_CHANNEL_OF[token.lower()])
    if len(set(joint.channels)) != len(joint.channels):
        raise MotionError(describe(at_line(path, line), "a channel is listed twice", joint.name))


def _read_header(lines: list[str], motion_line: int, path: Path) -> tuple[int, float, int]:
    """Frames, frame time in s, and the index of the first row."""
    frames: int | None = None
    for index in range(motion_line + 1, len(lines)):
        tokens = lines[index].replace(":", ": ").split()
        if not tokens:
            continue
        line = index + 1
        if tokens[0].lower() == "frames:" and frames is None:
            frames = whole_number(tokens[1] if len(tokens) == 2 else "", path, line, "count of frames")
        elif tokens[0].lower() == "frame" and len(tokens) == 3 and tokens[1].lower() == "time:":
            if frames is None:
                raise MotionError(describe(at_line(path, line), "Frames: is missing"))
            seconds = number(tokens[2], path, line, "frame time")
            if not 1e-5 < seconds < 10.0:
                raise MotionError(
                    describe(at_line(path, line), "frame time is out of range", seconds, "0.00001 to 10 s")
                )
            return frames, seconds, index + 1
        else:
            raise MotionError(
                describe(at_line(path, line), "cannot be understood", tokens[0][:40], "Frames:, Frame Time:")
            )
    raise MotionError(describe(at_line(path, len(lines)), "ends before Frame Time:"))
