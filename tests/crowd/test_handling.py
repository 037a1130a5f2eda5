"""Picking up, carrying, putting down and handing over, with everything that moves a hand."""

from typing import Any

import numpy as np
import pytest

from crowd.controllers.grab import HOLDING, OPEN, GrabStatus
from crowd.errors import SettingsError
from crowd.motion.rotation import conjugate, rotate
from crowd.scenario.load import scenario_from
from crowd.scenario.source import ScenarioSource
from crowd.simulation import Simulation
from crowd.state import CarryStage
from crowd_kernels.reach_state import MOVING, NONE, OUT_OF_REACH, REACHED, REFUSED

THINGS = [
    {"name": "ball", "shape": "sphere", "radius": 0.04, "position": [-0.25, 1.0, 0.45]},
    {"name": "bottle", "shape": "capsule", "radius": 0.035, "length": 0.24, "position": [2.8, 0.9, 0.45],
     "resting": True},
    {"name": "packet", "shape": "box", "size": [0.06, 0.05, 0.1], "position": [5.8, 0.9, 0.4],
     "resting": True},
    {"name": "pen", "shape": "capsule", "radius": 0.007, "length": 0.15, "position": [8.8, 1.0, 0.45],
     "rotation": [90, 40, 0]},
    {"name": "low", "shape": "sphere", "radius": 0.03, "position": [11.8, 0.35, 0.4]},
    {"name": "high", "shape": "box", "size": [0.05, 0.12, 0.05], "position": [14.8, 1.6, 0.35]},
]  # fmt: skip
CARTON = {"name": "carton", "shape": "box", "size": [0.35, 0.25, 0.28], "position": [0, 0.85, 0.5],
          "resting": True}  # fmt: skip
BALLOON = {"name": "balloon", "shape": "sphere", "radius": 0.13, "position": [3, 1.1, 0.45]}
CUP = {"name": "cup", "shape": "capsule", "radius": 0.035, "length": 0.14, "position": [-0.2, 1.0, 0.45]}


def simulation_of(objects: Any, people: Any, dt: float = 1 / 60, walls: Any = ()) -> Simulation:
    scenario = scenario_from(
        {
            "dt": dt,
            "world": {
                "bounds": {"x": [-10, 30], "z": [-20, 20]},
                "walls": [{"points": points} for points in walls],
            },
            "characters": [
                {"position": [x, z], "facing": facing, "height": height, "glances": False}
                for x, z, facing, height in people
            ],
            "objects": objects,
        },
        ScenarioSource(),
    )
    simulation = Simulation(scenario, threads=1)
    advance(simulation, 0.3)
    return simulation


def advance(simulation: Simulation, seconds: float) -> None:
    for _ in range(round(seconds / simulation.dt)):
        simulation.step()


def apart(simulation: Simulation, item: int) -> float:
    """Greatest distance between an object and where the hands that hold it would have it, m."""
    objects = simulation.objects
    far = []
    for side in np.flatnonzero(objects.holder_hand[item]):
        row = int(objects.holder[item])
        hands = np.array([row], np.int32), np.array([side], np.int32)
        place, turn = simulation.grab.holding.hands_in_world(simulation.state, hands)
        there = rotate(conjugate(turn), objects.position_world[item] - place)[0]
        far.append(np.linalg.norm(there - objects.grip_position[item, side]))
    return float(max(far))


@pytest.fixture(scope="module")
def pickers() -> Simulation:
    """Six people, each with an object in its right hand."""
    simulation = simulation_of(THINGS, [(3 * k, 0, 0, 1.6 + 0.05 * k) for k in range(6)])
    for row in range(6):
        simulation.commands.grasp(row, row, "right")
    advance(simulation, 2.5)
    return simulation


def test_things_high_and_low_are_grasped(pickers: Simulation) -> None:
    state, objects = pickers.state, pickers.objects
    assert state.grab_stage[:, 0].tolist() == [HOLDING] * 6
    assert state.grab_status[:, 0].tolist() == [GrabStatus.HOLDING] * 6
    assert objects.holder.tolist() == list(range(6))
    assert (state.finger_contact[:, 0].sum(axis=1) >= 3).all()
    gaps = pickers.grab.finger_gaps(state, np.arange(6, dtype=np.int32), 0)
    assert gaps.min() > -1e-3, "no finger is more than a millimetre inside"
    away = objects.position_world - pickers.model.objects.start_position_world
    assert np.linalg.norm(away, axis=1).max() < 0.003, "nothing moves while it is grasped"


