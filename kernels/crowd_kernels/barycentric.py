"""Barycentric look-up in a tessellated parameter space, with a nearby inside point for what lies outside."""

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from crowd_kernels._jit import inlined_kernel, kernel, parallel_kernel, prange
from crowd_kernels.triangle import nearest_on_triangle

CHUNKS = 32
EDGE = 1e-7
FARTHEST = 1e3


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
    hull_face: npt.NDArray[np.int32]
    """(F, 3) Examples at the corners of the triangles around the convex hull."""
    hull_plane: npt.NDArray[np.float64]
    """(F, 4) Outward unit normal of each triangle, and the offset that makes the plane 0 on it."""
    centre: npt.NDArray[np.float64]
    """(3,) Point that sees the whole surface of the tessellation."""
    cone_face: npt.NDArray[np.int32]
    """(B, 3) Examples at the corners of the triangles around the tessellation; none if it fills the hull."""
    cone_inverse: npt.NDArray[np.float64]
    """(B, 9) Row-major inverse of the matrix of directions from `centre` to those corners."""
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


@inlined_kernel
def scaled(value: float, scale: float) -> float:
    """Divide by a scale and bring what is far nearer, so that squares stay finite."""
    return min(max(value / scale, -FARTHEST), FARTHEST)


@inlined_kernel
def simplex_weights(
    simplex: Any, inverse: Any, example: Any, number: int, x: float, y: float, z: float
) -> tuple[float, float, float, float]:
    """Find the barycentric weights of a point in one tetrahedron; they sum to 1 and may be negative."""
    last = simplex[number, 3]
    dx = x - example[last, 0]
    dy = y - example[last, 1]
    dz = z - example[last, 2]
    a = inverse[number, 0] * dx + inverse[number, 1] * dy + inverse[number, 2] * dz
    b = inverse[number, 3] * dx + inverse[number, 4] * dy + inverse[number, 5] * dz
    c = inverse[number, 6] * dx + inverse[number, 7] * dy + inverse[number, 8] * dz
    return a, b, c, 1.0 - a - b - c


@inlined_kernel
def find_simplex(
    simplex: Any,
    inverse: Any,
    example: Any,
    grid_origin: Any,
    grid_scale: Any,
    grid_shape: Any,
    cell_start: Any,
    cell_simplex: Any,
    x: float,
    y: float,
    z: float,
) -> int:
    """Find the tetrahedron that contains a point; -1 when none does. Arrays as in `SpaceArrays`."""
    i = math.floor((x - grid_origin[0]) * grid_scale[0])
    j = math.floor((y - grid_origin[1]) * grid_scale[1])
    k = math.floor((z - grid_origin[2]) * grid_scale[2])
    if i < 0 or j < 0 or k < 0 or i >= grid_shape[0] or j >= grid_shape[1] or k >= grid_shape[2]:
        return -1
    cell = (int(i) * grid_shape[1] + int(j)) * grid_shape[2] + int(k)
    best = -1
    best_margin = -EDGE
    for entry in range(cell_start[cell], cell_start[cell + 1]):
        number = cell_simplex[entry]
        a, b, c, d = simplex_weights(simplex, inverse, example, number, x, y, z)
        margin = min(min(a, b), min(c, d))
        if margin >= 0.0:
            return int(number)
        if margin > best_margin:
            best_margin = margin
            best = int(number)
    return best


@kernel
def on_face(
    face: Any, example: Any, number: int, x: float, y: float, z: float
) -> tuple[float, float, float, float]:
    """Find the point of one triangle nearest to a point, and the square of their distance."""
    a = face[number, 0]
    b = face[number, 1]
    c = face[number, 2]
    u, v, w = nearest_on_triangle(
        x, y, z,
        example[a, 0], example[a, 1], example[a, 2],
        example[b, 0], example[b, 1], example[b, 2],
        example[c, 0], example[c, 1], example[c, 2],
    )  # fmt: skip
    on_x = u * example[a, 0] + v * example[b, 0] + w * example[c, 0]
    on_y = u * example[a, 1] + v * example[b, 1] + w * example[c, 1]
    on_z = u * example[a, 2] + v * example[b, 2] + w * example[c, 2]
    return on_x, on_y, on_z, (on_x - x) ** 2 + (on_y - y) ** 2 + (on_z - z) ** 2


@kernel
def nearest_on_hull(
    hull_face: Any, hull_plane: Any, example: Any, x: float, y: float, z: float
) -> tuple[float, float, float]:
    """Find the point of the convex hull that is nearest to a point.

    A triangle is no nearer than its plane, so the triangle of the farthest plane comes first, and others
    are tried only while their planes are nearer than the best point so far.
    """
    first = -1
    largest = 0.0
    for face in range(hull_plane.shape[0]):
        height = (
            hull_plane[face, 0] * x + hull_plane[face, 1] * y + hull_plane[face, 2] * z + hull_plane[face, 3]
        )
        if height > largest:
            largest = height
            first = face
    if first < 0:
        return x, y, z
    near_x, near_y, near_z, best = on_face(hull_face, example, first, x, y, z)
    if best <= largest * largest * (1.0 + 1e-12):
        return near_x, near_y, near_z
    for face in range(hull_plane.shape[0]):
        height = (
            hull_plane[face, 0] * x + hull_plane[face, 1] * y + hull_plane[face, 2] * z + hull_plane[face, 3]
        )
        if height > 0.0 and height * height < best and face != first:
            on_x, on_y, on_z, square = on_face(hull_face, example, face, x, y, z)
            if square < best:
                best = square
                near_x = on_x
                near_y = on_y
                near_z = on_z
    return near_x, near_y, near_z


