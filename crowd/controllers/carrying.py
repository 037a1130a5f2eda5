"""Before layer 5: what both hands hold moves as one thing, and both hands with it."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from crowd.controllers.carry_room import cylindrical, from_cylindrical, limited
from crowd.controllers.controller import Step
from crowd.controllers.grip_placement import GripPlacement
from crowd.controllers.holding import Frames, Holding
from crowd.controllers.reach import REACH_LIMITS, Reach
from crowd.model import Model
from crowd.motion.easing import minimum_jerk
from crowd.motion.rotation import about, conjugate, from_vector, multiply, rotate, to_vector
from crowd.people import shoulders_world
from crowd.state import BoolArray, CarryStage, FloatArray, IntArray, State
from crowd_kernels.reach_goal import is_inside_body
from crowd_kernels.reach_state import HOLD, MOVE, MOVING, OUT_OF_REACH, REFUSED

WALKING, STANDING = 0.5, 0.1
"""Shares of locomotion from which on a person walks, and down to which it stands."""


@dataclass(frozen=True)
class CarryingSettings:
    """Where and how people carry things with both hands."""

    height: float = 0.60
    """Height of the middle of the object, over stature."""
    gap: float = 0.17
    """m, at a stature of 1.75 m. From the middle of the body to the near side of the object."""
    move_time: float = 0.9
    """s, > 0. Least time from one place to another."""
    speed: float = 0.6
    """m/s, > 0. Mean speed of longer ways."""
    turn_rate: float = 0.9
    """rad/s, > 0. Mean rate of larger turns."""
    tolerance: float = 1e-3
    """m. An object at this distance is where it shall be."""
    angle_tolerance: float = 0.0174533
    """rad. Likewise for its rotation."""


class Carrying:
    """Moves objects that are between two hands, and gives both hands their targets.

    Each object has one course in the root frame; the targets of both hands follow from where it is on it, so
    that no hand goes where the other one does not. What is carried is fixed against the root, not the chest:
    the hands move the chest, which would move them again.
    """

    state_fields: ClassVar[tuple[str, ...]] = (
        "carry_stage",
        "carry_progress",
        "carry_seconds",
        "carry_position",
        "carry_rotation",
        "carry_velocity",
        "carry_turn_velocity",
        "carry_start_position",
        "carry_start_rotation",
        "carry_start_velocity",
        "carry_start_turn_velocity",
        "carry_grip_rotation",
        "carry_place_world",
        "carry_place_rotation_world",
    )

    def __init__(
        self,
        model: Model,
        holding: Holding,
        placement: GripPlacement,
        reach: Reach,
        settings: CarryingSettings | None = None,
    ) -> None:
        self.settings = settings or CarryingSettings()
        self._holding, self._placement, self._reach = holding, placement, reach
        self._objects = holding.objects
        self._world = model.world
        self._stature = model.people.stature
        self._size = model.people.stature / model.skeleton.stature
        self._lacks: BoolArray = np.zeros(model.capacity, np.bool_)

    def activate(self, state: State, characters: IntArray) -> None:
        """Start people with empty hands."""
        state.carry_stage[characters] = CarryStage.FREE

    # ---- what is asked

    def bring(
        self,
        state: State,
        characters: IntArray,
        items: IntArray,
        position_world: FloatArray,
        rotation_world: FloatArray,
    ) -> None:
        """Let people bring what both hands hold to a place; refused where one hand cannot go.

        Parameters
        ----------
        state : State
        characters, items : (M,) int32
            Each once, and the objects between their hands.
        position_world : (M, 3) float64
            Centres of the objects, m.
        rotation_world : (M, 4) float64
        """
        if characters.size == 0:
            return
        self._notice(state, characters, items)
        state.carry_place_world[characters] = position_world
        state.carry_place_rotation_world[characters] = rotation_world
        is_blocked, is_inside = np.zeros((2, characters.size), np.bool_)
        for hand in (0, 1):
            at = characters, np.full(characters.size, hand, np.int32)
            place, _ = self._holding.hand_targets(at, items, position_world, rotation_world)
            is_blocked |= self._is_blocked(state, characters, hand, place)
            is_inside |= self._is_inside(state, characters, place)
        is_refused = is_blocked | is_inside
        self._begin(state, characters, np.where(is_refused, CarryStage.STOPPED, CarryStage.PLACING))
        state.reach_count[characters] += 1
        state.reach_is_blocked[characters] = is_blocked[:, None]
        state.reach_refusals[characters] += is_refused[:, None]

    def _is_blocked(self, state: State, rows: IntArray, hand: int, place: FloatArray) -> BoolArray:
        """Whose hand has a wall between its shoulder and its target."""
        shoulder = shoulders_world(
            state.position_world[rows], state.yaw[rows], self._stature[rows], hand, state.is_seated[rows]
        )
        return np.asarray(self._world.is_blocked(shoulder, place))

    def _is_inside(self, state: State, rows: IntArray, place: FloatArray) -> BoolArray:
        """Whose target is in the own body."""
        at = rotate(about(1, -state.yaw[rows]), place - state.position_world[rows])
        return np.array(
            [
                is_inside_body(tuple(point), tuple(pelvis), size, REACH_LIMITS.body_radius)
                for point, pelvis, size in zip(at, state.pose_pelvis[rows], self._size[rows], strict=True)
            ],
            np.bool_,
        )

    # ---- in every step

    def evaluate(self, step: Step) -> None:
        """Move what is between two hands, and the targets of these hands.

        Who lets hands return while both hold something carries it before the body.
        """
        state = step.state
        right, left = self._objects.holder_hand.T
        items = np.flatnonzero(right & left).astype(np.int32)
        rows = self._objects.holder[items]
        if rows.size == 0:
            state.carry_stage.fill(CarryStage.FREE)
            return
        is_empty = np.ones(state.capacity, np.bool_)
        is_empty[rows] = False
        state.carry_stage[is_empty] = CarryStage.FREE
        self._notice(state, rows, items)
        returns = np.asarray(~np.isin(state.reach_stage[rows], (HOLD, MOVE)).all(axis=1))
        self._change(state, rows, returns)
        position, rotation = self._advance(state, rows, items, step.dt)
        self._aim(state, rows, items, returns, (position, rotation))

    def _change(self, state: State, rows: IntArray, returns: BoolArray) -> None:
        """Let things be carried whose holders take the hands back or walk, and others go to their places."""
        stage, walking = state.carry_stage[rows], state.locomotion_weight[rows]
        leaves = (stage == CarryStage.PLACING) & (walking > WALKING)
        is_there = state.carry_progress[rows] >= 1.0
        new = stage.copy()
        new[leaves & ~is_there] = CarryStage.WAITING
        new[(stage == CarryStage.WAITING) & (walking < STANDING)] = CarryStage.PLACING
        new[returns | (leaves & is_there)] = CarryStage.CARRYING
        changed = new != stage
        self._begin(state, rows[changed], new[changed])

    def _notice(self, state: State, rows: IntArray, items: IntArray) -> None:
        """Leave objects that two hands have just taken where they are."""
        new = state.carry_stage[rows] == CarryStage.FREE
        if not new.any():
            return
        rows, items = rows[new], items[new]
        place, turn = self._holding.in_world(items)
        back = about(1, -state.yaw[rows])
        state.carry_position[rows] = rotate(back, place - state.position_world[rows])
        state.carry_rotation[rows] = multiply(back, turn)
        state.carry_grip_rotation[rows] = state.carry_rotation[rows]
        state.carry_velocity[rows] = 0.0
        state.carry_turn_velocity[rows] = 0.0
        state.carry_place_world[rows], state.carry_place_rotation_world[rows] = place, turn
        # Hands are to hold it as they do: what they lacked when they closed is not wanted any more.
        state.reach_missing_place[rows] = 0.0
        state.reach_missing_turn[rows] = 0.0
        self._begin(state, rows, np.full(rows.size, CarryStage.PLACING))
        stays = rows[~self._lacks[rows]]
        state.carry_progress[stays] = 1.0
        state.carry_seconds[stays] = 0.0

    def _begin(self, state: State, rows: IntArray, stage: npt.NDArray[np.integer]) -> None:
        """Let objects set out from where they are, as fast as they move."""
        if rows.size == 0:
            return
        state.carry_stage[rows] = stage
        state.carry_progress[rows] = 0.0
        for name in ("position", "rotation", "velocity", "turn_velocity"):
            getattr(state, f"carry_start_{name}")[rows] = getattr(state, f"carry_{name}")[rows]
        state.reach_is_blocked[rows] &= (stage == CarryStage.STOPPED)[:, None]
        items = np.array([self._object_of(row) for row in rows], np.int32)
        position, rotation = self._goal(state, rows, items)
        way = np.linalg.norm(position - state.carry_position[rows], axis=1)
        turn = np.linalg.norm(to_vector(multiply(conjugate(state.carry_rotation[rows]), rotation)), axis=1)
        settings = self.settings
        seconds = np.maximum(way / settings.speed, turn / settings.turn_rate)
        state.carry_seconds[rows] = np.maximum(seconds, settings.move_time)

    def _object_of(self, row: int) -> int:
        """What is between the hands of a character."""
        objects = self._objects
        return int(np.flatnonzero((objects.holder == row) & objects.holder_hand.all(axis=1))[0])

    def _goal(self, state: State, rows: IntArray, items: IntArray) -> Frames:
        """Where objects shall come, in root frames, as far as both hands can bring them there."""
        back = about(1, -state.yaw[rows])
        position = rotate(back, state.carry_place_world[rows] - state.position_world[rows])
        rotation = multiply(back, state.carry_place_rotation_world[rows])
        stage = state.carry_stage[rows]
        carries = np.isin(stage, (CarryStage.CARRYING, CarryStage.WAITING))
        stopped = stage == CarryStage.STOPPED
        grip = state.carry_grip_rotation[rows]
        before = np.zeros((rows.size, 3))
        before[:, 1] = self.settings.height * self._stature[rows] - self._rise_of_hands(items, grip)
        before[:, 2] = self.settings.gap * self._size[rows] + self._placement.depths(items, grip)
        position[carries], rotation[carries] = before[carries], grip[carries]
        position[stopped] = state.carry_start_position[rows[stopped]]
        rotation[stopped] = state.carry_start_rotation[rows[stopped]]
        near, turned = self._limited(state, rows, (position, rotation))
        turn = to_vector(multiply(turned, conjugate(rotation)))
        lacks = np.linalg.norm(near - position, axis=1) > self.settings.tolerance
        self._lacks[rows] = lacks | (np.linalg.norm(turn, axis=1) > self.settings.angle_tolerance)
        return near, turned

    def _rise_of_hands(self, items: IntArray, rotation: FloatArray) -> FloatArray:
        """How far the middle between both hands is above the objects' centres, turned so (A, 4), m. (A,)"""
        center = np.zeros((items.size, 3))
        hands = [np.full(items.size, hand, np.int32) for hand in (0, 1)]
        places = [
            self._holding.hand_targets((items, hand), items, center, rotation)[0][:, 1] for hand in hands
        ]
        return np.asarray(0.5 * (places[0] + places[1]))

    def _limited(self, state: State, rows: IntArray, frames: Frames) -> Frames:
        """Bring poses in root frames into the room of both hands."""
        grip, walking = state.carry_grip_rotation[rows], state.locomotion_weight[rows]
        return limited(frames, grip, self._stature[rows], self._size[rows], walking.astype(np.float64))

    def _advance(self, state: State, rows: IntArray, items: IntArray, dt: float) -> Frames:
        """Move objects on along their courses around the body; where they are then, in root frames."""
        seconds = state.carry_seconds[rows]
        progress = np.minimum(state.carry_progress[rows] + dt / np.maximum(seconds, dt), 1.0)
        state.carry_progress[rows] = progress
        share = minimum_jerk(progress)
        # What is left of the motion at the start: as fast as it was at first, at rest at the end.
        drift = (seconds * progress * (1.0 - progress) ** 3)[:, None]
        goal, goal_rotation = self._goal(state, rows, items)
        start, start_rotation = state.carry_start_position[rows], state.carry_start_rotation[rows]
        first, last = cylindrical(start), cylindrical(goal)
        between = (a + share * (b - a) for a, b in zip(first, last, strict=True))
        position = from_cylindrical(*between) + drift * state.carry_start_velocity[rows]
        turn = to_vector(multiply(goal_rotation, conjugate(start_rotation)))
        turned = share[:, None] * turn + drift * state.carry_start_turn_velocity[rows]
        rotation = multiply(from_vector(turned), start_rotation)
        position, rotation = self._limited(state, rows, (position, rotation))
        # What was taken outside the room comes into it along the course.
        inside, inside_rotation = self._limited(state, rows, (start, start_rotation))
        position += (1.0 - share)[:, None] * (start - inside)
        outside = to_vector(multiply(start_rotation, conjugate(inside_rotation)))
        rotation = multiply(from_vector((1.0 - share)[:, None] * outside), rotation)
        state.carry_velocity[rows] = (position - state.carry_position[rows]) / dt
        change = to_vector(multiply(rotation, conjugate(state.carry_rotation[rows])))
        state.carry_turn_velocity[rows] = change / dt
        state.carry_position[rows], state.carry_rotation[rows] = position, rotation
        return position, rotation

    def _aim(self, state: State, rows: IntArray, items: IntArray, returns: BoolArray, frames: Frames) -> None:
        """Give both hands their targets, for objects at frames against the root.

        Both bring the same point to the same place: the centre of the object as each has it in its grip. A
        hand whose wrist does not turn as far as it should then still has the object where the other has it.
        """
        heading = about(1, state.yaw[rows])
        position = state.position_world[rows] + rotate(heading, frames[0])
        rotation = multiply(heading, frames[1])
        moves = state.carry_seconds[rows] > 0.0
        for hand in (0, 1):
            _, wanted = self._holding.hand_targets(
                (rows, np.full(rows.size, hand, np.int32)), items, position, rotation
            )
            grip = self._objects.grip_position[items, hand]
            if returns.any():
                self._reach.start(
                    state, rows[returns], hand, position[returns], wanted[returns], grip[returns], is_own=True
                )
            state.reach_is_own[rows, hand] = True
            state.reach_point_hand[rows, hand] = grip
            state.reach_target_world[rows, hand] = position
            state.reach_target_rotation_world[rows, hand] = wanted
            # Motions are smooth and followed at once: hands that lag come off. Those that have just taken
            # the object turn to rest first.
            state.reach_seen[rows, hand] = frames[0]
            state.reach_seen_velocity[rows, hand] = 0.0
            for name in ("lag", "lag_velocity", "lag_acceleration", "bulge", "time_left"):
                getattr(state, f"reach_{name}")[rows, hand] = 0.0
            state.reach_glide_turn[rows, hand] = (1.0, 0.0, 0.0, 0.0)
            tight = rows[moves]
            state.reach_rotation[tight, hand] = multiply(conjugate(heading[moves]), wanted[moves])
            state.reach_turn_velocity[tight, hand] = 0.0
            state.reach_turn_acceleration[tight, hand] = 0.0

    def end(self, state: State, characters: IntArray) -> None:
        """Let people whose hands open go on with each by itself: targets are those of wrists again."""
        rows = np.unique(characters[state.carry_stage[characters] != CarryStage.FREE])
        state.carry_stage[rows] = CarryStage.FREE
        for hand in (0, 1):
            point = state.reach_point_hand[rows, hand]
            world = rotate(state.reach_target_rotation_world[rows, hand], point)
            state.reach_target_world[rows, hand] -= world
            state.reach_seen[rows, hand] -= rotate(state.reach_rotation[rows, hand], point)
            state.reach_point_hand[rows, hand] = 0.0

    def report(self, state: State) -> None:
        """Tell how hands with an object between them stand, after the reach layer has told it of each."""
        rows = np.flatnonzero(state.carry_stage != CarryStage.FREE)
        if rows.size == 0:
            return
        is_there = (state.carry_progress[rows] >= 1.0) & (state.carry_stage[rows] != CarryStage.WAITING)
        state.reach_stage[rows[~is_there]] = MOVE
        state.reach_status[rows[~is_there]] = MOVING
        far = rows[is_there & self._lacks[rows]]
        state.reach_status[far] = OUT_OF_REACH
        state.reach_status[rows[state.carry_stage[rows] == CarryStage.STOPPED]] = REFUSED
