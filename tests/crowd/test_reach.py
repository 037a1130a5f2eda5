"""Reaching people: hands come to targets and stay there, nothing jumps, left mirrors right."""

import numpy as np
import pytest

import crowd
from crowd.bench.reachers import Reachers
from crowd.controllers.reach import require_lanes
from crowd.errors import MotionError, SettingsError
from crowd.motion.rotation import conjugate, multiply, to_vector
from crowd.scenario.object_table import ObjectTable
from crowd.scenario.schema import Area, Character, Goal, Scenario, WorldTable
from crowd_kernels.reach_correction import LANES

GROUND = WorldTable(bounds=Area(x=(-20, 20), z=(-20, 20)))
FRAMES = 90


def standing(count=1, **keys):
    people = tuple(
        Character(position=(2.0 * k - count, 0.0), facing=0.0, height=1.75, **keys) for k in range(count)
    )
    return Scenario(name="stand", world=GROUND, characters=people)


def run(reachers, frames):
    """Step and gather hands (F, N, 2, 3) and rotations (F, N, J, 4)."""
    hands, rotations = [], []
    for _ in range(frames):
        reachers.step()
        hands.append(np.stack([reachers.hand(0)[0], reachers.hand(1)[0]], axis=1))
        rotations.append(reachers.local_rotations())
    return np.array(hands), np.array(rotations)


def accelerations(rotations, dt=1 / 60):
    turn = to_vector(multiply(conjugate(rotations[:-1]), rotations[1:])) / dt
    return np.linalg.norm(np.diff(turn, axis=0) / dt, axis=-1)


def targets(reachers, hand, rng):
    point = reachers.space.pseudo[hand].point
    count = len(reachers.rows)
    return (point[rng.integers(0, len(point), count)] + rng.normal(0, 0.01, (count, 3))) * reachers.size[
        :, None
    ]


@pytest.fixture
def reachers():
    made = Reachers(48, seed=2)
    run(made, 3)
    return made


@pytest.mark.parametrize("hand", [0, 1])
def test_hands_reach_hold_and_return(reachers, hand, rng):
    wanted = targets(reachers, hand, rng)
    reachers.reach(hand, wanted)
    state = reachers.simulation.state
    hands, rotations = run(reachers, FRAMES)
    assert (state.reach_status[:, hand] == 2).all()
    assert (state.reach_stage[:, hand] == 2).all()
    assert np.linalg.norm(hands[-1, :, hand] - wanted, axis=1).max() < 1e-3
    reachers.simulation.reach.end(state, reachers.rows, hand)
    _, more = run(reachers, 110)
    assert (state.reach_stage == 0).all()
    assert (state.reach_status == 0).all()
    assert accelerations(np.concatenate([rotations, more])).max() < 65.0


def test_the_hand_arrives_at_the_time_that_is_asked(reachers, rng):
    wanted = targets(reachers, 0, rng)
    reachers.reach(0, wanted)
    reachers.simulation.state.reach_seconds[:, 0] = 0.8
    hands, _ = run(reachers, 48)
    assert np.linalg.norm(hands[-1, :, 0] - wanted, axis=1).max() < 1e-3
    assert np.linalg.norm(hands[-6, :, 0] - wanted, axis=1).max() > 2e-3


def test_both_hands_reach_at_once(reachers, rng):
    right = np.array([-0.25, 1.1, 0.45]) * reachers.size[:, None]
    left = np.array([0.30, 1.3, 0.40]) * reachers.size[:, None]
    reachers.reach(0, right)
    hands, before = run(reachers, 20)
    reachers.reach(1, left)
    hands, rotations = run(reachers, FRAMES)
    assert np.linalg.norm(hands[-1, :, 0] - right, axis=1).max() < 1e-3
    assert np.linalg.norm(hands[-1, :, 1] - left, axis=1).max() < 1e-3
    assert (reachers.simulation.state.reach_status == 2).all()
    assert accelerations(np.concatenate([before, rotations])).max() < 80.0


def test_a_new_target_while_holding_is_reached_without_returning(reachers, rng):
    first = np.array([-0.45, 1.2, 0.40]) * reachers.size[:, None]
    second = np.array([0.15, 1.3, 0.50]) * reachers.size[:, None]
    reachers.reach(0, first)
    run(reachers, FRAMES)
    reachers.reach(0, second)
    hands, rotations = run(reachers, 60)
    path = hands[:, :, 0]
    assert np.linalg.norm(path[-1] - second, axis=1).max() < 1e-3
    # Nearer to one of the two than a return to rest would be, and around the body.
    assert path[..., 1].min() > 0.9
    assert np.hypot(path[..., 0], path[..., 2]).min() > 0.3
    speed = np.linalg.norm(np.diff(path, axis=0), axis=2).max() * 60
    assert 1.2 < speed < 2.8
    assert accelerations(rotations).max() < 65.0


