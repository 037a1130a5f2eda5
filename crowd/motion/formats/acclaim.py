"""ASF and AMC of Acclaim: a skeleton of bones, and frames of bone rotations."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import numpy.typing as npt

from crowd.errors import MotionError, describe, nearest_first
from crowd.motion.formats.euler import compose
from crowd.motion.formats.text import TextFile, at_line, number
from crowd.motion.rotation import conjugate, multiply
from crowd.motion.source import SourceMotion, SourceSkeleton

FloatArray = npt.NDArray[np.float64]

USUAL_RATE = 120.0
"""AMC files state no rate; CMU and HDM05 captured at this one, Hz."""
INCH = 0.0254
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
    ordered = {"root": skeleton.bones["root"]}
    waiting = {name: bone for name, bone in skeleton.bones.items() if name != "root"}
    while waiting:
        ready = [name for name, bone in waiting.items() if bone.parent in ordered]
        if not ready:
            name, bone = next(iter(waiting.items()))
            raise MotionError(
                describe(at_line(skeleton.path, bone.line), "bone does not hang on the root", name)
            )
        for name in ready:
            ordered[name] = waiting.pop(name)
    if not any(bone.length > 0.0 for bone in ordered.values()):
        raise MotionError(describe(str(skeleton.path), "all bones have zero length"))
    skeleton.bones = ordered


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
    names, values, frames = _read_frames(path, asf)
    skeleton = _as_joints(asf)
    count = skeleton.joint_count
    rotation = np.zeros((frames, count, 4))
    rotation[..., 0] = 1.0
    position = np.broadcast_to(skeleton.offset, (frames, count, 3)).copy()
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
    bones = list(asf.bones.values())
    place = {bone.name: index for index, bone in enumerate(bones)}
    names = [bone.name for bone in bones]
    parent = [-1 if bone.name == "root" else place[bone.parent] for bone in bones]
    offset = [
        asf.position
        if bone.name == "root"
        else np.array(asf.bones[bone.parent].direction) * asf.bones[bone.parent].length
        for bone in bones
    ]
    with_children = {bone.parent for bone in bones}
    for bone in bones:
        if bone.name not in with_children and bone.name != "root":
            names.append(f"{bone.name}_end")
            parent.append(place[bone.name])
            offset.append(np.array(bone.direction) * bone.length)
    animated = [any(kind[0] == "r" for kind in bone.freedom) for bone in bones]
    animated += [False] * (len(names) - len(bones))
    still = np.tile([1.0, 0.0, 0.0, 0.0], (len(names), 1))
    return SourceSkeleton(
        tuple(names), np.array(parent, np.int32), np.array(offset), still, np.array(animated)
    )


def _read_frames(path: Path, asf: AcclaimSkeleton) -> tuple[list[str], FloatArray, int]:
    """Bones in the order of the frames, their values (frames, columns), and the number of frames."""
    names: list[str] = []
    numbers: list[str] = []
    starts: list[int] = []
    row: list[str] = []
    at = 0
    expected = 1
    began = False
    source = TextFile(path)
    lines = source.lines
    for index, text in enumerate(lines):
        if text.startswith(("#", ":")) or not text.strip():
            continue
        name, _, rest = text.strip().partition(" ")
        if not rest and name.isdigit():
            if began:
                _close_frame(path, index, names, at, row, numbers)
            if int(name) != expected and expected > 1:
                raise MotionError(describe(at_line(path, index + 1), "frame is missing", name, str(expected)))
            expected = int(name) + 1
            began, at, row = True, 0, []
            starts.append(index + 1)
            continue
        if not began:
            raise MotionError(
                describe(at_line(path, index + 1), "is no AMC file", text[:40], "a frame number")
            )
        if len(numbers) == 0:
            names.append(name)
            _check_bone(path, index + 1, asf, name, names)
        elif at >= len(names) or names[at] != name:
            wanted = names[at] if at < len(names) else "a frame number"
            raise MotionError(describe(at_line(path, index + 1), "bone is out of order", name[:40], wanted))
        row.append(rest)
        at += 1
        freedom = len(asf.bones[name].freedom)
        if len(rest.split()) != freedom:
            raise MotionError(
                describe(at_line(path, index + 1), "wrong count of numbers", rest, f"{freedom} numbers")
            )
    if not began:
        raise MotionError(describe(at_line(path, len(lines)), "there are no frames"))
    _close_frame(path, len(lines), names, at, row, numbers)
    width = sum(len(asf.bones[name].freedom) for name in names)
    return names, source.table(numbers, starts, width, "a frame"), len(numbers)


def _check_bone(path: Path, line: int, asf: AcclaimSkeleton, name: str, names: list[str]) -> None:
    if name not in asf.bones:
        known = nearest_first(name, asf.bones)
        raise MotionError(describe(at_line(path, line), "the skeleton has no such bone", name[:40], known))
    if names.count(name) > 1:
        raise MotionError(describe(at_line(path, line), "bone comes twice in a frame", name))


def _close_frame(
    path: Path, line: int, names: list[str], at: int, row: list[str], numbers: list[str]
) -> None:
    if at != len(names) or not names:
        raise MotionError(
            describe(at_line(path, line), "frame ends too soon", f"{at} bones", f"{len(names)}")
        )
    numbers.append(" ".join(row))
