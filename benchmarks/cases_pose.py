"""Sample, blend and kinematics of the built-in library's locomotion, with NumPy beside each stage."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from benchmarks.case import Case
from crowd.controllers.controller import KeySamples
from crowd.joints import Joints
from crowd.motion.clip_table import ClipTable
from crowd.motion.procedural import built_in_library
from crowd.motion.skeleton import Segment, Skeleton
from crowd.state import State
from crowd_kernels import _jit
from crowd_kernels.clip import PADDED_JOINTS, blend_samples
from crowd_kernels.pose import CHUNKS, local_rotations

Array = npt.NDArray[np.floating[Any]]

SIZES = (1000, 10_000)
ROTATION_TOLERANCE = 1e-5
POSITION_TOLERANCE = 1e-5
"""m"""


@dataclass
class Crowd:
    """A crowd in random blends of four examples."""

    skeleton: Skeleton
    table: ClipTable
    state: State
    samples: KeySamples
    joints: Joints
    segment_scale: npt.NDArray[np.float32]
    active: npt.NDArray[np.int32]
    rotation_local: npt.NDArray[np.float32]


def set_up(size: int, rng: np.random.Generator) -> Crowd:
    """Give everyone four random examples at a random phase, and their own proportions."""
    _jit.set_thread_count(1)
    library = built_in_library()
    skeleton, table = library.skeleton, ClipTable.build(library)
    samples = KeySamples.create(size, 4)
    clip = table.example_clip[rng.integers(0, len(table.example_clip), (size, 4))]
    place = rng.random((size, 1)) * table.key_count[clip]
    key = place.astype(np.int32)
    samples.frame[:] = table.first_key[clip] + key
    samples.next_frame[:] = table.first_key[clip] + (key + 1) % table.key_count[clip]
    samples.fraction[:] = place - key
    samples.weight[:] = rng.dirichlet(np.ones(4), size)
    crowd = Crowd(
        skeleton,
        table,
        State.create(size),
        samples,
        Joints(skeleton, size),
        rng.uniform(0.9, 1.1, (size, len(Segment))).astype(np.float32),
        np.arange(size, dtype=np.int32),
        np.zeros((size, skeleton.joint_count, 4), np.float32),
    )
    blend(crowd)
    return crowd


def blend(crowd: Crowd) -> None:
    """Sample and blend."""
    table, samples, state = crowd.table, crowd.samples, crowd.state
    blend_samples(
        table.key_rotation,
        table.key_pelvis,
        crowd.active,
        samples.frame,
        samples.next_frame,
        samples.fraction,
        samples.weight,
        samples.layer_weight,
        samples.mask_index,
        table.joint_mask,
        table.pelvis_mask,
        state.pose_rotation,
        state.pose_pelvis,
        samples.scratch,
    )


def kinematics(crowd: Crowd) -> None:
    """Compute joints from the pose."""
    crowd.joints.compute_arrays(crowd.state, crowd.segment_scale, crowd.active)


def pose(crowd: Crowd) -> None:
    """Sample, blend and compute joints."""
    blend(crowd)
    kinematics(crowd)


def convert(crowd: Crowd) -> None:
    """Write plain local rotations."""
    scratch = np.zeros((CHUNKS, 4 * PADDED_JOINTS), np.float32)
    local_rotations(crowd.state.pose_rotation, crowd.active, scratch, crowd.rotation_local)


def blended(crowd: Crowd, dtype: type[np.floating[Any]] = np.float32) -> tuple[Array, Array]:
    """Rotations (N, 4, 64) and pelvis (N, 3) by whole-array NumPy."""
    samples = crowd.samples
    after = (samples.weight * samples.fraction).astype(dtype)
    before = samples.weight.astype(dtype) - after

    def total(keys: Array) -> Array:
        keys = keys.astype(dtype, copy=False)
        result = np.einsum("ns,nsr->nr", before, keys[samples.frame])
        result += np.einsum("ns,nsr->nr", after, keys[samples.next_frame])
        return np.asarray(result)

    rotation = total(crowd.table.key_rotation).reshape(len(crowd.active), 4, PADDED_JOINTS)
    rotation /= np.linalg.norm(rotation, axis=1, keepdims=True)
    return rotation, total(crowd.table.key_pelvis) / (after + before).sum(axis=1, keepdims=True)


def product(a: Array, b: Array) -> Array:
    """Products of quaternions, components first."""
    return np.stack(
        [
            a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
            a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
            a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
            a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0],
        ]
    )


def jointed(crowd: Crowd, rotation: Array, pelvis: Array) -> tuple[Array, Array]:
    """Joint positions (N, J, 3) and rotations (N, J, 4) by NumPy, over all characters at once."""
    skeleton, scale = crowd.skeleton, crowd.segment_scale.astype(rotation.dtype)
    local = np.ascontiguousarray(rotation.transpose(2, 1, 0))
    turned, placed = [local[0]], [(pelvis * scale[:, Segment.LEG, None]).T]
    for joint in range(1, skeleton.joint_count):
        above = turned[skeleton.parent[joint]]
        offset = np.zeros_like(above)
        offset[1:] = skeleton.offset[joint][:, None] * scale[:, skeleton.segment[joint]]
        back = above * np.array([1, -1, -1, -1], rotation.dtype)[:, None]
        placed.append(placed[skeleton.parent[joint]] + product(product(above, offset), back)[1:])
        turned.append(product(above, local[joint]))
    return np.stack(placed).transpose(2, 0, 1), np.stack(turned).transpose(2, 0, 1)


def blend_in_numpy(crowd: Crowd) -> None:
    """Sample and blend."""
    blended(crowd)


def kinematics_in_numpy(crowd: Crowd) -> None:
    """Compute joints from the pose."""
    state = crowd.state
    jointed(crowd, state.pose_rotation.reshape(-1, 4, PADDED_JOINTS), state.pose_pelvis)


def pose_in_numpy(crowd: Crowd) -> None:
    """Sample, blend and compute joints."""
    jointed(crowd, *blended(crowd))


def convert_in_numpy(crowd: Crowd) -> None:
    """Write plain local rotations."""
    rows = crowd.state.pose_rotation.reshape(-1, 4, PADDED_JOINTS)
    crowd.rotation_local[:] = rows[:, :, : crowd.skeleton.joint_count].transpose(0, 2, 1)


def copy_outputs(crowd: Crowd) -> None:
    """Copy as many bytes as all stages write: what the machine's memory allows."""
    crowd.state.pose_rotation.copy()
    crowd.joints.position_model.copy()
    crowd.joints.rotation_model.copy()


