"""Targets that hands and eyes cannot go to: a status, an event, and a pose like any other."""

import numpy as np
import pytest

import crowd
from crowd.bench.reach import LARGEST_RATIO
from crowd.bench.reachers import angular_motion
from crowd.controllers.grab import GrabStatus
from crowd.motion.rotation import conjugate, multiply
from crowd.motion.swing_twist import FINGERS, swing_twist_limits
from crowd.scenario.load import scenario_from
from crowd.scenario.source import ScenarioSource
from crowd.tasks import EventKind
from crowd_kernels import gaze, reach_state

NAN = float("nan")
INSIDE = (0.0, 1.2, 0.02)
BEHIND = (0.1, 1.2, 0.62)
BEFORE = (-0.2, 1.15, 0.35)
LEGS = ("thigh", "shank", "foot", "toe")
EXAMPLE_ACCELERATION = 50.0
"""Largest of any joint in the built-in reaches, rad/s^2."""
CLEAR = "obstacles are in the way from every place to stand"


def scene(dt, *, ball=BEFORE, tasks=(), walls=(((-3, 0.5), (3, 0.5)),), boxes=(), other=(2, -2)):
    """Somebody before a wall, somebody else, and a ball."""
    content = {
        "dt": dt,
        "world": {
            "bounds": {"x": [-5, 5], "z": [-5, 5]},
            "walls": [{"points": points} for points in walls],
            "boxes": list(boxes),
        },
        "objects": [{"name": "ball", "shape": "sphere", "radius": 0.035, "position": ball}],
        "characters": [
            {"position": [0, 0], "facing": 0, "height": 1.75, "tasks": list(tasks)},
            {"position": other, "facing": 0, "height": 1.75},
        ],
    }
    return crowd.Simulation(scenario_from(content, ScenarioSource()), threads=1)


def beyond_limits(simulation):
    """How far joints are beyond their limits: share of the swing ellipse, or rad of twist.

    Without fingers, which close by limits of their own (see `test_hand`).
    """
    skeleton = simulation.model.skeleton
    limits, is_limited = swing_twist_limits(skeleton)
    is_limited[[any(finger in name for finger in ("thumb", *FINGERS)) for name in skeleton.joint_names]] = 0
    rotation = simulation.joint_rotations_local().astype(float)
    inner = multiply(
        conjugate(limits.parent_frame.astype(float)), multiply(rotation, limits.joint_frame.astype(float))
    )
    inner *= np.where(inner[..., :1] < 0, -1.0, 1.0)
    w, x, y, z = np.moveaxis(inner, -1, 0)
    swing = np.stack([x * w - y * z, y * w + x * z], axis=-1) / np.hypot(w, z)[..., None]
    beyond = np.linalg.norm(swing * limits.inverse_swing, axis=-1) - 1
    twist, (low, high) = 2 * np.arctan2(z, w), 2 * np.arctan(limits.twist.astype(float)).T
    turned = np.where(limits.is_free[:, 2] > 0, np.maximum(twist - high, low - twist), -1.0)
    return float(np.maximum(beyond, turned)[:, is_limited > 0].max())


def watch(simulation, seconds, until=lambda: False, poses=None):
    """Run, and look at every pose; keep those of trunk and arms, which reach, if wanted."""
    names = np.array(simulation.model.skeleton.joint_names)
    joints = simulation.reach.space.keys.joint
    joints = joints[[not any(part in name for part in LEGS) for name in names[joints]]]
    for _ in simulation.run(seconds=seconds):
        if poses is not None:
            poses.append(simulation.joint_rotations_local()[:, joints])
        assert np.isfinite(simulation.state.pose_rotation).all()
        assert np.isfinite(simulation.joint_positions_world()).all()
        assert beyond_limits(simulation) < 0.01
        if until():
            return


def told(simulation):
    return [(event.kind.value, event.character, event.task, event.detail) for event in simulation.events]


def hand_place(simulation, side="right"):
    return simulation.joint_positions_world()[0, simulation.model.skeleton.joint(f"{side}_hand")]


both_rates = pytest.mark.parametrize("dt", [1 / 30, 1 / 60])


