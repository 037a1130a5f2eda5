"""Hands on objects: placed, closed, measured."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from benchmarks.case import Case
from crowd.motion.body import build_skeleton
from crowd.motion.hand import hand_table
from crowd.world.mesh import Mesh
from crowd.world.objects import Objects, ShapeKind
from crowd.world.shape_table import shape_table
from crowd_kernels.aligned import aligned_zeros
from crowd_kernels.clip import PADDED_JOINTS
from crowd_kernels.grasp import CHUNKS, close_hands, measure_gaps
from crowd_kernels.hand_placement import place_hands
from crowd_kernels.hand_pose import FINGER_ROW, compose_frames, hands_in_world, pose_hands

DEEPEST = 1e-4
"""m."""


@dataclass
class Grasps:
    """One hand on each of many objects, in the objects' frames."""

    hand: Any
    table: Any
    side: Any
    rows: Any
    scale: Any
    natural: tuple[Any, Any]
    origin: tuple[Any, Any]
    position: Any
    rotation: Any
    style: Any
    status: Any
    closure: Any
    contact: Any
    gap: Any

    def place(self) -> None:
        """Place all hands."""
        place_hands(
            self.hand, self.table, self.side, self.rows, self.scale, *self.natural, *self.origin,
            self.position, self.rotation, self.style, self.status,
        )  # fmt: skip

    def close(self) -> None:
        """Close all fingers."""
        self.closure[:] = 0
        self.contact[:] = 0
        close_hands(
            self.hand, self.table, self.rows, self.side, self.style, self.rows, self.scale, self.position,
            self.rotation, *self.origin, self.closure, self.contact,
        )  # fmt: skip

    def measure(self) -> None:
        """Measure all gaps."""
        measure_gaps(
            self.hand, self.table, self.side, self.style, self.rows, self.scale, self.position,
            self.rotation, *self.origin, np.ascontiguousarray(self.closure[self.rows, self.side]), 0.05,
            self.gap,
        )  # fmt: skip

    def problem(self) -> str | None:
        """Say what is wrong with the closed hands."""
        self.measure()
        if self.gap.min() < -DEEPEST:
            return f"a finger is {-1e3 * self.gap.min():.3f} mm inside"
        touching = self.contact[self.rows, self.side].sum(axis=1)
        return None if touching.min() >= 3 else f"only {touching.min()} segments touch"


def grasps_of(kind: ShapeKind) -> Any:
    """Make the setup of a case with objects of one kind, 2.5 to 5 cm in half thickness."""

    def setup(size: int, rng: np.random.Generator) -> Grasps:
        half = np.repeat(rng.uniform(0.025, 0.05, (size, 1)), 3, axis=1)
        if kind is ShapeKind.CAPSULE:
            half[:, 1] += 0.08
        if kind is ShapeKind.BOX:
            half[:, 2] = rng.uniform(0.05, 0.1, size)
        meshes: tuple[Mesh, ...] = ()
        mesh = np.full(size, -1, np.int32)
        if kind is ShapeKind.MESH:
            meshes, mesh = tuple(_ball(row) for row in half[:8]), np.arange(size, dtype=np.int32) % 8
            half = half[mesh]
        upright = np.tile([1.0, 0.0, 0.0, 0.0], (size, 1))
        objects = Objects(
            tuple(map(str, range(size))), np.full(size, kind, np.int32), half,
            np.zeros((size, 3), np.float32), mesh, meshes, np.zeros((size, 3)), upright,
        )  # fmt: skip
        turned = rng.normal(size=(size, 4))
        grasps = Grasps(
            hand_table(build_skeleton()), shape_table(objects), rng.integers(0, 2, size).astype(np.int32),
            np.arange(size, dtype=np.int32), rng.uniform(0.9, 1.1, size),
            (rng.normal(0, 0.1, (size, 3)), turned / np.linalg.norm(turned, axis=1, keepdims=True)),
            (np.zeros((size, 3)), upright), np.zeros((size, 3)), np.zeros((size, 4)),
            np.zeros(size, np.int32), np.zeros(size, np.int32), np.zeros((size, 2, 15), np.float32),
            np.zeros((size, 2, 15), np.uint8), np.zeros((size, 5)),
        )  # fmt: skip
        grasps.place()
        grasps.close()
        return grasps

    return setup


