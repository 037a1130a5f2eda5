"""Bodies as the renderer needs them: meshes by level, limbs as capsules, and landmarks for clothes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from crowd.body import Figure, Material, Outfit, Recipe, Skin, built_in_builds
from crowd.body.builds import is_built_in
from crowd.body.stance import rest_positions
from crowd.motion.skeleton import Skeleton

Float32Array = npt.NDArray[np.float32]
FloatArray = npt.NDArray[np.float64]

TRUNK, ARM, HAND = 0, 1, 2
BY_PLACE = -1
FIXED_MATERIAL = 8
PLAIN = Recipe("plain", Figure(), Outfit())


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
    material : (C,) int32
        `Material`; `BY_PLACE` where it follows from the place on the body.
    """

    joint: npt.NDArray[np.int32]
    start: FloatArray
    end: FloatArray
    radius: FloatArray
    material: npt.NDArray[np.int32]


@dataclass(frozen=True)
class Body:
    """One build of body.

    Attributes
    ----------
    skins : tuple of Skin
        From fine to coarse, none or as many as there are mesh levels.
    limbs : Limbs
    recipe : Recipe
        What is worn where.
    """

    skins: tuple[Skin, ...]
    limbs: Limbs
    recipe: Recipe = PLAIN


def built_in_bodies(skeleton: Skeleton) -> tuple[Body, ...]:
    """One body for each build; one of only limbs where the skeleton is not the built-in one."""
    if not is_built_in(skeleton):
        return (Body((), simple_limbs(skeleton)),)
    return tuple(
        Body(build.skins, dressed_limbs(skeleton, build.recipe), build.recipe) for build in built_in_builds()
    )


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


def simple_limbs(skeleton: Skeleton) -> Limbs:
    """Capsules along the bones of the built-in skeleton."""
    rest, unit = rest_positions(skeleton), skeleton.stature / 1.75
    rows: list[tuple[int, FloatArray, FloatArray, float]] = []

    def add(joint: str, start: FloatArray, end: FloatArray, radius: float) -> None:
        rows.append((skeleton.joint(joint), start, end, radius * unit))

    def at(joint: str, *offset: float) -> FloatArray:
        return np.asarray(rest[skeleton.joint(joint)] + unit * np.array(offset or (0.0, 0.0, 0.0)))

    # Those that far people are drawn with come first: trunk, head, arms and legs.
    for sign in (1.0, -1.0):
        add("spine_2", at("spine_1", 0.05 * sign, -0.03, 0.0), at("spine_3", 0.056 * sign, 0.0, 0.0), 0.097)
        add("spine_3", at("spine_3", 0.058 * sign, 0.0, 0.0), at("spine_4", 0.066 * sign, 0.0, 0.0), 0.103)
    add("head", at("head", 0.0, -0.005, 0.035), at("head", 0.0, 0.048, 0.018), 0.088)
    for side in ("left", "right"):
        add(f"{side}_thigh", at(f"{side}_thigh"), at(f"{side}_shank"), 0.072)
        add(f"{side}_shank", at(f"{side}_shank"), at(f"{side}_foot", 0.0, 0.02, 0.0), 0.050)
        add(f"{side}_upper_arm", at(f"{side}_upper_arm", 0.0, -0.01, 0.0), at(f"{side}_forearm"), 0.046)
        add(f"{side}_forearm", at(f"{side}_forearm"), at(f"{side}_hand"), 0.036)
    add("pelvis", at("pelvis", -0.062, -0.01, -0.008), at("pelvis", 0.062, -0.01, -0.008), 0.108)
    add("spine_2", at("pelvis", 0.0, 0.0, 0.012), at("spine_3", 0.0, 0.03, 0.02), 0.092)
    add("spine_4", at("spine_3", 0.0, 0.03, 0.018), at("spine_4", 0.0, 0.03, 0.014), 0.098)
    for side in ("left", "right"):
        add(
            f"{side}_foot", at(f"{side}_foot", 0.0, -0.030, -0.025), at(f"{side}_toe", 0.0, 0.014, 0.0), 0.039
        )
        add(f"{side}_toe", at(f"{side}_toe", 0.0, 0.010, 0.0), at(f"{side}_toe", 0.0, 0.006, 0.055), 0.033)
        add(f"{side}_hand", at(f"{side}_hand", 0.0, -0.03, 0.0), at(f"{side}_middle_2", 0.0, 0.0, 0.0), 0.033)
    add("spine_4", at("left_upper_arm", -0.02, -0.03, 0.0), at("right_upper_arm", 0.02, -0.03, 0.0), 0.066)
    add("neck_1", at("neck_1", 0.0, -0.03, 0.0), at("head", 0.0, 0.0, 0.005), 0.056)
    joint, start, end, radius = zip(*rows, strict=True)
    return Limbs(
        np.array(joint, np.int32),
        np.array(start),
        np.array(end),
        np.array(radius),
        np.full(len(joint), BY_PLACE, np.int32),
    )


