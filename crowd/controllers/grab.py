"""Layer 6, grab: fingers close on objects, hold them and let them go."""

from dataclasses import dataclass
from enum import IntEnum
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from crowd.controllers.carrying import Carrying
from crowd.controllers.controller import Step
from crowd.controllers.grip_placement import GripPlacement
from crowd.controllers.holding import Frames, Hands, Holding, composed
from crowd.controllers.reach import Reach
from crowd.joints import Joints
from crowd.model import Model
from crowd.motion.easing import minimum_jerk
from crowd.motion.hand import hand_table
from crowd.motion.rotation import about, rotate
from crowd.people import HANDING_HEIGHT
from crowd.state import BoolArray, FloatArray, IntArray, State
from crowd.world.objects import ObjectState
from crowd.world.shape_table import shape_table
from crowd_kernels import reach_state
from crowd_kernels.aligned import aligned_zeros
from crowd_kernels.grasp import CHUNKS, close_hands, measure_gaps
from crowd_kernels.hand_placement import TOO_BIG
from crowd_kernels.hand_pose import FINGER_ROW, pose_hands

OPEN, CLOSING, HOLDING, OPENING = range(4)
NOTHING, GRASP, TOUCH, GRASP_BOTH, AWAIT = range(5)
STATURE = 1.75
"""m."""
FARTHEST_GAP = 0.05
"""Gaps between fingers and objects are measured up to this, m."""


class GrabStatus(IntEnum):
    """How a grasp stands."""

    NONE = 0
    APPROACHING = 1
    HOLDING = 2
    TOUCHING = 3
    REFUSED = 4
    """No such object, an object that is nowhere, or a hand that holds something else."""
    TAKEN = 5
    """Somebody else holds the object and does not offer it."""
    TOO_BIG = 6
    """One hand cannot hold it; both may."""
    MISSED = 7
    """The fingers met nothing."""
    OUT_OF_REACH = 8
    """The hand is as near as it gets."""
    GIVEN = 9
    """Another hand has taken the object over; this one opens and returns."""
    TOO_LATE = 10
    """The hand has not come to the object for long."""
    EMPTY = 11
    """There is nothing in the hand."""
    TIED = 12
    """The other hand holds the object too; both move together."""
    TOO_FAR = 13
    """The other person is too far away."""


@dataclass(frozen=True)
class GrabSettings:
    """How hands grasp."""

    close_time: float = 0.32
    """s, > 0. From the open to the closed hand."""
    open_time: float = 0.28
    """s, > 0. From a grip to the open hand."""
    shape_time: float = 0.4
    """s, > 0. From the fingers of other layers to the open hand, and back."""
    near: float = 0.0015
    """m. A hand this near to its place on the object closes."""
    near_angle: float = 0.045
    """rad. Likewise for its rotation."""
    patience: float = 8.0
    """s, > 0. Who stands and has not come to an object for so long gives up."""
    before_body: float = 0.36
    """m, at a stature of 1.75 m. How far ahead people bring what they take with the other hand."""
    slip: float = 0.05
    """m. A hand that is farther than this from what it touched touches it no more."""
    nearness_of_both: float = 0.4
    """Share of these at which two hands close together: what one still lacks, the other must give."""
    settle_distance: float = 0.01
    """m. An object let go this near to where it was to be put is put exactly there."""


