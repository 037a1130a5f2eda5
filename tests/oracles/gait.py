"""Slow twins of `crowd_kernels.gait`: one character at a time, with the words of the definition."""

import math


def key_position(first_key, key_count, phase):
    """Key before, key after and place between them for a clip whose keys are uniform over two cycles."""
    position = (phase % 2.0) / 2.0 * key_count
    before = math.floor(position) % key_count
    return first_key + before, first_key + (before + 1) % key_count, position - math.floor(position)


def contact(contact_phase, example, weight, phase, foot):
    """What of a foot is planted: the blend's own events are the weighted means of the examples' events."""
    flat = sum(w * contact_phase[e][foot][0] for e, w in zip(example, weight, strict=True))
    lift = sum(w * contact_phase[e][foot][1] for e, w in zip(example, weight, strict=True))
    since_strike = (phase - (0.0, 0.5)[foot]) % 1.0
    if since_strike < flat:
        return "heel"
    return "ball" if since_strike < lift else "swing"