@both_rates
@pytest.mark.parametrize(
    ("target", "rotation", "detail"),
    [
        ((NAN, 1.0, 0.3), None, "the target is not finite"),
        ((0.1, float("inf"), 0.3), None, "the target is not finite"),
        (INSIDE, None, "the target is inside the body"),
        (BEHIND, None, "a wall is in the way"),
        (BEFORE, (0.0, 0.0, 0.0, 0.0), "the rotation is none"),
        (BEFORE, (NAN, 0.0, 0.0, 1.0), "the rotation is none"),
    ],
)
def test_bad_reaches_are_refused_from_rest_and_on_the_way(dt, target, rotation, detail):
    simulation, poses = scene(dt), []
    state, commands = simulation.state, simulation.commands
    watch(simulation, 0.3, poses=poses)
    commands.reach(0, target, "right", rotation_world=rotation)
    before = hand_place(simulation)
    watch(simulation, 1.0, poses=poses)
    assert state.reach_status[0, 0] == reach_state.REFUSED
    assert told(simulation) == [("target_refused", 0, "reach", detail)]
    assert np.linalg.norm(hand_place(simulation) - before) < 0.02
    commands.reach(0, BEFORE, "right")
    watch(simulation, 0.4, poses=poses)
    commands.reach(0, target, "right", rotation_world=rotation)
    watch(simulation, 1.5, poses=poses)
    assert state.reach_status[0, 0] == reach_state.REFUSED
    assert told(simulation)[1:] == [("target_refused", 0, "reach", detail)]
    assert np.linalg.norm(hand_place(simulation) - BEFORE) < 0.15
    commands.end_reach(0)
    watch(simulation, 2.0, poses=poses)
    assert (state.reach_stage[0] == reach_state.NONE).all()
    _, acceleration = angular_motion(np.array(poses, float), dt)
    assert acceleration < LARGEST_RATIO * EXAMPLE_ACCELERATION
    attempted = simulation.metrics.as_dict()["reach.attempted"]
    assert attempted == 3


@both_rates
def test_each_refusal_is_told_with_its_own_reason(dt):
    simulation = scene(dt)
    commands = simulation.commands
    for target in ((NAN, 1.0, 1.0), INSIDE, BEHIND, BEHIND):
        commands.reach(0, target, "right")
        watch(simulation, 0.3)
    assert [detail for _, _, _, detail in told(simulation)] == [
        "the target is not finite",
        "the target is inside the body",
        "a wall is in the way",
        "a wall is in the way",
    ]
    for _ in range(2):
        commands.look_at(0, (NAN, 1.0, 1.0))
        watch(simulation, 0.3)
    assert told(simulation)[4:] == 2 * [("target_refused", 0, "gaze", "there is no target")]


@both_rates
def test_what_is_asked_stays_in_the_state_and_free_targets_are_taken_up(dt):
    simulation = scene(dt)
    state = simulation.state
    simulation.commands.reach(0, BEHIND, "right")
    watch(simulation, 0.2)
    assert state.reach_target_world[0, 0].tolist() == list(BEHIND)
    assert state.reach_is_blocked[0, 0]
    simulation.commands.reach(0, BEFORE, "right")
    watch(simulation, 0.4)
    state.reach_target_world[0, 0] = BEHIND
    watch(simulation, 1.5)
    assert state.reach_status[0, 0] == reach_state.REFUSED
    assert told(simulation)[1:] == [("target_refused", 0, "reach", "a wall is in the way")]
    assert hand_place(simulation)[2] < 0.45
    state.reach_target_world[0, 0] = BEFORE
    watch(simulation, 1.5)
    assert state.reach_status[0, 0] == reach_state.REACHED
    assert len(told(simulation)) == 2


@both_rates
@pytest.mark.parametrize("target", [(NAN, 1.0, 0.3), INSIDE, BEHIND])
def test_a_hand_that_is_refused_on_its_way_returns_after_its_time(dt, target):
    simulation = scene(dt)
    simulation.commands.reach(0, BEFORE, "right", hold=0.5)
    watch(simulation, 0.4)
    simulation.commands.reach(0, target, "right", hold=0.5)
    watch(simulation, 4.0)
    assert (simulation.state.reach_stage[0] == reach_state.NONE).all()


