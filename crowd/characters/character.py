"""A skinned glTF character: its mesh, skin and materials, and which of its joints is which of ours."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from crowd.errors import MotionError, describe
from crowd.motion.formats.gltf import (
    Document,
    joint_names,
    joint_parents,
    node_transforms,
    read_document,
    rest_matrices,
    skin_joints,
    world_of,
)
from crowd.motion.importing.joint_names import JointMap, read_mapping
from crowd.motion.importing.joint_shape import recognise

FloatArray = npt.NDArray[np.float64]
Float32Array = npt.NDArray[np.float32]
IntArray = npt.NDArray[np.int32]

TRIANGLES = 4
LEAST_WEIGHT = 1e-6
MAPPING_SUFFIX = ".joints.toml"


@dataclass(frozen=True)
class MeshPart:
    """A skinned mesh with one material.

    Attributes
    ----------
    position, normal : (V, 3) float32
        In the space that the skin's bind matrices start from, file units.
    texture_coordinate : (V, 2) float32
        Zeros where the file has none.
    joint : (V, 4) int32
        Places in `Character.joint_names`.
    weight : (V, 4) float32
        Sums to 1.
    triangle : (T, 3) int32
        Counter-clockwise from outside.
    colour : (4,) float32
        Base colour, linear, with alpha.
    image : bytes
        PNG or JPEG file of the base colour, empty where there is none.
    """

    position: Float32Array
    normal: Float32Array
    texture_coordinate: Float32Array
    joint: IntArray
    weight: Float32Array
    triangle: IntArray
    colour: Float32Array
    image: bytes


@dataclass(frozen=True)
class Character:
    """A skinned character.

    Attributes
    ----------
    name : str
    path : Path
    joint_names : tuple of str
    parent : (K,) int32
        Parents come before their children; -1 for roots.
    rest : (K, 4, 4) float64
        World matrices of the joints in the bind pose, file units and axes.
    inverse_bind : (K, 4, 4) float64
        From mesh space to joint space in the bind pose.
    joints : JointMap
        Which of them is which of ours.
    parts : tuple of MeshPart
    """

    name: str
    path: Path
    joint_names: tuple[str, ...]
    parent: IntArray
    rest: FloatArray
    inverse_bind: FloatArray
    joints: JointMap
    parts: tuple[MeshPart, ...]

    @property
    def joint_count(self) -> int:
        """Number of joints."""
        return len(self.joint_names)

    @property
    def vertex_count(self) -> int:
        """Number of vertices of all parts."""
        return sum(len(part.position) for part in self.parts)


def load_character(path: Path | str, mapping: Path | None = None) -> Character:
    """Load a skinned glTF character.

    Parameters
    ----------
    path : path
        ``.gltf`` or ``.glb``.
    mapping : Path, optional
        File that says which joint is which. When left out, one called ``NAME.joints.toml`` beside the
        character is; otherwise names tell, then the shape of the skeleton.

    Raises
    ------
    MotionError
        The file is broken, has no skin or no skinned mesh, or its joints cannot be mapped.
    """
    place = Path(path)
    document = read_document(place)
    if not document.items("skins"):
        raise MotionError(describe(str(place), "has no skin"))
    nodes = skin_joints(document)
    names, parent = joint_names(document, nodes), joint_parents(document, nodes)
    rest = rest_matrices(document, nodes)
    parts = tuple(_parts(document, nodes))
    if not parts:
        raise MotionError(describe(str(place), "has no mesh on its skin"))
    beside = place.with_suffix(MAPPING_SUFFIX)
    mapping = beside if mapping is None and beside.is_file() else mapping
    joints = (
        recognise(names, parent, rest[:, :3, 3], str(place))
        if mapping is None
        else read_mapping(mapping, names)
    )
    return Character(place.stem, place, names, parent, rest, _inverse_bind(document, nodes), joints, parts)


def _inverse_bind(document: Document, nodes: Sequence[int]) -> FloatArray:
    skin = document.items("skins")[0]
    listed = list(skin["joints"])
    if "inverseBindMatrices" not in skin:
        world = world_of(document, *node_transforms(document))
        return np.asarray(np.linalg.inv(world[list(nodes)]))
    flat = np.asarray(document.accessor(skin["inverseBindMatrices"]), np.float64)
    matrices = np.transpose(flat.reshape(-1, 4, 4), (0, 2, 1))
    return np.stack([matrices[listed.index(node)] for node in nodes])


def _parts(document: Document, nodes: Sequence[int]) -> list[MeshPart]:
    """All triangle meshes on the first skin."""
    listed = list(document.items("skins")[0]["joints"])
    order = np.array([list(nodes).index(node) for node in listed], np.int32)
    found = []
    for node in document.items("nodes"):
        if node.get("skin") != 0 or "mesh" not in node:
            continue
        where = f"{document.path}: meshes[{node['mesh']}]"
        try:
            primitives = document.items("meshes")[node["mesh"]]["primitives"]
        except (IndexError, KeyError, TypeError) as error:
            raise MotionError(describe(where, "is malformed", str(error)[:80])) from error
        for primitive in primitives:
            if primitive.get("mode", TRIANGLES) == TRIANGLES:
                found.append(_part(document, primitive, order, where))
    return found


def _part(document: Document, primitive: dict[str, Any], order: IntArray, where: str) -> MeshPart:
    attributes = primitive.get("attributes", {})
    for needed in ("POSITION", "JOINTS_0", "WEIGHTS_0"):
        if needed not in attributes:
            raise MotionError(describe(where, "lacks an attribute", needed))
    position = np.asarray(document.accessor(attributes["POSITION"]), np.float32)
    count = len(position)
    joint = np.asarray(document.accessor(attributes["JOINTS_0"]), np.int64)
    weight = np.asarray(document.accessor(attributes["WEIGHTS_0"]), np.float64)
    indices = (
        np.asarray(document.accessor(primitive["indices"]), np.int64)
        if "indices" in primitive
        else np.arange(count)
    )
    is_whole = joint.shape == weight.shape == (count, 4) and len(indices) % 3 == 0
    if not is_whole or joint.max(initial=0) >= len(order) or indices.max(initial=0) >= count:
        raise MotionError(describe(where, "joints, weights, vertices and triangles do not fit"))
    triangle = indices.reshape(-1, 3).astype(np.int32)
    # Exporters leave sums below 1, or vertices without any weight.
    weight = np.clip(weight, 0.0, None)
    total = weight.sum(axis=1, keepdims=True)
    weight = np.where(total > LEAST_WEIGHT, weight / np.maximum(total, LEAST_WEIGHT), [1.0, 0.0, 0.0, 0.0])
    normal = (
        np.asarray(document.accessor(attributes["NORMAL"]), np.float32)
        if "NORMAL" in attributes
        else _normals(position, triangle)
    )
    texture = (
        np.asarray(document.accessor(attributes["TEXCOORD_0"]), np.float32)
        if "TEXCOORD_0" in attributes
        else np.zeros((count, 2), np.float32)
    )
    colour, image = _material(document, primitive.get("material"))
    return MeshPart(
        position, normal, texture, order[joint], weight.astype(np.float32), triangle, colour, image
    )


def _normals(position: Float32Array, triangle: IntArray) -> Float32Array:
    """Vertex normals from the triangles around each vertex."""
    corners = position[triangle]
    face = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal = np.zeros_like(position)
    for corner in range(3):
        np.add.at(normal, triangle[:, corner], face)
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    return np.asarray(normal / np.maximum(length, 1e-12), np.float32)


def _material(document: Document, index: int | None) -> tuple[Float32Array, bytes]:
    """Base colour and the file of its picture."""
    colour, image = np.ones(4, np.float32), b""
    materials = document.items("materials")
    if index is None or not 0 <= index < len(materials):
        return colour, image
    surface = materials[index].get("pbrMetallicRoughness", {})
    colour[:] = surface.get("baseColorFactor", colour)
    texture = surface.get("baseColorTexture", {}).get("index")
    try:
        if texture is not None:
            source = document.items("images")[document.items("textures")[texture]["source"]]
            image = _image(document, source)
    except (IndexError, KeyError, TypeError) as error:
        where = f"{document.path}: materials[{index}]"
        raise MotionError(describe(where, "has a picture that is not there", str(error)[:80])) from error
    return colour, image


def _image(document: Document, source: dict[str, Any]) -> bytes:
    import base64

    if "bufferView" in source:
        view = document.items("bufferViews")[source["bufferView"]]
        first = int(view.get("byteOffset", 0))
        data: bytes = document.buffers[view.get("buffer", 0)]
        return data[first : first + int(view["byteLength"])]
    uri = str(source["uri"])
    if uri.startswith("data:"):
        return base64.b64decode(uri.partition(",")[2])
    place = document.path.parent / uri
    return place.read_bytes() if place.is_file() and place.parent == document.path.parent else b""
