"""Task lists are checked with file, line and key, and names stand for one thing or for all of a kind."""

import numpy as np
import pytest

import crowd
from crowd.errors import ScenarioError, SettingsError
from crowd.scenario.task_table import ACTIONS
from crowd.tasks.task_list import Group, TaskKind, groups_of

SCENE = """
[world]
bounds = {{ x = [-5.0, 5.0], z = [-5.0, 5.0] }}
boxes = [{{ name = "table_1", x = [-1.0, 1.0], z = [2.0, 2.6], height = 0.75, boards = [0.75] }}]

[[objects]]
name = "cup_1"
shape = "sphere"
radius = 0.04
position = [0.0, 0.75, 2.2]
resting = true

[[characters]]
name = "ann"
position = [0.0, 0.0]
tasks = [{tasks}]
"""


def load(folder, tasks):
    path = folder / "room.toml"
    path.write_text(SCENE.format(tasks=tasks), encoding="utf-8")
    return crowd.Simulation(crowd.load_scenario(path), threads=1)


def test_names_stand_for_things_and_kinds():
    assert groups_of(("cup_1", "cup_2[0]", "mug")) == {
        "cup_1": Group((0,), is_kind=False),
        "cup": Group((0, 1), is_kind=True),
        "cup_2[0]": Group((1,), is_kind=False),
        "cup_2": Group((1,), is_kind=True),
        "mug": Group((2,), is_kind=False),
    }


def test_a_full_name_means_one_thing_also_where_others_have_it_with_a_number():
    assert groups_of(("mug", "mug_1", "mug_2"))["mug"] == Group((0,), is_kind=False)


@pytest.mark.parametrize(
    ("tasks", "message"),
    [
        ('{ pick_up = "cop" }', "tasks[0].pick_up: no object has this name; got 'cop'"),
        ('{ sit = "table" }', "tasks[0].sit: no seat has this name; got 'table'; allowed there is no"),
        ('{ play = "walk" }', "tasks[0].play: no gesture or idle clip has this name; got 'walk'"),
        ('{ hand_over = "anne" }', "tasks[0].hand_over: no person has this name; got 'anne'; allowed"),
        ("{ walk_to = [9.0, 0.0] }", "tasks[0].walk_to: goal is outside the bounds; got [9.0, 0.0]"),
        ("{ walk_to = [0.0, 2.3] }", "tasks[0].walk_to: goal is inside a wall; got [0.0, 2.3]"),
        ("{ put_down = [0.0, 0.7, 9.0] }", "tasks[0].put_down: point is outside the bounds; got [0.0, 9.0]"),
        ("{ walk_to = 3 }", "tasks[0].walk_to: is neither a name nor a point; got 3"),
        ('{ walk_to = [1.0, "b"] }', "tasks[0].walk_to[1]: must be a number; got 'b'; allowed a number"),
        ("{ put_down = [0.0, 9.0, 1.0] }", "tasks[0].put_down[1]: is out of range; got 9.0; allowed <= 3"),
        ('{ touch = "" }', "tasks[0].touch: is neither a name nor a point; got ''"),
        ("{ wait = -1.0 }", "tasks[0].wait: is out of range; got -1.0; allowed >= 0"),
        ("{ wait = nan }", "tasks[0].wait: must be finite; got nan"),
        ('{ wait = "1" }', "tasks[0].wait: must be a number; got '1'; allowed a number"),
        ("{ wait = true }", "tasks[0].wait: must be a number; got 'true'; allowed a number"),
        ('{ touch = [0.0, "0.7", 1.0] }', "tasks[0].touch[1]: must be a number; got '0.7'"),
        ('{ look_at = "ann" }', "tasks[0].look_at: nobody does this with oneself; got 'ann'"),
        (
            '{ hand_over = "ann" }',
            "tasks[0].hand_over: nobody does this with oneself; got 'ann'; allowed some",
        ),
        ("{ weight = 1.0 }", 'tasks[0].weight: unknown key; allowed "wait"'),
        ('{ wait = 1.0, play = "nod" }', "tasks[0]: needs exactly one action; got 'wait and play'"),
        ("{ }", "tasks[0]: needs exactly one action; got 'none'"),
        ('{ wait = 1.0, hand = "left" }', "tasks[0].hand: means nothing for wait; got 'left'"),
    ],
)
def test_what_is_wrong_with_a_task_is_one_line(tmp_path, tasks, message):
    with pytest.raises(ScenarioError) as caught:
        load(tmp_path, tasks)
    lines = str(caught.value).splitlines()
    assert len(lines) == 1
    assert lines[0].startswith(f"room.toml: line 16: characters[0].{message}")


