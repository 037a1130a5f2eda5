"""Characters of the user's: mapped, driven by the crowd, recorded and exported, several in one crowd."""

from pathlib import Path

import numpy as np
import pytest

import crowd
from crowd.characters import Driver, load_character
from crowd.errors import MotionError, ScenarioError, SettingsError
from crowd.export import Selection, export
from crowd.motion.rotation import rotate
from crowd.recording import Recorder, Recording

pytestmark = pytest.mark.xdist_group("export")
GLTF = Path(__file__).parents[2].parent / "shared" / "data" / "gltf"
needs_models = pytest.mark.skipif(not GLTF.is_dir(), reason="needs the characters of ../shared/data")
SCENE = """
[world]
bounds = {{ x = [-10, 10], z = [-10, 10] }}

[[characters]]
position = [0, -6]
{first}
goals = [{{ position = [0, 6] }}]

[[regions]]
count = {count}
area = {{ x = [-8, -2], z = [-6, 6] }}
{second}
goals = [{{ area = {{ x = [2, 8], z = [-6, 6] }} }}]
"""


def scene(folder, first="", second="", count=12):
    path = folder / "scene.toml"
    path.write_text(SCENE.format(first=first, second=second, count=count))
    return crowd.load_scenario(path)


def recorded(simulation, path, steps=20):
    with Recorder(path, simulation) as recorder:
        for _ in range(steps):
            recorder.record(simulation.step())
    return Recording(path)


@pytest.fixture(scope="module")
def own_bones(tmp_path_factory):
    """A skinned character with our own bones, and a second one."""
    folder = tmp_path_factory.mktemp("own_bones")
    simulation = crowd.Simulation(crowd.load_scenario("plaza"), characters=3)
    with recorded(simulation, folder / "run.h5", 4) as recording:
        export(Selection(recording, [0, 1]), "gltf", folder / "people")
    for old, new in (("person_0000", "one"), ("person_0001", "two")):
        (folder / "people" / f"{old}.glb").rename(folder / f"{new}.glb")
    return folder


@pytest.fixture(scope="module")
def walkers():
    simulation = crowd.Simulation(crowd.load_scenario("plaza"), characters=30, threads=1)
    for _ in range(90):
        simulation.step()
    return simulation


def test_a_character_with_our_own_bones_lands_on_the_joints(own_bones, walkers):
    joints, skeleton = walkers.joints, walkers.model.skeleton
    character = load_character(own_bones / "one.glb")
    position = joints.position_model.astype(float)
    turned, placed, scale = Driver(character, skeleton).pose(joints.rotation_model.astype(float), position)
    model = crowd.Simulation(crowd.load_scenario("plaza"), characters=3).model
    # The character has the size of the person that it was exported of.
    expected = walkers.model.people.stride_scale / model.people.stride_scale[0]
    assert scale == pytest.approx(expected, rel=1e-3)
    feet = [skeleton.joint(f"{side}_foot") for side in ("left", "right")]
    theirs = [character.joint_names.index(skeleton.joint_names[foot]) for foot in feet]
    assert np.abs(placed[:, theirs] - position[:, feet]).max() < 2e-3
    hand = skeleton.joint("left_hand")
    ahead = np.array([0.0, 0.0, 1.0])
    found = rotate(turned[:, character.joint_names.index("left_hand")], ahead)
    # The character has one person's proportions: the way from its wrist to its knuckles is a little askew.
    assert np.abs(found - rotate(joints.rotation_model[:, hand].astype(float), ahead)).max() < 0.03


@needs_models
@pytest.mark.parametrize("name", ["robot/robot.glb", "cesium_man/cesium_man.gltf"])
def test_feet_of_any_character_stay_where_the_crowd_plants_them(walkers, name):
    joints, skeleton = walkers.joints, walkers.model.skeleton
    character = load_character(GLTF / name)
    driver = Driver(character, skeleton)
    position = joints.position_model.astype(float)
    _, placed, _ = driver.pose(joints.rotation_model.astype(float), position)
    for side in ("left", "right"):
        foot = placed[:, character.joints.joint[f"{side}_foot"]]
        wanted = position[:, skeleton.joint(f"{side}_foot")]
        assert np.linalg.norm(foot - wanted, axis=1).max() < 1e-3
    matrices = driver.skin_matrices(joints.rotation_model.astype(float), position)
    assert np.isfinite(matrices).all()
    part = character.parts[0]
    points = np.c_[part.position, np.ones(len(part.position))]
    blended = np.einsum("vk,nvkij->nvij", part.weight, matrices[:2][:, part.joint])
    skinned = np.einsum("nvij,vj->nvi", blended, points)[..., :3]
    assert skinned[..., 1].min() > -0.2
    assert skinned[..., 1].max() < 4.5


@needs_models
def test_a_creature_without_knees_is_refused_in_one_line():
    with pytest.raises(MotionError, match=r"no joint for left_thigh.*--joints") as refused:
        load_character(GLTF / "greenman" / "greenman.glb")
    assert "\n" not in str(refused.value)


