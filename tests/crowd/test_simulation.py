"""Whole runs: repeatable bits, stop and go on, people who get where they should, obstacles that go."""

import json
import pickle

import numpy as np
import pytest

import crowd
from crowd.checkpoint import FORMAT
from crowd.errors import CrowdError, MotionError, RecordingError, SettingsError
from crowd.scenario.schema import Area, Box, Character, Flow, Goal, Region, Scenario, Wall, WorldTable

GROUND = WorldTable(bounds=Area(x=(-20, 20), z=(-20, 20)))


def busy(count=60):
    """People who cross a small square with a wall and a box, some standing, all the time."""
    square = Area(x=(-9, 9), z=(-9, 9))
    return Scenario(
        name="busy",
        world=WorldTable(
            bounds=Area(x=(-12, 12), z=(-12, 12)),
            boxes=(Box(x=(-2, 2), z=(-1, 1)), Box(x=(4, 5), z=(-6, -2), appear_at=0.8, disappear_at=1.6)),
            walls=(Wall(points=((-6, 3), (-3, 5))),),
        ),
        regions=(
            Region(count=count, area=square, goals=(Goal(area=square, radius=0.6),), repeat=True),
            Region(count=8, area=square, gestures=("wave",), gesture_every=2.0),
        ),
        flows=(
            Flow(
                source=Area(x=(-11, -9), z=(-11, -9)),
                rate=2.0,
                most_present=6,
                goals=(Goal(position=(10, 10)),),
            ),
        ),
    )


def arrays_of(simulation):
    from crowd.checkpoint import state_arrays

    return {name: array.copy() for name, array in state_arrays(simulation)}


def assert_equal_bits(one, other):
    for name, array in one.items():
        np.testing.assert_array_equal(array, other[name], err_msg=name)


@pytest.fixture(scope="module")
def reference():
    """State of the busy scene after two seconds on one thread."""
    simulation = crowd.Simulation(busy(), seed=5, is_threaded=False)
    for _ in simulation.run(seconds=2.0):
        pass
    return arrays_of(simulation)


def test_equal_bits_on_two_threads(reference):
    simulation = crowd.Simulation(busy(), seed=5, threads=2, is_threaded=True)
    for _ in simulation.run(seconds=2.0):
        pass
    assert_equal_bits(reference, arrays_of(simulation))


@pytest.mark.parametrize("stop", [0.5, 1.2])
def test_equal_bits_after_stop_save_and_restore(reference, stop, tmp_path):
    first = crowd.Simulation(busy(), seed=5, is_threaded=False)
    for _ in first.run(seconds=stop):
        pass
    first.save(tmp_path / "stop.npz")
    second = crowd.Simulation(busy(), seed=5, is_threaded=False)
    second.restore(tmp_path / "stop.npz")
    assert second.time == pytest.approx(stop)
    for _ in second.run(seconds=2.0 - stop):
        pass
    assert_equal_bits(reference, arrays_of(second))


def test_another_seed_gives_another_run(reference):
    simulation = crowd.Simulation(busy(), seed=6, is_threaded=False)
    for _ in simulation.run(seconds=0.5):
        pass
    assert (simulation.state.position_world != reference["state.position_world"]).any()


def test_a_checkpoint_of_another_run_is_refused(tmp_path):
    simulation = crowd.Simulation(busy(), seed=5)
    simulation.save(tmp_path / "stop.npz")
    with pytest.raises(RecordingError, match="seed"):
        crowd.Simulation(busy(), seed=6).restore(tmp_path / "stop.npz")
    with pytest.raises(RecordingError, match="cannot write"):
        simulation.save(tmp_path / "nowhere" / "stop.npz")
    assert not list(tmp_path.glob("*.partial"))


def changed_checkpoint(path, **changes):
    """Write the checkpoint beside `path` with other arrays; None leaves one out."""
    with np.load(path.with_name("stop.npz")) as stored:
        contents = {**stored, **changes}
    np.savez(path, **{name: array for name, array in contents.items() if array is not None})


def facts_with(path, **changes):
    """The facts of a checkpoint, with others."""
    with np.load(path) as stored:
        return np.array(json.dumps(json.loads(str(stored["facts"])) | changes))


def single_array(path):
    """Write one array, as NumPy does outside archives."""
    with path.open("wb") as file:
        np.save(file, np.zeros(3))


