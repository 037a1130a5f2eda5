"""Layer 7, gaze: people look at points, each other and objects, and their eyes are never quite still."""

import math
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from crowd.controllers.controller import Step
from crowd.errors import SettingsError, describe, nearest_first
from crowd.motion.skeleton import Segment, Skeleton
from crowd.navigation.avoidance import Avoidance
from crowd.navigation.cell_table import CellTable
from crowd.people import People
from crowd.scenario import PlacedCharacters
from crowd.state import ByteArray, Float32Array, FloatArray, IntArray, State
from crowd.world.objects import ObjectState
from crowd_kernels.gaze import (
    CHARACTER,
    CHUNKS,
    NOTHING,
    OBJECT,
    POINT,
    GazeArrays,
    GazeLimits,
    eye_point_crowd,
    gaze_crowd,
    scratch_length,
    split_gazing,
)
from crowd_kernels.glance import GlanceLimits, glance_crowd
from crowd_kernels.saccade import OFF, SaccadeModes, offset_eyes_crowd, saccade_crowd

FRAME_RATE_OF_INTERVALS = 30.0
"""Frames per second in which Lee's intervals are counted."""
MODES = ("listening", "talking", "thinking")
NEIGHBORS_CONSIDERED = 8


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
    """Half axes of the ellipse in which eyes turn."""
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


