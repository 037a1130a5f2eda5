"""The pose of reaching people: examples of both hands, blended over the pose below.

Both sections of all examples are stretched to the course of the reach, so that apexes coincide. Pose rows are
compact here: the 24 joints of pelvis, legs, trunk, head and arms; fingers are left to grasping.
"""

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from crowd_kernels._jit import inlined_kernel
from crowd_kernels.clip import PADDED_JOINTS
from crowd_kernels.locomotion import ease
from crowd_kernels.quaternion import Quaternion, multiply, normalized, rotate
from crowd_kernels.reach_goal import (
    APEX,
    ReachLimits,
    ReachState,
    advance_course,
    goal_of,
    quaternion_of,
    set_vector,
    vector_of,
)
from crowd_kernels.reach_space import NEAREST, SCRATCH, ReachArrays, weigh_examples
from crowd_kernels.vector import Vector, add, norm, scaled, subtract

JOINTS = 24
ROW = 4 * JOINTS
"""Length of a compact pose row: components outermost, 24 joints each."""
SCRATCH_ROW = 3 * ROW + JOINTS
"""Length of a chunk's scratch row for `reach_crowd`."""
SLOTS = 24
"""Most examples that are blended for one hand."""
LEAST_WEIGHT = 1e-4
"""Weights that fade end here."""
SAME_PLACE = 0.004
"""A look-up serves places this close to its own, m; a tenth of the spacing of pseudo-examples."""
SAME_SHARE = 0.01
"""Likewise for the share of the upper body's examples."""
CHAIN = 9
"""Joints from pelvis to hand."""
LOWER, UPPER, RIGHT_ARM, LEFT_ARM = 0, 1, 2, 3
"""Groups of joints: pelvis and legs; spine, neck and head; arms."""
ZERO = np.float32(0.0)
ONE = np.float32(1.0)
TINY = np.float32(1e-12)


class ReachKeys(NamedTuple):
    """Key frames of all examples and the joints that they hold."""

    rotation: npt.NDArray[np.float32]
    """(K, 96) Compact pose rows, signs aligned over all keys."""
    pelvis: npt.NDArray[np.float32]
    """(K, 3) Pelvis in the root frame, m."""
    first_key: npt.NDArray[np.int32]
    """(E,) First key of each example."""
    key_count: npt.NDArray[np.int32]
    """(E,) Keys of each example."""
    apex: npt.NDArray[np.float64]
    """(E,) Place of the apex among an example's keys."""
    apex_time: npt.NDArray[np.float64]
    """(E,) s."""
    end_time: npt.NDArray[np.float64]
    """(E,) s."""
    pelvis_rest: npt.NDArray[np.float64]
    """(S, 3) Pelvis of each set at rest, m. Sets: standing right and left, seated right and left."""
    first_seated: int
    """First example of the seated sets."""
    joint: npt.NDArray[np.int32]
    """(J,) Skeleton joint of each compact joint."""
    group: npt.NDArray[np.float32]
    """(96,) 1 where a compact joint belongs to a group, else 0; in the order of the groups."""
    chain: npt.NDArray[np.int32]
    """(2, 9) Compact joints from pelvis to right and left hand."""
    chain_place: npt.NDArray[np.int32]
    """(2, 9) Their places in the tree of inverse kinematics."""
    chain_offset: npt.NDArray[np.float64]
    """(2, 9, 3) Their rest offsets in the parent's frame, m."""
    chain_segment: npt.NDArray[np.int32]
    """(2, 9) Columns of the proportions that stretch the offsets."""
    leg_segment: int
    """Column that stretches the pelvis position."""
    shoulder: npt.NDArray[np.float64]
    """(2, 3) Shoulders in the rest pose, m."""


@inlined_kernel
def wrist_of_goal(
    keys: ReachKeys,
    arm: int,
    goal: Vector,
    rotation: Quaternion,
    has_rotation: bool,
    point: Vector,
    size: float,
) -> Vector:
    """Estimate where the wrist is when a point of the hand is at its goal, root frame, m."""
    length = norm(point)
    if length == 0.0:
        return goal
    if has_rotation:
        return subtract(goal, rotate(rotation, point))
    shoulder = (size * keys.shoulder[arm, 0], size * keys.shoulder[arm, 1], size * keys.shoulder[arm, 2])
    way = subtract(goal, shoulder)
    distance = max(norm(way), 1e-6)
    return subtract(goal, scaled(way, min(length / distance, 0.5)))


