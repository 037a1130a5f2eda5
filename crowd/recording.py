"""Recordings: what happened in a run, as `crowd.recorder` wrote it."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import h5py
import numpy as np
import numpy.typing as npt

from crowd.errors import RecordingError, describe
from crowd.motion.skeleton import Skeleton
from crowd.recorder import FORMAT, PELVIS, ROTATION, STATE_FIELDS, Field, Recorder, reason

__all__ = ["STATE_FIELDS", "Field", "Recorder", "Recording"]

FloatArray = npt.NDArray[np.float64]
AnyArray = npt.NDArray[Any]
Rows = int | slice


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
        if isinstance(frames, slice):
            frames = slice(*frames.indices(self.frame_count))
        elif not -self.frame_count <= frames < self.frame_count:
            allowed = f"0 to {self.frame_count - 1}" if self.frame_count else "the recording is empty"
            raise RecordingError(describe(str(self.path), "has no such frame", frames, allowed))
        else:
            frames %= self.frame_count
        try:
            return np.asarray(self._file["frames"][name][frames])
        except (OSError, RuntimeError) as error:
            raise RecordingError(describe(str(self.path), f"{name} is damaged", reason(error))) from error

    def joint_rotations_local(self, frame: int) -> FloatArray:
        """Rotations against the parent joints, unit quaternions. (character, joint, 4)."""
        rotation = self.read(ROTATION, frame).astype(np.float64)
        length = np.sqrt((rotation * rotation).sum(axis=-1, keepdims=True))
        rotation[..., 0] += length[..., 0] == 0.0
        return np.asarray(rotation / np.where(length == 0.0, 1.0, length))

    def joint_positions_world(self, frame: int) -> FloatArray:
        """Joints in world space, m. (character, joint, 3); rows of empty slots mean nothing."""
        skeleton = self.skeleton
        local = self.joint_rotations_local(frame)
        yaw = self.read("yaw", frame)
        heading = np.stack([np.cos(yaw / 2), 0 * yaw, np.sin(yaw / 2), 0 * yaw], axis=1)
        offset = skeleton.offset * self.segment_scale[:, skeleton.segment, None]
        position = np.zeros((len(yaw), skeleton.joint_count, 3))
        rotation = np.zeros((len(yaw), skeleton.joint_count, 4))
        rotation[:, 0] = _product(heading, local[:, 0])
        position[:, 0] = self.read("position_world", frame) + _turned(heading, self.read(PELVIS, frame))
        for joint in range(1, skeleton.joint_count):
            parent = int(skeleton.parent[joint])
            rotation[:, joint] = _product(rotation[:, parent], local[:, joint])
            position[:, joint] = position[:, parent] + _turned(rotation[:, parent], offset[:, joint])
        return position

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


def _product(first: FloatArray, second: FloatArray) -> FloatArray:
    w, x, y, z = np.moveaxis(first, -1, 0)
    a, b, c, d = np.moveaxis(second, -1, 0)
    return np.stack(
        [
            w * a - x * b - y * c - z * d,
            w * b + x * a + y * d - z * c,
            w * c - x * d + y * a + z * b,
            w * d + x * c - y * b + z * a,
        ],
        axis=-1,
    )


def _turned(rotation: FloatArray, vector: FloatArray) -> FloatArray:
    twice = 2.0 * np.cross(rotation[..., 1:], vector)
    return np.asarray(vector + rotation[..., :1] * twice + np.cross(rotation[..., 1:], twice), np.float64)
