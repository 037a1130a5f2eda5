"""Retarget to the project's skeleton: rest poses matched, proportions bridged, feet on the ground."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from crowd.motion.body import leg_lengths, sole_points
from crowd.motion.importing.axes import PosedSource
from crowd.motion.importing.joint_names import FINGERS, SIDES, JointMap
from crowd.motion.rotation import about, conjugate, continuous, multiply, rotate, slerp, swing
from crowd.motion.skeleton import Skeleton
from crowd.motion.source import world_pose

FloatArray = npt.NDArray[np.float64]

LONGEST = 0.9985
"""Share of its length to which a leg is stretched at most, so that knees do not lock."""
TOE_DOWN = 0.06
"""A toe that the source does not move bends to the ground while the ball is nearer than this, m."""
MOST_TIP = np.radians(22.0)
NEAR_GROUND = 0.05
"""A foot higher than this swings freely, m."""
TOE_LENGTH = 0.05
"""Tip of the toes before the ball, m."""
SOLE_BELOW_JOINTS = 0.015
"""Sole below the lowest joint of a foot, m."""
PARALLEL = 1e-3
"""Bones of one skeleton in several proportions differ in direction by less, rad."""
LIMBS = {
    "upper_arm": "forearm",
    "forearm": "hand",
    "hand": "middle_1",
    "thigh": "shank",
    "shank": "foot",
}
"""Joints whose segments are aimed like the source's in its rest pose, with the joint that they point to."""


@dataclass(frozen=True)
class Retargeted:
    """A motion on the project's skeleton, in world space.

    Attributes
    ----------
    rotation_local : (F, J, 4) float64
        Against the parent; the pelvis against the world.
    pelvis : (F, 3) float64
        m; the ground is at y = 0.
    travel : (F, 3) float64
        The source's own pelvis joint, in our scale, m; speeds are measured on it.
    frame_rate : float
    scale : float
        Our leg length over the source's; distances are multiplied by it.
    """

    rotation_local: FloatArray
    pelvis: FloatArray
    travel: FloatArray
    frame_rate: float
    scale: float


def leg_scale(source: PosedSource, joints: JointMap) -> float:
    """Leg length of the project's skeleton over that of the source."""
    rest = source.rest_position
    lengths = []
    for side in SIDES:
        hip, knee, ankle = (rest[joints.joint[f"{side}_{part}"]] for part in ("thigh", "shank", "foot"))
        lengths.append(np.linalg.norm(knee - hip) + np.linalg.norm(ankle - knee))
    return float(sum(leg_lengths()) / np.mean(lengths))


def retarget(
    source: PosedSource,
    joints: JointMap,
    skeleton: Skeleton,
    is_flat: npt.NDArray[np.bool_],
    soles: FloatArray,
    ground: float,
) -> Retargeted:
    """Put a motion onto the project's skeleton.

    Parameters
    ----------
    source : PosedSource
    joints : JointMap
    skeleton : Skeleton
        The project's; rest frames along the world's axes.
    is_flat : (F, 2) bool
        Heel and ball of the right and the left foot are on the ground.
    soles : (F, 2) float64
        Height of the lowest point of the right and the left foot over the ground, m.
    ground : float
        Height of the ground under the source, m.

    Notes
    -----
    Rotations are carried over in world space against both rest poses; limb segments are first aimed like the
    source's in its rest pose, so that a T-pose and hanging arms agree. Feet then stay where the source's are
    (times the ratio of leg lengths), soles as high over the ground, and the legs bend to meet them. Motion of
    the project's own skeleton, such as an exported recording, is taken as it is.
    """
    scale = leg_scale(source, joints)
    rotation = world_rotations(source, joints, skeleton)
    travel = scale * source.position[:, joints.joint["pelvis"]]
    if is_ours(source, joints, skeleton):
        return Retargeted(continuous(local_of(rotation, skeleton)), travel, travel, source.frame_rate, scale)
    level_feet(rotation, skeleton, is_flat)
    pelvis = place_pelvis(source, joints, skeleton, rotation, scale, ground)
    ankles = place_ankles(source, joints, skeleton, rotation, scale, ground, soles)
    pelvis = within_reach(pelvis, rotation, skeleton, ankles)
    for side, ankle in zip(("right", "left"), ankles, strict=True):
        bend_leg(rotation, skeleton, side, pelvis, ankle)
    return Retargeted(continuous(local_of(rotation, skeleton)), pelvis, travel, source.frame_rate, scale)


