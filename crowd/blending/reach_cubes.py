"""Division of the space around points into cubes, each with the points that can be near a place inside."""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from crowd_kernels.reach_cubes import RIVALS, list_candidates
from crowd_kernels.reach_space import BLOCK, COARSEST, HALVINGS

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

OCTANTS = np.array([[code & 1, code >> 1 & 1, code >> 2] for code in range(8)])
"""(8, 3) Places of the halves of a cube, x innermost."""
LONGEST = BLOCK
"""Lists longer than this are divided while they may be."""


class Cubes(NamedTuple):
    """Equal cubes with their lists of candidates."""

    place: IntArray
    """(C, 3) Place of each cube, counted in cubes from the lowest corner."""
    candidate: npt.NDArray[np.int32]
    """(N,) Points of all lists."""
    start: IntArray
    """(C + 1,) First candidate of each list."""

    def chosen(self, which: npt.NDArray[np.intp]) -> "Cubes":
        """Some of the cubes."""
        length = np.diff(self.start)[which]
        start = np.concatenate([[0], np.cumsum(length)])
        rows = np.arange(start[-1]) + np.repeat(self.start[which] - start[:-1], length)
        return Cubes(self.place[which], self.candidate[rows], start)


class DividedSpace(NamedTuple):
    """Space around the points of one set; columns as in `crowd_kernels.reach_space.ReachArrays`."""

    along: IntArray
    """(3,) Coarsest cubes along each axis."""
    first: IntArray
    """(C,) First list of each coarsest cube."""
    shift: IntArray
    """(C,) Bits by which places inside are shifted."""
    candidate: npt.NDArray[np.int32]
    """(N,) Points of all lists."""
    start: IntArray
    """(L + 1,) First candidate of each list."""


def divide_space(point: FloatArray, low: FloatArray, high: FloatArray) -> DividedSpace:
    """List the points that can be among the four nearest of a place, in cubes that are fine where needed.

    Parameters
    ----------
    point : (P, 3) float64
        m.
    low, high : (3,) float64
        Corners of the space, m.
    """
    along = np.maximum(np.ceil((high - low) / COARSEST), 1.0).astype(np.int64)
    level = -int(np.ceil(np.log2(along.max())))
    every = np.arange(len(point), dtype=np.int32)
    cubes = Cubes(np.zeros((1, 3), np.int64), every, np.array([0, len(point)]))
    while level < 0:
        level += 1
        cubes = halved(point, low, level, cubes, np.ceil(along * 2.0**level))
    cubes = cubes.chosen(np.lexsort(cubes.place.T))
    # Coarsest cubes whose parts, equally many of each, may be divided further.
    member = np.arange(len(cubes.place))
    first, shift = np.zeros(len(member), np.int64), np.zeros(len(member), np.int64)
    lists: list[Cubes] = []
    for level in range(HALVINGS + 1):
        parts = np.arange(len(cubes.place)).reshape(-1, 8**level)
        is_open = (np.diff(cubes.start)[parts] > LONGEST).any(axis=1) & (level < HALVINGS)
        done = member[~is_open]
        first[done] = sum(len(part.place) for part in lists) + 8**level * np.arange(len(done))
        shift[done] = 3 * (HALVINGS - level)
        lists.append(cubes.chosen(parts[~is_open].ravel()))
        member = member[is_open]
        if level < HALVINGS:
            cubes = halved(point, low, level + 1, cubes.chosen(parts[is_open].ravel()))
    length = np.concatenate([np.diff(part.start) for part in lists])
    candidate = np.concatenate([part.candidate for part in lists])
    return DividedSpace(along, first, shift, candidate, np.concatenate([[0], np.cumsum(length)]))


def halved(
    point: FloatArray, low: FloatArray, level: int, cubes: Cubes, end: FloatArray | float = np.inf
) -> Cubes:
    """Halve cubes in all directions; the eight parts of each follow each other.

    Parameters
    ----------
    point : (P, 3) float64
        m.
    low : (3,) float64
        Lowest corner of the space, m.
    level : int
        How often the parts are halves of the coarsest cubes; negative for larger ones.
    cubes : Cubes
    end : (3,) float64 or float
        Parts from these places on are left out.
    """
    place = (2 * cubes.place[:, None] + OCTANTS).reshape(-1, 3)
    parent = np.repeat(np.arange(len(cubes.place)), len(OCTANTS))
    is_inside = (place < end).all(axis=1)
    place, parent = place[is_inside], parent[is_inside]
    half = 0.5 * COARSEST * 0.5**level
    candidate = np.empty(np.diff(cubes.start)[parent].sum(), np.int32)
    start = np.zeros(len(place) + 1, np.int64)
    list_candidates(
        np.ascontiguousarray(point.T),
        low + (2 * place + 1) * half,
        half,
        parent,
        cubes.candidate,
        cubes.start,
        np.zeros(len(point)),
        np.zeros(RIVALS, np.int32),
        np.zeros(RIVALS),
        candidate,
        start,
    )
    return Cubes(place, candidate[: start[-1]].copy(), start)


def along_curve(point: FloatArray, edge: float) -> npt.NDArray[np.intp]:
    """Sort points (P, 3) by cubes along a Morton curve, so that those near each other share cache lines."""
    place = ((point - point.min(axis=0)) / edge).astype(np.int64)
    bits = np.arange(20)
    code = ((place[..., None] >> bits & 1) << 3 * bits + np.arange(3)[:, None]).sum(axis=(1, 2))
    return np.argsort(code, kind="stable")
