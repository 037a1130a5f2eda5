"""People who turn while they walk: legs move smoothly whatever is commanded, whole bodies included."""

import numpy as np
import pytest

from crowd.bench.sweep import lone_people
from crowd.simulation import Simulation

PEOPLE = 32
MOST_FOOT_ACCELERATION = 220.0
"""m/s^2; feet that land from a walk reach half of it."""
FEET = ("right_shank", "right_foot", "right_toe", "left_shank", "left_foot", "left_toe")
# Time s; forward speed m/s, turn rate rad/s, side speed m/s.
WAYS = {
    "tight turns": (
        (0.5, (0.8, 1.9, 0.2)),
        (2.5, (0.2, 0.8, 0.5)),
        (4.0, (0.9, 2.1, 0.0)),
        (5.5, (0.3, -1.8, -0.3)),
        (7.0, (0.9, -1.9, -0.4)),
    ),
    "a slow walk that weaves": (
        (0.5, (0.45, 0.3, 0.06)),
        (2.0, (0.45, -0.6, 0.06)),
        (3.5, (0.4, 0.6, -0.06)),
        (5.0, (0.45, -0.3, 0.1)),
        (6.5, (0.5, 0.3, -0.1)),
    ),
}


@pytest.mark.parametrize("way", WAYS)
def test_legs_do_not_jerk_in_turns(way):
    simulation = Simulation(lone_people(PEOPLE))
    feet = [simulation.model.skeleton.joint(name) for name in FEET]
    places = []
    for frame in simulation.run(seconds=9.0):
        # Everyone a little later than the one before, so that changes meet every phase of the gait.
        for at, parameters in WAYS[way]:
            late = frame.time - at - 0.035 * np.arange(PEOPLE)
            simulation.commands.set_locomotion(np.flatnonzero(np.abs(late) < 0.5 * simulation.dt), parameters)
        places.append(simulation.joint_positions_world()[:, feet])
    acceleration = np.linalg.norm(np.diff(places, 2, axis=0), axis=-1) / simulation.dt**2
    assert acceleration[20:].max() < MOST_FOOT_ACCELERATION
