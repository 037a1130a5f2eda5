"""Text files of motion: read with any encoding, numbers in bulk, errors with their line."""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt

from crowd.errors import MotionError, describe

FloatArray = npt.NDArray[np.float64]

LARGEST_FILE = 1 << 30
"""Larger files are refused, bytes."""


def read_text(path: Path) -> str:
    """Read a text file; bytes that are not UTF-8 are read as Latin-1.

    Raises
    ------
    MotionError
        The file cannot be read, is empty, too large, or binary.
    """
    content = read_bytes(path)
    if b"\0" in content:
        raise MotionError(describe(str(path), f"is binary, not text: a zero at byte {content.index(0)}"))
    if not content.strip():
        raise MotionError(describe(str(path), "is empty"))
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        return content.decode("latin-1")


def read_bytes(path: Path) -> bytes:
    """Read a whole file.

    Raises
    ------
    MotionError
        The file cannot be read or is too large.
    """
    try:
        if path.stat().st_size > LARGEST_FILE:
            size = f"{path.stat().st_size} bytes"
            raise MotionError(describe(str(path), "is too large", size, f"up to {LARGEST_FILE} bytes"))
        return path.read_bytes()
    except OSError as error:
        raise MotionError(describe(str(path), "cannot be read", error.strerror or str(error))) from error


def at_line(path: Path, line: int) -> str:
    """Where something is, for a message; lines count from 1."""
    return f"{path}:{line}"


def number(token: str, path: Path, line: int, what: str) -> float:
    """Read a finite number.

    Raises
    ------
    MotionError
        It is none.
    """
    try:
        value = float(token)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise MotionError(describe(at_line(path, line), f"{what} is no finite number", token))
    return value


def whole_number(token: str, path: Path, line: int, what: str) -> int:
    """Read a whole number >= 0.

    Raises
    ------
    MotionError
        It is none.
    """
    if not token.isascii() or not token.isdigit() or len(token) > 18:
        raise MotionError(describe(at_line(path, line), f"{what} is no whole number", token, "0 or more"))
    return int(token)


def read_rows(lines: Sequence[str], line_numbers: Sequence[int], columns: int, path: Path) -> FloatArray:
    """Read rows of numbers, one row on each line that is not blank.

    Parameters
    ----------
    lines : sequence of str
    line_numbers : sequence of int
        Where each one stands in the file.
    columns : int
        Numbers in a row.
    path : Path

    Returns
    -------
    (rows, columns) float64

    Raises
    ------
    MotionError
        A row has another count, or something is no finite number; the first such line is named.
    """
    rows = [line for line in lines if line.strip()]
    if not rows:
        return np.zeros((0, columns))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            values = np.fromstring(" ".join(rows), dtype=np.float64, sep=" ")
        except (ValueError, DeprecationWarning):
            values = np.zeros(0)
    if values.size == len(rows) * columns and np.isfinite(values).all():
        widths = {len(row.split()) for row in (rows[0], rows[len(rows) // 2], rows[-1])}
        if widths == {columns}:
            return values.reshape(len(rows), columns)
    return _rows_one_by_one(lines, line_numbers, columns, path)


def _rows_one_by_one(
    lines: Sequence[str], line_numbers: Sequence[int], columns: int, path: Path
) -> FloatArray:
    found = []
    for line_number, line in zip(line_numbers, lines, strict=True):
        tokens = line.split()
        if not tokens:
            continue
        if len(tokens) != columns:
            raise MotionError(
                describe(at_line(path, line_number), "wrong count of numbers", len(tokens), str(columns))
            )
        found.append([number(token, path, line_number, "value") for token in tokens])
    return np.array(found, np.float64)
