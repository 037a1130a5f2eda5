"""Inverse kinematics of any tree of joints by damped least squares, sixteen characters as lanes.

One iteration turns every joint by a rotation vector of the root frame: its drift towards a reference pose,
and what the missing steps of all effectors ask of it,

    dq = z + W J^T (J W J^T + d I)^-1 (dx - J z).

Joints are balls, so no column of J is ever built: a joint at lever r takes the torque r x force + torque.
Joints that would leave their limits turn just as far as the limit, along the direction in which they would
leave it, and the rest is solved again without that direction.

Trees come from `ik_tree.plain_tree`; `ik_layout` describes the rows on which the leaves of `ik_joint`,
`ik_limit`, `ik_effector`, `ik_system` and `ik_root` work.
"""

from typing import Any, NamedTuple

import numpy as np

from crowd_kernels._jit import IS_THREADED, kernel, parallel_kernel, prange
from crowd_kernels.ik_effector import effector_row
from crowd_kernels.ik_gather import FAR, gather_effectors, gather_joints
from crowd_kernels.ik_lanes import add_row, running_row, sum_row
from crowd_kernels.ik_layout import (
    ANGLE,
    BLOCK,
    DISTANCE,
    EFFECTOR_ROW,
    IS_FAR,
    JOINT_ROW,
    ONE,
    PLACE,
    PUSH,
    ROTATION,
    WANTS_FRAME,
    WANTS_PLACE,
    ZERO,
)
from crowd_kernels.ik_root import root_commit_row, root_pull_row, root_push_row
from crowd_kernels.ik_step import build_system, free_joints, place_joints, turn_joints
from crowd_kernels.ik_system import solve_system
from crowd_kernels.ik_tree import TreeArrays
from crowd_kernels.lanes import LANES

CHUNKS = 32
NONE = 0
MOVING = 1
REACHED = 2
OUT_OF_REACH = 3
REFUSED = 4
CONTROL_ROWS = 11


class SolveSettings(NamedTuple):
    """How a solve steps and when it ends."""

    damping: float
    """Least damping, m."""
    error_damping: float
    """Its product with the position step is added to the square of the damping, m. An arm that is stretched
    towards a target beyond it swings to and fro where this is smaller than its forearm."""
    turn_error_damping: float
    """Its product with the turn is added to the damping of rotations, 1/rad. Joints at their limits swing to
    and fro below a rotation that they cannot have where this is small."""
    pull: float
    """Share of the way to the reference pose that the first iteration takes."""
    pull_fade: float
    """Factor of `pull` from one iteration to the next. A pull that stays moves effectors off their targets
    again to second order, and long solves do not end."""
    pull_step: float
    """Largest rotation towards the reference pose in one iteration, rad."""
    place_step: float
    """Largest step of an effector in one iteration, m."""
    turn_step: float
    """Largest turn of an effector in one iteration, rad."""
    reach: float
    """Share of a chain's length within which targets are sought."""
    place_first: int
    """Iterations in which rotations wait for effectors that are farther than `waiting_distance`."""
    waiting_distance: float
    """See `place_first`, m."""
    distance_tolerance: float
    """Distance at which a target is reached, m."""
    angle_tolerance: float
    """Angle at which a target is reached, rad."""
    least_iterations: int
    """Iterations that are always made, so that the pose follows its reference."""
    most_iterations: int
    """Iterations after which a solve ends."""
    passes: int
    """Solves of one iteration in which joints at their limits are fixed, 1 and more."""
    approach: float
    """Largest share of what is left of the way from the last pose to a limit that a joint goes in one
    iteration."""
    patience: float
    """Iterations with less than 1 % of progress after which a solve ends."""


SETTINGS = SolveSettings(
    damping=0.02,
    error_damping=0.2,
    turn_error_damping=0.0,
    pull=0.1,
    pull_fade=0.8,
    pull_step=0.087,
    place_step=0.2,
    turn_step=0.5,
    reach=0.995,
    place_first=6,
    waiting_distance=0.03,
    distance_tolerance=1e-3,
    angle_tolerance=0.0174533,
    least_iterations=0,
    most_iterations=100,
    passes=4,
    approach=1.0,
    patience=12.0,
)


