"""Cameras: where they stand, what they see, and the rays through their pixels."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Self

import numpy as np
import numpy.typing as npt

from crowd.errors import describe
from crowd_viewer.context import ViewerError

FloatArray = npt.NDArray[np.float64]
Point = tuple[float, float, float]
UP = np.array([0.0, 1.0, 0.0])
NEAREST = 0.05


def _unit(vector: FloatArray) -> FloatArray:
    return np.asarray(vector / np.linalg.norm(vector))


@dataclass(frozen=True)
class Camera:
    """A view of the scene.

    Attributes
    ----------
    eye, target : tuple of float
        Where it stands and what it looks at, m.
    field_of_view : float
        Vertical angle, rad; 0 draws without perspective.
    height : float
        Height of the picture in the scene where there is no perspective, m.
    """

    eye: Point
    target: Point
    field_of_view: float = math.radians(42.0)
    height: float = 20.0

    @classmethod
    def around(cls, target: Sequence[float], distance: float, azimuth: float, elevation: float) -> Self:
        """Look at a point from a distance, m; angles in rad, azimuth 0 looks along -z from ahead."""
        flat = distance * math.cos(elevation)
        x, y, z = map(float, target)
        eye = (x + flat * math.sin(azimuth), y + distance * math.sin(elevation), z + flat * math.cos(azimuth))
        return cls(eye, (x, y, z))

    @classmethod
    def framing(
        cls, points: FloatArray, aspect: float, azimuth: float = 0.5, elevation: float = 0.30
    ) -> Self:
        """See all points, (P, 3) m, from an angle above."""
        low, high = points.min(axis=0), points.max(axis=0)
        middle = 0.5 * (low + high)
        middle[1] += 0.8
        camera = cls.around(middle, 1.0, azimuth, elevation)
        right, up, ahead = camera.axes()
        away = points - middle
        slope_y = math.tan(0.5 * camera.field_of_view) * 0.93
        slope_x = slope_y * aspect
        depth = away @ ahead
        needed = max(
            float((np.abs(away @ right) / slope_x - depth).max()),
            float(((np.abs(away @ up) + 1.0) / slope_y - depth).max()),
            4.0,
        )
        return cls.around(middle, needed, azimuth, elevation)

    @classmethod
    def from_json(cls, text: str) -> Self:
        """Read what `to_json` wrote.

        Raises
        ------
        ViewerError
            It is not a camera.
        """
        try:
            values = json.loads(text)
            eye, target = (tuple(map(float, values.pop(key))) for key in ("eye", "target"))
            if len(eye) != 3 or len(target) != 3 or eye == target:
                raise ValueError("eye and target must be two different points")
            return cls(eye, target, **{key: float(value) for key, value in values.items()})
        except (ValueError, TypeError, AttributeError, KeyError) as error:
            allowed = '{"eye": [x, y, z], "target": [x, y, z]} with two different points'
            raise ViewerError(describe("camera", "is not a camera", text, allowed)) from error

    def to_json(self) -> str:
        """One line that `from_json` reads."""
        return json.dumps(asdict(self))

    @property
    def is_perspective(self) -> bool:
        """Things look smaller far away."""
        return self.field_of_view > 0.0

    def axes(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Unit vectors to the right, up and ahead."""
        ahead = _unit(np.subtract(self.target, self.eye))
        reference = UP if abs(ahead[1]) < 0.9999 else np.array([0.0, 0.0, -1.0])
        right = _unit(np.cross(ahead, reference))
        return right, np.cross(right, ahead), ahead

    def view(self, origin: FloatArray) -> FloatArray:
        """Matrix from the scene, counted from `origin`, to the camera. (4, 4)."""
        right, up, ahead = self.axes()
        matrix = np.eye(4)
        matrix[:3, :3] = right, up, -ahead
        matrix[:3, 3] = -matrix[:3, :3] @ (np.asarray(self.eye) - origin)
        return matrix

    def projection(self, aspect: float, farthest: float) -> FloatArray:
        """Matrix from the camera to clip space. (4, 4)."""
        near = NEAREST if self.is_perspective else -farthest
        depth = farthest - near
        matrix = np.zeros((4, 4))
        if self.is_perspective:
            scale = 1.0 / math.tan(0.5 * self.field_of_view)
            matrix[0, 0], matrix[1, 1] = scale / aspect, scale
            matrix[2, 2], matrix[2, 3] = -(farthest + near) / depth, -2.0 * farthest * near / depth
            matrix[3, 2] = -1.0
        else:
            matrix[0, 0], matrix[1, 1] = 2.0 / (self.height * aspect), 2.0 / self.height
            matrix[2, 2], matrix[2, 3] = -2.0 / depth, -(farthest + near) / depth
            matrix[3, 3] = 1.0
        return matrix

    def pixels_at_one_metre(self, picture_height: int) -> float:
        """Height in pixels of one metre one metre away, or anywhere without perspective."""
        if self.is_perspective:
            return 0.5 * picture_height / math.tan(0.5 * self.field_of_view)
        return picture_height / self.height

    def ray(self, x: float, y: float, size: tuple[int, int]) -> tuple[FloatArray, FloatArray]:
        """Origin and unit direction of the ray through a pixel counted from the upper left corner."""
        right, up, ahead = self.axes()
        across = (2.0 * (x + 0.5) / size[0] - 1.0) * size[0] / size[1]
        above = 1.0 - 2.0 * (y + 0.5) / size[1]
        if not self.is_perspective:
            half = 0.5 * self.height
            return np.asarray(self.eye) + half * (across * right + above * up), ahead
        slope = math.tan(0.5 * self.field_of_view)
        return np.asarray(self.eye, np.float64), _unit(ahead + slope * (across * right + above * up))

    def moved(self, offset: FloatArray) -> Self:
        """The same view from elsewhere."""
        x, y, z = (float(v) for v in offset)
        eye = (self.eye[0] + x, self.eye[1] + y, self.eye[2] + z)
        return replace(self, eye=eye, target=(self.target[0] + x, self.target[1] + y, self.target[2] + z))


def view_planes(matrix: FloatArray) -> FloatArray:
    """Planes of a view from its matrix to clip space: unit normals inwards, and offsets. (6, 4).

    Gribb and Hartmann, "Fast extraction of viewing frustum planes from the world-view-projection matrix",
    2001.
    """
    planes = np.concatenate([matrix[3] + matrix[:3], matrix[3] - matrix[:3]])
    return np.ascontiguousarray(planes / np.linalg.norm(planes[:, :3], axis=1, keepdims=True))
