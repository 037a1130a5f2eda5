"""What is exported and read again is the same motion."""

import json
import math
import sqlite3
import subprocess
import sys
import tracemalloc
from pathlib import Path

import numpy as np
import pytest

import crowd
from crowd.body import built_in_builds
from crowd.body.looks import draw_builds, draw_looks
from crowd.characters import load_character
from crowd.errors import RecordingError, SettingsError
from crowd.export import FORMATS, Selection, export
from crowd.export import selection as selections
from crowd.export.bvh import euler_zyx
from crowd.export.coco import EDGES, KEYPOINTS, PictureCamera
from crowd.export.formats import ExportSettings
from crowd.motion.body import build_skeleton
from crowd.motion.clip import ClipKind
from crowd.motion.formats import read_motions
from crowd.motion.formats.euler import compose
from crowd.motion.importing.importer import import_clip
from crowd.motion.importing.labels import Correction
from crowd.motion.rotation import about, conjugate, from_vector, multiply, rotate, to_vector
from crowd.recording import Recorder, Recording

pytestmark = pytest.mark.xdist_group("export")
MOST_WAY, MOST_TURN = 1e-4, math.radians(0.01)
"""A round trip moves joints by less, m, and turns them by less, rad."""
ROBOT = Path(__file__).parents[2].parent / "shared" / "data" / "gltf" / "robot" / "robot.glb"


def record(path, scenario, seconds, **how):
    simulation = crowd.Simulation(crowd.load_scenario(scenario), seed=2, **how)
    with Recorder(path, simulation) as recorder:
        for frame in simulation.run(seconds=seconds):
            recorder.record(frame)
    return path


@pytest.fixture(scope="module")
def plaza(tmp_path_factory):
    path = record(tmp_path_factory.mktemp("export") / "plaza.h5", "plaza", 2.0, characters=6)
    with Recording(path) as recording:
        yield recording


@pytest.fixture(scope="module")
def corridor(tmp_path_factory):
    path = record(tmp_path_factory.mktemp("export") / "corridor.h5", "corridor", 20.0)
    with Recording(path) as recording:
        yield recording


def truth(recording, slot, first, last):
    """World rotations (F, J, 4) and positions (F, J, 3) of one person."""
    slots = np.array([slot])
    rotation, position = recording.posed(recording.poses(slice(first, last + 1), slots), slots)
    return rotation[:, 0], position[:, 0]


def turn_between(first, second):
    return np.linalg.norm(to_vector(multiply(conjugate(first), second)), axis=-1).max()


@pytest.mark.parametrize("format_name", ["bvh", "gltf"])
def test_a_person_comes_back_the_same(plaza, tmp_path, format_name):
    selection = Selection(plaza, [1, 4])
    export(selection, format_name, tmp_path / "people")
    files = sorted((tmp_path / "people").iterdir())
    assert [file.stem for file in files] == [visit.name for visit in selection.visits]
    for visit, file in zip(selection.visits, files, strict=True):
        (motion,) = read_motions(file, frame_rate=1.0 / selection.frame_seconds)
        assert motion.frame_count == visit.frame_count
        assert motion.frame_rate == pytest.approx(1.0 / selection.frame_seconds, rel=1e-4)
        names = motion.skeleton.joint_names
        place = [names.index(name) for name in plaza.skeleton.joint_names]
        rotation, position = motion.world()
        expected_rotation, expected_position = truth(plaza, visit.slot, visit.first, visit.last)
        assert np.abs(position[:, place] - expected_position).max() < MOST_WAY
        assert turn_between(rotation[:, place], expected_rotation) < MOST_TURN


