"""Slow twins of `crowd_kernels.random`: plain Python integers, masked to 64 bits."""

import math

MASK = 2**64 - 1


def mix(x, key):
    x = ((x ^ (key & MASK)) + 0x9E3779B97F4A7C15) & MASK
    x = ((x ^ (x >> 30)) * 0xBF58476D1CE4E5B9) & MASK
    x = ((x ^ (x >> 27)) * 0x94D049BB133111EB) & MASK
    return x ^ (x >> 31)


def uniform(seed, character, step, purpose):
    bits = 0
    for key in (seed, character, step, purpose):
        bits = mix(bits, key)
    return (bits >> 11) / 2**53


def normal(seed, character, step, purpose):
    radius = math.sqrt(-2 * math.log(1 - uniform(seed, character, step, purpose)))
    return radius * math.cos(2 * math.pi * uniform(seed, character, step, ~purpose))
