"""Plan the feet: where they are planted, how they roll, and how they swing from one place to the next.

A foot is planted around the time at which it stands beside the root, and stays there exactly. Its sole rolls
from the heel over the flat foot to the ball; between two stances the ankle follows a curve with continuous
acceleration.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from crowd.motion.body import ANKLE_HEIGHT, BALL_AHEAD, BALL_HEIGHT, STATURE, sole_points
from crowd.motion.clip import TOE_ROLL
from crowd.motion.easing import minimum_jerk
from crowd.motion.procedural.shape import GaitShape
from crowd.motion.rotation import about, multiply, rotate

FloatArray = npt.NDArray[np.float64]
RootPath = Callable[[FloatArray], tuple[FloatArray, FloatArray]]
"""Times (F,) to root positions (F, 3), m, and headings (F,), rad."""

END_STEP = 1e-3
LIFT_RISE, LIFT_FALL = 2.6, 3.1
CLEARANCE = 0.012
"""Least height of a swinging foot, m (toe clearance of walking is 1 to 2 cm)."""
TOE_STRAIGHTENING = 0.18
"""Share of a cycle in which toes straighten after they have left the ground."""
HEEL, BALL = sole_points()
TOE_JOINT = STATURE * np.array([0.0, BALL_HEIGHT - ANKLE_HEIGHT, BALL_AHEAD])
TIP = STATURE * np.array([0.0, -BALL_HEIGHT, 0.040])


@dataclass(frozen=True)
class FootPath:
    """One foot over the frames of a clip.

    Attributes
    ----------
    ankle : (F, 3) float64
        m.
    pitch, yaw : (F,) float64
        Rise of the toes, and heading, rad.
    toe_free : (F,) float64
        Share of a cycle since the toes left the ground; 0 on the ground.
    """

    ankle: FloatArray
    pitch: FloatArray
    yaw: FloatArray
    toe_free: FloatArray


def stance_pitch(shape: GaitShape, share: FloatArray) -> FloatArray:
    """Rise of the toes over a stance, negative once the heel rises, rad; `share` since the strike."""
    strike = (
        shape.strike_pitch * (1.0 - minimum_jerk(share / shape.flat)) if shape.flat > 0.0 else 0.0 * share
    )
    progress = np.clip((share - shape.heel_off) / (shape.stance - shape.heel_off), 0.0, None)
    return np.asarray(strike - shape.toe_off_pitch * progress ** (1.0 + shape.rise_power))


def planted(
    shape: GaitShape,
    root: RootPath,
    side: float,
    strike_time: FloatArray,
    share: FloatArray,
    effort: FloatArray,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Ankle (F, 3), pitch (F,) and yaw (F,) of a planted foot.

    Parameters
    ----------
    shape : GaitShape
    root : RootPath
    side : float
        1 left, -1 right.
    strike_time : (F,) float64
        When this stance began, s.
    share : (F,) float64
        Share of a cycle since then.
    effort : (F,) float64
        Factor on the roll of the foot, for starts and stops.
    """
    place, heading = root(strike_time + 0.5 * shape.stance * shape.cycle_duration)
    yaw = heading + side * shape.toe_out
    beside = np.array([0.5 * side * shape.width, ANKLE_HEIGHT * STATURE, 0.0])
    ahead = np.zeros((len(share), 3))
    ahead[:, 2] = shape.ankle_ahead * effort
    flat_ankle = place + rotate(about(1, heading), beside + ahead)
    pitch = effort * stance_pitch(shape, share)
    turned = multiply(about(1, yaw), about(0, -pitch))
    pivot = np.where((pitch >= 0.0)[:, None], HEEL, BALL)
    return flat_ankle + rotate(about(1, yaw), pivot) - rotate(turned, pivot), pitch, yaw


def quintic(u: FloatArray, ends: tuple[FloatArray, ...]) -> FloatArray:
    """Curve over u in [0, 1] from position, velocity, acceleration at its start to those at its end."""
    p0, v0, a0, p1, v1, a1 = ends
    distance, slope, bend = p1 - p0 - v0 - 0.5 * a0, v1 - v0 - a0, a1 - a0
    c3 = 10.0 * distance - 4.0 * slope + 0.5 * bend
    c4 = -15.0 * distance + 7.0 * slope - bend
    c5 = 6.0 * distance - 3.0 * slope + 0.5 * bend
    return np.asarray(p0 + u * (v0 + u * (0.5 * a0 + u * (c3 + u * (c4 + u * c5)))))