def test_the_figure_of_a_run_tells_of_things_that_came_off_their_hands(pickers: Simulation) -> None:
    place = pickers.objects.position_world
    before = place[2].copy()
    place[2] += (0.0, 0.008, 0.0)
    pickers.metrics.observe(pickers)
    place[2] = before
    assert pickers.metrics.as_dict()["held.apart_mm.max"] == pytest.approx(8.0, abs=0.5)


def test_things_are_carried_and_put_down_where_asked(pickers: Simulation) -> None:
    state, objects = pickers.state, pickers.objects
    rows = np.arange(6)
    for name in ("right",):
        pickers.commands.end_reach(rows, name)
    worst = 0.0
    pickers.commands.set_locomotion(rows, (1.2, 0.0, 0.0))
    for _ in range(90):
        pickers.step()
        worst = max(worst, *(apart(pickers, item) for item in range(6)))
    pickers.commands.set_locomotion(rows, (0.0, 0.0, 0.0))
    advance(pickers, 1.5)
    assert worst < 1e-3
    ahead = np.array([-0.2, 0.0, 0.42])
    wanted = state.position_world + ahead
    wanted[:, 1] = [0.9, 1.0, 1.0, 1.1, 0.6, 1.3]
    upright = pickers.model.objects.start_rotation_world
    pickers.commands.put(rows, wanted, upright)
    advance(pickers, 2.5)
    off = np.linalg.norm(objects.position_world - wanted, axis=1)
    assert off.max() < 0.01
    pickers.commands.let_go(rows, "right", wanted, upright)
    advance(pickers, 1.5)
    assert np.allclose(objects.position_world, wanted, atol=1e-12), "exactly where asked"
    assert (objects.holder == -1).all()
    assert (state.grab_stage[:, 0] == OPEN).all()
    assert (state.grab_weight[:, 0] == 0).all()


@pytest.fixture(scope="module")
def carriers() -> Simulation:
    """Two people with something large between their hands."""
    simulation = simulation_of([CARTON, BALLOON], [(0, 0, 0, 1.75), (3, 0, 0, 1.65)])
    simulation.commands.grasp(0, "carton")
    simulation.commands.grasp(1, "balloon")
    advance(simulation, 2.5)
    return simulation


def test_large_things_are_carried_with_both_hands(carriers: Simulation) -> None:
    state, objects = carriers.state, carriers.objects
    assert (state.grab_stage == HOLDING).all()
    assert objects.holder_hand.all()
    carriers.commands.end_reach(slice(None))
    advance(carriers, 1.5)
    assert (state.carry_stage == CarryStage.CARRYING).all()
    carriers.commands.set_locomotion(slice(None), (1.2, 0.3, 0.0))
    places = []
    for _ in range(120):
        carriers.step()
        assert max(apart(carriers, item) for item in (0, 1)) < 1e-3
        away = objects.position_world - state.position_world
        sine, cosine = np.sin(state.yaw), np.cos(state.yaw)
        x, z = cosine * away[:, 0] - sine * away[:, 2], sine * away[:, 0] + cosine * away[:, 2]
        places.append(np.stack([x, away[:, 1], z], axis=1))
    assert np.ptp(places, axis=0).max() < 0.02, "they stay where they are against the body"


def test_a_large_thing_is_put_down_with_both_hands(carriers: Simulation) -> None:
    state, objects = carriers.state, carriers.objects
    carriers.commands.set_locomotion(slice(None), (0.0, 0.0, 0.0))
    advance(carriers, 1.5)
    heading = np.stack([np.sin(state.yaw), np.zeros(2), np.cos(state.yaw)], axis=1)
    wanted = state.position_world + 0.45 * heading + np.array([0.0, 0.95, 0.0])
    carriers.commands.put(slice(None), wanted)
    advance(carriers, 2.0)
    assert (state.carry_stage == CarryStage.PLACING).all()
    assert np.linalg.norm(objects.position_world - wanted, axis=1).max() < 0.01
    carriers.commands.let_go(slice(None))
    advance(carriers, 1.0)
    assert (objects.holder == -1).all()
    assert np.linalg.norm(objects.position_world - wanted, axis=1).max() < 0.01


