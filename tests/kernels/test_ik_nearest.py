"""Targets out of reach: the point that a solve comes to is the nearest that limits allow."""

import numpy as np
import pytest

from crowd_kernels.ik import OUT_OF_REACH
from crowd_kernels.ik_tree import plain_tree
from crowd_kernels.joint_limit import LimitArrays
from tests.kernels.test_ik import POINT, Crowd, arm, resting
from tests.oracles import ik as oracle
from tests.oracles.nearest import Search

COUNT = 8


def random_tree(rng):
    """Three ball joints with random bones and limits."""
    quarter = oracle.quaternion(oracle.Rotation.from_rotvec([np.pi / 2, 0, 0]))
    frames = np.tile(quarter, (3, 1)).astype(np.float32)
    widest = rng.uniform(0.4, 1.4, (3, 2))
    twist = np.tan(np.stack([-rng.uniform(0.2, 1.2, 3), rng.uniform(0.2, 1.2, 3)], axis=1) / 2)
    limits = LimitArrays(
        frames,
        frames.copy(),
        (1 / np.sin(widest / 2)).astype(np.float32),
        twist.astype(np.float32),
        np.ones((3, 3), np.float32),
    )
    offset = np.array([[0, 0, 0], [0, -rng.uniform(0.2, 0.4), 0], [0, -rng.uniform(0.2, 0.4), 0]])
    return plain_tree([-1, 0, 1], offset, [2], limits=limits)


@pytest.mark.parametrize("kind", ["arm of a person", "random arm"])
def test_what_is_out_of_reach_is_approached_as_a_slow_search_does(kind, rng):
    tree = arm(first="right_upper_arm") if kind == "arm of a person" else random_tree(rng)
    rest = resting(tree)
    search = Search(tree, POINT, rest, rng)
    middle, size = search.tips.mean(axis=0), np.ptp(search.tips, axis=0).max()
    crowd = Crowd(tree, np.tile(rest, (COUNT, 1, 1)))
    crowd.task[:] = 1
    crowd.target[:, 0] = middle + rng.normal(0, 0.6 * size, (COUNT, 3))
    crowd.solve(pull=0.0, reach=1e3)
    best = np.array([search.nearest(target) for target in crowd.target[:, 0]])
    is_far = best > 5e-3
    assert is_far.sum() > COUNT // 3
    assert (crowd.status[is_far] == OUT_OF_REACH).all()
    farther = crowd.errors()[:, 0] - best
    assert np.median(farther) < 1e-3
    assert farther.max() < 0.02 * np.linalg.norm(tree.offset[1:], axis=1).sum()
