"""Look-up of reach examples with SciPy's k-d tree beside it, and the reach layer with inverse kinematics."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from benchmarks.case import Case
from crowd.bench.reachers import Reachers, random_targets
from crowd.blending.reach_space import ReachSpace
from crowd.controllers.controller import Step
from crowd.controllers.reach import built_in_reach_space
from crowd_kernels import _jit
from crowd_kernels.reach_space import MOST_SAMPLES, NEAREST, find_examples_crowd

ROUNDS = 16
"""Different places in turn, so that the branch predictor cannot learn them."""


@dataclass
class Hands:
    """Hand positions in several rounds, and the examples found for those of the last round."""

    space: ReachSpace
    tree: cKDTree
    part: npt.NDArray[np.int32]
    position: npt.NDArray[np.float64]
    number: npt.NDArray[np.int32]
    real: npt.NDArray[np.float64]
    clip: npt.NDArray[np.int32]
    weight: npt.NDArray[np.float64]
    count: npt.NDArray[np.int32]
    round: int = 0

    def next_places(self) -> npt.NDArray[np.float64]:
        """Places of the next round."""
        self.round = (self.round + 1) % ROUNDS
        return np.asarray(self.position[self.round])


def set_up(size: int, rng: np.random.Generator) -> Hands:
    """Draw places between the examples of a standing person's right hand."""
    _jit.set_thread_count(1)
    space = built_in_reach_space()
    point = space.pseudo[0].point
    return Hands(
        space,
        cKDTree(point),
        np.zeros(size, np.int32),
        point[rng.integers(0, len(point), (ROUNDS, size))] + rng.normal(0.0, 0.02, (ROUNDS, size, 3)),
        *space.scratch(),
        np.zeros((size, MOST_SAMPLES), np.int32),
        np.zeros((size, MOST_SAMPLES)),
        np.zeros(size, np.int32),
    )


def run(hands: Hands) -> None:
    """Look up all hands."""
    find_examples_crowd(
        hands.space.arrays,
        hands.part,
        hands.next_places(),
        hands.number,
        hands.real,
        hands.clip,
        hands.weight,
        hands.count,
    )


def search(hands: Hands) -> None:
    """Find the nearest points with SciPy, without weights and examples."""
    hands.tree.query(hands.next_places(), NEAREST)


def check(hands: Hands) -> str | None:
    """Compare with blends of the four nearest points that SciPy finds."""
    pseudo = hands.space.pseudo[0]
    distance, near = hands.tree.query(hands.position[hands.round], NEAREST)
    inverse = 1.0 / np.maximum(distance, 1e-6)
    share = inverse - inverse[:, -1:]
    share /= share.sum(axis=1, keepdims=True)
    wanted = np.zeros((len(near), len(hands.space.keys.first_key)))
    found = np.zeros_like(wanted)
    rows: Any = np.arange(len(near))
    for k in range(NEAREST):
        for b in range(pseudo.clip.shape[1]):
            np.add.at(wanted, (rows, pseudo.clip[near[:, k], b]), share[:, k] * pseudo.weight[near[:, k], b])
    for sample in range(MOST_SAMPLES):
        is_used = sample < hands.count
        np.add.at(found, (rows[is_used], hands.clip[is_used, sample]), hands.weight[is_used, sample])
    worst = float(np.abs(wanted - found).max())
    return None if worst < 1e-9 else f"weights differ by {worst:.2g}"


def set_up_people(size: int, rng: np.random.Generator) -> tuple[Reachers, npt.NDArray[np.float64]]:
    """Let everyone reach for a place with the right hand; they are half way."""
    reachers = Reachers(size, seed=1)
    reachers.simulation.threads = 1
    _jit.set_thread_count(1)
    target = random_targets(reachers, 0, rng, is_far=False)
    reachers.step()
    reachers.reach(0, target)
    for _ in range(25):
        reachers.step()
    return reachers, target


def evaluate(case: tuple[Reachers, npt.NDArray[np.float64]]) -> None:
    """Advance the layer by one step."""
    reachers, _ = case
    simulation = reachers.simulation
    _jit.set_thread_count(1)
    step = Step(simulation.model, simulation.state, reachers.rows, 0, 0.0, simulation.dt, 0)
    simulation.reach.evaluate(step)


def check_people(case: tuple[Reachers, npt.NDArray[np.float64]]) -> str | None:
    """After a while all hands are at their targets."""
    reachers, target = case
    for _ in range(90):
        reachers.step()
    worst = float(np.linalg.norm(reachers.hand(0)[0] - target, axis=1).max())
    return None if worst < 1e-3 else f"a hand is {1000 * worst:.1f} mm off"


CASES = [
    Case("reach look-up", (1000, 10_000), set_up, run, check, peers={"scipy k-d tree": search}, bound_us=0.5),
    Case("reach layer", (1000,), set_up_people, evaluate, check_people, bound_us=7.0),
]
