"""Holds of effectors: where they are, how far a hold has come, and where a solve shall bring them.

All walks go from an effector up to the pelvis, so only the joints of its own chain are read.
"""

import math
from typing import Any

from crowd_kernels._jit import kernel, parallel_kernel, prange
from crowd_kernels.ik import NONE
from crowd_kernels.ik_gather import POSITION, ROTATION_TOO
from crowd_kernels.ik_tree import TreeArrays
from crowd_kernels.quaternion import Quaternion, conjugate, from_yaw, multiply, normalized, rotate
from crowd_kernels.reach_state import NONE as NO_REACH
from crowd_kernels.reach_state import RETURN
from crowd_kernels.vector import Vector, add, scaled, subtract

CHUNKS = 32
GONE = 1e-3
"""Share of a hold's way that counts as none: the hold has come, or ended."""


@kernel
def held_point(
    tree: TreeArrays, e: int, segment_scale: Any, pose: Any, pelvis: Any, point: Any
) -> tuple[Quaternion, Vector]:
    """Find an effector of one character in the root frame.

    Parameters
    ----------
    tree : TreeArrays
    e : int
        Effector, 0 to E - 1.
    segment_scale : (G,) float32
        Proportions.
    pose : (L,) float32
        Pose row.
    pelvis : (3,) float32
        Pelvis at scale 1, m.
    point : (3,) float32
        The point in the frame of its joint, m.

    Returns
    -------
    rotation, place : tuple of float
        Rotation of the joint, and the point, m.
    """
    rotation = (1.0, 0.0, 0.0, 0.0)
    place = (float(point[0]), float(point[1]), float(point[2]))
    k = tree.effector[e]
    while k >= 0:
        index = tree.joint[k] * tree.joint_step
        step = tree.component_step
        local = (
            float(pose[index]),
            float(pose[index + step]),
            float(pose[index + 2 * step]),
            float(pose[index + 3 * step]),
        )
        scale = float(segment_scale[tree.segment[k]])
        offset = (tree.offset[k, 0] * scale, tree.offset[k, 1] * scale, tree.offset[k, 2] * scale)
        place = add(offset, rotate(local, place))
        rotation = multiply(local, rotation)
        k = tree.parent[k]
    scale = float(segment_scale[tree.root_segment])
    place = add(place, (pelvis[0] * scale, pelvis[1] * scale, pelvis[2] * scale))
    return normalized(rotation), place


@kernel
def hold_effectors_chunk(
    tree: TreeArrays,
    segment_scale: Any,
    pose_rotation: Any,
    pose_pelvis: Any,
    position_world: Any,
    yaw: Any,
    stage: Any,
    point: Any,
    active: Any,
    begin: int,
    end: int,
    out_task: Any,
    out_target_world: Any,
    out_target_rotation_world: Any,
    out_point: Any,
) -> None:
    """Hold the effectors of one run of active characters.

    Parameters
    ----------
    begin, end : int
        Range of `active`.

    Notes
    -----
    All other arguments are those of `hold_effectors`.
    """
    for index in range(begin, end):
        character = active[index]
        for e in range(stage.shape[1]):
            if stage[character, e] == NO_REACH:
                continue
            rotation, place = held_point(
                tree, e, segment_scale[character], pose_rotation[character], pose_pelvis[character], point
            )
            facing = from_yaw(yaw[character])
            place = rotate(facing, place)
            rotation = multiply(facing, rotation)
            for axis in range(3):
                out_point[character, e, axis] = point[axis]
            for axis, value in enumerate(place):
                out_target_world[character, e, axis] = position_world[character, axis] + value
            for component, value in enumerate(rotation):
                out_target_rotation_world[character, e, component] = value
            out_task[character, e] = 0 if stage[character, e] == RETURN else POSITION | ROTATION_TOO


