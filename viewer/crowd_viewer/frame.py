"""One moment of a crowd as it is drawn, alike from a running simulation and from a recording."""

from __future__ import annotations

import math
import os
import tomllib
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt
from pydantic import ValidationError

from crowd.characters import Cast
from crowd.errors import describe
from crowd.joints import Joints
from crowd.motion.rotation import slerp
from crowd.motion.skeleton import Segment, Skeleton
from crowd.recorder import PELVIS, ROTATION, ROTATION_STEPS
from crowd.recording import Recording
from crowd.scenario import Scenario
from crowd.simulation import Simulation
from crowd.state import State
from crowd.trajectories import Trajectories, open_recording
from crowd.world.objects import Objects
from crowd_kernels.clip import PADDED_JOINTS
from crowd_viewer.context import ViewerError
from crowd_viewer.solids import Solid, scenario_solids, wall_solids

FloatArray = npt.NDArray[np.float64]
Float32Array = npt.NDArray[np.float32]
Shown = Simulation | Recording | Trajectories | str | os.PathLike[str]
"""What can be shown: paths are those of recordings and of files that `crowd.load_trajectories` reads."""
SAMPLED_FRAMES = 50
LARGEST_STEP = 1.0
"""An object that is farther away in the next frame has not been carried there, m."""
Quantity = Callable[[str], npt.NDArray[Any] | None]
LARGEST_IDENTITY = 1 << 24


@dataclass(frozen=True)
class CrowdFrame:
    """A crowd at one time. Rows are slots; what a source hands out is valid until its next frame.

    Attributes
    ----------
    time : float
        s.
    is_active : (N,) bool
        There is a person in the slot.
    identity : (N,) int64
        Stable number of each person.
    position_world : (N, 3) float64
        Roots on the ground, m.
    yaw : (N,) float64
        rad.
    joint_position_model : (N, J, 3) float32
        In the root frame, m.
    joint_rotation_model : (N, J, 4) float32
        In the root frame, unit quaternions.
    object_position_world : (M, 3) float64 or None
        Centres of the scene's objects, m; None where they are as at the start.
    object_rotation_world : (M, 4) or None
        Unit quaternions.
    """

    time: float
    is_active: npt.NDArray[np.bool_]
    identity: npt.NDArray[np.int64]
    position_world: FloatArray
    yaw: FloatArray
    joint_position_model: Float32Array
    joint_rotation_model: Float32Array
    object_position_world: FloatArray | None = None
    object_rotation_world: npt.NDArray[np.floating[Any]] | None = None

    @property
    def places(self) -> FloatArray:
        """Where people are, m. (P, 3)."""
        return self.position_world[self.is_active]


@dataclass(frozen=True)
class Scene:
    """What stays the same from frame to frame.

    Attributes
    ----------
    name : str
    skeleton : Skeleton
    stature : (N,) float64
        m.
    segment_scale : (N, 8) float32
    radius : (N,) float64
        Body discs, m.
    bounds : tuple of float
        Lowest and highest x, lowest and highest z of the ground, m.
    solids : tuple of Solid
        Walls and obstacles.
    cast : Cast
        Characters of the user's that people are drawn as.
    objects : Objects
        Things that people can grasp.
    """

    name: str
    skeleton: Skeleton
    stature: FloatArray
    segment_scale: Float32Array
    radius: FloatArray
    bounds: tuple[float, float, float, float]
    solids: tuple[Solid, ...]
    cast: Cast
    objects: Objects = field(default_factory=Objects.none)


class Source(Protocol):
    """Where frames come from."""

    scene: Scene

    def frame(self, time: float | None = None) -> CrowdFrame:
        """The crowd at a time, s; the present or last one when left out."""

    def places(self) -> FloatArray:
        """Where people are, now or during the whole recording, m. (P, 3)."""

    def quantity(self, name: str) -> npt.NDArray[Any] | None:
        """A quantity of `State` in the last frame, by name; None where it is not known."""


def opened(shown: Shown) -> Simulation | Recording:
    """What is shown, opened where it is a file, and with bodies where it is trajectories."""
    return shown if isinstance(shown, Simulation | Recording) else open_recording(shown)


def source_of(shown: Shown) -> Source:
    """Frames of whatever can be shown.

    Raises
    ------
    ViewerError
        The recording is empty.
    """
    source = opened(shown)
    return LiveSource(source) if isinstance(source, Simulation) else ReplaySource(source)


