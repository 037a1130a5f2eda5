"""Motion as a file holds it: its own skeleton, joint names, units and axes, before anything is converted."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from crowd.motion.rotation import multiply, rotate

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int32]
BoolArray = npt.NDArray[np.bool_]


@dataclass(frozen=True)
class SourceSkeleton:
    """A tree of joints with the names, units and axes of its file.

    Attributes
    ----------
    joint_names : tuple of str
        Unique. End points that a format states without a name of their own are called ``PARENT_end``.
    parent : (J,) int32
        Index of the parent, -1 for roots; a parent comes before its children.
    offset : (J, 3) float64
        Position in the parent's frame in the rest pose, file units.
    rest_rotation : (J, 4) float64
        Rotation against the parent in the rest pose, unit quaternions (w, x, y, z).
    is_animated : (J,) bool
        The joint has rotation channels.
    """

    joint_names: tuple[str, ...]
    parent: IntArray
    offset: FloatArray
    rest_rotation: FloatArray
    is_animated: BoolArray

    @property
    def joint_count(self) -> int:
        """Number of joints, end points included."""
        return len(self.joint_names)


@dataclass(frozen=True)
class SourceMotion:
    """Frames of one motion on its own skeleton.

    Attributes
    ----------
    path : Path
        The file it was read from.
    name : str
    skeleton : SourceSkeleton
    frame_rate : float
        Frames per second, as stated by the file or the format's custom.
    rotation_local : (F, J, 4) float64
        Whole rotation against the parent, fixed rotations of the rest pose included; unit quaternions.
    position_local : (F, J, 3) float64
        Whole translation against the parent, file units.
    metres_per_unit : float or None
        As stated by the file; None when it says nothing.
    tags : tuple of (str, float)
        Named times, s, in file order, such as ``("heelStrikeLf", 0.533)``.
    """

    path: Path
    name: str
    skeleton: SourceSkeleton
    frame_rate: float
    rotation_local: FloatArray
    position_local: FloatArray
    metres_per_unit: float | None = None
    tags: tuple[tuple[str, float], ...] = ()

    @property
    def frame_count(self) -> int:
        """Number of frames."""
        return int(self.rotation_local.shape[0])

    @property
    def duration(self) -> float:
        """Time from the first to the last frame, s."""
        return (self.frame_count - 1) / self.frame_rate

    def world(self) -> tuple[FloatArray, FloatArray]:
        """Joint rotations (F, J, 4) and positions (F, J, 3), file units and axes."""
        return world_pose(self.skeleton.parent, self.rotation_local, self.position_local)


def world_pose(
    parent: IntArray, rotation_local: FloatArray, position_local: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Chain local rotations (..., J, 4) and translations (..., J, 3) into world ones of the same shapes."""
    rotation = np.array(rotation_local, np.float64)
    position = np.array(position_local, np.float64)
    for joint, above in enumerate(parent):
        if above >= 0:
            position[..., joint, :] = position[..., above, :] + rotate(
                rotation[..., above, :], position_local[..., joint, :]
            )
            rotation[..., joint, :] = multiply(rotation[..., above, :], rotation_local[..., joint, :])
    return rotation, position
