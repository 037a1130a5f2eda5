"""Layer 8, constraint: hands and head stay where they are held while other layers disturb the pose."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from crowd.controllers.controller import Step
from crowd.errors import SettingsError, describe, nearest_first
from crowd.motion.joint_tree import joint_trees
from crowd.motion.skeleton import Segment, Skeleton
from crowd.state import ByteArray, Float32Array, IntArray, State
from crowd_kernels.aligned import aligned_zeros
from crowd_kernels.hold import aim_holds, apply_holds, hold_effectors
from crowd_kernels.ik import CHUNKS, SETTINGS, SolveSettings, scratch_length, solve_crowd
from crowd_kernels.ik_gather import POSITION, ROTATION_TOO
from crowd_kernels.ik_tree import TreeArrays
from crowd_kernels.reach_state import HOLD

EFFECTORS = ("right_hand", "left_hand", "head")
"""Joints that can be held, in the order of the state's effector axis: hands as everywhere, then the head."""
FOLLOWING = SETTINGS._replace(
    damping=0.01,
    pull=1.0,
    pull_fade=1.0,
    place_first=0,
    distance_tolerance=3e-4,
    least_iterations=2,
    most_iterations=4,
)
"""Two iterations let the pose follow; more are made where they leave effectors beyond the tolerances."""
ORIGIN: Float32Array = np.zeros(3, np.float32)


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
    solve: SolveSettings = FOLLOWING
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
        count = len(EFFECTORS)
        self.trees = joint_trees(skeleton, EFFECTORS, weights=self.settings.weights)
        self.tree = self.trees[(1 << count) - 1]
        self._target: Float32Array = aligned_zeros((capacity, count, 3), np.float32)
        self._target_rotation: Float32Array = aligned_zeros((capacity, count, 4), np.float32)
        self._angle: Float32Array = aligned_zeros((capacity, count), np.float32)
        self._iterations = aligned_zeros(capacity, np.int32)
        self._mask: ByteArray = aligned_zeros(capacity, np.uint8)
        length = scratch_length(len(self.tree.joint), count, len(Segment))
        self._scratch = aligned_zeros((CHUNKS, length), np.float32)

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
        stage = np.zeros((step.state.capacity, len(EFFECTORS)), np.uint8)
        stage[characters, effector_number(effector)] = HOLD
        self._hold_effectors(step, characters, stage, np.asarray(point, np.float32))

    def hold_reaches(self, step: Step) -> None:
        """Hold hands that go to a target or stay there where layers 5 and 6 have them now; let others go.

        Hands on their way back are followed still, so that the hold fades along their motion.
        """
        self._hold_effectors(step, step.active, step.state.reach_stage, ORIGIN)

    def _hold_effectors(self, step: Step, rows: IntArray, stage: ByteArray, point: Float32Array) -> None:
        """Hold effectors where the pose has them now, by the stages of their reaches."""
        state = step.state
        hold_effectors(
            self.tree,
            step.model.people.segment_scale,
            state.pose_rotation,
            state.pose_pelvis,
            state.position_world,
            state.yaw,
            stage,
            point,
            rows,
            state.constraint_task,
            state.constraint_target_world,
            state.constraint_target_rotation_world,
            state.constraint_point,
        )

    def release(self, state: State, characters: npt.ArrayLike, effector: str | int) -> None:
        """Let an effector go; it finds back softly."""
        rows = np.atleast_1d(np.asarray(characters, np.int32))
        state.constraint_task[rows, effector_number(effector)] = 0

    def evaluate(self, step: Step) -> None:
        """Bring held effectors back to where they are held."""
        state, people = step.state, step.model.people
        aim_holds(
            self.tree,
            self.settings.fade_rate,
            step.dt,
            people.segment_scale,
            state.pose_rotation,
            state.pose_pelvis,
            state.position_world,
            state.yaw,
            state.constraint_task,
            state.constraint_target_world,
            state.constraint_target_rotation_world,
            state.constraint_point,
            step.active,
            state.constraint_last_task,
            state.constraint_weight,
            state.constraint_weight_rate,
            state.constraint_rotation,
            self._target,
            self._target_rotation,
            state.constraint_status,
            self._mask,
        )
        held = self._mask[step.active]
        for mask, tree in self.trees.items():
            rows = step.active[held == mask]
            if rows.size:
                self._solve(step, tree, rows)
        if held.any():
            apply_holds(self.tree, state.constraint_rotation, self._mask, step.active, state.pose_rotation)

    def _solve(self, step: Step, tree: TreeArrays, rows: IntArray) -> None:
        """Solve for people who hold the same effectors."""
        state = step.state
        solve_crowd(
            tree,
            self.settings.solve,
            step.model.people.segment_scale,
            state.constraint_last_task,
            state.constraint_point,
            self._target,
            self._target_rotation,
            state.pose_rotation,
            state.pose_pelvis,
            state.constraint_rotation,
            rows,
            self._scratch,
            state.constraint_rotation,
            state.pose_pelvis,
            state.constraint_status,
            state.constraint_distance,
            self._angle,
            self._iterations,
        )


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
