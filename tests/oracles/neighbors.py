"""Nearest neighbours by measuring every pair."""

import numpy as np


def nearest(position_world, active, reach, wanted):
    """Return for each active character the (number, distance) of its neighbours, nearest first."""
    position = np.asarray(position_world)
    present = [c for c in active if np.all(np.isfinite(position[c, [0, 2]]))]
    lists = {}
    for own in present:
        others = []
        for other in present:
            step = position[other] - position[own]
            squared = np.float32(step[0] ** 2 + step[2] ** 2)
            if other != own and squared < np.float32(reach**2):
                others.append((float(squared), int(other)))
        others.sort()
        lists[int(own)] = [(number, squared**0.5) for squared, number in others[:wanted]]
    return lists
