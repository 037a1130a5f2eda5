"""What an exported person is drawn with: joints, a skinned mesh, and local transforms for poses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from crowd.characters import Character, Driver, MeshPart
from crowd.motion.rotation import conjugate, multiply, rotate
from crowd.motion.skeleton import Skeleton
from crowd.recording import Poses, Recording

FloatArray = npt.NDArray[np.float64]
Float32Array = npt.NDArray[np.float32]
IntArray = npt.NDArray[np.int32]

STICK_WIDTH, WIDEST = 0.16, 0.045
"""Half width of a stick as a share of its length, and at most, m."""
STICK_COLOUR = (0.72, 0.62, 0.52, 1.0)


@dataclass(frozen=True)
class Tracks:
    """Local transforms of one person's joints over some frames.

    Attributes
    ----------
    rotation : (F, K, 4) float64
    translation : (F, K, 3) float64
        In units of `scale`; the root's in the frame of the scene.
    scale : float
        Metres per unit of the body.
    """

    rotation: FloatArray
    translation: FloatArray
    scale: float


class StickBody:
    """The project's own skeleton, drawn as sticks.

    Parameters
    ----------
    skeleton : Skeleton
    """

    name = "sticks"

    def __init__(self, skeleton: Skeleton) -> None:
        self.joint_names = skeleton.joint_names
        self.parent: IntArray = skeleton.parent
        self.rest: FloatArray = _rest_positions(skeleton)
        self.rest_rotation: FloatArray = np.tile([1.0, 0.0, 0.0, 0.0], (skeleton.joint_count, 1))
        self.inverse_bind: FloatArray = np.tile(np.eye(4), (skeleton.joint_count, 1, 1))
        self.inverse_bind[:, :3, 3] = -self.rest
        self.parts = (stick_mesh(skeleton, self.rest),)

    def tracks(self, recording: Recording, poses: Poses, slot: int) -> Tracks:
        """Transforms of one person, whose poses are (F, 1, ...)."""
        offset = recording.joint_offsets(np.array([slot]))[0]
        translation = np.broadcast_to(offset, (len(poses.yaw), *offset.shape)).copy()
        translation[:, 0] = poses.pelvis_world[:, 0]
        return Tracks(poses.rotation[:, 0], translation, 1.0)


class CharacterBody:
    """A user's character.

    Parameters
    ----------
    character : Character
    skeleton : Skeleton
        Of the people.
    """

    def __init__(self, character: Character, skeleton: Skeleton) -> None:
        self.name = character.name
        self._driver = Driver(character, skeleton)
        self.joint_names = character.joint_names
        self.parent: IntArray = character.parent
        self.inverse_bind: FloatArray = character.inverse_bind
        self.parts: tuple[MeshPart, ...] = character.parts
        # Joints of an exporter's armature are often scaled as a whole.
        self._unit = float(np.linalg.norm(character.rest[:, :3, 0], axis=1).mean())
        self.rest, self.rest_rotation = self._driver.rest_pose()

    def tracks(self, recording: Recording, poses: Poses, slot: int) -> Tracks:
        """Transforms of one person, whose poses are (F, 1, ...)."""
        rotation_world, position_world = recording.posed(poses, np.array([slot]))
        turned, position, scale = self._driver.pose(rotation_world[:, 0], position_world[:, 0])
        size = float(scale.mean()) * self._unit
        world = multiply(turned, self.rest_rotation)
        rotation, translation = world.copy(), position / size
        for joint, above in enumerate(self.parent):
            if above >= 0:
                back = conjugate(world[:, above])
                rotation[:, joint] = multiply(back, world[:, joint])
                translation[:, joint] = rotate(back, (position[:, joint] - position[:, above]) / size)
        return Tracks(rotation, translation, size)


Body = StickBody | CharacterBody


class Bodies:
    """The body of each person of a recording.

    Parameters
    ----------
    recording : Recording
        Its people keep the characters that they were recorded with; others are sticks.
    characters : sequence of Character
        Given to people in turn by slot instead.
    """

    def __init__(self, recording: Recording, characters: Sequence[Character] = ()) -> None:
        cast = recording.cast
        self._number = np.arange(recording.character_count) % len(characters) if characters else cast.number
        self._characters = tuple(characters) or cast.characters
        self._skeleton = recording.skeleton
        self._made: dict[int, Body] = {}

    def number(self, slot: int) -> int:
        """Which body a person has; -1 for sticks."""
        return int(self._number[slot])

    def of(self, slot: int) -> Body:
        """The body of a person."""
        number = self.number(slot)
        if number not in self._made:
            self._made[number] = (
                StickBody(self._skeleton)
                if number < 0
                else CharacterBody(self._characters[number], self._skeleton)
            )
        return self._made[number]


def _rest_positions(skeleton: Skeleton) -> FloatArray:
    rest = skeleton.offset.copy()
    for joint, parent in enumerate(skeleton.parent):
        if parent >= 0:
            rest[joint] += rest[parent]
    return rest


def stick_mesh(skeleton: Skeleton, rest: FloatArray) -> MeshPart:
    """One tapered stick from each joint to each of its children, bound to the joint."""
    corners: list[FloatArray] = []
    joints: list[int] = []
    for joint, parent in enumerate(skeleton.parent.tolist()):
        if parent < 0:
            continue
        begin, end = rest[parent], rest[joint]
        way = end - begin
        length = float(np.linalg.norm(way))
        if length < 1e-6:
            continue
        axis = way / length
        across = np.cross(axis, np.eye(3)[int(np.abs(axis).argmin())])
        across /= np.linalg.norm(across)
        other = np.cross(axis, across)
        width = min(STICK_WIDTH * length, WIDEST)
        middle = begin + 0.25 * way
        ring = [middle + width * (c * across + s * other) for c, s in ((1, 0), (0, 1), (-1, 0), (0, -1))]
        for k in range(4):
            nearer, farther = ring[k], ring[(k + 1) % 4]
            corners += [np.array([begin, farther, nearer]), np.array([end, nearer, farther])]
            joints += [parent, parent]
    triangles = np.array(corners)
    normal = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    count = 3 * len(triangles)
    joint_rows = np.zeros((count, 4), np.int32)
    joint_rows[:, 0] = np.repeat(joints, 3)
    return MeshPart(
        triangles.reshape(-1, 3).astype(np.float32),
        np.repeat(normal, 3, axis=0).astype(np.float32),
        np.zeros((count, 2), np.float32),
        joint_rows,
        np.tile(np.array([1.0, 0.0, 0.0, 0.0], np.float32), (count, 1)),
        np.arange(count, dtype=np.int32).reshape(-1, 3),
        np.array(STICK_COLOUR, np.float32),
        b"",
    )
