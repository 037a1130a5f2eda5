"""Gaze of everybody at once, saccades and glances; answers are checked by the eyes' rays and statistics."""

import math
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from benchmarks.case import Case
from crowd.controllers.gaze import Gaze
from crowd.controllers.gaze_settings import SACCADES
from crowd.motion.body import build_skeleton
from crowd.motion.skeleton import Segment
from crowd.navigation.avoidance import Avoidance, AvoidanceSettings
from crowd.state import State
from crowd_kernels import _jit
from crowd_kernels.clip import PADDED_JOINTS
from crowd_kernels.gaze import ON_TARGET, eye_point_crowd, gaze_crowd
from crowd_kernels.glance import glance_crowd
from crowd_kernels.saccade import offset_eyes_crowd, saccade_crowd

SIZES = (1000, 10_000)
DT = 1.0 / 60.0
SETTLE_STEPS = 150
LEAST_ON_TARGET = 0.99
MOST_ERROR = math.radians(1.0)


@dataclass
class Onlookers:
    """People who stand about and look at points."""

    gaze: Gaze
    state: State
    avoidance: Avoidance
    pose: npt.NDArray[np.float32]
    scale: npt.NDArray[np.float32]
    trunk: npt.NDArray[np.float32]
    follow: npt.NDArray[np.float32]
    active: npt.NDArray[np.int32]
    step: int = 0
    offsets: list[float] = field(default_factory=list)


def set_up(size: int, rng: np.random.Generator) -> Onlookers:
    """Let everyone look at a point in reach, 1 to 10 m away."""
    _jit.set_thread_count(1)
    skeleton, state = build_skeleton(), State.create(size)
    state.is_active[:] = True
    state.position_world[:, [0, 2]] = math.sqrt(size / 0.5) * rng.random((size, 2))
    state.yaw[:] = rng.uniform(-np.pi, np.pi, size)
    state.pose_pelvis[:] = skeleton.offset[0]
    state.pose_rotation[:, :PADDED_JOINTS] = 1.0
    avoidance = Avoidance(AvoidanceSettings(), size)
    onlookers = Onlookers(
        Gaze(skeleton, size, avoidance),
        state,
        avoidance,
        state.pose_rotation.copy(),
        rng.uniform(0.9, 1.1, (size, len(Segment))).astype(np.float32),
        np.ones(size, np.float32),
        np.ones(size, np.float32),
        np.arange(size, dtype=np.int32),
    )
    heading = state.yaw + rng.uniform(-1.7, 1.7, size)
    away = rng.uniform(1.0, 10.0, size)
    points = np.stack([away * np.sin(heading), rng.uniform(0.8, 2.2, size), away * np.cos(heading)], axis=1)
    onlookers.gaze.look_at_point(state, onlookers.active, state.position_world + points)
    return onlookers


def turn(data: Onlookers) -> None:
    """Turn everyone by one step."""
    state, size = data.state, data.state.capacity
    gaze_crowd(
        data.gaze.arrays,
        data.gaze.limits,
        data.scale,
        state.position_world,
        state.yaw,
        data.trunk,
        data.follow,
        state.gaze_kind,
        state.gaze_target_world,
        state.saccade_offset,
        data.active,
        DT,
        data.gaze.scratch,
        state.pose_rotation,
        state.pose_pelvis,
        state.gaze_turn.reshape(size, -1),
        state.gaze_turn_rate.reshape(size, -1),
        state.gaze_eye_turn.reshape(size, -1),
        state.gaze_weight,
        state.gaze_weight_rate,
        state.gaze_error,
        state.gaze_status,
    )


def copy_poses(data: Onlookers) -> None:
    """Restore the poses of the layers below, as they are anew in each frame."""
    data.state.pose_rotation[:] = data.pose


