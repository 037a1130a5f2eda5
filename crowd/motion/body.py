"""The built-in skeleton from published proportions, and how people differ from it."""

import numpy as np
import numpy.typing as npt

from crowd.motion.skeleton import Segment, Skeleton
from crowd_kernels.random import normal

FloatArray = npt.NDArray[np.float64]

STATURE = 1.75

# Segment lengths as shares of stature: Drillis and Contini 1966, as printed in Winter, "Biomechanics and
# motor control of human movement". Trunk joints are spread over hip to shoulder, 0.288; joint
# centres of hips and shoulders lie inside the surface breadths.
THIGH, SHANK, ANKLE_HEIGHT = 0.245, 0.246, 0.039
UPPER_ARM, FOREARM, HAND = 0.186, 0.146, 0.108
HALF_HIP, HALF_SHOULDER = 0.050, 0.106
BALL_AHEAD, BALL_HEIGHT, HEEL_BEHIND = 0.074, 0.014, 0.035
PELVIS_RISE = 0.024
EYE_HEIGHT = 0.936

# Bones of the hand as shares of hand length: Buryanov and Kotiuk 2010. Metacarpal, proximal, middle, distal.
FINGERS = {
    "thumb": (0.244, 0.167, 0.115),
    "index": (0.360, 0.210, 0.118),
    "middle": (0.342, 0.236, 0.139),
    "ring": (0.307, 0.219, 0.136),
    "little": (0.284, 0.173, 0.096),
}
FINGER_SIDE = {"thumb": 0.17, "index": 0.14, "middle": 0.03, "ring": -0.08, "little": -0.18}
"""Place of a finger across the hand, towards the thumb, as share of hand length."""

# Ranges in degrees about x, y, z, left side; hips and shoulders flex about -x, knees about +x.
# Clinical norms of the AAOS with the engine's corrections for motion data.
LIMITS: dict[str, tuple[tuple[float, float], tuple[float, float], tuple[float, float]]] = {
    "spine": ((-8, 20), (-12, 12), (-10, 10)),
    "neck": ((-25, 28), (-40, 40), (-24, 24)),
    "head": ((-25, 28), (-40, 40), (-24, 24)),
    "eye": ((-35, 35), (-40, 40), (0, 0)),
    "clavicle": ((-10, 10), (-18, 18), (-8, 32)),
    "upper_arm": ((-180, 60), (-90, 90), (-45, 175)),
    "forearm": ((-152, 5), (-90, 90), (-10, 10)),
    "hand": ((-35, 35), (-20, 20), (-80, 80)),
    "thumb": ((-55, 55), (-75, 30), (-75, 40)),
    "finger": ((-25, 25), (-20, 20), (-110, 35)),
    "thigh": ((-125, 32), (-48, 48), (-32, 48)),
    "shank": ((-2, 142), (-10, 10), (-5, 5)),
    "foot": ((-32, 55), (-32, 32), (-32, 32)),
    "toe": ((-75, 42), (-5, 5), (-5, 5)),
}

PURPOSE_PROPORTION = 410
PROPORTION_SPREAD = {
    Segment.NECK_HEAD: 0.02,
    Segment.SHOULDER: 0.05,
    Segment.ARM: 0.025,
    Segment.HAND: 0.04,
    Segment.LEG: 0.02,
}
"""Standard deviation of a segment's length at equal stature, as a share (order of ANSUR II)."""


def build_skeleton() -> Skeleton:
    """Build the 56-joint skeleton: upright, arms hanging, all joint frames along the world's axes."""
    names: list[str] = []
    parents: list[int] = []
    offsets: list[tuple[float, float, float]] = []
    segments: list[int] = []

    def add(name: str, parent: str | None, offset: tuple[float, float, float], segment: Segment) -> None:
        names.append(name)
        parents.append(-1 if parent is None else names.index(parent))
        offsets.append(offset)
        segments.append(int(segment))

    hip = THIGH + SHANK + ANKLE_HEIGHT
    add("pelvis", None, (0.0, hip + PELVIS_RISE, 0.0), Segment.LEG)
    add_trunk(add)
    for side, sign in (("left", 1.0), ("right", -1.0)):
        add_arm(add, side, sign)
    for side, sign in (("left", 1.0), ("right", -1.0)):
        add(f"{side}_thigh", "pelvis", (sign * HALF_HIP, -PELVIS_RISE, 0.0), Segment.PELVIS)
        add(f"{side}_shank", f"{side}_thigh", (0.0, -THIGH, 0.0), Segment.LEG)
        add(f"{side}_foot", f"{side}_shank", (0.0, -SHANK, 0.0), Segment.LEG)
        add(f"{side}_toe", f"{side}_foot", (0.0, BALL_HEIGHT - ANKLE_HEIGHT, BALL_AHEAD), Segment.FOOT)
    lower, upper = joint_limits(names)
    return Skeleton(
        tuple(names),
        np.array(parents, np.int32),
        STATURE * np.array(offsets),
        np.array(segments, np.int32),
        lower,
        upper,
        STATURE,
    )


