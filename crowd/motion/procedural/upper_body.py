"""Pelvis, spine, head, arms and fingers of a gait: counter-rotation, a steady head, swinging arms."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from crowd.motion.body import FINGERS, PELVIS_RISE, STATURE
from crowd.motion.easing import minimum_jerk
from crowd.motion.procedural.feet import quintic
from crowd.motion.procedural.shape import GaitShape
from crowd.motion.rotation import about, multiply
from crowd.motion.skeleton import Skeleton

FloatArray = npt.NDArray[np.float64]

GRAVITY = 9.81
SPINE_SHARE = {"spine_1": 0.2, "spine_2": 0.25, "spine_3": 0.3, "spine_4": 0.25}
NECK_SHARE = {"neck_1": 0.3, "neck_2": 0.3, "head": 0.4}
ARM_LAG = 0.03
"""Arms swing this share of a cycle behind the legs."""
THORAX_YAW = 0.7
"""Turn of the chest against the pelvis's own, as a share of it (Boulic et al. 1990: 1.33 to 4 RV)."""
RELAXED_CURL = {1: 0.35, 2: 0.5, 3: 0.3}
"""Flexion of resting finger joints, rad."""


@dataclass(frozen=True)
class Trunk:
    """Pelvis over the frames of a clip, in the root's frame.

    Attributes
    ----------
    position : (F, 3) float64
        m.
    rotation : (F, 4) float64
    yaw, roll, pitch : (F,) float64
        Angles that make up the rotation, rad.
    """

    position: FloatArray
    rotation: FloatArray
    yaw: FloatArray
    roll: FloatArray
    pitch: FloatArray


def pelvis_height(shape: GaitShape, phase: FloatArray) -> FloatArray:
    """Height of the hips over the cycle, m.

    Walking: lowest shortly after a strike, highest in mid-stance. Running: a parabola of free fall while both
    feet are off the ground, joined by a smooth curve while one is down.
    """
    if not shape.is_running:
        return np.asarray(shape.pelvis_height - shape.bounce * np.cos(4.0 * np.pi * (phase - 0.045)))
    step = np.mod(phase, 0.5)
    flight = (0.5 - shape.stance) * shape.cycle_duration
    contact = shape.stance * shape.cycle_duration
    speed = 0.5 * GRAVITY * flight
    down, up = np.array(-speed * contact), np.array(speed * contact)
    fall = np.array(-GRAVITY * contact**2)
    zero = np.array(0.0)
    on_ground = quintic(step / shape.stance, (zero, down, fall, zero, up, fall))
    since = (step - shape.stance) * shape.cycle_duration
    height = np.where(step < shape.stance, on_ground, speed * since - 0.5 * GRAVITY * since**2)
    return np.asarray(shape.pelvis_height + height)


def move_pelvis(shape: GaitShape, phase: FloatArray, bank: FloatArray, effort: FloatArray) -> Trunk:
    """Pelvis of a gait.

    Parameters
    ----------
    shape : GaitShape
    phase : (F,) float64
        Cycles; the right heel strikes at whole numbers.
    bank : (F,) float64
        Lean into a curve, left positive, rad.
    effort : (F,) float64
        Factor on all swings, for starts and stops.
    """
    turn = 2.0 * np.pi * phase
    yaw = effort * shape.pelvis_yaw * np.cos(turn)
    roll = -effort * shape.pelvis_drop * np.sin(turn + 0.3) - bank
    pitch = 0.35 * shape.lean * np.ones_like(phase)
    position = np.zeros((len(phase), 3))
    position[:, 0] = -effort * shape.sway * np.sin(turn - 0.25)
    position[:, 1] = pelvis_height(shape, phase) + PELVIS_RISE * STATURE
    rotation = multiply(about(1, yaw), multiply(about(2, roll), about(0, pitch)))
    return Trunk(position, rotation, yaw, roll, pitch)


def move_trunk(
    skeleton: Skeleton,
    shape: GaitShape,
    phase: FloatArray,
    trunk: Trunk,
    look: FloatArray,
    effort: FloatArray,
    out: FloatArray,
) -> None:
    """Write pelvis, spine, neck and head; the chest turns against the pelvis, the head stays level and ahead.

    `look` is how far the head turns into a curve, left positive, rad.
    """
    out[:, 0] = trunk.rotation
    chest_yaw = -THORAX_YAW * effort * shape.pelvis_yaw * np.cos(2.0 * np.pi * (phase - 0.02)) + 0.3 * look
    chest_pitch = shape.lean * np.ones_like(phase)
    for name, share in SPINE_SHARE.items():
        rotation = multiply(
            about(2, -share * (trunk.roll + 0.0)), about(0, share * (chest_pitch - trunk.pitch))
        )
        out[:, skeleton.joint(name)] = multiply(about(1, share * (chest_yaw - trunk.yaw)), rotation)
    for name, share in NECK_SHARE.items():
        turned = about(1, share * (look - chest_yaw))
        out[:, skeleton.joint(name)] = multiply(turned, about(0, share * (0.03 - chest_pitch)))


def swing_arms(
    skeleton: Skeleton, shape: GaitShape, phase: FloatArray, effort: FloatArray, out: FloatArray
) -> None:
    """Write shoulders, elbows and fingers; each arm swings with the other side's leg."""
    for side, sign in (("left", 1.0), ("right", -1.0)):
        ahead = sign * np.cos(2.0 * np.pi * (phase - ARM_LAG))
        flexion = shape.arm_forward + effort * shape.arm_swing * ahead
        elbow = shape.elbow + effort * shape.elbow_swing * minimum_jerk(0.5 + 0.5 * ahead)
        pose_arm(skeleton, side, flexion, shape.arm_out * np.ones_like(phase), elbow, out, inward=0.12)
        curl_fingers(skeleton, side, 1.0 if not shape.is_running else 2.0, out)


def pose_arm(
    skeleton: Skeleton,
    side: str,
    flexion: FloatArray,
    out_angle: FloatArray,
    elbow: FloatArray,
    out: FloatArray,
    inward: float | FloatArray = 0.0,
    twist: float | FloatArray = 0.0,
) -> None:
    """Write shoulder and elbow of one arm.

    Parameters
    ----------
    skeleton : Skeleton
    side : str
    flexion, out_angle, elbow : (F,) float64
        Shoulder ahead, shoulder away from the body, elbow bent, rad.
    out : (F, J, 4) float64
        Local rotations.
    inward : float or (F,) float64
        Turn of the upper arm about itself that brings a bent forearm before the body, rad.
    twist : float or (F,) float64
        Turn of the hand about the forearm, thumb outward, rad.
    """
    sign = 1.0 if side == "left" else -1.0
    shoulder = multiply(about(0, -flexion), about(2, sign * out_angle))
    turned = about(1, -sign * inward * np.ones_like(flexion))
    out[:, skeleton.joint(f"{side}_upper_arm")] = multiply(shoulder, turned)
    out[:, skeleton.joint(f"{side}_forearm")] = about(0, -elbow)
    out[:, skeleton.joint(f"{side}_hand")] = about(1, sign * twist * np.ones_like(flexion))


def curl_fingers(skeleton: Skeleton, side: str, share: float, out: FloatArray) -> None:
    """Write resting fingers, curled `share` times as far as a relaxed hand."""
    sign = 1.0 if side == "left" else -1.0
    for finger in FINGERS:
        for number, angle in RELAXED_CURL.items():
            joint = skeleton.joint(f"{side}_{finger}_{number}")
            less = 0.3 if finger == "thumb" else 1.0
            out[:, joint] = about(2, -sign * less * share * angle)
