"""Poses of the hand, and the segments of its fingers."""

import numpy as np
import pytest

from crowd.motion.body import build_skeleton
from crowd.motion.hand import HAND_LENGTH, POSES, hand_pose, hand_table, segment_ends
from crowd.motion.rotation import rotate, to_vector

SKELETON = build_skeleton()
TABLE = hand_table(SKELETON)
THUMB, INDEX, MIDDLE, RING, LITTLE = range(5)


def posed(name, side=1):
    """Ends of all segments in a pose, (15, 2, 3)."""
    still = TABLE._replace(
        open_rotation=np.stack([[hand_pose(SKELETON, side, name) for side in ("right", "left")]]),
        sweep=np.zeros((1, 2, 15, 3)),
    )
    return segment_ends(still, side, 0, np.zeros(15))


def distance(first, second, samples=60):
    """Of two segments."""
    share = np.linspace(0, 1, samples)[:, None]
    a, b = (start + share * (end - start) for start, end in (first, second))
    return np.linalg.norm(a[:, None] - b[None], axis=2).min()


@pytest.mark.parametrize("name", POSES)
def test_left_mirrors_right(name):
    assert np.allclose(posed(name, 1) * [-1, 1, 1], posed(name, 0), atol=1e-12)


@pytest.mark.parametrize("name", POSES)
def test_neighbouring_fingers_do_not_run_into_each_other(name):
    ends = posed(name)
    for finger in (INDEX, MIDDLE, RING):
        for part in range(3):
            first, second = 3 * finger + part, 3 * finger + 3 + part
            # Fingers that lie side by side may press on each other by 3 mm.
            room = TABLE.radius[first] + TABLE.radius[second] - 0.003
            assert distance(ends[first], ends[second]) > room


def test_an_open_hand_leaves_the_plane_of_its_palm_free():
    ends = posed("open")
    depth = -ends[..., 0].min(axis=1) + TABLE.radius
    assert depth.max() < TABLE.palm_depth


def test_a_closed_hand_is_a_fist_with_the_thumb_before_the_fingers():
    ends = posed("closed")
    palm = np.array([-TABLE.palm_depth, -0.05, 0.0])
    for finger in (INDEX, MIDDLE, RING, LITTLE):
        assert np.linalg.norm(ends[3 * finger + 2, 1] - palm) < 0.05, "tips are in the palm"
    thumb = ends[2, 1]
    assert thumb[0] < ends[3 * INDEX + 1].mean(axis=0)[0] + 0.02, "in front of the fingers"
    assert thumb[2] < ends[0, 0, 2], "on their side"


def test_a_pinch_brings_thumb_and_finger_tips_together():
    ends = posed("pinch")
    for finger in (INDEX, MIDDLE):
        gap = distance(ends[2], ends[3 * finger + 2]) - TABLE.radius[2] - TABLE.radius[3 * finger + 2]
        assert gap < 0.012
    across = ends[2, 1] - ends[2, 0]
    other = ends[3 * INDEX + 2, 1] - ends[3 * INDEX + 2, 0]
    assert across @ other / np.linalg.norm(across) / np.linalg.norm(other) > -0.3, "tips side by side"


def test_a_pointing_hand_has_one_straight_finger():
    ends = posed("point")
    length = np.linalg.norm(ends[5, 1] - ends[3, 0])
    assert length > 0.98 * np.linalg.norm(ends[3:6, 1] - ends[3:6, 0], axis=1).sum()
    assert np.linalg.norm(ends[8, 1] - ends[6, 0]) < 0.06


@pytest.mark.parametrize("name", POSES)
def test_joints_stay_within_their_limits(name):
    for side, side_name in enumerate(("right", "left")):
        turned = np.degrees(to_vector(hand_pose(SKELETON, side_name, name)))
        low = np.degrees(SKELETON.limit_lower[TABLE.joint[side]])
        high = np.degrees(SKELETON.limit_upper[TABLE.joint[side]])
        assert (turned >= low - 1e-6).all()
        assert (turned <= high + 1e-6).all()


def test_segments_have_the_lengths_of_published_bones():
    length = np.linalg.norm(TABLE.tip[1], axis=1) / HAND_LENGTH
    assert length[3:6] == pytest.approx([0.210, 0.118, 0.084 - 0.003 / HAND_LENGTH], abs=2e-3)
    assert length[6:8] == pytest.approx([0.236, 0.139], abs=2e-3)
    reach = rotate(hand_pose(SKELETON, "left", "open")[0], TABLE.tip[1, 0])
    assert reach[2] > 0, "the open thumb points to its side"
