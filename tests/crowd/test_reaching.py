"""The built-in reaches: where hands come, that people stand firmly, and that left mirrors right."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from crowd.bench.reachers import angular_motion
from crowd.blending.reach_space import (
    BODY_RADIUS,
    LARGEST_GAP,
    SIDES,
    ReachSpace,
    blend_positions,
    control_points,
    hand_position,
)
from crowd.motion.body import build_skeleton, sole_points
from crowd.motion.clip import Clip, ClipKind, ReachLabels
from crowd.motion.mirror import mirrored
from crowd.motion.procedural.reach_pose import centre_of_mass, place_joints
from crowd.motion.procedural.reaching import seated_reaches, standing_reaches
from crowd.motion.rotation import rotate
from crowd_kernels.reach_blend import key_shares
from tests.oracles import reach as oracle

SKELETON = build_skeleton()
RIGHT = [clip for clip in standing_reaches() if clip.reach.side == "right"]
SEATED = [clip for clip in seated_reaches() if clip.reach.side == "right"]


@pytest.fixture(scope="module")
def space():
    parts = (standing_reaches(), seated_reaches())
    sets = [[clip for clip in part if clip.reach.side == side] for part in parts for side in SIDES]
    return ReachSpace.build(SKELETON, sets)


def joints(clip):
    return place_joints(
        SKELETON, clip.rotation_local.astype(np.float64), clip.pelvis_position_root.astype(np.float64)
    )


def apex_frame(clip):
    return round(clip.reach.apex * clip.frame_rate)


def every(clips):
    return pytest.mark.parametrize("clip", clips, ids=lambda clip: clip.name)


def test_there_are_enough_directions_heights_and_distances():
    assert len(RIGHT) >= 20
    heights = {round(clip.reach.hand_position[1], 1) for clip in RIGHT}
    assert min(heights) < 0.2
    assert max(heights) > 1.9
    assert len(heights) >= 4
    azimuth = np.degrees(
        [np.arctan2(clip.reach.hand_position[0], clip.reach.hand_position[2]) for clip in RIGHT]
    )
    assert azimuth.max() > 40
    assert azimuth.min() < -170


@every(RIGHT + SEATED)
def test_the_hand_is_where_the_label_says_at_the_apex(clip):
    placed, _ = joints(clip)
    hand = placed[apex_frame(clip), SKELETON.joint("right_hand")]
    assert np.linalg.norm(hand - clip.reach.hand_position) < 1e-3


@every(RIGHT + SEATED)
def test_the_hand_starts_and_ends_at_rest_and_moves_in_one_stroke(clip):
    placed, _ = joints(clip)
    hand = placed[:, SKELETON.joint("right_hand")]
    speed = np.linalg.norm(np.diff(hand, axis=0), axis=1) * clip.frame_rate
    assert 0.35 <= clip.reach.apex / clip.duration <= 0.5
    assert 0.45 <= clip.reach.apex <= 1.3
    assert speed[[0, -1]].max() < 0.05
    assert speed[apex_frame(clip)] < 0.05
    assert speed.max() < 3.2
    np.testing.assert_allclose(hand[0], hand[-1], atol=1e-3)


@every(RIGHT)
def test_feet_stay_and_the_body_is_balanced(clip):
    placed, turned = joints(clip)
    _, ball = sole_points()
    for side in SIDES:
        foot = SKELETON.joint(f"{side}_foot")
        point = placed[:, foot] + rotate(turned[:, foot], ball)
        assert np.abs(point - point[0]).max() < 2e-3
    centre = centre_of_mass(SKELETON, placed)
    assert np.abs(centre[:, 0]).max() < 0.13
    assert centre[:, 2].min() > -0.06
    assert centre[:, 2].max() < 0.16


@every(RIGHT)
def test_low_reaches_bend_the_whole_body(clip):
    if clip.reach.hand_position[1] < 0.2:
        assert 0.44 <= clip.pelvis_position_root[:, 1].min() <= 0.62


@every(SEATED)
def test_seated_people_keep_hips_and_legs(clip):
    assert np.ptp(clip.pelvis_position_root, axis=0).max() < 1e-6
    legs = [j for j, name in enumerate(SKELETON.joint_names) if "thigh" in name or "shank" in name]
    assert np.ptp(clip.rotation_local[:, legs], axis=0).max() < 1e-6


def test_left_examples_mirror_right_ones():
    by_name = {clip.name: clip for clip in standing_reaches()}
    for clip in RIGHT:
        other = by_name[clip.name.replace("_right", "_left")]
        image = mirrored(clip, SKELETON, other.name)
        np.testing.assert_array_equal(image.rotation_local, other.rotation_local)
        assert other.reach == image.reach


@pytest.mark.parametrize("part", range(4))
def test_no_place_between_examples_is_far_from_a_blend(space, part, rng):
    examples, pseudo = space.examples[part], space.pseudo[part]
    corners = pseudo.corners[rng.integers(0, len(pseudo.corners), 20_000)]
    hand = blend_positions(SKELETON, examples, corners, rng.dirichlet(np.ones(4), 20_000))
    hand = hand[np.hypot(hand[:, 0], hand[:, 2]) > BODY_RADIUS]
    gap, _ = cKDTree(pseudo.point).query(hand)
    assert gap.max() <= LARGEST_GAP


def test_blends_come_near_to_what_is_asked(space, rng):
    for part in range(4):
        pseudo = space.pseudo[part]
        asked = pseudo.point[rng.integers(0, len(pseudo.point), 2000)] + rng.normal(0, 0.01, (2000, 3))
        clip, weight = space.locate(part, asked)
        first = sum(len(examples.clips) for examples in space.examples[:part])
        rotation = np.einsum(
            "ps,psjc->pjc", weight, space.examples[part].rotation[(clip - first) * (weight > 0)]
        )
        rotation /= np.linalg.norm(rotation, axis=2, keepdims=True)
        pelvis = np.einsum("ps,psc->pc", weight, space.examples[part].pelvis[(clip - first) * (weight > 0)])
        hand = hand_position(SKELETON, space.examples[part].side, rotation, pelvis)
        error = np.linalg.norm(hand - asked, axis=1)
        assert np.percentile(error, 90) < 0.04


def played(space, number, rate):
    """Rotations (F, J, 4) and pelvis (F, 3) of an example as it is blended, `rate` times a second."""
    keys = space.keys
    course = np.linspace(0.0, 2.0, round(keys.end_time[number] * rate) + 1)
    time = np.linspace(0.0, keys.end_time[number], len(course))
    apex, end = keys.apex_time[number], keys.end_time[number]
    course = np.where(time <= apex, time / apex, 1.0 + (time - apex) / (end - apex))
    poses = [oracle.blend(keys, {number: 1.0}, at) for at in course]
    return np.array([pose for pose, _ in poses]), np.array([pelvis for _, pelvis in poses])


@pytest.mark.parametrize("number", [0, 7, 19])
def test_curves_go_through_the_frames_of_examples(space, number):
    clip = space.examples[0].clips[number]
    rotation, pelvis = played(space, number, clip.frame_rate)
    frames = clip.rotation_local[:, space.keys.joint]
    cosine = np.abs((rotation * frames).sum(axis=2)).min()
    assert np.degrees(2.0 * np.arccos(min(cosine, 1.0))) < 0.5
    assert np.abs(pelvis - clip.pelvis_position_root).max() < 1e-3


@pytest.mark.parametrize("rate", [60, 77, 240])
@pytest.mark.parametrize("number", [0, 7, 19])
def test_examples_do_not_accelerate_more_however_often_they_are_drawn(space, number, rate):
    clip = space.examples[0].clips[number]
    frames = clip.rotation_local[:, space.keys.joint].astype(np.float64)
    _, wanted = angular_motion(frames[:, None], 1.0 / clip.frame_rate)
    _, found = angular_motion(played(space, number, rate)[0][:, None], 1.0 / rate)
    assert found < 1.1 * wanted


@pytest.mark.parametrize("rate", [25.0, 120.0])
@pytest.mark.parametrize("seconds", [0.1, 0.5])
def test_curves_meet_frames_of_clips_of_any_rate_that_begin_and_end_while_moving(rate, seconds):
    count = round(seconds * rate) + 1
    time = np.arange(count) / rate
    frames = np.stack([time, 0.3 * np.sin(6.0 * time)], axis=1).astype(np.float32)
    still = np.zeros((count, 3), np.float32)
    upright = np.tile([1.0, 0.0, 0.0, 0.0], (count, 1, 1)).astype(np.float32)
    label = ReachLabels("right", 0.05, (0.0, 1.0, 0.0))
    heading = np.zeros(count)
    clip = Clip("reach", ClipKind.REACH, rate, upright, still, still, heading, is_cyclic=False, reach=label)
    points = control_points(frames, clip)
    curve = []
    for place in np.linspace(0.0, len(points) - 1.0, count):
        first, *shares = key_shares(place, len(points))
        curve.append(np.dot(shares, points[first : first + 3]))
    np.testing.assert_allclose(curve, frames, atol=2e-3)
    np.testing.assert_allclose(np.array(curve)[[0, -1]], frames[[0, -1]], atol=1e-5)