@both_rates
def test_things_that_move_behind_a_wall_are_not_followed(dt):
    simulation = scene(dt)
    simulation.commands.grasp(0, "ball", "right")
    watch(simulation, 0.3)
    simulation.objects.position_world[0] = BEHIND
    watch(simulation, 1.5)
    assert simulation.state.grab_status[0, 0] == GrabStatus.REFUSED
    assert told(simulation) == [("target_refused", 0, "grab", "a wall is in the way")]
    assert hand_place(simulation)[2] < 0.45


@both_rates
@pytest.mark.parametrize("action", ["touch", "grasp"])
@pytest.mark.parametrize(
    ("place", "detail"),
    [
        ((NAN, 1.0, 0.3), "there is no such object, or the hand holds something else"),
        (INSIDE, "the target is inside the body"),
        (BEHIND, "a wall is in the way"),
    ],
)
def test_things_that_hands_cannot_go_to_are_refused(dt, action, place, detail):
    simulation = scene(dt)
    watch(simulation, 0.3)
    simulation.objects.position_world[0] = place
    getattr(simulation.commands, action)(0, "ball", "right")
    watch(simulation, 1.5)
    assert simulation.state.grab_status[0, 0] == GrabStatus.REFUSED
    assert simulation.state.grab_object[0, 0] == -1
    assert told(simulation) == [("target_refused", 0, "grab", detail)]


@both_rates
def test_what_somebody_else_holds_is_not_taken(dt):
    simulation = scene(dt, other=(0.9, 0))
    simulation.commands.grasp(0, "ball", "right")
    watch(simulation, 2.5)
    assert simulation.objects.holder[0] == 0
    simulation.commands.end_reach(0)
    watch(simulation, 1.5)
    simulation.commands.grasp(1, "ball", "right")
    watch(simulation, 1.0)
    assert simulation.state.grab_status[1, 0] == GrabStatus.TAKEN
    assert told(simulation) == [("target_refused", 1, "grab", "somebody else holds the object")]
    simulation.commands.reach(1, (NAN, 1.0, 0.3), "right")
    watch(simulation, 0.3)
    simulation.commands.grasp(1, "ball", "right")
    watch(simulation, 0.3)
    assert told(simulation)[1:] == [
        ("target_refused", 1, "reach", "the target is not finite"),
        ("target_refused", 1, "grab", "somebody else holds the object"),
    ]


@both_rates
def test_what_is_touched_is_followed_until_somebody_else_has_it(dt):
    simulation = scene(dt, ball=(-0.2, 1.15, 0.4), walls=(), other=(0, 0.9))
    state, ball = simulation.state, simulation.objects.position_world[0]
    simulation.commands.touch(0, "ball", "right")
    watch(simulation, 2.0)
    assert state.grab_status[0, 0] == GrabStatus.TOUCHING
    ball[1] += 0.1
    watch(simulation, 1.5)
    assert state.grab_status[0, 0] == GrabStatus.TOUCHING
    assert np.linalg.norm(hand_place(simulation) - ball) < 0.2
    assert told(simulation) == []
    simulation.objects.holder[0], simulation.objects.holder_hand[0] = 1, (True, False)
    watch(simulation, 2.0)
    assert state.grab_status[0, 0] == GrabStatus.TAKEN
    assert (state.reach_stage[0] == reach_state.NONE).all()
    assert told(simulation) == [("target_refused", 0, "grab", "somebody else holds the object")]


@both_rates
@pytest.mark.parametrize("action", ["pick_up", "touch", "look_at"])
def test_tasks_about_things_that_are_nowhere_fail_with_a_line(dt, action):
    simulation = scene(dt, tasks=[{action: "ball"}])
    simulation.objects.position_world[0] = NAN
    watch(simulation, 2.0, lambda: bool(simulation.state.is_finished[0]))
    assert told(simulation) == [("task_failed", 0, action, "the object is nowhere")]