def rays_miss(data: Onlookers) -> npt.NDArray[np.float64]:
    """Angle by which the middle of both eyes' rays misses the target, by whole-array NumPy, rad. (N,)"""
    state, arrays = data.state, data.gaze.arrays
    rows = state.pose_rotation.reshape(-1, 4, PADDED_JOINTS).astype(np.float64)

    def product(a: npt.NDArray[np.float64], b: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        w = a[:, :1] * b[:, :1] - (a[:, 1:] * b[:, 1:]).sum(axis=1, keepdims=True)
        return np.concatenate(
            [w, a[:, :1] * b[:, 1:] + b[:, :1] * a[:, 1:] + np.cross(a[:, 1:], b[:, 1:])], 1
        )

    def rotated(a: npt.NDArray[np.float64], v: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        t = 2.0 * np.cross(a[:, 1:], v)
        return np.asarray(v + a[:, :1] * t + np.cross(a[:, 1:], t))

    rotation = rows[:, :, 0]
    place = state.pose_pelvis.astype(np.float64) * data.scale[:, arrays.leg_segment, None]
    chain = list(zip(arrays.joint, arrays.offset, arrays.segment, strict=True))
    for joint, offset, segment in chain:
        place = place + rotated(rotation, offset * data.scale[:, segment, None].astype(np.float64))
        rotation = product(rotation, rows[:, :, joint])
    sine, cosine = np.sin(state.yaw), np.cos(state.yaw)
    x, y, z = (state.gaze_target_world - state.position_world).T
    target = np.stack([cosine * x - sine * z, y, sine * x + cosine * z], axis=1)
    worst = np.zeros(state.capacity)
    for joint, offset, segment in zip(arrays.eye, arrays.eye_offset, arrays.eye_segment, strict=True):
        eye = place + rotated(rotation, offset * data.scale[:, segment, None].astype(np.float64))
        ray = rotated(product(rotation, rows[:, :, joint]), np.tile([0.0, 0.0, 1.0], (len(eye), 1)))
        way = target - eye
        cosine_of_miss = (ray * way).sum(axis=1) / np.linalg.norm(way, axis=1)
        worst = np.maximum(worst, np.arccos(np.clip(cosine_of_miss, -1.0, 1.0)))
    return worst


def check_turn(data: Onlookers) -> str | None:
    """Let the turn settle; the rays of nearly all eyes then meet their targets."""
    for _ in range(SETTLE_STEPS):
        copy_poses(data)
        turn(data)
    is_met = data.state.gaze_status == ON_TARGET
    if is_met.mean() < LEAST_ON_TARGET:
        return f"{is_met.mean():.3f} on target, allowed from {LEAST_ON_TARGET}"
    worst = float(rays_miss(data)[is_met].max())
    return None if worst < MOST_ERROR else f"a ray misses by {math.degrees(worst):.2f} degrees"


def jump(data: Onlookers) -> None:
    """Advance everyone's saccades by one step, and turn resting eyes."""
    state = data.state
    data.step += 1
    saccade_crowd(
        data.gaze.modes,
        state.saccade_mode,
        data.active,
        1,
        data.step,
        data.step * DT,
        DT,
        state.saccade_start,
        state.saccade_goal,
        state.saccade_clock,
        state.saccade_duration,
        state.saccade_until,
        state.saccade_offset,
    )
    beside = data.active[state.saccade_offset.any(axis=1)]
    eyes = data.gaze.settings
    offset_eyes_crowd(
        data.gaze.arrays.eye,
        eyes.eye_pitch,
        eyes.eye_heading,
        state.saccade_offset,
        beside,
        state.pose_rotation,
    )


def check_jump(data: Onlookers) -> str | None:
    """Over half a minute, eyes of listeners rest on the target as long as published."""
    shares = []
    for _ in range(1800):
        jump(data)
        shares.append(1.0 - data.state.saccade_goal.any(axis=1).mean())
    share, wanted = float(np.mean(shares[900:])), SACCADES[0].target_share
    return (
        None if abs(share - wanted) < 0.04 else f"{share:.3f} of the time on the target, published {wanted}"
    )


def glance(data: Onlookers) -> None:
    """Choose glances for one step; neighbours are sorted by avoidance anyway."""
    state, cells = data.state, data.avoidance.steer_cells
    data.step += 1
    glance_crowd(
        cells.cell_start,
        cells.point,
        cells.character,
        cells.columns,
        cells.rows,
        cells.cell_size,
        data.gaze.glance_limits,
        state.position_world,
        state.velocity_world,
        state.yaw,
        state.is_active,
        data.gaze.may_glance,
        0.1,
        data.active,
        1,
        data.step,
        data.step * DT,
        data.gaze.keys,
        state.glance_until,
        state.is_glancing,
        state.gaze_kind,
        state.gaze_index,
        state.gaze_trunk,
    )


def set_up_glances(size: int, rng: np.random.Generator) -> Onlookers:
    """Sort people into cells."""
    data = set_up(size, rng)
    radius = np.full(size, 0.25)
    data.gaze.release(data.state, data.active)
    data.avoidance.steer_cells.sort(data.state.position_world, radius, data.active, 5.0)
    return data


def check_glance(data: Onlookers) -> str | None:
    """After a while some people look at others, all of them at somebody near and in front."""
    for _ in range(600):
        glance(data)
    state, limits = data.state, data.gaze.glance_limits
    looking = np.flatnonzero(state.is_glancing)
    if not 0.01 < looking.size / state.capacity < 0.5:
        return f"{looking.size} of {state.capacity} look at somebody"
    way = state.position_world[state.gaze_index[looking]] - state.position_world[looking]
    angle = np.arctan2(way[:, 0], way[:, 2]) - state.yaw[looking]
    angle = np.abs(np.angle(np.exp(1j * angle)))
    if angle.max() > limits.field or np.hypot(way[:, 0], way[:, 2]).max() > limits.distance:
        return "somebody looks at a person who is far away or behind"
    return None


def find_eyes(data: Onlookers) -> None:
    """Let everyone look the next one in the eyes."""
    state = data.state
    state.gaze_index[:] = np.roll(data.active, -1)
    eye_point_crowd(
        data.gaze.arrays,
        data.scale,
        state.position_world,
        state.yaw,
        data.pose,
        state.pose_pelvis,
        state.is_active,
        state.gaze_index,
        data.active,
        state.gaze_target_world,
    )


def check_eyes(data: Onlookers) -> str | None:
    """Eyes in the rest pose are above the root at the height of their own proportions."""
    arrays, state = data.gaze.arrays, data.state
    height = state.pose_pelvis[:, 1] * data.scale[:, arrays.leg_segment].astype(np.float64)
    for offset, segment in zip(arrays.offset, arrays.segment, strict=True):
        height += offset[1] * data.scale[:, segment]
    height += arrays.eye_offset[0, 1] * data.scale[:, arrays.eye_segment[0]]
    error = np.abs(state.gaze_target_world[:, 1] - np.roll(height, -1)).max()
    return None if error < 1e-5 else f"eyes are off by {error:.2g} m"


CASES = [
    Case(
        "gaze: waist to eyes, everyone looks",
        SIZES,
        set_up,
        turn,
        check_turn,
        reset=copy_poses,
        bound_us=0.28,
    ),
    Case("gaze: eyes of others", SIZES, set_up, find_eyes, check_eyes),
    Case("gaze: saccades", SIZES, set_up, jump, check_jump, bound_us=0.05),
    Case("gaze: glances", SIZES, set_up_glances, glance, check_glance, bound_us=0.05),
]
