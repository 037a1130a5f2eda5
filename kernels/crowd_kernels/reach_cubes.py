"""Which points can be among the four nearest of a place, for all places of a cube."""

from typing import Any

from crowd_kernels._jit import inlined_kernel, kernel
from crowd_kernels.reach_space import FAR, NEAREST

RIVALS = 16
"""Points next to a cube's centre with which all others are compared."""
SLACK = 1e-12
"""Lead below which a point does not count as nearer, m2; more than rounding makes."""


@inlined_kernel
def choose_rivals(
    point: Any, x: float, y: float, z: float, candidate: Any, square: Any, rival: Any, rival_square: Any
) -> int:
    """Find the candidates nearest to a place, and the squared distances of all.

    Parameters
    ----------
    point : (3, P) float64
        m.
    x, y, z : float
        m.
    candidate : (N,) int32
        Points.
    square : (>= N,) float64
        Written: squared distances of the candidates, m2.
    rival : (16,) int32
        Written: the nearest ones.
    rival_square : (16,) float64
        Written: their squared distances, m2, ascending.

    Returns
    -------
    int
        Number of rivals.
    """
    count = candidate.shape[0]
    rivals = min(count, RIVALS)
    for n in range(rivals):
        rival_square[n] = FAR
    for i in range(count):
        one = candidate[i]
        dx, dy, dz = point[0, one] - x, point[1, one] - y, point[2, one] - z
        own = dx * dx + dy * dy + dz * dz
        square[i] = own
        if own < rival_square[rivals - 1]:
            n = rivals - 1
            while n > 0 and rival_square[n - 1] > own:
                rival_square[n] = rival_square[n - 1]
                rival[n] = rival[n - 1]
                n -= 1
            rival_square[n] = own
            rival[n] = one
    return int(rivals)


@inlined_kernel
def is_beaten(
    point: Any, one: int, square: float, half: float, rival: Any, rival_square: Any, rivals: int
) -> bool:
    """Tell whether four rivals are nearer than a point wherever one stands in a cube."""
    nearer = 0
    for n in range(rivals):
        other = rival[n]
        apart = (
            abs(point[0, one] - point[0, other])
            + abs(point[1, one] - point[1, other])
            + abs(point[2, one] - point[2, other])
        )
        if square - rival_square[n] > 2.0 * half * apart + SLACK:
            nearer += 1
            if nearer == NEAREST:
                return True
    return False


@kernel
def list_candidates(
    point: Any,
    centre: Any,
    half: float,
    parent: Any,
    candidate: Any,
    start: Any,
    square: Any,
    rival: Any,
    rival_square: Any,
    out_candidate: Any,
    out_start: Any,
) -> None:
    """List the points that can be among the four nearest of a place, for each of many cubes.

    Parameters
    ----------
    point : (3, P) float64
        m.
    centre : (C, 3) float64
        Centres of the cubes, m.
    half : float
        Half their edge, m.
    parent : (C,) int64
        List of candidates that each cube begins with: those of a cube around it.
    candidate : (N,) int32
        Points of all these lists.
    start : (L + 1,) int64
        First candidate of each list.
    square : (P,) float64
        Scratch.
    rival : (16,) int32
        Scratch.
    rival_square : (16,) float64
        Scratch.
    out_candidate : (M,) int32
        Written: points of the cubes' lists, in the order of the parents'; M at least the sum of the lengths
        of all cubes' parents.
    out_start : (C + 1,) int64
        Written: first point of each cube's list.

    Notes
    -----
    The difference of the squared distances to two points is linear in the place, so that its least value in
    a cube is that of the centre, less half the edge times twice the distance of the points summed over the
    axes.
    Lists may hold a few points too many, as each is compared with some others only.
    """
    out_start[0] = 0
    for cube in range(centre.shape[0]):
        own = candidate[start[parent[cube]] : start[parent[cube] + 1]]
        rivals = choose_rivals(
            point, centre[cube, 0], centre[cube, 1], centre[cube, 2], own, square, rival, rival_square
        )
        end = out_start[cube]
        for i in range(own.shape[0]):
            if not is_beaten(point, own[i], square[i], half, rival, rival_square, rivals):
                out_candidate[end] = own[i]
                end += 1
        out_start[cube + 1] = end