@both_rates
@pytest.mark.parametrize(
    ("place", "detail"),
    [(INSIDE, "the target is inside the body"), (BEHIND, "a wall is in the way")],
)
def test_what_is_held_is_not_put_where_it_cannot_go(dt, place, detail):
    simulation = scene(dt)
    simulation.commands.grasp(0, "ball", "right")
    watch(simulation, 2.5)
    simulation.commands.put(0, place)
    watch(simulation, 1.5)
    assert simulation.state.reach_status[0, 0] == reach_state.REFUSED
    assert told(simulation) == [("target_refused", 0, "reach", detail)]
    assert simulation.objects.holder[0] == 0
    assert simulation.objects.position_world[0, 2] < 0.5


@both_rates
@pytest.mark.parametrize("where", ["nowhere", "head", "self", "gone"])
def test_what_eyes_cannot_look_at_is_refused(dt, where):
    simulation = scene(dt)
    commands, state = simulation.commands, simulation.state
    watch(simulation, 0.3)
    eyes = [simulation.model.skeleton.joint(f"{side}_eye") for side in ("left", "right")]
    if where == "nowhere":
        commands.look_at(0, (NAN, 1.0, 1.0))
    elif where == "head":
        commands.look_at(0, simulation.joint_positions_world()[0, eyes].mean(axis=0))
    elif where == "self":
        commands.look_at(0, character=0)
    else:
        state.is_active[1] = False
        commands.look_at(0, character=1)
    watch(simulation, 1.5)
    assert state.gaze_status[0] == gaze.REFUSED
    detail = "the target is too near" if where == "head" else "there is no target"
    assert told(simulation) == [("target_refused", 0, "gaze", detail)]
    commands.look_away(0)
    watch(simulation, 1.0)


ROOM = (((-0.8, 1), (0.8, 1)), ((0.8, 1), (0.8, 2)), ((0.8, 2), (-0.8, 2)), ((-0.8, 2), (-0.8, 1)))
"""A closed room, too small for a body that would reach its middle from inside."""


@both_rates
@pytest.mark.parametrize(
    "task",
    [{"pick_up": "ball"}, {"touch": "ball"}, {"touch": [0.0, 1.1, 1.6]}, {"put_down": [0.0, 1.1, 1.6]}],
)
def test_tasks_behind_walls_fail_with_a_line(dt, task):
    tasks = [task]
    where = (0.0, 1.1, 1.6)
    if "put_down" in task:
        tasks, where = [{"pick_up": "ball"}, task], BEFORE
    simulation = scene(dt, ball=where, tasks=tasks, walls=ROOM)
    watch(simulation, 15.0, lambda: bool(simulation.state.is_finished[0]))
    action = next(iter(task))
    failed = [event for event in simulation.events if event.kind is EventKind.TASK_FAILED]
    assert [(event.task, event.detail) for event in failed] == [(action, CLEAR)]
    assert simulation.state.is_finished[0]
    if action == "put_down":
        assert simulation.objects.holder[0] == 0


@both_rates
@pytest.mark.parametrize("task", [{"pick_up": "ball"}, {"touch": [0.1, 1.0, 0.62]}])
def test_people_walk_round_a_wall_to_where_nothing_is_between(dt, task):
    simulation = scene(dt, ball=BEHIND, tasks=[task], walls=(((-1.5, 0.5), (1.5, 0.5)),))
    watch(simulation, 25.0, lambda: bool(simulation.state.is_finished[0]))
    assert told(simulation)[-1][:3] == ("task_done", 0, next(iter(task)))
    assert simulation.state.position_world[0, 2] > 0.5


@both_rates
def test_boards_do_not_hide_what_lies_on_them(dt):
    shelf = {"name": "shelf", "x": [-0.5, 0.5], "z": [0.6, 1.0], "height": 1.6, "boards": [0.5, 1.1, 1.5]}
    simulation = scene(dt, ball=(0.1, 1.135, 0.72), tasks=[{"pick_up": "ball"}], walls=(), boxes=[shelf])
    watch(simulation, 15.0, lambda: bool(simulation.state.is_finished[0]))
    assert simulation.objects.holder[0] == 0
