"""People do what their task lists say: whole scenes with objects, seats and each other."""

from dataclasses import replace

import numpy as np
import pytest

import crowd
from crowd.checkpoint import state_arrays
from crowd.controllers.grab import CLOSING, HOLDING, OPEN
from crowd.errors import MotionError
from crowd.motion.procedural import built_in_library
from crowd.state import CarryStage
from crowd.tasks.events import EventKind

ROOM = """
[world]
bounds = {{ x = [-5.0, 5.0], z = [-5.0, 5.0] }}
boxes = [
    {{ name = "table", x = [-1.5, 1.5], z = [2.0, 2.7], height = 0.75, boards = [0.75] }},
    {{ name = "shelf", x = [-1.5, 1.5], z = [-3.0, -2.6], height = 1.5, boards = [0.5, 1.1] }},
    {{ name = "stool", x = [3.0, 3.4], z = [0.0, 0.4], height = 0.45, boards = [0.45], facing = 180 }},
]

[[objects]]
name = "can_1"
shape = "capsule"
radius = 0.035
length = 0.15
position = [0.4, 1.1, -2.8]
resting = true

[[objects]]
name = "can_2"
shape = "capsule"
radius = 0.035
length = 0.15
position = [-0.6, 0.5, -2.8]
resting = true

{people}
"""


def scene(folder, people, **how):
    path = folder / "room.toml"
    path.write_text(ROOM.format(people=people), encoding="utf-8")
    return crowd.Simulation(crowd.load_scenario(path), threads=1, **how)


def person(name, x, z, tasks):
    return f'[[characters]]\nname = "{name}"\nposition = [{x}, {z}]\nfacing = 0\ntasks = [{tasks}]\n'


def finish(simulation, seconds):
    for _ in simulation.run(seconds=seconds):
        if simulation.is_finished:
            return
    pytest.fail(f"still busy: {list(simulation.events)[-3:]}")


def done(simulation):
    return [event.task for event in simulation.events if event.kind is EventKind.TASK_DONE]


def test_the_last_steps_to_a_place_begin_without_a_halt(tmp_path):
    simulation = scene(tmp_path, person("a", 0, 0, '{ pick_up = "can_1" }'))
    state, directed = simulation.state, []
    for _ in simulation.run(seconds=20.0):
        if state.is_directed[0]:
            directed.append(state.directed_parameter[0].copy())
        elif directed:
            break
    assert len(directed) > 10
    assert directed[0].any(), "a single step at rest would jerk the legs"
    np.testing.assert_allclose(directed[0], directed[1], atol=0.1)


def test_what_is_fetched_stands_on_the_table_afterwards(tmp_path):
    simulation = scene(tmp_path, person("ann", 0.0, 0.0, '{ pick_up = "can_1" }, { put_down = "table" }'))
    start = simulation.objects.position_world.copy()
    finish(simulation, 60.0)
    x, y, z = simulation.objects.position_world[0]
    assert -1.5 < x < 1.5
    assert 2.0 < z < 2.7
    assert y == pytest.approx(0.75 + 0.075, abs=1e-6)
    assert np.array_equal(simulation.objects.position_world[1], start[1])
    figures = simulation.metrics.as_dict()
    assert figures["held.apart_mm.max"] < 1.0
    assert 0.0 < figures["placed.error_mm.max"] < 2.0
    assert figures["reach.finger_depth_mm.max"] < 1.0
    assert figures["tasks.failed"] == 0


def test_two_people_take_two_things_of_one_kind(tmp_path):
    tasks = '{ pick_up = "can" }'
    simulation = scene(tmp_path, person("ann", 0.4, 0.0, tasks) + person("ben", -0.4, 0.0, tasks))
    finish(simulation, 60.0)
    assert sorted(simulation.objects.holder.tolist()) == [0, 1]


def test_its_own_name_means_a_thing_that_was_put_down_too(tmp_path):
    tasks = '{ pick_up = "can_1" }, { put_down = "table" }, { pick_up = "can_1" }, { wait = 0.5 }'
    simulation = scene(tmp_path, person("ann", 0.0, 0.0, tasks))
    finish(simulation, 60.0)
    assert done(simulation) == ["pick_up", "put_down", "pick_up", "wait"]
    assert simulation.objects.holder.tolist() == [0, -1]