def test_goals_and_tasks_exclude_each_other(tmp_path):
    with pytest.raises(ScenarioError, match="cannot be given beside goals; got '1 tasks'; allowed goals or"):
        load(tmp_path, "{ wait = 1.0 }]\ngoals = [{ position = [1.0, 1.0] }")


def test_programs_give_tasks_in_the_same_words(tmp_path):
    simulation = load(tmp_path, "{ wait = 0.1 }")
    simulation.commands.do(0, [{"look_at": "cup_1", "seconds": 0.2}, {"play": "nod"}])
    for _ in simulation.run(seconds=5.0):
        if simulation.is_finished:
            break
    assert [event.task for event in simulation.events] == ["wait", "look_at", "play"]
    assert simulation.state.is_finished[0]


def test_programs_are_told_what_is_wrong(tmp_path):
    simulation = load(tmp_path, "{ wait = 0.1 }")
    with pytest.raises(ScenarioError, match=r"no object has this name; got 'cap'; allowed \"cup\""):
        simulation.commands.do(0, [{"pick_up": "cap"}])
    with pytest.raises(SettingsError, match="list of character 0 is too long; got 8; allowed 7 more tasks"):
        simulation.commands.do(0, [{"wait": 1.0}] * 8)


def test_places_and_rows_that_are_none_are_refused(tmp_path):
    simulation = load(tmp_path, "{ wait = 0.1 }")
    with pytest.raises(SettingsError, match=r"put: position has the wrong shape; got \(2,\); allowed \(3,\)"):
        simulation.commands.put(0, (1.0, 2.0))
    with pytest.raises(SettingsError, match="put: position is not finite"):
        simulation.commands.put(0, (float("nan"), 0.0, 0.0))
    with pytest.raises(SettingsError, match="are no rows; got 'ann'; allowed whole numbers, 0 to 0"):
        simulation.commands.put("ann", (1.0, 2.0, 0.0))


def test_a_person_without_anything_cannot_put_it_down(tmp_path):
    simulation = load(tmp_path, '{ put_down = "table" }, { carry_to = [1.0, 1.0] }')
    for _ in simulation.run(seconds=0.2):
        pass
    told = [(event.kind, event.task, event.detail) for event in simulation.events]
    assert told == [("task_failed", task, "the hands are empty") for task in ("put_down", "carry_to")]
    assert simulation.state.is_finished[0]


def test_a_scenario_with_tasks_can_be_written_and_read_again():
    scenario = crowd.load_scenario("seated_desk")
    again = type(scenario).model_validate_json(scenario.model_dump_json())
    assert again.characters == scenario.characters


def test_kinds_of_tasks_are_the_actions_of_scenarios():
    assert tuple(kind.name.lower() for kind in TaskKind) == ACTIONS


def pair(folder, *lists):
    """People of the names ann, ben and cid with these tasks."""
    world, people = SCENE.split("[[characters]]")[0].format(), ""
    for row, (name, tasks) in enumerate(zip(("ann", "ben", "cid"), lists, strict=False)):
        people += f'[[characters]]\nname = "{name}"\nposition = [{row}.0, 0.0]\ntasks = [{tasks}]\n\n'
    path = folder / "pair.toml"
    path.write_text(world + people, encoding="utf-8")
    return crowd.Simulation(crowd.load_scenario(path), threads=1)


@pytest.mark.parametrize(
    ("lists", "task", "what"),
    [
        (
            ('{ take_from = "ben" }', "{ wait = 1.0 }"),
            "tasks[0].take_from",
            """no task hand_over = "ann"; got 'ben'; allowed somebody who has: nobody here""",
        ),
        (
            ('{ take_from = "ben" }, { take_from = "cid" }', "{ wait = 1.0 }", '{ hand_over = "ann" }'),
            "tasks[0].take_from",
            """no task hand_over = "ann"; got 'ben'; allowed somebody who has: "cid\"""",
        ),
        (
            ('{ hand_over = "ben" }, { hand_over = "ben" }', '{ take_from = "ann" }'),
            "tasks[1].hand_over",
            """only 1 task take_from = "ann"; got 'ben'; allowed somebody who has: "ben\"""",
        ),
    ],
)
def test_nobody_waits_for_somebody_who_does_not_come(tmp_path, lists, task, what):
    with pytest.raises(ScenarioError) as caught:
        pair(tmp_path, *lists)
    assert str(caught.value) == f"pair.toml: line 16: characters[0].{task}: this person has {what}"


