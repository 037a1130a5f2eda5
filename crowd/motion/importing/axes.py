"""Units and axes of a source skeleton: what its file states, what its rest pose tells, what the user says."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from crowd.errors import MotionError, describe
from crowd.motion.importing.joint_names import JointMap
from crowd.motion.rotation import conjugate, from_axes, multiply, rotate
from crowd.motion.source import SourceMotion, world_pose

FloatArray = npt.NDArray[np.float64]

UNITS = {
    "m": 1.0,
    "dm": 0.1,
    "cm": 0.01,
    "mm": 0.001,
    "inch": 0.0254,
    "foot": 0.3048,
    "acclaim": 0.0254 / 0.45,
}
USUAL_LEG = 0.86
"""Hip to ankle of a grown person, m (Drillis and Contini 1966 at 1.75 m)."""
LEG_RANGE = (0.25, 1.6)
"""Leg lengths that are believed, m; toys and giants need ``--units``."""
STEADY = 1e-3
"""A joint whose place in its parent changes by less than this share of the longest bone does not move."""
AXIS_NAMES = ("+x", "-x", "+y", "-y", "+z", "-z")


@dataclass(frozen=True)
class Convention:
    """How a file's numbers become ours.

    Attributes
    ----------
    metres_per_unit : float
    to_ours : (4,) float64
        Rotation from the file's axes to ours (left +x, up +y, ahead +z).
    text : str
        The same in words, for the report.
    """

    metres_per_unit: float
    to_ours: FloatArray
    text: str


@dataclass(frozen=True)
class PosedSource:
    """A source motion in metres and our axes, joint by joint as in the file.

    Attributes
    ----------
    position : (F, J, 3) float64
        m.
    turned : (F, J, 4) float64
        Rotation of each joint against the rest pose, in world axes.
    rest_position : (J, 3) float64
        m.
    frame_rate : float
    """

    position: FloatArray
    turned: FloatArray
    rest_position: FloatArray
    frame_rate: float


def find_convention(
    motion: SourceMotion, joints: JointMap, units: str | None = None, up: str | None = None
) -> Convention:
    """Find unit and axes of a motion's skeleton.

    Parameters
    ----------
    motion : SourceMotion
    joints : JointMap
    units : str, optional
        One of `UNITS`, instead of what the file states or the leg length suggests.
    up : str, optional
        Up axis such as ``"+z"``, instead of the one along the standing legs.

    Raises
    ------
    MotionError
        The leg has no length, or a length that no person has in any unit; the hips coincide.
    """
    rest = rest_positions(motion)
    legs = [
        rest[joints.joint[f"{side}_thigh"]] - rest[joints.joint[f"{side}_foot"]] for side in ("left", "right")
    ]
    metres, said = unit_of(motion, _leg_length(motion, joints), units)
    up_axis = nearest_axis(legs[0] + legs[1]) if up is None else axis_named(up)
    left = rest[joints.joint["left_thigh"]] - rest[joints.joint["right_thigh"]]
    left = left - up_axis * (left @ up_axis)
    if not np.linalg.norm(left) > 1e-6 * np.linalg.norm(legs[0]):
        raise MotionError(describe(f"{motion.path}: skeleton", "left and right hip lie in one place"))
    left = nearest_axis(left)
    columns = np.stack([left, up_axis, np.cross(left, up_axis)])
    to_ours = conjugate(from_axes(*(row[None] for row in columns))[0])
    ahead = axis_name(columns[2])
    return Convention(metres, to_ours, f"{said}, up {axis_name(up_axis)}, facing {ahead}")


def unit_of(motion: SourceMotion, leg: float, units: str | None) -> tuple[float, str]:
    """Metres per unit, and where that is known from."""
    if units is not None:
        if units not in UNITS:
            raise MotionError(describe("--units", "is no unit", units, ", ".join(UNITS)))
        if math.isfinite(leg) and not LEG_RANGE[0] <= leg * UNITS[units] <= LEG_RANGE[1]:
            raise MotionError(
                describe(
                    f"{motion.path}: skeleton",
                    f"has a leg of unbelievable length in {units}",
                    f"{leg * UNITS[units]:.3g} m",
                    f"{LEG_RANGE[0]} to {LEG_RANGE[1]} m",
                )
            )
        return UNITS[units], f"{units} (as told)"
    if not (math.isfinite(leg) and leg > 0.0):
        raise MotionError(describe(f"{motion.path}: skeleton", "the leg has no length"))
    if motion.metres_per_unit is not None:
        if not LEG_RANGE[0] <= leg * motion.metres_per_unit <= LEG_RANGE[1]:
            raise MotionError(
                describe(
                    f"{motion.path}: skeleton",
                    "has a leg of unbelievable length by the unit that the file states; say --units",
                    f"{leg * motion.metres_per_unit:.3g} m",
                    f"{LEG_RANGE[0]} to {LEG_RANGE[1]} m",
                )
            )
        return motion.metres_per_unit, f"{motion.metres_per_unit:g} m per unit (stated)"
    name = min(UNITS, key=lambda unit: abs(math.log(leg * UNITS[unit] / USUAL_LEG)))
    if not LEG_RANGE[0] <= leg * UNITS[name] <= LEG_RANGE[1]:
        raise MotionError(
            describe(
                f"{motion.path}: skeleton",
                "no unit gives the leg a human length; say --units",
                f"{leg:.3g} units",
                ", ".join(UNITS),
            )
        )
    return UNITS[name], f"{name} (by leg length {leg * UNITS[name]:.2f} m)"


def rest_positions(motion: SourceMotion) -> FloatArray:
    """Joint positions (J, 3) of the rest pose, file units and axes, in the proportions of the motion.

    Some files animate one skeleton in several sizes: what a motion keeps constant counts, not the rest pose.
    """
    skeleton = motion.skeleton
    offset = skeleton.offset.copy()
    low, high = motion.position_local.min(axis=0), motion.position_local.max(axis=0)
    size = float(np.linalg.norm(offset[1:], axis=1).max(initial=0.0))
    is_constant = (skeleton.parent >= 0) & ((high - low).max(axis=1) < STEADY * size)
    offset[is_constant] = 0.5 * (low + high)[is_constant]
    return world_pose(skeleton.parent, skeleton.rest_rotation, offset)[1]


def _leg_length(motion: SourceMotion, joints: JointMap) -> float:
    rest = rest_positions(motion)
    hip, knee, ankle = (rest[joints.joint[f"left_{part}"]] for part in ("thigh", "shank", "foot"))
    return float(np.linalg.norm(knee - hip) + np.linalg.norm(ankle - knee))


def nearest_axis(direction: FloatArray) -> FloatArray:
    """Signed coordinate axis nearest to a direction."""
    axis = int(np.abs(direction).argmax())
    result = np.zeros(3)
    result[axis] = math.copysign(1.0, direction[axis])
    return result


def axis_name(axis: FloatArray) -> str:
    """Name of a signed axis, such as ``"+y"``."""
    index = int(np.abs(axis).argmax())
    return AXIS_NAMES[2 * index + (axis[index] < 0)]


def axis_named(name: str) -> FloatArray:
    """Signed axis of a name such as ``"+y"`` or ``"z"``.

    Raises
    ------
    MotionError
        It is none.
    """
    full = name.lower() if name.startswith(("+", "-")) else "+" + name.lower()
    if full not in AXIS_NAMES:
        raise MotionError(describe("--up", "is no axis", name, ", ".join(AXIS_NAMES)))
    index = AXIS_NAMES.index(full)
    result = np.zeros(3)
    result[index // 2] = -1.0 if index % 2 else 1.0
    return result


def convert(motion: SourceMotion, convention: Convention) -> PosedSource:
    """Pose a source motion in metres and our axes."""
    skeleton = motion.skeleton
    rest_rotation, _ = world_pose(skeleton.parent, skeleton.rest_rotation, skeleton.offset)
    rest = rest_positions(motion)
    rotation, position = motion.world()
    scale, turn = convention.metres_per_unit, convention.to_ours
    turned = multiply(multiply(turn, multiply(rotation, conjugate(rest_rotation))), conjugate(turn))
    return PosedSource(scale * rotate(turn, position), turned, scale * rotate(turn, rest), motion.frame_rate)