def test_nothing_is_put_into_what_stands_there_until_it_is_taken_away(tmp_path):
    place = "put_down = [0.0, 0.75, 2.3]"
    people = person("ann", 0.0, 0.0, f'{{ pick_up = "can_1" }}, {{ {place} }}, {{ walk_to = [-3.0, 0.0] }}')
    people += person("ben", 1.0, 0.0, f'{{ wait = 15.0 }}, {{ pick_up = "can_2" }}, {{ {place} }}')
    people += person("cid", 3.0, -2.0, '{ wait = 35.0 }, { pick_up = "can_1" }, { walk_to = [3.0, 3.0] }')
    simulation = scene(tmp_path, people)
    nearest = np.inf
    for _ in simulation.run(seconds=90.0):
        if (simulation.objects.holder < 0).all():
            nearest = min(nearest, np.linalg.norm(np.subtract(*simulation.objects.position_world)))
        if simulation.is_finished:
            break
    assert simulation.metrics.as_dict()["tasks.failed"] == 0
    assert nearest > 0.07
    assert simulation.objects.holder.tolist() == [2, -1]
    assert np.allclose(simulation.objects.position_world[1], (0.0, 0.825, 2.3), atol=0.002)


def test_nobody_waits_for_a_kind_of_which_all_are_put_down(tmp_path):
    fetch = '{ pick_up = "can" }, { put_down = "table" }, '
    simulation = scene(tmp_path, person("ann", 0.0, 0.0, fetch * 2 + '{ pick_up = "can" }'))
    finish(simulation, 90.0)
    assert done(simulation) == ["pick_up", "put_down", "pick_up", "put_down"]
    last, before = list(simulation.events)[-1], list(simulation.events)[-2]
    assert last.kind is EventKind.TASK_FAILED
    assert last.detail == "all of the kind have been put down already"
    assert last.time - before.time < 0.2


def test_a_kind_of_which_there_is_one_thing_is_no_name_of_its_own(tmp_path):
    mug = '[[objects]]\nname = "mug_1"\nshape = "sphere"\nradius = 0.04\nposition = [0.4, 1.14, -2.8]\n\n'
    tasks = '{ pick_up = "mug" }, { put_down = "table" }, { pick_up = "mug" }, { pick_up = "mug_1" }'
    path = tmp_path / "room.toml"
    others = ROOM[ROOM.index("[[objects]]") : ROOM.index("{people}")]
    path.write_text(ROOM.replace(others, mug).format(people=person("ann", 0.0, 0.0, tasks)), encoding="utf-8")
    simulation = crowd.Simulation(crowd.load_scenario(path), threads=1)
    finish(simulation, 60.0)
    assert done(simulation) == ["pick_up", "put_down", "pick_up"]
    failed = [event.detail for event in simulation.events if event.kind is EventKind.TASK_FAILED]
    assert failed == ["all of the kind have been put down already"]
    assert simulation.objects.holder.tolist() == [0]


def test_of_two_things_the_named_hand_puts_its_own_down(tmp_path):
    tasks = (
        '{ pick_up = "can_1", hand = "right" }, { pick_up = "can_2", hand = "left" }, '
        '{ put_down = "table", hand = "left" }'
    )
    simulation = scene(tmp_path, person("ann", 0.0, 0.0, tasks))
    finish(simulation, 60.0)
    assert done(simulation) == ["pick_up", "pick_up", "put_down"]
    assert simulation.objects.holder.tolist() == [0, -1]


def test_what_is_handed_over_changes_hands(tmp_path):
    people = person("ann", 0.0, -1.0, '{ pick_up = "can_1" }, { hand_over = "ben" }')
    people += person("ben", 0.0, 0.5, '{ take_from = "ann" }')
    simulation = scene(tmp_path, people)
    finish(simulation, 90.0)
    assert simulation.objects.holder[0] == 1
    assert (simulation.state.grab_object[0] < 0).all()


CARTON = """
[[objects]]
name = "carton"
shape = "box"
size = [0.34, 0.25, 0.30]
position = [-1.0, 0.75, 2.3]
resting = true
"""


def test_what_is_too_big_for_one_hand_is_carried_and_handed_over_with_both(tmp_path):
    people = person(
        "ann", 0.0, -1.0, '{ pick_up = "carton" }, { carry_to = [-1.0, -0.5] }, { hand_over = "ben" }'
    )
    people += person("ben", -1.0, 0.5, '{ take_from = "ann" }, { put_down = "table" }')
    simulation = scene(tmp_path, people + CARTON)
    finish(simulation, 90.0)
    for who, tasks in enumerate((["pick_up", "carry_to", "hand_over"], ["take_from", "put_down"])):
        finished = [event for event in simulation.events if event.kind is EventKind.TASK_DONE]
        assert [event.task for event in finished if event.character == who] == tasks
    assert {event.kind for event in simulation.events} == {
        EventKind.TASK_DONE, EventKind.OBJECT_TAKEN, EventKind.OBJECT_PUT_DOWN,
    }  # fmt: skip
    item = simulation.model.objects.index("carton")
    assert simulation.objects.holder[item] == -1
    assert simulation.objects.position_world[item, 1] == pytest.approx(0.875, abs=1e-6)
    figures = simulation.metrics.as_dict()
    assert figures["held.apart_mm.max"] < 1.0
    assert figures["reach.finger_depth_mm.max"] < 1.0
    assert figures["placed.error_mm.max"] < 2.0


