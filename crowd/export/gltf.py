"""Animated skinned glTF: one ``.glb`` for each person."""

from __future__ import annotations

import json
import struct
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from crowd.characters import MeshPart
from crowd.export.bodies import Bodies, Body
from crowd.export.output import whole_folder
from crowd.export.selection import Selection, Visit
from crowd.motion.rotation import conjugate, multiply

AnyArray = npt.NDArray[Any]

FLOAT, UNSIGNED_INT, UNSIGNED_SHORT = 5126, 5125, 5123
MAGIC, VERSION, JSON_CHUNK, BINARY_CHUNK = 0x46546C67, 2, 0x4E4F534A, 0x004E4942
ARRAY_BUFFER, ELEMENT_BUFFER = 34962, 34963
TYPES = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4", 16: "MAT4"}
COMPONENTS = {
    np.dtype(np.float32): FLOAT,
    np.dtype(np.uint32): UNSIGNED_INT,
    np.dtype(np.uint16): UNSIGNED_SHORT,
}


def export_gltf(selection: Selection, out: Path, on_block: Callable[[float], None], bodies: Bodies) -> None:
    """Write a folder of GLB files: nodes for joints, a skin, and an animation.

    Parameters
    ----------
    selection : Selection
    out : Path
        Folder; files are called after the visits.
    on_block : callable
        Called with the number of frames after each block, shared among the people.
    bodies : Bodies
    """
    visits = selection.visits
    with whole_folder(out) as folder:
        for visit in visits:
            write_person(selection, visit, bodies.of(visit.slot), folder / f"{visit.name}.glb")
            on_block(selection.frame_count / max(len(visits), 1))


