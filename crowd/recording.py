"""Recordings: what happened in a run, as `crowd.recorder` wrote it."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import h5py
import numpy as np
import numpy.typing as npt

from crowd.characters import Cast
from crowd.characters.character_file import read_character
from crowd.errors import RecordingError, describe
from crowd.motion.rotation import about, multiply, rotate
from crowd.motion.skeleton import Skeleton
from crowd.motion.source import world_pose
from crowd.recorder import FORMAT, OBJECT_FIELDS, PELVIS, ROTATION, STATE_FIELDS, Field, Recorder, reason
from crowd.world.mesh import Mesh
from crowd.world.objects import Objects

__all__ = ["OBJECT_FIELDS", "STATE_FIELDS", "Field", "Poses", "Recorder", "Recording"]

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[Any]
AnyArray = npt.NDArray[Any]
Rows = int | slice
HDF5_BEGIN = b"\x89HDF\r\n\x1a\n"
SUPERBLOCK_BYTES = 48


@dataclass(frozen=True)
class Poses:
    """Poses of some characters in some frames.

    Attributes
    ----------
    position_world : (F, C, 3) float64
        Roots on the ground, m.
    yaw : (F, C) float64
        rad.
    rotation : (F, C, J, 4) float64
        Against the parent joint; the pelvis against the world.
    pelvis_world : (F, C, 3) float64
        m.
    """

    position_world: FloatArray
    yaw: FloatArray
    rotation: FloatArray
    pelvis_world: FloatArray


class Recording:
    """A recorded run, read frame by frame; use it in a ``with`` block.

    Parameters
    ----------
    path : path
        Also of a run that still goes on, or that was killed.

    Raises
    ------
    RecordingError
        The file is missing, or is not a recording.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.path = Path(path)
        _check_length(self.path)
        try:
            self._file = h5py.File(self.path, "r", libver="latest", swmr=True)
        except (OSError, RuntimeError) as error:
            what = "is not a recording" if self.path.is_file() else "no such recording"
            raise RecordingError(describe(str(self.path), what, reason(error))) from error
        try:
            self._read_facts()
        except (KeyError, ValueError, OSError, RuntimeError) as error:
            self._file.close()
            raise RecordingError(describe(str(self.path), "is not a recording", reason(error))) from error

    def _read_facts(self) -> None:
        file = self._file
        found = int(file.attrs["format"])
        if found != FORMAT:
            raise ValueError(f"format {found}, not {FORMAT}")
        self.scenario_name = str(file.attrs["scenario"])
        self.scenario_text = str(file["scenario_text"].asstr()[()])
        self.seed = int(file.attrs["seed"])
        self.dt = float(file.attrs["dt"])
        """Length of a step of the simulation, s."""
        self.every = int(file.attrs["every"])
        """Steps from one recorded frame to the next."""
        self.version = str(file.attrs["version"])
        self.bodies = str(file.attrs["bodies"])
        group = file["skeleton"]
        self.skeleton = Skeleton(
            tuple(group["joint_names"].asstr()[:]),
            group["parent"][:],
            group["offset"][:],
            group["segment"][:],
            group["limit_lower"][:],
            group["limit_upper"][:],
            float(group.attrs["stature"]),
        )
        people = file["characters"]
        self.names: tuple[str, ...] = tuple(people["name"].asstr()[:])
        self.radius: FloatArray = people["radius"][:]
        self.preferred_speed: FloatArray = people["preferred_speed"][:]
        self.stature: FloatArray = people["stature"][:]
        self.segment_scale: npt.NDArray[np.float32] = people["segment_scale"][:]
        world = file["world"]
        self.walls: FloatArray = world["wall"][:]
        """Wall segments. (wall, end, 3), m"""
        self.wall_appear_at: FloatArray = world["appear_at"][:]
        self.wall_disappear_at: FloatArray = world["disappear_at"][:]
        self.objects = _objects_of(file["objects"]) if "objects" in file else Objects.none()
        """Things that people can grasp; empty in recordings without."""
        time = file["frames"]["time"][:]
        is_whole = np.isfinite(time)
        self.frame_count = int(time.size if is_whole.all() else np.argmin(is_whole))
        self.time: FloatArray = time[: self.frame_count]
        """Simulated time of each frame, s."""
        self.fields: tuple[str, ...] = tuple(name for name in file["frames"] if name != "time")
        """Names for `read`."""

    @property
    def character_count(self) -> int:
        """Number of slots."""
        return len(self.names)

    @property
    def frame_seconds(self) -> float:
        """Time from one recorded frame to the next, s."""
        return self.dt * self.every

    @cached_property
    def cast(self) -> Cast:
        """Skinned characters that people are drawn as."""
        if "cast" not in self._file:
            return Cast.of_nobody(self.character_count)
        group = self._file["cast"]
        try:
            characters = tuple(read_character(group[name]) for name in group if name != "number")
            return Cast(characters, group["number"][:])
        except (KeyError, ValueError, OSError, RuntimeError) as error:
            raise RecordingError(
                describe(str(self.path), "its characters are damaged", reason(error))
            ) from error

    def read(self, name: str, frames: Rows = slice(None)) -> AnyArray:
        """Read a quantity, named as in `State`.

        Parameters
        ----------
        name : str
            One of `fields`.
        frames : int or slice
            Which frames; all when left out.

        Returns
        -------
        (character, ...) or (frame, character, ...) array

        Raises
        ------
        RecordingError
            There is no such quantity or frame.
        """
        if name not in self.fields:
            allowed = ", ".join(self.fields)
            raise RecordingError(describe(str(self.path), "holds no such quantity", name, allowed))
        return self._read_frames("frames", name, frames)

    def read_objects(self, name: str, frames: Rows = slice(None)) -> AnyArray:
        """Read a quantity of the objects, named as in `ObjectState`.

        Parameters
        ----------
        name : str
            ``"position_world"``, ``"rotation_world"`` or ``"holder"``.
        frames : int or slice
            Which frames; all when left out.

        Returns
        -------
        (object, ...) or (frame, object, ...) array

        Raises
        ------
        RecordingError
            There are no objects, or there is no such quantity or frame.
        """
        if self.objects.count == 0:
            raise RecordingError(describe(str(self.path), "holds no objects"))
        if name not in OBJECT_FIELDS:
            allowed = ", ".join(OBJECT_FIELDS)
            raise RecordingError(describe(str(self.path), "holds no such quantity", name, allowed))
        return self._read_frames("objects/frames", name, frames)

    def _read_frames(self, group: str, name: str, frames: Rows) -> AnyArray:
        if isinstance(frames, slice):
            frames = slice(*frames.indices(self.frame_count))
        elif not -self.frame_count <= frames < self.frame_count:
            allowed = f"0 to {self.frame_count - 1}" if self.frame_count else "the recording is empty"
            raise RecordingError(describe(str(self.path), "has no such frame", frames, allowed))
        else:
            frames %= self.frame_count
        try:
            return np.asarray(self._file[group][name][frames])
        except (OSError, RuntimeError) as error:
            raise RecordingError(describe(str(self.path), f"{name} is damaged", reason(error))) from error

    def joint_rotations_local(self, frame: int) -> FloatArray:
        """Rotations against the parent joints, unit quaternions. (character, joint, 4)."""
        return _unit(self.read(ROTATION, frame))

    def poses(self, frames: slice, characters: IntArray) -> Poses:
        """Read poses of some characters in some frames.

        Parameters
        ----------
        frames : slice
        characters : (C,) int
            Slots.
        """
        position = self.read("position_world", frames)[:, characters]
        yaw = self.read("yaw", frames)[:, characters]
        rotation = _unit(self.read(ROTATION, frames)[:, characters])
        pelvis = self.read(PELVIS, frames)[:, characters].astype(np.float64)
        heading = about(1, yaw)
        rotation[..., 0, :] = multiply(heading, rotation[..., 0, :])
        return Poses(position, yaw, rotation, position + rotate(heading, pelvis))

    def joint_offsets(self, characters: IntArray) -> FloatArray:
        """Joint offsets of some characters in their own proportions, m. (C, joint, 3)."""
        return np.asarray(
            self.skeleton.offset * self.segment_scale[characters][:, self.skeleton.segment, None]
        )

    def joint_positions_world(self, frame: int) -> FloatArray:
        """Joints in world space, m. (character, joint, 3); rows of empty slots mean nothing."""
        everyone = np.arange(self.character_count)
        poses = self.poses(slice(frame, frame + 1 or None), everyone)
        return np.asarray(self.posed(poses, everyone)[1][0])

    def posed(self, poses: Poses, characters: IntArray) -> tuple[FloatArray, FloatArray]:
        """World rotations (F, C, J, 4) and positions (F, C, J, 3), m, of poses."""
        offset = np.broadcast_to(self.joint_offsets(characters), (*poses.rotation.shape[:3], 3)).copy()
        offset[..., 0, :] = poses.pelvis_world
        return world_pose(self.skeleton.parent, poses.rotation, offset)

    def frames(self) -> Iterator[tuple[float, dict[str, AnyArray]]]:
        """Go through all frames: time, s, and all quantities but the pose."""
        names = [name for name in self.fields if name not in (ROTATION, PELVIS)]
        for frame, time in enumerate(self.time.tolist()):
            yield time, {name: self.read(name, frame) for name in names}

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def _check_length(path: Path) -> None:
    """Refuse a file whose end is missing: the HDF5 library does not survive one in single-writer mode.

    Where the end should be stands in the superblock (HDF5 file format 3.0, section II.A, version 2 and 3).
    """
    try:
        with path.open("rb") as file:
            begin = file.read(SUPERBLOCK_BYTES)
        size = path.stat().st_size
    except OSError:
        return
    if len(begin) < SUPERBLOCK_BYTES:
        if begin.startswith(HDF5_BEGIN):
            raise RecordingError(describe(str(path), "is cut off", f"{size} bytes"))
        return
    version, address_bytes, is_open = begin[8], begin[9], begin[11] != 0
    # Without room taken in advance, the end of a run that was killed may not have been written.
    is_known = not is_open or hasattr(os, "posix_fallocate")
    if begin.startswith(HDF5_BEGIN) and version in (2, 3) and address_bytes == 8 and is_known:
        end = int.from_bytes(begin[28:36], "little")
        if size < end:
            raise RecordingError(
                describe(str(path), "is cut off", f"{size} of {end} bytes", "the whole file")
            )


def _unit(rotation: AnyArray) -> FloatArray:
    """Unit quaternions of recorded ones; empty rows become the identity."""
    values = rotation.astype(np.float64)
    length = np.sqrt((values * values).sum(axis=-1, keepdims=True))
    values[..., 0] += length[..., 0] == 0.0
    return np.asarray(values / np.where(length == 0.0, 1.0, length))


def _objects_of(group: h5py.Group) -> Objects:
    """Shapes of recorded objects."""
    stored = group.get("meshes", {})
    meshes = [
        Mesh(stored[str(number)]["vertex"][:], stored[str(number)]["triangle"][:])
        for number in range(len(stored))
    ]
    return Objects(
        tuple(group["name"].asstr()[:]),
        group["kind"][:],
        group["half_size"][:],
        group["colour"][:],
        group["mesh"][:],
        tuple(meshes),
        group["start_position_world"][:],
        group["start_rotation_world"][:],
    )