class Grab:
    """Brings hands to objects, closes them, lets held objects follow, and opens them."""

    state_fields: ClassVar[tuple[str, ...]] = (
        "grab_stage",
        "grab_status",
        "grab_refusals",
        "grab_refusal",
        "grab_purpose",
        "grab_object",
        "grab_giver",
        "grab_style",
        "grab_position",
        "grab_rotation",
        "grab_time",
        "grab_weight",
        "finger_closure",
        "finger_limit",
        "finger_contact",
    )

    def __init__(
        self,
        model: Model,
        objects: ObjectState,
        joints: Joints,
        reach: Reach,
        settings: GrabSettings | None = None,
    ) -> None:
        self.settings = settings or GrabSettings()
        self.objects = objects
        self.holding = Holding(model.skeleton, objects, joints)
        self.reach = reach
        self.hand = hand_table(model.skeleton)
        self.shapes = shape_table(model.objects)
        self.placement = GripPlacement(model, self.hand, self.shapes, objects, joints)
        self.carrying = Carrying(model, self.holding, self.placement, reach)
        self._scale = self.placement.scale
        self._scratch = aligned_zeros((CHUNKS, FINGER_ROW), np.float32)

    def activate(self, state: State, characters: IntArray) -> None:
        """Start people with empty hands."""
        state.grab_stage[characters] = OPEN
        state.grab_object[characters] = -1

    # ---- what is asked

    def grasp(self, state: State, characters: IntArray, hand: npt.ArrayLike, item: npt.ArrayLike) -> None:
        """Let hands go to objects, close around them and hold them.

        A second hand of the same character that is sent to an object makes it a grasp with both hands, palms
        on opposite sides. What another character holds out is taken over; so is what the other hand holds.

        Parameters
        ----------
        state : State
        characters : (M,) int32
            Each once.
        hand : int or (M,) int
            0 right, 1 left.
        item : int or (M,) int
            Rows of the objects. How it goes shows in ``state.grab_status``.
        """
        rows, hands, items = _listed(characters, hand, item)
        may = self._accept(state, (rows, hands), items)
        rows, hands, items = rows[may], hands[may], items[may]
        other = 1 - hands
        together = (state.grab_object[rows, other] == items) & (state.grab_stage[rows, other] == OPEN)
        together &= state.grab_purpose[rows, other] != TOUCH
        self._bring_before_body(state, (rows, other), items)
        moves = ~together & self._is_brought(state, rows, items)
        state.grab_object[rows[moves], hands[moves]] = items[moves]
        state.grab_purpose[rows[moves], hands[moves]] = AWAIT
        alone = ~together & ~moves
        self._grasp_alone(state, (rows[alone], hands[alone]), items[alone])
        self._grasp_together(state, rows[together], items[together])

    def grasp_both(self, state: State, characters: IntArray, item: npt.ArrayLike) -> None:
        """Let both hands go to opposite sides of objects and hold them together; see `grasp`."""
        rows, right, items = _listed(characters, 0, item)
        reasons = [self._reason_against(state, (rows, hand), items) for hand in (right, right + 1)]
        against = np.where(reasons[0] == GrabStatus.NONE, reasons[1], reasons[0])
        for hand, reason in zip((right, right + 1), reasons, strict=True):
            has = reason != GrabStatus.NONE
            self._turn_down(state, (rows[has], hand[has]), reason[has])
        may = against == GrabStatus.NONE
        self._grasp_together(state, rows[may], items[may])

    def is_too_big(
        self, state: State, characters: IntArray, hand: npt.ArrayLike, item: npt.ArrayLike
    ) -> BoolArray:
        """Tell which objects single hands cannot hold; arguments as in `grasp`. (M,)"""
        return np.asarray(self.placement.of_one_hand(state, *_listed(characters, hand, item))[3] == TOO_BIG)

    def is_too_big_for_both(self, state: State, characters: IntArray, item: npt.ArrayLike) -> BoolArray:
        """Tell which objects two hands cannot hold; arguments as in `grasp_both`. (M,)"""
        rows, _, items = _listed(characters, 0, item)
        return ~self.placement.of_both_hands(state, rows, items)[2]

    def touch(self, state: State, characters: IntArray, hand: npt.ArrayLike, item: npt.ArrayLike) -> None:
        """Let hands go to objects and lie on them without closing; arguments as in `grasp`."""
        rows, hands, items = _listed(characters, hand, item)
        may = self._accept(state, (rows, hands), items, holds=False)
        self._place(state, (rows[may], hands[may]), items[may], TOUCH)
        self._send(state, (rows[may], hands[may]))

    def release(
        self,
        state: State,
        characters: IntArray,
        hand: npt.ArrayLike,
        position_world: npt.ArrayLike | None = None,
        rotation_world: npt.ArrayLike | None = None,
    ) -> None:
        """Open hands; objects that no hand holds any more stay where they are.

        Parameters
        ----------
        state : State
        characters : (M,) int32
            Each once.
        hand : int or (M,) int
            0 right, 1 left. A hand that is on its way gives up.
        position_world : (3,) or (M, 3) array, optional
            Where the objects are to be, m; taken over where they are within `settle_distance` of it.
        rotation_world : (4,) or (M, 4) array, optional
            Likewise, unit quaternions.
        """
        rows, hands, _ = _listed(characters, hand, 0)
        items = state.grab_object[rows, hands]
        has = np.flatnonzero(self.holding.held_by((rows, hands), items))
        is_free = self.holding.detach((rows[has], hands[has]), items[has])
        if position_world is not None:
            free = has[is_free]
            objects, things = self.objects, items[free]
            place = np.broadcast_to(np.asarray(position_world, np.float64), (rows.size, 3))[free]
            near = np.linalg.norm(place - objects.position_world[things], axis=1)
            objects.release_error[things] = near
            put = near <= self.settings.settle_distance
            objects.position_world[things[put]] = place[put]
            if rotation_world is not None:
                turn = np.broadcast_to(np.asarray(rotation_world, np.float64), (rows.size, 4))[free]
                objects.rotation_world[things[put]] = turn[put]
        self._open(state, (rows, hands))

    def put(
        self,
        state: State,
        characters: IntArray,
        hand: npt.ArrayLike,
        position_world: npt.ArrayLike,
        rotation_world: npt.ArrayLike,
    ) -> None:
        """Let hands bring what they hold to poses in the world; `release` then lets go.

        Parameters
        ----------
        state : State
        characters : (M,) int32
            Each once; those whose hand holds nothing are refused. What both hands hold goes with both.
        hand : int or (M,) int
        position_world : (3,) or (M, 3) array
            Centre of the object, m.
        rotation_world : (4,) or (M, 4) array
        """
        rows, hands, _ = _listed(characters, hand, 0)
        holds = np.isin(state.grab_stage[rows, hands], (CLOSING, HOLDING))
        empty = rows[~holds], hands[~holds]
        self._turn_down(state, empty, np.full(empty[0].size, GrabStatus.EMPTY, np.uint8))
        place = np.broadcast_to(np.asarray(position_world, np.float64), (rows.size, 3))[holds]
        turn = np.broadcast_to(np.asarray(rotation_world, np.float64), (rows.size, 4))[holds]
        at = rows[holds], hands[holds]
        items = state.grab_object[at]
        both = self.objects.holder_hand[items].all(axis=1)
        self.carrying.bring(state, at[0][both], items[both], place[both], turn[both])
        alone = at[0][~both], at[1][~both]
        targets = self.holding.hand_targets(alone, items[~both], place[~both], turn[~both])
        self.reach.start(state, *alone, *targets)

    def finger_gaps(self, state: State, characters: IntArray, hand: npt.ArrayLike) -> FloatArray:
        """Measure how far fingers are from the objects that their hands go to or hold.

        Parameters
        ----------
        state : State
        characters : (M,) int32
        hand : int or (M,) int

        Returns
        -------
        (M, 5) float64
            Least gap of each finger, thumb first, m; negative inside; at most 5 cm, also for empty hands.
        """
        rows, hands, _ = _listed(characters, hand, 0)
        gap = np.full((rows.size, 5), FARTHEST_GAP)
        has = np.flatnonzero(state.grab_object[rows, hands] >= 0)
        at = rows[has], hands[has]
        found = np.zeros((has.size, 5))
        measure_gaps(
            self.hand,
            self.shapes,
            at[1],
            np.ascontiguousarray(state.grab_style[at]),
            np.ascontiguousarray(state.grab_object[at]),
            self._scale[at[0]],
            *self.holding.hands_in_world(state, at),
            self.objects.position_world,
            self.objects.rotation_world,
            np.ascontiguousarray(state.finger_closure[at]),
            FARTHEST_GAP,
            found,
        )
        gap[has] = found
        return gap

    # ---- in every step

    def evaluate(self, step: Step) -> None:
        """Advance the fingers of hands that are at work and write them into the poses."""
        state = step.state
        busy = (state.grab_object >= 0) | (state.grab_weight > 0.0)
        busy &= state.is_active[:, None]
        if not busy.any():
            return
        self._relax(state, _hands_where(busy & (state.grab_stage == OPEN)), step.dt)
        self._close(state, _hands_where(busy & (state.grab_stage == CLOSING)), step.dt)
        self._go_on_opening(state, _hands_where(busy & (state.grab_stage == OPENING)), step.dt)
        pose_hands(
            self.hand,
            state.grab_object,
            state.grab_style,
            step.dt / self.settings.shape_time,
            step.active,
            state.finger_closure,
            self._scratch,
            state.grab_weight,
            state.pose_rotation,
        )

    def settle(self, step: Step) -> None:
        """After the joints are known: hands that have arrived begin to close, held objects follow."""
        state = step.state
        self.holding.drop_of_the_gone(state)
        rows, hands = _hands_where((state.grab_object >= 0) & state.is_active[:, None])
        status = state.grab_status[rows, hands]
        waits = (status == GrabStatus.APPROACHING.value) | (status == GrabStatus.OUT_OF_REACH.value)
        waits &= state.grab_stage[rows, hands] == OPEN
        if waits.any():
            awaits = waits & (state.grab_purpose[rows, hands] == AWAIT)
            awaits[awaits] = ~self._is_brought(state, rows[awaits], state.grab_object[rows, hands][awaits])
            self._grasp_alone(state, (rows[awaits], hands[awaits]), state.grab_object[rows, hands][awaits])
            self._arrive(state, (rows[waits], hands[waits]))
            self._lose_patience(state, (rows[waits], hands[waits]), step.dt)
        self.holding.follow(state)
        touches = state.grab_status[rows, hands] == GrabStatus.TOUCHING.value
        if touches.any():
            self._keep_touching(state, (rows[touches], hands[touches]))
        self.carrying.report(state)
        if waits.any():
            self._follow(state, (rows[waits], hands[waits]))

    # ---- parts of these

    def _accept(self, state: State, hands: Hands, items: IntArray, holds: bool = True) -> BoolArray:
        """Sort out hands that cannot go to their objects, and say why."""
        rows, side = hands
        reason = self._reason_against(state, hands, items, holds)
        other = 1 - side
        goes_on = (state.grab_object[rows, side] >= 0) & (state.grab_object[rows, other] != items)
        goes_on &= (reason == GrabStatus.NONE) & (state.grab_stage[rows, side] == OPEN)
        if holds and goes_on.any():
            big = self.is_too_big(state, rows[goes_on], side[goes_on], items[goes_on])
            reason[np.flatnonzero(goes_on)[big]] = GrabStatus.TOO_BIG
        may = reason == GrabStatus.NONE
        has = (rows[~may], side[~may])
        self._turn_down(state, has, reason[~may])
        state.grab_status[rows[may], side[may]] = GrabStatus.APPROACHING
        state.grab_time[rows[may], side[may]] = 0.0
        if holds and may.any():
            state.grab_giver[rows[may], side[may]] = self.objects.holder[items[may]]
        return np.asarray(may)

    def _reason_against(
        self, state: State, hands: Hands, items: IntArray, holds: bool = True
    ) -> npt.NDArray[np.uint8]:
        """Why hands cannot go to objects: `GrabStatus.NONE` where they can, `HOLDING` where they have it."""
        rows, side = hands
        objects = self.objects
        exists = (items >= 0) & (items < objects.count)
        known = np.where(exists, items, 0)
        if objects.count:
            exists &= np.isfinite(objects.position_world[known]).all(axis=1)
        reason = np.where(exists, GrabStatus.NONE, GrabStatus.REFUSED).astype(np.uint8)
        closed = np.isin(state.grab_stage[rows, side], (CLOSING, HOLDING))
        has_it = closed & exists & (state.grab_object[rows, side] == items)
        reason[closed] = GrabStatus.REFUSED
        reason[has_it] = GrabStatus.HOLDING
        if not holds or not exists.any():
            return reason
        giver = objects.holder[known]
        is_others = exists & (giver >= 0) & (giver != rows)
        offers = ((state.reach_stage[giver] != reach_state.NONE) & objects.holder_hand[known]).any(axis=1)
        reason[is_others & ~offers & ~closed] = GrabStatus.TAKEN
        return reason

    def _turn_down(self, state: State, hands: Hands, reason: npt.NDArray[np.uint8]) -> None:
        """Refuse what hands are asked for; what they are at goes on. `HOLDING` needs no refusal."""
        new = reason != GrabStatus.HOLDING
        rows, side, reason = hands[0][new], hands[1][new], reason[new]
        state.grab_refusal[rows, side] = reason
        state.grab_refusals[rows, side] += 1
        idle = state.grab_object[rows, side] < 0
        state.grab_status[rows[idle], side[idle]] = reason[idle]

    def _is_brought(self, state: State, rows: IntArray, items: IntArray) -> BoolArray:
        """Which objects others, or other hands, are still bringing to where they hold them out."""
        holder = self.objects.holder[items]
        moves = (state.reach_stage[holder] == reach_state.MOVE) & self.objects.holder_hand[items]
        return np.asarray((holder >= 0) & moves.any(axis=1))

    def _bring_before_body(self, state: State, hands: Hands, items: IntArray) -> None:
        """Let hands that hold objects at the side bring them to where the other hand takes them."""
        rests = self.holding.held_by(hands, items)
        rests &= np.isin(state.reach_stage[hands], (reach_state.NONE, reach_state.RETURN))
        rows, side, items = hands[0][rests], hands[1][rests], items[rests]
        if rows.size == 0:
            return
        ahead = np.zeros((rows.size, 3))
        ahead[:, 1] = HANDING_HEIGHT * self.placement.stature[rows]
        ahead[:, 2] = self.settings.before_body * self.placement.stature[rows] / STATURE
        place = state.position_world[rows] + rotate(about(1, state.yaw[rows]), ahead)
        self.put(state, rows, side, place, self.placement.upright(items))

    def _grasp_alone(self, state: State, hands: Hands, items: IntArray) -> None:
        """Choose grips of single hands and send those that are large enough."""
        if items.size == 0:
            return
        rows, side = hands
        fits = self._place(state, hands, items, GRASP) != TOO_BIG
        self._send(state, (rows[fits], side[fits]))
        self._refuse(state, (rows[~fits], side[~fits]), GrabStatus.TOO_BIG)

    def _place(self, state: State, hands: Hands, items: IntArray, purpose: int) -> IntArray:
        """Choose grips for single hands; tells who is `TOO_BIG`."""
        rows, side = hands
        position, rotation, style, status = self.placement.of_one_hand(state, rows, side, items)
        state.grab_object[rows, side] = items
        state.grab_purpose[rows, side] = purpose
        state.grab_style[rows, side] = style
        state.grab_position[rows, side] = position
        state.grab_rotation[rows, side] = rotation
        state.finger_contact[rows, side] = 0
        state.grab_stage[rows, side] = OPEN
        return status

    def _grasp_together(self, state: State, rows: IntArray, items: IntArray) -> None:
        """Choose grips on opposite sides, and send both hands."""
        if rows.size == 0:
            return
        position, rotation, fits = self.placement.of_both_hands(state, rows, items)
        for side in (0, 1):
            hands = np.full(rows.size, side, np.int32)
            state.grab_object[rows, side] = items
            state.grab_purpose[rows, side] = GRASP_BOTH
            state.grab_style[rows, side] = 0
            state.grab_position[rows, side] = position[:, side]
            state.grab_rotation[rows, side] = rotation[:, side]
            state.finger_contact[rows, side] = 0
            state.grab_stage[rows, side] = OPEN
            state.grab_giver[rows, side] = self.objects.holder[items]
            state.grab_time[rows, side] = 0.0
            state.grab_status[rows, side] = GrabStatus.APPROACHING
            self._refuse(state, (rows[~fits], hands[~fits]), GrabStatus.TOO_BIG)
            self._send(state, (rows[fits], hands[fits]))

    def _send(self, state: State, hands: Hands) -> None:
        """Let the reach layer bring hands to their grips."""
        if hands[0].size:
            self.reach.start(state, *hands, *self._wanted(state, hands))

    def _wanted(self, state: State, hands: Hands) -> Frames:
        """Where hand joints shall be for their grips, in the world."""
        grip = state.grab_position[hands], state.grab_rotation[hands]
        return composed(self.holding.in_world(state.grab_object[hands]), grip)

    def _arrive(self, state: State, hands: Hands) -> None:
        """Let hands that are at their grips touch or begin to close; give up what others have taken."""
        rows, side = hands
        items = state.grab_object[hands]
        holder = self.objects.holder[items]
        lost = (holder >= 0) & (holder != rows) & (holder != state.grab_giver[hands])
        lost &= state.grab_purpose[hands] != TOUCH
        self._give_up(state, (rows[lost], side[lost]), GrabStatus.TAKEN)
        refused = ~lost & (state.reach_status[hands] == reach_state.REFUSED)
        self._give_up(state, (rows[refused], side[refused]), GrabStatus.REFUSED)
        stays = ~lost & ~refused
        far = stays & (state.reach_status[hands] == reach_state.OUT_OF_REACH)
        state.grab_status[rows[stays], side[stays]] = np.where(
            far[stays], GrabStatus.OUT_OF_REACH, GrabStatus.APPROACHING
        )
        is_near = stays & self._is_near(state, hands)
        touching = is_near & (state.grab_purpose[hands] == TOUCH)
        state.grab_status[rows[touching], side[touching]] = GrabStatus.TOUCHING
        closing = is_near & (state.grab_purpose[hands] == GRASP)
        # Of several hands that arrive at once the first one gets the object.
        first = np.zeros(rows.size, np.bool_)
        first[np.flatnonzero(closing)[np.unique(items[closing], return_index=True)[1]]] = True
        self._begin(state, (rows[first], side[first]))
        both = is_near & (state.grab_purpose[hands] == GRASP_BOTH)
        count = np.bincount(rows[both], minlength=state.capacity)
        pair = both & (count[rows] == 2)
        if pair.any():
            owner = np.unique(items[pair], return_index=True)[1]
            chosen = np.isin(rows, rows[pair][owner]) & pair
            self._begin(state, (rows[chosen], side[chosen]))

    def _lose_patience(self, state: State, hands: Hands, dt: float) -> None:
        """Let hands give up that have not come to their objects for long while their people stand."""
        waits = (state.grab_stage[hands] == OPEN) & (state.grab_object[hands] >= 0)
        waits &= np.isin(state.grab_status[hands], (GrabStatus.APPROACHING, GrabStatus.OUT_OF_REACH))
        rows, side = hands[0][waits], hands[1][waits]
        walks = state.locomotion_weight[rows] > 0.0
        state.grab_time[rows, side] = np.where(walks, 0.0, state.grab_time[rows, side] + dt)
        late = state.grab_time[rows, side] > self.settings.patience
        self._give_up(state, (rows[late], side[late]), GrabStatus.TOO_LATE)

    def forget(self, state: State, characters: IntArray, hand: npt.ArrayLike) -> None:
        """Let hands that are on their way to objects, or touch them, leave them alone."""
        rows, hands, _ = _listed(characters, hand, 0)
        goes = (state.grab_stage[rows, hands] == OPEN) & (state.grab_object[rows, hands] >= 0)
        self._forget(state, (rows[goes], hands[goes]), GrabStatus.NONE)

    def refuse(self, state: State, characters: IntArray, hand: npt.ArrayLike, why: GrabStatus) -> None:
        """Note that hands do not do what they were asked to; what they are at goes on."""
        rows, hands, _ = _listed(characters, hand, 0)
        self._turn_down(state, (rows, hands), np.full(rows.size, why, np.uint8))

    def _keep_touching(self, state: State, hands: Hands) -> None:
        """Let hands follow what they have touched, and give up what others carry away."""
        rows, side = hands
        place, _ = self.holding.hands_in_world(state, hands)
        slipped = np.linalg.norm(place - self._wanted(state, hands)[0], axis=1) > self.settings.slip
        holder = self.objects.holder[state.grab_object[hands]]
        lost = slipped & (holder >= 0) & (holder != rows)
        self._give_up(state, (rows[lost], side[lost]), GrabStatus.TAKEN)
        follows = slipped & ~lost
        state.grab_status[rows[follows], side[follows]] = GrabStatus.APPROACHING

    def _is_near(self, state: State, hands: Hands) -> BoolArray:
        """Who is at the grip, within `near` and `near_angle`; a share of them for both hands."""
        place, turn = self.holding.hands_in_world(state, hands)
        wanted_place, wanted_turn = self._wanted(state, hands)
        away = np.linalg.norm(place - wanted_place, axis=1)
        cosine = np.minimum(np.abs((turn * wanted_turn).sum(axis=1)), 1.0)
        share = np.where(state.grab_purpose[hands] == GRASP_BOTH, self.settings.nearness_of_both, 1.0)
        return np.asarray(
            (away <= share * self.settings.near)
            & (2.0 * np.arccos(cosine) <= share * self.settings.near_angle)
        )

    def _begin(self, state: State, hands: Hands) -> None:
        """Find where fingers will end, fix objects to hands, and begin to close."""
        rows, side = hands
        if rows.size == 0:
            return
        items = state.grab_object[hands]
        place, turn = self.holding.hands_in_world(state, hands)
        limit, contact = state.finger_limit, state.finger_contact
        limit[hands] = 0.0
        contact[hands] = 0
        close_hands(
            self.hand,
            self.shapes,
            rows,
            side,
            np.ascontiguousarray(state.grab_style[hands]),
            np.ascontiguousarray(items),
            self._scale[rows],
            place,
            turn,
            self.objects.position_world,
            self.objects.rotation_world,
            limit,
            contact,
        )
        met = contact[hands].any(axis=1) | (state.grab_purpose[hands] == GRASP_BOTH)
        self._give_up(state, (rows[~met], side[~met]), GrabStatus.MISSED)
        rows, side, items = rows[met], side[met], items[met]
        self._take_from_others(state, rows, side, items)
        self.holding.attach((rows, side), items, (place[met], turn[met]))
        state.grab_stage[rows, side] = CLOSING
        state.grab_time[rows, side] = 0.0

    def _take_from_others(self, state: State, rows: IntArray, side: IntArray, items: IntArray) -> None:
        """Open the hands that held these objects until now."""
        objects = self.objects
        for hand in (0, 1):
            holder = objects.holder[items]
            held = (holder >= 0) & objects.holder_hand[items, hand]
            # Both hands that begin together are no others.
            held &= ~((holder == rows) & (state.grab_purpose[rows, side] == GRASP_BOTH))
            givers = holder[held]
            objects.holder_hand[items[held], hand] = False
            self._open(state, (givers, np.full(givers.size, hand, np.int32)), GrabStatus.GIVEN)

    def _relax(self, state: State, hands: Hands, dt: float) -> None:
        """Open fingers of hands that have not begun to close, and may have had something before."""
        if hands[0].size == 0:
            return
        still_closed = state.finger_closure[hands] - np.float32(dt / self.settings.open_time)
        state.finger_closure[hands] = np.maximum(still_closed, 0.0)

    def _close(self, state: State, hands: Hands, dt: float) -> None:
        """Go on closing."""
        if hands[0].size == 0:
            return
        time = state.grab_time[hands] + dt
        state.grab_time[hands] = time
        share = minimum_jerk(time / self.settings.close_time)
        limit = state.finger_limit[hands]
        state.finger_closure[hands] = np.minimum(limit, share[:, None]).astype(np.float32)
        done = (share[:, None] >= limit).all(axis=1)
        ready = hands[0][done], hands[1][done]
        state.grab_stage[ready] = HOLDING
        state.grab_status[ready] = GrabStatus.HOLDING

    def _go_on_opening(self, state: State, hands: Hands, dt: float) -> None:
        """Go on opening; a hand that is open is free."""
        if hands[0].size == 0:
            return
        before = state.grab_time[hands]
        state.grab_time[hands] = before + dt
        length = self.settings.open_time
        left = 1.0 - minimum_jerk((before + dt) / length)
        had = 1.0 - minimum_jerk(before / length)
        share = left / np.maximum(had, 1e-9)
        state.finger_closure[hands] *= share[:, None].astype(np.float32)
        done = left <= 0.0
        ready = hands[0][done], hands[1][done]
        state.finger_closure[ready] = 0.0
        given = state.grab_status[ready] == GrabStatus.GIVEN
        self.reach.end(state, ready[0][given], ready[1][given])
        self._forget(state, ready, GrabStatus.NONE)

    def _open(self, state: State, hands: Hands, status: GrabStatus = GrabStatus.NONE) -> None:
        """Begin to open hands; those that have not closed yet are free at once."""
        rows, side = hands
        self.carrying.end(state, rows)
        closed = np.isin(state.grab_stage[hands], (CLOSING, HOLDING))
        state.grab_time[rows[closed], side[closed]] = 0.0
        state.grab_stage[rows[closed], side[closed]] = OPENING
        state.grab_status[rows[closed], side[closed]] = status
        idle = state.grab_stage[hands] == OPEN
        self._forget(state, (rows[idle], side[idle]), GrabStatus.NONE)

    def _give_up(self, state: State, hands: Hands, status: GrabStatus) -> None:
        """Free hands that are on their way, and let them return."""
        if hands[0].size == 0:
            return
        self._forget(state, hands, status)
        self._refuse(state, hands, status)
        self.reach.end(state, *hands)

    def _refuse(self, state: State, hands: Hands, status: GrabStatus) -> None:
        """Say that hands do not get what they were sent to, and why."""
        state.grab_status[hands] = status
        state.grab_refusal[hands] = status
        state.grab_refusals[hands] += 1

    def _forget(self, state: State, hands: Hands, status: GrabStatus) -> None:
        state.grab_object[hands] = -1
        state.grab_giver[hands] = -1
        state.grab_purpose[hands] = NOTHING
        state.grab_stage[hands] = OPEN
        state.grab_status[hands] = status
        state.finger_contact[hands] = 0

    def _follow(self, state: State, hands: Hands) -> None:
        """Give hands that are on their way the places of objects that have moved."""
        still = state.grab_object[hands] >= 0
        still &= (state.grab_stage[hands] == OPEN) & (state.grab_purpose[hands] != AWAIT)
        rows, side = hands[0][still], hands[1][still]
        if rows.size == 0:
            return
        state.reach_target_world[rows, side], state.reach_target_rotation_world[rows, side] = self._wanted(
            state, (rows, side)
        )


def _listed(
    characters: IntArray, hand: npt.ArrayLike, item: npt.ArrayLike
) -> tuple[IntArray, IntArray, IntArray]:
    """Characters, hands and objects as arrays of one length."""
    rows = np.atleast_1d(np.asarray(characters, np.int32))
    hands = np.broadcast_to(np.asarray(hand, np.int32), rows.shape)
    items = np.broadcast_to(np.asarray(item, np.int32), rows.shape)
    return rows, np.ascontiguousarray(hands), np.ascontiguousarray(items)


def _hands_where(mask: BoolArray) -> Hands:
    """Characters and hands for which a mask (N, 2) is true."""
    rows, hands = np.nonzero(mask)
    return rows.astype(np.int32), hands.astype(np.int32)
