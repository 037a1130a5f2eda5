"""Animated glTF 2.0: a node hierarchy, the joints of a skin, and keyed animations."""

from __future__ import annotations

import base64
import binascii
import json
import struct
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from crowd.errors import MotionError, describe
from crowd.motion.formats.joint_list import check_size
from crowd.motion.formats.text import read_bytes
from crowd.motion.rotation import conjugate, multiply, rotate, slerp
from crowd.motion.source import SourceMotion, SourceSkeleton

FloatArray = npt.NDArray[np.float64]
AnyArray = npt.NDArray[Any]

USUAL_RATE = 30.0
"""Animations are keyed at any times; they are sampled at this rate, Hz."""
LONGEST = 3600.0
"""Longer animations are refused, s: times of an hour come from slips of units, and would fill the memory."""
MAGIC, VERSION, JSON_CHUNK, BINARY_CHUNK = 0x46546C67, 2, 0x4E4F534A, 0x004E4942
COMPONENTS: dict[int, np.dtype[Any]] = {
    5120: np.dtype("<i1"),
    5121: np.dtype("<u1"),
    5122: np.dtype("<i2"),
    5123: np.dtype("<u2"),
    5125: np.dtype("<u4"),
    5126: np.dtype("<f4"),
}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}


@dataclass
class Document:
    """A parsed glTF file.

    Attributes
    ----------
    path : Path
    content : dict
        The JSON part.
    buffers : list of bytes
    parent : list of int
        Parent of each node, -1 for roots.
    order : list of int
        Nodes, parents first.
    """

    path: Path
    content: dict[str, Any]
    buffers: list[bytes]
    parent: list[int]
    order: list[int]

    def items(self, key: str) -> list[dict[str, Any]]:
        """A top-level list; empty when absent."""
        found = self.content.get(key, [])
        return found if isinstance(found, list) else []

    def accessor(self, index: int) -> FloatArray | AnyArray:
        """Read an accessor: (count,) or (count, width); normalised integers become floats.

        Raises
        ------
        MotionError
            It lies outside its buffer, or is of an unknown kind.
        """
        where = f"{self.path}: accessors[{index}]"
        try:
            accessor = self.items("accessors")[index]
            dtype, width = COMPONENTS[accessor["componentType"]], WIDTHS[accessor["type"]]
            count = int(accessor["count"])
            view = self.items("bufferViews")[accessor["bufferView"]]
            data = self.buffers[view.get("buffer", 0)]
            first = int(view.get("byteOffset", 0)) + int(accessor.get("byteOffset", 0))
            stride = int(view.get("byteStride", dtype.itemsize * width))
        except (KeyError, IndexError, TypeError, ValueError, AttributeError) as error:
            raise MotionError(describe(where, "cannot be read", str(error))) from error
        last = first + stride * (count - 1) + dtype.itemsize * width
        if count < 1 or first < 0 or stride < dtype.itemsize * width or last > len(data):
            raise MotionError(describe(where, "lies outside its buffer", f"{count} items"))
        raw = np.lib.stride_tricks.as_strided(
            np.frombuffer(data, np.uint8)[first:], (count, dtype.itemsize * width), (stride, 1)
        )
        values: AnyArray = np.ascontiguousarray(raw).view(dtype)
        if accessor.get("normalized") and dtype.kind in "iu":
            values = np.maximum(values / np.iinfo(dtype).max, -1.0)
        if dtype.kind == "f" and not np.isfinite(values).all():
            raise MotionError(describe(where, "holds a value that is no finite number"))
        return values[:, 0] if width == 1 else values


def read_document(path: Path) -> Document:
    """Read a ``.gltf`` or ``.glb`` file with its buffers.

    Raises
    ------
    MotionError
        The file is broken, or a buffer is missing.
    """
    raw = read_bytes(path)
    binary = b""
    if raw[:4] == struct.pack("<I", MAGIC):
        text, binary = _chunks(raw, path)
    else:
        text = raw
    try:
        content = json.loads(text.decode("utf-8"))
        assert isinstance(content, dict)
        assert str(content["asset"]["version"]).startswith("2")
    except (ValueError, AssertionError, KeyError, TypeError, RecursionError) as error:
        raise MotionError(describe(str(path), "is no glTF 2.0 file", str(error)[:80] or None)) from error
    document = Document(path, content, [], [], [])
    for index, buffer in enumerate(document.items("buffers")):
        document.buffers.append(_buffer(buffer, index, binary, path))
    _order_nodes(document)
    return document


