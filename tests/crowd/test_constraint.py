"""Hands stay where they are held while gaze and feet disturb the pose; holds come and go without a jump."""

import numpy as np
import pytest

from crowd.errors import SettingsError
from crowd.motion.rotation import about, multiply
from crowd.scenario.schema import Area, Character, Goal, Scenario, WorldTable
from crowd.simulation import Simulation
from crowd_kernels.ik import OUT_OF_REACH, REACHED, REFUSED

COUNT = 8
EVERYONE = np.arange(COUNT)
HANDS = ("right_hand", "left_hand")


def standing_people(goals=(), **options):
    characters = tuple(
        Character(position=(-8.0 + 2.0 * i, 0.0), facing=20.0 * i, goals=goals) for i in range(COUNT)
    )
    world = WorldTable(bounds=Area(x=(-12.0, 12.0), z=(-12.0, 12.0)))
    simulation = Simulation(Scenario(name="held", world=world, characters=characters), seed=3, **options)
    for _ in range(60):
        simulation.step()
    return simulation


def hands(simulation):
    """World places (N, 2, 3) and rotations (N, 2, 4) of both hands."""
    joints = [simulation.model.skeleton.joint(name) for name in HANDS]
    facing = about(1, simulation.state.yaw)[:, None]
    rotation = multiply(facing, simulation.joints.rotation_model[:, joints].astype(float))
    return simulation.joint_positions_world()[:, joints], rotation


def hold_hands(simulation):
    place, rotation = hands(simulation)
    for hand, name in enumerate(HANDS):
        simulation.constraint.hold(simulation.state, EVERYONE, name, place[:, hand], rotation[:, hand])
    return place, rotation


def sweep_gaze(simulation, each_step, seconds=0.5, hold_seconds=0.5):
    """Let everyone's point of gaze run from straight ahead to 90 degrees at the left."""
    steps = round(seconds / simulation.dt)
    eyes = simulation.joint_positions_world()[:, simulation.model.skeleton.joint("head")]
    yaw = simulation.state.yaw.copy()
    for step in range(steps + round(hold_seconds / simulation.dt)):
        heading = yaw + np.radians(90.0) * min(1.0, step / steps)
        ahead = np.stack([np.sin(heading), np.zeros(COUNT), np.cos(heading)], axis=1)
        simulation.commands.look_at(EVERYONE, eyes + 3.0 * ahead)
        simulation.step()
        each_step(simulation)


def largest_angle(a, b):
    return np.degrees((2 * np.arccos(np.clip(np.abs((a * b).sum(axis=-1)), 0, 1))).max())


def test_both_hands_stay_within_a_millimetre_while_the_gaze_sweeps_a_right_angle_in_half_a_second():
    moved, turned = [], []
    free, held = standing_people(), standing_people()
    start, _ = hands(free)
    place, rotation = hold_hands(held)
    for _ in range(30):
        held.step()
    sweep_gaze(free, lambda s: moved.append(np.linalg.norm(hands(s)[0] - start, axis=2).max()))
    assert max(moved) > 0.05, "gaze disturbs hands that are not held"
    moved.clear()

    def note(simulation):
        now, frame = hands(simulation)
        moved.append(np.linalg.norm(now - place, axis=2).max())
        turned.append(largest_angle(frame, rotation))

    sweep_gaze(held, note)
    assert max(moved) < 1e-3
    assert max(turned) < 1.0
    assert (held.state.constraint_status[:, :2] == REACHED).all()
    head = held.model.skeleton.joint("head")
    same = np.abs((free.joints.rotation_model[:, head] * held.joints.rotation_model[:, head]).sum(axis=1))
    assert np.degrees(2 * np.arccos(np.clip(same.min(), -1, 1))) < 5, "people look where they did"


def test_holds_come_and_go_without_a_jump():
    simulation = standing_people()
    place, _ = hands(simulation)
    poses = []
    target = place[:, 0] + (0.0, 0.25, 0.0)
    for step in range(120):
        if step == 10:
            simulation.constraint.hold(simulation.state, EVERYONE, 0, target)
        if step == 60:
            assert np.abs(hands(simulation)[0][:, 0] - target).max() < 1e-3
            simulation.constraint.release(simulation.state, EVERYONE, 0)
        simulation.step()
        poses.append(hands(simulation)[0][:, 0].copy())
    velocity = np.diff(poses, axis=0) / simulation.dt
    assert np.linalg.norm(velocity, axis=2).max() < 3.5
    assert (simulation.state.constraint_weight == 0).all()
    free = standing_people()
    for _ in range(120):
        free.step()
    np.testing.assert_array_equal(simulation.state.pose_rotation, free.state.pose_rotation)


