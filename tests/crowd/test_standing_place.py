"""People find a place from which they can reach something, among obstacles and others."""

import math

import numpy as np
import pytest

from crowd.tasks.settle import errors, is_settled, settle_parameters
from crowd.tasks.standing_place import find_standing_place
from crowd.world import World
from crowd.world.obstacles import Box, Wall

BOUNDS = (-5.0, 5.0, -5.0, 5.0)
START = np.array([0.0, 0.0, -4.0])


def find(world, target=(0.0, 1.0, 0.0), hand=0, taken=(), attempt=0):
    return find_standing_place(world, np.array(target), START, 1.75, 0.25, hand, taken, attempt)


def test_the_place_is_near_and_on_the_side_one_comes_from():
    place = find(World(BOUNDS))
    assert np.hypot(*place.position_world[[0, 2]]) == pytest.approx(0.46)
    assert place.position_world[2] < -0.4


@pytest.mark.parametrize(("hand", "side"), [(0, -1.0), (1, 1.0), (2, 0.0)])
def test_the_target_is_on_the_side_of_the_hand(hand, side):
    place = find(World(BOUNDS), hand=hand)
    way, turn = errors(place.position_world[None], np.array([place.yaw]), np.zeros((1, 3)), np.zeros(1))
    assert np.sign(way[0, 0]) * (abs(way[0, 0]) > 0.02) == side
    assert way[0, 1] > 0.4
    assert turn[0] == pytest.approx(-place.yaw)


def test_what_stands_on_a_table_is_reached_from_its_edge():
    world = World(BOUNDS, [Box(-2.0, 2.0, -0.3, 0.3, 0.75)])
    place = find(world, (0.5, 0.8, -0.15))
    assert world.is_walkable(place.position_world[None], 0.25)[0]
    assert place.position_world[2] < -0.5


def test_nobody_reaches_through_a_wall():
    world = World(BOUNDS, [Wall((-4.0, -0.2), (4.0, -0.2))])
    place = find(world)
    assert place.position_world[2] > 0.0


def test_places_of_others_are_left_to_them():
    first = find(World(BOUNDS))
    second = find(World(BOUNDS), taken=[(first.position_world, 0.25)])
    assert np.linalg.norm(first.position_world - second.position_world) > 0.5


@pytest.mark.parametrize("stature", [1.55, 1.6, 1.65, 1.75])
@pytest.mark.parametrize("depth", [0.05, 0.1, 0.17])
def test_there_is_a_place_beside_somebody_who_stands_at_a_table(stature, depth):
    world = World(BOUNDS, [Box(-2.0, 2.0, 0.0, 0.7, 0.75)])
    other, target = np.array([0.0, 0.0, -0.31]), np.array([0.0, 0.81, depth])
    place = find_standing_place(world, target, START, stature, 0.25, 0, [(other, 0.25)])
    assert np.linalg.norm(place.position_world - other) > 0.5
    assert np.linalg.norm(place.position_world - target * [1.0, 0.0, 1.0]) < 0.8
    assert world.is_walkable(place.position_world[None], 0.25)[0]


def test_another_try_finds_another_place():
    first, second = find(World(BOUNDS)), find(World(BOUNDS), attempt=1)
    assert np.linalg.norm(first.position_world - second.position_world) > 0.1


def test_nothing_is_found_where_nobody_can_stand():
    world = World(BOUNDS, [Box(-2.0, 2.0, -2.0, 2.0, 0.75)])
    assert find(world) is None


@pytest.mark.parametrize("yaw", [0.0, 1.0, 3.0, -2.5])
def test_settling_moves_towards_the_place_and_stops_there(yaw):
    place, place_yaw = np.array([[1.0, 0.0, 2.0]]), np.array([0.7])
    position, heading = np.array([[0.6, 0.0, 2.5]]), np.array([yaw])
    dt = 1.0 / 60.0
    for _ in range(400):
        ahead, rate, left = settle_parameters(position, heading, place, place_yaw)[0]
        sine, cosine = math.sin(heading[0]), math.cos(heading[0])
        position += dt * np.array([[ahead * sine + left * cosine, 0.0, ahead * cosine - left * sine]])
        heading = heading + dt * rate
    assert is_settled(position, heading, place, place_yaw)[0]
    assert not settle_parameters(position, heading, place, place_yaw).any()