def scratch_length(joint_count: int, effector_count: int, segment_count: int) -> int:
    """Length of one chunk's scratch row for `solve_crowd`.

    Parameters
    ----------
    joint_count, effector_count : int
        Joints and effectors of the tree.
    segment_count : int
        Columns of the proportions.

    Returns
    -------
    int
        Number of float32.
    """
    blocks = effector_count * (2 * effector_count + 1)
    return (
        (joint_count + 1) * JOINT_ROW
        + effector_count * EFFECTOR_ROW
        + blocks * BLOCK
        + (6 * effector_count + segment_count + CONTROL_ROWS) * LANES
    )


@kernel
def solve_block(
    tree: TreeArrays,
    settings: SolveSettings,
    parts: int,
    scale: Any,
    root_reference: Any,
    joints: Any,
    effectors: Any,
    system: Any,
    push: Any,
    control: Any,
    out_iterations: Any,
) -> None:
    """Iterate on 16 characters until all have ended.

    Parameters
    ----------
    tree : TreeArrays
    settings : SolveSettings
    parts : int
        Rows of blocks of an effector: 1 position, 2 position and rotation.
    scale : (G * 16,) float32
        Proportions.
    root_reference : (48,) float32
        Where the root is drawn to, m.
    joints : (K + 1, JOINT_ROW) float32
        The root and all joints.
    effectors : (E, EFFECTOR_ROW) float32
    system : (E * (2 * E + 1), 144) float32
        Scratch.
    push : (E, PUSH) float32
        Scratch.
    control : (6 * 16,) float32
        Scratch.
    out_iterations : (32,) float32
        Iterations made, and iterations without progress.
    """
    count = tree.effector.shape[0]
    totals = control[: 4 * LANES]
    error = control[:LANES]
    missing = control[LANES : 2 * LANES]
    damping = control[2 * LANES : 4 * LANES]
    best = control[4 * LANES : 5 * LANES]
    running = control[5 * LANES : 6 * LANES]
    iterations = out_iterations[:LANES]
    stalled = out_iterations[LANES : 2 * LANES]
    root_weight = np.float32(tree.root_weight)
    used = parts * count * (parts * count + 1) // 2
    for lane in range(LANES):
        best[lane] = FAR
        running[lane] = ONE
        iterations[lane] = ZERO
        stalled[lane] = ZERO
    pull = np.float32(settings.pull)
    approached = ONE
    for iteration in range(settings.most_iterations + 1):
        place_joints(tree, scale, joints)
        for lane in range(LANES):
            error[lane] = ZERO
            missing[lane] = ZERO
            damping[lane] = np.float32(settings.damping * settings.damping)
            damping[LANES + lane] = damping[lane]
        waiting = np.float32(settings.waiting_distance) if iteration < settings.place_first else FAR
        for e in range(count):
            effector_row(
                joints[tree.effector[e] + 1],
                joints[tree.base[e] + 1],
                np.float32(settings.reach),
                (np.float32(settings.place_step), np.float32(settings.turn_step)),
                waiting,
                (np.float32(settings.distance_tolerance), np.float32(settings.angle_tolerance)),
                (np.float32(settings.error_damping), np.float32(settings.turn_error_damping)),
                effectors[e],
                totals,
            )
        is_early = ONE if iteration < settings.least_iterations else ZERO
        running_row(error, missing, is_early, np.float32(settings.patience), best, stalled, running)
        if sum_row(running) == ZERO or iteration == settings.most_iterations:
            break
        add_row(running, iterations)
        approached *= ONE - np.float32(settings.approach)
        free_joints(tree, pull, np.float32(settings.pull_step), ONE - approached, joints)
        for _ in range(settings.passes):
            if root_weight > ZERO:
                root_pull_row(
                    root_reference,
                    pull,
                    np.float32(settings.place_step),
                    joints[0],
                )
            build_system(tree, parts, joints, effectors, system[:used], push)
            solve_system(parts * count, parts, damping, system, push)
            turn_joints(tree, ONE - approached, joints, effectors, push, running, missing, error)
            if sum_row(error) == ZERO:
                break
        pull *= np.float32(settings.pull_fade)
        if root_weight > ZERO:
            for e in range(count):
                root_push_row(effectors[e], push[e], root_weight, joints[0])
            root_commit_row(running, joints[0])


