"""The hand: segments of the fingers, and its poses - open, relaxed, closed, pinch, point.

Angles are those of the left hand; the right one mirrors it. In the frame of a hand joint fingers point to -y,
the thumb's side is +z, and the back of the left hand is +x.
"""

import numpy as np
import numpy.typing as npt

from crowd.motion.body import FINGERS, HAND, STATURE
from crowd.motion.rotation import about, conjugate, from_vector, multiply, rotate, swing, to_vector
from crowd.motion.skeleton import Skeleton
from crowd_kernels.hand import HandTable
from crowd_kernels.lanes import LANES

FloatArray = npt.NDArray[np.float64]

SIDES = ("right", "left")
HAND_LENGTH = HAND * STATURE
LAST_BONE = {"thumb": 0.115, "index": 0.084, "middle": 0.092, "ring": 0.092, "little": 0.085}
"""Last bone of each finger as share of hand length: Buryanov and Kotiuk 2010."""
PULP = 0.004
"""Flesh before the last bone, m."""
RADIUS = {"thumb": (0.011, 0.010, 0.0095)} | dict.fromkeys(
    ("index", "middle", "ring", "little"), (0.009, 0.008, 0.007)
)
"""Radii of the segments, m, of a hand of this length."""
PALM_DEPTH = 0.014
"""Palm below the plane of the joints, m."""
PALM_HALF_WIDTH = 0.042

Bend = tuple[float, float, float, float]
Bends = dict[str, Bend]
Ways = tuple[tuple[float, float, float], ...]

POSES: dict[str, tuple[Bends, Ways]] = {
    "open": (
        {
            "index": (-0.10, 0.10, 0.05, 0.14),
            "middle": (-0.08, 0.10, 0.05, 0.03),
            "ring": (-0.08, 0.10, 0.05, -0.08),
            "little": (-0.10, 0.12, 0.05, -0.22),
        },
        ((0.00, -0.30, 0.95), (0.04, -0.42, 0.91), (0.07, -0.48, 0.87)),
    ),
    "relaxed": (
        {
            "index": (0.35, 0.50, 0.30, 0.05),
            "middle": (0.40, 0.55, 0.30, 0.00),
            "ring": (0.45, 0.60, 0.30, -0.03),
            "little": (0.50, 0.60, 0.30, -0.08),
        },
        ((-0.35, -0.74, 0.57), (-0.38, -0.80, 0.46), (-0.36, -0.85, 0.38)),
    ),
    "closed": (
        {
            "index": (1.35, 1.75, 1.00, -0.02),
            "middle": (1.45, 1.75, 1.00, 0.00),
            "ring": (1.50, 1.75, 1.00, 0.02),
            "little": (1.55, 1.70, 1.00, 0.06),
        },
        ((-0.87, -0.33, 0.37), (-0.76, -0.60, -0.25), (-0.42, -0.66, -0.62)),
    ),
    "pinch": (
        {
            "index": (0.95, 0.75, 0.45, 0.00),
            "middle": (1.00, 0.78, 0.45, 0.00),
            "ring": (1.10, 0.95, 0.45, 0.02),
            "little": (1.15, 1.05, 0.45, 0.05),
        },
        ((-0.80, -0.54, 0.26), (-0.72, -0.68, -0.12), (-0.55, -0.82, -0.15)),
    ),
    "point": (
        {
            "index": (-0.02, 0.08, 0.05, 0.02),
            "middle": (1.35, 1.70, 0.95, 0.00),
            "ring": (1.45, 1.70, 0.95, 0.02),
            "little": (1.50, 1.65, 0.95, 0.05),
        },
        ((-0.72, -0.62, 0.31), (-0.72, -0.66, -0.20), (-0.45, -0.70, -0.55)),
    ),
}
"""Fingers: flexion of three joints and spread towards the thumb, rad. Thumb: directions of its bones."""

STYLES: tuple[tuple[str, str], ...] = (("open", "closed"), ("open", "pinch"))
"""Pose from which and pose to which each style of grip closes: power, pinch."""


