"""Where hands are in blended poses: walks along their chains from the pelvis."""

from typing import Any

from crowd_kernels._jit import inlined_kernel
from crowd_kernels.clip import PADDED_JOINTS
from crowd_kernels.quaternion import Quaternion, multiply, normalized, rotate
from crowd_kernels.reach_blend import CHAIN, JOINTS, ROW, ReachKeys, blend_apex, blend_shares
from crowd_kernels.reach_state import ReachState, vector_of
from crowd_kernels.vector import Vector, add, scaled


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


@inlined_kernel
def place_point(
    character: int,
    arm: int,
    scale: Any,
    pelvis: Vector,
    pelvis_rotation: Quaternion,
    keys: ReachKeys,
    state: ReachState,
    row: Any,
    stride: int,
) -> tuple[Vector, Quaternion]:
    """Find where the point of a hand is that comes to its target, and how the hand is turned.

    Notes
    -----
    Arguments and results are those of `place_hand`.
    """
    hand, turned = place_hand(keys, arm, scale, pelvis, pelvis_rotation, row, stride)
    return add(hand, rotate(turned, vector_of(state.point_hand, character, arm))), turned


@inlined_kernel
def place_apex(
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
    """Find where the point of a hand is, and how the hand is turned, where its blend is at the apex.

    Notes
    -----
    Arguments are those of `blend_apex`; root frame, m.
    """
    body, body_turned = blend_apex(
        character, arm, weights, scale, live_pelvis, live_rotation, keys, state, row
    )
    return place_point(character, arm, scale, body, body_turned, keys, state, row, JOINTS)


@inlined_kernel
def place_alone(
    character: int,
    arm: int,
    own: float,
    walking_share: float,
    scale: Any,
    live_pelvis: Vector,
    keys: ReachKeys,
    state: ReachState,
    rows: Any,
) -> tuple[Vector, Quaternion]:
    """Find where the point of a hand would be, and how it would be turned, if the other hand did not reach.

    Parameters
    ----------
    character, arm : int
    own : float
        Share of the hand's examples.
    walking_share : float
        Share of locomotion in the pose.
    scale : (G,) float32
        Proportions.
    live_pelvis : tuple of float
        Pelvis of the pose below this layer, root frame, m.
    keys : ReachKeys
    state : ReachState
    rows : (SCRATCH_ROW,) float32
        Scratch, after `blend_body`.

    Returns
    -------
    tuple of float, tuple of float
        Root frame, m.
    """
    leg = float(scale[keys.leg_segment])
    shares = (own, 0.0) if arm == 0 else (0.0, own)
    pelvis = scaled(live_pelvis, 1.0 / leg)
    moved = blend_shares(character, walking_share, keys, shares, state, pelvis, rows)
    row = rows[ROW : 2 * ROW]
    turned = local_rotation(row, 0, JOINTS)
    return place_point(character, arm, scale, scaled(moved, leg), turned, keys, state, row, JOINTS)