@pytest.mark.parametrize("place", [(0.0, 1.2, 0.8), (-0.3, 0.78, 0.7), (0.0, 1.75, 0.45), (0.0, 1.0, 0.6)])
def test_a_thin_plate_comes_from_afar_without_a_jump_of_the_head(place: Any) -> None:
    """Also from where both hands just come to it but carry nothing."""
    plate = {"name": "plate", "shape": "box", "size": [0.3, 0.01, 0.3], "position": list(place)}
    simulation = simulation_of([plate], [(0, 0, 0, 1.75)])
    head, places = simulation.model.skeleton.joint("head"), []
    simulation.commands.grasp(0, "plate", "both")
    for _ in range(150):
        simulation.step()
        places.append(simulation.joint_positions_world()[0, head])
        assert simulation.objects.holder[0] < 0 or apart(simulation, 0) < 1e-3
    assert (simulation.state.grab_stage[0] == HOLDING).all()
    acceleration = np.linalg.norm(np.diff(places, 2, axis=0), axis=1) / simulation.dt**2
    assert acceleration.max() < 15.0


def two_handed(dt: float = 1 / 60, walls: Any = (), people: Any = ((0, 0, 0, 1.75),)) -> Simulation:
    """A person with a carton between both hands, and others."""
    simulation = simulation_of([CARTON], people, dt, walls)
    simulation.commands.grasp(0, "carton")
    advance(simulation, 2.0)
    assert (simulation.state.grab_stage[0] == HOLDING).all()
    return simulation


def worst_apart(simulation: Simulation, seconds: float) -> float:
    """Greatest distance of a hand from what it holds in the next steps, m."""
    worst = 0.0
    for _ in range(round(seconds / simulation.dt)):
        simulation.step()
        if simulation.objects.holder[0] >= 0:
            worst = max(worst, apart(simulation, 0))
    return worst


@pytest.mark.parametrize("hertz", [30, 60, 120])
def test_both_hands_stay_at_what_they_move(hertz: int) -> None:
    simulation = two_handed(1 / hertz)
    commands, state = simulation.commands, simulation.state
    upright, turned = (1.0, 0.0, 0.0, 0.0), (np.cos(0.3), 0.0, np.sin(0.3), 0.0)
    worst = []
    for place, turn in (((0.1, 1.0, 0.6), None), ((0.0, 1.2, 0.45), turned), ((-0.2, 0.9, 0.5), upright)):
        commands.put(0, place, turn)
        worst.append(worst_apart(simulation, 0.5))
        assert (state.reach_status[0] == MOVING).all()
        worst.append(worst_apart(simulation, 1.5))
        assert (state.reach_status[0] == REACHED).all()
        assert np.linalg.norm(simulation.objects.position_world[0] - place) < 1e-3
    commands.end_reach(0)
    worst.append(worst_apart(simulation, 1.5))
    commands.set_locomotion(0, (1.2, 0.6, 0.0))
    worst.append(worst_apart(simulation, 1.5))
    commands.set_locomotion(0, (0.0, 0.0, 0.0))
    worst.append(worst_apart(simulation, 1.0))
    ahead = 0.5 * np.array([np.sin(state.yaw[0]), 2.0, np.cos(state.yaw[0])])
    commands.put(0, state.position_world[0] + ahead)
    worst.append(worst_apart(simulation, 1.5))
    assert max(worst) < 1e-3


def test_what_walkers_put_is_carried_until_they_stand() -> None:
    simulation = two_handed()
    simulation.commands.set_locomotion(0, (1.0, 0.0, 0.0))
    assert worst_apart(simulation, 1.5) < 1e-3
    assert simulation.state.carry_stage[0] == CarryStage.CARRYING
    simulation.commands.put(0, (0.0, 1.0, 2.5))
    assert worst_apart(simulation, 0.5) < 1e-3
    assert simulation.state.carry_stage[0] == CarryStage.WAITING
    simulation.commands.set_locomotion(0, (0.0, 0.0, 0.0))
    assert worst_apart(simulation, 3.0) < 1e-3
    assert simulation.state.carry_stage[0] == CarryStage.PLACING


