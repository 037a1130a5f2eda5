"""Rows of sixteen characters as the lanes of a block, and back.

Inside a block a value is 16 neighbouring lanes, one for each character. Rows turn into lanes and back by
interleaving in two steps of four: merging 4 streams moves the upper two bits of an index to its end, so two
steps move the four bits that number the lanes. LLVM makes shuffles of each step.
"""

from typing import Any

from crowd_kernels._jit import inlined_kernel, kernel
from crowd_kernels.clip import PADDED_JOINTS

LANES = 16
STREAM = 4 * PADDED_JOINTS
COMPONENT = LANES * PADDED_JOINTS


@inlined_kernel
def interleave(a: Any, b: Any, c: Any, d: Any, count: int, out: Any) -> None:
    """Merge four streams into one: a[0] b[0] c[0] d[0] a[1] b[1] ...

    Parameters
    ----------
    a, b, c, d : (>= count,) float32
    count : int
    out : (>= 4 * count,) float32
        Written.
    """
    for i in range(count):
        out[4 * i] = a[i]
        out[4 * i + 1] = b[i]
        out[4 * i + 2] = c[i]
        out[4 * i + 3] = d[i]


@inlined_kernel
def deinterleave(merged: Any, count: int, out_a: Any, out_b: Any, out_c: Any, out_d: Any) -> None:
    """Split one stream into four, the inverse of `interleave`.

    Parameters
    ----------
    merged : (>= 4 * count,) float32
    count : int
    out_a, out_b, out_c, out_d : (>= count,) float32
        Written.
    """
    for i in range(count):
        out_a[i] = merged[4 * i]
        out_b[i] = merged[4 * i + 1]
        out_c[i] = merged[4 * i + 2]
        out_d[i] = merged[4 * i + 3]


@kernel
def gather_block(pose_rotation: Any, active: Any, first: int, spare: Any, out_local: Any) -> None:
    """Turn the pose rows of 16 active characters into lanes; the last character fills up the block.

    Parameters
    ----------
    pose_rotation : (N, 256) float32
        Pose rows.
    active : (A,) int32
    first : int
        Place in `active` of the first lane, below A.
    spare : (1024,) float32
        Scratch.
    out_local : (4096,) float32
        Written: component, joint, lane.
    """
    last = active.shape[0] - 1
    for component in range(4):
        begin = component * PADDED_JOINTS
        end = begin + PADDED_JOINTS
        for stream in range(4):
            interleave(
                pose_rotation[active[min(first + stream, last)], begin:end],
                pose_rotation[active[min(first + stream + 4, last)], begin:end],
                pose_rotation[active[min(first + stream + 8, last)], begin:end],
                pose_rotation[active[min(first + stream + 12, last)], begin:end],
                PADDED_JOINTS,
                spare[stream * STREAM : (stream + 1) * STREAM],
            )
        interleave(
            spare[:STREAM],
            spare[STREAM : 2 * STREAM],
            spare[2 * STREAM : 3 * STREAM],
            spare[3 * STREAM : 4 * STREAM],
            STREAM,
            out_local[component * COMPONENT : (component + 1) * COMPONENT],
        )


@kernel
def scatter_block(block: Any, length: int, active: Any, first: int, spare: Any, out_rows: Any) -> None:
    """Write the lanes of a block to the rows of their characters.

    Lanes that only fill up a block hold the values of the last character, and write them to its row again.

    Parameters
    ----------
    block : (length * 16,) float32
        Value, lane.
    length : int
        Values of one character.
    active : (A,) int32
    first : int
        Place in `active` of the first lane, below A.
    spare : (>= length * 16,) float32
        Scratch.
    out_rows : (N, length) float32
        Written in the rows of 16 active characters.
    """
    last = active.shape[0] - 1
    part = 4 * length
    deinterleave(
        block, part, spare[:part], spare[part : 2 * part], spare[2 * part : 3 * part], spare[3 * part :]
    )
    for stream in range(4):
        deinterleave(
            spare[stream * part : (stream + 1) * part],
            length,
            out_rows[active[min(first + stream, last)]],
            out_rows[active[min(first + stream + 4, last)]],
            out_rows[active[min(first + stream + 8, last)]],
            out_rows[active[min(first + stream + 12, last)]],
        )
