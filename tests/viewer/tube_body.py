"""A body of separate tubes: the limbs of a body as skins, to compare the two ways of drawing."""

import numpy as np

from crowd.body import Material, Skin


def tube(start, end, radius, around, rings):
    """Positions, normals and triangles of a capsule."""
    along = end - start
    along = along / np.linalg.norm(along)
    side = np.cross(along, [0.3, 0.2, 0.9])
    side /= np.linalg.norm(side)
    up = np.cross(side, along)
    latitude = np.sort(np.append(np.linspace(-np.pi / 2, np.pi / 2, rings), 1e-9))
    angle = np.arange(around) * 2 * np.pi / around
    ring = np.cos(angle)[:, None] * side + np.sin(angle)[:, None] * up
    normal = np.cos(latitude)[:, None, None] * ring + np.sin(latitude)[:, None, None] * along
    middle = np.where(latitude[:, None] <= 0, start, end)[:, None]
    row, column = np.meshgrid(np.arange(len(latitude) - 1), np.arange(around), indexing="ij")
    a, b = (row * around + column).ravel(), (row * around + (column + 1) % around).ravel()
    triangle = np.concatenate([np.c_[a, b, a + around], np.c_[b, b + around, a + around]])
    return (middle + radius * normal).reshape(-1, 3), normal.reshape(-1, 3), triangle


def tube_mesh(limbs, around):
    """A skin of all limbs, each moved by its own joint alone."""
    position, normal, joint, triangle, count = [], [], [], [], 0
    for number, start, end, radius in zip(limbs.joint, limbs.start, limbs.end, limbs.radius, strict=True):
        points, directions, faces = tube(start, end, radius, around, around // 2)
        position.append(points)
        normal.append(directions)
        joint.append(np.full(len(points), number))
        triangle.append(faces + count)
        count += len(points)
    joints, weights = np.zeros((count, 4), np.uint8), np.zeros((count, 4), np.float32)
    joints[:, 0], weights[:, 0] = np.concatenate(joint), 1.0
    return Skin(
        np.concatenate(position).astype(np.float32),
        np.concatenate(normal).astype(np.float32),
        joints,
        weights,
        np.full(count, Material.TOP, np.uint8),
        np.ones(count, np.float32),
        np.concatenate(triangle).astype(np.uint32),
    )
