"""The pose of reaching people: examples of both hands, blended over the pose below them.

Both sections of all examples are stretched to the course of the reach, so that apexes coincide. Pose rows are
compact here: the 24 joints of pelvis, legs, trunk, head and arms; fingers are left to grasping.
"""

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from crowd_kernels._jit import inlined_kernel
from crowd_kernels.clip import PADDED_JOINTS
from crowd_kernels.quaternion import Quaternion, slerp
from crowd_kernels.reach_state import APEX, ReachState
from crowd_kernels.vector import Vector, add, scaled

JOINTS = 24
ROW = 4 * JOINTS
"""Length of a compact pose row: components outermost, 24 joints each."""
SCRATCH_ROW = 3 * ROW + JOINTS
"""Length of a chunk's scratch row for `reach_crowd`."""
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
    """(K, 96) Compact pose rows, control points of the curves that `key_shares` describes; signs aligned over
    all keys."""
    pelvis: npt.NDArray[np.float32]
    """(K, 3) Pelvis in the root frame likewise, m."""
    first_key: npt.NDArray[np.int32]
    """(E,) First key of each example."""
    key_count: npt.NDArray[np.int32]
    """(E,) Keys of each example, at least 3."""
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
def key_shares(place: float, count: int) -> tuple[int, float, float, float]:
    """Find which three keys of an example make up its pose, and their shares.

    Parameters
    ----------
    place : float
        Place among the keys, 0 to count - 1.
    count : int
        Keys of the example, at least 3.

    Returns
    -------
    int
        The first of the three.
    float, float, float
        Shares; their sum is 1.

    Notes
    -----
    **Source:** quadratic B-splines; de Boor, "A practical guide to splines", 1978. The velocities of joints
    change evenly from key to key; on straight lines between keys they would change all at once.
    """
    middle = min(max(int(place + 0.5), 1), count - 2)
    along = place - middle
    before = 0.5 * (0.5 - along) * (0.5 - along)
    after = 0.5 * (0.5 + along) * (0.5 + along)
    return middle - 1, before, 1.0 - before - after, after


