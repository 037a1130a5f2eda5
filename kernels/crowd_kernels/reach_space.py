"""Look-up of reach examples: the nearest pseudo-examples of a hand position, and the examples they blend.

A space holds several sets (hand, standing or seated). The space around the points of a set is divided into
cubes, coarse ones where few points come into question and finer ones where there are many. Each cube lists
all points that are among the four nearest of any place inside, so that a look-up is one scan without search.
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
FAR = math.inf
"""Key of no point; its lowest bits are 0, the first place in a list."""
COARSEST = 0.2
"""Edge of the coarsest cubes, m."""
HALVINGS = 2
"""How often a cube may be halved in all directions."""
DIVISIONS = 1 << HALVINGS
"""Finest cubes along the edge of a coarsest one."""
PLACE_BITS = 0xFFFF
"""Bits of a squared distance that give way to a place in a list; the others are exact to 2e-11."""
LANES = 16
"""Columns in which squared distances are sorted, each by itself."""
BLOCK = 2 * LANES
"""Points that are measured before they are sorted in."""
MEASURED = NEAREST * LANES
"""Place of new squared distances in the scratch; before it stand the smallest four of each column."""
DISTANCE = MEASURED + BLOCK
"""Place of the distances of the nearest points."""
SCRATCH = DISTANCE + NEAREST
NUMBERS = NEAREST + NEAREST * BLENDED
"""Length of the scratch for numbers: the nearest points and all that they blend."""


class ReachArrays(NamedTuple):
    """Sets of pseudo-examples as the kernel reads them; P points of all sets one after the other."""

    point: npt.NDArray[np.float64]
    """(P, 4) Hand position at the apex, m, and 0, so that no point lies across cache lines."""
    clip: npt.NDArray[np.int32]
    """(P, 4) Examples that are blended, numbered over all sets."""
    weight: npt.NDArray[np.float64]
    """(P, 4) Their weights: not negative, sum 1."""
    low: npt.NDArray[np.float64]
    """(S, 3) Lowest corner of the space in which places are looked up, m."""
    high: npt.NDArray[np.float64]
    """(S, 3) Highest corner, m."""
    along: npt.NDArray[np.int32]
    """(S, 3) Coarsest cubes along each axis."""
    first_cube: npt.NDArray[np.int32]
    """(S,) Row of `cube` of each set's first coarsest cube."""
    cube: npt.NDArray[np.int32]
    """(C, 2) Coarsest cubes, x innermost: the first list, and by how many bits the place among all finest
    cubes inside, in Morton order, is shifted to the right to get the place among those that have a list."""
    start: npt.NDArray[np.int32]
    """(L + 1,) First candidate of each list; at least one, or four where the set has so many."""
    candidate: npt.NDArray[np.unsignedinteger[Any]]
    """(N + 32,) Points of all lists, 16 bits each where these suffice; the last ones are spare."""


@inlined_kernel
def list_around(arrays: ReachArrays, part: int, x: float, y: float, z: float) -> int:
    """Find the list of candidates of the cube around a place within the space of a set."""
    finest = DIVISIONS / COARSEST
    nx, ny, nz = int(arrays.along[part, 0]), int(arrays.along[part, 1]), int(arrays.along[part, 2])
    i = min(max(int((x - arrays.low[part, 0]) * finest), 0), DIVISIONS * nx - 1)
    j = min(max(int((y - arrays.low[part, 1]) * finest), 0), DIVISIONS * ny - 1)
    k = min(max(int((z - arrays.low[part, 2]) * finest), 0), DIVISIONS * nz - 1)
    cube = arrays.first_cube[part] + ((k >> HALVINGS) * ny + (j >> HALVINGS)) * nx + (i >> HALVINGS)
    inside = 0
    for bit in range(HALVINGS):
        octant = (i >> bit & 1) | (j >> bit & 1) << 1 | (k >> bit & 1) << 2
        inside |= octant << 3 * bit
    return int(arrays.cube[cube, 0] + (inside >> arrays.cube[cube, 1]))


