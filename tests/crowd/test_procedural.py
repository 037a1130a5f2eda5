"""The built-in motion library walks like people: planted feet, published timing and ranges, no seams."""

import math

import numpy as np
import pytest

from crowd.bench.reachers import angular_motion
from crowd.bench.sweep import largest_acceleration
from crowd.blending.parameter_space import ParameterSpace
from crowd.controllers.foot_lock import leg_arrays
from crowd.controllers.locomotion import COMMAND_LIMITS
from crowd.motion.body import STATURE, build_skeleton, draw_segment_scale
from crowd.motion.clip import TOE_ROLL, ClipKind, FootEvent
from crowd.motion.procedural import built_in_library
from crowd.motion.procedural.shape import walk_cycle
from crowd.motion.rotation import multiply, rotate
from tests.oracles.example_sets import dense_weights

LIBRARY = built_in_library()
SKELETON = LIBRARY.skeleton
LOCOMOTION = LIBRARY.of_kind(ClipKind.LOCOMOTION)
BY_NAME = {clip.name: clip for clip in LIBRARY.clips}
SIDES = ("right", "left")
STRIKES = (FootEvent.RHS, FootEvent.LHS)
LARGEST_FOOT_STEP = 0.07
"""By which a foot may move in a frame because a command changes, m."""
TOE_OFFS = (FootEvent.RTO, FootEvent.LTO)
FLATS = (FootEvent.RTS, FootEvent.LTS)


def kinematics(clip):
    """Joint positions (F, J, 3) and rotations (F, J, 4) in the root frame."""
    count = clip.frame_count
    rotation = np.zeros((count, SKELETON.joint_count, 4))
    position = np.zeros((count, SKELETON.joint_count, 3))
    rotation[:, 0], position[:, 0] = clip.rotation_local[:, 0], clip.pelvis_position_root
    for joint in range(1, SKELETON.joint_count):
        above = SKELETON.parent[joint]
        rotation[:, joint] = multiply(rotation[:, above], clip.rotation_local[:, joint].astype(float))
        position[:, joint] = position[:, above] + rotate(rotation[:, above], SKELETON.offset[joint])
    return position, rotation


def sole(clip, leg):
    """Heel, ball and tip of a foot in the world, (3, F, 3)."""
    position, rotation = kinematics(clip)
    points = leg_arrays(SKELETON).sole[leg]
    foot, toe = (SKELETON.joint(f"{SIDES[leg]}_{part}") for part in ("foot", "toe"))
    model = [
        position[:, foot] + rotate(rotation[:, foot], points[0]),
        position[:, foot] + rotate(rotation[:, foot], points[1]),
        position[:, toe] + rotate(rotation[:, toe], points[2]),
    ]
    half = 0.5 * clip.root_yaw
    heading = np.stack([np.cos(half), 0 * half, np.sin(half), 0 * half], axis=1)
    return np.array([clip.root_position + rotate(heading, point) for point in model])


def stances(clip, leg):
    """Frames of each stance that lies whole in the clip: (strike, flat, lift of the ball)."""
    events = [(time, event) for time, event in clip.foot_events]
    cycle = clip.cycle_duration
    for strike, event in events:
        if event is not STRIKES[leg]:
            continue
        later = {
            other: min((t for t, e in events if e is other and t > strike - 1e-9), default=np.inf)
            for other in FootEvent
        }
        lift = later[TOE_OFFS[leg]] - TOE_ROLL * cycle
        if lift < clip.duration:
            rate = clip.frame_rate
            yield math.ceil(strike * rate - 1e-6), later[FLATS[leg]] * rate, math.floor(lift * rate + 1e-6)


def flexion(clip, joint):
    """Angle about x, degrees: knees bend positive."""
    rotation = clip.rotation_local[:, SKELETON.joint(joint)].astype(float)
    return np.degrees(2 * np.arctan2(rotation[:, 1], rotation[:, 0]))


def test_there_are_the_kinds_of_example_that_locomotion_needs():
    assert len(LOCOMOTION) >= 20
    parameters = np.array([clip.parameters for clip in LOCOMOTION])
    assert parameters[:, 0].min() < -0.8
    assert parameters[:, 0].max() > 3.3
    assert np.degrees(parameters[:, 1].max()) > 100
    assert parameters[:, 2].max() > 1.0
    assert len(LIBRARY.of_kind(ClipKind.IDLE)) >= 4
    assert len(LIBRARY.of_kind(ClipKind.START)) >= 2
    assert len(LIBRARY.of_kind(ClipKind.STOP)) >= 2
    assert SKELETON.joint_count >= 50


@pytest.mark.parametrize("clip", LOCOMOTION, ids=lambda clip: clip.name)
def test_planted_feet_do_not_move_and_nothing_is_below_the_ground(clip):
    found = 0
    for leg in range(2):
        points = sole(clip, leg)
        for strike, flat, lift in stances(clip, leg):
            frames = np.arange(strike, lift + 1)
            heel = points[0, frames[frames <= flat]]
            ball = points[1, frames[frames > flat]]
            for planted in (heel, ball):
                if len(planted) > 1:
                    assert np.abs(planted - planted[0]).max() < 1e-3
            found += 1
        assert points[..., 1].min() > -0.012
    assert found >= 3


