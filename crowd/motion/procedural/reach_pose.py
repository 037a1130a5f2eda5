"""The posture of a reaching person: the numbers that make it, and the most comfortable ones for a target.

Feet stay where standing people have them; everything else moves: the pelvis sinks, shifts and turns, knees
and hips bend, heels may rise, the back bends and turns, the other arm balances.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from crowd.motion.body import ANKLE_HEIGHT, BALL_AHEAD, FINGERS, PELVIS_RISE, STATURE
from crowd.motion.procedural.feet import FootPath
from crowd.motion.procedural.legs import LONGEST, bend_leg
from crowd.motion.procedural.shape import GaitShape, standing_in_place
from crowd.motion.procedural.upper_body import NECK_SHARE, SPINE_SHARE, curl_fingers
from crowd.motion.rotation import about, conjugate, from_vector, multiply, rotate
from crowd.motion.skeleton import Skeleton

FloatArray = npt.NDArray[np.float64]

NUMBERS = (
    "shift",
    "height",
    "ahead",
    "pelvis_yaw",
    "pelvis_pitch",
    "pelvis_roll",
    "back_yaw",
    "back_pitch",
    "back_roll",
    "clavicle_rise",
    "clavicle_ahead",
    "arm_swing_x",
    "arm_swing_z",
    "arm_twist",
    "elbow",
    "near_heel",
    "far_heel",
    "other_swing_x",
    "other_swing_z",
    "neck_yaw",
    "neck_pitch",
    "forearm_twist",
    "other_elbow",
    "curl",
)
"""Names of the numbers of a posture, in order; m and rad. They describe a reach of the right hand."""
COLUMN = {name: column for column, name in enumerate(NUMBERS)}
SEARCHED = NUMBERS[: COLUMN["neck_yaw"]]
"""Numbers that the search for a comfortable posture changes; the others follow from them."""
BODY = ("shift", "height", "ahead", "pelvis_yaw", "pelvis_pitch", "pelvis_roll", "near_heel", "far_heel")
"""Numbers that stay with people who sit."""

EASE = {
    "shift": 0.09,
    "height": 0.22,
    "ahead": 0.12,
    "pelvis_yaw": 0.45,
    "pelvis_pitch": 0.45,
    "pelvis_roll": 0.16,
    "back_yaw": 0.38,
    "back_pitch": 0.45,
    "back_roll": 0.22,
    "clavicle_rise": 0.34,
    "clavicle_ahead": 0.16,
    "arm_swing_x": 1.5,
    "arm_swing_z": 1.1,
    "arm_twist": 0.45,
    "elbow": 0.7,
    "near_heel": 0.36,
    "far_heel": 0.36,
    "other_swing_x": 0.35,
    "other_swing_z": 0.30,
}
"""How far each number departs from standing at equal discomfort."""
RANGE = {
    "height": (0.47, 1.2),
    "pelvis_yaw": (-0.75, 0.75),
    "pelvis_pitch": (-0.15, 1.25),
    "pelvis_roll": (-0.25, 0.25),
    "back_yaw": (-0.75, 0.75),
    "back_pitch": (-0.30, 1.05),
    "back_roll": (-0.50, 0.50),
    "clavicle_rise": (-0.08, 0.50),
    "clavicle_ahead": (-0.28, 0.28),
    "arm_swing_x": (-2.25, 0.85),
    "arm_swing_z": (-2.1, 0.75),
    "arm_twist": (-1.1, 1.1),
    "elbow": (0.12, 2.3),
    "near_heel": (0.0, 0.75),
    "far_heel": (0.0, 0.75),
    "other_swing_x": (-1.2, 0.7),
    "other_swing_z": (0.02, 0.9),
}
COMFORTABLE_ELBOW = 0.55
"""Flexion at which an extended arm is at ease, rad."""
TIGHT = 0.015
"""Excess over a range at which it weighs as one unit of discomfort, rad or m."""
EXACT = 0.0008
"""Distance from the target that weighs as one unit, m."""
BALANCE = 0.022
"""Distance of the centre of mass from the middle of the feet that weighs as one unit, m."""
KNEE_RANGE, ANKLE_RANGE = 2.35, 0.48
NECK_YAW, NECK_DOWN, NECK_UP = 0.95, 0.55, 0.60
"""Greatest turns of neck and head together against the chest, rad."""
GAZE_SHARE = 0.75
"""Share of a look that neck and head take; eyes take the rest."""
SEAT_HEIGHT = 0.45
SEATED_PELVIS = SEAT_HEIGHT + 0.10
"""Height of the pelvis of a person who sits on the seat, m: seat and flesh under the hip joints."""
SEATED_BACK = 0.40
"""How far the pelvis of a seated person is behind the ankles, m."""

# Mass of the body as shares, and the place of each share between two joints: Winter, "Biomechanics and
# motor control of human movement", table of segments.
MASSES = (
    ("pelvis", "spine_3", 0.355, 0.55),
    ("spine_4", "neck_1", 0.142, 0.50),
    ("neck_2", "head", 0.081, 1.00),
    ("right_upper_arm", "right_forearm", 0.028, 0.44),
    ("right_forearm", "right_hand", 0.022, 0.68),
    ("left_upper_arm", "left_forearm", 0.028, 0.44),
    ("left_forearm", "left_hand", 0.022, 0.68),
    ("right_thigh", "right_shank", 0.100, 0.43),
    ("right_shank", "right_foot", 0.061, 0.60),
    ("left_thigh", "left_shank", 0.100, 0.43),
    ("left_shank", "left_foot", 0.061, 0.60),
)


@dataclass(frozen=True)
class Body:
    """A skeleton on its feet, or on a seat."""

    skeleton: Skeleton
    shape: GaitShape
    is_seated: bool

    def neutral(self) -> FloatArray:
        """Numbers of a person at rest, arms hanging; (24,)."""
        numbers = np.zeros(len(NUMBERS))
        if self.is_seated:
            rest = {"height": SEATED_PELVIS, "pelvis_pitch": -0.05, "back_pitch": 0.08, "elbow": 0.45}
        else:
            height = self.shape.pelvis_height + PELVIS_RISE * STATURE + 0.008
            rest = {"height": height, "pelvis_pitch": 0.009, "back_pitch": 0.021, "elbow": 0.26}
        rest |= {"arm_swing_x": -0.03, "arm_swing_z": -0.14, "arm_twist": 0.12}
        rest |= {"other_swing_x": -0.03, "other_swing_z": 0.14, "neck_pitch": -0.03, "curl": 1.0}
        rest["other_elbow"] = rest["elbow"]
        for name, value in rest.items():
            numbers[COLUMN[name]] = value
        return numbers

    def pose(self, numbers: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Turn numbers (F, 24) into local rotations (F, J, 4) and pelvis positions (F, 3)."""
        skeleton = self.skeleton
        value = {name: numbers[:, column] for name, column in COLUMN.items()}
        rotation = np.zeros((len(numbers), skeleton.joint_count, 4))
        rotation[..., 0] = 1.0
        pelvis = np.stack([value["shift"], value["height"], value["ahead"]], axis=1)
        rotation[:, 0] = multiply(
            about(1, value["pelvis_yaw"]),
            multiply(about(2, value["pelvis_roll"]), about(0, value["pelvis_pitch"])),
        )
        for side, path in self.feet(numbers).items():
            bend_leg(skeleton, side, pelvis, rotation[:, 0], path, rotation)
        for name, share in SPINE_SHARE.items():
            bend = multiply(about(2, share * value["back_roll"]), about(0, share * value["back_pitch"]))
            rotation[:, skeleton.joint(name)] = multiply(about(1, share * value["back_yaw"]), bend)
        for name, share in NECK_SHARE.items():
            turned = about(1, share * value["neck_yaw"])
            rotation[:, skeleton.joint(name)] = multiply(turned, about(0, share * value["neck_pitch"]))
        zero = np.zeros(len(numbers))
        for side in ("right", "left"):
            is_near = side == "right"
            x = value["arm_swing_x" if is_near else "other_swing_x"]
            z = value["arm_swing_z" if is_near else "other_swing_z"]
            twist = value["arm_twist"] if is_near else zero - 0.12
            swing = from_vector(np.stack([x, zero, z], axis=1))
            rotation[:, skeleton.joint(f"{side}_upper_arm")] = multiply(swing, about(1, twist))
            elbow = value["elbow" if is_near else "other_elbow"]
            turn = value["forearm_twist"] if is_near else zero
            rotation[:, skeleton.joint(f"{side}_forearm")] = multiply(about(0, -elbow), about(1, -turn))
            curl_fingers(skeleton, side, 1.0, rotation)
        rotation[:, skeleton.joint("right_clavicle")] = multiply(
            about(1, value["clavicle_ahead"]), about(2, -value["clavicle_rise"])
        )
        open_fingers(skeleton, value["curl"], rotation)
        return rotation, pelvis

    def feet(self, numbers: FloatArray) -> dict[str, FootPath]:
        """Ankles of feet on the ground whose heels may rise about the balls."""
        paths = {}
        count = len(numbers)
        for side, sign, heel in (("right", -1.0, "near_heel"), ("left", 1.0, "far_heel")):
            x, yaw = 0.5 * sign * self.shape.width, sign * self.shape.toe_out
            place = np.tile([x, ANKLE_HEIGHT * STATURE, self.shape.ankle_ahead], (count, 1))
            if self.is_seated:
                place[:, 2] += SEATED_BACK
            pitch = -numbers[:, COLUMN[heel]]
            ball = np.array([0.0, -ANKLE_HEIGHT * STATURE, BALL_AHEAD * STATURE])
            heading = about(1, np.full(count, yaw))
            ankle = place + rotate(heading, ball) - rotate(multiply(heading, about(0, -pitch)), ball)
            paths[side] = FootPath(ankle, pitch, np.full(count, yaw), np.zeros(count))
        return paths


