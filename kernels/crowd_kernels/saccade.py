"""Saccades: quick jumps of the eyes with the statistics of people who listen, talk or think."""

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from crowd_kernels._jit import kernel, parallel_kernel, prange
from crowd_kernels.easing import minimum_jerk
from crowd_kernels.pose import joint_rotation, set_joint_rotation
from crowd_kernels.quaternion import from_rotation_vector, multiply, normalized
from crowd_kernels.random import normal, uniform

CHUNKS = 32
DIRECTIONS = 8
OFF = 255
"""Mode of eyes without saccades."""
PURPOSE_KIND = 0x5AC0
PURPOSE_DIRECTION = 0x5AC1
PURPOSE_MAGNITUDE = 0x5AC2
PURPOSE_INTERVAL = 0x5AC3
PURPOSE_ENTRY = 0x5AC4
MAGNITUDE_SCALE, MAGNITUDE_TOP, MAGNITUDE_RANGE = math.radians(6.9), 15.7, 15.0
"""A = -6.9 ln(P / 15.7) degrees with P even in (0, 15]."""
DURATION_START, DURATION_PER_RADIAN = 0.025, 0.0024 * 180.0 / math.pi
"""25 ms and 2.4 ms for each degree."""
SHORTEST_INTERVAL = 0.001


class SaccadeModes(NamedTuple):
    """Statistics of each mode of attention; angles in rad, times in s."""

    direction: npt.NDArray[np.float64]
    """(M, 8) Cumulative share of the directions 0 (right), 45, 90 (up) ... 315 degrees; the last is 1."""
    magnitude_cap: npt.NDArray[np.float64]
    """(M,) Largest magnitude to the side; larger ones are drawn anew."""
    return_share: npt.NDArray[np.float64]
    """(M,) Share of the saccades away from the target that go back to it instead of elsewhere."""
    interval_log_mean: npt.NDArray[np.float64]
    """(M, 2) Mean of the logarithm of the time on the target, and away from it."""
    interval_log_spread: npt.NDArray[np.float64]
    """(M, 2) Standard deviation of the same."""


@kernel
def draw_interval(
    modes: SaccadeModes, mode: int, is_away: bool, seed: int, character: int, step: int
) -> float:
    """Draw the time until the next saccade: log-normal, which keeps mean and spread, unlike a cut bell curve.

    Parameters
    ----------
    modes : SaccadeModes
    mode : int
        Row of `modes`.
    is_away : bool
        The eyes rest beside the target.
    seed, character, step : int
        Keys.

    Returns
    -------
    float
        s, at least 0.001.
    """
    kind = 1 if is_away else 0
    draw = normal(seed, character, step, PURPOSE_INTERVAL)
    interval = math.exp(modes.interval_log_mean[mode, kind] + modes.interval_log_spread[mode, kind] * draw)
    return max(interval, SHORTEST_INTERVAL)


@kernel
def draw_offset(modes: SaccadeModes, mode: int, seed: int, character: int, step: int) -> tuple[float, float]:
    """Draw where the eyes go beside the target.

    Parameters
    ----------
    modes : SaccadeModes
    mode : int
        Row of `modes`.
    seed, character, step : int
        Keys.

    Returns
    -------
    pitch, heading : float
        Down and left positive, rad.

    Notes
    -----
    **Source:** Lee, Badler, Badler, "Eyes alive", 2002, tables and equation of magnitude.
    **Differs from the source:** a magnitude above the cap is drawn anew instead of set to it, and eyelids
    lower the cap itself to a half up and down, and to three quarters on diagonals. Both are one draw from the
    range that the cap leaves.
    """
    draw = uniform(seed, character, step, PURPOSE_DIRECTION)
    direction = 0
    while direction < DIRECTIONS - 1 and draw >= modes.direction[mode, direction]:
        direction += 1
    share = 0.75 if direction % 2 == 1 else (0.5 if direction % 4 == 2 else 1.0)
    least = MAGNITUDE_TOP * math.exp(-share * modes.magnitude_cap[mode] / MAGNITUDE_SCALE)
    p = MAGNITUDE_RANGE - (MAGNITUDE_RANGE - least) * uniform(seed, character, step, PURPOSE_MAGNITUDE)
    magnitude = -MAGNITUDE_SCALE * math.log(p / MAGNITUDE_TOP)
    angle = direction * (2.0 * math.pi / DIRECTIONS)
    return -magnitude * math.sin(angle), -magnitude * math.cos(angle)


