"""Which joint is which by where it lies, for skeletons whose joints have no telling names."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from crowd.errors import MotionError, describe
from crowd.motion.importing.joint_names import JointMap, joint_map, map_joints

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int32]

UP = 1
"""Files whose joints have no names (glTF) have y up."""
LEG = ("thigh", "shank", "foot", "toe")
ARM = ("clavicle", "upper_arm", "forearm", "hand")


def recognise(names: tuple[str, ...], parent: IntArray, rest: FloatArray, where: str) -> JointMap:
    """Map joints by their names, or else by the shape of the skeleton; see `map_joints` and `map_by_shape`.

    Raises
    ------
    MotionError
        Neither tells; the message is about the names.
    """
    try:
        return map_joints(names, where)
    except MotionError as by_name:
        try:
            return map_by_shape(names, parent, rest, where)
        except MotionError:
            raise by_name from None


def map_by_shape(names: tuple[str, ...], parent: IntArray, rest: FloatArray, where: str) -> JointMap:
    """Map the joints of a standing humanoid by its tree and its rest pose, +y up.

    Parameters
    ----------
    names : tuple of str
    parent : (J,) int32
    rest : (J, 3) float64
        Positions in the rest pose.
    where : str
        File, for the message.

    Raises
    ------
    MotionError
        The tree is not that of a person: two legs from one joint, a head and two arms above.

    Notes
    -----
    The two lowest leaves on different branches are the feet, the joint where they meet the pelvis; the
    highest leaf is the head; among the rest the leaves farthest to both sides are the hands. The toes tell
    ahead.
    """
    leaves = [joint for joint in range(len(parent)) if joint not in set(parent.tolist())]
    height = rest[:, UP]
    by_height = sorted(leaves, key=lambda leaf: float(height[leaf]))
    feet = _two_branches(by_height, parent)
    if feet is None:
        raise _unlike_a_person(where, "two legs")
    pelvis = _meeting(feet, parent)
    assert pelvis is not None
    legs = [_down_to(pelvis, foot, parent) for foot in feet]
    head_leaf = by_height[-1]
    trunk = _down_to(pelvis, head_leaf, parent)
    if min(len(leg) for leg in legs) < 3 or len(trunk) < 2 or height[head_leaf] <= height[pelvis]:
        raise _unlike_a_person(where, "two legs of three joints and a trunk")
    across = rest[legs[0][0]] - rest[legs[1][0]]
    ahead = sum(rest[leg[-1]] - rest[leg[min(2, len(leg) - 1)]] for leg in legs)
    if float(np.linalg.norm(np.cross(np.eye(3)[UP], across))) < 1e-9:
        raise _unlike_a_person(where, "hips side by side")
    facing = ahead if np.hypot(ahead[0], ahead[2]) > 1e-6 else np.array([0.0, 0.0, 1.0])
    first_is_left = float(np.cross(np.eye(3)[UP], facing) @ across) > 0.0
    left, right = (0, 1) if first_is_left else (1, 0)
    joint = {"pelvis": pelvis, "head": trunk[-1]}
    for side, number in (("left", left), ("right", right)):
        joint |= {f"{side}_{part}": found for part, found in zip(LEG, legs[number], strict=False)}
    arms = _arms(leaves, parent, trunk, rest, across if first_is_left else -across)
    for side, arm in zip(("left", "right"), arms, strict=True):
        parts = ARM if len(arm) >= 4 else ARM[1:]
        joint |= {f"{side}_{part}": found for part, found in zip(parts, arm, strict=False)}
    used = {found for arm in arms for found in arm}
    chest = [found for found in trunk[:-1] if found not in used]
    fork = max((chest.index(parent[arm[0]]) for arm in arms if arm and parent[arm[0]] in chest), default=None)
    cut = len(chest) if fork is None else fork + 1
    return joint_map("its shape", names, joint, {"spine": tuple(chest[:cut]), "neck": tuple(chest[cut:])})


def _unlike_a_person(where: str, lacks: str) -> MotionError:
    return MotionError(
        describe(f"{where}: skeleton", f"is not that of a person by its shape: no {lacks}; see --joints")
    )


def _above(joint: int, parent: IntArray) -> list[int]:
    """A joint and all above it."""
    path = [joint]
    while parent[path[-1]] >= 0:
        path.append(int(parent[path[-1]]))
    return path


def _meeting(pair: tuple[int, int], parent: IntArray) -> int | None:
    """Lowest joint above two others; None when they hang on different roots."""
    above = set(_above(pair[0], parent))
    return next((joint for joint in _above(pair[1], parent) if joint in above), None)


def _down_to(top: int, leaf: int, parent: IntArray) -> list[int]:
    """Joints below `top` on the way to a leaf, from the top down."""
    path = _above(leaf, parent)
    return path[: path.index(top)][::-1]


def _two_branches(by_height: list[int], parent: IntArray) -> tuple[int, int] | None:
    """The lowest leaf, and the lowest one that meets it no sooner than three joints up."""
    for second in by_height[1:]:
        meeting = _meeting((by_height[0], second), parent)
        if meeting is None:
            continue
        if all(len(_down_to(meeting, leaf, parent)) >= 3 for leaf in (by_height[0], second)):
            return by_height[0], second
    return None


def _arms(
    leaves: list[int], parent: IntArray, trunk: list[int], rest: FloatArray, to_left: FloatArray
) -> tuple[list[int], list[int]]:
    """Chains of the left and the right arm from the trunk outwards; empty where there is none."""
    side = to_left / np.linalg.norm(to_left)
    chains = []
    for sign in (1.0, -1.0):
        best: list[int] = []
        farthest = 0.0
        for leaf in leaves:
            path = _above(leaf, parent)
            fork = next((joint for joint in path if joint in trunk), None)
            if fork is None or leaf == trunk[-1]:
                continue
            chain = _down_to(fork, leaf, parent)
            distance = sign * float((rest[leaf] - rest[fork]) @ side)
            if len(chain) >= 2 and distance > farthest:
                best, farthest = chain, distance
        chains.append(best)
    return chains[0], chains[1]
