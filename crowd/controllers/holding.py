"""Objects in hands: fixed to them, following them, let go."""

import numpy as np
import numpy.typing as npt

from crowd.joints import Joints
from crowd.motion.hand import SIDES
from crowd.motion.skeleton import Skeleton
from crowd.state import BoolArray, FloatArray, IntArray, State
from crowd.world.objects import ObjectState
from crowd_kernels.hand_pose import compose_frames, hands_in_world

Hands = tuple[IntArray, IntArray]
"""Characters and their hands, 0 right, 1 left; (A,) each."""
Frames = tuple[FloatArray, FloatArray]
"""Positions (A, 3), m, and rotations (A, 4)."""


class Holding:
    """Keeps objects and the hands that hold them together.

    Attributes
    ----------
    objects : ObjectState
    """

    def __init__(self, skeleton: Skeleton, objects: ObjectState, joints: Joints) -> None:
        self.objects = objects
        self._joints = joints
        self._hand_joint = np.array([skeleton.joint(f"{side}_hand") for side in SIDES], np.int32)

    def hands_in_world(self, state: State, hands: Hands) -> Frames:
        """Where hand joints are, by the last computed joints."""
        position, rotation = np.zeros((hands[0].size, 3)), np.zeros((hands[0].size, 4))
        hands_in_world(
            self._hand_joint,
            *hands,
            self._joints.position_model,
            self._joints.rotation_model,
            state.position_world,
            state.yaw,
            position,
            rotation,
        )
        return position, rotation

    def in_world(self, items: IntArray) -> Frames:
        """Where objects are."""
        return self.objects.position_world[items], self.objects.rotation_world[items]

    def hand_targets(
        self, hands: Hands, items: IntArray, position_world: FloatArray, rotation_world: FloatArray
    ) -> Frames:
        """Where hand joints must be for what they hold to be at poses (A, 3), m, and (A, 4)."""
        upright = np.zeros((items.size, 3)), np.tile([1.0, 0.0, 0.0, 0.0], (items.size, 1))
        side = hands[1]
        grip = self.objects.grip_position[items, side], self.objects.grip_rotation[items, side]
        return composed((position_world, rotation_world), relative(upright, grip))

    def attach(self, hands: Hands, items: IntArray, frames: Frames) -> None:
        """Fix objects to hands whose joints are at `frames`, as they now lie against them."""
        rows, side = hands
        objects = self.objects
        objects.holder[items] = rows
        objects.holder_hand[items, side] = True
        objects.grip_position[items, side], objects.grip_rotation[items, side] = relative(
            self.in_world(items), frames
        )

    def held_by(self, hands: Hands, items: IntArray) -> BoolArray:
        """Which of these hands hold these objects; -1 is no object."""
        known = np.maximum(items, 0)
        held = (items >= 0) & (self.objects.holder[known] == hands[0])
        return np.asarray(held & self.objects.holder_hand[known, hands[1]])

    def detach(self, hands: Hands, items: IntArray) -> BoolArray:
        """Let hands let go of objects; tells which objects no hand holds any more."""
        objects = self.objects
        objects.holder_hand[items, hands[1]] = False
        is_free = ~objects.holder_hand[items].any(axis=1)
        objects.holder[items[is_free]] = -1
        return np.asarray(is_free)

    def drop_of_the_gone(self, state: State) -> None:
        """Leave objects where they are whose holder has left the scene."""
        objects = self.objects
        gone = (objects.holder >= 0) & ~state.is_active[np.maximum(objects.holder, 0)]
        if gone.any():
            objects.holder[gone] = -1
            objects.holder_hand[gone] = False

    def follow(self, state: State) -> None:
        """Move held objects with hands; between two hands they take the middle of what both ask for."""
        objects = self.objects
        items, (place, turn) = self._asked_by_hands(state)
        if items.size == 0:
            return
        objects.position_world[items], objects.rotation_world[items] = place, turn
        second = np.flatnonzero(items[1:] == items[:-1]) + 1
        if second.size:
            sign = np.sign((turn[second] * turn[second - 1]).sum(axis=1, keepdims=True))
            middle = turn[second] + sign * turn[second - 1]
            objects.position_world[items[second]] = 0.5 * (place[second] + place[second - 1])
            objects.rotation_world[items[second]] = middle / np.linalg.norm(middle, axis=1, keepdims=True)

    def apart(self, state: State) -> FloatArray:
        """How far objects are from where each hand that holds them has its grip, m. (A,)"""
        items, (place, _) = self._asked_by_hands(state)
        away = self.objects.position_world.take(items, axis=0) - place
        return np.asarray(np.sqrt(np.einsum("ak,ak->a", away, away)))

    def _asked_by_hands(self, state: State) -> tuple[npt.NDArray[np.intp], Frames]:
        """Held objects, once for each hand that holds them, and where the hands ask them to be."""
        objects = self.objects
        items, side = np.nonzero(objects.holder_hand)
        hands = objects.holder[items], side.astype(np.int32)
        # One index of rows is much faster than two.
        grips = len(SIDES) * items + side
        grip = (
            objects.grip_position.reshape(-1, 3).take(grips, axis=0),
            objects.grip_rotation.reshape(-1, 4).take(grips, axis=0),
        )
        return items, composed(self.hands_in_world(state, hands), grip)


def composed(outer: Frames, inner: Frames) -> Frames:
    """Chain frames: `inner` is given in `outer`."""
    return _chained(outer, inner, is_inverse=False)


def relative(frames: Frames, reference: Frames) -> Frames:
    """Express frames in other ones."""
    return _chained(reference, frames, is_inverse=True)


def _chained(outer: Frames, inner: Frames, is_inverse: bool) -> Frames:
    place, turn = np.zeros((len(outer[0]), 3)), np.zeros((len(outer[0]), 4))
    frames: tuple[npt.NDArray[np.float64], ...] = tuple(map(np.ascontiguousarray, (*outer, *inner)))
    compose_frames(frames[0], frames[1], frames[2], frames[3], is_inverse, place, turn)
    return place, turn
