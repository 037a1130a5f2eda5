"""Objects of a scenario: read and checked, saved with a run, written to and read from recordings."""

from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from crowd.errors import RecordingError, ScenarioError, SettingsError
from crowd.motion.rotation import rotate
from crowd.recording import Recorder, Recording
from crowd.scenario import load_scenario
from crowd.scenario.objects import place_objects
from crowd.simulation import Simulation
from crowd.world.mesh import Mesh, load_mesh
from crowd.world.objects import Objects, ShapeKind

SCENE = """\
[world]
bounds = { x = [-5, 5], z = [-5, 5] }

[[characters]]
position = [0, 0]

[[objects]]
name = "ball"
shape = "sphere"
radius = 0.04
position = [0.3, 0.9, 0.4]

[[objects]]
name = "carton"
shape = "box"
size = [0.3, 0.2, 0.1]
position = [1, 0.8, 1]
resting = true
rotation = [0, 30, 90]

[[objects]]
name = "bottle"
shape = "capsule"
radius = 0.03
length = 0.24
position = [-1, 1.0, 1]
resting = true
repeat = { count = [3, 1, 2], spacing = [0.2, 0, 0.3] }
"""

TETRAHEDRON = "v 0 0 0\nv 10 0 0\nv 0 10 0\nv 0 0 10\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
MESH_TABLE = """
[[objects]]
name = "stone"
shape = "mesh"
file = "stone.obj"
scale = 0.01
position = [2, 0, 2]
resting = true
"""


def scene(folder: Path, text: str = SCENE) -> Any:
    path = folder / "scene.toml"
    path.write_text(text, encoding="utf-8")
    return load_scenario(path)


def test_objects_are_placed_by_centre_or_on_a_surface(tmp_path: Path) -> None:
    objects = place_objects(scene(tmp_path))
    assert objects.name[:3] == ("ball", "carton", "bottle[0]")
    assert objects.count == 8
    assert objects.kind[:3].tolist() == [ShapeKind.SPHERE, ShapeKind.BOX, ShapeKind.CAPSULE]
    place = objects.start_position_world
    assert place[objects.index("ball")].tolist() == [0.3, 0.9, 0.4]
    assert place[objects.index("carton"), 1] == pytest.approx(0.8 + 0.15), "the box stands on its side"
    assert place[objects.index("bottle[0]"), 1] == pytest.approx(1.12)
    assert np.allclose(place[objects.index("bottle[5]")], [-0.6, 1.12, 1.3])


def test_a_mesh_is_centred_and_scaled(tmp_path: Path) -> None:
    pytest.importorskip("trimesh")
    (tmp_path / "stone.obj").write_text(TETRAHEDRON)
    objects = place_objects(scene(tmp_path, SCENE + MESH_TABLE))
    row = objects.index("stone")
    assert objects.kind[row] == ShapeKind.MESH
    mesh = objects.meshes[objects.mesh[row]]
    assert mesh.triangle.shape == (4, 3)
    assert np.allclose(objects.half_size[row], 0.05)
    assert np.allclose(mesh.vertex.min(axis=0), -0.05)
    assert objects.start_position_world[row, 1] == pytest.approx(0.05)


def test_an_unknown_object_names_the_nearest(tmp_path: Path) -> None:
    objects = place_objects(scene(tmp_path))
    with pytest.raises(SettingsError, match=r"no object has this name; got 'bal'; allowed \"ball\""):
        objects.index("bal")
    with pytest.raises(SettingsError, match="no objects"):
        Objects.none().index("ball")


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        (
            'shape = "sphere"',
            'shape = "ball"',
            "scene.toml: line 9: objects[0].shape: is not one of the choices; got 'ball'; "
            "allowed 'sphere', 'box', 'capsule' or 'mesh'",
        ),
        (
            "radius = 0.04\n",
            "",
            "scene.toml: line 7: objects[0].radius: is missing; a sphere needs radius",
        ),
        (
            "radius = 0.04",
            "radius = 0.04\nlength = 1",
            "scene.toml: line 11: objects[0].length: means nothing for a sphere; allowed radius",
        ),
        (
            "radius = 0.04",
            "radius = nan",
            "scene.toml: line 10: objects[0].radius: must be finite; got nan; allowed a number",
        ),
        (
            "length = 0.24",
            "length = 0.05",
            "scene.toml: line 25: objects[2].length: must be at least twice the radius; got 0.05; "
            "allowed >= 0.06 m",
        ),
        (
            "position = [0.3, 0.9, 0.4]",
            "position = [0.3, 0.02, 0.4]",
            "scene.toml: line 11: objects[0].position: ball reaches below the ground; got '-0.02 m'; "
            "allowed a greater height, or resting = true",
        ),
        (
            "position = [0.3, 0.9, 0.4]",
            "position = [9, 0.9, 0.4]",
            "scene.toml: line 11: objects[0].position: ball is outside the bounds; got [9.0, 0.9, 0.4]; "
            "allowed x -5 to 5, z -5 to 5",
        ),
        (
            'name = "carton"',
            'name = "ball"',
            "scene.toml: line 14: objects[1].name: is there twice; got 'ball'; allowed a name of its own",
        ),
        (
            "count = [3, 1, 2]",
            "count = [300, 100, 2]",
            "scene.toml: line 28: objects[2].repeat.count: has too many copies; got 60000; "
            "allowed at most 10000",
        ),
        (
            'shape = "sphere"\nradius = 0.04',
            'shape = "mesh"\nfile = "gone.obj"',
            "objects[0].file: ",
        ),
    ],
)
def test_a_wrong_object_gets_one_line(tmp_path: Path, old: str, new: str, expected: str) -> None:
    assert old in SCENE
    with pytest.raises(ScenarioError) as caught:
        scene(tmp_path, SCENE.replace(old, new))
    lines = str(caught.value).splitlines()
    assert len(lines) == 1, lines
    assert lines[0] == expected or (expected.endswith("file: ") and "gone.obj: no such file" in lines[0])


