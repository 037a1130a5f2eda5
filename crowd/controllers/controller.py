"""What the layers of the controller stack share."""

from dataclasses import dataclass
from typing import ClassVar, Protocol

import numpy as np
import numpy.typing as npt

from crowd.model import Model
from crowd.state import State

IntArray = npt.NDArray[np.int32]


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
    fraction: npt.NDArray[np.float32]
    weight: npt.NDArray[np.float32]

    @classmethod
    def create(cls, capacity: int, count: int) -> "KeySamples":
        """Make room for `count` samples of `capacity` characters."""
        shape = (capacity, count)
        return cls(
            np.zeros(shape, np.int32), np.zeros(shape, np.int32), np.zeros(shape, np.float32), np.zeros(shape, np.float32)
        )
