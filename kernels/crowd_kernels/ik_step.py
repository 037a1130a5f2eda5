"""One iteration of inverse kinematics for sixteen characters: joints placed, system built, joints turned."""

from typing import Any

import numpy as np

from crowd_kernels._jit import kernel
from crowd_kernels.ik_accumulate import (
    add_lever_row,
    add_moments_row,
    add_own_moments_row,
    finish_cross_row,
    finish_frame_row,
    finish_place_row,
    finish_push_row,
    take_cross_row,
    take_frame_row,
    take_place_row,
)
from crowd_kernels.ik_effector import add_torque_row
from crowd_kernels.ik_gather import frame_of
from crowd_kernels.ik_joint import forward_row, free_step_row, pull_row, rest_row, step_row
from crowd_kernels.ik_lanes import clear_row
from crowd_kernels.ik_layout import BLOCK, IS_FIXED, IS_OUTSIDE, ONE, ZERO
from crowd_kernels.ik_limit import (
    begin_fixing_row,
    excess_row,
    find_limit_row,
    find_room_row,
    limit_row,
    lock_axis_row,
)
from crowd_kernels.ik_root import root_accumulate_row, root_subtract_row
from crowd_kernels.ik_system import block_of
from crowd_kernels.ik_tree import TreeArrays
from crowd_kernels.lanes import LANES


@kernel
def place_joints(tree: TreeArrays, scale: Any, joints: Any) -> None:
    """Take over the next rotations of all joints of a block, and compute places and frames.

    Parameters
    ----------
    tree : TreeArrays
    scale : (G * 16,) float32
        Proportions.
    joints : (K + 1, JOINT_ROW) float32
        The root and all joints.
    """
    for k in range(tree.joint.shape[0]):
        part = tree.segment[k] * LANES
        forward_row(
            joints[tree.parent[k] + 1],
            scale[part : part + LANES],
            tree.offset[k, 0],
            tree.offset[k, 1],
            tree.offset[k, 2],
            joints[k + 1],
        )


@kernel
def free_joints(tree: TreeArrays, gain: Any, bound: Any, approach: Any, joints: Any) -> None:
    """Set drift, mobility and room of all joints of a block for a new iteration.

    Parameters
    ----------
    tree : TreeArrays
    gain : float32
        Share of the way to the reference pose.
    bound : float32
        Largest rotation towards it, rad.
    approach : float32
        Largest share of the way from the last pose to a limit that a joint goes.
    joints : (K + 1, JOINT_ROW) float32
        The root and all joints.
    """
    for k in range(tree.joint.shape[0]):
        if tree.weight[k] <= ZERO:
            continue
        above = joints[tree.parent[k] + 1]
        pull_row(above, gain, bound, joints[k + 1])
        if tree.is_limited[k]:
            find_room_row(approach, tree.inverse_swing[k, 0], tree.inverse_swing[k, 1], joints[k + 1])
            for axis in range(3):
                if tree.is_free[k, axis] == ZERO:
                    if joints[k + 1, IS_FIXED] == ZERO:
                        begin_fixing_row(tree.weight[k], joints[k + 1])
                    lock_axis_row(
                        above,
                        tree.weight[k],
                        frame_of(tree.parent_frame, k),
                        frame_of(tree.joint_frame, k),
                        axis,
                        joints[k + 1],
                    )


@kernel
def add_free_joints(
    tree: TreeArrays, a: int, b: int, parts: int, joints: Any, effectors: Any, out_system: Any, out_push: Any
) -> None:
    """Make the blocks of two effectors as if all joints turned freely.

    Parameters
    ----------
    a, b : int
        Effectors of the blocks' rows and columns. Where both are the same, its right side is made too.
    out_system : (E * parts * (E * parts + 1) / 2, 144) float32
        Blocks of the lower triangle, 0 on entry: those of a and b are written.
    out_push : (E, PUSH) float32
        Right side, 0 on entry.

    Notes
    -----
    All other arguments are those of `build_system`.
    """
    places = out_system[block_of(a * parts, b * parts)]
    # The two blocks of a's rotation are neighbours.
    first = block_of(2 * a + 1, 2 * b) if parts == 2 else 0
    frames = out_system[first : first + parts].reshape(parts * BLOCK)
    crossed = out_system[block_of(2 * a, 2 * b + 1) if parts == 2 and a != b else 0]
    total = ZERO
    for k in range(tree.joint.shape[0]):
        if tree.moves[a, k] and tree.moves[b, k]:
            weight, joint = tree.weight[k], joints[k + 1]
            total += weight
            if a == b:
                add_own_moments_row(joint, weight, effectors[a], out_push[a], places)
            else:
                add_moments_row(joint, weight, effectors[a], effectors[b], places)
            if parts == 2:
                add_lever_row(joint, weight, effectors[b], frames)
                if a != b:
                    add_lever_row(joint, weight, effectors[a], crossed)
    finish_place_row(effectors[a], effectors[b], places)
    if a == b:
        finish_push_row(effectors[a], out_push[a])
    if parts == 2:
        finish_frame_row(effectors[a], effectors[b], total, frames)
        if a != b:
            finish_cross_row(effectors[a], effectors[b], crossed)


