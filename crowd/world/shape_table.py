"""Shapes of objects as kernels read them: meshes as trees of bounding boxes."""

import numpy as np
import numpy.typing as npt

from crowd.world.mesh import Mesh
from crowd.world.objects import Objects
from crowd_kernels.capsule import ShapeTable

FloatArray = npt.NDArray[np.float64]

LEAF_TRIANGLES = 2


def shape_table(objects: Objects) -> ShapeTable:
    """Pack the shapes of all objects; a mesh that several of them have is there once."""
    trees = [MeshTree(mesh) for mesh in objects.meshes]
    nodes = np.cumsum([0] + [len(tree.low) for tree in trees])
    triangles = np.cumsum([0] + [len(tree.corner) for tree in trees])
    first, last = np.zeros((2, objects.count), np.int32)
    for row, mesh in enumerate(objects.mesh):
        if mesh >= 0:
            first[row], last[row] = nodes[mesh], nodes[mesh + 1]
    return ShapeTable(
        np.ascontiguousarray(objects.kind),
        np.ascontiguousarray(objects.half_size),
        first,
        last,
        _joined([tree.low for tree in trees], (0, 3)),
        _joined([tree.high for tree in trees], (0, 3)),
        _joined([np.array(tree.skip) + nodes[n] for n, tree in enumerate(trees)], (0,)).astype(np.int32),
        _joined(
            [np.where(tree.first < 0, -1, tree.first + triangles[n]) for n, tree in enumerate(trees)], (0,)
        ).astype(np.int32),
        _joined([tree.count for tree in trees], (0,)).astype(np.int32),
        _joined([tree.corner for tree in trees], (0, 9)),
    )


def _joined(parts: list[FloatArray], empty: tuple[int, ...]) -> FloatArray:
    return np.ascontiguousarray(np.concatenate(parts)) if parts else np.zeros(empty)


class MeshTree:
    """Triangles of one mesh, halved at the median of their longest side until few are left.

    Attributes
    ----------
    low, high : (K, 3) float64
        Box of each node, parents before children, depth first, m.
    skip : (K,) int
        Node that follows when the children are passed over.
    first, count : (K,) int
        Triangles of a leaf in `corner`; -1 and 0 for inner nodes.
    corner : (T, 9) float64
        m.
    """

    def __init__(self, mesh: Mesh) -> None:
        corners = mesh.vertex[mesh.triangle]
        self._low, self._high = corners.min(axis=1), corners.max(axis=1)
        self._center = corners.mean(axis=1)
        self._boxes: list[tuple[FloatArray, FloatArray]] = []
        self.skip: list[int] = []
        self._leaf: list[tuple[int, int]] = []
        self._order: list[npt.NDArray[np.intp]] = []
        self._placed = 0
        self._split(np.arange(len(corners)))
        self.low = np.array([box[0] for box in self._boxes])
        self.high = np.array([box[1] for box in self._boxes])
        self.first, self.count = np.array(self._leaf, np.int64).T
        self.corner = corners[np.concatenate(self._order)].reshape(-1, 9)

    def _split(self, members: npt.NDArray[np.intp]) -> None:
        node = len(self.skip)
        self._boxes.append((self._low[members].min(axis=0), self._high[members].max(axis=0)))
        self.skip.append(0)
        self._leaf.append((-1, 0))
        if len(members) <= LEAF_TRIANGLES:
            self._leaf[node] = (self._placed, len(members))
            self._order.append(members)
            self._placed += len(members)
        else:
            axis = int(np.argmax(np.ptp(self._center[members], axis=0)))
            ordered = members[np.argsort(self._center[members, axis], kind="stable")]
            self._split(ordered[: len(members) // 2])
            self._split(ordered[len(members) // 2 :])
        self.skip[node] = len(self.skip)
