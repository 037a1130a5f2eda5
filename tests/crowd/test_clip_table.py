"""Clips packed for the kernels: signs, phases, contacts, masks."""

from dataclasses import replace

import numpy as np
import pytest

from crowd.errors import MotionError
from crowd.motion.clip import TOE_ROLL, ClipKind, FootEvent, JointMask
from crowd.motion.clip_table import ClipTable, phase_times, strike_times
from crowd.motion.procedural import built_in_library
from tests.oracles import pose as oracle

LIBRARY = built_in_library()
TABLE = ClipTable.build(LIBRARY)


def test_every_pair_of_keys_of_a_joint_agrees_in_sign_where_they_are_blended():
    rows = TABLE.key_rotation.reshape(-1, 4, 64)
    for joint in range(LIBRARY.skeleton.joint_count):
        values = rows[:, :, joint]
        mean = values.mean(axis=0)
        assert (values @ mean > 0).mean() > 0.999
    np.testing.assert_allclose(np.linalg.norm(rows, axis=1), 1, atol=1e-5)


def test_keys_reproduce_their_clip():
    clip = LIBRARY.clip("walk")
    number = TABLE.index("walk")
    first, count = TABLE.first_key[number], TABLE.key_count[number]
    times = phase_times(clip, np.arange(count) / count * 2)
    for key in range(0, count, 9):
        frame = round(times[key] * clip.frame_rate)
        if abs(frame / clip.frame_rate - times[key]) < 1e-4:
            got = oracle.row_to_quaternions(TABLE.key_rotation[first + key])[: LIBRARY.skeleton.joint_count]
            np.testing.assert_allclose(np.abs((got * clip.rotation_local[frame]).sum(axis=1)), 1, atol=1e-4)


def test_unequal_steps_are_warped_to_equal_phases():
    clip = LIBRARY.clip("walk")
    shifted = []
    for time, event in clip.foot_events:
        late = 0.05 if event in (FootEvent.LHS, FootEvent.LTS, FootEvent.LHO, FootEvent.LTO) else 0.0
        shifted.append(((time + late) % clip.duration, event))
    limping = replace(clip, foot_events=tuple(sorted(shifted)))
    strikes = strike_times(limping)
    np.testing.assert_allclose(phase_times(limping, np.array([0, 0.5, 1.0, 1.5])), strikes[:4], atol=1e-9)
    times = phase_times(limping, np.linspace(0, 1.999, 500))
    assert (np.diff(times) > 0).all()


def test_contacts_follow_the_foot_events():
    clip = LIBRARY.clip("walk")
    example = list(TABLE.example_clip).index(TABLE.index("walk"))
    events = {event: time for time, event in reversed(clip.foot_events)}
    cycle = clip.cycle_duration
    flat = (events[FootEvent.RTS] - events[FootEvent.RHS]) / cycle
    off = (events[FootEvent.RTO] - events[FootEvent.RHS]) / cycle
    np.testing.assert_allclose(TABLE.contact_phase[example, 0], [flat, off - TOE_ROLL], atol=1e-6)
    np.testing.assert_allclose(TABLE.contact_phase[:, 0], TABLE.contact_phase[:, 1], atol=0.01)


def test_clips_that_cannot_be_blended_in_phase_are_refused():
    clip = LIBRARY.clip("walk")
    without = replace(clip, foot_events=clip.foot_events[1:])
    with pytest.raises(MotionError, match="walk"):
        strike_times(without)


def test_masks_cover_what_they_name():
    names = LIBRARY.skeleton.joint_names
    mask = dict(zip(JointMask, TABLE.joint_mask, strict=True))
    assert (mask[JointMask.FULL_BODY] == 1).all()
    for joint, name in enumerate(names):
        is_leg = any(part in name for part in ("thigh", "shank", "foot", "toe"))
        for kind in JointMask:
            if kind is not JointMask.FULL_BODY:
                assert not (is_leg and mask[kind][joint] > 0)
        assert (mask[JointMask.RIGHT_ARM][joint] == 1) == (
            name.startswith("right") and not is_leg and "eye" not in name
        )
    assert (
        0
        < mask[JointMask.UPPER_BODY][names.index("spine_1")]
        < mask[JointMask.UPPER_BODY][names.index("spine_3")]
    )
    assert list(TABLE.pelvis_mask) == [1] + [0] * (len(JointMask) - 1)


def test_the_table_is_small_enough_for_the_cache():
    assert TABLE.key_rotation.nbytes < 8e6
    assert len(LIBRARY.of_kind(ClipKind.LOCOMOTION)) == len(TABLE.example_clip)
