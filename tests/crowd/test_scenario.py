"""Scenario files: every mistake gives one line with file, line, key, what was found and what is allowed."""

from pathlib import Path

import pytest

import crowd.scenario.load as load
from crowd.errors import ScenarioError
from crowd.scenario import bundled_scenarios, load_scenario, place
from crowd.scenario.checks import check_clips
from crowd.scenario.schema import Scenario

VALID = """\
description = "one walker"

[world]
bounds = { x = [-10.0, 10.0], z = [-10.0, 10.0] }
boxes = [{ x = [2.0, 4.0], z = [-1.0, 1.0] }]

[[characters]]
name = "anna"
position = [-5.0, 0.0]
goals = [{ position = [6.0, 0.0] }]
"""


def written(folder: Path, text: str) -> Path:
    path = folder / "scene.toml"
    path.write_text(text, encoding="utf-8")
    return path


def problems_of(folder: Path, text: str) -> list[str]:
    with pytest.raises(ScenarioError) as caught:
        load_scenario(written(folder, text))
    return str(caught.value).splitlines()


def the_problem(folder: Path, text: str) -> str:
    lines = problems_of(folder, text)
    assert len(lines) == 1, lines
    return lines[0]


def test_a_valid_file_is_read_with_defaults(tmp_path: Path) -> None:
    scenario = load_scenario(written(tmp_path, VALID))
    assert scenario.name == "scene"
    assert scenario.dt == pytest.approx(1 / 60)
    assert scenario.characters[0].goals[0].position == (6.0, 0.0)
    assert scenario.character_count == 1


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        (
            'name = "anna"',
            'name = "anna"\nraduis = 0.3',
            'scene.toml: line 9: characters[0].raduis: unknown key; allowed "radius", ',
        ),
        (
            'name = "anna"',
            "radius = nan",
            "scene.toml: line 8: characters[0].radius: must be finite; got nan; allowed a number",
        ),
        (
            'name = "anna"',
            "radius = -0.2",
            "scene.toml: line 8: characters[0].radius: is out of range; got -0.2; allowed >= 0.1",
        ),
        (
            'name = "anna"',
            'radius = "0.3"',
            "scene.toml: line 8: characters[0].radius: must be a number; got '0.3'; allowed a number",
        ),
        (
            'name = "anna"',
            "speed = true",
            "scene.toml: line 8: characters[0].speed: must be a number; got 'true'; allowed a number",
        ),
        (
            'name = "anna"',
            "glances = 1",
            "scene.toml: line 8: characters[0].glances: must be true or false; got 1; allowed true or false",
        ),
        (
            'name = "anna"',
            'radius = "wide"',
            "scene.toml: line 8: characters[0].radius: must be a number; got 'wide'; allowed a number",
        ),
        (
            "position = [-5.0, 0.0]",
            "",
            "scene.toml: line 7: characters[0].position: is missing",
        ),
        (
            "goals = [{ position = [6.0, 0.0] }]",
            "goals = [{ position = [3.0, 0.5] }]",
            "scene.toml: line 10: characters[0].goals[0].position: goal is inside a wall; got [3.0, 0.5]; "
            "allowed a point on free ground",
        ),
        (
            "goals = [{ position = [6.0, 0.0] }]",
            "goals = [{ position = [60.0, 0.0] }]",
            "scene.toml: line 10: characters[0].goals[0].position: goal is outside the bounds; "
            "got [60.0, 0.0]; allowed x -10 to 10, z -10 to 10",
        ),
        (
            "goals = [{ position = [6.0, 0.0] }]",
            "goals = [{ radius = 0.3 }]",
            "scene.toml: line 10: characters[0].goals[0]: needs exactly one place; got 'none of them'; "
            "allowed one of position, area, swap_through",
        ),
        (
            "position = [-5.0, 0.0]",
            "position = [1.9, 0.0]",
            "scene.toml: line 9: characters[0].position: start is inside a wall, or 0.1 m from it; "
            "got [1.9, 0.0]; allowed at least the radius away, 0.25 m",
        ),
        (
            "position = [-5.0, 0.0]",
            "position = [-50.0, 0.0]",
            "scene.toml: line 9: characters[0].position: start is outside the bounds; got [-50.0, 0.0]; "
            "allowed x -10 to 10, z -10 to 10",
        ),
        (
            "x = [2.0, 4.0]",
            "x = [4.0, 2.0]",
            "scene.toml: line 5: world.boxes[0].x: must rise; got [4.0, 2.0]; "
            "allowed [low, high] with low < high",
        ),
        (
            'name = "anna"',
            'on_arrival = "vanish"',
            "scene.toml: line 8: characters[0].on_arrival: is not one of the choices; got 'vanish'; "
            "allowed 'stay' or 'leave'",
        ),
        (
            "[world]",
            "[expect]\n'overlap.max_deth_m' = { max = 0.05 }\n[world]",
            'scene.toml: line 4: expect."overlap.max_deth_m": unknown metric; allowed "overlap.max_depth_m"',
        ),
        (
            "[world]",
            '[[plays]]\nclip = "wave"\nat = 1.0\nwho = "ana"\n[world]',
            "scene.toml: line 6: plays[0].who: nobody has this name; got 'ana'; allowed \"anna\"",
        ),
    ],
)
def test_each_mistake_is_one_exact_line(tmp_path: Path, old: str, new: str, expected: str) -> None:
    assert old in VALID
    assert the_problem(tmp_path, VALID.replace(old, new, 1)).startswith(expected)