def local_of(rotation: FloatArray, skeleton: Skeleton) -> FloatArray:
    """Rotations (F, J, 4) against the parent of ones against the world."""
    local = rotation.copy()
    for joint, parent in enumerate(skeleton.parent):
        if parent >= 0:
            local[:, joint] = multiply(conjugate(rotation[:, parent]), rotation[:, joint])
    return local


def is_ours(source: PosedSource, joints: JointMap, skeleton: Skeleton) -> bool:
    """Whether a source has the project's own skeleton, in any proportions: such motion is taken as it is."""
    place: dict[str, int] = dict(joints.joint)
    for chain, found in joints.chain.items():
        place |= {f"{chain}_{number}": joint for number, joint in enumerate(found, 1)}
    if any(name not in place for name in skeleton.joint_names):
        return False
    for joint, parent in enumerate(skeleton.parent):
        if parent < 0:
            continue
        names = skeleton.joint_names[joint], skeleton.joint_names[parent]
        way = source.rest_position[place[names[0]]] - source.rest_position[place[names[1]]]
        ours = skeleton.offset[joint]
        length = np.linalg.norm(way) * np.linalg.norm(ours)
        if np.linalg.norm(np.cross(way, ours)) > PARALLEL * length or way @ ours < 0.0:
            return False
    return True


def world_rotations(source: PosedSource, joints: JointMap, skeleton: Skeleton) -> FloatArray:
    """World rotations (F, J, 4) of our joints; those without a source follow their parent."""
    frames = len(source.position)
    known: dict[int, FloatArray] = {}
    pelvis = source.turned[:, joints.joint["pelvis"]]
    known[0] = pelvis
    spine = [pelvis] + [source.turned[:, joint] for joint in joints.chain["spine"]]
    for number in range(1, 5):
        known[skeleton.joint(f"spine_{number}")] = along_chain(spine, number / 4)
    chest = spine[-1]
    head = source.turned[:, joints.joint["head"]] if "head" in joints.joint else chest
    neck = [chest] + [source.turned[:, joint] for joint in joints.chain["neck"]] + [head]
    for number in (1, 2):
        known[skeleton.joint(f"neck_{number}")] = along_chain(neck, number / 3)
    known[skeleton.joint("head")] = head
    for role, joint in joints.joint.items():
        side, _, part = role.partition("_")
        if side in SIDES and part != "toe_end":
            known[skeleton.joint(role)] = multiply(
                source.turned[:, joint], rest_aim(source, joints, skeleton, role)
            )
    rotation = np.zeros((frames, skeleton.joint_count, 4))
    for joint, parent in enumerate(skeleton.parent):
        rotation[:, joint] = known.get(joint, rotation[:, parent])
    return rotation


def along_chain(rotations: list[FloatArray], share: float) -> FloatArray:
    """Rotation at a share of the way up a chain, between those of its joints."""
    place = share * (len(rotations) - 1)
    below = min(int(place), len(rotations) - 2) if len(rotations) > 1 else 0
    if len(rotations) == 1:
        return rotations[0]
    return slerp(rotations[below], rotations[below + 1], place - below)


