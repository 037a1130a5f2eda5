"""People who get nowhere are noticed and ranked; others keep their rights."""

import numpy as np

from crowd.navigation.patience import Patience, PatienceSettings
from tests.oracles import patience as oracle

DT = 0.05
COUNT = 40


def run(seconds, speed, seed=1):
    """People who walk at shares of their wish; returns patience, responsibilities and tracks."""
    patience = Patience(COUNT, PatienceSettings())
    position = np.zeros((COUNT, 3))
    everyone = np.arange(COUNT, dtype=np.int32)
    track = [position.copy()]
    for step in range(round(seconds / DT)):
        preferred = np.tile([1.3, 0.0, 0.4], (COUNT, 1))
        responsibility, mobility = np.full(COUNT, 0.5), np.ones(COUNT)
        patience.update(position, preferred, everyone, DT, seed, step, responsibility, mobility)
        position = position + DT * speed[:, None] * preferred
        track.append(position.copy())
    return patience, responsibility, mobility, np.array(track)


def test_waiting_times_match_the_oracle():
    speed = np.linspace(0, 1, COUNT)
    patience, _, _, track = run(5.0, speed)
    for person in range(COUNT):
        wanted = oracle.wait(track[:-1, person], np.array([1.3, 0, 0.4]), patience._limits, DT)
        assert abs(patience.waiting[person] - wanted) < DT + 1e-9


def test_only_those_who_wait_are_ranked_and_ranks_differ():
    speed = np.where(np.arange(COUNT) < 20, 0.0, 0.9)
    _, responsibility, mobility, _ = run(5.0, speed)
    assert (responsibility[20:] == 0.5).all()
    assert (mobility[20:] == 1.0).all()
    assert (responsibility[:20] < 0.5).all()
    assert len(np.unique(responsibility[:20])) == 20
    assert responsibility[:20].min() < 1e-3 * responsibility[:20].max()


def test_ranks_change_in_time_and_repeat_with_the_seed():
    standing = np.zeros(COUNT)
    first, later = run(4.0, standing)[1], run(8.0, standing)[1]
    assert (first != later).any()
    np.testing.assert_array_equal(first, run(4.0, standing)[1])
    assert (first != run(4.0, standing, seed=2)[1]).any()
