"""Every layer draws what it is there for, of a run and, as far as that is recorded, of a recording."""

import numpy as np
import pytest

import crowd
from crowd.recording import Recorder
from crowd_viewer.frame import source_of
from crowd_viewer.ground_map import BLOCKED, FREE, cells_of
from crowd_viewer.joint_limits import BEYOND, limit_arcs
from crowd_viewer.joint_limits import FREE as WITHIN
from crowd_viewer.overlays import LAYERS, Overlays, Seen, joint_positions, joint_rotations, nearest_people


class Collected:
    """Stands in for the batch of lines: keeps what is added."""

    def __init__(self):
        self.start, self.end, self.colours = [], [], []

    def add(self, start, end, colour):
        self.start.append(np.asarray(start, float))
        self.end.append(np.asarray(end, float))
        self.colours.append(colour)

    def path(self, points, colour):
        self.add(points[:-1], points[1:], colour)

    def circles(self, middle, radius, colour, corners=20):
        self.add(middle, middle + radius[:, None] * [1.0, 0.0, 0.0], colour)

    def arrows(self, start, vector, colour):
        self.add(start, start + vector, colour)

    @property
    def count(self):
        return sum(map(len, self.start))


@pytest.fixture(scope="module")
def crowded():
    """Sixty people after four seconds."""
    simulation = crowd.Simulation(crowd.load_scenario("plaza"), seed=3, characters=60, threads=1)
    for _ in range(240):
        simulation.step()
    return simulation


def seen_of(shown, picked):
    source = source_of(shown)
    frame = source.frame()
    simulation = shown if isinstance(shown, crowd.Simulation) else None
    rows = nearest_people(frame, np.zeros(3))
    return Seen(frame, source.scene, rows, picked, source.quantity, simulation)


def walker_in_company(simulation):
    """Somebody who walks, with others near."""
    state = simulation.state
    walks = np.flatnonzero(state.is_active & (state.locomotion_weight > 0.9))
    away = np.linalg.norm(state.position_world[walks][:, None] - state.position_world[walks][None], axis=2)
    return int(walks[np.argmax((away < 4.0).sum(axis=1))])


@pytest.mark.parametrize("layer", [name for name in LAYERS if name != "targets"])
def test_every_layer_of_a_run_draws_lines_that_are_finite(crowded, layer):
    lines = Collected()
    LAYERS[layer](lines, seen_of(crowded, walker_in_company(crowded)))
    assert lines.count > 0
    assert np.isfinite(np.concatenate(lines.start)).all()
    assert np.isfinite(np.concatenate(lines.end)).all()


def test_gaze_and_reach_targets_are_joined_with_eyes_and_hands():
    simulation = crowd.Simulation(crowd.load_scenario("plaza"), seed=3, characters=12, threads=1)
    simulation.step()
    state, skeleton = simulation.state, simulation.model.skeleton
    row = int(np.flatnonzero(state.is_active)[0])
    point = state.position_world[row] + [2.0 * np.sin(state.yaw[row]), 1.5, 2.0 * np.cos(state.yaw[row])]
    simulation.commands.look_at([row], point)
    for _ in range(30):
        simulation.step()
    state.reach_stage[row, 1] = 1
    state.reach_target_world[row, 1] = (1.0, 2.0, 3.0)
    lines = Collected()
    LAYERS["targets"](lines, seen_of(simulation, row))
    start, end = np.concatenate(lines.start), np.concatenate(lines.end)
    joints = simulation.joint_positions_world()[row]
    eyes = joints[[skeleton.joint("left_eye"), skeleton.joint("right_eye")]].mean(axis=0)
    to_point = np.linalg.norm(end - point, axis=1) < 1e-5
    assert np.linalg.norm(start[to_point] - eyes, axis=1).min() < 1e-4
    to_hand = np.linalg.norm(end - [1.0, 2.0, 3.0], axis=1) < 1e-9
    assert start[to_hand][0] == pytest.approx(joints[skeleton.joint("left_hand")], abs=1e-4)


def test_nobody_picked_and_nobody_there_draw_nothing_of_the_picked(crowded):
    for layer in ("neighbours", "half-planes", "limits"):
        lines = Collected()
        LAYERS[layer](lines, seen_of(crowded, -1))
        assert lines.count == 0


def test_a_recording_shows_the_layers_that_it_holds(crowded, tmp_path):
    simulation = crowd.Simulation(crowd.load_scenario("plaza"), seed=3, characters=20, threads=1)
    with Recorder(tmp_path / "run.h5", simulation) as recorder:
        for _ in range(120):
            recorder.record(simulation.step())
    with crowd.Recording(tmp_path / "run.h5") as recording:
        seen = seen_of(recording, 0)
        for layer in ("velocity", "way", "disc", "neighbours", "feet", "skeleton", "limits"):
            lines = Collected()
            LAYERS[layer](lines, seen)
            assert lines.count > 0, layer


