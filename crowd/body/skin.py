"""Skins of the built-in builds: smooth meshes that the joints of the built-in skeleton move."""

from __future__ import annotations

import zipfile
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

Float32Array = npt.NDArray[np.float32]

LEVELS = 3
"""Skins of a build: for people near, at some distance, and far away."""
STEPS_PER_METRE = 10_000.0
SKY_STEPS = 63.0
FIRST_OF_TIMES = (1980, 1, 1, 0, 0, 0)
"""Date of everything in the file: the same skins are the same bytes."""


@dataclass(frozen=True)
class Skin:
    """A skin in rest pose.

    Attributes
    ----------
    position, normal : (V, 3) float32
        m, from the ground below the root.
    joint : (V, 4) uint8
    weight : (V, 4) float32
        Share of each joint; they add up to 1.
    material : (V,) uint8
        `Material`; the same at all corners of a triangle.
    open_sky : (V,) float32
        Share of the light from all around that the body itself does not keep away, 0 to 1.
    triangle : (T, 3) uint32
        Anticlockwise from outside.
    """

    position: Float32Array
    normal: Float32Array
    joint: npt.NDArray[np.uint8]
    weight: Float32Array
    material: npt.NDArray[np.uint8]
    open_sky: Float32Array
    triangle: npt.NDArray[np.uint32]


def write_skins(path: Path, builds: Iterable[tuple[Skin, ...]]) -> None:
    """Write the skins of all builds, positions in steps of 0.1 mm and weights of 1/255."""
    skins = [skin for build in builds for skin in build]
    weight = np.concatenate([whole_weights(skin.weight) for skin in skins])
    arrays = {
        "vertex_count": np.array([len(skin.position) for skin in skins], np.int32),
        "triangle_count": np.array([len(skin.triangle) for skin in skins], np.int32),
        # Components one after the other: neighbours in memory are alike, which packs better.
        "position": np.round(np.concatenate([s.position for s in skins]).T * STEPS_PER_METRE).astype(
            np.int16
        ),
        "normal": np.round(np.concatenate([s.normal for s in skins]).T * 127.0).astype(np.int8),
        "joint": np.where(weight > 0, np.concatenate([s.joint for s in skins]), 0).astype(np.uint8).T,
        "weight": weight.T,
        "material": np.concatenate([s.material for s in skins]),
        "open_sky": np.round(np.concatenate([s.open_sky for s in skins]) * SKY_STEPS).astype(np.uint8),
        "triangle": np.concatenate([s.triangle for s in skins]).astype(np.uint16).T,
    }
    with zipfile.ZipFile(path, "w") as archive:
        for name, values in arrays.items():
            entry = zipfile.ZipInfo(f"{name}.npy", FIRST_OF_TIMES)
            entry.compress_type = zipfile.ZIP_LZMA
            with archive.open(entry, "w") as file:
                np.lib.format.write_array(file, np.ascontiguousarray(values))


def whole_weights(weight: Float32Array) -> npt.NDArray[np.uint8]:
    """Weights as whole numbers that add up to 255; the largest takes what rounding leaves."""
    whole = np.round(weight * 255.0).astype(np.int32)
    whole[:, 0] += 255 - whole.sum(axis=1)
    return whole.astype(np.uint8)


def read_skins(path: Path) -> tuple[tuple[Skin, ...], ...]:
    """Skins of all builds, from fine to coarse."""
    with np.load(path) as file:
        columns = {name: file[name] for name in file.files}
    ends = np.cumsum(columns["vertex_count"])[:-1]
    names = ("position", "normal", "joint", "weight", "material", "open_sky")
    parts = {name: np.split(np.ascontiguousarray(columns[name].T), ends) for name in names}
    triangles = np.split(columns["triangle"].T, np.cumsum(columns["triangle_count"])[:-1])
    skins = [
        Skin(
            (position / STEPS_PER_METRE).astype(np.float32),
            _unit(normal),
            joint,
            (weight / 255.0).astype(np.float32),
            material,
            (open_sky / SKY_STEPS).astype(np.float32),
            triangle.astype(np.uint32),
        )
        for position, normal, joint, weight, material, open_sky, triangle in zip(
            *(parts[name] for name in names), triangles, strict=True
        )
    ]
    return tuple(tuple(skins[k : k + LEVELS]) for k in range(0, len(skins), LEVELS))


def _unit(normal: npt.NDArray[np.int8]) -> Float32Array:
    direction = normal.astype(np.float32)
    return np.asarray(direction / np.linalg.norm(direction, axis=1, keepdims=True))
