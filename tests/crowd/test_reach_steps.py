"""Reaches in steps of any size, from folded arms, after long waits, and to what never rests."""

import numpy as np
import pytest

from crowd.bench.reach import (
    FASTEST,
    LARGEST_RATIO,
    LEAST_MET,
    MOST_BEYOND,
    TOLERANCE,
    run_batch,
    run_both,
    send_on,
)
from crowd.bench.reachers import Reachers, angular_motion, beyond_limits, random_targets, random_turns
from crowd.motion.rotation import conjugate, from_vector, multiply
from crowd_kernels.reach_state import OUT_OF_REACH, REACHED
from tests.oracles import ik as oracle

PEOPLE = 60
every_rate = pytest.mark.parametrize("rate", [30, 120])


def reachers_at(rate, people=PEOPLE):
    made = Reachers(people, seed=6, dt=1 / rate)
    for _ in range(3):
        made.step()
    return made


def allowed(reachers):
    return LARGEST_RATIO * reachers.largest_example_acceleration


def check_smooth(reachers, outcome):
    assert outcome.beyond < MOST_BEYOND
    assert outcome.acceleration < allowed(reachers)
    assert outcome.speed < FASTEST
    away = np.linalg.norm(outcome.place - outcome.target, axis=1)
    assert away[outcome.status == REACHED].max() < TOLERANCE


@every_rate
@pytest.mark.parametrize("moves", [False, True])
def test_hands_are_sent_on_smoothly_in_steps_of_any_size(rate, moves, rng):
    reachers = reachers_at(rate)
    ends = [run_batch(reachers, 0, random_targets(reachers, 0, rng, is_far=False), None) for _ in range(2)]
    way = [ends[time % 2] for time in range(4)]
    outcome = send_on(
        reachers, 0, [end.target for end in way], [end.rotation for end in way], rng, moves=moves
    )
    assert (outcome.status == REACHED).all()
    check_smooth(reachers, outcome)


@every_rate
def test_both_hands_go_anywhere_smoothly_in_steps_of_any_size(rate, rng):
    reachers = reachers_at(rate, 150)
    outcomes = run_both(reachers, rng, 2)
    assert np.mean([(outcome.status == REACHED).mean() for outcome in outcomes]) > LEAST_MET
    for outcome in outcomes:
        assert np.isin(outcome.status, (REACHED, OUT_OF_REACH)).all()
        check_smooth(reachers, outcome)


@pytest.mark.parametrize("rate", [30, 60, 240])
@pytest.mark.parametrize("acceleration", [1.0, 3.2, 6.0, 11.0])
def test_targets_that_go_round_and_round_are_met(rate, acceleration, rng):
    """A target that sets off at once jumps; then it is followed as `ReachLimits.acceleration` says."""
    reachers, radius = reachers_at(rate), 0.06
    middle = rng.uniform((-0.3, 0.9, 0.35), (0.0, 1.4, 0.5), (PEOPLE, 3)) * reachers.size[:, None]
    spin = np.sqrt(acceleration / radius)
    met = []
    for frame in range(5 * rate):
        angle = spin * frame / rate
        target = middle + radius * np.array([np.cos(angle), np.sin(angle), 0.0])
        if frame == 0:
            reachers.reach(0, target)
        reachers.move(0, target, None, reachers.rows)
        reachers.step()
        if frame > 3.5 * rate:
            assert (reachers.simulation.state.reach_time_left[:, 0] == 0.0).all(), "nobody glides any more"
            met.append(np.linalg.norm(reachers.hand(0)[0] - target, axis=1))
    # Two rounds a second in steps of 26 degrees: joints that may only accelerate gradually lag behind.
    is_coarse = spin / rate > 0.4
    assert np.max(met) < (4e-3 if is_coarse else TOLERANCE)
    assert is_coarse or (reachers.simulation.state.reach_status[:, 0] == REACHED).all()


