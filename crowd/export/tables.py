"""Plain tables: CSV of t, id, x, y, yaw, and NumPy arrays of joints."""

from __future__ import annotations

import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from crowd.export.output import whole_file
from crowd.export.selection import Selection

Numbers = npt.NDArray[Any]


def export_csv(selection: Selection, out: Path, on_block: Callable[[float], None]) -> None:
    """Write ``t,id,x,y,yaw``: s, visit, m, m, rad, one row for each person and frame.

    The plane is that of pedestrian research: x is our z, y is our x, so that left stays left; yaw turns from
    x towards y.

    Parameters
    ----------
    selection : Selection
    out : Path
    on_block : callable
        Called with the number of frames after each block.
    """
    with whole_file(out) as path, path.open("w", encoding="utf-8") as file:
        file.write("t,id,x,y,yaw\n")
        for _, time, visit, position, yaw in ground_rows(selection, on_block):
            file.writelines(
                f"{t:.6f},{number},{z:.6f},{x:.6f},{turn:.6f}\n"
                for t, number, x, z, turn in zip(
                    time.tolist(), visit.tolist(), position[:, 0].tolist(), position[:, 2].tolist(),
                    yaw.tolist(), strict=True,
                )
            )  # fmt: skip


def ground_rows(selection: Selection, on_block: Callable[[float], None]) -> Any:
    """Rows by frame, then by person: frame from 0, time s, visit number, position (3,) m, yaw rad."""
    recording = selection.recording
    number_of = visit_numbers(selection)
    for frames in selection.blocks():
        is_active = recording.read("is_active", frames)[:, selection.slots]
        position = recording.read("position_world", frames)[:, selection.slots]
        yaw = recording.read("yaw", frames)[:, selection.slots]
        frame, column = np.nonzero(is_active)
        visit = number_of(selection.slots[column], frame + frames.start)
        yield (
            frame + frames.start - selection.first,
            recording.time[frame + frames.start],
            visit,
            position[frame, column],
            yaw[frame, column],
        )
        on_block(frames.stop - frames.start)


def visit_numbers(selection: Selection) -> Callable[[Numbers, Numbers], Numbers]:
    """A function that gives the visit of slots at frames."""
    visits = selection.visits
    key = np.array([visit.slot * (selection.last + 2) + visit.first for visit in visits], np.int64)

    def number(slot: Numbers, frame: Numbers) -> Numbers:
        place = np.searchsorted(key, slot * (selection.last + 2) + frame, side="right") - 1
        return np.asarray(place)

    return number


def export_npz(selection: Selection, out: Path, on_block: Callable[[float], None]) -> None:
    """Write joint positions as arrays for ``numpy.load``.

    ``time`` (F,) s; ``joint_names`` (J,), ``parent`` (J,), ``names`` (C,); ``is_active`` (F, C);
    ``joint_position_world`` (F, C, J, 3) float32 m; ``rotation_local`` (F, C, J, 4) float32, (w, x, y, z),
    the pelvis against the world.

    Parameters
    ----------
    selection : Selection
    out : Path
    on_block : callable
        Called with the number of frames after each block.
    """
    recording, slots = selection.recording, selection.slots
    frames, people, joints = selection.frame_count, len(slots), recording.skeleton.joint_count
    with whole_file(out) as path, zipfile.ZipFile(path, "w", zipfile.ZIP_STORED) as archive:
        _store(archive, "time", recording.time[selection.first : selection.last + 1])
        _store(archive, "joint_names", np.array(recording.skeleton.joint_names))
        _store(archive, "parent", recording.skeleton.parent)
        _store(archive, "names", np.array([recording.names[slot] for slot in slots]))
        streams: tuple[tuple[str, tuple[int, ...], Any, Callable[[slice], Numbers]], ...] = (
            (
                "is_active",
                (frames, people),
                np.bool_,
                lambda part: recording.read("is_active", part)[:, slots],
            ),
            (
                "joint_position_world",
                (frames, people, joints, 3),
                np.float32,
                lambda part: recording.posed(recording.poses(part, slots), slots)[1],
            ),
            (
                "rotation_local",
                (frames, people, joints, 4),
                np.float32,
                lambda part: recording.poses(part, slots).rotation,
            ),
        )
        for name, shape, dtype, read in streams:
            with archive.open(f"{name}.npy", "w", force_zip64=True) as stream:
                described = np.lib.format.dtype_to_descr(np.dtype(dtype))
                header = {"descr": described, "fortran_order": False, "shape": shape}
                np.lib.format.write_array_header_2_0(stream, header)
                for part in selection.blocks():
                    stream.write(np.ascontiguousarray(read(part), dtype).tobytes())
                    on_block((part.stop - part.start) / len(streams))


def _store(archive: zipfile.ZipFile, name: str, array: Numbers) -> None:
    with archive.open(f"{name}.npy", "w") as stream:
        np.lib.format.write_array(stream, np.asanyarray(array), allow_pickle=False)
