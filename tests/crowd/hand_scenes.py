"""Random objects of graspable size, and hands put on them."""

from dataclasses import dataclass

import numpy as np

from crowd.motion.body import build_skeleton
from crowd.motion.hand import hand_table
from crowd.world.mesh import Mesh
from crowd.world.objects import Objects, ShapeKind
from crowd.world.shape_table import shape_table
from crowd_kernels.grasp import close_hands, measure_gaps
from crowd_kernels.hand_placement import place_hands

HAND = hand_table(build_skeleton())


def sphere_mesh(stacks=10, slices=16):
    """Unit sphere of triangles."""
    polar = np.linspace(0, np.pi, stacks + 1)[1:-1]
    around = 2 * np.pi * np.arange(slices) / slices
    p, a = (grid.ravel() for grid in np.meshgrid(polar, around, indexing="ij"))
    ring = np.stack([np.sin(p) * np.cos(a), np.cos(p), np.sin(p) * np.sin(a)], axis=1)
    vertex = np.concatenate([[[0, 1, 0]], ring, [[0, -1, 0]]])
    last, triangles = len(vertex) - 1, []
    for k in range(slices):
        following = (k + 1) % slices
        triangles.append((0, 1 + following, 1 + k))
        end = 1 + (stacks - 2) * slices
        triangles.append((last, end + k, end + following))
        for row in range(stacks - 2):
            a, b = 1 + row * slices + k, 1 + row * slices + following
            triangles += [(a, b, a + slices), (b, b + slices, a + slices)]
    return vertex, np.array(triangles)


def random_mesh(rng):
    """A lump: a sphere with dents and bumps, longer one way than the other."""
    vertex, triangle = sphere_mesh()
    wave = np.sin(2 * vertex @ rng.normal(size=(3, 4)) + rng.uniform(0, 6, 4)).sum(axis=1)
    return Mesh.of(vertex * rng.uniform(0.022, 0.05, 3) * (1 + 0.04 * wave)[:, None], triangle)


def random_objects(kind, count, rng):
    """Objects of a size that one hand can hold, thin ones included."""
    meshes = tuple(random_mesh(rng) for _ in range(min(count, 40))) if kind == ShapeKind.MESH else ()
    half, mesh = np.zeros((count, 3)), np.full(count, -1, np.int32)
    for row in range(count):
        if kind == ShapeKind.SPHERE:
            half[row] = rng.uniform(0.012, 0.055)
        elif kind == ShapeKind.BOX:
            sides = [rng.uniform(0.012, 0.05), rng.uniform(0.012, 0.05), rng.uniform(0.012, 0.12)]
            half[row] = rng.permutation(sides)
        elif kind == ShapeKind.CAPSULE:
            radius = rng.uniform(0.01, 0.045)
            half[row] = radius, radius + rng.uniform(0.02, 0.15), radius
        else:
            mesh[row] = row % len(meshes)
            half[row] = meshes[mesh[row]].half_size
    return Objects(
        tuple(f"{ShapeKind(kind).name.lower()}[{row}]" for row in range(count)),
        np.full(count, kind, np.int32),
        half,
        np.zeros((count, 3), np.float32),
        mesh,
        meshes,
        rng.uniform(-1, 1, (count, 3)),
        unit_quaternions(rng, count),
    )


def unit_quaternions(rng, count):
    rotation = rng.normal(size=(count, 4))
    return rotation / np.linalg.norm(rotation, axis=1, keepdims=True)


@dataclass
class Hands:
    """Hands placed on objects, one on each."""

    objects: Objects
    table: object
    side: np.ndarray
    scale: np.ndarray
    natural_position: np.ndarray
    natural_rotation: np.ndarray
    position: np.ndarray
    rotation: np.ndarray
    style: np.ndarray
    status: np.ndarray

    @classmethod
    def on(cls, objects, rng):
        """Place a hand on each object from a random direction; everything in the objects' frames."""
        count = objects.count
        side, item = rng.integers(0, 2, count).astype(np.int32), np.arange(count, dtype=np.int32)
        scale = rng.uniform(0.9, 1.1, count)
        natural_position, natural_rotation = rng.normal(0, 0.1, (count, 3)), unit_quaternions(rng, count)
        position, rotation = np.zeros((count, 3)), np.zeros((count, 4))
        style, status = np.zeros((2, count), np.int32)
        table = shape_table(objects)
        here, upright = np.zeros((count, 3)), np.tile([1.0, 0, 0, 0], (count, 1))
        place_hands(
            HAND, table, side, item, scale, natural_position, natural_rotation, here, upright,
            position, rotation, style, status,
        )  # fmt: skip
        return cls(
            objects, table, side, scale, natural_position, natural_rotation, position, rotation, style, status
        )

    def close(self):
        """Where the fingers end: closure (N, 15) and contact (N, 15)."""
        count = self.objects.count
        rows = np.arange(count, dtype=np.int32)
        closure, contact = np.zeros((count, 2, 15), np.float32), np.zeros((count, 2, 15), np.uint8)
        here, upright = np.zeros((count, 3)), np.tile([1.0, 0, 0, 0], (count, 1))
        close_hands(
            HAND, self.table, rows, self.side, self.style, rows, self.scale, self.position, self.rotation,
            here, upright, closure, contact,
        )  # fmt: skip
        return closure[rows, self.side], contact[rows, self.side]

    def gaps(self, closure):
        """Least gap of each finger, (N, 5), m."""
        count = self.objects.count
        gap = np.zeros((count, 5))
        here, upright = np.zeros((count, 3)), np.tile([1.0, 0, 0, 0], (count, 1))
        measure_gaps(
            HAND, self.table, self.side, self.style, np.arange(count, dtype=np.int32), self.scale,
            self.position, self.rotation, here, upright, np.ascontiguousarray(closure), 0.05, gap,
        )  # fmt: skip
        return gap
