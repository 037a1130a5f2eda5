"""Barycentric look-up in a tessellated parameter space, with the nearest point for what lies outside."""

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from crowd_kernels._jit import kernel, parallel_kernel, prange

CHUNKS = 32
EDGE = 1e-9


class SpaceArrays(NamedTuple):
    """A tessellation as the kernel reads it; coordinates are parameters divided by `axis_range`."""

    axis_range: npt.NDArray[np.float64]
    """(3,) Scale of each axis."""
    example: npt.NDArray[np.float64]
    """(E, 3) Scaled parameters of the examples."""
    cycle_duration: npt.NDArray[np.float64]
    """(E,) Length of one gait cycle, s."""
    simplex: npt.NDArray[np.int32]
    """(S, 4) Examples at the corners of each tetrahedron."""
    inverse: npt.NDArray[np.float64]
    """(S, 9) Row-major inverse of the edge matrix from corner 3 to corners 0, 1, 2."""
    face: npt.NDArray[np.int32]
    """(F, 3) Examples at the corners of the boundary triangles."""
    grid_origin: npt.NDArray[np.float64]
    """(3,) Lowest corner of the look-up grid."""
    grid_scale: npt.NDArray[np.float64]
    """(3,) Cells per unit."""
    grid_shape: npt.NDArray[np.int64]
    """(3,) Cells along each axis."""
    cell_start: npt.NDArray[np.int32]
    """(cells + 1,) First candidate of each cell."""
    cell_simplex: npt.NDArray[np.int32]
    """Tetrahedra that touch each cell."""


@kernel
def nearest_on_triangle(
    px: float,
    py: float,
    pz: float,
    ax: float,
    ay: float,
    az: float,
    bx: float,
    by: float,
    bz: float,
    cx: float,
    cy: float,
    cz: float,
) -> tuple[float, float, float]:
    """Find the barycentric weights of the point of triangle a, b, c nearest to p.

    Parameters
    ----------
    px, py, pz, ax, ay, az, bx, by, bz, cx, cy, cz : float
        Coordinates.

    Returns
    -------
    tuple of float
        Weights of a, b, c: all >= 0, sum 1.

    Notes
    -----
    **Source:** Ericson, Real-Time Collision Detection, 2005, section 5.1.5 (regions of the triangle).
    """
    abx, aby, abz = bx - ax, by - ay, bz - az
    acx, acy, acz = cx - ax, cy - ay, cz - az
    apx, apy, apz = px - ax, py - ay, pz - az
    d1 = abx * apx + aby * apy + abz * apz
    d2 = acx * apx + acy * apy + acz * apz
    if d1 <= 0.0 and d2 <= 0.0:
        return 1.0, 0.0, 0.0
    bpx, bpy, bpz = px - bx, py - by, pz - bz
    d3 = abx * bpx + aby * bpy + abz * bpz
    d4 = acx * bpx + acy * bpy + acz * bpz
    if d3 >= 0.0 and d4 <= d3:
        return 0.0, 1.0, 0.0
    vc = d1 * d4 - d3 * d2
    if vc <= 0.0 and d1 >= 0.0 and d3 <= 0.0:
        t = d1 / (d1 - d3)
        return 1.0 - t, t, 0.0
    cpx, cpy, cpz = px - cx, py - cy, pz - cz
    d5 = abx * cpx + aby * cpy + abz * cpz
    d6 = acx * cpx + acy * cpy + acz * cpz
    if d6 >= 0.0 and d5 <= d6:
        return 0.0, 0.0, 1.0
    vb = d5 * d2 - d1 * d6
    if vb <= 0.0 and d2 >= 0.0 and d6 <= 0.0:
        t = d2 / (d2 - d6)
        return 1.0 - t, 0.0, t
    va = d3 * d6 - d5 * d4
    if va <= 0.0 and d4 - d3 >= 0.0 and d5 - d6 >= 0.0:
        t = (d4 - d3) / ((d4 - d3) + (d5 - d6))
        return 0.0, 1.0 - t, t
    scale = 1.0 / (va + vb + vc)
    v = vb * scale
    w = vc * scale
    return max(1.0 - v - w, 0.0), v, w


@kernel
def simplex_weights(
    space: SpaceArrays, simplex: int, x: float, y: float, z: float
) -> tuple[float, float, float, float]:
    """Find the barycentric weights of a point in one tetrahedron; they sum to 1 and may be negative."""
    last = space.simplex[simplex, 3]
    dx = x - space.example[last, 0]
    dy = y - space.example[last, 1]
    dz = z - space.example[last, 2]
    a = space.inverse[simplex, 0] * dx + space.inverse[simplex, 1] * dy + space.inverse[simplex, 2] * dz
    b = space.inverse[simplex, 3] * dx + space.inverse[simplex, 4] * dy + space.inverse[simplex, 5] * dz
    c = space.inverse[simplex, 6] * dx + space.inverse[simplex, 7] * dy + space.inverse[simplex, 8] * dz
    return a, b, c, 1.0 - a - b - c