def test_whoever_waits_for_nobody_is_told_soon(tmp_path):
    simulation = pair(tmp_path, "{ wait = 0.1 }", "{ wait = 0.1 }")
    simulation.commands.do(0, [{"take_from": "ben"}])
    simulation.commands.do(1, [{"take_from": "ben"}])
    for _ in simulation.run(seconds=10.0):
        if simulation.is_finished:
            break
    told = [(event.character, event.kind.value, event.detail) for event in simulation.events]
    assert told[2:] == [
        (0, "task_failed", 'ben has no task hand_over = "ann"'),
        (1, "task_failed", "nobody does this with oneself"),
    ]


def test_whoever_waits_is_told_when_the_other_gives_up(tmp_path):
    simulation = pair(tmp_path, '{ take_from = "ben" }', '{ wait = 1.0 }, { hand_over = "ann" }')
    for _ in simulation.run(seconds=3.0):
        pass
    told = [(event.character, event.task, event.detail) for event in simulation.events]
    assert told == [
        (1, "wait", ""),
        (1, "hand_over", "the hands are empty"),
        (0, "take_from", 'ben has no task hand_over = "ann"'),
    ]


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda do: do.let_go(0, position_world=(1, 2)), r"let_go: position has the wrong shape; got \(2,\)"),
        (lambda do: do.let_go(0, position_world="there"), "let_go: position is not numbers; got 'there'"),
        (lambda do: do.let_go(0, position_world=[1, [2], 3]), "let_go: position is not numbers"),
        (lambda do: do.let_go(0, "foot"), "let_go: unknown hand; got 'foot'; allowed right, left or both"),
        (lambda do: do.let_go(0, None, (1, 1, 1), (1.0, 0.0)), "let_go: rotation has the wrong shape"),
        (lambda do: do.put(0, (1, 1, 1), (0.0, 0.0, 0.0, 0.0)), "put: rotation has no length"),
        (lambda do: do.put(0, (1, 1, 1), (float("nan"), 0, 0, 0)), "put: rotation is not finite"),
        (lambda do: do.set_goal(0, 3.0), r"set_goal: goal has the wrong shape; got \(\); allowed \(2,\) or"),
        (lambda do: do.set_goal(0, (1.0, float("inf"))), "set_goal: goal is not finite"),
        (lambda do: do.set_locomotion(0, (1.0, 0.0)), "set_locomotion: parameter vector has the wrong shape"),
        (lambda do: do.set_locomotion(0, "fast"), "set_locomotion: parameter vector is not numbers"),
        (lambda do: do.look_at(0, "ann"), "look_at: point is not numbers"),
        (lambda do: do.look_at(0, ["1", "2", "3"]), "look_at: point is not numbers"),
        (lambda do: do.put(0, np.full((1, 3), 1j)), "put: position is not numbers"),
        (lambda do: do.put(0, (True, False, True)), "put: position is not numbers"),
        (lambda do: do.put(0, (10**400, 0, 0)), "put: position is too large; allowed numbers up to 1e308"),
        (lambda do: do.put(10**5000, (1, 1, 1)), "characters: are no rows; got 'a whole number of 16610 b"),
        (lambda do: do.put(0, ("a", 10**5000, 0)), "put: position is not numbers; got 'tuple with a number"),
        (lambda do: do.put(0, ["a" * 999, 0, 0]), r"put: position is not numbers; got \"\['a{195}\.\.\.\";"),
        (lambda do: do.put([10**5000], (1, 1, 1)), "characters: are no rows; got 'list with a number too"),
        (lambda do: do.grasp(0, 10**5000), "grasp: no such object; got 'a whole number of 16610 bits'"),
        (lambda do: do.look_at(0, object=[10**5000]), "look_at: no such object; got 'list with a number"),
        (lambda do: do.look_at(0, character=[0, 0]), "look_at: wrong number of characters to look at; got 2"),
        (lambda do: do.look_at(0, object=0.5), "look_at: no such object; got '0.5'"),
        (lambda do: do.look_at(0, object="cap"), "no object has this name; got 'cap'; allowed \"cup_1\""),
        (lambda do: do.reach(0, "cup"), "reach: target is not numbers"),
        (lambda do: do.touch(0, "cup_1", "foot"), "touch: unknown hand; got 'foot'"),
        (lambda do: do.grasp(0, 7), "grasp: no such object; got '7'; allowed 0 to 0"),
        (lambda do: do.grasp(0, 0.5), "grasp: no such object; got '0.5'"),
        (lambda do: do.hand_over(0, 5), "characters: no such row; got 5"),
        (lambda do: do.hand_over(0, 0), "hand_over: the giver holds nothing"),
        (lambda do: do.set_attention(0, "bored"), "'bored'"),
        (lambda do: do.play(0, "nod", repetitions=0), "play: length must be positive"),
        (
            lambda do: do.play(0, "nod", repetitions="twice"),
            "play: repetitions is not a number; got 'twice'; allowed > 0",
        ),
        (lambda do: do.play(0, "nod", seconds="2"), "play: seconds is not a number; got '2'; allowed > 0 s"),
        (
            lambda do: do.set_goal(0, (1, 1), radius="wide"),
            "set_goal: radius is not a number; got 'wide'; allowed > 0 m",
        ),
        (lambda do: do.set_goal(0, (1, 1), radius=None), "set_goal: radius is not a number; got 'None'"),
        (
            lambda do: do.look_at(0, (1, 1, 1), trunk="half"),
            "look_at: trunk is not a number; got 'half'; allowed 0 to 1",
        ),
        (lambda do: do.look_at(0, (1, 1, 1), trunk=[0.5, 0.5]), "look_at: trunk is not a number"),
        (lambda do: do.look_at(0, (1, 1, 1), trunk=True), "look_at: trunk is not a number; got 'True'"),
        (lambda do: do.look_at(0, (1, 1, 1), trunk=float("nan")), "look_at: trunk is out of range; got nan"),
        (lambda do: do.look_at(0, (1, 1, 1), trunk=10**400), "look_at: trunk is too large; got 'a whole"),
        (lambda do: do.look_at(0, (1, 1, 1), trunk=1.5), "look_at: trunk is out of range; got 1.5"),
        (lambda do: do.reach(0, (1, 1, 1), seconds="1"), "reach: seconds is not a number; got '1'"),
        (lambda do: do.reach(0, (1, 1, 1), hold="long"), "reach: hold is not a number; got 'long'"),
        (lambda do: do.end_reach(0, "foot"), "end_reach: unknown hand"),
    ],
)
def test_wrong_arguments_of_commands_are_one_line(tmp_path, call, message):
    simulation = load(tmp_path, "{ wait = 0.1 }")
    with pytest.raises(SettingsError, match=message) as caught:
        call(simulation.commands)
    assert len(str(caught.value).splitlines()) == 1