DESK = 'name = "desk", x = [2.4, 4.0], z = [-1.1, -0.55], height = 0.74, boards = [0.74] }},\n    {{ '


@pytest.mark.parametrize(("thing", "place", "desk"), [
    ("can_1", 0.0, ""), ("can_1", 2.0, DESK), ("carton", 0.0, ""),
])  # fmt: skip
def test_who_sits_takes_what_others_give_and_stands_up_for_what_needs_both_hands(
    tmp_path, thing, place, desk
):
    people = person("ann", 0.0, 0.0, f'{{ pick_up = "{thing}" }}, {{ hand_over = "ben" }}')
    people += person("ben", place, 1.0, '{ sit = "stool" }, { take_from = "ann" }, { wait = 0.5 }')
    path = tmp_path / "room.toml"
    room = ROOM.replace('name = "stool"', desk + 'name = "stool"').format(people=people + CARTON)
    path.write_text(room, encoding="utf-8")
    simulation = crowd.Simulation(crowd.load_scenario(path), threads=1)
    item = simulation.model.objects.index(thing)
    seat = None
    for _ in simulation.run(seconds=90.0):
        if simulation.state.is_seated[1]:
            seat = simulation.state.position_world[1].copy() if seat is None else seat
        if simulation.is_finished:
            break
    assert sorted(done(simulation)) == ["hand_over", "pick_up", "sit", "take_from", "wait"]
    assert {event.kind for event in simulation.events} == {EventKind.TASK_DONE, EventKind.OBJECT_TAKEN}
    assert simulation.objects.holder[item] == 1
    assert simulation.state.is_seated[1] == (thing == "can_1")
    assert np.linalg.norm(simulation.state.position_world[1] - seat) < 0.05
    assert simulation.metrics.as_dict()["reach.finger_depth_mm.max"] < 1.0


def test_nobody_is_pushed_off_a_seat(tmp_path):
    people = person("ann", 3.0, -3.0, "{ wait = 9 }, { walk_to = [3.3, 3.0] }")
    simulation = scene(tmp_path, people + person("ben", 2.0, 1.0, '{ sit = "stool" }, { wait = 12 }'))
    places = []
    for _ in simulation.run(seconds=25.0):
        if simulation.state.is_seated[1]:
            places.append(simulation.state.position_world[1].copy())
        if simulation.is_finished:
            break
    assert len(places) > 300
    assert np.ptp(places, axis=0).max() < 0.02


def test_what_is_held_already_is_picked_up_at_once(tmp_path):
    tasks = (
        '{ pick_up = "can_1", hand = "right" }, { pick_up = "can_1" }, { pick_up = "can_1", hand = "left" }'
    )
    simulation = scene(tmp_path, person("ann", 0.0, 0.0, tasks + ', { pick_up = "can_2", hand = "left" }'))
    finish(simulation, 60.0)
    assert done(simulation) == ["pick_up"] * 3
    assert simulation.objects.holder_hand[0].tolist() == [False, True]
    assert simulation.objects.holder.tolist() == [0, -1]
    assert [event.detail for event in simulation.events if event.kind is EventKind.TASK_FAILED] == [
        "the hands hold something else"
    ]


def test_people_sit_on_seats_and_stand_up_to_walk(tmp_path):
    simulation = scene(tmp_path, person("ann", 1.0, -1.0, '{ sit = "stool" }, { walk_to = [0.0, 0.0] }'))
    lowest = np.inf
    for _ in simulation.run(seconds=60.0):
        lowest = min(lowest, float(simulation.joints.position_model[0, 0, 1]))
        if simulation.is_finished:
            break
    assert lowest == pytest.approx(0.55 * simulation.model.people.stride_scale[0], abs=0.06)
    assert done(simulation) == ["sit", "walk_to"]
    assert not simulation.state.is_seated[0]


