"""Grid maps and queries in the format of the Moving AI benchmarks (Sturtevant, 2012)."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt


@dataclass(frozen=True)
class Queries:
    """Start and goal cells with the lengths of optimal ways.

    Attributes
    ----------
    is_walkable : (rows, columns) uint8
    start, goal : (Q,) int32
        Cells, ``row * columns + column``.
    optimal_length : (Q,) float64
        In cells; diagonal moves count the root of 2.
    """

    is_walkable: npt.NDArray[np.uint8]
    start: npt.NDArray[np.int32]
    goal: npt.NDArray[np.int32]
    optimal_length: npt.NDArray[np.float64]


def read_map(path: Path) -> npt.NDArray[np.uint8]:
    """Read a ``.map`` file: 1 where one can walk (``.``, ``G``, ``S``), rows from top to bottom."""
    lines = path.read_text(encoding="ascii").splitlines()
    first = lines.index("map") + 1
    return np.array([[character in ".GS" for character in line] for line in lines[first:] if line], np.uint8)


def read_queries(map_path: Path, scen_path: Path) -> Queries:
    """Read a map with the queries of a ``.scen`` file."""
    is_walkable = read_map(map_path)
    columns = is_walkable.shape[1]
    fields = [line.split() for line in scen_path.read_text(encoding="ascii").splitlines()[1:] if line.strip()]
    numbers = np.array([[float(value) for value in row[-5:]] for row in fields])
    start = numbers[:, 1] * columns + numbers[:, 0]
    goal = numbers[:, 3] * columns + numbers[:, 2]
    return Queries(is_walkable, start.astype(np.int32), goal.astype(np.int32), numbers[:, 4])
