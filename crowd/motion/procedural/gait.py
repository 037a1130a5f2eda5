"""Locomotion clips: gaits along a path of the root, cyclic ones and starts and stops."""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from crowd.motion.clip import TOE_ROLL, Clip, ClipKind, FootEvent
from crowd.motion.easing import minimum_jerk
from crowd.motion.procedural.feet import FootPath, RootPath, plan_foot, with_clearance
from crowd.motion.procedural.legs import bend_leg, lower_pelvis
from crowd.motion.procedural.shape import GaitShape
from crowd.motion.procedural.upper_body import GRAVITY, move_pelvis, move_trunk, swing_arms
from crowd.motion.rotation import about, continuous, rotate
from crowd.motion.skeleton import Skeleton

FloatArray = npt.NDArray[np.float64]

FRAME_RATE = 60.0
CYCLES = 2
BANK_SHARE = 0.55
"""Share of the full lean into a curve that people take."""
LOOK_AHEAD = 0.35
"""People look where they will be after this time, s."""
EVENTS = (
    (0.0, (FootEvent.RHS, FootEvent.RTS, FootEvent.RHO, FootEvent.RTO)),
    (0.5, (FootEvent.LHS, FootEvent.LTS, FootEvent.LHO, FootEvent.LTO)),
)


def steady_path(forward: float, turn: float, side: float) -> RootPath:
    """Path of constant body velocity and turn rate."""

    def path(time: FloatArray) -> tuple[FloatArray, FloatArray]:
        heading = turn * time
        if abs(turn) < 1e-9:
            x, z = side * time, forward * time
        else:
            x = (forward * (1.0 - np.cos(heading)) + side * np.sin(heading)) / turn
            z = (forward * np.sin(heading) - side * (1.0 - np.cos(heading))) / turn
        return np.stack([x, np.zeros_like(time), z], axis=-1), heading

    return path


def cyclic_clip(
    skeleton: Skeleton,
    name: str,
    shape: GaitShape,
    forward: float = 0.0,
    turn: float = 0.0,
    side: float = 0.0,
) -> Clip:
    """Make two cycles of a gait at constant velocity; speeds in m/s, turn rate in rad/s, left positive."""
    # A multiple of four puts every strike on a frame, so that left and right are exact mirror images.
    frames = 4 * round(CYCLES * shape.cycle_duration * FRAME_RATE / 4)
    cycle = frames / FRAME_RATE / CYCLES
    path = steady_path(forward, turn, side)
    shape = with_clearance(replace(shape, cycle_duration=cycle), path)
    time = np.arange(frames + 1) / FRAME_RATE
    ones = np.ones(frames + 1)
    bank = BANK_SHARE * math.atan(forward * turn / GRAVITY) * ones
    look = max(min(LOOK_AHEAD * turn, 0.6), -0.6) * ones
    rotation, pelvis = animate(
        skeleton, shape, path, time, bank, look, lambda t: np.ones_like(t), is_cyclic=True
    )
    place, heading = path(time)
    return Clip(
        name,
        ClipKind.LOCOMOTION,
        FRAME_RATE,
        rotation,
        pelvis,
        place,
        heading,
        is_cyclic=True,
        foot_events=cycle_events(shape),
        parameters=(forward, turn, side),
        cycles=CYCLES,
    )


def cycle_events(shape: GaitShape) -> tuple[tuple[float, FootEvent], ...]:
    """Eight events in each cycle, by time."""
    cycle = shape.cycle_duration
    found = []
    for number in range(CYCLES):
        for begin, events in EVENTS:
            for share, event in zip(
                (0.0, shape.flat, shape.heel_off, shape.stance + TOE_ROLL), events, strict=True
            ):
                time = math.fmod((number + begin + share) * cycle, CYCLES * cycle)
                found.append((time, event))
    return tuple(sorted(found, key=lambda entry: (round(entry[0], 9), int(entry[1]))))


