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
from crowd_kernels.joint_limit import into_limit, join, out_of_limit, split
from crowd_kernels.quaternion import Quaternion, conjugate, multiply
from crowd_kernels.vector import Vector, add, dot, scaled, subtract

CHUNKS = 32
LANES = 32
"""Most joints of a tree; components of a correction stand this far apart."""
FAR: Any = np.float32(1e3)
ZERO: Any = np.float32(0.0)
ONE: Any = np.float32(1.0)
TINY: Any = np.float32(1e-6)


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
def share_of(tree: TreeArrays, task: Any, share: Any, k: int) -> Any:
    """Find the share of a joint: the largest of the effectors that have a task and that it moves."""
    most = ZERO
    for e in range(tree.effector.shape[0]):
        column = tree.column[e]
        if tree.moves[e, k] != 0 and task[column] != 0:
            most = max(most, share[column])
    return most


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
    bound: Any,
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
    bound : (N, >= E) float32
        How far joints are bound to approach their limits slowly, for each effector, 0 to 1: where they are
        not, they go where the blended motion takes them.
    correction : (N, 96) float32
        Vector part of the last correction: component c of the tree's joint k stands at 32 c + k.
    pose_rotation : (N, L) float32
        Blended poses, unit quaternions.
    active : (A,) int32
        Characters to process, each once; 0 to N - 1.
    last_rotation : (N, L) float32
        In: last solutions, 0 for none. Out: poses from which joints shall approach their limits, the last
        solutions where joints are bound, and where the solves start where they are not.
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
                share = share_of(tree, task[character], kept[character], k)
                if share > ZERO:
                    x, y, z = share * row[k], share * row[LANES + k], share * row[2 * LANES + k]
                    w = np.sqrt(max(ONE - x * x - y * y - z * z, ZERO))
                    rotation = unit_quaternion(multiply((w, x, y, z), rotation))
                set_joint_rotation(tree, k, rotation, out_rotation[character])
                share = share_of(tree, task[character], bound[character], k)
                if share < ONE or is_new:
                    last = joint_rotation(tree, k, last_rotation[character])
                    last = mixed_rotation(last, rotation, share)
                    set_joint_rotation(tree, k, last, last_rotation[character])


@inlined_kernel
def within_limits(tree: TreeArrays, k: int, rotation: Quaternion, solved: Quaternion) -> Quaternion:
    """Bring a joint's rotation within its limits, or as far beyond them as its solution is.

    Parameters
    ----------
    tree : TreeArrays
    k : int
        Joint of the tree. Axes that are not free turn as in the solution.
    rotation, solved : tuple of float32

    Returns
    -------
    tuple of float32
        With the sign of the solution.
    """
    parent_frame = (
        tree.parent_frame[k, 0],
        tree.parent_frame[k, 1],
        tree.parent_frame[k, 2],
        tree.parent_frame[k, 3],
    )
    joint_frame = (
        tree.joint_frame[k, 0],
        tree.joint_frame[k, 1],
        tree.joint_frame[k, 2],
        tree.joint_frame[k, 3],
    )
    x, y, twist = split(into_limit(parent_frame, rotation, joint_frame))
    own_x, own_y, own_twist = split(into_limit(parent_frame, solved, joint_frame))
    x = own_x + tree.is_free[k, 0] * (x - own_x)
    y = own_y + tree.is_free[k, 1] * (y - own_y)
    twist = own_twist + tree.is_free[k, 2] * (twist - own_twist)
    twist = min(max(twist, min(tree.twist[k, 0], own_twist)), max(tree.twist[k, 1], own_twist))
    inverse_x, inverse_y = tree.inverse_swing[k, 0], tree.inverse_swing[k, 1]
    u, v = x * inverse_x, y * inverse_y
    own_u, own_v = own_x * inverse_x, own_y * inverse_y
    value = u * u + v * v
    largest = max(ONE, own_u * own_u + own_v * own_v)
    share = np.sqrt(largest / value) if value > largest else ONE
    inside = out_of_limit(parent_frame, join(share * x, share * y, twist), joint_frame)
    dot = inside[0] * solved[0] + inside[1] * solved[1] + inside[2] * solved[2] + inside[3] * solved[3]
    sign = ONE if dot >= ZERO else -ONE
    return sign * inside[0], sign * inside[1], sign * inside[2], sign * inside[3]


@inlined_kernel
def correction_of(solved: Quaternion, blended: Quaternion) -> Vector:
    """Find the correction that turns a blended rotation into a solution."""
    w, x, y, z = multiply(solved, conjugate(blended))
    sign = ONE if w >= ZERO else -ONE
    return sign * x, sign * y, sign * z


