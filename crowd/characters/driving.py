"""Drive the joints of a character by the poses of the crowd's people."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from crowd.characters.character import Character
from crowd.motion.importing.axes import Convention, PosedSource, axis_name, nearest_axis
from crowd.motion.importing.joint_names import SIDES
from crowd.motion.importing.retarget import rest_aim
from crowd.motion.rotation import conjugate, from_axes, multiply, rotate, swing
from crowd.motion.skeleton import Skeleton

FloatArray = npt.NDArray[np.float64]
Float32Array = npt.NDArray[np.float32]

STRETCH, REACH = 0.9995, 0.999
"""Shares of its length to which a leg is stretched at most, and up to which the body sinks instead."""
MOST_ACROSS = 0.9
"""Feet farther aside than this share of a leg are not followed."""
CARRIED = {"shank": "thigh", "foot": "shank", "toe": "foot", "forearm": "upper_arm", "hand": "forearm"}
"""Joints that hang on another one of a person, whatever they hang on in the file."""


class Driver:
    """Turns poses of people into skin matrices of one character.

    Parameters
    ----------
    character : Character
    skeleton : Skeleton
        Of the people; rest frames along the world's axes.

    Notes
    -----
    Rotations are carried over in world space against both rest poses, as imports do it the other way round.
    A character is scaled to the leg length of the person that it stands for, so that its feet stay where
    foot locks put them; thighs and shanks then bend to meet the ankles, and the body sinks where they would
    not reach.
    """

    def __init__(self, character: Character, skeleton: Skeleton) -> None:
        self.character = character
        self.skeleton = skeleton
        joints = character.joints
        rest = character.rest[:, :3, 3]
        self.convention = _convention(character)
        to_ours = self.convention.to_ours
        position = rotate(to_ours, rest)
        still = np.tile([1.0, 0.0, 0.0, 0.0], (1, len(rest), 1))
        source = PosedSource(position[None], still, position, 1.0)
        self._rest_position = position
        self._aim = {
            role: conjugate(rest_aim(source, joints, skeleton, role))
            for role in joints.joint
            if role.partition("_")[0] in SIDES and not role.endswith("toe_end")
        }
        legs = [[joints.joint[f"{side}_{part}"] for part in ("thigh", "shank", "foot")] for side in SIDES]
        self._upper, self._lower = (
            float(np.mean([np.linalg.norm(position[leg[k + 1]] - position[leg[k]]) for leg in legs]))
            for k in range(2)
        )
        self._role = {joint: role for role, joint in joints.joint.items() if not role.endswith("toe_end")}
        self._chain = _chain_of(character, skeleton)
        self._carriers = self._order_by_carrier()

    @property
    def leg_length(self) -> float:
        """Hip to ankle of the character, file units."""
        return self._upper + self._lower

    def rest_pose(self) -> tuple[FloatArray, FloatArray]:
        """Positions (K, 3), file units, and rotations (K, 4) of the joints in the bind pose, in our axes."""
        axes = [rotate(self.convention.to_ours, self.character.rest[:, :3, column]) for column in range(3)]
        unit = [axis / np.linalg.norm(axis, axis=1, keepdims=True) for axis in axes]
        return self._rest_position, from_axes(*unit)

    def skin_matrices(self, rotation_world: FloatArray, position_world: FloatArray) -> Float32Array:
        """Matrices that take the character's mesh to world space.

        Parameters
        ----------
        rotation_world : (N, J, 4) float64
            Of the people's joints.
        position_world : (N, J, 3) float64
            m.

        Returns
        -------
        (N, K, 4, 4) float32
            For the joints of the character; mesh space to world, m.
        """
        turned, position, scale = self.pose(rotation_world, position_world)
        to_ours = self.convention.to_ours
        count, joints = turned.shape[:2]
        rest = np.zeros((joints, 4, 4))
        for column in range(3):
            rest[:, :3, column] = rotate(to_ours, self.character.rest[:, :3, column])
        matrix = np.zeros((count, joints, 4, 4))
        for column in range(3):
            matrix[..., :3, column] = rotate(turned, rest[:, :3, column]) * scale[:, None, None]
        matrix[..., :3, 3] = position
        matrix[..., 3, 3] = 1.0
        return np.asarray(matrix @ self.character.inverse_bind, np.float32)

    def pose(
        self, rotation_world: FloatArray, position_world: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Pose the character's joints.

        Parameters
        ----------
        rotation_world, position_world
            See `skin_matrices`.

        Returns
        -------
        turned : (N, K, 4) float64
            World rotation of each joint against the rest pose.
        position : (N, K, 3) float64
            m.
        scale : (N,) float64
            Metres per file unit of each person's copy.
        """
        ours = self.skeleton
        thigh, shank, foot = (ours.joint(f"left_{part}") for part in ("thigh", "shank", "foot"))
        leg = np.linalg.norm(position_world[:, shank] - position_world[:, thigh], axis=1)
        leg = leg + np.linalg.norm(position_world[:, foot] - position_world[:, shank], axis=1)
        scale = leg / self.leg_length
        turned = self._rotations(rotation_world)
        position = self._positions(turned, scale, position_world)
        drop = self._drop(position, scale, position_world)
        position[..., 1] -= drop[:, None]
        for side in SIDES:
            self._bend_leg(turned, position, side, scale, position_world)
        position = self._positions(turned, scale, position_world)
        position[..., 1] -= drop[:, None]
        return turned, position, scale

    def _drop(self, position: FloatArray, scale: FloatArray, position_world: FloatArray) -> FloatArray:
        """How far the body sinks, m, (N,), so that both legs reach the person's ankles.

        Hips wider or narrower than the person's are farther from the feet.
        """
        joints = self.character.joints.joint
        longest = REACH * self.leg_length * scale
        drop = np.zeros(len(position))
        for side in SIDES:
            way = (
                position_world[:, self.skeleton.joint(f"{side}_foot")] - position[:, joints[f"{side}_thigh"]]
            )
            across = np.minimum(np.hypot(way[:, 0], way[:, 2]), MOST_ACROSS * longest)
            drop = np.maximum(drop, -way[:, 1] - np.sqrt(longest**2 - across**2))
        return drop

    def _rotations(self, rotation_world: FloatArray) -> FloatArray:
        """World rotations against the rest pose; joints without a role turn with their parent."""
        count = len(rotation_world)
        turned = np.zeros((count, self.character.joint_count, 4))
        turned[..., 0] = 1.0
        for joint, above in enumerate(self.character.parent):
            role = self._role.get(joint)
            if role is not None and role in self._aim:
                turned[:, joint] = multiply(rotation_world[:, self.skeleton.joint(role)], self._aim[role])
            elif role is not None:
                turned[:, joint] = rotation_world[:, self.skeleton.joint(role)]
            elif joint in self._chain:
                turned[:, joint] = rotation_world[:, self._chain[joint]]
            elif above >= 0:
                turned[:, joint] = turned[:, above]
            else:
                turned[:, joint] = rotation_world[:, 0]
        return turned

    def _positions(self, turned: FloatArray, scale: FloatArray, position_world: FloatArray) -> FloatArray:
        """Joint positions, m: hips where the person's are, all else carried by the joint above."""
        character = self.character
        rest, size = self._rest_position, scale[:, None]
        joints = character.joints.joint
        pelvis = joints["pelvis"]
        hips = np.mean([rest[joints[f"{side}_thigh"]] for side in SIDES], axis=0)
        ours = np.mean([position_world[:, self.skeleton.joint(f"{side}_thigh")] for side in SIDES], axis=0)
        position = np.zeros((len(turned), character.joint_count, 3))
        position[:, pelvis] = ours - size * rotate(turned[:, pelvis], hips - rest[pelvis])
        for joint, carrier in self._carriers:
            way = rest[joint] - rest[carrier]
            position[:, joint] = position[:, carrier] + size * rotate(turned[:, carrier], way)
        return position

    def _order_by_carrier(self) -> list[tuple[int, int]]:
        """Joints with the one that carries each, carriers first, the pelvis left out.

        A joint hangs on the one above, but a foot on its shank also where the file hangs it elsewhere; what
        hangs on nothing is carried by the pelvis.
        """
        roles, parent = self.character.joints.joint, self.character.parent
        pelvis = roles["pelvis"]
        waiting = {}
        for joint in range(len(parent)):
            side, _, part = self._role.get(joint, "").partition("_")
            above = int(parent[joint]) if parent[joint] >= 0 else pelvis
            waiting[joint] = roles.get(f"{side}_{CARRIED.get(part, '')}", above)
        # What stands above the pelvis is carried by it.
        above = int(parent[pelvis])
        while above >= 0:
            waiting[above], above = pelvis, int(parent[above])
        del waiting[pelvis]
        ordered: list[tuple[int, int]] = []
        placed = {pelvis}
        while waiting:
            ready = [joint for joint, carrier in waiting.items() if carrier in placed]
            for joint in ready or list(waiting):
                ordered.append((joint, waiting.pop(joint) if ready else pelvis))
                waiting.pop(joint, None)
                placed.add(joint)
        return ordered

    def _bend_leg(
        self,
        turned: FloatArray,
        position: FloatArray,
        side: str,
        scale: FloatArray,
        position_world: FloatArray,
    ) -> None:
        """Turn thigh and shank so that the ankle is where the person's is."""
        joints = self.character.joints.joint
        thigh, shank, foot = (joints[f"{side}_{part}"] for part in ("thigh", "shank", "foot"))
        hip, knee, ankle = position[:, thigh], position[:, shank], position[:, foot]
        way = position_world[:, self.skeleton.joint(f"{side}_foot")] - hip
        upper, lower = (np.linalg.norm(b - a, axis=1) for a, b in ((hip, knee), (knee, ankle)))
        distance = np.maximum(np.linalg.norm(way, axis=1), 1e-9)
        direction = way / distance[:, None]
        length = np.clip(distance, np.abs(upper - lower) + 1e-4 * scale, STRETCH * (upper + lower))
        ahead = rotate(turned[:, joints["pelvis"]], np.array([0.0, 0.0, 1.0]))
        bend = knee - hip + 0.02 * (upper + lower)[:, None] * ahead
        bend = bend - direction * (bend * direction).sum(1)[:, None]
        bend /= np.maximum(np.linalg.norm(bend, axis=1), 1e-9)[:, None]
        along = (upper**2 - lower**2 + length**2) / (2.0 * length)
        out = np.sqrt(np.maximum(upper**2 - along**2, 0.0))
        new_knee = along[:, None] * direction + out[:, None] * bend
        new_shank = length[:, None] * direction - new_knee
        turned[:, thigh] = multiply(swing(knee - hip, new_knee), turned[:, thigh])
        turned[:, shank] = multiply(swing(ankle - knee, new_shank), turned[:, shank])


def _convention(character: Character) -> Convention:
    """Axes of the character by its rest pose; its unit is told by the leg that it gets."""
    rest, joints = character.rest[:, :3, 3], character.joints.joint
    legs = sum(rest[joints[f"{side}_thigh"]] - rest[joints[f"{side}_foot"]] for side in SIDES)
    up = nearest_axis(legs)
    left = rest[joints["left_thigh"]] - rest[joints["right_thigh"]]
    left = nearest_axis(left - up * (left @ up))
    to_ours = conjugate(from_axes(*(row[None] for row in (left, up, np.cross(left, up))))[0])
    return Convention(1.0, to_ours, f"up {axis_name(up)}, facing {axis_name(np.cross(left, up))}")


def _chain_of(character: Character, skeleton: Skeleton) -> dict[int, int]:
    """Our spine or neck joint for each joint of the character's spine and neck."""
    found = {}
    for chain, ours in (("spine", [f"spine_{k}" for k in range(1, 5)]), ("neck", ["neck_1", "neck_2"])):
        joints = character.joints.chain[chain]
        for number, joint in enumerate(joints, 1):
            found[joint] = skeleton.joint(ours[max(round(number / len(joints) * len(ours)), 1) - 1])
    return found
