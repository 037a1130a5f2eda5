"""Layer 7, gaze: people look at points, each other and objects, and their eyes are never quite still."""

from typing import ClassVar

import numpy as np
import numpy.typing as npt

from crowd.controllers.controller import Step
from crowd.controllers.gaze_settings import (
    GazeSettings,
    gaze_arrays,
    gaze_limits,
    glance_limits,
    mode_index,
    saccade_modes,
)
from crowd.motion.skeleton import Skeleton
from crowd.navigation.avoidance import Avoidance
from crowd.navigation.cell_table import CellTable
from crowd.people import People
from crowd.scenario import PlacedCharacters
from crowd.state import ByteArray, Float32Array, FloatArray, IntArray, State
from crowd.world.objects import ObjectState
from crowd_kernels.aligned import aligned_full, aligned_zeros
from crowd_kernels.gaze import (
    CHARACTER,
    CHUNKS,
    IDLE,
    NOTHING,
    OBJECT,
    POINT,
    REFUSED,
    eye_point_crowd,
    gaze_crowd,
    split_gazing,
)
from crowd_kernels.gaze_chain import scratch_length
from crowd_kernels.glance import glance_crowd
from crowd_kernels.saccade import offset_eyes_crowd, saccade_crowd

NEIGHBORS_CONSIDERED = 8


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
        "gaze_refusals",
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
        self._mode: ByteArray = aligned_zeros(capacity, np.uint8)
        self.may_glance: npt.NDArray[np.bool_] = np.full(capacity, self.settings.glances.is_on)
        """Who glances at others when nothing else is looked at. (character,)"""
        if placed is not None:
            self.may_glance &= placed.glances
            self._look_at_world[:] = placed.look_at_world
            self._mode[:] = [mode_index(attention) for attention in placed.attention]
        self._cells = None if avoidance is None else avoidance.steer_cells
        self._trunk: Float32Array = aligned_full(capacity, 1, np.float32)
        self._follow: Float32Array = aligned_full(capacity, 1, np.float32)
        self._turned: IntArray = aligned_zeros(capacity, np.int32)
        self._resting: IntArray = aligned_zeros(capacity, np.int32)
        self.scratch: Float32Array = aligned_zeros(
            (CHUNKS, scratch_length(self.arrays.joint.shape[0])), np.float32
        )
        self.keys = aligned_zeros((CHUNKS, NEIGHBORS_CONSIDERED), np.int64)

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
        state.gaze_status[characters] = IDLE

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
        was_refused = state.gaze_status[turned] == REFUSED
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
        is_refused = ~was_refused & (state.gaze_status[turned] == REFUSED) & ~state.is_glancing[turned]
        state.gaze_refusals[turned[is_refused]] += 1

    def _object_points(self, index: IntArray) -> FloatArray:
        """Where objects are; NaN for those that do not exist."""
        points = np.full((index.size, 3), np.nan)
        if self._objects is not None:
            exists = (index >= 0) & (index < self._objects.count)
            points[exists] = self._objects.position_world[index[exists]]
        return points
