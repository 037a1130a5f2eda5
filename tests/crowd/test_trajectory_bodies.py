"""Bodies for trajectories: exactly where the points are, facing where they go, with planted feet."""

from pathlib import Path

import numpy as np
import pytest

import crowd
from crowd.trajectories import Trajectories, Way, open_recording
from crowd.trajectories.following import motion_along

ZARA = Path(__file__).resolve().parents[2] / "../shared/data/ucy_zara01"
DT = 1.0 / 60.0


def curved_way(number=1, begin=0.0, rate=5.0, seconds=8.0):
    """Along a circle of 5 m, then a stop, at 1.25 m/s."""
    time = np.arange(0.0, seconds, 1.0 / rate)
    angle = 0.25 * np.minimum(time, 5.0)
    return Way(number, time + begin, 5.0 * np.stack([1.0 - np.cos(angle), np.sin(angle)], axis=1))


def test_bodies_are_at_the_samples_when_these_were_taken():
    way = curved_way(rate=6.0)
    simulation = crowd.FollowingSimulation(Trajectories("circle", (way,)), threads=1)
    places = {}
    while not simulation.is_finished:
        frame = simulation.step()
        if simulation.state.is_active[0]:
            places[round(frame.time / DT)] = simulation.state.position_world[0, [0, 2]].copy()
    for time, position in zip(way.time[1:], way.position[1:], strict=True):
        assert places[round(time / DT)] == pytest.approx(position, abs=1e-9)


def test_people_face_where_they_go_and_stand_where_the_point_stands():
    simulation = crowd.FollowingSimulation(Trajectories("circle", (curved_way(),)), threads=1)
    errors = []
    for _ in range(round(7.5 / DT)):
        frame = simulation.step()
        if 1.0 < frame.time < 4.5:
            # The circle's tangent.
            away = 0.25 * frame.time - simulation.state.yaw[0]
            errors.append(abs(np.remainder(away + np.pi, 2 * np.pi) - np.pi))
    assert max(errors) < 0.15
    assert simulation.state.locomotion_weight[0] < 0.01
    assert np.abs(simulation.state.velocity_world[0]).max() < 0.01


def test_feet_stay_where_they_are_put_down():
    ways = tuple(curved_way(number, 0.7 * number) for number in range(6))
    simulation = crowd.FollowingSimulation(Trajectories("circles", ways), threads=1)
    while not simulation.is_finished:
        simulation.step()
    figures = simulation.metrics.as_dict()
    assert figures["foot_slip.stances"] > 60
    assert figures["foot_slip.mean_m"] < 0.001
    assert figures["foot_slip.max_m"] < 0.03


def test_a_swaying_head_does_not_change_the_speed_of_the_walk():
    time = np.arange(0.0, 10.0, 0.04)
    sway = 0.04 * np.sin(2 * np.pi * 1.8 * time)
    way = Way(1, time, np.stack([sway, 1.3 * time], axis=1))
    steps = np.arange(1, 596) * DT
    motion = motion_along(way, steps, DT)
    assert motion[:, 0] == pytest.approx(0.04 * np.sin(2 * np.pi * 1.8 * steps), abs=2e-3)
    assert np.hypot(*motion[60:-60, 2:].T) == pytest.approx(1.3, rel=0.01)


def test_ways_come_and_go_and_slots_are_used_again():
    ways = tuple(curved_way(number, 3.0 * number, seconds=4.0) for number in range(5))
    trajectories = Trajectories("one after the other", ways)
    simulation = crowd.FollowingSimulation(trajectories, threads=1)
    assert simulation.model.capacity == trajectories.most_present(DT) == 2
    present = []
    while not simulation.is_finished:
        simulation.step()
        present.append(int(simulation.state.is_active.sum()))
    assert set(present) == {0, 1, 2} or set(present) == {1, 2}
    assert simulation.state.spawn_count.sum() == 5
    assert simulation.time == pytest.approx(3.0 * 4 + 3.8, abs=0.1)


def test_a_point_that_is_seen_once_and_one_that_never_moves_get_bodies():
    still = Way(2, np.array([0.0, 1.0, 2.0]), np.tile([3.0, 1.0], (3, 1)))
    ways = (Way(1, np.array([0.5]), np.array([[1.0, 2.0]])), still)
    simulation = crowd.FollowingSimulation(Trajectories("two", ways), threads=1)
    while not simulation.is_finished:
        simulation.step()
    assert simulation.state.spawn_count.sum() == 2
    assert np.isfinite(simulation.joint_positions_world()).all()


def test_trajectories_open_as_a_recording_and_walls_come_along(tmp_path):
    lines = [f"{0.2 * k},{n},{0.25 * k},{n}" for k in range(20) for n in (1, 2)]
    (tmp_path / "two.csv").write_text("\n".join(lines))
    with crowd.open_recording(tmp_path / "two.csv") as recording:
        assert recording.character_count == 2
        assert recording.time[-1] == pytest.approx(3.8, abs=0.05)
    with open_recording(tmp_path / "two.csv", record=tmp_path / "kept.h5") as recording:
        assert recording.path == tmp_path / "kept.h5"
    with crowd.open_recording(tmp_path / "kept.h5") as recording:
        assert recording.scenario_name == "two.csv"


@pytest.mark.skipif(not ZARA.is_dir(), reason="needs the UCY tracks of shared/data")
def test_observed_people_of_zara_walk_with_planted_feet():
    simulation = crowd.FollowingSimulation(read_zara(40.0), threads=1)
    while not simulation.is_finished:
        simulation.step()
    figures = simulation.metrics.as_dict()
    assert figures["foot_slip.stances"] > 150
    assert figures["foot_slip.mean_m"] < 0.002
    assert figures["foot_slip.p95_m"] < 0.01


def read_zara(seconds):
    """Tracks that begin in the first seconds: splines over the frame number, pixels by a homography to m."""
    to_ground = np.loadtxt(ZARA / "H.txt")
    lines = [line.split(" - ")[0].split() for line in (ZARA / "annotation.vsp").read_text().splitlines()]
    rows = iter([line for line in lines if line])
    ways = []
    for number in range(int(next(rows)[0])):
        points = np.array([next(rows)[:3] for _ in range(int(next(rows)[0]))], float)
        ground = np.c_[288.0 - points[:, 1], 360.0 + points[:, 0], np.ones(len(points))] @ to_ground.T
        if points[0, 2] < 25.0 * seconds:
            ways.append(Way(number, points[:, 2] / 25.0, ground[:, :2] / ground[:, 2:]))
    return Trajectories("zara01", tuple(sorted(ways, key=lambda way: way.time[0])))
