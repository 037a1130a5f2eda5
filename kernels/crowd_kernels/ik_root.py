"""Row leaves of inverse kinematics for a root that moves."""

from typing import Any

import numpy as np

from crowd_kernels._jit import inlined_kernel
from crowd_kernels.ik_layout import DRIFT, PLACE, TINY, WANTS_PLACE, put_vector, vector_at
from crowd_kernels.lanes import LANES
from crowd_kernels.vector import dot, subtract


@inlined_kernel
def root_pull_row(reference: Any, gain: Any, bound: Any, root: Any) -> None:
    """Let the root drift towards its reference.

    Parameters
    ----------
    reference : (48,) float32
        Wanted place, m.
    gain : float32
        Share of the way.
    bound : float32
        Largest drift, m.
    root : (JOINT_ROW,) float32
        The root: its drift is written.
    """
    for lane in range(LANES):
        way = subtract(vector_at(reference, 0, lane), vector_at(root, PLACE, lane))
        share = min(gain, bound / np.sqrt(dot(way, way) + TINY))
        put_vector(root, DRIFT, lane, (way[0] * share, way[1] * share, way[2] * share))


@inlined_kernel
def root_accumulate_row(a: Any, b: Any, weight: Any, out_block: Any) -> None:
    """Add the root's moves to the system of two effectors.

    Parameters
    ----------
    a, b : (EFFECTOR_ROW,) float32
    weight : float32
        How easily the root moves.
    out_block : (144,) float32
        In and out.
    """
    for lane in range(LANES):
        share = weight * a[WANTS_PLACE + lane] * b[WANTS_PLACE + lane]
        out_block[lane] += share
        out_block[4 * LANES + lane] += share
        out_block[8 * LANES + lane] += share


@inlined_kernel
def root_subtract_row(root: Any, effector: Any, out_right: Any) -> None:
    """Take away from an effector's step what the drift of the root already does.

    Parameters
    ----------
    root : (JOINT_ROW,) float32
    effector : (EFFECTOR_ROW,) float32
    out_right : (96,) float32
        In and out.
    """
    for lane in range(LANES):
        drift = vector_at(root, DRIFT, lane)
        place = effector[WANTS_PLACE + lane]
        out_right[lane] -= place * drift[0]
        out_right[LANES + lane] -= place * drift[1]
        out_right[2 * LANES + lane] -= place * drift[2]


@inlined_kernel
def root_push_row(effector: Any, force: Any, weight: Any, root: Any) -> None:
    """Add what a force at an effector moves the root to its drift.

    Parameters
    ----------
    effector : (EFFECTOR_ROW,) float32
    force : (48,) float32
    weight : float32
        How easily the root moves.
    root : (JOINT_ROW,) float32
        The root: its drift is changed.
    """
    for lane in range(LANES):
        drift = vector_at(root, DRIFT, lane)
        push = vector_at(force, 0, lane)
        share = weight * effector[WANTS_PLACE + lane]
        put_vector(
            root,
            DRIFT,
            lane,
            (drift[0] + share * push[0], drift[1] + share * push[1], drift[2] + share * push[2]),
        )


@inlined_kernel
def root_commit_row(is_running: Any, root: Any) -> None:
    """Move the root by its drift.

    Parameters
    ----------
    is_running : (16,) float32
        0 where the character stays as it is.
    root : (JOINT_ROW,) float32
        The root: its place is changed.
    """
    for lane in range(LANES):
        drift, place, run = vector_at(root, DRIFT, lane), vector_at(root, PLACE, lane), is_running[lane]
        put_vector(
            root,
            PLACE,
            lane,
            (place[0] + run * drift[0], place[1] + run * drift[1], place[2] + run * drift[2]),
        )