@kernel
def status_of(task: int, effector: Any, lane: int, stalled: Any, settings: SolveSettings) -> int:
    """Tell how a solve ended for one effector of one character."""
    if task == 0:
        return NONE
    if effector[WANTS_PLACE + lane] == ZERO and effector[WANTS_FRAME + lane] == ZERO:
        return REFUSED
    if effector[IS_FAR + lane] != ZERO and effector[WANTS_PLACE + lane] != ZERO:
        return OUT_OF_REACH
    if (
        effector[DISTANCE + lane] < settings.distance_tolerance
        and effector[ANGLE + lane] < settings.angle_tolerance
    ):
        return REACHED
    return OUT_OF_REACH if stalled > settings.patience else MOVING


@kernel
def solve_chunk(
    tree: TreeArrays,
    settings: SolveSettings,
    segment_scale: Any,
    task: Any,
    point: Any,
    target_position: Any,
    target_rotation: Any,
    reference_rotation: Any,
    reference_root: Any,
    last_rotation: Any,
    active: Any,
    begin: int,
    end: int,
    scratch: Any,
    pose_rotation: Any,
    root_position: Any,
    out_status: Any,
    out_distance: Any,
    out_angle: Any,
    out_iterations: Any,
) -> None:
    """Solve one run of blocks of 16 active characters.

    Parameters
    ----------
    begin, end : int
        Range of blocks.
    scratch : (scratch_length(K, E, G),) float32
        Row of this chunk.

    Notes
    -----
    All other arguments are those of `solve_crowd`.
    """
    count = active.shape[0]
    joint_count = tree.joint.shape[0]
    effector_count = tree.effector.shape[0]
    effector_begin = (joint_count + 1) * JOINT_ROW
    system_begin = effector_begin + effector_count * EFFECTOR_ROW
    blocks = effector_count * (2 * effector_count + 1)
    push_begin = system_begin + blocks * BLOCK
    scale_begin = push_begin + effector_count * 6 * LANES
    control_begin = scale_begin + segment_scale.shape[1] * LANES
    joints = scratch[:effector_begin].reshape(joint_count + 1, JOINT_ROW)
    effectors = scratch[effector_begin:system_begin].reshape(effector_count, EFFECTOR_ROW)
    system = scratch[system_begin:push_begin].reshape(blocks, BLOCK)
    push = scratch[push_begin:scale_begin].reshape(effector_count, PUSH)
    scale = scratch[scale_begin:control_begin]
    control = scratch[control_begin : control_begin + 6 * LANES]
    root_reference = scratch[control_begin + 6 * LANES : control_begin + 9 * LANES]
    iterations = scratch[control_begin + 9 * LANES : control_begin + 11 * LANES]
    for block in range(begin, end):
        first = block * LANES
        gather_joints(
            tree,
            segment_scale,
            pose_rotation,
            reference_rotation,
            last_rotation,
            root_position,
            active,
            first,
            scale,
            joints,
        )
        parts = gather_effectors(
            tree,
            task,
            point,
            target_position,
            target_rotation,
            active,
            first,
            scale,
            effectors,
        )
        for lane in range(LANES):
            character = active[min(first + lane, count - 1)]
            for axis in range(3):
                root_reference[axis * LANES + lane] = (
                    reference_root[character, axis] * segment_scale[character, tree.root_segment]
                )
        solve_block(
            tree, settings, parts, scale, root_reference, joints, effectors, system, push, control, iterations
        )
        for lane in range(min(LANES, count - first)):
            character = active[first + lane]
            out_iterations[character] = int(iterations[lane])
            for e in range(effector_count):
                column = tree.column[e]
                effector = effectors[e]
                out_status[character, column] = status_of(
                    int(task[character, column]), effector, lane, iterations[LANES + lane], settings
                )
                out_distance[character, column] = effector[DISTANCE + lane]
                out_angle[character, column] = effector[ANGLE + lane]
            pose = pose_rotation[character]
            for k in range(joint_count):
                if tree.weight[k] > ZERO:
                    row = ROTATION + lane
                    for component in range(4):
                        index = component * tree.component_step + tree.joint[k] * tree.joint_step
                        pose[index] = joints[k + 1, row + component * LANES]
            if tree.root_weight > 0.0:
                for axis in range(3):
                    root_position[character, axis] = (
                        joints[0, PLACE + axis * LANES + lane] / segment_scale[character, tree.root_segment]
                    )


