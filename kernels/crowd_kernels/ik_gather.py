"""Poses and targets of sixteen characters, gathered into the rows of inverse kinematics."""

from typing import Any

import numpy as np

from crowd_kernels._jit import kernel
from crowd_kernels.ik_layout import (
    FRAME,
    LENGTH,
    NEXT,
    ONE,
    PLACE,
    POINT,
    REFERENCE,
    TARGET,
    TARGET_FRAME,
    WANTS_FRAME,
    WANTS_PLACE,
    ZERO,
)
from crowd_kernels.ik_limit import hold_reference_row
from crowd_kernels.ik_tree import TreeArrays
from crowd_kernels.lanes import LANES

POSITION = 1
ROTATION_TOO = 2
"""Tasks of an effector: 1 position, 2 rotation, 3 both; 0 for none."""
FAR: Any = np.float32(1e30)
LEAST_LENGTH = 0.5


@kernel
def frame_of(frames: Any, k: int) -> tuple[Any, Any, Any, Any]:
    """Read a frame of a limit."""
    return frames[k, 0], frames[k, 1], frames[k, 2], frames[k, 3]


@kernel
def is_sound(place: Any, frame: Any, point: Any, wants_place: bool, wants_frame: bool) -> bool:
    """Tell whether a target can be sought: what is asked for is finite, and the rotation is one."""
    total = float(point[0]) + float(point[1]) + float(point[2])
    if wants_place:
        total += float(place[0]) + float(place[1]) + float(place[2])
    if wants_frame:
        square = 0.0
        for component in range(4):
            square += float(frame[component]) * float(frame[component])
        if not (square > LEAST_LENGTH and square < 1.0 / LEAST_LENGTH):
            return False
    return bool(np.isfinite(total))


@kernel
def gather_effectors(
    tree: TreeArrays,
    segment_scale: Any,
    task: Any,
    point: Any,
    target_position: Any,
    target_rotation: Any,
    active: Any,
    first: int,
    out_effectors: Any,
) -> int:
    """Read the targets of 16 active characters.

    Parameters
    ----------
    first : int
        Place in `active` of the first lane.
    out_effectors : (E, EFFECTOR_ROW) float32
        Written.

    Returns
    -------
    int
        Rows of blocks of an effector: 2 if anyone asks for a rotation, else 1.

    Notes
    -----
    All other arguments are those of `solve_crowd`.
    """
    count = active.shape[0]
    parts = 1
    for e in range(tree.effector.shape[0]):
        column = tree.column[e]
        row = out_effectors[e]
        for lane in range(LANES):
            character = active[min(first + lane, count - 1)]
            wants_place = (task[character, column] & POSITION) != 0
            wants_frame = (task[character, column] & ROTATION_TOO) != 0
            place = target_position[character, column]
            frame = target_rotation[character, column]
            if not is_sound(place, frame, point[character, column], wants_place, wants_frame):
                wants_place = False
                wants_frame = False
            if wants_frame:
                parts = 2
            row[WANTS_PLACE + lane] = ONE if wants_place else ZERO
            row[WANTS_FRAME + lane] = ONE if wants_frame else ZERO
            square = 0.0
            for component in range(4):
                square += float(frame[component]) * float(frame[component])
            for component in range(4):
                own = frame[component] / np.sqrt(square) if wants_frame else (1.0 if component == 0 else 0.0)
                row[TARGET_FRAME + component * LANES + lane] = own
            is_wanted = wants_place or wants_frame
            length: Any = 0.0
            for axis in range(3):
                own = point[character, column, axis] if is_wanted else ZERO
                row[POINT + axis * LANES + lane] = own
                length += own * own
                row[TARGET + axis * LANES + lane] = place[axis] if wants_place else ZERO
            row[LENGTH + lane] = np.sqrt(length) if tree.root_weight == 0.0 else FAR
        k = tree.effector[e]
        while k >= 0 and k != tree.base[e]:
            x, y, z = tree.offset[k, 0], tree.offset[k, 1], tree.offset[k, 2]
            own = np.sqrt(x * x + y * y + z * z)
            for lane in range(LANES):
                character = active[min(first + lane, count - 1)]
                row[LENGTH + lane] += own * segment_scale[character, tree.segment[k]]
            k = tree.parent[k]
    return parts


@kernel
def gather_joints(
    tree: TreeArrays,
    segment_scale: Any,
    pose_rotation: Any,
    reference_rotation: Any,
    last_rotation: Any,
    root_position: Any,
    active: Any,
    first: int,
    out_scale: Any,
    out_joints: Any,
) -> None:
    """Read proportions, pose, reference and last pose of 16 active characters.

    Parameters
    ----------
    first : int
        Place in `active` of the first lane.
    out_scale : (G * 16,) float32
        Written.
    out_joints : (K + 1, JOINT_ROW) float32
        Written: the pose as next rotations.

    Notes
    -----
    All other arguments are those of `solve_crowd`.
    """
    count = active.shape[0]
    for lane in range(LANES):
        character = active[min(first + lane, count - 1)]
        for part in range(segment_scale.shape[1]):
            out_scale[part * LANES + lane] = segment_scale[character, part]
        scale = segment_scale[character, tree.root_segment]
        for axis in range(3):
            out_joints[0, PLACE + axis * LANES + lane] = root_position[character, axis] * scale
        pose = pose_rotation[character]
        reference = reference_rotation[character]
        last = last_rotation[character]
        for k in range(tree.joint.shape[0]):
            begin = tree.joint[k] * tree.joint_step
            for component in range(4):
                index = begin + component * tree.component_step
                out_joints[k + 1, NEXT + component * LANES + lane] = pose[index]
                out_joints[k + 1, REFERENCE + component * LANES + lane] = reference[index]
                out_joints[k + 1, FRAME + component * LANES + lane] = last[index]
    out_joints[0, FRAME : FRAME + LANES] = ONE
    out_joints[0, FRAME + LANES : FRAME + 4 * LANES] = ZERO
    for k in range(tree.joint.shape[0]):
        if tree.is_limited[k]:
            hold_reference_row(
                frame_of(tree.parent_frame, k),
                frame_of(tree.joint_frame, k),
                tree.inverse_swing[k, 0],
                tree.inverse_swing[k, 1],
                tree.twist[k, 0],
                tree.twist[k, 1],
                out_joints[k + 1],
            )
