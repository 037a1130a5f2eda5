"""Slow twin of the waiting times of `crowd_kernels.patience`."""

from itertools import pairwise

import numpy as np


def wait(positions, preferred, limits, dt):
    """Waiting time of one person after a track of positions (T, 3) at a constant preferred velocity (3,)."""
    progress, waiting = 1.0, 0.0
    for before, after in pairwise(positions):
        realised = np.clip((after - before) @ preferred / dt / (preferred @ preferred), -1, 1)
        progress += (realised - progress) * min(dt / limits.memory, 1)
        waiting = waiting + dt if progress < limits.least_progress else max(waiting - 2 * dt, 0)
    return waiting
