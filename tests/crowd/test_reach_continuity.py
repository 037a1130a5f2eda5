"""Reaches go on smoothly when hands come and go, when people crouch, and below what they cannot have."""

import numpy as np
import pytest

from crowd.bench.reach import (
    FASTEST,
    LARGEST_JITTER,
    LARGEST_RATIO,
    LEAST_MET,
    TOLERANCE,
    TURNING,
    TWIST,
    run_batch,
    run_both,
    send_on,
)
from crowd.bench.reachers import Reachers, angular_motion, random_targets, random_turns
from crowd.motion.easing import minimum_jerk
from crowd.motion.rotation import conjugate, from_vector, multiply
from crowd_kernels.reach_state import HOLD, MOVING, OUT_OF_REACH, REACHED

PEOPLE = 60


@pytest.fixture
def reachers():
    made = Reachers(PEOPLE, seed=5)
    for _ in range(3):
        made.step()
    return made


def frames(reachers, count):
    """Rotations (F, N, J, 4) over some steps."""
    found = []
    for _ in range(count):
        reachers.step()
        found.append(reachers.local_rotations())
    return found


def before_the_body(reachers, hand, rng):
    """Targets where people work with both hands, on the hand's own side."""
    target = rng.uniform((-0.45, 0.75, 0.3), (0.0, 1.5, 0.55), (PEOPLE, 3)) * reachers.size[:, None]
    return target * ((1, 1, 1) if hand == 0 else (-1, 1, 1))


def allowed(reachers):
    return LARGEST_RATIO * reachers.largest_example_acceleration


@pytest.mark.parametrize("first", [0, 1])
def test_nothing_jumps_when_the_second_hand_comes_and_goes_while_the_first_one_holds(reachers, first, rng):
    simulation, second = reachers.simulation, 1 - first
    end = simulation.reach.end
    shown = []
    reachers.reach(first, before_the_body(reachers, first, rng))
    shown += frames(reachers, 90)
    reachers.reach(second, before_the_body(reachers, second, rng))
    shown += frames(reachers, 100)
    assert (simulation.state.reach_status == REACHED).all()
    end(simulation.state, reachers.rows, second)
    shown += frames(reachers, 110)
    end(simulation.state, reachers.rows, first)
    shown += frames(reachers, 110)
    assert not simulation.state.reach_stage.any()
    assert angular_motion(np.array(shown), simulation.dt)[1] < allowed(reachers)


@pytest.mark.parametrize("hands", [(0,), (0, 1)])
def test_nothing_jumps_when_people_set_off_and_stop_while_their_hands_reach(reachers, hands, rng):
    """Examples of the whole body give way to those of the upper one, and come back."""
    state, shown = reachers.simulation.state, []
    begin = rng.uniform(0, 60, PEOPLE)
    for hand in hands:
        reachers.reach(hand, before_the_body(reachers, hand, rng))
    for frame in range(300):
        walking = minimum_jerk((frame - begin) / 40) - minimum_jerk((frame - begin - 120) / 40)
        # Those who only walk are posed by a layer that is not here.
        state.locomotion_weight[:] = 0.999 * walking
        shown += frames(reachers, 1)
    assert (state.reach_status[:, hands] == REACHED).all()
    assert angular_motion(np.array(shown), reachers.simulation.dt)[1] < allowed(reachers)


def sent_on(reachers, hand, has_rotation, rng):
    """Targets and rotations of hands that are sent on: anywhere, or to and fro where rotations are known."""
    anywhere = [random_targets(reachers, hand, rng, is_far=False) for _ in range(6)]
    if not has_rotation:
        return anywhere, [None] * 6
    ends = [run_batch(reachers, hand, target, None) for target in anywhere[:2]]
    way = [ends[time % 2] for time in range(5)]
    # Rotations are asked for, let go and asked for again on the way.
    return [end.target for end in way], [end.rotation if time != 2 else None for time, end in enumerate(way)]


