"""Layer 5, reach: hands go to targets by blended examples, exact by inverse kinematics."""

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from operator import attrgetter
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from crowd.blending.reach_space import SIDES, ReachSpace
from crowd.controllers.controller import Step
from crowd.errors import MotionError, describe
from crowd.motion.body import build_skeleton
from crowd.motion.clip import Clip, ClipKind
from crowd.motion.joint_tree import joint_trees
from crowd.motion.library import MotionLibrary
from crowd.motion.mirror import mirrored, opposite
from crowd.motion.procedural.reaching import seated_reaches, standing_reaches
from crowd.motion.skeleton import Segment, Skeleton
from crowd.people import shoulders_world
from crowd.state import CarryStage, FloatArray, IntArray, State
from crowd.world import World
from crowd_kernels.aligned import aligned_zeros
from crowd_kernels.clip import PADDED_JOINTS
from crowd_kernels.ik import SETTINGS, SolveSettings, scratch_length, solve_crowd
from crowd_kernels.ik_tree import TreeArrays
from crowd_kernels.reach import CHUNKS, reach_crowd
from crowd_kernels.reach_blend import SCRATCH_ROW
from crowd_kernels.reach_correction import LANES, keep_corrections, start_solves
from crowd_kernels.reach_missing import find_missing_crowd
from crowd_kernels.reach_state import MOVE, MOVING, NONE, REFUSED, RETURN, ReachLimits, ReachState
from crowd_kernels.reach_status import reach_status_crowd

REACH_LIMITS = ReachLimits(
    least_time=0.25,
    time_per_metre=0.57,
    time_per_radian=0.7,
    time_shared=3.0,
    acceleration=12.0,
    target_speed=2.5,
    turn_acceleration=15.0,
    far_turn_time=0.32,
    clearance=0.30,
    body_radius=0.10,
    turn_back=3.0,
    lead=0.8,
    lead_acceleration=25.0,
    weight_change=0.25,
    rotation_rate=3.0,
    farthest=0.13,
    missing_rate=8.0,
    example_time=0.35,
)
SOLVE = SETTINGS._replace(
    reach=1e3,
    damping=0.016,
    error_damping=0.4,
    turn_error_damping=8.0,
    pull_fade=1.0,
    place_first=0,
    passes=8,  # Arms at many limits at once, far from rotations they cannot have, sway with fewer.
)
EFFECTORS = ("right_hand", "left_hand")
BOTH_HANDS = 3
"""Mask of effectors: bit 0 the right hand, bit 1 the left one."""
read_parts = attrgetter(*(f"reach_{name}" for name in ReachState._fields))
"""Reads the fields of a state that the kernels of reaches change."""
FEWEST_EXAMPLES = 8
"""A library with fewer reaches of a hand takes the built-in ones."""


@dataclass(frozen=True)
class ReachSettings:
    """How people reach."""

    limits: ReachLimits = REACH_LIMITS
    """How hands go from target to target; larger accelerations follow moving targets more closely."""
    solve: SolveSettings = SOLVE
    """How inverse kinematics brings hands to their targets, for iterations of `iteration_time`."""
    iteration_time: float = 1.0 / 120.0
    """Longest time that one iteration serves, s. The same number in every step keeps motions smooth."""
    shared_error_damping: float = 0.8
    """Damping by errors where both hands pull at one trunk, see `SolveSettings.error_damping`. Larger: hands
    that cannot both be where they should stay farther away, but joints leave and meet limits more softly."""
    fade_rate: float = 6.0
    """Rate with which turns of joints fade that the targets do not ask for, 1/s. Where it is larger, hands
    stop short of rotations far from the blended ones, since damped steps make up for less than fades."""
    correction_acceleration: float = 30.0
    """Largest angular acceleration of what inverse kinematics turns joints, rad/s^2; limits come first."""
    shared_correction_acceleration: float = 40.0
    """Likewise where both hands reach, which push joints to their limits more often."""
    rest_acceleration: float = 0.1
    """Where both hands wait that cannot both be where they should, joints turn faster than this times the
    time they have waited, at most 3 s, or rest, rad/s^2."""
    limit_rate: float = 8.0
    """Rate with which joints approach their limits at most, 1/s; larger: harder stops."""
    tolerance: float = 7e-4
    """m. A hand at this distance has reached its target; layers above leave up to 0.3 mm more."""
    angle_tolerance: float = 0.0174533
    """rad. Likewise for its rotation."""
    wall_distance: float = 0.05
    """m. Walls are looked for again when a target has moved as far as this."""


