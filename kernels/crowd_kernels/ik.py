"""Inverse kinematics of any tree of joints by damped least squares, sixteen characters as lanes.

One iteration turns every joint by a rotation vector of the root frame: its drift towards a reference pose,
and what the missing steps of all effectors ask of it,

    dq = z + W J^T (J W J^T + d I)^-1 (dx - J z).

Joints are balls, so no column of J is ever built: a joint at lever r takes the torque r x force + torque.
Joints that would leave their limits turn just as far as the limit, along the direction in which they would
leave it, and the rest is solved again without that direction.
"""

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from crowd_kernels._jit import kernel, parallel_kernel, prange
from crowd_kernels.ik_rows import (
    ANGLE,
    BLOCK,
    DISTANCE,
    EFFECTOR_ROW,
    FRAME,
    IS_FAR,
    IS_FIXED,
    JOINT_ROW,
    LENGTH,
    PLACE,
    POINT,
    PUSH,
    REFERENCE,
    ROTATION,
    TARGET,
    TARGET_FRAME,
    WANTS_FRAME,
    WANTS_PLACE,
    accumulate_cross_row,
    accumulate_frame_row,
    accumulate_free_cross_row,
    accumulate_free_frame_row,
    accumulate_free_place_row,
    accumulate_place_row,
    add_row,
    add_torque_row,
    begin_fixing_row,
    clear_row,
    commit_row,
    divide_block,
    effector_row,
    factor_block,
    find_limit_row,
    forward_row,
    free_step_row,
    hold_reference_row,
    limit_row,
    lock_axis_row,
    pull_row,
    rest_row,
    root_accumulate_row,
    root_commit_row,
    root_pull_row,
    root_push_row,
    root_subtract_row,
    running_row,
    solve_lower,
    solve_upper,
    start_push_row,
    step_row,
    subtract_block,
    subtract_drift_row,
    subtract_lower,
    subtract_upper,
    sum_row,
)
from crowd_kernels.joint_limit import LimitArrays
from crowd_kernels.lanes import LANES

CHUNKS = 32

POSITION = 1
ROTATION_TOO = 2
"""Tasks of an effector: 1 position, 2 rotation, 3 both; 0 for none."""

NONE = 0
MOVING = 1
REACHED = 2
OUT_OF_REACH = 3
REFUSED = 4

ONE: Any = np.float32(1.0)
ZERO: Any = np.float32(0.0)
FAR: Any = np.float32(1e30)
LEAST_LENGTH = 0.5
CONTROL_ROWS = 11


class TreeArrays(NamedTuple):
    """The joints that a solve reads, K of them, and its E effectors.

    Poses are rows of numbers, one for each character: component c of joint k stands at
    ``c * component_step + joint[k] * joint_step``. Steps (64, 1) fit pose rows, (1, 4) plain quaternions.
    """

    joint: npt.NDArray[np.int32]
    """(K,) Joints, a parent before its children."""
    parent: npt.NDArray[np.int32]
    """(K,) Place of the parent in `joint`, -1 for the root."""
    offset: npt.NDArray[np.float32]
    """(K, 3) Rest offsets in the parent's frame, m."""
    segment: npt.NDArray[np.int32]
    """(K,) Columns of the proportions that stretch the offsets."""
    weight: npt.NDArray[np.float32]
    """(K,) How easily each joint turns, 0 to 1; 0 for joints that keep their rotation."""
    is_limited: npt.NDArray[np.uint8]
    """(K,) 1 where a joint keeps its limits."""
    parent_frame: npt.NDArray[np.float32]
    """(K, 4) This and the next four: limits, see `LimitArrays`."""
    joint_frame: npt.NDArray[np.float32]
    """(K, 4)"""
    inverse_swing: npt.NDArray[np.float32]
    """(K, 2)"""
    twist: npt.NDArray[np.float32]
    """(K, 2)"""
    is_free: npt.NDArray[np.float32]
    """(K, 3)"""
    effector: npt.NDArray[np.int32]
    """(E,) Place in `joint` of the joint that carries each effector."""
    column: npt.NDArray[np.int32]
    """(E,) Column of each effector in the arrays of targets and results, which may hold more effectors."""
    base: npt.NDArray[np.int32]
    """(E,) Place in `joint` of the first joint of each effector's chain that can turn."""
    moves: npt.NDArray[np.uint8]
    """(E, K) 1 where a joint that can turn moves an effector."""
    root_segment: int
    """Column of the proportions that stretches the root's position."""
    root_weight: float
    """How easily the root moves, 0 to 1; 0 for a root that stays."""
    component_step: int
    """Distance of components in a pose row."""
    joint_step: int
    """Distance of joints in a pose row."""


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
    """Largest share of the way to a limit that a joint goes in one iteration."""
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