@inlined_kernel
def eased_rotation(
    tree: TreeArrays, k: int, turn: Vector, blended: Quaternion, solved: Quaternion
) -> Quaternion:
    """Turn a blended rotation by another correction than that of its solution, within the joint's limits."""
    x, y, z = turn
    w = np.sqrt(max(ONE - x * x - y * y - z * z, ZERO))
    rotation = unit_quaternion(multiply((w, x, y, z), blended))
    return within_limits(tree, k, rotation, solved) if tree.is_limited[k] != 0 else rotation


@inlined_kernel
def is_slower(tree: TreeArrays, solution: Any, last: Any, slowest: Any) -> bool:
    """Tell whether all joints that a tree turns go less far from row to row than twice an angle, rad."""
    largest = ZERO
    for k in range(tree.joint.shape[0]):
        if tree.weight[k] > ZERO:
            w, x, y, z = joint_rotation(tree, k, solution)
            to_w, to_x, to_y, to_z = joint_rotation(tree, k, last)
            sign = ONE if w * to_w + x * to_x + y * to_y + z * to_z >= ZERO else -ONE
            w, x, y, z = w - sign * to_w, x - sign * to_x, y - sign * to_y, z - sign * to_z
            largest = max(largest, w * w + x * x + y * y + z * z)
    return bool(largest < slowest * slowest)


@parallel_kernel
def keep_corrections(
    tree: TreeArrays,
    most: float,
    slowest: float,
    task: Any,
    bound: Any,
    waited: Any,
    solution: Any,
    active: Any,
    pose_rotation: Any,
    out_correction: Any,
    out_change: Any,
    out_last: Any,
    out_distance: Any,
) -> None:
    """Take solutions into the poses, and keep how they are turned against the blended ones.

    Corrections change their speed gradually, whatever the solutions do: arms that were straight, as their
    targets were out of reach, would else begin to bend at any speed, and joints jump that come to be held.
    What hands miss by it is made up for in the next steps.

    Parameters
    ----------
    tree : TreeArrays
        K joints, at most 32.
    most : float
        Largest change of a correction's change: half the angle, rad.
    slowest : float
        Half the angle that joints turn by in a step after a person has waited for 1 s, or else not at all,
        rad; in proportion to that time.
    task : (N, >= E) uint8
        What is asked of each effector, 0 for nothing.
    bound : (N, >= E) float32
        See `start_solves`: joints that are not bound turn as solved, as those of a hand that is nearly back.
    waited : (N,) float64
        For how long people have only waited with both hands, one of them far from its goal, s.
    solution : (N, L) float32
        Pose rows that the solves left, unit quaternions.
    active : (A,) int32
        Characters to process, each once; 0 to N - 1.
    pose_rotation : (N, L) float32
        In: the blended poses. Out: the solutions, at joints that the tree turns.
    out_correction : (N, 96) float32
        In: those of the last step. Out: these, laid out as in `start_solves`.
    out_change : (N, 96) float32
        How they have changed.
    out_last : (N, L) float32
        In: the last solutions. Out: these, at joints that the tree turns.
    out_distance : (N, 2) float32
        Written where joints may not turn as solved: farther than any hand is from its target.

    Notes
    -----
    **Source:** see `start_solves`.
    **Differs from the source:** bounds the acceleration of what inverse kinematics turns joints; limits come
    first, and bound solutions whose joints must stop.
    """
    count = active.shape[0]
    largest = np.float32(most)
    for chunk in prange(CHUNKS):
        for index in range(chunk * count // CHUNKS, (chunk + 1) * count // CHUNKS):
            character = active[index]
            row = out_correction[character]
            change = out_change[character]
            # Solves of two hands that cannot both be where they should creep on for long.
            is_still = waited[character] > 0.0 and is_slower(
                tree, solution[character], out_last[character], np.float32(slowest * waited[character])
            )
            is_eased = is_still
            for k in range(tree.joint.shape[0]):
                if tree.weight[k] <= ZERO:
                    continue
                solved = joint_rotation(tree, k, out_last[character] if is_still else solution[character])
                blended = joint_rotation(tree, k, pose_rotation[character])
                turn = correction_of(solved, blended)
                before = row[k], row[LANES + k], row[2 * LANES + k]
                expected = add(before, (change[k], change[LANES + k], change[2 * LANES + k]))
                away = subtract(turn, expected)
                square = dot(away, away)
                own = largest / max(share_of(tree, task[character], bound[character], k), TINY)
                if square > own * own:
                    turn = add(expected, scaled(away, own / np.sqrt(square)))
                    solved = eased_rotation(tree, k, turn, blended, solved)
                    turn = correction_of(solved, blended)
                    is_eased = True
                step = subtract(turn, before)
                for axis in range(3):
                    row[axis * LANES + k] = turn[axis]
                    change[axis * LANES + k] = step[axis]
                set_joint_rotation(tree, k, solved, pose_rotation[character])
                set_joint_rotation(tree, k, solved, out_last[character])
            if is_eased:
                out_distance[character, 0] = FAR
                out_distance[character, 1] = FAR