@parallel_kernel
def hold_effectors(
    tree: TreeArrays,
    segment_scale: Any,
    pose_rotation: Any,
    pose_pelvis: Any,
    position_world: Any,
    yaw: Any,
    stage: Any,
    point: Any,
    active: Any,
    out_task: Any,
    out_target_world: Any,
    out_target_rotation_world: Any,
    out_point: Any,
) -> None:
    """Hold effectors where the pose has them now.

    Parameters
    ----------
    tree : TreeArrays
        E effectors, in the order of the columns; the root's joint is the pelvis.
    segment_scale : (N, G) float32
        Proportions, about 1.
    pose_rotation : (N, L) float32
        Pose rows: unit local rotations.
    pose_pelvis : (N, 3) float32
        Pelvis in the root frame at scale 1, m.
    position_world : (N, 3) float64
        Root, m.
    yaw : (N,) float64
        Heading, rad.
    stage : (N, H) uint8
        Stage of a reach for the first H of the effectors: none leaves the hold alone, a hand on its way back
        is followed but let go, all others are held.
    point : (3,) float32
        What is held, in the frame of the joint, m.
    active : (A,) int32
        Characters to process, each once; 0 to N - 1.
    out_task : (N, E) uint8
        Written where the stage is not none: 3, or 0 for hands on their way back.
    out_target_world : (N, E, 3) float64
        Written in the same places: the point, m.
    out_target_rotation_world : (N, E, 4) float32
        Written in the same places: rotation of the joint, unit quaternions.
    out_point : (N, E, 3) float32
        Written in the same places: `point`.

    Notes
    -----
    **Source:** forward kinematics of a chain.
    """
    count = active.shape[0]
    for k in prange(CHUNKS):
        chunk = (k * 37) % CHUNKS
        hold_effectors_chunk(
            tree,
            segment_scale,
            pose_rotation,
            pose_pelvis,
            position_world,
            yaw,
            stage,
            point,
            active,
            chunk * count // CHUNKS,
            (chunk + 1) * count // CHUNKS,
            out_task,
            out_target_world,
            out_target_rotation_world,
            out_point,
        )


@kernel
def faded(
    weight: float, speed: float, goal: float, rate: float, decay: float, dt: float
) -> tuple[float, float]:
    """Move a share to its goal as a critically damped spring.

    Parameters
    ----------
    weight, speed : float
        Share and its rate of change, 1/s.
    goal : float
        0 or 1.
    rate : float
        Rate of the spring, 1/s.
    decay : float
        ``exp(-rate * dt)``.
    dt : float
        s.

    Returns
    -------
    weight, speed : float
        After `dt`.
    """
    away = weight - goal
    change = (speed + rate * away) * dt
    following = goal + (away + change) * decay
    if abs(following - goal) < GONE:
        return goal, 0.0
    return following, (speed - rate * change) * decay


@kernel
def aim_effector(
    task: int,
    weight: float,
    rotation: Quaternion,
    place: Vector,
    position_world: Any,
    yaw: float,
    target_world: Any,
    target_rotation_world: Any,
    out_target: Any,
    out_target_rotation: Any,
) -> None:
    """Mix one target from where the incoming pose has an effector and where it is held.

    Parameters
    ----------
    task : int
        1 position, 2 rotation, 3 both.
    weight : float
        Share of the hold, above 0 and up to 1.
    rotation, place : tuple of float
        The effector in the incoming pose, root frame.
    position_world : (3,) float64
        Root, m.
    yaw : float
        Heading, rad.
    target_world : (3,) float64
        Where it is held, m.
    target_rotation_world : (4,) float32
        Rotation in which it is held.
    out_target : (3,) float32
        Root frame, m.
    out_target_rotation : (4,) float32
        Root frame, unit quaternion.
    """
    back = conjugate(from_yaw(yaw))
    if task & POSITION:
        away = subtract(
            (target_world[0], target_world[1], target_world[2]),
            (position_world[0], position_world[1], position_world[2]),
        )
        way = subtract(rotate(back, away), place)
        place = add(place, scaled(way, weight))
    if task & ROTATION_TOO:
        w, x, y, z = multiply(
            back,
            (
                float(target_rotation_world[0]),
                float(target_rotation_world[1]),
                float(target_rotation_world[2]),
                float(target_rotation_world[3]),
            ),
        )
        is_opposite = w * rotation[0] + x * rotation[1] + y * rotation[2] + z * rotation[3] < 0.0
        share = -weight if is_opposite else weight
        rest = 1.0 - weight
        rotation = (
            rest * rotation[0] + share * w,
            rest * rotation[1] + share * x,
            rest * rotation[2] + share * y,
            rest * rotation[3] + share * z,
        )
        length = math.sqrt(rotation[0] ** 2 + rotation[1] ** 2 + rotation[2] ** 2 + rotation[3] ** 2)
        # What is no rotation stays none, so that the solve refuses it.
        rotation = (rotation[0] / length, rotation[1] / length, rotation[2] / length, rotation[3] / length)
    for axis, value in enumerate(place):
        out_target[axis] = value
    for component, value in enumerate(rotation):
        out_target_rotation[component] = value


