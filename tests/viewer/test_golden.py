"""Pictures stay as they were: compared with stored ones by the largest difference of small blocks."""

import os
from pathlib import Path

import numpy as np
import pytest

FOLDER = Path(__file__).parent / "pictures"
SIZE = (640, 360)
VIEWS = {
    "near": ((2.0, 1.7, -7.2), (0.4, 0.9, -14.0)),
    "middle": ((7.0, 4.0, -2.5), (0.0, 0.5, -14.0)),
    "far": ((20.0, 18.0, 45.0), (0.0, 0.0, 0.0)),
}
LARGEST_BLOCK, LARGEST_MEAN = 6.0, 1.0


def differences(expected, actual):
    """Largest difference of the means of 8 by 8 pixels, and the mean difference."""
    away = actual.astype(float) - expected
    blocks = away.reshape(SIZE[1] // 8, 8, SIZE[0] // 8, 8, 3).mean(axis=(1, 3))
    return float(np.abs(blocks).max()), float(away.mean())


@pytest.fixture(scope="module")
def standing(drawing):
    """A frame that no motion and no steering can change: twenty-five people in set poses."""
    import crowd
    from crowd_viewer.frame import CrowdFrame, LiveSource, standing_joints

    simulation = crowd.Simulation(crowd.load_scenario("plaza"), seed=1, characters=25, threads=1)
    source = LiveSource(simulation)
    row = np.arange(25)
    position = np.zeros((25, 3))
    position[:, 0], position[:, 2] = 1.6 * (row % 5 - 2) + 0.3 * (row // 5), 1.9 * (row // 5 - 2) - 14.0
    joints = standing_joints(source.scene)
    frame = CrowdFrame(
        0.0,
        np.ones(25, bool),
        row.astype(np.int64),
        position,
        0.7 * row,
        joints.position_model,
        joints.rotation_model,
    )
    return source.scene, frame


@pytest.mark.parametrize("name", VIEWS)
def test_pictures_are_the_stored_ones(drawing, standing, name):
    image = pytest.importorskip("PIL.Image")
    from crowd_viewer.context import headless_context
    from crowd_viewer.renderer import Renderer

    scene, frame = standing
    with Renderer(headless_context(), scene, SIZE) as renderer:
        renderer.draw(frame, drawing.Camera(*VIEWS[name]), keeps_levels=False)
        picture = renderer.picture()
    path = FOLDER / f"{name}.png"
    if os.environ.get("UPDATE_PICTURES"):
        FOLDER.mkdir(exist_ok=True)
        drawing.write_picture(path, picture)
    block, mean = differences(np.asarray(image.open(path)), picture)
    if block >= LARGEST_BLOCK or abs(mean) >= LARGEST_MEAN:
        drawing.write_picture(path.with_name(f"{name}.actual.png"), picture)
    assert block < LARGEST_BLOCK
    assert abs(mean) < LARGEST_MEAN
