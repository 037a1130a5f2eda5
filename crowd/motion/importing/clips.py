"""Clips that are not gait cycles, mirrored clips, and how good a clip is."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from crowd.motion.body import sole_points
from crowd.motion.clip import Clip, ClipKind, FootEvent
from crowd.motion.importing.cycles import close_seam, heading_of, posed
from crowd.motion.importing.retarget import Retargeted, smoothed
from crowd.motion.rotation import about, continuous, multiply, rotate
from crowd.motion.skeleton import Skeleton

FloatArray = npt.NDArray[np.float64]

ROOT_SMOOTHING = 0.25
"""A root that follows the pelvis is averaged over this to each side, s."""
IN_PLACE = (ClipKind.IDLE, ClipKind.GESTURE, ClipKind.REACH, ClipKind.HAND_POSE)


def plain_clip(
    name: str,
    kind: ClipKind,
    motion: Retargeted,
    skeleton: Skeleton,
    stands_first: bool,
) -> Clip:
    """Make a clip that is played once, or an idle that repeats; without foot events.

    The root of clips in place stands below the pelvis, faces as the feet do and does not move; that of
    others follows the pelvis, averaged, and faces as the feet do where somebody stands first.
    """
    yaw = facing_of_feet(motion, skeleton)
    if kind in IN_PLACE:
        path = np.repeat(
            motion.pelvis[:1] if kind is not ClipKind.IDLE else motion.pelvis.mean(0)[None], 1, 0
        )
        root = np.repeat(path * (1.0, 0.0, 1.0), len(yaw), axis=0)
        heading = np.full(len(yaw), mean_angle(yaw) if kind is ClipKind.IDLE else yaw[0])
    else:
        reach = min(max(round(ROOT_SMOOTHING * motion.frame_rate), 1), max(len(yaw) // 3, 1))
        unwrapped = np.unwrap(heading_of(motion.rotation_local[:, 0]))
        if stands_first:
            unwrapped += mean_angle(yaw[:1] - unwrapped[:1])
        heading = smoothed(unwrapped, reach)
        root = np.stack([smoothed(motion.pelvis[:, axis], reach) for axis in range(3)], axis=1)
        root[:, 1] = 0.0
    back = about(1, -heading)
    rotation = motion.rotation_local.copy()
    rotation[:, 0] = multiply(back, rotation[:, 0])
    pelvis = rotate(back, motion.pelvis - root)
    if kind is ClipKind.IDLE and len(rotation) > 2:
        rotation, pelvis = close_seam(rotation, pelvis, skeleton)
    start = about(1, -heading[:1])
    return Clip(
        name,
        kind,
        motion.frame_rate,
        continuous(rotation).astype(np.float32),
        pelvis.astype(np.float32),
        rotate(start, root - root[:1]),
        heading - heading[0],
        is_cyclic=kind is ClipKind.IDLE,
    )


def facing_of_feet(motion: Retargeted, skeleton: Skeleton) -> FloatArray:
    """Mean heading of both feet, rad, (F,)."""
    rotation, _ = posed(motion.rotation_local, motion.pelvis, skeleton)
    feet = [heading_of(rotation[:, skeleton.joint(f"{side}_foot")]) for side in ("left", "right")]
    return np.asarray(np.angle(np.exp(1j * feet[0]) + np.exp(1j * feet[1])))


def mean_angle(angles: FloatArray) -> float:
    """Circular mean, rad."""
    return float(np.angle(np.exp(1j * angles).mean()))


def stance_drift(clip: Clip, skeleton: Skeleton) -> float:
    """Mean way, m, that heel or ball of a planted foot drifts over the ground in a stance.

    The heel counts until the foot is flat, the ball from then on.
    """
    rotation, position = posed(
        clip.rotation_local.astype(np.float64), clip.pelvis_position_root.astype(np.float64), skeleton
    )
    turn = about(1, clip.root_yaw)
    drifts = []
    for foot, side in enumerate(("right", "left")):
        joint = skeleton.joint(f"{side}_foot")
        kinds = list(FootEvent)[4 * foot : 4 * foot + 4]
        times = {kind: [time for time, event in clip.foot_events if event is kind] for kind in kinds}
        ball = position[:, joint] + rotate(rotation[:, joint], sole_points()[1])
        world = clip.root_position + rotate(turn, ball)
        for flat in times[kinds[1]]:
            rises = next((time for time in sorted(times[kinds[2]]) if time >= flat), None)
            if rises is None or rises - flat < 2.0 / clip.frame_rate:
                continue
            first, last = round(flat * clip.frame_rate), min(round(rises * clip.frame_rate), len(world) - 1)
            drifts.append(float(np.hypot(*(world[last] - world[first])[[0, 2]])))
    return float(np.mean(drifts)) if drifts else 0.0
