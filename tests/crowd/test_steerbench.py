"""SteerBench files: starts to the digit, goals of all kinds, and refusals that name the line."""

import math
import time
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from crowd.errors import ScenarioError
from crowd.scenario import load_scenario, place
from crowd.scenario.geometry import Ground
from crowd.scenario.steerbench_placement import ReaderRandom

HEADER = """\
<!-- a comment -->
<SteerBenchTestCase xmlns="http://www.magix.ucla.edu/steerbench">
<header><version>1.0</version><name>other</name>
<worldBounds><xmin>-100</xmin><xmax>100</xmax><ymin>0</ymin><ymax>0</ymax><zmin>-100</zmin><zmax>100</zmax></worldBounds>
</header>
"""


def box(name: str, x: tuple[float, float], z: tuple[float, float], height: float = 0.0) -> str:
    sides = {"xmin": x[0], "xmax": x[1], "ymin": 0, "ymax": height, "zmin": z[0], "zmax": z[1]}
    return f"<{name}>" + "".join(f"<{key}>{value}</{key}>" for key, value in sides.items()) + f"</{name}>"


def vector(name: str, x: float, z: float) -> str:
    return f"<{name}><x>{x}</x><y>0</y><z>{z}</z></{name}>"


def seek(x: float, z: float) -> str:
    place = vector("targetLocation", x, z)
    return f"<seekStaticTarget><desiredSpeed>1.3</desiredSpeed>{place}</seekStaticTarget>"


def agent(position: str, goals: str, direction: str | None = None, name: str = "A") -> str:
    facing = direction or vector("direction", 0, 2)
    start = f"<initialConditions><speed>0</speed>{position}{facing}<radius>0.5</radius></initialConditions>"
    return f"<agent><name>{name}</name>{start}<goalSequence>{goals}</goalSequence></agent>"


def written(folder: Path, body: str, header: str = HEADER, name: str = "case.xml") -> Path:
    path = folder / name
    path.write_text(header + body + "\n</SteerBenchTestCase>\n", encoding="utf-8")
    return path


def test_the_generator_has_the_readers_twist() -> None:
    rng = ReaderRandom(2)
    drawn = [rng.integer() for _ in range(6)]
    assert drawn == [2437592789, 794921487, 4168414096, 279878709, 1918977131, 206148438]


def test_the_generator_renews_itself_as_its_definition_says() -> None:
    state = [2]
    for index in range(1, 624):
        state.append((1812433253 * (state[-1] ^ (state[-1] >> 30)) + index) & 0xFFFFFFFF)
    expected = []
    for _ in range(3):
        for i in range(624):
            following = state[(i + 1) % 624]
            mixed = (state[i] & 0x80000000) | (following & 0x7FFFFFFF)
            state[i] = state[(i + 397) % 624] ^ (mixed >> 1) ^ (following & 1)
        for word in state:
            word ^= word >> 11
            word ^= (word << 7) & 0x9D2C5680
            word ^= (word << 15) & 0xEFC60000
            expected.append(word ^ (word >> 18))
    rng = ReaderRandom(2)
    assert [rng.integer() for _ in range(len(expected))] == expected


def test_one_agent_is_read(tmp_path: Path) -> None:
    path = written(
        tmp_path, box("obstacle", (4, 5), (-1, 1)) + agent(vector("position", -1, -0.0), seek(3, 4))
    )
    scenario = load_scenario(path)
    assert scenario.name == "case"
    person = scenario.characters[0]
    assert (person.name, person.position, person.radius, person.speed) == ("A", (-1.0, 0.0), 0.5, 1.3)
    assert person.facing == 0.0
    assert person.on_arrival == "leave"
    assert (person.goals[0].position, person.goals[0].radius) == ((3.0, 4.0), 0.5)
    assert scenario.world.boxes[0].height > 0.0
    ideal = math.hypot(4.0, 4.0) / 1.3
    assert scenario.seconds == pytest.approx(2 * ideal + 60)


def test_random_boxes_stand_where_the_reader_puts_them(tmp_path: Path) -> None:
    region = (
        "<obstacleRegion><numObstacles>50</numObstacles>"
        + box("regionBounds", (-100, 100), (-100, 100))
        + "<obstacleSize>0.98</obstacleSize><obstacleHeight>2</obstacleHeight></obstacleRegion>"
    )
    scenario = load_scenario(written(tmp_path, region + agent(vector("position", 0, 0), seek(1, 1))))
    first = scenario.world.boxes[0]
    assert first.x == pytest.approx((12.886869, 13.866869), abs=1e-5)
    assert first.z == pytest.approx((-62.856342, -61.876339), abs=1e-5)
    assert first.height == 2.0
    centers = np.array([[sum(b.x) / 2, sum(b.z) / 2] for b in scenario.world.boxes])
    gap = np.abs(centers[:, None] - centers).max(axis=2) + 10 * np.eye(50)
    assert gap.min() > 0.98


