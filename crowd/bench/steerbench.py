"""SteerBench files run with whole people, beside the same files run with plain discs."""

import time
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from crowd.bench.steerbench_score import CLASSIC_RATE, Scores, SteerBenchScores
from crowd.errors import SettingsError, describe
from crowd.scenario import Scenario, load_scenario
from crowd.simulation import Simulation

Bodies = Literal["people", "discs"]
MOST_OVERLAP = 0.05
SMALL = 50
"""Files with fewer characters than this get the short time limit."""
SHORT_EXTRA = 60.0
LONG_LIMIT = 3600.0
"""Time limit of crowded files, s: jams are given time."""


@dataclass(frozen=True)
class SteerBenchResult:
    """One file run once."""

    name: str
    bodies: Bodies
    characters: int
    arrived: float
    seconds: float
    limit: float
    classic: Scores
    step_free: Scores
    ideal: float
    deepest_m: float
    crossings: int
    wall_seconds: float

    @property
    def problem(self) -> str:
        """What is wrong; empty when every goal was reached, no wall crossed and no body overlapped deeply."""
        if self.arrived < 1.0:
            return f"{self.arrived:.1%} arrived"
        if self.crossings:
            return f"{self.crossings} walls crossed"
        return f"overlap {self.deepest_m:.3f} m" if self.deepest_m > MOST_OVERLAP else ""


def ideal_score(simulation: Simulation) -> float:
    """Composite 01 of characters that go straight to their goals at their speed, undisturbed.

    The discrete clock of 20 Hz and the removal at the goal's radius are those of the suite.
    """
    placed = simulation.model.placed
    scores = []
    for row in range(simulation.model.capacity):
        first, count = int(placed.first_goal[row]), int(placed.goal_count[row])
        here, frames = placed.position_world[row], 0
        speed = placed.preferred_speed[row]
        for goal in range(first, first + count):
            own = placed.goal_speed[goal]
            speed = speed if np.isnan(own) else own
            length = float(np.linalg.norm(placed.goal_world[goal] - here))
            frames += int(np.ceil((length - placed.goal_radius[goal]) * CLASSIC_RATE / speed - 1e-9))
            here = placed.goal_world[goal]
        scores.append(frames / CLASSIC_RATE + frames * 0.5 * speed**2)
    return float(np.mean(scores)) if scores else 0.0


def time_limit(scenario: Scenario, simulation: Simulation) -> float:
    """Twice the undisturbed time and a minute for small files; an hour for crowds."""
    if simulation.model.capacity >= SMALL:
        return LONG_LIMIT
    placed = simulation.model.placed
    length = 0.0
    for row in range(simulation.model.capacity):
        first, count = int(placed.first_goal[row]), int(placed.goal_count[row])
        points = np.vstack([placed.position_world[row : row + 1], placed.goal_world[first : first + count]])
        own = np.linalg.norm(np.diff(points, axis=0), axis=1).sum() / placed.preferred_speed[row]
        length = max(length, float(own))
    return 2.0 * length + SHORT_EXTRA


def run_file(path: Path, bodies: Bodies, threads: int | None = None, seed: int = 0) -> SteerBenchResult:
    """Run one file to the end or to its time limit."""
    begin = time.perf_counter()
    scenario = load_scenario(path)
    simulation = Simulation(scenario, seed=seed, threads=threads, bodies=bodies)
    state = simulation.state
    scores = SteerBenchScores(simulation.model.radius, simulation.model.world.tree)
    scores.add(0.0, state.position_world[:, [0, 2]], state.is_active)
    limit = time_limit(scenario, simulation)
    for frame in simulation.run(seconds=limit):
        scores.add(frame.time, state.position_world[:, [0, 2]], state.is_active)
        if simulation.is_finished:
            break
    metrics = simulation.metrics.as_dict()
    return SteerBenchResult(
        path.stem,
        bodies,
        simulation.model.capacity,
        float(metrics["finished"]),
        simulation.time,
        limit,
        scores.classic,
        scores.step_free,
        ideal_score(simulation),
        float(metrics["overlap.max_depth_m"]),
        int(metrics.get("wall.crossings", 0)),
        time.perf_counter() - begin,
    )


def find_files(folder: Path) -> list[Path]:
    """All SteerBench files of a folder.

    Raises
    ------
    SettingsError
        There are none.
    """
    files = sorted(folder.glob("*.xml")) if folder.is_dir() else [folder] if folder.is_file() else []
    if not files:
        raise SettingsError(
            describe(str(folder), "holds no SteerBench files", allowed="a folder with .xml files")
        )
    return files


COLUMNS = (
    "file                    bodies  people arrived  time s limit s ideal 01       01       02  free 01"
    "  free 02 collis. deepest m crossed  ok"
)


def row(result: SteerBenchResult) -> str:
    """One run as a line below `COLUMNS`."""
    classic, free = result.classic, result.step_free
    return (
        f"{result.name:23s} {result.bodies:6s} {result.characters:7d} {result.arrived:7.1%} "
        f"{result.seconds:7.1f} {result.limit:7.0f} {result.ideal:8.1f} {classic.composite_01:8.1f} "
        f"{classic.composite_02:8.1f} {free.composite_01:8.1f} {free.composite_02:8.1f} "
        f"{free.collisions:7.2f} {result.deepest_m:9.3f} {result.crossings:7d}  {result.problem or 'yes'}"
    )
