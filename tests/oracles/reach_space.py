"""Slow twin of the reach look-up: all distances, sorted."""

import numpy as np


def find_examples(point, clip, weight, position):
    """Weights of examples as a dictionary, by the four nearest of all points."""
    distance = np.linalg.norm(point - position, axis=1)
    near = np.argsort(distance, kind="stable")[:4]
    inverse = 1.0 / np.maximum(distance[near], 1e-6)
    share = inverse - (inverse[-1] if len(near) == 4 else 0.0)
    share = share / share.sum() if share.sum() > 0 else np.full(len(near), 1.0 / len(near))
    result = {}
    for one, part in zip(near, share, strict=True):
        for number, own in zip(clip[one], weight[one], strict=True):
            if part * own > 0:
                result[int(number)] = result.get(int(number), 0.0) + part * own
    return result


def candidates(point, centre, half):
    """Points that are not farther than four others at all places of a cube, by comparing all pairs."""
    square = ((point - centre) ** 2).sum(axis=1)
    apart = np.abs(point[:, None] - point[None, :]).sum(axis=2)
    nearer = square[:, None] - square[None, :] > 2.0 * half * apart + 1e-12
    return np.flatnonzero(nearer.sum(axis=1) < 4).tolist()