def difference(name: str, got: Array, wanted: Array, allowed: float) -> str | None:
    """What is wrong with an array, if anything."""
    error = float(np.abs(got - wanted).max())
    return None if error <= allowed else f"{name} off by {error:.2g}, allowed {allowed:g}"


def check_blend(crowd: Crowd) -> str | None:
    """Compare all poses with NumPy in double precision."""
    rotation, pelvis = blended(crowd, np.float64)
    state = crowd.state
    got = state.pose_rotation.reshape(rotation.shape)
    return difference("local rotations", got, rotation, ROTATION_TOLERANCE) or difference(
        "pelvis", state.pose_pelvis, pelvis, POSITION_TOLERANCE
    )


def check_pose(crowd: Crowd) -> str | None:
    """Compare all poses and joints with NumPy in double precision."""
    position, rotation = jointed(crowd, *blended(crowd, np.float64))
    return (
        check_blend(crowd)
        or difference("joint positions", crowd.joints.position_model, position, POSITION_TOLERANCE)
        or difference("joint rotations", crowd.joints.rotation_model, rotation, ROTATION_TOLERANCE)
    )


def check_conversion(crowd: Crowd) -> str | None:
    """Compare with the rows, bit for bit."""
    rows = crowd.state.pose_rotation.reshape(-1, 4, PADDED_JOINTS)[:, :, : crowd.skeleton.joint_count]
    return difference("local rotations", crowd.rotation_local, rows.transpose(0, 2, 1), 0.0)


CASES = [
    Case(
        "pose: sample, blend 4 clips, kinematics, 56 joints",
        SIZES,
        set_up,
        pose,
        check_pose,
        peers={"NumPy": pose_in_numpy, "copy of the bytes written": copy_outputs},
        bound_us=1.2,
    ),
    Case(
        "pose: sample and blend 4 clips", SIZES, set_up, blend, check_blend, peers={"NumPy": blend_in_numpy}
    ),
    Case("pose: kinematics", SIZES, set_up, kinematics, check_pose, peers={"NumPy": kinematics_in_numpy}),
    Case(
        "pose: plain local rotations",
        SIZES,
        set_up,
        convert,
        check_conversion,
        peers={"NumPy": convert_in_numpy},
    ),
]
