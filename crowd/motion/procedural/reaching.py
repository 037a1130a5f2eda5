"""Reaches of one hand with the whole body: floor to overhead, across to behind, far and close.

Each clip goes from rest to the posture with the wrist at its target and back to rest. All numbers of the
posture pass between the two along minimum-jerk curves, the look a little earlier than the rest.
"""

from dataclasses import replace
from functools import cache

import numpy as np
import numpy.typing as npt

from crowd.motion.body import build_skeleton
from crowd.motion.clip import Clip, ClipKind, ReachLabels
from crowd.motion.easing import minimum_jerk
from crowd.motion.mirror import mirrored
from crowd.motion.procedural.gait import FRAME_RATE
from crowd.motion.procedural.reach_pose import (
    COLUMN,
    Body,
    comfortable_numbers,
    place_joints,
    seated_body,
    standing_body,
)
from crowd.motion.rotation import continuous

FloatArray = npt.NDArray[np.float64]

DIRECTIONS = {"across": 52.0, "ahead": 8.0, "oblique": -42.0, "side": -92.0, "back": -136.0, "behind": -176.0}
"""Azimuth of the right wrist from straight ahead, left positive, deg; behind comes by a turn to the right."""
SHARE_OF_WAY = {"across": 0.94, "ahead": 1.0, "oblique": 1.0, "side": 1.0, "back": 0.88, "behind": 0.78}
"""Distances in each direction over those ahead."""
STANDING = {
    "floor": (0.13, {"far": 0.52, "close": 0.30}),
    "low": (0.70, {"far": 0.63, "close": 0.33}),
    "middle": (1.25, {"far": 0.76, "close": 0.34}),
    "high": (1.72, {"far": 0.62}),
    "overhead": (1.98, {"far": 0.32}),
}
"""Heights of the wrist and its distances from the root's axis, m."""
SEATED = {
    "low": (0.42, {"far": 0.50}),
    "table": (0.74, {"far": 0.62, "close": 0.32}),
    "middle": (1.02, {"far": 0.66}),
    "high": (1.34, {"far": 0.42}),
}
CLOSE_DIRECTIONS = ("across", "ahead", "oblique", "side", "back")
"""Directions in which something can be close without being inside the body's own turn."""
SHORTEST, SECONDS_PER_METRE = 0.45, 0.55
"""Time to the apex: a fixed share, and one for the way of the wrist (speed grows with distance), s, s/m."""
LONGEST_TO_APEX = 1.30
APEX_SHARE = 0.46
"""Apex as a share of the clip: people go back a little more slowly."""
GAZE_LEAD = 0.82
"""Share of the time to the apex in which the head is there."""
BEND_ON_THE_WAY = 0.30
"""How much farther the elbow bends on the way, per rad of the shoulder's swing, rad."""
AWAY_ON_THE_WAY = 0.12
"""How much farther from the body the arm is on the way to what is low or behind, rad."""


@cache
def standing_reaches() -> tuple[Clip, ...]:
    """Make the examples of a standing person, for both hands, on the built-in skeleton."""
    return reaches(standing_body(build_skeleton()), STANDING, "reach")


@cache
def seated_reaches() -> tuple[Clip, ...]:
    """Make the examples of a person on a seat 0.45 m high, for both hands; hips, legs and feet stay."""
    return reaches(seated_body(build_skeleton()), SEATED, "seated_reach")


def reaches(
    body: Body, elevations: dict[str, tuple[float, dict[str, float]]], prefix: str
) -> tuple[Clip, ...]:
    """Make one clip for each elevation, direction and distance with the right hand, and its mirror image."""
    names, targets = [], []
    for elevation, (height, distances) in elevations.items():
        for distance, way in distances.items():
            for direction, azimuth in DIRECTIONS.items():
                if distance == "close" and direction not in CLOSE_DIRECTIONS:
                    continue
                # Nobody who sits turns right round.
                if body.is_seated and direction == "behind":
                    continue
                angle, radius = np.radians(azimuth), way * SHARE_OF_WAY[direction]
                names.append(f"{prefix}_{elevation}_{direction}_{distance}")
                targets.append((radius * np.sin(angle), height, radius * np.cos(angle)))
    apex = comfortable_numbers(body, np.array(targets))
    right = [clip(body, name, numbers) for name, numbers in zip(names, apex, strict=True)]
    return tuple(
        made
        for example in right
        for made in (
            replace(example, name=f"{example.name}_right"),
            mirrored(example, body.skeleton, f"{example.name}_left"),
        )
    )


def clip(body: Body, name: str, apex: FloatArray) -> Clip:
    """Make the clip of one reach from the numbers of its apex, (24,)."""
    skeleton, rest = body.skeleton, body.neutral()
    hand = skeleton.joint("right_hand")
    ends, _ = place_joints(skeleton, *body.pose(np.stack([rest, apex])))
    way = float(np.linalg.norm(ends[1, hand] - ends[0, hand]))
    to_apex = min(SHORTEST + SECONDS_PER_METRE * way, LONGEST_TO_APEX)
    intervals = round(to_apex * FRAME_RATE)
    count = round(intervals / APEX_SHARE)
    frame = np.arange(count + 1)
    progress = np.where(frame <= intervals, frame / intervals, (count - frame) / (count - intervals))
    risen = minimum_jerk(progress)[:, None]
    numbers = rest + risen * (apex - rest)
    for column in (COLUMN["neck_yaw"], COLUMN["neck_pitch"]):
        early = minimum_jerk(progress / GAZE_LEAD)
        numbers[:, column] = rest[column] + early * (apex[column] - rest[column])
    on_the_way = 64.0 * (progress * (1.0 - progress)) ** 3
    swing = np.hypot(apex[COLUMN["arm_swing_x"]], apex[COLUMN["arm_swing_z"]])
    numbers[:, COLUMN["elbow"]] += BEND_ON_THE_WAY * swing * on_the_way
    numbers[:, COLUMN["arm_swing_z"]] -= AWAY_ON_THE_WAY * on_the_way
    rotation, pelvis = body.pose(numbers)
    left, up, ahead = (float(value) for value in ends[1, hand])
    return Clip(
        name,
        ClipKind.REACH,
        FRAME_RATE,
        continuous(rotation).astype(np.float32),
        pelvis.astype(np.float32),
        np.zeros((count + 1, 3)),
        np.zeros(count + 1),
        is_cyclic=False,
        reach=ReachLabels("right", intervals / FRAME_RATE, (left, up, ahead)),
    )