def plain_tree(
    parent: npt.ArrayLike,
    offset: npt.ArrayLike,
    effector: npt.ArrayLike,
    weight: npt.ArrayLike | None = None,
    limits: LimitArrays | None = None,
    is_limited: npt.ArrayLike | None = None,
) -> TreeArrays:
    """Describe a tree whose poses are plain quaternions, (N, 4 K) with (w, x, y, z) of joint after joint.

    Parameters
    ----------
    parent : (K,) int
        Place of each joint's parent, before its children; -1 for joints at the root.
    offset : (K, 3) float
        Rest offsets in the parent's frame, m.
    effector : (E,) int
        Joints that carry the effectors.
    weight : (K,) float, optional
        How easily each joint turns; 1 when left out.
    limits : LimitArrays, optional
        Limits of all joints; none when left out.
    is_limited : (K,) bool, optional
        Joints whose limits are kept; all when left out.

    Returns
    -------
    TreeArrays
        With one column of proportions, and a root that stays.
    """
    parents = np.asarray(parent, np.int32)
    count = len(parents)
    weights = np.ones(count, np.float32) if weight is None else np.asarray(weight, np.float32)
    kept = np.full(count, limits is not None) if is_limited is None else np.asarray(is_limited)
    carriers = np.asarray(effector, np.int32)
    base, moves = find_chains(parents, weights, carriers)
    return TreeArrays(
        joint=np.arange(count, dtype=np.int32),
        parent=parents,
        offset=np.asarray(offset, np.float32),
        segment=np.zeros(count, np.int32),
        weight=weights,
        is_limited=kept.astype(np.uint8),
        **(limits or no_limits(count))._asdict(),
        effector=carriers,
        column=np.arange(len(carriers), dtype=np.int32),
        base=base,
        moves=moves,
        root_segment=0,
        root_weight=0.0,
        component_step=1,
        joint_step=4,
    )


def find_chains(
    parent: npt.NDArray[np.int32], weight: npt.NDArray[np.float32], effector: npt.NDArray[np.int32]
) -> tuple[npt.NDArray[np.int32], npt.NDArray[np.uint8]]:
    """Follow each effector up to the root: `TreeArrays.base` and `TreeArrays.moves`."""
    base = effector.copy()
    moves = np.zeros((len(effector), len(parent)), np.uint8)
    for e, carrier in enumerate(effector):
        joint = int(carrier)
        while joint >= 0:
            if weight[joint] > 0:
                moves[e, joint] = 1
                base[e] = joint
            joint = int(parent[joint])
    return base, moves


