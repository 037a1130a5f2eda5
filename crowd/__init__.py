"""Crowds of whole people.

>>> import crowd
>>> scenario = crowd.load_scenario("plaza")
>>> simulation = crowd.Simulation(scenario, seed=7)
>>> for frame in simulation.run(seconds=10): ...
"""

import os
from importlib import import_module
from typing import TYPE_CHECKING, Any

# Threads that wait for work by spinning would take the core of a viewer or of a second run.
os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")

if TYPE_CHECKING:
    from crowd.compilation import warm_up
    from crowd.errors import CrowdError
    from crowd.metrics import Metrics, measure
    from crowd.recording import Recorder, Recording
    from crowd.scenario import Scenario, load_scenario
    from crowd.simulation import Frame, Simulation
    from crowd.trajectories import FollowingSimulation, load_trajectories, open_recording

__all__ = [
    "CrowdError",
    "FollowingSimulation",
    "Frame",
    "Metrics",
    "Recorder",
    "Recording",
    "Scenario",
    "Simulation",
    "load_scenario",
    "load_trajectories",
    "measure",
    "open_recording",
    "warm_up",
]

_HOME = {
    "CrowdError": "errors",
    "FollowingSimulation": "trajectories",
    "Frame": "simulation",
    "Metrics": "metrics",
    "Recorder": "recording",
    "Recording": "recording",
    "Scenario": "scenario",
    "Simulation": "simulation",
    "load_scenario": "scenario",
    "load_trajectories": "trajectories",
    "measure": "metrics",
    "open_recording": "trajectories",
    "warm_up": "compilation",
}


def __getattr__(name: str) -> Any:
    """Load a public name when it is first used, so that `import crowd` stays light."""
    if name not in _HOME:
        raise AttributeError(f"module 'crowd' has no attribute {name!r}")
    value = getattr(import_module(f"crowd.{_HOME[name]}"), name)
    globals()[name] = value
    return value