def test_all_mistakes_are_listed_at_once(tmp_path: Path) -> None:
    lines = problems_of(tmp_path, VALID.replace('name = "anna"', "radius = inf\nspeed = 0\nheigt = 1.7"))
    assert [line.split(": ")[2] for line in lines] == [
        "characters[0].radius",
        "characters[0].speed",
        "characters[0].heigt",
    ]


def test_overlapping_starts_name_both_people(tmp_path: Path) -> None:
    text = VALID + "\n[[characters]]\nposition = [-5.3, 0.0]\n"
    line = the_problem(tmp_path, text)
    assert line == (
        "scene.toml: line 13: characters[1].position: start overlaps characters[0], 0.3 m away; "
        "got [-5.3, 0.0]; allowed at least 0.5 m away"
    )


def test_malformed_toml_gives_line_and_column(tmp_path: Path) -> None:
    assert the_problem(tmp_path, "[world]\nbounds = { x = [1, 2\n").startswith("scene.toml: ")
    line = the_problem(tmp_path, '[world]\nname "anna"\n')
    assert line.startswith("scene.toml: line 2, column ")
    assert "is not TOML" in line


def test_a_polygon_whose_edges_cross_is_refused(tmp_path: Path) -> None:
    polygon = "[[world.polygons]]\npoints = [[0.0, 4.0], [2.0, 6.0], [2.0, 4.0], [0.0, 6.0]]\n"
    line = the_problem(tmp_path, VALID.replace("[[characters]]", polygon + "[[characters]]"))
    assert line.startswith("scene.toml: line 8: world.polygons[0].points: edges cross; ")
    assert "1 5" in line


def test_nobody_in_the_scene_is_refused(tmp_path: Path) -> None:
    text = VALID[: VALID.index("[[characters]]")]
    assert the_problem(tmp_path, text) == (
        "scene.toml: has nobody in it; allowed at least one of characters, regions, flows"
    )


def test_unknown_names_offer_the_nearest() -> None:
    with pytest.raises(ScenarioError) as caught:
        load_scenario("plazza")
    message = str(caught.value)
    assert message.startswith(
        "scenario: unknown name; got 'plazza'; allowed a .toml or .xml file, or \"plaza\""
    )


def test_missing_files_and_other_files_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ScenarioError, match="no such file"):
        load_scenario(tmp_path / "absent.toml")
    other = tmp_path / "notes.txt"
    other.write_text("hello")
    with pytest.raises(ScenarioError, match=r"is not a scenario file; got '\.txt'; allowed \.toml or \.xml"):
        load_scenario(other)
    binary = tmp_path / "binary.toml"
    binary.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ScenarioError, match="is not text"):
        load_scenario(binary)


def test_a_long_list_of_problems_is_cut(tmp_path: Path) -> None:
    lines = problems_of(tmp_path, VALID + "\n[[characters]]\nposition = [0.0, 50.0]\n" * 40)
    assert len(lines) == 21
    assert lines[-1] == "scene.toml: and 59 more problems"


