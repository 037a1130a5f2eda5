"""Overlapping discs pushed apart, pair after pair."""

import numpy as np


def pairs_by_character(position_world, radius, margin):
    """Partners with larger numbers that nearly touch, nearest first, for each character."""
    count = len(radius)
    lists = []
    for first in range(count):
        near = []
        for second in range(first + 1, count):
            step = position_world[second] - position_world[first]
            squared = np.float32(step[0] ** 2 + step[2] ** 2)
            if squared <= (radius[first] + radius[second] + margin) ** 2:
                near.append((squared, second))
        lists.append([second for _, second in sorted(near)])
    return lists


def relax(position_world, radius, mobility, margin, full_passes, most_passes, wanted_depth):
    """Positions after the passes, in the order of the kernel: forwards, backwards, forwards, ..."""
    position = np.array(position_world, float)
    lists = pairs_by_character(position, radius, margin)
    for sweep in range(most_passes):
        threshold = 0.0 if sweep < full_passes else wanted_depth
        deepest = 0.0
        order = range(len(radius)) if sweep % 2 == 0 else range(len(radius) - 1, -1, -1)
        for first in order:
            for second in lists[first]:
                total = mobility[first] + mobility[second]
                if total == 0.0:
                    continue
                step = (position[second] - position[first])[[0, 2]]
                distance = np.linalg.norm(step)
                depth = radius[first] + radius[second] - distance
                deepest = max(deepest, depth)
                if depth > threshold:
                    push = depth * step / distance
                    position[first, [0, 2]] -= push * mobility[first] / total
                    position[second, [0, 2]] += push * mobility[second] / total
        if deepest <= 0.0 or (deepest <= wanted_depth and sweep + 1 >= full_passes):
            break
    return position


def deepest_overlap(position_world, radius):
    """Deepest overlap of any pair, m, >= 0."""
    step = position_world[:, None, [0, 2]] - position_world[None, :, [0, 2]]
    depth = radius[:, None] + radius[None, :] - np.linalg.norm(step, axis=-1)
    np.fill_diagonal(depth, -np.inf)
    return max(float(depth.max(initial=0.0)), 0.0)
