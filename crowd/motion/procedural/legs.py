"""Bend the legs so that the ankles meet the planned feet, lowering the pelvis where a leg is too short."""

import numpy as np
import numpy.typing as npt

from crowd.motion.body import SHANK, STATURE, THIGH
from crowd.motion.procedural.feet import FootPath, toe_angle
from crowd.motion.rotation import about, conjugate, from_axes, multiply, rotate
from crowd.motion.skeleton import Skeleton

FloatArray = npt.NDArray[np.float64]

THIGH_LENGTH, SHANK_LENGTH = THIGH * STATURE, SHANK * STATURE
LONGEST = 0.9985 * (THIGH_LENGTH + SHANK_LENGTH)
"""A leg is never stretched farther, so that knees do not lock, m."""
KNEE_OUT = 0.35
"""Share of the foot's heading that the knee follows; the rest is the pelvis's."""


def lower_pelvis(
    pelvis: FloatArray,
    rotation: FloatArray,
    hips: FloatArray,
    ankles: FloatArray,
    is_cyclic: bool,
    frames: int,
) -> FloatArray:
    """Lower the pelvis smoothly where an ankle is out of reach.

    Parameters
    ----------
    pelvis : (F, 3) float64
        m.
    rotation : (F, 4) float64
        Of the pelvis.
    hips : (2, 3) float64
        In the pelvis's frame, m.
    ankles : (2, F, 3) float64
        m.
    is_cyclic : bool
        The last frame is the first one again.
    frames : int
        Frames over which lowering is spread to each side.

    Returns
    -------
    (F, 3) float64
    """
    missing = np.zeros(len(pelvis))
    for hip, ankle in zip(hips, ankles, strict=True):
        joint = pelvis + rotate(rotation, hip)
        away = np.hypot(ankle[:, 0] - joint[:, 0], ankle[:, 2] - joint[:, 2])
        highest = ankle[:, 1] + np.sqrt(np.maximum(LONGEST**2 - away**2, 1e-4))
        missing = np.maximum(missing, joint[:, 1] - highest)
    if not (missing > 0.0).any():
        return pelvis
    kernel = np.hanning(2 * frames + 3)[1:-1]
    kernel /= kernel.sum()
    body = missing[:-1] if is_cyclic else missing
    padded = np.pad(body, 2 * frames, mode="wrap" if is_cyclic else "edge")
    widened = np.lib.stride_tricks.sliding_window_view(padded, 2 * frames + 1).max(axis=1)
    smooth = np.convolve(widened, kernel, mode="valid")
    lowered = pelvis.copy()
    lowered[:, 1] -= np.append(smooth, smooth[0]) if is_cyclic else smooth
    return lowered


def bend_leg(
    skeleton: Skeleton, side: str, pelvis: FloatArray, rotation: FloatArray, path: FootPath, out: FloatArray
) -> None:
    """Write the local rotations of one leg; `out` is (F, J, 4), `path` is in the root's frame."""
    thigh, shank, foot, toe = (skeleton.joint(f"{side}_{part}") for part in ("thigh", "shank", "foot", "toe"))
    hip = pelvis + rotate(rotation, skeleton.offset[thigh])
    way = path.ankle - hip
    length = np.minimum(np.linalg.norm(way, axis=1), LONGEST)
    up = -way / np.linalg.norm(way, axis=1, keepdims=True)
    heading = rotate(rotation, np.array([0.0, 0.0, 1.0]))
    knee_yaw = np.arctan2(heading[:, 0], heading[:, 2])
    knee_yaw = knee_yaw + KNEE_OUT * np.angle(np.exp(1j * (path.yaw - knee_yaw)))
    ahead = rotate(about(1, knee_yaw), np.array([0.0, 0.0, 1.0]))
    hinge = np.cross(up, ahead)
    hinge /= np.linalg.norm(hinge, axis=1, keepdims=True)
    frame = from_axes(hinge, up, np.cross(hinge, up))
    inner = (THIGH_LENGTH**2 + length**2 - SHANK_LENGTH**2) / (2.0 * THIGH_LENGTH * length)
    knee = (THIGH_LENGTH**2 + SHANK_LENGTH**2 - length**2) / (2.0 * THIGH_LENGTH * SHANK_LENGTH)
    flexion = np.pi - np.arccos(np.clip(knee, -1.0, 1.0))
    thigh_rotation = multiply(frame, about(0, -np.arccos(np.clip(inner, -1.0, 1.0))))
    shank_rotation = multiply(thigh_rotation, about(0, flexion))
    foot_rotation = multiply(about(1, path.yaw), about(0, -path.pitch))
    out[:, thigh] = multiply(conjugate(rotation), thigh_rotation)
    out[:, shank] = about(0, flexion)
    out[:, foot] = multiply(conjugate(shank_rotation), foot_rotation)
    out[:, toe] = about(0, toe_angle(path))
