"""The course of each reach: 0 at rest, 1 with the hand at the target, 2 at rest again."""

from crowd_kernels._jit import inlined_kernel
from crowd_kernels.easing import minimum_jerk
from crowd_kernels.reach_state import APEX, END, HOLD, MOVE, NONE, REFUSED, RETURN, ReachLimits, ReachState


@inlined_kernel
def paced(now: float, wanted: float, usual: float, is_at_rest: bool, limits: ReachLimits, dt: float) -> float:
    """Change the rate of a course towards another one: at once where it is at rest, else gradually.

    Parameters
    ----------
    now, wanted : float
        1/s.
    usual : float
        Rate of the way there, 1/s: the faster, the faster rates change.
    is_at_rest : bool
    limits : ReachLimits
    dt : float
        s.

    Returns
    -------
    float
        1/s.
    """
    if is_at_rest:
        return wanted
    fastest = max(usual, abs(now))
    change = limits.turn_back * fastest * fastest * dt
    return now + min(max(wanted - now, -change), change)


@inlined_kernel
def advance_course(
    character: int,
    arm: int,
    rate: float,
    return_rate: float,
    limits: ReachLimits,
    dt: float,
    state: ReachState,
) -> None:
    """Advance the course of one hand and change its stage.

    Parameters
    ----------
    character, arm : int
    rate, return_rate : float
        Rates of the course to the apex and back, 1/s.
    limits : ReachLimits
    dt : float
        s.
    state : ReachState
        In and out.
    """
    stage = state.stage[character, arm]
    course = state.course[character, arm]
    now = state.course_rate[character, arm]
    wanted = 0.0
    if stage == RETURN:
        wanted = return_rate if course >= APEX else -rate
        if course < APEX and now > 0.0 and course + now * dt >= APEX:
            wanted = now
    elif course < APEX:
        wanted = rate
    elif course > APEX:
        wanted = -return_rate
    now = paced(now, wanted, rate, course in (0.0, APEX), limits, dt)
    moved = course + now * dt
    # Courses stop at the apex, whose pose all sections share.
    if (course < APEX and moved > APEX - 1e-9) or (course > APEX and moved < APEX + 1e-9):
        moved = APEX
        now = 0.0
    state.course[character, arm] = min(max(moved, 0.0), END)
    state.course_rate[character, arm] = now
    if stage == RETURN:
        if moved <= 0.0 or moved >= END:
            state.stage[character, arm] = NONE
            state.status[character, arm] = NONE
            state.course[character, arm] = 0.0
            state.course_rate[character, arm] = 0.0
            state.weight[character, arm] = 0.0
        return
    is_turned = not state.has_rotation[character, arm] or state.rotation_share[character, arm] >= 1.0
    is_turned = is_turned or state.status[character, arm] == REFUSED
    is_there = moved == APEX and state.time_left[character, arm] <= 0.0 and is_turned
    state.stage[character, arm] = HOLD if is_there else MOVE


@inlined_kernel
def course_shares(course: float, lead: float) -> tuple[float, float]:
    """Find the share of the examples in the pose, and that of the correction of the hand, on a course."""
    side = course if course <= APEX else END - course
    return minimum_jerk(side / lead), minimum_jerk(side)


@inlined_kernel
def kept_share(course: float, advance: float, lead: float) -> float:
    """Find how much of its last correction a hand keeps: on its way back less in each step, at rest nothing.

    Parameters
    ----------
    course : float
    advance : float
        How far the course went in this step.
    lead : float
        See `ReachLimits`.
    """
    _, now = course_shares(course, lead)
    _, before = course_shares(course - advance, lead)
    return min(now / before, 1.0) if before > 0.0 else 1.0