@parallel_kernel
def saccade_crowd(
    modes: SaccadeModes,
    mode: Any,
    active: Any,
    seed: int,
    step: int,
    time: float,
    dt: float,
    start: Any,
    goal: Any,
    clock: Any,
    duration: Any,
    until: Any,
    out_offset: Any,
) -> None:
    """Advance the eyes' jumps.

    Parameters
    ----------
    modes : SaccadeModes
    mode : (N,) uint8
        Row of `modes`, or 255 for eyes that only come back to the target.
    active : (A,) int32
        Characters to process, each once; 0 to N - 1.
    seed, step : int
        Keys of the draws.
    time, dt : float
        Simulation time and step, s.
    start, goal : (N, 2) float32
        In and out: offsets between which the eyes jump, about x (down) and y (left), rad; goal 0 is the
        target.
    clock : (N,) float32
        In and out: time since the jump began, s.
    duration : (N,) float32
        In and out: length of the jump, s; 0 for somebody new.
    until : (N,) float64
        In and out: time of the next jump, s.
    out_offset : (N, 2) float32
        Where the eyes are beside the target, rad.

    Notes
    -----
    **Source:** Lee, Badler, Badler, "Eyes alive", 2002: intervals on the target and away from it, magnitude,
    eight directions, duration 25 ms and 2.4 ms for each degree.
    **Differs from the source:** the profile is that of least jerk; several jumps follow each other away from
    the target, so that both the published intervals and the published share of time on the target come out.
    """
    count = active.shape[0]
    for k in prange(CHUNKS):
        chunk = (k * 37) % CHUNKS
        for index in range(chunk * count // CHUNKS, (chunk + 1) * count // CHUNKS):
            character = active[index]
            kind = mode[character]
            is_away = goal[character, 0] != 0.0 or goal[character, 1] != 0.0
            if kind == OFF:
                is_due = is_away
            elif duration[character] == 0.0:
                # Somebody new is somewhere within the first interval.
                part = uniform(seed, character, step, PURPOSE_ENTRY)
                until[character] = time + part * draw_interval(modes, kind, False, seed, character, step)
                duration[character] = DURATION_START
                clock[character] = DURATION_START
                is_due = False
            else:
                is_due = time >= until[character]
            if is_due:
                returns = kind == OFF or (
                    is_away and uniform(seed, character, step, PURPOSE_KIND) < modes.return_share[kind]
                )
                pitch, heading = 0.0, 0.0
                if not returns:
                    pitch, heading = draw_offset(modes, kind, seed, character, step)
                start[character, 0] = out_offset[character, 0]
                start[character, 1] = out_offset[character, 1]
                goal[character, 0] = pitch
                goal[character, 1] = heading
                way = math.hypot(pitch - start[character, 0], heading - start[character, 1])
                duration[character] = DURATION_START + DURATION_PER_RADIAN * way
                clock[character] = 0.0
                if kind != OFF:
                    interval = draw_interval(modes, kind, not returns, seed, character, step)
                    until[character] = time + duration[character] + interval
            if clock[character] < duration[character]:
                clock[character] += dt
                progress = min(clock[character] / duration[character], 1.0)
                share = minimum_jerk(progress)
                for axis in range(2):
                    begin = start[character, axis]
                    out_offset[character, axis] = begin + share * (goal[character, axis] - begin)


@parallel_kernel
def offset_eyes_crowd(
    eye: Any, pitch_limit: float, heading_limit: float, offset: Any, active: Any, pose_rotation: Any
) -> None:
    """Turn the eyes of people who look at nothing in particular, in place.

    Parameters
    ----------
    eye : (2,) int32
        Joints of the eyes.
    pitch_limit, heading_limit : float
        Half axes of the ellipse of an eye's turn, rad.
    offset : (N, 2) float32
        Turn about x and y, rad.
    active : (A,) int32
        Characters to process, each once; 0 to N - 1.
    pose_rotation : (N, 256) float32
        In and out: both eyes are turned.

    Notes
    -----
    **Source:** none; the turn is composed with the pose.
    """
    count = active.shape[0]
    for k in prange(CHUNKS):
        chunk = (k * 37) % CHUNKS
        for index in range(chunk * count // CHUNKS, (chunk + 1) * count // CHUNKS):
            character = active[index]
            pitch, heading = float(offset[character, 0]), float(offset[character, 1])
            square = (pitch / pitch_limit) ** 2 + (heading / heading_limit) ** 2
            factor = 1.0 / math.sqrt(max(square, 1.0))
            turn = from_rotation_vector((factor * pitch, factor * heading, 0.0))
            row = pose_rotation[character]
            for side in range(2):
                local = joint_rotation(row, eye[side])
                set_joint_rotation(row, eye[side], normalized(multiply(local, turn)))