def open_fingers(skeleton: Skeleton, curl: FloatArray, rotation: FloatArray) -> None:
    """Scale the curl of the right hand's resting fingers, frame by frame."""
    for joint, name in enumerate(skeleton.joint_names):
        if name.startswith("right_") and is_finger(name):
            angle = 2.0 * np.arctan2(rotation[:, joint, 3], rotation[:, joint, 0])
            rotation[:, joint] = about(2, angle * curl)


def is_finger(name: str) -> bool:
    """A joint is part of a finger."""
    return any(finger in name for finger in FINGERS)


def place_joints(
    skeleton: Skeleton, rotation: FloatArray, pelvis: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Joint positions (F, J, 3) and rotations (F, J, 4) in the root frame; fingers are left out."""
    turned, placed = rotation.copy(), np.zeros((*rotation.shape[:2], 3))
    placed[:, 0] = pelvis
    for joint in range(1, skeleton.joint_count):
        if is_finger(skeleton.joint_names[joint]):
            continue
        above = skeleton.parent[joint]
        placed[:, joint] = placed[:, above] + rotate(turned[:, above], skeleton.offset[joint])
        turned[:, joint] = multiply(turned[:, above], rotation[:, joint])
    return placed, turned


def centre_of_mass(skeleton: Skeleton, placed: FloatArray) -> FloatArray:
    """Centre of mass of poses, (F, 3)."""
    centre = np.zeros((len(placed), 3))
    for first, second, mass, share in MASSES:
        a, b = placed[:, skeleton.joint(first)], placed[:, skeleton.joint(second)]
        centre += mass * ((1.0 - share) * a + share * b)
    return centre


def first_guess(body: Body, target: FloatArray) -> FloatArray:
    """Numbers (T, 24) that turn a person roughly towards wrist targets (T, 3)."""
    numbers = np.tile(body.neutral(), (len(target), 1))
    azimuth = np.arctan2(target[:, 0], target[:, 2])
    azimuth = np.where(azimuth > 2.2, azimuth - 2.0 * np.pi, azimuth)
    turn = np.clip(azimuth + 0.3, -2.6, 1.2)
    numbers[:, COLUMN["back_yaw"]] = np.clip(0.25 * turn, -0.6, 0.6)
    if not body.is_seated:
        numbers[:, COLUMN["pelvis_yaw"]] = np.clip(0.22 * turn, -0.55, 0.55)
        low = np.clip((0.95 - target[:, 1]) / 0.85, 0.0, 1.0)
        numbers[:, COLUMN["height"]] -= 0.38 * low
        numbers[:, COLUMN["pelvis_pitch"]] += 0.45 * low
        numbers[:, COLUMN["back_pitch"]] += 0.45 * low
        numbers[:, COLUMN["near_heel"]] = numbers[:, COLUMN["far_heel"]] = 0.35 * low
    placed, turned = place_joints(body.skeleton, *body.pose(numbers))
    shoulder = placed[:, body.skeleton.joint("right_upper_arm")]
    chest = turned[:, body.skeleton.joint("right_clavicle")]
    way = rotate(conjugate(chest), target - shoulder)
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    angle = np.arccos(np.clip(-way[:, 1], -1.0, 1.0))
    # The arm hangs along -y; it swings about the horizontal axis across the way to the target.
    axis = np.stack([-way[:, 2], 0.0 * angle, way[:, 0]], axis=1)
    axis /= np.maximum(np.linalg.norm(axis, axis=1, keepdims=True), 1e-9)
    swing = axis * np.minimum(angle, 2.3)[:, None]
    numbers[:, COLUMN["arm_swing_x"]] = np.clip(swing[:, 0], -2.3, 0.7)
    numbers[:, COLUMN["arm_swing_z"]] = np.clip(swing[:, 2], -2.2, 0.6)
    numbers[:, COLUMN["elbow"]] = 0.6
    return numbers


def discomfort(body: Body, numbers: FloatArray, target: FloatArray) -> FloatArray:
    """Residuals (T, R) whose squares add up to the cost of a posture: missing the target costs most."""
    skeleton = body.skeleton
    rotation, pelvis = body.pose(numbers)
    placed, _ = place_joints(skeleton, rotation, pelvis)
    rest = body.neutral()
    rest[COLUMN["elbow"]] = COMFORTABLE_ELBOW
    terms = [(placed[:, skeleton.joint("right_hand")] - target) / EXACT]
    columns = [COLUMN[name] for name in SEARCHED]
    ease = np.array([EASE[name] for name in SEARCHED])
    terms.append((numbers[:, columns] - rest[columns]) / ease)
    for name, (lower, upper) in RANGE.items():
        number = numbers[:, COLUMN[name]]
        excess = np.maximum(lower - number, 0.0) + np.maximum(number - upper, 0.0)
        terms.append(excess[:, None] / TIGHT)
    if body.is_seated:
        return np.concatenate(terms, axis=1)
    middle = 0.4 * BALL_AHEAD * STATURE + body.shape.ankle_ahead
    centre = centre_of_mass(skeleton, placed)
    terms.append((centre[:, [0, 2]] - [0.0, middle]) / BALANCE)
    for side in ("right", "left"):
        hip, ankle = placed[:, skeleton.joint(f"{side}_thigh")], foot_target(body, numbers, side)
        stretch = np.linalg.norm(ankle - hip, axis=1) - LONGEST
        knee = 2.0 * np.arctan2(
            np.abs(rotation[:, skeleton.joint(f"{side}_shank"), 1]),
            rotation[:, skeleton.joint(f"{side}_shank"), 0],
        )
        foot = rotation[:, skeleton.joint(f"{side}_foot")]
        dorsiflexion = -2.0 * np.arctan2(foot[:, 1], foot[:, 0])
        for excess, unit in ((stretch, 0.002), (knee - KNEE_RANGE, 0.02), (dorsiflexion - ANKLE_RANGE, 0.02)):
            terms.append(np.maximum(excess, 0.0)[:, None] / unit)
    return np.concatenate(terms, axis=1)


def foot_target(body: Body, numbers: FloatArray, side: str) -> FloatArray:
    """Ankle that a leg shall come to, (T, 3)."""
    return body.feet(numbers)[side].ankle


def comfortable_numbers(body: Body, target: FloatArray, passes: int = 30) -> FloatArray:
    """Find the most comfortable posture whose right wrist is at each target.

    Parameters
    ----------
    body : Body
    target : (T, 3) float64
        Wrists in the root frame, m.
    passes : int
        Damped Gauss-Newton steps; all targets take them side by side.

    Returns
    -------
    (T, 24) float64

    Notes
    -----
    **Source:** reaching postures as minima of joint discomfort under balance (Yang, Marler, Kim, Arora,
    "Multi-objective optimization for upper body posture prediction", 2004).
    """
    numbers = first_guess(body, target)
    searched = [COLUMN[name] for name in SEARCHED if not (body.is_seated and name in BODY)]
    count, width, step = len(target), len(searched), 1e-5
    damping = np.full(count, 1e-2)
    residual = discomfort(body, numbers, target)
    for _ in range(passes):
        moved = np.repeat(numbers[:, None], width, axis=1)
        moved[:, np.arange(width), searched] += step
        ahead = discomfort(body, moved.reshape(-1, len(NUMBERS)), np.repeat(target, width, axis=0))
        slope = (ahead.reshape(count, width, -1) - residual[:, None]) / step
        matrix = slope @ slope.transpose(0, 2, 1)
        gradient = (slope @ residual[..., None])[..., 0]
        # Far too steep terms (missing the target) and gentle ones share one scale through their diagonal.
        diagonal = np.einsum("tii->ti", matrix)
        matrix = matrix + (damping[:, None] * diagonal)[:, :, None] * np.eye(width)
        trial = numbers.copy()
        trial[:, searched] -= np.clip(np.linalg.solve(matrix, gradient[..., None])[..., 0], -0.25, 0.25)
        after = discomfort(body, trial, target)
        is_better = (after**2).sum(axis=1) < (residual**2).sum(axis=1)
        numbers[is_better], residual[is_better] = trial[is_better], after[is_better]
        damping = np.clip(np.where(is_better, 0.3 * damping, 4.0 * damping), 1e-7, 1e3)
    return with_gaze(body, numbers, target)


def with_gaze(body: Body, numbers: FloatArray, target: FloatArray) -> FloatArray:
    """Add what follows from a posture: the look at the hand, the turn of the forearm, the open hand."""
    numbers = numbers.copy()
    skeleton = body.skeleton
    placed, turned = place_joints(skeleton, *body.pose(numbers))
    way = rotate(conjugate(turned[:, skeleton.joint("spine_4")]), target - placed[:, skeleton.joint("head")])
    yaw = GAZE_SHARE * np.arctan2(way[:, 0], np.maximum(way[:, 2], -0.5 * np.abs(way[:, 0])))
    pitch = -GAZE_SHARE * np.arctan2(way[:, 1], np.hypot(way[:, 0], way[:, 2]))
    numbers[:, COLUMN["neck_yaw"]] = NECK_YAW * np.tanh(yaw / NECK_YAW)
    limit = np.where(pitch > 0.0, NECK_DOWN, NECK_UP)
    numbers[:, COLUMN["neck_pitch"]] = limit * np.tanh(pitch / limit)
    # Hands come from above to what is low, and from the side to what is at eye height.
    low = np.clip((1.15 - target[:, 1]) / 0.6, 0.0, 1.0)
    numbers[:, COLUMN["forearm_twist"]] = 0.25 + 0.55 * low
    lift = np.linalg.norm(numbers[:, :3] - body.neutral()[:3], axis=1)
    numbers[:, COLUMN["other_elbow"]] += np.minimum(1.2 * lift, 0.6)
    numbers[:, COLUMN["curl"]] = 0.45
    return numbers


def standing_body(skeleton: Skeleton) -> Body:
    """A person on the feet of the idle clips."""
    return Body(skeleton, standing_in_place(), is_seated=False)


def seated_body(skeleton: Skeleton) -> Body:
    """A person on a seat 0.45 m high, root under the pelvis."""
    return Body(skeleton, standing_in_place(), is_seated=True)
