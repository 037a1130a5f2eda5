"""Key frames and foot contacts of a blend against slow twins, and what a step must look like."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from crowd_kernels.gait import BALL, CHUNKS, HEEL, SWING, contact_crowd, sample_crowd
from tests.oracles import gait as oracle

NAMES = {SWING: "swing", HEEL: "heel", BALL: "ball"}
EXAMPLE_CLIP = np.array([0, 2, 3], np.int32)
KEY_COUNT = np.array([128, 31, 64, 128], np.int32)
FIRST_KEY = np.array([0, 128, 159, 223], np.int32)
CONTACT_PHASE = np.array(
    [[[0.09, 0.55], [0.09, 0.55]], [[0.05, 0.26], [0.06, 0.27]], [[0.0, 0.62], [0.0, 0.62]]]
)


def random_blends(rng, count):
    example = rng.integers(0, 3, (count, 4)).astype(np.int32)
    weight = rng.dirichlet(np.ones(4), count)
    return example, weight, rng.uniform(0, 2, count)


def everyone(count):
    return np.arange(count, dtype=np.int32)


def sample(example, weight, phase, active=None, build=sample_crowd):
    count = len(phase)
    out = (
        np.full((count, 4), -7, np.int32),
        np.full((count, 4), -7, np.int32),
        np.full((count, 4), -7, np.float32),
        np.full((count, 4), -7, np.float32),
    )
    active = everyone(count) if active is None else np.array(active, np.int32)
    build(EXAMPLE_CLIP, FIRST_KEY, KEY_COUNT, example, weight, phase, active, *out)
    return out


def contacts(example, weight, phase, active=None, build=contact_crowd, contact_phase=CONTACT_PHASE):
    out = np.full((len(phase), 2), 9, np.uint8)
    active = everyone(len(phase)) if active is None else np.array(active, np.int32)
    build(contact_phase, example, weight, phase, active, out)
    return out


@pytest.mark.parametrize("count", [0, 1, CHUNKS + 3, 500])
def test_samples_match_oracle(count, rng):
    example, weight, phase = random_blends(rng, count)
    frame, next_frame, fraction, out_weight = sample(example, weight, phase)
    for row in range(count):
        for corner in range(4):
            clip = EXAMPLE_CLIP[example[row, corner]]
            before, after, share = oracle.key_position(FIRST_KEY[clip], KEY_COUNT[clip], phase[row])
            assert (frame[row, corner], next_frame[row, corner]) == (before, after)
            assert fraction[row, corner] == pytest.approx(share, abs=1e-5)
    np.testing.assert_allclose(out_weight, weight, atol=1e-7)


@given(
    phase=st.one_of(st.floats(0, 2, exclude_max=True), st.sampled_from([0.0, np.nextafter(2.0, 0.0), 1.0]))
)
def test_samples_stay_inside_their_clip_and_join_at_the_ends(phase):
    frame, next_frame, fraction, _ = sample(
        np.array([[0, 1, 2, 0]], np.int32), np.full((1, 4), 0.25), np.array([phase])
    )
    for corner, clip in enumerate(EXAMPLE_CLIP[[0, 1, 2, 0]]):
        first, last = FIRST_KEY[clip], FIRST_KEY[clip] + KEY_COUNT[clip] - 1
        assert first <= frame[0, corner] <= last
        assert next_frame[0, corner] == (first if frame[0, corner] == last else frame[0, corner] + 1)
        assert 0 <= fraction[0, corner] <= 1


@pytest.mark.parametrize("count", [0, 1, CHUNKS + 3, 500])
def test_contacts_match_oracle(count, rng):
    example, weight, phase = random_blends(rng, count)
    got = contacts(example, weight, phase)
    for row in range(count):
        for foot in range(2):
            wanted = oracle.contact(CONTACT_PHASE, example[row], weight[row], phase[row], foot)
            assert NAMES[int(got[row, foot])] == wanted


def test_a_step_rolls_from_heel_to_ball_to_swing_once_a_cycle(rng):
    example, weight, _ = random_blends(rng, 20)
    phases = np.linspace(0, 2, 801)[:-1]
    for row in range(20):
        ones = np.ones((len(phases), 1))
        history = contacts((ones * example[row]).astype(np.int32), ones * weight[row], phases)
        for foot in range(2):
            # Start at the strike of the foot.
            states = np.roll(history[:, foot], -200 * foot)
            changes = states[np.flatnonzero(np.diff(states, prepend=-1))].tolist()
            assert changes in ([HEEL, BALL, SWING] * 2, [BALL, SWING] * 2)


def test_walking_has_double_support_and_running_flies():
    phases = np.linspace(0, 2, 801)[:-1]
    count = len(phases)
    for example, fewest in ((0, 1), (1, 0)):
        chosen = np.full((count, 4), example, np.int32)
        planted = (contacts(chosen, np.full((count, 4), 0.25), phases) != SWING).sum(axis=1)
        assert planted.min() == fewest
        assert planted.max() == fewest + 1


def test_only_active_rows_are_written(rng):
    example, weight, phase = random_blends(rng, 60)
    some = [2, 30, 59]
    for everything, chosen in (
        (sample(example, weight, phase), sample(example, weight, phase, some)),
        ((contacts(example, weight, phase),), (contacts(example, weight, phase, some),)),
    ):
        for all_rows, some_rows in zip(everything, chosen, strict=True):
            np.testing.assert_array_equal(some_rows[some], all_rows[some])
            untouched = np.delete(some_rows, some, axis=0)
            assert (untouched == untouched[0, 0]).all()
            assert untouched[0, 0] in (-7, 9)


def test_equal_bits_on_one_and_many_threads(rng):
    example, weight, phase = random_blends(rng, 999)
    for one, other in zip(
        sample(example, weight, phase, build=sample_crowd.serial),
        sample(example, weight, phase, build=sample_crowd.threaded),
        strict=True,
    ):
        np.testing.assert_array_equal(one, other)
    np.testing.assert_array_equal(
        contacts(example, weight, phase, build=contact_crowd.serial),
        contacts(example, weight, phase, build=contact_crowd.threaded),
    )
