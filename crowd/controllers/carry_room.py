"""Where both hands can have one thing: the room before a person in which neither hand leaves it."""

import numpy as np

from crowd.controllers.holding import Frames
from crowd.motion.rotation import about, conjugate, from_vector, multiply, to_vector
from crowd.state import FloatArray

CENTER = 0.75
"""Height of the middle of the room, over stature."""
FARTHEST, HIGHEST, LOWEST = 0.72, 0.50, 1.6
"""Half axes of the room around that: sideways, up, down, m; the trunk bends down, but not up."""
WALKING_FARTHEST, WALKING_LOWEST = 0.60, 0.50
"""Likewise of people who walk, whose trunk stays upright."""
CHEST = 0.63
"""Height of the middle of the chest, over stature."""
BEFORE_CHEST, AWAY = 0.15, 0.38
"""Heights from there between which the room changes from that before the chest to that below and above, m."""
NEAREST = 0.22, 0.48
"""Least distance from the body's axis before the chest, and below and above, m."""
ASIDE = 1.0, 0.4
"""Greatest angle to a side, rad."""
TURN, TILT = (0.7, 0.25), (0.4, 0.1)
"""Greatest turn about the vertical, and greatest tilt, against how both hands took it, rad."""
WALKING_TURN = 0.4
"""Share of these angles for people who walk."""


def limited(
    frames: Frames, grip_rotation: FloatArray, stature: FloatArray, size: FloatArray, walking: FloatArray
) -> Frames:
    """Bring poses of objects to near ones that both hands can give them.

    Parameters
    ----------
    frames : (A, 3) float64, (A, 4) float64
        Positions in root frames, m, and rotations there.
    grip_rotation : (A, 4) float64
        Rotations in the root frames when both hands took the objects.
    stature : (A,) float64
        m.
    size : (A,) float64
        Stature over the library's.
    walking : (A,) float64
        Share of locomotion in the pose, 0 to 1.

    Returns
    -------
    (A, 3) float64, (A, 4) float64
    """
    away, azimuth, height = cylindrical(frames[0])
    rise = height / size - CENTER * stature / size
    across = away / size / _between((FARTHEST, WALKING_FARTHEST), walking)
    up = rise / np.where(rise > 0.0, HIGHEST, _between((LOWEST, WALKING_LOWEST), walking))
    inwards = 1.0 / np.maximum(np.hypot(across, up), 1.0)
    height = CENTER * stature + inwards * rise * size
    from_chest = np.abs(height - CHEST * stature) / size
    share = np.clip((from_chest - BEFORE_CHEST) / (AWAY - BEFORE_CHEST), 0.0, 1.0)
    away = np.maximum(inwards * away, _between(NEAREST, share) * size)
    turning = 1.0 + walking * (WALKING_TURN - 1.0)
    most = turning * _between(ASIDE, share)
    azimuth = np.clip(azimuth, -most, most)
    facing = multiply(about(1, azimuth), grip_rotation)
    turn = to_vector(multiply(frames[1], conjugate(facing)))
    turn[:, 1] = np.clip(turn[:, 1], -turning * _between(TURN, share), turning * _between(TURN, share))
    tilt, most = np.hypot(turn[:, 0], turn[:, 2]), turning * _between(TILT, share)
    turn[:, [0, 2]] *= (most / np.maximum(tilt, most))[:, None]
    return from_cylindrical(away, azimuth, height), multiply(from_vector(turn), facing)


def _between(ends: tuple[float, float], share: FloatArray) -> FloatArray:
    return ends[0] + share * (ends[1] - ends[0])


def cylindrical(position: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Distances from the body's axis (A,), m, angles to the left (A,), rad, and heights (A,), m."""
    x, y, z = position.T
    return np.hypot(x, z), np.arctan2(x, z), y


def from_cylindrical(away: FloatArray, azimuth: FloatArray, height: FloatArray) -> FloatArray:
    """Positions (A, 3), m, at distances, angles and heights as of `cylindrical`."""
    return np.stack([away * np.sin(azimuth), height, away * np.cos(azimuth)], axis=1)