def rest_aim(source: PosedSource, joints: JointMap, skeleton: Skeleton, role: str) -> FloatArray:
    """Rotation that puts a segment of our rest pose along the source's, (4,)."""
    side, _, part = role.partition("_")
    still = np.array([1.0, 0.0, 0.0, 0.0])
    rest = source.rest_position
    if part in ("foot", "toe"):
        ahead = next((joints.joint[r] for r in (f"{side}_toe", f"{side}_toe_end") if r in joints.joint), None)
        if ahead is None:
            return still
        way = rest[ahead] - rest[joints.joint[f"{side}_foot"]]
        return about(1, np.arctan2(way[0], way[2])) if np.hypot(way[0], way[2]) > 1e-6 else still
    finger, _, number = part.rpartition("_")
    child = LIMBS.get(part) or (f"{finger}_{int(number) + 1}" if finger in FINGERS else None)
    if child is None:
        return still
    if f"{side}_{child}" not in joints.joint:
        above = {"hand": "forearm", **{f"{f}_3": f"{f}_2" for f in FINGERS}}.get(part)
        above = above or ("hand" if finger in FINGERS else None)
        has_above = above is not None and f"{side}_{above}" in joints.joint
        return rest_aim(source, joints, skeleton, f"{side}_{above}") if has_above else still
    way = rest[joints.joint[f"{side}_{child}"]] - rest[joints.joint[role]]
    ours = skeleton.offset[skeleton.joint(f"{side}_{child}")]
    return swing(ours, way) if np.linalg.norm(way) > 1e-6 else still


def level_feet(rotation: FloatArray, skeleton: Skeleton, is_flat: npt.NDArray[np.bool_]) -> None:
    """Turn each foot by a constant so that its sole is level on average while heel and ball are down."""
    for column, side in enumerate(("right", "left")):
        foot, toe = skeleton.joint(f"{side}_foot"), skeleton.joint(f"{side}_toe")
        flat = is_flat[:, column]
        if not flat.any():
            continue
        # Up, in the frame of the foot: level when it is +y.
        up = rotate(conjugate(rotation[flat, foot]), np.array([0.0, 1.0, 0.0])).mean(axis=0)
        tilt = swing(np.array([0.0, 1.0, 0.0]), up)
        rotation[:, foot] = multiply(rotation[:, foot], tilt)
        rotation[:, toe] = multiply(rotation[:, toe], tilt)


def middle_of_stances(is_down: npt.NDArray[np.bool_]) -> npt.NDArray[np.bool_]:
    """Frames in the middle third of the stances of a foot."""
    result = np.zeros(len(is_down), bool)
    for begin, end in runs(is_down):
        third = (end - begin) // 3
        result[begin + third : end - third] = True
    return result


