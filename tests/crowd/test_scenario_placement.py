"""Placement: bodies apart, draws that depend on their own keys only, goals on free ground."""

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from crowd.errors import ScenarioError
from crowd.scenario import PlacedCharacters, Scenario, load_scenario, place
from crowd.scenario.geometry import Ground

HALL = {"bounds": {"x": (-10, 10), "z": (-10, 10)}, "boxes": [{"x": (-2, 2), "z": (-2, 2)}]}


def scene(**tables: object) -> Scenario:
    return Scenario.model_validate({"world": HALL, **tables})


def least_gap(people: PlacedCharacters) -> float:
    x, z = people.position_world[:, 0], people.position_world[:, 2]
    gap = np.hypot(x[:, None] - x, z[:, None] - z) - people.radius[:, None] - people.radius
    np.fill_diagonal(gap, np.inf)
    return float(gap.min())


def wall_gap(people: PlacedCharacters) -> float:
    x, z = people.position_world[:, 0], people.position_world[:, 2]
    outside = np.hypot(np.maximum(np.abs(x) - 2, 0), np.maximum(np.abs(z) - 2, 0))
    return float((np.minimum.reduce([outside, 10 - np.abs(x), 10 - np.abs(z)]) - people.radius).min())


@settings(max_examples=25, deadline=None)
@given(
    seed=st.integers(0, 2**40),
    count=st.integers(1, 120),
    spacing=st.floats(0, 0.5),
    arrangement=st.sampled_from(["random", "grid"]),
)
def test_nobody_overlaps_another_or_a_wall(seed: int, count: int, spacing: float, arrangement: str) -> None:
    area = {"x": (-9.5, 9.5), "z": (-9.5, 9.5)}
    region = {"count": count, "area": area, "spacing": spacing, "arrangement": arrangement}
    people = place(scene(regions=[region], characters=[{"position": (5, 5)}]), seed)
    assert people.count == count + 1
    assert least_gap(people) >= spacing - 1e-9
    assert wall_gap(people) >= -1e-9


def test_a_grid_fills_a_dense_crowd() -> None:
    region = {
        "count": 500,
        "area": {"x": (-8, 8), "z": (3, 9.8)},
        "arrangement": "grid",
        "spacing": 0.0,
        "radius": 0.2,
    }
    people = place(scene(regions=[region]), seed=3)
    assert people.count == 500
    assert least_gap(people) >= -1e-9


def test_draws_depend_on_their_own_region_only() -> None:
    first = {"count": 20, "area": {"x": (-9, -4), "z": (-9, 9)}}
    second = {"count": 20, "area": {"x": (4, 9), "z": (-9, 9)}}
    alone = place(scene(regions=[first]), seed=5)
    together = place(scene(regions=[first, second], characters=[{"position": (0, 5)}]), seed=5)
    rows = slice(1, 21)
    assert np.array_equal(alone.position_world, together.position_world[rows])
    assert np.array_equal(alone.preferred_speed, together.preferred_speed[rows])
    assert np.array_equal(alone.stature, together.stature[rows])
    other = place(scene(regions=[first]), seed=6)
    assert not np.array_equal(alone.position_world, other.position_world)


def test_a_region_too_small_for_its_count_is_refused() -> None:
    for arrangement in ("random", "grid"):
        region = {"count": 60, "area": {"x": (4, 6), "z": (4, 6)}, "arrangement": arrangement}
        with pytest.raises(
            ScenarioError, match=r"regions\[0\]\.count: region is too small for its people; got 60"
        ):
            place(scene(regions=[region]), seed=0)


def test_the_number_of_people_is_scaled_in_proportion() -> None:
    regions = [
        {"count": 30, "area": {"x": (-9, -4), "z": (-9, 9)}, "name": "left"},
        {"count": 10, "area": {"x": (4, 9), "z": (-9, 9)}, "name": "right"},
    ]
    scenario = scene(regions=regions, characters=[{"position": (0, 5), "name": "guide"}])
    people = place(scenario, seed=0, characters=9)
    assert people.name[0] == "guide"
    assert sum(name.startswith("left") for name in people.name) == 6
    assert sum(name.startswith("right") for name in people.name) == 2
    assert place(scenario, seed=0, characters=81).count == 81
    assert place(scenario, seed=0, characters=1).name == ("guide",)
    with pytest.raises(ScenarioError, match="has only individuals, no region"):
        place(scene(characters=[{"position": (0, 5)}]), seed=0, characters=2)
    with pytest.raises(ScenarioError, match="must be positive"):
        place(scenario, seed=0, characters=0)


def test_people_on_a_circle_swap_with_those_opposite() -> None:
    people = place(load_scenario("circle_swap"), seed=0)
    start, goal = people.position_world, people.goal_world[people.first_goal]
    assert np.allclose(start, -goal, atol=1e-12)
    facing = np.stack([np.sin(people.yaw), np.zeros(people.count), np.cos(people.yaw)], axis=1)
    way = (goal - start) / np.linalg.norm(goal - start, axis=1)[:, None]
    assert np.allclose(facing, way, atol=1e-9)


