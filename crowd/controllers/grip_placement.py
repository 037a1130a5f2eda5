"""Where hands go on objects: how a hand would come to them by itself, and the grip nearest to that."""

import numpy as np

from crowd.joints import Joints
from crowd.model import Model
from crowd.motion.hand import SIDES
from crowd.motion.rotation import about, conjugate, from_axes, multiply, rotate, yaw_of
from crowd.motion.skeleton import Segment
from crowd.state import BoolArray, FloatArray, IntArray, State
from crowd.world.objects import ObjectState, ShapeKind
from crowd_kernels.capsule import ShapeTable
from crowd_kernels.hand import HandTable
from crowd_kernels.hand_placement import PALM_GAP, place_hands
from crowd_kernels.hand_pose import hands_in_world

TALL = 0.05
"""Things whose half height is more are taken from the side, lower ones more from above, m."""
ABOVE = 0.15
"""So are things that are not this far below the shoulder, m."""
ROLL_TALL, ROLL_LOW = 0.30, 1.15
"""Turn of the back of the hand from the side upwards, rad."""
DESCENT = 0.35
"""Share of the way down in the direction of the fingers; the hand stays flatter than the arm."""
APART = 0.3
"""How far the back of a hand leans away from the hand that holds the object already."""
BELOW, EDGE = 0.09, 0.04
"""Both hands take what others hold so far below the middle, and keep so far from the edge, m."""
WIDEST = 0.9
"""Widest thing that two hands hold, m."""


