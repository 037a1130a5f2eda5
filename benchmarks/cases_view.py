"""The processor's side of one picture: who is seen, at which level, and the poses as texels."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from benchmarks.case import Case
from crowd_kernels import _jit
from crowd_kernels.view import levels_crowd, pack_crowd, sort_rows

JOINTS, BUILDS, LEVELS = 56, 19, 5
FEW_JOINTS = 21
LEAST_HEIGHT = np.array([150.0, 70.0, 34.0, 14.0])
MESH_LEVELS = 3
LARGEST_UPLOAD = 8 << 20


@dataclass
class Crowd:
    """A crowd on a square seen from its edge, and the arrays of a renderer."""

    position: npt.NDArray[np.float64]
    yaw: npt.NDArray[np.float64]
    joint_position: npt.NDArray[np.float32]
    joint_rotation: npt.NDArray[np.float32]
    scale: npt.NDArray[np.int16]
    build: npt.NDArray[np.int32]
    level: npt.NDArray[np.int32]
    begin: npt.NDArray[np.int32]
    drawn: npt.NDArray[np.int32]
    root: npt.NDArray[np.float32]
    full: npt.NDArray[np.int16]
    reduced: npt.NDArray[np.int16]


def set_up(size: int, rng: np.random.Generator) -> Crowd:
    """Spread people over a square with one for every square metre."""
    _jit.set_thread_count(1)
    position = np.zeros((size, 3))
    position[:, [0, 2]] = rng.uniform(-0.5, 0.5, (size, 2)) * np.sqrt(size)
    rotation = rng.normal(size=(size, JOINTS, 4))
    rotation /= np.linalg.norm(rotation, axis=2, keepdims=True)
    return Crowd(
        position,
        rng.uniform(-np.pi, np.pi, size),
        rng.uniform(-1.0, 2.0, (size, JOINTS, 3)).astype(np.float32),
        rotation.astype(np.float32),
        np.full((size, JOINTS), 8192, np.int16),
        rng.integers(0, BUILDS, size).astype(np.int32),
        np.full(size, -1, np.int32),
        np.zeros(LEVELS * BUILDS + 1, np.int32),
        np.zeros(size, np.int32),
        np.zeros((size, 8), np.float32),
        np.zeros((size, 8 * JOINTS), np.int16),
        np.zeros((size, 8 * FEW_JOINTS), np.int16),
    )


def prepare(crowd: Crowd) -> None:
    """Do what a renderer does before it uploads; everyone is in view."""
    count = len(crowd.position)
    planes = np.array([[0.0, 1.0, 0.0, 5.0]] * 6)
    eye = np.array([0.0, 8.0, 0.5 * np.sqrt(count) + 4.0])
    levels_crowd(
        crowd.position,
        np.ones(count, np.bool_),
        np.full(count, 1.75),
        planes,
        eye,
        1400.0,
        True,
        LEAST_HEIGHT,
        crowd.level,
    )
    sort_rows(crowd.level, crowd.build, BUILDS, crowd.begin, crowd.drawn)
    near = int(crowd.begin[MESH_LEVELS * BUILDS])
    for rows, joint_count, palette in (
        (slice(0, near), JOINTS, crowd.full),
        (slice(near, int(crowd.begin[-1])), FEW_JOINTS, crowd.reduced),
    ):
        pack_crowd(
            crowd.position,
            crowd.yaw,
            crowd.joint_position,
            crowd.joint_rotation,
            crowd.scale,
            crowd.build,
            crowd.drawn[rows],
            np.arange(joint_count, dtype=np.int32),
            np.zeros(3),
            crowd.root[rows],
            palette[rows],
        )


def is_right(crowd: Crowd) -> str | None:
    """Everyone is packed once, poses are near the source's, and the upload is small."""
    seen = int(crowd.begin[-1])
    near = int(crowd.begin[MESH_LEVELS * BUILDS])
    if sorted(crowd.drawn[:seen]) != list(range(len(crowd.position))):
        return "somebody is left out or drawn twice"
    joints = crowd.reduced[near:seen].reshape(-1, FEW_JOINTS, 2, 4)
    expected = crowd.joint_position[crowd.drawn[near:seen], :FEW_JOINTS]
    if np.abs(joints[:, :, 1, :3] * (4.0 / 32767.0) - expected).max(initial=0.0) > 1e-4:
        return "joints are off by more than 0.1 mm"
    upload = crowd.root[:seen].nbytes + crowd.full[:near].nbytes + crowd.reduced[near:seen].nbytes
    return f"{upload} bytes to upload" if upload > LARGEST_UPLOAD else None


CASES = [Case("view: levels and poses of a picture", (1000, 10_000), set_up, prepare, is_right, bound_us=0.5)]
