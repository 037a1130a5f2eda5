"""Write recordings: frames of a run, streamed to an HDF5 file that stays readable when the run is killed.

The file is written in HDF5's single-writer mode: at any moment it holds whole blocks of frames and may be
read while the run goes on. Rotations are stored as 16-bit numbers, right to 0.0001 rad.
"""

from __future__ import annotations

import errno
import math
import os
import shutil
import time as clock
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from importlib import metadata
from operator import attrgetter
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, Self

import h5py
import numpy as np

from crowd.characters import Cast
from crowd.characters.character_file import write_character
from crowd.errors import RecordingError, SettingsError, describe
from crowd.scenario.geometry import wall_segments

if TYPE_CHECKING:
    from crowd.simulation import Frame, Simulation
    from crowd.world.objects import Objects

FORMAT = 1
ROTATION_STEPS = 32767.0
BLOCK_SECONDS = 1.0
BLOCK_BYTES = 16 << 20
CHUNK_BYTES = 1 << 20
LARGEST_DELAY = 1.0
"""Wall time after which frames are written although the block is not full, s."""
TABLE_BYTES = 1 << 20
"""Room reserved for the file's own tables."""


@dataclass(frozen=True)
class Field:
    """One recorded quantity: how a frame of it is stored, and how it is documented in the file."""

    dtype: Any
    shape: tuple[int, ...]
    meaning: str


STATE_FIELDS: Mapping[str, Field] = {
    "is_active": Field(np.bool_, (), "in the scene"),
    "is_finished": Field(np.bool_, (), "has completed the goal list"),
    "spawn_count": Field(np.int32, (), "people that have entered through the slot so far"),
    "position_world": Field(np.float64, (3,), "root on the ground, m"),
    "yaw": Field(np.float64, (), "heading about +y, 0 faces +z, left positive, rad"),
    "velocity_world": Field(np.float32, (3,), "realised velocity of the root, m/s"),
    "goal_world": Field(np.float32, (3,), "present goal, m"),
    "wants_to_walk": Field(np.bool_, (), "has a goal and is not waiting"),
    "locomotion_parameter": Field(np.float32, (3,), "forward m/s, turn rad/s, side m/s of the present blend"),
    "directed_parameter": Field(np.float32, (3,), "commanded forward m/s, turn rad/s, side m/s"),
    "is_directed": Field(np.bool_, (), "moves by command instead of steering"),
    "desired_velocity_world": Field(np.float32, (3,), "velocity that avoidance asks for, m/s"),
    "locomotion_weight": Field(np.float32, (), "share of locomotion in the pose, 0 to 1"),
    "phase": Field(np.float32, (), "gait phase, cycles"),
    "foot_contact": Field(np.uint8, (2,), "right, left: 0 swing, 1 heel, 2 ball"),
    "foot_point_world": Field(np.float32, (2, 2, 3), "right, left; heel, ball; m"),
}
ROTATION = "rotation_local"
PELVIS = "pelvis_root"
OBJECT_FIELDS: Mapping[str, Field] = {
    "position_world": Field(np.float64, (3,), "centre of the object, m"),
    "rotation_world": Field(np.float32, (4,), "w x y z"),
    "holder": Field(np.int32, (), "slot of the character that holds it, -1 for none"),
}


@dataclass(frozen=True)
class Quantity:
    """A field with the number of its rows, and where its values come from."""

    field: Field
    rows: int
    read: Callable[[Simulation], Any]


