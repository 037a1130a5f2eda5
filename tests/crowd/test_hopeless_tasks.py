"""Tasks that cannot be done end soon, each with one line that says why, and the next ones are done."""

import numpy as np
import pytest

import crowd
from crowd.tasks.execution import MOST_ATTEMPTS
from crowd.tasks.support import is_carried

PEN = "walls = [{ points = [[-4, -4], [-2, -4], [-2, -2], [-4, -2], [-4, -4]] }]"
FENCE = """
    { x = [-4.0, 4.0], z = [1.0, 1.2], appear_at = 1.0 },
    { x = [-4.0, 4.0], z = [-4.0, -3.8], appear_at = 1.0, disappear_at = OPENS },
    { x = [-4.2, -4.0], z = [-4.0, 1.2], appear_at = 1.0 },
    { x = [4.0, 4.2], z = [-4.0, 1.2], appear_at = 1.0 },
"""
TABLE = '{ name = "table", x = [-1.5, 1.5], z = [3.0, 3.7], height = 0.75, boards = [0.3, 0.75] },'
BLOCK = "{ x = [3.0, 4.0], z = [-4.0, -3.0], height = 0.6 },"
SEAT = '{ name = "stool", x = [3.0, 3.4], z = [3.0, 3.4], height = 0.45, boards = [0.45], facing = 180 },'

THINGS = """
[[objects]]
name = "can"
shape = "capsule"
radius = 0.035
length = 0.15
position = [0.4, 0.75, 3.2]
resting = true

[[objects]]
name = "carton"
shape = "box"
size = [0.3, 0.3, 0.3]
position = [-0.6, 0.75, 3.3]
resting = true

[[objects]]
name = "boulder"
shape = "sphere"
radius = 0.7
position = [-3.0, 0.0, 3.0]
resting = true
"""


def scene(folder, people, boxes=TABLE + SEAT, walls="walls = []", things=THINGS):
    path = folder / "room.toml"
    world = f"[world]\nbounds = {{ x = [-5, 5], z = [-5, 5] }}\nboxes = [{boxes}]\n{walls}\n"
    path.write_text(world + things + people, encoding="utf-8")
    return crowd.Simulation(crowd.load_scenario(path), threads=1)


def person(tasks, place="[0.0, 0.0]"):
    return f"[[characters]]\nposition = {place}\nfacing = 0\ntasks = [{tasks}]\n"


def told(simulation, seconds):
    """What is told until everyone has finished."""
    for _ in simulation.run(seconds=seconds):
        if simulation.is_finished:
            break
    assert simulation.is_finished
    return [(event.kind.value, event.task, event.detail) for event in simulation.events]


@pytest.mark.parametrize("task", ['pick_up = "carton", hand = "left"', 'pick_up = "boulder"'])
def test_what_is_too_big_is_told_once_and_at_once(tmp_path, task):
    simulation = scene(tmp_path, person(f"{{ {task} }}, {{ wait = 0.1 }}"))
    assert told(simulation, 0.5) == [
        ("task_failed", "pick_up", "the object is too big for the hands that were asked"),
        ("task_done", "wait", ""),
    ]


def test_of_a_kind_those_that_fit_into_the_hand_are_taken(tmp_path):
    people = person('{ pick_up = "box", hand = "right" }', "[-0.6, 1.5]")
    things = THINGS.replace('"can"', '"box_1"').replace('"carton"', '"box_2"')
    simulation = scene(tmp_path, people, things=things)
    assert told(simulation, 20.0)[-1] == ("task_done", "pick_up", "")
    assert simulation.objects.holder.tolist() == [0, -1, -1]


