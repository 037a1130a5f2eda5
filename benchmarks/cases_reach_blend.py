"""Look-up and blend of reaches whose targets move, as in every step before inverse kinematics."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from benchmarks.case import Case
from crowd.bench.reachers import Reachers
from crowd.blending.reach_space import SIDES
from crowd.controllers.reach import REACH_LIMITS
from crowd.motion.rotation import about, multiply, rotate
from crowd_kernels import _jit
from crowd_kernels.aligned import aligned_copy, aligned_zeros
from crowd_kernels.clip import PADDED_JOINTS
from crowd_kernels.easing import minimum_jerk
from crowd_kernels.reach import CHUNKS, reach_crowd
from crowd_kernels.reach_blend import CHAIN, JOINTS, SCRATCH_ROW
from crowd_kernels.reach_examples import SAME_PLACE
from crowd_kernels.reach_space import NEAREST
from crowd_kernels.reach_state import ReachState

ROUNDS = 32
RADIUS = 0.05
"""Of the circles on which targets move, m."""
IN_FRONT = 0.2
"""Least distance of their middles before a person, so that no target is in the own body, m."""
SETTLING = 2 * ROUNDS
"""Steps after which hands follow their targets exactly."""
BLENDS = 8
"""Blends over one pose, one over the other: few, so that no numbers become so small that processors are slow
with them, but more than one, as copying the pose is not what is measured."""
LARGEST_COURSE = 0.9
FloatArray = npt.NDArray[np.float64]


@dataclass
class MovingHands:
    """People of whom one hand each is on its way to a target that moves on a circle.

    Attributes
    ----------
    reachers : Reachers
    hand : (N,) int64
        Hand of each person, 0 right, 1 left.
    target : (32, N, 3) float64
        In the root frame, m, in each round.
    target_world : (32, N, 2, 3) float64
        m.
    course : (N, 2) float64
        How far each hand is on its way; the same in every round.
    live_pose, pose : (N, 256) float32
        Pose rows before and after examples are blended over them.
    live_pelvis, pelvis : (N, 3) float32
        m.
    parts : tuple
        State of the reaches as kernels take it.
    number, real, rows : array
        What the kernel works in.
    task, place, rotation, kept, bound : array
        What `reach_crowd` asks of inverse kinematics.
    round : int
    """

    reachers: Reachers
    hand: npt.NDArray[np.int64]
    target: FloatArray
    target_world: FloatArray
    course: FloatArray
    live_pose: npt.NDArray[np.float32]
    live_pelvis: npt.NDArray[np.float32]
    pose: npt.NDArray[np.float32]
    pelvis: npt.NDArray[np.float32]
    parts: ReachState
    number: npt.NDArray[np.int32]
    real: FloatArray
    rows: npt.NDArray[np.float32]
    task: npt.NDArray[np.uint8]
    place: npt.NDArray[np.float32]
    rotation: npt.NDArray[np.float32]
    kept: npt.NDArray[np.float32]
    bound: npt.NDArray[np.float32]
    round: int = 0


def set_up(size: int, rng: np.random.Generator) -> MovingHands:
    """Let everyone follow a target with one hand until the goals are where the targets are."""
    _jit.set_thread_count(1)
    reachers = Reachers(size, seed=1)
    reachers.step()
    state = reachers.simulation.state
    hand = rng.integers(0, len(SIDES), size)
    middle = np.zeros((size, 3))
    for side in range(len(SIDES)):
        point = reachers.space.pseudo[side].point
        point = point[point[:, 2] > IN_FRONT]
        rows = np.flatnonzero(hand == side)
        middle[rows] = reachers.size[rows, None] * point[rng.integers(0, len(point), len(rows))]
    angle = 2.0 * np.pi * (np.arange(ROUNDS)[:, None] / ROUNDS + rng.random(size))
    circle = RADIUS * np.stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)], axis=-1)
    target = middle + circle
    target_world = np.zeros((ROUNDS, size, len(SIDES), 3))
    target_world[:, reachers.rows, hand] = rotate(about(1, state.yaw), target) + state.position_world
    reachers.simulation.reach.start(state, reachers.rows, hand, target_world[0, reachers.rows, hand])
    course = np.zeros((size, len(SIDES)))
    course[reachers.rows, hand] = rng.uniform(0.1, LARGEST_COURSE, size)
    hands = MovingHands(
        reachers,
        hand,
        target,
        target_world,
        course,
        state.pose_rotation.copy(),
        state.pose_pelvis.copy(),
        aligned_copy(state.pose_rotation),
        aligned_copy(state.pose_pelvis),
        ReachState(*(getattr(state, f"reach_{name}") for name in ReachState._fields)),
        *reachers.space.scratch(),
        aligned_zeros((CHUNKS, SCRATCH_ROW), np.float32),
        aligned_zeros((size, 2), np.uint8),
        aligned_zeros((size, 2, 3), np.float32),
        aligned_zeros((size, 2, 4), np.float32),
        aligned_zeros((size, 2), np.float32),
        aligned_zeros((size, 2), np.float32),
    )
    # Reaches begin at rest, where they take up their examples.
    hands.course = np.zeros_like(course)
    run(hands)
    hands.course = course
    for _ in range(SETTLING):
        run(hands)
    return hands


def run(hands: MovingHands) -> None:
    """Move all targets on, look up the examples, blend them and aim the hands."""
    hands.round = (hands.round + 1) % ROUNDS
    if hands.round % BLENDS == 0:
        np.copyto(hands.pose, hands.live_pose)
        np.copyto(hands.pelvis, hands.live_pelvis)
    np.copyto(hands.parts.target_world, hands.target_world[hands.round])
    np.copyto(hands.parts.course, hands.course)
    simulation, space = hands.reachers.simulation, hands.reachers.space
    state = simulation.state
    reach_crowd(
        space.arrays,
        space.keys,
        REACH_LIMITS,
        simulation.model.people.segment_scale,
        hands.reachers.size,
        state.position_world,
        state.yaw,
        state.is_seated,
        state.locomotion_weight,
        hands.reachers.rows,
        simulation.dt,
        hands.parts,
        hands.number,
        hands.real,
        hands.rows,
        state.reach_correction,
        state.reach_correction_change,
        state.reach_last_rotation,
        hands.pose,
        hands.pelvis,
        hands.task,
        hands.place,
        hands.rotation,
        hands.kept,
        hands.bound,
    )


def check(hands: MovingHands) -> str | None:
    """Compare one more step with SciPy's look-up and a blend in NumPy."""
    keys, rows = hands.reachers.space.keys, hands.reachers.rows
    looked_up = hands.parts.looked_up[rows, hands.hand].copy()
    if (hands.round + 1) % BLENDS == 0:
        run(hands)
    live, live_pelvis = compact(hands, hands.pose), hands.pelvis.astype(np.float64)
    run(hands)
    target = hands.target[hands.round]
    if not (hands.task[rows, hands.hand] == 1).all():
        return "a hand is not asked for its place"
    if not (np.linalg.norm(target - looked_up, axis=1) > SAME_PLACE).all():
        return "a look-up served twice"
    worst = np.abs(weights(hands, hands.parts.example_wanted) - nearest_weights(hands, target)).max()
    if not worst < 1e-9:
        return f"weights differ by {worst:.2g}"
    weight = weights(hands, hands.parts.example_weight)
    weight /= weight.sum(axis=1, keepdims=True)
    course = hands.parts.course[rows, hands.hand]
    example, example_pelvis = blend(hands, weight, course)
    share = np.array([minimum_jerk(part) for part in course / REACH_LIMITS.lead])[:, None]
    sign = np.where((live * example).sum(axis=2) < 0.0, -1.0, 1.0)[..., None]
    pose = (1.0 - share[:, None]) * live + share[:, None] * sign * example
    pose /= np.linalg.norm(pose, axis=2, keepdims=True)
    pelvis = (1.0 - share) * live_pelvis + share * example_pelvis
    found = compact(hands, hands.pose)
    worst = max(
        np.abs(found * np.sign((found * pose).sum(axis=2, keepdims=True)) - pose).max(),
        np.abs(hands.pelvis - pelvis).max(),
    )
    if not worst < 5e-5:
        return f"poses differ by {worst:.2g}"
    leg = hands.reachers.simulation.model.people.segment_scale[:, [keys.leg_segment]].astype(np.float64)
    apex, apex_pelvis = blend(hands, weight, np.ones_like(course))
    missing = target - hand_place(hands, leg * apex_pelvis, apex)
    if not (np.linalg.norm(missing, axis=1) < REACH_LIMITS.farthest).all():
        return "a target is out of reach"
    risen = np.array([minimum_jerk(part) for part in course])[:, None]
    place = hand_place(hands, leg * pelvis, pose) + risen * missing
    worst = np.abs(hands.place[rows, hands.hand] - place).max()
    return None if worst < 1e-4 else f"places asked for differ by {1000.0 * worst:.2g} mm"