@pytest.mark.parametrize(
    ("name", "content", "expected"),
    [
        ("a.txt", "v 0 0 0", "is not a mesh file; got '.txt'"),
        ("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\n", "has a wrong number of triangles; got 0"),
        ("a.obj", "v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "not finite"),
        ("a.glb", "glTF rubbish", "cannot be read as a mesh"),
        ("a.stl", "", "mesh"),
    ],
)
def test_a_file_that_is_no_mesh_is_refused(tmp_path: Path, name: str, content: str, expected: str) -> None:
    pytest.importorskip("trimesh")
    path = tmp_path / name
    path.write_text(content)
    with pytest.raises(ScenarioError, match=expected):
        load_mesh(path)


def test_triangles_without_area_and_unused_vertices_are_dropped() -> None:
    mesh = Mesh.of([[0, 0, 0], [1, 0, 0], [0, 1, 0], [9, 9, 9]], [[0, 1, 2], [0, 1, 1]])
    assert mesh.vertex.shape == (3, 3)
    assert mesh.triangle.tolist() == [[0, 1, 2]]


def test_a_recording_holds_shapes_once_and_places_per_frame(tmp_path: Path) -> None:
    pytest.importorskip("trimesh")
    (tmp_path / "stone.obj").write_text(TETRAHEDRON)
    simulation = Simulation(scene(tmp_path, SCENE + MESH_TABLE), threads=1)
    places = []
    with Recorder(tmp_path / "run.h5", simulation, every=1) as recorder:
        for number in range(5):
            simulation.objects.position_world[:, 0] += 0.1
            simulation.objects.holder[0] = -(number % 2)
            recorder.record(simulation.step())
            places.append(simulation.objects.position_world.copy())
    with Recording(tmp_path / "run.h5") as recording:
        assert recording.objects.name == simulation.model.objects.name
        assert np.array_equal(recording.objects.half_size, simulation.model.objects.half_size)
        assert np.array_equal(recording.objects.meshes[0].vertex, simulation.model.objects.meshes[0].vertex)
        assert np.array_equal(recording.read_objects("position_world"), places)
        assert recording.read_objects("holder")[:, 0].tolist() == [0, -1, 0, -1, 0]
        with pytest.raises(RecordingError, match="no such quantity"):
            recording.read_objects("speed")


def test_a_recording_without_objects_opens(tmp_path: Path) -> None:
    simulation = Simulation(load_scenario("corridor"), characters=2, threads=1)
    with Recorder(tmp_path / "run.h5", simulation, every=1) as recorder:
        recorder.record(simulation.step())
    with h5py.File(tmp_path / "run.h5") as file:
        assert "objects" not in file
    with Recording(tmp_path / "run.h5") as recording:
        assert recording.objects.count == 0
        with pytest.raises(RecordingError, match="holds no objects"):
            recording.read_objects("position_world")


def test_a_checkpoint_holds_the_objects(tmp_path: Path) -> None:
    scenario = scene(tmp_path)
    simulation = Simulation(scenario, threads=1)
    simulation.objects.position_world[0] = (1, 2, 3)
    simulation.objects.holder[1] = 0
    simulation.save(tmp_path / "stop.npz")
    other = Simulation(scenario, threads=1)
    other.restore(tmp_path / "stop.npz")
    assert other.objects.position_world[0].tolist() == [1, 2, 3]
    assert other.objects.holder[1] == 0


@pytest.mark.parametrize("name", ["ball", "carton", "bottle[0]", "stone"])
def test_bounds_enclose_the_turned_surface_and_touch_it(tmp_path: Path, name: str) -> None:
    (tmp_path / "stone.obj").write_text(TETRAHEDRON, encoding="utf-8")
    (tmp_path / "room.toml").write_text(SCENE + MESH_TABLE, encoding="utf-8")
    objects = Simulation(load_scenario(tmp_path / "room.toml"), threads=1).model.objects
    row = objects.index(name)
    half = objects.half_size[row]
    up, around = np.meshgrid(np.linspace(-np.pi / 2.0, np.pi / 2.0, 101), np.linspace(0.0, 2.0 * np.pi, 200))
    sphere = np.stack([np.cos(up) * np.cos(around), np.sin(up), np.cos(up) * np.sin(around)], axis=-1)
    sphere = sphere.reshape(-1, 3)
    surface = {
        "ball": half[0] * sphere,
        "carton": half * np.array(np.meshgrid(*[(-1.0, 1.0)] * 3)).reshape(3, -1).T,
        "bottle[0]": half[0] * sphere + np.sign(sphere) * (0.0, half[1] - half[0], 0.0),
        "stone": objects.meshes[objects.mesh[row]].vertex,
    }[name]
    for rotation in np.random.default_rng(4).normal(size=(20, 4)):
        rotation /= np.linalg.norm(rotation)
        turned = rotate(rotation, surface)
        least, greatest = objects.bounds(row, rotation)
        np.testing.assert_allclose(least, turned.min(axis=0), atol=1e-4)
        np.testing.assert_allclose(greatest, turned.max(axis=0), atol=1e-4)
        assert objects.lowest_point(row, rotation) == least[1]
