"""Make the skins of the built-in builds from their distances; needs scikit-image and fast-simplification."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from crowd.body.builds import Recipe
from crowd.body.clothes import Piece, pieces
from crowd.body.figure import Flesh
from crowd.body.skin import Skin
from crowd.body.stance import Stance
from crowd.body.weights import skin_weights, strongest

FloatArray = npt.NDArray[np.float64]
Triangles = npt.NDArray[np.int64]

LEVEL_VERTICES = (4600, 1000, 260)
LEAST_VERTICES = (40, 30, 30)
SKY_REACH, SKY_SHARE = (0.015, 0.04, 0.09, 0.18), (0.22, 0.22, 0.22, 0.22)
"""How far from the surface the distance is looked up, m, and how much each counts."""


def sampled_surface(piece: Piece) -> tuple[FloatArray, Triangles]:
    """Vertices and triangles where the distance to a piece is zero."""
    from skimage.measure import marching_cubes

    # Off the round numbers that edges are at: surfaces through samples give slivers.
    begin = np.asarray(piece.low, np.float32) - np.float32(0.37 * piece.step)
    axes = [
        np.arange(low, high + piece.step, piece.step, dtype=np.float32)
        for low, high in zip(begin, piece.high, strict=True)
    ]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    values = piece.distance(grid.reshape(-1, 3)).reshape(grid.shape[:3])
    vertices, triangles, _, _ = marching_cubes(
        values, 0.0, spacing=(piece.step,) * 3, gradient_direction="ascent"
    )
    return vertices + begin, triangles[:, ::-1].astype(np.int64)


def simplified(vertices: FloatArray, triangles: Triangles, vertex_count: int) -> tuple[FloatArray, Triangles]:
    """The same surface with about so many vertices."""
    import fast_simplification

    target = 2 * vertex_count
    if target >= len(triangles):
        return vertices, triangles
    points, faces = fast_simplification.simplify(
        vertices.astype(np.float32), triangles.astype(np.int32), target_count=target
    )
    return points.astype(np.float64), faces.astype(np.int64)


def paired(vertices: FloatArray, triangles: Triangles) -> tuple[FloatArray, Triangles]:
    """A surface and its mirror image."""
    other = vertices * [-1.0, 1.0, 1.0]
    return np.vstack([vertices, other]), np.vstack([triangles, triangles[:, ::-1] + len(vertices)])


def normals_of(piece: Piece, vertices: FloatArray) -> FloatArray:
    """Directions in which the distance grows."""
    points = vertices.astype(np.float32)
    # Wider than the samples are apart: small dents would glitter.
    half = np.float32(piece.step)
    gradient = np.stack(
        [
            piece.distance(points + half * axis) - piece.distance(points - half * axis)
            for axis in np.eye(3, dtype=np.float32)
        ],
        axis=1,
    ).astype(np.float64)
    return np.asarray(gradient / np.maximum(np.linalg.norm(gradient, axis=1, keepdims=True), 1e-9))


def open_sky(everything: Sequence[Piece], vertices: FloatArray, normals: FloatArray) -> FloatArray:
    """Share of the light from around that reaches vertices, from how fast the distance to the body grows.

    Notes
    -----
    **Source:** ambient occlusion from distance fields (Evans, "Fast approximations for global illumination on
    dynamic scenes", 2006).
    """
    hidden = np.zeros(len(vertices))
    for reach, share in zip(SKY_REACH, SKY_SHARE, strict=True):
        outside = (vertices + reach * normals).astype(np.float32)
        distance = np.full(len(vertices), reach, np.float32)
        for piece in everything:
            distance = np.minimum(distance, piece.distance(outside))
            if piece.is_paired:
                distance = np.minimum(distance, piece.distance(outside * np.array([-1, 1, 1], np.float32)))
        hidden += share * np.clip(1.0 - distance / reach, 0.0, 1.0)
    return np.asarray(1.0 - hidden)


def generate(recipe: Recipe, stance: Stance) -> tuple[Skin, ...]:
    """Skins of one build, from fine to coarse."""
    flesh = Flesh(recipe.figure, stance)
    everything = list(pieces(flesh, recipe.outfit))
    surfaces = [sampled_surface(piece) for piece in everything]
    total = sum(piece.share for piece in everything)
    skins = []
    for count, least in zip(LEVEL_VERTICES, LEAST_VERTICES, strict=True):
        parts = []
        for piece, surface in zip(everything, surfaces, strict=True):
            wanted = max(least, round(count * piece.share / total))
            mesh = (
                paired(*simplified(*surface, wanted // 2))
                if piece.is_paired
                else simplified(*surface, wanted)
            )
            parts.append(_skinned(flesh, everything, piece, *mesh))
        skins.append(assembled(parts))
    return tuple(skins)


def _skinned(
    flesh: Flesh, everything: Sequence[Piece], piece: Piece, vertices: FloatArray, triangles: Triangles
) -> Skin:
    """A piece in rest pose with weights."""
    joint, weight = strongest(
        skin_weights(flesh, vertices.astype(np.float32), piece.legs_apart, has_limbs=piece.has_limbs)
    )
    facing = normals_of(piece, vertices)
    position, normal = at_rest(flesh.stance, vertices, facing, joint, weight)
    return Skin(
        position.astype(np.float32),
        normal.astype(np.float32),
        joint,
        weight.astype(np.float32),
        np.full(len(vertices), int(piece.material), np.uint8),
        open_sky(everything, vertices, facing).astype(np.float32),
        triangles.astype(np.uint32),
    )


def assembled(parts: Sequence[Skin]) -> Skin:
    """Several skins as one."""
    first = np.cumsum([0] + [len(part.position) for part in parts[:-1]])

    def all_of(name: str) -> npt.NDArray[Any]:
        return np.concatenate([getattr(part, name) for part in parts])

    return Skin(
        all_of("position"),
        all_of("normal"),
        all_of("joint"),
        all_of("weight"),
        all_of("material"),
        all_of("open_sky"),
        np.concatenate([part.triangle + np.uint32(begin) for part, begin in zip(parts, first, strict=True)]),
    )


def at_rest(
    stance: Stance,
    vertices: FloatArray,
    normals: FloatArray,
    joints: npt.NDArray[np.uint8],
    weights: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Vertices and normals in rest pose that the blended joints carry to where they were sculpted."""
    blended = np.einsum("pk,pkij->pij", weights, stance.to_stance[joints])
    back = np.linalg.inv(blended)
    rest = np.einsum("pij,pj->pi", back[:, :3, :3], vertices) + back[:, :3, 3]
    facing = np.einsum("pij,pj->pi", back[:, :3, :3], normals)
    return rest, facing / np.linalg.norm(facing, axis=1, keepdims=True)