@pytest.mark.parametrize("hand", [0, 1])
@pytest.mark.parametrize("has_rotation", [False, True])
def test_hands_that_are_sent_on_at_any_time_go_smoothly_to_their_last_target(hand, has_rotation, rng):
    """Between any targets in reach: behind and before, above the head and at the floor."""
    reachers = Reachers(200, seed=2)
    for _ in range(3):
        reachers.step()
    targets, rotations = sent_on(reachers, hand, has_rotation, rng)
    outcome = send_on(reachers, hand, targets, rotations, rng)
    assert (outcome.status == REACHED).all()
    assert np.linalg.norm(outcome.place - targets[-1], axis=1).max() < TOLERANCE
    assert outcome.acceleration < allowed(reachers)
    assert outcome.speed < FASTEST
    assert not reachers.simulation.state.reach_stage.any(), "hands have returned"


@pytest.mark.parametrize("walking", [0.0, 0.5])
def test_hands_that_are_sent_on_again_and_again_keep_a_pose(walking, rng):
    """More and more examples fade, of the whole body and of the upper one; people meet their last target."""
    reachers = Reachers(PEOPLE, seed=5)
    state = reachers.simulation.state
    for frame in range(200):
        state.locomotion_weight[:] = walking
        if frame % 8 == 0:
            target = random_targets(reachers, 0, rng, is_far=False)
            reachers.reach(0, target)
        reachers.step()
        used = (state.reach_example_weight[:, 0] != 0) | (state.reach_example_wanted[:, 0] != 0)
        assert np.isfinite(reachers.local_rotations()).all()
        np.testing.assert_allclose(state.reach_example_wanted[:, 0].sum(axis=1), 1.0, atol=1e-9)
    assert used.sum(axis=1).max() > 32, "the test asks for many"
    for _ in range(260):
        state.locomotion_weight[:] = 0.0
        reachers.step()
    assert np.linalg.norm(reachers.hand(0)[0] - target, axis=1).max() < TOLERANCE


def test_a_hand_that_is_let_go_on_its_way_to_another_place_does_not_linger(reachers, rng):
    state, end = reachers.simulation.state, reachers.simulation.reach.end
    reachers.reach(0, random_targets(reachers, 0, rng, is_far=False))
    frames(reachers, 25)
    reachers.reach(0, random_targets(reachers, 0, rng, is_far=False))
    frames(reachers, 6)
    end(state, reachers.rows, 0)
    frames(reachers, 90)
    assert not state.reach_stage.any()


@pytest.mark.parametrize("hand", [0, 1])
def test_what_is_wanted_may_change_while_a_hand_glides(reachers, hand, rng):
    """A turned grip carries the wrist along, and people sit down: neither makes the arm jump."""
    state = reachers.simulation.state
    first, second = (run_batch(reachers, hand, before_the_body(reachers, hand, rng), None) for _ in range(2))
    turned = multiply(from_vector(0.5 * random_turns(PEOPLE, rng)), second.rotation)
    state.reach_point_hand[:, hand] = (0.0, -0.09, 0.0)
    reachers.reach(hand, first.target, first.rotation)
    shown = frames(reachers, 100)
    for rotation in (second.rotation, turned):
        reachers.reach(hand, second.target, rotation)
        shown += frames(reachers, 12)
    shown += frames(reachers, 150)
    assert angular_motion(np.array(shown), reachers.simulation.dt)[1] < allowed(reachers)
    reachers.reach(hand, first.target, None)
    shown = shown[-2:] + frames(reachers, 8)
    state.is_seated[:] = True
    shown += frames(reachers, 150)
    assert angular_motion(np.array(shown), reachers.simulation.dt)[1] < 2 * allowed(reachers)


def test_a_second_hand_keeps_the_time_that_is_asked(reachers, rng):
    reachers.reach(0, before_the_body(reachers, 0, rng))
    frames(reachers, 90)
    reachers.reach(1, before_the_body(reachers, 1, rng))
    reachers.simulation.state.reach_seconds[:, 1] = 0.8
    frames(reachers, 50)
    assert (reachers.simulation.state.reach_course[:, 1] == 1.0).all()


