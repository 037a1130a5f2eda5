"""Goals behind closed walls are found before a run."""

from pathlib import Path

import pytest

from crowd.errors import ScenarioError
from crowd.scenario import bundled_scenarios, load_scenario, place
from crowd.scenario.reach import check_reachable
from crowd.scenario.worlds import build_world

ROOM = """
[world]
bounds = {{ x = [-10.0, 10.0], z = [-10.0, 10.0] }}
walls = [{{ points = [[2.0, 2.0], [6.0, 2.0], [6.0, 6.0], [2.0, 6.0], [2.0, {end}]] }}]

[[characters]]
position = [0.0, 0.0]
goals = [{{ position = [-5.0, 0.0] }}, {{ position = [4.0, 4.0] }}]

[[regions]]
count = 10
area = {{ x = [-9.0, -1.0], z = [-9.0, -1.0] }}
goals = [{{ area = {{ x = [3.0, 5.0], z = [3.0, 5.0] }} }}]
"""


NARROW = ("doorway-one-way", "curves", "overtake-obstacle", "wall-squeeze", "simple-wall", "urban")


def checked(folder: Path, end: float) -> None:
    path = folder / "room.toml"
    path.write_text(ROOM.format(end=end), encoding="utf-8")
    scenario = load_scenario(path)
    check_reachable(scenario, place(scenario, seed=0), build_world(scenario)[0])


def test_a_goal_in_a_closed_room_is_one_line_for_each_table(tmp_path: Path) -> None:
    with pytest.raises(ScenarioError) as caught:
        checked(tmp_path, end=2.0)
    first, second = str(caught.value).splitlines()
    assert first == (
        "room.toml: line 8: characters[0].goals[1]: goal cannot be reached; got [4.0, 4.0]; "
        "allowed a point to which a way leads from [0, 0] for a body of radius 0.25 m"
    )
    assert second.startswith("room.toml: line 13: regions[0].goals[0]: goal cannot be reached; got [")


def test_a_door_must_be_wide_enough_for_the_body(tmp_path: Path) -> None:
    checked(tmp_path, end=3.2)
    with pytest.raises(ScenarioError):
        checked(tmp_path, end=2.4)


@pytest.mark.parametrize("name", sorted(bundled_scenarios()))
def test_all_goals_of_bundled_scenarios_are_reachable(name: str) -> None:
    scenario = load_scenario(name)
    world, _ = build_world(scenario)
    for seed in range(3):
        check_reachable(scenario, place(scenario, seed), world)


def test_narrow_published_scenes_have_ways_for_their_wide_bodies(shared_data: Path) -> None:
    for name in NARROW:
        scenario = load_scenario(shared_data / "steerbench" / f"{name}.xml")
        check_reachable(scenario, place(scenario, seed=0), build_world(scenario)[0])
