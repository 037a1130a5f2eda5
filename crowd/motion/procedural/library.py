"""The built-in library: all clips that the engine makes for itself."""

import math
from functools import cache

from crowd.motion.body import build_skeleton
from crowd.motion.clip import Clip, ClipKind, JointMask
from crowd.motion.library import MotionLibrary
from crowd.motion.procedural.gait import changing_clip, cyclic_clip
from crowd.motion.procedural.shape import (
    back_shape,
    run_shape,
    side_shape,
    standing_in_place,
    turn_shape,
    walk_shape,
)
from crowd.motion.procedural.standing import GESTURES, IDLES, POSTURES, SIT_DOWN, Stance, to_clip
from crowd.motion.skeleton import Skeleton

WALKS = {"walk_slow": 0.7, "walk": 1.35, "walk_fast": 1.9}
RUNS = {"jog": 2.5, "run": 3.6}
BACK_WALKS = {"walk_back_slow": 0.5, "walk_back": 1.0}
# An example just inside the line between two others makes thin tetrahedra with them: a little more turn takes
# its weight from all to nothing, and legs jerk. So the tight circle lies outside the line from turning on the
# spot to the tight run, and slow walks that weave need no share of a faster circle.
CIRCLES = {"walk_circle": (1.25, 40.0), "walk_slow_circle": (0.7, 80.0), "walk_tight_circle": (1.25, 124.0)}
RUN_CIRCLES = {"run_circle": (3.1, 50.0), "run_tight_circle": (2.4, 115.0)}
SIDESTEPS = {"sidestep_slow": 0.5, "sidestep_fast": 1.1}
TURN_RATE = 130.0
"""Turning on the spot, deg/s."""


def locomotion_clips(skeleton: Skeleton) -> list[Clip]:
    """Examples of the locomotion space, left and right ones as mirror images."""
    clips = [cyclic_clip(skeleton, "in_place", standing_in_place())]
    for name, speed in WALKS.items():
        clips.append(cyclic_clip(skeleton, name, walk_shape(speed), forward=speed))
    for name, speed in RUNS.items():
        clips.append(cyclic_clip(skeleton, name, run_shape(speed), forward=speed))
    for name, speed in BACK_WALKS.items():
        clips.append(cyclic_clip(skeleton, name, back_shape(speed), forward=-speed))
    for side, sign in (("left", 1.0), ("right", -1.0)):
        for circles, shape in ((CIRCLES, walk_shape), (RUN_CIRCLES, run_shape)):
            for name, (speed, rate) in circles.items():
                turn = sign * math.radians(rate)
                clips.append(cyclic_clip(skeleton, f"{name}_{side}", shape(speed), forward=speed, turn=turn))
        turn = sign * math.radians(TURN_RATE)
        clips.append(cyclic_clip(skeleton, f"turn_{side}", turn_shape(), turn=turn))
        for name, speed in SIDESTEPS.items():
            clips.append(cyclic_clip(skeleton, f"{name}_{side}", side_shape(speed), side=sign * speed))
    return clips


def changing_clips(skeleton: Skeleton) -> list[Clip]:
    """Starts from standing and stops, led by either foot."""
    clips = []
    for gait, shape, speed in (("walk", walk_shape(1.35), 1.35), ("run", run_shape(2.5), 2.5)):
        for leads in ("left", "right"):
            clips.append(changing_clip(skeleton, f"start_{gait}_{leads}", shape, speed, True, leads))
            clips.append(changing_clip(skeleton, f"stop_{gait}_{leads}", shape, speed, False, leads))
    return clips


@cache
def built_in_library() -> MotionLibrary:
    """Make the built-in library; it is made once in a process."""
    skeleton = build_skeleton()
    ground = standing_in_place()
    clips = locomotion_clips(skeleton) + changing_clips(skeleton)
    for name, (change, seconds) in IDLES.items():
        stance = Stance.neutral(seconds)
        change(stance)
        clips.append(to_clip(skeleton, ground, name, ClipKind.IDLE, stance, JointMask.FULL_BODY))
    for kind, table in ((ClipKind.GESTURE, GESTURES), (ClipKind.POSTURE, POSTURES)):
        for name, (change, seconds, mask) in table.items():
            stance = Stance.neutral(seconds)
            change(stance)
            clips.append(to_clip(skeleton, ground, name, kind, stance, mask))
    change, seconds = SIT_DOWN
    stance = Stance.neutral(seconds)
    change(stance)
    clips.append(to_clip(skeleton, ground, "sit_down", ClipKind.SIT, stance, JointMask.FULL_BODY))
    return MotionLibrary(
        "built-in", skeleton, tuple(clips), "made by the engine from published gait data", "MIT"
    )