@inlined_kernel
def look_up(
    part: int,
    arm: int,
    wrist: Vector,
    pelvis: Vector,
    size: float,
    space: ReachArrays,
    keys: ReachKeys,
    number: Any,
    real: Any,
) -> int:
    """Find the examples of a set for a wrist; those of seated people relative to the pelvis as it is.

    Parameters
    ----------
    part : int
        0 the whole body, 1 the upper body.
    arm : int
    wrist, pelvis : tuple of float
        Root frame, m.
    size : float
        Stature over the library's.
    space : ReachArrays
    keys : ReachKeys
    number : (20,) int32
        Scratch; the examples are written from `NEAREST` on, some of them more than once.
    real : (100 + E,) float64
        Scratch; the weights of the examples are added from `SCRATCH` on.

    Returns
    -------
    int
        How many examples are written.
    """
    place = scaled(wrist, 1.0 / size)
    if part == 1:
        rest = (keys.pelvis_rest[2 + arm, 0], keys.pelvis_rest[2 + arm, 1], keys.pelvis_rest[2 + arm, 2])
        place = add(scaled(subtract(wrist, pelvis), 1.0 / size), rest)
    return weigh_examples(space, 2 * part + arm, place[0], place[1], place[2], number, real, real[SCRATCH:])


@inlined_kernel
def is_looked_up(
    character: int, arm: int, wrist: Vector, pelvis: Vector, upper_share: float, state: ReachState
) -> bool:
    """Tell whether the last look-up serves, as nothing that it depends on has moved away from it.

    Parameters
    ----------
    character, arm : int
    wrist, pelvis : tuple of float
        Root frame, m.
    upper_share : float
        0: the whole body reaches; 1: only the upper body.
    state : ReachState
    """
    share = state.looked_up_share[character, arm]
    if (upper_share <= 0.0) != (share <= 0.0) or (upper_share >= 1.0) != (share >= 1.0):
        return False
    if abs(upper_share - share) > SAME_SHARE:
        return False
    moved = subtract(wrist, vector_of(state.looked_up, character, arm))
    if norm(moved) > SAME_PLACE:
        return False
    if upper_share <= 0.0:
        return True
    return (
        norm(subtract(moved, subtract(pelvis, vector_of(state.looked_up_pelvis, character, arm))))
        <= SAME_PLACE
    )


@inlined_kernel
def add_wanted(share: float, example: Any, weight: Any, character: int, arm: int, state: ReachState) -> None:
    """Add the weights that examples shall have to their slots, or to free ones; where none is, they are lost.

    Parameters
    ----------
    share : float
        Factor of the weights.
    example : (S,) int32
        Examples, some of them more than once.
    weight : (E,) float64
        In and out: weights of all examples; then 0 for these.
    character, arm : int
    state : ReachState
        In and out: `example`, `example_wanted`, `example_count`.
    """
    count = state.example_count[character, arm]
    for slot in range(count):
        clip = state.example[character, arm, slot]
        if is_slot_used(character, arm, slot, state):
            state.example_wanted[character, arm, slot] += share * weight[clip]
            weight[clip] = 0.0
    free = 0
    for sample in range(example.shape[0]):
        clip = example[sample]
        wanted = share * weight[clip]
        weight[clip] = 0.0
        if not wanted > 0.0:
            continue
        while free < count and is_slot_used(character, arm, free, state):
            free += 1
        if free == SLOTS:
            continue
        state.example[character, arm, free] = clip
        state.example_weight[character, arm, free] = 0.0
        state.example_weight_rate[character, arm, free] = 0.0
        state.example_wanted[character, arm, free] = wanted
        count = max(count, free + 1)
    state.example_count[character, arm] = count


@inlined_kernel
def is_slot_used(character: int, arm: int, slot: int, state: ReachState) -> bool:
    """Tell whether a slot holds an example: one that has a weight or shall have one."""
    has_weight = state.example_weight[character, arm, slot] != 0.0
    return bool(has_weight or state.example_wanted[character, arm, slot] != 0.0)


