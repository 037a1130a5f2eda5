"""Triangle meshes of objects, read from files."""

import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from crowd.errors import ScenarioError, describe

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int32]

FILE_ENDINGS = (".obj", ".stl", ".ply", ".glb", ".gltf")
MOST_TRIANGLES = 200_000
LEAST_AREA = 1e-12
"""Triangles smaller than this are left out, m2."""


@dataclass(frozen=True)
class Mesh:
    """A surface of triangles around its origin.

    Attributes
    ----------
    vertex : (V, 3) float64
        m; the origin is the centre of the bounding box.
    triangle : (T, 3) int32
        Vertices of each triangle.
    """

    vertex: FloatArray
    triangle: IntArray

    @property
    def half_size(self) -> FloatArray:
        """Half the sides of the bounding box, m. (3,)"""
        return np.asarray(np.ptp(self.vertex, axis=0) / 2.0)

    @classmethod
    def of(cls, vertex: npt.ArrayLike, triangle: npt.ArrayLike) -> "Mesh":
        """Centre vertices (V, 3) and drop triangles (T, 3) without area.

        Raises
        ------
        ScenarioError
            Nothing is left, or something is not finite.
        """
        points = np.asarray(vertex, np.float64).reshape(-1, 3)
        faces = np.asarray(triangle, np.int64).reshape(-1, 3)
        if not np.isfinite(points).all():
            raise ScenarioError(describe("mesh", "has a vertex that is not finite"))
        if len(faces) and not (faces.min() >= 0 and faces.max() < len(points)):
            raise ScenarioError(describe("mesh", "has a triangle without vertices", int(faces.max())))
        corners = points[faces]
        across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        faces = faces[np.linalg.norm(across, axis=1) > 2.0 * LEAST_AREA]
        if not 1 <= len(faces) <= MOST_TRIANGLES:
            raise ScenarioError(
                describe("mesh", "has a wrong number of triangles", len(faces), f"1 to {MOST_TRIANGLES:,}")
            )
        kept, index = np.unique(faces, return_inverse=True)
        points = points[kept]
        center = (points.min(axis=0) + points.max(axis=0)) / 2.0
        return cls(
            np.ascontiguousarray(points - center),
            np.ascontiguousarray(index.reshape(-1, 3).astype(np.int32)),
        )


def load_mesh(path: str | os.PathLike[str], scale: float = 1.0) -> Mesh:
    """Read the triangles of a mesh file; all parts of a scene become one mesh.

    Parameters
    ----------
    path : path
        .obj, .stl, .ply, .glb or .gltf.
    scale : float
        Metres per unit of the file, > 0.

    Raises
    ------
    ScenarioError
        The file is missing or is not a mesh, or the packages of the extra ``mesh`` are not installed.
    """
    file = Path(path)
    if file.suffix.lower() not in FILE_ENDINGS:
        allowed = ", ".join(FILE_ENDINGS)
        raise ScenarioError(describe(file.name, "is not a mesh file", file.suffix or "no ending", allowed))
    if not file.is_file():
        raise ScenarioError(describe(str(path), "no such file"))
    try:
        import trimesh
    except ImportError:
        allowed = 'pip install "crowd-engine[mesh]"'
        raise ScenarioError(describe(file.name, "needs the package trimesh", allowed=allowed)) from None
    try:
        content = trimesh.load_mesh(file, process=False)
        vertex, triangle = content.vertices, content.faces
    except Exception as error:  # readers of the formats raise whatever they meet
        reason = str(error).splitlines()[0][:80] if str(error) else type(error).__name__
        raise ScenarioError(describe(file.name, "cannot be read as a mesh", reason)) from error
    return Mesh.of(np.asarray(vertex) * scale, triangle)
