"""Objects that people can grasp: what never changes about them, and where they are."""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum
from typing import Any

import numpy as np
import numpy.typing as npt

from crowd.errors import SettingsError, describe, nearest_first
from crowd.motion.rotation import rotate
from crowd.world.mesh import Mesh

FloatArray = npt.NDArray[np.float64]
Float32Array = npt.NDArray[np.float32]
IntArray = npt.NDArray[np.int32]
BoolArray = npt.NDArray[np.bool_]


class ShapeKind(IntEnum):
    """Shapes of objects; all have their origin in the centre."""

    SPHERE = 0
    BOX = 1
    CAPSULE = 2
    """Along its own y axis."""
    MESH = 3


@dataclass(frozen=True)
class Objects:
    """What never changes about objects; arrays with one row for each.

    Attributes
    ----------
    name : tuple of str
        Unique.
    kind : (M,) int32
        `ShapeKind`.
    half_size : (M, 3) float64
        Half the sides of the bounding box along the object's own axes, m. The radius of a sphere or a capsule
        is the first, half the length of a capsule with its caps the second.
    colour : (M, 3) float32
        Red, green, blue, 0 to 1.
    mesh : (M,) int32
        Index in `meshes`, -1 for other shapes.
    meshes : tuple of Mesh
    start_position_world : (M, 3) float64
        Centre at the start, m.
    start_rotation_world : (M, 4) float64
        Unit quaternions.
    """

    name: tuple[str, ...]
    kind: IntArray
    half_size: FloatArray
    colour: Float32Array
    mesh: IntArray
    meshes: tuple[Mesh, ...]
    start_position_world: FloatArray
    start_rotation_world: FloatArray

    @classmethod
    def none(cls) -> "Objects":
        """No objects."""
        return cls(
            (),
            np.zeros(0, np.int32),
            np.zeros((0, 3)),
            np.zeros((0, 3), np.float32),
            np.zeros(0, np.int32),
            (),
            np.zeros((0, 3)),
            np.zeros((0, 4)),
        )

    @property
    def count(self) -> int:
        """Number of objects."""
        return len(self.name)

    def index(self, name: str) -> int:
        """Row of an object by name.

        Raises
        ------
        SettingsError
            No object has this name; the nearest known names are listed.
        """
        if name not in self.name:
            known = nearest_first(name, self.name) if self.name else "the scenario has no objects"
            raise SettingsError(describe("objects", "no object has this name", name, known))
        return self.name.index(name)

    def lowest_point(self, index: int, rotation_world: FloatArray) -> float:
        """Height of the lowest point of an object against its centre when it is turned (4,), m, <= 0."""
        return float(self.bounds(index, rotation_world)[0][1])

    def bounds(self, index: int, rotation_world: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Least and greatest coordinates of an object turned (4,) about its centre, m. Two (3,) arrays."""
        half = self.half_size[index]
        columns = rotate(rotation_world, np.eye(3))
        match ShapeKind(int(self.kind[index])):
            case ShapeKind.SPHERE:
                reach = np.full(3, half[0])
            case ShapeKind.BOX:
                reach = half @ np.abs(columns)
            case ShapeKind.CAPSULE:
                reach = half[0] + np.abs(columns[1]) * (half[1] - half[0])
            case ShapeKind.MESH:
                vertex = self.meshes[self.mesh[index]].vertex @ columns
                return vertex.min(axis=0), vertex.max(axis=0)
        return -reach, reach


class ObjectState:
    """Where objects are and who holds them: a structure of arrays, leading axis = object.

    Attributes
    ----------
    position_world : (M, 3) float64
        Centre, m.
    rotation_world : (M, 4) float64
        Unit quaternions.
    holder : (M,) int32
        Character that holds the object, -1 for none.
    holder_hand : (M, 2) bool
        Which of the holder's hands hold it: right, left.
    grip_position : (M, 2, 3) float64
        Centre of the object in the frame of each holding hand joint, m.
    grip_rotation : (M, 2, 4) float64
        Rotation of the object against each holding hand joint.
    release_error : (M,) float64
        How far the hand held the object from where it was to be put, when it last let go of it, m; NaN where
        no place was asked for.
    """

    def __init__(self, objects: Objects) -> None:
        count = objects.count
        self.position_world: FloatArray = objects.start_position_world.copy()
        self.rotation_world: FloatArray = objects.start_rotation_world.copy()
        self.holder: IntArray = np.full(count, -1, np.int32)
        self.holder_hand: BoolArray = np.zeros((count, 2), np.bool_)
        self.grip_position: FloatArray = np.zeros((count, 2, 3))
        self.grip_rotation: FloatArray = np.tile([1.0, 0.0, 0.0, 0.0], (count, 2, 1))
        self.release_error: FloatArray = np.full(count, np.nan)

    @property
    def count(self) -> int:
        """Number of objects."""
        return int(self.holder.shape[0])

    def state_fields(self) -> Mapping[str, npt.NDArray[Any]]:
        """Arrays that change in a run."""
        return dict(vars(self))