def test_targets_out_of_reach_are_approached_without_jitter_and_bad_ones_refused():
    simulation = standing_people()
    place, _ = hands(simulation)
    target = place[:, 0] + (0.0, 0.5, 3.0)
    target[3] = np.nan
    simulation.constraint.hold(simulation.state, EVERYONE, "right_hand", target)
    poses = []
    moved = simulation.constraint.tree.joint[simulation.constraint.tree.moves[0] > 0]
    for step in range(120):
        simulation.step()
        if step >= 60:
            poses.append(simulation.joint_rotations_local()[:, moved])
    status = simulation.state.constraint_status[:, 0]
    assert status[3] == REFUSED
    assert (np.delete(status, 3) == OUT_OF_REACH).all()
    assert np.isfinite(poses).all()
    steps = [largest_angle(a, b) for a, b in zip(poses[1:], poses[:-1], strict=True)]
    assert max(steps) < 0.6, "degrees in a frame, with breathing and glances"


def test_what_the_layers_below_did_can_be_held_every_step():
    simulation = standing_people()
    controller = simulation.constraint
    place = simulation.controllers.index(simulation.gaze)
    below, above = simulation.controllers[:place], simulation.controllers[place:]

    class Holding:
        state_fields = ()

        def activate(self, state, characters):
            pass

        def evaluate(self, step):
            controller.hold_here(step, step.active, "right_hand")

    simulation.controllers = (*below, Holding(), *above)
    for _ in range(30):
        simulation.step()
    start, _ = hands(simulation)
    moved = []
    sweep_gaze(
        simulation, lambda s: moved.append(np.linalg.norm(hands(s)[0][:, 0] - start[:, 0], axis=1).max())
    )
    assert max(moved) < 0.02, "only what idle motion does"


def test_a_hand_that_reached_stays_at_its_target_under_gaze_and_goes_home_afterwards():
    simulation = standing_people()
    yaw = simulation.state.yaw
    side = np.stack([np.cos(yaw), np.zeros(COUNT), -np.sin(yaw)], axis=1)
    ahead = np.stack([np.sin(yaw), np.zeros(COUNT), np.cos(yaw)], axis=1)
    target = simulation.state.position_world + 0.45 * ahead - 0.15 * side + (0.0, 1.2, 0.0)
    simulation.reach.start(simulation.state, EVERYONE, 0, target)
    for _ in range(150):
        simulation.step()
    missed = []
    sweep_gaze(simulation, lambda s: missed.append(np.linalg.norm(hands(s)[0][:, 0] - target, axis=1).max()))
    assert max(missed) < 1.5e-3, "1 mm for the reach and 0.5 mm for the hold"
    simulation.reach.end(simulation.state, EVERYONE, 0)
    places = []
    for _ in range(240):
        simulation.step()
        places.append(hands(simulation)[0][:, 0].copy())
    assert (simulation.state.constraint_weight == 0).all()
    acceleration = np.diff(places, 2, axis=0) / simulation.dt**2
    assert np.linalg.norm(acceleration, axis=2).max() < 40.0


@pytest.mark.parametrize("is_threaded", [False, True])
def test_runs_with_holds_repeat_bit_for_bit_after_a_checkpoint(tmp_path, is_threaded):
    goals = (Goal(position=(0.0, 8.0)),)
    first, second = (standing_people(goals, is_threaded=is_threaded) for _ in range(2))
    hold_hands(first)
    for _ in range(5):
        first.step()
    first.save(tmp_path / "state.npz")
    second.restore(tmp_path / "state.npz")
    serial = standing_people(goals, is_threaded=False)
    serial.restore(tmp_path / "state.npz")
    for _ in range(10):
        for simulation in (first, second, serial):
            simulation.step()
    for other in (second, serial):
        np.testing.assert_array_equal(first.state.pose_rotation, other.state.pose_rotation)
        np.testing.assert_array_equal(first.state.constraint_weight, other.state.constraint_weight)


def test_unknown_effectors_are_named():
    simulation = standing_people()
    with pytest.raises(SettingsError, match="right_hand"):
        simulation.constraint.hold(simulation.state, 0, "right_hnd", (0.0, 1.0, 0.0))
    with pytest.raises(SettingsError, match="0 to 2"):
        simulation.constraint.release(simulation.state, 0, 7)