def test_lines_are_found_in_every_form_of_toml(tmp_path: Path) -> None:
    text = (
        'title = """two\nlines"""\n'  # lines 1, 2
        '[world]  # comment with ] and "\n'  # 3
        "bounds.x = [-10.0, 10.0]\n"  # 4
        "bounds.z = [\n  -10.0,\n  10.0,\n]\n"  # 5 to 8
        "[[characters]]\n"  # 9
        "'position' = [0.0, 0.0]\n"  # 10
        "goals = [\n"  # 11
        "  { position = [1.0, 1.0], wait_seconds = 1 },\n"  # 12
        "# { position = [2.0, 2.0] },\n"  # 13
        "  { position = [2.0, 2.0], wait_seconds = -1 },\n"  # 14
        "]\n"
    )
    lines = problems_of(tmp_path, text)
    assert lines[0].startswith(
        "scene.toml: line 14: characters[0].goals[1].wait_seconds: is out of range; got -1"
    )
    assert lines[1].startswith("scene.toml: line 1: title: unknown key")


def test_every_bundled_scenario_is_complete() -> None:
    assert {"plaza", "circle_swap", "corridor", "bottleneck", "maze"} <= set(bundled_scenarios())
    for name in bundled_scenarios():
        scenario = load_scenario(name)
        assert scenario.name == name
        assert scenario.description
        assert {"overlap.max_depth_m", "foot_slip.mean_m"} <= set(scenario.expect)
        people = place(scenario, seed=1)
        assert people.count == scenario.character_count
        assert people.radius.min() >= 0.22
        assert people.radius.max() <= 0.28


def test_the_plaza_is_what_it_promises() -> None:
    people = place(load_scenario("plaza"), seed=0)
    is_jogging = people.preferred_speed > 2.0
    assert people.count == 200
    assert is_jogging.sum() == 15
    assert ((people.preferred_speed[~is_jogging] >= 1.0) & (people.preferred_speed[~is_jogging] <= 1.6)).all()
    assert (people.goal_count == 0).sum() == 25


def test_scenarios_can_be_made_in_python() -> None:
    scenario = Scenario.model_validate(
        {
            "world": {"bounds": {"x": (-5, 5), "z": (-5, 5)}},
            "regions": [{"count": 3, "area": {"x": (-4, 4), "z": (-4, 4)}}],
        }
    )
    assert place(scenario, seed=0).count == 3
    with pytest.raises(ScenarioError, match=r"^scenario: world: is missing$"):
        load.scenario_from({}, load.ScenarioSource())


def test_avoidance_can_be_set_as_the_engine_knows_it(tmp_path: Path) -> None:
    scenario = load_scenario(written(tmp_path, VALID + "\n[avoidance]\ntime_horizon = 3\n"))
    assert scenario.avoidance.changed == {"time_horizon": 3}
    assert scenario.avoidance.model_dump() == {"time_horizon": 3}
    assert load_scenario(written(tmp_path, VALID)).avoidance.changed == {}


@pytest.mark.parametrize(
    ("setting", "expected"),
    [
        ("time_horizn = 3.0", 'time_horizn: unknown key; allowed "time_horizon", '),
        ("time_horizon = -1.0", "time_horizon: is out of range; got -1.0; allowed 0.1 to 10"),
        ("time_horizon = nan", "time_horizon: is out of range; got nan; allowed 0.1 to 10"),
        ("neighbor_count = 2.5", "neighbor_count: must be a whole number; got 2.5; allowed a whole number"),
        ('time_horizon = "long"', "time_horizon: must be a number; got 'long'; allowed a number"),
    ],
)
def test_wrong_avoidance_settings_are_refused(tmp_path: Path, setting: str, expected: str) -> None:
    line = the_problem(tmp_path, VALID + f"\n[avoidance]\n{setting}\n")
    assert line.startswith("scene.toml: line 13: avoidance." + expected)


def test_unknown_clips_are_named_with_their_keys(tmp_path: Path) -> None:
    text = VALID.replace('name = "anna"', 'name = "anna"\ngestures = ["wave", "wawe"]')
    scenario = load_scenario(written(tmp_path, text + '\n[[plays]]\nclip = "nood"\nat = 1.0\n'))
    with pytest.raises(ScenarioError) as caught:
        check_clips(scenario, ["wave", "nod"])
    assert str(caught.value).splitlines() == [
        'scene.toml: line 9: characters[0].gestures[1]: unknown clip; got \'wawe\'; allowed "wave", "nod"',
        'scene.toml: line 14: plays[0].clip: unknown clip; got \'nood\'; allowed "nod", "wave"',
    ]
