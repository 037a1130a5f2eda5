"""Fixtures of the viewer's tests: small crowds, and a skip where nothing can be drawn."""

import os

import numpy as np
import pytest

import crowd


@pytest.fixture(scope="session")
def drawing():
    """The viewer; tests that draw are skipped where there is no OpenGL, unless REQUIRE_GL is set."""
    pytest.importorskip("moderngl")
    import crowd_viewer
    from crowd_viewer.context import headless_context

    try:
        headless_context()
    except crowd_viewer.ViewerError as error:
        if os.environ.get("REQUIRE_GL"):
            raise
        pytest.skip(str(error))
    return crowd_viewer


@pytest.fixture(scope="session")
def walkers():
    """Forty people of the plaza after two seconds."""
    simulation = crowd.Simulation(crowd.load_scenario("plaza"), seed=3, characters=40, threads=1)
    for _ in range(120):
        simulation.step()
    return simulation


@pytest.fixture(scope="session")
def close_camera(drawing, walkers):
    """A view of the person nearest to the middle, from ahead."""
    state = walkers.state
    away = np.where(state.is_active, (state.position_world**2).sum(axis=1), np.inf)
    chosen = int(np.argmin(away))
    place, yaw = state.position_world[chosen], float(state.yaw[chosen])
    camera = drawing.Camera.around(place + [0.0, 0.95, 0.0], 4.0, yaw + 0.5, 0.15)
    return chosen, camera