class GripPlacement:
    """Chooses grips.

    Attributes
    ----------
    scale : (N,) float64
        Of each character's hands.
    stature : (N,) float64
        m.
    """

    def __init__(
        self, model: Model, hand: HandTable, shapes: ShapeTable, objects: ObjectState, joints: Joints
    ) -> None:
        self.scale: FloatArray = np.ascontiguousarray(model.people.segment_scale[:, Segment.HAND], np.float64)
        self.stature = model.people.stature
        self._hand, self._shapes, self._objects, self._joints = hand, shapes, objects, joints
        self._model = model
        names = [[f"{side}_{part}" for side in SIDES] for part in ("upper_arm", "hand")]
        self._shoulder, self._wrist = (
            np.array([model.skeleton.joint(name) for name in pair], np.int32) for pair in names
        )

    def of_one_hand(
        self, state: State, rows: IntArray, side: IntArray, items: IntArray
    ) -> tuple[FloatArray, FloatArray, IntArray, IntArray]:
        """Choose grips of single hands.

        Parameters
        ----------
        state : State
        rows, side, items : (A,) int32
            Characters, their hands, the objects.

        Returns
        -------
        position (A, 3), rotation (A, 4), style (A,), status (A,)
            As `crowd_kernels.hand_placement.place_hands` writes them.
        """
        count = rows.size
        natural = self._natural_hand(state, rows, side, items)
        position, rotation = np.zeros((count, 3)), np.zeros((count, 4))
        style, status = np.zeros((2, count), np.int32)
        place_hands(
            self._hand,
            self._shapes,
            side,
            items,
            self.scale[rows],
            *natural,
            self._objects.position_world,
            self._objects.rotation_world,
            position,
            rotation,
            style,
            status,
        )
        return position, rotation, style, status

    def of_both_hands(
        self, state: State, rows: IntArray, items: IntArray
    ) -> tuple[FloatArray, FloatArray, BoolArray]:
        """Choose grips of both hands on opposite sides, fingers ahead.

        Returns
        -------
        position : (A, 2, 3) float64
            Right and left hand joint in the objects' frames, m.
        rotation : (A, 2, 4) float64
        fits : (A,) bool
            The object is not wider than two hands hold.
        """
        to_object = conjugate(self._objects.rotation_world[items])
        left = rotate(to_object, _left(state.yaw[rows]))
        ahead = rotate(to_object, _ahead(state.yaw[rows]))
        is_box = self._shapes.kind[items] == ShapeKind.BOX
        nearest = np.argmax(np.abs(left), axis=1)
        face = np.zeros((rows.size, 3))
        face[np.arange(rows.size), nearest] = np.sign(left[np.arange(rows.size), nearest])
        across = np.where(is_box[:, None], face, left)
        fingers = ahead - across * (ahead * across).sum(axis=1, keepdims=True)
        fingers /= np.linalg.norm(fingers, axis=1, keepdims=True)
        position, rotation = np.zeros((rows.size, 2, 3)), np.zeros((rows.size, 2, 4))
        width = np.zeros(rows.size)
        hand, scale = self._hand, self.scale[rows][:, None]
        for side, sign in ((0, -1.0), (1, 1.0)):
            back = sign * across
            reach = np.array([self._support(item, way) for item, way in zip(items, back, strict=True)])
            width += reach
            # The back of the left hand is its +x, that of the right hand its -x: both have x to the left.
            rotation[:, side] = from_axes(across, -fingers, np.cross(across, -fingers))
            on_palm = back * -hand.palm_depth + fingers * 0.5 * (hand.nearest_grip + hand.farthest_grip)
            position[:, side] = back * (reach + PALM_GAP)[:, None] - scale * on_palm
        position += self._below_others(rows, items)[:, None]
        return position, rotation, width <= WIDEST

    def _below_others(self, rows: IntArray, items: IntArray) -> FloatArray:
        """How far below the middle hands take what others hold, in the objects' frames, m. (A, 3)"""
        objects = self._objects
        down = rotate(conjugate(objects.rotation_world[items]), np.array([0.0, -1.0, 0.0]))
        room = np.array([self._support(item, way) for item, way in zip(items, down, strict=True)]) - EDGE
        is_others = (objects.holder[items] >= 0) & (objects.holder[items] != rows)
        return np.asarray(down * np.where(is_others, np.clip(room, 0.0, BELOW), 0.0)[:, None])

    def upright(self, items: IntArray) -> FloatArray:
        """Rotations (A, 4) of objects as they stood at the start, with the headings that they have now."""
        start = self._model.objects.start_rotation_world[items]
        heading = yaw_of(multiply(self._objects.rotation_world[items], conjugate(start)))
        return multiply(about(1, heading), start)

    def depths(self, items: IntArray, rotation: FloatArray) -> FloatArray:
        """Reach of objects from their centres backwards when they are turned (A, 4), m. (A,)"""
        back = rotate(conjugate(rotation), np.array([0.0, 0.0, -1.0]))
        return np.array([self._support(item, way) for item, way in zip(items, back, strict=True)])

    def _support(self, item: int, way: FloatArray) -> float:
        """Reach of an object from its centre along a unit vector in its frame, m."""
        half = self._shapes.half_size[item]
        match ShapeKind(int(self._shapes.kind[item])):
            case ShapeKind.SPHERE:
                return float(half[0])
            case ShapeKind.BOX:
                return float(np.abs(way) @ half)
            case ShapeKind.CAPSULE:
                return float(half[0] + abs(way[1]) * (half[1] - half[0]))
            case ShapeKind.MESH:
                objects = self._model.objects
                return float((objects.meshes[objects.mesh[item]].vertex @ way).max())

    def _natural_hand(
        self, state: State, rows: IntArray, side: IntArray, items: IntArray
    ) -> tuple[FloatArray, FloatArray]:
        """Hand as a person would bring it to the object: from the shoulder, tall things from the side."""
        objects = self._objects
        shoulder, _ = self._joint_in_world(state, self._shoulder, rows, side)
        center = objects.position_world[items]
        way = center - shoulder
        way[:, 1] *= DESCENT
        length = np.linalg.norm(way, axis=1, keepdims=True)
        fingers = np.where(length > 1e-6, way / np.maximum(length, 1e-6), _ahead(state.yaw[rows]))
        outward = np.where(side == 1, 1.0, -1.0)[:, None] * np.cross([0.0, 1.0, 0.0], fingers)
        size = np.linalg.norm(outward, axis=1, keepdims=True)
        outward = np.where(size > 1e-6, outward / np.maximum(size, 1e-6), _left(state.yaw[rows]))
        height = -np.array(
            [
                self._model.objects.lowest_point(item, turn)
                for item, turn in zip(items.tolist(), objects.rotation_world[items], strict=True)
            ]
        )
        is_from_side = (height > TALL) | (center[:, 1] > shoulder[:, 1] - ABOVE)
        roll = np.where(is_from_side, ROLL_TALL, ROLL_LOW)[:, None]
        up = np.cross(fingers, outward) * np.where(side == 1, 1.0, -1.0)[:, None]
        back = np.cos(roll) * outward + np.sin(roll) * up
        held = objects.holder[items] >= 0
        if held.any():
            back[held] = self._away_from_holder(state, items[held], back[held])
            fingers[held] -= back[held] * (fingers[held] * back[held]).sum(axis=1, keepdims=True)
            fingers /= np.maximum(np.linalg.norm(fingers, axis=1, keepdims=True), 1e-9)
        x = back * np.where(side == 1, 1.0, -1.0)[:, None]
        rotation = from_axes(x, -fingers, np.cross(x, -fingers))
        return center - 0.08 * fingers, np.ascontiguousarray(rotation)

    def _away_from_holder(self, state: State, items: IntArray, back: FloatArray) -> FloatArray:
        """Turn the back of a hand away from the hand that holds the object, as little as both have room."""
        objects = self._objects
        hand = np.argmax(objects.holder_hand[items], axis=1).astype(np.int32)
        _, turn = self._joint_in_world(state, self._wrist, objects.holder[items], hand)
        its_back = rotate(turn, np.where(hand == 1, 1.0, -1.0)[:, None] * np.array([1.0, 0.0, 0.0]))
        its_share = (back * its_back).sum(axis=1, keepdims=True)
        turned = back - (np.maximum(its_share, 0.0) + np.where(its_share > 0.0, APART, 0.0)) * its_back
        return np.asarray(turned / np.maximum(np.linalg.norm(turned, axis=1, keepdims=True), 1e-9))

    def _joint_in_world(
        self, state: State, joint: IntArray, rows: IntArray, side: IntArray
    ) -> tuple[FloatArray, FloatArray]:
        position, rotation = np.zeros((rows.size, 3)), np.zeros((rows.size, 4))
        hands_in_world(
            joint,
            rows,
            side,
            self._joints.position_model,
            self._joints.rotation_model,
            state.position_world,
            state.yaw,
            position,
            rotation,
        )
        return position, rotation


def _left(yaw: FloatArray) -> FloatArray:
    return np.stack([np.cos(yaw), np.zeros_like(yaw), -np.sin(yaw)], axis=1)


def _ahead(yaw: FloatArray) -> FloatArray:
    return np.stack([np.sin(yaw), np.zeros_like(yaw), np.cos(yaw)], axis=1)
