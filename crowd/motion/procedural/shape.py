"""What distinguishes one gait from another: timing laws and a few shape numbers."""

import math
from dataclasses import dataclass, replace

import numpy as np

from crowd.motion.body import STATURE
from crowd.motion.clip import TOE_ROLL

HIP_HEIGHT = 0.53 * STATURE


@dataclass(frozen=True)
class GaitShape:
    """Numbers that the foot planner and the upper body follow; shares are of a gait cycle.

    Attributes
    ----------
    cycle_duration : float
        s.
    stance : float
        From heel strike until the ball lifts off, `TOE_ROLL` before toe off.
    flat : float
        From heel strike until the sole is on the ground; 0 for a foot that lands flat.
    heel_off : float
        From heel strike until the heel rises.
    strike_pitch, toe_off_pitch : float
        Rise of the toes at the strike, of the heel at toe off, rad.
    rise_power : float
        How late the heel rises: 1 evenly, larger late.
    ankle_ahead : float
        Ankle before the root in mid-stance, m.
    width : float
        Distance between the feet across the way, m.
    lift : float
        Extra height of the foot in mid-swing, m.
    pelvis_height : float
        Mean height of the hips, m.
    bounce, sway : float
        Half range of the pelvis up and down, and to the sides, m.
    pelvis_yaw, pelvis_drop : float
        Half range, rad.
    lean : float
        Trunk ahead, rad.
    arm_swing, arm_forward, elbow, elbow_swing, arm_out : float
        Half range and mean of the shoulder, least flexion and range of the elbow, abduction, rad.
    toe_out : float
        rad.
    is_running : bool
        The body flies between contacts.
    """

    cycle_duration: float
    stance: float
    flat: float
    heel_off: float
    strike_pitch: float
    toe_off_pitch: float
    rise_power: float
    ankle_ahead: float
    width: float
    lift: float
    pelvis_height: float
    bounce: float
    sway: float
    pelvis_yaw: float
    pelvis_drop: float
    lean: float
    arm_swing: float
    arm_forward: float
    elbow: float
    elbow_swing: float
    arm_out: float
    toe_out: float = math.radians(6.0)
    is_running: bool = False


QUICK_STEPS = 0.95
"""Steps against the mean law, which is good to 7 %; shorter ones spare the legs their last stretch."""


def walk_cycle(speed: float) -> float:
    """Gait cycle of walking, s: mean of the laws of Boulic et al. 1990 and Koopman et al. 2014."""
    boulic = 1.346 / math.sqrt(speed / HIP_HEIGHT)
    koopman = 2.0 * math.sqrt((-0.532 + 0.020 * 3.6 * speed + 0.47 * STATURE) / speed)
    return QUICK_STEPS * 0.5 * (boulic + koopman)


def walk_stance(speed: float, cycle: float) -> float:
    """Stance share of walking until the ball lifts: mean of Boulic et al. 1990 and Kirtley et al. 1985."""
    return 0.5 * ((0.752 * cycle - 0.143) / cycle + (64.2 - 3.5 * speed) / 100.0) - 0.02 - TOE_ROLL


def run_cycle(speed: float) -> float:
    """Gait cycle of running, s: step frequency 2.25 + 0.13 V Hz, fitted to young adults at 2.6 m/s."""
    return 2.0 / (2.25 + 0.13 * speed)


def run_stance(speed: float, cycle: float) -> float:
    """Stance share of running until the ball lifts off: contact 0.425 V^-0.45 s, fitted at 2.6 m/s.

    Fast runs are a little shorter on the ground, because the root keeps a constant speed.
    """
    contact: float = 0.425 * math.pow(speed, -0.45)
    return contact / cycle - 0.012 * (speed - 2.0) - TOE_ROLL


# Shape numbers fitted so that hip, knee and ankle come close to the published curves: Koopman et al. 2014 for
# walking, the mean runner of the BMC group for running. Columns: flat, heel_off / stance, strike_pitch deg,
# toe_off_pitch deg, rise_power, ankle_ahead m, lift m, pelvis_height m.
WALK_SPEEDS = (0.7, 1.0, 1.35, 1.9)
WALK_FIT = np.array(
    [
        (0.079, 0.25, 9.6, 40.4, 1.11, -0.130, 0.060, 0.932),
        (0.081, 0.25, 17.0, 40.0, 1.37, -0.110, 0.068, 0.932),
        (0.090, 0.25, 18.5, 40.0, 1.80, -0.105, 0.070, 0.918),
        (0.106, 0.25, 20.3, 40.0, 1.81, -0.110, 0.066, 0.903),
    ]
)
RUN_SPEEDS = (2.5, 3.6)
RUN_FIT = np.array(
    [
        (0.065, 0.28, 7.0, 42.0, 0.9, -0.155, 0.135, 0.928),
        (0.065, 0.30, 5.0, 46.0, 0.9, -0.145, 0.190, 0.920),
    ]
)


