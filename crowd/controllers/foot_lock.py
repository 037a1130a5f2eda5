"""Foot locking, the last word on the legs: planted feet stay, whatever the layers above did."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from crowd.motion.skeleton import Segment, Skeleton
from crowd.state import ByteArray, Float32Array, FloatArray, IntArray
from crowd_kernels.aligned import aligned_zeros
from crowd_kernels.foot_lock import LegArrays, lock_feet_crowd
from crowd_kernels.foot_plan import LockLimits

HEEL_BEHIND_ANKLE = 0.035
"""Heel contact behind the ankle, over stature (Winter: foot length 0.152, ankle at a quarter of it)."""
TOE_LENGTH = 0.04
"""Tip of the foot before the ball, over stature."""

LOCK_LIMITS = LockLimits(
    release_distance=0.2,
    release_yaw=0.6,
    stretch=0.99,
    swing_rate=16.0,
    ground_rate=30.0,
    # What legs of walkers need changes more slowly in 99.9 % of frames; what is faster would show as a jerk.
    pelvis_speed=0.2,
    pelvis_rate=28.0,
)


@dataclass(frozen=True)
class FootLockSettings:
    """How feet are held and let go."""

    limits: LockLimits = LOCK_LIMITS


class FootLock:
    """Holds planted feet and keeps its state between steps."""

    def __init__(
        self, skeleton: Skeleton, settings: FootLockSettings | None = None, *, capacity: int, dt: float
    ) -> None:
        self.settings = settings or FootLockSettings()
        self.legs = leg_arrays(skeleton)
        self.contact: ByteArray = aligned_zeros((capacity, 2), np.uint8)
        self.is_released: npt.NDArray[np.bool_] = aligned_zeros((capacity, 2), np.bool_)
        self.anchor: FloatArray = aligned_zeros((capacity, 2, 2))
        self.anchor_yaw: FloatArray = aligned_zeros((capacity, 2))
        self.offset: FloatArray = aligned_zeros((capacity, 2, 3))
        self.offset_rate: FloatArray = aligned_zeros((capacity, 2, 3))
        self.yaw_offset: FloatArray = aligned_zeros((capacity, 2))
        self.yaw_offset_rate: FloatArray = aligned_zeros((capacity, 2))
        self.leg_need: FloatArray = aligned_zeros((capacity, 2))
        self.deciding: ByteArray = aligned_zeros(capacity, np.uint8)
        self.drop_gap: FloatArray = aligned_zeros((capacity, 2))
        self.drop: FloatArray = aligned_zeros(capacity)

    def state_fields(self) -> dict[str, npt.NDArray[np.generic]]:
        """Arrays that change in a run."""
        names = (
            "contact",
            "is_released",
            "anchor",
            "anchor_yaw",
            "offset",
            "offset_rate",
            "yaw_offset",
            "yaw_offset_rate",
            "leg_need",
            "deciding",
            "drop_gap",
            "drop",
        )
        return {name: getattr(self, name) for name in names}

    def reset(self, characters: IntArray) -> None:
        """Forget what was planted, for people who have just entered."""
        for array in self.state_fields().values():
            array[characters] = 0

    def evaluate(
        self,
        pose_rotation: Float32Array,
        pose_pelvis: Float32Array,
        segment_scale: Float32Array,
        position_world: FloatArray,
        yaw: FloatArray,
        contact_wanted: ByteArray,
        active: IntArray,
        dt: float,
        out_foot_point_world: FloatArray,
        out_foot_contact: ByteArray,
    ) -> None:
        """Hold planted feet; arguments as in `crowd_kernels.foot_lock.lock_feet_crowd`."""
        lock_feet_crowd(
            self.legs,
            self.settings.limits,
            segment_scale,
            position_world,
            yaw,
            contact_wanted,
            active,
            dt,
            pose_rotation,
            pose_pelvis,
            self.contact,
            self.is_released,
            self.anchor,
            self.anchor_yaw,
            self.offset,
            self.offset_rate,
            self.yaw_offset,
            self.yaw_offset_rate,
            self.leg_need,
            self.deciding,
            self.drop_gap,
            self.drop,
            out_foot_point_world,
            out_foot_contact,
        )


def leg_arrays(skeleton: Skeleton) -> LegArrays:
    """Both legs of a skeleton for the kernel."""
    parts = ("thigh", "shank", "foot", "toe")
    joints = np.array(
        [[skeleton.joint(f"{side}_{part}") for part in parts] for side in ("right", "left")], np.int32
    )
    sole = np.zeros((2, 3, 3))
    for leg, (thigh, shank, foot, toe) in enumerate(joints):
        chain = (0, thigh, shank, foot)
        ankle_height = sum(skeleton.offset[joint, 1] for joint in chain)
        sole[leg, 0] = (0.0, -ankle_height, -HEEL_BEHIND_ANKLE * skeleton.stature)
        sole[leg, 1] = (skeleton.offset[toe, 0], -ankle_height, skeleton.offset[toe, 2])
        sole[leg, 2] = (0.0, -ankle_height - skeleton.offset[toe, 1], TOE_LENGTH * skeleton.stature)
    return LegArrays(
        joints,
        np.ascontiguousarray(skeleton.offset[joints]),
        np.ascontiguousarray(skeleton.segment[joints].astype(np.int32)),
        np.linalg.norm(skeleton.offset[joints], axis=-1),
        sole,
        int(Segment.LEG),
        int(Segment.FOOT),
    )
