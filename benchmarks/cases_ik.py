"""Inverse kinematics: a chain of ten ball joints beside Pinocchio, and an arm that keeps its limits."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from benchmarks.case import Case
from crowd.motion.body import build_skeleton
from crowd.motion.joint_tree import joint_tree
from crowd.motion.skeleton import Segment
from crowd_kernels import _jit
from crowd_kernels.aligned import aligned_zeros
from crowd_kernels.clip import PADDED_JOINTS
from crowd_kernels.ik import CHUNKS, SETTINGS, SolveSettings, scratch_length, solve_crowd
from crowd_kernels.ik_tree import TreeArrays, plain_tree

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
LIMIT_TOLERANCE = 1e-5


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
            aligned_zeros((CHUNKS, scratch_length(len(OFFSET), 1, 1)), np.float32),
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
        crowd.pose,
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


def pinocchio_peers() -> dict[str, Callable[[Crowd], None]]:
    """Pinocchio on the same chain, where it is installed."""
    try:
        import pinocchio
    except ImportError:
        return {}

    def chain() -> Any:
        model, above = pinocchio.Model(), 0
        for joint, offset in enumerate(OFFSET):
            place = pinocchio.SE3(np.eye(3), np.array(offset))
            above = model.addJoint(above, pinocchio.JointModelSpherical(), place, f"joint_{joint}")
        hand = pinocchio.SE3(np.eye(3), np.array(POINT))
        return model, model.addFrame(pinocchio.Frame("hand", above, 0, hand, pinocchio.FrameType.OP_FRAME))

    def solve_all(crowd: Crowd) -> None:
        """Iterate one after another: kinematics and Jacobian by Pinocchio, the step by NumPy."""
        model, hand = chain()
        data = model.createData()
        rows = 6 if crowd.task[0, 0] == 3 else 3
        weight = np.repeat(WEIGHT, 3)
        start = crowd.start[0].reshape(-1, 4)[:, [1, 2, 3, 0]].astype(np.float64).ravel()
        damping = crowd.settings.damping**2 * np.eye(rows)
        aligned = pinocchio.ReferenceFrame.LOCAL_WORLD_ALIGNED
        frames = Rotation.from_quat(crowd.target_rotation[:, 0, [1, 2, 3, 0]]).as_matrix()
        for character in range(len(crowd.start)):
            q = start
            for _ in range(ITERATIONS):
                jacobian = pinocchio.computeFrameJacobian(model, data, q, hand, aligned)[:rows]
                now = pinocchio.updateFramePlacement(model, data, hand)
                miss = crowd.target[character, 0] - now.translation
                if rows == 6:
                    miss = np.concatenate([miss, pinocchio.log3(frames[character] @ now.rotation.T)])
                pull = crowd.settings.pull * pinocchio.difference(model, q, start)
                system = (jacobian * weight) @ jacobian.T + damping
                push = np.linalg.solve(system, miss - jacobian @ pull)
                q = pinocchio.integrate(model, q, pull + weight * (jacobian.T @ push))

    return {"Pinocchio from Python": solve_all}


@dataclass
class Arms(Crowd):
    """Right arms of the built-in skeleton with trunk and limits, and poses within the limits to reach."""


def set_up_arms(size: int, rng: np.random.Generator) -> Arms:
    """Draw poses evenly within all limits; their hands are the targets."""
    _jit.set_thread_count(1)
    tree = joint_tree(build_skeleton(), ["right_hand"])
    count = len(tree.joint)
    local = np.tile(np.array([1.0, 0.0, 0.0, 0.0]), (size, count, 1))
    for k in np.flatnonzero(tree.weight > 0):
        angle, radius = 2.0 * np.pi * rng.random(size), np.sqrt(rng.random(size))
        if 0.0 in tree.is_free[k, :2]:
            radius, angle = 2.0 * rng.random(size) - 1.0, np.zeros(size)
        inverse = np.where(tree.inverse_swing[k] > 0, tree.inverse_swing[k], np.inf)
        x, y = radius * np.cos(angle) / inverse[0], radius * np.sin(angle) / inverse[1]
        low, high = 2.0 * np.arctan(tree.twist[k]) if tree.is_free[k, 2] else (0.0, 0.0)
        twist = Rotation.from_rotvec(np.outer(low + (high - low) * rng.random(size), [0, 0, 1]))
        swing = Rotation.from_quat(np.stack([x, y, 0 * x, np.sqrt(1 - x * x - y * y)], axis=1))
        outer, inner = (Rotation.from_quat(f[k][[1, 2, 3, 0]]) for f in (tree.parent_frame, tree.joint_frame))
        local[:, k] = (outer * swing * twist * inner.inv()).as_quat()[:, [3, 0, 1, 2]]
    place, frame = arm_kinematics(tree, local)
    start = np.zeros((size, 4, PADDED_JOINTS), np.float32)
    start[:, 0] = 1.0
    elbow = tree.joint[-2]
    start[:, 0, elbow], start[:, 1, elbow] = np.cos(0.4), -np.sin(0.4)
    rows = start.reshape(size, -1)
    return Arms(
        tree,
        SETTINGS,
        np.ones((size, len(Segment)), np.float32),
        np.full((size, 1), 3, np.uint8),
        np.tile(np.array(POINT, np.float32), (size, 1, 1)),
        place[:, None].astype(np.float32),
        frame.as_quat()[:, None, [3, 0, 1, 2]].astype(np.float32),
        rows,
        rows.copy(),
        np.zeros((size, 3), np.float32),
        np.arange(size, dtype=np.int32),
        aligned_zeros((CHUNKS, scratch_length(count, 1, len(Segment))), np.float32),
        np.zeros((size, 1), np.uint8),
        np.zeros((size, 1), np.float32),
        np.zeros((size, 1), np.float32),
        np.zeros(size, np.int32),
    )


def arm_kinematics(tree: TreeArrays, local: Array) -> tuple[Array, Rotation]:
    """Hands of poses (N, K, 4) of a chain by SciPy."""
    frame, place = Rotation.identity(), np.zeros((len(local), 3))
    for k in range(len(tree.joint)):
        place = place + frame.apply(np.tile(tree.offset[k], (len(local), 1)))
        frame = frame * Rotation.from_quat(local[:, k, [1, 2, 3, 0]])
    return place + frame.apply(np.tile(POINT, (len(local), 1))), frame


def check_arms(arms: Arms) -> str | None:
    """Compare hands with their targets, and all joints with their limits, by SciPy."""
    rows = arms.pose.reshape(len(arms.pose), 4, -1)[:, :, arms.tree.joint]
    local = np.moveaxis(rows, 1, 2).astype(np.float64)
    place, frame = arm_kinematics(arms.tree, local)
    wanted = Rotation.from_quat(arms.target_rotation[:, 0, [1, 2, 3, 0]])
    missed = np.linalg.norm(place - arms.target[:, 0], axis=1) > 1.05 * DISTANCE_TOLERANCE
    missed |= (wanted * frame.inv()).magnitude() > 1.05 * ANGLE_TOLERANCE
    for k in np.flatnonzero(arms.tree.weight > 0):
        outer, inner = (
            Rotation.from_quat(f[k][[1, 2, 3, 0]]) for f in (arms.tree.parent_frame, arms.tree.joint_frame)
        )
        x, y, z, w = (outer.inv() * Rotation.from_quat(local[:, k, [1, 2, 3, 0]]) * inner).as_quat().T
        norm = np.hypot(w, z)
        swing = np.stack([x * w - y * z, y * w + x * z], axis=1) / norm[:, None]
        over = np.linalg.norm(swing * arms.tree.inverse_swing[k], axis=1).max() - 1.0
        if over > LIMIT_TOLERANCE:
            return f"joint {k} leaves its limit by {over:.2g}, allowed {LIMIT_TOLERANCE:g}"
    share = float(missed.mean())
    return None if share <= 0.02 else f"{share:.2%} of the hands miss their targets, allowed 2%"


CASES = [
    *(
        Case(
            f"ik: one iteration of ten joints, {name}",
            SIZES,
            set_up(task),
            solve,
            check,
            items=iterations,
            peers=pinocchio_peers(),
            bound_us=0.10,
        )
        for name, task in (("position", 1), ("position and rotation", 3))
    ),
    Case(
        "ik: whole solve of an arm with limits, position and rotation",
        SIZES,
        set_up_arms,
        solve,
        check_arms,
        bound_us=20.0,
    ),
]
