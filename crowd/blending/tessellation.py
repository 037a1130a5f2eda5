"""Tessellate points of the locomotion space, the same way in every quadrant, and check the result."""

from dataclasses import dataclass
from itertools import combinations

import numpy as np
import numpy.typing as npt
from scipy.spatial import ConvexHull

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int32]

PLANE_TOLERANCE = 1e-9
FLAT = 1e-6
"""A set of points thinner than this does not span the space."""
SLIVER = 1e-11
"""Least determinant of a tetrahedron that is kept."""
VOLUME_TOLERANCE = 1e-7
LEAST_COVER = 0.9
"""Least share of the convex hull that the four quadrants must fill."""
APEX = 20.0
TIE_BREAK = 1e-5
TIE_DIRECTION = np.array([7.0, 7.0 * np.sqrt(2.0), 7.0 * np.sqrt(3.0)])


@dataclass(frozen=True)
class Tessellation:
    """Tetrahedra over points.

    Attributes
    ----------
    simplex : (S, 4) int32
        Corners of each tetrahedron.
    hull_face : (F, 3) int32
        Triangles around the convex hull.
    hull_plane : (F, 4) float64
        Their outward unit normals and offsets.
    centre : (3,) float64
        Point from which the whole surface of the tessellation can be seen.
    cone_face : (B, 3) int32
        Triangles around the tessellation where it falls short of the hull, else none.
    """

    simplex: IntArray
    hull_face: IntArray
    hull_plane: FloatArray
    centre: FloatArray
    cone_face: IntArray


def tessellate(points: FloatArray) -> Tessellation | None:
    """Tessellate scaled points, quadrant by quadrant.

    The points of each quadrant (second coordinate >= 0 or <= 0, third likewise) are tessellated by
    themselves, with the points on the planes between them shared, so that no tetrahedron mixes opposite
    sides. Sets for which this leaves much of the hull empty, or that have nothing on the axis where the
    quadrants meet, are tessellated as a whole.

    Returns
    -------
    Tessellation or None
        None when the points do not span the space.
    """
    if is_flat(points):
        return None
    hull = ConvexHull(points)
    hull_face, hull_plane = hull.simplices.astype(np.int32), np.ascontiguousarray(hull.equations)
    parts = [delaunay(points, members) for members in quadrants(points)]
    simplex = np.concatenate([np.zeros((0, 4), np.int32), *parts])
    share = volumes(points, simplex).sum() / hull.volume
    if share > 1 - VOLUME_TOLERANCE:
        return Tessellation(simplex, hull_face, hull_plane, points.mean(axis=0), no_faces())
    on_axis = points[(np.abs(points[:, 1:]) <= PLANE_TOLERANCE).all(axis=1), 0]
    if share > LEAST_COVER and on_axis.size:
        centre = np.array([0.5 * (on_axis.min() + on_axis.max()), 0.0, 0.0])
        cone_face = boundary_faces(simplex)
        if sees_all(points, centre, cone_face, share * hull.volume):
            return Tessellation(simplex, hull_face, hull_plane, centre, cone_face)
    whole = delaunay(points, np.arange(len(points)))
    return Tessellation(whole, hull_face, hull_plane, points.mean(axis=0), no_faces())


def quadrants(points: FloatArray) -> list[npt.NDArray[np.intp]]:
    """Points of each quadrant that has any volume."""
    found = []
    for turn_side in (1.0, -1.0):
        for step_side in (1.0, -1.0):
            is_member = (turn_side * points[:, 1] >= -PLANE_TOLERANCE) & (
                step_side * points[:, 2] >= -PLANE_TOLERANCE
            )
            members = np.flatnonzero(is_member)
            if not is_flat(points[members]):
                found.append(members)
    return found


def is_flat(points: FloatArray) -> bool:
    """The points lie in one plane, or nearly so."""
    if len(points) < 4:
        return True
    spread = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    return bool(spread[-1] < FLAT)


def delaunay(points: FloatArray, members: npt.NDArray[np.intp]) -> IntArray:
    """Tessellate some of the points by the lower hull of their lifts; (S, 4) indices into all points.

    Points on one sphere have several Delaunay tessellations, and two quadrants could choose different ones
    on the plane between them. A small fixed term in the lift decides such ties by the point alone, equally
    for mirrored points, so that quadrants always agree.

    Notes
    -----
    **Source:** lifting and symbolic perturbation, Edelsbrunner, Geometry and Topology for Mesh Generation,
    2001, chapters 1 and 5.
    """
    own = points[members]
    unmirrored = np.column_stack([own[:, 0], np.abs(own[:, 1:])])
    lift = (own**2).sum(axis=1) + TIE_BREAK * np.sin(unmirrored @ TIE_DIRECTION)
    # A point high above gives the hull a volume, however alike the lifts are.
    apex = np.append(own.mean(axis=0), APEX)
    hull = ConvexHull(np.vstack([np.column_stack([own, lift]), apex]))
    is_lower = (hull.simplices < len(own)).all(axis=1) & (hull.equations[:, 3] < 0)
    simplex = members[hull.simplices[is_lower]]
    simplex = np.sort(simplex[volumes(points, simplex) * 6 > SLIVER], axis=1)
    return np.ascontiguousarray(simplex[np.lexsort(simplex.T[::-1])], dtype=np.int32)


def volumes(points: FloatArray, simplex: npt.NDArray[np.integer]) -> FloatArray:
    """Volume of each tetrahedron."""
    edges = points[simplex[:, :3]] - points[simplex[:, 3:]]
    return np.asarray(np.abs(np.linalg.det(edges)) / 6)


def boundary_faces(simplex: IntArray) -> IntArray:
    """Triangles that belong to one tetrahedron only; (F, 3) indices."""
    uses: dict[tuple[int, ...], int] = {}
    for cell in simplex:
        for face in combinations(sorted(int(corner) for corner in cell), 3):
            uses[face] = uses.get(face, 0) + 1
    return np.array([face for face, count in uses.items() if count == 1], dtype=np.int32).reshape(-1, 3)


def no_faces() -> IntArray:
    """An empty list of triangles."""
    return np.zeros((0, 3), dtype=np.int32)


def sees_all(points: FloatArray, centre: FloatArray, face: IntArray, volume: float) -> bool:
    """The cones from a centre to the faces of a body fill that body once, and none of them is flat."""
    cones = np.abs(np.linalg.det(points[face] - centre)) / 6
    return bool(cones.min() > SLIVER and abs(cones.sum() - volume) < VOLUME_TOLERANCE * volume)
