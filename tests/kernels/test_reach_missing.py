"""What hands could not have: it is found, spared in the next step, and fades."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from crowd.controllers.reach import built_in_reach_space
from crowd_kernels.clip import PADDED_JOINTS
from crowd_kernels.reach_missing import (
    BOTH,
    SLIGHT,
    SLIGHT_TURN,
    find_missing_crowd,
    spare_missing_place,
    spare_missing_turn,
)
from crowd_kernels.reach_state import ReachState
from tests.oracles import reach as oracle

KEYS = built_in_reach_space().keys
COUNT = 5
DT = 1.0 / 60.0
SCALE = np.linspace(0.9, 1.1, 20, dtype=np.float32)


def scipy_rotation(q):
    return Rotation.from_quat(np.asarray(q, float)[..., [1, 2, 3, 0]])


def quaternion(r):
    return r.as_quat()[..., [3, 0, 1, 2]]


@pytest.fixture
def state(rng):
    arrays = {name: np.zeros((COUNT, 2)) for name in ReachState._fields}
    for name in ("missing_place", "missing_turn", "point_hand"):
        arrays[name] = rng.uniform(-0.8, 0.8, (COUNT, 2, 3))
    return ReachState(**arrays)


@pytest.fixture
def poses():
    q = quaternion(Rotation.random(COUNT * PADDED_JOINTS, random_state=1)).reshape(COUNT, PADDED_JOINTS, 4)
    return np.ascontiguousarray(np.moveaxis(q, 2, 1).reshape(COUNT, -1), np.float32)


def hands(poses, pelvis, point):
    """Points and rotations of both hands of all poses, (N, 2, 3) and (N, 2, 4)."""
    local = poses.reshape(COUNT, 4, -1)[:, :, KEYS.joint].transpose(0, 2, 1).astype(float)
    place, turned = np.zeros((COUNT, 2, 3)), np.zeros((COUNT, 2, 4))
    for person, row in enumerate(local):
        body = SCALE[KEYS.leg_segment] * pelvis[person]
        for arm in (0, 1):
            hand, frame = oracle.place_hand(KEYS, arm, SCALE, body, row)
            place[person, arm] = hand + scipy_rotation(frame).apply(point[person, arm])
            turned[person, arm] = frame
    return place, turned


def test_what_is_missing_is_what_was_wanted_against_what_came(rng, state, poses):
    pelvis = rng.normal(size=(COUNT, 3)).astype(np.float32)
    place, frame = hands(poses, pelvis, state.point_hand)
    turn = Rotation.from_rotvec(rng.uniform(-0.8, 0.8, (COUNT * 2, 3)))
    spared = Rotation.from_rotvec(state.missing_turn.reshape(-1, 3))
    asked = quaternion(spared.inv() * turn * scipy_rotation(frame.reshape(-1, 4))).reshape(COUNT, 2, 4)
    away = rng.uniform(-0.1, 0.1, (COUNT, 2, 3))
    distance = np.linalg.norm(away, axis=2).astype(np.float32)
    task = np.full((COUNT, 2), BOTH, np.uint8)
    task[3, 0], task[4], distance[4, 1] = 0, 1, 0.0
    active = np.array([4, 1, 3, 0], np.int32)
    before = state.missing_place.copy(), state.missing_turn.copy()
    # Corrections that turn otherwise than solved say so by a distance that no hand has.
    distance[1] = 1e3
    angle = np.full((COUNT, 2), np.nan, np.float32)
    find_missing_crowd(
        KEYS, np.tile(SCALE, (COUNT, 1)), task, (place + away).astype(np.float32), asked.astype(np.float32),
        active, poses, pelvis, state, distance, angle,
    )  # fmt: skip
    places, turns = before[0] + away, turn.as_rotvec().reshape(COUNT, 2, 3)
    places[2], turns[2] = before[0][2], before[1][2]
    places[3, 0], turns[3, 0], turns[4, 0] = 0, 0, 0
    # Nothing more is missing where the hand has come: what was spared stays so.
    places[4, 1], turns[4, 1] = before[0][4, 1], before[1][4, 1]
    np.testing.assert_allclose(state.missing_place, places, atol=2e-6)
    np.testing.assert_allclose(state.missing_turn, turns, atol=1e-5)
    np.testing.assert_allclose(distance[1], np.linalg.norm(away[1], axis=1), atol=1e-5)
    turns[4] = 0
    np.testing.assert_allclose(angle[active], np.linalg.norm(turns[active], axis=2), atol=1e-5)
    assert np.isnan(angle[2]).all()


@pytest.mark.parametrize("kept", [0.0, 0.3, 1.0])
def test_a_share_of_what_was_missing_is_spared(state, kept):
    before = state.missing_place.copy(), state.missing_turn.copy()
    wanted = Rotation.random(random_state=2)
    asked = scipy_rotation(spare_missing_turn(tuple(quaternion(wanted)), 1, 0, kept, DT, state))
    angle = np.linalg.norm(before[1][1, 0])
    turn_share = kept * angle / (angle + SLIGHT_TURN * DT)
    turn = Rotation.from_rotvec(turn_share * before[1][1, 0])
    np.testing.assert_allclose((turn * asked * wanted.inv()).magnitude(), 0, atol=1e-7)
    place = np.array(spare_missing_place((0.1, 0.2, 0.3), 1, 0, kept, DT, state))
    length = np.linalg.norm(before[0][1, 0])
    share = kept * length / (length + SLIGHT * DT)
    np.testing.assert_allclose(place, [0.1, 0.2, 0.3] - share * before[0][1, 0], atol=1e-12)
    before[0][1, 0] *= share
    before[1][1, 0] *= turn_share
    np.testing.assert_allclose(state.missing_place, before[0])
    np.testing.assert_allclose(state.missing_turn, before[1])


def test_slight_misses_are_made_up_for_at_once(state):
    slight = 0.1 * SLIGHT * DT
    state.missing_place[0, 0] = (0.0, slight, 0.0)
    asked = spare_missing_place((1.0, 2.0, 3.0), 0, 0, 1.0, DT, state)
    np.testing.assert_allclose(asked, (1.0, 2.0, 3.0), atol=0.1 * slight)
    assert np.linalg.norm(state.missing_place[0, 0]) < 0.1 * slight
