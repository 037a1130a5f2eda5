"""The walkable world: doors that bodies fit through, thin walls, obstacles that come and go, ways."""

import time

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from crowd.navigation.routing import Routing
from crowd.world import World
from crowd.world.obstacles import Box, Polygon, Wall
from tests.oracles import routing as oracle

BOUNDS = (-10.0, 10.0, -10.0, 10.0)


def points(*places):
    return np.array([[x, 0.0, z] for x, z in places])


@pytest.mark.parametrize("shift", np.linspace(0, 0.25, 20))
@pytest.mark.parametrize(("gap", "fits"), [(1.2, True), (1.02, True), (0.95, False), (0.5, False)])
def test_a_door_lets_bodies_through_wherever_the_grid_lies(shift, gap, fits):
    walls = [Box(-10.0, shift - gap / 2, -0.2, 0.2), Box(shift + gap / 2, 11.0, -0.2, 0.2)]
    world = World(BOUNDS, walls)
    assert world.is_reachable(points((0, -5)), points((3, 5)), 0.5)[0] == fits


def test_thin_walls_stop_bodies_of_any_size():
    world = World(BOUNDS, [Wall((-11.0, 0.03), (11.0, 0.03))])
    for radius in (0.1, 0.25, 0.5):
        assert not world.is_reachable(points((0, -2)), points((0, 2)), radius)[0]


def test_slanted_polygons_block_their_inside():
    world = World(BOUNDS, [Polygon(((-3, 0), (0, -3), (3, 0), (0, 3)))])
    assert list(world.is_walkable(points((0, 0), (2.4, 2.4), (1.8, 1.8), (11, 0)), 0.25)) == [
        False,
        True,
        True,
        False,
    ]
    near = world.nearest_walkable(points((0.5, 0.5)), 0.25)
    assert world.clearance_at(near)[0] >= 0.24


def test_obstacles_close_and_open_a_way():
    world = World(BOUNDS, [Box(-10, -1, -0.2, 0.2), Box(1, 10, -0.2, 0.2)])
    start, goal = points((0, -5)), points((0, 5))
    assert world.is_reachable(start, goal, 0.25)[0]
    number = world.add_obstacle(Box(-1, 1, -0.1, 0.1))
    assert not world.is_reachable(start, goal, 0.25)[0]
    world.remove_obstacle(number)
    assert world.is_reachable(start, goal, 0.25)[0]


def test_bad_shapes_are_refused():
    with pytest.raises(ValueError, match="polygon"):
        Polygon(((0, 0), (1, 1), (1, 0), (0, 1)))
    with pytest.raises(ValueError, match="wall"):
        Wall((1, 1), (1, 1))
    with pytest.raises(ValueError, match="bounds"):
        World((1, 0, 0, 1))


def follow(world, start, goal, radius=0.3, steps=2800):
    """Walk points along their way points; returns all positions (step, N, 3) and the routing."""
    position = np.array(start)
    routing = Routing(world, len(position))
    everyone = np.arange(len(position), dtype=np.int32)
    routing.set_goals(everyone, goal, np.full(len(position), radius), position)
    way_point, remaining = position.copy(), np.zeros(len(position))
    track = []
    for step in range(steps):
        routing.way_points(position, everyone, step, way_point, remaining)
        way = way_point - position
        length = np.linalg.norm(way, axis=1, keepdims=True)
        position = position + way / np.maximum(length, 1e-9) * np.minimum(length, 0.03)
        track.append(position.copy())
        if (np.linalg.norm(position - goal, axis=1) < 0.05).all():
            break
    return np.array(track), routing


MAZE = [Box(-10, 6, -6.2, -5.8), Box(-6, 10, -2.2, -1.8), Box(-10, 6, 1.8, 2.2), Wall((-6, 6), (10, 6))]


@pytest.mark.parametrize(("count", "detour"), [(3, 1.05), (14, 1.1)], ids=["own searches", "a shared field"])
def test_way_points_lead_to_the_goal_without_touching_walls(count, detour, rng):
    world = World(BOUNDS, MAZE)
    start = np.stack([rng.uniform(-9, 9, count), np.zeros(count), np.full(count, -8.0)], axis=1)
    goal = np.tile([8.0, 0.0, 9.0], (count, 1))
    track, _ = follow(world, start, goal)
    np.testing.assert_allclose(track[-1], goal, atol=0.06)
    for character in range(count):
        assert world.clearance_at(track[:, character]).min() > 0.24
        length = np.linalg.norm(np.diff(track[:, character], axis=0), axis=1).sum()
        best = oracle.shortest_way(world, start[character], goal[character], 0.3)
        # Those who share a goal spread over wide gaps, which makes some ways longer.
        assert length < detour * best + 0.6