def changing_clip(
    skeleton: Skeleton, name: str, shape: GaitShape, speed: float, starts: bool, leads: str
) -> Clip:
    """Make a start from standing, or a stop, over one cycle and a half.

    Parameters
    ----------
    skeleton : Skeleton
    name : str
    shape : GaitShape
        The gait at full speed.
    speed : float
        m/s.
    starts : bool
        From standing to the gait; otherwise from the gait to standing.
    leads : str
        Foot that makes the first step, or the last one.
    """
    cycle = shape.cycle_duration
    # A walk whose right foot strikes at 0 lifts the left one a little later, and the other way round.
    first = (0.0 if leads == "left" else 0.5) * cycle
    length = round(1.5 * cycle * FRAME_RATE) / FRAME_RATE
    time = first + np.arange(round(length * FRAME_RATE) + 1) / FRAME_RATE

    def share(t: FloatArray) -> FloatArray:
        risen = minimum_jerk((t - first) / length)
        return risen if starts else 1.0 - risen

    fine = first + np.linspace(-2.0 * cycle, length + 2.0 * cycle, 4000)
    travelled = np.concatenate([[0.0], np.cumsum(0.5 * np.diff(fine) * (share(fine)[1:] + share(fine)[:-1]))])
    origin = np.interp(first, fine, travelled)

    def path(t: FloatArray) -> tuple[FloatArray, FloatArray]:
        z = speed * (np.interp(t, fine, travelled) - origin)
        return np.stack([np.zeros_like(z), np.zeros_like(z), z], axis=-1), np.zeros_like(z)

    zero = np.zeros(len(time))
    rotation, pelvis = animate(skeleton, shape, path, time, zero, zero, share, is_cyclic=False)
    place, heading = path(time)
    kind = ClipKind.START if starts else ClipKind.STOP
    events = [
        ((number + begin + at) * cycle - first, event)
        for number in range(-1, 4)
        for begin, names in EVENTS
        for at, event in zip((0.0, shape.flat, shape.heel_off, shape.stance + TOE_ROLL), names, strict=True)
    ]
    inside = tuple(sorted((t, event) for t, event in events if 0.0 <= t <= length))
    return Clip(name, kind, FRAME_RATE, rotation, pelvis, place, heading, is_cyclic=False, foot_events=inside)


def animate(
    skeleton: Skeleton,
    shape: GaitShape,
    path: RootPath,
    time: FloatArray,
    bank: FloatArray,
    look: FloatArray,
    effort: Callable[[FloatArray], FloatArray],
    *,
    is_cyclic: bool,
) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.float32]]:
    """Put feet, pelvis and upper body together: local rotations (F, J, 4) and pelvis positions (F, 3)."""
    place, heading = path(time)
    phase = time / shape.cycle_duration
    strength = effort(time)
    trunk = move_pelvis(shape, phase, bank, strength)
    rotation = np.zeros((len(time), skeleton.joint_count, 4))
    rotation[..., 0] = 1.0
    feet = {}
    for side, sign in (("right", -1.0), ("left", 1.0)):
        world = plan_foot(shape, path, sign, time, effort)
        ankle = rotate(about(1, -heading), world.ankle - place)
        feet[side] = FootPath(ankle, world.pitch, world.yaw - heading, world.toe_free)
    hips = np.array([skeleton.offset[skeleton.joint(f"{side}_thigh")] for side in feet])
    ankles = np.array([foot.ankle for foot in feet.values()])
    spread = round(0.06 * FRAME_RATE)
    pelvis = lower_pelvis(trunk.position, trunk.rotation, hips, ankles, is_cyclic, spread)
    for side, foot in feet.items():
        bend_leg(skeleton, side, pelvis, trunk.rotation, foot, rotation)
    move_trunk(skeleton, shape, phase, trunk, look, strength, rotation)
    swing_arms(skeleton, shape, phase, strength, rotation)
    return continuous(rotation).astype(np.float32), pelvis.astype(np.float32)