class Recorder:
    """Writes frames of a simulation to a new file.

    Parameters
    ----------
    path : path
        Usually ends in ``.h5``; an existing file is replaced.
    simulation : Simulation
    every : int
        Record each `every`-th step, >= 1. At 60 Hz, 2 gives 30 frames a second.

    Raises
    ------
    RecordingError
        The file cannot be written.
    """

    def __init__(self, path: str | os.PathLike[str], simulation: Simulation, every: int = 2) -> None:
        if every < 1:
            raise SettingsError(describe("every", "must be positive", every, "1 or more"))
        self.path = Path(path)
        self.every = every
        self.frame_count = 0
        self._quantities = _quantities_of(simulation)
        self._pending = 0
        self._written_at = clock.monotonic()
        frame_bytes = sum(_row_bytes(one.field) * one.rows for one in self._quantities.values())
        per_second = max(1, round(BLOCK_SECONDS / (simulation.dt * every)))
        self._block = max(1, min(per_second, BLOCK_BYTES // max(1, frame_bytes)))
        self._buffers = {
            path: np.zeros((self._block, one.rows, *one.field.shape), one.field.dtype)
            for path, one in self._quantities.items()
        }
        self._times = np.zeros(self._block)
        self._block_bytes = self._times.nbytes + sum(buffer.nbytes for buffer in self._buffers.values())
        # Kept open: HDF5 writes what it holds of a dataset when the last reference to it goes.
        self._datasets: dict[str, h5py.Dataset] = {}
        self._file: h5py.File | None = None
        try:
            self._file = h5py.File(self.path, "w", libver="latest")
            self._write_facts(simulation)
            self._create_frames()
            self._file.swmr_mode = True
            self._reserve()
        except (OSError, RuntimeError) as error:
            if self._file is not None:
                self._abandon()
                self.path.unlink()
            raise RecordingError(describe(str(self.path), "cannot be written", reason(error))) from error

    def record(self, frame: Frame) -> None:
        """Note a frame if its turn has come, and write what has gathered.

        Raises
        ------
        RecordingError
            The disk is full; the file keeps all frames written before and is closed.
        """
        if (frame.index + 1) % self.every or self._file is None:
            return
        for path, buffer in self._buffers.items():
            buffer[self._pending] = self._quantities[path].read(frame.simulation)
        self._times[self._pending] = frame.time
        self._pending += 1
        if self._pending == self._block or clock.monotonic() - self._written_at > LARGEST_DELAY:
            self._write()

    def close(self) -> None:
        """Write what is left and close the file; further calls do nothing.

        Raises
        ------
        RecordingError
            The disk is full; the file keeps all frames written before.
        """
        if self._file is None:
            return
        self._write()
        os.ftruncate(self._descriptor, self._file.id.get_filesize())
        file, self._file = self._file, None
        self._datasets.clear()
        try:
            file.close()
        except (OSError, RuntimeError) as error:
            raise RecordingError(self._cut_off(error)) from error

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            self.close()
        except RecordingError:
            # What went wrong first is told.
            if error is None:
                raise

    def _write(self) -> None:
        """Append the gathered frames. The time column comes last: what it holds is complete."""
        if self._file is None or self._pending == 0:
            return
        first, last = self.frame_count, self.frame_count + self._pending
        try:
            self._reserve()
            for name, buffer in self._buffers.items():
                dataset = self._datasets[name]
                dataset.resize(last, axis=0)
                dataset[first:last] = buffer[: self._pending]
            self._file.flush()
            times = self._datasets["time"]
            times.resize(last, axis=0)
            times[first:last] = self._times[: self._pending]
            self._file.flush()
        except (OSError, RuntimeError) as error:
            message = self._cut_off(error)
            self._abandon()
            raise RecordingError(message) from error
        self.frame_count = last
        self._pending = 0
        self._written_at = clock.monotonic()

    def _cut_off(self, error: Exception) -> str:
        what = f"cannot be written any further; the first {self.frame_count} frames are kept"
        return describe(str(self.path), what, reason(error))

    def _reserve(self) -> None:
        """Take the room for the next block first: the HDF5 library does not survive a failed write."""
        assert self._file is not None
        # A block may begin in one chunk of each quantity and end in the next.
        wanted = 2 * self._block_bytes + TABLE_BYTES
        if hasattr(os, "posix_fallocate"):
            os.posix_fallocate(self._descriptor, self._file.id.get_filesize(), wanted)
        elif shutil.disk_usage(self.path.absolute().parent).free < wanted:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    def _abandon(self) -> None:
        """Close without another write to the disk, which keeps the file as the last whole block left it."""
        if self._file is None:
            return
        self._pending = 0
        if hasattr(os, "memfd_create"):
            nowhere = os.memfd_create("abandoned recording")
            os.dup2(nowhere, self._descriptor)
            os.close(nowhere)
        file, self._file = self._file, None
        self._datasets.clear()
        # The error that led here is the one to report.
        with suppress(OSError, RuntimeError):
            file.close()

    @property
    def _descriptor(self) -> int:
        assert self._file is not None
        return int(self._file.id.get_vfd_handle())

    def _write_facts(self, simulation: Simulation) -> None:
        """Write what stays the same during a run."""
        assert self._file is not None
        file, scenario, model = self._file, simulation.scenario, simulation.model
        file.attrs["format"] = FORMAT
        file.attrs["producer"] = "crowd-engine"
        file.attrs["version"] = _version()
        file.attrs["scenario"] = scenario.name
        file.attrs["seed"] = simulation.seed
        file.attrs["dt"] = simulation.dt
        file.attrs["every"] = self.every
        file.attrs["fps"] = 1.0 / (simulation.dt * self.every)
        file.attrs["bodies"] = simulation.bodies
        text = h5py.string_dtype("utf-8")
        file.create_dataset(
            "scenario_text", data=scenario.source.text or scenario.model_dump_json(), dtype=text
        )
        skeleton = model.skeleton
        group = file.create_group("skeleton")
        group.create_dataset("joint_names", data=list(skeleton.joint_names), dtype=text)
        for name in ("parent", "offset", "segment", "limit_lower", "limit_upper"):
            group.create_dataset(name, data=getattr(skeleton, name))
        group.attrs["stature"] = skeleton.stature
        people = file.create_group("characters")
        people.create_dataset("name", data=list(model.placed.name), dtype=text)
        for name in ("radius", "preferred_speed", "stature", "segment_scale"):
            people.create_dataset(name, data=getattr(model.people, name))
        _write_cast(file, model.cast)
        world = file.create_group("world")
        for name, values in wall_segments(scenario.world).items():
            world.create_dataset(name, data=values)
        if model.objects.count:
            self._write_objects(model.objects)

    def _write_objects(self, objects: Objects) -> None:
        """Write the shapes of objects."""
        assert self._file is not None
        group = self._file.create_group("objects")
        group.create_dataset("name", data=list(objects.name), dtype=h5py.string_dtype("utf-8"))
        for name in ("kind", "half_size", "colour", "mesh", "start_position_world", "start_rotation_world"):
            group.create_dataset(name, data=getattr(objects, name))
        for number, mesh in enumerate(objects.meshes):
            group.create_dataset(f"meshes/{number}/vertex", data=mesh.vertex)
            group.create_dataset(f"meshes/{number}/triangle", data=mesh.triangle)

    def _create_frames(self) -> None:
        assert self._file is not None
        for path, one in self._quantities.items():
            field = one.field
            chunk_rows = min(one.rows, max(1, CHUNK_BYTES // (_row_bytes(field) * self._block)))
            dataset = self._file.create_dataset(
                path,
                shape=(0, one.rows, *field.shape),
                maxshape=(None, one.rows, *field.shape),
                dtype=field.dtype,
                chunks=(self._block, chunk_rows, *field.shape),
                compression="lzf",
                shuffle=True,
            )
            dataset.attrs["meaning"] = field.meaning
            self._datasets[path] = dataset
        self._datasets["time"] = self._file.create_dataset(
            "frames/time", shape=(0,), maxshape=(None,), dtype=np.float64, chunks=(1024,), fillvalue=np.nan
        )


def _row_bytes(field: Field) -> int:
    return int(np.dtype(field.dtype).itemsize * math.prod(field.shape))


def _quantities_of(simulation: Simulation) -> dict[str, Quantity]:
    """What is recorded of a simulation, by the path in the file: plain discs have no pose."""
    capacity = simulation.state.capacity
    found = {
        f"frames/{name}": Quantity(field, capacity, attrgetter(f"state.{name}"))
        for name, field in STATE_FIELDS.items()
    }
    if simulation.bodies == "people":
        joint_count = simulation.model.skeleton.joint_count
        scale = f"1/{ROTATION_STEPS:.0f}"
        meaning = f"joint against parent, w x y z in units of {scale}"
        found[f"frames/{ROTATION}"] = Quantity(
            Field(np.int16, (joint_count, 4), meaning),
            capacity,
            lambda run: np.rint(run.joint_rotations_local() * ROTATION_STEPS),
        )
        found[f"frames/{PELVIS}"] = Quantity(
            Field(np.float32, (3,), "pelvis in the root frame, m"),
            capacity,
            lambda run: run.pelvis_positions_root(),
        )
    if simulation.model.objects.count:
        for name, field in OBJECT_FIELDS.items():
            found[f"objects/frames/{name}"] = Quantity(
                field, simulation.model.objects.count, attrgetter(f"objects.{name}")
            )
    return found


def _write_cast(file: h5py.File, cast: Cast) -> None:
    """Write the characters that people are drawn as, if there are any."""
    if not cast.characters:
        return
    group = file.create_group("cast")
    group.create_dataset("number", data=cast.number)
    for number, character in enumerate(cast.characters):
        write_character(group.create_group(f"{number:03d}"), character)


def _version() -> str:
    try:
        return metadata.version("crowd-engine")
    except metadata.PackageNotFoundError:
        return "unknown"


def reason(error: BaseException) -> str:
    """Say in a few words why a file operation failed."""
    if isinstance(error, OSError) and error.errno is not None:
        return os.strerror(error.errno)
    text = str(error)
    for number in (errno.ENOSPC, errno.EFBIG, errno.EDQUOT, errno.EACCES, errno.EISDIR):
        if os.strerror(number) in text:
            return os.strerror(number)
    return text.splitlines()[0] if text else type(error).__name__
