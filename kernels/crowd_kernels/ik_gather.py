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
    vector_at,
)
from crowd_kernels.ik_limit import hold_reference_row
from crowd_kernels.ik_tree import TreeArrays
from crowd_kernels.lanes import LANES
from crowd_kernels.vector import dot

POSITION = 1
ROTATION_TOO = 2
"""Tasks of an effector: 1 position, 2 rotation, 3 both; 0 for none."""
FAR: Any = np.float32(1e30)
LEAST_SQUARE: Any = np.float32(0.5)
"""Rotations whose squared length is less than this, or more than its inverse, are none."""


@kernel
def frame_of(frames: Any, k: int) -> tuple[Any, Any, Any, Any]:
    """Read a frame of a limit."""
    return frames[k, 0], frames[k, 1], frames[k, 2], frames[k, 3]


@kernel
def is_sound(place: Any, square: Any, point: Any, wants_place: bool, wants_frame: bool) -> bool:
    """Tell whether a target can be sought: what is asked for is finite, and the rotation is one."""
    total = point[0] + point[1] + point[2]
    if wants_place:
        total += place[0] + place[1] + place[2]
    if wants_frame and not (square > LEAST_SQUARE and square < ONE / LEAST_SQUARE):
        return False
    return bool(np.isfinite(total))


@kernel
def gather_effectors(
    tree: TreeArrays,
    task: Any,
    point: Any,
    target_position: Any,
    target_rotation: Any,
    active: Any,
    first: int,
    scale: Any,
    out_effectors: Any,
) -> int:
    """Read the targets of 16 active characters.

    Parameters
    ----------
    first : int
        Place in `active` of the first lane.
    scale : (G * 16,) float32
        Their proportions.
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
            asked = task[character, column]
            place = target_position[character, column]
            frame = target_rotation[character, column]
            own_point = point[character, column]
            square = frame[0] * frame[0] + frame[1] * frame[1] + frame[2] * frame[2] + frame[3] * frame[3]
            if not is_sound(place, square, own_point, (asked & POSITION) != 0, (asked & ROTATION_TOO) != 0):
                asked = 0
            wants_place, wants_frame = (asked & POSITION) != 0, (asked & ROTATION_TOO) != 0
            row[WANTS_PLACE + lane] = ONE if wants_place else ZERO
            row[WANTS_FRAME + lane] = ONE if wants_frame else ZERO
            inverse = ONE / np.sqrt(square)
            for component in range(4):
                rest = ONE if component == 0 else ZERO
                row[TARGET_FRAME + component * LANES + lane] = (
                    frame[component] * inverse if wants_frame else rest
                )
            for axis in range(3):
                row[POINT + axis * LANES + lane] = own_point[axis] if asked != 0 else ZERO
                row[TARGET + axis * LANES + lane] = place[axis] if wants_place else ZERO
            if wants_frame:
                parts = 2
        if tree.root_weight > 0.0:
            row[LENGTH : LENGTH + LANES] = FAR
            continue
        for lane in range(LANES):
            reach = vector_at(row, POINT, lane)
            row[LENGTH + lane] = np.sqrt(dot(reach, reach))
        k = tree.effector[e]
        while k >= 0 and k != tree.base[e]:
            x, y, z = tree.offset[k, 0], tree.offset[k, 1], tree.offset[k, 2]
            own = np.sqrt(x * x + y * y + z * z)
            for lane in range(LANES):
                row[LENGTH + lane] += own * scale[tree.segment[k] * LANES + lane]
            k = tree.parent[k]
    return parts


@kernel
def gather_rotation(tree: TreeArrays, k: int, pose: Any, begin: int, lane: int, out_joint: Any) -> None:
    """Read the rotation of the tree's joint k from a pose row to one lane of a joint's row."""
    index, step, place = tree.joint[k] * tree.joint_step, tree.component_step, begin + lane
    out_joint[place] = pose[index]
    out_joint[place + LANES] = pose[index + step]
    out_joint[place + 2 * LANES] = pose[index + 2 * step]
    out_joint[place + 3 * LANES] = pose[index + 3 * step]


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
        Written: the pose as next rotations, the reference, bounds and last values of limits; frames are used
        for the last pose, and what is left of them has no meaning.

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
        for k in range(tree.joint.shape[0]):
            joint = out_joints[k + 1]
            gather_rotation(tree, k, pose_rotation[character], NEXT, lane, joint)
            if tree.weight[k] > ZERO:
                gather_rotation(tree, k, reference_rotation[character], REFERENCE, lane, joint)
            if tree.is_limited[k]:
                gather_rotation(tree, k, last_rotation[character], FRAME, lane, joint)
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