def test_nothing_is_put_into_the_air(tmp_path):
    tasks = '{ pick_up = "can" }, { put_down = [0.0, 1.2, 0.0] }, { put_down = [0.2, 0.75, 3.2] }'
    simulation = scene(tmp_path, person(tasks, "[0.4, 1.5]"))
    events = [event for event in told(simulation, 40.0) if event[0].startswith("task")]
    assert events == [
        ("task_done", "pick_up", ""),
        ("task_failed", "put_down", "there is nothing to put it on"),
        ("task_done", "put_down", ""),
    ]
    np.testing.assert_allclose(simulation.objects.position_world[0], (0.2, 0.825, 3.2), atol=0.002)


@pytest.mark.parametrize(
    ("place", "expected"),
    [
        ((0.0, 0.0, 0.0), True),
        ((0.0, 0.02, 0.0), True),
        ((0.0, 0.1, 0.0), False),
        ((0.0, -0.1, 0.0), False),
        ((0.0, 0.75, 3.2), True),
        ((0.0, 0.3, 3.2), True),
        ((0.0, 0.5, 3.2), False),
        ((0.0, 0.75, 2.9), False),
        ((3.5, 0.6, -3.5), True),
        ((-0.5, 1.05, 3.3), True),
        ((-0.5, 1.05, 3.5), False),
        ((0.4, 0.9, 3.2), False),
    ],
)
def test_things_stand_on_the_ground_boards_boxes_and_other_things(tmp_path, place, expected):
    simulation = scene(tmp_path, person("{ wait = 0.1 }"), TABLE + BLOCK)
    assert is_carried(simulation, 0, np.array(place)) is expected


VASE = """
[[objects]]
name = "vase"
shape = "box"
size = [0.06, 0.4, 0.06]
position = [0.0, 0.75, 3.3]
rotation = ROTATION
resting = true
"""
UPRIGHT, LYING_ALONG_X = "[0.0, 0.0, 0.0]", "[0.0, 0.0, 90.0]"


@pytest.mark.parametrize(
    ("rotation", "place", "expected"),
    [
        (UPRIGHT, (0.02, 1.15, 3.3), True),
        (UPRIGHT, (0.15, 1.15, 3.3), False),
        (UPRIGHT, (0.0, 1.15, 3.45), False),
        (UPRIGHT, (0.0, 0.81, 3.3), False),
        (LYING_ALONG_X, (0.15, 0.81, 3.3), True),
        (LYING_ALONG_X, (0.25, 0.81, 3.3), False),
        (LYING_ALONG_X, (0.0, 0.81, 3.45), False),
        (LYING_ALONG_X, (0.0, 1.15, 3.3), False),
    ],
)
def test_things_carry_what_is_above_them_and_nothing_beside(tmp_path, rotation, place, expected):
    things = THINGS + VASE.replace("ROTATION", rotation)
    simulation = scene(tmp_path, person("{ wait = 0.1 }"), TABLE, things=things)
    assert is_carried(simulation, 0, np.array(place)) is expected


def test_a_thing_that_somebody_holds_carries_nothing(tmp_path):
    simulation = scene(tmp_path, person("{ wait = 0.1 }"))
    simulation.objects.holder[1] = 0
    assert not is_carried(simulation, 0, np.array((-0.5, 1.05, 3.3)))


def test_who_is_shut_in_is_told_once_for_each_task(tmp_path):
    tasks = '{ walk_to = [0.0, 0.0] }, { sit = "stool" }, { touch = "can" }, { walk_to = [-2.6, -3.0] }'
    simulation = scene(tmp_path, person(tasks, "[-3.0, -3.0]"), walls=PEN)
    assert told(simulation, 10.0) == [
        ("task_failed", "walk_to", "there is no way there"),
        ("task_failed", "sit", "there is no way there"),
        ("task_failed", "touch", "obstacles are in the way from every place to stand"),
        ("task_done", "walk_to", ""),
    ]


