"""The skeleton: joints, their tree, rest pose, limits and the segment that each joint's length belongs to."""

from dataclasses import dataclass, field
from enum import IntEnum
from functools import cached_property

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int32]


class Segment(IntEnum):
    """Group of joints whose offsets scale together, so that people can differ in proportions."""

    TORSO = 0
    NECK_HEAD = 1
    SHOULDER = 2
    ARM = 3
    HAND = 4
    PELVIS = 5
    LEG = 6
    FOOT = 7


@dataclass(frozen=True)
class Skeleton:
    """A tree of joints in rest pose: standing, arms hanging down or in the stated rest pose, facing +z.

    Joints are sorted so that a parent comes before its children; joint 0 is the pelvis.

    Attributes
    ----------
    joint_names : tuple of str
        Unique names such as ``"left_foot"``.
    parent : (J,) int32
        Index of the parent joint, -1 for the pelvis.
    offset : (J, 3) float64
        Position of the joint in its parent's frame in the rest pose, m. Joint 0: pelvis above the ground.
    segment : (J,) int32
        `Segment` whose scale stretches the joint's offset.
    limit_lower, limit_upper : (J, 3) float64
        Allowed rotation vector about the joint's x, y, z axes against the rest pose, rad.
    stature : float
        Height from sole to crown in rest pose, m.
    """

    joint_names: tuple[str, ...]
    parent: IntArray
    offset: FloatArray
    segment: IntArray
    limit_lower: FloatArray
    limit_upper: FloatArray
    stature: float
    _index: dict[str, int] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "_index", {name: i for i, name in enumerate(self.joint_names)})

    @property
    def joint_count(self) -> int:
        """Number of joints."""
        return len(self.joint_names)

    def joint(self, name: str) -> int:
        """Index of a joint by name."""
        return self._index[name]

    @cached_property
    def leg_length(self) -> float:
        """Length from hip to ankle along thigh and shank, m."""
        knee, ankle = self.joint("left_shank"), self.joint("left_foot")
        return float(np.linalg.norm(self.offset[knee]) + np.linalg.norm(self.offset[ankle]))
