"""Read trajectories: JuPedSim (sqlite, text, HDF5), and CSV of t, id, x, y.

The plane of pedestrian research has x to the right and y up, seen from above. Its x is our z, its y is our x,
as in exports, so that left stays left.
"""

from __future__ import annotations

import os
import re
import sqlite3
import warnings
from collections.abc import Sequence
from contextlib import closing
from pathlib import Path

import h5py
import numpy as np
import numpy.typing as npt
import shapely
from shapely.geometry.base import BaseGeometry

from crowd.errors import RecordingError, describe
from crowd.recording import HDF5_BEGIN
from crowd.trajectories.trajectories import Trajectories, split_into_ways

FloatArray = npt.NDArray[np.float64]

SQLITE_BEGIN = b"SQLite format 3\x00"
ALLOWED = "JuPedSim sqlite, text or HDF5, or CSV of t, id, x, y"
CSV_COLUMNS = {"t": ("t", "time", "t/s", "time/s"), "id": ("id",), "x": ("x", "x/m"), "y": ("y", "y/m")}
UNITS = {"m": 1.0, "cm": 0.01}


def load_trajectories(path: str | os.PathLike[str]) -> Trajectories:
    """Read a file of trajectories; its content tells the format.

    Parameters
    ----------
    path : path

    Returns
    -------
    Trajectories

    Raises
    ------
    RecordingError
        The file is missing, of no known format, or broken; the message says where.
    """
    place = Path(path)
    try:
        with place.open("rb") as file:
            begin = file.read(16)
    except OSError as error:
        raise RecordingError(describe(str(place), "cannot be read", os.strerror(error.errno or 0))) from error
    if begin == SQLITE_BEGIN:
        rows, area = _read_sqlite(place)
    elif begin.startswith(HDF5_BEGIN):
        rows, area = _read_hdf5(place)
    else:
        rows, area = _read_text(place), None
    if len(rows) == 0:
        raise RecordingError(describe(str(place), "holds no trajectories", allowed=ALLOWED))
    if not np.isfinite(rows).all():
        row = int(np.flatnonzero(~np.isfinite(rows).all(axis=1))[0])
        raise RecordingError(describe(str(place), "holds a number that is not finite", rows[row].tolist()))
    ways = split_into_ways(str(place), rows[:, 1].astype(np.int64), rows[:, 0], rows[:, [3, 2]])
    return Trajectories(place.name, tuple(ways), area)


def _read_sqlite(path: Path) -> tuple[FloatArray, BaseGeometry | None]:
    """Rows t, id, x, y, and the area; the file is not written to."""
    try:
        with closing(sqlite3.connect(f"{path.absolute().as_uri()}?mode=ro", uri=True)) as connection:
            facts = dict(connection.execute("SELECT key, value FROM metadata"))
            rate = _rate(str(path), facts.get("fps"))
            found = connection.execute("SELECT frame, id, pos_x, pos_y FROM trajectory_data").fetchall()
            shapes = [text for (text,) in connection.execute("SELECT wkt FROM geometry")]
    except sqlite3.Error as error:
        raise RecordingError(describe(str(path), "is no JuPedSim trajectory file", str(error))) from error
    rows = np.array(found, np.float64).reshape(-1, 4)
    rows[:, 0] /= rate
    return rows, _area(str(path), shapes)


def _read_hdf5(path: Path) -> tuple[FloatArray, BaseGeometry | None]:
    try:
        with h5py.File(path, "r") as file:
            dataset = file["trajectory"]
            rate = _rate(str(path), dataset.attrs.get("fps"))
            table = dataset[:]
            rows = np.stack([table[name].astype(np.float64) for name in ("frame", "id", "x", "y")], axis=1)
            wkt = file.attrs.get("wkt_geometry")
    except (OSError, KeyError, ValueError) as error:
        raise RecordingError(describe(str(path), "is no trajectory file", str(error), ALLOWED)) from error
    rows[:, 0] /= rate
    return rows, _area(str(path), [] if wkt is None else [wkt])