def no_limits(count: int) -> LimitArrays:
    """Make limits that hold nothing, for trees without any."""
    identity = np.tile(np.array([1, 0, 0, 0], np.float32), (count, 1))
    return LimitArrays(
        identity,
        identity.copy(),
        np.zeros((count, 2), np.float32),
        np.tile(np.array([-np.inf, np.inf], np.float32), (count, 1)),
        np.ones((count, 3), np.float32),
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
def block_of(row: int, column: int) -> int:
    """Find a block in the lower triangle of the system."""
    return row * (row + 1) // 2 + column


@kernel
def half_of(row: int, parts: int) -> int:
    """Find the half of an effector's push that belongs to a row of blocks."""
    return row // parts * 2 + row % parts


@kernel
def solve_system(count: int, parts: int, damping: Any, system: Any, out_push: Any) -> None:
    """Solve the system by Cholesky in blocks of 3 rows.

    Parameters
    ----------
    count : int
        Rows of blocks.
    parts : int
        Rows of blocks of an effector: 1 position, 2 position and rotation.
    damping : (32,) float32
        Added to the diagonal, of positions and of rotations.
    system : (count * (count + 1) / 2, 144) float32
        Blocks of the lower triangle, replaced by the factor.
    out_push : (E, PUSH) float32
        In: the right side. Out: the solution.
    """
    halves = out_push.reshape(2 * out_push.shape[0], PUSH // 2)
    for row in range(count):
        for column in range(row):
            for inner in range(column):
                subtract_block(
                    system[block_of(row, inner)],
                    system[block_of(column, inner)],
                    system[block_of(row, column)],
                )
            divide_block(system[block_of(column, column)], system[block_of(row, column)])
        for inner in range(row):
            subtract_block(
                system[block_of(row, inner)], system[block_of(row, inner)], system[block_of(row, row)]
            )
        part = row % parts * LANES
        factor_block(damping[part : part + LANES], system[block_of(row, row)])
    for row in range(count):
        for column in range(row):
            subtract_lower(
                system[block_of(row, column)], halves[half_of(column, parts)], halves[half_of(row, parts)]
            )
        solve_lower(system[block_of(row, row)], halves[half_of(row, parts)])
    for row in range(count - 1, -1, -1):
        for column in range(row + 1, count):
            subtract_upper(
                system[block_of(column, row)], halves[half_of(column, parts)], halves[half_of(row, parts)]
            )
        solve_upper(system[block_of(row, row)], halves[half_of(row, parts)])


@kernel
def place_joints(tree: TreeArrays, scale: Any, joints: Any) -> None:
    """Compute places and frames of all joints of a block.

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
def frame_of(frames: Any, k: int) -> tuple[Any, Any, Any, Any]:
    """Read a frame of a limit."""
    return frames[k, 0], frames[k, 1], frames[k, 2], frames[k, 3]


@kernel
def free_joints(tree: TreeArrays, gain: Any, bound: Any, joints: Any) -> None:
    """Set drift and mobility of all joints of a block for a new iteration.

    Parameters
    ----------
    tree : TreeArrays
    gain : float32
        Share of the way to the reference pose.
    bound : float32
        Largest rotation towards it, rad.
    joints : (K + 1, JOINT_ROW) float32
        The root and all joints.
    """
    for k in range(tree.joint.shape[0]):
        if tree.weight[k] <= ZERO:
            continue
        above = joints[tree.parent[k] + 1]
        pull_row(above, gain, bound, joints[k + 1])
        if tree.is_limited[k]:
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
def add_joint(weight: Any, joint: Any, effectors: Any, a: int, b: int, parts: int, out_system: Any) -> None:
    """Add a joint's share to the blocks of two effectors.

    Parameters
    ----------
    weight : float32
        How easily the joint turns.
    joint : (JOINT_ROW,) float32
    effectors : (E, EFFECTOR_ROW) float32
    a, b : int
        Effectors of the blocks' rows and columns.
    parts : int
        Rows of blocks of an effector: 1 position, 2 position and rotation.
    out_system : (E * parts * (E * parts + 1) / 2, 144) float32
        Blocks of the lower triangle, in and out.
    """
    places = out_system[block_of(a * parts, b * parts)]
    is_free = joint[IS_FIXED] == ZERO
    if is_free:
        accumulate_free_place_row(joint, weight, effectors[a], effectors[b], places)
    else:
        accumulate_place_row(joint, effectors[a], effectors[b], places)
    if parts == 1:
        return
    # The two blocks of a's rotation are neighbours.
    first = block_of(2 * a + 1, 2 * b)
    frames = out_system[first : first + 2].reshape(2 * BLOCK)
    if is_free:
        accumulate_free_frame_row(joint, weight, effectors[a], effectors[b], frames)
    else:
        accumulate_frame_row(joint, effectors[a], effectors[b], frames)
    if a == b:
        return
    cross = out_system[block_of(2 * a, 2 * b + 1)]
    if is_free:
        accumulate_free_cross_row(joint, weight, effectors[a], effectors[b], cross)
    else:
        accumulate_cross_row(joint, effectors[a], effectors[b], cross)


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
    for a in range(tree.effector.shape[0]):
        start_push_row(effectors[a], out_push[a])
        if root_weight > ZERO:
            root_subtract_row(joints[0], effectors[a], out_push[a])
        for k in range(tree.joint.shape[0]):
            if tree.moves[a, k]:
                subtract_drift_row(joints[k + 1], effectors[a], out_push[a])
        for b in range(a + 1):
            if root_weight > ZERO:
                root_accumulate_row(
                    effectors[a],
                    effectors[b],
                    root_weight,
                    out_system[block_of(a * parts, b * parts)],
                )
            for k in range(tree.joint.shape[0]):
                if tree.moves[a, k] and tree.moves[b, k]:
                    add_joint(tree.weight[k], joints[k + 1], effectors, a, b, parts, out_system)


@kernel
def turn_joints(
    tree: TreeArrays,
    approach: Any,
    joints: Any,
    effectors: Any,
    push: Any,
    running: Any,
    out_violations: Any,
) -> None:
    """Find the next rotations of all joints, and fix those that would leave their limits.

    Parameters
    ----------
    tree : TreeArrays
    approach : float32
        See `SolveSettings`.
    joints : (K + 1, JOINT_ROW) float32
        The root and all joints.
    effectors : (E, EFFECTOR_ROW) float32
    push : (E, PUSH) float32
        Solution of the system.
    running : (16,) float32
        0 where the character stays as it is.
    out_violations : (16,) float32
        Number of directions that were fixed.
    """
    clear_row(out_violations)
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
        is_free = tree.is_free[k, 0] * tree.is_free[k, 1] * tree.is_free[k, 2] > ZERO
        is_outside = find_limit_row(
            frame_of(tree.parent_frame, k),
            frame_of(tree.joint_frame, k),
            tree.inverse_swing[k, 0],
            tree.inverse_swing[k, 1],
            approach,
            joints[k + 1],
        )
        if is_outside or not is_free:
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
                joints[k + 1],
                out_violations,
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
        free_joints(tree, pull, np.float32(settings.pull_step), joints)
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
            turn_joints(tree, np.float32(settings.approach), joints, effectors, push, running, error)
            if sum_row(error) == ZERO:
                break
        pull *= np.float32(settings.pull_fade)
        for k in range(tree.joint.shape[0]):
            if tree.weight[k] > ZERO:
                commit_row(joints[k + 1])
        if root_weight > ZERO:
            for e in range(count):
                root_push_row(effectors[e], push[e], root_weight, joints[0])
            root_commit_row(running, joints[0])


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
    root_position: Any,
    active: Any,
    first: int,
    out_scale: Any,
    out_joints: Any,
) -> None:
    """Read proportions, pose and reference of 16 active characters.

    Parameters
    ----------
    first : int
        Place in `active` of the first lane.
    out_scale : (G * 16,) float32
        Written.
    out_joints : (K + 1, JOINT_ROW) float32
        Written.

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
        for k in range(tree.joint.shape[0]):
            begin = tree.joint[k] * tree.joint_step
            for component in range(4):
                index = begin + component * tree.component_step
                out_joints[k + 1, ROTATION + component * LANES + lane] = pose[index]
                out_joints[k + 1, REFERENCE + component * LANES + lane] = reference[index]
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
    push_begin = system_begin + effector_count * (2 * effector_count + 1) * BLOCK
    scale_begin = push_begin + effector_count * 6 * LANES
    control_begin = scale_begin + segment_scale.shape[1] * LANES
    joints = scratch[:effector_begin].reshape(joint_count + 1, JOINT_ROW)
    effectors = scratch[effector_begin:system_begin].reshape(effector_count, EFFECTOR_ROW)
    system = scratch[system_begin:push_begin].reshape(effector_count * (2 * effector_count + 1), BLOCK)
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
            root_position,
            active,
            first,
            scale,
            joints,
        )
        parts = gather_effectors(
            tree,
            segment_scale,
            task,
            point,
            target_position,
            target_rotation,
            active,
            first,
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
    balls that are fixed along one direction at a time where they leave their limits, and they have weights.
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
            active,
            chunk * block_count // CHUNKS,
            (chunk + 1) * block_count // CHUNKS,
            scratch[chunk],
            pose_rotation,
            root_position,
            out_status,
            out_distance,
            out_angle,
            out_iterations,
        )