@kernel
def start_joints(tree: TreeArrays, mask: int, before: int, pose: Any, held: Any) -> None:
    """Prepare the pose from which the solve of one character starts.

    Joints stay as the last solve left them. Those that it did not turn come from the incoming pose.

    Parameters
    ----------
    tree : TreeArrays
    mask : int
        Bit e is set where effector e is held.
    before : int
        The same of the last step.
    pose : (L,) float32
        Incoming pose.
    held : (L,) float32
        In and out; joints that no held effector turns are left as they are, but for those that never turn.
    """
    is_same = mask & ~before == 0
    for k in range(tree.joint.shape[0]):
        if tree.weight[k] > 0.0 and (is_same or is_moved(tree, before, k)):
            continue
        copy_joint(tree, k, pose, held)


@kernel
def is_moved(tree: TreeArrays, mask: int, k: int) -> bool:
    """Tell whether an effector of a mask turns a joint."""
    found = False
    for e in range(tree.effector.shape[0]):
        if (mask >> e) & 1 and tree.moves[e, k]:
            found = True
    return found


@kernel
def copy_joint(tree: TreeArrays, k: int, pose: Any, out_pose: Any) -> None:
    """Copy the rotation of a joint of the tree from one pose row to another."""
    for component in range(4):
        index = component * tree.component_step + tree.joint[k] * tree.joint_step
        out_pose[index] = pose[index]


@kernel
def aim_holds_chunk(
    tree: TreeArrays,
    rate: float,
    dt: float,
    segment_scale: Any,
    pose_rotation: Any,
    pose_pelvis: Any,
    position_world: Any,
    yaw: Any,
    task: Any,
    target_world: Any,
    target_rotation_world: Any,
    point: Any,
    active: Any,
    begin: int,
    end: int,
    last_task: Any,
    weight: Any,
    weight_rate: Any,
    held_rotation: Any,
    out_target: Any,
    out_target_rotation: Any,
    out_status: Any,
    out_mask: Any,
) -> None:
    """Aim the holds of one run of active characters.

    Parameters
    ----------
    begin, end : int
        Range of `active`.

    Notes
    -----
    All other arguments are those of `aim_holds`.
    """
    decay = math.exp(-rate * dt)
    for index in range(begin, end):
        character = active[index]
        mask = 0
        before = 0
        for e in range(tree.effector.shape[0]):
            out_status[character, e] = NONE
            asked = task[character, e]
            share = float(weight[character, e])
            if share > 0.0:
                before |= 1 << e
            elif asked == 0:
                last_task[character, e] = 0
                continue
            goal = 1.0 if asked != 0 else 0.0
            share, speed = faded(share, float(weight_rate[character, e]), goal, rate, decay, dt)
            weight[character, e] = share
            weight_rate[character, e] = speed
            if asked != 0:
                last_task[character, e] = asked
            if not share > 0.0:
                last_task[character, e] = 0
                continue
            mask |= 1 << e
            rotation, place = held_point(
                tree,
                e,
                segment_scale[character],
                pose_rotation[character],
                pose_pelvis[character],
                point[character, e],
            )
            aim_effector(
                int(last_task[character, e]),
                share,
                rotation,
                place,
                position_world[character],
                yaw[character],
                target_world[character, e],
                target_rotation_world[character, e],
                out_target[character, e],
                out_target_rotation[character, e],
            )
        out_mask[character] = mask
        if mask != 0:
            start_joints(tree, mask, before, pose_rotation[character], held_rotation[character])


