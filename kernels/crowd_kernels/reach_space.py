"""Look-up of reach examples: the nearest pseudo-examples of a hand position, and the examples they blend.

A space holds several sets (hand, standing or seated). The points of a set are in the leaves of a balanced
k-d tree: node n has the children 2 n and 2 n + 1, and all leaves are equally deep.
"""

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from crowd_kernels._jit import inlined_kernel, parallel_kernel, prange

CHUNKS = 32
NEAREST = 4
BLENDED = 4
"""Examples that one pseudo-example blends."""
MOST_SAMPLES = 12
"""Most examples of a look-up: three of the four nearest have a weight."""
EXACT = 1e-6
"""Distance at which a point takes all the weight, m."""
FAR = 1e30
LEAF_POINTS = 16
"""Most points in a leaf."""
STACK = 8
"""Place of the open nodes in the scratch; before it stand the nearest points."""
LEAF = 32
"""Place of the distances within a leaf."""
SCRATCH = LEAF + LEAF_POINTS


class ReachArrays(NamedTuple):
    """Sets of pseudo-examples as the kernel reads them; P points of all sets one after the other."""

    point: npt.NDArray[np.float64]
    """(3, P) Hand position at the apex, m."""
    clip: npt.NDArray[np.int32]
    """(P, 4) Examples that are blended, numbered over all sets."""
    weight: npt.NDArray[np.float64]
    """(P, 4) Their weights: not negative, sum 1."""
    low: npt.NDArray[np.float64]
    """(S, 3) Lowest corner of the space in which places are looked up, m."""
    high: npt.NDArray[np.float64]
    """(S, 3) Highest corner, m."""
    first_node: npt.NDArray[np.int32]
    """(S,) Row of `box` before the root of each set's tree."""
    leaf_count: npt.NDArray[np.int32]
    """(S,) Leaves of each tree, a power of two."""
    box: npt.NDArray[np.float64]
    """(nodes, 6) Lowest and highest coordinates of the points below each node, m."""
    leaf_start: npt.NDArray[np.int32]
    """(nodes + 1,) First point of a leaf; only rows of leaves are used, and the row after the last one."""


@inlined_kernel
def box_square(box: Any, node: int, x: float, y: float, z: float) -> float:
    """Find the square of the distance from a place to the box of a node."""
    dx = max(max(box[node, 0] - x, x - box[node, 3]), 0.0)
    dy = max(max(box[node, 1] - y, y - box[node, 4]), 0.0)
    dz = max(max(box[node, 2] - z, z - box[node, 5]), 0.0)
    return float(dx * dx + dy * dy + dz * dz)


@inlined_kernel
def nearest_points(
    arrays: ReachArrays,
    part: int,
    x: float,
    y: float,
    z: float,
    out_point: Any,
    out_distance: Any,
) -> int:
    """Find the four points nearest to a place, nearest first.

    Parameters
    ----------
    arrays : ReachArrays
    part : int
        Set.
    x, y, z : float
        Place, m.
    out_point : (48,) int32
        Written: the points in the first four; the rest is scratch.
    out_distance : (48,) float64
        Written: their distances, m; the rest is scratch.

    Returns
    -------
    int
        How many there are: 4, or all points of a smaller set.

    Notes
    -----
    **Source:** Friedman, Bentley, Finkel, "An algorithm for finding best matches in logarithmic expected
    time", 1977.
    **Differs from the source:** nodes have tight boxes, which also prune well for places outside.
    """
    root = arrays.first_node[part]
    first_leaf = arrays.leaf_count[part]
    d0 = d1 = d2 = d3 = FAR
    p0 = p1 = p2 = p3 = -1
    count = 0
    out_point[STACK] = 1
    out_distance[STACK] = 0.0
    top = STACK + 1
    while top > STACK:
        top -= 1
        node = int(out_point[top])
        if out_distance[top] >= d3:
            continue
        while node < first_leaf:
            node = 2 * node
            near = box_square(arrays.box, root + node, x, y, z)
            far = box_square(arrays.box, root + node + 1, x, y, z)
            other = node + 1
            if far < near:
                near, far = far, near
                node, other = other, node
            if far < d3:
                out_point[top] = other
                out_distance[top] = far
                top += 1
        first = arrays.leaf_start[root + node]
        inside = arrays.leaf_start[root + node + 1] - first
        count += inside
        for i in range(inside):
            dx = arrays.point[0, first + i] - x
            dy = arrays.point[1, first + i] - y
            dz = arrays.point[2, first + i] - z
            out_distance[LEAF + i] = dx * dx + dy * dy + dz * dz
        for i in range(inside):
            d = out_distance[LEAF + i]
            if d < d3:
                p = first + i
                if d < d1:
                    d3, p3, d2, p2 = d2, p2, d1, p1
                    if d < d0:
                        d1, p1, d0, p0 = d0, p0, d, p
                    else:
                        d1, p1 = d, p
                elif d < d2:
                    d3, p3, d2, p2 = d2, p2, d, p
                else:
                    d3, p3 = d, p
    out_point[0], out_point[1], out_point[2], out_point[3] = p0, p1, p2, p3
    out_distance[0], out_distance[1] = math.sqrt(d0), math.sqrt(d1)
    out_distance[2], out_distance[3] = math.sqrt(d2), math.sqrt(d3)
    return min(count, NEAREST)