def _identities(spawn_count: npt.NDArray[np.generic]) -> npt.NDArray[np.int64]:
    """A number for each person that has ever been in a slot."""
    capacity = len(spawn_count)
    spawned = np.maximum(spawn_count.astype(np.int64) - 1, 0)
    return np.asarray((np.arange(capacity) + capacity * spawned) % LARGEST_IDENTITY, np.int64)


class LiveSource:
    """Frames of a running simulation, read where they lie."""

    def __init__(self, simulation: Simulation) -> None:
        self.simulation = simulation
        model, scenario = simulation.model, simulation.scenario
        bounds = (*scenario.world.bounds.x, *scenario.world.bounds.z)
        self.scene = Scene(
            scenario.name,
            model.skeleton,
            model.people.stature,
            model.people.segment_scale,
            model.people.radius,
            bounds,
            tuple(scenario_solids(scenario.world)),
            model.cast,
            model.objects,
        )
        self._standing: Joints | None = None

    def frame(self, time: float | None = None) -> CrowdFrame:
        """The crowd now; a simulation has no other time."""
        simulation, state = self.simulation, self.simulation.state
        joints = simulation.joints
        if simulation.bodies == "discs" or simulation.step_index == 0:
            if self._standing is None:
                self._standing = standing_joints(self.scene)
            joints = self._standing
        return CrowdFrame(
            simulation.time,
            state.is_active,
            _identities(state.spawn_count),
            state.position_world,
            state.yaw,
            joints.position_model,
            joints.rotation_model,
            simulation.objects.position_world,
            simulation.objects.rotation_world,
        )

    def places(self) -> FloatArray:
        """Where people are now, m. (P, 3)."""
        return self.frame().places

    def quantity(self, name: str) -> npt.NDArray[Any] | None:
        """A quantity of `State` now."""
        return getattr(self.simulation.state, name, None)


class ReplaySource:
    """Frames of a recording, between two recorded ones by interpolation."""

    def __init__(self, recording: Recording) -> None:
        if recording.frame_count == 0:
            raise ViewerError(describe(str(recording.path), "the recording is empty"))
        self.recording = recording
        scenario = recorded_scenario(recording)
        if scenario is not None:
            bounds = (*scenario.world.bounds.x, *scenario.world.bounds.z)
            solids = tuple(scenario_solids(scenario.world))
        else:
            solids = tuple(
                wall_solids(recording.walls, recording.wall_appear_at, recording.wall_disappear_at)
            )
            bounds = _bounds_of(recording)
        self.scene = Scene(
            recording.scenario_name,
            recording.skeleton,
            recording.stature,
            recording.segment_scale,
            recording.radius,
            bounds,
            solids,
            recording.cast,
            recording.objects,
        )
        self._pose = State.create(recording.character_count)
        self._joints = standing_joints(self.scene)
        self._everyone = np.arange(recording.character_count, dtype=np.int32)
        self._nearest = 0

    def frame(self, time: float | None = None) -> CrowdFrame:
        """The crowd at a time, s, at most that of the last frame."""
        recording = self.recording
        times = recording.time
        time = float(times[-1]) if time is None else min(max(time, float(times[0])), float(times[-1]))
        after = min(int(np.searchsorted(times, time)), len(times) - 1)
        before = max(after - 1, 0)
        gap = float(times[after] - times[before])
        share = (time - float(times[before])) / gap if gap > 0.0 else 0.0
        nearest = self._nearest = after if share >= 0.5 else before
        both = {
            name: np.stack([recording.read(name, before), recording.read(name, after)])
            for name in ("position_world", "yaw", "spawn_count", "is_active")
        }
        stays = (both["spawn_count"][0] == both["spawn_count"][1]) & both["is_active"].all(axis=0)
        weight = np.where(stays, share, 1.0 if nearest == after else 0.0)
        turn = np.remainder(both["yaw"][1] - both["yaw"][0] + math.pi, 2.0 * math.pi) - math.pi
        position = both["position_world"]
        if ROTATION in recording.fields:
            self._compute_joints(before, after, weight)
        chosen = int(nearest == after)
        return CrowdFrame(
            time,
            both["is_active"][chosen],
            _identities(both["spawn_count"][chosen]),
            position[0] + weight[:, None] * (position[1] - position[0]),
            both["yaw"][0] + weight * turn,
            self._joints.position_model,
            self._joints.rotation_model,
            *self._objects(before, after, share),
        )

    def _objects(self, before: int, after: int, share: float) -> tuple[FloatArray | None, FloatArray | None]:
        """Where objects are between two frames."""
        if self.recording.objects.count == 0:
            return None, None
        position, rotation = (
            [self.recording.read_objects(name, frame).astype(np.float64) for frame in (before, after)]
            for name in ("position_world", "rotation_world")
        )
        # A thing that changes hands or is put back jumps.
        weight = np.where(np.linalg.norm(position[1] - position[0], axis=1) < LARGEST_STEP, share, 1.0)
        mixed = position[0] + weight[:, None] * (position[1] - position[0])
        return mixed, slerp(rotation[0], rotation[1], weight)

    def places(self, start: float = -math.inf, stop: float = math.inf) -> FloatArray:
        """Where people are in some frames from `start` to `stop`, s. (P, 3) m."""
        return recorded_places(self.recording, start, stop)

    def quantity(self, name: str) -> npt.NDArray[Any] | None:
        """A quantity in the recorded frame that is nearest to the last one drawn."""
        return self.recording.read(name, self._nearest) if name in self.recording.fields else None

    def _compute_joints(self, before: int, after: int, weight: FloatArray) -> None:
        """Compute joints of a moment between two frames."""
        recording, share = self.recording, weight.astype(np.float32)[:, None]
        rotation = [
            recording.read(ROTATION, frame).astype(np.float32) / np.float32(ROTATION_STEPS)
            for frame in (before, after)
        ]
        side = np.where((rotation[0] * rotation[1]).sum(axis=-1, keepdims=True) < 0.0, -1.0, 1.0)
        blend = rotation[0] + share[..., None] * (side.astype(np.float32) * rotation[1] - rotation[0])
        length = np.sqrt((blend * blend).sum(axis=-1, keepdims=True))
        pose = self._pose.pose_rotation.reshape(len(weight), 4, PADDED_JOINTS)
        pose[:, :, : blend.shape[1]] = (blend / np.maximum(length, 1e-6)).transpose(0, 2, 1)
        pelvis = [recording.read(PELVIS, frame) for frame in (before, after)]
        leg = recording.segment_scale[:, int(Segment.LEG), None]
        self._pose.pose_pelvis[:] = (pelvis[0] + share * (pelvis[1] - pelvis[0])) / leg
        self._joints.compute_arrays(self._pose, recording.segment_scale, self._everyone)