@cache
def solve_settings(settings: ReachSettings, dt: float, is_shared: bool) -> SolveSettings:
    """Settings of the solves of one hand, or of both, in steps of `dt` s, for like motions with any step."""
    iterations = math.ceil(dt / settings.iteration_time - 1e-9)
    span = dt / iterations
    stiffness = settings.iteration_time / span
    solve = settings.solve
    return solve._replace(
        damping=solve.damping * math.sqrt(stiffness),
        error_damping=(settings.shared_error_damping if is_shared else solve.error_damping) * stiffness,
        turn_error_damping=solve.turn_error_damping * stiffness,
        pull=1.0 - math.exp(-settings.fade_rate * span),
        approach=1.0 - math.exp(-settings.limit_rate * span),
        least_iterations=iterations,
        most_iterations=iterations,
    )


class Reach:
    """Moves hands to targets, holds them there and brings them back."""

    state_fields: ClassVar[tuple[str, ...]] = (
        "reach_count",
        "reach_checked_world",
        "reach_correction",
        "reach_correction_change",
        "reach_last_rotation",
        *(f"reach_{name}" for name in ReachState._fields),
    )

    def __init__(
        self,
        library: MotionLibrary,
        segment_scale: npt.NDArray[np.float32],
        stature: FloatArray,
        world: World,
        settings: ReachSettings | None = None,
    ) -> None:
        self.settings = settings or ReachSettings()
        self._library = library
        self._stature = stature
        self._world = world
        self._segment_scale = segment_scale
        self._size = np.ascontiguousarray(stature / library.skeleton.stature)
        self._space: ReachSpace | None = None
        self._trees = joint_trees(library.skeleton, EFFECTORS)
        self._tree = self._trees[BOTH_HANDS]
        require_lanes(len(self._tree.joint))
        capacity = len(stature)
        self._rows = aligned_zeros((CHUNKS, SCRATCH_ROW), np.float32)
        length = scratch_length(len(self._tree.joint), len(EFFECTORS), len(Segment))
        self._solve_scratch = aligned_zeros((CHUNKS, length), np.float32)
        self._solution = aligned_zeros((capacity, 4 * PADDED_JOINTS), np.float32)
        self._task = aligned_zeros((capacity, 2), np.uint8)
        self._point = aligned_zeros((capacity, 2, 3), np.float32)
        self._target = aligned_zeros((capacity, 2, 3), np.float32)
        self._bound = aligned_zeros((capacity, 2), np.float32)
        self._kept = aligned_zeros((capacity, 2), np.float32)
        self._target_rotation = aligned_zeros((capacity, 2, 4), np.float32)
        self._status = aligned_zeros((capacity, 2), np.uint8)
        self._distance = aligned_zeros((capacity, 2), np.float32)
        self._angle = aligned_zeros((capacity, 2), np.float32)
        self._iterations = aligned_zeros(capacity, np.int32)
        self.part_seconds = {"blending": 0.0, "inverse kinematics": 0.0}
        """Time that the parts of this layer have taken, s."""

    @property
    def tree(self) -> TreeArrays:
        """Joints that inverse kinematics turns for either hand, and their limits."""
        return self._tree

    @property
    def space(self) -> ReachSpace:
        """The examples and what fills the space between them."""
        self.prepare()
        assert self._space is not None
        return self._space

    def prepare(self) -> None:
        """Make the space of the examples, which takes seconds; without it the first reach of a run does."""
        if self._space is None:
            self._space = reach_space(self._library)
            self._number, self._real = self._space.scratch()

    def activate(self, state: State, characters: IntArray) -> None:
        """Start people with hanging arms."""
        state.reach_stage[characters] = NONE
        state.reach_status[characters] = NONE
        state.reach_course[characters] = 0.0
        state.reach_weight[characters] = 0.0
        state.reach_correction[characters] = 0.0
        state.reach_correction_change[characters] = 0.0
        state.reach_last_rotation[characters] = 0.0

    def start(
        self,
        state: State,
        characters: IntArray,
        hand: npt.ArrayLike,
        position_world: npt.ArrayLike,
        rotation_world: npt.ArrayLike | None = None,
        point_hand: npt.ArrayLike | None = None,
        seconds: float | None = None,
        hold: float | None = None,
        is_own: bool = False,
    ) -> None:
        """Reach for targets; a hand that is on its way or holds goes there without returning.

        Refused are targets that are not finite or lie behind walls; the layer refuses those in the body.

        Parameters
        ----------
        state : State
        characters : (M,) int32
        hand : int or (M,) int
            0 right, 1 left.
        position_world : (3,) or (M, 3) array
            m.
        rotation_world : (4,) or (M, 4) array, optional
            Rotation of the hand joint.
        point_hand : (3,) or (M, 3) array, optional
            Point in the hand joint's frame that comes to the target, in the character's own size, m; the
            wrist when left out.
        seconds : float, optional
            Time to the target, s; as people do when left out.
        hold : float, optional
            Time at the target before the hand returns, s; until `end` when left out.
        is_own : bool
            The targets move with the body, so that no wall comes between.
        """
        hands = np.broadcast_to(np.asarray(hand), len(characters))
        state.reach_target_world[characters, hands] = position_world
        state.reach_has_rotation[characters, hands] = rotation_world is not None
        if rotation_world is not None:
            state.reach_target_rotation_world[characters, hands] = rotation_world
        state.reach_point_hand[characters, hands] = 0.0 if point_hand is None else point_hand
        state.reach_hold_left[characters, hands] = np.inf if hold is None else hold
        state.reach_seconds[characters, hands] = 0.0 if seconds is None else seconds
        state.reach_count[characters, hands] += 1
        state.reach_waited[characters] = 0.0
        state.reach_is_own[characters, hands] = is_own
        state.reach_is_blocked[characters, hands] = False
        if not is_own:
            self._look_for_walls(state, characters, hands)
        is_good = np.isfinite(state.reach_target_world[characters, hands]).all(axis=1)
        is_good &= ~state.reach_is_blocked[characters, hands]
        # Another start before the first step begins anew as well.
        is_new = state.reach_stage[characters, hands] == NONE
        is_new |= state.reach_course[characters, hands] == 0.0
        rests = (state.reach_stage[characters] == NONE).all(axis=1)
        state.reach_correction[characters[rests]] = 0.0
        state.reach_correction_change[characters[rests]] = 0.0
        state.reach_last_rotation[characters[rests]] = 0.0
        state.reach_status[characters, hands] = np.where(is_good, MOVING, REFUSED)
        state.reach_refusals[characters, hands] += ~is_good
        going = ~is_new | is_good
        state.reach_stage[characters[going], hands[going]] = MOVE
        rows, own = characters[is_new & is_good], hands[is_new & is_good]
        for name in (
            "offset",
            "offset_velocity",
            "away",
            "lag",
            "lag_velocity",
            "lag_acceleration",
            "turn_velocity",
            "turn_acceleration",
            "missing_place",
            "missing_turn",
            "course",
            "course_rate",
            "time_left",
            "seen_velocity",
            "bulge",
            "lead_time",
            "turn",
            "turn_before",
            "rotation_rate",
        ):
            getattr(state, f"reach_{name}")[rows, own] = 0.0
        state.reach_rotation_share[rows, own] = state.reach_has_rotation[rows, own]
        away = state.reach_target_world[rows, own] - state.position_world[rows]
        sine, cosine = np.sin(state.yaw[rows]), np.cos(state.yaw[rows])
        state.reach_seen[rows, own, 0] = cosine * away[:, 0] - sine * away[:, 2]
        state.reach_seen[rows, own, 1] = away[:, 1]
        state.reach_seen[rows, own, 2] = sine * away[:, 0] + cosine * away[:, 2]
        state.reach_rotation[rows, own] = (1.0, 0.0, 0.0, 0.0)
        state.reach_glide_turn[rows, own] = (1.0, 0.0, 0.0, 0.0)
        if rotation_world is not None:
            turned = state.reach_target_rotation_world[rows, own]
            w, x, y, z = turned.T
            c, s = np.cos(0.5 * state.yaw[rows]), np.sin(-0.5 * state.yaw[rows])
            state.reach_rotation[rows, own] = np.stack(
                [c * w - s * y, c * x + s * z, c * y + s * w, c * z - s * x], axis=1
            )

    def _look_for_walls(self, state: State, characters: IntArray, hands: npt.NDArray[np.intp]) -> None:
        """Note which targets lie behind walls."""
        target = state.reach_target_world[characters, hands]
        shoulder = shoulders_world(
            state.position_world[characters],
            state.yaw[characters],
            self._stature[characters],
            hands,
            state.is_seated[characters],
        )
        state.reach_is_blocked[characters, hands] = self._world.is_blocked(shoulder, target)
        state.reach_checked_world[characters, hands] = np.where(np.isfinite(target), target, 0.0)

    def _follow_moved(self, state: State, reaching: IntArray) -> None:
        """Look for walls before targets that have moved."""
        if not self._world.has_obstacles:
            return
        away = state.reach_target_world[reaching] - state.reach_checked_world[reaching]
        moved = np.einsum("nhk,nhk->nh", away, away) > self.settings.wall_distance**2
        moved &= ~state.reach_is_own[reaching] & (state.reach_stage[reaching] != RETURN)
        place, hands = np.nonzero(moved & (state.reach_stage[reaching] != NONE))
        if place.size:
            self._look_for_walls(state, reaching[place], hands)

    def end(self, state: State, characters: IntArray, hand: npt.ArrayLike) -> None:
        """Let hands return."""
        hands = np.broadcast_to(np.asarray(hand), len(characters))
        reaches = state.reach_stage[characters, hands] != NONE
        state.reach_stage[characters[reaches], hands[reaches]] = RETURN

    def evaluate(self, step: Step) -> None:
        """Advance reaches, blend the examples over the pose and bring the hands to their targets."""
        state, settings = step.state, self.settings
        reaches = state.reach_stage != NONE
        reaching = step.active[(reaches[:, 0] | reaches[:, 1])[step.active]]
        if reaching.size == 0:
            return
        self._follow_moved(state, reaching)
        begins = (state.reach_stage == MOVE) & (state.reach_course == 0.0)
        parts = ReachState(*read_parts(state))
        begin = time.perf_counter()
        reach_crowd(
            self.space.arrays,
            self.space.keys,
            settings.limits,
            self._segment_scale,
            self._size,
            state.position_world,
            state.yaw,
            state.is_seated,
            state.locomotion_weight,
            reaching,
            step.dt,
            parts,
            self._number,
            self._real,
            self._rows,
            state.reach_correction,
            state.reach_correction_change,
            state.reach_last_rotation,
            state.pose_rotation,
            state.pose_pelvis,
            self._task,
            self._target,
            self._target_rotation,
            self._kept,
            self._bound,
        )
        blended = time.perf_counter()
        self._solve(state, reaching, step.dt)
        find_missing_crowd(
            self.space.keys,
            self._segment_scale,
            self._task,
            self._target,
            self._target_rotation,
            reaching,
            state.pose_rotation,
            state.pose_pelvis,
            parts,
            self._distance,
            self._angle,
        )
        self.part_seconds["blending"] += blended - begin
        self.part_seconds["inverse kinematics"] += time.perf_counter() - blended
        self._report(reaching, step.dt, parts)
        refused = begins & (state.reach_status == REFUSED)
        state.reach_stage[refused] = NONE
        for name in ("course", "course_rate", "weight"):
            getattr(state, f"reach_{name}")[refused] = 0.0

    def _solve(self, state: State, reaching: IntArray, dt: float) -> None:
        """Bring hands to their targets, from the blended poses turned as the last solutions were."""
        settings = self.settings
        np.copyto(self._point, state.reach_point_hand, casting="same_kind")
        start_solves(
            self._tree,
            self._task,
            self._kept,
            self._bound,
            state.reach_correction,
            state.pose_rotation,
            reaching,
            state.reach_last_rotation,
            self._solution,
        )
        asks = (self._task != 0)[reaching]
        hands = asks[:, 0] + 2 * asks[:, 1]
        for mask, tree in self._trees.items():
            rows = reaching[hands == mask]
            if rows.size == 0:
                continue
            solve_crowd(
                tree,
                solve_settings(settings, dt, mask == BOTH_HANDS),
                self._segment_scale,
                self._task,
                self._point,
                self._target,
                self._target_rotation,
                state.pose_rotation,
                state.pose_pelvis,
                state.reach_last_rotation,
                rows,
                self._solve_scratch,
                self._solution,
                state.pose_pelvis,
                self._status,
                self._distance,
                self._angle,
                self._iterations,
            )
        # Hands that hold one thing between them stay at it whatever their joints must do.
        carries = reaching[state.carry_stage[reaching] != CarryStage.FREE]
        self._bound[carries] = 0.0
        state.reach_waited[carries] = 0.0
        shared = hands == BOTH_HANDS
        for rows, acceleration in (
            (reaching[~shared], settings.correction_acceleration),
            (reaching[shared], settings.shared_correction_acceleration),
        ):
            keep_corrections(
                self._tree,
                0.5 * acceleration * dt * dt,
                0.5 * settings.rest_acceleration * dt,
                self._task,
                self._bound,
                state.reach_waited,
                self._solution,
                rows,
                state.pose_rotation,
                state.reach_correction,
                state.reach_correction_change,
                state.reach_last_rotation,
                self._distance,
            )

    def _report(self, reaching: IntArray, dt: float, parts: ReachState) -> None:
        """Tell how the reaches stand."""
        reach_status_crowd(
            self._target,
            self._distance,
            self._angle,
            reaching,
            dt,
            self.settings.tolerance,
            self.settings.angle_tolerance,
            parts,
        )