@inlined_kernel
def look_up_examples(
    character: int,
    arm: int,
    wrist: Vector,
    pelvis: Vector,
    size: float,
    upper_share: float,
    space: ReachArrays,
    keys: ReachKeys,
    state: ReachState,
    number: Any,
    real: Any,
) -> None:
    """Set the weights that one hand's examples come to, of both sets that are needed.

    Parameters
    ----------
    character, arm : int
    upper_share : float
        0: the whole body reaches; 1: only the upper body.
    state : ReachState
        In and out: `example` and what belongs to it, `looked_up` likewise.

    Notes
    -----
    All other arguments are those of `look_up`.
    """
    for slot in range(state.example_count[character, arm]):
        state.example_wanted[character, arm, slot] = 0.0
    for part in range(2):
        share = upper_share if part == 1 else 1.0 - upper_share
        if share <= 0.0:
            continue
        found = look_up(part, arm, wrist, pelvis, size, space, keys, number, real)
        add_wanted(share, number[NEAREST : NEAREST + found], real[SCRATCH:], character, arm, state)
    set_vector(state.looked_up, character, arm, wrist)
    set_vector(state.looked_up_pelvis, character, arm, pelvis)
    state.looked_up_share[character, arm] = upper_share


@inlined_kernel
def choose_examples(
    character: int,
    arm: int,
    pelvis: Vector,
    size: float,
    upper_share: float,
    limits: ReachLimits,
    space: ReachArrays,
    keys: ReachKeys,
    dt: float,
    state: ReachState,
    number: Any,
    real: Any,
) -> None:
    """Let the weights of one hand's examples follow its goal, and advance its course at their pace.

    The weights of a look-up have kinks as the goal moves; those of the blend follow them smoothly. At the
    start of a reach they are taken over at once.

    Parameters
    ----------
    upper_share : float
        0: the whole body reaches; 1: only the upper body.

    Notes
    -----
    All other arguments are those of `look_up` and `reach_character`.
    """
    goal = goal_of(state, character, arm)
    wrist = wrist_of_goal(
        keys,
        arm,
        goal,
        quaternion_of(state.rotation, character, arm),
        state.rotation_share[character, arm] > 0.0,
        vector_of(state.point_hand, character, arm),
        size,
    )
    is_first = state.course[character, arm] <= 0.0
    if is_first:
        state.example_count[character, arm] = 0
    if is_first or not is_looked_up(character, arm, wrist, pelvis, upper_share, state):
        look_up_examples(character, arm, wrist, pelvis, size, upper_share, space, keys, state, number, real)
    total = 0.0
    there = 0.0
    back = 0.0
    count = 0
    for slot in range(state.example_count[character, arm]):
        wanted = state.example_wanted[character, arm, slot]
        weight = wanted
        if weight == 0.0 and state.example_weight[character, arm, slot] == 0.0:
            continue
        if not is_first:
            weight, rate = ease(
                state.example_weight[character, arm, slot],
                state.example_weight_rate[character, arm, slot],
                wanted,
                limits.example_rate,
                dt,
            )
            state.example_weight_rate[character, arm, slot] = rate
            if wanted == 0.0 and weight < LEAST_WEIGHT:
                weight = 0.0
        weight = max(weight, 0.0)
        state.example_weight[character, arm, slot] = weight
        if weight > 0.0 or wanted > 0.0:
            count = slot + 1
        if weight > 0.0:
            clip = state.example[character, arm, slot]
            total += weight
            there += weight * keys.apex_time[clip]
            back += weight * (keys.end_time[clip] - keys.apex_time[clip])
    state.example_count[character, arm] = count
    # Long limbs move more slowly (dynamic similarity).
    slowness = math.sqrt(size) / total
    time = state.seconds[character, arm]
    if time <= 0.0:
        time = max(there * slowness, limits.time_per_radian * state.turn[character, arm])
    rate = 1.0 / time
    advance_course(character, arm, rate, rate * there / back, limits, dt, state)


