"""Inverse kinematics of a chain of ten ball joints from pelvis to hand, iteration by iteration."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from benchmarks.case import Case
from crowd_kernels import _jit
from crowd_kernels.ik import (
    CHUNKS,
    SETTINGS,
    SolveSettings,
    TreeArrays,
    plain_tree,
    scratch_length,
    solve_crowd,
)

Array = npt.NDArray[Any]

SIZES = (1000, 10_000)
ITERATIONS = 20
OFFSET = [
    *([0.0, 0.1, 0.0] for _ in range(7)),
    [0.0, -0.01, 0.17],
    [0.0, -0.326, 0.0],
    [0.0, -0.256, 0.0],
]
WEIGHT = [0.3] * 7 + [1.0, 1.0, 0.6]
SPREAD = np.radians([15.0] * 7 + [90.0, 60.0, 40.0])
POINT = (0.0, -0.08, 0.0)
DISTANCE_TOLERANCE = 1e-3
ANGLE_TOLERANCE = np.radians(1.0)


@dataclass
class Crowd:
    """Hands of a crowd at rest, and where they should go."""

    tree: TreeArrays
    settings: SolveSettings
    scale: Array
    task: Array
    point: Array
    target: Array
    target_rotation: Array
    start: Array
    pose: Array
    root: Array
    active: Array
    scratch: Array
    status: Array
    distance: Array
    angle: Array
    iterations: Array


def kinematics(local: Array) -> tuple[Array, Rotation]:
    """Hands of poses (N, 10, 4) by SciPy."""
    frame, place = Rotation.identity(), np.zeros((len(local), 3))
    for joint, offset in enumerate(OFFSET):
        place = place + frame.apply(np.tile(offset, (len(local), 1)))
        frame = frame * Rotation.from_quat(local[:, joint, [1, 2, 3, 0]])
    return place + frame.apply(np.tile(POINT, (len(local), 1))), frame


def set_up(task: int) -> Callable[[int, np.random.Generator], Crowd]:
    """Draw reachable targets; `task` 1 asks for positions, 3 for positions and rotations."""

    def make(size: int, rng: np.random.Generator) -> Crowd:
        _jit.set_thread_count(1)
        tree = plain_tree(np.arange(-1, len(OFFSET) - 1), OFFSET, [len(OFFSET) - 1], WEIGHT)
        axis = rng.normal(size=(size, len(OFFSET), 3))
        axis *= (rng.random((size, len(OFFSET))) * SPREAD / np.linalg.norm(axis, axis=2))[..., None]
        turned = Rotation.from_rotvec(axis.reshape(-1, 3)).as_quat()[:, [3, 0, 1, 2]]
        place, frame = kinematics(turned.reshape(size, -1, 4))
        start = np.zeros((size, len(OFFSET), 4), np.float32)
        start[..., 0] = 1.0
        start[:, 8] = (np.cos(0.5), -np.sin(0.5), 0.0, 0.0)
        return Crowd(
            tree,
            SETTINGS._replace(least_iterations=ITERATIONS, most_iterations=ITERATIONS),
            np.ones((size, 1), np.float32),
            np.full((size, 1), task, np.uint8),
            np.tile(np.array(POINT, np.float32), (size, 1, 1)),
            place[:, None].astype(np.float32),
            frame.as_quat()[:, None, [3, 0, 1, 2]].astype(np.float32),
            start.reshape(size, -1),
            start.reshape(size, -1).copy(),
            np.zeros((size, 3), np.float32),
            np.arange(size, dtype=np.int32),
            np.zeros((CHUNKS, scratch_length(len(OFFSET), 1, 1)), np.float32),
            np.zeros((size, 1), np.uint8),
            np.zeros((size, 1), np.float32),
            np.zeros((size, 1), np.float32),
            np.zeros(size, np.int32),
        )

    return make


def solve(crowd: Crowd) -> None:
    """Iterate from the rest pose."""
    crowd.pose[:] = crowd.start
    solve_crowd(
        crowd.tree,
        crowd.settings,
        crowd.scale,
        crowd.task,
        crowd.point,
        crowd.target,
        crowd.target_rotation,
        crowd.start,
        crowd.root,
        crowd.active,
        crowd.scratch,
        crowd.pose,
        crowd.root,
        crowd.status,
        crowd.distance,
        crowd.angle,
        crowd.iterations,
    )


def check(crowd: Crowd) -> str | None:
    """Compare hands with their targets by SciPy."""
    place, frame = kinematics(crowd.pose.reshape(len(crowd.pose), -1, 4))
    missed = np.linalg.norm(place - crowd.target[:, 0], axis=1) > 1.05 * DISTANCE_TOLERANCE
    if crowd.task[0, 0] == 3:
        wanted = Rotation.from_quat(crowd.target_rotation[:, 0, [1, 2, 3, 0]])
        missed |= (wanted * frame.inv()).magnitude() > 1.05 * ANGLE_TOLERANCE
    share = float(missed.mean())
    return None if share <= 2e-3 else f"{share:.2%} of the hands miss their targets, allowed 0.2%"


def iterations(crowd: Crowd) -> int:
    """Iterations made by all characters together."""
    return int(crowd.iterations.sum())


CASES = [
    Case(f"ik: one iteration of ten joints, {name}", SIZES, set_up(task), solve, check, items=iterations)
    for name, task in (("position", 1), ("position and rotation", 3))
]