def add_trunk(add: object) -> None:
    """Add spine, neck, head and eyes."""
    assert callable(add)
    below = "pelvis"
    for number, (rise, ahead) in enumerate(
        ((0.045, -0.008), (0.057, 0.0), (0.063, -0.003), (0.065, -0.003)), 1
    ):
        add(f"spine_{number}", below, (0.0, rise, ahead), Segment.TORSO)
        below = f"spine_{number}"
    add("neck_1", "spine_4", (0.0, 0.070, 0.004), Segment.NECK_HEAD)
    add("neck_2", "neck_1", (0.0, 0.034, 0.008), Segment.NECK_HEAD)
    add("head", "neck_2", (0.0, 0.032, 0.008), Segment.NECK_HEAD)
    head_height = 0.554 + 0.045 + 0.057 + 0.063 + 0.065 + 0.070 + 0.034 + 0.032
    for side, sign in (("left", 1.0), ("right", -1.0)):
        add(f"{side}_eye", "head", (sign * 0.018, EYE_HEIGHT - head_height, 0.050), Segment.NECK_HEAD)


def add_arm(add: object, side: str, sign: float) -> None:
    """Add clavicle, arm, hand and fingers of one side; the palm faces the thigh, the thumb ahead."""
    assert callable(add)
    add(f"{side}_clavicle", "spine_4", (sign * 0.012, 0.043, 0.010), Segment.SHOULDER)
    add(
        f"{side}_upper_arm",
        f"{side}_clavicle",
        (sign * (HALF_SHOULDER - 0.012), -0.009, -0.010),
        Segment.SHOULDER,
    )
    add(f"{side}_forearm", f"{side}_upper_arm", (0.0, -UPPER_ARM, 0.0), Segment.ARM)
    add(f"{side}_hand", f"{side}_forearm", (0.0, -FOREARM, 0.0), Segment.ARM)
    for finger, (metacarpal, *bones) in FINGERS.items():
        across = FINGER_SIDE[finger] * HAND
        if finger == "thumb":
            base = (0.0, -0.35 * metacarpal * HAND, 0.6 * across)
            lengths = (metacarpal * 0.8, bones[0])
            steps = [(0.0, -0.78 * length * HAND, 0.62 * length * HAND) for length in lengths]
        else:
            base = (0.0, -metacarpal * HAND, across)
            steps = [(0.0, -length * HAND, 0.0) for length in bones]
        add(f"{side}_{finger}_1", f"{side}_hand", base, Segment.HAND)
        for number, step in enumerate(steps, 2):
            add(f"{side}_{finger}_{number}", f"{side}_{finger}_{number - 1}", step, Segment.HAND)


def joint_limits(names: list[str]) -> tuple[FloatArray, FloatArray]:
    """Lowest and highest rotation about x, y, z of each joint, rad; the right side mirrors the left."""
    ranges = np.zeros((len(names), 3, 2))
    for joint, name in enumerate(names):
        kind = next((kind for kind in LIMITS if kind in name), "finger")
        if name == "pelvis":
            ranges[joint] = np.array([[-180, 180]] * 3)
            continue
        ranges[joint] = LIMITS[kind]
        if name.startswith("right"):
            ranges[joint, 1:] = -ranges[joint, 1:, ::-1]
    return np.radians(ranges[..., 0]), np.radians(ranges[..., 1])


def draw_segment_scale(skeleton: Skeleton, stature: FloatArray, seed: int) -> npt.NDArray[np.float32]:
    """Draw proportions of people whose stature is given.

    Parameters
    ----------
    skeleton : Skeleton
    stature : (N,) float64
        m.
    seed : int
        Key of the draws.

    Returns
    -------
    (N, 8) float32
        Scale of joint offsets by `Segment`. Longer legs than usual come with a shorter trunk, so that stature
        is kept.
    """
    count = len(stature)
    scale = np.repeat((stature / skeleton.stature)[:, None], len(Segment), axis=1)
    for segment, spread in PROPORTION_SPREAD.items():
        draws = [normal(seed, character, 0, PURPOSE_PROPORTION + int(segment)) for character in range(count)]
        scale[:, segment] *= 1.0 + spread * np.clip(draws, -2.0, 2.0)
    leg_share = float(skeleton.offset[0, 1]) / skeleton.stature
    trunk = (stature - leg_share * skeleton.stature * scale[:, Segment.LEG]) / (
        (1.0 - leg_share) * skeleton.stature
    )
    scale[:, Segment.TORSO] = trunk
    # Sole and hips go with the leg: clips plant the sole of this skeleton.
    scale[:, Segment.FOOT] = scale[:, Segment.LEG]
    scale[:, Segment.PELVIS] = scale[:, Segment.LEG]
    return scale.astype(np.float32)


def leg_lengths() -> tuple[float, float]:
    """Thigh and shank of the built-in skeleton, m."""
    return THIGH * STATURE, SHANK * STATURE


def sole_points() -> tuple[FloatArray, FloatArray]:
    """Heel and ball of the sole in the foot's frame, m."""
    height = -ANKLE_HEIGHT * STATURE
    return np.array([0.0, height, -HEEL_BEHIND * STATURE]), np.array([0.0, height, BALL_AHEAD * STATURE])