def standing_joints(scene: Scene) -> Joints:
    """Joints of people who stand in the rest pose."""
    count = len(scene.stature)
    state = State.create(count)
    state.pose_rotation[:, :PADDED_JOINTS] = 1.0
    state.pose_pelvis[:] = scene.skeleton.offset[0]
    joints = Joints(scene.skeleton, count)
    joints.compute_arrays(state, scene.segment_scale, np.arange(count, dtype=np.int32))
    return joints


def recorded_scenario(recording: Recording) -> Scenario | None:
    """The scenario that a recording was made of; None for other formats than TOML and JSON."""
    text = recording.scenario_text
    try:
        return Scenario.model_validate(tomllib.loads(text) | {"name": recording.scenario_name})
    except (tomllib.TOMLDecodeError, ValidationError):
        pass
    try:
        return Scenario.model_validate_json(text)
    except ValidationError:
        return None


def recorded_places(recording: Recording, start: float = -math.inf, stop: float = math.inf) -> FloatArray:
    """Where people are in up to `SAMPLED_FRAMES` frames of a recording between two times, s. (P, 3) m."""
    first, last = np.searchsorted(recording.time, [start, stop])
    places = [np.zeros((0, 3))]
    for frame in np.unique(np.linspace(first, max(last - 1, first), SAMPLED_FRAMES).astype(int)).tolist():
        if frame < recording.frame_count:
            places.append(recording.read("position_world", frame)[recording.read("is_active", frame)])
    return np.concatenate(places)


def _bounds_of(recording: Recording) -> tuple[float, float, float, float]:
    """Ground under all walls and all ways."""
    points = np.concatenate([recording.walls.reshape(-1, 3), recorded_places(recording)])
    if not len(points):
        points = np.zeros((1, 3))
    low, high = points.min(axis=0) - 2.0, points.max(axis=0) + 2.0
    return float(low[0]), float(high[0]), float(low[2]), float(high[2])
