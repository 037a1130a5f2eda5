"""When the feet of packed examples are planted, and that blends of their keys go the short way round."""

from dataclasses import replace

import numpy as np
import pytest

from crowd.motion.clip import TOE_ROLL, ClipKind, FootEvent
from crowd.motion.clip_table import ClipTable, contact_phases, phase_times
from crowd.motion.procedural import built_in_library

LIBRARY = built_in_library()
EXAMPLES = LIBRARY.of_kind(ClipKind.LOCOMOTION)
TABLE = ClipTable.build(LIBRARY)
STRIKES = {FootEvent.RHS: FootEvent.RTS, FootEvent.LHS: FootEvent.LTS}


@pytest.mark.parametrize("clip", EXAMPLES, ids=lambda clip: clip.name)
def test_every_example_plants_its_feet_for_a_plausible_share_of_the_cycle(clip):
    flat, lift = contact_phases(clip).T
    assert (flat >= 0).all()
    assert (flat < 0.2).all()
    assert (flat < lift).all()
    is_run = clip.parameters[0] > 2.0
    assert (lift > (0.15 if is_run else 0.45)).all()
    assert (lift < (0.5 if is_run else 0.75)).all()


@pytest.mark.parametrize("clip", EXAMPLES, ids=lambda clip: clip.name)
def test_contacts_come_when_the_events_of_the_clip_say(clip):
    cycle = clip.cycle_duration
    for foot, (strike, flat, off) in enumerate(
        [
            (FootEvent.RHS, FootEvent.RTS, FootEvent.RTO),
            (FootEvent.LHS, FootEvent.LTS, FootEvent.LTO),
        ]
    ):
        at = {event: [time for time, kind in clip.foot_events if kind is event] for event in FootEvent}
        landed = at[strike][0]
        for event, column, early in ((flat, 0, 0.0), (off, 1, TOE_ROLL)):
            after = min((time - landed + 1e-6) % clip.duration for time in at[event])
            assert contact_phases(clip)[foot, column] == pytest.approx(after / cycle - early, abs=0.01)


def with_toe_strikes(clip, delay):
    """The clip with each toe strike `delay` seconds after its heel strike."""
    events = [(time, event) for time, event in clip.foot_events if event not in STRIKES.values()]
    toes = [((time + delay) % clip.duration, STRIKES[event]) for time, event in events if event in STRIKES]
    return replace(clip, foot_events=tuple(sorted(events + toes)))


@pytest.mark.parametrize("delay", [0.0, 1e-9, -1e-9, -0.03])
def test_a_foot_that_lands_flat_or_toe_first_is_flat_at_once(delay):
    flat = contact_phases(with_toe_strikes(LIBRARY.clip("walk"), delay))[:, 0]
    np.testing.assert_allclose(flat, 0, atol=1e-6)


def test_contacts_follow_the_warp_of_unequal_steps():
    clip = LIBRARY.clip("walk")
    period = clip.duration

    def late(time):
        return float(np.mod(time + 0.1 * period / (2 * np.pi) * np.sin(2 * np.pi * time / period), period))

    limping = replace(
        clip, foot_events=tuple(sorted((late(time), event) for time, event in clip.foot_events))
    )
    phase = np.linspace(0, 2, 40_001)[:-1]
    times = phase_times(limping, phase)
    contact = contact_phases(limping)
    for foot, (strike, off) in enumerate([(FootEvent.RHS, FootEvent.RTO), (FootEvent.LHS, FootEvent.LTO)]):
        strikes, offs = (
            [phase[np.abs(times - time).argmin()] for time, kind in limping.foot_events if kind is event]
            for event in (strike, off)
        )
        share = np.mean([min((end - begin) % 2 for end in offs) for begin in strikes])
        assert contact[foot, 1] + TOE_ROLL == pytest.approx(share, abs=0.01)


def test_any_two_locomotion_keys_of_a_joint_agree_in_sign():
    joints = LIBRARY.skeleton.joint_count
    keys = TABLE.key_rotation.reshape(-1, 4, 64)[:, :, :joints]
    used = np.concatenate(
        [
            np.arange(TABLE.first_key[clip], TABLE.first_key[clip] + TABLE.key_count[clip])
            for clip in TABLE.example_clip
        ]
    )
    for joint in range(joints):
        agreement = keys[used, :, joint] @ keys[used, :, joint].T
        assert agreement.min() > 0.5, LIBRARY.skeleton.joint_names[joint]
    # Idle and gestures are mixed onto locomotion, where a sign is chosen anew; they agree all the same.
    for joint in range(joints):
        assert (keys[:, :, joint] @ keys[:, :, joint].T).min() > 0


def test_a_cyclic_clip_closes_without_a_jump():
    joints = LIBRARY.skeleton.joint_count
    for clip in TABLE.example_clip:
        rows = np.arange(TABLE.first_key[clip], TABLE.first_key[clip] + TABLE.key_count[clip])
        keys = TABLE.key_rotation[rows].reshape(-1, 4, 64)[:, :, :joints]
        step = np.abs((keys * np.roll(keys, -1, axis=0)).sum(axis=1)).clip(max=1)
        angle = 2 * np.arccos(step).max(axis=1)
        assert angle[-1] <= 1.05 * angle[:-1].max() + 1e-3
        travel = np.linalg.norm(np.diff(TABLE.key_pelvis[np.append(rows, rows[0])], axis=0), axis=1)
        assert travel[-1] <= 1.05 * travel[:-1].max() + 1e-4
