"""ASF and AMC of Acclaim: a skeleton of bones, and frames of bone rotations."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from itertools import compress
from pathlib import Path
from typing import NoReturn

import numpy as np
import numpy.typing as npt

from crowd.errors import MotionError, describe, nearest_first
from crowd.motion.formats.euler import compose
from crowd.motion.formats.joint_list import IDENTITY, JointList, check_size, rest_positions
from crowd.motion.formats.text import MAXIMUM_NUMBER, TextFile, at_line, number
from crowd.motion.rotation import conjugate, multiply
from crowd.motion.source import SourceMotion, SourceSkeleton

FloatArray = npt.NDArray[np.float64]

USUAL_RATE = 120.0
"""AMC files state no rate; CMU and HDM05 captured at this one, Hz."""
INCH = 0.0254
_HEADER_LINES = 20
_BLOCK = 256
"""Frames whose numbers are read at once."""
DEGREES_OF_FREEDOM = ("rx", "ry", "rz", "tx", "ty", "tz", "l")


@dataclass
class _Bone:
    name: str
    line: int
    direction: tuple[float, float, float] = (0.0, 0.0, 0.0)
    length: float = 0.0
    axis: tuple[float, float, float] = (0.0, 0.0, 0.0)
    axis_order: str = "XYZ"
    freedom: tuple[str, ...] = ()
    parent: str = ""

    def end(self) -> tuple[float, ...]:
        """From the start of the bone to its end."""
        return tuple(self.length * part for part in self.direction)


@dataclass
class AcclaimSkeleton:
    """What an ASF file holds.

    Attributes
    ----------
    path : Path
    metres_per_unit : float or None
    radians : float
        Radians in the file's unit of angle.
    bones : dict of str to bone
        By name, parents first; ``root`` is the first one.
    position : (3,) float64
        Of the root, file units.
    """

    path: Path
    metres_per_unit: float | None = None
    radians: float = math.pi / 180.0
    bones: dict[str, _Bone] = field(default_factory=dict)
    position: FloatArray = field(default_factory=lambda: np.zeros(3))


def read_asf(path: Path) -> AcclaimSkeleton:
    """Read an ASF skeleton.

    Raises
    ------
    MotionError
        The file is broken; its line is named.
    """
    skeleton = AcclaimSkeleton(path)
    skeleton.bones["root"] = _Bone("root", 1, freedom=("tx", "ty", "tz", "rx", "ry", "rz"))
    section, bone = "", None
    lines = TextFile(path).lines
    for index, text in enumerate(lines):
        line = index + 1
        tokens = text.split("#")[0].split()
        if not tokens:
            continue
        if tokens[0].startswith(":"):
            if bone is not None:
                raise MotionError(describe(at_line(path, bone.line), "bone is not ended", bone.name))
            section = tokens[0].lower()
        elif section == ":units":
            _read_unit(skeleton, tokens, line)
        elif section == ":root":
            _read_root(skeleton, tokens, line)
        elif section == ":bonedata":
            bone = _read_bone(skeleton, bone, tokens, line)
        elif section == ":hierarchy":
            _read_children(skeleton, tokens, line)
    if bone is not None:
        raise MotionError(describe(at_line(path, bone.line), "bone is not ended", bone.name))
    if len(skeleton.bones) < 2:
        raise MotionError(describe(at_line(path, len(lines)), "is no ASF skeleton: it has no bones"))
    _sort_bones(skeleton)
    return skeleton


def _read_unit(skeleton: AcclaimSkeleton, tokens: list[str], line: int) -> None:
    if len(tokens) != 2:
        raise MotionError(describe(at_line(skeleton.path, line), "a unit takes one value", " ".join(tokens)))
    if tokens[0] == "length":
        length = number(tokens[1], skeleton.path, line, "length")
        if length <= 0.0:
            raise MotionError(describe(at_line(skeleton.path, line), "length must be positive", length))
        skeleton.metres_per_unit = INCH / length
    elif tokens[0] == "angle":
        if tokens[1] not in ("deg", "rad"):
            raise MotionError(describe(at_line(skeleton.path, line), "unknown angle", tokens[1], "deg, rad"))
        skeleton.radians = math.pi / 180.0 if tokens[1] == "deg" else 1.0


def _numbers(tokens: list[str], count: int, path: Path, line: int, what: str) -> tuple[float, ...]:
    if len(tokens) < count:
        raise MotionError(describe(at_line(path, line), f"{what} takes {count} numbers", " ".join(tokens)))
    return tuple(number(token, path, line, what) for token in tokens[:count])


def _order(token: str, path: Path, line: int) -> str:
    if sorted(token.upper()) != ["X", "Y", "Z"]:
        raise MotionError(describe(at_line(path, line), "is no order of axes", token, "like XYZ"))
    return token.upper()


def _read_root(skeleton: AcclaimSkeleton, tokens: list[str], line: int) -> None:
    root, path = skeleton.bones["root"], skeleton.path
    match tokens[0].lower():
        case "order":
            root.freedom = _freedom(tokens[1:], path, line)
        case "axis":
            root.axis_order = _order(tokens[1] if len(tokens) > 1 else "", path, line)
        case "position":
            skeleton.position = np.array(_numbers(tokens[1:], 3, path, line, "position"))
        case "orientation":
            x, y, z = _numbers(tokens[1:], 3, path, line, "orientation")
            root.axis = (x, y, z)


def _freedom(tokens: list[str], path: Path, line: int) -> tuple[str, ...]:
    found = tuple(token.lower() for token in tokens)
    for token in found:
        if token not in DEGREES_OF_FREEDOM:
            allowed = ", ".join(DEGREES_OF_FREEDOM)
            raise MotionError(describe(at_line(path, line), "unknown channel", token, allowed))
    if len(set(found)) != len(found):
        raise MotionError(describe(at_line(path, line), "a channel is listed twice", " ".join(found)))
    return found


def _read_bone(skeleton: AcclaimSkeleton, bone: _Bone | None, tokens: list[str], line: int) -> _Bone | None:
    path = skeleton.path
    word = tokens[0].lower()
    if word == "begin":
        if bone is not None:
            raise MotionError(describe(at_line(path, line), "bone is not ended", bone.name))
        return _Bone("", line)
    if bone is None:
        raise MotionError(describe(at_line(path, line), "cannot be understood", tokens[0][:40], "begin"))
    match word:
        case "end":
            if not bone.name or bone.name in skeleton.bones:
                raise MotionError(
                    describe(at_line(path, bone.line), "bone name is missing or used twice", bone.name)
                )
            skeleton.bones[bone.name] = bone
            return None
        case "name":
            bone.name = " ".join(tokens[1:])
        case "direction":
            x, y, z = _numbers(tokens[1:], 3, path, line, "direction")
            bone.direction = (x, y, z)
        case "length":
            bone.length = _numbers(tokens[1:], 1, path, line, "length")[0]
        case "axis":
            x, y, z = _numbers(tokens[1:], 3, path, line, "axis")
            bone.axis = (x, y, z)
            bone.axis_order = _order(tokens[4] if len(tokens) > 4 else "XYZ", path, line)
        case "dof":
            bone.freedom = _freedom(tokens[1:], path, line)
    return bone


def _read_children(skeleton: AcclaimSkeleton, tokens: list[str], line: int) -> None:
    if tokens[0].lower() in ("begin", "end") and len(tokens) == 1:
        return
    for name in tokens:
        if name not in skeleton.bones:
            known = nearest_first(name, skeleton.bones)
            raise MotionError(describe(at_line(skeleton.path, line), "no bone has this name", name, known))
    for name in tokens[1:]:
        child = skeleton.bones[name]
        if name == "root" or child.parent:
            raise MotionError(describe(at_line(skeleton.path, line), "bone has two parents", name))
        child.parent = tokens[0]


def _sort_bones(skeleton: AcclaimSkeleton) -> None:
    """Order bones so that parents come first."""
    children: dict[str, list[str]] = {}
    for name, bone in skeleton.bones.items():
        children.setdefault(bone.parent, []).append(name)
    order = ["root"]
    for name in order:
        order += children.get(name, [])
    loose = sorted(set(skeleton.bones).difference(order), key=lambda name: skeleton.bones[name].line)
    if loose:
        line = skeleton.bones[loose[0]].line
        what = "bone does not hang on the root: it has no parent, or is its own ancestor"
        raise MotionError(describe(at_line(skeleton.path, line), what, loose[0]))
    skeleton.bones = {name: skeleton.bones[name] for name in order}


def read_amc(path: Path, skeleton_path: Path, frame_rate: float | None = None) -> SourceMotion:
    """Read AMC frames on an ASF skeleton.

    Parameters
    ----------
    path, skeleton_path : Path
    frame_rate : float, optional
        Hz; `USUAL_RATE` when not told.

    Raises
    ------
    MotionError
        A file is broken; its line is named.

    Notes
    -----
    A bone turns itself, about where it starts; as joints, a rotation belongs to the start of its bone and a
    child's offset is the bone before it. Euler angles apply in listed order about fixed axes.
    """
    asf = read_asf(skeleton_path)
    skeleton = _as_joints(asf)
    names, values = _read_frames(path, asf)
    check_size(path, len(values), skeleton.joint_count)
    rotation = np.empty((len(values), skeleton.joint_count, 4))
    rotation[:] = IDENTITY
    position = rest_positions(skeleton, len(values))
    place = {name: index for index, name in enumerate(skeleton.joint_names)}
    column = 0
    for name in names:
        bone = asf.bones[name]
        part = values[:, column : column + len(bone.freedom)]
        column += len(bone.freedom)
        turns = [k for k, kind in enumerate(bone.freedom) if kind[0] == "r"]
        if turns:
            # Applied in listed order about fixed axes: the last listed is the outermost.
            axes = tuple("xyz".index(bone.freedom[k][1]) for k in turns[::-1])
            own = compose(axes, part[:, turns[::-1]] * asf.radians)
            frame = _axis_rotation(bone, asf.radians)
            rotation[:, place[name]] = multiply(multiply(frame, own), conjugate(frame))
        for k, kind in enumerate(bone.freedom):
            if kind[0] == "t":
                position[:, place[name], "xyz".index(kind[1])] += part[:, k]
    rate = USUAL_RATE if frame_rate is None else frame_rate
    return SourceMotion(path, path.stem, skeleton, rate, rotation, position, asf.metres_per_unit)


def _axis_rotation(bone: _Bone, radians: float) -> FloatArray:
    axes = tuple("XYZ".index(axis) for axis in bone.axis_order[::-1])
    return compose(axes, radians * np.array([bone.axis[axis] for axis in axes]))


def _as_joints(asf: AcclaimSkeleton) -> SourceSkeleton:
    """One joint at the start of each bone, and one at the end of each bone without children."""

    def fail(line: int, what: str, got: object) -> NoReturn:
        raise MotionError(describe(at_line(asf.path, line), what, got))

    joints = JointList(fail)
    place = {"": -1}
    for name, bone in asf.bones.items():
        place[name] = joints.add(name, place[bone.parent], bone.line)
        above = asf.bones.get(bone.parent)
        joints.offset[-1] = tuple(asf.position) if above is None else above.end()
        joints.is_animated[-1] = any(kind[0] == "r" for kind in bone.freedom)
    with_children = {bone.parent for bone in asf.bones.values()}
    for name, bone in asf.bones.items():
        if name not in with_children:
            joints.add_end(place[name], bone.line)
            joints.offset[-1] = bone.end()
    return joints.build(asf.bones["root"].line)


def _read_frames(path: Path, asf: AcclaimSkeleton) -> tuple[list[str], FloatArray]:
    """Bones in the order of the frames, and their values (frames, columns)."""
    source = TextFile(path)
    kept = [text != "" and text[0] not in "#:" and not text.isspace() for text in source.lines]
    lines = list(compress(range(1, len(kept) + 1), kept))
    texts = list(compress(source.lines, kept))
    if any(text.strip().lower() == ":radians" for text in source.lines[:_HEADER_LINES]):
        asf.radians = 1.0
    if not texts:
        source.fail(len(source.lines), "holds no frames")
    if not texts[0].strip().isdigit():
        source.fail(lines[0], "the number of a frame should stand here", texts[0].strip())
    first = source.integer(texts[0].strip(), lines[0], "a frame")
    end = next((at for at in range(1, len(texts)) if texts[at].strip().isdigit()), len(texts))
    names = _first_bones(source, asf, list(zip(lines[1:end], texts[1:end], strict=True)))
    widths = [len(asf.bones[name].freedom) for name in names]
    check_size(path, len(texts) / end, len(asf.bones))
    blocks: list[FloatArray] = []
    for at in range(0, len(texts), _BLOCK * end):
        block = slice(at, at + _BLOCK * end)
        values = _read_block(" ".join(texts[block]).split(), first + at // end, names, widths)
        if values is None:
            _fail_in_block(source, lines[block], first + at // end, names, widths)
        blocks.append(values)
    return names, np.concatenate(blocks)


def _read_block(tokens: list[str], first: int, names: list[str], widths: list[int]) -> FloatArray | None:
    """Values of frames of which the first has a number; None when anything is wrong."""
    period = 1 + len(names) + sum(widths)
    count = len(tokens) // period
    expected = [str(first + frame) for frame in range(count)]
    if not count or len(tokens) % period or tokens[::period] != expected:
        return None
    is_value = np.ones(period, bool)
    is_value[0] = False
    place = 1
    for name, width in zip(names, widths, strict=True):
        if tokens[place::period].count(name) != count:
            return None
        tokens[place::period] = ["0"] * count
        is_value[place] = False
        place += 1 + width
    try:
        values = np.fromiter(map(float, tokens), np.float64, len(tokens)).reshape(count, period)
    except ValueError:
        return None
    values = values[:, is_value]
    return values if bool((np.abs(values) <= MAXIMUM_NUMBER).all()) else None


def _first_bones(source: TextFile, asf: AcclaimSkeleton, body: list[tuple[int, str]]) -> list[str]:
    """Names of the bones in the first frame; all others must list the same."""
    names: list[str] = []
    for line, text in body:
        name = text.split()[0]
        if name not in asf.bones:
            source.fail(line, "the skeleton has no such bone", name, nearest_first(name, asf.bones))
        if name in names:
            source.fail(line, "a bone stands twice in a frame", name)
        names.append(name)
    if not any(asf.bones[name].freedom for name in names):
        source.fail(len(source.lines) if not body else body[0][0], "a frame holds no bones that move")
    return names


def _fail_in_block(
    source: TextFile, lines: list[int], first: int, names: list[str], widths: list[int]
) -> NoReturn:
    """Say which line of some frames is wrong."""
    for at, line in enumerate(lines):
        frame, bone = first + at // (1 + len(names)), at % (1 + len(names)) - 1
        tokens = source.lines[line - 1].split()
        if bone < 0:
            if tokens != [str(frame)]:
                source.fail(line, f"the number of frame {frame} should stand here", " ".join(tokens))
            continue
        if tokens[0] != names[bone]:
            source.fail(line, "another bone should stand here", tokens[0], names[bone])
        for token in tokens[1:]:
            source.number(token, line, f"each value of {names[bone]}")
        if len(tokens) != 1 + widths[bone]:
            source.fail(line, f"{names[bone]} has {widths[bone]} values", len(tokens) - 1)
    source.fail(lines[-1], f"ends within frame {first + len(lines) // (1 + len(names))}")
