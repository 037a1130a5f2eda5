"""Furniture: boxes with boards that objects rest on and people sit on."""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]

SPOT_SPACING = 0.18
"""Distance between places for objects on a board, m."""
SPOT_INSET = 0.13
"""Least distance of such a place from the board's edge, m."""


@dataclass(frozen=True)
class Furniture:
    """One shelf, table or seat.

    Attributes
    ----------
    name : str
    x, z : (low, high)
        Sides of the box, m.
    boards : tuple of float
        Heights of the upper sides of its boards, ascending, m.
    facing : float or None
        Direction in which people sit, rad; None where nobody can.
    """

    name: str
    x: tuple[float, float]
    z: tuple[float, float]
    boards: tuple[float, ...]
    facing: float | None

    @property
    def center(self) -> FloatArray:
        """Middle of the box on the ground. (3,)"""
        return np.array([sum(self.x) / 2.0, 0.0, sum(self.z) / 2.0])

    def spots(self) -> FloatArray:
        """Places for objects on the highest board, m. (S, 3)"""
        rows = []
        for low, high in (self.x, self.z):
            room = high - low - 2.0 * SPOT_INSET
            count = max(int(room / SPOT_SPACING) + 1, 1) if room > 0.0 else 1
            middle = (low + high) / 2.0
            half = SPOT_SPACING * (count - 1) / 2.0
            rows.append(np.linspace(middle - half, middle + half, count))
        x, z = (grid.ravel() for grid in np.meshgrid(*rows, indexing="ij"))
        return np.stack([x, np.full(len(x), self.boards[-1]), z], axis=1)

    def sitting_place(self, clearance: float) -> tuple[FloatArray, float]:
        """Where the feet of a seated person are, and which way the person faces.

        Parameters
        ----------
        clearance : float
            Distance of the feet from the edge of the seat, m.
        """
        assert self.facing is not None
        ahead = np.array([math.sin(self.facing), 0.0, math.cos(self.facing)])
        half = abs(ahead[0]) * (self.x[1] - self.x[0]) / 2.0 + abs(ahead[2]) * (self.z[1] - self.z[0]) / 2.0
        return self.center + (half + clearance) * ahead, self.facing