def test_random_goals_depend_on_the_seed_only_and_keep_clear_of_boxes(tmp_path: Path) -> None:
    goal = seek(0, 0).replace(
        vector("targetLocation", 0, 0), "<targetLocation><random>true</random></targetLocation>"
    )
    walls = "".join(box("obstacle", (x, x + 12), (-100, 80)) for x in range(-90, 90, 20))
    people = "".join(agent(vector("position", -98, z), goal, name=str(z)) for z in range(-90, 90, 3))
    scenario = load_scenario(written(tmp_path, walls + people))
    one, two, again = (place(scenario, seed) for seed in (1, 2, 1))
    assert np.array_equal(one.goal_world, again.goal_world)
    assert not np.array_equal(one.goal_world, two.goal_world)
    points = one.goal_world[:, [0, 2]]
    assert Ground(scenario.world).clearance(points).min() >= 1.0
    assert not one.goal_is_area.any()


def test_a_heading_is_followed_to_the_edge_of_the_world(tmp_path: Path) -> None:
    flow = (
        "<flowStaticDirection><desiredSpeed>1</desiredSpeed><timeDuration>1000</timeDuration>"
        + vector("targetDirection", 3, 4)
        + "</flowStaticDirection>"
    )
    short = flow.replace("1000", "10")
    scenario = load_scenario(
        written(tmp_path, agent(vector("position", 0, 0), flow) + agent(vector("position", 5, 0), short))
    )
    assert scenario.characters[0].goals[0].position == pytest.approx((0.75 * 99.5, 99.5))
    assert scenario.characters[1].goals[0].position == pytest.approx((11, 8))


def test_an_idle_agent_waits_where_it_is(tmp_path: Path) -> None:
    idle = "<idle><desiredSpeed>0</desiredSpeed><timeDuration>7</timeDuration></idle>"
    person = load_scenario(written(tmp_path, agent(vector("position", 2, 3), idle + seek(5, 5)))).characters[
        0
    ]
    assert person.goals[0].position == person.position
    assert person.goals[0].wait_seconds == 7.0
    assert person.goals[1].position == (5.0, 5.0)


@pytest.mark.parametrize(
    ("body", "expected"),
    [
        (
            agent(vector("position", 0, 0), "<fleeStaticTarget><desiredSpeed>1</desiredSpeed>"
                  + vector("targetLocation", 1, 1) + "</fleeStaticTarget>"),
            "case.xml: line 6: fleeStaticTarget: goal of this kind is not run; got 'fleeStaticTarget'; "
            "allowed seekStaticTarget, flowStaticDirection, idle",
        ),
        (
            agent(vector("position", 0, 0), "<seekTarget/>"),
            'case.xml: line 6: seekTarget: unknown goal; got \'seekTarget\'; allowed "seekStaticTarget", ',
        ),
        ("<circleObstacle/>", "case.xml: line 6: circleObstacle: unknown element; got 'circleObstacle'; "),
        (
            box("obstacle", (1, -1), (0, 1)),
            "case.xml: line 6: obstacle: xmin must be below xmax; got '1 and -1'",
        ),
        (
            agent(vector("position", 0, 0), seek(1, 1)).replace("0.5", "-0.5"),
            "case.xml: line 6: radius: is out of range; got -0.5; allowed > 0",
        ),
        (
            agent(vector("position", math.nan, 0), seek(1, 1)),
            "case.xml: line 6: x: must be finite; got 'nan'",
        ),
        (
            box("obstacle", (0, 2), (0, 2)) + "\n" + agent(vector("position", -4, 0), seek(1, 1)),
            "case.xml: line 7: characters[0].goals[0].position: goal is inside a wall; got [1.0, 1.0]; ",
        ),
        (
            agent(vector("position", 0, 0), seek(5, 5))
            + "\n"
            + agent(vector("position", 0.4, 0), seek(5, 5)),
            "case.xml: line 7: characters[1].position: start overlaps characters[0], 0.4 m away; ",
        ),
        ("", "case.xml: line 2: SteerBenchTestCase: has no agents; "),
        (
            "<agentRegion><numAgents>9</numAgents>" + box("regionBounds", (0, 2), (0, 2))
            + "<initialConditions>" + vector("direction", 1, 0) + "<radius>0.5</radius><speed>0</speed>"
            "</initialConditions><goalSequence>" + seek(9, 9) + "</goalSequence></agentRegion>",
            "case.xml: line 6: agentRegion: region is too small for its agents; got '2 x 2 m'; ",
        ),
        ("<agent>", "case.xml: line 7, column 3: is not well-formed XML: mismatched tag"),
    ],
)  # fmt: skip
def test_what_cannot_be_run_is_refused_with_its_line(tmp_path: Path, body: str, expected: str) -> None:
    with pytest.raises(ScenarioError) as caught:
        load_scenario(written(tmp_path, body))
    assert str(caught.value).startswith(expected)
    assert "\n" not in str(caught.value)