def test_a_scenario_says_who_is_drawn_as_what(own_bones):
    scenario = scene(own_bones, 'character = "two.glb"', 'character = ["one.glb", "built-in"]', 60)
    cast = crowd.Simulation(scenario, seed=5).model.cast
    assert [character.name for character in cast.characters] == ["two", "one"]
    assert cast.number[0] == 0
    assert set(cast.number[1:]) == {1, -1}
    assert 15 < (cast.number[1:] == 1).sum() < 45
    again = crowd.Simulation(
        scene(own_bones, "", 'character = ["one.glb", "built-in"]', 80), seed=5
    ).model.cast
    assert ((cast.number[1:] == 1) == (again.number[1:61] == 0)).all()


def test_a_run_says_it_for_all_others(own_bones):
    scenario = scene(own_bones, 'character = "built-in"')
    files = [own_bones / "one.glb", own_bones / "two.glb"]
    cast = crowd.Simulation(scenario, character_files=files).model.cast
    assert cast.number[0] == -1
    assert set(cast.number[1:]) == {0, 1}
    assert len(crowd.Simulation(scenario).model.cast.characters) == 0


@pytest.mark.parametrize(
    ("value", "message"),
    [
        ('"on.glb"', r"line 7: characters\[0\].character: .*no such file; got 'on.glb'.*\"one.glb\""),
        ('"scene.toml"', r"line 7: .*no such file"),
        ("3", r"line 7: .*is no file.*in quotes"),
        ('["one.glb", ""]', r"line 7: .*is no file"),
        ('"broken.glb"', r"line 7: .*cannot be used: .*broken.glb: .*cut short"),
    ],
)
def test_a_wrong_character_is_named_with_its_line(own_bones, value, message):
    (own_bones / "broken.glb").write_bytes((own_bones / "one.glb").read_bytes()[:5000])
    with pytest.raises(ScenarioError, match=message):
        crowd.Simulation(scene(own_bones, f"character = {value}"))


def test_a_wrong_file_of_a_run_is_named(own_bones):
    with pytest.raises(SettingsError, match="no such file"):
        crowd.Simulation(scene(own_bones), character_files=["nobody.glb"])


def test_a_mapping_file_beside_the_character_is_used(own_bones, tmp_path):
    (tmp_path / "one.glb").write_bytes((own_bones / "one.glb").read_bytes())
    roles = [f"{side}_{part}" for side in ("left", "right") for part in ("thigh", "shank", "foot")]
    lines = [f'{role} = "{role}"' for role in ("pelvis", *roles)]
    (tmp_path / "one.joints.toml").write_text("\n".join([*lines, "head = []"]))
    joints = load_character(tmp_path / "one.glb").joints
    assert joints.family.endswith("one.joints.toml")
    assert "head" in joints.unused


def test_a_recording_holds_its_characters(own_bones, tmp_path):
    for name in ("one", "two"):
        (tmp_path / f"{name}.glb").write_bytes((own_bones / f"{name}.glb").read_bytes())
    scenario = scene(tmp_path, 'character = "two.glb"', 'character = ["one.glb", "built-in"]')
    simulation = crowd.Simulation(scenario)
    expected = simulation.model.cast
    with recorded(simulation, tmp_path / "run.h5") as recording:
        for name in ("one", "two"):
            (tmp_path / f"{name}.glb").unlink()
        assert (recording.cast.number == expected.number).all()
        for found, wanted in zip(recording.cast.characters, expected.characters, strict=True):
            assert found.joint_names == wanted.joint_names
            assert found.joints == wanted.joints
            assert (found.inverse_bind == wanted.inverse_bind).all()
            for one, other in zip(found.parts, wanted.parts, strict=True):
                for name in ("position", "weight", "joint", "triangle", "colour", "image"):
                    assert np.array_equal(getattr(one, name), getattr(other, name))


@needs_models
def test_exports_show_each_person_as_recorded(tmp_path):
    robot = str(GLTF / "robot" / "robot.glb")
    man = str(GLTF / "cesium_man" / "cesium_man.gltf")
    scenario = scene(tmp_path, f'character = "{robot}"', f'character = ["{man}", "built-in"]')
    with recorded(crowd.Simulation(scenario), tmp_path / "run.h5") as recording:
        export(Selection(recording), "gltf", tmp_path / "people")
        found = {
            int(file.stem[-4:]): load_character(file).vertex_count
            for file in sorted((tmp_path / "people").iterdir())
        }
        counts = [load_character(path).vertex_count for path in (robot, man)]
        number = recording.cast.number
        assert found[0] == counts[0]
        assert [found[slot] == counts[1] for slot in range(1, 13)] == (number[1:] == 1).tolist()
        pytest.importorskip("pxr")
        from pxr import Usd

        export(Selection(recording), "usd", tmp_path / "crowd.usdc")
        stage = Usd.Stage.Open(str(tmp_path / "crowd.usdc"))
        names = {child.GetName() for child in stage.GetPrimAtPath("/Bodies").GetAllChildren()}
        assert {"body_0", "body_1"} < names
        assert all(name.startswith(("body_", "build_")) for name in names)
        for slot in range(13):
            body = "build_" if number[slot] < 0 else f"body_{number[slot]}"
            prim = stage.GetPrimAtPath(f"/Crowd/person_{slot:04d}")
            assert body in str(prim.GetPrimStack()[0].referenceList.prependedItems)