def runs(flags: npt.NDArray[np.bool_]) -> list[tuple[int, int]]:
    """First and one-past-last index of each run of true values."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(np.int8)))
    return [(int(begin), int(end)) for begin, end in zip(edges[::2], edges[1::2], strict=True)]


def place_pelvis(
    source: PosedSource,
    joints: JointMap,
    skeleton: Skeleton,
    rotation: FloatArray,
    scale: float,
    ground: float,
) -> FloatArray:
    """Pelvis positions (F, 3) that keep the height of the hips over the ankles, in leg lengths."""
    hips = np.mean([source.position[:, joints.joint[f"{side}_thigh"]] for side in SIDES], axis=0)
    ours = np.mean([skeleton.offset[skeleton.joint(f"{side}_thigh")] for side in SIDES], axis=0)
    target = scale * hips
    target[:, 1] = scale * (hips[:, 1] - ground - sole_depth(source, joints)) - sole_points()[0][1]
    return np.asarray(target - rotate(rotation[:, 0], ours))


def sole_depth(source: PosedSource, joints: JointMap) -> float:
    """Height of the source's ankles over the ground in its rest pose, m.

    A rest pose that stands on y = 0 tells; otherwise the sole lies a little below the lowest joint of a foot.
    """
    rest = source.rest_position
    feet = [joint for role, joint in joints.joint.items() if role.endswith(("foot", "toe", "toe_end"))]
    lowest = rest[feet, 1].min()
    ankle = np.mean([rest[joints.joint[f"{side}_foot"], 1] for side in SIDES])
    stands = -0.01 < lowest < 0.06
    return float(np.clip(ankle if stands else ankle - lowest + SOLE_BELOW_JOINTS, 0.04, 0.14))


def place_ankles(
    source: PosedSource,
    joints: JointMap,
    skeleton: Skeleton,
    rotation: FloatArray,
    scale: float,
    ground: float,
    soles: FloatArray,
) -> FloatArray:
    """Ankle positions (2, F, 3), right and left; soles are as high over the ground as the source's.

    Parameters
    ----------
    source, joints, skeleton, rotation, scale, ground
        See `retarget`; feet in `rotation` are tipped where they are shorter than the source's.
    soles : (F, 2) float64
        Height of the lowest point of the source's right and left foot over the ground, m.
    """
    depth = sole_depth(source, joints)
    result = []
    for column, side in enumerate(("right", "left")):
        ankle = scale * source.position[:, joints.joint[f"{side}_foot"]]
        ankle[:, 1] -= scale * (ground + depth) + sole_points()[0][1]
        if f"{side}_toe" not in joints.joint:
            bend_toe(rotation, skeleton, side, ankle)
        height = scale * soles[:, column]
        nearness = np.clip(1.0 - height / NEAR_GROUND, 0.0, 1.0)
        tip_forward(rotation, skeleton, side, ankle[:, 1] - height, nearness)
        lowest = lowest_point(rotation, skeleton, side, ankle[:, 1])
        ankle[:, 1] += np.maximum(nearness * (height - lowest), -lowest)
        result.append(ankle)
    return np.array(result)


def lowest_point(rotation: FloatArray, skeleton: Skeleton, side: str, ankle_height: FloatArray) -> FloatArray:
    """Height (F,) of the lowest of heel, ball and tip of a foot whose ankle is at the given height, m."""
    foot, toe = (rotation[:, skeleton.joint(f"{side}_{part}")] for part in ("foot", "toe"))
    heel, ball = sole_points()
    joint = skeleton.offset[skeleton.joint(f"{side}_toe")]
    tip = rotate(foot, joint) + rotate(toe, ball - joint + (0.0, 0.0, TOE_LENGTH))
    below = [rotate(foot, heel)[:, 1], rotate(foot, ball)[:, 1], tip[:, 1]]
    return np.asarray(ankle_height + np.min(below, axis=0))


def tip_forward(
    rotation: FloatArray, skeleton: Skeleton, side: str, ankle_height: FloatArray, nearness: FloatArray
) -> None:
    """Tip a foot forward where its ankle is too high for heel, ball or tip to reach height 0.

    A foot shorter than the source's would hang in the air as soon as the heel rises, or pull the body down.
    Feet far from the ground, of low `nearness`, are left alone.
    """
    foot = skeleton.joint(f"{side}_foot")
    before = rotation[:, foot].copy()
    angle = np.zeros(len(ankle_height))
    for _ in range(3):
        gap = lowest_point(rotation, skeleton, side, ankle_height)
        to_ball = rotate(rotation[:, foot], sole_points()[1])
        lever = np.maximum(np.hypot(to_ball[:, 0], to_ball[:, 2]), 0.06)
        angle = np.clip(angle + gap / lever, 0.0, MOST_TIP)
        rotation[:, foot] = multiply(before, about(0, nearness * angle))


def smoothed(values: FloatArray, reach: int) -> FloatArray:
    """Weighted mean over `reach` frames to each side."""
    window = np.hanning(2 * reach + 3)[1:-1]
    padded = np.pad(values, reach, mode="edge")
    return np.convolve(padded, window / window.sum(), mode="valid")


def within_reach(
    pelvis: FloatArray, rotation: FloatArray, skeleton: Skeleton, ankles: FloatArray
) -> FloatArray:
    """Lower the pelvis smoothly where an ankle is farther away than the leg is long."""
    longest = LONGEST * sum(leg_lengths())
    missing = np.zeros(len(pelvis))
    for side, ankle in zip(("right", "left"), ankles, strict=True):
        hip = pelvis + rotate(rotation[:, 0], skeleton.offset[skeleton.joint(f"{side}_thigh")])
        across = np.hypot(ankle[:, 0] - hip[:, 0], ankle[:, 2] - hip[:, 2])
        highest = ankle[:, 1] + np.sqrt(np.maximum(longest**2 - across**2, 1e-4))
        missing = np.maximum(missing, hip[:, 1] - highest)
    if not missing.any():
        return pelvis
    reach = 3
    widest = np.lib.stride_tricks.sliding_window_view(np.pad(missing, reach, mode="edge"), 2 * reach + 1).max(
        axis=1
    )
    return pelvis - np.outer(np.maximum(smoothed(widest, reach), missing), (0.0, 1.0, 0.0))


def bend_leg(
    rotation: FloatArray, skeleton: Skeleton, side: str, pelvis: FloatArray, ankle: FloatArray
) -> None:
    """Turn thigh and shank so that the ankle is met; the knee keeps its plane and its twist."""
    thigh, shank, foot = (skeleton.joint(f"{side}_{part}") for part in ("thigh", "shank", "foot"))
    upper, lower = (np.linalg.norm(skeleton.offset[joint]) for joint in (shank, foot))
    hip = pelvis + rotate(rotation[:, 0], skeleton.offset[thigh])
    knee_way = rotate(rotation[:, thigh], skeleton.offset[shank])
    way = ankle - hip
    distance = np.linalg.norm(way, axis=1)
    direction = way / np.maximum(distance, 1e-9)[:, None]
    length = np.clip(distance, abs(upper - lower) + 1e-4, LONGEST * (upper + lower))
    ahead = rotate(rotation[:, thigh], np.array([0.0, 0.0, 1.0]))
    # A nearly straight leg has no plane of its own: the thigh's front decides.
    bend = knee_way - direction * (knee_way * direction).sum(1)[:, None] + 0.02 * ahead
    bend -= direction * (bend * direction).sum(1)[:, None]
    bend /= np.maximum(np.linalg.norm(bend, axis=1), 1e-9)[:, None]
    along = (upper**2 - lower**2 + length**2) / (2.0 * length)
    out = np.sqrt(np.maximum(upper**2 - along**2, 0.0))
    new_knee = along[:, None] * direction + out[:, None] * bend
    new_shank = length[:, None] * direction - new_knee
    rotation[:, shank] = multiply(
        swing(rotate(rotation[:, shank], skeleton.offset[foot]), new_shank), rotation[:, shank]
    )
    rotation[:, thigh] = multiply(swing(knee_way, new_knee), rotation[:, thigh])


def bend_toe(rotation: FloatArray, skeleton: Skeleton, side: str, ankle: FloatArray) -> None:
    """Bend a toe that the source does not have, so that it stays on the ground while the heel rises."""
    foot, toe = skeleton.joint(f"{side}_foot"), skeleton.joint(f"{side}_toe")
    ball = ankle + rotate(rotation[:, foot], sole_points()[1])
    ahead = rotate(rotation[:, foot], np.array([0.0, 0.0, 1.0]))
    pitch = np.arcsin(np.clip(-ahead[:, 1], 0.0, np.sin(1.0)))
    share = np.clip(1.0 - ball[:, 1] / TOE_DOWN, 0.0, 1.0)
    rotation[:, toe] = multiply(rotation[:, foot], about(0, -pitch * share * share * (3.0 - 2.0 * share)))


def foot_points(motion: Retargeted, skeleton: Skeleton) -> FloatArray:
    """Heel and ball of the soles in world space, (F, 2, 2, 3): right and left foot, heel and ball."""
    offset = np.broadcast_to(skeleton.offset, (*motion.rotation_local.shape[:2], 3)).copy()
    offset[:, 0] = motion.pelvis
    rotation, position = world_pose(skeleton.parent, motion.rotation_local, offset)
    result = np.zeros((len(offset), 2, 2, 3))
    for column, side in enumerate(("right", "left")):
        foot = skeleton.joint(f"{side}_foot")
        for row, point in enumerate(sole_points()):
            result[:, column, row] = position[:, foot] + rotate(rotation[:, foot], point)
    return result
