"""Things that people can grasp and carry: spheres, boxes, capsules and meshes, wherever they are."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from crowd.world.mesh import Mesh
from crowd.world.objects import Objects, ShapeKind
from crowd_viewer.frame import CrowdFrame
from crowd_viewer.programs import compile_program, set_units

if TYPE_CHECKING:
    import moderngl

FloatArray = npt.NDArray[np.float64]
Float32Array = npt.NDArray[np.float32]

AROUND, RINGS = 24, 7
"""Corners around a capsule, and rings from its pole to its middle."""
BEVEL = 0.06
"""Width of the slanted rim of a box, which catches light, as a share of half a side."""
CREASE = math.cos(math.radians(40.0))
"""Where triangles of a mesh meet at more than this angle there is an edge."""


class Things:
    """All objects of a scene on the graphics side.

    Parameters
    ----------
    context : moderngl.Context
    objects : Objects
    """

    def __init__(self, context: moderngl.Context, objects: Objects) -> None:
        self._groups: list[tuple[npt.NDArray[np.intp], moderngl.Buffer, list[moderngl.VertexArray]]] = []
        self._fixed = np.zeros((objects.count, 7), np.float32)
        if objects.count == 0:
            return
        self._fixed[:, :4] = sizes(objects)
        self._fixed[:, 4:] = objects.colour
        light = ("view.glsl", "lighting.glsl", "thing.frag")
        shaded = compile_program(context, ("view.glsl", "thing.vert"), light)
        set_units(shaded)
        plain = compile_program(context, ("view.glsl", "thing.vert"), ("plain.frag",))
        shapes = np.stack([objects.kind, objects.mesh], axis=1)
        for kind, number in np.unique(shapes, axis=0).tolist():
            rows = np.flatnonzero((shapes == (kind, number)).all(axis=1))
            shape = context.buffer(shape_vertices(ShapeKind(kind), objects, number).tobytes())
            places = context.buffer(reserve=56 * len(rows), dynamic=True)
            arrays = []
            for program in (shaded, plain):
                forms = [form if name in program else skip for form, skip, name in SHAPE_LAYOUT]
                used = [name for _, _, name in SHAPE_LAYOUT if name in program]
                own = [form if name in program else skip for form, skip, name in PLACE_LAYOUT]
                placed = [name for _, _, name in PLACE_LAYOUT if name in program]
                layout = [(shape, " ".join(forms), *used), (places, " ".join(own) + "/i", *placed)]
                arrays.append(context.vertex_array(program, layout))
            self._groups.append((rows, places, arrays))

    def update(self, frame: CrowdFrame, origin: FloatArray) -> None:
        """Upload where everything is."""
        if frame.object_position_world is None or frame.object_rotation_world is None:
            return
        for rows, places, _ in self._groups:
            table = np.zeros((len(rows), 14), np.float32)
            table[:, :3] = frame.object_position_world[rows] - origin
            table[:, 3:7] = frame.object_rotation_world[rows]
            table[:, 7:] = self._fixed[rows]
            places.write(table.tobytes())

    def draw(self, *, is_plain: bool = False) -> None:
        """Draw all things; plain ones have no colour."""
        for rows, _, arrays in self._groups:
            arrays[int(is_plain)].render(instances=len(rows))

    def release(self) -> None:
        """Give the memory back."""
        for _, places, arrays in self._groups:
            places.release()
            for array in arrays:
                array.release()


SHAPE_LAYOUT = (("3f4", "12x", "point"), ("3f4", "12x", "normal"), ("1f4", "4x", "end"))
PLACE_LAYOUT = (
    ("3f4", "12x", "centre"),
    ("4f4", "16x", "turn"),
    ("4f4", "16x", "size"),
    ("3f4", "12x", "tint"),
)


def sizes(objects: Objects) -> FloatArray:
    """How far each shape is stretched along its axes, and how far the ends of capsules are out, m. (M, 4)."""
    size = np.ones((objects.count, 4))
    size[:, 3] = 0.0
    is_round = np.isin(objects.kind, (ShapeKind.SPHERE, ShapeKind.CAPSULE))
    size[is_round, :3] = objects.half_size[is_round, :1]
    is_long = objects.kind == ShapeKind.CAPSULE
    size[is_long, 3] = objects.half_size[is_long, 1] - objects.half_size[is_long, 0]
    is_box = objects.kind == ShapeKind.BOX
    size[is_box, :3] = objects.half_size[is_box]
    return size


def shape_vertices(kind: ShapeKind, objects: Objects, number: int) -> Float32Array:
    """Triangles of a shape, three rows each: point, normal, end. (V, 7)."""
    if kind is ShapeKind.MESH:
        return mesh_vertices(objects.meshes[number])
    return box_vertices() if kind is ShapeKind.BOX else capsule_vertices()


def capsule_vertices() -> Float32Array:
    """Two half spheres of radius 1 with a belt between their rims, which opens with the length."""
    half = np.linspace(0.0, 0.5 * np.pi, RINGS)
    latitude = np.concatenate([half[::-1], -half])
    end = np.concatenate([np.ones(RINGS), -np.ones(RINGS)])
    angle = np.linspace(0.0, 2.0 * np.pi, AROUND + 1)
    ring = np.stack([np.sin(angle), np.zeros(AROUND + 1), np.cos(angle)], axis=1)
    point = np.cos(latitude)[:, None, None] * ring + np.sin(latitude)[:, None, None] * [0.0, 1.0, 0.0]
    rows = np.concatenate([point, point, np.broadcast_to(end[:, None, None], (*point.shape[:2], 1))], axis=2)
    a, b, c, d = rows[:-1, :-1], rows[:-1, 1:], rows[1:, :-1], rows[1:, 1:]
    return np.stack([a, c, b, b, c, d], axis=2).reshape(-1, 7).astype(np.float32)


def box_vertices() -> Float32Array:
    """A box with sides of 2 and slanted rims."""
    inner = 1.0 - BEVEL
    corners = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], np.float64)
    points = (corners[:, None] * np.where(np.eye(3) > 0, 1.0, inner)[None]).reshape(-1, 3)
    return flat_vertices(points, _hull_triangles(points))


def mesh_vertices(mesh: Mesh) -> Float32Array:
    """Triangles of a mesh, smooth but for its creases."""
    point = np.asarray(mesh.vertex, np.float64)
    triangle = np.asarray(mesh.triangle, np.int64)
    corner = point[triangle]
    face = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    # Vertices that lie in one place belong together, whatever the file says.
    _, same = np.unique(np.round(point, 6), axis=0, return_inverse=True)
    total = np.zeros((int(same.max(initial=-1)) + 1, 3))
    for k in range(3):
        np.add.at(total, same.ravel()[triangle[:, k]], face)
    own = face / np.maximum(np.linalg.norm(face, axis=1, keepdims=True), 1e-12)
    smooth = total[same.ravel()[triangle]]
    smooth = smooth / np.maximum(np.linalg.norm(smooth, axis=2, keepdims=True), 1e-12)
    is_edge = (smooth * own[:, None]).sum(axis=2) < CREASE
    normal = np.where(is_edge[..., None], own[:, None], smooth)
    rows = np.concatenate([corner, normal, np.zeros((*corner.shape[:2], 1))], axis=2)
    return rows.reshape(-1, 7).astype(np.float32)


def flat_vertices(point: FloatArray, triangle: npt.NDArray[np.int64]) -> Float32Array:
    """Triangles with one normal each."""
    corner = point[triangle]
    face = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    face /= np.linalg.norm(face, axis=1, keepdims=True)
    normal = np.broadcast_to(face[:, None], corner.shape)
    rows = np.concatenate([corner, normal, np.zeros((*corner.shape[:2], 1))], axis=2)
    return rows.reshape(-1, 7).astype(np.float32)


def _hull_triangles(point: FloatArray) -> npt.NDArray[np.int64]:
    """Triangles of the convex hull of points around the origin, anticlockwise from outside."""
    from scipy.spatial import ConvexHull

    triangle: npt.NDArray[np.int64] = ConvexHull(point).simplices.astype(np.int64)
    corner = point[triangle]
    inwards = (np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]) * corner[:, 0]).sum(1) < 0.0
    triangle[inwards] = triangle[inwards][:, ::-1]
    return triangle
