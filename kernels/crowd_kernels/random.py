"""Counter-based random numbers: a hash of (seed, character, step, purpose) and nothing else."""

import math

import numpy as np

from crowd_kernels._jit import kernel

GOLDEN = np.uint64(0x9E3779B97F4A7C15)
MIX_A = np.uint64(0xBF58476D1CE4E5B9)
MIX_B = np.uint64(0x94D049BB133111EB)
SHIFT_30 = np.uint64(30)
SHIFT_27 = np.uint64(27)
SHIFT_31 = np.uint64(31)
SHIFT_11 = np.uint64(11)


@kernel
def mix(x: np.uint64, key: int) -> np.uint64:
    """Fold one key into a hash.

    Parameters
    ----------
    x : uint64
        Hash so far.
    key : int
        Any 64-bit integer.

    Returns
    -------
    uint64
        New hash; all its bits depend on all bits of both.

    Notes
    -----
    **Source:** SplitMix64 finaliser (Steele, Lea, Flood, "Fast splittable pseudorandom number generators",
    2014; Vigna's public-domain constants).
    """
    x = (x ^ np.uint64(key)) + GOLDEN
    x = (x ^ (x >> SHIFT_30)) * MIX_A
    x = (x ^ (x >> SHIFT_27)) * MIX_B
    return x ^ (x >> SHIFT_31)


@kernel
def uniform(seed: int, character: int, step: int, purpose: int) -> float:
    """Draw a uniform number in [0, 1) that depends on its four keys only.

    Parameters
    ----------
    seed, character, step, purpose : int
        Keys. Different purposes give independent streams.

    Returns
    -------
    float
        Multiple of 2^-53.

    Notes
    -----
    **Source:** counter-based generation (Salmon et al., "Parallel random numbers: as easy as 1, 2, 3", 2011),
    with the hash of `mix`.
    """
    bits = mix(mix(mix(mix(np.uint64(0), seed), character), step), purpose)
    return np.float64(bits >> SHIFT_11) * 2.0**-53


@kernel
def normal(seed: int, character: int, step: int, purpose: int) -> float:
    """Draw a standard normal number that depends on its four keys only.

    Parameters
    ----------
    seed, character, step, purpose : int
        Keys as in `uniform`; `purpose` and its bitwise complement are used.

    Returns
    -------
    float
        Mean 0, standard deviation 1.

    Notes
    -----
    **Source:** Box and Muller, 1958.
    """
    first = uniform(seed, character, step, purpose)
    second = uniform(seed, character, step, ~purpose)
    return math.sqrt(-2.0 * math.log(1.0 - first)) * math.cos(2.0 * math.pi * second)
