"""Slow twin of `crowd_kernels.reach_correction`: one joint after another, rotations as SciPy's, float64."""

import numpy as np

from tests.oracles.ik import join, quaternion, rotation, split


def started(tree, task, share, vector, local):
    """Local rotations (K, 4) of a blend, turned by shares (E,) of corrections (K, 3) where tasks (E,) are."""
    result = np.array(local, float)
    for k, moved in enumerate((tree.moves != 0).T & (np.array(task) != 0)):
        if moved.any():
            turn = np.max(np.asarray(share, float)[moved]) * vector[k]
            scalar = np.sqrt(max(1 - turn @ turn, 0))
            result[k] = quaternion(rotation([scalar, *turn]) * rotation(local[k]))
    return result


def last(tree, task, bound, previous, start):
    """Rotations (K, 4) from which joints approach limits: previous ones, as far as joints are bound (E,)."""
    result = np.array(previous, float)
    for k, moved in enumerate((tree.moves != 0).T & (np.array(task) != 0)):
        own = np.max(np.asarray(bound, float)[moved], initial=0) if np.any(previous[k]) else 0
        before = result[k] * (1 if result[k] @ start[k] >= 0 else -1)
        mixed = own * before + (1 - own) * start[k]
        result[k] = mixed / np.linalg.norm(mixed)
    return result


def kept(tree, solution, local):
    """Corrections (K, 3) that turn a blended pose into a solution; zero where the tree does not turn."""
    result = np.zeros((len(tree.joint), 3))
    for k in np.flatnonzero(tree.weight > 0):
        result[k] = kept_turn(solution[k], local[k])
    return result


def eased(tree, k, solved, local, expected, most):
    """Rotation of joint k that is no farther than `most` from the expected correction, within its limits."""
    away = kept_turn(solved, local) - expected
    if np.linalg.norm(away) <= most:
        return np.array(solved, float)
    turn = expected + most / np.linalg.norm(away) * away
    result = quaternion(rotation([np.sqrt(max(1 - turn @ turn, 0)), *turn]) * rotation(local))
    if not tree.is_limited[k]:
        return result
    swing, twist = split(tree, k, result)
    own_swing, own_twist = split(tree, k, solved)
    free = np.asarray(tree.is_free[k], float)
    swing = own_swing + free[:2] * (swing - own_swing)
    twist = own_twist + free[2] * (twist - own_twist)
    low, high = 2 * np.arctan(np.asarray(tree.twist[k], float))
    twist = np.clip(twist, min(low, own_twist), max(high, own_twist))
    size = np.linalg.norm(swing * tree.inverse_swing[k])
    largest = max(1, np.linalg.norm(own_swing * tree.inverse_swing[k]))
    return quaternion(join(tree, k, swing * min(1, largest / max(size, 1e-12)), twist))


def kept_turn(solved, local):
    """Correction (3,) that turns a blended rotation into a solution."""
    turn = quaternion(rotation(solved) * rotation(local).inv())
    return turn[1:] * (1 if turn[0] >= 0 else -1)