def lift_curve(progress: FloatArray) -> FloatArray:
    """Height of a swinging foot over its way, largest early: 0 to 1 and back, smooth at both ends."""
    peak = LIFT_RISE / (LIFT_RISE + LIFT_FALL)
    top = peak**LIFT_RISE * (1.0 - peak) ** LIFT_FALL
    return np.asarray(progress**LIFT_RISE * (1.0 - progress) ** LIFT_FALL / top)


def with_clearance(shape: GaitShape, root: RootPath) -> GaitShape:
    """Raise the lift of a gait until a swinging foot keeps `CLEARANCE` from the ground."""
    time = np.linspace(0.0, shape.cycle_duration, 121)
    share = time / shape.cycle_duration
    is_free = (share > shape.stance + TOE_ROLL + 0.06) & (share < 0.84)
    for _ in range(40):
        path = plan_foot(shape, root, -1.0, time, np.ones_like)
        sole = np.stack([path.ankle + rotate(about(0, -path.pitch), point) for point in (HEEL, BALL)])
        toes = path.pitch - toe_angle(path)
        tip = path.ankle + rotate(about(0, -path.pitch), TOE_JOINT) + rotate(about(0, -toes), TIP)
        lowest = min(sole[:, is_free, 1].min(), tip[is_free, 1].min())
        if lowest >= CLEARANCE:
            break
        shape = replace(shape, lift=shape.lift + 0.006)
    return shape


def toe_angle(path: FootPath) -> FloatArray:
    """Toes stay on the ground while the heel rises, and straighten in the swing, rad."""
    fading = np.exp(-((path.toe_free / TOE_STRAIGHTENING) ** 2))
    return np.asarray(np.clip(np.minimum(path.pitch, 0.0) * fading, -1.1, 0.0))


def plan_foot(
    shape: GaitShape,
    root: RootPath,
    side: float,
    time: FloatArray,
    effort: Callable[[FloatArray], FloatArray],
) -> FootPath:
    """Plan one foot over all frames.

    Parameters
    ----------
    shape : GaitShape
    root : RootPath
    side : float
        1 left, -1 right; the right foot strikes at time 0, the left half a cycle later.
    time : (F,) float64
        s.
    effort : callable
        Factor on roll and lift at strike times (F,), for starts and stops.
    """
    cycle = shape.cycle_duration
    phase = time / cycle - (0.5 if side > 0 else 0.0)
    number = np.floor(phase + 1e-9)
    share = phase - number
    strike = (number + (0.5 if side > 0 else 0.0)) * cycle

    def track(at_strike: FloatArray, at_share: FloatArray) -> FloatArray:
        ankle, pitch, yaw = planted(shape, root, side, at_strike, at_share, effort(at_strike))
        return np.column_stack([ankle, pitch, yaw])

    here = track(strike, np.minimum(share, shape.stance))
    length = 1.0 - shape.stance
    off = np.full_like(share, shape.stance)
    before = [track(strike, off - k * END_STEP) for k in range(3)]
    after = [track(strike + cycle, k * END_STEP + 0.0 * share) for k in range(3)]
    rate = length / END_STEP
    leaving = (1.5 * before[0] - 2.0 * before[1] + 0.5 * before[2]) * rate
    leaving_bend = (before[0] - 2.0 * before[1] + before[2]) * rate**2
    landing = (-1.5 * after[0] + 2.0 * after[1] - 0.5 * after[2]) * rate
    landing_bend = (after[0] - 2.0 * after[1] + after[2]) * rate**2
    progress = np.clip((share - shape.stance) / length, 0.0, 1.0)[:, None]
    swing = quintic(progress, (before[0], leaving, leaving_bend, after[0], landing, landing_bend))
    distance = np.hypot(after[0][:, 0] - before[0][:, 0], after[0][:, 2] - before[0][:, 2])
    turned = np.abs(after[0][:, 4] - before[0][:, 4])
    moves = minimum_jerk((distance + 0.2 * turned) / 0.05) if shape.lift > 0.025 else np.ones(len(time))
    swing[:, 1] += shape.lift * moves * lift_curve(progress[:, 0])
    path = np.where((share > shape.stance)[:, None], swing, here)
    return FootPath(path[:, :3], path[:, 3], path[:, 4], np.maximum(share - shape.stance, 0.0))