@pytest.mark.parametrize("begins_anew", [False, True])
def test_a_hand_follows_new_rotations_however_long_the_other_one_has_waited_in_vain(begins_anew, rng):
    reachers = reachers_at(60)
    state, half = reachers.simulation.state, 2.0 * random_turns(PEOPLE, rng)
    target = rng.uniform((-0.3, 0.9, 0.35), (-0.1, 1.3, 0.5), (PEOPLE, 3)) * reachers.size[:, None]
    reachers.reach(0, target)
    for _ in range(85):
        reachers.step()
    rotation = reachers.hand(0)[1]
    reachers.reach(0, target, rotation)
    reachers.reach(1, random_targets(reachers, 1, rng, is_far=True))
    for _ in range(20 * 60):
        reachers.step()
    waits = (state.reach_status[:, 0] == REACHED) & (state.reach_status[:, 1] == OUT_OF_REACH)
    assert waits.sum() > 8
    turn = 0.2 * half
    if begins_anew:
        reachers.reach(0, target, multiply(from_vector(turn), rotation))
    for frame in range(240):
        share = min(frame / 60, 1.0)
        turned = multiply(from_vector((1.0 if begins_anew else share) * turn), rotation)
        if not begins_anew:
            reachers.move(0, target, turned, reachers.rows)
        reachers.step()
    behind = multiply(conjugate(reachers.hand(0)[1]), turned)
    angle = 2.0 * np.arccos(np.minimum(np.abs(behind[:, 0]), 1.0))
    assert np.quantile(angle[waits], 0.9) < np.radians(1.0)


@pytest.mark.parametrize("clip", ["arms_folded", "hands_on_hips"])
@pytest.mark.parametrize("hands", [(0,), (0, 1)])
def test_people_reach_from_folded_arms_and_go_back_to_them_smoothly(clip, hands, rng):
    reachers = reachers_at(60, 200)
    simulation = reachers.simulation
    state, model = simulation.state, simulation.model
    names = [model.clip_table.names[number] for number in model.idle_clips]
    state.idle_clip[:] = names.index(clip)
    state.idle_time[:] = rng.uniform(3.0, 4.0, (200, 1))
    state.idle_mix[:], state.idle_until[:] = 1.0, np.inf
    reachers.step()
    for hand in hands:
        near = rng.uniform((-0.35, 0.85, 0.25), (-0.05, 1.3, 0.4), (200, 3)) * reachers.size[:, None]
        reachers.reach(hand, near * ((1, 1, 1) if hand == 0 else (-1, 1, 1)))
    shown = []
    for frame in range(330):
        if frame == 160:
            for hand in hands:
                simulation.reach.end(state, reachers.rows, hand)
        # Arms stay folded all the time.
        state.idle_time[:] = np.minimum(state.idle_time, 4.5)
        reachers.step()
        shown.append(reachers.local_rotations())
    # For itself this leaves room for what else people do.
    assert angular_motion(np.array(shown), simulation.dt)[1] < reachers.largest_example_acceleration


def test_how_far_joints_are_beyond_their_limits_is_what_the_oracle_says(rng):
    """Of poses whose elbows, wrists and shoulders are far beyond, and of one at rest."""
    reachers = reachers_at(60)
    tree = reachers.simulation.reach.tree
    rotation = reachers.simulation.joint_rotations_local().astype(float)
    assert beyond_limits(tree, rotation) == 0.0
    for k in np.flatnonzero((tree.is_limited != 0) & (tree.weight > 0)):
        turned = rotation[:1].copy()
        joint = tree.joint[k]
        turned[0, joint] = multiply(from_vector(rng.normal(0.0, 0.8, 3)), turned[0, joint])
        swing, twist = oracle.split(tree, k, turned[0, joint])
        low, high = 2.0 * np.arctan(tree.twist[k].astype(float))
        beyond = max(twist - high, low - twist, 0.0) if tree.is_free[k, 2] else 0.0
        share = max(np.linalg.norm(swing * tree.inverse_swing[k]), 1.0)
        size = np.linalg.norm(swing)
        beyond = max(beyond, 2.0 * (np.arcsin(size) - np.arcsin(size / share)))
        assert beyond_limits(tree, turned) == pytest.approx(beyond, abs=1e-5)
