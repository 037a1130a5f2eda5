"""The constraint layer: right hands held while the trunk below them turns."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from benchmarks.case import Case
from crowd.bench.frames import Hands, scene
from crowd.controllers.constraint import EFFECTORS
from crowd.controllers.controller import Step
from crowd.simulation import Simulation

Array = npt.NDArray[Any]

SIZES = (1000, 10_000)
TURN = np.radians(5.0)
MOST_MILLIMETRES = 1.0


@dataclass
class Held:
    """People who stand with a hand at a target, and the same pose with the trunk turned."""

    simulation: Simulation
    step: Step
    rows: Array
    hands: Array
    turned: Array


def set_up(size: int, rng: np.random.Generator) -> Held:
    """Let hands reach until they are held, then turn a joint of every spine."""
    simulation = Simulation(scene("reaching", size), seed=int(rng.integers(1000)), threads=1)
    hands = Hands(simulation)
    for _ in simulation.run(seconds=2.5):
        hands.ask()
    state, skeleton = simulation.state, simulation.model.skeleton
    active = simulation.population.active(state)
    step = Step(simulation.model, state, active, 0, 0.0, simulation.dt, 0)
    rows = active[state.constraint_weight[active, 0] == 1.0]
    simulation.constraint.hold_reaches(step)
    turned = state.pose_rotation.copy()
    spine = turned.reshape(state.capacity, 4, -1)[:, :, skeleton.joint("spine_2")]
    w, x, y, z = spine.T.copy()
    cosine, sine = np.cos(TURN / 2), np.sin(TURN / 2)
    spine[:] = np.stack(
        [cosine * w - sine * y, cosine * x + sine * z, cosine * y + sine * w, cosine * z - sine * x], 1
    )
    return Held(simulation, step, rows, state.constraint_target_world[rows, 0].copy(), turned)


def run(held: Held) -> None:
    """Follow the hands that reach, turn all trunks, and bring the hands back."""
    state, constraint = held.simulation.state, held.simulation.constraint
    constraint.hold_reaches(held.step)
    state.pose_rotation[:] = held.turned
    state.constraint_target_world[held.rows, 0] = held.hands
    constraint.evaluate(held.step)


def check(held: Held) -> str | None:
    """Compare hands with where they were before the trunks turned."""
    simulation = held.simulation
    simulation.joints.compute(simulation.state, simulation.model.people, held.step.active)
    hand = simulation.model.skeleton.joint(EFFECTORS[0])
    moved = np.linalg.norm(simulation.joint_positions_world()[held.rows, hand] - held.hands, axis=1)
    worst = 1e3 * float(moved.max(initial=0.0))
    if held.rows.size < 0.9 * held.step.active.size:
        return f"only {held.rows.size} of {held.step.active.size} hands are held"
    return (
        None if worst < MOST_MILLIMETRES else f"a hand is off by {worst:.2f} mm, allowed {MOST_MILLIMETRES}"
    )


CASES = [Case("constraint layer: one held hand", SIZES, set_up, run, check, bound_us=2.5)]