@inlined_kernel
def blend_row(key: Any, next_key: Any, weight: Any, next_weight: Any, out_sum: Any) -> None:
    """Add the weighted sum of two compact rows to a row.

    Parameters
    ----------
    key, next_key : (96,) float32
    weight, next_weight : float32
    out_sum : (96,) float32
        In and out.
    """
    for lane in range(ROW):
        out_sum[lane] += weight * key[lane] + next_weight * next_key[lane]


@inlined_kernel
def unit_row(row: Any) -> None:
    """Scale the quaternions of a compact row to unit length, in place.

    Parameters
    ----------
    row : (96,) float32
        In and out; quaternions without length become the identity.
    """
    for lane in range(JOINTS):
        w = row[lane]
        x = row[JOINTS + lane]
        y = row[2 * JOINTS + lane]
        z = row[3 * JOINTS + lane]
        square = w * w + x * x + y * y + z * z
        scale = ONE / np.sqrt(square)
        is_lost = square < TINY
        row[lane] = ONE if is_lost else w * scale
        row[JOINTS + lane] = ZERO if is_lost else x * scale
        row[2 * JOINTS + lane] = ZERO if is_lost else y * scale
        row[3 * JOINTS + lane] = ZERO if is_lost else z * scale


@inlined_kernel
def sum_examples(
    character: int, arm: int, part: int, course: float, keys: ReachKeys, state: ReachState, row: Any
) -> tuple[Vector, float]:
    """Add the weighted examples of one hand at a course to a compact row.

    Parameters
    ----------
    character, arm : int
    part : int
        0 those of the whole body, 1 those of the upper body.
    course : float
    keys : ReachKeys
    state : ReachState
    row : (96,) float32
        In and out.

    Returns
    -------
    tuple of float, float
        Weighted sum of the pelvis, m, and sum of the weights.
    """
    x = 0.0
    y = 0.0
    z = 0.0
    total = 0.0
    for slot in range(state.example_count[character, arm]):
        own = state.example_weight[character, arm, slot]
        clip = state.example[character, arm, slot]
        if own <= 0.0 or (clip >= keys.first_seated) != (part == 1):
            continue
        apex = keys.apex[clip]
        place = course * apex
        if course > APEX:
            place = apex + (course - APEX) * (keys.key_count[clip] - 1 - apex)
        index = min(int(place), keys.key_count[clip] - 2)
        before = keys.first_key[clip] + index
        after_share = own * (place - index)
        before_share = own - after_share
        blend_row(
            keys.rotation[before],
            keys.rotation[before + 1],
            np.float32(before_share),
            np.float32(after_share),
            row,
        )
        x += before_share * keys.pelvis[before, 0] + after_share * keys.pelvis[before + 1, 0]
        y += before_share * keys.pelvis[before, 1] + after_share * keys.pelvis[before + 1, 1]
        z += before_share * keys.pelvis[before, 2] + after_share * keys.pelvis[before + 1, 2]
        total += own
    return (x, y, z), total


@inlined_kernel
def weight_of_part(
    character: int, arm: int, part: int, keys: ReachKeys, state: ReachState
) -> tuple[float, float]:
    """Find the summed weights of one hand's examples: those of a part, and all."""
    own = 0.0
    total = 0.0
    for slot in range(state.example_count[character, arm]):
        weight = state.example_weight[character, arm, slot]
        total += weight
        if (state.example[character, arm, slot] >= keys.first_seated) == (part == 1):
            own += weight
    return own, total


@inlined_kernel
def read_joints(keys: ReachKeys, pose: Any, out_row: Any) -> None:
    """Read the joints of a compact row from a pose row."""
    for k in range(keys.joint.shape[0]):
        joint = keys.joint[k]
        out_row[k] = pose[joint]
        out_row[JOINTS + k] = pose[PADDED_JOINTS + joint]
        out_row[2 * JOINTS + k] = pose[2 * PADDED_JOINTS + joint]
        out_row[3 * JOINTS + k] = pose[3 * PADDED_JOINTS + joint]