@inlined_kernel
def blend_row(
    before: Any,
    middle: Any,
    after: Any,
    before_weight: Any,
    middle_weight: Any,
    after_weight: Any,
    out_sum: Any,
) -> None:
    """Add the weighted sum of three compact rows to a row.

    Parameters
    ----------
    before, middle, after : (96,) float32
    before_weight, middle_weight, after_weight : float32
    out_sum : (96,) float32
        In and out.
    """
    for lane in range(ROW):
        out_sum[lane] += (
            before_weight * before[lane] + middle_weight * middle[lane] + after_weight * after[lane]
        )


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
    character: int,
    arm: int,
    part: int,
    course: float,
    weights: Any,
    keys: ReachKeys,
    state: ReachState,
    row: Any,
) -> tuple[Vector, float]:
    """Add the weighted examples of one hand at a course to a compact row.

    Parameters
    ----------
    character, arm : int
    part : int
        0 those of the whole body, 1 those of the upper body.
    course : float
    weights : (N, 2, SLOTS) float64
        `state.example_weight` or `state.example_wanted`.
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
        own = weights[character, arm, slot]
        clip = state.example[character, arm, slot]
        if own == 0.0 or (clip >= keys.first_seated) != (part == 1):
            continue
        apex = keys.apex[clip]
        place = course * apex
        if course > APEX:
            place = apex + (course - APEX) * (keys.key_count[clip] - 1 - apex)
        index, before, middle, after = key_shares(place, keys.key_count[clip])
        key = keys.first_key[clip] + index
        before, middle, after = own * before, own * middle, own * after
        blend_row(
            keys.rotation[key],
            keys.rotation[key + 1],
            keys.rotation[key + 2],
            np.float32(before),
            np.float32(middle),
            np.float32(after),
            row,
        )
        x += before * keys.pelvis[key, 0] + middle * keys.pelvis[key + 1, 0] + after * keys.pelvis[key + 2, 0]
        y += before * keys.pelvis[key, 1] + middle * keys.pelvis[key + 1, 1] + after * keys.pelvis[key + 2, 1]
        z += before * keys.pelvis[key, 2] + middle * keys.pelvis[key + 1, 2] + after * keys.pelvis[key + 2, 2]
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
def blend_shares(
    character: int,
    walking_share: float,
    keys: ReachKeys,
    own: tuple[float, float],
    state: ReachState,
    pelvis: Vector,
    rows: Any,
) -> Vector:
    """Blend the examples of both hands, by given shares, over the pose below them.

    Where both hands reach, trunk and legs are shared by their weights; each arm belongs to its own reach and
    balances the other one's as far as it is free.

    Parameters
    ----------
    character : int
    walking_share : float
        Share of locomotion in the pose.
    keys : ReachKeys
    own : tuple of float
        Shares of the right and left hand's examples.
    state : ReachState
    pelvis : tuple of float
        Pelvis of the pose below, at leg scale 1, m.
    rows : (SCRATCH_ROW,) float32
        Scratch. In: compact row of the pose below, from 2 `ROW` on. Out: that of the blended pose, from `ROW`
        on, and the shares that the pose below keeps in it, from 3 `ROW` on.

    Returns
    -------
    tuple of float
        Pelvis at leg scale 1, m.
    """
    row, total, live = rows[:ROW], rows[ROW : 2 * ROW], rows[2 * ROW : 3 * ROW]
    shares = rows[3 * ROW : SCRATCH_ROW]
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
            if weight == 0.0:
                continue
            row[:] = ZERO
            moved, _ = sum_examples(
                character, arm, part, state.course[character, arm], state.example_weight, keys, state, row
            )
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
            if part == 0:
                x += trunk / whole * moved[0]
                y += trunk / whole * moved[1]
                z += trunk / whole * moved[2]
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
    return x + (1.0 - below) * pelvis[0], y + (1.0 - below) * pelvis[1], z + (1.0 - below) * pelvis[2]


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

    Parameters
    ----------
    own : tuple of float
        Shares of the right and left hand's examples.
    rows : (SCRATCH_ROW,) float32
        Scratch, see `blend_shares`; in: compact row of the pose.
    pose : (256,) float32
        In and out: pose row.
    pelvis : (3,) float32
        In and out: pelvis at leg scale 1, m.

    Notes
    -----
    All other arguments are those of `reach_character`.
    """
    below = (float(pelvis[0]), float(pelvis[1]), float(pelvis[2]))
    moved = blend_shares(character, walking_share, keys, own, state, below, rows)
    write_joints(keys, rows[ROW : 2 * ROW], rows[3 * ROW : SCRATCH_ROW], pose)
    for axis in range(3):
        pelvis[axis] = moved[axis]


@inlined_kernel
def blend_apex(
    character: int,
    arm: int,
    weights: Any,
    scale: Any,
    live_pelvis: Vector,
    live_rotation: Quaternion,
    keys: ReachKeys,
    state: ReachState,
    row: Any,
) -> tuple[Vector, Quaternion]:
    """Blend the examples of one hand, all by themselves, at their apex.

    Parameters
    ----------
    character, arm : int
    weights : (N, 2, SLOTS) float64
        `state.example_weight` or `state.example_wanted`.
    scale : (G,) float32
        Proportions.
    live_pelvis, live_rotation : tuple of float
        Pelvis of the pose below this layer, root frame, m: examples of the upper body leave it there.
    keys : ReachKeys
    state : ReachState
    row : (96,) float32
        Written: the blended pose.

    Returns
    -------
    tuple of float, tuple of float
        Position, m, and rotation of the pelvis, root frame.
    """
    row[:] = ZERO
    leg = float(scale[keys.leg_segment])
    moved, whole = sum_examples(character, arm, 0, APEX, weights, keys, state, row)
    _, upper = sum_examples(character, arm, 1, APEX, weights, keys, state, row)
    upper_share = upper / (whole + upper)
    unit_row(row)
    return (
        add(scaled(moved, leg / (whole + upper)), scaled(live_pelvis, upper_share)),
        slerp(
            (float(row[0]), float(row[JOINTS]), float(row[2 * JOINTS]), float(row[3 * JOINTS])),
            live_rotation,
            upper_share,
        ),
    )