def test_a_way_that_is_closed_is_found_anew():
    world = World(BOUNDS, [Box(-6, 6, -0.2, 0.2)])
    position, goal = points((-3.0, -5.0)), points((-3.0, 5.0))
    one = np.zeros(1, np.int32)
    routing = Routing(world, 1)
    routing.set_goals(one, goal, np.array([0.25]), position)
    way_point, remaining = position.copy(), np.zeros(1)
    routing.way_points(position, one, 0, way_point, remaining)
    assert way_point[0, 0] < -6.0, "round the near end"
    before = remaining[0]
    world.add_obstacle(Box(-10, -6, -0.2, 0.2))
    routing.way_points(position, one, 1, way_point, remaining)
    routing.way_points(position, one, 2, way_point, remaining)
    assert way_point[0, 0] > 6.0, "round the far end"
    assert remaining[0] > before + 3.0


def test_unreachable_goals_leave_people_where_they_are():
    world = World(BOUNDS, [Wall((-11.0, 0.0), (11.0, 0.0))])
    position = points((0, -5))
    one = np.zeros(1, np.int32)
    routing = Routing(world, 1)
    routing.set_goals(one, points((0, 5)), np.array([0.25]), position)
    way_point, remaining = np.zeros((1, 3)), np.zeros(1)
    routing.way_points(position, one, 0, way_point, remaining)
    assert routing.status[0] != 0
    assert np.isinf(remaining[0])
    np.testing.assert_array_equal(way_point, position)


def test_a_large_world_is_built_quickly(rng):
    boxes = [Box(x, x + 1, z, z + 1) for x, z in rng.uniform(-95, 95, (700, 2))]
    World(BOUNDS, boxes[:1]).grid(0.5)
    begin = time.process_time()
    World((-100, 100, -100, 100), boxes).grid(0.5)
    assert time.process_time() - begin < 2.0, "about 0.1 s on a free core"


def is_blocked_by_samples(shapes, start, end):
    """Slow twin of `World.is_blocked`: points along the way, to 2 cm before its end."""
    way = end - start
    share = max(1.0 - 0.02 / max(np.linalg.norm(way), 0.02), 0.0)
    steps = start + np.linspace(0.0, share, 4001)[:, None] * way
    blocked = np.zeros(len(steps), np.bool_)
    for shape in shapes:
        ground = shape.geometry()
        if getattr(shape, "has_boards", False) and ground.covers(shapely.Point(end[[0, 2]])):
            continue
        blocked |= shapely.intersects_xy(ground, steps[:, 0], steps[:, 2]) & (steps[:, 1] < shape.height)
    return bool(blocked.any())


@settings(max_examples=150, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_arms_are_blocked_where_points_of_their_way_are_inside(seed):
    rng = np.random.default_rng(seed)
    shapes = []
    for _ in range(rng.integers(1, 4)):
        x, z, wide, deep = *rng.uniform(-1, 0.6, 2), *rng.uniform(0.1, 0.8, 2)
        height, has_boards = rng.uniform(0.3, 2.0), bool(rng.random() < 0.4)
        shapes.append(Box(x, x + wide, z, z + deep, height, has_boards))
    corners = rng.uniform(0.2, 0.8) * np.array([[0, -1], [1, 1], [-1, 1], [0, 0.2]])[:, [1, 0]]
    shapes.append(Polygon([tuple(map(float, corner)) for corner in corners[[0, 1, 3, 2]]], 1.0))
    start = rng.uniform((-1.5, 1.0, -1.5), (1.5, 1.6, 1.5), (20, 3))
    end = rng.uniform((-1.5, 0.0, -1.5), (1.5, 1.9, 1.5), (20, 3))
    end[-1] = start[-1] - [0.0, 0.8, 0.0]
    got = World(BOUNDS, shapes).is_blocked(start, end)
    lower = [Box(b.xmin, b.xmax, b.zmin, b.zmax, b.height - 1e-3, b.has_boards) for b in shapes[:-1]]
    lower.append(Polygon(shapes[-1].points, 0.999))
    for row in range(20):
        sampled = is_blocked_by_samples(shapes, start[row], end[row])
        # Samples miss what is shorter than their distance.
        if sampled == is_blocked_by_samples(lower, start[row], end[row]):
            assert got[row] == sampled or (got[row] and touches(shapes, start[row], end[row]))


def touches(shapes, start, end):
    """The way cuts less than a few millimetres of a corner."""
    line = shapely.LineString([start[[0, 2]], end[[0, 2]]])
    cuts = [line.intersection(shape.geometry()).length for shape in shapes]
    return any(0.0 < cut < 5e-3 for cut in cuts)


def test_a_thin_wall_is_in_the_way_below_its_height():
    world = World(BOUNDS, [Wall((-1.0, 0.5), (1.0, 0.5), height=1.2)])
    shoulder = np.array([[0.0, 1.4, 0.0]])
    for target, is_blocked in (
        ((0.0, 1.0, 1.0), False),
        ((0.0, 0.9, 1.0), True),
        ((0.0, 0.3, 0.49), False),
        ((0.0, 0.3, 0.5), False),
        ((0.0, 0.3, 0.54), True),
        ((2.5, 0.3, 1.0), False),
        ((0.0, np.nan, 1.0), False),
    ):
        assert world.is_blocked(shoulder, np.array([target]))[0] == is_blocked, target