@kernel
def towards_centre(
    centre: Any, cone_inverse: Any, x: float, y: float, z: float
) -> tuple[int, float, float, float]:
    """Find where the line from the centre to a point leaves the tessellation.

    Returns
    -------
    tuple
        Row of `SpaceArrays.cone_face` and the barycentric weights of the place on it.
    """
    dx = x - centre[0]
    dy = y - centre[1]
    dz = z - centre[2]
    best = 0
    best_margin = -math.inf
    best_u = 1.0
    best_v = 0.0
    best_w = 0.0
    for cone in range(cone_inverse.shape[0]):
        u = cone_inverse[cone, 0] * dx + cone_inverse[cone, 1] * dy + cone_inverse[cone, 2] * dz
        v = cone_inverse[cone, 3] * dx + cone_inverse[cone, 4] * dy + cone_inverse[cone, 5] * dz
        w = cone_inverse[cone, 6] * dx + cone_inverse[cone, 7] * dy + cone_inverse[cone, 8] * dz
        total = u + v + w
        if total > 0.0:
            margin = min(min(u, v), w) / total
            if margin > best_margin:
                best_margin = margin
                best = cone
                best_u = u / total
                best_v = v / total
                best_w = w / total
    return best, best_u, best_v, best_w


@kernel
def locate_chunk(
    space: SpaceArrays,
    parameter: Any,
    active: Any,
    begin: int,
    end: int,
    out_example: Any,
    out_weight: Any,
    out_cycle_rate: Any,
    out_parameter: Any,
    out_is_inside: Any,
) -> None:
    """Process one run of active characters; arguments as in `locate_crowd`."""
    # Fields are read once: passing the whole tuple on costs more than a look-up.
    axis_range, cycle_duration, example = space.axis_range, space.cycle_duration, space.example
    simplex, inverse = space.simplex, space.inverse
    grid_origin, grid_scale, grid_shape = space.grid_origin, space.grid_scale, space.grid_shape
    cell_start, cell_simplex = space.cell_start, space.cell_simplex
    hull_face, hull_plane = space.hull_face, space.hull_plane
    centre, cone_face, cone_inverse = space.centre, space.cone_face, space.cone_inverse
    for index in range(begin, end):
        row = active[index]
        forward = parameter[row, 0]
        turn = parameter[row, 1]
        side = parameter[row, 2]
        is_number = not (math.isnan(forward) or math.isnan(turn) or math.isnan(side))
        x = scaled(forward, axis_range[0]) if is_number else 0.0
        y = scaled(turn, axis_range[1]) if is_number else 0.0
        z = scaled(side, axis_range[2]) if is_number else 0.0
        number = find_simplex(
            simplex, inverse, example, grid_origin, grid_scale, grid_shape, cell_start, cell_simplex, x, y, z
        )
        out_is_inside[row] = number >= 0 and is_number
        if number < 0:
            x, y, z = nearest_on_hull(hull_face, hull_plane, example, x, y, z)
            number = find_simplex(
                simplex,
                inverse,
                example,
                grid_origin,
                grid_scale,
                grid_shape,
                cell_start,
                cell_simplex,
                x,
                y,
                z,
            )
        if number >= 0:
            a, b, c, d = simplex_weights(simplex, inverse, example, number, x, y, z)
            first = simplex[number, 0]
            second = simplex[number, 1]
            third = simplex[number, 2]
            fourth = simplex[number, 3]
        else:
            number, a, b, c = towards_centre(centre, cone_inverse, x, y, z)
            d = 0.0
            first = cone_face[number, 0]
            second = cone_face[number, 1]
            third = cone_face[number, 2]
            fourth = first
        a = max(a, 0.0)
        b = max(b, 0.0)
        c = max(c, 0.0)
        d = max(d, 0.0)
        share = 1.0 / (a + b + c + d)
        a *= share
        b *= share
        c *= share
        d *= share
        for axis in range(3):
            out_parameter[row, axis] = axis_range[axis] * (
                a * example[first, axis]
                + b * example[second, axis]
                + c * example[third, axis]
                + d * example[fourth, axis]
            )
        a /= cycle_duration[first]
        b /= cycle_duration[second]
        c /= cycle_duration[third]
        d /= cycle_duration[fourth]
        rate = a + b + c + d
        out_example[row, 0] = first
        out_example[row, 1] = second
        out_example[row, 2] = third
        out_example[row, 3] = fourth
        out_weight[row, 0] = a / rate
        out_weight[row, 1] = b / rate
        out_weight[row, 2] = c / rate
        out_weight[row, 3] = d / rate
        out_cycle_rate[row] = rate


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
        Forward speed m/s, turn rate rad/s, side speed m/s. With a NaN in it, a row counts as rest.
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
        1 inside the tessellation, 0 outside or not a number.

    Notes
    -----
    **Source:** Feng, Xu, Shapiro, section 4.1, tetrahedra with barycentric weights.
    **Differs from the source:** weights are valid and continuous everywhere. Points outside go to the nearest
    point of the convex hull; where the tessellation falls short of the hull, straight on towards its centre.
    A blend of examples of unequal cycle duration D realises sum(w D p) / sum(w D), so pose weights are
    w = (u / D) / sum(u / D) from barycentric u, and the cycle rate is sum(u / D).
    """
    count = active.shape[0]
    for k in prange(CHUNKS):
        chunk = (k * 37) % CHUNKS
        locate_chunk(
            space,
            parameter,
            active,
            chunk * count // CHUNKS,
            (chunk + 1) * count // CHUNKS,
            out_example,
            out_weight,
            out_cycle_rate,
            out_parameter,
            out_is_inside,
        )
