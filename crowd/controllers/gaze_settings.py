"""How people look: limits, shares, speeds, glances and saccades, and the same packed for the kernels."""

import math
from dataclasses import dataclass, field

import numpy as np

from crowd.errors import SettingsError, describe, nearest_first
from crowd.motion.skeleton import Segment, Skeleton
from crowd_kernels.gaze_chain import GazeArrays, GazeLimits
from crowd_kernels.glance import GlanceLimits
from crowd_kernels.saccade import OFF, SaccadeModes

FRAME_RATE_OF_INTERVALS = 30.0
"""Frames per second in which Lee's intervals are counted."""
MODES = ("listening", "talking", "thinking")


@dataclass(frozen=True)
class GazeKey:
    """Joints that turn alike. Limits are those of the whole key, rad."""

    joints: tuple[str, ...]
    limit: tuple[float, float, float]
    """Largest turn up or down, to a side, and tilt."""
    share: float
    """Relative part of each joint in the turn; larger: takes more of it."""
    rate: float
    """Natural frequency of the motion, 1/s; larger: quicker."""
    is_trunk: bool = False
    """Takes part as far as the character's posture lets it."""
    bias: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Turn about x (down), y (left), z that is added while looking, for the whole key, rad."""


def degrees(pitch: float, heading: float, roll: float) -> tuple[float, float, float]:
    """Angles in rad."""
    return math.radians(pitch), math.radians(heading), math.radians(roll)


KEYS = (
    GazeKey(("spine_1", "spine_2"), degrees(15.0, 24.0, 10.0), share=0.35, rate=6.0, is_trunk=True),
    GazeKey(("spine_3", "spine_4"), degrees(6.0, 15.0, 5.0), share=0.35, rate=7.0, is_trunk=True),
    GazeKey(("neck_1", "neck_2"), degrees(25.0, 50.0, 20.0), share=1.0, rate=9.0),
    GazeKey(("head",), degrees(20.0, 40.0, 15.0), share=1.5, rate=10.0),
)
"""Limits of Thiebaux and others as implemented, with neck and head together at 90 degrees to a side."""


@dataclass(frozen=True)
class GlanceSettings:
    """Idle glances at people who pass by. Means and spreads are of log-normal times, s."""

    is_on: bool = True
    distance: float = 5.0
    """Farthest person who is noticed, m; never farther than avoidance looks."""
    field: float = math.radians(70.0)
    """Farthest to a side at which somebody is noticed, rad."""
    lost_field: float = math.radians(95.0)
    """A glance ends when somebody is farther round than this, rad."""
    distance_scale: float = 3.5
    """Interest in somebody falls to 1/e over this distance, m."""
    standing_interest: float = 0.3
    """Interest in people who do not come nearer, over that in those who do."""
    no_interest: float = 0.4
    """Interest in nobody, against 1 for somebody near who comes straight on; larger: fewer glances."""
    length: tuple[float, float] = (1.3, 0.7)
    """Mean and spread of the length of a glance."""
    pause: tuple[float, float] = (4.0, 2.5)
    """Mean and spread of the time between two choices."""
    trunk: float = 0.1
    """Share of the trunk in a glance."""


@dataclass(frozen=True)
class SaccadeSettings:
    """Attention of one mode, in the units of the article: degrees, percent, frames at 30 per second."""

    cap: float
    """Largest magnitude."""
    direction: tuple[float, ...]
    """Shares of the directions 0 (right), 45, 90 (up) ... 315."""
    target_share: float
    """Share of time on the target."""
    target_interval: tuple[float, float]
    """Mean and spread of the time on the target."""
    away_interval: tuple[float, float]
    """Mean and spread of the time at one place beside it."""


FREE_DIRECTIONS = (15.54, 6.46, 17.69, 7.44, 16.80, 7.89, 20.38, 7.79)
THOUGHT_DIRECTIONS = (5.46, 10.54, 24.69, 6.44, 6.89, 12.80, 26.38, 6.79)
SACCADES = (
    SaccadeSettings(10.0, FREE_DIRECTIONS, 0.75, (237.5, 47.1), (13.0, 7.1)),
    SaccadeSettings(12.0, FREE_DIRECTIONS, 0.41, (93.9, 94.9), (27.8, 24.0)),
    SaccadeSettings(12.0, THOUGHT_DIRECTIONS, 0.20, (180.0, 47.0), (180.0, 47.0)),
)
"""In the order of `MODES`; Lee, Badler, Badler, "Eyes alive", 2002, and for thinking its implementation."""


@dataclass(frozen=True)
class GazeSettings:
    """How people look. Angles in rad, speeds in rad/s."""

    keys: tuple[GazeKey, ...] = KEYS
    eye_share: float = 1.0
    """Relative part of the eyes in the turn, > 0."""
    eye_pitch: float = math.radians(35.0)
    eye_heading: float = math.radians(40.0)
    """Half axes of the ellipse in which eyes turn, less than a right angle."""
    eye_speed: float = math.radians(700.0)
    """Largest speed of the eyes against the head, saccades apart; above that of any human eye."""
    head_speed: float = math.radians(180.0)
    """Largest speed that gaze gives to the head."""
    fade_rate: float = 14.0
    """1/s. Rate with which gaze comes and goes; larger: quicker, less soft."""
    walking_trunk: float = 0.3
    """Share of the trunk's part that remains while walking."""
    gesture_follow: float = 0.15
    """How readily the head follows while a gesture moves it, 0 to 1; larger cancels nods."""
    glances: GlanceSettings = field(default_factory=GlanceSettings)
    saccades: tuple[SaccadeSettings, ...] = SACCADES


