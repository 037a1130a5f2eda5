"""Trees of joints with effectors, as inverse kinematics reads them."""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from crowd_kernels.joint_limit import LimitArrays


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
