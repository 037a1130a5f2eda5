"""Pictures without a screen: they show who is there, where they are, in every way of asking."""

import math

import numpy as np
import pytest

import crowd
from crowd.recording import Recorder, Recording

SIZE = (320, 184)


def projected(camera, points, size):
    """Pixels of points."""
    matrix = camera.projection(size[0] / size[1], 3000.0) @ camera.view(np.zeros(3))
    clip = np.c_[points, np.ones(len(points))] @ matrix.T
    shares = clip[:, :2] / clip[:, 3:]
    return np.c_[(shares[:, 0] + 1.0) * 0.5 * size[0], (1.0 - shares[:, 1]) * 0.5 * size[1]]


def test_a_picture_has_the_size_asked_for_and_is_not_empty(drawing, walkers):
    picture = drawing.render(walkers, size=SIZE)
    assert picture.shape == (184, 320, 3)
    assert picture.dtype == np.uint8
    assert picture.std() > 15


def test_the_same_frame_gives_the_same_picture(drawing, walkers):
    first = drawing.render(walkers, size=SIZE)
    assert (first == drawing.render(walkers, size=SIZE)).all()


def test_the_chest_of_a_person_shows_that_person_at_its_distance(drawing, walkers, close_camera):
    chosen, camera = close_camera
    identity, depth = drawing.render_identities(walkers, camera=camera, size=SIZE)
    chest = walkers.joint_positions_world()[chosen, walkers.model.skeleton.joint("spine_3")]
    x, y = projected(camera, chest[None], SIZE)[0].astype(int)
    assert identity[y, x] == chosen + 1
    ahead = camera.axes()[2] @ (chest - np.array(camera.eye))
    assert depth[y, x] == pytest.approx(ahead, abs=0.2)
    assert math.isinf(depth[0, 0])


def test_someone_covers_about_as_many_pixels_as_a_person_does(drawing, walkers, close_camera):
    chosen, camera = close_camera
    identity, _ = drawing.render_identities(walkers, camera=camera, size=SIZE)
    tall = np.flatnonzero((identity == chosen + 1).any(axis=1))
    joints = projected(camera, walkers.joint_positions_world()[chosen], SIZE)
    # From the sole to the crown is more than from the lowest joint to the highest, but not much.
    span = joints[:, 1].max() - joints[:, 1].min()
    assert span < tall.max() - tall.min() + 1 < 1.35 * span


def test_two_hundred_people_differ_in_their_looks(drawing):
    from crowd.body import built_in_builds
    from crowd.body.looks import draw_builds, draw_looks

    recipes = [build.recipe for build in built_in_builds()]
    identity, stature = np.arange(200), np.full(200, 1.70)
    build = draw_builds(identity, stature, recipes)
    looks = draw_looks(identity, build, recipes)
    assert len(np.unique(looks[:, 1, :3].round(3), axis=0)) > 190
    assert len(np.unique(build)) == len(recipes)
    assert np.bincount(build).max() < 40
    assert (looks == draw_looks(identity, build, recipes)).all()
    assert np.isfinite(looks).all()


def test_tall_people_are_more_often_men(drawing):
    from crowd.body import built_in_builds
    from crowd.body.looks import draw_builds

    recipes = [build.recipe for build in built_in_builds()]
    is_woman = np.array([recipe.is_woman for recipe in recipes])
    shares = [
        is_woman[draw_builds(np.arange(1000), np.full(1000, h), recipes)].mean() for h in (1.55, 1.69, 1.85)
    ]
    assert shares[0] > 0.95
    assert shares[1] == pytest.approx(0.5, abs=0.06)
    assert shares[2] < 0.05


def test_a_recording_looks_like_the_run(drawing, tmp_path):
    simulation = crowd.Simulation(crowd.load_scenario("plaza"), seed=3, characters=40, threads=1)
    with Recorder(tmp_path / "run.h5", simulation, every=2) as recorder:
        for _ in range(60):
            recorder.record(simulation.step())
    camera = drawing.Camera((6.0, 4.0, 12.0), (0.0, 0.8, 0.0))
    live = drawing.render(simulation, camera=camera, size=SIZE).astype(float)
    with Recording(tmp_path / "run.h5") as recording:
        replay = drawing.render(recording, camera=camera, size=SIZE).astype(float)
        earlier = drawing.render(recording, time=0.5, camera=camera, size=SIZE).astype(float)
    assert np.abs(live - replay).mean() < 0.2
    assert np.abs(live - earlier).mean() > 1.0


def test_a_camera_is_read_back_and_a_wrong_one_is_refused(drawing):
    camera = drawing.Camera((1.0, 2.0, 3.0), (0.0, 1.0, 0.0), 0.7)
    assert drawing.Camera.from_json(camera.to_json()) == camera
    for text in (
        "",
        "[]",
        "{}",
        '{"eye": [1, 2, 3], "target": [1, 2, 3]}',
        '{"eye": 3, "target": [1, 2, 3]}',
    ):
        with pytest.raises(drawing.ViewerError, match="is not a camera"):
            drawing.Camera.from_json(text)


def test_a_prism_is_closed_and_faces_outwards(drawing):
    from shapely import box

    from crowd_viewer.solids import prism

    triangles = prism(box(0.0, 0.0, 2.0, 1.0), 1.5).reshape(-1, 3, 7).astype(float)
    a, b, c = (triangles[:, k, :3] for k in range(3))
    normal = np.cross(b - a, c - a)
    assert (np.abs(np.linalg.norm(triangles[:, :, 3:6], axis=2) - 1.0) < 1e-5).all()
    assert ((normal * triangles[:, 0, 3:6]).sum(axis=1) > 0).all()
    # The divergence theorem: triangles that close a body hold its volume, less the slanted rim.
    assert (a * normal).sum() / 6.0 == pytest.approx(3.0, rel=0.02)


def test_an_empty_recording_is_refused_and_one_cut_short_is_shown(drawing, tmp_path):
    simulation = crowd.Simulation(crowd.load_scenario("plaza"), seed=3, characters=20, threads=1)
    with Recorder(tmp_path / "empty.h5", simulation):
        pass
    with (
        Recording(tmp_path / "empty.h5") as recording,
        pytest.raises(drawing.ViewerError, match="the recording is empty"),
    ):
        drawing.render(recording, size=SIZE)
    recorder = Recorder(tmp_path / "cut.h5", simulation, every=1)
    for _ in range(70):
        recorder.record(simulation.step())
    # Never closed: the file ends with the last whole block.
    with Recording(tmp_path / "cut.h5") as recording:
        assert 0 < recording.frame_count <= 70
        assert drawing.render(recording, size=SIZE).std() > 15
    recorder.close()