@pytest.mark.parametrize(
    ("tasks", "each_time"),
    [
        ("{ walk_to = [0.0, 0.0] }, { walk_to = [1.0, 0.0] }", ["walk_to", "walk_to"]),
        ('{ pick_up = "boulder" }', ["pick_up"]),
        ("{ put_down = [0.0, 0.0, 0.0] }", ["put_down"]),
    ],
)
def test_a_hopeless_list_that_repeats_is_told_once_a_second(tmp_path, tasks, each_time):
    people = person(tasks, "[-3.0, -3.0]") + "repeat = true\n"
    simulation = scene(tmp_path, people, walls=PEN)
    for _ in simulation.run(seconds=3.5):
        pass
    assert [event.task for event in simulation.events] == each_time * 4
    assert simulation.tasks.failed.tolist() == [len(each_time) * 4]


def test_a_list_that_repeats_begins_again_at_once_where_something_is_done(tmp_path):
    people = person("{ walk_to = [0.0, 0.0] }, { wait = 0.1 }", "[-3.0, -3.0]") + "repeat = true\n"
    simulation = scene(tmp_path, people, walls=PEN)
    for _ in simulation.run(seconds=2.0):
        pass
    assert simulation.tasks.done[0] >= 10


def test_who_is_shut_in_on_the_way_is_told_and_stops(tmp_path):
    boxes = TABLE + FENCE.replace(", disappear_at = OPENS", "")
    simulation = scene(tmp_path, person('{ pick_up = "can" }', "[0.0, -3.0]"), boxes)
    assert told(simulation, 5.0) == [("task_failed", "pick_up", "there is no way there")]
    assert simulation.time < 1.1
    assert not simulation.state.wants_to_walk.any()


@pytest.mark.parametrize("attempt", [0, MOST_ATTEMPTS - 1])
@pytest.mark.parametrize(("before", "after"), [(0, 2), (7, 0)])
def test_who_is_shut_in_just_when_the_time_is_over_is_told_once(tmp_path, attempt, before, after):
    tasks = ["{ wait = 0.02 }"] * before + ["{ walk_to = [0.0, 4.0] }"] + ["{ wait = 0.02 }"] * after
    boxes = TABLE + FENCE.replace(", disappear_at = OPENS", "")
    people = person(", ".join(tasks), "[0.0, -3.0]")
    expected = scene(tmp_path, people, boxes)
    told(expected, 5.0)
    simulation = scene(tmp_path, people, boxes)
    for _ in simulation.run(seconds=0.9):
        pass
    simulation.tasks.attempt[0] = attempt
    simulation.tasks.until[0] = next(event.time for event in expected.events if event.task == "walk_to")
    wait = ("task_done", "wait", "")
    failure = ("task_failed", "walk_to", "there is no way there")
    assert told(simulation, 5.0) == [wait] * before + [failure] + [wait] * after
    assert simulation.tasks.failed.tolist() == [1]


def test_who_is_shut_in_until_a_door_opens_waits_for_it(tmp_path):
    boxes = TABLE + FENCE.replace("OPENS", "4.0")
    simulation = scene(tmp_path, person("{ walk_to = [0.0, -4.5] }", "[0.0, -2.0]"), boxes)
    assert told(simulation, 20.0) == [("task_done", "walk_to", "")]
    assert simulation.time > 4.0


def test_a_goal_without_a_way_is_told_once(tmp_path):
    boxes = TABLE + FENCE.replace("OPENS", "4.0")
    people = "[[characters]]\nposition = [0.0, -1.0]\ngoals = [{ position = [0.0, -4.5] }]\n"
    simulation = scene(tmp_path, people, boxes)
    assert told(simulation, 20.0) == [("target_refused", "walk", "there is no way to the goal")]


def test_a_seat_without_room_before_it_is_told_at_once(tmp_path):
    boxes = SEAT + '{ name = "desk", x = [2.6, 3.8], z = [2.0, 2.6], height = 0.74 },'
    simulation = scene(tmp_path, person('{ sit = "stool" }'), boxes)
    why = "obstacles are in the way from every place to stand"
    assert told(simulation, 0.5) == [("task_failed", "sit", why)]
