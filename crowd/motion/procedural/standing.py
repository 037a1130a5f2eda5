"""Idle variations and gestures: people who stand, shift their weight, look about, talk with their hands."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from crowd.motion.body import ANKLE_HEIGHT, FINGERS, PELVIS_RISE, STATURE
from crowd.motion.clip import Clip, ClipKind, JointMask
from crowd.motion.easing import minimum_jerk
from crowd.motion.procedural.feet import FootPath
from crowd.motion.procedural.gait import FRAME_RATE
from crowd.motion.procedural.legs import bend_leg, lower_pelvis
from crowd.motion.procedural.shape import GaitShape, standing_in_place
from crowd.motion.procedural.upper_body import NECK_SHARE, SPINE_SHARE, curl_fingers, pose_arm
from crowd.motion.rotation import about, continuous, multiply
from crowd.motion.skeleton import Skeleton

FloatArray = npt.NDArray[np.float64]

BREATH_SECONDS = 4.0
SEAT_BEHIND = 0.40
"""Pelvis of a person on a seat behind the ankles, m."""
SEATED_PELVIS = 0.55
"""Height of the pelvis over a seat 0.45 m high, m."""
STANDING_RISE = 0.008
"""Pelvis of a standing person over that of the stepping in place, m."""
RAISE_SECONDS = 0.55
"""Time in which a gesture rises from and sinks back to hanging arms."""


@dataclass
class Stance:
    """Angles of a standing person over the frames of a clip, rad and m; left and up positive.

    Arms are (shoulder ahead, shoulder out, elbow, inward turn, hand twist) for left and right.
    """

    time: FloatArray
    shift: FloatArray
    back: FloatArray
    sink: FloatArray
    turn: FloatArray
    lean: FloatArray
    look: FloatArray
    nod: FloatArray
    tilt: FloatArray
    shrug: FloatArray
    left: list[FloatArray]
    right: list[FloatArray]
    curl: dict[str, FloatArray]

    @classmethod
    def neutral(cls, seconds: float) -> "Stance":
        """Stand upright with hanging arms, breathing."""
        time = np.arange(round(seconds * FRAME_RATE) + 1) / FRAME_RATE
        zero = np.zeros_like(time)
        # A whole number of breaths, so that clips that go round do not jump where they do.
        breaths = max(round(seconds / BREATH_SECONDS), 1)
        breath = np.sin(2.0 * np.pi * breaths * time / time[-1])
        arm = [0.03 + 0.008 * breath, 0.14 + 0.01 * breath, 0.26 + zero, 0.12 + zero, zero]
        return cls(
            time,
            zero.copy(),
            zero.copy(),
            zero.copy(),
            zero.copy(),
            0.03 + 0.010 * breath,
            zero.copy(),
            zero.copy(),
            zero.copy(),
            0.012 * breath,
            [angle.copy() for angle in arm],
            [angle.copy() for angle in arm],
            {"left": 1.0 + zero, "right": 1.0 + zero},
        )

    def wave(self, seconds: float, size: float, late: float = 0.0) -> FloatArray:
        """Slow swing that fits into the clip a whole number of times."""
        length = self.time[-1]
        count = max(round(length / seconds), 1)
        return np.asarray(size * np.sin(2.0 * np.pi * (count * self.time / length - late)))

    def bump(self, begin: float, end: float, ease: float = 0.7) -> FloatArray:
        """Rise from 0 to 1 at a time and fall back at another, s."""
        return np.asarray(
            minimum_jerk((self.time - begin) / ease) * (1.0 - minimum_jerk((self.time - end) / ease))
        )


def build_stance(
    skeleton: Skeleton, shape: GaitShape, stance: Stance, is_cyclic: bool
) -> tuple[FloatArray, FloatArray]:
    """Local rotations (F, J, 4) and pelvis positions (F, 3) of a standing person on flat, fixed feet."""
    count = len(stance.time)
    rotation = np.zeros((count, skeleton.joint_count, 4))
    rotation[..., 0] = 1.0
    pelvis = np.zeros((count, 3))
    pelvis[:, 0] = stance.shift
    pelvis[:, 2] = -stance.back
    pelvis[:, 1] = shape.pelvis_height + PELVIS_RISE * STATURE + STANDING_RISE - stance.sink
    drop = -1.2 * stance.shift
    pelvis_rotation = multiply(
        about(1, 0.3 * stance.turn), multiply(about(2, drop), about(0, 0.3 * stance.lean))
    )
    rotation[:, 0] = pelvis_rotation
    feet = {}
    for side, sign in (("right", -1.0), ("left", 1.0)):
        ankle = np.tile([0.5 * sign * shape.width, ANKLE_HEIGHT * STATURE, shape.ankle_ahead], (count, 1))
        zero = np.zeros(count)
        feet[side] = FootPath(ankle, zero, zero + sign * shape.toe_out, zero)
    hips = np.array([skeleton.offset[skeleton.joint(f"{side}_thigh")] for side in feet])
    ankles = np.array([foot.ankle for foot in feet.values()])
    pelvis = lower_pelvis(pelvis, pelvis_rotation, hips, ankles, is_cyclic, frames=8)
    for side, foot in feet.items():
        bend_leg(skeleton, side, pelvis, pelvis_rotation, foot, rotation)
    for name, share in SPINE_SHARE.items():
        bend = multiply(about(2, -share * drop), about(0, share * 0.7 * stance.lean))
        rotation[:, skeleton.joint(name)] = multiply(about(1, share * 0.7 * stance.turn), bend)
    for name, share in NECK_SHARE.items():
        tip = multiply(about(2, share * stance.tilt), about(0, share * (stance.nod - stance.lean)))
        rotation[:, skeleton.joint(name)] = multiply(about(1, share * (stance.look - stance.turn)), tip)
    for side, arm in (("left", stance.left), ("right", stance.right)):
        ahead, away, elbow, inward, twist = arm
        pose_arm(skeleton, side, ahead, away, elbow, rotation, inward, twist)
        sign = 1.0 if side == "left" else -1.0
        rotation[:, skeleton.joint(f"{side}_clavicle")] = about(2, sign * stance.shrug)
        curl_fingers(skeleton, side, 1.0, rotation)
        for finger in FINGERS:
            for number in (1, 2, 3):
                joint = skeleton.joint(f"{side}_{finger}_{number}")
                angle = -2.0 * np.arctan2(rotation[:, joint, 3], rotation[:, joint, 0]) * sign
                rotation[:, joint] = about(2, -sign * angle * stance.curl[side])
    return rotation, pelvis


def to_clip(
    skeleton: Skeleton, shape: GaitShape, name: str, kind: ClipKind, stance: Stance, mask: JointMask
) -> Clip:
    """Make a clip of a standing person."""
    is_cyclic = kind is ClipKind.IDLE
    rotation, pelvis = build_stance(skeleton, shape, stance, is_cyclic)
    count = len(stance.time)
    return Clip(
        name,
        kind,
        FRAME_RATE,
        continuous(rotation).astype(np.float32),
        pelvis.astype(np.float32),
        np.zeros((count, 3)),
        np.zeros(count),
        is_cyclic=is_cyclic,
        mask=mask,
    )


# ---- idle variations: seconds and what they do to the neutral stance


def idle(stance: Stance) -> None:
    """Stand with a slight sway."""
    stance.shift += stance.wave(12.0, 0.008)
    stance.turn += stance.wave(12.0, 0.02, 0.2)
    stance.look += stance.wave(6.0, 0.03, 0.1)


def shift_weight(stance: Stance) -> None:
    """Rest on one leg, then on the other."""
    left, right = stance.bump(0.8, 4.6, 1.2), stance.bump(5.6, 9.6, 1.2)
    stance.shift += 0.045 * (left - right)
    stance.turn += 0.08 * (right - left)
    stance.look += 0.15 * right - 0.10 * left
    stance.right[2] += 0.15 * left
    stance.left[2] += 0.15 * right


def look_about(stance: Stance) -> None:
    """Look to one side and the other, the chest following a little."""
    left, right = stance.bump(0.7, 3.0), stance.bump(4.6, 7.4)
    stance.look += 0.75 * left - 0.65 * right
    stance.turn += 0.16 * left - 0.14 * right
    stance.shift += 0.015 * right
    stance.nod += 0.06 * left


def hands_on_hips(stance: Stance) -> None:
    """Hands on the hips for a while."""
    up = stance.bump(0.6, 8.6, 0.9)
    for arm in (stance.left, stance.right):
        arm[0] += -0.35 * up
        arm[1] += 0.75 * up
        arm[2] += 1.45 * up
        arm[3] += 0.55 * up
    stance.look += 0.25 * stance.bump(3.0, 5.0)
    stance.shift += 0.02 * up


def arms_folded(stance: Stance) -> None:
    """Arms folded before the chest for a while."""
    up = stance.bump(0.6, 9.4, 1.0)
    for arm, more in ((stance.left, 0.0), (stance.right, 0.12)):
        arm[0] += (0.42 + more) * up
        arm[1] += 0.08 * up
        arm[2] += (1.55 - more) * up
        arm[3] += 1.05 * up
    stance.look += 0.3 * stance.bump(2.5, 4.5) - 0.25 * stance.bump(6.0, 7.6)
    stance.shift -= 0.025 * up
    stance.lean -= 0.03 * up


# ---- gestures


def wave(stance: Stance) -> None:
    """Raise the right hand and wave."""
    up = stance.bump(0.0, 2.3, RAISE_SECONDS)
    stance.right[0] += 0.35 * up
    stance.right[1] += 1.35 * up
    stance.right[2] += (1.55 + 0.28 * np.sin(2.0 * np.pi * 2.0 * stance.time)) * up
    stance.right[3] += -1.75 * up
    stance.curl["right"] -= 0.8 * up
    stance.look += -0.12 * up


def talk(stance: Stance) -> None:
    """Talk with both hands."""
    up = stance.bump(0.0, 4.0, RAISE_SECONDS)
    beat = np.sin(2.0 * np.pi * 0.9 * stance.time)
    other = np.sin(2.0 * np.pi * 0.7 * stance.time + 1.0)
    for arm, move in ((stance.left, beat), (stance.right, other)):
        arm[0] += (0.22 + 0.12 * move) * up
        arm[1] += (0.10 + 0.06 * move) * up
        arm[2] += (1.05 + 0.25 * move) * up
        arm[3] += (0.25 - 0.18 * move) * up
        arm[4] += (0.5 + 0.3 * move) * up
    for side in stance.curl:
        stance.curl[side] -= 0.5 * up
    stance.nod += 0.05 * beat * up
    stance.look += 0.08 * other * up


def point(stance: Stance) -> None:
    """Point ahead with the right arm, and look there."""
    up = stance.bump(0.0, 1.8, RAISE_SECONDS)
    stance.right[0] += 1.38 * up
    stance.right[1] += -0.05 * up
    stance.right[2] += -0.14 * up
    stance.look += -0.15 * up
    stance.turn += 0.06 * up


def look_around(stance: Stance) -> None:
    """Turn the head to both sides."""
    stance.look += 0.8 * stance.bump(0.1, 1.3, 0.5) - 0.7 * stance.bump(2.1, 3.3, 0.5)


def nod(stance: Stance) -> None:
    """Nod twice."""
    stance.nod += 0.13 * (1.0 - np.cos(2.0 * np.pi * 1.25 * stance.time)) * stance.bump(0.0, 1.5, 0.3)


def shrug(stance: Stance) -> None:
    """Lift shoulders and open hands."""
    up = stance.bump(0.0, 0.9, 0.45)
    stance.shrug += 0.28 * up
    stance.tilt += 0.10 * up
    for arm in (stance.left, stance.right):
        arm[0] += 0.05 * up
        arm[1] += 0.22 * up
        arm[2] += 1.0 * up
        arm[3] += -0.45 * up
        arm[4] += 0.9 * up


def applaud(stance: Stance) -> None:
    """Clap the hands."""
    up = stance.bump(0.0, 3.0, RAISE_SECONDS)
    clap = 0.5 - 0.5 * np.cos(2.0 * np.pi * 2.5 * stance.time)
    for arm in (stance.left, stance.right):
        arm[0] += 0.45 * up
        arm[2] += 1.25 * up
        arm[3] += (0.62 - 0.20 * clap) * up
    for side in stance.curl:
        stance.curl[side] -= 0.7 * up


def check_phone(stance: Stance) -> None:
    """Hold a phone before the chest and read it."""
    up = stance.bump(0.0, 4.0, 0.7)
    stance.right[0] += 0.42 * up
    stance.right[2] += 1.5 * up
    stance.right[3] += 0.55 * up
    stance.right[4] += 0.4 * up
    stance.nod += 0.45 * up
    stance.look += 0.06 * up
    stance.curl["right"] += 0.6 * up


# ---- postures, kept as long as something is carried


def carry_right(stance: Stance) -> None:
    """Carry something before the body with the right hand."""
    stance.right[0] += 0.12
    stance.right[1] += 0.02
    stance.right[2] += 1.30
    stance.right[3] += 0.10


def carry_left(stance: Stance) -> None:
    """Carry something before the body with the left hand."""
    stance.left[0] += 0.12
    stance.left[1] += 0.02
    stance.left[2] += 1.30
    stance.left[3] += 0.10


# ---- sitting


def sit_down(stance: Stance) -> None:
    """Lean ahead, sink onto a seat 0.45 m high, and sit upright with the hands on the thighs."""
    down = minimum_jerk((stance.time - 0.15) / 1.15)
    lean = minimum_jerk(stance.time / 0.8) * (1.0 - minimum_jerk((stance.time - 0.75) / 0.75))
    stance.back += SEAT_BEHIND * minimum_jerk((stance.time - 0.10) / 1.05)
    standing = standing_in_place().pelvis_height + PELVIS_RISE * STATURE + STANDING_RISE
    stance.sink += (standing - SEATED_PELVIS) * down
    stance.lean += 0.85 * lean
    stance.nod += 0.15 * lean
    for arm in (stance.left, stance.right):
        arm[0] += 0.42 * down
        arm[1] += 0.02 * down
        arm[2] += 0.42 * down
        arm[3] += 0.15 * down


Change = Callable[[Stance], None]
IDLES: dict[str, tuple[Change, float]] = {
    "idle": (idle, 12.0),
    "shift_weight": (shift_weight, 12.0),
    "look_about": (look_about, 9.0),
    "hands_on_hips": (hands_on_hips, 11.0),
    "arms_folded": (arms_folded, 12.0),
}
GESTURES: dict[str, tuple[Change, float, JointMask]] = {
    "wave": (wave, 3.2, JointMask.UPPER_BODY),
    "talk": (talk, 4.9, JointMask.UPPER_BODY),
    "point": (point, 2.6, JointMask.UPPER_BODY),
    "look_around": (look_around, 4.1, JointMask.HEAD),
    "nod": (nod, 2.0, JointMask.HEAD),
    "shrug": (shrug, 1.6, JointMask.UPPER_BODY),
    "applaud": (applaud, 3.9, JointMask.ARMS),
    "check_phone": (check_phone, 5.0, JointMask.UPPER_BODY),
}
POSTURES: dict[str, tuple[Change, float, JointMask]] = {
    "carry_right": (carry_right, 2.0, JointMask.RIGHT_ARM),
    "carry_left": (carry_left, 2.0, JointMask.LEFT_ARM),
}
SIT_DOWN: tuple[Change, float] = (sit_down, 1.6)
