"""Gather the joints of a file into a skeleton, and refuse what is no skeleton."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NoReturn

import numpy as np

from crowd.errors import MotionError, describe
from crowd.motion.source import FloatArray, SourceSkeleton

MAXIMUM_POSES = 2**24
"""Most frames times joints of one motion: an hour of 39 joints at 120 Hz, one gigabyte."""
MAXIMUM_JOINTS = 10_000
IDENTITY = (1.0, 0.0, 0.0, 0.0)

Fail = Callable[[int, str, object], NoReturn]


class JointList:
    """Joints in the order of a file, parents first.

    Parameters
    ----------
    fail : callable
        ``fail(line, what, got)`` raises the error of the format.
    """

    def __init__(self, fail: Fail) -> None:
        self._fail = fail
        self.names: list[str] = []
        self.parent: list[int] = []
        self.offset: list[Sequence[float]] = []
        self.rest_rotation: list[Sequence[float]] = []
        self.is_animated: list[bool] = []
        self._index: dict[str, int] = {}

    def add(self, name: str, parent: int, line: int) -> int:
        """Add a joint at its parent, without rotation; gives its index."""
        if name in self._index:
            self._fail(line, "two joints have the same name", name)
        if len(self.names) >= MAXIMUM_JOINTS:
            self._fail(line, "has too many joints", f"more than {MAXIMUM_JOINTS}")
        self._index[name] = len(self.names)
        self.names.append(name)
        self.parent.append(parent)
        self.offset.append((0.0, 0.0, 0.0))
        self.rest_rotation.append(IDENTITY)
        self.is_animated.append(False)
        return len(self.names) - 1

    def add_end(self, parent: int, line: int) -> int:
        """Add an end point that has no name of its own."""
        base = f"{self.names[parent]}_end"
        name, number = base, 2
        while name in self._index:
            name, number = f"{base}_{number}", number + 1
        return self.add(name, parent, line)

    def build(self, line: int) -> SourceSkeleton:
        """Make the skeleton; `line` is named when it is unusable."""
        if not self.names:
            self._fail(line, "holds no joint", None)
        parent = np.array(self.parent, np.int32)
        offset = np.array(self.offset, np.float64).reshape(-1, 3)
        bones = offset[parent >= 0]
        if bones.size and not bones.any():
            self._fail(line, "all bones have zero length", None)
        rest = np.array(self.rest_rotation, np.float64).reshape(-1, 4)
        return SourceSkeleton(tuple(self.names), parent, offset, rest, np.array(self.is_animated, bool))


def check_size(path: Path, frame_count: float, joint_count: int) -> None:
    """Refuse motions whose arrays would not fit into memory, before these are made."""
    if frame_count * joint_count > MAXIMUM_POSES:
        what = f"is too long: {frame_count:.0f} frames of {joint_count} joints"
        raise MotionError(describe(str(path), what, allowed=f"{MAXIMUM_POSES} joints in all frames together"))


def rest_positions(skeleton: SourceSkeleton, frame_count: int) -> FloatArray:
    """Offsets of all joints, repeated for each frame: (F, J, 3)."""
    return np.array(np.broadcast_to(skeleton.offset, (frame_count, skeleton.joint_count, 3)))


def stated_rate(frame_time: float) -> float:
    """Frames per second of a printed frame time, s: the integer that it stands for, where there is one.

    A time is printed with few digits: 0.0333333 means 30 per second, 0.0333667 means 29.97.
    """
    rate = 1.0 / frame_time
    return float(round(rate)) if abs(rate - round(rate)) < 1e-4 * rate else rate
