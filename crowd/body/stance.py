"""The stance bodies are sculpted in, arms and legs apart so that they do not melt into each other."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from crowd.body.distances import Points
from crowd.motion.skeleton import Segment, Skeleton

FloatArray = npt.NDArray[np.float64]

ARM_ANGLE, LEG_ANGLE = 0.55, 0.10
FINGER_ANGLE = {"thumb": 0.10, "index": 0.09, "middle": 0.02, "ring": -0.05, "little": -0.13}
"""How far arms and legs are raised to the side, and fingers spread towards the thumb, rad."""
TIP_LENGTH = {"thumb": 0.024, "index": 0.020, "middle": 0.021, "ring": 0.021, "little": 0.019}
"""Last joint to the tip, m."""


class Stance:
    """Where each joint of a skeleton is in the stance, against the rest pose.

    Parameters
    ----------
    skeleton : Skeleton
        The built-in one.

    Attributes
    ----------
    rest : (J, 3) float64
        Joints in rest pose, m.
    to_stance : (J, 4, 4) float64
        From the rest pose to the stance.
    """

    def __init__(self, skeleton: Skeleton) -> None:
        self.skeleton = skeleton
        self.rest = rest_positions(skeleton)
        self.to_stance = np.zeros((skeleton.joint_count, 4, 4))
        for joint, (name, parent) in enumerate(zip(skeleton.joint_names, skeleton.parent, strict=True)):
            above = self.to_stance[parent] if parent >= 0 else np.eye(4)
            self.to_stance[joint] = above @ turn_about(self.rest[joint], *self._turn(name))

    @staticmethod
    def _turn(name: str) -> tuple[int, float]:
        """Axis and angle by which a joint is turned."""
        side, _, rest = name.partition("_")
        sign = 1.0 if side == "left" else -1.0
        if rest == "upper_arm":
            return 2, sign * ARM_ANGLE
        if rest == "thigh":
            return 2, sign * LEG_ANGLE
        if rest == "foot":
            return 2, -sign * LEG_ANGLE
        finger, _, number = rest.partition("_")
        if finger in FINGER_ANGLE and number == "1":
            return 0, -FINGER_ANGLE[finger]
        return 0, 0.0

    def to_rest(self, points: Points, joint: str) -> Points:
        """Points of the stance, where they are in rest pose if they move with a joint."""
        matrix = np.linalg.inv(self.to_stance[self.skeleton.joint(joint)])
        value: Points = (points @ matrix[:3, :3].T + matrix[:3, 3]).astype(np.float32)
        return value

    def arm_at_rest(self, points: Points) -> Points:
        """Points of the left arm."""
        return self.to_rest(points, "left_upper_arm")

    def arm_point(self, height: float) -> FloatArray:
        """Where a height on the left arm in rest pose is in the stance."""
        joint = self.skeleton.joint("left_upper_arm")
        x, _, z = self.rest[joint]
        return np.asarray((self.to_stance[joint] @ [x, height, z, 1.0])[:3])

    def leg_at_rest(self, points: Points) -> Points:
        """Points of the left leg."""
        return self.to_rest(points, "left_thigh")

    def foot_at_rest(self, points: Points) -> Points:
        """Points of the left foot."""
        return self.to_rest(points, "left_foot")

    def finger_at_rest(self, points: Points, finger: str) -> Points:
        """Points of a finger of the left hand."""
        return self.to_rest(points, f"left_{finger}_1")

    def finger_bones(self, finger: str) -> FloatArray:
        """Joints of a finger of the left hand and its tip in rest pose. (4, 3)."""
        joints = self.rest[[self.skeleton.joint(f"left_{finger}_{number}") for number in (1, 2, 3)]]
        along = joints[2] - joints[1]
        tip = joints[2] + along / np.linalg.norm(along) * TIP_LENGTH[finger]
        return np.vstack([joints, tip])


def rest_positions(skeleton: Skeleton) -> FloatArray:
    """Joints in rest pose, m. (J, 3)."""
    return summed_offsets(skeleton.offset, skeleton)


def summed_offsets(offset: FloatArray, skeleton: Skeleton) -> FloatArray:
    """Joints whose offsets from their parents are given, with nothing turned. (J, 3)."""
    rest = np.array(offset, np.float64)
    for joint, parent in enumerate(skeleton.parent):
        if parent >= 0:
            rest[joint] += rest[parent]
    return rest


def flesh_segments(skeleton: Skeleton) -> npt.NDArray[np.int32]:
    """Segment whose scale stretches the flesh around each joint: that of the bone below it. (J,)."""
    segment = np.array(skeleton.segment, np.int32)
    for name, part in (("pelvis", Segment.PELVIS), ("clavicle", Segment.SHOULDER), ("hand", Segment.HAND)):
        segment[[name in joint for joint in skeleton.joint_names]] = int(part)
    for joint, name in enumerate(skeleton.joint_names):
        if name.endswith("upper_arm"):
            segment[joint] = int(Segment.ARM)
        elif name.endswith("thigh"):
            segment[joint] = int(Segment.LEG)
        elif name.endswith("foot"):
            segment[joint] = int(Segment.FOOT)
        elif name == "spine_4":
            segment[joint] = int(Segment.TORSO)
    return segment


def turn_about(centre: FloatArray, axis: int, angle: float) -> FloatArray:
    """Matrix of a turn about an axis through a point."""
    first, second = (axis + 1) % 3, (axis + 2) % 3
    matrix = np.eye(4)
    matrix[first, first] = matrix[second, second] = np.cos(angle)
    matrix[first, second], matrix[second, first] = -np.sin(angle), np.sin(angle)
    matrix[:3, 3] = centre - matrix[:3, :3] @ centre
    return matrix
