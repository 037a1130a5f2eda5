"""What an exported person is drawn with: joints, a skinned mesh, and local transforms for poses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from crowd.body import Skin, built_in_builds
from crowd.body.builds import is_built_in
from crowd.body.looks import draw_builds, draw_looks
from crowd.body.stance import flesh_segments, rest_positions, summed_offsets
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


class OwnBody:
    """The project's own skeleton with meshes around it.

    Parameters
    ----------
    name : str
    skeleton : Skeleton
    rest : (J, 3) float64
        Joints in rest pose, m.
    parts : tuple of MeshPart
        In rest pose.
    """

    def __init__(self, name: str, skeleton: Skeleton, rest: FloatArray, parts: tuple[MeshPart, ...]) -> None:
        self.name = name
        self.joint_names = skeleton.joint_names
        self.parent: IntArray = skeleton.parent
        self.rest: FloatArray = rest
        self.rest_rotation: FloatArray = np.tile([1.0, 0.0, 0.0, 0.0], (skeleton.joint_count, 1))
        self.inverse_bind: FloatArray = np.tile(np.eye(4), (skeleton.joint_count, 1, 1))
        self.inverse_bind[:, :3, 3] = -self.rest
        self.parts = parts

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


Body = OwnBody | CharacterBody


class Bodies:
    """The body of each person of a recording.

    Parameters
    ----------
    recording : Recording
        Its people keep the characters that they were recorded with; others get built-in bodies, or sticks
        where the skeleton is not the built-in one.
    characters : sequence of Character
        Given to people in turn by slot instead.
    """

    def __init__(self, recording: Recording, characters: Sequence[Character] = ()) -> None:
        cast, skeleton = recording.cast, recording.skeleton
        self._number = np.arange(recording.character_count) % len(characters) if characters else cast.number
        self._characters = tuple(characters) or cast.characters
        self._skeleton = skeleton
        self._recording = recording
        self._builds = built_in_builds() if is_built_in(skeleton) else ()
        if self._builds:
            recipes = [build.recipe for build in self._builds]
            slots = np.arange(recording.character_count)
            self._build = draw_builds(slots, recording.stature, recipes)
            self._look = draw_looks(slots, self._build, recipes)
        self._made: dict[int, Body] = {}

    def kind(self, slot: int) -> str:
        """Name that those who have the same body share, whatever its colours."""
        number = int(self._number[slot])
        if number >= 0:
            return f"body_{number}"
        return f"build_{self._build[slot]}" if self._builds else "sticks"

    def of(self, slot: int) -> Body:
        """The body of a person."""
        number = int(self._number[slot])
        key = number if number >= 0 else -1 - slot
        if key not in self._made:
            self._made[key] = (
                CharacterBody(self._characters[number], self._skeleton) if number >= 0 else self._own(slot)
            )
        return self._made[key]

    def _own(self, slot: int) -> OwnBody:
        """A body in the person's own proportions."""
        skeleton, recording = self._skeleton, self._recording
        plain = rest_positions(skeleton)
        if not self._builds:
            return OwnBody("sticks", skeleton, plain, (stick_mesh(skeleton, plain),))
        build = self._builds[self._build[slot]]
        rest = summed_offsets(recording.joint_offsets(np.array([slot]))[0], skeleton)
        flesh = recording.segment_scale[slot, flesh_segments(skeleton)].astype(np.float64)
        skin = build.skins[0]
        around = skin.position[:, None] - plain[skin.joint]
        moved = rest[skin.joint] + flesh[skin.joint][..., None] * around
        position = np.einsum("vk,vki->vi", skin.weight, moved).astype(np.float32)
        parts = skin_parts(replace(skin, position=position), self._look[slot, :, :3])
        return OwnBody(build.recipe.name, skeleton, rest, parts)


def skin_parts(skin: Skin, colours: Float32Array) -> tuple[MeshPart, ...]:
    """A mesh for each material of a skin; row k of the colours (M, 3), linear, is that of material k."""
    parts = []
    of_triangle = skin.material[skin.triangle[:, 0]]
    for material in np.unique(of_triangle):
        used, corner = np.unique(skin.triangle[of_triangle == material], return_inverse=True)
        parts.append(
            MeshPart(
                skin.position[used],
                skin.normal[used],
                np.zeros((len(used), 2), np.float32),
                skin.joint[used].astype(np.int32),
                skin.weight[used],
                corner.reshape(-1, 3).astype(np.int32),
                np.append(colours[material], 1.0).astype(np.float32),
                b"",
            )
        )
    return tuple(parts)


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
