"""Which joint of a source skeleton is which of ours: naming families, mapping files, suggestions."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from crowd.errors import MotionError, describe, nearest_first

SIDES = ("left", "right")
FINGERS = ("thumb", "index", "middle", "ring", "little")
CHAINS = ("spine", "neck")
"""Roles that hold any number of source joints, from the pelvis up."""
SIDED = ("clavicle", "upper_arm", "forearm", "hand", "thigh", "shank", "foot", "toe", "toe_end", "eye")
SIDED_ROLES = tuple(
    f"{side}_{part}"
    for side in SIDES
    for part in SIDED + tuple(f"{finger}_{number}" for finger in FINGERS for number in (1, 2, 3))
)
ROLES = ("pelvis", *CHAINS, "head", *SIDED_ROLES)
REQUIRED = ("pelvis", *(f"{side}_{part}" for side in SIDES for part in ("thigh", "shank", "foot")))


@dataclass(frozen=True)
class NamingFamily:
    """How one kind of software names joints.

    Attributes
    ----------
    name : str
    pattern : mapping of str to str or tuple of str
        Names by role, without their side; ``{side}`` stands where the side goes. Chains list several.
    sides : (str, str)
        Spelling of left and right.
    fingers : str
        Pattern of finger joints with ``{side}``, ``{finger}`` and ``{number}``; empty if there are none.
    finger_names : tuple of str
        Spelling of thumb, index, middle, ring and little finger.
    finger_numbers : tuple of str
        Spelling of the three joints of a finger, from the hand outwards.
    """

    name: str
    pattern: Mapping[str, str | tuple[str, ...]]
    sides: tuple[str, str]
    fingers: str = ""
    finger_names: tuple[str, str, str, str, str] = ("thumb", "index", "middle", "ring", "pinky")
    finger_numbers: tuple[str, str, str] = ("1", "2", "3")

    def spellings(self) -> dict[str, tuple[str, ...]]:
        """Normalised names that each role may have; chains in order from the pelvis up."""
        result: dict[str, tuple[str, ...]] = {}
        for role, pattern in self.pattern.items():
            names = (pattern,) if isinstance(pattern, str) else pattern
            if role in SIDED:
                for side, spelling in zip(SIDES, self.sides, strict=True):
                    result[f"{side}_{role}"] = tuple(normalised(name.format(side=spelling)) for name in names)
            else:
                result[role] = tuple(normalised(name) for name in names)
        if self.fingers:
            for side, spelling in zip(SIDES, self.sides, strict=True):
                for finger, finger_name in zip(FINGERS, self.finger_names, strict=True):
                    for number, digit in enumerate(self.finger_numbers, 1):
                        name = self.fingers.format(side=spelling, finger=finger_name, number=digit)
                        result[f"{side}_{finger}_{number}"] = (normalised(name),)
        return result


FAMILIES = (
    NamingFamily(
        "crowd engine",
        {
            "pelvis": "pelvis",
            "spine": ("spine_1", "spine_2", "spine_3", "spine_4"),
            "neck": ("neck_1", "neck_2"),
            "head": "head",
            **{part: f"{{side}}_{part}" for part in SIDED},
            "toe_end": "{side}_toe_end",
        },
        ("left", "right"),
        "{side}_{finger}_{number}",
        ("thumb", "index", "middle", "ring", "little"),
    ),
    NamingFamily(
        "SmartBody",
        {
            "pelvis": "base",
            "spine": ("spine1", "spine2", "spine3"),
            "neck": ("spine4", "spine5"),
            "head": "skullbase",
            "clavicle": "{side}_sternoclavicular",
            "upper_arm": "{side}_shoulder",
            "forearm": "{side}_elbow",
            "hand": "{side}_wrist",
            "thigh": "{side}_hip",
            "shank": "{side}_knee",
            "foot": "{side}_ankle",
            "toe": "{side}_forefoot",
            "toe_end": "{side}_toe",
        },
        ("l", "r"),
        "{side}_{finger}{number}",
    ),
    NamingFamily(
        "SmartBody Jt",
        {
            "pelvis": "JtRoot",
            "spine": ("JtSpineA", "JtSpineB", "JtSpineC"),
            "neck": ("JtNeckA", "JtNeckB"),
            "head": "JtSkullA",
            "clavicle": "JtClavicle{side}",
            "upper_arm": "JtShoulder{side}",
            "forearm": "JtElbow{side}",
            "hand": "JtWrist{side}",
            "thigh": "JtHip{side}",
            "shank": "JtKnee{side}",
            "foot": "JtAnkle{side}",
            "toe": "JtBall{side}",
            "toe_end": "JtToe{side}",
            "eye": "JtEye{side}",
        },
        ("Lf", "Rt"),
        "Jt{finger}{number}{side}",
        ("thumb", "index", "middle", "ring", "little"),
        ("A", "B", "C"),
    ),
    NamingFamily(
        "Acclaim",
        {
            "pelvis": "root",
            "spine": ("lowerback", "upperback", "thorax"),
            "neck": ("lowerneck", "upperneck"),
            "head": "head",
            "clavicle": "{side}clavicle",
            "upper_arm": "{side}humerus",
            "forearm": "{side}radius",
            "hand": "{side}wrist",
            "thigh": "{side}femur",
            "shank": "{side}tibia",
            "foot": "{side}foot",
            "toe": "{side}toes",
            "toe_end": "{side}toes_end",
        },
        ("l", "r"),
    ),
    NamingFamily(
        "DeepMimic",
        {
            "pelvis": "root",
            "spine": ("chest",),
            "head": "neck",
            "upper_arm": "{side}_shoulder",
            "forearm": "{side}_elbow",
            "hand": "{side}_wrist",
            "thigh": "{side}_hip",
            "shank": "{side}_knee",
            "foot": "{side}_ankle",
        },
        ("left", "right"),
    ),
    NamingFamily(
        "HumanIK and Mixamo",
        {
            "pelvis": ("Hips", "Hip"),
            "spine": ("Spine", "Spine1", "Spine2", "Spine3", "Spine4"),
            "neck": ("Neck", "Neck1"),
            "head": "Head",
            "clavicle": "{side}Shoulder",
            "upper_arm": "{side}Arm",
            "forearm": "{side}ForeArm",
            "hand": "{side}Hand",
            "thigh": ("{side}UpLeg", "{side}HipJoint"),
            "shank": "{side}Leg",
            "foot": "{side}Foot",
            "toe": ("{side}ToeBase", "{side}Toe"),
            "toe_end": ("{side}Toe_End", "{side}ToeBase_end"),
            "eye": "{side}Eye",
        },
        ("Left", "Right"),
        "{side}Hand{finger}{number}",
    ),
    NamingFamily(
        "Biovision",
        {
            "pelvis": "Hips",
            "spine": ("Chest", "Chest2", "Chest3", "Chest4"),
            "neck": ("Neck",),
            "head": "Head",
            "clavicle": "{side}Collar",
            "upper_arm": "{side}Shoulder",
            "forearm": "{side}Elbow",
            "hand": "{side}Wrist",
            "thigh": "{side}Hip",
            "shank": "{side}Knee",
            "foot": "{side}Ankle",
            "toe": "{side}Toe",
        },
        ("Left", "Right"),
    ),
    NamingFamily(
        "iPi",
        {
            "pelvis": "Hip",
            "spine": ("LowerSpine", "MiddleSpine", "Chest"),
            "neck": ("Neck",),
            "head": "Head",
            "clavicle": "{side}Clavicle",
            "upper_arm": "{side}Shoulder",
            "forearm": "{side}Forearm",
            "hand": "{side}Hand",
            "thigh": "{side}Thigh",
            "shank": "{side}Shin",
            "foot": "{side}Foot",
            "toe": "{side}Toe",
            "toe_end": "{side}Toe_end",
        },
        ("L", "R"),
        "{side}Finger{finger}{number}",
        ("0", "1", "2", "3", "4"),
        ("", "1", "2"),
    ),
    NamingFamily(
        "Unreal",
        {
            "pelvis": "pelvis",
            "spine": ("spine_01", "spine_02", "spine_03", "spine_04", "spine_05"),
            "neck": ("neck_01", "neck_02"),
            "head": "head",
            "clavicle": "clavicle_{side}",
            "upper_arm": "upperarm_{side}",
            "forearm": "lowerarm_{side}",
            "hand": "hand_{side}",
            "thigh": "thigh_{side}",
            "shank": "calf_{side}",
            "foot": "foot_{side}",
            "toe": "ball_{side}",
        },
        ("l", "r"),
        "{finger}_0{number}_{side}",
    ),
    NamingFamily(
        "Blender Rigify",
        {
            "pelvis": ("hips", "spine", "pelvis"),
            "spine": ("spine.001", "spine.002", "spine.003"),
            "neck": ("spine.004", "spine.005", "neck"),
            "head": ("head", "spine.006"),
            "clavicle": "shoulder.{side}",
            "upper_arm": "upper_arm.{side}",
            "forearm": "forearm.{side}",
            "hand": "hand.{side}",
            "thigh": "thigh.{side}",
            "shank": "shin.{side}",
            "foot": "foot.{side}",
            "toe": "toe.{side}",
        },
        ("L", "R"),
        "f_{finger}.0{number}.{side}",
    ),
    NamingFamily(
        "VRM",
        {
            "pelvis": "hips",
            "spine": ("spine", "chest", "upperChest"),
            "neck": ("neck",),
            "head": "head",
            "clavicle": "{side}Shoulder",
            "upper_arm": "{side}UpperArm",
            "forearm": "{side}LowerArm",
            "hand": "{side}Hand",
            "thigh": "{side}UpperLeg",
            "shank": "{side}LowerLeg",
            "foot": "{side}Foot",
            "toe": "{side}Toes",
            "eye": "{side}Eye",
        },
        ("left", "right"),
        "{side}{finger}{number}",
        ("Thumb", "Index", "Middle", "Ring", "Little"),
        ("Proximal", "Intermediate", "Distal"),
    ),
    NamingFamily(
        "Quaternius",
        {
            "pelvis": ("Hips", "Body"),
            "spine": ("Abdomen", "Torso", "Chest"),
            "neck": ("Neck",),
            "head": "Head",
            "clavicle": "Shoulder.{side}",
            "upper_arm": "UpperArm.{side}",
            "forearm": "LowerArm.{side}",
            "hand": ("Hand.{side}", "Wrist.{side}", "Palm2.{side}"),
            "thigh": "UpperLeg.{side}",
            "shank": "LowerLeg.{side}",
            "foot": "Foot.{side}",
            "toe": ("Toe.{side}", "Toes.{side}"),
        },
        ("L", "R"),
        "{finger}{number}.{side}",
        ("Thumb", "Index", "Middle", "Ring", "Pinky"),
    ),
)


@dataclass(frozen=True)
class JointMap:
    """Source joints by role.

    Attributes
    ----------
    family : str
        Naming family, or the mapping file.
    joint : mapping of str to int
        Source joint of every role that is found, chains left out.
    chain : mapping of str to tuple of int
        Source joints of ``spine`` and ``neck``, from the pelvis up.
    unused : tuple of str
        Source joints without a role.
    """

    family: str
    joint: Mapping[str, int]
    chain: Mapping[str, tuple[int, ...]]
    unused: tuple[str, ...]


def normalised(name: str) -> str:
    """Reduce a joint name to what families agree on: no namespace, no separators, lower case."""
    bare = name.rsplit(":", 1)[-1]
    bare = re.sub(r"^mixamorig\d*_?", "", bare, flags=re.IGNORECASE)
    return re.sub(r"[^a-z0-9]", "", bare.lower())


def map_joints(names: Sequence[str], where: str) -> JointMap:
    """Recognise the naming family of a skeleton and map its joints.

    Parameters
    ----------
    names : sequence of str
        Source joint names.
    where : str
        File, for the message.

    Raises
    ------
    MotionError
        No family names all of `REQUIRED`; the nearest family and the nearest names are told.
    """
    family, joint, chain = nearest_family(names)
    missing = [role for role in REQUIRED if role not in joint]
    if missing:
        wanted = family.spellings()[missing[0]][0]
        raise MotionError(
            describe(
                f"{where}: joint names",
                f"no joint for {', '.join(missing)} (nearest family: {family.name}); "
                "name them in a mapping file: --joints, or NAME.joints.toml beside a character",
                allowed=f"like {nearest_first(wanted, names)}",
            )
        )
    return joint_map(family.name, names, joint, chain)


def nearest_family(
    names: Sequence[str],
) -> tuple[NamingFamily, dict[str, int], dict[str, tuple[int, ...]]]:
    """The naming family that knows most of some joints, with the joints and chains that it knows."""
    place: dict[str, int] = {}
    for index, name in enumerate(names):
        place.setdefault(normalised(name), index)
    found = [match_family(family, place) for family in FAMILIES]
    best = max(range(len(FAMILIES)), key=lambda k: coverage(*found[k]))
    return FAMILIES[best], *found[best]


def match_family(
    family: NamingFamily, place: Mapping[str, int]
) -> tuple[dict[str, int], dict[str, tuple[int, ...]]]:
    """Source joints by role, and chains, as one family spells them."""
    joint: dict[str, int] = {}
    chain: dict[str, tuple[int, ...]] = {}
    for role, spellings in family.spellings().items():
        present = tuple(place[name] for name in spellings if name in place)
        if role in CHAINS:
            chain[role] = present
        elif present:
            joint[role] = present[0]
    taken = joint.get("pelvis")
    return joint, {role: tuple(i for i in joints if i != taken) for role, joints in chain.items()}


def coverage(joint: Mapping[str, int], chain: Mapping[str, tuple[int, ...]]) -> tuple[int, int]:
    """Rank of a match: required roles, then all."""
    required = sum(role in joint for role in REQUIRED)
    return required, len(joint) + sum(len(joints) for joints in chain.values())


def joint_map(
    family: str, names: Sequence[str], joint: Mapping[str, int], chain: Mapping[str, tuple[int, ...]]
) -> JointMap:
    """Complete a match with the joints that have no role."""
    used = set(joint.values()).union(*chain.values())
    unused = tuple(name for index, name in enumerate(names) if index not in used)
    return JointMap(family, dict(joint), {role: chain.get(role, ()) for role in CHAINS}, unused)


def read_mapping(path: Path, names: Sequence[str]) -> JointMap:
    """Read a mapping file: TOML with one line for each role.

    ``left_thigh = "Leg1_L"``; chains are lists from the pelvis up, ``spine = ["Low", "High"]``. Roles that
    the file leaves out are recognised by their names, as far as a naming family knows them;
    ``head = []`` says that there is no head.

    Raises
    ------
    MotionError
        The file cannot be read, or names an unknown role or joint, or lacks a required role.
    """
    try:
        table = tomllib.loads(path.read_text("utf-8"))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise MotionError(describe(str(path), "is not a mapping file", str(error))) from error
    place = {name: index for index, name in enumerate(names)}
    told: dict[str, tuple[int, ...]] = {}
    for role, value in table.items():
        if role not in ROLES:
            raise MotionError(describe(f"{path}: {role}", "is no role", role, nearest_first(role, ROLES)))
        listed = value if isinstance(value, list) else [value]
        if role not in CHAINS and len(listed) > 1:
            raise MotionError(describe(f"{path}: {role}", "takes one joint", value))
        for name in listed:
            if name not in place:
                known = nearest_first(str(name), names)
                raise MotionError(describe(f"{path}: {role}", "the skeleton has no such joint", name, known))
        told[role] = tuple(place[name] for name in listed)
    taken = set().union(*told.values())
    _, joint, chain = nearest_family(names)
    joint = {role: index for role, index in joint.items() if role not in told and index not in taken}
    chain = {role: tuple(index for index in found if index not in taken) for role, found in chain.items()}
    chain |= {role: found for role, found in told.items() if role in CHAINS}
    joint |= {role: found[0] for role, found in told.items() if role not in CHAINS and found}
    missing = [role for role in REQUIRED if role not in joint]
    if missing:
        raise MotionError(describe(str(path), "lacks required roles", ", ".join(missing)))
    return joint_map(str(path), names, joint, chain)
