"""The bundled scenarios, run to the end, are what they say they are."""

from pathlib import Path

import numpy as np
import pytest

from crowd.cli.expectations import judge
from crowd.cli.run import measured_facts
from crowd.scenario import bundled_scenarios, load_scenario
from crowd.simulation import Simulation

SECONDS = {"plaza": 20.0}
"""Shorter runs of scenarios whose expectations do not need the whole."""


def run_to_end(simulation: Simulation, seconds: float) -> None:
    """Step until the time is over or everybody has arrived."""
    for _ in simulation.run(seconds):
        if simulation.is_finished:
            return


@pytest.mark.parametrize("name", sorted(bundled_scenarios()))
def test_expectations_are_met(name: str) -> None:
    scenario = load_scenario(name)
    simulation = Simulation(scenario, seed=1)
    run_to_end(simulation, SECONDS.get(name, scenario.seconds))
    measured = measured_facts(simulation, 1.0, 0.0, was_stopped=False)
    missed = [
        f"{verdict.key} = {verdict.value}, allowed {verdict.allowed}"
        for verdict in judge(scenario.expect, measured)
        if not verdict.is_met
    ]
    assert missed == []


def test_the_plaza_is_alive() -> None:
    simulation = Simulation(load_scenario("plaza"), seed=2)
    start = simulation.state.position_world.copy()
    longest = np.zeros(simulation.state.capacity)
    gestured = np.zeros(simulation.state.capacity, np.bool_)
    for _ in simulation.run(seconds=12.0):
        distance = np.linalg.norm(simulation.state.position_world - start, axis=1)
        np.maximum(longest, distance, out=longest)
        gestured |= simulation.state.play_clip >= 0
    stands = simulation.model.placed.goal_count == 0
    jogs = simulation.model.placed.preferred_speed > 2.0
    assert np.quantile(longest[stands], 0.8) < 0.3
    assert np.median(longest[~stands]) > 6.0
    assert np.median(longest[jogs]) > 15.0
    assert gestured[stands].mean() > 0.7
    assert not gestured[~stands].any()


NARROW_OR_TRICKY = (
    "crossing-trick",
    "curves",
    "doorway-two-way",
    "double-squeeze",
    "oncoming-trick",
    "overtake-obstacle",
    "simple-wall",
    "wall-squeeze",
)


@pytest.mark.parametrize("name", NARROW_OR_TRICKY)
def test_published_scenes_are_walked_to_the_end(shared_data: Path, name: str) -> None:
    scenario = load_scenario(shared_data / "steerbench" / f"{name}.xml")
    simulation = Simulation(scenario)
    run_to_end(simulation, scenario.seconds)
    measured = simulation.metrics.as_dict()
    assert measured["finished"] == 1.0
    assert measured["overlap.max_depth_m"] <= 0.05
    assert measured.get("wall.crossings", 0) == 0
