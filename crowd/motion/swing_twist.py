"""Limits of the joints by swing and twist, as inverse kinematics reads them.

`Skeleton.limit_lower` and `limit_upper` bound rotation vectors axis by axis; bones of shoulders and hips move
in cones. Both say the same about hinges.
"""

from dataclasses import dataclass
from enum import Enum

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from crowd.motion.rotation import from_axes, multiply
from crowd.motion.skeleton import Skeleton
from crowd_kernels.joint_limit import LimitArrays

FloatArray = npt.NDArray[np.float64]


class Bone(Enum):
    """Direction of a bone in the rest pose, left side."""

    UP = (0.0, 1.0, 0.0)
    DOWN = (0.0, -1.0, 0.0)
    AHEAD = (0.0, 0.0, 1.0)
    LEFT = (1.0, 0.0, 0.0)


@dataclass(frozen=True)
class SwingTwist:
    """Range of a joint of the left side or the middle, degrees.

    Attributes
    ----------
    bone : Bone
        Axis of the twist.
    axis : (3,) float
        Axis of the first swing in the joint's rest frame, across the bone.
    centre : float, float
        Middle of the swing about the first and the second axis; the second one is bone cross first.
    swing : float, float
        Semi-axes of the ellipse; 0 for an axis about which the joint cannot swing.
    twist : float, float
        Least and largest turn about the bone; both 0 for a joint that cannot twist.
    """

    bone: Bone
    axis: tuple[float, float, float]
    centre: tuple[float, float]
    swing: tuple[float, float]
    twist: tuple[float, float]


X, Y, Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)

# Clinical norms of the AAOS, spread over the joints of spine and neck, as ellipses around their middles. The
# shoulder's ellipse reaches less far up than an arm does: the clavicle rises with it.
RANGES: dict[str, SwingTwist] = {
    "spine": SwingTwist(Bone.UP, X, (6, 0), (15, 10), (-12, 12)),
    "neck": SwingTwist(Bone.UP, X, (1, 0), (26, 22), (-38, 38)),
    "head": SwingTwist(Bone.UP, X, (1, 0), (26, 22), (-38, 38)),
    "eye": SwingTwist(Bone.AHEAD, X, (0, 0), (35, 40), (0, 0)),
    "clavicle": SwingTwist(Bone.LEFT, Z, (12, 0), (20, 18), (-10, 10)),
    "upper_arm": SwingTwist(Bone.DOWN, X, (-30, 25), (115, 100), (-100, 90)),
    "forearm": SwingTwist(Bone.DOWN, X, (-74, 0), (77, 0), (-90, 90)),
    "hand": SwingTwist(Bone.DOWN, X, (8, 0), (28, 75), (0, 0)),
    "thumb": SwingTwist(Bone.DOWN, X, (0, 0), (30, 60), (-20, 20)),
    "finger": SwingTwist(Bone.DOWN, Z, (-37, 0), (73, 15), (0, 0)),
    "thigh": SwingTwist(Bone.DOWN, X, (-40, 4), (82, 45), (-48, 48)),
    "shank": SwingTwist(Bone.DOWN, X, (70, 0), (72, 0), (0, 0)),
    "foot": SwingTwist(Bone.DOWN, X, (17, 0), (56, 35), (-38, 38)),
    "toe": SwingTwist(Bone.AHEAD, X, (-16, 0), (59, 0), (0, 0)),
}
FINGERS = ("index", "middle", "ring", "little")


def range_of(name: str) -> SwingTwist | None:
    """Range of a joint by its name; None for the pelvis and names that the skeleton does not have."""
    if any(finger in name for finger in FINGERS):
        return RANGES["finger"]
    return next((found for kind, found in RANGES.items() if kind in name), None)


def swing_twist_limits(skeleton: Skeleton) -> tuple[LimitArrays, npt.NDArray[np.uint8]]:
    """Limits of all joints of a skeleton, the right side mirrored.

    Parameters
    ----------
    skeleton : Skeleton
        Joint frames along the world's axes in the rest pose, as in every motion library.

    Returns
    -------
    limits : LimitArrays
        One row for each joint.
    is_limited : (J,) uint8
        1 for joints that have a limit.
    """
    count = skeleton.joint_count
    parent_frame = np.tile(np.array([1.0, 0.0, 0.0, 0.0]), (count, 1))
    joint_frame = parent_frame.copy()
    inverse_swing = np.zeros((count, 2))
    twist = np.tile(np.array([-np.inf, np.inf]), (count, 1))
    is_free = np.ones((count, 3))
    is_limited = np.zeros(count, np.uint8)
    for joint, name in enumerate(skeleton.joint_names):
        limit = range_of(name)
        if limit is None:
            continue
        is_limited[joint] = 1
        bone, first = np.array(limit.bone.value), np.array(limit.axis)
        second = np.cross(bone, first)
        frame = from_axes(first, second, bone)
        centre = Rotation.from_rotvec(np.radians(first * limit.centre[0] + second * limit.centre[1]))
        low, high = np.tan(0.5 * np.radians(limit.twist))
        mirror = np.ones(4)
        if name.startswith("right"):
            # Across the plane x = 0 turns about x stay, and those about y and z turn round.
            mirror, low, high = np.array([1.0, 1.0, -1.0, -1.0]), -high, -low
        joint_frame[joint] = mirror * frame
        parent_frame[joint] = mirror * multiply(centre.as_quat()[[3, 0, 1, 2]], frame)
        swing = np.radians(limit.swing)
        is_free[joint] = (swing[0] > 0, swing[1] > 0, low < high)
        inverse_swing[joint] = [1.0 / np.sin(0.5 * angle) if angle > 0 else 0.0 for angle in swing]
        twist[joint] = low, high
    limits = LimitArrays(
        parent_frame.astype(np.float32),
        joint_frame.astype(np.float32),
        inverse_swing.astype(np.float32),
        twist.astype(np.float32),
        is_free.astype(np.float32),
    )
    return limits, is_limited
