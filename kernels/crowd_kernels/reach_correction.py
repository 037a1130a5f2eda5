"""Corrections by inverse kinematics: carried from step to step, on top of the blended motion.

A solve that starts anew from each blended pose may fall to another side of a joint limit in each step, and
the pose jumps. Here it starts from the blended pose turned as the last solution was turned against its own,
so that the solution moves on from where it was while the examples are followed at once.

A correction c turns a joint in its parent's frame: solution = c blended. It is kept as the vector part of
c, whose scalar part is not negative; zero is no correction.
"""

from typing import Any

import numpy as np

from crowd_kernels._jit import inlined_kernel, parallel_kernel, prange
from crowd_kernels.ik_layout import unit_quaternion
from crowd_kernels.ik_tree import TreeArrays
from crowd_kernels.quaternion import Quaternion, conjugate, multiply

CHUNKS = 32
LANES = 32
"""Most joints of a tree; components of a correction stand this far apart."""
ZERO: Any = np.float32(0.0)
ONE: Any = np.float32(1.0)


@inlined_kernel
def joint_rotation(tree: TreeArrays, k: int, row: Any) -> Quaternion:
    """Read a joint of the tree from a pose row."""
    index = tree.joint[k] * tree.joint_step
    step = tree.component_step
    return row[index], row[index + step], row[index + 2 * step], row[index + 3 * step]


@inlined_kernel
def set_joint_rotation(tree: TreeArrays, k: int, rotation: Quaternion, out_row: Any) -> None:
    """Write a joint of the tree into a pose row."""
    index = tree.joint[k] * tree.joint_step
    step = tree.component_step
    out_row[index] = rotation[0]
    out_row[index + step] = rotation[1]
    out_row[index + 2 * step] = rotation[2]
    out_row[index + 3 * step] = rotation[3]


@inlined_kernel
def kept_of(tree: TreeArrays, task: Any, kept: Any, k: int) -> Any:
    """Find the share of its last correction that a joint keeps: the largest of the effectors it moves."""
    share = ZERO
    for e in range(tree.effector.shape[0]):
        column = tree.column[e]
        if tree.moves[e, k] != 0 and task[column] != 0:
            share = max(share, kept[column])
    return share


@inlined_kernel
def mixed_rotation(last: Quaternion, start: Quaternion, share: Any) -> Quaternion:
    """Mix the rotation of the last step, by a share, with that from which this one starts; 0 for none."""
    dot = last[0] * start[0] + last[1] * start[1] + last[2] * start[2] + last[3] * start[3]
    own = share if dot >= ZERO else -share
    rest = ONE - share if dot != ZERO else ONE
    return unit_quaternion(
        (
            own * last[0] + rest * start[0],
            own * last[1] + rest * start[1],
            own * last[2] + rest * start[2],
            own * last[3] + rest * start[3],
        )
    )


@parallel_kernel
def start_solves(
    tree: TreeArrays,
    task: Any,
    kept: Any,
    correction: Any,
    pose_rotation: Any,
    active: Any,
    last_rotation: Any,
    out_rotation: Any,
) -> None:
    """Turn blended poses by the last corrections: where the next solves start.

    Parameters
    ----------
    tree : TreeArrays
        K joints, at most 32, of all effectors.
    task : (N, >= E) uint8
        What is asked of each effector, 0 for nothing. Joints that move none with a task are not corrected.
    kept : (N, >= E) float32
        Share of the last correction that is still made for each effector, 0 to 1.
    correction : (N, 96) float32
        Vector part of the last correction: component c of the tree's joint k stands at 32 c + k.
    pose_rotation : (N, L) float32
        Blended poses, unit quaternions.
    active : (A,) int32
        Characters to process, each once; 0 to N - 1.
    last_rotation : (N, L) float32
        In: last solutions, 0 for none. Out: poses from which joints shall approach their limits, the last
        solutions where all of the correction is kept, and near to where the solves start where little is.
    out_rotation : (N, L) float32
        Joints of the tree are written.

    Notes
    -----
    **Source:** Feng, Xu, Shapiro, "An example-based motion synthesis technique for locomotion and object
    manipulation", 2012, section 5.2: increments are found from the current joint angles.
    **Differs from the source:** the current angles follow the motion of the examples before each solve, so
    that a step of inverse kinematics has only the change of the correction to find.
    """
    count = active.shape[0]
    for chunk in prange(CHUNKS):
        for index in range(chunk * count // CHUNKS, (chunk + 1) * count // CHUNKS):
            character = active[index]
            row = correction[character]
            is_new = last_rotation[character, tree.joint[0] * tree.joint_step] == ZERO
            for k in range(tree.joint.shape[0]):
                rotation = joint_rotation(tree, k, pose_rotation[character])
                share = kept_of(tree, task[character], kept[character], k)
                if share > ZERO:
                    x, y, z = share * row[k], share * row[LANES + k], share * row[2 * LANES + k]
                    w = np.sqrt(max(ONE - x * x - y * y - z * z, ZERO))
                    rotation = unit_quaternion(multiply((w, x, y, z), rotation))
                set_joint_rotation(tree, k, rotation, out_rotation[character])
                if share < ONE or is_new:
                    last = joint_rotation(tree, k, last_rotation[character])
                    # A hand that is nearly back comes to the blended motion in time, beside any limit.
                    last = mixed_rotation(last, rotation, share * share)
                    set_joint_rotation(tree, k, last, last_rotation[character])


@parallel_kernel
def keep_corrections(
    tree: TreeArrays, solution: Any, active: Any, pose_rotation: Any, out_correction: Any, out_last: Any
) -> None:
    """Take solutions into the poses, and keep how they are turned against the blended ones.

    Parameters
    ----------
    tree : TreeArrays
        K joints, at most 32.
    solution : (N, L) float32
        Pose rows that the solves left, unit quaternions.
    active : (A,) int32
        Characters to process, each once; 0 to N - 1.
    pose_rotation : (N, L) float32
        In: the blended poses. Out: the solutions, at joints that the tree turns.
    out_correction : (N, 96) float32
        Laid out as in `start_solves`.
    out_last : (N, L) float32
        The solutions, at joints that the tree turns.

    Notes
    -----
    **Source:** see `start_solves`.
    """
    count = active.shape[0]
    for chunk in prange(CHUNKS):
        for index in range(chunk * count // CHUNKS, (chunk + 1) * count // CHUNKS):
            character = active[index]
            row = out_correction[character]
            for k in range(tree.joint.shape[0]):
                if tree.weight[k] <= ZERO:
                    continue
                solved = joint_rotation(tree, k, solution[character])
                blended = joint_rotation(tree, k, pose_rotation[character])
                w, x, y, z = multiply(solved, conjugate(blended))
                sign = ONE if w >= ZERO else -ONE
                row[k] = sign * x
                row[LANES + k] = sign * y
                row[2 * LANES + k] = sign * z
                set_joint_rotation(tree, k, solved, pose_rotation[character])
                set_joint_rotation(tree, k, solved, out_last[character])
