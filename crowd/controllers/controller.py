"""What the layers of the controller stack share."""

from dataclasses import dataclass
from typing import ClassVar, Protocol

import numpy as np

from crowd.model import Model
from crowd.state import Float32Array, IntArray, State
from crowd_kernels.aligned import aligned_full, aligned_zeros
from crowd_kernels.clip import CHUNKS, ROW, blend_samples


@dataclass
class Step:
    """What every layer is handed in one step.

    Attributes
    ----------
    model, state
        Read-only data and the arrays that change.
    active : (A,) int32
        Characters in the scene, ascending.
    index : int
        Number of the step, from 0.
    time, dt : float
        Time at the end of the step, and its length, s.
    seed : int
        Key of all random choices.
    """

    model: Model
    state: State
    active: IntArray
    index: int
    time: float
    dt: float
    seed: int


class Controller(Protocol):
    """One layer: it may override, modify or ignore the pose that the layers below it wrote."""

    state_fields: ClassVar[tuple[str, ...]]
    """Fields of `State` that the layer changes."""

    def activate(self, state: State, characters: IntArray) -> None:
        """Prepare the layer for people who have just entered through these slots."""

    def evaluate(self, step: Step) -> None:
        """Write the pose of the characters on which the layer is active."""


@dataclass
class KeySamples:
    """Key frames to blend, as the pose kernel reads them: `count` samples for each character."""

    frame: IntArray
    next_frame: IntArray
    fraction: Float32Array
    weight: Float32Array
    layer_weight: Float32Array
    """Share of the layer in the pose. (character,)"""
    mask_index: IntArray
    """Joints that the layer writes, as a row of the clip table's masks. (character,)"""
    scratch: Float32Array

    @classmethod
    def create(cls, capacity: int, count: int) -> "KeySamples":
        """Make room for `count` samples of `capacity` characters."""
        shape = (capacity, count)
        return cls(
            aligned_zeros(shape, np.int32),
            aligned_zeros(shape, np.int32),
            aligned_zeros(shape, np.float32),
            aligned_zeros(shape, np.float32),
            aligned_full(capacity, 1, np.float32),
            aligned_zeros(capacity, np.int32),
            aligned_zeros((CHUNKS, ROW), np.float32),
        )

    def blend_onto_pose(self, step: Step, characters: IntArray) -> None:
        """Blend the samples and mix the result onto the characters' pose."""
        table, state = step.model.clip_table, step.state
        blend_samples(
            table.key_rotation,
            table.key_pelvis,
            characters,
            self.frame,
            self.next_frame,
            self.fraction,
            self.weight,
            self.layer_weight,
            self.mask_index,
            table.joint_mask,
            table.pelvis_mask,
            state.pose_rotation,
            state.pose_pelvis,
            self.scratch,
        )
