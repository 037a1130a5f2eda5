"""Captured motion comes in: names, axes, proportions, contacts, cycles, labels, all of known motions."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from crowd.errors import MotionError
from crowd.motion.body import build_skeleton
from crowd.motion.clip import ClipKind, FootEvent
from crowd.motion.importing.axes import UNITS, convert, find_convention
from crowd.motion.importing.clips import stance_drift
from crowd.motion.importing.example_set import NEEDS, OTHER_NEEDS, assemble, distance
from crowd.motion.importing.importer import ImportSettings, import_clip
from crowd.motion.importing.joint_names import FAMILIES, REQUIRED, map_joints, normalised, read_mapping
from crowd.motion.importing.labels import (
    Correction,
    JumpCorrection,
    ReachCorrection,
    read_labels,
    write_labels,
)
from crowd.motion.library import Calibration
from crowd.motion.library_file import load_library, save_library
from crowd.motion.mirror import mirrored
from crowd.motion.procedural import built_in_library
from crowd.motion.rotation import about, conjugate, from_vector, multiply, rotate, slerp, swing, to_vector
from crowd.motion.source import SourceMotion, SourceSkeleton

SKELETON = build_skeleton()
LIBRARY = built_in_library()
Y_UP = np.array([1.0, 0.0, 0.0, 0.0])
Z_UP = about(0, math.pi / 2)
"""Turns our axes into ones whose up is +z: x stays, y goes to z."""


def as_source(clip, to_file=Y_UP, units_per_metre=1.0, scale=1.0, frames=None, seed=None, names=None):
    """Write a clip of ours as another program would: other axes, units, size, joint frames and names."""
    rng = np.random.default_rng(seed)
    joints = SKELETON.joint_count
    twist = np.tile(Y_UP, (joints, 1)) if seed is None else from_vector(rng.uniform(-2.0, 2.0, (joints, 3)))
    rotation = clip.rotation_local.astype(np.float64)
    rotation[:, 0] = multiply(about(1, clip.root_yaw), rotation[:, 0])
    pelvis = clip.root_position + rotate(about(1, clip.root_yaw), clip.pelvis_position_root)
    parent = SKELETON.parent
    # In the file, joint frames are those of ours turned by `twist` in the rest pose, and all by `to_file`.
    above = np.concatenate([[to_file * (1, -1, -1, -1)], twist[parent[1:]]])
    file_rotation = multiply(multiply(conjugate(above), rotation), twist)
    rest_rotation = multiply(conjugate(above), twist)
    factor = units_per_metre * scale
    offset = rotate(conjugate(above), factor * SKELETON.offset)
    position = np.broadcast_to(offset, (*rotation.shape[:2], 3)).copy()
    position[:, 0] = factor * rotate(to_file, pelvis)
    skeleton = SourceSkeleton(
        tuple(names or SKELETON.joint_names), parent, offset, rest_rotation, np.ones(joints, bool)
    )
    motion = SourceMotion(
        Path(f"{clip.name}.test"), clip.name, skeleton, clip.frame_rate, file_rotation, position
    )
    if frames is None:
        return motion
    return replace(motion, rotation_local=file_rotation[frames], position_local=position[frames])


def pose_error(first, second, late=0):
    """Largest angle, rad, between two loops of which the first may start up to `late` frames later."""
    a = first.rotation_local[:-1].astype(np.float64)
    b = second.rotation_local[:-1].astype(np.float64)
    shifted = [np.roll(b, -shift, axis=0) for shift in range(-late, late + 1)]
    return min(np.linalg.norm(to_vector(multiply(conjugate(a), c)), axis=-1).max() for c in shifted)


@pytest.mark.parametrize("name", ["walk", "run", "walk_circle_left", "sidestep_slow_right", "walk_back"])
@pytest.mark.parametrize(
    ("to_file", "unit", "seed"), [(Y_UP, "m", None), (Z_UP, "cm", 1), (about(1, math.pi / 2), "inch", 2)]
)
def test_a_gait_comes_back_whatever_axes_units_and_joint_frames_the_file_has(name, to_file, unit, seed):
    clip = LIBRARY.clip(name)
    found = import_clip(as_source(clip, to_file, 1.0 / UNITS[unit], seed=seed), SKELETON)
    assert found.clip.kind is ClipKind.LOCOMOTION
    assert found.clip.parameters == pytest.approx(clip.parameters, abs=2e-3)
    assert found.clip.duration == pytest.approx(clip.duration, abs=0.02)
    assert found.scale == pytest.approx(1.0, abs=1e-6)
    # The feet are put on the ground anew, which tips them a little.
    assert np.degrees(pose_error(found.clip, clip, late=3)) < 20.0


def test_a_smaller_person_walks_in_proportion():
    clip = LIBRARY.clip("walk")
    found = import_clip(as_source(clip, scale=0.8), SKELETON)
    assert found.scale == pytest.approx(1.25)
    assert found.clip.parameters[0] == pytest.approx(1.35, rel=0.01)
    assert found.clip.parameters[0] / found.scale == pytest.approx(0.8 * 1.35, rel=0.01)


def test_foot_events_are_those_of_the_gait():
    for name in ("walk_slow", "walk", "walk_fast", "jog", "run"):
        clip = LIBRARY.clip(name)
        found = import_clip(as_source(clip), SKELETON).clip
        for event in (FootEvent.RHS, FootEvent.LHS):
            expected = [time for time, kind in clip.foot_events if kind is event]
            times = [time for time, kind in found.foot_events if kind is event]
            assert times == pytest.approx(expected, abs=0.05)
        assert len(found.foot_events) == 16
        assert found.foot_events[0] == (0.0, FootEvent.RHS)


def test_two_cycles_are_cut_out_of_a_longer_walk():
    clip = LIBRARY.clip("walk")
    source = as_source(clip)
    intervals = clip.frame_count - 1
    order = np.arange(20, 20 + round(1.8 * intervals)) % intervals
    turns = (np.arange(20, 20 + len(order)) // intervals)[:, None] * clip.parameters[0] * clip.duration
    position = source.position_local[order].copy()
    position[:, 0] += turns * np.array([0.0, 0.0, 1.0])
    long = replace(source, rotation_local=source.rotation_local[order], position_local=position)
    found = import_clip(long, SKELETON).clip
    assert found.cycles == 2
    assert found.duration == pytest.approx(clip.duration, abs=0.05)
    assert found.parameters == pytest.approx(clip.parameters, abs=0.03)


def test_one_cycle_is_repeated():
    clip = LIBRARY.clip("run")
    half = as_source(clip, frames=slice(0, (clip.frame_count - 1) // 2 + 1))
    found = import_clip(half, SKELETON).clip
    assert found.cycles == 2
    assert found.duration == pytest.approx(clip.duration, abs=0.05)
    assert found.parameters == pytest.approx(clip.parameters, abs=0.05)


def test_the_imported_cycle_closes_and_does_not_slide():
    for name in ("walk", "jog", "walk_circle_right"):
        clip = import_clip(as_source(LIBRARY.clip(name), seed=3), SKELETON).clip
        ends = to_vector(multiply(conjugate(clip.rotation_local[0].astype(float)), clip.rotation_local[-1]))
        assert np.abs(ends).max() < 1e-3
        assert np.abs(clip.pelvis_position_root[0] - clip.pelvis_position_root[-1]).max() < 1e-4
        assert stance_drift(clip, SKELETON) < 0.02


@pytest.mark.parametrize(
    ("name", "kind"),
    [
        ("idle", ClipKind.IDLE),
        ("start_walk_left", ClipKind.START),
        ("turn_left", ClipKind.LOCOMOTION),
    ],
)
def test_clips_are_recognised_by_how_they_move(name, kind):
    clips = [clip for clip in LIBRARY.clips if clip.name.startswith(name)]
    assert clips
    assert import_clip(as_source(clips[0]), SKELETON).clip.kind is kind


def test_a_start_run_backward_is_a_stop():
    start = as_source(LIBRARY.clip("start_walk_left"))
    back = slice(None, None, -1)
    stop = replace(
        start, rotation_local=start.rotation_local[back], position_local=start.position_local[back]
    )
    assert import_clip(stop, SKELETON).clip.kind is ClipKind.STOP


def test_a_jump_is_labelled():
    jump = jump_motion(flight=0.5, length=1.2)
    found = import_clip(jump, SKELETON).clip
    assert found.kind is ClipKind.JUMP
    assert found.jump.take_off == pytest.approx(1.0, abs=0.07)
    assert found.jump.landing == pytest.approx(1.5, abs=0.07)
    assert found.jump.apex == pytest.approx(1.25, abs=0.05)
    assert found.jump.length == pytest.approx(1.2, abs=0.02)
    assert found.quality.flight_gravity == pytest.approx(9.81, rel=0.15)


def jump_motion(flight, length):
    """Somebody who stands, flies on a parabola and stands again, all joints stiff."""
    rate, frames = 60.0, 151
    time = np.arange(frames) / rate
    air = np.clip(time - 1.0, 0.0, flight)
    rotation = np.tile(Y_UP, (frames, SKELETON.joint_count, 1))
    position = np.broadcast_to(SKELETON.offset, (frames, SKELETON.joint_count, 3)).copy()
    position[:, 0, 1] += 0.5 * 9.81 * air * (flight - air)
    position[:, 0, 2] += length * air / flight
    skeleton = SourceSkeleton(
        SKELETON.joint_names,
        SKELETON.parent,
        SKELETON.offset,
        np.tile(Y_UP, (SKELETON.joint_count, 1)),
        np.ones(SKELETON.joint_count, bool),
    )
    return SourceMotion(Path("jump.test"), "jump", skeleton, rate, rotation, position)


def test_a_pop_is_mended():
    clip = LIBRARY.clip("walk")
    source = as_source(clip)
    arm = SKELETON.joint("left_forearm")
    rotation = source.rotation_local.copy()
    rotation[30, arm] = multiply(rotation[30, arm], about(2, math.pi))
    found = import_clip(replace(source, rotation_local=rotation), SKELETON)
    assert found.popped == 1
    assert np.degrees(pose_error(found.clip, import_clip(source, SKELETON).clip)) < 3.0


def test_every_family_maps_its_own_names():
    for family in FAMILIES:
        names = [
            spelling[0] for role, spelling in family.spellings().items() if role not in ("spine", "neck")
        ]
        found = map_joints(names, "somebody.bvh")
        assert set(REQUIRED) <= set(found.joint)


def test_names_are_recognised_with_namespaces_and_separators():
    assert normalised("mixamorig:LeftUpLeg") == "leftupleg"
    assert normalised("Upper_Arm.L") == "upperarml"


def test_unknown_names_are_refused_with_the_nearest_ones():
    names = ["root", "thigh_left", "thigh_right", "shin_left"]
    with pytest.raises(MotionError, match="no joint for") as caught:
        map_joints(names, "odd.bvh")
    assert "thigh_left" in str(caught.value)
    assert "--joints" in str(caught.value)


def test_a_mapping_file_names_what_no_family_does(tmp_path):
    names = [f"bone{number}" for number in range(8)]
    path = tmp_path / "map.toml"
    path.write_text(
        "".join(f'{role} = "bone{k}"\n' for k, role in enumerate(REQUIRED)) + 'spine = ["bone7"]\n'
    )
    found = read_mapping(path, names)
    assert found.joint["pelvis"] == 0
    assert found.chain["spine"] == (7,)
    path.write_text('left_thig = "bone1"\n')
    with pytest.raises(MotionError, match="left_thigh"):
        read_mapping(path, names)
    path.write_text('left_thigh = "bone11"\n')
    with pytest.raises(MotionError, match=r'no such joint.*"bone1"'):
        read_mapping(path, names)


def test_a_mapping_file_need_only_name_what_names_do_not_tell(tmp_path):
    path = tmp_path / "map.toml"
    names = [*LIBRARY.skeleton.joint_names, "Leg1"]
    names.remove("left_thigh")
    path.write_text('left_thigh = "Leg1"\nhead = []\nneck = ["neck_1"]\n')
    found = read_mapping(path, names)
    assert names[found.joint["left_thigh"]] == "Leg1"
    assert names[found.joint["right_shank"]] == "right_shank"
    assert "head" not in found.joint
    assert [names[joint] for joint in found.chain["neck"]] == ["neck_1"]
    assert len(found.chain["spine"]) == 4
    path.write_text('left_shank = "left_foot"\n')
    with pytest.raises(MotionError, match="lacks required roles; got 'left_thigh, left_foot'"):
        read_mapping(path, names)


def test_told_units_that_make_giants_are_refused():
    source = as_source(LIBRARY.clip("walk"), units_per_metre=100.0)
    joints = map_joints(source.skeleton.joint_names, "walk.bvh")
    assert find_convention(source, joints, units="cm").metres_per_unit == 0.01
    with pytest.raises(MotionError, match="unbelievable length in m; got '8"):
        find_convention(source, joints, units="m")


def test_units_are_told_when_no_unit_gives_a_human_leg():
    source = as_source(LIBRARY.clip("walk"), units_per_metre=1e-6)
    joints = map_joints(source.skeleton.joint_names, "tiny.bvh")
    with pytest.raises(MotionError, match="--units"):
        find_convention(source, joints)
    with pytest.raises(MotionError, match="is no unit"):
        find_convention(source, joints, units="furlong")


def test_axes_are_found_and_told_in_words():
    source = as_source(LIBRARY.clip("walk"), Z_UP, 100.0)
    joints = map_joints(source.skeleton.joint_names, "z.bvh")
    found = find_convention(source, joints)
    assert "cm" in found.text
    assert "up +z" in found.text
    posed = convert(source, found)
    assert posed.rest_position[SKELETON.joint("head"), 1] > 1.4


def test_labels_correct_what_was_found(tmp_path):
    source = as_source(LIBRARY.clip("walk"))
    told = Correction(forward=1.0, turn=10.0)
    clip = import_clip(source, SKELETON, correction=told).clip
    assert clip.parameters == pytest.approx((1.0, math.radians(10.0), 0.0))
    gesture = import_clip(source, SKELETON, correction=Correction(kind=ClipKind.GESTURE)).clip
    assert gesture.kind is ClipKind.GESTURE
    with pytest.raises(MotionError, match="begin and end"):
        import_clip(source, SKELETON, correction=Correction(begin=5.0))
    with pytest.raises(MotionError, match="no time is found with both feet in the air"):
        import_clip(source, SKELETON, correction=Correction(kind=ClipKind.JUMP))
    with pytest.raises(MotionError, match="there is no reach in it"):
        import_clip(source, SKELETON, correction=Correction(reach=ReachCorrection(side="left")))


@pytest.mark.parametrize(
    "name",
    [
        "walk_slow",
        "walk",
        "walk_fast",
        "jog",
        "run",
        "walk_back",
        "sidestep_slow_left",
        "sidestep_fast_right",
    ],
)
def test_a_gait_captured_in_place_is_as_fast_as_its_feet_tell(name):
    clip = LIBRARY.clip(name)
    still = replace(clip, root_position=np.zeros_like(clip.root_position))
    found = import_clip(as_source(still), SKELETON)
    speed = math.hypot(clip.parameters[0], clip.parameters[2])
    assert found.in_place == pytest.approx(speed, rel=0.035)
    assert found.clip.kind is ClipKind.LOCOMOTION
    assert found.clip.parameters == pytest.approx(clip.parameters, rel=0.035, abs=0.01)
    assert import_clip(as_source(clip), SKELETON).in_place == 0.0


@pytest.mark.parametrize("name", ["in_place", "turn_left", "idle", "wave"])
def test_who_stands_or_turns_on_the_spot_is_not_taken_for_a_walker_in_place(name):
    assert import_clip(as_source(LIBRARY.clip(name)), SKELETON).in_place == 0.0


def test_told_jumps_and_reaches_are_measured_at_the_told_times():
    source = as_source(LIBRARY.clip("walk"))
    jump = JumpCorrection(take_off=0.3, apex=0.4, landing=0.6)
    clip = import_clip(source, SKELETON, correction=Correction(kind=ClipKind.JUMP, jump=jump)).clip
    assert (clip.jump.take_off, clip.jump.apex, clip.jump.landing) == (0.3, 0.4, 0.6)
    speed = LIBRARY.clip("walk").parameters[0]
    assert clip.jump.flight_length == pytest.approx(0.3 * speed, rel=0.1)
    found = {
        side: import_clip(
            source,
            SKELETON,
            correction=Correction(kind=ClipKind.REACH, reach=ReachCorrection(side=side, apex=0.5)),
        ).clip.reach
        for side in ("left", "right")
    }
    for side, sign in (("left", 1.0), ("right", -1.0)):
        assert (found[side].side, found[side].apex) == (side, 0.5)
        assert sign * found[side].hand_position[0] > 0.1


def test_written_labels_are_read_back_and_change_nothing(tmp_path):
    path = tmp_path / "crowd-labels.toml"
    sources = [as_source(LIBRARY.clip(name)) for name in ("walk", "walk_circle_left", "jog", "idle")]
    found = [import_clip(source, SKELETON) for source in sources]
    write_labels(path, found)
    told = read_labels(path)
    assert list(told) == [entry.clip.name for entry in found]
    for source, entry in zip(sources, found, strict=True):
        again = import_clip(source, SKELETON, correction=told[entry.clip.name]).clip
        assert again.kind is entry.clip.kind
        assert again.parameters == pytest.approx(entry.clip.parameters, abs=1e-5)
        assert [event for _, event in again.foot_events] == [event for _, event in entry.clip.foot_events]
        times = np.array([[time for time, _ in clip.foot_events] for clip in (again, entry.clip)])
        assert np.abs(times[0] - times[1]).max(initial=0.0) < 2e-4
        assert np.abs(again.rotation_local - entry.clip.rotation_local).max() < 2e-3


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[walk]\nkin = 'idle'\n", "kind"),
        ("[walk]\nkind = 'dance'\n", "kind"),
        ("[walk]\nbegin = -1.0\n", "begin"),
        ("[walk]\nturn = nan\n", "turn"),
        ("[walk\n", "not a file of labels"),
    ],
)
def test_bad_labels_get_one_line(tmp_path, text, words):
    path = tmp_path / "labels.toml"
    path.write_text(text)
    with pytest.raises(MotionError, match=words) as caught:
        read_labels(path)
    assert "\n" not in str(caught.value).strip() or "not a file" in str(caught.value)
    assert str(path) in str(caught.value)


def test_told_events_replace_found_ones():
    source = as_source(LIBRARY.clip("walk"))
    clip = LIBRARY.clip("walk")
    events = tuple((time, event.name) for time, event in clip.foot_events)
    found = import_clip(source, SKELETON, correction=Correction(events=events)).clip
    assert [event for _, event in found.foot_events][:2] == [event for _, event in clip.foot_events][:2]
    assert found.foot_events[0][0] == 0.0


def test_a_mirror_image_is_its_own_mirror_image():
    clip = LIBRARY.clip("walk_circle_left")
    image = mirrored(clip, SKELETON, "image")
    assert image.parameters == pytest.approx((clip.parameters[0], -clip.parameters[1], 0.0))
    assert image.foot_events[0] == (0.0, FootEvent.RHS)
    right = LIBRARY.clip("walk_circle_right")
    assert np.degrees(pose_error(image, right)) < 0.5
    again = mirrored(image, SKELETON, "again")
    assert np.degrees(pose_error(again, clip)) < 0.5


def test_missing_sides_are_mirrored_and_gaps_are_filled_and_named():
    wanted = ("walk", "walk_circle_left", "sidestep_slow_left", "run", "jog")
    clips = [replace(LIBRARY.clip(name), source=f"{name}.bvh") for name in wanted]
    examples = assemble(clips, "test", "us", "MIT")
    origin = {entry.need: entry.origin for entry in examples.coverage}
    assert origin["walking in a circle to the right"] == "mirrored"
    assert origin["sidestep to the right"] == "mirrored"
    assert origin["walking backward"] == "built-in library"
    assert origin["turning left on the spot"] == "built-in library"
    assert origin["standing idle"] == origin["gestures"] == "built-in library"
    assert origin["reaching with the left hand"] == "built-in library"
    assert {need.name for need in (*NEEDS, *OTHER_NEEDS)} == set(origin)
    assert all(origin[need.name] != "missing" for need in NEEDS)
    bare = assemble(clips, "test", "us", "MIT", fills=False)
    assert {entry.origin for entry in bare.coverage} >= {"missing"}


def test_examples_that_say_the_same_are_kept_once():
    twin = replace(LIBRARY.clip("walk"), name="twin")
    examples = assemble([LIBRARY.clip("walk"), twin], "test", "us", "MIT")
    assert examples.duplicates == (("twin", "walk"),)
    parameters = [clip.parameters for clip in examples.library.of_kind(ClipKind.LOCOMOTION)]
    for number, first in enumerate(parameters):
        assert all(distance(first, other) > 0.01 for other in parameters[:number])


def test_a_motion_that_two_files_hold_is_kept_once():
    wave = LIBRARY.clip("wave")
    moved = wave.pelvis_position_root + np.float32([0.0, 0.02, 0.0])
    clips = [wave, replace(wave, name="wave_copy"), replace(wave, name="lower", pelvis_position_root=moved)]
    examples = assemble(clips, "test", "us", "MIT", fills=False)
    assert examples.duplicates == (("wave_copy", "wave"),)
    assert [clip.name for clip in examples.library.clips] == ["wave", "lower"]


def test_a_library_file_holds_everything(tmp_path):
    jump = import_clip(jump_motion(0.5, 1.0), SKELETON).clip
    library = assemble([LIBRARY.clip("walk"), jump], "mine", "me", "All rights\nréservés").library
    library = replace(library, calibration=Calibration(50, 0.01, 0.2, 0.003, 0.004))
    path = tmp_path / "mine.h5"
    save_library(path, library)
    again = load_library(path)
    assert (again.name, again.source, again.licence) == (library.name, library.source, library.licence)
    assert again.calibration == library.calibration
    assert again.skeleton.joint_names == library.skeleton.joint_names
    for first, second in zip(again.clips, library.clips, strict=True):
        assert np.array_equal(first.rotation_local, second.rotation_local)
        assert np.array_equal(first.root_position, second.root_position)
        assert (first.name, first.kind, first.mask, first.foot_events) == (
            second.name,
            second.kind,
            second.mask,
            second.foot_events,
        )
        assert (first.jump, first.reach, first.quality) == (second.jump, second.reach, second.quality)
    assert list(tmp_path.iterdir()) == [path]


def test_what_is_no_library_is_refused(tmp_path):
    with pytest.raises(MotionError, match="no such motion library"):
        load_library(tmp_path / "none.h5")
    (tmp_path / "text.h5").write_text("hello")
    with pytest.raises(MotionError, match="is no motion library"):
        load_library(tmp_path / "text.h5")


def test_rotation_arithmetic():
    rng = np.random.default_rng(5)
    vectors = rng.uniform(-1.5, 1.5, (50, 3))
    assert to_vector(from_vector(vectors)) == pytest.approx(vectors, abs=1e-12)
    starts, ends = rng.normal(size=(2, 50, 3))
    turned = rotate(swing(starts, ends), starts)
    assert np.cross(turned, ends) == pytest.approx(np.zeros((50, 3)), abs=1e-9)
    assert ((turned * ends).sum(1) > 0).all()
    assert rotate(swing([0, 1, 0], [0, -1, 0]), [0, 1, 0]) == pytest.approx([0, -1, 0], abs=1e-9)
    a, b = from_vector(vectors[:25]), from_vector(vectors[25:])
    assert slerp(a, b, 0.0) == pytest.approx(a)
    half = to_vector(multiply(conjugate(a), slerp(a, b, 0.5)))
    assert 2 * half == pytest.approx(to_vector(multiply(conjugate(a), b)), abs=1e-9)


def test_settings_of_the_user_win():
    source = as_source(LIBRARY.clip("walk"), units_per_metre=100.0)
    found = import_clip(source, SKELETON, ImportSettings(units="cm", up="+y"))
    assert "as told" in found.convention