def dressed_limbs(skeleton: Skeleton, recipe: Recipe) -> Limbs:
    """Capsules of a build: thicker and thinner limbs, wide ones inside a skirt, hair, hat and bag."""
    figure, outfit = recipe.figure, recipe.outfit
    plain = simple_limbs(skeleton)
    names = [skeleton.joint_names[joint] for joint in plain.joint]
    factors = {
        "spine_2": 0.5 * (figure.waist + figure.chest), "spine_3": figure.chest, "spine_4": figure.chest,
        "pelvis": figure.hip, "head": figure.head, "neck_1": figure.neck, "thigh": figure.leg,
        "shank": figure.leg, "upper_arm": figure.arm, "forearm": figure.arm, "hand": figure.hand,
    }  # fmt: skip
    factor = np.array([factors.get(name, factors.get(name.split("_", 1)[-1], 1.0)) for name in names])
    radius = plain.radius * factor
    start, end = plain.start.copy(), plain.end.copy()
    around = np.array([name in ("pelvis", "spine_2", "spine_3") for name in names])
    start[around, 0] *= factor[around]
    end[around, 0] *= factor[around]
    hem = outfit.hem if outfit.hangs else outfit.bottom_hem if outfit.bottom == "skirt" else 1.0
    if hem < 0.85:
        for part in ("thigh", "shank"):
            is_in = np.array([name.endswith(part) for name in names])
            covered = hem < 0.70 if part == "thigh" else hem < 0.45
            radius[is_in] += 0.022 * covered
    extra = list(_extra_limbs(skeleton, outfit))
    joint, more_start, more_end, more_radius, material = zip(*extra, strict=True) if extra else ((),) * 5
    return Limbs(
        np.append(plain.joint, np.array(joint, np.int32)),
        np.vstack([start, np.array(more_start).reshape(-1, 3)]),
        np.vstack([end, np.array(more_end).reshape(-1, 3)]),
        np.append(radius, more_radius),
        np.append(plain.material, np.array(material, np.int32)),
    )


def _extra_limbs(
    skeleton: Skeleton, outfit: Outfit
) -> Iterator[tuple[int, tuple[float, ...], tuple[float, ...], float, int]]:
    """Capsules of hair, hat and bag."""
    head, chest = skeleton.joint("head"), skeleton.joint("spine_4")
    hair, extra = int(Material.HAIR), int(Material.EXTRA)
    if outfit.hat == "scarf":
        yield head, (0.0, 1.66, -0.010), (0.0, 1.55, -0.020), 0.092, extra
    elif outfit.hat:
        yield head, (0.0, 1.70, -0.006), (0.0, 1.69, -0.012), 0.094, extra
    elif outfit.hair != "bald":
        size = 0.112 if outfit.hair == "curls" else 0.096
        yield head, (0.0, 1.675, -0.020), (0.0, 1.64, -0.030), size, hair
    if outfit.hair in ("bob", "long") and outfit.hat != "scarf":
        low = 1.53 if outfit.hair == "bob" else 1.42
        yield head, (0.0, 1.64, -0.045), (0.0, low, -0.065), 0.075, hair
    if outfit.hair == "ponytail":
        yield head, (0.0, 1.68, -0.130), (0.0, 1.45, -0.130), 0.026, hair
    if outfit.bag == "backpack":
        yield chest, (0.0, 1.34, -0.190), (0.0, 1.14, -0.190), 0.105, extra
    if outfit.bag == "shoulder":
        yield skeleton.joint("spine_1"), (0.22, 0.90, -0.02), (0.22, 0.88, -0.02), 0.085, extra


def worn_where(recipe: Recipe) -> FloatArray:
    """Heights at which clothes end on limbs, for shaders, m. (4,).

    Sleeve, hem of the top, hem of the bottom, and shoe, with a minus where there is no hair.
    """
    outfit = recipe.outfit
    has_hair = outfit.hair != "bald" and outfit.hat != "scarf"
    bottom_hem = outfit.bottom_hem if outfit.bottom else outfit.hem
    return np.array([outfit.sleeve, outfit.hem, bottom_hem, outfit.shoe if has_hair else -outfit.shoe])


def landmarks(skeleton: Skeleton) -> dict[str, str]:
    """Heights in rest pose and joints that clothes and faces go by, as constants for shaders."""
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
    names = ("head", "left_eye", "right_eye")
    joints = {f"{name.upper()}_JOINT": str(skeleton.joint(name)) for name in names}
    return {name: f"{float(value):.5f}" for name, value in values.items()} | joints