class Gaze:
    """Turns eyes, head, neck, chest and waist towards what people look at."""

    state_fields: ClassVar[tuple[str, ...]] = (
        "gaze_kind",
        "gaze_index",
        "gaze_target_world",
        "gaze_trunk",
        "gaze_weight",
        "gaze_weight_rate",
        "gaze_turn",
        "gaze_turn_rate",
        "gaze_eye_turn",
        "gaze_error",
        "gaze_status",
        "is_glancing",
        "glance_until",
        "saccade_mode",
        "saccade_start",
        "saccade_goal",
        "saccade_offset",
        "saccade_clock",
        "saccade_duration",
        "saccade_until",
    )

    def __init__(
        self,
        skeleton: Skeleton,
        capacity: int,
        avoidance: Avoidance | None = None,
        objects: ObjectState | None = None,
        placed: PlacedCharacters | None = None,
        settings: GazeSettings | None = None,
    ) -> None:
        """Prepare for a skeleton; neighbours come from `avoidance`, without which nobody glances."""
        self.settings = settings or GazeSettings()
        self.arrays = gaze_arrays(skeleton, self.settings)
        self.limits = gaze_limits(self.settings)
        self.modes = saccade_modes(self.settings.saccades)
        self.glance_limits = glance_limits(self.settings.glances)
        if avoidance is not None:
            seen = min(self.glance_limits.distance, avoidance.settings.neighbor_distance)
            self.glance_limits = self.glance_limits._replace(distance=seen)
        self._objects = objects
        self._look_at_world: FloatArray = np.full((capacity, 3), np.nan)
        self._mode: ByteArray = np.zeros(capacity, np.uint8)
        self.may_glance: npt.NDArray[np.bool_] = np.full(capacity, self.settings.glances.is_on)
        """Who glances at others when nothing else is looked at. (character,)"""
        if placed is not None:
            self.may_glance &= placed.glances
            self._look_at_world[:] = placed.look_at_world
            self._mode[:] = [mode_index(attention) for attention in placed.attention]
        self._cells = None if avoidance is None else avoidance.steer_cells
        self._trunk: Float32Array = np.ones(capacity, np.float32)
        self._follow: Float32Array = np.ones(capacity, np.float32)
        self._turned: IntArray = np.zeros(capacity, np.int32)
        self._resting: IntArray = np.zeros(capacity, np.int32)
        self.scratch: Float32Array = np.zeros(
            (CHUNKS, scratch_length(self.arrays.joint.shape[0])), np.float32
        )
        self.keys = np.zeros((CHUNKS, NEIGHBORS_CONSIDERED), np.int64)

    def activate(self, state: State, characters: IntArray) -> None:
        """Let people look where the scenario wants it, or ahead."""
        state.saccade_mode[characters] = self._mode[characters]
        looks = characters[np.isfinite(self._look_at_world[characters, 0])]
        self.look_at_point(state, looks, self._look_at_world[looks])

    def look_at_point(
        self, state: State, characters: IntArray, point_world: npt.ArrayLike, trunk: float = 1.0
    ) -> None:
        """Let characters look at points until `release`.

        Parameters
        ----------
        state : State
        characters : (M,) int32
        point_world : (3,) or (M, 3) array
            m. Points that are not finite or inside the head are refused: the status says so.
        trunk : float
            How far waist and chest take part, 0 to 1.
        """
        self._look(state, characters, POINT, -1, trunk)
        state.gaze_target_world[characters] = point_world

    def look_at_character(
        self, state: State, characters: IntArray, other: npt.ArrayLike, trunk: float = 1.0
    ) -> None:
        """Let characters look other characters in the eyes until `release`.

        Parameters
        ----------
        state : State
        characters : (M,) int32
        other : int or (M,) int
            Oneself, or somebody who is not there, is refused: the status says so.
        trunk : float
            How far waist and chest take part, 0 to 1.
        """
        self._look(state, characters, CHARACTER, other, trunk)

    def look_at_object(
        self, state: State, characters: IntArray, index: npt.ArrayLike, trunk: float = 1.0
    ) -> None:
        """Let characters look at objects, also moving ones, until `release`; arguments as above."""
        self._look(state, characters, OBJECT, index, trunk)

    def release(self, state: State, characters: IntArray) -> None:
        """Let the gaze fade; idle glances may come again."""
        state.gaze_kind[characters] = NOTHING
        state.is_glancing[characters] = False

    def set_attention(self, state: State, characters: IntArray, attention: str) -> None:
        """Set how the eyes jump: "listening", "talking", "thinking", or "none"."""
        state.saccade_mode[characters] = mode_index(attention)

    def _look(
        self, state: State, characters: IntArray, kind: int, index: npt.ArrayLike, trunk: float
    ) -> None:
        state.gaze_kind[characters] = kind
        state.gaze_index[characters] = index
        state.gaze_trunk[characters] = trunk
        state.is_glancing[characters] = False

    def evaluate(self, step: Step) -> None:
        """Choose glances, advance saccades, and turn everyone who looks or has just looked at something."""
        state, people = step.state, step.model.people
        if self._cells is not None:
            self._glance(step, self._cells)
        saccade_crowd(
            self.modes,
            state.saccade_mode,
            step.active,
            step.seed,
            step.index,
            step.time,
            step.dt,
            state.saccade_start,
            state.saccade_goal,
            state.saccade_clock,
            state.saccade_duration,
            state.saccade_until,
            state.saccade_offset,
        )
        turned, resting = split_gazing(
            step.active,
            state.gaze_kind,
            state.gaze_weight,
            state.saccade_offset,
            self._turned,
            self._resting,
        )
        self._turn(step, people, self._turned[:turned])
        if resting:
            offset_eyes_crowd(
                self.arrays.eye,
                self.settings.eye_pitch,
                self.settings.eye_heading,
                state.saccade_offset,
                self._resting[:resting],
                state.pose_rotation,
            )

    def _glance(self, step: Step, cells: CellTable) -> None:
        """Let people who look at nothing in particular choose somebody."""
        state = step.state
        glance_crowd(
            cells.cell_start,
            cells.point,
            cells.character,
            cells.columns,
            cells.rows,
            cells.cell_size,
            self.glance_limits,
            state.position_world,
            state.velocity_world,
            state.yaw,
            state.is_active,
            self.may_glance,
            self.settings.glances.trunk,
            step.active,
            step.seed,
            step.index,
            step.time,
            self.keys,
            state.glance_until,
            state.is_glancing,
            state.gaze_kind,
            state.gaze_index,
            state.gaze_trunk,
        )

    def _turn(self, step: Step, people: People, turned: IntArray) -> None:
        """Follow moving targets and turn."""
        if turned.size == 0:
            return
        state = step.state
        kind = state.gaze_kind[turned]
        watching = turned[kind == CHARACTER]
        if watching.size:
            eye_point_crowd(
                self.arrays,
                people.segment_scale,
                state.position_world,
                state.yaw,
                state.pose_rotation,
                state.pose_pelvis,
                state.is_active,
                state.gaze_index,
                watching,
                state.gaze_target_world,
            )
        handling = turned[kind == OBJECT]
        if handling.size:
            state.gaze_target_world[handling] = self._object_points(state.gaze_index[handling])
        remaining = 1.0 - (1.0 - self.settings.walking_trunk) * state.locomotion_weight[turned]
        self._trunk[turned] = state.gaze_trunk[turned] * remaining
        table, head = step.model.clip_table, self.arrays.joint[-1]
        moves_head = table.joint_mask[table.mask_index, head][state.play_clip[turned]]
        held = (1.0 - self.settings.gesture_follow) * moves_head * state.play_weight[turned]
        self._follow[turned] = 1.0 - held
        capacity = state.capacity
        gaze_crowd(
            self.arrays,
            self.limits,
            people.segment_scale,
            state.position_world,
            state.yaw,
            self._trunk,
            self._follow,
            state.gaze_kind,
            state.gaze_target_world,
            state.saccade_offset,
            turned,
            step.dt,
            self.scratch,
            state.pose_rotation,
            state.pose_pelvis,
            state.gaze_turn.reshape(capacity, -1),
            state.gaze_turn_rate.reshape(capacity, -1),
            state.gaze_eye_turn.reshape(capacity, -1),
            state.gaze_weight,
            state.gaze_weight_rate,
            state.gaze_error,
            state.gaze_status,
        )

    def _object_points(self, index: IntArray) -> FloatArray:
        """Where objects are; NaN for those that do not exist."""
        points = np.full((index.size, 3), np.nan)
        if self._objects is not None:
            exists = (index >= 0) & (index < self._objects.count)
            points[exists] = self._objects.position_world[index[exists]]
        return points


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