def test_targets_may_move_and_jump_on_the_way(reachers, rng):
    start = np.array([-0.35, 1.2, 0.45])
    reachers.reach(0, start * reachers.size[:, None])
    state = reachers.simulation.state
    rotations, hands = [], []
    for frame in range(150):
        drift = np.array([0.10 * min(frame, 120) / 60, 0.0, 0.0])
        jump = np.array([0.15, 0.2, 0.0]) if frame > 20 else 0.0
        wanted = (start + drift + jump) * reachers.size[:, None]
        sine, cosine = np.sin(state.yaw), np.cos(state.yaw)
        state.reach_target_world[:, 0] = state.position_world + np.stack(
            [
                cosine * wanted[:, 0] + sine * wanted[:, 2],
                wanted[:, 1],
                cosine * wanted[:, 2] - sine * wanted[:, 0],
            ],
            axis=1,
        )
        reachers.step()
        rotations.append(reachers.local_rotations())
        hands.append(np.linalg.norm(reachers.hand(0)[0] - wanted, axis=1).max())
    assert max(hands[90:118]) < 1e-3, "the hand stays with the moving target"
    assert hands[-1] < 1e-3
    assert accelerations(np.array(rotations)).max() < 70.0


def test_turning_back_half_way_is_smooth(reachers, rng):
    wanted = targets(reachers, 0, rng)
    reachers.reach(0, wanted)
    _, first = run(reachers, 30)
    reachers.simulation.reach.end(reachers.simulation.state, reachers.rows, 0)
    _, second = run(reachers, 20)
    reachers.reach(0, wanted)
    hands, third = run(reachers, FRAMES)
    assert np.linalg.norm(hands[-1, :, 0] - wanted, axis=1).max() < 1e-3
    assert accelerations(np.concatenate([first, second, third])).max() < 130.0


def test_far_targets_are_approached_without_jitter_and_reported(reachers, rng):
    wanted = np.array([-0.6, 1.5, 1.6]) * np.ones((len(reachers.rows), 1))
    reachers.reach(0, wanted)
    run(reachers, FRAMES)
    state = reachers.simulation.state
    assert (state.reach_status[:, 0] == 3).all()
    frozen = state.idle_time.copy()
    hands, _ = run(reachers, 10)
    assert (frozen != state.idle_time).any()
    assert np.linalg.norm(np.diff(hands[:, :, 0], axis=0), axis=2).max() < 1e-4
    assert hands[-1, :, 0, 2].min() > 0.5


def test_bad_targets_are_refused_and_the_pose_stays_sound(reachers):
    state, good = reachers.simulation.state, np.array([-0.3, 1.2, 0.4])
    reachers.reach(0, good * reachers.size[:, None])
    run(reachers, FRAMES)
    for bad in (np.full(3, np.nan), np.full(3, np.inf)):
        state.reach_target_world[:, 0] = bad
        hands, _ = run(reachers, 5)
        assert (state.reach_status[:, 0] == 4).all()
        assert np.linalg.norm(hands[-1, :, 0] - good * reachers.size[:, None], axis=1).max() < 1e-3
    state.reach_target_world[:, 0] = state.position_world + np.array([0.0, 1.2, 0.0])
    run(reachers, 5)
    assert (state.reach_status[:, 0] == 4).all()
    assert np.isfinite(state.pose_rotation).all()
    reachers.simulation.reach.start(state, reachers.rows, 1, np.full(3, np.nan))
    run(reachers, 2)
    assert (state.reach_status[:, 1] == 4).all()
    assert (state.reach_stage[:, 1] == 0).all()


def test_left_is_the_mirror_of_right():
    mirrored = []
    for hand, sign in ((0, 1.0), (1, -1.0)):
        reachers = Reachers(12, seed=7)
        state = reachers.simulation.state
        point = reachers.space.pseudo[0].point
        rng = np.random.default_rng(3)
        wanted = point[rng.integers(0, len(point), 12)] * np.array([sign, 1.0, 1.0]) * reachers.size[:, None]
        state.idle_time[:] = 0.0
        reachers.reach(hand, wanted)
        run(reachers, FRAMES)
        mirrored.append(reachers.simulation.joints.position_model.copy() * [sign, 1.0, 1.0])
    skeleton = reachers.simulation.model.skeleton
    swap = [skeleton.joint(name) for name in skeleton.joint_names if "spine" in name or name == "pelvis"]
    np.testing.assert_allclose(mirrored[0][:, swap], mirrored[1][:, swap], atol=1e-4)
    right, left = skeleton.joint("right_forearm"), skeleton.joint("left_forearm")
    np.testing.assert_allclose(mirrored[0][:, right], mirrored[1][:, left], atol=1e-4)


