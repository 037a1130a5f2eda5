"""People: what stays the same about each slot's person during a run."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from crowd.motion.body import draw_segment_scale
from crowd.motion.skeleton import Segment, Skeleton
from crowd_kernels.random import uniform

FloatArray = npt.NDArray[np.float64]

PURPOSE_TEMPO = 201
HANDING_HEIGHT = 0.66
"""Height at which people hand things over, over stature."""
SEATED_HANDING_HEIGHT = 0.6
"""Height at which people hand things to somebody who sits, over the other's stature."""
SHOULDER_HEIGHT, SHOULDER_SIDE = 0.82, 0.10
"""Of somebody who stands, over stature."""
SEATED_SHOULDER_HEIGHT, SEATED_SHOULDER_BEHIND = 0.575, 0.20
"""Of somebody who sits, over stature; behind the feet."""


@dataclass(frozen=True)
class People:
    """Arrays with one row for each slot.

    Attributes
    ----------
    radius : (N,) float64
        Body disc, m.
    preferred_speed : (N,) float64
        Speed on a free way, m/s.
    stature : (N,) float64
        Height, m.
    segment_scale : (N, 8) float32
        Scale of joint offsets by `Segment`.
    stride_scale : (N,) float64
        Leg length over that of the library's skeleton.
    tempo : (N,) float64
        Cadence over that of the library: dynamic similarity of longer legs, and a personal share.
    """

    radius: FloatArray
    preferred_speed: FloatArray
    stature: FloatArray
    segment_scale: npt.NDArray[np.float32]
    stride_scale: FloatArray
    tempo: FloatArray

    @classmethod
    def build(
        cls,
        skeleton: Skeleton,
        radius: FloatArray,
        preferred_speed: FloatArray,
        stature: FloatArray,
        seed: int,
    ) -> "People":
        """Draw proportions and tempo for people of given stature.

        Notes
        -----
        Cadence scales by one over the square root of leg length (dynamic similarity, Alexander 1984), and
        everyone has a tempo of their own within 3 %.
        """
        count = radius.shape[0]
        segment_scale = draw_segment_scale(skeleton, stature, seed)
        stride_scale = segment_scale[:, Segment.LEG].astype(np.float64)
        personal = np.array([uniform(seed, character, 0, PURPOSE_TEMPO) for character in range(count)])
        tempo = (0.97 + 0.06 * personal) / np.sqrt(stride_scale)
        return cls(radius, preferred_speed, stature, segment_scale, stride_scale, tempo)


def shoulders_world(
    position_world: FloatArray,
    yaw: npt.ArrayLike,
    stature: npt.ArrayLike,
    hand: npt.ArrayLike,
    is_seated: npt.ArrayLike = False,
) -> FloatArray:
    """Where shoulders are of people who stand or sit upright.

    Parameters
    ----------
    position_world : (M, 3) float64
        On the ground, m.
    yaw : (M,) float64
        rad.
    stature : float or (M,) float64
        m.
    hand : int or (M,) int
        0 right, 1 left, 2 the middle between both.
    is_seated : bool or (M,) bool

    Returns
    -------
    (M, 3) float64
        m.
    """
    side = np.array([-SHOULDER_SIDE, SHOULDER_SIDE, 0.0])[np.asarray(hand)] * stature
    behind = np.where(is_seated, SEATED_SHOULDER_BEHIND, 0.0) * stature
    height = np.where(is_seated, SEATED_SHOULDER_HEIGHT, SHOULDER_HEIGHT) * stature
    sine, cosine = np.sin(yaw), np.cos(yaw)
    away = [cosine * side - sine * behind, height, -sine * side - cosine * behind]
    return np.asarray(position_world + np.stack(np.broadcast_arrays(*away), axis=-1))
