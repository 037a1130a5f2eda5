"""Look-up of locomotion examples, their key frames and foot contacts, with SciPy and NumPy beside them."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.spatial import Delaunay

from benchmarks.case import Case
from crowd.blending.parameter_space import ParameterSpace
from crowd.motion.clip_table import ClipTable
from crowd.motion.procedural import built_in_library
from crowd_kernels import _jit
from crowd_kernels.barycentric import locate_crowd
from crowd_kernels.gait import BALL, HEEL, SWING, contact_crowd, sample_crowd

FloatArray = npt.NDArray[np.float64]


@dataclass
class Crowd:
    """Wanted parameters and phases of a crowd, and what is found for them."""

    table: ClipTable
    space: ParameterSpace
    peer: Delaunay
    parameter: FloatArray
    phase: FloatArray
    active: npt.NDArray[np.int32]
    example: npt.NDArray[np.int32]
    weight: FloatArray
    cycle_rate: FloatArray
    realised: FloatArray
    is_inside: npt.NDArray[np.uint8]
    frame: npt.NDArray[np.int32]
    next_frame: npt.NDArray[np.int32]
    fraction: npt.NDArray[np.float32]
    frame_weight: npt.NDArray[np.float32]
    contact: npt.NDArray[np.uint8]


def set_up(is_inside: bool) -> Callable[[int, np.random.Generator], Crowd]:
    """Draw parameters that lie inside the space of the built-in library, or outside it."""

    def make(size: int, rng: np.random.Generator) -> Crowd:
        _jit.set_thread_count(1)
        table = ClipTable.build(built_in_library())
        names = [table.names[clip] for clip in table.example_clip]
        space = ParameterSpace.build(table.parameters, table.cycle_duration, names)
        low, high = space.parameters.min(axis=0), space.parameters.max(axis=0)
        points = low + rng.random((40 * size, 3)) * (high - low)
        points = np.ascontiguousarray(points[space.locate(points)[3] == is_inside][:size])
        crowd = Crowd(
            table,
            space,
            Delaunay(space.arrays.example),
            points,
            2.0 * rng.random(size),
            np.arange(size, dtype=np.int32),
            np.zeros((size, 4), np.int32),
            np.zeros((size, 4)),
            np.zeros(size),
            np.zeros((size, 3)),
            np.zeros(size, np.uint8),
            np.zeros((size, 4), np.int32),
            np.zeros((size, 4), np.int32),
            np.zeros((size, 4), np.float32),
            np.zeros((size, 4), np.float32),
            np.zeros((size, 2), np.uint8),
        )
        locate(crowd)
        return crowd

    return make


def locate(crowd: Crowd) -> None:
    """Find examples and weights."""
    locate_crowd(
        crowd.space.arrays,
        crowd.parameter,
        crowd.active,
        crowd.example,
        crowd.weight,
        crowd.cycle_rate,
        crowd.realised,
        crowd.is_inside,
    )


def locate_with_scipy(crowd: Crowd) -> None:
    """Find tetrahedra and weights inside with SciPy's Delaunay tessellation of the same examples."""
    points = crowd.parameter / crowd.space.arrays.axis_range
    cell = crowd.peer.find_simplex(points)
    transform = crowd.peer.transform[cell]
    share = np.einsum("nij,nj->ni", transform[:, :3], points - transform[:, 3])
    weight = (
        np.column_stack([share, 1 - share.sum(axis=1)])
        / crowd.space.arrays.cycle_duration[crowd.peer.simplices[cell]]
    )
    weight /= weight.sum(axis=1, keepdims=True)


def check_weights(crowd: Crowd) -> str | None:
    """Weights are valid and realise the point asked for, or one nearer to it than any example."""
    if crowd.weight.min() < 0 or np.abs(crowd.weight.sum(axis=1) - 1).max() > 1e-12:
        return "weights are negative or do not sum to 1"
    duration = crowd.weight * crowd.space.arrays.cycle_duration[crowd.example]
    blend = (duration[..., None] * crowd.space.parameters[crowd.example]).sum(axis=1)
    blend /= duration.sum(axis=1, keepdims=True)
    error = float(np.abs(blend - crowd.realised).max())
    if error > 1e-9:
        return f"a blend misses the realised parameters by {error:.2g}"
    scale = crowd.space.arrays.axis_range
    miss = np.linalg.norm((blend - crowd.parameter) / scale, axis=1)
    if crowd.is_inside.all():
        return None if miss.max() < 1e-9 else f"a point inside is missed by {miss.max():.2g} ranges"
    if crowd.is_inside.any():
        return "a point outside is said to lie inside"
    away = (crowd.parameter[:, None] - crowd.space.parameters) / scale
    nearest = np.linalg.norm(away, axis=2).min(axis=1)
    return None if (miss <= nearest + 1e-9).all() else "an example is nearer than what is realised"


def find_frames(crowd: Crowd) -> None:
    """Find key frames and foot contacts of the blends."""
    sample_crowd(
        crowd.table.example_clip,
        crowd.table.first_key,
        crowd.table.key_count,
        crowd.example,
        crowd.weight,
        crowd.phase,
        crowd.active,
        crowd.frame,
        crowd.next_frame,
        crowd.fraction,
        crowd.frame_weight,
    )
    contact_crowd(
        crowd.table.contact_phase, crowd.example, crowd.weight, crowd.phase, crowd.active, crowd.contact
    )


def frames_in_numpy(crowd: Crowd) -> tuple[Any, Any, Any, Any]:
    """Find key frames and foot contacts with whole-array NumPy."""
    table, clip = crowd.table, crowd.table.example_clip[crowd.example]
    position = 0.5 * crowd.phase[:, None] * table.key_count[clip]
    key = np.minimum(position.astype(np.int32), table.key_count[clip] - 1)
    frame, next_frame = table.first_key[clip] + key, table.first_key[clip] + (key + 1) % table.key_count[clip]
    events = np.einsum("ns,nsfe->nfe", crowd.weight, table.contact_phase[crowd.example])
    since = (crowd.phase[:, None] - (0.0, 0.5)) % 1.0
    contact = np.where(since < events[..., 0], HEEL, np.where(since < events[..., 1], BALL, SWING))
    return frame, next_frame, position - key, contact


def check_frames(crowd: Crowd) -> str | None:
    """Compare everyone with NumPy."""
    frame, next_frame, fraction, contact = frames_in_numpy(crowd)
    if not ((crowd.frame == frame).all() and (crowd.next_frame == next_frame).all()):
        return "key frames differ from NumPy's"
    if np.abs(crowd.fraction - fraction).max() > 1e-5:
        return "places between key frames differ from NumPy's"
    # A sum in other order may put a rare event on the other side of the present phase.
    return None if (crowd.contact != contact).mean() < 1e-4 else "foot contacts differ from NumPy's"


def run_frames_in_numpy(crowd: Crowd) -> None:
    """Drop the result."""
    frames_in_numpy(crowd)


CASES = [
    Case(
        "blending: locomotion examples, parameters inside",
        (1000, 10_000),
        set_up(True),
        locate,
        check_weights,
        peers={"SciPy Delaunay": locate_with_scipy},
        bound_us=0.15,
    ),
    Case(
        "blending: locomotion examples, parameters outside",
        (1000, 10_000),
        set_up(False),
        locate,
        check_weights,
        bound_us=0.5,
    ),
    Case(
        "blending: key frames and foot contacts",
        (1000, 10_000),
        set_up(True),
        find_frames,
        check_frames,
        peers={"NumPy": run_frames_in_numpy},
    ),
]
