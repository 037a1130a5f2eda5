"""Gait cycles: where a motion repeats, its root at constant velocity, and the seam closed."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from crowd.motion.clip import Clip, ClipKind, FootEvent
from crowd.motion.importing.contacts import Stance
from crowd.motion.importing.retarget import Retargeted, bend_leg
from crowd.motion.procedural.gait import steady_path
from crowd.motion.rotation import (
    about,
    conjugate,
    continuous,
    from_vector,
    multiply,
    rotate,
    slerp,
    to_vector,
)
from crowd.motion.skeleton import Skeleton
from crowd.motion.source import world_pose

FloatArray = npt.NDArray[np.float64]

SEAM_MEAN, SEAM_MAX, SEAM_HEIGHT = math.radians(12.0), math.radians(36.0), 0.04
"""First and last pose of a loop differ by less: mean and largest joint angle, rad; height, m."""
STRAIGHT_TURN = math.radians(8.0)
"""Less turn in a gait cycle is none."""
ALONG_AXIS, ACROSS_AXIS = math.radians(35.0), math.radians(45.0)
"""Travel within this of ahead or behind, or of either side, is wholly so: pelvises stand askew."""
TURN_RADIUS = 0.2
"""Turning on a smaller circle is turning on the spot, m."""
STANDING_SPEED = 0.05
"""Slower is on the spot, m/s."""
SEAM_PARTS = ("pelvis", "spine", "neck", "head", "upper_arm", "forearm", "thigh", "shank", "foot")


@dataclass(frozen=True)
class RootMotion:
    """A root that moves at constant body velocity and turn rate.

    Attributes
    ----------
    parameters : (float, float, float)
        Forward m/s, turn rad/s, side m/s.
    position : (F, 3) float64
        m.
    yaw : (F,) float64
        rad.
    """

    parameters: tuple[float, float, float]
    position: FloatArray
    yaw: FloatArray


@dataclass(frozen=True)
class Window:
    """Part of a motion that holds whole gait cycles.

    Attributes
    ----------
    begin, end : float
        s.
    first_strike : float
        Time of the right heel strike that becomes time 0, s.
    cycles : int
    stances : tuple of Stance
        Those that begin in it, in time order.
    seam : float
        Mean joint angle between its ends, rad.
    """

    begin: float
    end: float
    first_strike: float
    cycles: int
    stances: tuple[Stance, ...]
    seam: float


def seam_angles(motion: Retargeted, skeleton: Skeleton, first: FloatArray, last: FloatArray) -> FloatArray:
    """Angles, rad, between two poses (J, 4) of the main joints; the heading does not count."""
    differences = to_vector(multiply(conjugate(first), last))
    tilt = to_vector(multiply(conjugate(without_heading(first[0])), without_heading(last[0])))
    angles = np.linalg.norm(differences, axis=-1)
    angles[0] = np.linalg.norm(tilt)
    main = [i for i, name in enumerate(skeleton.joint_names) if any(part in name for part in SEAM_PARTS)]
    return np.asarray(angles[main])


def without_heading(rotation: FloatArray) -> FloatArray:
    """Take the heading out of rotations (..., 4)."""
    return multiply(about(1, -heading_of(rotation)), rotation)


def heading_of(rotation: FloatArray) -> FloatArray:
    """Heading, rad, of what rotations (..., 4) do to +z."""
    ahead = rotate(rotation, np.array([0.0, 0.0, 1.0]))
    return np.asarray(np.arctan2(ahead[..., 0], ahead[..., 2]))


def is_loop(motion: Retargeted, skeleton: Skeleton) -> bool:
    """Whether the last frame of a motion is its first again, but for place and heading."""
    local = motion.rotation_local
    if len(local) < 8:
        return False
    angles = seam_angles(motion, skeleton, local[0], local[-1])
    height = abs(motion.travel[-1, 1] - motion.travel[0, 1])
    return bool(angles.mean() < SEAM_MEAN and angles.max() < SEAM_MAX and height < SEAM_HEIGHT)


def alternate(stances: list[Stance]) -> bool:
    """Whether feet strike in turn, the same number of times."""
    feet = [stance.foot for stance in stances]
    return len(feet) >= 2 and len(feet) % 2 == 0 and all(a != b for a, b in pairwise(feet))


def find_window(motion: Retargeted, skeleton: Skeleton, stances: list[Stance], loops: bool) -> Window | None:
    """Find two gait cycles of a motion, or one; None if it holds none.

    A loop is taken whole. Otherwise the window between strikes of the same foot whose ends agree best is
    taken, two cycles before one.
    """
    duration = (len(motion.pelvis) - 1) / motion.frame_rate
    if loops and alternate(stances) and len(stances) in (2, 4):
        right = [stance.strike for stance in stances if stance.foot == 0]
        angles = seam_angles(motion, skeleton, motion.rotation_local[0], motion.rotation_local[-1])
        return Window(0.0, duration, right[0], len(right), tuple(stances), float(angles.mean()))
    for cycles in (2, 1):
        windows = [
            window
            for number in range(len(stances) - 2 * cycles)
            if (window := window_from(motion, skeleton, stances, number, cycles)) is not None
        ]
        if windows:
            return min(windows, key=lambda window: window.seam)
    return None


def window_from(
    motion: Retargeted, skeleton: Skeleton, stances: list[Stance], number: int, cycles: int
) -> Window | None:
    """The window of some cycles that begins with one of the stances, if its ends agree."""
    inside, after = stances[number : number + 2 * cycles], stances[number + 2 * cycles]
    if not alternate(inside) or after.foot != inside[0].foot:
        return None
    begin, end = inside[0].strike, after.strike
    first, last = (
        sample(motion.rotation_local, np.array([time * motion.frame_rate]))[0] for time in (begin, end)
    )
    angles = seam_angles(motion, skeleton, first, last)
    if angles.mean() > SEAM_MEAN or angles.max() > SEAM_MAX:
        return None
    right = next(stance.strike for stance in inside if stance.foot == 0)
    return Window(begin, end, right, cycles, tuple(inside), float(angles.mean()))


def sample(rotation: FloatArray, place: FloatArray) -> FloatArray:
    """Rotations (n, J, 4) at fractional frames (n,)."""
    before = np.clip(place.astype(int), 0, max(len(rotation) - 2, 0))
    after = np.minimum(before + 1, len(rotation) - 1)
    return slerp(rotation[before], rotation[after], (place - before)[:, None])


def sample_linear(values: FloatArray, place: FloatArray) -> FloatArray:
    """Vectors (n, k) at fractional frames (n,)."""
    frames = np.arange(len(values))
    return np.stack([np.interp(place, frames, column) for column in values.T], axis=1)


def steady_root(pelvis: FloatArray, heading: FloatArray, duration: float, cycles: int) -> RootMotion:
    """Fit a root of constant velocity to whole gait cycles.

    Parameters
    ----------
    pelvis : (F, 3) float64
        m; the ends are the same phase.
    heading : (F,) float64
        Of the pelvis, rad.
    duration : float
        s.
    cycles : int

    Notes
    -----
    Forward and side speed are the mean velocity seen from a frame that turns at the mean rate, in the
    direction of travel when that is nearly ahead, behind or aside of the pelvis: people walk with a pelvis
    that stands askew, and examples belong on the axes of the parameter space.
    """
    unwrapped = np.unwrap(heading)
    time = np.linspace(0.0, duration, len(pelvis))
    net = float(unwrapped[-1] - unwrapped[0])
    turn = net / duration if abs(net) / cycles >= STRAIGHT_TURN else 0.0
    steps = np.diff(pelvis, axis=0)
    middle = 0.5 * (time[1:] + time[:-1])
    velocity = rotate(about(1, -turn * middle), steps).sum(axis=0) / duration
    speed = math.hypot(velocity[0], velocity[2])
    askew = unwrapped - turn * time
    mean_heading = float(np.angle(np.exp(1j * askew).mean()))
    travel = math.atan2(velocity[0], velocity[2])
    parameters, facing = on_axes(speed, turn, travel, mean_heading)
    path, bend = steady_path(*parameters)(time)
    path = rotate(about(1, facing), path)
    if parameters[0] == parameters[2] == 0.0 and turn != 0.0:
        path = path + centre_of(pelvis, turn * time)
    else:
        path = path + (pelvis - path).mean(axis=0)
    path[:, 1] = 0.0
    return RootMotion(parameters, path, facing + bend)


def on_axes(
    speed: float, turn: float, travel: float, heading: float
) -> tuple[tuple[float, float, float], float]:
    """Parameters and facing, rad, of a motion that travels in a direction with a mean heading."""
    if speed < STANDING_SPEED and turn == 0.0:
        return (0.0, 0.0, 0.0), heading
    if turn != 0.0 and speed < TURN_RADIUS * abs(turn):
        return (0.0, turn, 0.0), heading
    aside = (travel - heading + math.pi) % (2.0 * math.pi) - math.pi
    if abs(aside) < ALONG_AXIS:
        return (speed, turn, 0.0), travel
    if abs(aside) > math.pi - ALONG_AXIS:
        return (-speed, turn, 0.0), travel + math.pi
    if abs(abs(aside) - 0.5 * math.pi) < ACROSS_AXIS:
        side = math.copysign(1.0, aside)
        return (0.0, turn, side * speed), travel - side * 0.5 * math.pi
    return (speed * math.cos(aside), turn, speed * math.sin(aside)), heading


def centre_of(pelvis: FloatArray, angle: FloatArray) -> FloatArray:
    """Centre (3,) of the circle on which a pelvis turns by the given angles, by least squares."""
    cosine, sine = np.cos(angle), np.sin(angle)
    one, zero = np.ones_like(angle), np.zeros_like(angle)
    matrix = np.concatenate([np.stack([one, zero, cosine, sine], 1), np.stack([zero, one, -sine, cosine], 1)])
    found = np.linalg.lstsq(matrix, np.concatenate([pelvis[:, 0], pelvis[:, 2]]), rcond=None)[0]
    return np.array([found[0], 0.0, found[1]])


def cyclic_clip(name: str, motion: Retargeted, skeleton: Skeleton, window: Window) -> Clip:
    """Make a locomotion clip of two gait cycles that starts with a right heel strike.

    Parameters
    ----------
    name : str
    motion : Retargeted
    skeleton : Skeleton
    window : Window
    """
    duration = window.end - window.begin
    intervals = max(round(duration * motion.frame_rate), 8)
    place = (window.begin + np.linspace(0.0, duration, intervals + 1)) * motion.frame_rate
    rotation = sample(motion.rotation_local, place)
    pelvis = sample_linear(motion.pelvis, place)
    root = steady_root(pelvis, heading_of(rotation[:, 0]), duration, window.cycles)
    back = about(1, -root.yaw)
    rotation[:, 0] = multiply(back, rotation[:, 0])
    pelvis = rotate(back, pelvis - root.position)
    rotation, pelvis = close_seam(rotation, pelvis, skeleton)
    shift = (window.first_strike - window.begin) / duration * intervals
    turned = np.mod(np.arange(intervals + 1) + shift, intervals).astype(np.float64)
    rotation, pelvis = sample(rotation, turned), sample_linear(pelvis, turned)
    repeats = 2 // window.cycles
    rotation = np.concatenate([rotation[:-1]] * repeats + [rotation[:1]])
    pelvis = np.concatenate([pelvis[:-1]] * repeats + [pelvis[:1]])
    frames = np.linspace(0.0, repeats * duration, repeats * intervals + 1)
    position, yaw = steady_path(*root.parameters)(frames)
    return Clip(
        name,
        ClipKind.LOCOMOTION,
        intervals / duration,
        continuous(rotation).astype(np.float32),
        pelvis.astype(np.float32),
        position,
        yaw,
        is_cyclic=True,
        foot_events=cycle_events(window, repeats),
        parameters=root.parameters,
        cycles=2,
    )


def captured_parameters(motion: Retargeted, window: Window) -> tuple[float, float, float]:
    """Forward m/s, turn rad/s and side m/s of the source's own pelvis joint, in the size of the source."""
    ends = np.array([window.begin, window.end]) * motion.frame_rate
    place = np.linspace(ends[0], ends[1], max(round(ends[1] - ends[0]), 8) + 1)
    heading = heading_of(sample(motion.rotation_local[:, :1], place)[:, 0])
    travel = sample_linear(motion.travel, place)
    forward, turn, side = steady_root(travel, heading, window.end - window.begin, window.cycles).parameters
    return forward / motion.scale, turn, side / motion.scale


