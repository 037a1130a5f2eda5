"""People who look at points, at each other and at objects, in whole runs."""

import numpy as np
import pytest

import crowd
from crowd.bench.sweep import MOST_ACCELERATION_RATIO, largest_acceleration, look_about
from crowd.controllers.gaze import Gaze
from crowd.controllers.gaze_settings import GazeSettings, GlanceSettings
from crowd.errors import SettingsError
from crowd.motion.clip import ClipKind
from crowd.scenario.object_table import ObjectTable
from crowd.scenario.schema import Area, Character, Goal, Region, Scenario, WorldTable
from crowd_kernels.gaze import ON_TARGET, REFUSED

GROUND = WorldTable(bounds=Area(x=(-20, 20), z=(-20, 20)))


def eye_misses(simulation, character, target):
    """Angles between the rays of both eyes as drawn and a target, degrees."""
    skeleton, joints, state = simulation.model.skeleton, simulation.joints, simulation.state
    places, misses = simulation.joint_positions_world(), []
    for name in ("left_eye", "right_eye"):
        joint = skeleton.joint(name)
        w, x, y, z = joints.rotation_model[character, joint].astype(float)
        ray = np.array([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)])
        sine, cosine = np.sin(state.yaw[character]), np.cos(state.yaw[character])
        ray = np.array([cosine * ray[0] + sine * ray[2], ray[1], cosine * ray[2] - sine * ray[0]])
        way = target - places[character, joint]
        misses.append(np.degrees(np.arccos(min(ray @ way / np.linalg.norm(way) / np.linalg.norm(ray), 1.0))))
    return misses


def pair(**options):
    """Somebody who stands, and somebody who walks past in front."""
    people = (
        Character(position=(0, 0), facing=0),
        Character(position=(-3, 3), facing=90, goals=(Goal(position=(4, 3)),)),
    )
    return crowd.Simulation(Scenario(world=GROUND, characters=people), seed=4, **options)


def test_eyes_as_drawn_meet_a_point_also_while_walking():
    simulation = pair()
    target = np.array([2.0, 0.8, 5.0])
    simulation.commands.set_attention([0, 1], "none")
    simulation.commands.look_at([0, 1], target)
    for frame in simulation.run(seconds=2.5):
        if frame.time > 1.2:
            # The foot locks lower the pelvis a little after the gaze.
            assert max(eye_misses(simulation, 0, target)) < 1.0
            assert max(eye_misses(simulation, 1, target)) < 1.0
    assert simulation.state.gaze_status.tolist() == [ON_TARGET, ON_TARGET]
    simulation.commands.look_away([0, 1])
    for _ in simulation.run(seconds=2.5):
        pass
    assert not simulation.state.gaze_turn[simulation.state.gaze_kind == 0].any()


def test_the_eyes_of_somebody_who_walks_past_are_followed():
    simulation = pair()
    simulation.commands.set_attention(0, "none")
    simulation.commands.look_at(0, character=1)
    skeleton = simulation.model.skeleton
    eyes = [skeleton.joint("left_eye"), skeleton.joint("right_eye")]
    for frame in simulation.run(seconds=4.0):
        if frame.time > 1.0:
            target = simulation.joint_positions_world()[1, eyes].mean(axis=0)
            assert max(eye_misses(simulation, 0, target)) < 1.0
    assert simulation.state.gaze_status[0] == ON_TARGET


@pytest.mark.parametrize("dt", [1 / 30, 1 / 60])
@pytest.mark.parametrize("walks", [False, True])
@pytest.mark.parametrize(
    ("low", "high"),
    [((-40.0, 0.0), (40.0, 0.0)), ((10.0, -25.0), (10.0, 20.0)), ((30.0, 15.0), (-30.0, -20.0))],
)
def test_eyes_stay_on_an_object_that_moves_thirty_degrees_a_second(dt, walks, low, high):
    goals = (Goal(position=(0, 15)),) if walks else ()
    ball = ObjectTable(name="ball", shape="sphere", radius=0.05, position=(0, 1.6, 3))
    people = (Character(position=(0, 0), facing=0, goals=goals),)
    simulation = crowd.Simulation(Scenario(world=GROUND, characters=people, objects=(ball,), dt=dt), seed=4)
    state, eye = simulation.state, simulation.model.skeleton.joint("left_eye")
    simulation.commands.set_attention(0, "none")
    simulation.commands.look_at(0, object="ball")
    low, high = np.radians(low), np.radians(high)
    length = np.degrees(np.linalg.norm(high - low)) / 30.0
    worst = 0.0
    for frame in simulation.run(seconds=1.0 + 4.0 * length):
        if frame.time > 1.0:
            worst = max(worst, *eye_misses(simulation, 0, simulation.objects.position_world[0]))
        share = max(frame.time + dt - 1.0, 0.0) / length % 2.0
        side, up = low + min(share, 2.0 - share) * (high - low)
        way = [np.sin(side) * np.cos(up), np.sin(up), np.cos(side) * np.cos(up)]
        height = simulation.joint_positions_world()[0, eye, 1]
        centre = state.position_world[0] + [0.0, height, 0.0]
        simulation.objects.position_world[0] = centre + 3.0 * np.array(way)
    assert worst < 1.0
    assert state.gaze_status[0] == ON_TARGET


