"""Skin weights: how much each joint moves a point, from where it is along trunk and limbs."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from crowd.body.distances import Points, round_cone
from crowd.body.figure import FINGER_RADIUS, Flesh, mirrored

FloatArray = npt.NDArray[np.float64]

INFLUENCES = 4
LEGS_APART = 0.015
"""Half of the width over which the left leg's pull turns into the right leg's, m."""


def smooth(low: float, high: float, value: npt.ArrayLike) -> FloatArray:
    """Rise from 0 to 1 between two values."""
    share = np.clip((np.asarray(value, np.float64) - low) / (high - low), 0.0, 1.0)
    return np.asarray(share * share * (3.0 - 2.0 * share))


def skin_weights(
    flesh: Flesh, points: Points, legs_apart: float = LEGS_APART, *, has_limbs: bool = True
) -> FloatArray:
    """Share of each joint in the motion of points in the stance.

    Parameters
    ----------
    flesh : Flesh
    points : (P, 3) float32
    legs_apart : float
        m; wide for cloth that hangs around both legs.
    has_limbs : bool
        Arms and legs pull too; not on what hangs on the trunk or the head.

    Returns
    -------
    (P, J) float64
        Rows add up to 1.

    Notes
    -----
    Joints blend only with their neighbours in the tree, so that a thigh never pulls the other one: sharing
    goes down the tree, from trunk to limbs to fingers.
    """
    stance = flesh.stance
    joint = stance.skeleton.joint
    weight = np.zeros((len(points), stance.skeleton.joint_count))
    p = mirrored(points)
    is_left = points[:, 0] > 0.0

    below = stance.arm_at_rest(p)
    others = np.minimum(flesh.trunk(points), flesh.leg(points))
    # Wide over the shoulder, narrow between the sleeve and the side of the trunk.
    nearer = others - flesh.arm(points)
    low = smooth(1.33, 1.22, below[:, 1])
    arm = (1.0 - low) * smooth(-0.04, 0.05, nearer) + low * smooth(-0.012, 0.012, nearer)
    arm *= (below[:, 1] > 0.66) & (p[:, 1] < 1.50) & has_limbs
    hip_line = 0.855 + 0.5 * np.minimum(p[:, 0], 0.17)
    leg = (1.0 - arm) * smooth(0.065, -0.065, points[:, 1] - hip_line) * has_limbs
    trunk = 1.0 - arm - leg

    _share_trunk(weight, flesh, p, is_left, trunk)
    for side, on_side in (("left", is_left), ("right", ~is_left)):
        _share_arm(weight, flesh, p, arm * on_side, side)
    left = smooth(-legs_apart, legs_apart, points[:, 0])
    for side, share in (("left", left), ("right", 1.0 - left)):
        down = stance.leg_at_rest(p)
        shank = smooth(0.565, 0.435, down[:, 1])
        foot = smooth(0.125, 0.060, down[:, 1])
        toe = smooth(0.095, 0.150, down[:, 2]) * foot
        weight[:, joint(f"{side}_thigh")] += leg * share * (1.0 - shank)
        weight[:, joint(f"{side}_shank")] += leg * share * (shank - shank * foot)
        weight[:, joint(f"{side}_foot")] += leg * share * (shank * foot - shank * toe)
        weight[:, joint(f"{side}_toe")] += leg * share * shank * toe
    return np.asarray(weight / weight.sum(axis=1, keepdims=True))


def _share_trunk(
    weight: FloatArray, flesh: Flesh, p: Points, is_left: npt.NDArray[np.bool_], trunk: FloatArray
) -> None:
    """Share between pelvis, spine, neck, head and clavicles: each pulls most half way up to the next."""
    stance = flesh.stance
    names = ["pelvis", "spine_1", "spine_2", "spine_3", "spine_4", "neck_1", "neck_2", "head"]
    heights = stance.rest[[stance.skeleton.joint(name) for name in names], 1]
    middles = np.append(0.5 * (heights[:-1] + heights[1:]), 1.635)
    middles[0] = 0.985
    # The chin and the face belong to the head, which the neck passes behind.
    height = p[:, 1] + np.where(p[:, 1] > 1.50, 0.9 * np.maximum(p[:, 2] - 0.025, 0.0), 0.0)
    place = np.interp(height, middles, np.arange(len(names)))
    rows = np.clip(1.0 - np.abs(place[:, None] - np.arange(len(names))), 0.0, 1.0)
    clavicle = smooth(0.06, 0.15, p[:, 0]) * smooth(1.34, 1.42, p[:, 1]) * smooth(1.56, 1.50, p[:, 1])
    for number, name in enumerate(names):
        weight[:, stance.skeleton.joint(name)] += trunk * (1.0 - clavicle) * rows[:, number]
    for side, on_side in (("left", is_left), ("right", ~is_left)):
        weight[:, stance.skeleton.joint(f"{side}_clavicle")] += trunk * clavicle * on_side


def _share_arm(weight: FloatArray, flesh: Flesh, p: Points, arm: FloatArray, side: str) -> None:
    """Share between upper arm, forearm, hand and fingers."""
    stance = flesh.stance
    joint = stance.skeleton.joint
    down = stance.arm_at_rest(p)
    forearm = smooth(1.155, 1.055, down[:, 1])
    hand = smooth(0.885, 0.825, down[:, 1])
    weight[:, joint(f"{side}_upper_arm")] += arm * (1.0 - forearm)
    weight[:, joint(f"{side}_forearm")] += arm * (forearm - forearm * hand)
    near = np.flatnonzero((arm > 0.0) & (down[:, 1] < 0.86))
    palm = arm * forearm * hand
    if near.size:
        shares = _finger_shares(flesh, p[near])
        for name, share in shares.items():
            weight[near, joint(f"{side}_{name}")] += palm[near] * share
        palm[near] *= 1.0 - sum(shares.values(), np.zeros(near.size))
    weight[:, joint(f"{side}_hand")] += palm


def _finger_shares(flesh: Flesh, p: Points) -> dict[str, FloatArray]:
    """Share of each finger joint in points near the hand, up to 1 for the palm."""
    stance = flesh.stance
    distances, along = {}, {}
    for finger, sizes in FINGER_RADIUS.items():
        at, bones = stance.finger_at_rest(p, finger), stance.finger_bones(finger)
        distances[finger] = np.min(
            [round_cone(at, bones[k], bones[k + 1], sizes[k], sizes[k + 1]) for k in range(3)], axis=0
        )
        steps = np.linalg.norm(np.diff(bones, axis=0), axis=1)
        way = (bones[-1] - bones[1]) / np.linalg.norm(bones[-1] - bones[1])
        # Length along the finger from its first joint.
        along[finger] = ((at - bones[0]) @ way, steps)
    table = np.stack(list(distances.values()), axis=1)
    nearest = np.exp(-(table - table.min(axis=1, keepdims=True)) / 0.0025)
    nearest /= nearest.sum(axis=1, keepdims=True)
    shares: dict[str, FloatArray] = {}
    for column, finger in enumerate(FINGER_RADIUS):
        length, steps = along[finger]
        begin = smooth(-0.010, 0.008, length) * nearest[:, column]
        if finger == "thumb":
            begin = begin * smooth(0.012, 0.002, distances[finger])
        second = smooth(steps[0] - 0.008, steps[0] + 0.008, length)
        third = smooth(steps[0] + steps[1] - 0.006, steps[0] + steps[1] + 0.006, length)
        shares[f"{finger}_1"] = begin * (1.0 - second)
        shares[f"{finger}_2"] = begin * (second - second * third)
        shares[f"{finger}_3"] = begin * second * third
    return shares


def strongest(weight: FloatArray) -> tuple[npt.NDArray[np.uint8], FloatArray]:
    """The four joints that pull each point most, and their shares, which add up to 1."""
    order = np.argsort(-weight, axis=1, kind="stable")[:, :INFLUENCES]
    kept = np.take_along_axis(weight, order, axis=1)
    kept /= kept.sum(axis=1, keepdims=True)
    return np.where(kept > 0.0, order, 0).astype(np.uint8), kept