@pytest.mark.parametrize(("place", "reason"), [
    ((0.35, 1.0, 0.5), "a wall is in the way"), ((0.17, 1.0, 0.1), "the target is inside the body"),
])  # fmt: skip
def test_where_one_hand_cannot_go_neither_goes(place: Any, reason: str) -> None:
    simulation = two_handed(walls=[[[0.42, 0.1], [0.42, 1.5]]])
    before = simulation.objects.position_world[0].copy()
    simulation.commands.put(0, place)
    assert worst_apart(simulation, 1.0) < 1e-3
    assert (simulation.state.reach_status[0] == REFUSED).all()
    assert {event.detail for event in simulation.events} == {reason}
    assert np.linalg.norm(simulation.objects.position_world[0] - before) < 1e-3
    simulation.commands.put(0, (0.0, 1.0, 0.5))
    assert worst_apart(simulation, 1.5) < 1e-3
    assert (simulation.state.reach_status[0] == REACHED).all()


def test_as_near_as_both_hands_get_is_out_of_reach() -> None:
    simulation = two_handed()
    simulation.commands.put(0, (0.0, 1.2, 2.0))
    assert worst_apart(simulation, 2.5) < 1e-3
    assert (simulation.state.reach_status[0] == OUT_OF_REACH).all()
    simulation.commands.reach(0, (-0.3, 1.3, 0.3), "right")
    assert worst_apart(simulation, 1.0) < 1e-3
    assert [event.detail for event in simulation.events] == ["the other hand holds the object too"]


def test_both_hands_give_to_both_hands() -> None:
    simulation = two_handed(people=[(0, 0, 0, 1.75), (0, 0.95, 180, 1.7), (0, 4.5, 180, 1.7)])
    simulation.commands.end_reach(0)
    assert worst_apart(simulation, 1.2) < 1e-3
    simulation.commands.hand_over(0, 2)
    simulation.step()
    assert [event.detail for event in simulation.events] == ["the other person is too far away"]
    simulation.commands.hand_over(0, 1)
    assert worst_apart(simulation, 4.0) < 1e-3
    assert simulation.objects.holder[0] == 1
    assert simulation.objects.holder_hand[0].all()
    assert (simulation.state.reach_stage[0] == NONE).all()
    simulation.commands.end_reach(1)
    assert worst_apart(simulation, 1.5) < 1e-3
    assert simulation.state.carry_stage.tolist() == [CarryStage.FREE, CarryStage.CARRYING, CarryStage.FREE]


def test_a_hand_can_be_named_where_each_holds_something() -> None:
    other = {**CUP, "name": "mug", "position": [0.2, 1.0, 0.45]}
    simulation = simulation_of([CUP, other], [(0, 0, 0, 1.75)])
    for name, hand in (("cup", "right"), ("mug", "left")):
        simulation.commands.grasp(0, name, hand)
    advance(simulation, 2.0)
    for command in (simulation.commands.put, lambda row, place: simulation.commands.let_go(row, None, place)):
        with pytest.raises(SettingsError, match="each hand of character 0 holds something"):
            command(0, (0.0, 1.2, 0.4))
    before = simulation.objects.position_world.copy()
    simulation.commands.put(0, (-0.25, 1.2, 0.4), hand="right")
    advance(simulation, 1.5)
    assert np.linalg.norm(simulation.objects.position_world[0] - (-0.25, 1.2, 0.4)) < 1e-3
    assert np.linalg.norm(simulation.objects.position_world[1] - before[1]) < 1e-3
    simulation.commands.let_go(0, "both")
    advance(simulation, 0.5)
    assert simulation.objects.holder.tolist() == [-1, -1]