def _chunks(raw: bytes, path: Path) -> tuple[bytes, bytes]:
    """JSON and binary part of a GLB file."""
    text, binary, at = b"", b"", 12
    while at + 8 <= len(raw):
        size, kind = struct.unpack_from("<II", raw, at)
        if at + 8 + size > len(raw):
            raise MotionError(describe(f"{path}: byte {at}", "a chunk is cut short", f"{size} bytes"))
        if kind == JSON_CHUNK and not text:
            text = raw[at + 8 : at + 8 + size]
        elif kind == BINARY_CHUNK and not binary:
            binary = raw[at + 8 : at + 8 + size]
        at += 8 + size
    return text, binary


def _buffer(buffer: Any, index: int, binary: bytes, path: Path) -> bytes:
    where = f"{path}: buffers[{index}]"
    uri = buffer.get("uri") if isinstance(buffer, dict) else None
    if uri is None:
        return binary
    if not isinstance(uri, str):
        raise MotionError(describe(where, "uri is no text"))
    if uri.startswith("data:"):
        try:
            return base64.b64decode(uri.partition(",")[2], validate=True)
        except (binascii.Error, ValueError) as error:
            raise MotionError(describe(where, "data cannot be decoded", str(error))) from error
    place = path.parent / unquote(uri)
    if ".." in Path(unquote(uri)).parts or Path(unquote(uri)).is_absolute():
        raise MotionError(describe(where, "lies outside the folder of the file", uri))
    return read_bytes(place)


def _order_nodes(document: Document) -> None:
    """Find the parent of each node and an order with parents first; cycles are refused."""
    nodes = document.items("nodes")
    parent = [-1] * len(nodes)
    for index, node in enumerate(nodes):
        for child in node.get("children", []) if isinstance(node, dict) else []:
            if not isinstance(child, int) or not 0 <= child < len(nodes) or parent[child] != -1:
                raise MotionError(
                    describe(f"{document.path}: nodes[{index}]", "has an impossible child", child)
                )
            parent[child] = index
    order = [index for index, above in enumerate(parent) if above == -1]
    children: dict[int, list[int]] = {}
    for index, above in enumerate(parent):
        children.setdefault(above, []).append(index)
    for index in order:
        order.extend(children.get(index, []))
    if len(order) != len(nodes):
        raise MotionError(describe(f"{document.path}: nodes", "hang in a circle"))
    document.parent, document.order = parent, order


