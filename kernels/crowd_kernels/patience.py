"""Right of way among characters that get nowhere: a changing order, so that somebody always goes first."""

import math
from typing import Any, NamedTuple

from crowd_kernels._jit import kernel, parallel_kernel, prange
from crowd_kernels.random import uniform

CHUNKS = 32
PURPOSE_RANK = 0x9A7
PURPOSE_TURN = 0x9A8
STANDING_SPEED = 0.05
"""Who wishes to be slower than this waits for nothing, m/s."""
MOBILITY_SPREAD = 1.5
"""Natural logarithm of the ratio between the largest and the smallest mobility of those who wait."""
LONGEST_JUMP = 1.0
"""A character that moves farther in one step has been placed anew, m."""


class PatienceLimits(NamedTuple):
    """Numbers that govern patience."""

    memory: float
    """Time over which progress is averaged, s."""
    least_progress: float
    """Share of the preferred speed below which a character waits."""
    patience: float
    """Waiting time after which right of way is drawn, s."""
    turn_time: float
    """Time for which a rank is kept, s."""
    spread: float
    """Natural logarithm of the ratio between the largest and the smallest responsibility."""
    sidestep_after: float
    """Waiting time after which a character also tries other directions, s."""
    sidestep_angle: float
    """Largest turn of the preferred velocity then, rad."""


@kernel
def wait_of(waiting: float, progress: float, limits: PatienceLimits, dt: float) -> float:
    """Advance the time that a character has waited.

    Parameters
    ----------
    waiting : float
        So far, s.
    progress : float
        Share of the preferred speed that was realised lately.
    limits : PatienceLimits
    dt : float
        s.

    Returns
    -------
    float
        s; it grows while there is no progress and falls twice as fast afterwards.
    """
    if progress < limits.least_progress:
        return waiting + dt
    return max(waiting - 2.0 * dt, 0.0)


@parallel_kernel
def rank_waiting_crowd(
    position_world: Any,
    active: Any,
    limits: PatienceLimits,
    dt: float,
    seed: int,
    step: int,
    last_position_world: Any,
    progress: Any,
    waiting: Any,
    preferred_velocity_world: Any,
    responsibility: Any,
    mobility: Any,
) -> None:
    """Notice who gets nowhere, and give those characters a rank that changes from time to time.

    A rank scales responsibility over orders of magnitude, so that of two waiting characters nearly always one
    goes and the other gives way, and there is no circle of characters that all wait for the next.

    Parameters
    ----------
    position_world : (N, 3) float64
        m.
    active : (A,) int32
    limits : PatienceLimits
    dt : float
        s.
    seed, step : int
        Keys of the ranks.
    last_position_world : (N, 3) float64
        State: positions one step ago, m.
    progress : (N,) float64
        State: share of the preferred speed that was realised lately.
    waiting : (N,) float64
        State: time without progress, s.
    preferred_velocity_world : (N, 3) float64
        In and out, m/s; turned for those who have waited very long.
    responsibility, mobility : (N,) float64
        In and out: reduced for those who wait and have a high rank.

    Notes
    -----
    **Source:** own; random priorities that change over time break symmetric waiting as random back-off
    does in shared media (Metcalfe, Boggs, 1976).
    """
    count = active.shape[0]
    for k in prange(CHUNKS):
        for index in range(k * count // CHUNKS, (k + 1) * count // CHUNKS):
            own = active[index]
            dx = position_world[own, 0] - last_position_world[own, 0]
            dz = position_world[own, 2] - last_position_world[own, 2]
            last_position_world[own, 0] = position_world[own, 0]
            last_position_world[own, 2] = position_world[own, 2]
            px, pz = preferred_velocity_world[own, 0], preferred_velocity_world[own, 2]
            squared = px * px + pz * pz
            is_placed_anew = not (dx * dx + dz * dz <= LONGEST_JUMP * LONGEST_JUMP)
            if is_placed_anew or not squared > STANDING_SPEED * STANDING_SPEED:
                progress[own] = 1.0
                waiting[own] = 0.0
                continue
            realised = min(max((dx * px + dz * pz) / (squared * dt), -1.0), 1.0)
            progress[own] += (realised - progress[own]) * min(dt / limits.memory, 1.0)
            waiting[own] = wait_of(waiting[own], progress[own], limits, dt)
            if waiting[own] < limits.patience:
                continue
            # Each character changes its rank at moments of its own.
            phase = uniform(seed, own, 0, PURPOSE_TURN)
            turn = int(step * dt / limits.turn_time + phase)
            rank = uniform(seed, own, turn, PURPOSE_RANK)
            scale = math.exp(-limits.spread * rank)
            responsibility[own] *= scale
            mobility[own] *= math.exp(-MOBILITY_SPREAD * rank)
            if waiting[own] > limits.sidestep_after:
                angle = limits.sidestep_angle * (2.0 * uniform(seed, own, turn, ~PURPOSE_RANK) - 1.0)
                cosine, sine = math.cos(angle), math.sin(angle)
                preferred_velocity_world[own, 0] = cosine * px - sine * pz
                preferred_velocity_world[own, 2] = sine * px + cosine * pz