def test_hands_on_their_way_turn_to_what_is_asked_last() -> None:
    simulation = simulation_of([CUP], [(0, 0, 0, 1.75)])
    simulation.commands.grasp(0, "cup", "right")
    advance(simulation, 0.3)
    simulation.commands.reach(0, (-0.3, 1.4, 0.4), "both")
    advance(simulation, 2.0)
    assert simulation.state.grab_status[0].tolist() == [GrabStatus.NONE] * 2
    assert simulation.state.reach_status[0, 0] == REACHED
    simulation.commands.grasp(0, "cup", "right")
    advance(simulation, 0.3)
    simulation.commands.end_reach(0, "both")
    advance(simulation, 1.5)
    assert (simulation.state.reach_stage[0] == NONE).all()
    assert simulation.state.grab_object[0].tolist() == [-1, -1]


def test_hands_and_people_that_are_none_are_one_line() -> None:
    simulation = simulation_of([CUP], [(0, 0, 0, 1.75), (3, 0, 0, 1.75)])
    commands = simulation.commands
    with pytest.raises(SettingsError, match="unknown hand; got 'third'; allowed right, left or both"):
        commands.end_reach(0, "third")
    with pytest.raises(
        SettingsError, match="mask has the wrong length; got 1; allowed one value for each of 2"
    ):
        commands.end_reach(np.array([True]))
    simulation.state.is_active[1] = False
    for command in (commands.end_reach, lambda row: commands.grasp(row, "cup")):
        with pytest.raises(SettingsError, match="characters: this one is not there; got 1"):
            command(1)


def test_from_person_to_person_and_from_hand_to_hand() -> None:
    simulation = simulation_of([CUP], [(0, 0, 0, 1.75), (0, 1.0, 180, 1.7)])
    state, objects = simulation.state, simulation.objects
    with pytest.raises(SettingsError, match="holds nothing"):
        simulation.commands.hand_over(0, 1)
    simulation.commands.grasp(0, "cup", "right")
    advance(simulation, 2.0)
    assert state.grab_stage[0, 0] == HOLDING
    simulation.commands.hand_over(0, 1)
    advance(simulation, 3.5)
    assert objects.holder[0] == 1
    assert objects.holder_hand[0].tolist() == [True, False]
    assert state.grab_stage[1, 0] == HOLDING
    assert state.grab_stage[0, 0] == OPEN
    assert state.reach_stage[0, 0] in (0, 3), "the giver takes the hand back"
    assert simulation.grab.finger_gaps(state, np.array([1], np.int32), 0).min() > -1e-3
    simulation.commands.put(1, [0.0, 1.1, 0.6], [1.0, 0, 0, 0])
    advance(simulation, 2.0)
    simulation.commands.grasp(1, "cup", "left")
    advance(simulation, 3.0)
    assert objects.holder[0] == 1
    assert objects.holder_hand[0].tolist() == [False, True]
    assert state.grab_stage[1].tolist() == [OPEN, HOLDING]


def test_what_is_too_far_is_out_of_reach_and_moves_nothing() -> None:
    far = {"name": "far", "shape": "sphere", "radius": 0.04, "position": [0, 1.0, 4.0]}
    simulation = simulation_of([far], [(0, 0, 0, 1.75)])
    simulation.commands.grasp(0, "far", "right")
    advance(simulation, 2.0)
    assert simulation.state.grab_status[0, 0] == GrabStatus.OUT_OF_REACH
    assert simulation.state.grab_stage[0, 0] == OPEN
    assert simulation.objects.holder[0] == -1
    simulation.commands.let_go(0)
    advance(simulation, 1.5)
    assert simulation.state.grab_object[0, 0] == -1
    assert np.isfinite(simulation.state.pose_rotation).all()


def test_a_hand_follows_an_object_that_moves_and_gives_up_what_is_taken() -> None:
    simulation = simulation_of([CUP], [(0, 0, 0, 1.75), (0, 1.0, 180, 1.7)])
    state, objects = simulation.state, simulation.objects
    simulation.commands.grasp(0, "cup", "right")
    for _ in range(40):
        objects.position_world[0] += [0.001, 0.002, 0.0]
        simulation.step()
    advance(simulation, 1.5)
    assert state.grab_stage[0, 0] == HOLDING
    simulation.commands.grasp(1, "cup", "right")
    state.reach_stage[0, 0] = 0
    simulation.commands.let_go(1)
    state.reach_stage[0] = 0
    simulation.commands.grasp(1, "cup", "right")
    assert state.grab_status[1, 0] == GrabStatus.TAKEN