@pytest.mark.parametrize("hand", [0, 1])
def test_targets_may_move_and_turn_and_jump_at_any_time(hand, rng):
    reachers = Reachers(200, seed=4)
    for _ in range(3):
        reachers.step()
    ends = [
        run_batch(reachers, hand, random_targets(reachers, hand, rng, is_far=False), None) for _ in range(2)
    ]
    way = [ends[time % 2] for time in range(5)]
    targets, rotations = [end.target for end in way], [end.rotation for end in way]
    outcome = send_on(reachers, hand, targets, rotations, rng, moves=True)
    assert (outcome.status == REACHED).all()
    assert np.linalg.norm(outcome.place - targets[-1], axis=1).max() < TOLERANCE
    assert outcome.acceleration < allowed(reachers)
    assert outcome.speed < FASTEST


@pytest.mark.parametrize("seed", [0, 2])
@pytest.mark.parametrize("times", [1, 2])
def test_both_hands_go_anywhere_at_any_time_and_nothing_jumps(seed, times, rng):
    """Also where nobody has both at once: one trunk bears both, and straight arms come into reach again."""
    reachers = Reachers(300, seed)
    for _ in range(3):
        reachers.step()
    outcomes = run_both(reachers, rng, times)
    met = np.mean([(outcome.status == REACHED).mean() for outcome in outcomes])
    assert met > LEAST_MET
    for outcome in outcomes:
        assert np.isin(outcome.status, (REACHED, OUT_OF_REACH)).all()
        away = np.linalg.norm(outcome.place - outcome.target, axis=1)
        assert away[outcome.status == REACHED].max() < TOLERANCE
        assert outcome.acceleration < allowed(reachers)
        assert outcome.speed < FASTEST
        assert outcome.jitter < LARGEST_JITTER
    assert not reachers.simulation.state.reach_stage.any(), "hands have returned"


@pytest.mark.parametrize("hand", [0, 1])
def test_hands_that_turn_back_while_they_are_sent_on_do_not_stop_dead(reachers, hand, rng):
    state, end = reachers.simulation.state, reachers.simulation.reach.end
    reachers.reach(hand, random_targets(reachers, hand, rng, is_far=False))
    shown = frames(reachers, 90)
    for wait in (10, 25):
        reachers.reach(hand, random_targets(reachers, hand, rng, is_far=False))
        shown += frames(reachers, wait)
        end(state, reachers.rows, hand)
        shown += frames(reachers, wait)
    reachers.reach(hand, random_targets(reachers, hand, rng, is_far=False))
    shown += frames(reachers, 180)
    assert (state.reach_status[:, hand] == REACHED).all()
    assert angular_motion(np.array(shown), reachers.simulation.dt)[1] < allowed(reachers)


@pytest.mark.parametrize("hand", [0, 1])
@pytest.mark.parametrize("is_far", [False, True])
def test_hands_rest_below_rotations_that_they_cannot_have(reachers, hand, is_far, rng):
    """Near targets are met all the same, and what of the rotation is out of reach is reported."""
    state = reachers.simulation.state
    target = random_targets(reachers, hand, rng, is_far=is_far)
    reachers.reach(hand, target)
    frames(reachers, 85)
    turned = multiply(from_vector(2.4 * random_turns(PEOPLE, rng)), reachers.hand(hand)[1])
    reachers.simulation.reach.end(state, reachers.rows, hand)
    frames(reachers, 110)
    reachers.reach(hand, target, turned)
    frames(reachers, 210)
    places = []
    for _ in range(20):
        reachers.step()
        places.append(reachers.hand(hand)[0])
    shaking = np.linalg.norm(np.diff(places, axis=0), axis=2).max(axis=0)
    assert shaking.max() < (1e-3 if is_far else LARGEST_JITTER)
    assert np.quantile(shaking, 0.95) < LARGEST_JITTER
    status = state.reach_status[:, hand]
    assert np.isin(status, (REACHED, OUT_OF_REACH)).all()
    assert (status == OUT_OF_REACH).mean() > 0.3
    angle = 2 * np.arccos(np.minimum(np.abs((turned * reachers.hand(hand)[1]).sum(axis=1)), 1))
    assert (angle[status == OUT_OF_REACH] > np.radians(0.9)).all() or is_far
    if not is_far:
        assert np.linalg.norm(places[-1] - target, axis=1).max() < 5e-3
        assert np.median(angle) < 2.4 / 2