def gaze_arrays(skeleton: Skeleton, settings: GazeSettings) -> GazeArrays:
    """Chain and eyes of a skeleton for the kernel."""
    names = [name for key in settings.keys for name in key.joints]
    keys = [key for key in settings.keys for _ in key.joints]
    joint = np.array([skeleton.joint(name) for name in names], np.int32)
    eye = np.array([skeleton.joint("left_eye"), skeleton.joint("right_eye")], np.int32)
    size = np.array([len(key.joints) for key in keys])[:, None]
    limit = np.array([key.limit for key in keys]) / size
    bias = np.array([key.bias for key in keys]) / size
    return GazeArrays(
        joint,
        np.ascontiguousarray(skeleton.offset[joint], np.float32),
        np.ascontiguousarray(skeleton.segment[joint], np.int32),
        np.array([key.share for key in keys], np.float32),
        np.array([key.is_trunk for key in keys]),
        limit.astype(np.float32),
        bias.astype(np.float32),
        np.array([key.rate for key in keys], np.float32),
        eye,
        np.ascontiguousarray(skeleton.offset[eye], np.float32),
        np.ascontiguousarray(skeleton.segment[eye], np.int32),
        int(Segment.LEG),
    )


def mode_index(attention: str) -> int:
    """Row of the saccade statistics.

    Raises
    ------
    SettingsError
        There is no such attention.
    """
    if attention == "none":
        return OFF
    if attention not in MODES:
        raise SettingsError(
            describe("attention", "is unknown", attention, nearest_first(attention, (*MODES, "none")))
        )
    return MODES.index(attention)


def gaze_limits(settings: GazeSettings) -> GazeLimits:
    """Limits for the kernel."""
    return GazeLimits(
        np.float32(settings.eye_share),
        np.float32(settings.eye_pitch),
        np.float32(settings.eye_heading),
        np.float32(settings.eye_speed),
        np.float32(settings.head_speed),
        np.float32(settings.fade_rate),
    )


def log_normal(mean: float, spread: float) -> tuple[float, float]:
    """Mean and standard deviation of the logarithm of a log-normal quantity with given mean and spread."""
    variance = math.log1p((spread / mean) ** 2)
    return math.log(mean) - 0.5 * variance, math.sqrt(variance)


def glance_limits(settings: GlanceSettings) -> GlanceLimits:
    """Limits for the kernel."""
    return GlanceLimits(
        settings.distance,
        settings.field,
        settings.lost_field,
        settings.distance_scale,
        settings.standing_interest,
        settings.no_interest,
        *log_normal(*settings.length),
        *log_normal(*settings.pause),
    )


def saccade_modes(settings: tuple[SaccadeSettings, ...]) -> SaccadeModes:
    """Statistics of saccades for the kernel.

    Notes
    -----
    The article gives intervals and the share of time on the target, which plain alternation cannot both have.
    With several places beside the target one after the other both come out, where the share of returns is
    ``target_share * away_mean / ((1 - target_share) * target_mean)``.
    """
    direction = np.cumsum([mode.direction for mode in settings], axis=1)
    direction /= direction[:, -1:]
    returns = [
        mode.target_share * mode.away_interval[0] / ((1.0 - mode.target_share) * mode.target_interval[0])
        for mode in settings
    ]
    # A time in seconds has the spread of its frames: only the mean of the logarithm changes.
    times = np.array(
        [[log_normal(*mode.target_interval), log_normal(*mode.away_interval)] for mode in settings]
    )
    return SaccadeModes(
        direction,
        np.radians([mode.cap for mode in settings]),
        np.minimum(returns, 1.0),
        times[..., 0] - math.log(FRAME_RATE_OF_INTERVALS),
        np.ascontiguousarray(times[..., 1]),
    )
