"""The simulation: a run is a pure function of scenario, seed and commands."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from crowd import checkpoint
from crowd.arguments import checked_seconds, checked_seed, whole_number
from crowd.checkpoint import Stateful
from crowd.commands import Commands
from crowd.controllers.animation import Animation
from crowd.controllers.constraint import Constraint, HandHolding
from crowd.controllers.controller import Controller, Step
from crowd.controllers.foot_lock import FootLock
from crowd.controllers.gaze import Gaze
from crowd.controllers.grab import Grab
from crowd.controllers.idle import Idle
from crowd.controllers.locomotion import Locomotion
from crowd.controllers.reach import Reach
from crowd.controllers.sitting import Sitting
from crowd.controllers.world_offset import WorldOffset
from crowd.errors import SettingsError, describe, nearest_first
from crowd.joints import Joints
from crowd.metrics import Metrics
from crowd.model import Model
from crowd.motion.library import MotionLibrary
from crowd.navigation.navigator import Navigator, avoidance_settings
from crowd.population import Population
from crowd.scenario import Scenario
from crowd.state import Float32Array, FloatArray, IntArray, State
from crowd.tasks import Events, Refusals, Tasks
from crowd.world.objects import ObjectState
from crowd_kernels import _jit

BODIES = ("people", "discs")
SERIAL_BELOW = 200
MOST_CHARACTERS = 2**31 - 1
"""What rows of 32 bits can tell apart."""
STAGES = ("perceive", "decide", "navigate", "steer", "locomote", "animate", "settle", "record")


@dataclass(frozen=True)
class Frame:
    """What `Simulation.step` returns.

    Attributes
    ----------
    index : int
        Number of the step, from 0.
    time : float
        Simulation time at the end of the step, s.
    simulation : Simulation
    """

    index: int
    time: float
    simulation: Simulation


class Simulation:
    """A crowd in a world, stepped at a fixed rate.

    Parameters
    ----------
    scenario : Scenario
        What `crowd.load_scenario` returns.
    seed : int
        Key of every random choice; the same seed gives the same bits on any number of threads.
    threads : int, optional
        Threads of the kernels; all cores when left out. Fewer than 200 characters always run on one.
    motions : MotionLibrary, optional
        The built-in library when left out.
    characters : int, optional
        Number of people, instead of the scenario's own.
    character_files : sequence of path
        Skinned glTF characters for people to whom the scenario gives none; each draws one.
    bodies : {"people", "discs"}
        ``"discs"`` moves plain discs by avoidance alone, without animation: the comparison for benchmarks.
    is_threaded : bool, optional
        Use the kernels' threaded builds; from 200 people on when left out. Results are the same.
    """

    def __init__(
        self,
        scenario: Scenario,
        *,
        seed: int = 0,
        threads: int | None = None,
        motions: MotionLibrary | None = None,
        characters: int | None = None,
        character_files: Sequence[str | os.PathLike[str]] = (),
        bodies: Literal["people", "discs"] = "people",
        is_threaded: bool | None = None,
    ) -> None:
        if not isinstance(scenario, Scenario):
            allowed = "what crowd.load_scenario returns"
            raise SettingsError(describe("scenario", "is no scenario", repr(scenario), allowed))
        if bodies not in BODIES:
            raise SettingsError(describe("bodies", "is unknown", bodies, nearest_first(str(bodies), BODIES)))
        self.scenario = scenario
        self.seed = seed = checked_seed(seed)
        self.bodies = bodies
        self.dt = scenario.dt
        self.step_index = 0
        if characters is not None:
            characters = whole_number("characters", characters, 1, MOST_CHARACTERS)
        self.model = Model.build(
            scenario, seed, motions, characters, [Path(file) for file in character_files]
        )
        capacity = self.model.capacity
        is_threaded = capacity >= SERIAL_BELOW if is_threaded is None else is_threaded
        wanted = thread_count(threads)
        self.threads = wanted if is_threaded else 1
        _jit.set_thread_count(self.threads)
        self.state = State.create(capacity)
        self.objects = ObjectState(self.model.objects)
        self.model.timetable.update(self.model.world, 0.0)
        self.navigator = Navigator(self.model, avoidance_settings(scenario), turns_first=bodies == "people")
        self.population = Population(self.model, seed, self.navigator.routing)
        self.world_offset = WorldOffset()
        self.idle = Idle(capacity)
        self.sitting = Sitting(capacity)
        self.locomotion = Locomotion(capacity)
        self.animation = Animation(capacity)
        people = self.model.people
        self.reach = Reach(self.model.library, people.segment_scale, people.stature, self.model.world)
        self.joints = Joints(self.model.skeleton, capacity)
        self.grab = Grab(self.model, self.objects, self.joints, self.reach)
        self.carrying = self.grab.carrying
        self.gaze = Gaze(
            self.model.skeleton, capacity, self.navigator.avoidance, self.objects, self.model.placed
        )
        self.constraint = Constraint(self.model.skeleton, capacity)
        self.controllers: tuple[Controller, ...] = (
            self.world_offset,
            self.idle,
            self.sitting,
            self.locomotion,
            self.animation,
            self.carrying,
            self.reach,
            self.grab,
            HandHolding(self.constraint),
            self.gaze,
        )
        self.foot_lock = FootLock(self.model.skeleton, capacity=capacity, dt=self.dt)
        self.commands = Commands(self)
        self.tasks = Tasks(self)
        self.refusals = Refusals(self)
        if bodies == "people" and (self.objects.count or self.tasks.lists.count.any()):
            self.reach.prepare()
        self.metrics = Metrics()
        self.stage_seconds = dict.fromkeys(STAGES, 0.0)
        layers = (*self.controllers, self.constraint)
        self.layer_seconds = dict.fromkeys((type(layer).__name__ for layer in layers), 0.0)
        self.compile_seconds = 0.0
        first = self.population.first_people()
        self.population.enter(
            self.state, first, self.model.placed.position_world[first], self.model.placed.yaw[first]
        )
        self._prepare(first)

    @property
    def time(self) -> float:
        """Simulated time, s."""
        return self.step_index * self.dt

    @property
    def events(self) -> Events:
        """What happened to people's tasks."""
        return self.tasks.events

    @property
    def is_finished(self) -> bool:
        """Everyone has completed the task list, and nobody is still to come."""
        present = self.state.is_active
        return not self.population.expects_more() and bool(self.state.is_finished[present].all())

    def step(self, on_stage: Callable[[str], None] | None = None) -> Frame:
        """Advance by one step of `dt`; `on_stage` is called with the name of each stage before it runs."""
        _jit.set_thread_count(self.threads)
        step = Step(
            self.model,
            self.state,
            self.population.active(self.state),
            self.step_index,
            self.time + self.dt,
            self.dt,
            self.seed,
        )
        frame = Frame(step.index, step.time, self)
        for stage in STAGES:
            if on_stage is not None:
                on_stage(stage)
            start = time.perf_counter()
            getattr(self, f"_{stage}")(step, frame)
            self.stage_seconds[stage] += time.perf_counter() - start
        self.step_index += 1
        return frame

    def run(self, seconds: float | None = None) -> Iterator[Frame]:
        """Step for `seconds` of simulated time; without it, until everyone has finished.

        Raises
        ------
        SettingsError
            It is no time, or too long.
        """
        last = None
        if seconds is not None:
            last = self.step_index + round(checked_seconds("run", seconds) / self.dt)
        while not self.is_finished if last is None else self.step_index < last:
            yield self.step()

    # ---- the stages of a frame, in the order of `STAGES`

    def _perceive(self, step: Step, frame: Frame) -> None:
        """Let people in, change the world by its timetable."""
        self.model.timetable.update(self.model.world, step.time)
        self._prepare(self.population.newcomers(step))
        step.active = self.population.active(self.state)

    def _decide(self, step: Step, frame: Frame) -> None:
        """Advance lists of goals and tasks; start what the scenario plays."""
        self.population.decide(step, self.commands)
        if self.bodies == "people":
            self.tasks.decide(step)
        step.active = self.population.active(self.state)

    def _navigate(self, step: Step, frame: Frame) -> None:
        """Find way points."""
        self.navigator.navigate(step)

    def _steer(self, step: Step, frame: Frame) -> None:
        """Choose velocities that avoid others and walls."""
        self.navigator.steer(step)

    def _locomote(self, step: Step, frame: Frame) -> None:
        """Turn velocities into parameters of the motion library."""
        if self.bodies == "people":
            self.locomotion.command(step)

    def _animate(self, step: Step, frame: Frame) -> None:
        """Run the controller stack."""
        if self.bodies == "discs":
            self.navigator.move_discs(step)
            return
        for controller in self.controllers:
            self._evaluate(controller, step)

    def _evaluate(self, controller: Controller, step: Step) -> None:
        """Run one layer and note its time."""
        start = time.perf_counter()
        controller.evaluate(step)
        name = type(controller).__name__
        self.layer_seconds[name] = self.layer_seconds.get(name, 0.0) + time.perf_counter() - start

    def _settle(self, step: Step, frame: Frame) -> None:
        """Push bodies apart, plant feet, hold effectors, and compute joints."""
        self.navigator.project(step)
        if self.bodies == "discs":
            return
        state, model = self.state, self.model
        self.foot_lock.evaluate(
            state.pose_rotation,
            state.pose_pelvis,
            model.people.segment_scale,
            state.position_world,
            state.yaw,
            self.locomotion.contact_wanted,
            step.active,
            step.dt,
            state.foot_point_world,
            state.foot_contact,
        )
        self._evaluate(self.constraint, step)
        self.joints.compute(state, model.people, step.active)
        self.grab.settle(step)

    def _record(self, step: Step, frame: Frame) -> None:
        """Tell of refused targets, hand the frame to metrics."""
        self.refusals.tell(step.time)
        self.metrics.observe(self)

    # ---- what a program reads

    def joint_positions_world(self) -> FloatArray:
        """Joints of everyone in world space, m. (N, J, 3) float64; rows of empty slots mean nothing."""
        return self.joints.positions_world(self.state)

    def joint_rotations_local(self) -> Float32Array:
        """Rotations against the parent joints, unit quaternions. (N, J, 4) float32."""
        rows = self.state.pose_rotation.reshape(self.state.capacity, 4, -1)
        return np.ascontiguousarray(rows[:, :, : self.model.skeleton.joint_count].transpose(0, 2, 1))

    def pelvis_positions_root(self) -> Float32Array:
        """Pelvis in the root frame, in each person's own scale, m. (N, 3) float32."""
        return self.joints.position_model[:, 0].copy()

    # ---- stop and go on

    def stateful_parts(self) -> tuple[tuple[str, Stateful], ...]:
        """Parts with arrays of their own that change in a run."""
        return (
            ("population", self.population),
            ("foot_lock", self.foot_lock),
            ("objects", self.objects),
            ("tasks", self.tasks),
            ("refusals", self.refusals),
            *self.navigator.parts(),
        )

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the whole state to a file, see `crowd.checkpoint.save`."""
        checkpoint.save(self, path)

    def restore(self, path: str | os.PathLike[str]) -> None:
        """Continue from a saved state of the same scenario, number of people and seed, with the same bits."""
        checkpoint.restore(self, path)

    def _prepare(self, rows: IntArray) -> None:
        """Prepare layers for people who have just entered."""
        if rows.size == 0:
            return
        for controller in self.controllers:
            controller.activate(self.state, rows)
        self.foot_lock.reset(rows)
        self.tasks.enter(rows)
        self.constraint.activate(self.state, rows)


def thread_count(wanted: int | None) -> int:
    """Threads to use: all that there are, or those wanted.

    Raises
    ------
    SettingsError
        There are not so many.
    """
    most = _jit.maximum_thread_count()
    if wanted is None:
        return most
    return whole_number("threads", wanted, 1, most)
