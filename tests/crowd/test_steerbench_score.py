"""SteerBench scores against the values that the definitions give by hand."""

import numpy as np
import pytest
import shapely

from crowd.bench.steerbench_score import BEGIN_DEPTH, END_GAP, Score, SteerBenchScores

NOTHING = shapely.STRtree([])


def run(positions, rate, radius=0.5, obstacles=NOTHING, present=None):
    """Feed positions (frame, N, 2) at a rate; returns the scores object."""
    scores = SteerBenchScores(np.full(positions.shape[1], radius), obstacles)
    for frame, position in enumerate(positions):
        is_there = np.ones(positions.shape[1], bool) if present is None else present[frame]
        scores.add(frame / rate, position, is_there)
    return scores


def straight(length, speed, rate):
    """A mover at constant speed that is taken out in the frame after it has come within 0.5 m of its goal."""
    frames = int(np.ceil((length - 0.5) * rate / speed)) + 1
    x = np.arange(frames + 1) * speed / rate
    positions = np.stack([x, 0 * x], axis=1)[:, None]
    present = np.append(True, length - x[:-1] > 0.5)[:, None]
    return positions, present


@pytest.mark.parametrize(("length", "composite"), [(11.0, 144.99), (9.0, 117.245)])
def test_ideal_movers_of_simple_2_and_simple_3(length, composite):
    positions, present = straight(length, 1.3, 20.0)
    scores = run(positions, 20.0, present=present)
    assert scores.classic.composite_01 == pytest.approx(composite, abs=0.01)


def curve(rate):
    time = np.arange(0, 8, 1 / rate)
    x = np.stack([1.3 * time + 0.1 * np.sin(time), 0.4 * np.sin(0.8 * time)], axis=1)
    return x[:, None]


def test_step_free_scores_do_not_depend_on_the_rate():
    values = [run(curve(rate), rate).step_free for rate in (20.0, 60.0, 120.0)]
    for value in values[1:]:
        assert value.composite_01 == pytest.approx(values[0].composite_01, rel=0.01)
        assert value.composite_02 == pytest.approx(values[0].composite_02, rel=0.01)


def test_classic_scores_are_taken_at_20_hz_whatever_the_step():
    values = [run(curve(rate), rate).classic.composite_02 for rate in (20.0, 60.0, 90.0)]
    assert values[1] == pytest.approx(values[0], rel=0.01)
    assert values[2] == pytest.approx(values[0], rel=0.01)


def test_two_discs_that_overlap_for_a_while_have_one_collision_each():
    time = np.arange(0, 3, 0.05)
    gap = np.where((time > 1.0) & (time <= 1.4), 0.95, 1.3)
    positions = np.stack([np.zeros((len(time), 2)), np.stack([gap, 0 * gap], axis=1)], axis=1)
    scores = run(positions, 20.0)
    assert scores.classic.collisions == 1.0
    assert scores.step_free.collisions == 1.0
    assert scores.deepest == pytest.approx(0.05)


def test_a_collision_that_flickers_around_contact_counts_once():
    time = np.arange(0, 2, 0.05)
    gap = 1.0 + 0.004 * np.where(np.arange(len(time)) % 2, 1, -1)
    positions = np.stack([np.zeros((len(time), 2)), np.stack([gap, 0 * gap], axis=1)], axis=1)
    score = Score(np.full(2, 0.5), BEGIN_DEPTH, END_GAP, NOTHING)
    for position in positions:
        score.add(position, np.ones(2, bool), 0.05)
    assert score.scores().collisions == 1.0


def test_a_disc_inside_a_box_penetrates_by_its_radius():
    box = shapely.STRtree([shapely.box(-2, -2, 2, 2)])
    scores = run(np.zeros((10, 1, 2)), 20.0, obstacles=box)
    assert scores.deepest == pytest.approx(0.5)
    assert scores.classic.collisions == 1.0
