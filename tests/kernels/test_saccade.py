"""Saccades against their twin and against the published statistics, at several frame rates."""

import math
from itertools import pairwise

import numpy as np
import pytest
from scipy import stats

from crowd.controllers.gaze_settings import SACCADES, saccade_modes
from crowd_kernels.saccade import OFF, offset_eyes_crowd, saccade_crowd
from tests.oracles import saccade as oracle
from tests.oracles.pose import matrix, quaternions_to_row, row_to_quaternions

MODES = saccade_modes(SACCADES)
LIKELY = 1e-3
"""Chi-square tests reject a true distribution this often; draws are the same in every run."""


class Eyes:
    """Many people's eyes."""

    def __init__(self, count, mode):
        self.mode = np.full(count, mode, np.uint8)
        self.active = np.arange(count, dtype=np.int32)
        self.start, self.goal, self.offset = (np.zeros((count, 2), np.float32) for _ in range(3))
        self.clock, self.duration = (np.zeros(count, np.float32) for _ in range(2))
        self.until = np.zeros(count)
        self.index = 0

    def step(self, dt, seed=3):
        self.index += 1
        saccade_crowd(
            MODES, self.mode, self.active, seed, self.index, self.index * dt, dt, self.start, self.goal,
            self.clock, self.duration, self.until, self.offset,
        )  # fmt: skip


def record(mode, rate, count=1500, seconds=40.0):
    """Goals of all saccades in degrees, and how long the eyes then rested, on the target and beside it."""
    eyes = Eyes(count, mode)
    goals, rests, since = [], ([], []), np.full(count, np.nan)
    share = []
    for _ in range(round(seconds * rate)):
        before, was_away = eyes.until.copy(), eyes.goal.any(axis=1)
        eyes.step(1 / rate)
        time = eyes.index / rate
        jumped = np.flatnonzero((eyes.until != before) & (eyes.index > 1))
        for person in jumped:
            if eyes.goal[person].any():
                goals.append(np.degrees(eyes.goal[person]))
            if not np.isnan(since[person]):
                rests[int(was_away[person])].append(time - since[person])
            since[person] = time + eyes.duration[person]
        if time > 0.5 * seconds:
            share.append(1 - eyes.goal.any(axis=1).mean())
    return np.array(goals), [np.array(rest) for rest in rests], float(np.mean(share))


@pytest.mark.parametrize("mode", [0, 1, 2, OFF])
def test_steps_agree_with_the_slow_twin(mode):
    eyes = Eyes(12, mode)
    slow = [oracle.Eyes() for _ in range(12)]
    if mode == OFF:
        eyes.goal[:] = eyes.offset[:] = (0.1, -0.05)
        for person in slow:
            person.goal[:], person.now[:] = (0.1, -0.05), (0.1, -0.05)
    for index in range(1, 900):
        eyes.step(1 / 60)
        for character, person in enumerate(slow):
            now = person.step(MODES, mode, 3, character, index, index / 60, 1 / 60)
            np.testing.assert_allclose(eyes.offset[character], now, atol=2e-6)
    assert eyes.offset.any() != (mode == OFF)


@pytest.mark.parametrize("rate", [30, 60, 120])
@pytest.mark.parametrize("mode", [0, 1])
def test_saccades_have_the_published_statistics(mode, rate):
    goals, rests, share = record(mode, rate, count=400 if mode == 0 else 200)
    assert len(goals) > 1000
    direction = np.round(np.arctan2(-goals[:, 0], -goals[:, 1]) / (math.pi / 4)).astype(int) % 8
    expected = oracle.SHARES[mode] / oracle.SHARES[mode].sum()
    assert stats.chisquare(np.bincount(direction, minlength=8), len(goals) * expected).pvalue > LIKELY
    magnitude, cap = np.hypot(*goals.T), SACCADES[mode].cap
    for among, factor in ((direction % 4 == 0, 1.0), (direction % 4 == 2, 0.5), (direction % 2 == 1, 0.75)):
        edges = np.concatenate([[0.0], np.linspace(0.15, 1.0, 9) * cap * factor + 1e-6])
        shares = [oracle.magnitude_share(a, b, cap * factor) for a, b in pairwise(edges)]
        counts = np.histogram(magnitude[among], edges)[0]
        assert counts.sum() == among.sum(), "never above the cap"
        assert stats.chisquare(counts, among.sum() * np.array(shares) / sum(shares)).pvalue > LIKELY
    away = SACCADES[mode].away_interval
    # A rest is seen at whole frames.
    assert rests[1].mean() == pytest.approx(away[0] / 30, abs=0.05 * away[0] / 30 + 0.5 / rate)
    assert rests[1].std() == pytest.approx(away[1] / 30, rel=0.15)
    assert share == pytest.approx(SACCADES[mode].target_share, abs=0.05)