def test_what_cannot_be_looked_at_is_refused_by_a_status():
    simulation = pair()
    simulation.commands.look_at(0, (np.nan, 1, 1))
    simulation.commands.look_at(1, character=1)
    for _ in simulation.run(seconds=0.5):
        pass
    assert simulation.state.gaze_status.tolist() == [REFUSED, REFUSED]
    assert np.isfinite(simulation.joint_positions_world()).all()
    assert not np.isnan(simulation.state.gaze_turn).any()


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda c: c.look_at(0), "exactly one target"),
        (lambda c: c.look_at(0, (0, 1, 2), character=1), "point and character"),
        (lambda c: c.look_at(0, (0, 1)), "shape"),
        (lambda c: c.look_at(0, character=9), "no such row"),
        (lambda c: c.look_at(0, object=0), "no objects"),
        (lambda c: c.look_at(0, object="cup"), "no object has this name"),
        (lambda c: c.look_at(0, (0, 1, 2), trunk=2), "0 to 1"),
        (lambda c: c.set_attention(0, "talkative"), "talking"),
    ],
)
def test_bad_commands_get_one_clear_line(call, message):
    with pytest.raises(SettingsError, match=message) as caught:
        call(pair().commands)
    assert "\n" not in str(caught.value)


def square(count=60):
    area = Area(x=(-7, 7), z=(-7, 7))
    return Scenario(
        world=GROUND,
        regions=(Region(count=count, area=area, goals=(Goal(area=area, radius=0.6),), repeat=True),),
    )


def test_people_glance_at_each_other_now_and_then_and_only_forwards():
    simulation = crowd.Simulation(square(), seed=2)
    state, glances, seen = simulation.state, [], set()
    for _ in simulation.run(seconds=12.0):
        glances.append(state.is_glancing.mean())
        for character in np.flatnonzero(state.is_glancing):
            seen.add((character, int(state.gaze_index[character])))
    assert 0.05 < np.mean(glances) < 0.5
    assert len(seen) > 60
    assert (state.gaze_kind[state.is_glancing] == 2).all()


def test_a_wanted_gaze_replaces_a_glance_and_is_not_replaced():
    simulation = crowd.Simulation(square(), seed=2)
    for _ in simulation.run(seconds=5.0):
        pass
    simulation.commands.look_at(slice(None), (0.0, 1.5, 0.0))
    for _ in simulation.run(seconds=5.0):
        assert not simulation.state.is_glancing.any()
        assert (simulation.state.gaze_kind == 1).all()


def test_looking_changes_neither_ways_nor_other_choices():
    runs = []
    for is_on in (True, False):
        simulation = crowd.Simulation(square(), seed=2)
        simulation.gaze.may_glance[:] = is_on
        for _ in simulation.run(seconds=4.0):
            pass
        runs.append(simulation)
    for field in ("position_world", "yaw", "phase", "idle_clip", "idle_until", "foot_point_world"):
        one, other = (getattr(run.state, field) for run in runs)
        np.testing.assert_allclose(one, other, atol=0 if field != "foot_point_world" else 1e-12)
    assert (runs[0].state.pose_rotation != runs[1].state.pose_rotation).any()


def test_glances_can_be_switched_off_by_settings():
    simulation = crowd.Simulation(square(), seed=2)
    quiet = GazeSettings(glances=GlanceSettings(is_on=False))
    gaze = Gaze(
        simulation.model.skeleton, simulation.state.capacity, simulation.navigator.avoidance, settings=quiet
    )
    simulation.controllers = (*simulation.controllers[:-1], gaze)
    for _ in simulation.run(seconds=5.0):
        assert not simulation.state.is_glancing.any()


