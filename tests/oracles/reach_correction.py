"""Slow twin of `crowd_kernels.reach_correction`: one joint after another, rotations as SciPy's, float64."""

import numpy as np

from tests.oracles.ik import quaternion, rotation


def started(tree, task, vector, local):
    """Local rotations (K, 4) of a blended pose, turned by corrections (K, 3) where a task (E,) is near."""
    result = np.array(local, float)
    for k in np.flatnonzero(tree.moves[np.array(task) != 0].any(axis=0)):
        scalar = np.sqrt(max(1 - vector[k] @ vector[k], 0))
        result[k] = quaternion(rotation([scalar, *vector[k]]) * rotation(local[k]))
    return result


def kept(tree, solution, local):
    """Corrections (K, 3) that turn a blended pose into a solution; zero where the tree does not turn."""
    result = np.zeros((len(tree.joint), 3))
    for k in np.flatnonzero(tree.weight > 0):
        turn = quaternion(rotation(solution[k]) * rotation(local[k]).inv())
        result[k] = turn[1:] * (1 if turn[0] >= 0 else -1)
    return result
