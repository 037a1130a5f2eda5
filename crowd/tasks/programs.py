"""What each task consists of: a fixed sequence of moves, each with what ends it."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from crowd.tasks.acting import (
    extend,
    grasp,
    grasp_offered,
    lay,
    let_go,
    lift,
    look_at_target,
    look_away,
    offer,
    play,
    rise,
    settle,
    sit,
    stand_still,
    stand_up,
    wait,
    walk,
    withdraw,
)
from crowd.tasks.choosing import (
    choose_look,
    choose_object,
    choose_seat,
    choose_spot,
    choose_touch,
    choose_walk,
)
from crowd.tasks.meeting import choose_meeting, face_giver, find_partner, find_taker
from crowd.tasks.task_list import TaskKind
from crowd.tasks.waits import Outcome, Wait

if TYPE_CHECKING:
    from crowd.tasks.execution import Tasks

LONGEST_WALK, LONGEST_SETTLING, LONGEST_REACH = 600.0, 4.0, 6.0
"""Times after which something has gone wrong, s."""
LONGEST_MEETING = 120.0
"""Time to wait for somebody who gives or takes, s."""

Begin = Callable[["Tasks", int, float], Outcome]


@dataclass(frozen=True)
class Move:
    """One move of a task."""

    begin: Begin
    wait: Wait = Wait.TIME
    seconds: float = math.nan
    """Longest time to wait, s; the task's own seconds when NaN."""

    def limit(self, tasks: Tasks, row: int) -> float:
        """Longest time to wait, s."""
        if math.isnan(self.seconds):
            return float(tasks.lists.seconds[row, tasks.index[row]])
        return self.seconds


RISE = Move(rise, Wait.RISEN, 10.0)
GO_THERE = (
    RISE,
    Move(walk, Wait.ARRIVED, LONGEST_WALK),
    Move(settle, Wait.SETTLED, LONGEST_SETTLING),
    Move(stand_still, Wait.STANDING, 3.0),
)
WITHDRAW = Move(withdraw, Wait.WITHDRAWN, LONGEST_REACH)
LOOK_AWAY = Move(look_away)
PROGRAMS: dict[TaskKind, tuple[Move, ...]] = {
    TaskKind.WALK_TO: (Move(choose_walk), RISE, Move(walk, Wait.ARRIVED, LONGEST_WALK)),
    TaskKind.CARRY_TO: (Move(choose_walk), RISE, Move(walk, Wait.ARRIVED, LONGEST_WALK)),
    TaskKind.PICK_UP: (
        Move(choose_object),
        *GO_THERE,
        Move(grasp, Wait.HOLDING, LONGEST_REACH),
        Move(lift, Wait.WITHDRAWN, LONGEST_REACH),
        LOOK_AWAY,
    ),
    TaskKind.PUT_DOWN: (
        Move(choose_spot),
        *GO_THERE,
        Move(lay, Wait.REACHED, LONGEST_REACH),
        Move(let_go, Wait.OPEN, LONGEST_REACH),
        WITHDRAW,
        LOOK_AWAY,
    ),
    TaskKind.TOUCH: (
        Move(choose_touch),
        *GO_THERE,
        Move(extend, Wait.TOUCHING, LONGEST_REACH),
        Move(wait),
        WITHDRAW,
        LOOK_AWAY,
    ),
    TaskKind.HAND_OVER: (
        Move(find_taker, Wait.TAKER_THERE, LONGEST_MEETING),
        Move(choose_meeting),
        *GO_THERE,
        Move(wait, Wait.TAKER_READY, LONGEST_MEETING),
        Move(offer, Wait.TAKEN, LONGEST_MEETING),
        WITHDRAW,
        LOOK_AWAY,
    ),
    TaskKind.TAKE_FROM: (
        Move(find_partner),
        Move(wait, Wait.GIVER_NEAR, LONGEST_MEETING),
        Move(face_giver),
        RISE,
        Move(settle, Wait.SETTLED, LONGEST_SETTLING),
        Move(stand_still, Wait.STANDING, 3.0),
        Move(wait, Wait.OFFERED, LONGEST_MEETING),
        Move(grasp_offered, Wait.HOLDING, LONGEST_REACH),
        Move(lift, Wait.WITHDRAWN, LONGEST_REACH),
        LOOK_AWAY,
    ),
    TaskKind.LOOK_AT: (Move(choose_look), Move(look_at_target), LOOK_AWAY),
    TaskKind.WAIT: (Move(wait),),
    TaskKind.SIT: (
        Move(choose_seat),
        RISE,
        Move(walk, Wait.ARRIVED, LONGEST_WALK),
        Move(settle, Wait.SETTLED, 2.0 * LONGEST_SETTLING),
        Move(sit, Wait.SEATED, 10.0),
    ),
    TaskKind.STAND_UP: (Move(stand_up, Wait.RISEN, 10.0),),
    TaskKind.PLAY: (Move(play, Wait.PLAYED, LONGEST_WALK),),
}
"""What each task consists of."""