@pytest.mark.parametrize("command", ["set_goal", "set_locomotion"])
def test_who_sits_and_is_sent_away_stands_up_and_then_walks(tmp_path, command):
    simulation = scene(tmp_path, person("ann", 1.0, -1.0, '{ sit = "stool" }'))
    finish(simulation, 60.0)
    state = simulation.state
    seat = np.array([*state.position_world[0], state.yaw[0]])
    if command == "set_goal":
        simulation.commands.set_goal(0, (0.0, 0.5))
    else:
        simulation.commands.set_locomotion(0, (1.0, 0.0, 0.0))
    for _ in simulation.run(seconds=10.0):
        if state.sitting_time[0] > 0.0:
            np.testing.assert_allclose([*state.position_world[0], state.yaw[0]], seat, atol=0.02)
        if np.linalg.norm(state.position_world[0] - seat[:3]) > 2.0:
            break
    assert np.linalg.norm(state.position_world[0] - seat[:3]) > 2.0
    assert not state.is_seated[0]
    assert state.sitting_time[0] == 0.0


def test_a_point_is_touched_with_the_finger_tips(tmp_path):
    simulation = scene(tmp_path, person("ann", 0.0, 0.0, "{ touch = [0.5, 0.9, 2.2], seconds = 0.5 }"))
    nearest = np.inf
    for _ in simulation.run(seconds=30.0):
        names = simulation.model.skeleton
        tip = simulation.joint_positions_world()[0, names.joint("right_middle_3")]
        nearest = min(nearest, float(np.linalg.norm(tip - [0.5, 0.9, 2.2])))
        if simulation.is_finished:
            break
    assert done(simulation) == ["touch"]
    assert nearest < 0.06


def test_a_run_with_tasks_goes_on_after_a_stop_with_equal_bits(tmp_path):
    people = person("ann", 0.0, 0.0, '{ pick_up = "can_1" }, { put_down = "table" }')
    whole = scene(tmp_path, people, seed=4)
    for _ in whole.run(seconds=9.0):
        pass
    first, second = scene(tmp_path, people, seed=4), scene(tmp_path, people, seed=4)
    for _ in first.run(seconds=4.0):
        pass
    first.save(tmp_path / "stop.npz")
    second.restore(tmp_path / "stop.npz")
    for _ in second.run(seconds=5.0):
        pass
    assert second.step_index == whole.step_index
    assert np.array_equal(whole.state.pose_rotation, second.state.pose_rotation)
    assert np.array_equal(whole.objects.position_world, second.objects.position_world)


def test_a_run_stopped_while_hands_reach_hold_and_hand_over_goes_on_with_equal_bits(tmp_path):
    scenario = crowd.load_scenario("hand_over")
    whole, other = crowd.Simulation(scenario, threads=1), crowd.Simulation(scenario, threads=1)
    stops, ahead, expected, met = (230, 600, 720, 760), 40, {}, set()
    for step in range(1, stops[-1] + ahead + 1):
        whole.step()
        if step in stops:
            whole.save(tmp_path / f"{step}.npz")
            met |= set(whole.state.grab_stage.ravel().tolist())
            met |= {f"carries {stage}" for stage in whole.state.carry_stage.tolist()}
        if step - ahead in stops:
            expected[step - ahead] = {name: array.copy() for name, array in state_arrays(whole)}
    assert met >= {OPEN, CLOSING, HOLDING, f"carries {CarryStage.PLACING}", f"carries {CarryStage.CARRYING}"}
    # What the simulation did before, and in which order runs are taken up, leaves nothing behind.
    for stop in reversed(stops):
        other.restore(tmp_path / f"{stop}.npz")
        for _ in range(ahead):
            other.step()
        for name, array in state_arrays(other):
            np.testing.assert_array_equal(array, expected[stop][name], err_msg=f"{stop}: {name}")


def test_a_library_without_the_clips_of_tasks_is_refused_before_the_run(tmp_path):
    library = built_in_library()
    fewer = replace(library, clips=tuple(clip for clip in library.clips if clip.name != "carry_left"))
    with pytest.raises(MotionError, match="no clip has this name; got 'carry_left'; allowed"):
        scene(tmp_path, person("ann", 0.0, 0.0, "{ wait = 1.0 }"), motions=fewer)


@pytest.mark.parametrize("x", [-1.2, 0.1, 1.3])
def test_people_walk_to_the_part_of_furniture_that_is_nearest(tmp_path, x):
    simulation = scene(tmp_path, person("ann", x, 0.0, '{ walk_to = "table" }'))
    finish(simulation, 30.0)
    assert abs(simulation.state.position_world[0, 0] - x) < 0.35
    assert 1.2 < simulation.state.position_world[0, 2] < 2.0