def flipped_byte(path):
    """Write the checkpoint beside `path` with one wrong byte in the middle."""
    content = bytearray(path.with_name("stop.npz").read_bytes())
    content[len(content) // 2] ^= 0xFF
    path.write_bytes(content)


@pytest.mark.parametrize(
    ("write", "message"),
    [
        (
            lambda path: path.write_text("t,id,x,y\n0,1,2,3\n"),
            r"is not a checkpoint; got b't,id,x,y'; ",
        ),
        (lambda path: path.write_bytes(b""), "is not a checkpoint; got 'an empty file'; "),
        (single_array, r"is not a checkpoint; got b'\x93NUMPY"),
        (lambda path: path.write_bytes(pickle.dumps({"seed": 5})), "is not a checkpoint; got b'"),
        (lambda path: np.savez(path, a=np.zeros(3), b=1), "is not a checkpoint; got 'arrays a, b'; "),
        (lambda path: changed_checkpoint(path, facts=None), "is not a checkpoint; got 'arrays state."),
        (lambda path: changed_checkpoint(path, facts=np.array("3")), "is not a checkpoint; got 'arrays "),
        (lambda path: path.mkdir(), "cannot be read; got 'Is a directory'; "),
        (lambda path: None, "cannot be read; got 'No such file or directory'; "),
        (flipped_byte, "is damaged; got "),
    ],
)
def test_what_is_no_checkpoint_is_one_line(tmp_path, write, message):
    simulation = crowd.Simulation(busy(), seed=5)
    simulation.save(tmp_path / "stop.npz")
    path = tmp_path / "other.npz"
    write(path)
    with pytest.raises(RecordingError) as caught:
        simulation.restore(path)
    (line,) = str(caught.value).splitlines()
    assert line.startswith(f"{path}: {message}")
    assert line.endswith("; allowed a file written by Simulation.save")
    assert "pickle" not in line


def test_a_checkpoint_that_does_not_fit_changes_nothing(tmp_path):
    simulation = crowd.Simulation(busy(), seed=5)
    simulation.save(tmp_path / "stop.npz")
    for _ in simulation.run(seconds=0.1):
        pass
    whole = (tmp_path / "stop.npz").read_bytes()
    (tmp_path / "cut.npz").write_bytes(whole[: len(whole) // 2])
    changed_checkpoint(tmp_path / "lacks.npz", **{"state.yaw": None})
    changed_checkpoint(tmp_path / "more.npz", **{"state.wings": np.zeros(3)})
    changed_checkpoint(tmp_path / "old.npz", facts=facts_with(tmp_path / "stop.npz", format=1))
    changed_checkpoint(tmp_path / "text.npz", **{"state.yaw": np.full(simulation.state.yaw.shape, "left")})
    before = arrays_of(simulation)
    for name, message in (
        ("cut", f"is cut off; got '{len(whole) // 2} bytes'; allowed the whole file"),
        ("lacks", "is of another version of the engine: its arrays are others; got 'no state.yaw'; allowed "),
        ("more", "is of another version of the engine: its arrays are others; got 'state.wings'; allowed "),
        ("text", "does not fit the scenario: state.yaw; got '<U4 "),
        ("old", f"is of another version of the engine: its format is another; got 1; allowed {FORMAT}"),
    ):
        with pytest.raises(RecordingError) as caught:
            simulation.restore(tmp_path / f"{name}.npz")
        assert str(caught.value).startswith(f"{tmp_path / name}.npz: {message}")
    after = arrays_of(simulation)
    assert_equal_bits(before, after)


def walker(**changes):
    return Character(**({"position": (0, -5), "facing": 0, "goals": (Goal(position=(0, 5)),)} | changes))


def run_one(person, seconds, world=GROUND, **options):
    simulation = crowd.Simulation(Scenario(world=world, characters=(person,)), **options)
    for _ in simulation.run(seconds=seconds):
        pass
    return simulation


def test_a_walker_reaches_its_goal_at_its_speed_and_stays():
    simulation = run_one(walker(speed=1.4), 6.0)
    assert simulation.state.locomotion_parameter[0, 0] == pytest.approx(1.4, abs=0.01)
    for _ in simulation.run(seconds=5.0):
        pass
    assert simulation.is_finished
    assert np.linalg.norm(simulation.state.position_world[0] - (0, 0, 5)) < 0.45
    assert simulation.state.locomotion_weight[0] == 0.0, "it stands again"


def test_a_walker_with_its_goal_behind_turns_before_it_walks():
    simulation = run_one(walker(facing=180.0), 0.6)
    assert abs(simulation.state.yaw[0]) < np.pi - 0.3
    assert np.linalg.norm(simulation.state.position_world[0] - (0, 0, -5)) < 0.3
    for _ in simulation.run(seconds=10.0):
        pass
    assert simulation.is_finished


def test_leaving_people_are_gone():
    simulation = run_one(walker(on_arrival="leave"), 12.0)
    assert not simulation.state.is_active[0]
    assert simulation.is_finished


def test_goals_are_done_in_order_with_waits():
    person = walker(goals=(Goal(position=(0, -2), wait_seconds=2.0), Goal(position=(2, -2))))
    simulation = run_one(person, 4.5)
    assert simulation.state.goal_index[0] == 1
    assert not simulation.state.wants_to_walk[0]
    for _ in simulation.run(seconds=6.0):
        pass
    assert simulation.is_finished


def test_an_obstacle_that_appears_is_walked_around_and_one_that_goes_opens_the_way():
    wall = Box(x=(-20, 3), z=(0, 0.5), appear_at=1.0)
    simulation = run_one(walker(), 25.0, WorldTable(bounds=GROUND.bounds, boxes=(wall,)))
    assert simulation.is_finished
    door = Box(x=(-20, 20), z=(0, 0.5), disappear_at=4.0)
    simulation = crowd.Simulation(
        Scenario(world=WorldTable(bounds=GROUND.bounds, boxes=(door,)), characters=(walker(),))
    )
    for frame in simulation.run(seconds=4.0):
        assert simulation.state.position_world[0, 2] < 0.0, frame.time
    for _ in simulation.run(seconds=12.0):
        pass
    assert simulation.is_finished


def test_two_who_meet_pass_each_other():
    people = (walker(), walker(position=(0, 5), facing=180.0, goals=(Goal(position=(0, -5)),)))
    simulation = crowd.Simulation(Scenario(world=GROUND, characters=people))
    nearest = np.inf
    for _ in simulation.run(seconds=12.0):
        nearest = min(nearest, np.linalg.norm(np.subtract(*simulation.state.position_world)))
    assert simulation.is_finished
    assert nearest > 0.45


def test_a_flow_brings_people_in_at_its_rate_and_takes_them_out():
    flow = Flow(
        source=Area(x=(-2, 2), z=(-6, -4)),
        rate=1.0,
        limit=5,
        most_present=3,
        goals=(Goal(position=(0, 1)),),
        speed=1.5,
    )
    simulation = crowd.Simulation(Scenario(world=GROUND, flows=(flow,)))
    present = [int(simulation.state.is_active.sum()) for _ in simulation.run(seconds=25.0)]
    assert max(present) <= 3
    assert simulation.state.spawn_count.sum() == 5
    assert present[-1] == 0
    assert simulation.is_finished


def test_discs_move_without_animation():
    simulation = run_one(walker(facing=180.0), 12.0, bodies="discs")
    assert simulation.is_finished
    assert simulation.state.locomotion_weight[0] == 0.0


def test_commands_change_what_people_do():
    simulation = crowd.Simulation(Scenario(world=GROUND, characters=(Character(position=(0, 0), facing=0),)))
    simulation.commands.set_locomotion(0, (1.0, 0.0, 0.0))
    for _ in simulation.run(seconds=3.0):
        pass
    assert 2.0 < simulation.state.position_world[0, 2] < 3.0
    simulation.commands.release(0)
    simulation.commands.set_goal(0, (0.0, 0.0))
    for _ in simulation.run(seconds=8.0):
        pass
    assert simulation.is_finished
    assert np.linalg.norm(simulation.state.position_world[0]) < 0.5
    hand = simulation.model.skeleton.joint("right_hand")
    simulation.commands.play(0, "wave")
    highest = max(simulation.joint_positions_world()[0, hand, 1] for _ in simulation.run(seconds=2.5))
    assert highest > 1.3, "a hand that waves is up"


@pytest.mark.parametrize(
    ("call", "error", "message"),
    [
        (lambda c: c.play(0, "wav"), MotionError, "wave"),
        (lambda c: c.play(0, "wave", seconds=-1), SettingsError, "positive"),
        (lambda c: c.set_goal(0, (np.nan, 0)), SettingsError, "finite"),
        (lambda c: c.set_goal(7, (0, 0)), SettingsError, "no such row"),
        (lambda c: c.set_goal(0, (100, 0)), SettingsError, "outside"),
        (lambda c: c.set_goal(0, (0, 0), radius=0), SettingsError, "positive"),
        (lambda c: c.set_locomotion(0, (np.inf, 0, 0)), SettingsError, "finite"),
    ],
)
def test_bad_commands_get_one_clear_line(call, error, message):
    simulation = crowd.Simulation(Scenario(world=GROUND, characters=(walker(),)))
    with pytest.raises(error, match=message) as caught:
        call(simulation.commands)
    assert isinstance(caught.value, CrowdError)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("how", "message"),
    [
        (
            {"seed": 2**70},
            "seed: is out of range; got 1180591620717411303424; allowed -9223372036854775808 to",
        ),
        ({"seed": "a"}, "seed: is no whole number; got 'a'; allowed a whole number"),
        ({"seed": 1.5}, "seed: is no whole number; got '1.5'"),
        ({"seed": True}, "seed: is no whole number; got 'True'"),
        ({"seed": 10**5000}, "seed: is out of range; got 'a whole number of 16610 bits'; allowed -92233"),
        ({"seed": [10**5000]}, "seed: is no whole number; got 'list with a number too long to show'"),
        ({"bodies": "disks"}, 'bodies: is unknown; got \'disks\'; allowed "discs", "people"'),
        ({"threads": 0}, "threads: is out of range; got 0; allowed 1 to"),
        ({"threads": 1.5}, "threads: is no whole number; got '1.5'; allowed a whole number"),
        ({"threads": "2"}, "threads: is no whole number; got '2'"),
        ({"characters": 2.5}, "characters: is no whole number; got '2.5'"),
        ({"characters": 10**400}, "characters: is out of range; got 'a whole number of 1329 bits'"),
        (
            {"scenario": "plaza"},
            "scenario: is no scenario; got \"'plaza'\"; allowed what crowd.load_scenario",
        ),
    ],
)
def test_wrong_arguments_of_a_simulation_are_one_line(how, message):
    scenario = how.pop("scenario", Scenario(world=GROUND, characters=(walker(),)))
    with pytest.raises(SettingsError) as caught:
        crowd.Simulation(scenario, **how)
    assert str(caught.value).startswith(message)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("seconds", "what"),
    [
        (float("nan"), "seconds are out of range; got nan"),
        (float("inf"), "seconds are out of range; got inf"),
        (-1.0, "seconds are out of range; got -1.0"),
        (1e9, "seconds are out of range; got 1000000000.0"),
        (10**400, "seconds is too large; got 'a whole number of 1329 bits'"),
        pytest.param(10**5000, "seconds is too large; got 'a whole number of 16610 bits'", id="unwritable"),
        ([10**5000], "seconds is not a number; got 'list with a number too long to show'"),
        ((10**5000, "a"), "seconds is not a number; got 'tuple with a number too long to show'"),
        ("1", "seconds is not a number; got '1'"),
        (True, "seconds is not a number; got 'True'"),
        (np.True_, "seconds is not a number; got 'True'"),
        (1j, "seconds is not a number; got '1j'"),
        (np.complex128(1), "seconds is not a number; got '(1+0j)'"),
        ([1.0], "seconds is not a number; got '[1.0]'"),
        (np.ones((2, 2)), "seconds is not a number; got '[[1. 1.] [1. 1.]]'"),
    ],
)
def test_a_length_that_cannot_be_run_is_refused(seconds, what):
    simulation = crowd.Simulation(Scenario(world=GROUND, characters=(walker(),)))
    with pytest.raises(SettingsError) as caught:
        next(simulation.run(seconds=seconds))
    assert str(caught.value).startswith(f"run: {what}")
    assert str(caught.value).endswith("; allowed 0 to 86400 s")
    assert len(str(caught.value).splitlines()) == 1
    assert simulation.time == 0.0


@pytest.mark.parametrize("seconds", [0, 0.0, np.float32(0.0), np.array(0.0)])
def test_a_run_of_no_length_has_no_step(seconds):
    simulation = crowd.Simulation(Scenario(world=GROUND, characters=(walker(),)))
    assert not list(simulation.run(seconds=seconds))


def test_joints_hang_together_and_rotations_are_unit():
    simulation = run_one(walker(), 2.0)
    skeleton = simulation.model.skeleton
    position = simulation.joint_positions_world()[0]
    scale = simulation.model.people.segment_scale[0, skeleton.segment]
    for joint in range(1, skeleton.joint_count):
        length = np.linalg.norm(position[joint] - position[skeleton.parent[joint]])
        assert length == pytest.approx(np.linalg.norm(skeleton.offset[joint]) * scale[joint], abs=1e-4)
    np.testing.assert_allclose(np.linalg.norm(simulation.joint_rotations_local()[0], axis=1), 1, atol=1e-5)
    assert position[skeleton.joint("head"), 1] > 1.3
    assert abs(position[:, 1].min()) < 0.06
