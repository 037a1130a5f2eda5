"""Numbers, vectors, rotations, times and seeds that programs give, checked."""

import operator
from typing import Any, SupportsFloat, SupportsIndex

import numpy as np
import numpy.typing as npt

from crowd.errors import SettingsError, describe

LONGEST = 86_400.0
"""Longest run, s: a day is more than any crowd needs, and a slip of units asks for more."""
LARGEST_SEED = 2**63 - 1
"""What the whole numbers of 64 bits hold with which random numbers are made."""
SHOWN_BITS = 128
"""Longest whole number that messages show; Python writes no number of more than 4,300 digits at all."""
SHOWN_LENGTH = 200
"""Longest text of values that messages show, characters."""
REAL_KINDS = "iufO"
"""Kinds of NumPy types that are real numbers, or objects that may be; no truth values, text, complex ones."""


def number(what: str, name: str, value: SupportsFloat, allowed: str) -> float:
    """Read one number; that it is in its range remains to be checked.

    Parameters
    ----------
    what, name : str
        Command and argument, for messages.
    value : number
        Text is refused, also such as looks like a number; so are truth values and complex numbers.
    allowed : str
        The range, for messages.

    Raises
    ------
    SettingsError
        It is no number, or is too large for one.
    """
    try:
        array = np.asarray(value)
        if array.ndim or array.dtype.kind not in REAL_KINDS:
            raise TypeError
        return float(value)
    except (TypeError, ValueError):
        raise SettingsError(describe(what, f"{name} is not a number", shown(value), allowed)) from None
    except OverflowError:
        raise SettingsError(describe(what, f"{name} is too large", shown(value), allowed)) from None


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
        given = np.asarray(value)
        if given.dtype.kind not in REAL_KINDS:
            raise TypeError
        array = given.astype(np.float64)
    except (TypeError, ValueError):
        raise SettingsError(describe(what, f"{name} is not numbers", shown(value), allowed)) from None
    except OverflowError:
        raise SettingsError(describe(what, f"{name} is too large", allowed="numbers up to 1e308")) from None
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


def checked_seed(value: SupportsIndex) -> int:
    """Read the key of random choices.

    Raises
    ------
    SettingsError
        It is no whole number of 64 bits.
    """
    return whole_number("seed", value, -LARGEST_SEED - 1, LARGEST_SEED)


def whole_number(what: str, value: SupportsIndex, least: int, most: int) -> int:
    """Read a whole number from a range.

    Parameters
    ----------
    what : str
        Argument, for messages.
    value : int
        Truth values are refused.
    least, most : int

    Raises
    ------
    SettingsError
        It is no whole number, or outside the range.
    """
    try:
        if isinstance(value, bool | np.bool_):
            raise TypeError
        whole = operator.index(value)
    except TypeError:
        raise SettingsError(describe(what, "is no whole number", shown(value), "a whole number")) from None
    if not least <= whole <= most:
        got = whole if whole.bit_length() <= SHOWN_BITS else shown(whole)
        raise SettingsError(describe(what, "is out of range", got, f"{least} to {most}"))
    return whole


def shown(value: Any) -> str:
    """What somebody gave, in one line: of a very long number its length, of long text the beginning."""
    if isinstance(value, int) and value.bit_length() > SHOWN_BITS:
        return f"a whole number of {value.bit_length()} bits"
    try:
        text = " ".join(str(value).split())
    except ValueError:
        return f"{type(value).__name__} with a number too long to show"
    return text if len(text) <= SHOWN_LENGTH else f"{text[: SHOWN_LENGTH - 3]}..."


def checked_seconds(what: str, seconds: SupportsFloat) -> float:
    """Read a length of time to simulate, s.

    Raises
    ------
    SettingsError
        It is no number, below 0, or longer than a day.
    """
    allowed = f"0 to {LONGEST:g} s"
    length = number(what, "seconds", seconds, allowed)
    if not 0.0 <= length <= LONGEST:
        raise SettingsError(describe(what, "seconds are out of range", length, allowed))
    return length