def cycle_events(window: Window, repeats: int) -> tuple[tuple[float, FootEvent], ...]:
    """Events of all stances against the first right strike, over two cycles."""
    duration = window.end - window.begin
    found = [
        ((time - window.first_strike) % duration + number * duration, kind)
        for number in range(repeats)
        for stance in window.stances
        for time, kind in stance.events
    ]
    whole = repeats * duration
    rounded = [(0.0 if whole - time < 1e-9 else time, kind) for time, kind in found]
    return tuple(sorted(rounded, key=lambda entry: (round(entry[0], 9), int(entry[1]))))


def close_seam(rotation: FloatArray, pelvis: FloatArray, skeleton: Skeleton) -> tuple[FloatArray, FloatArray]:
    """Spread what differs between the first and the last pose over all frames, so that both agree.

    Parameters
    ----------
    rotation : (F, J, 4) float64
        Local, the pelvis in the root frame.
    pelvis : (F, 3) float64
        In the root frame, m.
    skeleton : Skeleton

    Notes
    -----
    Each half takes half of the difference. Feet are closed where they are, not by the joints above them, so
    that a seam in a hip does not drag a planted foot along.
    """
    share = np.linspace(-0.5, 0.5, len(rotation))
    world, position = posed(rotation, pelvis, skeleton)
    ankles, feet = {}, {}
    for side in ("left", "right"):
        foot = skeleton.joint(f"{side}_foot")
        ankles[side] = position[:, foot] - np.outer(share, position[-1, foot] - position[0, foot])
        feet[side] = spread(world[:, foot], share)
    closed = np.stack([spread(rotation[:, joint], share) for joint in range(rotation.shape[1])], axis=1)
    pelvis = pelvis - np.outer(share, pelvis[-1] - pelvis[0])
    world, _ = posed(closed, pelvis, skeleton)
    for side in ("left", "right"):
        foot = skeleton.joint(f"{side}_foot")
        bend_leg(world, skeleton, side, pelvis, ankles[side])
        world[:, foot] = feet[side]
        for part in ("thigh", "shank", "foot"):
            joint = skeleton.joint(f"{side}_{part}")
            closed[:, joint] = multiply(conjugate(world[:, skeleton.parent[joint]]), world[:, joint])
    return closed, pelvis


def posed(rotation: FloatArray, pelvis: FloatArray, skeleton: Skeleton) -> tuple[FloatArray, FloatArray]:
    """Rotations (F, J, 4) and positions (F, J, 3) of all joints in the frame of the pelvis's position."""
    offset = np.broadcast_to(skeleton.offset, (*rotation.shape[:2], 3)).copy()
    offset[:, 0] = pelvis
    return world_pose(skeleton.parent, rotation, offset)


def spread(rotation: FloatArray, share: FloatArray) -> FloatArray:
    """Take a growing share of the difference between last and first rotation out of (F, 4) ones."""
    difference = to_vector(multiply(conjugate(rotation[0]), rotation[-1]))
    return multiply(rotation, from_vector(-share[:, None] * difference))