@pytest.mark.parametrize("mode", [0, 1, 2])
def test_intervals_are_log_normal_with_the_published_mean_and_spread(mode):
    for kind, (mean, spread) in enumerate((SACCADES[mode].target_interval, SACCADES[mode].away_interval)):
        mu, sigma = MODES.interval_log_mean[mode, kind], MODES.interval_log_spread[mode, kind]
        assert stats.lognorm(sigma, scale=math.exp(mu)).mean() == pytest.approx(mean / 30)
        assert stats.lognorm(sigma, scale=math.exp(mu)).std() == pytest.approx(spread / 30)
    # One frame is short against the intervals of this mode.
    rests = record(mode, 120, 300, 60.0)[1][1]
    mu, sigma = MODES.interval_log_mean[mode, 1], MODES.interval_log_spread[mode, 1]
    edges = stats.lognorm(sigma, scale=math.exp(mu)).ppf(np.linspace(0, 1, 9))
    short = rests[rests < 20.0] - 0.5 / 120
    shares = np.full(8, 1 / 8)
    if mode < 2:
        assert stats.chisquare(np.histogram(short, edges)[0], len(short) * shares).pvalue > LIKELY


def test_a_saccade_is_quick_smooth_and_takes_the_published_time():
    eyes = Eyes(300, 1)
    dt = 1 / 2000
    last, fastest = eyes.offset.copy(), np.zeros(300)
    for _ in range(6000):
        eyes.step(dt)
        fastest = np.maximum(fastest, np.linalg.norm(np.degrees(eyes.offset - last), axis=1) / dt)
        last = eyes.offset.copy()
    assert 300 < fastest.max() < 900
    way = np.degrees(np.linalg.norm(eyes.goal - eyes.start, axis=1))
    jumped = way > 0
    np.testing.assert_allclose(eyes.duration[jumped], 0.025 + 0.0024 * way[jumped], atol=1e-5)


def test_people_do_not_jump_together():
    eyes = Eyes(500, 0)
    for _ in range(60):
        eyes.step(1 / 60)
    assert 0.02 < (eyes.offset != 0).any(axis=1).mean() < 0.5


def test_resting_eyes_turn_within_their_limits(rng):
    count, eye = 6, np.array([8, 9], np.int32)
    quaternions = rng.normal(0, 0.1, (count, 56, 4)) + [1, 0, 0, 0]
    quaternions /= np.linalg.norm(quaternions, axis=2, keepdims=True)
    rows = np.array([quaternions_to_row(q) for q in quaternions])
    before = rows.copy()
    offset = rng.normal(0, 0.4, (count, 2)).astype(np.float32)
    offset[0] = 0
    offset_eyes_crowd(eye, 0.6, 0.7, offset, np.arange(count, dtype=np.int32), rows)
    for character in range(count):
        old, new = row_to_quaternions(before[character]), row_to_quaternions(rows[character])
        limited = offset[character] / max(np.hypot(*(offset[character] / (0.6, 0.7))), 1)
        angle = np.linalg.norm(limited)
        turn = np.array([np.cos(angle / 2), *(np.sin(angle / 2) * limited / max(angle, 1e-12)), 0])
        for joint in eye:
            np.testing.assert_allclose(matrix(new[joint]), matrix(old[joint]) @ matrix(turn), atol=1e-5)
        others = np.delete(np.arange(64), eye)
        np.testing.assert_array_equal(new[others], old[others])
