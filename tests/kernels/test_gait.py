"""Key frames and foot contacts of blended examples at a gait phase."""

import numpy as np

from crowd_kernels.gait import contact_crowd, sample_crowd
from tests.oracles import gait as oracle

COUNT = 200


def make(rng):
    example = rng.integers(0, 5, (COUNT, 4)).astype(np.int32)
    weight = rng.dirichlet(np.ones(4), COUNT)
    return example, weight, rng.uniform(0, 2, COUNT), np.arange(COUNT, dtype=np.int32)


def test_samples_match_oracle_and_wrap(rng):
    example, weight, phase, active = make(rng)
    phase[:3] = (0.0, np.nextafter(2.0, 0), 1.999)
    clip = np.array([4, 0, 2, 1, 3], np.int32)
    count = np.array([128, 64, 96, 128, 32], np.int32)
    first = np.concatenate([[0], np.cumsum(count)[:-1]]).astype(np.int32)
    frame, following = np.zeros((2, COUNT, 4), np.int32)
    fraction, out_weight = np.zeros((2, COUNT, 4), np.float32)
    sample_crowd(clip, first, count, example, weight, phase, active, frame, following, fraction, out_weight)
    for c in range(COUNT):
        for corner in range(4):
            number = clip[example[c, corner]]
            key, after, share = oracle.key_at(phase[c], count[number])
            assert frame[c, corner] == first[number] + key
            assert following[c, corner] == first[number] + after
            assert abs(fraction[c, corner] - share) < 1e-4
    np.testing.assert_allclose(out_weight, weight, atol=1e-7)


def test_contacts_match_oracle(rng):
    example, weight, phase, active = make(rng)
    contact_phase = np.sort(rng.uniform(0.0, 0.8, (5, 2, 2)), axis=2)
    out = np.zeros((COUNT, 2), np.uint8)
    contact_crowd(contact_phase, example, weight, phase, active, out)
    for c in range(COUNT):
        for foot in range(2):
            assert out[c, foot] == oracle.contact(contact_phase[example[c], foot], weight[c], phase[c], foot)
    assert set(np.unique(out)) == {0, 1, 2}


def test_feet_take_turns_in_a_walk():
    contact_phase = np.tile([0.1, 0.58], (1, 2, 1))
    phase = np.linspace(0, 2, 400, endpoint=False)
    zero = np.zeros((400, 4), np.int32)
    weight = np.tile([1.0, 0, 0, 0], (400, 1))
    out = np.zeros((400, 2), np.uint8)
    contact_crowd(contact_phase, zero, weight, phase, np.arange(400, dtype=np.int32), out)
    planted = out > 0
    assert planted.any(axis=1).all(), "one foot is always down"
    assert abs(planted.mean(axis=0) - 0.58).max() < 0.01
    assert abs(planted.all(axis=1).mean() - 0.16) < 0.02
