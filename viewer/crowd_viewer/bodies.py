"""Bodies as the renderer needs them: meshes by level, limbs as capsules, and landmarks for clothes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from crowd.motion.skeleton import Segment, Skeleton

Float32Array = npt.NDArray[np.float32]
FloatArray = npt.NDArray[np.float64]

TRUNK, ARM, HAND = 0, 1, 2


@dataclass(frozen=True)
class Limbs:
    """Capsules of a body in rest pose.

    Attributes
    ----------
    joint : (C,) int32
    start, end : (C, 3) float64
        m, from the ground below the root.
    radius : (C,) float64
        m.
    """

    joint: npt.NDArray[np.int32]
    start: FloatArray
    end: FloatArray
    radius: FloatArray


@dataclass(frozen=True)
class Mesh:
    """A skin in rest pose.

    Attributes
    ----------
    position, normal : (V, 3) float32
        m, from the ground below the root.
    joint : (V, 4) uint8
    weight : (V, 4) float32
        Share of each joint; they add up to 1.
    triangle : (T, 3) uint32
        Anticlockwise from outside.
    """

    position: Float32Array
    normal: Float32Array
    joint: npt.NDArray[np.uint8]
    weight: Float32Array
    triangle: npt.NDArray[np.uint32]


@dataclass(frozen=True)
class Body:
    """One build of body: skins from fine to coarse, none or as many as there are mesh levels, and limbs."""

    meshes: tuple[Mesh, ...]
    limbs: Limbs


def built_in_bodies(skeleton: Skeleton) -> tuple[Body, ...]:
    """One body for each build; only limbs where the skeleton is not the built-in one."""
    return (Body((), simple_limbs(skeleton)),)


def rest_positions(skeleton: Skeleton) -> FloatArray:
    """Joints in rest pose, m. (J, 3)."""
    rest = np.zeros((skeleton.joint_count, 3))
    for joint, parent in enumerate(skeleton.parent):
        rest[joint] = skeleton.offset[joint] + (rest[parent] if parent >= 0 else 0.0)
    return rest


def joint_parts(skeleton: Skeleton) -> npt.NDArray[np.int32]:
    """Whether the flesh of each joint is trunk and leg, arm, or hand. (J,)."""
    arms = {"upper_arm", "forearm"}
    hands = {"hand", "thumb", "index", "middle", "ring", "little"}
    part = np.full(skeleton.joint_count, TRUNK, np.int32)
    for joint, name in enumerate(skeleton.joint_names):
        side, _, rest = name.partition("_")
        if side in ("left", "right"):
            if rest in arms:
                part[joint] = ARM
            elif rest.split("_")[0] in hands:
                part[joint] = HAND
    return part


def flesh_segments(skeleton: Skeleton) -> npt.NDArray[np.int32]:
    """Segment whose scale stretches the flesh around each joint: that of the bone below it. (J,)."""
    segment = np.array(skeleton.segment, np.int32)
    for name, part in (("pelvis", Segment.PELVIS), ("clavicle", Segment.SHOULDER), ("hand", Segment.HAND)):
        segment[[name in joint for joint in skeleton.joint_names]] = int(part)
    for joint, name in enumerate(skeleton.joint_names):
        if name.endswith("upper_arm"):
            segment[joint] = int(Segment.ARM)
        elif name.endswith("thigh"):
            segment[joint] = int(Segment.LEG)
        elif name.endswith("foot"):
            segment[joint] = int(Segment.FOOT)
        elif name == "spine_4":
            segment[joint] = int(Segment.TORSO)
    return segment


def simple_limbs(skeleton: Skeleton) -> Limbs:
    """Capsules along the bones of the built-in skeleton."""
    rest, unit = rest_positions(skeleton), skeleton.stature / 1.75
    rows: list[tuple[int, FloatArray, FloatArray, float]] = []

    def add(joint: str, start: FloatArray, end: FloatArray, radius: float) -> None:
        rows.append((skeleton.joint(joint), start, end, radius * unit))

    def at(joint: str, *offset: float) -> FloatArray:
        return np.asarray(rest[skeleton.joint(joint)] + unit * np.array(offset or (0.0, 0.0, 0.0)))

    for sign in (1.0, -1.0):
        add("spine_2", at("spine_1", 0.05 * sign, -0.03, 0.0), at("spine_3", 0.056 * sign, 0.0, 0.0), 0.097)
        add("spine_3", at("spine_3", 0.058 * sign, 0.0, 0.0), at("spine_4", 0.066 * sign, 0.0, 0.0), 0.103)
    add("spine_2", at("pelvis", 0.0, 0.0, 0.012), at("spine_3", 0.0, 0.03, 0.02), 0.092)
    add("spine_4", at("spine_3", 0.0, 0.03, 0.018), at("spine_4", 0.0, 0.03, 0.014), 0.098)
    add("pelvis", at("pelvis", -0.062, -0.01, -0.008), at("pelvis", 0.062, -0.01, -0.008), 0.108)
    add("head", at("head", 0.0, -0.005, 0.035), at("head", 0.0, 0.048, 0.018), 0.088)
    for side in ("left", "right"):
        add(f"{side}_thigh", at(f"{side}_thigh"), at(f"{side}_shank"), 0.072)
        add(f"{side}_shank", at(f"{side}_shank"), at(f"{side}_foot", 0.0, 0.02, 0.0), 0.050)
        add(f"{side}_upper_arm", at(f"{side}_upper_arm", 0.0, -0.01, 0.0), at(f"{side}_forearm"), 0.046)
        add(f"{side}_forearm", at(f"{side}_forearm"), at(f"{side}_hand"), 0.036)
    for side in ("left", "right"):
        add(
            f"{side}_foot", at(f"{side}_foot", 0.0, -0.030, -0.025), at(f"{side}_toe", 0.0, 0.014, 0.0), 0.039
        )
        add(f"{side}_toe", at(f"{side}_toe", 0.0, 0.010, 0.0), at(f"{side}_toe", 0.0, 0.006, 0.055), 0.033)
        add(f"{side}_hand", at(f"{side}_hand", 0.0, -0.03, 0.0), at(f"{side}_middle_2", 0.0, 0.0, 0.0), 0.033)
    add("spine_4", at("left_upper_arm", -0.02, -0.03, 0.0), at("right_upper_arm", 0.02, -0.03, 0.0), 0.066)
    add("neck_1", at("neck_1", 0.0, -0.03, 0.0), at("head", 0.0, 0.0, 0.005), 0.056)
    joint, start, end, radius = zip(*rows, strict=True)
    return Limbs(np.array(joint, np.int32), np.array(start), np.array(end), np.array(radius))


def landmarks(skeleton: Skeleton) -> dict[str, str]:
    """Heights on the body in rest pose that clothes and faces go by, as constants for shaders."""
    rest, unit = rest_positions(skeleton), skeleton.stature / 1.75
    head, eye = rest[skeleton.joint("head")], rest[skeleton.joint("left_eye")]
    values = {
        "EYES": eye[1],
        "BROW": eye[1] + 0.045 * unit,
        "MOUTH": eye[1] - 0.068 * unit,
        "CHIN": eye[1] - 0.125 * unit,
        "HAIR_LINE": eye[1] + 0.025 * unit,
        "HEAD_MIDDLE": head[2] + 0.015 * unit,
        "NECK_LINE": rest[skeleton.joint("neck_1")][1] + 0.015 * unit,
        "CHEST": rest[skeleton.joint("spine_4")][1] + 0.03 * unit,
        "SHOE_TOP": rest[skeleton.joint("left_foot")][1] - 0.005 * unit,
    }
    return {name: f"{float(value):.5f}" for name, value in values.items()}