@pytest.mark.parametrize("format_name", ["bvh", "gltf"])
def test_an_exported_person_is_imported_the_same(plaza, tmp_path, format_name):
    skeleton = build_skeleton()
    selection = Selection(plaza)
    export(selection, format_name, tmp_path / "people")
    files = sorted((tmp_path / "people").iterdir())
    for visit, file in zip(selection.visits, files, strict=True):
        (motion,) = read_motions(file)
        entry = import_clip(motion, skeleton, correction=Correction(kind=ClipKind.OTHER))
        clip, slots = entry.clip, np.array([visit.slot])
        poses = plaza.poses(slice(visit.first, visit.last + 1), slots)
        assert turn_between(clip.rotation_local[:, 1:].astype(float), poses.rotation[:, 0, 1:]) < MOST_TURN
        # The clip starts at the origin, ahead; the person is put there too.
        heading = about(1, clip.root_yaw)
        rotation = multiply(heading, clip.rotation_local[:, 0].astype(float))
        pelvis = clip.root_position + rotate(heading, clip.pelvis_position_root.astype(float))
        back = multiply(rotation[0], conjugate(poses.rotation[0, 0, 0]))
        assert turn_between(rotation, multiply(back, poses.rotation[:, 0, 0])) < MOST_TURN
        way = entry.scale * rotate(back, poses.pelvis_world[:, 0] - poses.pelvis_world[:1, 0])
        assert np.abs(pelvis - pelvis[0] - way).max() < MOST_WAY
        assert pelvis[0, 1] == pytest.approx(entry.scale * poses.pelvis_world[0, 0, 1], abs=MOST_WAY)


