"""Clocks of idle variations and plays: keys against a slow twin, fades without jumps, repeatable choices."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from crowd.motion import easing
from crowd_kernels.easing import minimum_jerk
from crowd_kernels.layers import idle_crowd, key_at, play_crowd
from tests.oracles import layers as oracle

DT = 1 / 60
FIRST = np.array([0, 30, 50], np.int32)
COUNT = np.array([30, 20, 10], np.int32)
RATE = np.array([10.0, 10.0, 10.0])


@given(
    time=st.floats(-5, 50),
    key_count=st.integers(1, 40),
    key_rate=st.floats(1, 60),
    is_cyclic=st.booleans(),
)
def test_key_position_matches_oracle(time, key_count, key_rate, is_cyclic):
    frame, following, fraction = key_at(time, 7, key_count, key_rate, is_cyclic)
    assert 7 <= frame < 7 + key_count
    assert 7 <= following < 7 + key_count
    assert -1e-9 <= fraction <= 1 + 1e-9
    wanted = oracle.key_at(time, 7, key_count, key_rate, is_cyclic)
    assert math.isclose(frame + fraction, wanted, abs_tol=1e-6)
    if following != frame:
        assert following == frame + 1 or (is_cyclic and following == 7)


def test_minimum_jerk_is_flat_at_its_ends():
    step = 1e-4
    assert minimum_jerk(0.0) == 0.0
    assert minimum_jerk(1.0) == 1.0
    assert minimum_jerk(step) < 1e-10
    assert 1 - minimum_jerk(1 - step) < 1e-10
    assert minimum_jerk(0.5) == pytest.approx(0.5)
    assert (minimum_jerk(-0.5), minimum_jerk(1.5)) == (0.0, 1.0)
    progress = np.linspace(-0.2, 1.2, 29)
    np.testing.assert_allclose([minimum_jerk(u) for u in progress], easing.minimum_jerk(progress), atol=1e-15)


def run_idle(people=50, seconds=60.0, seed=3):
    """Run idle clocks; returns the blended fractional clip position and the weights per step."""
    everyone = np.arange(people, dtype=np.int32)
    clips = np.array([0, 1, 2], np.int32)
    clip, clip_time = np.zeros((people, 2), np.int32), np.zeros((people, 2))
    mix, until = np.ones(people), np.linspace(0, 5, people)
    frame, following = np.zeros((people, 2), np.int32), np.zeros((people, 2), np.int32)
    fraction, weight = np.zeros((people, 2), np.float32), np.zeros((people, 2), np.float32)
    shares = []
    for step in range(round(seconds / DT)):
        idle_crowd(
            clips, FIRST, COUNT, RATE, everyone, seed, step, step * DT, DT, 1.4, 5.0, 14.0,
            clip, clip_time, mix, until, frame, following, fraction, weight,
        )  # fmt: skip
        share = np.zeros((people, 3))
        for sample in range(2):
            np.add.at(share, (np.arange(people), clip[:, sample]), weight[:, sample])
        shares.append(share)
    return np.array(shares)


def test_idle_variations_pass_over_without_a_jump():
    shares = run_idle()
    assert np.allclose(shares.sum(axis=2), 1, atol=1e-6)
    assert np.abs(np.diff(shares, axis=0)).max() < 1.9 * DT / 1.4
    assert (shares.mean(axis=(0, 1)) > 0.1).all(), "all variations are used"
    assert shares[..., 0].mean() > shares[..., 1].mean(), "the neutral one most"


def test_idle_choices_depend_on_the_seed_only():
    np.testing.assert_array_equal(run_idle(seconds=20), run_idle(seconds=20))
    assert (run_idle(seconds=20) != run_idle(seconds=20, seed=4)).any()
    np.testing.assert_array_equal(
        run_idle(people=50, seconds=8)[:, :1], run_idle(people=50, seconds=8)[:, :1]
    )


def test_a_play_eases_in_and_out_and_hands_over_to_the_queued_one():
    one = np.arange(1, dtype=np.int32)
    clip, time, end = np.array([0], np.int32), np.zeros(1), np.array([3.0])
    weight, rate = np.zeros(1), np.zeros(1)
    queued, queued_length = np.array([2], np.int32), np.array([1.0])
    frame, following = np.zeros((1, 1), np.int32), np.zeros((1, 1), np.int32)
    fraction, sample_weight = np.zeros((1, 1), np.float32), np.zeros((1, 1), np.float32)
    layer_weight = np.zeros(1, np.float32)
    history = []
    for _ in range(round(8 / DT)):
        if clip[0] < 0:
            break
        playing = clip[0]
        play_crowd(
            FIRST, COUNT, RATE, np.zeros(3, bool), one, DT, 9.0, 0.45, clip, time, end, weight, rate,
            queued, queued_length, frame, following, fraction, sample_weight, layer_weight,
        )  # fmt: skip
        history.append((playing, float(layer_weight[0])))
    played = [clip_number for clip_number, _ in history]
    weights = np.array([share for _, share in history])
    assert played[0] == 0
    assert played[-1] == 2
    assert clip[0] == -1
    assert weights[played.index(2) - 1] < 1e-3, "one has faded out before the next begins"
    assert weights.max() > 0.99
    assert np.abs(np.diff(weights)).max() < 9.0 * DT / math.e * 1.05