def require_lanes(joints: int) -> None:
    """Check that corrections of so many joints have room.

    Raises
    ------
    MotionError
        They have not.
    """
    if joints > LANES:
        raise MotionError(describe("reach", "too many joints move the hands", joints, f"at most {LANES}"))


def reach_space(library: MotionLibrary) -> ReachSpace:
    """Space of a library's reaches; what it lacks comes from the other hand or the built-in library."""
    own = library.of_kind(ClipKind.REACH)
    standing = one_for_each_side(library.skeleton, own)
    if standing is None:
        return built_in_reach_space()
    seated = [[clip for clip in seated_reaches() if side_of(clip) == side] for side in SIDES]
    return ReachSpace.build(library.skeleton, [*standing, *seated])


def one_for_each_side(skeleton: Skeleton, clips: Sequence[Clip]) -> list[list[Clip]] | None:
    """Reaches of the right and of the left hand, mirrored where a side lacks; None where both do."""
    sides = [[clip for clip in clips if side_of(clip) == side] for side in SIDES]
    if max(len(side) for side in sides) < FEWEST_EXAMPLES:
        return None
    for lacking, other in ((0, 1), (1, 0)):
        if len(sides[lacking]) < FEWEST_EXAMPLES:
            sides[lacking] = [mirrored(clip, skeleton, opposite(clip.name)) for clip in sides[other]]
    return sides


def side_of(clip: Clip) -> str:
    """Hand that a clip reaches with."""
    assert clip.reach is not None
    return clip.reach.side


@cache
def built_in_reach_space() -> ReachSpace:
    """Space of the built-in reaches: standing right and left, seated right and left; made once."""
    parts = (standing_reaches(), seated_reaches())
    sets = [[clip for clip in part if side_of(clip) == side] for part in parts for side in SIDES]
    return ReachSpace.build(build_skeleton(), sets)