def test_a_crowd_in_usd_has_the_same_joints(plaza, tmp_path):
    pytest.importorskip("pxr")
    from pxr import Usd, UsdGeom, UsdSkel

    path = tmp_path / "crowd.usdc"
    selection = Selection(plaza)
    export(selection, "usd", path)
    stage = Usd.Stage.Open(str(path))
    assert UsdGeom.GetStageMetersPerUnit(stage) == 1.0
    assert UsdGeom.GetStageUpAxis(stage) == "Y"
    cache = UsdSkel.Cache()
    for visit in selection.visits:
        prim = stage.GetPrimAtPath(f"/Crowd/{visit.name}")
        assert prim.IsInstance()
        root = UsdSkel.Root(prim)
        cache.Populate(root, Usd.TraverseInstanceProxies())
        skeleton = UsdSkel.Skeleton(stage.GetPrimAtPath(f"/Crowd/{visit.name}/Skeleton"))
        query = cache.GetSkelQuery(skeleton)
        rotation, position = truth(plaza, visit.slot, visit.first, visit.last)
        for frame in (0, visit.frame_count // 2, visit.frame_count - 1):
            joints = np.array(query.ComputeJointSkelTransforms(frame))
            world = np.array(UsdGeom.Xformable(prim).ComputeLocalToWorldTransform(frame))
            found = (joints @ world)[:, 3, :3]
            assert np.abs(found - position[frame]).max() < MOST_WAY
            quaternions = np.array([_rotation_of(matrix) for matrix in joints])
            assert turn_between(quaternions, rotation[frame]) < MOST_TURN


def _rotation_of(matrix):
    from scipy.spatial.transform import Rotation

    return Rotation.from_matrix(matrix[:3, :3].T).as_quat()[[3, 0, 1, 2]]


def test_pedpy_analyses_an_exported_corridor(corridor, tmp_path):
    pedpy = pytest.importorskip("pedpy")
    path = tmp_path / "corridor.sqlite"
    selection = Selection(corridor)
    export(selection, "jupedsim", path)
    trajectory = pedpy.load_trajectory_from_jupedsim_sqlite(trajectory_file=path)
    area = pedpy.load_walkable_area_from_jupedsim_sqlite(trajectory_file=path)
    assert trajectory.frame_rate == pytest.approx(1.0 / selection.frame_seconds)
    assert trajectory.data.id.nunique() == len(selection.visits)
    assert pedpy.is_trajectory_valid(traj_data=trajectory, walkable_area=area)
    low_x, low_y, high_x, high_y = area.bounds
    middle = 0.5 * (low_x + high_x), 0.5 * (low_y + high_y)
    half = 0.2 * (high_x - low_x), 0.5 * (high_y - low_y) - 0.01
    inner = pedpy.MeasurementArea(
        [(middle[0] + a * half[0], middle[1] + b * half[1]) for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    )
    density = pedpy.compute_classic_density(traj_data=trajectory, measurement_area=inner)
    speed = pedpy.compute_individual_speed(
        traj_data=trajectory, frame_step=5, speed_calculation=pedpy.SpeedCalculation.BORDER_SINGLE_SIDED
    )
    mean = pedpy.compute_mean_speed_per_frame(
        traj_data=trajectory, individual_speed=speed, measurement_area=inner
    )
    both = density.join(mean.add_suffix("_mean"))
    assert both.density.max() > 0.05
    walking = both[both.density > 0].speed_mean
    assert 0.5 < walking.mean() < 2.0
    # The fundamental diagram: speed, and flow through a metre, against density by Voronoi cells.
    cells = pedpy.compute_individual_voronoi_polygons(
        traj_data=trajectory,
        walkable_area=area,
        cut_off=pedpy.Cutoff(radius=1.0, quad_segments=3),
        use_blind_points=False,
    )
    cells = cells.merge(speed, on=["id", "frame"]).dropna()
    assert len(cells) > 500
    flow = cells.density * cells.speed
    assert 0.1 < cells.density.median() < 6.0
    assert flow.max() < 8.0
    crowded = cells.density > cells.density.median()
    assert cells.speed[crowded].mean() <= cells.speed[~crowded].mean() + 0.1


def test_jupedsim_files_keep_left_and_right(plaza, tmp_path):
    path = tmp_path / "plaza.sqlite"
    selection = Selection(plaza, [0])
    export(selection, "jupedsim", path)
    connection = sqlite3.connect(path)
    frame, x, y, ax, ay = connection.execute(
        "SELECT frame, pos_x, pos_y, ori_x, ori_y FROM trajectory_data ORDER BY frame LIMIT 1"
    ).fetchone()
    position = plaza.read("position_world", selection.first)[0]
    yaw = plaza.read("yaw", selection.first)[0]
    assert (frame, x, y) == (0, pytest.approx(position[2]), pytest.approx(position[0]))
    assert (ax, ay) == (pytest.approx(math.cos(yaw)), pytest.approx(math.sin(yaw)))
    frames = connection.execute("SELECT COUNT(*) FROM frame_data").fetchone()[0]
    assert frames == selection.frame_count
    facts = dict(connection.execute("SELECT key, value FROM metadata").fetchall())
    assert facts["version"] == "2"
    connection.close()


def test_csv_and_arrays_hold_what_was_recorded(plaza, tmp_path):
    selection = Selection(plaza, ["2", 3], start=0.5, stop=1.5)
    export(selection, "csv", tmp_path / "p.csv")
    rows = np.loadtxt(tmp_path / "p.csv", delimiter=",", skiprows=1)
    assert set(rows[:, 1]) == {0.0, 1.0}
    assert rows[:, 0].min() >= 0.5 - 1e-6
    assert rows[:, 0].max() <= 1.5 + 1e-6
    first = plaza.read("position_world", selection.first)[2]
    assert rows[0, 2:4] == pytest.approx([first[2], first[0]], abs=1e-5)
    export(selection, "npz", tmp_path / "p.npz")
    with np.load(tmp_path / "p.npz") as arrays:
        assert arrays["joint_position_world"].shape == (selection.frame_count, 2, 56, 3)
        expected = plaza.joint_positions_world(selection.first)[[2, 3]]
        assert np.abs(arrays["joint_position_world"][0] - expected).max() < 1e-5
        assert arrays["joint_names"][0] == "pelvis"
        assert arrays["rotation_local"].shape[-1] == 4
        assert arrays["time"][0] >= 0.5 - 1e-9
        assert arrays["is_active"].all()


def test_keypoints_lie_where_the_camera_sees_them(plaza, tmp_path):
    selection = Selection(plaza, [0])
    position = plaza.joint_positions_world(selection.first)[0]
    head = position[plaza.skeleton.joint("head")]
    camera = PictureCamera(tuple(head + (0.0, 0.0, -8.0)), tuple(head), 40.0, 800, 600)
    export(selection, "coco", tmp_path / "k.json", ExportSettings(camera=camera))
    content = json.loads((tmp_path / "k.json").read_text())
    assert len(content["images"]) == selection.frame_count
    assert content["categories"][0]["keypoints"] == list(KEYPOINTS)
    assert max(max(edge) for edge in EDGES) == len(KEYPOINTS)
    first = content["annotations"][0]
    assert first["image_id"] == 1
    assert first["num_keypoints"] == 17
    points = np.array(first["keypoints"]).reshape(17, 3)
    assert (points[:, 2] == 2).all()
    # The head is in the middle; a metre 8 m away is as many pixels as the pinhole says.
    assert points[0, :2] == pytest.approx([400.0, 300.0], abs=30.0)
    height = 300.0 / math.tan(math.radians(20.0)) / 8.0
    ankle = position[plaza.skeleton.joint("left_foot")]
    assert points[15, 1] == pytest.approx(300.0 + height * (head[1] - ankle[1]), rel=0.06)


def test_people_who_come_and_go_are_visits(corridor):
    selection = Selection(corridor)
    visits = selection.visits
    assert len({visit.name for visit in visits}) == len(visits)
    active = corridor.read("is_active")
    assert sum(visit.frame_count for visit in visits) == int(active.sum())
    for visit in visits:
        assert active[visit.first : visit.last + 1, visit.slot].all()


def test_visits_do_not_depend_on_blocks(corridor, monkeypatch):
    whole = Selection(corridor).visits
    monkeypatch.setattr(selections, "BLOCK_BYTES", 1)
    assert Selection(corridor).visits == whole


def test_blocks_do_not_change_a_file(plaza, tmp_path, monkeypatch):
    export(Selection(plaza, [0]), "bvh", tmp_path / "one")
    export(Selection(plaza, [0]), "gltf", tmp_path / "one_gltf")
    monkeypatch.setattr(selections, "BLOCK_BYTES", 1)
    export(Selection(plaza, [0]), "bvh", tmp_path / "many")
    export(Selection(plaza, [0]), "gltf", tmp_path / "many_gltf")
    for ending, folder in (("bvh", ""), ("glb", "_gltf")):
        names = [f"one{folder}/person_0000.{ending}", f"many{folder}/person_0000.{ending}"]
        one, many = ((tmp_path / name).read_bytes() for name in names)
        assert one == many


@pytest.mark.parametrize("format_name", ["csv", "npz", "bvh", "gltf", "coco", "jupedsim"])
def test_memory_does_not_grow_with_length(corridor, tmp_path, monkeypatch, format_name):
    monkeypatch.setattr(selections, "BLOCK_BYTES", 1 << 20)

    def peak(stop):
        selection = Selection(corridor, list(range(8)), stop=stop)
        assert selection.visits
        tracemalloc.start()
        export(selection, format_name, tmp_path / f"{format_name}_{stop}")
        result = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return result

    peak(5.0)
    assert peak(20.0) < 1.35 * peak(5.0) + 300_000


def test_people_are_exported_with_the_bodies_that_are_drawn(plaza, tmp_path):
    recipes = [build.recipe for build in built_in_builds()]
    build = draw_builds(np.arange(6), plaza.stature, recipes)
    look = draw_looks(np.arange(6), build, recipes)
    export(Selection(plaza), "gltf", tmp_path / "people")
    for slot in range(6):
        person = load_character(tmp_path / "people" / f"person_{slot:04d}.glb")
        skin = built_in_builds()[build[slot]].skins[0]
        assert person.vertex_count == len(skin.position)
        # The bind pose is the person's own: as tall as it is, and on the ground.
        height = np.concatenate([part.position[:, 1] for part in person.parts])
        assert height.max() == pytest.approx(plaza.stature[slot], rel=0.04)
        assert abs(height.min()) < 0.01
        for part, material in zip(person.parts, np.unique(skin.material), strict=True):
            assert part.colour[:3] == pytest.approx(look[slot, material, :3], abs=1e-5)


@pytest.mark.skipif(not ROBOT.is_file(), reason="needs the characters of ../shared/data")
def test_a_character_of_ones_own_is_exported_with_its_mesh(plaza, tmp_path):
    robot = load_character(ROBOT)
    export(Selection(plaza, [0]), "gltf", tmp_path / "robots", ExportSettings((robot,)))
    (file,) = (tmp_path / "robots").iterdir()
    again = load_character(file)
    assert again.vertex_count == robot.vertex_count
    assert again.joint_names == robot.joint_names
    (motion,) = read_motions(file, frame_rate=30.0)
    assert motion.frame_count == Selection(plaza, [0]).visits[0].frame_count
    _, position = motion.world()
    ours = plaza.joint_positions_world(0)[0]
    pelvis = position[0, robot.joints.joint["pelvis"]]
    assert np.hypot(*(pelvis - ours[0])[[0, 2]]) < 0.3


def test_a_failed_export_leaves_nothing(plaza, tmp_path, monkeypatch):
    def fails(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("crowd.export.bvh.motion_rows", fails)
    with pytest.raises(RecordingError, match="No space left"):
        export(Selection(plaza, [0]), "bvh", tmp_path / "people")
    assert list(tmp_path.iterdir()) == []


def test_bad_requests_get_one_line(plaza, tmp_path):
    with pytest.raises(SettingsError, match=r'is no format; got "?.?bhv'):
        export(Selection(plaza), "bhv", tmp_path / "x")
    with pytest.raises(SettingsError, match="no such character"):
        Selection(plaza, ["99"])
    with pytest.raises(SettingsError, match="no frame lies in the time"):
        Selection(plaza, start=50.0)
    with pytest.raises(SettingsError, match="straight up or down"):
        PictureCamera((0, 5, 0), (0, 0, 0))
    (tmp_path / "taken").write_text("mine")
    with pytest.raises(RecordingError, match="is a file"):
        export(Selection(plaza, [0]), "bvh", tmp_path / "taken")
    assert (tmp_path / "taken").read_text() == "mine"
    for place in (tmp_path, Path()):
        with pytest.raises(RecordingError, match="is a folder; allowed the name of a file"):
            export(Selection(plaza), "npz", place)


def test_a_folder_that_is_there_takes_the_files_of_people(plaza, tmp_path, monkeypatch):
    (tmp_path / "other.txt").write_text("mine")
    monkeypatch.chdir(tmp_path)
    export(Selection(plaza, [0]), "bvh", Path())
    assert sorted(file.name for file in tmp_path.iterdir()) == ["other.txt", "person_0000.bvh"]


def test_the_command_line_exports_every_format(plaza, tmp_path):
    for format_name in FORMATS:
        ending = {"usd": ".usda", "coco": ".json"}.get(format_name, "")
        if format_name == "usd":
            pytest.importorskip("pxr")
        out = tmp_path / f"out_{format_name}{ending}"
        command = [sys.executable, "-c", "from crowd.cli import main; main()", "export", str(plaza.path)]
        options = ["--to", format_name, "--out", str(out), "--characters", "0,1", "--stop", "0.5"]
        done = subprocess.run([*command, *options], capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        assert out.exists()


def test_angles_rebuild_the_rotation_also_where_axes_lock():
    rng = np.random.default_rng(1)
    rotation = from_vector(rng.uniform(-3.0, 3.0, (200, 3)))
    locked = compose((2, 1, 0), np.array([[0.3, math.pi / 2, 0.8], [0.3, -math.pi / 2, 0.8]]))
    for values in (rotation, locked):
        again = compose((2, 1, 0), euler_zyx(values))
        assert turn_between(again, values) < 1e-6
