"""Sample, blend and kinematics of the built-in library's locomotion, with a NumPy version beside it."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from benchmarks.case import Case
from crowd.controllers.controller import KeySamples
from crowd.joints import Joints
from crowd.motion.clip_table import ClipTable
from crowd.motion.procedural import built_in_library
from crowd.state import State
from crowd_kernels import _jit
from crowd_kernels.clip import blend_samples


@dataclass
class Crowd:
    """A crowd in random blends of four examples."""

    table: ClipTable
    state: State
    samples: KeySamples
    joints: Joints
    segment_scale: Any
    active: Any


def set_up(size: int, rng: np.random.Generator) -> Crowd:
    """Give everyone four random examples at a random phase."""
    _jit.set_thread_count(1)
    library = built_in_library()
    table = ClipTable.build(library)
    samples = KeySamples.create(size, 4)
    clip = table.example_clip[rng.integers(0, len(table.example_clip), (size, 4))]
    key = (rng.random((size, 1)) * table.key_count[clip]).astype(np.int32)
    samples.frame[:] = table.first_key[clip] + key
    samples.next_frame[:] = table.first_key[clip] + (key + 1) % table.key_count[clip]
    samples.fraction[:] = rng.random((size, 4))
    weight = rng.random((size, 4))
    samples.weight[:] = weight / weight.sum(axis=1, keepdims=True)
    scale = np.ones((size, 8), np.float32)
    return Crowd(
        table,
        State.create(size),
        samples,
        Joints(library.skeleton, size),
        scale,
        np.arange(size, dtype=np.int32),
    )


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


def pose(crowd: Crowd) -> None:
    """Sample, blend and compute joints."""
    blend(crowd)
    crowd.joints.compute_arrays(crowd.state, crowd.segment_scale, crowd.active)


def blend_in_numpy(crowd: Crowd) -> None:
    """Sample and blend with whole-array NumPy."""
    samples, keys = crowd.samples, crowd.table.key_rotation
    share = samples.weight * samples.fraction
    total = np.einsum("ns,nsr->nr", samples.weight - share, keys[samples.frame])
    total += np.einsum("ns,nsr->nr", share, keys[samples.next_frame])
    rotation = total.reshape(len(total), 4, -1)
    rotation /= np.linalg.norm(rotation, axis=1, keepdims=True)


def check(crowd: Crowd) -> str | None:
    """Compare some characters with a plain weighted sum in double precision."""
    samples, keys = crowd.samples, crowd.table.key_rotation.astype(np.float64)
    for character in range(0, len(crowd.active), max(len(crowd.active) // 20, 1)):
        share = (samples.weight * samples.fraction)[character].astype(np.float64)
        rest = samples.weight[character] - share
        total = rest @ keys[samples.frame[character]] + share @ keys[samples.next_frame[character]]
        rotation = total.reshape(4, -1)
        rotation /= np.linalg.norm(rotation, axis=0)
        error = np.abs(rotation.ravel() - crowd.state.pose_rotation[character]).max()
        if not error < 1e-5:
            return f"rotation of character {character} is off by {error:.2g}"
    length = np.linalg.norm(crowd.joints.rotation_model, axis=2)
    return None if np.abs(length - 1).max() < 1e-4 else "joint rotations are not of unit length"


CASES = [
    Case(
        "pose: sample, blend 4 clips, kinematics, 56 joints",
        (1000, 10_000),
        set_up,
        pose,
        check,
        peers={"NumPy, blend alone": blend_in_numpy},
        bound_us=1.2,
    ),
]