@kernel
def take_fixed_joint(
    weight: Any, joint: Any, effectors: Any, a: int, b: int, parts: int, out_system: Any
) -> None:
    """Take what a joint with fixed directions cannot do from the blocks of two effectors.

    Parameters
    ----------
    weight : float32
        How easily the joint would turn freely.
    joint : (JOINT_ROW,) float32
    effectors : (E, EFFECTOR_ROW) float32
    a, b : int
        Effectors of the blocks' rows and columns.
    parts : int
        Rows of blocks of an effector: 1 position, 2 position and rotation.
    out_system : (E * parts * (E * parts + 1) / 2, 144) float32
        Blocks of the lower triangle, in and out.
    """
    take_place_row(joint, weight, effectors[a], effectors[b], out_system[block_of(a * parts, b * parts)])
    if parts == 1:
        return
    first = block_of(2 * a + 1, 2 * b)
    frames = out_system[first : first + 2].reshape(2 * BLOCK)
    take_frame_row(joint, weight, effectors[a], effectors[b], frames)
    if a != b:
        crossed = out_system[block_of(2 * a, 2 * b + 1)]
        take_cross_row(joint, weight, effectors[a], effectors[b], crossed)


@kernel
def build_system(
    tree: TreeArrays, parts: int, joints: Any, effectors: Any, out_system: Any, out_push: Any
) -> None:
    """Build J W J^T, and the right side dx - J z.

    Parameters
    ----------
    tree : TreeArrays
    parts : int
        Rows of blocks of an effector: 1 position, 2 position and rotation.
    joints : (K + 1, JOINT_ROW) float32
        The root and all joints.
    effectors : (E, EFFECTOR_ROW) float32
    out_system : (E * parts * (E * parts + 1) / 2, 144) float32
        Blocks of the lower triangle.
    out_push : (E, PUSH) float32
        Right side.
    """
    root_weight = np.float32(tree.root_weight)
    out_system[:] = ZERO
    out_push[:] = ZERO
    for a in range(tree.effector.shape[0]):
        for b in range(a + 1):
            add_free_joints(tree, a, b, parts, joints, effectors, out_system, out_push)
            for k in range(tree.joint.shape[0]):
                if tree.moves[a, k] and tree.moves[b, k] and joints[k + 1, IS_FIXED] != ZERO:
                    take_fixed_joint(tree.weight[k], joints[k + 1], effectors, a, b, parts, out_system)
            if root_weight > ZERO:
                places = out_system[block_of(a * parts, b * parts)]
                root_accumulate_row(effectors[a], effectors[b], root_weight, places)
        if root_weight > ZERO:
            root_subtract_row(joints[0], effectors[a], out_push[a])


@kernel
def turn_joints(
    tree: TreeArrays,
    approach: Any,
    joints: Any,
    effectors: Any,
    push: Any,
    running: Any,
    largest: Any,
    out_violations: Any,
) -> None:
    """Find the next rotations of all joints, and fix those that would leave their limits.

    Parameters
    ----------
    tree : TreeArrays
    approach : float32
        Largest share of the way from the last pose to a limit that a joint goes.
    joints : (K + 1, JOINT_ROW) float32
        The root and all joints.
    effectors : (E, EFFECTOR_ROW) float32
    push : (E, PUSH) float32
        Solution of the system.
    running : (16,) float32
        0 where the character stays as it is.
    largest : (16,) float32
        Scratch.
    out_violations : (16,) float32
        Number of directions that were fixed.
    """
    clear_row(out_violations)
    clear_row(largest)
    for k in range(tree.joint.shape[0]):
        if tree.weight[k] <= ZERO:
            continue
        is_first = True
        for e in range(tree.effector.shape[0]):
            if tree.moves[e, k]:
                add_torque_row(effectors[e], push[e], is_first, joints[k + 1])
                is_first = False
        if is_first:
            rest_row(joints[k + 1])
        above = joints[tree.parent[k] + 1]
        if joints[k + 1, IS_FIXED] == ZERO:
            free_step_row(above, tree.weight[k], running, joints[k + 1])
        else:
            step_row(above, running, joints[k + 1])
        if not tree.is_limited[k]:
            continue
        is_outside = find_limit_row(
            approach,
            frame_of(tree.parent_frame, k),
            frame_of(tree.joint_frame, k),
            tree.inverse_swing[k, 0],
            tree.inverse_swing[k, 1],
            joints[k + 1],
        )
        is_free = tree.is_free[k, 0] * tree.is_free[k, 1] * tree.is_free[k, 2] > ZERO
        joints[k + 1, IS_OUTSIDE] = ZERO
        if is_outside or not is_free:
            joints[k + 1, IS_OUTSIDE] = ONE
            excess_row(
                tree.inverse_swing[k, 0],
                tree.inverse_swing[k, 1],
                tree.is_free[k, 2],
                joints[k + 1],
                largest,
            )
    for k in range(tree.joint.shape[0]):
        if tree.weight[k] > ZERO and tree.is_limited[k] and joints[k + 1, IS_OUTSIDE] != ZERO:
            if joints[k + 1, IS_FIXED] == ZERO:
                begin_fixing_row(tree.weight[k], joints[k + 1])
            limit_row(
                joints[tree.parent[k] + 1],
                tree.weight[k],
                frame_of(tree.parent_frame, k),
                frame_of(tree.joint_frame, k),
                tree.inverse_swing[k, 0],
                tree.inverse_swing[k, 1],
                tree.is_free[k, 0],
                tree.is_free[k, 1],
                tree.is_free[k, 2],
                running,
                largest,
                joints[k + 1],
                out_violations,
            )
