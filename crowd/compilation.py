"""Compile all kernels before a run, so that its time is not mixed with the compiler's."""

import time
from collections.abc import Callable

import numpy as np

from crowd.controllers.grab import GrabSettings
from crowd.motion.clip import ClipKind
from crowd.scenario.object_table import ObjectTable
from crowd.scenario.schema import Area, Character, Goal, Scenario, Wall, WorldTable
from crowd.simulation import STAGES, Simulation


def warm_up(progress: Callable[[str], None] | None = None, *, is_threaded: bool = False) -> float:
    """Compile every kernel that a run uses, by stepping a tiny scene.

    Kernels are compiled on the first run on a machine and read from a cache afterwards.

    Parameters
    ----------
    progress : callable, optional
        Called with the name of the stage that is being compiled and how far this is.
    is_threaded : bool
        Compile the builds for several threads, which runs of 200 and more people use.

    Returns
    -------
    float
        Time it took, s.
    """
    begin = time.perf_counter()
    simulation = Simulation(warm_up_scenario(), bodies="people", is_threaded=is_threaded)
    gestures = simulation.model.library.of_kind(ClipKind.GESTURE)
    if gestures:
        simulation.commands.play(2, gestures[0].name)
    simulation.commands.look_at(0, character=1)
    simulation.state.saccade_offset[2] = 0.01
    # Hands need not arrive to close.
    simulation.grab.settings = GrabSettings(near=10.0, near_angle=7.0)
    simulation.grab.grasp(simulation.state, np.array([2], np.int32), 0, 0)

    def note(stage: str) -> None:
        if progress is not None:
            progress(f"{stage}, {STAGES.index(stage) + 1} of {len(STAGES)}")

    for _ in range(2):
        simulation.step(note)
    return time.perf_counter() - begin


def warm_up_scenario() -> Scenario:
    """Two people who meet at a wall and one who stands and grasps: every kernel has something to do."""
    return Scenario(
        name="warm-up",
        world=WorldTable(
            bounds=Area(x=(-5.0, 5.0), z=(-5.0, 5.0)), walls=(Wall(points=((-2.0, 0.0), (0.5, 0.0))),)
        ),
        characters=(
            Character(position=(-1.0, -2.0), facing=0.0, goals=(Goal(position=(-1.0, 2.0)),)),
            Character(position=(-1.0, 2.0), facing=180.0, goals=(Goal(position=(-1.0, -2.0)),)),
            Character(position=(3.0, 0.0)),
        ),
        objects=(ObjectTable(shape="sphere", radius=0.04, position=(3.0, 1.0, 0.4)),),
    )
