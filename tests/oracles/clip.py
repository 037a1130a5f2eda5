"""Slow twins of `crowd_kernels.clip`: one joint at a time, in double precision."""

import numpy as np


def blend(keys, frame, next_frame, fraction, weight):
    """Weighted mean of keys (rows or vectors) between two keys each."""
    total = 0
    for before, after, share, part in zip(frame, next_frame, fraction, weight, strict=True):
        total = total + part * ((1 - share) * keys[before].astype(float) + share * keys[after].astype(float))
    return total / np.sum(weight, dtype=float)


def mix(pose, rotation, share):
    """Mix (J, 4) rotations onto a pose by (J,) shares, the short way."""
    mixed = []
    for old, new, part in zip(pose, rotation, share, strict=True):
        new = new / np.linalg.norm(new)
        if old @ new < 0:
            new = -new
        both = (1 - part) * old + part * new
        mixed.append(both / np.linalg.norm(both))
    return np.array(mixed)