def test_both_hands_can_touch(tmp_path):
    simulation = load(tmp_path, "{ wait = 0.1 }")
    simulation.commands.touch(0, "cup_1", "both")
    assert simulation.state.grab_object[0].tolist() == [0, 0]


def test_a_person_does_nothing_with_oneself(tmp_path):
    with pytest.raises(ScenarioError) as caught:
        pair(tmp_path, '{ look_at = "ann" }, { hand_over = "ann" }', "{ wait = 1.0 }")
    told = [line.split("tasks", 1)[1] for line in str(caught.value).splitlines()]
    assert told == [
        f"[{number}].{task}: nobody does this with oneself; got 'ann'; allowed \"ben\""
        for number, task in enumerate(("look_at", "hand_over"))
    ]


def test_one_of_many_with_the_same_list_can_be_looked_at_by_the_others(tmp_path):
    crowd_of_three = """
[world]
bounds = { x = [-5.0, 5.0], z = [-5.0, 5.0] }

[[regions]]
name = "crowd"
count = 3
area = { x = [-4.0, 4.0], z = [-4.0, 4.0] }
tasks = [{ look_at = "crowd[0]", seconds = 0.2 }]
"""
    path = tmp_path / "three.toml"
    path.write_text(crowd_of_three, encoding="utf-8")
    names = crowd.Simulation(crowd.load_scenario(path), threads=1).tasks.names.characters
    assert "crowd[0]" in names
