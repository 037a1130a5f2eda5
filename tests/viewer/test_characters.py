"""Characters of the user's are drawn in place of the engine's own bodies, and picked like everyone."""

from dataclasses import replace

import numpy as np
import pytest

import crowd
from crowd.export import Selection, export
from crowd.recording import Recorder, Recording

SIZE = (640, 360)


@pytest.fixture(scope="module")
def folk(drawing, walkers, tmp_path_factory):
    """The walkers, half of them as skinned characters."""
    folder = tmp_path_factory.mktemp("folk")
    simulation = crowd.Simulation(crowd.load_scenario("plaza"), seed=3, characters=2, threads=1)
    with Recorder(folder / "run.h5", simulation) as recorder:
        for _ in range(4):
            recorder.record(simulation.step())
    with Recording(folder / "run.h5") as recording:
        export(Selection(recording, [0]), "gltf", folder / "people")
    (file,) = (folder / "people").iterdir()
    simulation = crowd.Simulation(
        crowd.load_scenario("plaza"), seed=3, characters=40, threads=1, character_files=[file]
    )
    for _ in range(120):
        simulation.step()
    simulation.model.cast.number[::2] = -1
    return simulation


def drawn(source, camera, kind="draw", **quality):
    import crowd_viewer
    from crowd_viewer.context import headless_context
    from crowd_viewer.renderer import Renderer

    chosen = replace(crowd_viewer.FINE, **quality)
    with Renderer(headless_context(), source.scene, SIZE, chosen) as renderer:
        if kind == "identities":
            return renderer.identities(source.frame(), camera)[0]
        renderer.draw(source.frame(), camera, keeps_levels=False)
        return renderer.picture()


@pytest.mark.parametrize("parity", [0, 1])
def test_a_character_stands_where_its_person_stands(drawing, walkers, folk, parity):
    from crowd_viewer.frame import source_of

    here = walkers.state.position_world
    away = np.where(np.arange(40) % 2 == parity, (here**2).sum(axis=1), np.inf)
    chosen = int(np.argmin(away))
    yaw = float(walkers.state.yaw[chosen])
    camera = drawing.Camera.around(here[chosen] + [0.0, 0.95, 0.0], 4.0, yaw + 0.5, 0.15)
    plain = drawn(source_of(walkers), camera, "identities") == chosen + 1
    own = drawn(source_of(folk), camera, "identities") == chosen + 1
    if parity == 0:
        assert (plain == own).all() or (plain != own).mean() < 0.02
        return
    # Another built-in body stands there, in the same pose.
    assert 0.6 * plain.sum() < own.sum() < 1.6 * plain.sum()
    assert (own & plain).sum() > 0.8 * min(own.sum(), plain.sum())


def test_the_picture_shows_them(drawing, walkers, folk, close_camera):
    from crowd_viewer.frame import source_of

    plain = drawn(source_of(walkers), close_camera[1]).astype(float)
    own = drawn(source_of(folk), close_camera[1]).astype(float)
    assert np.abs(plain - own).mean() > 0.5


def test_those_too_small_or_too_many_are_drawn_with_limbs(drawing, walkers, folk):
    from crowd_viewer.frame import source_of

    far = drawing.Camera((0.0, 300.0, 300.0), (0.0, 0.0, 0.0))
    assert (drawn(source_of(walkers), far) == drawn(source_of(folk), far)).all()
    few = drawing.Camera((6.0, 4.0, 12.0), (0.0, 0.8, 0.0))
    seen = {
        count: np.unique(drawn(source_of(folk), few, "identities", mesh_count=count)) for count in (2, 2000)
    }
    assert np.setdiff1d(seen[2000], seen[2]).size <= 2
