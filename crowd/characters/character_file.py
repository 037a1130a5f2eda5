"""Characters in HDF5 files: recordings hold the characters of their people, so that one file is enough."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from crowd.characters.character import Character, MeshPart
from crowd.motion.importing.joint_names import JointMap

SKELETON_ARRAYS = ("parent", "rest", "inverse_bind")
PART_ARRAYS = ("position", "normal", "texture_coordinate", "joint", "weight", "triangle", "colour")


def write_character(group: Any, character: Character) -> None:
    """Write a character into an HDF5 group."""
    joints = character.joints
    group.attrs["name"] = character.name
    group.attrs["path"] = str(character.path)
    group.attrs["family"] = joints.family
    group.attrs["roles"] = json.dumps({"joint": dict(joints.joint), "chain": dict(joints.chain)})
    group.create_dataset("joint_names", data=list(character.joint_names))
    for name in SKELETON_ARRAYS:
        group.create_dataset(name, data=getattr(character, name))
    for number, part in enumerate(character.parts):
        place = group.create_group(f"parts/{number:03d}")
        for name in PART_ARRAYS:
            values = getattr(part, name)
            place.create_dataset(name, data=values, **({"compression": "gzip"} if values.size > 16 else {}))
        place.create_dataset("image", data=np.frombuffer(part.image, np.uint8))


def read_character(group: Any) -> Character:
    """Read a character from an HDF5 group."""
    names = tuple(group["joint_names"].asstr()[:])
    roles = json.loads(group.attrs["roles"])
    chain = {role: tuple(joints) for role, joints in roles["chain"].items()}
    used = set(roles["joint"].values()).union(*chain.values())
    unused = tuple(name for index, name in enumerate(names) if index not in used)
    parts = tuple(
        MeshPart(**{name: part[name][:] for name in PART_ARRAYS}, image=part["image"][:].tobytes())
        for part in group["parts"].values()
    )
    return Character(
        str(group.attrs["name"]),
        Path(str(group.attrs["path"])),
        names,
        joints=JointMap(str(group.attrs["family"]), roles["joint"], chain, unused),
        parts=parts,
        **{name: group[name][:] for name in SKELETON_ARRAYS},
    )