def compact(hands: MovingHands, pose: npt.NDArray[np.float32]) -> FloatArray:
    """Rotations (N, J, 4) of the joints that reaches move, in pose rows."""
    components = pose.reshape(len(pose), 4, PADDED_JOINTS)[:, :, hands.reachers.space.keys.joint]
    return np.asarray(components.transpose(0, 2, 1), np.float64)


def weights(hands: MovingHands, value: FloatArray) -> FloatArray:
    """Weights (N, E) of all examples, from the slots (N, 2, S) of each hand."""
    rows: Any = hands.reachers.rows
    count = hands.parts.example_count[rows, hands.hand]
    example, own = hands.parts.example[rows, hands.hand], value[rows, hands.hand]
    total = np.zeros((len(rows), len(hands.reachers.space.keys.first_key)))
    for slot in range(own.shape[1]):
        used = slot < count
        np.add.at(total, (rows[used], example[used, slot]), own[used, slot])
    return total


def nearest_weights(hands: MovingHands, target: FloatArray) -> FloatArray:
    """Weights (N, E) of all examples by the nearest points that SciPy finds."""
    space, place = hands.reachers.space, target / hands.reachers.size[:, None]
    total = np.zeros((len(target), len(space.keys.first_key)))
    first = 0
    for side in range(len(SIDES)):
        rows: Any = np.flatnonzero(hands.hand == side)
        pseudo = space.pseudo[side]
        distance, near = cKDTree(pseudo.point).query(place[rows], NEAREST)
        inverse = 1.0 / np.maximum(distance, 1e-6)
        share = inverse - inverse[:, -1:]
        share /= share.sum(axis=1, keepdims=True)
        for k in range(NEAREST):
            for b in range(pseudo.clip.shape[1]):
                clip, own = first + pseudo.clip[near[:, k], b], share[:, k] * pseudo.weight[near[:, k], b]
                np.add.at(total, (rows, clip), own)
        first += len(space.examples[side].clips)
    return total