@inlined_kernel
def find_examples(
    arrays: ReachArrays,
    part: int,
    x: float,
    y: float,
    z: float,
    near: Any,
    distance: Any,
    out_clip: Any,
    out_weight: Any,
) -> int:
    """Find the examples to blend for a hand position.

    Parameters
    ----------
    arrays : ReachArrays
    part : int
        Set.
    x, y, z : float
        Hand position at the library's size, m.
    near : (48,) int32
        Scratch.
    distance : (48,) float64
        Scratch.
    out_clip : (>= 12,) int32
        Written: examples, each once.
    out_weight : (>= 12,) float64
        Written: their weights: positive, sum 1.

    Returns
    -------
    int
        Number of examples, 1 to 12.
    """
    x = min(max(x, arrays.low[part, 0]), arrays.high[part, 0])
    y = min(max(y, arrays.low[part, 1]), arrays.high[part, 1])
    z = min(max(z, arrays.low[part, 2]), arrays.high[part, 2])
    found = nearest_points(arrays, part, x, y, z, near, distance)
    least = 1.0 / max(distance[found - 1], EXACT) if found == NEAREST else 0.0
    total = 0.0
    for n in range(found):
        total += 1.0 / max(distance[n], EXACT) - least
    count = 0
    for n in range(found):
        # Where all are equally far, as from a circle's centre, they share.
        share = (1.0 / max(distance[n], EXACT) - least) / total if total > 0.0 else 1.0 / found
        if not share > 0.0:
            continue
        for b in range(BLENDED):
            weight = share * arrays.weight[near[n], b]
            if not weight > 0.0:
                continue
            clip = arrays.clip[near[n], b]
            place = 0
            while place < count and out_clip[place] != clip:
                place += 1
            if place == count:
                if count == MOST_SAMPLES:
                    continue
                out_clip[count] = clip
                out_weight[count] = 0.0
                count += 1
            out_weight[place] += weight
    return count


@parallel_kernel
def find_examples_crowd(
    arrays: ReachArrays,
    part: Any,
    position: Any,
    near: Any,
    distance: Any,
    out_clip: Any,
    out_weight: Any,
    out_count: Any,
) -> None:
    """Find the examples to blend for many hand positions.

    Parameters
    ----------
    arrays : ReachArrays
    part : (N,) int32
        Set of each position, 0 to S - 1.
    position : (N, 3) float64
        Hands at the library's size, m.
    near : (32, 48) int32
        Scratch of each chunk.
    distance : (32, 48) float64
        Scratch of each chunk.
    out_clip : (N, 12) int32
        Examples.
    out_weight : (N, 12) float64
        Their weights; those after the last example are not written.
    out_count : (N,) int32
        Number of examples.

    Notes
    -----
    Weights are w_j = (1 / d_j - 1 / d_4)+, scaled to sum 1: a point that is met takes all, and a neighbour
    enters or leaves the four nearest with weight 0, so that moving positions get continuous weights.

    **Source:** Feng, Xu, Shapiro, section 5.1, after Kovar, Gleicher, "Automated extraction and
    parameterization of motions in large data sets", 2004, section 5.
    **Differs from the source:** plain distances.
    """
    count = position.shape[0]
    for k in prange(CHUNKS):
        chunk = (k * 37) % CHUNKS
        for item in range(chunk * count // CHUNKS, (chunk + 1) * count // CHUNKS):
            out_count[item] = find_examples(
                arrays,
                part[item],
                position[item, 0],
                position[item, 1],
                position[item, 2],
                near[chunk],
                distance[chunk],
                out_clip[item],
                out_weight[item],
            )