@inlined_kernel
def sort_in(keys: Any) -> None:
    """Sort a block of new keys into the four smallest of each column.

    Parameters
    ----------
    keys : (>= 96,) float64
        In and out: four rows of 16 columns, smallest first, then two rows of new keys, any order.

    Notes
    -----
    Of two sorted lists, the smaller ones of each key and its counterpart from the other end are the smallest;
    they first fall, then rise, or the other way round, and two rounds of comparisons sort them.

    **Source:** Batcher, "Sorting networks and their applications", 1968.
    """
    for lane in range(LANES):
        one, other = keys[MEASURED + lane], keys[MEASURED + LANES + lane]
        a = keys[lane]
        b = keys[LANES + lane]
        c = min(keys[2 * LANES + lane], max(one, other))
        d = min(keys[3 * LANES + lane], min(one, other))
        a, c = min(a, c), max(a, c)
        b, d = min(b, d), max(b, d)
        keys[lane], keys[LANES + lane] = min(a, b), max(a, b)
        keys[2 * LANES + lane], keys[3 * LANES + lane] = min(c, d), max(c, d)


@inlined_kernel
def fold_columns(keys: Any, width: int) -> None:
    """Merge each of the first columns with the one so many columns on; notes as `sort_in`."""
    for lane in range(width):
        other = lane + width
        a = min(keys[lane], keys[3 * LANES + other])
        b = min(keys[LANES + lane], keys[2 * LANES + other])
        c = min(keys[2 * LANES + lane], keys[LANES + other])
        d = min(keys[3 * LANES + lane], keys[other])
        a, c = min(a, c), max(a, c)
        b, d = min(b, d), max(b, d)
        keys[lane], keys[LANES + lane] = min(a, b), max(a, b)
        keys[2 * LANES + lane], keys[3 * LANES + lane] = min(c, d), max(c, d)


@inlined_kernel
def square_to(point: Any, x: float, y: float, z: float) -> float:
    """Find the square of the distance from a place to a point (4,)."""
    dx, dy, dz = point[0] - x, point[1] - y, point[2] - z
    return float(dx * dx + dy * dy + dz * dz)