def test_a_scenario_tells_who_looks_where():
    person = Character(position=(0, 0), facing=0)
    people = (
        person.model_copy(update={"look_at": (1.0, 1.4, 2.0)}),
        person.model_copy(update={"position": (2, 0), "glances": False, "attention": "none"}),
        person.model_copy(update={"position": (2, 2.5), "facing": 180.0, "attention": "talking"}),
    )
    simulation = crowd.Simulation(Scenario(world=GROUND, characters=people), seed=1)
    state, glanced = simulation.state, np.zeros(3, bool)
    for _ in simulation.run(seconds=30.0):
        glanced |= state.is_glancing
    assert glanced.tolist() == [False, False, True]
    assert state.gaze_status[0] == ON_TARGET
    np.testing.assert_array_equal(state.gaze_target_world[0], (1.0, 1.4, 2.0))
    assert state.saccade_mode.tolist() == [0, 255, 1]
    assert not state.saccade_offset[1].any()


def looking(**options):
    """A square full of people, some of whom look at points, at others, and away again."""
    simulation = crowd.Simulation(square(), seed=2, **options)
    simulation.commands.look_at(slice(0, 20), (0.0, 1.2, 0.0))
    simulation.commands.look_at(np.arange(20, 40), character=np.arange(19, -1, -1))
    return simulation


def gaze_of(simulation):
    return {name: getattr(simulation.state, name).copy() for name in (*Gaze.state_fields, "pose_rotation")}


def test_equal_bits_on_two_threads_and_after_a_stop(tmp_path):
    one, two = looking(is_threaded=False), looking(threads=2, is_threaded=True)
    for simulation in (one, two):
        for frame in simulation.run(seconds=3.0):
            if abs(frame.time - 1.5) < 1e-6:
                simulation.save(tmp_path / "stop.npz")
            if abs(frame.time - 2.0) < 1e-6:
                simulation.commands.look_away(slice(0, 10))
    other = looking(is_threaded=False)
    other.restore(tmp_path / "stop.npz")
    for frame in other.run(seconds=1.5):
        if abs(frame.time - 2.0) < 1e-6:
            other.commands.look_away(slice(0, 10))
    wanted = gaze_of(one)
    assert (wanted["gaze_status"] > 0).sum() > 30
    for simulation in (two, other):
        for name, array in gaze_of(simulation).items():
            np.testing.assert_array_equal(array, wanted[name], err_msg=name)


def test_somebody_who_looks_at_a_point_still_nods():
    depths = []
    for looks in (False, True):
        simulation = pair()
        simulation.gaze.may_glance[:] = False
        simulation.commands.set_attention(0, "none")
        if looks:
            simulation.commands.look_at(0, (0.0, 1.6, 3.0))
        for _ in simulation.run(seconds=2.0):
            pass
        simulation.commands.play(0, "nod")
        head = simulation.model.skeleton.joint("head")
        ahead = []
        for _ in simulation.run(seconds=2.0):
            w, x, y, z = simulation.joints.rotation_model[0, head].astype(float)
            ahead.append(np.degrees(np.arcsin(2 * (y * z - w * x))))
            if looks:
                assert max(eye_misses(simulation, 0, np.array([0.0, 1.6, 3.0]))) < 1.0
        depths.append(np.ptp(ahead))
    assert depths[1] > 0.75 * depths[0] > 3.0


def test_nothing_pops_when_targets_come_jump_and_go():
    library = pair().model.library
    examples = max(
        largest_acceleration(clip.rotation_local[:, None], clip.frame_rate)
        for clip in library.clips
        if clip.kind is ClipKind.LOCOMOTION
    )
    assert look_about(None, 5.0, 12) < MOST_ACCELERATION_RATIO * examples


def test_heads_start_and_stop_softly():
    simulation = crowd.Simulation(square(16), seed=3)
    head = [simulation.model.skeleton.joint(name) for name in ("neck_1", "neck_2", "head")]
    rotations = []
    for frame in simulation.run(seconds=6.0):
        if frame.index % 45 == 20:
            step = frame.index // 45
            simulation.commands.look_at(
                slice(None), (9.0 * (-1) ** step, 1.0 + step % 3, 4.0 * (-1) ** (step // 2))
            )
        rotations.append(simulation.joint_rotations_local()[:, head])
    # Without gaze the necks of people who turn round suddenly reach 61 rad/s^2.
    assert largest_acceleration(np.array(rotations)[10:], 60.0) < 110.0