@parallel_kernel
def solve_crowd(
    tree: TreeArrays,
    settings: SolveSettings,
    segment_scale: Any,
    task: Any,
    point: Any,
    target_position: Any,
    target_rotation: Any,
    reference_rotation: Any,
    reference_root: Any,
    last_rotation: Any,
    active: Any,
    scratch: Any,
    pose_rotation: Any,
    root_position: Any,
    out_status: Any,
    out_distance: Any,
    out_angle: Any,
    out_iterations: Any,
) -> None:
    """Bring effectors of many characters to their targets, near to a reference pose and within joint limits.

    Parameters
    ----------
    tree : TreeArrays
    settings : SolveSettings
    segment_scale : (N, G) float32
        Proportions, about 1.
    task : (N, >= E) uint8
        What is asked of each effector, in its `tree.column`: 0 nothing, 1 position, 2 rotation, 3 both.
    point : (N, >= E, 3) float32
        The effector in the frame of its joint, in the character's own size, m.
    target_position : (N, >= E, 3) float32
        Root frame, m.
    target_rotation : (N, >= E, 4) float32
        Rotation of the effector's joint in the root frame; nearly unit quaternions.
    reference_rotation : (N, L) float32
        Pose that is followed as far as the targets allow. May be `pose_rotation`.
    reference_root : (N, 3) float32
        Position that the root is drawn to where it may move, at scale 1, m. May be `root_position`.
    last_rotation : (N, L) float32
        Pose from which joints approach their limits: that of the step before, or again `pose_rotation`.
    active : (A,) int32
        Characters to process, each once; 0 to N - 1.
    scratch : (32, scratch_length(K, E, G)) float32
        One row for each chunk.
    pose_rotation : (N, L) float32
        In and out: the pose from which the solve starts, and the solution.
    root_position : (N, 3) float32
        In and out: the root at scale 1, m; changes only where `tree.root_weight` is above 0.
    out_status : (N, >= E) uint8
        0 nothing asked, 1 moving (iterations ended too early), 2 reached, 3 out of reach (the nearest point
        found), 4 refused (a target is not finite or no rotation).
    out_distance : (N, >= E) float32
        Distance to the target, or to the point of the chain's sphere nearest to it, m.
    out_angle : (N, >= E) float32
        Angle to the target's rotation, rad.
    out_iterations : (N,) int32
        Iterations made.

    Notes
    -----
    Rows of inactive characters stay as they are.

    **Source:** Feng, Xu, Shapiro, "An example-based motion synthesis technique for locomotion and object
    manipulation", 2012, section 5.2; clamping of joints: Baerlocher, Boulic, "An inverse kinematics
    architecture enforcing an arbitrary number of strict priority levels", 2004; approach to limits: Faverjon,
    Tournassoud, "A local based approach for path planning of manipulators with a high number of degrees of
    freedom", 1987.
    **Differs from the source:** the pseudo-inverse is damped, and more so far from the target; joints are
    balls that are fixed along one direction at a time where they leave their limits, the gravest first, and
    they have weights; limits are approached softly from the pose of the step before, as they lie nearest and
    as they lie ahead.
    """
    block_count = (active.shape[0] + LANES - 1) // LANES
    for k in prange(CHUNKS):
        chunk = (k * 37) % CHUNKS
        solve_chunk(
            tree,
            settings,
            segment_scale,
            task,
            point,
            target_position,
            target_rotation,
            reference_rotation,
            reference_root,
            last_rotation,
            active,
            chunk * block_count // CHUNKS,
            (chunk + 1) * block_count // CHUNKS,
            scratch[chunk if IS_THREADED else 0],
            pose_rotation,
            root_position,
            out_status,
            out_distance,
            out_angle,
            out_iterations,
        )
