"""Numbers, vectors, rotations, times and seeds that programs give, checked."""

import math
import operator
from typing import SupportsFloat, SupportsIndex

import numpy as np
import numpy.typing as npt

from crowd.errors import SettingsError, describe


def number(what: str, name: str, value: SupportsFloat, allowed: str) -> float:
    """Read one number; that it is in its range remains to be checked.

    Parameters
    ----------
    what, name : str
        Command and argument, for messages.
    value : number
        Text is refused, also such as looks like a number.
    allowed : str
        The range, for messages.

    Raises
    ------
    SettingsError
        It is no number.
    """
    try:
        if isinstance(value, str | bytes):
            raise TypeError
        return float(value)
    except (TypeError, ValueError, OverflowError):
        raise SettingsError(describe(what, f"{name} is not a number", str(value), allowed)) from None


def vectors(
    what: str,
    name: str,
    value: npt.ArrayLike,
    count: int,
    lengths: tuple[int, ...] = (3,),
    *,
    must_be_finite: bool = True,
) -> npt.NDArray[np.float64]:
    """Read one vector for all characters or one for each.

    Parameters
    ----------
    what, name : str
        Command and argument, for messages.
    value : (L,) or (M, L) array
    count : int
        M, characters.
    lengths : tuple of int
        What L may be.
    must_be_finite : bool
        Otherwise the layers tell by a status what cannot be gone to.

    Returns
    -------
    (M, L) float64

    Raises
    ------
    SettingsError
        It is not numbers, of another shape, or not finite.
    """
    allowed = " or ".join(f"({length},) or ({count}, {length})" for length in lengths)
    try:
        array = np.asarray(value, np.float64)
    except (TypeError, ValueError):
        raise SettingsError(describe(what, f"{name} is not numbers", str(value), allowed)) from None
    if array.shape not in [shape for length in lengths for shape in ((length,), (count, length))]:
        raise SettingsError(describe(what, f"{name} has the wrong shape", array.shape, allowed))
    if must_be_finite and not np.isfinite(array).all():
        raise SettingsError(describe(what, f"{name} is not finite", array.tolist(), "finite numbers"))
    return np.broadcast_to(array, (count, array.shape[-1]))


def rotations_of(what: str, value: npt.ArrayLike, count: int) -> npt.NDArray[np.float64]:
    """Read one rotation (w, x, y, z) for all characters or one for each, as unit quaternions. (M, 4)

    Raises
    ------
    SettingsError
        As `vectors`, or it has no length.
    """
    quaternion = vectors(what, "rotation", value, count, (4,))
    length = np.linalg.norm(quaternion, axis=1, keepdims=True)
    if not (length > 0.0).all():
        raise SettingsError(describe(what, "rotation has no length", [0.0] * 4, "(w, x, y, z)"))
    return np.asarray(quaternion / length)


LONGEST = 86_400.0
"""Longest run, s."""
LARGEST_SEED = 2**63 - 1


def checked_seed(value: SupportsIndex) -> int:
    """Read the key of random choices.

    Raises
    ------
    SettingsError
        It is no whole number of 64 bits.
    """
    try:
        seed = operator.index(value)
    except TypeError:
        raise SettingsError(describe("seed", "is no whole number", str(value), "a whole number")) from None
    if not -LARGEST_SEED - 1 <= seed <= LARGEST_SEED:
        raise SettingsError(
            describe("seed", "is out of range", seed, f"{-LARGEST_SEED - 1} to {LARGEST_SEED}")
        )
    return seed


def require_seconds(what: str, seconds: float) -> None:
    """Refuse a length of time that cannot be simulated.

    Raises
    ------
    SettingsError
        It is no number, below 0, or longer than a day.
    """
    is_number = isinstance(seconds, int | float | np.number) and math.isfinite(seconds)
    if not is_number or not 0.0 <= seconds <= LONGEST:
        raise SettingsError(describe(what, "seconds are out of range", seconds, f"0 to {LONGEST:g} s"))
