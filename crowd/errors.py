"""Errors of the engine: one base, few kinds, and one form of message.

Every message says what is wrong and where, what was found and what is allowed; for an unknown name the
nearest known ones come first.
"""

import difflib
from collections.abc import Iterable


class CrowdError(Exception):
    """Base of every error that a user of the engine can cause or meet."""


class ScenarioError(CrowdError):
    """A scenario cannot be read, or asks for something impossible."""


class MotionError(CrowdError):
    """A motion library, a clip or a skeleton is unusable."""


class RecordingError(CrowdError):
    """A recording cannot be written or read."""


class SettingsError(CrowdError):
    """An argument or an option is outside what is allowed."""


def describe(where: str, what: str, got: object = None, allowed: str | None = None) -> str:
    """Form one line: where, what, got, allowed.

    Parameters
    ----------
    where : str
        File and key, for example ``"plaza.toml: characters[3].radius"``.
    what : str
        What is wrong, without a full stop.
    got : object, optional
        The value found; left out when None.
    allowed : str, optional
        What would be accepted.

    Returns
    -------
    str
        ``"plaza.toml: characters[3].radius: must be positive; got -0.2; allowed 0.1 to 2"``.
    """
    parts = [f"{where}: {what}"]
    if got is not None:
        parts.append(f"got {got!r}" if isinstance(got, str) else f"got {got}")
    if allowed is not None:
        parts.append(f"allowed {allowed}")
    return "; ".join(parts)


def nearest_first(name: str, known: Iterable[str], shown: int = 8) -> str:
    """List known names for a message, those most like `name` first, quoted and separated by commas."""
    names = sorted(known)
    near = difflib.get_close_matches(name, names, n=shown, cutoff=0.5)
    ordered = near + [other for other in names if other not in near]
    listed = ", ".join(f'"{other}"' for other in ordered[:shown])
    return listed + (f" and {len(ordered) - shown} more" if len(ordered) > shown else "")
