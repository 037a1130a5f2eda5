"""Commands, gait state and root motion against slow twins, and what a walker would notice."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from crowd_kernels.locomotion import (
    CommandLimits,
    GaitLimits,
    approach_crowd,
    ease,
    gait_crowd,
    integrate_root_crowd,
    prefer_crowd,
    wish_crowd,
    wrapped_angle,
)
from tests.oracles import locomotion as oracle

LIMITS = CommandLimits(0.35, 0.5, 2.6, 2.5, 1.6, 2.6, 2.2, 8.0)
GAIT = GaitLimits(0.12, 0.3, 0.08, 0.12, 14.0)
DT = 1 / 60
COUNT = 75


def ground_vectors(rng, count=COUNT, size=3.0):
    vectors = rng.normal(0, size, (count, 3))
    vectors[:, 1] = 0
    return vectors


def everyone(count=COUNT):
    return np.arange(count, dtype=np.int32)


def command(rng, count=COUNT, **changes):
    """Run `wish_crowd` and `approach_crowd` on random characters and return all its arrays by name."""
    arrays = {
        "yaw": rng.uniform(-math.pi, math.pi, count),
        "position_world": ground_vectors(rng, count),
        "way_point_world": ground_vectors(rng, count),
        "desired_velocity_world": ground_vectors(rng, count, 1.0),
        "wants_to_walk": rng.random(count) < 0.8,
        "is_directed": np.zeros(count, bool),
        "directed_parameter": np.zeros((count, 3)),
        "stride_scale": np.ones(count),
        "tempo": np.ones(count),
        "active": everyone(count),
        "limits": LIMITS,
        "dt": DT,
        "heading_velocity_world": ground_vectors(rng, count, 1.0),
        "turning_side": rng.integers(-1, 2, count).astype(np.int8),
        "locomotion_parameter": rng.normal(0, 1, (count, 3)),
        "out_wanted_parameter": np.zeros((count, 3)),
        "out_library_parameter": np.zeros((count, 3)),
    } | changes
    wish_crowd(*(array for name, array in arrays.items() if name != "locomotion_parameter"))
    approach_crowd(
        arrays["out_library_parameter"].copy(),
        arrays["stride_scale"],
        arrays["tempo"],
        arrays["active"],
        arrays["limits"],
        arrays["dt"],
        arrays["locomotion_parameter"],
        arrays["out_library_parameter"],
    )
    return arrays


def test_preferred_velocity_matches_oracle(rng):
    position, way_point = ground_vectors(rng), ground_vectors(rng)
    way_point[0] = position[0]
    yaw, remaining = rng.uniform(-math.pi, math.pi, COUNT), rng.uniform(0, 4, COUNT)
    speed, slows = rng.uniform(0, 2, COUNT), rng.random(COUNT) < 0.5
    out = np.zeros((COUNT, 3))
    prefer_crowd(position, yaw, way_point, remaining, speed, slows, everyone(), 0.8, 0.7, 1.9, out)
    for i in range(COUNT):
        wanted = oracle.prefer(
            position[i], yaw[i], way_point[i], remaining[i], speed[i], slows[i], 0.8, 0.7, 1.9
        )
        np.testing.assert_allclose(out[i], wanted, atol=1e-12)


def test_command_matches_oracle():
    before = command(np.random.default_rng(3), active=np.zeros(0, np.int32))
    after = command(np.random.default_rng(3))
    for i in range(COUNT):
        heading, side, parameter, wanted = oracle.command(
            before["yaw"][i],
            before["position_world"][i],
            before["way_point_world"][i],
            before["desired_velocity_world"][i],
            before["wants_to_walk"][i],
            before["heading_velocity_world"][i],
            before["turning_side"][i],
            before["locomotion_parameter"][i],
            LIMITS,
            DT,
        )
        np.testing.assert_allclose(after["heading_velocity_world"][i], heading, atol=1e-12)
        np.testing.assert_allclose(after["locomotion_parameter"][i], parameter, atol=1e-9)
        np.testing.assert_allclose(after["out_wanted_parameter"][i], wanted, atol=1e-9)
        assert after["turning_side"][i] == side


def test_library_parameters_are_scaled_by_stride_and_tempo(rng):
    scale, tempo = rng.uniform(0.8, 1.2, COUNT), rng.uniform(0.9, 1.1, COUNT)
    arrays = command(rng, stride_scale=scale, tempo=tempo)
    position, yaw, realised = np.zeros((COUNT, 3)), np.zeros(COUNT), np.zeros((COUNT, 3))
    integrate_root_crowd(
        arrays["out_library_parameter"], scale, tempo, everyone(), DT, position, yaw, realised
    )
    np.testing.assert_allclose(realised, arrays["locomotion_parameter"], rtol=1e-12)


def test_directed_characters_ignore_steering(rng):
    directed = rng.uniform(-0.02, 0.02, (COUNT, 3))
    arrays = command(
        rng,
        is_directed=np.ones(COUNT, bool),
        directed_parameter=directed,
        locomotion_parameter=np.zeros((COUNT, 3)),
    )
    np.testing.assert_allclose(arrays["locomotion_parameter"], directed, atol=1e-12)


def test_nobody_wavers_with_the_way_straight_behind():
    count = 1000
    rng = np.random.default_rng(5)
    yaw = rng.uniform(-math.pi, math.pi, count)
    back = np.stack([-np.sin(yaw), np.zeros(count), -np.cos(yaw)], axis=1) * 5
    side = np.zeros(count, np.int8)
    parameter, heading, library = np.zeros((count, 3)), np.zeros((count, 3)), np.zeros((count, 3))
    position = np.zeros((count, 3))
    sides = []
    for _ in range(120):
        command(
            rng,
            count,
            yaw=yaw,
            position_world=position,
            way_point_world=back + rng.normal(0, 0.02, (count, 3)),
            desired_velocity_world=np.zeros((count, 3)),
            wants_to_walk=np.ones(count, bool),
            heading_velocity_world=heading,
            turning_side=side,
            locomotion_parameter=parameter,
            out_library_parameter=library,
        )
        integrate_root_crowd(
            library, np.ones(count), np.ones(count), everyone(count), DT, position, yaw, parameter
        )
        sides.append(np.sign(parameter[:, 1]))
    first = sides[0]
    error = np.abs(np.angle(np.exp(1j * (np.arctan2(back[:, 0], back[:, 2]) - yaw))))
    assert (error < 0.15).all(), "everyone has turned round after two seconds"
    assert all(
        (turn[np.abs(parameter[:, 1]) > 0.5] == first[np.abs(parameter[:, 1]) > 0.5]).all() for turn in sides
    )


@given(
    value=st.floats(-2, 2),
    rate=st.floats(-5, 5),
    goal=st.sampled_from([0.0, 1.0]),
    stiffness=st.floats(1, 30),
)
@settings(max_examples=25, deadline=None)
def test_ease_is_the_critically_damped_spring(value, rate, goal, stiffness):
    np.testing.assert_allclose(
        ease(value, rate, goal, stiffness, DT),
        oracle.spring(value, rate, goal, stiffness, DT, 400),
        atol=1e-5,
    )


def test_ease_does_not_depend_on_the_step():
    one = ease(0.2, 1.0, 1.0, 12.0, 0.1)
    value = (0.2, 1.0)
    for _ in range(10):
        value = ease(value[0], value[1], 1.0, 12.0, 0.01)
    np.testing.assert_allclose(value, one, atol=1e-12)


@given(angle=st.floats(-1e4, 1e4))
@settings(deadline=None)
def test_wrapped_angle_is_equivalent_and_in_range(angle):
    wrapped = wrapped_angle(angle)
    assert -math.pi < wrapped <= math.pi
    assert math.isclose(math.cos(wrapped), math.cos(angle), abs_tol=1e-8)
    assert math.isclose(math.sin(wrapped), math.sin(angle), abs_tol=1e-8)


def test_root_follows_the_arc(rng):
    parameter = rng.normal(0, 1.5, (COUNT, 3))
    position, yaw = ground_vectors(rng), rng.uniform(-math.pi, math.pi, COUNT)
    new_position, new_yaw, realised = position.copy(), yaw.copy(), np.zeros((COUNT, 3))
    ones = np.ones(COUNT)
    integrate_root_crowd(parameter, ones, ones, everyone(), DT, new_position, new_yaw, realised)
    for i in range(COUNT):
        wanted, heading = oracle.integrate_root(position[i], yaw[i], parameter[i], DT)
        np.testing.assert_allclose(new_position[i], wanted, atol=1e-8)
        assert abs(math.remainder(new_yaw[i] - heading, math.tau)) < 1e-9


def test_a_full_circle_ends_where_it_began():
    parameter = np.array([[1.2, 0.5, 0.1]])
    position, yaw, realised, one = np.zeros((1, 3)), np.zeros(1), np.zeros((1, 3)), np.ones(1)
    steps = 600
    dt = 2 * math.pi / 0.5 / steps
    for _ in range(steps):
        integrate_root_crowd(parameter, one, one, everyone(1), dt, position, yaw, realised)
    np.testing.assert_allclose(position, 0, atol=1e-4)


def run_gait(wanted, seconds, present=None, phase=0.3, weight=0.0):
    """Run one character's gait state; returns lists of weight, phase and is_moving per step."""
    wanted = np.array([wanted], float)
    present = wanted.copy() if present is None else np.array([present], float)
    is_moving = np.array([weight > 0.5])
    weights, rates, phases = np.array([weight]), np.zeros(1), np.array([phase])
    history = []
    for _ in range(round(seconds / DT)):
        gait_crowd(
            wanted,
            present,
            np.array([0.9]),
            np.ones(1),
            everyone(1),
            GAIT,
            DT,
            is_moving,
            weights,
            rates,
            phases,
        )
        history.append((weights[0], phases[0], bool(is_moving[0])))
    return history


@pytest.mark.parametrize(
    ("wanted", "first"), [((0.5, 0.6, 0), 0.04), ((0.5, -0.6, 0), 0.54), ((0, 0, 0.4), 0.04)]
)
def test_a_start_lifts_the_foot_on_the_side_of_the_turn(wanted, first):
    history = run_gait(wanted, 1.0)
    assert history[0][1] == pytest.approx(first + 0.9 * DT)
    weights = [h[0] for h in history]
    assert weights[-1] == 1.0
    assert np.all(np.diff(weights) >= 0)


def test_a_stop_waits_for_double_support_and_eases_out():
    history = run_gait((0, 0, 0), 2.0, weight=1.0, phase=0.7)
    stopped = next(i for i, h in enumerate(history) if not h[2])
    assert (2 * history[stopped - 1][1]) % 1.0 < 0.16 or (2 * history[stopped][1]) % 1.0 < 0.2
    assert history[-1][0] == 0.0
    assert history[-1][1] == history[-2][1], "the phase rests while standing"


def test_only_active_rows_change(rng):
    arrays = command(rng, active=np.array([2, 5], np.int32))
    changed = np.flatnonzero(np.abs(arrays["out_wanted_parameter"]).sum(axis=1))
    assert set(changed) <= {2, 5}