class Layout:
    """Accessors and buffer views of a file whose binary part is filled later."""

    def __init__(self) -> None:
        self.accessors: list[dict[str, Any]] = []
        self.views: list[dict[str, Any]] = []
        self.filled: list[tuple[int, AnyArray]] = []
        self.size = 0

    def reserve(self, count: int, width: int, dtype: npt.DTypeLike, target: int | None = None) -> int:
        """Make room for an array; gives its accessor."""
        kind = np.dtype(dtype)
        view: dict[str, Any] = {
            "buffer": 0,
            "byteOffset": self.size,
            "byteLength": count * width * kind.itemsize,
        }
        if target is not None:
            view["target"] = target
        self.views.append(view)
        self.size += -(-view["byteLength"] // 4) * 4
        self.accessors.append(
            {
                "bufferView": len(self.views) - 1,
                "componentType": COMPONENTS[kind],
                "count": count,
                "type": TYPES[width],
            }
        )
        return len(self.accessors) - 1

    def place(self, values: AnyArray, target: int | None = None, bounds: bool = False) -> int:
        """Make room for an array and note its content; gives its accessor."""
        flat = np.ascontiguousarray(values).reshape(len(values), -1)
        index = self.reserve(len(flat), flat.shape[1], flat.dtype, target)
        self.filled.append((self.offset(index), flat))
        if bounds:
            self.accessors[index] |= {"min": flat.min(axis=0).tolist(), "max": flat.max(axis=0).tolist()}
        return index

    def place_bytes(self, content: bytes) -> int:
        """Make room for a file; gives its buffer view."""
        self.views.append({"buffer": 0, "byteOffset": self.size, "byteLength": len(content)})
        self.filled.append((self.size, np.frombuffer(content, np.uint8)))
        self.size += -(-len(content) // 4) * 4
        return len(self.views) - 1

    def offset(self, accessor: int) -> int:
        """Where an accessor begins in the binary part."""
        return int(self.views[self.accessors[accessor]["bufferView"]]["byteOffset"])


def write_person(selection: Selection, visit: Visit, body: Body, path: Path) -> None:
    """Write one visit; the animation starts at time 0."""
    recording, frames, joints = selection.recording, visit.frame_count, len(body.joint_names)
    slots = np.array([visit.slot])
    layout = Layout()
    content: dict[str, Any] = {
        "asset": {"version": "2.0", "generator": f"crowd-engine {recording.version}"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
    }
    inverse = np.transpose(body.inverse_bind, (0, 2, 1)).astype(np.float32).reshape(-1, 16)
    skin = {"joints": list(range(1, joints + 1)), "inverseBindMatrices": layout.place(inverse)}
    content["skins"] = [skin]
    _add_meshes(content, layout, body.parts)
    time = (np.arange(frames) * selection.frame_seconds).astype(np.float32)
    clock = layout.place(time, bounds=True)
    turns = [layout.reserve(frames, 4, np.float32) for _ in range(joints)]
    moves = [layout.reserve(frames, 3, np.float32) for _ in range(joints)]
    samplers: list[dict[str, Any]] = []
    channels: list[dict[str, Any]] = []
    for joint in range(joints):
        for path_name, output in (("rotation", turns[joint]), ("translation", moves[joint])):
            channels.append({"sampler": len(samplers), "target": {"node": joint + 1, "path": path_name}})
            samplers.append({"input": clock, "output": output, "interpolation": "LINEAR"})
    content["animations"] = [{"name": visit.name, "samplers": samplers, "channels": channels}]
    first = recording.poses(slice(visit.first, visit.first + 1), slots)
    start = body.tracks(recording, first, visit.slot)
    content["nodes"] = _nodes(body, visit.name, start.scale, start.translation[0])
    content |= {
        "accessors": layout.accessors,
        "bufferViews": layout.views,
        "buffers": [{"byteLength": layout.size}],
    }
    head = _header(content, layout.size)
    with path.open("wb") as file:
        file.write(head)
        file.truncate(len(head) + layout.size)
        for offset, values in layout.filled:
            file.seek(len(head) + offset)
            file.write(values.tobytes())
        for block in selection.blocks(1):
            begin, end = max(block.start, visit.first), min(block.stop, visit.last + 1)
            if begin >= end:
                continue
            tracks = body.tracks(recording, recording.poses(slice(begin, end), slots), visit.slot)
            for joint in range(joints):
                for accessor, values in (
                    (turns[joint], tracks.rotation[:, joint][:, [1, 2, 3, 0]]),
                    (moves[joint], tracks.translation[:, joint]),
                ):
                    rows = np.ascontiguousarray(values, np.float32)
                    file.seek(len(head) + layout.offset(accessor) + (begin - visit.first) * rows[0].nbytes)
                    file.write(rows.tobytes())


def _header(content: dict[str, Any], size: int) -> bytes:
    """The GLB header, the JSON chunk, and the header of the binary chunk."""
    text = json.dumps(content, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    total = 12 + 8 + len(text) + 8 + size
    return (
        struct.pack("<III", MAGIC, VERSION, total)
        + struct.pack("<II", len(text), JSON_CHUNK)
        + text
        + struct.pack("<II", size, BINARY_CHUNK)
    )


def _nodes(body: Body, name: str, scale: float, translation: AnyArray) -> list[dict[str, Any]]:
    """The person's node, its joints in rest pose where the person comes in, and its meshes."""
    rotation = body.rest_rotation.copy()
    for joint, parent in enumerate(body.parent):
        if parent >= 0:
            rotation[joint] = multiply(conjugate(body.rest_rotation[parent]), body.rest_rotation[joint])
    joints = len(body.joint_names)
    roots = [joint + 1 for joint, parent in enumerate(body.parent) if parent < 0]
    meshes = list(range(joints + 1, joints + 1 + len(body.parts)))
    nodes: list[dict[str, Any]] = [{"name": name, "scale": [scale] * 3, "children": roots + meshes}]
    for joint, joint_name in enumerate(body.joint_names):
        node: dict[str, Any] = {
            "name": joint_name,
            "rotation": rotation[joint][[1, 2, 3, 0]].tolist(),
            "translation": translation[joint].tolist(),
        }
        children = [child + 1 for child, parent in enumerate(body.parent) if parent == joint]
        if children:
            node["children"] = children
        nodes.append(node)
    nodes += [{"mesh": mesh, "skin": 0} for mesh in range(len(body.parts))]
    return nodes


def _add_meshes(content: dict[str, Any], layout: Layout, parts: Sequence[MeshPart]) -> None:
    content["meshes"], content["materials"] = [], []
    for part in parts:
        material: dict[str, Any] = {
            "pbrMetallicRoughness": {
                "baseColorFactor": part.colour.tolist(), "metallicFactor": 0.0, "roughnessFactor": 0.8
            }
        }  # fmt: skip
        attributes = {
            "POSITION": layout.place(part.position, ARRAY_BUFFER, bounds=True),
            "NORMAL": layout.place(part.normal, ARRAY_BUFFER),
            "TEXCOORD_0": layout.place(part.texture_coordinate, ARRAY_BUFFER),
            "JOINTS_0": layout.place(part.joint.astype(np.uint16), ARRAY_BUFFER),
            "WEIGHTS_0": layout.place(part.weight, ARRAY_BUFFER),
        }
        indices = layout.place(part.triangle.reshape(-1).astype(np.uint32), ELEMENT_BUFFER)
        if part.image:
            images, textures = content.setdefault("images", []), content.setdefault("textures", [])
            kind = "image/png" if part.image[:4] == b"\x89PNG" else "image/jpeg"
            images.append({"bufferView": layout.place_bytes(part.image), "mimeType": kind})
            textures.append({"source": len(images) - 1})
            material["pbrMetallicRoughness"]["baseColorTexture"] = {"index": len(textures) - 1}
        content["materials"].append(material)
        primitive = {
            "attributes": attributes, "indices": indices, "material": len(content["materials"]) - 1
        }  # fmt: skip
        content["meshes"].append({"primitives": [primitive]})
