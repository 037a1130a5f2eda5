"""Frames per second of whole crowds: standing, walking in the open, walking densely."""

import math
import resource
import time
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from crowd.compilation import warm_up
from crowd.hand_metrics import hand_errors
from crowd.scenario.object_table import ObjectTable
from crowd.scenario.schema import Area, Goal, Region, Scenario, Spread, WorldTable
from crowd.simulation import Simulation, thread_count

SCENES = ("standing", "walking_open", "walking_dense", "reaching", "everything")
SIZES = (10, 30, 100, 300, 1000, 3000, 10_000)
DENSITY = {
    "standing": 0.5,
    "walking_open": 0.5,
    "walking_dense": 2.0,
    "reaching": 0.5,
    "everything": 0.5,
}
"""Characters per square metre."""
BODY_RADIUS = 0.22
MOST_OVERLAP = 0.05
MOST_SLIP = 0.01
LEAST_SPEED = {"walking_open": 0.8, "walking_dense": 0.02, "everything": 0.8}
"""Mean speed below which nobody really walked, m/s."""
WARM_UP_SECONDS = 2.5
HANDS_AT_WORK = ("reaching", "everything")
"""Scenes in which everyone reaches, holds and looks."""
BALLS_IN_HANDS = ("everything",)
"""Scenes in which everyone holds a ball in the left hand."""
BALL_RADIUS = 0.035
BALL_PLACE = (0.2, 1.1, 0.36)
"""Where the left hand takes the ball: in the root frame at a stature of 1.75 m, m."""
TAKE_SECONDS = 2.5
"""Time that people stand and take the balls, s."""
TARGET_SECONDS = 2.0
MOST_REACH_ERROR = 0.03
"""Median distance of hands at work from their targets at the end, m; targets that walk are a step ahead."""
LEAST_AT_WORK = 0.9
"""Hands that reach at the end, and balls that are held, over people."""


@dataclass(frozen=True)
class FrameResult:
    """One row of the table; `asdict` gives the JSON form."""

    case: str
    characters: int
    threads: int
    fps: float
    us_per_character: float
    stages: dict[str, float]
    """Microseconds per character and frame of each stage."""
    ok: bool
    problem: str
    peak_memory_mb: float
    layers: dict[str, float]
    """The same for each layer of the controller stack, and for the parts of reaching."""

    def as_dict(self) -> dict[str, Any]:
        """Form for JSON."""
        return asdict(self)


def scene(name: str, characters: int) -> Scenario:
    """Make a scene of a given number of people at the scene's density.

    Walkers go to random points of the whole square, again and again.
    """
    side = math.sqrt(characters / DENSITY[name])
    square = Area(x=(-side / 2, side / 2), z=(-side / 2, side / 2))
    margin = 2.0
    ground = Area(x=(-side / 2 - margin, side / 2 + margin), z=(-side / 2 - margin, side / 2 + margin))
    walks = name in LEAST_SPEED
    region = Region(
        count=characters,
        area=square,
        arrangement="grid" if name == "walking_dense" else "random",
        spacing=0.02,
        facing="random",
        radius=Spread(min=BODY_RADIUS, max=BODY_RADIUS),
        goals=(Goal(area=square, radius=0.8),) if walks else (),
        repeat=walks,
    )
    ball = ObjectTable(shape="sphere", radius=BALL_RADIUS, position=BALL_PLACE)
    balls = (ball,) * characters if name in BALLS_IN_HANDS else ()
    return Scenario(name=name, world=WorldTable(bounds=ground), regions=(region,), objects=balls)


def measure_frames(
    name: str, characters: int, threads: int | None, seconds: float, seed: int = 1
) -> FrameResult:
    """Run one scene and time its frames; compiling is done before, and giving new targets does not count."""
    simulation = Simulation(scene(name, characters), seed=seed, threads=threads)
    hands = Hands(simulation) if name in HANDS_AT_WORK else None
    for _ in simulation.run(seconds=WARM_UP_SECONDS):
        if hands is not None:
            hands.ask()
    used = (simulation.stage_seconds, simulation.layer_seconds, simulation.reach.part_seconds)
    for seconds_used in used:
        seconds_used.update(dict.fromkeys(seconds_used, 0.0))
    start_step = simulation.step_index
    begin = time.perf_counter()
    wall = 0.0
    # A slow machine gets fewer frames rather than a long wait.
    while simulation.step_index - start_step < 10 or (
        simulation.step_index - start_step < seconds / simulation.dt
        and time.perf_counter() - begin < 20 * seconds
    ):
        if hands is not None:
            hands.ask()
        start = time.perf_counter()
        simulation.step()
        wall += time.perf_counter() - start
    frames = simulation.step_index - start_step
    per_item = 1e6 / (frames * characters)
    problem = find_problem(simulation, name)
    reach_parts = simulation.reach.part_seconds
    layers = simulation.layer_seconds | {f"Reach ({part})": reach_parts[part] for part in reach_parts}
    return FrameResult(
        name,
        characters,
        simulation.threads,
        frames / wall,
        wall * per_item,
        {stage: seconds_used * per_item for stage, seconds_used in simulation.stage_seconds.items()},
        not problem,
        problem,
        resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0,
        {layer: seconds_used * per_item for layer, seconds_used in layers.items()},
    )


