"""Frames per second of whole crowds: standing, walking in the open, walking densely."""

import math
import resource
import time
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from crowd.compilation import warm_up
from crowd.scenario.schema import Area, Goal, Region, Scenario, Spread, WorldTable
from crowd.simulation import Simulation, thread_count

SCENES = ("standing", "walking_open", "walking_dense")
SIZES = (10, 30, 100, 300, 1000, 3000, 10_000)
DENSITY = {"standing": 0.5, "walking_open": 0.5, "walking_dense": 2.0}
"""Characters per square metre."""
BODY_RADIUS = 0.22
MOST_OVERLAP = 0.05
MOST_SLIP = 0.01
LEAST_SPEED = {"walking_open": 0.8, "walking_dense": 0.02}
"""Mean speed below which nobody really walked, m/s."""
WARM_UP_SECONDS = 1.0


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
    walks = name != "standing"
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
    return Scenario(name=name, world=WorldTable(bounds=ground), regions=(region,))


def measure_frames(
    name: str, characters: int, threads: int | None, seconds: float, seed: int = 1
) -> FrameResult:
    """Run one scene and time its frames; compiling is done before."""
    simulation = Simulation(scene(name, characters), seed=seed, threads=threads)
    for _ in simulation.run(seconds=WARM_UP_SECONDS):
        pass
    for stage in simulation.stage_seconds:
        simulation.stage_seconds[stage] = 0.0
    start_step = simulation.step_index
    begin = time.perf_counter()
    # A slow machine gets fewer frames rather than a long wait.
    while simulation.step_index - start_step < 10 or (
        simulation.step_index - start_step < seconds / simulation.dt
        and time.perf_counter() - begin < 20 * seconds
    ):
        simulation.step()
    wall = time.perf_counter() - begin
    frames = simulation.step_index - start_step
    per_item = 1e6 / (frames * characters)
    problem = find_problem(simulation, name)
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
    )


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
    speed = float(np.hypot(state.velocity_world[:, 0], state.velocity_world[:, 2]).mean())
    least = LEAST_SPEED.get(name, 0.0)
    return f"mean speed is {speed:.2f} m/s, expected from {least}" if speed < least else ""


def compile_kernels(threads: int | None) -> float:
    """Compile both builds of all kernels; returns the time, s."""
    seconds = warm_up()
    return seconds + (warm_up(is_threaded=True) if thread_count(threads) > 1 else 0.0)
