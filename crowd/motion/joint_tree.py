"""Trees of a skeleton's joints for inverse kinematics: from a root joint to the effectors."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from crowd.errors import MotionError, describe, nearest_first
from crowd.motion.skeleton import Segment, Skeleton
from crowd.motion.swing_twist import swing_twist_limits
from crowd_kernels.clip import PADDED_JOINTS
from crowd_kernels.ik_tree import TreeArrays, find_chains

WEIGHTS: dict[str, float] = {
    "pelvis": 0.1,
    "spine": 0.15,
    "neck": 0.3,
    "head": 0.5,
    "clavicle": 0.3,
    "upper_arm": 1.0,
    "forearm": 1.0,
    "hand": 0.6,
}
"""How easily joints turn for an effector; joints not named here 1. Heavy parts move less than light ones."""


def joint_tree(
    skeleton: Skeleton,
    effectors: Sequence[str],
    *,
    first: str = "spine_1",
    weights: Mapping[str, float] | None = None,
    root_weight: float = 0.0,
    is_limited: bool = True,
    columns: Sequence[int] | None = None,
) -> TreeArrays:
    """Build the tree of joints above some effectors, for poses as `State.pose_rotation` holds them.

    Parameters
    ----------
    skeleton : Skeleton
    effectors : sequence of str
        Names of the joints that carry effectors, in the order of the kernel's effector axis.
    first : str
        Joint nearest to the pelvis that may turn; joints above it and on other branches keep their rotations.
        With ``"pelvis"`` all joints of the chains may turn.
    weights : mapping of str to float, optional
        How easily joints turn, by the first key that a joint's name contains; `WEIGHTS` when left out.
    root_weight : float
        How easily the pelvis moves, 0 for a pelvis that stays.
    is_limited : bool
        Keep the joints' limits.
    columns : sequence of int, optional
        Places of the effectors in the kernel's effector axis, when that holds more than these.

    Returns
    -------
    TreeArrays

    Raises
    ------
    MotionError
        The skeleton has no joint of such a name.
    """
    known = {name: joint for joint, name in enumerate(skeleton.joint_names)}
    for name in (*effectors, first):
        if name not in known:
            raise MotionError(
                describe("joint tree", "the skeleton has no such joint", name, nearest_first(name, known))
            )
    chains = [chain_above(skeleton, known[name]) for name in effectors]
    joints = sorted({joint for chain in chains for joint in chain})
    place = {joint: k for k, joint in enumerate(joints)}
    may_turn = {joint for chain in chains for joint in after(chain, known[first])}
    table = WEIGHTS if weights is None else weights
    names = [skeleton.joint_names[joint] for joint in joints]
    weight = np.array(
        [
            next((value for kind, value in table.items() if kind in name), 1.0) if joint in may_turn else 0.0
            for joint, name in zip(joints, names, strict=True)
        ],
        np.float32,
    )
    offset = skeleton.offset[joints].astype(np.float32)
    # The root's position is the pelvis, whatever the pose.
    offset[0] = 0.0
    parent = np.array([place.get(int(skeleton.parent[joint]), -1) for joint in joints], np.int32)
    carrier = np.array([place[known[name]] for name in effectors], np.int32)
    base, moves = find_chains(parent, weight, carrier)
    limits, has_limit = swing_twist_limits(skeleton)
    return TreeArrays(
        joint=np.array(joints, np.int32),
        parent=parent,
        offset=offset,
        segment=skeleton.segment[joints].astype(np.int32),
        weight=weight,
        is_limited=has_limit[joints] * np.uint8(is_limited),
        **{name: np.ascontiguousarray(array[joints]) for name, array in limits._asdict().items()},
        effector=carrier,
        column=np.array(range(len(effectors)) if columns is None else columns, np.int32),
        base=base,
        moves=moves,
        root_segment=int(Segment.LEG),
        root_weight=root_weight,
        component_step=PADDED_JOINTS,
        joint_step=1,
    )


def joint_trees(skeleton: Skeleton, effectors: Sequence[str], **options: Any) -> dict[int, TreeArrays]:
    """Build the tree of each set of some effectors, which reads no joints but those of their chains.

    Parameters
    ----------
    skeleton : Skeleton
    effectors : sequence of str
        Names of the joints that carry effectors.
    **options
        See `joint_tree`.

    Returns
    -------
    dict of int to TreeArrays
        Bit e of a key is set for the sets with effector e. All write their effectors to the same columns.
    """
    trees = {}
    for mask in range(1, 1 << len(effectors)):
        own = [e for e in range(len(effectors)) if mask >> e & 1]
        trees[mask] = joint_tree(skeleton, [effectors[e] for e in own], columns=own, **options)
    return trees


def chain_above(skeleton: Skeleton, joint: int) -> list[int]:
    """Joints from the pelvis to a joint."""
    chain = [joint]
    while skeleton.parent[chain[0]] >= 0:
        chain.insert(0, int(skeleton.parent[chain[0]]))
    return chain


def after(chain: list[int], first: int) -> list[int]:
    """Part of a chain from `first` on; nothing when it is on another branch."""
    return chain[chain.index(first) :] if first in chain else []
