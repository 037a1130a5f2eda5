"""The pelvis comes down softly before a leg is at its limit, and not at all for bent legs."""

import numpy as np
import pytest

from crowd_kernels.pelvis_drop import needed_drop
from tests.oracles import foot_lock as oracle


@pytest.mark.parametrize("stretch", [0.9, 0.99, 0.999])
@pytest.mark.parametrize("away", [0.0, 0.2])
def test_legs_grow_softly_to_their_limit_and_bent_ones_are_left_alone(stretch, away):
    height = np.linspace(0.3, 1.2, 4000)
    ankle = (0.1 + away, 0.05, 0.3)
    hip = [(0.1, 0.05 + high, 0.3) for high in height]
    drop = np.array([needed_drop(place, ankle, 1.0, stretch) for place in hip])
    slow = [oracle.needed_drop(np.array(place), np.array(ankle), 1.0, stretch) for place in hip]
    np.testing.assert_allclose(drop, slow, atol=1e-12)
    way, used = np.hypot(away, height), np.hypot(away, height - drop)
    assert used.max() <= stretch + 1e-12
    assert drop[way < 1 - 20 * (1 - stretch)].max(initial=0) < 1e-8
    slope = np.diff(used) / np.diff(way)
    assert slope.min() > -1e-9
    assert slope.max() < 1 + 1e-9
    assert np.abs(np.diff(slope)).max() < 1.1 * np.diff(way).max() / (1 - stretch)
