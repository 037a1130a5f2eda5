"""How reaches stand: whether hands are at their targets, and for how long they stay."""

from typing import Any

from crowd_kernels._jit import inlined_kernel, parallel_kernel, prange
from crowd_kernels.reach_state import (
    MOVE,
    MOVING,
    NONE,
    OUT_OF_REACH,
    REACHED,
    REFUSED,
    RETURN,
    ReachState,
    vector_of,
)
from crowd_kernels.vector import norm, subtract

CHUNKS = 32


@inlined_kernel
def judge_hand(
    character: int,
    arm: int,
    distance: float,
    angle: float,
    dt: float,
    tolerance: float,
    angle_tolerance: float,
    state: ReachState,
) -> None:
    """Tell how the reach of one hand stands.

    Parameters
    ----------
    character, arm : int
    distance : float
        m.
    angle : float
        rad.

    Notes
    -----
    All other arguments are those of `reach_status_crowd`.
    """
    stage = state.stage[character, arm]
    if stage in (NONE, RETURN):
        return
    is_refused = state.status[character, arm] == REFUSED
    if stage == MOVE:
        if not is_refused:
            state.status[character, arm] = MOVING
        return
    is_met = distance < tolerance
    if state.has_rotation[character, arm] and angle >= angle_tolerance:
        is_met = False
    if not is_refused:
        state.status[character, arm] = REACHED if is_met else OUT_OF_REACH
    state.hold_left[character, arm] -= dt
    if state.hold_left[character, arm] < 0.0:
        state.stage[character, arm] = RETURN


@parallel_kernel
def reach_status_crowd(
    target: Any,
    distance: Any,
    angle: Any,
    active: Any,
    dt: float,
    tolerance: float,
    angle_tolerance: float,
    state: ReachState,
) -> None:
    """Tell how each reach stands after inverse kinematics, and count down how long hands hold.

    Parameters
    ----------
    target : (N, 2, 3) float32
        Where inverse kinematics took the hands, root frame, m.
    distance : (N, 2) float32
        How far the points of the hands are from there, m.
    angle : (N, 2) float32
        How far the hands' rotations are from those asked for, rad.
    active : (A,) int32
        Characters of whom a hand reaches, each once.
    dt : float
        s.
    tolerance : float
        Distance at which a target is reached, m.
    angle_tolerance : float
        rad.
    state : ReachState
        In and out.

    Notes
    -----
    **Source:** the stages of Feng, Xu, Shapiro, section 5.1.
    """
    count = active.shape[0]
    for k in prange(CHUNKS):
        chunk = (k * 37) % CHUNKS
        for index in range(chunk * count // CHUNKS, (chunk + 1) * count // CHUNKS):
            character = active[index]
            for arm in range(2):
                missing = subtract(vector_of(state.seen, character, arm), vector_of(target, character, arm))
                judge_hand(
                    character,
                    arm,
                    distance[character, arm] + norm(missing),
                    angle[character, arm],
                    dt,
                    tolerance,
                    angle_tolerance,
                    state,
                )
