"""Channels of SmartBody motions, and the poses that their values make on a skeleton.

The local transform of a joint is translate(offset + position channels), then fixed rotation before, rotation
of the channels, fixed rotation after.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn

import numpy as np

from crowd.errors import MotionError, describe
from crowd.motion.formats import sampling
from crowd.motion.formats.euler import AXES, compose
from crowd.motion.formats.joint_list import IDENTITY, check_size
from crowd.motion.rotation import about, from_vector, multiply
from crowd.motion.source import FloatArray, SourceMotion, SourceSkeleton

POSITIONS = ("XPos", "YPos", "ZPos")
ANGLES = ("XRot", "YRot", "ZRot")
CHANNEL_TYPES = (*POSITIONS, *ANGLES, "Quat", "Swing", "Twist")
CANONICAL_TYPE = {name.lower(): name for name in CHANNEL_TYPES}
FRAME_RATE = 30.0
"""Of clips that are a single pose, or whose keys are uneven."""

Channel = tuple[str, str]
"""Joint name and type."""
SYNC_POINTS = ("start", "ready", "strokeStart", "emphasis", "stroke", "relax", "stop")


@dataclass(frozen=True)
class SmartBodySkeleton:
    """A skeleton file.

    Attributes
    ----------
    path : Path
    skeleton : SourceSkeleton
        Its offsets include the start values of position channels, its rest rotations both fixed ones.
    offset : (J, 3) float64
        Without start values.
    before, after : (J, 4) float64
        Fixed rotations around that of the channels.
    euler_axes : tuple of tuple of int
        Axes of joints with angle channels, the first outermost.
    channels : frozenset of (str, str)
        Joint and type of all channels.
    metres_per_unit : float or None
    """

    path: Path
    skeleton: SourceSkeleton
    offset: FloatArray
    before: FloatArray
    after: FloatArray
    euler_axes: tuple[tuple[int, ...], ...]
    channels: frozenset[Channel]
    metres_per_unit: float | None


@dataclass(frozen=True)
class ChannelData:
    """What a motion file holds, text or binary.

    Attributes
    ----------
    path : Path
    name : str
    channels : list of (str, str)
        Joint and type, in the order of the values.
    widths : mapping of str to int
        Values per type, where these are not one.
    times : (F,) float64
        s.
    values : (F, sum of widths) float64
    metres_per_unit : float or None
    tags : tuple of (str, float)
    fail_at_frame : callable
        ``fail_at_frame(frame, what)`` raises the error that names the place.
    """

    path: Path
    name: str
    channels: list[Channel]
    widths: Mapping[str, int]
    times: FloatArray
    values: FloatArray
    metres_per_unit: float | None
    tags: tuple[tuple[str, float], ...]
    fail_at_frame: Callable[[int, str], NoReturn]


def make_motion(data: ChannelData, body: SmartBodySkeleton, frame_rate: float | None) -> SourceMotion:
    """Apply the channels that the skeleton has, and sample uneven keys at `frame_rate`."""
    if not {joint for joint, _ in data.channels} & set(body.skeleton.joint_names):
        what = f"no channel belongs to a joint of {body.path}"
        raise MotionError(describe(str(data.path), what, data.channels[0][0]))
    if None not in (data.metres_per_unit, body.metres_per_unit) and (
        data.metres_per_unit != body.metres_per_unit
    ):
        what = f"states another unit than its skeleton {body.path}"
        got = f"{data.metres_per_unit} m and {body.metres_per_unit} m"
        raise MotionError(describe(str(data.path), what, got))
    steps = np.diff(data.times)
    if not (steps > 0.0).all():
        data.fail_at_frame(int(np.argmin(steps > 0.0)) + 1, "key times must increase")
    check_size(data.path, len(data.times), body.skeleton.joint_count)
    rotation, position = _pose(data, body)
    rate = sampling.common_rate(data.times) if len(data.times) > 1 else FRAME_RATE
    if rate is None:
        rate = frame_rate or FRAME_RATE
        check_size(data.path, (data.times[-1] - data.times[0]) * rate, body.skeleton.joint_count)
        at = sampling.frame_times(data.times[0], data.times[-1], rate)
        rotation, position = (
            sampling.turns(data.times, rotation, at),
            sampling.lines(data.times, position, at),
        )
    metres = data.metres_per_unit if data.metres_per_unit is not None else body.metres_per_unit
    return SourceMotion(data.path, data.name, body.skeleton, rate, rotation, position, metres, data.tags)


def _pose(data: ChannelData, body: SmartBodySkeleton) -> tuple[FloatArray, FloatArray]:
    joint_index = {name: number for number, name in enumerate(body.skeleton.joint_names)}
    shape = (len(data.values), body.skeleton.joint_count)
    position = np.array(np.broadcast_to(body.skeleton.offset, (*shape, 3)))
    columns: dict[str, dict[int, int]] = defaultdict(dict)
    column = 0
    for joint, kind in data.channels:
        # Position channels count for every joint, as in clips that stretch limbs of a rigid skeleton.
        if (joint, kind) in body.channels or (kind in POSITIONS and joint in joint_index):
            columns[kind][joint_index[joint]] = column
        column += data.widths.get(kind, 1)
    for axis, kind in enumerate(POSITIONS):
        for number, start in columns[kind].items():
            position[:, number, axis] = body.offset[number, axis] + data.values[:, start]
    rotation = np.empty((*shape, 4))
    rotation[:] = IDENTITY
    quaternions = columns["Quat"]
    if quaternions:
        rotation[:, list(quaternions)] = _free(data, list(quaternions.values()))
    _set_angles(data, body, columns, rotation)
    _set_swings(data, columns, rotation)
    rotation = multiply(body.before, rotation)
    if not np.array_equal(body.after, np.broadcast_to(IDENTITY, body.after.shape)):
        rotation = multiply(rotation, body.after)
    return rotation, position


def _free(data: ChannelData, starts: list[int]) -> FloatArray:
    """Rotations of Quat channels: rotation vectors or quaternions."""
    width = data.widths["Quat"]
    values = data.values[:, np.array(starts)[:, None] + np.arange(width)]
    if width == 3:
        return from_vector(values)
    length = np.linalg.norm(values, axis=-1, keepdims=True)
    usable = (length > 1e-3).all(axis=(1, 2))
    if not usable.all():
        data.fail_at_frame(int(np.argmin(usable)), "a quaternion has no length")
    return np.asarray(values / length)


def _set_angles(
    data: ChannelData, body: SmartBodySkeleton, columns: Mapping[str, dict[int, int]], rotation: FloatArray
) -> None:
    """Rotations of XRot, YRot and ZRot channels, degrees; a missing one is zero."""
    for joint in sorted({joint for kind in ANGLES for joint in columns[kind]}):
        axes = body.euler_axes[joint]
        angles = np.zeros((len(rotation), len(axes)))
        for number, axis in enumerate(axes):
            if joint in columns[ANGLES[axis]]:
                angles[:, number] = np.radians(data.values[:, columns[ANGLES[axis]][joint]])
        rotation[:, joint] = compose(axes, angles)


def _set_swings(data: ChannelData, columns: Mapping[str, dict[int, int]], rotation: FloatArray) -> None:
    """Rotations of Twist channels about z, degrees, and of Swing channels across it, rad."""
    for joint, start in columns["Twist"].items():
        rotation[:, joint] = about(AXES.index("Z"), np.radians(data.values[:, start]))
    for joint, start in columns["Swing"].items():
        across = np.pad(data.values[:, start : start + 2], ((0, 0), (0, 1)))
        rotation[:, joint] = multiply(from_vector(across), rotation[:, joint])


def choose_skeleton(
    path: Path, channels: Sequence[Channel], bodies: Sequence[SmartBodySkeleton]
) -> SmartBodySkeleton:
    """Skeleton that has most of the channels; among equals the one that the clip is named after, then the one
    with fewest other channels.

    Raises
    ------
    MotionError
        None has a joint of the clip, or several fit alike.
    """
    ranks = [
        (len(body.channels.intersection(channels)), _names(path, body.path), -len(body.channels))
        for body in bodies
    ]
    best = max(ranks, default=(0, 0, 0))
    if best[0] == 0:
        tried = ", ".join(str(body.path) for body in bodies) or "no .sk file beside or above it"
        raise MotionError(describe(str(path), "finds no skeleton that has its joints", tried))
    fitting = [body for body, rank in zip(bodies, ranks, strict=True) if rank == best]
    if any(not _is_same(fitting[0], other) for other in fitting[1:]):
        names = ", ".join(str(body.path) for body in fitting)
        raise MotionError(describe(str(path), "several skeletons fit alike", names, "one, stated"))
    return fitting[0]


def _names(clip: Path, skeleton: Path) -> int:
    """Length of a skeleton's name when the clip's name starts with it."""
    return len(skeleton.stem) if clip.stem.lower().startswith(skeleton.stem.lower()) else 0


def _is_same(first: SmartBodySkeleton, second: SmartBodySkeleton) -> bool:
    return (
        first.skeleton.joint_names == second.skeleton.joint_names
        and np.array_equal(first.skeleton.parent, second.skeleton.parent)
        and np.array_equal(first.offset, second.offset)
        and np.array_equal(first.before, second.before)
    )