def _read_text(path: Path) -> FloatArray:
    """Rows t, id, x, y of JuPedSim's text or of CSV."""
    try:
        with path.open(encoding="utf-8-sig") as file:
            head = [line for _, line in zip(range(200), file, strict=False)]
    except (OSError, UnicodeDecodeError) as error:
        raise RecordingError(describe(str(path), "is no trajectory file", allowed=ALLOWED)) from error
    comments = [line for line in head if line.lstrip().startswith("#")]
    if any("framerate" in line.lower() for line in comments):
        return _read_jupedsim_text(path, comments)
    return _read_csv(path, [line for line in head if line not in comments])


def _read_jupedsim_text(path: Path, comments: Sequence[str]) -> FloatArray:
    """Rows id, frame, x, y, with rate and unit in the comments before them."""
    told = next(line for line in comments if "framerate" in line.lower())
    number = re.search(r"framerate\W*([-+.\deE]+)", told, re.IGNORECASE)
    rate = _rate(str(path), number and number.group(1))
    unit = "cm" if any(re.search(r"x/cm|in cm\b", line) for line in comments) else "m"
    rows = _numbers(path, None, len(comments), (1, 0, 2, 3))
    rows[:, 0] /= rate
    rows[:, 2:] *= UNITS[unit]
    return rows


def _read_csv(path: Path, head: Sequence[str]) -> FloatArray:
    """Rows t, id, x, y by the names in the first line, or in that order."""
    first = next((line.strip() for line in head if line.strip()), "")
    separator = next((mark for mark in (",", ";", "\t") if mark in first), None)
    cells = [cell.strip().strip("\"'").lower() for cell in first.split(separator)]
    columns: tuple[int, ...] = (0, 1, 2, 3)
    has_names = any(cell[:1].isalpha() for cell in cells)
    if has_names:
        found = [
            next((place for place, cell in enumerate(cells) if cell in known), -1)
            for known in CSV_COLUMNS.values()
        ]
        if min(found) < 0:
            raise RecordingError(describe(str(path), "lacks columns", first[:80], ALLOWED))
        columns = tuple(found)
    elif len(cells) < 4:
        raise RecordingError(describe(str(path), "is no trajectory file", first[:80], ALLOWED))
    return _numbers(path, separator, int(has_names), columns)


def _numbers(path: Path, separator: str | None, skipped: int, columns: tuple[int, ...]) -> FloatArray:
    """Some columns of a table of numbers."""
    try:
        with warnings.catch_warnings():
            # An empty table is told of by the caller.
            warnings.simplefilter("ignore", UserWarning)
            return np.loadtxt(
                path,
                np.float64,
                delimiter=separator,
                skiprows=skipped,
                usecols=columns,
                ndmin=2,
                encoding="utf-8",
            )
    except (ValueError, UnicodeDecodeError) as error:
        reason = str(error).splitlines()[0].rstrip(".;")
        raise RecordingError(describe(str(path), "is broken", reason, ALLOWED)) from error


def _rate(where: str, told: object) -> float:
    """Frames per second."""
    try:
        rate = float(str(told))
    except ValueError:
        rate = 0.0
    if not 0.0 < rate < np.inf:
        raise RecordingError(describe(where, "tells no frame rate", told, "frames per second, above 0"))
    return rate


def _area(where: str, texts: Sequence[str | bytes]) -> BaseGeometry | None:
    """Ground that can be walked on, in our x and z."""
    try:
        shapes = [shapely.from_wkt(text.decode() if isinstance(text, bytes) else text) for text in texts]
    except (shapely.errors.ShapelyError, UnicodeDecodeError) as error:
        raise RecordingError(describe(where, "has a geometry that is no WKT", str(error)[:80])) from error
    if not shapes:
        return None
    return shapely.transform(shapely.union_all(shapes), lambda points: points[:, ::-1])