def _ball(half: Any) -> Mesh:
    """An ellipsoid of 2,304 triangles."""
    polar, around = np.meshgrid(np.linspace(0, np.pi, 25), 2 * np.pi * np.arange(48) / 48, indexing="ij")
    points = np.stack(
        [np.sin(polar) * np.cos(around), np.cos(polar), np.sin(polar) * np.sin(around)], axis=-1
    )
    corner = np.arange(24)[:, None] * 48
    here, beside = corner + np.arange(48), corner + (np.arange(48) + 1) % 48
    faces = np.stack([here, beside, here + 48, beside, beside + 48, here + 48], axis=-1)
    return Mesh.of(points.reshape(-1, 3) * half, faces.reshape(-1, 3))


def placed(grasps: Grasps) -> str | None:
    """Check by closing what was placed."""
    grasps.close()
    return grasps.problem()


@dataclass
class Holding:
    """Both hands of many people who hold something."""

    hand: Any
    character: Any
    side: Any
    style: Any
    weight: Any
    closure: Any
    pose: Any
    place: Any
    turn: Any
    root: Any
    yaw: Any
    grip: Any
    hands: Any
    items: Any
    grab_object: Any
    scratch: Any

    def pose_fingers(self) -> None:
        """Write all fingers."""
        people = np.arange(len(self.pose), dtype=np.int32)
        pose_hands(
            self.hand,
            self.grab_object,
            self.style,
            0.0,
            people,
            self.closure,
            self.scratch,
            self.weight,
            self.pose,
        )

    def follow(self) -> None:
        """Let all objects follow."""
        joint = np.array([0, 1], np.int32)
        frames = self.place, self.turn, self.root, self.yaw
        hands_in_world(joint, self.character, self.side, *frames, *self.hands)
        (place, turn), (inner, inner_turn) = self.hands, self.grip
        compose_frames(place, turn, inner, inner_turn, False, *self.items)

    def pose_problem(self) -> str | None:
        """Check that fingers are unit rotations."""
        joints = self.pose.reshape(len(self.pose), 4, -1)[:, :, self.hand.joint.ravel()]
        length = np.sqrt((joints**2).sum(axis=1))
        return None if np.abs(length - 1).max() < 1e-5 else "a finger is no rotation"

    def follow_problem(self) -> str | None:
        """Check that objects are as far from hands as their grips."""
        away = np.linalg.norm(self.items[0] - self.hands[0], axis=1)
        wrong = np.abs(away - np.linalg.norm(self.grip[0], axis=1)).max()
        return None if wrong < 1e-6 else f"an object is {wrong:g} m off"


def holding(size: int, rng: np.random.Generator) -> Holding:
    """Make people whose hands hold something."""
    count = 2 * size
    turn = rng.normal(size=(count, 4))
    turn /= np.linalg.norm(turn, axis=1, keepdims=True)
    pose = np.zeros((size, 4, PADDED_JOINTS), np.float32)
    pose[:, 0] = 1
    return Holding(
        hand_table(build_skeleton()), np.repeat(np.arange(size, dtype=np.int32), 2),
        np.tile(np.array([0, 1], np.int32), size), np.zeros((size, 2), np.int32), np.ones((size, 2)),
        rng.uniform(0, 1, (size, 2, 15)).astype(np.float32), pose.reshape(size, -1),
        rng.normal(size=(size, 2, 3)).astype(np.float32), turn.reshape(size, 2, 4).astype(np.float32),
        rng.normal(size=(size, 3)), rng.uniform(-3, 3, size),
        (rng.normal(size=(count, 3)), turn[::-1].copy()), (np.zeros((count, 3)), np.zeros((count, 4))),
        (np.zeros((count, 3)), np.zeros((count, 4))),
        np.zeros((size, 2), np.int32), aligned_zeros((CHUNKS, FINGER_ROW), np.float32),
    )  # fmt: skip


CASES = [
    *[
        Case(
            f"close a hand, {kind.name.lower()}",
            (300,),
            grasps_of(kind),
            Grasps.close,
            Grasps.problem,
        )
        for kind in ShapeKind
    ],
    Case("place a hand, box", (1000,), grasps_of(ShapeKind.BOX), Grasps.place, placed),
    Case("place a hand, mesh", (300,), grasps_of(ShapeKind.MESH), Grasps.place, placed),
    Case("pose both hands", (1000,), holding, Holding.pose_fingers, Holding.pose_problem),
    Case("objects follow both hands", (1000,), holding, Holding.follow, Holding.follow_problem),
    Case("gaps of a hand, capsule", (300,), grasps_of(ShapeKind.CAPSULE), Grasps.measure, Grasps.problem),
]
