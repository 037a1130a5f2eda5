"""Text files as lines and tokens, with errors that name the line."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NoReturn

import numpy as np

from crowd.errors import MotionError, describe
from crowd.motion.source import FloatArray

MAXIMUM_BYTES = 2**30
MAXIMUM_NUMBER = 1e12
"""Larger numbers are no angles, lengths or times, and their squares overflow."""
WORD = re.compile(r"[{}]|[^\s{}]+")
_INTEGER = re.compile(r"[+-]?[0-9]{1,18}")


def read_bytes(path: Path) -> bytes:
    """Content of a file that exists and is of sensible size."""
    if not path.is_file():
        raise MotionError(describe(str(path), "there is no such file"))
    try:
        size = path.stat().st_size
        if size > MAXIMUM_BYTES:
            raise MotionError(describe(str(path), "is too large", f"{size} bytes", f"{MAXIMUM_BYTES}"))
        return path.read_bytes()
    except OSError as error:
        raise MotionError(describe(str(path), f"cannot be read ({error.strerror})")) from error


def at_line(path: Path, line: int) -> str:
    """Where something is, for a message; lines count from 1."""
    return f"{path}:{line}"


def number(token: str, path: Path, line: int, what: str) -> float:
    """Value of a token that must be a finite number of sensible size."""
    try:
        value = float(token) if token.isascii() and "_" not in token else math.nan
    except ValueError:
        value = math.nan
    if not abs(value) <= MAXIMUM_NUMBER:
        raise MotionError(describe(at_line(path, line), f"{what} must be a finite number", token[:60]))
    return value


class TextFile:
    """A text file, by lines.

    Attributes
    ----------
    path : Path
    lines : list of str
        Without line ends.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        content = read_bytes(path)
        if content.startswith((b"\xff\xfe", b"\xfe\xff")):
            self.fail(1, "is UTF-16 text", allowed="UTF-8 or Latin-1")
        zero = content.find(b"\0")
        if zero >= 0:
            self.fail(content.count(b"\n", 0, zero) + 1, "is no text: holds a zero byte")
        try:
            text = content.decode("utf-8-sig")
        except UnicodeDecodeError:
            text = content.decode("latin-1")
        self.lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")

    def fail(self, line: int, what: str, got: object = None, allowed: str | None = None) -> NoReturn:
        """Raise a `MotionError` about a line, counted from 1."""
        shown = got[:60] if isinstance(got, str) else got
        raise MotionError(describe(at_line(self.path, line), what, shown, allowed))

    def number(self, token: str, line: int, what: str) -> float:
        """Value of a token that must be a finite number."""
        return number(token, self.path, line, what)

    def integer(self, token: str, line: int, what: str) -> int:
        """Value of a token that must be an integer that is not negative."""
        if not _INTEGER.fullmatch(token) or int(token) < 0:
            self.fail(line, f"{what} must be a count", token)
        return int(token)

    def table(self, rows: Sequence[str], lines: Sequence[int], width: int, what: str) -> FloatArray:
        """Rows of `width` numbers each; `lines` are their line numbers, `what` names one row.

        Returns
        -------
        (rows, width) float64
        """
        try:
            values = np.loadtxt(rows, np.float64, comments=None, ndmin=2)
        except ValueError:
            values = np.empty((0, 0))
        is_sound = values.shape == (len(rows), width) and bool((np.abs(values) <= MAXIMUM_NUMBER).all())
        if not is_sound:
            self._fail_at_row(rows, lines, width, what)
        return values

    def _fail_at_row(self, rows: Sequence[str], lines: Sequence[int], width: int, what: str) -> NoReturn:
        for row, line in zip(rows, lines, strict=True):
            tokens = row.split()
            for token in tokens:
                self.number(token, line, f"each value of {what}")
            if len(tokens) != width:
                self.fail(line, f"{what} must hold {width} numbers", len(tokens))
        self.fail(lines[0], f"{what} cannot be read")


class Tokens:
    """Tokens of a text file in order, one ahead.

    Attributes
    ----------
    line : int
        Line of the token taken last, from 1.
    """

    def __init__(self, text: TextFile, pattern: re.Pattern[str] = WORD, comment: str | None = None) -> None:
        self.text = text
        self.line = 1
        self._pattern = pattern
        self._comment = comment
        self._stream = self._scan()
        self._next = next(self._stream, None)

    def _scan(self) -> Iterator[tuple[str, int]]:
        for number, line in enumerate(self.text.lines, 1):
            content = line if self._comment is None else line.partition(self._comment)[0]
            for token in self._pattern.findall(content):
                yield token, number

    def peek(self) -> str | None:
        """Next token, not taken; None at the end."""
        return None if self._next is None else self._next[0]

    def next_line(self) -> int:
        """Line of the next token; that of the last at the end."""
        return self.line if self._next is None else self._next[1]

    def take(self, what: str) -> str:
        """Take the next token; `what` says what should stand there."""
        if self._next is None:
            self.text.fail(len(self.text.lines), f"ends where {what} should follow")
        token, self.line = self._next
        self._next = next(self._stream, None)
        return token

    def take_number(self, what: str) -> float:
        """Take a finite number."""
        token = self.take(what)
        return self.text.number(token, self.line, what)

    def take_numbers(self, count: int, what: str) -> tuple[float, ...]:
        """Take finite numbers."""
        return tuple(self.take_number(what) for _ in range(count))

    def take_integer(self, what: str) -> int:
        """Take a count."""
        token = self.take(what)
        return self.text.integer(token, self.line, what)

    def take_name(self, what: str) -> str:
        """Take everything up to an opening brace, and the brace."""
        words: list[str] = []
        while True:
            token = self.take(what)
            if token == "{":
                break
            if token == "}":
                self.fail(f"{what} should stand here", token)
            words.append(token)
        if not words:
            self.fail(f"{what} is missing")
        return " ".join(words).strip('"')

    def fail(self, what: str, got: object = None, allowed: str | None = None) -> NoReturn:
        """Raise a `MotionError` about the line of the last token."""
        self.text.fail(self.line, what, got, allowed)