@inlined_kernel
def write_joints(keys: ReachKeys, row: Any, rest: Any, pose: Any) -> None:
    """Write the joints of a compact row into a pose row; those whose rest (24,) is 1 keep their bits."""
    for k in range(keys.joint.shape[0]):
        if rest[k] >= ONE:
            continue
        joint = keys.joint[k]
        pose[joint] = row[k]
        pose[PADDED_JOINTS + joint] = row[JOINTS + k]
        pose[2 * PADDED_JOINTS + joint] = row[2 * JOINTS + k]
        pose[3 * PADDED_JOINTS + joint] = row[3 * JOINTS + k]


@inlined_kernel
def share_row(group: Any, lower: Any, upper: Any, right: Any, left: Any, out_share: Any) -> None:
    """Give each joint the share of its group.

    Parameters
    ----------
    group : (96,) float32
        See `ReachKeys.group`.
    lower, upper, right, left : float32
        Shares of the groups.
    out_share : (24,) float32
        Written.
    """
    for lane in range(JOINTS):
        out_share[lane] = (
            lower * group[LOWER * JOINTS + lane]
            + upper * group[UPPER * JOINTS + lane]
            + right * group[RIGHT_ARM * JOINTS + lane]
            + left * group[LEFT_ARM * JOINTS + lane]
        )


@inlined_kernel
def add_group_row(row: Any, live: Any, share: Any, out_sum: Any) -> None:
    """Add a compact row to a sum, signs as in another, with a share for each joint.

    Parameters
    ----------
    row, live : (96,) float32
        Unit quaternions: what is added, and those that tell the signs.
    share : (24,) float32
    out_sum : (96,) float32
        In and out.
    """
    for lane in range(JOINTS):
        w, x = row[lane], row[JOINTS + lane]
        y, z = row[2 * JOINTS + lane], row[3 * JOINTS + lane]
        cosine = (
            w * live[lane]
            + x * live[JOINTS + lane]
            + y * live[2 * JOINTS + lane]
            + z * live[3 * JOINTS + lane]
        )
        own = -share[lane] if cosine < ZERO else share[lane]
        out_sum[lane] += own * w
        out_sum[JOINTS + lane] += own * x
        out_sum[2 * JOINTS + lane] += own * y
        out_sum[3 * JOINTS + lane] += own * z


@inlined_kernel
def complete_row(live: Any, rest: Any, row: Any) -> None:
    """Complete a sum of rows times their shares by what the pose was, to unit length.

    Parameters
    ----------
    live : (96,) float32
        The pose as it was.
    rest : (24,) float32
        Its shares.
    row : (96,) float32
        In and out.
    """
    for lane in range(JOINTS):
        w = row[lane] + rest[lane] * live[lane]
        x = row[JOINTS + lane] + rest[lane] * live[JOINTS + lane]
        y = row[2 * JOINTS + lane] + rest[lane] * live[2 * JOINTS + lane]
        z = row[3 * JOINTS + lane] + rest[lane] * live[3 * JOINTS + lane]
        scale = ONE / np.sqrt(max(w * w + x * x + y * y + z * z, TINY))
        row[lane] = w * scale
        row[JOINTS + lane] = x * scale
        row[2 * JOINTS + lane] = y * scale
        row[3 * JOINTS + lane] = z * scale