@kernel
def find_simplex(space: SpaceArrays, x: float, y: float, z: float) -> int:
    """Find the tetrahedron that contains a point; -1 when none does."""
    i = math.floor((x - space.grid_origin[0]) * space.grid_scale[0])
    j = math.floor((y - space.grid_origin[1]) * space.grid_scale[1])
    k = math.floor((z - space.grid_origin[2]) * space.grid_scale[2])
    if (
        i < 0
        or j < 0
        or k < 0
        or i >= space.grid_shape[0]
        or j >= space.grid_shape[1]
        or k >= space.grid_shape[2]
    ):
        return -1
    cell = (int(i) * space.grid_shape[1] + int(j)) * space.grid_shape[2] + int(k)
    best = -1
    best_margin = -EDGE
    for entry in range(space.cell_start[cell], space.cell_start[cell + 1]):
        simplex = space.cell_simplex[entry]
        a, b, c, d = simplex_weights(space, simplex, x, y, z)
        margin = min(min(a, b), min(c, d))
        if margin >= 0.0:
            return int(simplex)
        if margin > best_margin:
            best_margin = margin
            best = int(simplex)
    return best


@kernel
def nearest_face(space: SpaceArrays, x: float, y: float, z: float) -> tuple[int, float, float, float]:
    """Find the boundary triangle nearest to a point, and the weights of the nearest point on it."""
    best = -1
    best_square = math.inf
    best_u = 1.0
    best_v = 0.0
    best_w = 0.0
    for face in range(space.face.shape[0]):
        a = space.face[face, 0]
        b = space.face[face, 1]
        c = space.face[face, 2]
        u, v, w = nearest_on_triangle(
            x, y, z,
            space.example[a, 0], space.example[a, 1], space.example[a, 2],
            space.example[b, 0], space.example[b, 1], space.example[b, 2],
            space.example[c, 0], space.example[c, 1], space.example[c, 2],
        )  # fmt: skip
        dx = u * space.example[a, 0] + v * space.example[b, 0] + w * space.example[c, 0] - x
        dy = u * space.example[a, 1] + v * space.example[b, 1] + w * space.example[c, 1] - y
        dz = u * space.example[a, 2] + v * space.example[b, 2] + w * space.example[c, 2] - z
        square = dx * dx + dy * dy + dz * dz
        if square < best_square:
            best_square = square
            best = face
            best_u = u
            best_v = v
            best_w = w
    return best, best_u, best_v, best_w


@parallel_kernel
def locate_crowd(
    space: SpaceArrays,
    parameter: Any,
    active: Any,
    out_example: Any,
    out_weight: Any,
    out_cycle_rate: Any,
    out_parameter: Any,
    out_is_inside: Any,
) -> None:
    """Find the examples and weights that realise each character's parameters.

    Parameters
    ----------
    space : SpaceArrays
        Tessellated examples.
    parameter : (N, 3) float64
        Forward speed m/s, turn rate rad/s, side speed m/s. NaN counts as 0.
    active : (A,) int32
        Characters to process.
    out_example : (N, 4) int32
        Examples at the corners of the tetrahedron.
    out_weight : (N, 4) float64
        Weights of pose and keys: all >= 0, sum 1; calibrated, so that the blend realises `out_parameter`.
    out_cycle_rate : (N,) float64
        Gait cycles per second of the blend.
    out_parameter : (N, 3) float64
        The parameters themselves, or the nearest ones that the examples can realise.
    out_is_inside : (N,) uint8
        1 inside the hull.

    Notes
    -----
    **Source:** Feng, Xu, Shapiro, section 4.1, tetrahedra with barycentric weights.
    **Differs from the source:** points outside get the nearest inside point with valid weights; a blend of
    examples of unequal cycle duration D realises sum(w D p) / sum(w D), so pose weights are w = (u / D) /
    sum(u / D) from barycentric u, and the cycle rate is sum(u / D).
    """
    count = active.shape[0]
    for chunk_number in prange(CHUNKS):
        chunk = (chunk_number * 37) % CHUNKS
        for index in range(chunk * count // CHUNKS, (chunk + 1) * count // CHUNKS):
            character = active[index]
            x = parameter[character, 0] / space.axis_range[0]
            y = parameter[character, 1] / space.axis_range[1]
            z = parameter[character, 2] / space.axis_range[2]
            x = x if x == x else 0.0
            y = y if y == y else 0.0
            z = z if z == z else 0.0
            simplex = find_simplex(space, x, y, z)
            if simplex >= 0:
                a, b, c, d = simplex_weights(space, simplex, x, y, z)
                for corner in range(4):
                    out_example[character, corner] = space.simplex[simplex, corner]
                out_is_inside[character] = 1
            else:
                face, a, b, c = nearest_face(space, x, y, z)
                d = 0.0
                for corner in range(3):
                    out_example[character, corner] = space.face[face, corner]
                out_example[character, 3] = space.face[face, 0]
                out_is_inside[character] = 0
            a = max(a, 0.0)
            b = max(b, 0.0)
            c = max(c, 0.0)
            d = max(d, 0.0)
            total = a + b + c + d
            out_weight[character, 0] = a / total
            out_weight[character, 1] = b / total
            out_weight[character, 2] = c / total
            out_weight[character, 3] = d / total
            x = 0.0
            y = 0.0
            z = 0.0
            rate = 0.0
            for corner in range(4):
                example = out_example[character, corner]
                share = out_weight[character, corner]
                x += share * space.example[example, 0]
                y += share * space.example[example, 1]
                z += share * space.example[example, 2]
                share /= space.cycle_duration[example]
                out_weight[character, corner] = share
                rate += share
            for corner in range(4):
                out_weight[character, corner] /= rate
            out_cycle_rate[character] = rate
            out_parameter[character, 0] = x * space.axis_range[0]
            out_parameter[character, 1] = y * space.axis_range[1]
            out_parameter[character, 2] = z * space.axis_range[2]