def fitted(speed: float, speeds: tuple[float, ...], table: np.ndarray) -> dict[str, float]:
    """Interpolate fitted shape numbers at a speed."""
    values = [float(np.interp(speed, speeds, column)) for column in table.T]
    names = (
        "flat",
        "heel_off",
        "strike_pitch",
        "toe_off_pitch",
        "rise_power",
        "ankle_ahead",
        "lift",
        "pelvis_height",
    )
    shape = dict(zip(names, values, strict=True))
    return shape | {name: math.radians(shape[name]) for name in ("strike_pitch", "toe_off_pitch")}


def walk_shape(speed: float) -> GaitShape:
    """Walking ahead; pelvis and arms after Boulic et al. 1990, shoulders at 0.8 of theirs as measured."""
    cycle = walk_cycle(speed)
    stance = walk_stance(speed, cycle)
    fit = fitted(speed, WALK_SPEEDS, WALK_FIT)
    relative = speed / HIP_HEIGHT
    return GaitShape(
        cycle,
        stance,
        fit["flat"],
        fit["heel_off"] * stance,
        fit["strike_pitch"],
        fit["toe_off_pitch"],
        fit["rise_power"],
        fit["ankle_ahead"],
        0.10,
        fit["lift"],
        fit["pelvis_height"],
        bounce=0.015 * relative,
        sway=0.022,
        pelvis_yaw=math.radians(min(5.2 * relative, 8.5)),
        pelvis_drop=math.radians(min(1.66 * relative, 4.0)),
        lean=math.radians(2.0 + speed),
        arm_swing=math.radians(0.8 * 9.88 * relative),
        arm_forward=math.radians(1.0),
        elbow=math.radians(10.0 + 5.0 * speed),
        elbow_swing=math.radians(14.0 * speed),
        arm_out=math.radians(7.0),
    )


def run_shape(speed: float) -> GaitShape:
    """Running ahead."""
    cycle = run_cycle(speed)
    stance = run_stance(speed, cycle)
    fit = fitted(speed, RUN_SPEEDS, RUN_FIT)
    return GaitShape(
        cycle,
        stance,
        fit["flat"],
        fit["heel_off"] * stance,
        fit["strike_pitch"],
        fit["toe_off_pitch"],
        fit["rise_power"],
        fit["ankle_ahead"],
        0.06,
        fit["lift"],
        fit["pelvis_height"],
        bounce=0.0,
        sway=0.008,
        pelvis_yaw=math.radians(7.0),
        pelvis_drop=math.radians(4.0),
        lean=math.radians(6.0 + 0.8 * speed),
        arm_swing=math.radians(22.0 + 3.0 * speed),
        arm_forward=math.radians(-12.0),
        elbow=math.radians(80.0),
        elbow_swing=math.radians(16.0),
        arm_out=math.radians(14.0),
        is_running=True,
    )


def flat_shape(cycle: float, stance: float, width: float, height: float, lift: float) -> GaitShape:
    """Steps on flat feet: marking time, turning on the spot, sidesteps, walking backward."""
    return GaitShape(
        cycle,
        stance,
        flat=0.0,
        heel_off=0.4 * stance,
        strike_pitch=0.0,
        toe_off_pitch=math.radians(16.0),
        rise_power=1.2,
        ankle_ahead=-0.02,
        width=width,
        lift=lift,
        pelvis_height=height,
        bounce=0.006,
        sway=0.018,
        pelvis_yaw=0.0,
        pelvis_drop=math.radians(1.2),
        lean=math.radians(2.5),
        arm_swing=math.radians(2.5),
        arm_forward=math.radians(2.0),
        elbow=math.radians(16.0),
        elbow_swing=math.radians(4.0),
        arm_out=math.radians(9.0),
    )


def standing_in_place() -> GaitShape:
    """Marking time with tiny steps: what very slow commands blend with."""
    return flat_shape(cycle=1.2, stance=0.66, width=0.175, height=0.918, lift=0.022)


def turn_shape() -> GaitShape:
    """Turning on the spot by small steps."""
    return flat_shape(cycle=0.92, stance=0.62, width=0.18, height=0.915, lift=0.032)


def side_shape(speed: float) -> GaitShape:
    """Sidesteps: the leading foot opens, the other follows without crossing."""
    cycle = float(np.interp(speed, (0.5, 1.1), (0.95, 0.66)))
    stance = float(np.interp(speed, (0.5, 1.1), (0.62, 0.56)))
    width = 0.5 * speed * cycle + 0.11
    height = float(np.interp(speed, (0.5, 1.1), (0.905, 0.885)))
    shape = flat_shape(cycle, stance, width, height, lift=0.03)
    return replace(shape, arm_out=math.radians(13.0), elbow=math.radians(26.0), sway=0.03)


def back_shape(speed: float) -> GaitShape:
    """Walking backward: shorter, quicker steps that land on the ball."""
    cycle = 0.88 * walk_cycle(speed)
    shape = flat_shape(cycle, walk_stance(speed, cycle), 0.14, 0.912, lift=0.045)
    swing = math.radians(0.5 * 9.88 * speed / HIP_HEIGHT)
    return replace(shape, arm_swing=swing, ankle_ahead=0.0, lean=math.radians(3.0))