def leg_motion(legs, dt):
    """Largest angular acceleration of thighs, shanks and feet over frames (F, N, 6, 4), in their order."""
    return [angular_motion(np.array(legs)[:, :, part::3], dt)[1] for part in range(3)]


@pytest.mark.parametrize("frame_rate", [60, 120])
@pytest.mark.parametrize("hand", [0, 1])
def test_legs_bend_and_straighten_smoothly_for_what_lies_low(hand, frame_rate, rng):
    """Knees start and stop as softly as those of the examples, above feet that stay in place."""
    reachers = Reachers(PEOPLE, seed=5, dt=1 / frame_rate)
    simulation = reachers.simulation
    legs = simulation.foot_lock.legs.joint[:, :3].ravel()
    target = rng.uniform((-0.5, 0.05, 0.2), (0.2, 0.5, 0.7), (PEOPLE, 3)) * reachers.size[:, None]
    rotations, balls, pelvis = [], [], []

    def watch(seconds):
        for _ in simulation.run(seconds=seconds):
            rotations.append(simulation.joint_rotations_local()[:, legs].astype(float))
            balls.append(simulation.state.foot_point_world[:, :, 1].copy())
            pelvis.append(simulation.pelvis_positions_root()[:, 1])

    watch(0.1)
    reachers.reach(hand, target * ((1, 1, 1) if hand == 0 else (-1, 1, 1)))
    watch(1.6)
    simulation.reach.end(simulation.state, reachers.rows, hand)
    watch(1.8)
    assert not simulation.state.reach_stage.any()
    assert np.median(np.ptp(pelvis, axis=0)) > 0.25, "people crouch"
    assert max(leg_motion(rotations, simulation.dt)) < allowed(reachers)
    assert np.abs(np.array(balls) - balls[0])[..., [0, 2]].max() < 1e-6


@pytest.mark.parametrize("hand", [0, 1])
def test_rotations_that_joints_cannot_have_are_sought_and_left_smoothly(reachers, hand, rng):
    """Joints come to rest softly at their limits, though the blended motion below carries them there."""
    state = reachers.simulation.state
    target = random_targets(reachers, hand, rng, is_far=False)
    turned = multiply(from_vector(2.4 * random_turns(PEOPLE, rng)), reachers.hand(hand)[1])
    reachers.reach(hand, target, turned)
    shown = frames(reachers, 130)
    assert (state.reach_status[:, hand] == OUT_OF_REACH).mean() > 0.3
    reachers.simulation.reach.end(state, reachers.rows, hand)
    shown += frames(reachers, 160)
    assert not state.reach_stage.any()
    assert angular_motion(np.array(shown), reachers.simulation.dt)[1] < allowed(reachers)


@pytest.mark.parametrize("hand", [0, 1])
def test_joints_slow_down_before_their_limits_wherever_they_cross_them(hand, rng):
    """Wrists of many people cross the narrow axis of their range, in its middle and far beside it."""
    reachers = Reachers(400, seed=0)
    for _ in range(3):
        reachers.step()
    target = random_targets(reachers, hand, rng, is_far=True)
    turned = multiply(from_vector(TWIST * random_turns(400, rng)), reachers.hand(hand)[1])
    outcome = run_batch(reachers, hand, target, turned, TURNING)
    assert (outcome.status == OUT_OF_REACH).all()
    assert outcome.speed < FASTEST
    assert outcome.acceleration < allowed(reachers)
    assert outcome.jitter < LARGEST_JITTER