class Hands:
    """Keeps everyone's right hand at work: reaching, holding, and looking there.

    People who stand get a new target every two seconds. People who walk hold a point before the body, which
    moves with them; where there are balls they first stand and take one each with the left hand.
    """

    def __init__(self, simulation: Simulation) -> None:
        self._simulation = simulation
        self._random = np.random.default_rng(7)
        self._is_walking = bool(simulation.model.placed.goal_count.any())
        self._rows = simulation.population.active(simulation.state)
        self._point = self._draw(self._rows.size)
        if simulation.objects.count:
            self._take_balls()
        self._start = simulation.step_index

    def _take_balls(self) -> None:
        """Let everyone stand, grasp a ball with the left hand and take it back."""
        simulation, rows = self._simulation, self._rows
        items = np.arange(rows.size, dtype=np.int32)
        simulation.objects.position_world[items] = self._in_world(rows, np.tile(BALL_PLACE, (rows.size, 1)))
        simulation.commands.set_locomotion(rows, (0.0, 0.0, 0.0))
        simulation.grab.grasp(simulation.state, rows, 1, items)
        for _ in simulation.run(seconds=TAKE_SECONDS):
            pass
        simulation.commands.end_reach(rows, "left")
        simulation.commands.release(rows)

    def ask(self) -> None:
        """Give new targets to those whose time has come, and take the targets along."""
        simulation, state = self._simulation, self._simulation.state
        period = round(TARGET_SECONDS / simulation.dt)
        is_due = (self._rows + simulation.step_index) % period == 0
        due = self._rows[is_due]
        if due.size and (not self._is_walking or simulation.step_index < self._start + period):
            self._point[is_due] = self._draw(due.size)
            targets = self._in_world(due, self._point[due])
            simulation.commands.reach(due, targets, "right")
            simulation.gaze.look_at_point(state, due, targets)
        if self._is_walking:
            reaching = self._rows[state.reach_stage[self._rows, 0] > 0]
            targets = self._in_world(reaching, self._point[reaching])
            state.reach_target_world[reaching, 0] = targets
            state.gaze_target_world[reaching] = targets

    def _draw(self, count: int) -> npt.NDArray[np.float64]:
        """Points before and beside the body, in the root frame at a stature of 1.75 m, m."""
        return self._random.uniform((-0.6, 0.8, 0.35), (0.1, 1.5, 0.6), (count, 3))

    def _in_world(
        self, rows: npt.NDArray[np.int32], points: npt.NDArray[np.float64]
    ) -> npt.NDArray[np.float64]:
        """Points in root frames at a stature of 1.75 m (R, 3) where these people are, m."""
        state, people = self._simulation.state, self._simulation.model.people
        x, y, z = (points * (people.stature[rows] / 1.75)[:, None]).T
        sine, cosine = np.sin(state.yaw[rows]), np.cos(state.yaw[rows])
        away = np.stack([cosine * x + sine * z, y, cosine * z - sine * x], axis=1)
        return np.asarray(state.position_world[rows] + away)


def find_problem(simulation: Simulation, name: str) -> str:
    """What is wrong with a run, in words; empty when nothing is."""
    state, metrics = simulation.state, simulation.metrics.as_dict()
    if not np.isfinite(simulation.joint_positions_world()).all():
        return "joint positions are not finite"
    overlap = metrics.get("overlap.max_depth_m", 0.0)
    if overlap > MOST_OVERLAP:
        return f"bodies overlap by {overlap:.3f} m, allowed {MOST_OVERLAP}"
    slip = metrics.get("foot_slip.mean_m", 0.0)
    if slip > MOST_SLIP:
        return f"feet slip by {slip:.4f} m, allowed {MOST_SLIP}"
    if name in HANDS_AT_WORK:
        at_work = np.nonzero(state.reach_stage)
        if at_work[0].size < LEAST_AT_WORK * state.is_active.sum():
            return f"only {at_work[0].size} hands reach"
        error = float(np.median(hand_errors(simulation, *at_work)))
        if error > MOST_REACH_ERROR:
            return f"hands are {error:.3f} m from their targets, allowed {MOST_REACH_ERROR}"
    if name in BALLS_IN_HANDS:
        held = int((simulation.objects.holder >= 0).sum())
        if held < LEAST_AT_WORK * state.is_active.sum():
            return f"only {held} balls are held"
    speed = float(np.hypot(state.velocity_world[:, 0], state.velocity_world[:, 2]).mean())
    least = LEAST_SPEED.get(name, 0.0)
    return f"mean speed is {speed:.2f} m/s, expected from {least}" if speed < least else ""


def compile_kernels(threads: int | None) -> float:
    """Compile both builds of all kernels; returns the time, s."""
    seconds = warm_up()
    return seconds + (warm_up(is_threaded=True) if thread_count(threads) > 1 else 0.0)
