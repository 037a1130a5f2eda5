"""The locomotion parameter space: automatic tessellation of examples, and what it can realise."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
import numpy.typing as npt
from scipy.spatial import Delaunay, QhullError

from crowd.errors import MotionError, describe
from crowd_kernels.barycentric import SpaceArrays, locate_crowd

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int32]

PLANE_TOLERANCE = 1e-9
SLIVER_VOLUME = 1e-9
GRID_SHAPE = (20, 14, 14)
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
        """Tessellate examples.

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
            The examples do not span the space.

        Notes
        -----
        Axes are divided by their range. Each of the four quadrants (turn left or right) x (side left or
        right) is tessellated by itself, with the examples on its planes shared, so that no blend mixes turns
        or sidesteps of opposite sides.
        """
        parameters = np.ascontiguousarray(parameters, dtype=np.float64)
        axis_range = np.ptp(parameters, axis=0)
        for axis, extent in zip(AXES, axis_range, strict=True):
            if not extent > 0:
                raise MotionError(
                    describe(
                        "locomotion examples",
                        f"all have the same {axis}",
                        allowed="examples on both sides of 0",
                    )
                )
        points = parameters / axis_range
        simplex = tessellate(points)
        if len(simplex) == 0:
            raise MotionError(
                describe("locomotion examples", "do not span the parameter space", f"{len(points)} examples")
            )
        return cls(tuple(names), parameters, pack(points, axis_range, cycle_duration, simplex))

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

    def reach(self, origin: npt.ArrayLike, direction: npt.ArrayLike) -> float:
        """Find how far the space extends from a point inside along a direction, in units of `direction`."""
        origin, direction = np.asarray(origin, float), np.asarray(direction, float)
        inside, outside = 0.0, 1.0
        while self.locate(origin + outside * direction)[3][0] and outside < 1e6:
            inside, outside = outside, 2.0 * outside
        for _ in range(50):
            middle = 0.5 * (inside + outside)
            if self.locate(origin + middle * direction)[3][0]:
                inside = middle
            else:
                outside = middle
        return inside

    @property
    def maximum_forward_speed(self) -> float:
        """Largest speed straight ahead, m/s."""
        return self.reach(np.zeros(3), (1.0, 0.0, 0.0))

    def maximum_turn_rate(self, forward_speed: float) -> float:
        """Largest turn rate to both sides at a forward speed, rad/s."""
        origin = (forward_speed, 0.0, 0.0)
        return min(self.reach(origin, (0.0, 1.0, 0.0)), self.reach(origin, (0.0, -1.0, 0.0)))

    def maximum_side_speed(self, forward_speed: float) -> float:
        """Largest side speed to both sides at a forward speed, m/s."""
        origin = (forward_speed, 0.0, 0.0)
        return min(self.reach(origin, (0.0, 0.0, 1.0)), self.reach(origin, (0.0, 0.0, -1.0)))


def tessellate(points: FloatArray) -> IntArray:
    """Tessellate scaled examples, quadrant by quadrant; returns (S, 4) indices."""
    found: dict[tuple[int, ...], None] = {}
    for turn_side in (1.0, -1.0):
        for step_side in (1.0, -1.0):
            members = np.flatnonzero(
                (turn_side * points[:, 1] >= -PLANE_TOLERANCE)
                & (step_side * points[:, 2] >= -PLANE_TOLERANCE)
            )
            if len(members) < 4:
                continue
            try:
                cells = Delaunay(points[members], qhull_options="QJ Pp Q12").simplices
            except QhullError:
                continue
            for cell in members[cells]:
                if abs(np.linalg.det(points[cell[:3]] - points[cell[3]])) > SLIVER_VOLUME:
                    found[tuple(sorted(int(corner) for corner in cell))] = None
    return np.array(list(found), dtype=np.int32).reshape(-1, 4)


def boundary_faces(simplex: IntArray) -> IntArray:
    """Triangles that belong to one tetrahedron only; (F, 3) indices."""
    uses: dict[tuple[int, ...], int] = {}
    for cell in simplex:
        for face in combinations(sorted(int(corner) for corner in cell), 3):
            uses[face] = uses.get(face, 0) + 1
    return np.array([face for face, count in uses.items() if count == 1], dtype=np.int32)


def pack(
    points: FloatArray, axis_range: FloatArray, cycle_duration: FloatArray, simplex: IntArray
) -> SpaceArrays:
    """Prepare a tessellation for the look-up kernel."""
    corners = points[simplex]
    edges = np.transpose(corners[:, :3] - corners[:, 3:], (0, 2, 1))
    inverse = np.linalg.inv(edges).reshape(-1, 9)
    lowest, highest = points.min(axis=0) - 1e-6, points.max(axis=0) + 1e-6
    shape = np.array(GRID_SHAPE, dtype=np.int64)
    scale = shape / (highest - lowest)
    first = np.clip(np.floor((corners.min(axis=1) - 1e-6 - lowest) * scale), 0, shape - 1).astype(int)
    last = np.clip(np.floor((corners.max(axis=1) + 1e-6 - lowest) * scale), 0, shape - 1).astype(int)
    cells: list[list[int]] = [[] for _ in range(int(shape.prod()))]
    for number, (low, high) in enumerate(zip(first, last, strict=True)):
        for i in range(low[0], high[0] + 1):
            for j in range(low[1], high[1] + 1):
                for k in range(low[2], high[2] + 1):
                    if touches(inverse[number], corners[number, 3], lowest, scale, (i, j, k)):
                        cells[(i * shape[1] + j) * shape[2] + k].append(number)
    start = np.concatenate([[0], np.cumsum([len(cell) for cell in cells])]).astype(np.int32)
    return SpaceArrays(
        np.ascontiguousarray(axis_range),
        np.ascontiguousarray(points),
        np.ascontiguousarray(cycle_duration, dtype=np.float64),
        simplex,
        np.ascontiguousarray(inverse),
        boundary_faces(simplex),
        lowest,
        scale,
        shape,
        start,
        np.array([number for cell in cells for number in cell], dtype=np.int32),
    )


def touches(
    inverse: FloatArray, corner: FloatArray, lowest: FloatArray, scale: FloatArray, cell: tuple[int, int, int]
) -> bool:
    """A tetrahedron may touch a grid cell: no face of it has the whole cell on its outer side."""
    box = (
        np.array(np.meshgrid(*[(index - 1e-3, index + 1 + 1e-3) for index in cell])).reshape(3, 8).T / scale
        + lowest
    )
    weights = (box - corner) @ inverse.reshape(3, 3).T
    all_weights = np.column_stack([weights, 1 - weights.sum(axis=1)])
    return bool((all_weights.max(axis=0) >= -1e-9).all())
