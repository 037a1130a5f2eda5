"""Joint positions and rotations of everyone, computed from the pose once a step."""

import numpy as np

from crowd.motion.skeleton import Segment, Skeleton
from crowd.people import People
from crowd.state import Float32Array, FloatArray, IntArray, State
from crowd_kernels.aligned import aligned_zeros
from crowd_kernels.pose import CHUNKS, kinematics, scratch_length


class Joints:
    """Forward kinematics of the crowd.

    Attributes
    ----------
    position_model : (N, J, 3) float32
        In the root frame (x left, y up, z ahead), m.
    rotation_model : (N, J, 4) float32
        In the root frame, unit quaternions.
    """

    def __init__(self, skeleton: Skeleton, capacity: int) -> None:
        joint_count = skeleton.joint_count
        self.position_model: Float32Array = aligned_zeros((capacity, joint_count, 3), np.float32)
        self.rotation_model: Float32Array = aligned_zeros((capacity, joint_count, 4), np.float32)
        self._parent = np.ascontiguousarray(skeleton.parent, np.int32)
        self._offset = np.ascontiguousarray(skeleton.offset, np.float32)
        self._segment = np.ascontiguousarray(skeleton.segment, np.int32)
        self._scratch = aligned_zeros((CHUNKS, scratch_length(joint_count, len(Segment))), np.float32)

    def compute(self, state: State, people: People, active: IntArray) -> None:
        """Compute the joints of active people from their pose."""
        self.compute_arrays(state, people.segment_scale, active)

    def compute_arrays(self, state: State, segment_scale: Float32Array, active: IntArray) -> None:
        """Compute joints for given proportions, (N, 8)."""
        kinematics(
            self._parent,
            self._offset,
            self._segment,
            int(Segment.LEG),
            segment_scale,
            state.pose_rotation,
            state.pose_pelvis,
            active,
            self._scratch,
            self.position_model,
            self.rotation_model,
        )

    def positions_world(self, state: State) -> FloatArray:
        """Joints in world space, m. (N, J, 3) float64."""
        sine, cosine = np.sin(state.yaw)[:, None], np.cos(state.yaw)[:, None]
        x, y, z = np.moveaxis(self.position_model.astype(np.float64), 2, 0)
        turned = np.stack([cosine * x + sine * z, y, cosine * z - sine * x], axis=2)
        return turned + state.position_world[:, None]