def test_other_versions_and_other_documents_are_refused(tmp_path: Path) -> None:
    person = agent(vector("position", 0, 0), seek(1, 1))
    with pytest.raises(ScenarioError, match=r"line 3: version: unknown version; got '2\.0'; allowed 1\.0"):
        load_scenario(written(tmp_path, person, HEADER.replace(">1.0<", ">2.0<")))
    with pytest.raises(ScenarioError, match="is not a SteerBench test case"):
        load_scenario(written(tmp_path, person, HEADER.replace("steerbench", "other")))
    bomb = '<!DOCTYPE a [<!ENTITY b "' + "c" * 100 + '">]>\n'
    with pytest.raises(ScenarioError, match="line 1: document type is not accepted"):
        load_scenario(written(tmp_path, person, bomb + HEADER))


CHECK_VALUES = {
    "hallway-one-way": {0: (-2.287315, -4.093933), 1: (64.608734, -5.652864), 199: (22.968132, 4.074434)},
    "bottleneck-squeeze": {
        0: (60.958057, -24.878515, 0.982911, -0.184081),
        1: (27.800846, -4.203064, 0.954869, 0.297028),
        999: (30.783609, 8.221046),
    },
    "free-tickets": {0: (6.687084, -31.176874), 1: (-43.048729, -5.267128), 199: (-17.315639, 39.585503)},
    "urban": {0: (13.441711, -62.668667), 1: (2.184547, 16.551422), 499: (-19.449532, -34.135056)},
    "random": {0: (13.171532, -61.408993), 1: (-84.792953, -10.374649), 3999: (13.325279, -58.977528)},
}


@pytest.mark.parametrize("name", CHECK_VALUES)
def test_random_starts_equal_the_published_ones(shared_data: Path, name: str) -> None:
    begin = time.process_time()
    people = place(load_scenario(shared_data / "steerbench" / f"{name}.xml"), seed=11)
    assert time.process_time() - begin < 2.0
    for row, (x, z, *direction) in CHECK_VALUES[name].items():
        assert people.position_world[row, [0, 2]] == pytest.approx((x, z), abs=1e-5)
        if direction:
            assert (math.sin(people.yaw[row]), math.cos(people.yaw[row])) == pytest.approx(
                direction, abs=1e-5
            )


IDEAL_TIMES = {
    "simple-1": 15.38,
    "simple-wall": 15.95,
    "crossing-4": 17.08,
    "overtake": 20.03,
    "fan-out": 31.24,
}


@pytest.mark.parametrize("name", IDEAL_TIMES)
def test_ideal_times_equal_the_published_ones(shared_data: Path, name: str) -> None:
    scenario = load_scenario(shared_data / "steerbench" / f"{name}.xml")
    times = []
    for person in scenario.characters:
        path = [person.position, *(goal.position for goal in person.goals if goal.position is not None)]
        times.append(sum(length_between(a, b) for a, b in pairwise(path)) / person.speed)
    assert np.mean(times) == pytest.approx(IDEAL_TIMES[name], abs=0.006)


def length_between(first: Sequence[float], second: Sequence[float]) -> float:
    return math.hypot(first[0] - second[0], first[1] - second[1])


def test_all_files_are_read_with_everybody_in_free_places(shared_data: Path) -> None:
    files = sorted((shared_data / "steerbench").glob("*.xml"))
    assert len(files) == 40
    for file in files:
        scenario = load_scenario(file)
        people = place(scenario, seed=0)
        gap = Ground(scenario.world).clearance(people.position_world[:, [0, 2]])
        assert (gap >= people.radius - 1e-3).all(), file.name
        assert people.leaves_at_goal.all()
        assert (people.goal_count >= 1).all()
