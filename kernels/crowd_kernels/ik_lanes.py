"""Row leaves of inverse kinematics for plain lanes: sums, and who takes another step."""

from typing import Any

import numpy as np

from crowd_kernels._jit import inlined_kernel
from crowd_kernels.ik_layout import HALF, ONE, ZERO
from crowd_kernels.lanes import LANES

PROGRESS: Any = np.float32(0.99)


@inlined_kernel
def clear_row(row: Any) -> None:
    """Set 16 numbers to zero.

    Parameters
    ----------
    row : (16,) float32
        Written.
    """
    for lane in range(LANES):
        row[lane] = ZERO


@inlined_kernel
def add_row(values: Any, out: Any) -> None:
    """Add 16 numbers to others.

    Parameters
    ----------
    values : (16,) float32
    out : (16,) float32
        In and out.
    """
    for lane in range(LANES):
        out[lane] += values[lane]


@inlined_kernel
def sum_row(row: Any) -> Any:
    """Add up 16 numbers."""
    total = ZERO
    for lane in range(LANES):
        total += row[lane]
    return total


@inlined_kernel
def running_row(
    error: Any, missing: Any, is_early: Any, patience: Any, best: Any, stalled: Any, out_running: Any
) -> None:
    """Decide which characters take another step.

    Parameters
    ----------
    error, missing : (16,) float32
        See `effector_row`.
    is_early : float32
        1 while everyone takes steps, reached or not.
    patience : float32
        Iterations with less than 1 % of progress after which a character stops.
    best, stalled : (16,) float32
        In and out: least error so far, and iterations since it fell.
    out_running : (16,) float32
        In and out: 1 for those who go on; who has stopped stays.
    """
    for lane in range(LANES):
        is_better = error[lane] < PROGRESS * best[lane]
        best[lane] = error[lane] if is_better else best[lane]
        stalled[lane] = ZERO if is_better else stalled[lane] + ONE
        goes_on = ONE if (missing[lane] > HALF) & (stalled[lane] <= patience) else ZERO
        out_running[lane] *= max(goes_on, is_early)