def test_neighbours_are_linked_from_the_nearest_on(crowded):
    row = walker_in_company(crowded)
    lines = Collected()
    LAYERS["neighbours"](lines, seen_of(crowded, row))
    state, settings = crowded.state, crowded.navigator.avoidance.settings
    found = crowded.navigator.avoidance.neighbors(
        state.position_world, crowded.model.people.radius, np.flatnonzero(state.is_active).astype(np.int32)
    )
    expected = found.character[row, : found.count[row]]
    assert found.count[row] <= settings.neighbor_count
    assert lines.end[0][:, [0, 2]] == pytest.approx(state.position_world[expected][:, [0, 2]])


def test_the_velocity_that_avoidance_takes_is_inside_of_the_half_planes_shown():
    """What the picture shows and what `Avoidance.steer` chooses must be of one kind."""
    random = np.random.default_rng(4)
    simulation = crowd.Simulation(crowd.load_scenario("plaza"), seed=3, characters=60, threads=1)
    for _ in range(240):
        simulation.step()
    state, navigator = simulation.state, simulation.navigator
    active = np.flatnonzero(state.is_active).astype(np.int32)
    chosen = np.zeros((simulation.model.capacity, 3))
    navigator.avoidance.steer(
        state.position_world,
        state.velocity_world,
        state.preferred_velocity_world,
        simulation.model.people.radius,
        navigator._maximum_speed,
        navigator._responsibility,
        active,
        simulation.model.world.walls,
        simulation.dt,
        chosen,
    )
    misses, restricted = 0, 0
    for row in random.permutation(active)[:40].tolist():
        lines, _ = navigator.half_planes(state, row, simulation.dt, simulation.seed)
        x, z = chosen[row, 0] - lines[:, 0], chosen[row, 2] - lines[:, 1]
        inside = lines[:, 2] * z - lines[:, 3] * x
        misses += int((inside < -1e-6).any())
        restricted += len(lines)
    assert restricted > 100
    # Where no velocity satisfies all, the least wrong one is taken.
    assert misses <= 4


def test_a_knee_bent_the_wrong_way_is_beyond_its_limit(crowded):
    seen = seen_of(crowded, 0)
    skeleton = seen.scene.skeleton
    row = np.array([int(seen.rows[0])])
    position, rotation = joint_positions(seen.frame, row)[0], joint_rotations(seen.frame, row)[0]
    colours = [colour for _, _, colour in limit_arcs(skeleton, position, rotation)]
    assert colours.count(BEYOND) == 0
    assert WITHIN in colours
    knee = skeleton.joint("left_shank")
    angle = float(skeleton.limit_lower[knee, 0]) - 0.5
    bent = rotation.copy()
    thigh = bent[skeleton.parent[knee]]
    turn = np.array([np.cos(angle / 2), np.sin(angle / 2), 0.0, 0.0])
    w, x, y, z = thigh
    p, q = turn[:2]
    bent[knee] = w * p - x * q, w * q + x * p, y * p + z * q, z * p - y * q
    wrong = [colour for _, _, colour in limit_arcs(skeleton, position, bent)]
    assert wrong.count(BEYOND) >= 1


def test_prints_appear_where_feet_are_put_down_and_fade():
    simulation = crowd.Simulation(crowd.load_scenario("plaza"), seed=3, characters=5, threads=1)
    overlays, source = Overlays(), source_of(simulation)
    overlays.toggle("feet")
    counts = []
    for _ in range(180):
        simulation.step()
        lines = Collected()
        overlays.prints.draw(lines, seen_of(simulation, -1))
        counts.append(lines.count)
    assert source.scene.name == "plaza"
    assert counts[0] == 0
    assert 10 < counts[-1] < 80


def test_the_map_has_walls_free_ground_and_distances_that_grow(crowded):
    grid = crowded.model.world.grid(0.25)
    plain = cells_of(grid, -1)
    free = np.asarray(grid.is_walkable).reshape(plain.shape[:2]) != 0
    assert (plain[free] == FREE).all()
    assert (plain[~free] == BLOCKED).all()
    goal = int(np.flatnonzero(grid.is_walkable)[0])
    told = cells_of(grid, goal)
    # Yellow at the goal, dark blue far away.
    near, far = told.reshape(-1, 4)[goal], told[free].astype(int)
    assert near[0] > 180 > far[:, 0].min()
