"""Characters sorted into ground cells, ready for neighbour searches."""

import math

import numpy as np
import numpy.typing as npt

from crowd_kernels.aligned import aligned_full, aligned_zeros
from crowd_kernels.cells import find_extent, mean_company, sort_into_cells

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int32]

WANTED_COMPANY = 3.0
MOST_ADJUSTMENTS = 4


class CellTable:
    """Scratch arrays of the counting sort, and the size of its cells.

    The size follows the density: about three characters per cell are fastest. Results of searches do not
    depend on it, so it is no part of a saved state.

    Parameters
    ----------
    capacity : int
        Largest number of characters.
    smallest_cell_size, largest_cell_size : float
        m.
    """

    def __init__(self, capacity: int, smallest_cell_size: float, largest_cell_size: float) -> None:
        self.cell_size = min(1.0, largest_cell_size)
        self.columns = 0
        self.rows = 0
        self.sorted_count = 0
        self.character: IntArray = aligned_zeros(capacity, np.int32)
        self.slot: IntArray = aligned_full(capacity, -1, np.int32)
        self.point: FloatArray = aligned_zeros(2 * capacity)
        self.cell_start: IntArray = aligned_zeros(1, np.int32)
        self._cell_of_index: IntArray = aligned_zeros(capacity, np.int32)
        self._cell_limit = 4 * capacity + 1024
        self._smallest = smallest_cell_size
        self._largest = largest_cell_size

    def sort(self, position_world: FloatArray, radius: FloatArray, active: IntArray, reach: float) -> None:
        """Sort the active characters; repeat with other cells if these are far too crowded or too empty.

        Parameters
        ----------
        position_world : (N, 3) float64
            m.
        radius : (N,) float64
            m.
        active : (A,) int32
        reach : float
            Largest distance that will be searched, m.
        """
        for _ in range(MOST_ADJUSTMENTS):
            self._sort_once(position_world, radius, active, reach)
            company = mean_company(self.cell_start, self.columns * self.rows)
            scale = math.sqrt(WANTED_COMPANY / max(company, 0.05))
            cell_size = min(max(self.cell_size * min(max(scale, 0.25), 2.0), self._smallest), self._largest)
            if 0.7 < cell_size / self.cell_size < 1.4:
                return
            self.cell_size = cell_size
        self._sort_once(position_world, radius, active, reach)

    def _sort_once(
        self, position_world: FloatArray, radius: FloatArray, active: IntArray, reach: float
    ) -> None:
        self.columns, self.rows = find_extent(position_world, active, self.cell_size, reach, self._cell_limit)
        if self.cell_start.shape[0] < self.columns * self.rows + 1:
            self.cell_start = aligned_zeros(2 * self.columns * self.rows + 1, np.int32)
        self.sorted_count = sort_into_cells(
            position_world,
            radius,
            active,
            self.cell_size,
            self.columns,
            self.rows,
            self._cell_of_index,
            self.cell_start,
            self.character,
            self.slot,
            self.point,
        )