def node_transforms(document: Document) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Translation (N, 3), rotation (N, 4) as (w, x, y, z) and scale (N, 3) of all nodes.

    Raises
    ------
    MotionError
        A transform is malformed.
    """
    nodes = document.items("nodes")
    translation, scale = np.zeros((len(nodes), 3)), np.ones((len(nodes), 3))
    rotation = np.tile([1.0, 0.0, 0.0, 0.0], (len(nodes), 1))
    for index, node in enumerate(nodes):
        try:
            if "matrix" in node:
                matrix = np.array(node["matrix"], np.float64).reshape(4, 4).T
                translation[index] = matrix[:3, 3]
                scale[index] = np.linalg.norm(matrix[:3, :3], axis=0)
                rotation[index] = _quaternion(matrix[None, :3, :3])[0]
            translation[index] = node.get("translation", translation[index])
            scale[index] = node.get("scale", scale[index])
            if "rotation" in node:
                rotation[index] = _unit(np.array(node["rotation"], np.float64).reshape(1, 4))[0]
        except (ValueError, TypeError, AttributeError) as error:
            where = f"{document.path}: nodes[{index}]"
            raise MotionError(describe(where, "has a malformed transform", str(error)[:80])) from error
    if not (np.isfinite(translation).all() and np.isfinite(scale).all() and np.isfinite(rotation).all()):
        raise MotionError(describe(f"{document.path}: nodes", "a transform is not finite"))
    return translation, rotation, scale


def _unit(xyzw: FloatArray) -> FloatArray:
    """Unit quaternions (w, x, y, z) of (x, y, z, w) ones."""
    length = np.linalg.norm(xyzw, axis=-1, keepdims=True)
    still = np.array([0.0, 0.0, 0.0, 1.0])
    return np.asarray(np.where(length > 1e-9, xyzw / np.maximum(length, 1e-9), still)[..., [3, 0, 1, 2]])


def _quaternion(matrix: FloatArray) -> FloatArray:
    """Rotations (..., 4) of matrices (..., 3, 3) whose columns may be scaled."""
    length = np.linalg.norm(matrix, axis=-2, keepdims=True)
    clean = np.where(length > 1e-12, matrix / np.maximum(length, 1e-12), np.eye(3))
    try:
        return np.asarray(Rotation.from_matrix(clean).as_quat()[..., [3, 0, 1, 2]])
    except (ValueError, np.linalg.LinAlgError):
        return np.broadcast_to([1.0, 0.0, 0.0, 0.0], (*matrix.shape[:-2], 4)).copy()


def skin_joints(document: Document) -> list[int]:
    """Nodes of the first skin, parents first; all nodes below the root where there is no skin.

    Raises
    ------
    MotionError
        The skin names nodes that are not there.
    """
    skins = document.items("skins")
    if not skins:
        return [node for node in document.order if document.parent[node] != -1] or document.order
    wanted = skins[0].get("joints", [])
    count = len(document.parent)
    if not wanted or not all(isinstance(node, int) and 0 <= node < count for node in wanted):
        raise MotionError(describe(f"{document.path}: skins[0]", "names joints that are not there"))
    chosen = set(wanted)
    return [node for node in document.order if node in chosen]


def joint_parents(document: Document, joints: Sequence[int]) -> npt.NDArray[np.int32]:
    """Nearest joint above each joint, by place in `joints`; -1 for roots."""
    place = {node: index for index, node in enumerate(joints)}
    parents = []
    for node in joints:
        above = document.parent[node]
        while above != -1 and above not in place:
            above = document.parent[above]
        parents.append(place.get(above, -1))
    return np.array(parents, np.int32)


def joint_names(document: Document, joints: Sequence[int]) -> tuple[str, ...]:
    """Names of nodes, made unique; nameless ones are called ``joint_N``."""
    names: dict[str, None] = {}
    for node in joints:
        name = str(document.items("nodes")[node].get("name") or f"joint_{node}")
        while name in names:
            name += "_"
        names[name] = None
    return tuple(names)


def world_of(
    document: Document, translation: FloatArray, rotation: FloatArray, scale: FloatArray
) -> FloatArray:
    """World matrices (..., N, 4, 4) of node transforms (..., N, 3), (..., N, 4), (..., N, 3)."""
    matrix = np.zeros((*rotation.shape[:-1], 4, 4))
    axes = np.eye(3)
    for column in range(3):
        matrix[..., :3, column] = rotate(rotation, axes[column]) * scale[..., column : column + 1]
    matrix[..., :3, 3] = translation
    matrix[..., 3, 3] = 1.0
    for node in document.order:
        if document.parent[node] != -1:
            matrix[..., node, :, :] = matrix[..., document.parent[node], :, :] @ matrix[..., node, :, :]
    return matrix


def rest_matrices(document: Document, joints: Sequence[int]) -> FloatArray:
    """World matrices (J, 4, 4) of joints in the pose that the skin is bound in, or as the nodes stand."""
    nodes = world_of(document, *node_transforms(document))
    skins = document.items("skins")
    if not skins or "inverseBindMatrices" not in skins[0]:
        return np.asarray(nodes[list(joints)])
    flat = np.asarray(document.accessor(skins[0]["inverseBindMatrices"]), np.float64)
    listed = skins[0]["joints"]
    if flat.shape != (len(listed), 16):
        raise MotionError(describe(f"{document.path}: skins[0]", "bind matrices and joints differ in number"))
    inverse = dict(zip(listed, np.transpose(flat.reshape(-1, 4, 4), (0, 2, 1)), strict=True))
    root = joints[0]
    to_world = nodes[root] @ inverse[root]
    try:
        return np.stack([to_world @ np.linalg.inv(inverse[node]) for node in joints])
    except np.linalg.LinAlgError as error:
        where = f"{document.path}: skins[0]"
        raise MotionError(describe(where, "a bind matrix cannot be inverted")) from error


def read_gltf(path: Path, frame_rate: float | None = None) -> tuple[SourceMotion, ...]:
    """Read all animations of a glTF file on its first skin.

    Parameters
    ----------
    path : Path
    frame_rate : float, optional
        Hz at which animations are sampled; `USUAL_RATE` when not told.

    Raises
    ------
    MotionError
        The file is broken, or holds no animation.
    """
    document = read_document(path)
    if not document.items("nodes"):
        raise MotionError(describe(str(path), "has no nodes"))
    animations = document.items("animations")
    if not animations:
        raise MotionError(describe(str(path), "holds no animation"))
    joints = skin_joints(document)
    parent = joint_parents(document, joints)
    rest = rest_matrices(document, joints)
    rest_rotation, offset = _local(rest[None], parent)
    names = joint_names(document, joints)
    motions = []
    for number, animation in enumerate(animations):
        rate = USUAL_RATE if frame_rate is None else frame_rate
        matrices, animated = _animate(document, animation, number, rate)
        rotation, position = _local(matrices[:, joints], parent)
        skeleton = SourceSkeleton(
            names, parent, offset[0], rest_rotation[0], np.array([node in animated for node in joints])
        )
        name = str(animation.get("name") or f"{path.stem}_{number}")
        motions.append(SourceMotion(path, name, skeleton, rate, rotation, position))
    return tuple(motions)


def _local(world: FloatArray, parent: npt.NDArray[np.int32]) -> tuple[FloatArray, FloatArray]:
    """Local rotations (F, J, 4) and translations (F, J, 3) of world matrices (F, J, 4, 4), without scale."""
    rotation, position = _quaternion(world[..., :3, :3]), world[..., :3, 3]
    local_rotation, local_position = rotation.copy(), position.copy()
    for joint, above in enumerate(parent):
        if above >= 0:
            back = conjugate(rotation[:, above])
            local_rotation[:, joint] = multiply(back, rotation[:, joint])
            local_position[:, joint] = rotate(back, position[:, joint] - position[:, above])
    return local_rotation, local_position


def _animate(
    document: Document, animation: dict[str, Any], number: int, rate: float
) -> tuple[FloatArray, set[int]]:
    """World matrices (F, N, 4, 4) of all nodes, and the nodes that turn."""
    translation, rotation, scale = node_transforms(document)
    where = f"{document.path}: animations[{number}]"
    try:
        channels = [
            (channel["target"]["node"], channel["target"]["path"], animation["samplers"][channel["sampler"]])
            for channel in animation["channels"]
            if "node" in channel["target"] and channel["target"]["path"] != "weights"
        ]
        tracks = [
            (node, path, sampler.get("interpolation", "LINEAR"), document.accessor(sampler["input"]),
             document.accessor(sampler["output"]))
            for node, path, sampler in channels
        ]  # fmt: skip
    except (KeyError, IndexError, TypeError, AttributeError) as error:
        raise MotionError(describe(where, "is malformed", str(error)[:80])) from error
    end = max((float(times.max()) for *_, times, _ in tracks), default=0.0)
    if not 0.0 <= end <= LONGEST:
        raise MotionError(describe(where, "is too long", f"{end:g} s", f"up to {LONGEST:g} s"))
    # All nodes are chained as matrices, four times as large as a pose.
    check_size(document.path, 4.0 * end * rate, len(document.parent))
    time = np.arange(round(end * rate) + 1) / rate
    frames = len(time)
    parts = {
        "translation": np.repeat(translation[None], frames, axis=0),
        "rotation": np.repeat(rotation[None], frames, axis=0),
        "scale": np.repeat(scale[None], frames, axis=0),
    }
    turned = set()
    for node, path, interpolation, times, values in tracks:
        if path not in parts or not isinstance(node, int) or not 0 <= node < len(document.parent):
            raise MotionError(describe(where, "has an unknown channel", f"{node} {path}", ", ".join(parts)))
        parts[path][:, node] = _sampled(time, times, values, interpolation, path, where)
        if path == "rotation":
            turned.add(node)
    return world_of(document, parts["translation"], parts["rotation"], parts["scale"]), turned


def _sampled(
    time: FloatArray, times: AnyArray, values: AnyArray, interpolation: str, path: str, where: str
) -> FloatArray:
    """Values of a sampler at given times; rotations as (w, x, y, z)."""
    width = 4 if path == "rotation" else 3
    keys = np.asarray(times, np.float64).reshape(-1)
    per_key = 3 if interpolation == "CUBICSPLINE" else 1
    if values.shape != (per_key * len(keys), width) or (len(keys) > 1 and not (np.diff(keys) > 0.0).all()):
        raise MotionError(describe(where, "keys and values do not fit", f"{len(keys)} keys, {len(values)}"))
    if interpolation == "CUBICSPLINE":
        tangent_in, points, tangent_out = (np.asarray(values, np.float64)[part::3] for part in range(3))
    else:
        points = np.asarray(values, np.float64)
    place = np.clip(time, keys[0], keys[-1])
    before = np.clip(np.searchsorted(keys, place, side="right") - 1, 0, max(len(keys) - 2, 0))
    after = np.minimum(before + 1, len(keys) - 1)
    step = np.where(after > before, keys[after] - keys[before], 1.0)
    share = ((place - keys[before]) / step)[:, None]
    if interpolation == "STEP":
        found = points[np.searchsorted(keys, place, side="right").clip(1) - 1]
        return _unit(found) if path == "rotation" else found
    if interpolation == "CUBICSPLINE":
        s, length = share, step[:, None]
        found = (
            (2 * s**3 - 3 * s**2 + 1) * points[before]
            + (s**3 - 2 * s**2 + s) * length * tangent_out[before]
            + (3 * s**2 - 2 * s**3) * points[after]
            + (s**3 - s**2) * length * tangent_in[after]
        )
        return _unit(found) if path == "rotation" else found
    if path == "rotation":
        return slerp(_unit(points[before]), _unit(points[after]), share[:, 0])
    return np.asarray((1.0 - share) * points[before] + share * points[after])