def hand_pose(skeleton: Skeleton, side: str, name: str) -> FloatArray:
    """Local rotations of the finger joints in a pose of the hand.

    Parameters
    ----------
    skeleton : Skeleton
    side : str
        ``"right"`` or ``"left"``.
    name : str
        ``"open"``, ``"relaxed"``, ``"closed"``, ``"pinch"`` or ``"point"``.

    Returns
    -------
    (15, 4) float64
        Thumb to little finger, from the palm outward.
    """
    bends, thumb = POSES[name]
    rotation = np.zeros((15, 4))
    along = _unit(skeleton.offset[skeleton.joint("left_thumb_2")])
    above = np.array([1.0, 0.0, 0.0, 0.0])
    for number, way in enumerate(thumb):
        turned = multiply(swing(rotate(above, along), _unit(np.array(way))), above)
        rotation[number] = multiply(conjugate(above), turned)
        above = turned
    for finger, name_of in enumerate(("index", "middle", "ring", "little"), 1):
        *flexion, spread = bends[name_of]
        for number, angle in enumerate(flexion):
            rotation[3 * finger + number] = about(2, -angle)
        rotation[3 * finger] = multiply(about(0, -spread), rotation[3 * finger])
    if side == "right":
        rotation = rotation * np.array([1.0, 1.0, -1.0, -1.0])
    return rotation


def hand_table(skeleton: Skeleton) -> HandTable:
    """Both hands of a skeleton for the kernels."""
    size = HAND_LENGTH
    shape = (2, 15)
    joint = np.zeros(shape, np.int32)
    offset, tip = np.zeros((2, *shape, 3))
    for side, side_name in enumerate(SIDES):
        for finger, name in enumerate(FINGERS):
            joints = [skeleton.joint(f"{side_name}_{name}_{number}") for number in (1, 2, 3)]
            last = _unit(skeleton.offset[joints[2]])
            length = LAST_BONE[name] * size + PULP - RADIUS[name][2]
            for number, at in enumerate(joints):
                row = 3 * finger + number
                joint[side, row] = at
                offset[side, row] = skeleton.offset[at]
                tip[side, row] = skeleton.offset[joints[number + 1]] if number < 2 else length * last
    radius = np.concatenate([RADIUS[name] for name in FINGERS])
    opened, sweep = np.zeros((len(STYLES), *shape, 4)), np.zeros((len(STYLES), *shape, 3))
    for style, (start, end) in enumerate(STYLES):
        for side, side_name in enumerate(SIDES):
            opened[style, side] = hand_pose(skeleton, side_name, start)
            closed = hand_pose(skeleton, side_name, end)
            sweep[style, side] = to_vector(multiply(conjugate(opened[style, side]), closed))
    lanes = np.zeros((len(STYLES), 2, 7, LANES), np.float32)
    lanes[..., :15] = np.concatenate([opened, sweep], axis=-1).swapaxes(-1, -2)
    pinch = np.zeros((2, 3))
    table = HandTable(
        joint, offset, tip, radius, opened, sweep,
        length=np.linalg.norm(tip, axis=-1), angle=np.linalg.norm(sweep, axis=-1), pinch_point=pinch,
        palm_depth=PALM_DEPTH, palm_half_width=PALM_HALF_WIDTH,
        nearest_grip=0.045, farthest_grip=0.075, thumb_clearance=0.030,
        pinch_half=0.020, span_half=0.062, segment_lanes=lanes.reshape(len(STYLES), 2, -1),
    )  # fmt: skip
    for side in range(2):
        ends = segment_ends(table, side, 1, np.ones(15))[:, 1]
        pinch[side] = 0.5 * ends[2] + 0.25 * (ends[5] + ends[8])
    return table


def segment_ends(table: HandTable, side: int, style: int, closure: FloatArray) -> FloatArray:
    """Ends of the axes of all segments in the frame of the hand joint, m. (15, 2, 3)."""
    ends = np.zeros((15, 2, 3))
    for finger in range(5):
        rotation, position = np.array([1.0, 0.0, 0.0, 0.0]), np.zeros(3)
        for row in range(3 * finger, 3 * finger + 3):
            position = position + rotate(rotation, table.offset[side, row])
            turn = from_vector(closure[row] * table.sweep[style, side, row])
            rotation = multiply(rotation, multiply(table.open_rotation[style, side, row], turn))
            ends[row] = position, position + rotate(rotation, table.tip[side, row])
    return ends


def _unit(vector: FloatArray) -> FloatArray:
    return np.asarray(vector / np.linalg.norm(vector))