@parallel_kernel
def aim_holds(
    tree: TreeArrays,
    rate: float,
    dt: float,
    segment_scale: Any,
    pose_rotation: Any,
    pose_pelvis: Any,
    position_world: Any,
    yaw: Any,
    task: Any,
    target_world: Any,
    target_rotation_world: Any,
    point: Any,
    active: Any,
    last_task: Any,
    weight: Any,
    weight_rate: Any,
    held_rotation: Any,
    out_target: Any,
    out_target_rotation: Any,
    out_status: Any,
    out_mask: Any,
) -> None:
    """Fade holds in and out, mix their targets, and prepare the pose from which a solve starts.

    Parameters
    ----------
    tree : TreeArrays
        E effectors, in the order of the columns; the root's joint is the pelvis.
    rate : float
        Rate with which a hold comes and goes, 1/s.
    dt : float
        s.
    segment_scale : (N, G) float32
        Proportions, about 1.
    pose_rotation : (N, L) float32
        Incoming pose rows: unit local rotations.
    pose_pelvis : (N, 3) float32
        Pelvis in the root frame at scale 1, m.
    position_world : (N, 3) float64
        Root, m.
    yaw : (N,) float64
        Heading, rad.
    task : (N, E) uint8
        What is asked of each effector: 0 nothing, 1 position, 2 rotation, 3 both.
    target_world : (N, E, 3) float64
        Where effectors are held, m.
    target_rotation_world : (N, E, 4) float32
        Rotations in which they are held, unit quaternions.
    point : (N, E, 3) float32
        What is held, in the frame of the joint and the character's own size, m.
    active : (A,) int32
        Characters to process, each once; 0 to N - 1.
    last_task : (N, E) uint8
        In and out: the task that counts, which is the last one asked while a hold fades; 0 when it has ended.
    weight : (N, E) float32
        In and out: share of each hold, 0 to 1.
    weight_rate : (N, E) float32
        In and out: its rate of change, 1/s.
    held_rotation : (N, L) float32
        In: the pose that the last solve left. Out: the pose from which the next starts.
    out_target : (N, E, 3) float32
        Written where the share is above 0: target in the root frame, m.
    out_target_rotation : (N, E, 4) float32
        Written in the same places: rotation in the root frame, unit quaternions.
    out_status : (N, E) uint8
        Written: 0, nothing asked, until a solve tells more.
    out_mask : (N,) uint8
        Written: bit e is set where effector e has a share above 0.

    Notes
    -----
    **Source:** none; shares are critically damped springs, in closed form.
    """
    count = active.shape[0]
    for k in prange(CHUNKS):
        chunk = (k * 37) % CHUNKS
        aim_holds_chunk(
            tree,
            rate,
            dt,
            segment_scale,
            pose_rotation,
            pose_pelvis,
            position_world,
            yaw,
            task,
            target_world,
            target_rotation_world,
            point,
            active,
            chunk * count // CHUNKS,
            (chunk + 1) * count // CHUNKS,
            last_task,
            weight,
            weight_rate,
            held_rotation,
            out_target,
            out_target_rotation,
            out_status,
            out_mask,
        )


@parallel_kernel
def apply_holds(tree: TreeArrays, held_rotation: Any, mask: Any, active: Any, out_pose_rotation: Any) -> None:
    """Take the joints that held effectors turn from the solution.

    Parameters
    ----------
    tree : TreeArrays
        E effectors.
    held_rotation : (N, L) float32
        Pose rows that the solve left.
    mask : (N,) uint8
        Bit e is set where effector e is held.
    active : (A,) int32
        Characters to process, each once; 0 to N - 1.
    out_pose_rotation : (N, L) float32
        Written at joints that an effector of the character's mask turns.

    Notes
    -----
    **Source:** none; the bits are copied.
    """
    count = active.shape[0]
    for chunk in prange(CHUNKS):
        for index in range(chunk * count // CHUNKS, (chunk + 1) * count // CHUNKS):
            character = active[index]
            if mask[character] != 0:
                for k in range(tree.joint.shape[0]):
                    if is_moved(tree, int(mask[character]), k):
                        copy_joint(tree, k, held_rotation[character], out_pose_rotation[character])
