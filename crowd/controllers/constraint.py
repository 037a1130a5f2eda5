"""Layer 8, constraint: hands and head stay where they are held while other layers disturb the pose."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from crowd.controllers.controller import Step
from crowd.errors import SettingsError, describe, nearest_first
from crowd.joints import Joints
from crowd.motion.joint_tree import joint_tree
from crowd.motion.rotation import about, multiply, rotate
from crowd.motion.skeleton import Segment, Skeleton
from crowd.state import Float32Array, FloatArray, IntArray, State
from crowd_kernels.ik import (
    CHUNKS,
    POSITION,
    ROTATION_TOO,
    SETTINGS,
    SolveSettings,
    scratch_length,
    solve_crowd,
)
from crowd_kernels.reach_goal import NONE as NO_REACH
from crowd_kernels.reach_goal import RETURN

EFFECTORS = ("right_hand", "left_hand", "head")
"""Joints that can be held, in the order of the state's effector axis: hands as everywhere, then the head."""
ONE_STEP = SETTINGS._replace(pull=1.0, least_iterations=4, most_iterations=4, place_first=0)
GONE = 1e-3
"""Share below which a hold that fades has ended."""


@dataclass(frozen=True)
class ConstraintSettings:
    """How effectors are held."""

    fade_rate: float = 25.0
    """Rate with which a hold comes and goes, 1/s; larger: quicker."""
    weights: Mapping[str, float] = field(
        default_factory=lambda: {
            "spine": 0.03,
            "neck": 0.2,
            "head": 0.4,
            "clavicle": 0.3,
            "upper_arm": 1.0,
            "forearm": 1.0,
            "hand": 0.8,
        }
    )
    """How easily joints turn: arms give way before the trunk, which follows the other layers."""
    solve: SolveSettings = ONE_STEP
    """One solve a step; it starts from the pose of the step before."""


