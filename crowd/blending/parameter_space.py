"""The locomotion parameter space: examples with weights for every point, and what they can realise."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from crowd.blending.tessellation import Tessellation, tessellate
from crowd.errors import MotionError, describe
from crowd_kernels.barycentric import SpaceArrays, locate_crowd

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int32]

GRID_SHAPE = (20, 14, 14)
MARGIN = 1e-6
"""How far the look-up grid reaches beyond the examples, in ranges."""
AXES = ("forward speed", "turn rate", "side speed")


@dataclass(frozen=True)
class ParameterSpace:
    """Examples in (forward speed, turn rate, side speed), tessellated.

    Attributes
    ----------
    names : tuple of str
        Names of the examples.
    parameters : (E, 3) float64
        m/s, rad/s, m/s.
    arrays : SpaceArrays
        What the look-up kernel reads.
    """

    names: tuple[str, ...]
    parameters: FloatArray
    arrays: SpaceArrays

    @classmethod
    def build(
        cls, parameters: FloatArray, cycle_duration: FloatArray, names: Sequence[str]
    ) -> "ParameterSpace":
        """Tessellate examples, with axes divided by their range.

        Parameters
        ----------
        parameters : (E, 3) float64
            m/s, rad/s, m/s.
        cycle_duration : (E,) float64
            Length of one gait cycle, s.
        names : sequence of str

        Raises
        ------
        MotionError
            The examples do not span the space, or an example's numbers are unusable.
        """
        parameters = np.ascontiguousarray(parameters, dtype=np.float64).reshape(-1, 3)
        cycle_duration = np.ascontiguousarray(cycle_duration, dtype=np.float64)
        check_examples(parameters, cycle_duration, names)
        axis_range = np.ptp(parameters, axis=0)
        points = parameters / axis_range
        tessellation = tessellate(points)
        if tessellation is None:
            raise MotionError(
                describe(
                    "locomotion examples",
                    "lie in one plane of the parameter space",
                    f"{len(points)} examples",
                    "at least four that differ in forward speed, turn rate and side speed independently",
                )
            )
        return cls(tuple(names), parameters, pack(points, axis_range, cycle_duration, tessellation))

    @property
    def simplex_count(self) -> int:
        """Number of tetrahedra."""
        return int(self.arrays.simplex.shape[0])

    def locate(
        self, parameter: npt.ArrayLike
    ) -> tuple[IntArray, FloatArray, FloatArray, npt.NDArray[np.bool_]]:
        """Look up points.

        Parameters
        ----------
        parameter : (N, 3) array
            m/s, rad/s, m/s.

        Returns
        -------
        example : (N, 4) int32
        weight : (N, 4) float64
            Pose weights.
        realised : (N, 3) float64
            The nearest parameters inside.
        is_inside : (N,) bool
        """
        points = np.ascontiguousarray(np.atleast_2d(np.asarray(parameter, dtype=np.float64)))
        count = len(points)
        example, weight = np.zeros((count, 4), np.int32), np.zeros((count, 4))
        rate, realised, is_inside = np.zeros(count), np.zeros((count, 3)), np.zeros(count, np.uint8)
        locate_crowd(
            self.arrays, points, np.arange(count, dtype=np.int32), example, weight, rate, realised, is_inside
        )
        return example, weight, realised, is_inside.astype(bool)

    def extent(self, origin: npt.ArrayLike, direction: npt.ArrayLike) -> FloatArray:
        """Find how far the space reaches from points along directions.

        Parameters
        ----------
        origin, direction : (..., 3) array
            m/s, rad/s, m/s; they broadcast.

        Returns
        -------
        (...) float64
            Units of `direction` to the farthest point of the space on each ray; 0 where it misses the space.
        """
        origin, direction = np.broadcast_arrays(
            np.asarray(origin, np.float64) / self.arrays.axis_range,
            np.asarray(direction, np.float64) / self.arrays.axis_range,
        )
        inverse = self.arrays.inverse.reshape(-1, 3, 3)
        last_corner = self.arrays.example[self.arrays.simplex[:, 3]]
        # Along a ray all barycentric weights are linear: weight = start + distance * slope.
        start = np.einsum("sij,...sj->...si", inverse, origin[..., None, :] - last_corner)
        slope = np.einsum("sij,...j->...si", inverse, direction)
        start = np.concatenate([start, 1 - start.sum(axis=-1, keepdims=True)], axis=-1)
        slope = np.concatenate([slope, -slope.sum(axis=-1, keepdims=True)], axis=-1)
        with np.errstate(divide="ignore", invalid="ignore"):
            crossing = -(start + 1e-12) / slope
        leaves = np.where(slope < 0, crossing, np.inf).min(axis=-1)
        enters = np.where(slope > 0, crossing, -np.inf).max(axis=-1)
        is_never_inside = ((slope == 0) & (start < -1e-12)).any(axis=-1)
        is_met = (enters <= leaves) & np.isfinite(leaves) & ~is_never_inside
        return np.asarray(np.where(is_met, leaves, 0.0).max(axis=-1).clip(min=0.0))

    @property
    def maximum_forward_speed(self) -> float:
        """Largest speed straight ahead, m/s."""
        return float(self.extent(np.zeros(3), (1.0, 0.0, 0.0)))

    def maximum_turn_rate(self, forward_speed: npt.ArrayLike) -> FloatArray:
        """Largest turn rate that is possible to both sides at forward speeds, rad/s."""
        return self._both_sides(forward_speed, 1)

    def maximum_side_speed(self, forward_speed: npt.ArrayLike) -> FloatArray:
        """Largest side speed that is possible to both sides at forward speeds, m/s."""
        return self._both_sides(forward_speed, 2)

    def _both_sides(self, forward_speed: npt.ArrayLike, axis: int) -> FloatArray:
        origin = np.asarray(forward_speed, np.float64)[..., None] * (1.0, 0.0, 0.0)
        direction = np.eye(3)[axis]
        return np.minimum(self.extent(origin, direction), self.extent(origin, -direction))


def check_examples(parameters: FloatArray, cycle_duration: FloatArray, names: Sequence[str]) -> None:
    """Refuse examples that cannot be tessellated.

    Raises
    ------
    MotionError
        A number is not finite, a duration is not positive, or all examples agree in one parameter.
    """
    for name, parameter, duration in zip(names, parameters, cycle_duration, strict=True):
        if not np.isfinite(parameter).all():
            raise MotionError(
                describe(f'clip "{name}"', "has parameters that are not finite", parameter.tolist())
            )
        if not (np.isfinite(duration) and duration > 0):
            raise MotionError(
                describe(f'clip "{name}"', "has an unusable cycle duration", duration, "above 0 s")
            )
    for axis, values in zip(AXES, parameters.T, strict=True):
        if len(values) == 0 or not np.ptp(values) > 0:
            raise MotionError(
                describe(
                    "locomotion examples",
                    f"all have the same {axis}",
                    f"{len(values)} examples",
                    f"examples that differ in {axis}",
                )
            )


def pack(
    points: FloatArray, axis_range: FloatArray, cycle_duration: FloatArray, tessellation: Tessellation
) -> SpaceArrays:
    """Prepare a tessellation for the look-up kernel."""
    simplex, cone_face = tessellation.simplex, tessellation.cone_face
    corners = points[simplex]
    inverse = inverse_rows(corners[:, :3] - corners[:, 3:])
    origin = points.min(axis=0) - MARGIN
    shape = np.array(GRID_SHAPE, dtype=np.int64)
    scale = shape / (points.max(axis=0) + MARGIN - origin)
    cell_start, cell_simplex = candidates(corners, inverse, origin, scale)
    return SpaceArrays(
        axis_range=np.ascontiguousarray(axis_range),
        example=np.ascontiguousarray(points),
        cycle_duration=cycle_duration,
        simplex=simplex,
        inverse=inverse,
        hull_face=tessellation.hull_face,
        hull_plane=tessellation.hull_plane,
        centre=tessellation.centre,
        cone_face=cone_face,
        cone_inverse=inverse_rows(points[cone_face] - tessellation.centre),
        grid_origin=origin,
        grid_scale=scale,
        grid_shape=shape,
        cell_start=cell_start,
        cell_simplex=cell_simplex,
    )


def inverse_rows(directions: FloatArray) -> FloatArray:
    """Invert the matrices whose columns are three directions each; (n, 9) row-major."""
    return np.ascontiguousarray(np.linalg.inv(np.transpose(directions, (0, 2, 1))).reshape(-1, 9))


def candidates(
    corners: FloatArray, inverse: FloatArray, origin: FloatArray, scale: FloatArray
) -> tuple[IntArray, IntArray]:
    """List the tetrahedra that may touch each grid cell: offsets (cells + 1,) and tetrahedra, cell by cell.

    A tetrahedron misses a cell when the whole cell lies beyond one of its faces. Cells are taken a little
    larger than they are, so that rounding in the look-up cannot pick a cell that lacks its tetrahedron.
    """
    index = np.indices(GRID_SHAPE).reshape(3, -1).T
    bits = np.indices((2, 2, 2)).reshape(3, 8).T
    box = (index[:, None] + np.where(bits, 1 + 1e-3, -1e-3)) / scale + origin
    touching = []
    for corner, rows in zip(corners[:, 3], inverse.reshape(-1, 3, 3), strict=True):
        weight = (box - corner) @ rows.T
        weight = np.concatenate([weight, 1 - weight.sum(axis=-1, keepdims=True)], axis=-1)
        touching.append((weight.max(axis=1) >= 0).all(axis=-1))
    cell, simplex = np.nonzero(np.array(touching).T)
    start = np.searchsorted(cell, np.arange(len(index) + 1))
    return start.astype(np.int32), simplex.astype(np.int32)
