"""Things that people can grasp are drawn whole, where they are, and alike in a run and its recording."""

import numpy as np
import pytest

import crowd
from crowd.recording import Recorder

SIZE = (320, 184)
SCENE = """
[world]
bounds = { x = [-4, 4], z = [-4, 4] }
[[objects]]
shape = "sphere"
radius = 0.3
position = [0, 1.0, 0]
colour = [0.9, 0.1, 0.1]
[[objects]]
shape = "box"
size = [0.4, 0.6, 0.2]
position = [-1.2, 1.0, 0]
rotation = [0, 30, 20]
[[objects]]
shape = "capsule"
radius = 0.1
length = 0.9
position = [1.2, 1.0, 0]
[[objects]]
shape = "mesh"
file = "pyramid.obj"
position = [0, 2.0, 0]
[[regions]]
count = 1
area = { x = [-3, -2], z = [-3, -2] }
"""
PYRAMID = (
    "v -1 0 -1\nv 1 0 -1\nv 1 0 1\nv -1 0 1\nv 0 1 0\nf 1 2 3\nf 1 3 4\nf 1 5 2\nf 2 5 3\nf 3 5 4\nf 4 5 1\n"
)


@pytest.fixture(scope="module")
def simulation(tmp_path_factory):
    """A person, far from four things that float."""
    pytest.importorskip("trimesh")
    folder = tmp_path_factory.mktemp("things")
    (folder / "pyramid.obj").write_text(PYRAMID)
    (folder / "scene.toml").write_text(SCENE)
    return crowd.Simulation(crowd.load_scenario(folder / "scene.toml"), seed=1, threads=1)


def test_shapes_are_closed_have_their_size_and_face_outwards(drawing, simulation):
    from crowd.world.objects import ShapeKind
    from crowd_viewer.things import shape_vertices, sizes

    objects = simulation.model.objects
    expected = {
        ShapeKind.SPHERE: 4 / 3 * np.pi * 0.3**3,
        ShapeKind.BOX: 0.4 * 0.6 * 0.2,
        ShapeKind.CAPSULE: 4 / 3 * np.pi * 0.1**3 + np.pi * 0.1**2 * 0.7,
        ShapeKind.MESH: 4 / 3,
    }
    for row, size in enumerate(sizes(objects)):
        kind = ShapeKind(int(objects.kind[row]))
        vertex = shape_vertices(kind, objects, int(objects.mesh[row])).astype(float).reshape(-1, 3, 7)
        point = vertex[..., :3] * size[:3] + vertex[..., 6:] * [0.0, size[3], 0.0]
        a, b, c = point[:, 0], point[:, 1], point[:, 2]
        face = np.cross(b - a, c - a)
        # The divergence theorem: triangles that close a body hold its volume.
        assert (a * face).sum() / 6.0 == pytest.approx(expected[kind], rel=0.04)
        assert (np.abs(np.linalg.norm(vertex[..., 3:6], axis=2) - 1.0) < 1e-5).all()
        is_real = np.linalg.norm(face, axis=1) > 1e-9
        assert ((face[:, None] * vertex[..., 3:6]).sum(axis=2)[is_real] > 0).all()


def test_things_are_seen_where_they_are(drawing, simulation):
    camera = drawing.Camera((0.0, 1.0, 6.0), (0.0, 1.0, 0.0))
    identity, depth = drawing.render_identities(simulation, camera=camera, size=SIZE)
    # The front of the sphere, and beside it the ground behind.
    assert depth[92, 160] == pytest.approx(5.7, abs=0.02)
    assert not identity[92, 160]
    is_sphere = (depth < 6.02) & (np.abs(np.arange(SIZE[0]) - 160) < 25)
    is_sphere[:75] = is_sphere[110:] = False  # The pyramid above, the ground below.
    radius = 0.3 * camera.pixels_at_one_metre(SIZE[1]) / 6.0
    assert is_sphere.sum() == pytest.approx(np.pi * radius**2, rel=0.1)
    red, green, _ = drawing.render(simulation, camera=camera, size=SIZE)[is_sphere].mean(axis=0)
    assert red > 3 * green


def test_carried_things_move_in_the_picture_and_in_the_recording(drawing, simulation, tmp_path):
    camera = drawing.Camera((0.0, 1.2, 6.0), (0.0, 1.2, 0.0))
    before = drawing.render(simulation, camera=camera, size=SIZE).astype(float)
    with Recorder(tmp_path / "run.h5", simulation, every=1) as recorder:
        for _ in range(3):
            frame = simulation.step()
            simulation.objects.position_world[0] += (0.0, 0.1, 0.0)
            recorder.record(frame)
    live = drawing.render(simulation, camera=camera, size=SIZE).astype(float)
    with crowd.Recording(tmp_path / "run.h5") as recording:
        replay = drawing.render(recording, camera=camera, size=SIZE).astype(float)
    assert np.abs(live - before).mean() > 0.5
    assert np.abs(live - replay).mean() < 0.1