def test_goals_speeds_and_bodies_are_packed_in_order() -> None:
    person = {
        "position": (5, 5),
        "facing": 90,
        "height": 1.8,
        "goals": [{"position": (5, 8), "speed": 2.0, "wait_seconds": 3}, {"position": (8, 8), "radius": 0.7}],
        "repeat": True,
        "on_arrival": "leave",
    }
    people = place(scene(characters=[{"position": (-5, 5)}, person]), seed=0)
    assert people.goal_count.tolist() == [0, 2]
    assert people.first_goal.tolist() == [0, 0]
    assert people.goal_world.tolist() == [[5, 0, 8], [8, 0, 8]]
    assert people.goal_radius.tolist() == [0.4, 0.7]
    assert people.goal_wait.tolist() == [3, 0]
    assert people.goal_speed[0] == 2.0
    assert math.isnan(people.goal_speed[1])
    assert people.yaw[1] == pytest.approx(math.pi / 2)
    assert people.stature[1] == 1.8
    assert 1.48 <= people.stature[0] <= 1.95
    assert people.repeats_goals.tolist() == [False, True]
    assert people.leaves_at_goal.tolist() == [False, True]


def test_goals_in_areas_keep_their_clearance() -> None:
    region = {
        "count": 60,
        "area": {"x": (-9, 9), "z": (4, 9)},
        "goals": [{"area": {"x": (-4, 4), "z": (-4, 4)}, "clearance": 1.0}],
    }
    people = place(scene(regions=[region]), seed=2)
    x, z = people.goal_world[:, 0], people.goal_world[:, 2]
    gap = np.hypot(np.maximum(np.abs(x) - 2, 0), np.maximum(np.abs(z) - 2, 0))
    assert gap.min() >= 1.0
    assert not people.goal_is_area.any()
    again = place(scene(regions=[region | {"repeat": True}]), seed=2)
    assert again.goal_is_area.all()
    assert again.goal_area[0].tolist() == [-4, 4, -4, 4]


def test_a_goal_area_without_free_ground_is_refused() -> None:
    person = {"position": (5, 5), "goals": [{"area": {"x": (-1, 1), "z": (-1, 1)}}]}
    with pytest.raises(ScenarioError, match=r"characters\[0\]\.goals\[0\]\.area: no free ground in the area"):
        place(scene(characters=[person]), seed=0)


def test_flows_have_slots_of_their_own() -> None:
    flow = {
        "source": {"x": (-9, -8), "z": (-9, 9)},
        "rate": 2.0,
        "limit": 30,
        "most_present": 12,
        "goals": [{"position": (9, 0)}],
    }
    people = place(scene(flows=[flow], characters=[{"position": (5, 5)}]), seed=0)
    assert people.flows[0].slots.tolist() == list(range(1, 13))
    assert people.flows[0].limit == 30
    assert people.is_from_flow.tolist() == [False] + [True] * 12
    assert people.leaves_at_goal[1:].all()


def test_plays_begin_once_and_gestures_keep_their_mean_period() -> None:
    scenario = scene(
        regions=[
            {
                "name": "group",
                "count": 10,
                "area": {"x": (4, 9), "z": (4, 9)},
                "gestures": ["talk", "wave"],
                "gesture_every": 5.0,
            }
        ],
        plays=[{"clip": "cheer", "at": 2.0, "who": "group", "share": 0.5}, {"clip": "bow", "at": 0.0}],
    )
    schedule = place(scenario, seed=1).plays
    assert schedule.clips == {"talk", "wave", "cheer", "bow"}
    dt = 1 / 60
    begun: dict[str, list[int]] = {}
    for step in range(round(50 / dt)):
        for clip, rows in schedule.between(step * dt, (step + 1) * dt):
            begun.setdefault(clip, []).extend(rows.tolist())
    assert begun["bow"] == list(range(10))
    assert 0 < len(begun["cheer"]) < 10
    assert len(set(begun["cheer"])) == len(begun["cheer"])
    assert len(begun["talk"]) + len(begun["wave"]) == 10 * 10
    assert min(len(begun["talk"]), len(begun["wave"])) > 25
    everything = [(clip, rows.tolist()) for clip, rows in schedule.between(0.0, 50.0)]
    assert sum(len(rows) for clip, rows in everything if clip in ("talk", "wave")) == 100


def test_a_file_in_messages_survives_scaling(tmp_path: Path) -> None:
    path = tmp_path / "small.toml"
    path.write_text(
        "[world]\nbounds = { x = [-5.0, 5.0], z = [-5.0, 5.0] }\n"
        "[[regions]]\ncount = 5\narea = { x = [-1.0, 1.0], z = [-1.0, 1.0] }\n"
    )
    with pytest.raises(
        ScenarioError, match=r"^small\.toml: line 4: regions\[0\]\.count: region is too small"
    ):
        place(load_scenario(path), seed=0, characters=50)


def test_a_full_circle_continues_on_wider_ones() -> None:
    people = place(load_scenario("circle_swap"), seed=0, characters=300)
    assert people.count == 300
    assert least_gap(people) >= 0.1 - 1e-9
    distance = np.linalg.norm(people.position_world, axis=1)
    assert distance.min() == pytest.approx(11.0)
    assert len(np.unique(distance.round(6))) == 3


def test_standing_groups_keep_their_size_when_the_rest_grows() -> None:
    people = place(load_scenario("plaza"), seed=0, characters=400)
    assert people.count == 400
    assert (people.goal_count == 0).sum() == 25
    fewer = place(load_scenario("plaza"), seed=0, characters=40)
    assert (fewer.goal_count == 0).sum() == 5


@pytest.mark.parametrize("name", ["plaza", "circle_swap", "corridor", "bottleneck", "maze"])
def test_bundled_scenarios_have_room_with_every_seed(name: str) -> None:
    scenario = load_scenario(name)
    for seed in range(30):
        people = place(scenario, seed)
        assert least_gap(people) >= 0.0
        assert Ground(scenario.world).clearance(people.goal_world[:, [0, 2]]).min() >= 0.2
