"""Biovision hierarchy (.bvh): skeleton and frames in one text file."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from crowd.motion.formats.euler import AXES, compose
from crowd.motion.formats.joint_list import IDENTITY, JointList, check_size, rest_positions, stated_rate
from crowd.motion.formats.text import TextFile, Tokens
from crowd.motion.source import FloatArray, SourceMotion, SourceSkeleton

CHANNEL_NAMES = tuple(f"{axis}{kind}" for kind in ("position", "rotation") for axis in AXES)
_CHANNELS = {name.upper(): (number // 3, number % 3) for number, name in enumerate(CHANNEL_NAMES)}
POSITION = 0


@dataclass
class _Block:
    """A block of the hierarchy that is open."""

    joint: int
    line: int
    is_end: bool
    has_offset: bool = False
    has_channels: bool = False


@dataclass(frozen=True)
class Channel:
    """One number of a row: the joint, position (0) or rotation (1), and the axis."""

    joint: int
    kind: int
    axis: int


def read_bvh(path: Path) -> SourceMotion:
    """Read a BVH file.

    Rotations compose in the order of their channels, the first listed outermost. Position channels replace
    the offset of their joint.

    Raises
    ------
    MotionError
        The file is broken; names the line.
    """
    text = TextFile(path)
    skeleton, channels, line = read_hierarchy(text)
    values, frame_time = _read_frames(text, line, len(channels))
    check_size(path, len(values), skeleton.joint_count)
    rotation, position = _pose(skeleton, channels, values)
    return SourceMotion(path, path.stem, skeleton, stated_rate(frame_time), rotation, position)


def read_hierarchy(text: TextFile) -> tuple[SourceSkeleton, list[Channel], int]:
    """Read all blocks up to ``MOTION``; gives its line too."""
    tokens = Tokens(text)
    if tokens.take("HIERARCHY").upper() != "HIERARCHY":
        tokens.fail("a BVH file starts with HIERARCHY")
    joints = JointList(text.fail)
    channels: list[Channel] = []
    open_blocks: list[_Block] = []
    while True:
        word = tokens.take("a joint, a closing brace or MOTION")
        match word.upper():
            case "MOTION" if not open_blocks:
                return joints.build(tokens.line), channels, tokens.line
            case "MOTION":
                tokens.fail(f"the block of line {open_blocks[-1].line} is not closed before MOTION")
            case "ROOT" | "JOINT" | "END" as kind:
                open_blocks.append(_open_block(tokens, joints, kind, open_blocks))
            case "OFFSET" | "CHANNELS" | "}" if not open_blocks:
                tokens.fail("stands outside all joints", word)
            case "OFFSET":
                open_blocks[-1].has_offset = True
                joints.offset[open_blocks[-1].joint] = tokens.take_numbers(3, "an offset")
            case "CHANNELS":
                added = _read_channels(tokens, open_blocks[-1])
                joints.is_animated[open_blocks[-1].joint] = any(entry.kind != POSITION for entry in added)
                channels += added
            case "}":
                if not open_blocks.pop().has_offset:
                    tokens.fail("the joint that is closed here has no OFFSET")
            case _:
                tokens.fail("unknown word", word, "ROOT, JOINT, End Site, OFFSET, CHANNELS, braces, MOTION")


def _open_block(tokens: Tokens, joints: JointList, kind: str, open_blocks: list[_Block]) -> _Block:
    line = tokens.line
    name = tokens.take_name("the name of a joint")
    if (kind == "ROOT") != (not open_blocks):
        tokens.text.fail(line, "a ROOT stands outside all joints, all others inside", kind)
    if open_blocks and open_blocks[-1].is_end:
        tokens.text.fail(line, "an End Site holds no joint", name)
    above = open_blocks[-1].joint if open_blocks else -1
    is_end = kind == "END"
    return _Block(joints.add_end(above, line) if is_end else joints.add(name, above, line), line, is_end)


def _read_channels(tokens: Tokens, block: _Block) -> list[Channel]:
    if block.has_channels or block.is_end:
        tokens.fail("an End Site has no CHANNELS, a joint has them once")
    block.has_channels = True
    found: list[Channel] = []
    for _ in range(tokens.take_integer("the number of channels")):
        name = tokens.take("a channel")
        if name.upper() not in _CHANNELS:
            tokens.fail("unknown channel", name, ", ".join(CHANNEL_NAMES))
        channel = Channel(block.joint, *_CHANNELS[name.upper()])
        if channel in found:
            tokens.fail("a channel is listed twice", name)
        found.append(channel)
    return found


def _read_frames(text: TextFile, motion_line: int, width: int) -> tuple[FloatArray, float]:
    """Rows after ``MOTION`` and the frame time; the declared number of rows may be wrong by one."""
    filled = [number for number, line in enumerate(text.lines[motion_line:], motion_line + 1) if line.strip()]
    if len(filled) < 2:
        text.fail(len(text.lines), "ends where Frames and Frame Time should follow")
    declared = text.integer(_value_of(text, filled[0], "frames"), filled[0], "Frames")
    frame_time = text.number(_value_of(text, filled[1], "frame time"), filled[1], "Frame Time")
    if not 1e-6 <= frame_time <= 1e3:
        text.fail(filled[1], "Frame Time is out of range", frame_time, "0.000001 to 1000 s")
    lines = filled[2:]
    if not lines:
        text.fail(filled[0], "holds no frames")
    if abs(declared - len(lines)) > 1:
        text.fail(filled[0], f"Frames: {declared}, but {len(lines)} rows follow")
    if width == 0:
        text.fail(motion_line, "holds no channels")
    return text.table([text.lines[line - 1] for line in lines], lines, width, "a frame"), frame_time


def _value_of(text: TextFile, line: int, key: str) -> str:
    """What follows a key and a colon."""
    content = " ".join(text.lines[line - 1].split())
    if not content.lower().startswith(key):
        text.fail(line, f'"{key.title()}:" should stand here', content)
    return content[len(key) :].lstrip(" :\t")


def _pose(
    skeleton: SourceSkeleton, channels: list[Channel], values: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Rotations and positions of all frames, joints with equal axes at once."""
    position = rest_positions(skeleton, len(values))
    turned: dict[int, list[int]] = defaultdict(list)
    for column, channel in enumerate(channels):
        if channel.kind == POSITION:
            position[:, channel.joint, channel.axis] = values[:, column]
        else:
            turned[channel.joint].append(column)
    alike: dict[tuple[int, ...], list[int]] = defaultdict(list)
    for joint, columns in turned.items():
        alike[tuple(channels[column].axis for column in columns)].append(joint)
    rotation = np.empty((len(values), skeleton.joint_count, 4))
    rotation[:] = IDENTITY
    for axes, joints in alike.items():
        angles = np.radians(values[:, [turned[joint] for joint in joints]])
        rotation[:, joints] = compose(axes, angles)
    return rotation, position