@inlined_kernel
def nearest_points(
    arrays: ReachArrays,
    part: int,
    x: float,
    y: float,
    z: float,
    keys: Any,
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
        Place within the space of the set, m.
    keys : (>= 96,) float64
        Scratch.
    out_point : (>= 4,) int32
        Written: the points.
    out_distance : (>= 4,) float64
        Written: their distances, m.

    Returns
    -------
    int
        How many there are: 4, or all points of a smaller set.

    Notes
    -----
    A search in a tree takes most of its time for mispredicted branches, as each is as likely as the other.
    Here all candidates are measured, and the smallest are sorted out by minima and maxima of numbers that
    hold the squared distance in the high bits and the place in the list in the low ones.
    """
    entry = list_around(arrays, part, x, y, z)
    first = int(arrays.start[entry])
    count = int(arrays.start[entry + 1]) - first
    for key in range(MEASURED):
        keys[key] = FAR
    begin = 0
    while begin < count:
        block = arrays.candidate[first + begin : first + begin + BLOCK]
        for i in range(BLOCK):
            keys[MEASURED + i] = FAR
        for i in range(min(count - begin, BLOCK)):
            square = np.float64(square_to(arrays.point[block[i]], x, y, z))
            keys[MEASURED + i] = np.int64(square.view(np.int64) & ~PLACE_BITS | begin + i).view(np.float64)
        sort_in(keys)
        begin += BLOCK
    fold_columns(keys, 8)
    fold_columns(keys, 4)
    fold_columns(keys, 2)
    fold_columns(keys, 1)
    found = min(count, NEAREST)
    for n in range(found):
        place = np.float64(keys[n * LANES]).view(np.int64) & PLACE_BITS
        point = arrays.candidate[first + place]
        out_point[n] = point
        out_distance[n] = math.sqrt(square_to(arrays.point[point], x, y, z))
    return found


@inlined_kernel
def weigh_examples(
    arrays: ReachArrays,
    part: int,
    x: float,
    y: float,
    z: float,
    number: Any,
    real: Any,
    out_weight: Any,
) -> int:
    """Find the weights of the examples to blend for a hand position.

    Parameters
    ----------
    arrays : ReachArrays
    part : int
        Set.
    x, y, z : float
        Hand position at the library's size, m.
    number : (20,) int32
        Scratch; the examples are written from `NEAREST` on, some of them more than once.
    real : (>= 100,) float64
        Scratch.
    out_weight : (E,) float64
        In and out: to the weights of all examples those of the ones found are added: not negative, sum 1.

    Returns
    -------
    int
        How many examples are written, 4 to 16.
    """
    x = min(max(x, arrays.low[part, 0]), arrays.high[part, 0])
    y = min(max(y, arrays.low[part, 1]), arrays.high[part, 1])
    z = min(max(z, arrays.low[part, 2]), arrays.high[part, 2])
    distance = real[DISTANCE:SCRATCH]
    found = nearest_points(arrays, part, x, y, z, real, number, distance)
    for n in range(found):
        distance[n] = 1.0 / max(distance[n], EXACT)
    least = distance[found - 1] if found == NEAREST else 0.0
    total = 0.0
    for n in range(found):
        total += max(distance[n] - least, 0.0)
    # The fourth has no weight, but where all are equally far, as from a circle's centre, they share.
    sharing = min(found, NEAREST - 1) if total > 0.0 else found
    for n in range(sharing):
        share = max(distance[n] - least, 0.0) / total if total > 0.0 else 1.0 / found
        point = number[n]
        for b in range(BLENDED):
            clip = arrays.clip[point, b]
            out_weight[clip] += share * arrays.weight[point, b]
            number[NEAREST + n * BLENDED + b] = clip
    return sharing * BLENDED


@inlined_kernel
def find_examples(
    arrays: ReachArrays,
    part: int,
    x: float,
    y: float,
    z: float,
    number: Any,
    real: Any,
    out_clip: Any,
    out_weight: Any,
) -> int:
    """Find the examples to blend for a hand position, each once.

    Parameters
    ----------
    arrays : ReachArrays
    part : int
        Set.
    x, y, z : float
        Hand position at the library's size, m.
    number : (20,) int32
        Scratch.
    real : (100 + E,) float64
        Scratch; 0 from `SCRATCH` on before and after.
    out_clip : (12,) int32
        Written: examples; those after the last one have no meaning.
    out_weight : (12,) float64
        Written: their weights: positive, sum 1.

    Returns
    -------
    int
        Number of examples, 1 to 12.
    """
    whole = real[SCRATCH:]
    samples = weigh_examples(arrays, part, x, y, z, number, real, whole)
    count = 0
    for sample in range(NEAREST, NEAREST + samples):
        clip = number[sample]
        weight = whole[clip]
        whole[clip] = 0.0
        # What has no weight, or has it no longer, is written over by the next one.
        if count < MOST_SAMPLES:
            out_clip[count] = clip
            out_weight[count] = weight
        count = min(count + int(weight > 0.0), MOST_SAMPLES)
    return count


@parallel_kernel
def find_examples_crowd(
    arrays: ReachArrays,
    part: Any,
    position: Any,
    number: Any,
    real: Any,
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
    number : (32, 20) int32
        Scratch of each chunk.
    real : (32, 100 + E) float64
        Scratch of each chunk; 0 from `SCRATCH` on before and after.
    out_clip : (N, 12) int32
        Examples.
    out_weight : (N, 12) float64
        Their weights; those after the last example have no meaning.
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
                number[chunk],
                real[chunk],
                out_clip[item],
                out_weight[item],
            )
