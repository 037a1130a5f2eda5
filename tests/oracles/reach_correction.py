"""Slow twin of `crowd_kernels.reach_correction`: one joint after another, rotations as SciPy's, float64."""

import numpy as np

from tests.oracles.ik import quaternion, rotation


def started(tree, task, share, vector, local):
    """Local rotations (K, 4) of a blend, turned by shares (E,) of corrections (K, 3) where tasks (E,) are."""
    result = np.array(local, float)
    for k, moved in enumerate((tree.moves != 0).T & (np.array(task) != 0)):
        if moved.any():
            turn = np.max(np.asarray(share, float)[moved]) * vector[k]
            scalar = np.sqrt(max(1 - turn @ turn, 0))
            result[k] = quaternion(rotation([scalar, *turn]) * rotation(local[k]))
    return result


def last(tree, task, share, previous, start):
    """Rotations (K, 4) from which joints approach limits: previous ones, less by what is not kept."""
    result = np.array(previous, float)
    for k, moved in enumerate((tree.moves != 0).T & (np.array(task) != 0)):
        own = np.max(np.asarray(share, float)[moved], initial=0) ** 2 if np.any(previous[k]) else 0
        before = result[k] * (1 if result[k] @ start[k] >= 0 else -1)
        mixed = own * before + (1 - own) * start[k]
        result[k] = mixed / np.linalg.norm(mixed)
    return result


def kept(tree, solution, local):
    """Corrections (K, 3) that turn a blended pose into a solution; zero where the tree does not turn."""
    result = np.zeros((len(tree.joint), 3))
    for k in np.flatnonzero(tree.weight > 0):
        turn = quaternion(rotation(solution[k]) * rotation(local[k]).inv())
        result[k] = turn[1:] * (1 if turn[0] >= 0 else -1)
    return result
