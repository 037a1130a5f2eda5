"""Bodies for trajectories: people who walk where points went, with the engine's own locomotion."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Sequence
from typing import ClassVar

import numpy as np
import numpy.typing as npt
from scipy.interpolate import Akima1DInterpolator
from scipy.ndimage import gaussian_filter1d
from shapely.geometry.base import BaseGeometry

from crowd.controllers.controller import Step
from crowd.controllers.locomotion import COMMAND_LIMITS, LocomotionSettings
from crowd.errors import RecordingError, describe
from crowd.motion.library import MotionLibrary
from crowd.navigation.navigator import Navigator
from crowd.recorder import Recorder
from crowd.scenario import Scenario
from crowd.scenario.schema import DEFAULT_DT, Area, Flow, Polygon, Wall, WorldTable
from crowd.simulation import Frame, Simulation
from crowd.state import IntArray, State
from crowd.trajectories.trajectories import Trajectories, Way

FloatArray = npt.NDArray[np.float64]

MARGIN = 2.0
"""Ground around all ways, m."""
WALL_HEIGHT = 1.0
"""Files know no heights, m."""
SMOOTHING = 0.25
"""Deviation of the bell curve over which velocities are averaged, s: half a step, so that the sway of a
tracked head is no change of speed."""
STANDING_SPEED = 0.1
"""Slower points stand, m/s."""
FACING_SPEED = 0.25
"""Slower people keep their heading, m/s: the direction of so small a motion is noise."""
LOOK_AHEAD = 0.25
"""People turn to where they will go so much later, s."""
TURN_GAIN = 4.0
"""Turn rate per heading error, 1/s."""
TURN_LIMIT = 2.5
"""rad/s."""
NEVER = 1e9
# Motion is given, so a command may change as fast as the points do.
LIMITS = COMMAND_LIMITS._replace(
    forward_acceleration=20.0, braking=20.0, side_acceleration=20.0, turn_acceleration=60.0
)
LARGEST_CROWD = 20_000


class FollowingSimulation(Simulation):
    """A simulation whose people are where the points of some trajectories are.

    Roots go through all samples exactly, between them along smooth curves. Headings, steps and planted feet
    are the engine's: people face where they go, stand where their point stands, and feet stay where they are
    put down as far as legs reach.

    Parameters
    ----------
    trajectories : Trajectories
    seed : int
        Key of everyone's body.
    threads : int, optional
    motions : MotionLibrary, optional
        The built-in library when left out.
    character_files : sequence of path
        Skinned glTF characters that people are drawn as.

    Notes
    -----
    Time counts from the first sample. Between samples a way is an Akima curve (Akima, "A new method of
    interpolation", J. ACM 17, 1970, in its later form that does not overshoot), so that somebody who stands
    between two samples stands.
    """

    def __init__(
        self,
        trajectories: Trajectories,
        *,
        seed: int = 0,
        threads: int | None = None,
        motions: MotionLibrary | None = None,
        character_files: Sequence[str | os.PathLike[str]] = (),
    ) -> None:
        super().__init__(
            scenario_around(trajectories),
            seed=seed,
            threads=threads,
            motions=motions,
            character_files=character_files,
        )
        self.trajectories = trajectories
        self.navigator = Bystander(self.model, self.navigator.avoidance.settings)
        self.locomotion.settings = LocomotionSettings(command=LIMITS)
        self.following = Following(self.model.capacity, trajectories, self.dt)
        self.controllers = (self.following, *self.controllers[1:])

    @property
    def is_finished(self) -> bool:
        """All ways have ended."""
        return self.following.has_ended and not self.state.is_active.any()

    @property
    def seconds(self) -> float:
        """Time from the first sample to the last, s."""
        return self.trajectories.last_time - self.trajectories.first_time

    def _perceive(self, step: Step, frame: Frame) -> None:
        """Let people in and out as their ways begin and end."""
        super()._perceive(step, frame)
        state, following = self.state, self.following
        state.is_active[following.leavers(step.index)] = False
        rows, position, yaw = following.newcomers(state, step.index)
        if rows.size:
            self.population.enter(state, rows, position, yaw)
            self._prepare(rows)
            following.take_up(state, rows)
        step.active = self.population.active(state)

    def _steer(self, step: Step, frame: Frame) -> None:
        """Take the motion from the ways."""
        self.following.direct(step)


class Bystander(Navigator):
    """A navigator that leaves everyone alone: where people go is known."""

    def navigate(self, step: Step) -> None:
        """Find no ways."""

    def steer(self, step: Step) -> None:
        """Avoid nobody."""

    def project(self, step: Step) -> None:
        """Push nobody."""


class Following:
    """Layer 1 in place of the world offset: roots are where their points are."""

    state_fields: ClassVar[tuple[str, ...]] = ("position_world", "previous_position_world", "yaw")

    def __init__(self, capacity: int, trajectories: Trajectories, dt: float) -> None:
        self.dt = dt
        self.trajectories = trajectories
        self._spans = [trajectories.steps(way, dt) for way in trajectories.ways]
        self._next = 0
        self._motion: list[FloatArray] = [np.zeros((1, 4))] * capacity
        self._first = np.zeros(capacity, np.int64)
        self._last = np.full(capacity, -1, np.int64)
        self._turn_rate = np.zeros(capacity)
        self._place = np.zeros((capacity, 2))

    @property
    def has_ended(self) -> bool:
        """No way is still to begin."""
        return self._next >= len(self._spans)

    def activate(self, state: State, characters: IntArray) -> None:
        """Start people as their ways do, see `take_up`."""

    def leavers(self, index: int) -> IntArray:
        """Rows whose way has ended before this step."""
        gone = np.flatnonzero((self._last >= 0) & (self._last < index)).astype(np.int32)
        self._last[gone] = -1
        return gone

    def newcomers(self, state: State, index: int) -> tuple[IntArray, FloatArray, FloatArray]:
        """Take the ways that begin in this step: rows (M,), first positions (M, 3) and headings (M,)."""
        begin = self._next
        while self._next < len(self._spans) and self._spans[self._next][0] <= index:
            self._next += 1
        numbers = range(begin, self._next)
        rows = np.flatnonzero(~state.is_active)[: len(numbers)].astype(np.int32)
        position, yaw = np.zeros((len(rows), 3)), np.zeros(len(rows))
        for k, (row, number) in enumerate(zip(rows.tolist(), numbers, strict=True)):
            last = self._spans[number][1]
            # A step shows the time at its end.
            times = self.trajectories.first_time + self.dt * np.arange(index + 1.0, last + 2.0)
            motion = motion_along(self.trajectories.ways[number], times, self.dt)
            self._motion[row], self._first[row], self._last[row] = motion, index, last
            position[k, [0, 2]] = motion[0, :2]
            yaw[k] = first_heading(motion)
        return rows, position, yaw

    def take_up(self, state: State, rows: IntArray) -> None:
        """Let people who come into view walking walk from the first step on."""
        for row in rows.tolist():
            velocity = self._motion[row][0, 2:]
            speed = float(np.hypot(*velocity))
            if speed > STANDING_SPEED:
                state.is_moving[row] = True
                state.locomotion_weight[row] = 1.0
                state.locomotion_parameter[row] = speed, 0.0, 0.0

    def direct(self, step: Step) -> None:
        """Command locomotion to do what the points do."""
        state, rows = step.state, step.active
        now = np.zeros((len(rows), 4))
        ahead = np.zeros((len(rows), 2))
        later = round(LOOK_AHEAD / step.dt)
        for k, row in enumerate(rows.tolist()):
            motion, number = self._motion[row], step.index - int(self._first[row])
            now[k] = motion[min(number, len(motion) - 1)]
            ahead[k] = motion[min(number + later, len(motion) - 1), 2:]
        velocity = now[:, 2:]
        yaw = state.yaw[rows]
        is_going = np.hypot(ahead[:, 0], ahead[:, 1]) > FACING_SPEED
        error = np.where(is_going, np.arctan2(ahead[:, 0], ahead[:, 1]) - yaw, 0.0)
        error = np.remainder(error + math.pi, 2.0 * math.pi) - math.pi
        turn = np.clip(TURN_GAIN * error, -TURN_LIMIT, TURN_LIMIT)
        sine, cosine = np.sin(yaw), np.cos(yaw)
        stands = (np.hypot(velocity[:, 0], velocity[:, 1]) < STANDING_SPEED) & (np.abs(turn) < 0.1)
        moves = np.where(stands, 0.0, 1.0)
        state.is_directed[rows] = True
        state.directed_parameter[rows, 0] = moves * (velocity[:, 0] * sine + velocity[:, 1] * cosine)
        state.directed_parameter[rows, 1] = moves * turn
        state.directed_parameter[rows, 2] = moves * (velocity[:, 0] * cosine - velocity[:, 1] * sine)
        state.desired_velocity_world[rows[:, None], [0, 2]] = velocity
        state.velocity_world[rows[:, None], [0, 2]] = velocity
        self._turn_rate[rows] = moves * turn
        self._place[rows] = now[:, :2]

    def evaluate(self, step: Step) -> None:
        """Put roots where their points are, and turn them."""
        state, rows = step.state, step.active
        state.previous_position_world[rows] = state.position_world[rows]
        state.position_world[rows[:, None], [0, 2]] = self._place[rows]
        yaw = state.yaw[rows] + step.dt * self._turn_rate[rows]
        state.yaw[rows] = np.remainder(yaw + math.pi, 2.0 * math.pi) - math.pi


def motion_along(way: Way, times: FloatArray, dt: float) -> FloatArray:
    """Sample a way.

    Parameters
    ----------
    way : Way
    times : (T,) float64
        Evenly spaced, s; outside of the way its ends count.
    dt : float
        Their distance, s.

    Returns
    -------
    (T, 4) float64
        x, z, m; smoothed velocity x, z, m/s.
    """
    motion = np.zeros((len(times), 4))
    if len(way.time) < 2:
        motion[:, :2] = way.position[0]
        return motion
    curve = Akima1DInterpolator(way.time, way.position, method="makima")
    motion[:, :2] = curve(np.clip(times, way.time[0], way.time[-1]))
    if len(times) < 2:
        return motion
    # Continued beyond both ends by its reflection, so that nobody seems to start or stop there.
    reach = min(round(4.0 * SMOOTHING / dt), len(times) - 1)
    before = 2.0 * motion[0, :2] - motion[reach:0:-1, :2]
    after = 2.0 * motion[-1, :2] - motion[-2 : -reach - 2 : -1, :2]
    longer = np.concatenate([before, motion[:, :2], after])
    smooth = gaussian_filter1d(longer, SMOOTHING / dt, axis=0, mode="nearest")
    motion[:, 2:] = np.gradient(smooth, dt, axis=0)[reach : reach + len(times)]
    return motion


def first_heading(motion: FloatArray) -> float:
    """Direction of the first motion that tells one, rad; 0 where there is none."""
    speed = np.hypot(motion[:, 2], motion[:, 3])
    going = np.flatnonzero(speed > FACING_SPEED)
    if going.size:
        return math.atan2(*motion[going[0], 2:])
    step = motion[-1, :2] - motion[0, :2]
    return math.atan2(*step) if float(np.hypot(*step)) > 0.05 else 0.0


def scenario_around(trajectories: Trajectories) -> Scenario:
    """A scenario with the walls of the file, and room for as many people as are seen at once.

    Raises
    ------
    RecordingError
        There are too many people.
    """
    present = trajectories.most_present(DEFAULT_DT)
    if present > LARGEST_CROWD:
        raise RecordingError(
            describe(trajectories.name, "shows too many people at once", present, f"up to {LARGEST_CROWD}")
        )
    points = np.concatenate([way.position for way in trajectories.ways])
    if trajectories.area is not None:
        low_x, low_z, high_x, high_z = trajectories.area.bounds
        points = np.concatenate([points, [[low_x, low_z], [high_x, high_z]]])
    low, high = (points.min(axis=0) - MARGIN).tolist(), (points.max(axis=0) + MARGIN).tolist()
    bounds = Area(x=(low[0], high[0]), z=(low[1], high[1]))
    walls, polygons = walls_around(trajectories.area)
    return Scenario(
        name=trajectories.name,
        description="people who walk along trajectories",
        seconds=max(trajectories.last_time - trajectories.first_time, DEFAULT_DT),
        world=WorldTable(bounds=bounds, walls=walls, polygons=polygons),
        flows=(Flow(source=bounds, rate=1.0, start_at=NEVER, most_present=present, name="people"),),
    )


def walls_around(area: BaseGeometry | None) -> tuple[tuple[Wall, ...], tuple[Polygon, ...]]:
    """Walls along the rim of an area, and its holes as obstacles."""
    walls: list[Wall] = []
    holes: list[Polygon] = []
    for part in [] if area is None else getattr(area, "geoms", [area]):
        if part.geom_type == "Polygon":
            walls.append(Wall(points=tuple(map(tuple, part.exterior.coords)), height=WALL_HEIGHT))
            holes += [
                Polygon(points=tuple(map(tuple, ring.coords[:-1])), height=WALL_HEIGHT)
                for ring in part.interiors
            ]
    return tuple(walls), tuple(holes)


def record_bodies(
    trajectories: Trajectories,
    path: str | os.PathLike[str],
    *,
    seed: int = 0,
    motions: MotionLibrary | None = None,
    character_files: Sequence[str | os.PathLike[str]] = (),
    on_frame: Callable[[Frame], None] = lambda frame: None,
) -> FollowingSimulation:
    """Give trajectories bodies, and write a recording of them.

    Parameters
    ----------
    trajectories : Trajectories
    path : path
        Of the recording; an existing file is replaced.
    seed, motions, character_files
        As of `FollowingSimulation`.
    on_frame : callable, optional
        Called after each step.

    Returns
    -------
    FollowingSimulation
        At its end, with its metrics.
    """
    simulation = FollowingSimulation(
        trajectories, seed=seed, motions=motions, character_files=character_files
    )
    with Recorder(path, simulation) as recorder:
        while not simulation.is_finished:
            frame = simulation.step()
            recorder.record(frame)
            on_frame(frame)
    return simulation
