"""What inverse kinematics could not do for a hand, which is made up for slowly.

Where joints are at their limits a hand stays behind what is asked for. As soon as the limits allow it,
inverse kinematics would make up for all of it within a step or two, and stop dead. So it is asked for the
target less what was missing in the last step, which fades. Targets that were met are followed without delay.
"""

from typing import Any

import numpy as np

from crowd_kernels._jit import inlined_kernel, parallel_kernel, prange
from crowd_kernels.clip import PADDED_JOINTS
from crowd_kernels.quaternion import (
    Quaternion,
    conjugate,
    from_rotation_vector,
    multiply,
    rotation_vector,
)
from crowd_kernels.reach_blend import ReachKeys
from crowd_kernels.reach_place import pelvis_of, place_point
from crowd_kernels.reach_state import ReachState, quaternion_of, set_vector, vector_of
from crowd_kernels.vector import Vector, add, norm, scaled, subtract

CHUNKS = 32
NOTHING = 0
BOTH = 3
"""Tasks of a hand: nothing, and position with rotation."""
SLIGHT, SLIGHT_TURN = 0.6, 3.2
"""Much less than a step at these speeds is made up for at once, the rest at the given rate, m/s and rad/s."""
EXACT = np.float32(1e-4)
"""Nothing is missing where inverse kinematics comes this close, m."""


@inlined_kernel
def spared_part(missing: Vector, slight: float, kept: float) -> Vector:
    """Find what of a missing vector is spared in the next step."""
    length = norm(missing)
    return scaled(missing, kept * length / (length + slight))


@inlined_kernel
def spare_missing_place(
    place: Vector, character: int, arm: int, kept: float, dt: float, state: ReachState
) -> Vector:
    """Take what was missing in the last step from a place that is asked for.

    Parameters
    ----------
    place : tuple of float
        Root frame, m.
    character, arm : int
    kept : float
        Share of what was missing that is still spared.
    dt : float
        s.
    state : ReachState
        In and out: `missing_place` becomes what is spared.

    Returns
    -------
    tuple of float
        What inverse kinematics shall be asked for, root frame, m.
    """
    spared = spared_part(vector_of(state.missing_place, character, arm), SLIGHT * dt, kept)
    set_vector(state.missing_place, character, arm, spared)
    return subtract(place, spared)


@inlined_kernel
def spare_missing_turn(
    rotation: Quaternion, character: int, arm: int, kept: float, dt: float, state: ReachState
) -> Quaternion:
    """Take what was missing in the last step from a rotation that is asked for.

    Parameters
    ----------
    rotation : tuple of float
        Root frame.
    character, arm : int
    kept : float
        Share of what was missing that is still spared.
    dt : float
        s.
    state : ReachState
        In and out: `missing_turn` becomes what is spared.

    Returns
    -------
    tuple of float
        What inverse kinematics shall be asked for, root frame.
    """
    spared = spared_part(vector_of(state.missing_turn, character, arm), SLIGHT_TURN * dt, kept)
    set_vector(state.missing_turn, character, arm, spared)
    return multiply(from_rotation_vector(scaled(spared, -1.0)), rotation)


@inlined_kernel
def find_missing(
    character: int,
    arm: int,
    keys: ReachKeys,
    scale: Any,
    task: int,
    target: Any,
    target_rotation: Any,
    pose: Any,
    pelvis: Any,
    state: ReachState,
) -> tuple[float, float]:
    """Find what is missing of what one hand was asked for; returns distance, m, and angle, rad.

    Notes
    -----
    Arguments are those of `find_missing_crowd`, for one character.
    """
    body, rotation = pelvis_of(keys, scale, pose, pelvis)
    tip, turned = place_point(character, arm, scale, body, rotation, keys, state, pose, PADDED_JOINTS)
    away = subtract(vector_of(target, character, arm), tip)
    set_vector(state.missing_place, character, arm, add(vector_of(state.missing_place, character, arm), away))
    missing = (0.0, 0.0, 0.0)
    if task == BOTH:
        spared = from_rotation_vector(vector_of(state.missing_turn, character, arm))
        wanted = multiply(spared, quaternion_of(target_rotation, character, arm))
        missing = rotation_vector(multiply(wanted, conjugate(turned)))
    set_vector(state.missing_turn, character, arm, missing)
    return norm(away), norm(missing)


@parallel_kernel
def find_missing_crowd(
    keys: ReachKeys,
    segment_scale: Any,
    task: Any,
    target: Any,
    target_rotation: Any,
    active: Any,
    pose_rotation: Any,
    pose_pelvis: Any,
    state: ReachState,
    out_distance: Any,
    out_angle: Any,
) -> None:
    """Find what is missing of what hands were asked for, after inverse kinematics.

    Parameters
    ----------
    keys : ReachKeys
    segment_scale : (N, G) float32
        Proportions.
    task : (N, 2) uint8
        What inverse kinematics was asked: 0 nothing, 1 position, 3 position and rotation.
    target : (N, 2, 3) float32
        Places that it was asked for: those wanted less what was spared, root frame, m.
    target_rotation : (N, 2, 4) float32
        Rotations, likewise.
    active : (A,) int32
        Characters of whom a hand reaches, each once.
    pose_rotation : (N, 256) float32
        Pose rows.
    pose_pelvis : (N, 3) float32
        Pelvis in the root frame at leg scale 1, m.
    state : ReachState
        In and out: `missing_place` and `missing_turn`, what was spared and what is missing.
    out_distance : (N, 2) float32
        In and out: how far the hands are from `target`, m; found anew where they are not very close.
    out_angle : (N, 2) float32
        Angle to the rotation wanted, rad; 0 where none is.

    Notes
    -----
    **Source:** Feng, Xu, Shapiro, section 5.2: the target of inverse kinematics varies in time.
    **Differs from the source:** targets that were missed are approached again at a given rate.
    """
    count = active.shape[0]
    for chunk in prange(CHUNKS):
        for index in range(chunk * count // CHUNKS, (chunk + 1) * count // CHUNKS):
            character = active[index]
            for arm in range(2):
                asked = task[character, arm]
                angle = 0.0
                if asked == NOTHING:
                    set_vector(state.missing_place, character, arm, (0.0, 0.0, 0.0))
                    set_vector(state.missing_turn, character, arm, (0.0, 0.0, 0.0))
                elif asked == BOTH or out_distance[character, arm] > EXACT:
                    out_distance[character, arm], angle = find_missing(
                        character,
                        arm,
                        keys,
                        segment_scale[character],
                        asked,
                        target,
                        target_rotation,
                        pose_rotation[character],
                        pose_pelvis[character],
                        state,
                    )
                out_angle[character, arm] = angle
