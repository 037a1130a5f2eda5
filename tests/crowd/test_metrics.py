"""Metrics say what happened: overlaps, walls, slip, steady motion; recordings give the same figures."""

import numpy as np
import pytest
import shapely

import crowd
from crowd.metrics import FootMetrics, Histogram, Metrics, MotionMetrics, Observation
from crowd.scenario.checks import METRIC_KEYS

DT = 1 / 60


def frame(time, position, **changes):
    """A frame of people who stand at ground points (N, 2)."""
    count = len(position)
    world = np.zeros((count, 3))
    world[:, [0, 2]] = position
    values = {
        "time": time,
        "is_active": np.ones(count, bool),
        "is_finished": np.zeros(count, bool),
        "spawn_count": np.ones(count, int),
        "position_world": world,
        "yaw": np.zeros(count),
        "radius": np.full(count, 0.25),
        "locomotion_parameter": np.zeros((count, 3)),
        "locomotion_weight": np.ones(count),
        "foot_contact": np.zeros((count, 2), np.uint8),
        "foot_point_world": np.zeros((count, 2, 2, 3)),
        "obstacles": shapely.STRtree([]),
        "deepest_overlap": 0.0,
    }
    return Observation(**(values | changes))


def test_overlap_is_the_depth_of_the_deepest_pair():
    metrics = Metrics()
    metrics.add(frame(0.1, [(0, 0), (0.47, 0), (3, 0)]))
    metrics.add(frame(0.3, [(0, 0), (0.60, 0), (3, 0)]))
    assert metrics.as_dict()["overlap.max_depth_m"] == pytest.approx(0.03)
    metrics.add(frame(0.32, [(0, 0), (0.60, 0), (3, 0)], deepest_overlap=0.04))
    assert metrics.as_dict()["overlap.max_depth_m"] == pytest.approx(0.04), "steps between samples count"


def test_walls_and_crossings():
    wall = shapely.STRtree([shapely.LineString([(0, -5), (0, 5)])])
    metrics = Metrics()
    for number, x in enumerate((-1.0, -0.22, 0.3)):
        metrics.add(frame(0.2 * number, [(x, 0)], obstacles=wall))
    result = metrics.as_dict()
    assert result["wall.max_depth_m"] == pytest.approx(0.03)
    assert result["wall.crossings"] == 1
    metrics.add(frame(2.0, [(-4.0, 0)], obstacles=wall, spawn_count=np.array([2])))
    assert metrics.as_dict()["wall.crossings"] == 1, "who enters anew has crossed nothing"


def test_slip_is_the_net_drift_of_each_stance():
    feet = FootMetrics()
    for step in range(200):
        contact = np.zeros((1, 2), np.uint8)
        point = np.zeros((1, 2, 2, 3))
        in_stance = step % 50
        if in_stance < 30:
            contact[0, 0] = 1 if in_stance < 10 else 2
            point[0, 0, 0, 2] = 0.001 * in_stance
            point[0, 0, 1, 2] = 5.0 + 0.002 * in_stance
        feet.add(frame(step * DT, [(0, 0)], foot_contact=contact, foot_point_world=point))
    result = feet.as_dict()
    assert result["foot_slip.stances"] == 4
    # Nine steps of 1 mm on the heel, then nineteen of 2 mm on the ball.
    assert result["foot_slip.mean_m"] == pytest.approx(0.047, abs=1e-6)
    assert result["foot_slip.max_m"] == pytest.approx(0.047, abs=1e-6)


def motion(asked, done, seconds=5.0, jitter=0.0):
    metrics = MotionMetrics()
    position = np.zeros((1, 2))
    rng = np.random.default_rng(0)
    for step in range(round(seconds / DT)):
        parameter = np.array([[asked[0] + jitter * rng.normal(), asked[1], 0.0]])
        yaw = np.array([done[1] * step * DT])
        position = position + done[0] * DT * np.array([[np.sin(yaw[0]), np.cos(yaw[0])]])
        metrics.add(frame(step * DT, position, yaw=yaw, locomotion_parameter=parameter))
    return metrics.as_dict()


def test_motion_errors_are_relative_speed_and_turn_rate():
    result = motion((1.0, 0.5), (1.1, 0.6))
    assert result["locomotion.speed_rms_relative"] == pytest.approx(0.1, abs=2e-3)
    assert result["locomotion.turn_rms_deg_s"] == pytest.approx(np.degrees(0.1), abs=0.05)
    assert motion((1.0, 0.0), (1.0, 0.0))["locomotion.speed_rms_relative"] < 1e-9


def test_windows_with_a_changing_command_do_not_count():
    assert "locomotion.windows" not in motion((1.0, 0.0), (1.0, 0.0), jitter=0.2)


def test_histogram_percentiles_and_exact_moments(rng):
    values = rng.gamma(2.0, 0.01, 5000)
    histogram = Histogram(1e-4, 1.0)
    histogram.add(values)
    assert histogram.mean == pytest.approx(values.mean())
    assert histogram.maximum == values.max()
    assert histogram.percentile(0.95) == pytest.approx(np.quantile(values, 0.95), abs=2e-4)
    assert Histogram(1.0, 1.0).percentile(0.5) == 0.0


def test_a_recording_measures_like_its_run(tmp_path):
    scenario = crowd.load_scenario("circle_swap")
    simulation = crowd.Simulation(scenario, seed=2, characters=12)
    with crowd.Recorder(tmp_path / "run.h5", simulation, every=1) as recorder:
        for step in simulation.run(seconds=4.0):
            recorder.record(step)
    live, recorded = simulation.metrics.as_dict(), crowd.measure(tmp_path / "run.h5")
    assert set(live) == set(recorded)
    assert recorded["foot_slip.stances"] == pytest.approx(live["foot_slip.stances"], abs=12)
    assert recorded["foot_slip.mean_m"] == pytest.approx(live["foot_slip.mean_m"], abs=2e-4)
    assert recorded["overlap.max_depth_m"] <= live["overlap.max_depth_m"] + 1e-6
    assert set(live) <= set(METRIC_KEYS)