class Constraint:
    """Solves for the joints between waist and held effectors.

    The solve starts from the last output and is drawn to the incoming pose, so the trunk follows gaze and
    feet as far as the held effectors allow.
    """

    state_fields: ClassVar[tuple[str, ...]] = (
        "constraint_task",
        "constraint_last_task",
        "constraint_weight",
        "constraint_weight_rate",
        "constraint_target_world",
        "constraint_target_rotation_world",
        "constraint_point",
        "constraint_rotation",
        "constraint_status",
        "constraint_distance",
        "pose_rotation",
    )

    def __init__(self, skeleton: Skeleton, capacity: int, settings: ConstraintSettings | None = None) -> None:
        self.settings = settings or ConstraintSettings()
        self.tree = joint_tree(skeleton, EFFECTORS, weights=self.settings.weights)
        self.joint = np.array([skeleton.joint(name) for name in EFFECTORS], np.int32)
        self._joints = Joints(skeleton, capacity)
        count = len(EFFECTORS)
        self._target: Float32Array = np.zeros((capacity, count, 3), np.float32)
        self._target_rotation: Float32Array = np.zeros((capacity, count, 4), np.float32)
        self._angle: Float32Array = np.zeros((capacity, count), np.float32)
        self._iterations = np.zeros(capacity, np.int32)
        length = scratch_length(len(self.tree.joint), count, len(Segment))
        self._scratch = np.zeros((CHUNKS, length), np.float32)

    def activate(self, state: State, characters: IntArray) -> None:
        """Hold nothing of people who have just entered."""
        state.constraint_task[characters] = 0
        state.constraint_last_task[characters] = 0
        state.constraint_weight[characters] = 0.0
        state.constraint_weight_rate[characters] = 0.0

    def hold(
        self,
        state: State,
        characters: npt.ArrayLike,
        effector: str | int,
        position_world: npt.ArrayLike | None = None,
        rotation_world: npt.ArrayLike | None = None,
        point: npt.ArrayLike = (0.0, 0.0, 0.0),
    ) -> None:
        """Hold an effector at a place, a rotation, or both, from the next step on; again to move it.

        Parameters
        ----------
        state : State
        characters : int or (M,) int
        effector : str or int
            ``"right_hand"``, ``"left_hand"`` or ``"head"``, or its number in this order.
        position_world : (3,) or (M, 3) float, optional
            m. Targets that are not finite are refused: the pose stays as it comes.
        rotation_world : (4,) or (M, 4) float, optional
            Rotation of the joint, unit quaternions.
        point : (3,) or (M, 3) float
            What is held, in the frame of the joint and the character's own size, m.

        Raises
        ------
        SettingsError
            There is no such effector.
        """
        rows, number = np.atleast_1d(np.asarray(characters, np.int32)), effector_number(effector)
        task = 0
        if position_world is not None:
            task |= POSITION
            state.constraint_target_world[rows, number] = position_world
        if rotation_world is not None:
            task |= ROTATION_TOO
            state.constraint_target_rotation_world[rows, number] = rotation_world
        state.constraint_point[rows, number] = point
        state.constraint_task[rows, number] = task

    def hold_here(
        self, step: Step, characters: IntArray, effector: str | int, point: npt.ArrayLike = (0.0, 0.0, 0.0)
    ) -> None:
        """Hold an effector where the pose of the layers so far has it; layers 5 and 6 call it every step."""
        if characters.size == 0:
            return
        number = effector_number(effector)
        self._joints.compute(step.state, step.model.people, characters)
        place, rotation = self._effectors(step.state, characters, np.asarray(point, np.float64))
        self.hold(step.state, characters, number, place[:, number], rotation[:, number], point)

    def hold_reaches(self, step: Step) -> None:
        """Hold hands that go to a target or stay there where layers 5 and 6 have them now; let others go.

        Hands on their way back are followed still, so that the hold fades along their motion.
        """
        state = step.state
        stage = state.reach_stage[step.active]
        reaching = np.ascontiguousarray(step.active[(stage != NO_REACH).any(axis=1)])
        if reaching.size == 0:
            return
        self._joints.compute(state, step.model.people, reaching)
        place, rotation = self._effectors(state, reaching, np.zeros(3))
        for hand in range(2):
            stage = state.reach_stage[reaching, hand]
            follows = stage != NO_REACH
            rows = reaching[follows]
            self.hold(state, rows, hand, place[follows, hand], rotation[follows, hand])
            self.release(state, reaching[stage == RETURN], hand)

    def release(self, state: State, characters: npt.ArrayLike, effector: str | int) -> None:
        """Let an effector go; it finds back softly."""
        rows = np.atleast_1d(np.asarray(characters, np.int32))
        state.constraint_task[rows, effector_number(effector)] = 0

    def evaluate(self, step: Step) -> None:
        """Bring held effectors back to where they are held."""
        state = step.state
        is_held = state.constraint_task[step.active] != 0
        is_on = is_held | (state.constraint_weight[step.active] > 0.0)
        rows = np.ascontiguousarray(step.active[is_on.any(axis=1)])
        if rows.size == 0:
            return
        is_new = (state.constraint_weight[rows] == 0.0).all(axis=1)
        state.constraint_rotation[rows[is_new]] = state.pose_rotation[rows[is_new]]
        self._fade(state, rows, step.dt)
        self._aim(step, rows)
        self._keep_still_joints(state, rows)
        solve_crowd(
            self.tree,
            self.settings.solve,
            step.model.people.segment_scale,
            state.constraint_last_task,
            state.constraint_point,
            self._target,
            self._target_rotation,
            state.pose_rotation,
            state.pose_pelvis,
            rows,
            self._scratch,
            state.constraint_rotation,
            state.pose_pelvis,
            state.constraint_status,
            state.constraint_distance,
            self._angle,
            self._iterations,
        )
        state.pose_rotation[rows] = state.constraint_rotation[rows]

    def _fade(self, state: State, rows: IntArray, dt: float) -> None:
        """Move the shares of holds to 1 or 0 as critically damped springs."""
        rate = self.settings.fade_rate
        goal = (state.constraint_task[rows] != 0).astype(np.float32)
        away = state.constraint_weight[rows] - goal
        speed = state.constraint_weight_rate[rows]
        change = (speed + rate * away) * dt
        decay = np.exp(-rate * dt)
        weight = goal + (away + change) * decay
        is_there = np.abs(weight - goal) < GONE
        state.constraint_weight[rows] = np.where(is_there, goal, weight)
        state.constraint_weight_rate[rows] = np.where(is_there, 0.0, (speed - rate * change) * decay)

    def _aim(self, step: Step, rows: IntArray) -> None:
        """Mix targets from where the incoming pose has the effectors and where they are held."""
        state = step.state
        self._joints.compute(state, step.model.people, rows)
        place, rotation = self._effectors_model(rows, state.constraint_point[rows].astype(np.float64))
        back = about(1, -state.yaw[rows])[:, None]
        held = rotate(
            np.broadcast_to(back, (*back.shape[:1], len(EFFECTORS), 4)),
            state.constraint_target_world[rows] - state.position_world[rows, None],
        )
        turned = multiply(back, state.constraint_target_rotation_world[rows].astype(np.float64))
        turned *= np.where((turned * rotation).sum(axis=2, keepdims=True) < 0.0, -1.0, 1.0)
        weight = state.constraint_weight[rows][..., None].astype(np.float64)
        asked, last = state.constraint_task[rows], state.constraint_last_task[rows]
        task = np.where(weight[..., 0] > 0.0, np.where(asked != 0, asked, last), 0).astype(np.uint8)
        state.constraint_last_task[rows] = task
        self._target[rows] = place + weight * np.where(task[..., None] & POSITION, held - place, 0.0)
        mixed = rotation + weight * np.where(task[..., None] & ROTATION_TOO, turned - rotation, 0.0)
        self._target_rotation[rows] = mixed / np.linalg.norm(mixed, axis=2, keepdims=True)

    def _keep_still_joints(self, state: State, rows: IntArray) -> None:
        """Take the joints that the solve does not turn from the incoming pose."""
        shape = (state.capacity, 4, -1)
        incoming = state.pose_rotation.reshape(shape)
        started = state.constraint_rotation.reshape(shape)
        moved = self.tree.joint[self.tree.weight > 0]
        kept: Float32Array = started[rows][:, :, moved]
        started[rows] = incoming[rows]
        started[rows[:, None, None], np.arange(4)[None, :, None], moved[None, None]] = kept

    def _effectors_model(self, rows: IntArray, point: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Places (M, 3, 3) and rotations (M, 3, 4) of effectors in the root frame."""
        rotation = self._joints.rotation_model[rows][:, self.joint].astype(np.float64)
        place = self._joints.position_model[rows][:, self.joint].astype(np.float64)
        return place + rotate(rotation, np.broadcast_to(point, place.shape)), rotation

    def _effectors(self, state: State, rows: IntArray, point: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Places and rotations of effectors in world space."""
        place, rotation = self._effectors_model(rows, point)
        facing = np.broadcast_to(about(1, state.yaw[rows])[:, None], rotation.shape)
        return rotate(facing, place) + state.position_world[rows, None], multiply(facing, rotation)


class HandHolding:
    """Tells the constraint layer, between grab and gaze, where hands that reach shall stay."""

    state_fields: ClassVar[tuple[str, ...]] = (
        "constraint_task",
        "constraint_target_world",
        "constraint_target_rotation_world",
        "constraint_point",
    )

    def __init__(self, constraint: Constraint) -> None:
        self.constraint = constraint

    def activate(self, state: State, characters: IntArray) -> None:
        """Nothing to prepare: the constraint layer does."""

    def evaluate(self, step: Step) -> None:
        """Hold the hands that reach."""
        self.constraint.hold_reaches(step)


def effector_number(effector: str | int) -> int:
    """Place of an effector in the state's effector axis.

    Raises
    ------
    SettingsError
        There is none of this name or number.
    """
    if isinstance(effector, str):
        if effector in EFFECTORS:
            return EFFECTORS.index(effector)
        known = nearest_first(effector, EFFECTORS)
        raise SettingsError(describe("constraint", "no such effector", effector, known))
    if not 0 <= effector < len(EFFECTORS):
        allowed = f"0 to {len(EFFECTORS) - 1}"
        raise SettingsError(describe("constraint", "no such effector", effector, allowed))
    return int(effector)
