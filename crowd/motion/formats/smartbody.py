"""SK and SKM of SmartBody: a skeleton with fixed rotations, and key frames of rotation vectors."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import numpy.typing as npt

from crowd.errors import MotionError, describe
from crowd.motion.formats.euler import from_euler
from crowd.motion.formats.text import at_line, number, read_rows, read_text, whole_number
from crowd.motion.rotation import from_vector, multiply
from crowd.motion.source import SourceMotion, SourceSkeleton

FloatArray = npt.NDArray[np.float64]

POSITIONS = ("XPos", "YPos", "ZPos")
ROTATIONS = ("XRot", "YRot", "ZRot", "Twist")
WIDTHS = {**dict.fromkeys(POSITIONS, 1), **dict.fromkeys(ROTATIONS, 1), "Quat": 3, "Swing": 2}
_KIND_OF = {kind.lower(): kind for kind in WIDTHS}
UNITS = {"m": 1.0, "cm": 0.01, "mm": 0.001}
USUAL_RATE = 30.0
"""Of single poses, Hz."""
SYNC_POINTS = ("ready", "strokeStart", "emphasis", "stroke", "relax")


@dataclass
class _Joint:
    name: str
    parent: int
    line: int
    offset: list[float] = field(default_factory=lambda: [0.0, 0.0, 0.0])
    before: FloatArray = field(default_factory=lambda: np.array([1.0, 0.0, 0.0, 0.0]))
    after: FloatArray = field(default_factory=lambda: np.array([1.0, 0.0, 0.0, 0.0]))
    turns: bool = False


@dataclass(frozen=True)
class SmartBodySkeleton:
    """What an SK file holds.

    Attributes
    ----------
    path : Path
    skeleton : SourceSkeleton
    before, after : (J, 4) float64
        Fixed rotations on both sides of a joint's own.
    metres_per_unit : float or None
    """

    path: Path
    skeleton: SourceSkeleton
    before: FloatArray
    after: FloatArray
    metres_per_unit: float | None


@dataclass(frozen=True)
class Channel:
    """One channel of a motion: joint, kind as in `WIDTHS`."""

    joint: str
    kind: str


def stated_unit(text: str) -> float | None:
    """Metres per unit by the header comment ``Units: cm``, or None."""
    found = re.search(r"Units:\s*(mm|cm|m)\b", text)
    return None if found is None else UNITS[found.group(1)]


def read_sk(path: Path) -> SmartBodySkeleton:
    """Read an SK skeleton.

    Raises
    ------
    MotionError
        The file is broken; its line is named.
    """
    text = read_text(path)
    joints: list[_Joint] = []
    open_joints: list[int] = []
    scale = 1.0
    tokens = list(_tokens(text))
    at = 0
    while at < len(tokens):
        word, line = tokens[at]
        lower = word.lower()
        if lower in ("root", "joint") and (open_joints or lower == "root"):
            name, at = _name(tokens, at + 1, path, line)
            if name in {joint.name for joint in joints}:
                raise MotionError(describe(at_line(path, line), "joint name is used twice", name))
            joints.append(_Joint(name, open_joints[-1] if open_joints else -1, line))
            open_joints.append(len(joints) - 1)
        elif word == "}":
            if not open_joints:
                raise MotionError(describe(at_line(path, line), "a closing brace is misplaced"))
            open_joints.pop()
            at += 1
        elif open_joints:
            at = _read_item(tokens, at, joints[open_joints[-1]], path)
        elif lower == "set_scale":
            scale = _numbers(tokens, at + 1, 1, path)[0]
            at += 2
        else:
            at += 1
    if open_joints:
        joint = joints[open_joints[-1]]
        raise MotionError(describe(at_line(path, joint.line), "joint is not closed", joint.name))
    if not joints or not np.any([joint.offset for joint in joints]):
        raise MotionError(describe(str(path), "is no SK skeleton: it has no joints with offsets"))
    before = np.array([joint.before for joint in joints])
    after = np.array([joint.after for joint in joints])
    skeleton = SourceSkeleton(
        tuple(joint.name for joint in joints),
        np.array([joint.parent for joint in joints], np.int32),
        scale * np.array([joint.offset for joint in joints]),
        multiply(before, after),
        np.array([joint.turns for joint in joints]),
    )
    return SmartBodySkeleton(path, skeleton, before, after, stated_unit(text))


def _tokens(text: str) -> Iterator[tuple[str, int]]:
    """Words with their lines; braces are words, comments are left out."""
    for line, content in enumerate(text.splitlines(), 1):
        for word in re.findall(r'"[^"]*"|[{}]|[^\s{}]+', content.split("#")[0]):
            yield word.strip('"'), line


def _name(tokens: list[tuple[str, int]], at: int, path: Path, line: int) -> tuple[str, int]:
    """A name up to the next brace, and the place after the brace."""
    words = []
    while at < len(tokens) and tokens[at][0] != "{":
        if tokens[at][1] > line + 2 or tokens[at][0] == "}":
            raise MotionError(describe(at_line(path, line), "joint has no opening brace"))
        words.append(tokens[at][0])
        at += 1
    if at == len(tokens) or not words:
        raise MotionError(describe(at_line(path, line), "joint has no name or no opening brace"))
    return " ".join(words), at + 1


def _numbers(tokens: list[tuple[str, int]], at: int, count: int, path: Path) -> list[float]:
    if at + count > len(tokens):
        raise MotionError(describe(at_line(path, tokens[-1][1]), "ends in the middle of a joint"))
    return [number(word, path, line, "value") for word, line in tokens[at : at + count]]


def _read_item(tokens: list[tuple[str, int]], at: int, joint: _Joint, path: Path) -> int:
    """Read one item of a joint block; gives the place after it. Unknown words are passed over."""
    word = tokens[at][0].lower()
    if word in ("offset", "center"):
        joint.offset = _numbers(tokens, at + 1, 3, path)
        return at + 4
    if word in ("prerot", "framerot", "postrot"):
        words = [token.lower() for token, _ in tokens[at + 1 : at + 7]]
        if len(words) < 6 or words[0] != "axis" or words[4] != "ang":
            raise MotionError(
                describe(at_line(path, tokens[at][1]), f"{word} is incomplete", allowed="axis x y z ang DEG")
            )
        axis = np.array(_numbers(tokens, at + 2, 3, path))
        angle = np.radians(_numbers(tokens, at + 6, 1, path)[0])
        length = float(np.linalg.norm(axis))
        turn = from_vector(axis / length * angle) if length > 0.0 else np.array([1.0, 0.0, 0.0, 0.0])
        if word == "postrot":
            joint.after = multiply(joint.after, turn)
        else:
            joint.before = multiply(joint.before, turn)
        return at + 7
    if word == "channel" and at + 1 < len(tokens):
        kind = tokens[at + 1][0].lower()
        if kind in ("quat", "swing", "twist", "xrot", "yrot", "zrot"):
            joint.turns = True
        elif kind in ("xpos", "ypos", "zpos"):
            pass
        else:
            allowed = ", ".join(WIDTHS)
            raise MotionError(
                describe(at_line(path, tokens[at + 1][1]), "unknown channel", tokens[at + 1][0], allowed)
            )
        return at + 2
    if word == "{":
        raise MotionError(describe(at_line(path, tokens[at][1]), "an opening brace is misplaced"))
    return at + 1


def read_channels(path: Path) -> tuple[Channel, ...]:
    """Read the channel list of an SKM file alone, to tell its skeleton.

    Raises
    ------
    MotionError
        The file is broken; its line is named.
    """
    return _read_channel_list(_content_lines(path), path)[0]


def _content_lines(path: Path) -> list[str]:
    return [line.split("#")[0].strip() for line in read_text(path).splitlines()]


def _read_channel_list(lines: list[str], path: Path) -> tuple[tuple[Channel, ...], int]:
    """Channels, and the index of the line after them."""
    start = next((k for k, line in enumerate(lines) if line.lower().startswith("channels")), None)
    heads = [line for line in lines[: start or 0] if line]
    if start is None or not heads or not heads[0].lower().startswith(("skmotion", "homotion", "knmotion")):
        raise MotionError(describe(at_line(path, 1), "is no SKM motion", allowed="SkMotion, then channels N"))
    words = lines[start].split()
    count = whole_number(words[1] if len(words) > 1 else "", path, start + 1, "count of channels")
    channels: list[Channel] = []
    at = start + 1
    while len(channels) < count:
        if at >= len(lines):
            raise MotionError(describe(at_line(path, len(lines)), "ends in the list of channels"))
        if lines[at]:
            joint, _, kind = lines[at].rpartition(" ")
            if kind.lower() not in _KIND_OF or not joint.strip():
                allowed = ", ".join(WIDTHS)
                raise MotionError(describe(at_line(path, at + 1), "unknown channel", lines[at][:40], allowed))
            channels.append(Channel(joint.strip().strip('"'), _KIND_OF[kind.lower()]))
        at += 1
    return tuple(channels), at


def read_skm(path: Path, skeleton_path: Path) -> SourceMotion:
    """Read an SKM motion on an SK skeleton.

    Parameters
    ----------
    path, skeleton_path : Path

    Raises
    ------
    MotionError
        A file is broken, with its line, or motion and skeleton have no joint in common.

    Notes
    -----
    Positions are added to a joint's offset; rotations stand between the fixed ones of the skeleton. Channels
    of joints that the skeleton lacks are passed over.
    """
    lines = _content_lines(path)
    channels, at = _read_channel_list(lines, path)
    width = sum(WIDTHS[channel.kind] for channel in channels)
    records, places, declared, after = _read_records(lines, at, path)
    rows = read_rows(records, places, width + 1, path)
    if len(rows) == 0:
        raise MotionError(describe(at_line(path, len(lines)), "there are no frames"))
    if abs(declared - len(rows)) > 1:
        told = f"{len(rows)} rows"
        raise MotionError(describe(str(path), "declares another count of frames", declared, told))
    sk = read_sk(skeleton_path)
    rate = frame_rate_of(rows[:, 0], path)
    rotation, position = place_values(sk, channels, rows[:, 1:], path)
    tags = _read_tags(lines[after:], after + 1, path)
    unit = sk.metres_per_unit if sk.metres_per_unit is not None else stated_unit(read_text(path))
    return SourceMotion(path, path.stem, sk.skeleton, rate, rotation, position, unit, tags)


def _read_records(lines: list[str], at: int, path: Path) -> tuple[list[str], list[int], int, int]:
    """Rows (time, values), their lines, the declared count, and the index after them."""
    records: list[str] = []
    places: list[int] = []
    declared, last = -1, at
    for index in range(at, len(lines)):
        words = lines[index].split(None, 3)
        if not words:
            continue
        if words[0].lower() == "frames":
            declared = whole_number(words[1] if len(words) > 1 else "", path, index + 1, "count of frames")
        elif words[0].lower() == "kt":
            if len(words) < 4 or words[2].lower() != "fr":
                raise MotionError(
                    describe(at_line(path, index + 1), "is no key frame", lines[index][:40], "kt TIME fr v v")
                )
            records.append(f"{words[1]} {words[3]}")
            places.append(index + 1)
            last = index + 1
        elif records:
            break
        elif words[0].lower() != "start_kt":
            raise MotionError(describe(at_line(path, index + 1), "cannot be understood", lines[index][:40]))
    if declared < 0:
        raise MotionError(describe(at_line(path, len(lines)), "ends before its frames"))
    return records, places, declared, last


def frame_rate_of(time: FloatArray, path: Path) -> float:
    """Frame rate of key times that are uniform to their printed digits.

    Raises
    ------
    MotionError
        Times do not rise, or their steps differ.
    """
    if len(time) == 1:
        return USUAL_RATE
    steps = np.diff(time)
    mean = float((time[-1] - time[0]) / (len(time) - 1))
    if not (steps > 0.0).all():
        raise MotionError(
            describe(str(path), f"time does not rise at frame {int((steps <= 0).argmax()) + 1}")
        )
    if np.abs(steps - mean).max() > 0.25 * mean:
        raise MotionError(
            describe(str(path), "steps of time differ", f"{steps.min():g} to {steps.max():g} s")
        )
    nearest = round(1.0 / mean)
    return float(nearest) if abs(nearest * mean - 1.0) < 2e-3 else 1.0 / mean


def place_values(
    sk: SmartBodySkeleton, channels: Sequence[Channel], values: FloatArray, path: Path
) -> tuple[FloatArray, FloatArray]:
    """Local rotations (F, J, 4) and translations (F, J, 3) of channel values.

    Parameters
    ----------
    sk : SmartBodySkeleton
    channels : sequence of Channel
        ``Quat`` of four values is a quaternion, of three a rotation vector.
    values : (F, n) float64
    path : Path
        For the message.

    Raises
    ------
    MotionError
        No channel belongs to the skeleton.
    """
    skeleton = sk.skeleton
    place = {name: index for index, name in enumerate(skeleton.joint_names)}
    own = np.zeros((len(values), skeleton.joint_count, 4))
    own[..., 0] = 1.0
    position = np.broadcast_to(skeleton.offset, (len(values), skeleton.joint_count, 3)).copy()
    column, used = 0, 0
    whole = values.shape[1] == sum(4 if c.kind == "Quat" else WIDTHS[c.kind] for c in channels)
    has_quaternions = whole and any(channel.kind == "Quat" for channel in channels)
    for channel in channels:
        width = 4 if has_quaternions and channel.kind == "Quat" else WIDTHS[channel.kind]
        part = values[:, column : column + width]
        column += width
        joint = place.get(channel.joint)
        if joint is None:
            continue
        used += 1
        if channel.kind in POSITIONS:
            position[:, joint, "XYZ".index(channel.kind[0])] += part[:, 0]
        elif channel.kind == "Quat" and skeleton.is_animated[joint]:
            own[:, joint] = _unit(part, path) if width == 4 else from_vector(part)
        elif channel.kind in ROTATIONS and skeleton.is_animated[joint]:
            axis = "Y" if channel.kind == "Twist" else channel.kind[0]
            own[:, joint] = multiply(own[:, joint], from_euler(np.radians(part), axis))
        elif channel.kind == "Swing" and skeleton.is_animated[joint]:
            own[:, joint] = from_vector(np.concatenate([part, np.zeros((len(part), 1))], axis=1))
    if used == 0:
        raise MotionError(
            describe(str(path), f"no channel belongs to the skeleton {sk.path.name}", channels[0].joint)
        )
    return multiply(multiply(sk.before, own), sk.after), position


def _unit(quaternion: FloatArray, path: Path) -> FloatArray:
    length = np.linalg.norm(quaternion, axis=1, keepdims=True)
    if not (length > 0.5).all():
        raise MotionError(describe(str(path), f"frame {int((length <= 0.5).argmax())} holds no rotation"))
    return np.asarray(quaternion / length)


def _read_tags(lines: Sequence[str], first: int, path: Path) -> tuple[tuple[str, float], ...]:
    """Named times after the frames; text values are passed over."""
    tags = []
    for index, line in enumerate(lines):
        key, colon, value = line.rpartition(":")
        if not colon or not key.strip() or not value.strip():
            continue
        try:
            float(value)
        except ValueError:
            continue
        name = re.sub(r"\s*time$", "", key.strip().strip('"'), flags=re.IGNORECASE)
        tags.append((_tag_name(name), number(value.strip(), path, first + index, name)))
    return tuple(tags)


def _tag_name(name: str) -> str:
    """One spelling for each sync point."""
    reduced = name.lower().replace("_", "").removesuffix("time")
    same = {"strokestart": "strokeStart", "strokeemphasis": "emphasis", "strokeend": "stroke"}
    same |= {point.lower(): point for point in SYNC_POINTS}
    return same.get(reduced, name)
