"""What a program asks of characters between two steps: goals, direct locomotion, plays."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from crowd.arguments import number, rotations_of, shown, vectors
from crowd.controllers.grab import CLOSING, HOLDING, GrabStatus
from crowd.errors import SettingsError, describe
from crowd.motion.clip import ClipKind
from crowd.people import HANDING_HEIGHT
from crowd.scenario.task_table import TaskTable
from crowd.state import CarryStage
from crowd.tasks.execution import encode_tasks

if TYPE_CHECKING:
    from crowd.simulation import Simulation

HANDS = ("right", "left")
BOTH = "both"
FARTHEST_HANDING = 1.6
"""Distance of people up to which one hands something over to the other, m."""
Characters = int | slice | Sequence[int] | npt.NDArray[np.integer]


class Commands:
    """Commands take effect in the next step; they write the state at once, so a saved state contains them."""

    def __init__(self, simulation: Simulation) -> None:
        self._simulation = simulation

    def set_goal(self, characters: Characters, goal_world: npt.ArrayLike, radius: float = 0.3) -> None:
        """Send characters to a point; it replaces what is left of their goal lists.

        Who sits stands up first.

        Parameters
        ----------
        characters : int, slice or sequence of int
            Rows of the state.
        goal_world : (2,), (3,), (M, 2) or (M, 3) array
            Ground point x, z (or x, y, z), one for all or one each, m.
        radius : float
            Distance at which the goal counts as reached, m, > 0.

        Raises
        ------
        SettingsError
            A goal is not finite, is inside an obstacle, or cannot be reached.
        """
        rows = self._rows(characters)
        goals = vectors("set_goal", "goal", goal_world, rows.size, (2, 3))
        if goals.shape[1] == 2:
            goals = np.insert(goals, 1, 0.0, axis=1)
        radius = number("set_goal", "radius", radius, "> 0 m")
        if not radius > 0:
            raise SettingsError(describe("set_goal", "radius must be positive", radius, "> 0 m"))
        simulation = self._simulation
        world, body = simulation.model.world, simulation.model.radius
        for row, goal in zip(rows, goals, strict=True):
            place = np.array([goal])
            if not world.is_walkable(place, body[row])[0]:
                where = "outside the bounds" if not world.is_inside_bounds(place)[0] else "inside an obstacle"
                raise SettingsError(
                    describe("set_goal", f"goal of character {row} is {where}", goal[[0, 2]].tolist())
                )
            start = simulation.state.position_world[row : row + 1]
            if not world.is_reachable(start, place, body[row])[0]:
                raise SettingsError(
                    describe("set_goal", f"character {row} finds no way to its goal", goal[[0, 2]].tolist())
                )
        simulation.sitting.stand(simulation.state, rows)
        simulation.population.send(
            simulation.state, rows, np.ascontiguousarray(goals), np.full(rows.size, radius)
        )

    def set_locomotion(self, characters: Characters, parameters: npt.ArrayLike) -> None:
        """Command forward speed, turn rate and side speed directly; steering is ignored until `release`.

        Who sits stands up first.

        Parameters
        ----------
        characters : int, slice or sequence of int
        parameters : (3,) or (M, 3) array
            Forward speed m/s, turn rate rad/s (left positive), side speed m/s (left positive). Values outside
            the locomotion hull are realised as the nearest ones inside.
        """
        rows = self._rows(characters)
        values = vectors("set_locomotion", "parameter vector", parameters, rows.size)
        simulation, state = self._simulation, self._simulation.state
        simulation.sitting.stand(state, rows)
        state.is_directed[rows] = True
        state.directed_parameter[rows] = values

    def release(self, characters: Characters) -> None:
        """Give characters back to navigation and steering."""
        self._simulation.state.is_directed[self._rows(characters)] = False

    def play(
        self, characters: Characters, clip_name: str, *, repetitions: float = 1, seconds: float | None = None
    ) -> None:
        """Play a clip over the pose, on the joints of its mask.

        Parameters
        ----------
        characters : int, slice or sequence of int
        clip_name : str
            A gesture of the motion library.
        repetitions : float
            Times that the clip is played, > 0; ``math.inf`` repeats a cyclic clip until `stop_play`.
        seconds : float, optional
            Length of the play, s; instead of `repetitions`.

        Raises
        ------
        MotionError
            No clip has this name.
        """
        rows = self._rows(characters)
        model = self._simulation.model
        clip = model.library.clip(clip_name)
        if clip.kind is ClipKind.LOCOMOTION:
            raise SettingsError(
                describe(
                    "play", "locomotion examples are blended, not played", clip_name, "a gesture or idle clip"
                )
            )
        if clip.frame_count < 2:
            raise SettingsError(describe("play", "is a single pose", clip_name, "a gesture or idle clip"))
        if seconds is None:
            length = clip.duration * number("play", "repetitions", repetitions, "> 0")
        else:
            length = number("play", "seconds", seconds, "> 0 s")
        if not length > 0 or math.isnan(length):
            raise SettingsError(describe("play", "length must be positive", length, "> 0 s"))
        index = model.clip_table.names.index(clip_name)
        self._simulation.animation.play(self._simulation.state, rows, index, length)

    def stop_play(self, characters: Characters) -> None:
        """Fade out what the characters play."""
        self._simulation.animation.stop(self._simulation.state, self._rows(characters))

    def look_at(
        self,
        characters: Characters,
        point_world: npt.ArrayLike | None = None,
        *,
        character: npt.ArrayLike | None = None,
        object: str | npt.ArrayLike | None = None,
        trunk: float = 1.0,
    ) -> None:
        """Let characters look at a point, another character or an object, until `look_away`.

        What cannot be looked at, such as a point inside the own head, shows in ``state.gaze_status``.

        Parameters
        ----------
        characters : int, slice or sequence of int
        point_world : (3,) or (M, 3) array, optional
            One for all or one each, m.
        character : int or (M,) int, optional
            Whom to look at instead.
        object : str, int or (M,) int, optional
            Name or row of an object to look at instead.
        trunk : float
            How far waist and chest take part, 0 to 1.

        Raises
        ------
        SettingsError
            Not exactly one target is given, or it is of the wrong shape or number.
        """
        rows, gaze, state = self._rows(characters), self._simulation.gaze, self._simulation.state
        given = [
            name
            for name, target in (("point", point_world), ("character", character), ("object", object))
            if target is not None
        ]
        if len(given) != 1:
            found = " and ".join(given) or "none of them"
            raise SettingsError(
                describe("look_at", "needs exactly one target", found, "one of point, character, object")
            )
        trunk = number("look_at", "trunk", trunk, "0 to 1")
        if not 0.0 <= trunk <= 1.0:
            raise SettingsError(describe("look_at", "trunk is out of range", trunk, "0 to 1"))
        if point_world is not None:
            points = vectors("look_at", "point", point_world, rows.size, must_be_finite=False)
            gaze.look_at_point(state, rows, points, trunk)
        elif character is not None:
            others = self._rows(np.atleast_1d(np.asarray(character)), must_be_there=False)
            self._require_one_or_all("look_at", "characters", others.size, rows.size)
            gaze.look_at_character(state, rows, others, trunk)
        else:
            assert object is not None
            objects = self._simulation.model.objects
            index = np.asarray(objects.index(object) if isinstance(object, str) else object)
            is_number = np.issubdtype(index.dtype, np.integer)
            if not is_number or ((index < 0) | (index >= objects.count)).any():
                known = f"0 to {objects.count - 1}" if objects.count else "the scenario has no objects"
                raise SettingsError(describe("look_at", "no such object", shown(object), known))
            self._require_one_or_all("look_at", "objects", index.size, rows.size)
            gaze.look_at_object(state, rows, index, trunk)

    def set_attention(self, characters: Characters, attention: str) -> None:
        """Set how the eyes jump about what is looked at: "listening", "talking", "thinking", or "none"."""
        simulation = self._simulation
        simulation.gaze.set_attention(simulation.state, self._rows(characters), attention)

    def look_away(self, characters: Characters) -> None:
        """Let the gaze of characters fade; idle glances may come again."""
        self._simulation.gaze.release(self._simulation.state, self._rows(characters))

    def reach(
        self,
        characters: Characters,
        target_world: npt.ArrayLike,
        hand: str | None = None,
        *,
        rotation_world: npt.ArrayLike | None = None,
        seconds: float | None = None,
        hold: float | None = None,
    ) -> None:
        """Let characters reach for points with a hand, until `end_reach`.

        A hand that already reaches goes on to the new target. How it stands shows in ``state.reach_status``:
        what is out of reach is approached as near as can be, what cannot be reached for is refused.

        Parameters
        ----------
        characters : int, slice or sequence of int
        target_world : (3,) or (M, 3) array
            Where the wrist shall come, m.
        hand : {"right", "left", "both"}, optional
            The hand on the target's side when left out. One that is on its way to an object leaves that
            alone; one that holds an object together with the other hand is refused, see `put`.
        rotation_world : (4,) or (M, 4) array, optional
            Rotation (w, x, y, z) of the hand joint.
        seconds : float, optional
            Time to the target, s, > 0; as people do when left out.
        hold : float, optional
            Time at the target before the hand returns, s, >= 0; until `end_reach` when left out.

        Raises
        ------
        SettingsError
            A target is of the wrong shape, a hand is unknown, or a time is out of range.
        """
        rows, simulation = self._rows(characters), self._simulation
        targets = vectors("reach", "target", target_world, rows.size, must_be_finite=False)
        if seconds is not None and not 0.0 < number("reach", "seconds", seconds, "> 0 s") < math.inf:
            raise SettingsError(describe("reach", "seconds are out of range", seconds, "> 0 s"))
        if hold is not None and not number("reach", "hold", hold, ">= 0 s") >= 0.0:
            raise SettingsError(describe("reach", "hold is out of range", hold, ">= 0 s"))
        rotations = None
        if rotation_world is not None:
            rotations = vectors("reach", "rotation", rotation_world, rows.size, (4,), must_be_finite=False)
            length = np.linalg.norm(rotations, axis=-1, keepdims=True)
            rotations = rotations / np.where(length > 0.0, length, 1.0)
        for side in self._sides("reach", rows, hand, targets):
            may = self._lets_reach(rows, side)
            own = None if rotations is None else np.broadcast_to(rotations, (rows.size, 4))[may]
            places = np.broadcast_to(targets, (rows.size, 3))[may]
            simulation.grab.forget(simulation.state, rows[may], side[may])
            simulation.reach.start(
                simulation.state, rows[may], side[may], places, own, seconds=seconds, hold=hold
            )

    def end_reach(self, characters: Characters, hand: str | None = None) -> None:
        """Let hands of characters return to rest, "right", "left" or "both"; both when none is named.

        Hands that are on their way to an object leave it alone. What both hands hold is then carried before
        the body.
        """
        rows, simulation = self._rows(characters), self._simulation
        for side in self._named_sides("end_reach", hand):
            simulation.grab.forget(simulation.state, rows, side)
            simulation.reach.end(simulation.state, rows, side)

    def grasp(self, characters: Characters, item: int | str, hand: str | None = None) -> None:
        """Let characters reach for an object, close a hand around it and hold it, until `let_go`.

        What another character holds out can be taken, and so can what the other hand holds. How it goes shows
        in ``state.grab_status``, see `crowd.controllers.grab.GrabStatus`.

        Parameters
        ----------
        characters : int, slice or sequence of int
        item : int or str
            Row or name of the object.
        hand : {"right", "left", "both"}, optional
            When left out the hand on the object's side, and both for what is too big for one.

        Raises
        ------
        SettingsError
            There is no such object or hand.
        """
        rows, index, simulation = self._rows(characters), self._item("grasp", item), self._simulation
        state, grab = simulation.state, simulation.grab
        sides = self._sides("grasp", rows, hand, simulation.objects.position_world[index])
        if len(sides) > 1:
            grab.grasp_both(state, rows, index)
            return
        both = grab.is_too_big(state, rows, sides[0], index) & (hand is None)
        grab.grasp_both(state, rows[both], index)
        grab.grasp(state, rows[~both], sides[0][~both], index)

    def touch(self, characters: Characters, item: int | str, hand: str | None = None) -> None:
        """Let characters lay a hand on an object until `let_go`; arguments as in `grasp`."""
        rows, index, simulation = self._rows(characters), self._item("touch", item), self._simulation
        for side in self._sides("touch", rows, hand, simulation.objects.position_world[index]):
            simulation.grab.touch(simulation.state, rows, side, index)

    def put(
        self,
        characters: Characters,
        position_world: npt.ArrayLike,
        rotation_world: npt.ArrayLike | None = None,
        hand: str | None = None,
    ) -> None:
        """Let characters bring what they hold to a place; `let_go` then leaves it there.

        Parameters
        ----------
        characters : int, slice or sequence of int
            Those who hold nothing are refused.
        position_world : (3,) or (M, 3) array
            Centre of the object, m.
        rotation_world : (4,) or (M, 4) array, optional
            Its rotation (w, x, y, z); as it is now when left out.
        hand : {"right", "left", "both"}, optional
            Hand that holds the object; needed where each hand holds another one.

        Raises
        ------
        SettingsError
            A position or rotation is of the wrong shape or not finite, there is no such hand, or each hand
            holds something and none is named.
        """
        rows, simulation = self._rows(characters), self._simulation
        state, objects = simulation.state, simulation.objects
        place = vectors("put", "position", position_world, rows.size)
        wanted = None if rotation_world is None else rotations_of("put", rotation_world, rows.size)
        self._named_sides("put", hand)
        self._require_one_thing("put", rows, hand)
        # One hand speaks for both where they hold the same.
        held = self._held(rows)
        only_left = (held[:, 0] < 0) & (held[:, 1] >= 0)
        side = np.full(rows.size, HANDS.index(hand)) if hand in HANDS else only_left.astype(np.int64)
        turn = np.tile([1.0, 0.0, 0.0, 0.0], (rows.size, 1))
        if objects.count:
            turn = objects.rotation_world[np.maximum(state.grab_object[rows, side], 0)]
        simulation.grab.put(state, rows, side, place, turn if wanted is None else wanted)

    def let_go(
        self,
        characters: Characters,
        hand: str | None = None,
        position_world: npt.ArrayLike | None = None,
        rotation_world: npt.ArrayLike | None = None,
    ) -> None:
        """Let characters open their hands and take them back; what they held stays where it is.

        Parameters
        ----------
        characters : int, slice or sequence of int
        hand : {"right", "left", "both"}, optional
            Both when left out.
        position_world, rotation_world : (3,) or (M, 3), and (4,) or (M, 4) array, optional
            Where the object was to be put, m: taken over exactly where it is within a centimetre of it.

        Raises
        ------
        SettingsError
            A position or rotation is of the wrong shape or not finite, there is no such hand, or a position
            is given for two things.
        """
        rows, simulation = self._rows(characters), self._simulation
        place = None if position_world is None else vectors("let_go", "position", position_world, rows.size)
        turn = None if rotation_world is None else rotations_of("let_go", rotation_world, rows.size)
        sides = self._named_sides("let_go", hand)
        if place is not None:
            self._require_one_thing("let_go", rows, hand)
        for side in sides:
            simulation.grab.release(simulation.state, rows, side, place, turn)
            simulation.reach.end(simulation.state, rows, side)

    def hand_over(self, giver: int, taker: int) -> None:
        """Let a character hold out what it holds, and another one, who stands before it, take it.

        What both hands hold is given with both hands and taken with both. Who is giver and taker gives it
        from one hand to the other. People who are too far apart are refused.

        Raises
        ------
        SettingsError
            The giver holds nothing, or one of them is nobody.
        """
        simulation = self._simulation
        state, objects, grab = simulation.state, simulation.objects, simulation.grab
        both = self._rows([giver, taker])
        held = np.flatnonzero(objects.holder == giver)
        if held.size == 0:
            raise SettingsError(describe("hand_over", "the giver holds nothing", giver))
        item = int(held[0])
        side = int(np.argmax(objects.holder_hand[item]))
        with_both = bool(objects.holder_hand[item].all())
        if giver == taker:
            grab.grasp(state, both[:1], 1 - side, item)
            return
        if np.linalg.norm(np.subtract(*state.position_world[both])) > FARTHEST_HANDING:
            grab.refuse(state, both[:1], side, GrabStatus.TOO_FAR)
            return
        place = state.position_world[both].mean(axis=0)
        place[1] = HANDING_HEIGHT * float(simulation.model.people.stature[both].mean())
        # Upright as it stood at the start, turned about the vertical as it is now.
        grab.put(state, both[:1], side, place, grab.placement.upright(held[:1].astype(np.int32)))
        self.grasp(taker, item, BOTH if with_both else HANDS[side])

    def _item(self, what: str, item: int | str) -> int:
        objects = self._simulation.model.objects
        if isinstance(item, str):
            return objects.index(item)
        if not isinstance(item, int | np.integer) or not 0 <= item < objects.count:
            allowed = f"0 to {objects.count - 1}" if objects.count else "the scenario has no objects"
            raise SettingsError(describe(what, "no such object", shown(item), allowed))
        return item

    def _sides(
        self, what: str, rows: npt.NDArray[np.int32], hand: str | None, targets: npt.NDArray[np.float64]
    ) -> list[npt.NDArray[np.int64]]:
        """Hands of each character, one after the other: those named, or that on the side of its target."""
        if hand is not None:
            return [np.full(rows.size, side) for side in self._named_sides(what, hand)]
        state = self._simulation.state
        away = targets - state.position_world[rows]
        to_left = np.cos(state.yaw[rows]) * away[:, 0] - np.sin(state.yaw[rows]) * away[:, 2]
        return [(to_left > 0.0).astype(np.int64)]

    def _named_sides(self, what: str, hand: str | None) -> tuple[int, ...]:
        """Hands of a name; both when none is given."""
        return (0, 1) if hand in (None, BOTH) else (self._hand(what, str(hand)),)

    def _hand(self, what: str, hand: str) -> int:
        if hand not in HANDS:
            raise SettingsError(describe(what, "unknown hand", hand, f"{', '.join(HANDS)} or {BOTH}"))
        return HANDS.index(hand)

    def _lets_reach(self, rows: npt.NDArray[np.int32], side: npt.NDArray[np.int64]) -> npt.NDArray[np.bool_]:
        """Whose hands can reach by themselves; those that hold something with the other hand are refused."""
        simulation = self._simulation
        is_tied = simulation.state.carry_stage[rows] != CarryStage.FREE
        simulation.grab.refuse(simulation.state, rows[is_tied], side[is_tied], GrabStatus.TIED)
        return np.asarray(~is_tied)

    def _held(self, rows: npt.NDArray[np.int32]) -> npt.NDArray[np.int32]:
        """What the right and the left hands hold, (M, 2); -1 for nothing."""
        state = self._simulation.state
        closed = np.isin(state.grab_stage[rows], (CLOSING, HOLDING))
        return np.asarray(np.where(closed, state.grab_object[rows], -1))

    def _require_one_thing(self, what: str, rows: npt.NDArray[np.int32], hand: str | None) -> None:
        """Check that a place is not asked for the two things in somebody's hands."""
        held = self._held(rows)
        has_two = (held >= 0).all(axis=1) & (held[:, 0] != held[:, 1])
        if hand not in HANDS and has_two.any():
            row = int(rows[np.argmax(has_two)])
            raise SettingsError(
                describe(what, f"each hand of character {row} holds something", hand, " or ".join(HANDS))
            )

    def do(self, characters: Characters, tasks: Sequence[Mapping[str, Any] | TaskTable]) -> None:
        """Let characters do tasks after those they have, one thing after the other.

        Parameters
        ----------
        characters : int, slice or sequence of int
        tasks : sequence of mapping
            As in a scenario file: ``[{"pick_up": "cup"}, {"put_down": "table"}, {"wait": 2.0}]``; see
            `crowd.scenario.task_table.TaskTable`.

        Raises
        ------
        ScenarioError
            A task is not understood, or names something that is not there.
        SettingsError
            Somebody's list would be too long.
        """
        own = self._simulation.tasks
        arrays = encode_tasks(own, tasks, "tasks")
        rows = self._rows(characters)
        for row in rows:
            room = own.room(int(row))
            if len(tasks) > room:
                raise SettingsError(
                    describe("do", f"list of character {row} is too long", len(tasks), f"{room} more tasks")
                )
        for row in rows:
            own.give(int(row), arrays)

    def _require_one_or_all(self, what: str, targets: str, count: int, characters: int) -> None:
        if count not in (1, characters):
            raise SettingsError(
                describe(what, f"wrong number of {targets} to look at", count, f"1 or {characters}")
            )

    def _rows(self, characters: Characters, must_be_there: bool = True) -> npt.NDArray[np.int32]:
        capacity = self._simulation.state.capacity
        if isinstance(characters, slice):
            return np.arange(capacity, dtype=np.int32)[characters]
        rows = np.atleast_1d(np.asarray(characters))
        if rows.dtype == np.bool_:
            if rows.shape != (capacity,):
                allowed = f"one value for each of {capacity}"
                raise SettingsError(
                    describe("characters", "mask has the wrong length", int(rows.size), allowed)
                )
            rows = np.flatnonzero(rows)
        if rows.size and not np.issubdtype(rows.dtype, np.integer):
            allowed = f"whole numbers, 0 to {capacity - 1}"
            raise SettingsError(describe("characters", "are no rows", shown(characters), allowed))
        if rows.size and (rows.min() < 0 or rows.max() >= capacity):
            wrong = int(rows[(rows < 0) | (rows >= capacity)][0])
            raise SettingsError(describe("characters", "no such row", wrong, f"0 to {capacity - 1}"))
        is_gone = ~self._simulation.state.is_active[rows.astype(np.int32)]
        if must_be_there and is_gone.any():
            present = int(self._simulation.state.is_active.sum())
            raise SettingsError(
                describe("characters", "this one is not there", int(rows[is_gone][0]), f"{present} others")
            )
        return rows.astype(np.int32)
