"""Open whatever shows a crowd in motion: recordings, and trajectories of other programs with bodies."""

from __future__ import annotations

import os
import tempfile
import weakref
from collections.abc import Callable, Sequence
from pathlib import Path

import h5py

from crowd.recording import HDF5_BEGIN, Recording
from crowd.simulation import Frame
from crowd.trajectories.files import load_trajectories
from crowd.trajectories.following import record_bodies
from crowd.trajectories.trajectories import Trajectories


def open_recording(
    shown: str | os.PathLike[str] | Trajectories,
    *,
    record: str | os.PathLike[str] | None = None,
    character_files: Sequence[str | os.PathLike[str]] = (),
    on_frame: Callable[[Frame], None] = lambda frame: None,
) -> Recording:
    """Open a recording; trajectories get bodies first, in a recording of their own.

    Parameters
    ----------
    shown : path or Trajectories
        A recording, or a file that `load_trajectories` reads.
    record : path, optional
        Where to keep the recording of the bodies; it is deleted with the object when left out.
    character_files : sequence of path
        Skinned glTF characters as which the bodies of trajectories are drawn.
    on_frame : callable, optional
        Called after each step of the walk along trajectories.

    Raises
    ------
    RecordingError
        It is neither.
    """
    if not isinstance(shown, Trajectories):
        path = Path(shown)
        if is_recording(path):
            return Recording(path)
        shown = load_trajectories(path)
    if record is not None:
        record_bodies(shown, record, character_files=character_files, on_frame=on_frame)
        return Recording(record)
    folder = tempfile.TemporaryDirectory(prefix="crowd-", ignore_cleanup_errors=True)
    path = Path(folder.name) / "bodies.h5"
    record_bodies(shown, path, character_files=character_files, on_frame=on_frame)
    recording = Recording(path)
    weakref.finalize(recording, folder.cleanup)
    return recording


def is_recording(path: Path) -> bool:
    """The file is a recording, or says with its ending that it should be one."""
    try:
        with path.open("rb") as begin:
            is_hdf5 = begin.read(len(HDF5_BEGIN)) == HDF5_BEGIN
        if not is_hdf5:
            return path.suffix.lower() in (".h5", ".hdf5")
        with h5py.File(path, "r") as file:
            return "trajectory" not in file
    except (OSError, RuntimeError):
        # A run that still goes on, or `Recording` tells what is wrong.
        return True