@pytest.mark.parametrize("clip", LOCOMOTION, ids=lambda clip: clip.name)
def test_parameters_are_those_of_the_root_and_the_loop_closes(clip):
    forward, turn, side = clip.parameters
    assert clip.root_yaw[-1] == pytest.approx(turn * clip.duration, abs=1e-9)
    step = np.diff(clip.root_position, axis=0)
    middle = 0.5 * (clip.root_yaw[1:] + clip.root_yaw[:-1])
    ahead = step[:, 0] * np.sin(middle) + step[:, 2] * np.cos(middle)
    left = step[:, 0] * np.cos(middle) - step[:, 2] * np.sin(middle)
    np.testing.assert_allclose(ahead * clip.frame_rate, forward, atol=1e-3)
    np.testing.assert_allclose(left * clip.frame_rate, side, atol=1e-3)
    dots = np.abs((clip.rotation_local[0] * clip.rotation_local[-1]).sum(axis=1))
    assert np.degrees(2 * np.arccos(np.clip(dots.min(), -1, 1))) < 0.5
    np.testing.assert_allclose(clip.pelvis_position_root[0], clip.pelvis_position_root[-1], atol=1e-4)
    loop = np.concatenate([clip.rotation_local[-4:-1], clip.rotation_local[:4]])[:, None]
    inside = largest_acceleration(clip.rotation_local[:, None], clip.frame_rate)
    assert largest_acceleration(loop, clip.frame_rate) < 1.05 * inside + 20


def feet_by_phase(clip, phases=40):
    """Where the feet are at equal phases of the first cycle, (phases, 2, 3), in the root frame."""
    position, _ = kinematics(clip)
    frame = np.linspace(0, clip.cycle_duration * clip.frame_rate, phases, endpoint=False).astype(int)
    return position[frame][:, [SKELETON.joint(f"{side}_foot") for side in SIDES]]


def test_what_a_command_changes_in_a_frame_moves_feet_little(rng):
    """No tetrahedron is so thin that a foot would be seen to jump as parameters pass through it."""
    parameters = np.array([clip.parameters for clip in LOCOMOTION])
    space = ParameterSpace.build(
        parameters, np.array([clip.cycle_duration for clip in LOCOMOTION]), [clip.name for clip in LOCOMOTION]
    )
    shares = rng.dirichlet(np.ones(4), (40, space.simplex_count))
    points = np.einsum("nsc,sca->nsa", shares, parameters[space.arrays.simplex]).reshape(-1, 3)
    feet = np.array([feet_by_phase(clip) for clip in LOCOMOTION]).reshape(len(LOCOMOTION), -1)

    def blended(at):
        return (dense_weights(space, at) @ feet).reshape(len(at), -1, 3)

    limits = COMMAND_LIMITS
    largest = np.array([limits.braking, limits.turn_acceleration, limits.side_acceleration]) / 60.0
    # A tenth of a frame, so that the step stays in thin tetrahedra, too.
    for step in np.diag(0.1 * largest):
        moved = np.linalg.norm(blended(points + step) - blended(points), axis=-1).max()
        assert moved < 0.1 * LARGEST_FOOT_STEP


@pytest.mark.parametrize("name", ["walk_slow", "walk", "walk_fast"])
def test_walks_have_the_timing_and_the_joints_of_people(name):
    clip = BY_NAME[name]
    speed, cycle = clip.parameters[0], clip.cycle_duration
    assert cycle == pytest.approx(walk_cycle(speed) / 0.95, rel=0.1), "stride law"
    strike = next(t for t, e in clip.foot_events if e is FootEvent.RHS)
    stance = (next(t for t, e in clip.foot_events if e is FootEvent.RTO) - strike) / cycle
    law = 0.5 * ((0.752 * cycle - 0.143) / cycle + (64.2 - 3.5 * speed) / 100)
    assert abs(stance - law) < 0.03
    assert stance > 0.5, "both feet are down for a while"
    knee = flexion(clip, "right_shank")
    one = knee[: round(cycle * clip.frame_rate)]
    swing = one[round(0.55 * len(one)) : round(0.95 * len(one))]
    assert 50 < swing.max() < 75
    assert -2 <= knee.min() < 15
    ankle = -flexion(clip, "right_foot")
    assert ankle.min() > -30
    assert ankle.max() < 30
    assert 0.005 < np.ptp(clip.pelvis_position_root[:, 1]) < 0.075
    arm, thigh = -flexion(clip, "right_upper_arm"), -flexion(clip, "right_thigh")
    assert 8 < np.ptp(arm) < 40
    assert np.corrcoef(arm, thigh)[0, 1] < -0.5, "arms swing against the legs"


@pytest.mark.parametrize("name", ["jog", "run"])
def test_runs_fly(name):
    clip = BY_NAME[name]
    strike = next(t for t, e in clip.foot_events if e is FootEvent.RHS)
    duty = (next(t for t, e in clip.foot_events if e is FootEvent.RTO) - strike) / clip.cycle_duration
    assert 0.25 < duty < 0.42
    assert flexion(clip, "right_shank").max() > 75
    assert flexion(clip, "right_forearm").max() < -60, "elbows are bent"