def test_a_held_target_that_turns_is_followed_in_human_time(reachers, rng):
    simulation = reachers.simulation
    state = simulation.state
    target = before_the_body(reachers, 0, rng)
    reachers.reach(0, target)
    frames(reachers, 85)
    first = reachers.hand(0)[1]
    shown = frames(reachers, 1)
    turn = random_turns(PEOPLE, rng)
    reachers.reach(0, target, multiply(from_vector(turn), first))
    shown += frames(reachers, 10)
    assert (state.reach_status[:, 0] == MOVING).all()
    shown += frames(reachers, 80)
    assert (state.reach_status[:, 0] == REACHED).mean() > 0.5
    reachers.reach(0, target, multiply(from_vector(-turn), first))
    shown += frames(reachers, 10)
    assert (state.reach_status[:, 0] == MOVING).all()
    shown += frames(reachers, 80)
    assert (state.reach_status[:, 0] == REACHED).mean() > 0.5
    assert angular_motion(np.array(shown), simulation.dt)[1] < allowed(reachers)


@pytest.mark.parametrize("hand", [0, 1])
@pytest.mark.parametrize("fastest", [1.0, 3.0])
def test_hands_keep_their_place_and_follow_targets_that_turn_fast(reachers, hand, fastest, rng):
    """Targets turn to and fro by up to half a radian, at up to `fastest` rad/s, under hands that hold."""
    simulation, swing = reachers.simulation, 0.5
    state, dt = simulation.state, simulation.dt
    target = before_the_body(reachers, hand, rng)
    reachers.reach(hand, target)
    frames(reachers, 85)
    first = reachers.hand(hand)[1]
    reachers.reach(hand, target, first)
    shown = frames(reachers, 40)
    axis, heading = random_turns(PEOPLE, rng), state.reach_target_rotation_world[:, hand]
    heading = multiply(heading.copy(), conjugate(first))
    away, behind = [], []
    for frame in range(240):
        # Motion begins softly, as that of things in other hands does.
        angle = swing * min(frame * dt, 1.0) ** 3 * np.sin(fastest / swing * frame * dt)
        turned = multiply(from_vector(angle * axis), first)
        state.reach_target_rotation_world[:, hand] = multiply(heading, turned)
        shown += frames(reachers, 1)
        place, rotation = reachers.hand(hand)
        away.append(np.linalg.norm(place - target, axis=1))
        behind.append(2 * np.arccos(np.minimum(np.abs((rotation * turned).sum(axis=1)), 1)))
    away, behind = np.array(away), np.array(behind)
    assert away.max() < 1e-3
    assert behind.max() < 0.15 * fastest, "a hand follows within 0.15 s"
    assert angular_motion(np.array(shown), dt)[1] < allowed(reachers)


def test_a_second_start_before_the_first_step_moves_no_hand_at_once(reachers, rng):
    target = before_the_body(reachers, 0, rng)
    before = reachers.hand(0)[1]
    reachers.reach(0, target)
    reachers.reach(0, target, multiply(from_vector(random_turns(PEOPLE, rng)), before))
    reachers.step()
    same = np.abs((before * reachers.hand(0)[1]).sum(axis=1))
    assert (2 * np.arccos(np.minimum(same, 1))).max() < 0.01


def test_hands_that_must_turn_far_take_their_time(reachers, rng):
    state, dt = reachers.simulation.state, reachers.simulation.dt
    per_radian = reachers.simulation.reach.settings.limits.time_per_radian
    target = before_the_body(reachers, 0, rng)
    reachers.reach(0, target)
    frames(reachers, 85)
    natural = reachers.hand(0)[1]
    reachers.simulation.reach.end(state, reachers.rows, 0)
    frames(reachers, 110)
    angle = rng.uniform(0.0, 2.4, (PEOPLE, 1))
    reachers.reach(0, target, multiply(from_vector(angle * random_turns(PEOPLE, rng)), natural))
    arrived = np.zeros(PEOPLE)
    for frame in range(120):
        reachers.step()
        arrived[(state.reach_stage[:, 0] == HOLD) & (arrived == 0)] = (frame + 1) * dt
    least = per_radian * angle[:, 0]
    # The turn against the examples is a little more or less than that against the natural pose.
    assert arrived.all()
    assert (arrived > least - 0.2).all()
    # Small turns cost nothing.
    assert arrived[least < 0.5].max() < 1.1