@inlined_kernel
def blend_body(
    character: int,
    walking_share: float,
    keys: ReachKeys,
    own: tuple[float, float],
    state: ReachState,
    rows: Any,
    pose: Any,
    pelvis: Any,
) -> None:
    """Blend the examples of both hands over the pose of one character.

    Where both hands reach, trunk and legs are shared by their weights; each arm belongs to its own reach and
    balances the other one's as far as it is free.

    Parameters
    ----------
    own : tuple of float
        Shares of the right and left hand's examples.
    rows : (SCRATCH_ROW,) float32
        Scratch.
    pose : (256,) float32
        In and out: pose row.
    pelvis : (3,) float32
        In and out: pelvis at leg scale 1, m.

    Notes
    -----
    All other arguments are those of `reach_character`.
    """
    row, total, live = rows[:ROW], rows[ROW : 2 * ROW], rows[2 * ROW : 3 * ROW]
    shares = rows[3 * ROW : SCRATCH_ROW]
    read_joints(keys, pose, live)
    both = 1.0 - (1.0 - own[0]) * (1.0 - own[1])
    total[:] = ZERO
    x = 0.0
    y = 0.0
    z = 0.0
    below = 0.0
    for arm in range(2):
        if own[arm] <= 0.0:
            continue
        trunk = both * own[arm] / (own[0] + own[1])
        other = own[arm] * (1.0 - own[1 - arm]) * (1.0 - walking_share)
        for part in range(2):
            weight, whole = weight_of_part(character, arm, part, keys, state)
            if weight <= 0.0:
                continue
            row[:] = ZERO
            moved, _ = sum_examples(character, arm, part, state.course[character, arm], keys, state, row)
            unit_row(row)
            share = weight / whole
            right = share * (own[arm] if arm == 0 else other)
            left = share * (own[arm] if arm == 1 else other)
            lower = share * trunk if part == 0 else 0.0
            share_row(
                keys.group,
                np.float32(lower),
                np.float32(share * trunk),
                np.float32(right),
                np.float32(left),
                shares,
            )
            add_group_row(row, live, shares, total)
            x += lower * moved[0] / weight
            y += lower * moved[1] / weight
            z += lower * moved[2] / weight
            below += lower
    still = 1.0 - walking_share
    right = (1.0 - own[0]) - own[1] * (1.0 - own[0]) * still
    left = (1.0 - own[1]) - own[0] * (1.0 - own[1]) * still
    share_row(
        keys.group,
        np.float32(1.0 - below),
        np.float32(1.0 - both),
        np.float32(right),
        np.float32(left),
        shares,
    )
    complete_row(live, shares, total)
    write_joints(keys, total, shares, pose)
    pelvis[0] = x + (1.0 - below) * pelvis[0]
    pelvis[1] = y + (1.0 - below) * pelvis[1]
    pelvis[2] = z + (1.0 - below) * pelvis[2]


@inlined_kernel
def local_rotation(row: Any, joint: int, stride: int) -> Quaternion:
    """Read a joint's rotation from a compact row (stride 24) or a pose row (stride 64)."""
    return (
        float(row[joint]),
        float(row[stride + joint]),
        float(row[2 * stride + joint]),
        float(row[3 * stride + joint]),
    )


@inlined_kernel
def bone_of(keys: ReachKeys, arm: int, k: int, scale: Any) -> Vector:
    """Find the offset of a joint of a hand's chain from the joint above, in that one's frame, m."""
    size = float(scale[keys.chain_segment[arm, k]])
    return (
        size * keys.chain_offset[arm, k, 0],
        size * keys.chain_offset[arm, k, 1],
        size * keys.chain_offset[arm, k, 2],
    )


@inlined_kernel
def pelvis_of(keys: ReachKeys, scale: Any, pose: Any, pelvis: Any) -> tuple[Vector, Quaternion]:
    """Read where the pelvis of a pose row is in the character's own size, m, and its rotation; root frame."""
    leg = float(scale[keys.leg_segment])
    place = (leg * float(pelvis[0]), leg * float(pelvis[1]), leg * float(pelvis[2]))
    return place, local_rotation(pose, 0, PADDED_JOINTS)


@inlined_kernel
def place_hand(
    keys: ReachKeys, arm: int, scale: Any, pelvis: Vector, pelvis_rotation: Quaternion, row: Any, stride: int
) -> tuple[Vector, Quaternion]:
    """Walk from the pelvis to a hand.

    Parameters
    ----------
    keys : ReachKeys
    arm : int
    scale : (G,) float32
        Proportions.
    pelvis : tuple of float
        Root frame, in the character's own size, m.
    pelvis_rotation : tuple of float
        Root frame.
    row : (4 * stride,) float32
        Local rotations: a compact row (stride 24) or a pose row (stride 64).
    stride : int

    Returns
    -------
    tuple of float, tuple of float
        Position, m, and rotation of the hand, root frame.
    """
    place = pelvis
    turned = pelvis_rotation
    for k in range(1, CHAIN):
        place = add(place, rotate(turned, bone_of(keys, arm, k, scale)))
        joint = keys.chain[arm, k]
        if stride == PADDED_JOINTS:
            joint = keys.joint[joint]
        turned = multiply(turned, local_rotation(row, joint, stride))
    return place, normalized(turned)
