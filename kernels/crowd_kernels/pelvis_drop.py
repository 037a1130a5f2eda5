"""How far the pelvis comes down for feet that are out of reach, without lag and without a jump."""

import math
from typing import Any

from crowd_kernels._jit import inlined_kernel
from crowd_kernels.gait import SWING
from crowd_kernels.locomotion import ease
from crowd_kernels.vector import Vector

UNKNOWN, NEITHER, FIRST_LEG = 0, 1, 2
"""What decides how far the pelvis is lowered: not known yet, no leg, or from here on one of the legs."""
TINY = 1e-12


@inlined_kernel
def needed_drop(hip: Vector, target: Vector, length: float, stretch: float) -> float:
    """Find how far the hip must come down for a foot: softly more as the leg comes near its largest stretch.

    The nearer a leg is to straight, the faster its knee turns with the way to the foot: at a bare limit a
    knee that straightens would stop dead.

    Parameters
    ----------
    hip, target : tuple of float
        Hip in the animation and place of the ankle, in one frame, m.
    length : float
        Of the straight leg, m.
    stretch : float
        Largest share of it that is used.

    Returns
    -------
    float
        m, not negative.
    """
    away = (target[0] - hip[0]) ** 2 + (target[2] - hip[2]) ** 2
    height = hip[1] - target[1]
    least = max(1.0 - stretch, TINY)
    # What lacks from straight: all of it where the leg is bent, `least` where it would have to be straight.
    slack = max(1.0 - math.sqrt(away + height * height) / length, 0.0)
    used = (1.0 - slack - least * math.exp(-slack / least)) * length
    return max(height - math.sqrt(max(used * used - away, 0.0)), 0.0)


@inlined_kernel
def followed_rate(need: float, before: float, fastest: float, dt: float) -> float:
    """Find how fast the pelvis follows a leg's need at once, m/s."""
    return min(max((need - before) / dt, -fastest), fastest)


@inlined_kernel
def lower_pelvis(
    character: int,
    right: float,
    left: float,
    fastest: float,
    stiffness: float,
    most: float,
    dt: float,
    contact: Any,
    leg_need: Any,
    deciding: Any,
    drop_gap: Any,
    drop: Any,
) -> None:
    """Lower the pelvis as far as the planted leg needs that needs most, in place.

    While one leg decides, the pelvis follows its need at once, so that the leg never comes to its limit with
    speed. Where another one takes over, needs and rates differ: the difference becomes a gap that is eased
    away, as is what feet need that are dragged off faster than people sink.

    Parameters
    ----------
    character : int
    right, left : float
        What each leg needs, planted or not, m.
    fastest : float
        Speed up to which the pelvis follows at once, m/s.
    stiffness : float
        Rate at which gaps are eased away, 1/s.
    most : float
        How far the pelvis is lowered at most, m.
    dt : float
        s.
    contact : (N, 2) uint8
        Contact in force.
    leg_need : (N, 2) float64
        In and out: what the legs needed in the last step, m.
    deciding : (N,) uint8
        In and out: `UNKNOWN`, `NEITHER` or `FIRST_LEG` and on.
    drop_gap : (N, 2) float64
        In and out: how far the pelvis is lower than the deciding leg needs, m, and its rate, m/s.
    drop : (N,) float64
        Written: how far the pelvis is lowered, m.

    Notes
    -----
    **Source:** Bollo, "Inertialization: high-performance animation transitions in Gears of War", 2018.
    **Differs from the source:** the gap fades as a critically damped spring instead of a polynomial.
    """
    now, need, rate = NEITHER, 0.0, 0.0
    if contact[character, 0] != SWING and right > need:
        now, need = FIRST_LEG, right
    if contact[character, 1] != SWING and left > need:
        now, need = FIRST_LEG + 1, left
    before = deciding[character]
    gap, gap_rate = drop_gap[character, 0], drop_gap[character, 1]
    if before != UNKNOWN:
        right_rate = followed_rate(right, leg_need[character, 0], fastest, dt)
        left_rate = followed_rate(left, leg_need[character, 1], fastest, dt)
        if before >= FIRST_LEG:
            gap += leg_need[character, before - FIRST_LEG]
            gap_rate += right_rate if before == FIRST_LEG else left_rate
        if now >= FIRST_LEG:
            rate = right_rate if now == FIRST_LEG else left_rate
        gap, gap_rate = ease(gap - (need - rate * dt), gap_rate - rate, 0.0, stiffness, dt)
    lowered = min(max(need + gap, 0.0), most)
    if lowered != need + gap:
        gap, gap_rate = lowered - need, 0.0
    leg_need[character, 0], leg_need[character, 1] = right, left
    deciding[character] = now
    drop_gap[character, 0], drop_gap[character, 1] = gap, gap_rate
    drop[character] = lowered
