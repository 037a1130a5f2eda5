"""JuPedSim trajectory files (sqlite, version 2), which JuPedSim and PedPy read."""

from __future__ import annotations

import sqlite3
from collections.abc import Callable
from pathlib import Path

import numpy as np
import numpy.typing as npt
import shapely
from shapely.geometry.base import BaseGeometry

from crowd.errors import RecordingError, describe
from crowd.export.output import whole_file
from crowd.export.selection import Selection
from crowd.export.tables import ground_rows
from crowd.recording import Recording

FloatArray = npt.NDArray[np.float64]

VERSION = 2
MARGIN = 1.0
"""Ground beyond the farthest wall or person, m."""
SAMPLED_FRAMES = 200
"""Frames in which people are looked for to tell ground from the inside of obstacles."""
GEOMETRY_HASH = 1
TABLES = """
CREATE TABLE trajectory_data (frame INTEGER NOT NULL, id INTEGER NOT NULL, pos_x REAL NOT NULL,
    pos_y REAL NOT NULL, ori_x REAL NOT NULL, ori_y REAL NOT NULL);
CREATE TABLE metadata (key TEXT NOT NULL UNIQUE PRIMARY KEY, value TEXT NOT NULL);
CREATE TABLE geometry (hash INTEGER NOT NULL, wkt TEXT NOT NULL);
CREATE UNIQUE INDEX geometry_hash ON geometry (hash);
CREATE TABLE frame_data (frame INTEGER NOT NULL, geometry_hash INTEGER NOT NULL);
CREATE INDEX frame_id ON trajectory_data (frame, id);
"""


def export_jupedsim(selection: Selection, out: Path, on_block: Callable[[float], None]) -> None:
    """Write a trajectory file: x is our z, y is our x, metres; ids are visits.

    Parameters
    ----------
    selection : Selection
    out : Path
    on_block : callable
        Called with the number of frames after each block.

    Raises
    ------
    RecordingError
        The file cannot be written.
    """
    area = walkable_area(selection)
    with whole_file(out) as path:
        path.unlink(missing_ok=True)
        try:
            connection = sqlite3.connect(path, isolation_level=None)
            try:
                _fill(connection, selection, area, on_block)
            finally:
                connection.close()
        except sqlite3.Error as error:
            raise RecordingError(describe(str(out), "cannot be written", str(error))) from error


def _fill(
    connection: sqlite3.Connection,
    selection: Selection,
    area: BaseGeometry,
    on_block: Callable[[float], None],
) -> None:
    connection.execute("PRAGMA synchronous = OFF")
    connection.execute("PRAGMA journal_mode = OFF")
    connection.executescript(TABLES)
    xmin, ymin, xmax, ymax = area.bounds
    facts = {
        "version": VERSION, "fps": 1.0 / selection.frame_seconds,
        "xmin": xmin, "xmax": xmax, "ymin": ymin, "ymax": ymax,
    }  # fmt: skip
    connection.executemany(
        "INSERT INTO metadata VALUES (?, ?)", [(key, str(value)) for key, value in facts.items()]
    )
    connection.execute("INSERT INTO geometry VALUES (?, ?)", (GEOMETRY_HASH, area.wkt))
    frames = ((frame, GEOMETRY_HASH) for frame in range(selection.frame_count))
    connection.execute("BEGIN")
    connection.executemany("INSERT INTO frame_data VALUES (?, ?)", frames)
    connection.execute("COMMIT")
    for frame, _, visit, position, yaw in ground_rows(selection, on_block):
        columns = (frame, visit, position[:, 2], position[:, 0], np.cos(yaw), np.sin(yaw))
        connection.execute("BEGIN")
        connection.executemany(
            "INSERT INTO trajectory_data VALUES (?, ?, ?, ?, ?, ?)",
            zip(*(column.tolist() for column in columns), strict=True),
        )
        connection.execute("COMMIT")


def walkable_area(selection: Selection) -> BaseGeometry:
    """Ground that people walk on: what walls enclose around them, in the plane (z, x), m.

    Walls that stand from the first frame on count. Faces between walls in which somebody is seen are ground;
    the rest is the inside of obstacles.
    """
    recording = selection.recording
    seen = _positions(selection)
    starts = recording.wall_appear_at <= recording.time[selection.first]
    walls = recording.walls[starts][:, :, [2, 0]]
    everything = np.concatenate([seen, walls.reshape(-1, 2)])
    low, high = everything.min(axis=0) - MARGIN, everything.max(axis=0) + MARGIN
    frame = shapely.box(*low, *high)
    lines = shapely.union_all([*shapely.linestrings(walls), frame.exterior]) if len(walls) else frame.exterior
    faces = shapely.get_parts(shapely.polygonize(shapely.get_parts(lines)))
    points = shapely.points(seen)
    shapely.prepare(faces)
    ground = [face for face in faces if shapely.contains(face, points).any()]
    united = shapely.union_all(ground) if ground else frame
    if united.geom_type != "Polygon":
        # Readers want one polygon: that in which most people are seen.
        parts = shapely.get_parts(united)
        counts = [int(shapely.contains(part, points).sum()) for part in parts]
        united = parts[int(np.argmax(counts))]
    return united


def _positions(selection: Selection) -> FloatArray:
    """Places of people in some frames, (n, 2): our z and x."""
    recording: Recording = selection.recording
    step = max(selection.frame_count // SAMPLED_FRAMES, 1)
    places = []
    for frame in range(selection.first, selection.last + 1, step):
        is_active = recording.read("is_active", frame)[selection.slots]
        places.append(recording.read("position_world", frame)[selection.slots][is_active][:, [2, 0]])
    found = np.concatenate(places)
    return found if len(found) else np.zeros((1, 2))