def blend(hands: MovingHands, weight: FloatArray, course: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Rotations (N, J, 4) and pelvis (N, 3) of weighted examples (N, E) on their way to the apex."""
    keys = hands.reachers.space.keys
    rotation, pelvis = np.zeros((len(weight), 4 * JOINTS)), np.zeros((len(weight), 3))
    for clip in range(weight.shape[1]):
        rows = np.flatnonzero(weight[:, clip] != 0.0)
        place = course[rows] * keys.apex[clip]
        middle = np.clip(np.floor(place + 0.5).astype(np.int64), 1, keys.key_count[clip] - 2)
        for key in range(-1, 2):
            # Quadratic B-splines, whose end pieces go on to the ends.
            along = place - middle
            share = 0.75 - along**2 if key == 0 else 0.5 * (0.5 + key * along) ** 2
            own = (weight[rows, clip] * share)[:, None]
            rotation[rows] += own * keys.rotation[keys.first_key[clip] + middle + key]
            pelvis[rows] += own * keys.pelvis[keys.first_key[clip] + middle + key]
    rotation = rotation.reshape(-1, 4, JOINTS)[:, :, : len(keys.joint)].transpose(0, 2, 1)
    return rotation / np.linalg.norm(rotation, axis=2, keepdims=True), pelvis


def hand_place(hands: MovingHands, pelvis: FloatArray, rotation: FloatArray) -> FloatArray:
    """Where the hands (N, 3) of poses are, root frame, m."""
    keys, rows = hands.reachers.space.keys, hands.reachers.rows
    scale = hands.reachers.simulation.model.people.segment_scale.astype(np.float64)
    chain, offset = keys.chain[hands.hand], keys.chain_offset[hands.hand]
    segment = keys.chain_segment[hands.hand]
    place, turned = pelvis, rotation[rows, chain[:, 0]]
    for k in range(1, CHAIN):
        place = place + rotate(turned, scale[rows, segment[:, k]][:, None] * offset[:, k])
        turned = multiply(turned, rotation[rows, chain[:, k]])
    return place


CASES = [Case("reach look-up and blend", (1000, 10_000), set_up, run, check, bound_us=1.0)]
