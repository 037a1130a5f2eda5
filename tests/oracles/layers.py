"""Slow twin of the key look-up of `crowd_kernels.layers`."""

import numpy as np


def key_at(time, first_key, key_count, key_rate, is_cyclic):
    """Interpolate the key numbers themselves: returns the fractional key position inside the clip."""
    position = time * key_rate
    if is_cyclic:
        return first_key + np.mod(position, key_count)
    return first_key + np.clip(position, 0, key_count - 1)