def test_seated_people_keep_their_hips(reachers):
    state = reachers.simulation.state
    state.is_seated[:] = True

    wanted = np.array([-0.25, 1.15, 0.45]) * reachers.size[:, None]
    reachers.reach(0, wanted)
    legs = [reachers.simulation.model.skeleton.joint(f"{side}_thigh") for side in ("right", "left")]
    hands, _ = run(reachers, FRAMES)
    after_reach = state.pose_rotation.reshape(-1, 4, 64)[:, :, legs].copy()
    state.reach_stage[:] = 0
    reachers.index -= 1
    for array in (state.idle_time, state.idle_mix):
        assert np.isfinite(array).all()
    assert np.linalg.norm(hands[-1, :, 0] - wanted, axis=1).max() < 1e-3
    assert np.isfinite(after_reach).all()


def test_walking_people_reach_with_the_upper_body_alone():
    scenario = Scenario(
        name="walk",
        world=GROUND,
        characters=(Character(position=(0, -15), facing=0.0, goals=(Goal(position=(0.0, 15.0)),)),),
    )
    walker, reacher = (crowd.Simulation(scenario, seed=1) for _ in range(2))
    for _ in range(120):
        walker.step()
        reacher.step()
    assert reacher.state.locomotion_weight[0] > 0.99
    for frame in range(90):
        ahead = reacher.state.position_world[0] + np.array([-0.3, 1.2, 0.45])
        if frame == 0:
            reacher.commands.reach(0, ahead, "right")
        reacher.state.reach_target_world[0, 0] = ahead
        walker.step()
        reacher.step()
    assert reacher.state.reach_status[0, 0] == 2
    np.testing.assert_array_equal(walker.state.position_world, reacher.state.position_world)
    legs = [
        walker.model.skeleton.joint(f"{side}_{part}")
        for side in ("left", "right")
        for part in ("thigh", "foot")
    ]
    np.testing.assert_allclose(
        walker.joints.position_model[:, legs], reacher.joints.position_model[:, legs], atol=1e-5
    )


def reach_and_step(simulation, frames):
    if simulation.step_index == 0:
        place = simulation.state.position_world + np.array([0.3, 1.3, 0.4])
        simulation.commands.reach(slice(None), place, "left")
        simulation.commands.reach(slice(None), place - np.array([0.6, 0.5, 0.0]), "right", hold=0.3)
    for _ in range(frames):
        simulation.step()
    return {name: array.copy() for name, array in simulation.state.arrays()}


def test_equal_bits_on_one_and_two_threads_and_after_a_checkpoint(tmp_path):
    one = reach_and_step(crowd.Simulation(standing(9), seed=1, is_threaded=False), 100)
    two = reach_and_step(crowd.Simulation(standing(9), seed=1, threads=2, is_threaded=True), 100)
    half = crowd.Simulation(standing(9), seed=1)
    reach_and_step(half, 37)
    half.save(tmp_path / "half.h5")
    again = crowd.Simulation(standing(9), seed=1)
    again.restore(tmp_path / "half.h5")
    last = reach_and_step(again, 63)
    for name, array in one.items():
        np.testing.assert_array_equal(array, two[name], err_msg=name)
        np.testing.assert_array_equal(array, last[name], err_msg=name)


def test_commands_choose_the_hand_by_side_and_end():
    simulation = crowd.Simulation(standing(2), seed=0)
    place = simulation.state.position_world + np.array([[0.3, 1.2, 0.4], [-0.3, 1.2, 0.4]])
    simulation.commands.reach([0, 1], place)
    assert simulation.state.reach_stage.tolist() == [[0, 1], [1, 0]]
    for _ in range(FRAMES):
        simulation.step()
    assert simulation.state.reach_status.tolist() == [[0, 2], [2, 0]]
    simulation.commands.end_reach(slice(None))
    for _ in range(110):
        simulation.step()
    assert not simulation.state.reach_stage.any()


@pytest.mark.parametrize(
    ("keys", "part"),
    [
        ({"hand": "middle"}, "unknown hand; got 'middle'; allowed right, left or both"),
        ({"target_world": (1.0, 2.0)}, "target has the wrong shape"),
        ({"seconds": 0.0}, "seconds are out of range"),
        ({"hold": -1.0}, "hold is out of range"),
        ({"rotation_world": (1.0, 0.0)}, "rotation has the wrong shape"),
    ],
)
def test_commands_refuse_what_cannot_be(keys, part):
    simulation = crowd.Simulation(standing(1), seed=0)
    with pytest.raises(SettingsError) as caught:
        simulation.commands.reach(0, **({"target_world": (0.3, 1.2, 0.4)} | keys))
    assert part in str(caught.value)


def test_examples_are_ready_before_the_first_step_where_there_is_something_to_reach():
    ball = ObjectTable(shape="sphere", radius=0.04, position=(0.0, 1.0, 0.4))
    for objects in ((), (ball,)):
        scenario = Scenario(
            name="ready", world=GROUND, characters=(Character(position=(0, 0)),), objects=objects
        )
        assert (crowd.Simulation(scenario, seed=1).reach._space is not None) == bool(objects)


def test_too_many_joints_for_the_corrections_are_refused():
    require_lanes(LANES)
    with pytest.raises(MotionError, match="too many joints move the hands; got 33; allowed at most 32"):
        require_lanes(LANES + 1)