def test_left_and_right_examples_mirror_each_other():
    for clip in LOCOMOTION:
        if not clip.name.endswith("_left"):
            continue
        other = BY_NAME[clip.name.removesuffix("_left") + "_right"]
        half = (clip.frame_count - 1) // 4
        for joint in ("shank", "foot", "thigh"):
            mine = flexion(clip, f"left_{joint}")[:-1]
            theirs = np.roll(flexion(other, f"right_{joint}")[:-1], half)
            assert np.abs(mine - theirs).max() < 3.0, (clip.name, joint)


def test_all_joints_stay_within_their_limits():
    for clip in LIBRARY.clips:
        for joint, name in enumerate(SKELETON.joint_names):
            if joint == 0 or not ("shank" in name or "forearm" in name or "toe" in name):
                continue
            angle = np.radians(flexion(clip, name))
            assert angle.min() > SKELETON.limit_lower[joint, 0] - 0.02, (clip.name, name)
            assert angle.max() < SKELETON.limit_upper[joint, 0] + 0.02, (clip.name, name)


@pytest.mark.parametrize(
    "clip", [*LIBRARY.of_kind(ClipKind.IDLE), *LIBRARY.of_kind(ClipKind.GESTURE)], ids=lambda c: c.name
)
def test_people_who_stand_keep_their_feet_and_move_calmly(clip):
    for leg in range(2):
        points = sole(clip, leg)
        assert np.abs(points - points[:, :1]).max() < 3e-3
        assert np.abs(points[:2, :, 1]).max() < 5e-3
    assert largest_acceleration(clip.rotation_local[:, None], clip.frame_rate) < 120
    arms = [SKELETON.joint(f"{side}_upper_arm") for side in SIDES]
    for frame in (0, -1):
        dots = np.abs(
            (clip.rotation_local[frame, arms] * LIBRARY.clip("idle").rotation_local[0, arms]).sum(axis=1)
        )
        assert np.degrees(2 * np.arccos(np.clip(dots.min(), -1, 1))) < 6, "begins and ends with hanging arms"


@pytest.mark.parametrize("clip", LIBRARY.of_kind(ClipKind.IDLE), ids=lambda clip: clip.name)
def test_people_who_stand_for_long_do_not_jump_where_their_clip_goes_round(clip):
    twice = np.concatenate([clip.rotation_local[:-1], clip.rotation_local[:-1]]).astype(np.float64)
    once = angular_motion(clip.rotation_local[:, None].astype(np.float64), 1.0 / clip.frame_rate)
    assert angular_motion(twice[:, None], 1.0 / clip.frame_rate)[1] < 1.001 * once[1] + 0.01
    np.testing.assert_allclose(clip.pelvis_position_root[-1], clip.pelvis_position_root[0], atol=1e-6)


def test_starts_begin_standing_and_stops_end_standing():
    for clip in LIBRARY.of_kind(ClipKind.START):
        assert np.linalg.norm(np.diff(clip.root_position, axis=0)[:3], axis=1).max() < 2e-3
    for clip in LIBRARY.of_kind(ClipKind.STOP):
        assert np.linalg.norm(np.diff(clip.root_position, axis=0)[-3:], axis=1).max() < 2e-3


def test_skeleton_has_published_proportions():
    skeleton = build_skeleton()
    height = dict.fromkeys(skeleton.joint_names, 0.0)
    for joint, name in enumerate(skeleton.joint_names):
        above = skeleton.joint_names[skeleton.parent[joint]] if joint else None
        height[name] = skeleton.offset[joint, 1] + (height[above] if above else 0.0)
    assert height["left_thigh"] == pytest.approx(0.530 * STATURE, abs=0.005)
    assert height["left_shank"] == pytest.approx(0.285 * STATURE, abs=0.005)
    assert height["left_foot"] == pytest.approx(0.039 * STATURE, abs=0.005)
    assert height["left_upper_arm"] == pytest.approx(0.818 * STATURE, abs=0.02)
    assert height["left_eye"] == pytest.approx(0.936 * STATURE, abs=0.005)
    assert height["left_middle_3"] == pytest.approx(
        (0.818 - 0.186 - 0.146 - 0.717 * 0.108) * STATURE, abs=0.02
    )


def test_people_differ_in_proportions_but_keep_their_stature():
    stature = np.linspace(1.5, 1.95, 200)
    scale = draw_segment_scale(SKELETON, stature, seed=3)
    share = SKELETON.offset[0, 1] / STATURE
    total = STATURE * (share * scale[:, 6] + (1 - share) * scale[:, 0])
    np.testing.assert_allclose(total, stature, rtol=1e-5)
    legs = scale[:, 6] / stature * STATURE
    assert 0.01 < legs.std() < 0.03
    assert (scale > 0.7).all()
    np.testing.assert_array_equal(scale, draw_segment_scale(SKELETON, stature, seed=3))
