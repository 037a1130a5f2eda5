"""Row leaves of inverse kinematics that build its system: what the joints together can do about effectors.

A joint of weight w that turns freely, with the effectors a and b at the levers l and m from it, adds

    w ((l . m) I - m l^T)

to the block of a's position and b's: what a force at b moves a by. So moments of all levers are added up
first, sums of w m l^T and of w m, and blocks are made of them once, at the end. Joints with fixed directions
count as free ones at first, and what they cannot do is taken away from the finished blocks. Who shares a row
with them keeps every bit: nothing is taken away there.
"""

from typing import Any

from crowd_kernels._jit import inlined_kernel
from crowd_kernels.ik_joint import lost_mobility_at
from crowd_kernels.ik_layout import DRIFT, MISS, PLACE, TIP, TURNS, WANTS_PLACE, put_vector, vector_at
from crowd_kernels.lanes import LANES
from crowd_kernels.vector import cross, subtract


@inlined_kernel
def add_own_moments_row(joint: Any, weight: Any, effector: Any, out_push: Any, out_block: Any) -> None:
    """Add the second moments of one effector about a joint, and what the joint's drift does to it.

    Parameters
    ----------
    joint : (JOINT_ROW,) float32
    weight : float32
        How easily the joint turns.
    effector : (EFFECTOR_ROW,) float32
    out_push : (PUSH,) float32
        Sums of what drifts do, in and out.
    out_block : (144,) float32
        Lower triangle, in and out.
    """
    for lane in range(LANES):
        drift = vector_at(joint, DRIFT, lane)
        lever = subtract(vector_at(effector, TIP, lane), vector_at(joint, PLACE, lane))
        moved = cross(drift, lever)
        out_push[lane] += moved[0]
        out_push[LANES + lane] += moved[1]
        out_push[2 * LANES + lane] += moved[2]
        out_push[3 * LANES + lane] += drift[0]
        out_push[4 * LANES + lane] += drift[1]
        out_push[5 * LANES + lane] += drift[2]
        x, y, z = weight * lever[0], weight * lever[1], weight * lever[2]
        out_block[lane] += x * lever[0]
        out_block[3 * LANES + lane] += y * lever[0]
        out_block[4 * LANES + lane] += y * lever[1]
        out_block[6 * LANES + lane] += z * lever[0]
        out_block[7 * LANES + lane] += z * lever[1]
        out_block[8 * LANES + lane] += z * lever[2]


@inlined_kernel
def add_moments_row(joint: Any, weight: Any, a: Any, b: Any, out_block: Any) -> None:
    """Add the second moments of two effectors about a joint.

    Parameters
    ----------
    joint : (JOINT_ROW,) float32
    weight : float32
        How easily the joint turns.
    a, b : (EFFECTOR_ROW,) float32
        Effectors of the block's rows and columns.
    out_block : (144,) float32
        In and out.
    """
    for lane in range(LANES):
        place = vector_at(joint, PLACE, lane)
        u, v, w = subtract(vector_at(a, TIP, lane), place)
        other = subtract(vector_at(b, TIP, lane), place)
        x, y, z = weight * other[0], weight * other[1], weight * other[2]
        out_block[lane] += x * u
        out_block[LANES + lane] += x * v
        out_block[2 * LANES + lane] += x * w
        out_block[3 * LANES + lane] += y * u
        out_block[4 * LANES + lane] += y * v
        out_block[5 * LANES + lane] += y * w
        out_block[6 * LANES + lane] += z * u
        out_block[7 * LANES + lane] += z * v
        out_block[8 * LANES + lane] += z * w


@inlined_kernel
def add_lever_row(joint: Any, weight: Any, effector: Any, out_block: Any) -> None:
    """Add the lever of an effector from a joint to the first moments.

    Parameters
    ----------
    joint : (JOINT_ROW,) float32
    weight : float32
        How easily the joint turns.
    effector : (EFFECTOR_ROW,) float32
    out_block : (>= 48,) float32
        In and out.
    """
    for lane in range(LANES):
        lever = subtract(vector_at(effector, TIP, lane), vector_at(joint, PLACE, lane))
        out_block[lane] += weight * lever[0]
        out_block[LANES + lane] += weight * lever[1]
        out_block[2 * LANES + lane] += weight * lever[2]


@inlined_kernel
def finish_push_row(effector: Any, out_push: Any) -> None:
    """Make the right side of the system: what is missing less what drifts already do.

    Parameters
    ----------
    effector : (EFFECTOR_ROW,) float32
    out_push : (PUSH,) float32
        In: sums of what drifts do. Out: the right side at the effector.
    """
    for lane in range(LANES):
        for axis in range(3):
            index = axis * LANES + lane
            out_push[index] = effector[MISS + index] - effector[WANTS_PLACE + lane] * out_push[index]
            index += 3 * LANES
            out_push[index] = effector[MISS + index] - effector[TURNS + lane] * out_push[index]


@inlined_kernel
def finish_place_row(a: Any, b: Any, block: Any) -> None:
    """Make the block of two effectors' positions of their second moments.

    Parameters
    ----------
    a, b : (EFFECTOR_ROW,) float32
        Effectors of the block's rows and columns.
    block : (144,) float32
        In and out; the lower triangle alone where both are the same.
    """
    for lane in range(LANES):
        share = a[WANTS_PLACE + lane] * b[WANTS_PLACE + lane]
        xx, yy, zz = block[lane], block[4 * LANES + lane], block[8 * LANES + lane]
        block[lane] = share * (yy + zz)
        block[LANES + lane] *= -share
        block[2 * LANES + lane] *= -share
        block[3 * LANES + lane] *= -share
        block[4 * LANES + lane] = share * (zz + xx)
        block[5 * LANES + lane] *= -share
        block[6 * LANES + lane] *= -share
        block[7 * LANES + lane] *= -share
        block[8 * LANES + lane] = share * (xx + yy)


@inlined_kernel
def finish_frame_row(a: Any, b: Any, weight: Any, blocks: Any) -> None:
    """Make the blocks of one effector's rotation with another's position and rotation.

    Parameters
    ----------
    a, b : (EFFECTOR_ROW,) float32
        Effectors of the blocks' rows and columns.
    weight : float32
        Sum over the joints that move both.
    blocks : (288,) float32
        Two neighbouring blocks, in and out. In: first moments of b in the first three rows, the rest 0.
    """
    for lane in range(LANES):
        share = a[TURNS + lane] * b[WANTS_PLACE + lane]
        x, y, z = vector_at(blocks, 0, lane)
        x, y, z = share * x, share * y, share * z
        put_vector(blocks, 0, lane, (x - x, -z, y))
        put_vector(blocks, 3 * LANES, lane, (z, x - x, -x))
        put_vector(blocks, 6 * LANES, lane, (-y, x, x - x))
        share = weight * a[TURNS + lane] * b[TURNS + lane]
        blocks[9 * LANES + lane] = share
        blocks[13 * LANES + lane] = share
        blocks[17 * LANES + lane] = share


@inlined_kernel
def finish_cross_row(a: Any, b: Any, block: Any) -> None:
    """Make the block of one effector's position with another's rotation.

    Parameters
    ----------
    a, b : (EFFECTOR_ROW,) float32
        Effectors of the block's rows and columns.
    block : (144,) float32
        In and out. In: first moments of a in the first three rows.
    """
    for lane in range(LANES):
        share = a[WANTS_PLACE + lane] * b[TURNS + lane]
        x, y, z = vector_at(block, 0, lane)
        x, y, z = share * x, share * y, share * z
        put_vector(block, 0, lane, (x - x, z, -y))
        put_vector(block, 3 * LANES, lane, (-z, x - x, x))
        put_vector(block, 6 * LANES, lane, (y, -x, x - x))


@inlined_kernel
def take_place_row(joint: Any, weight: Any, a: Any, b: Any, block: Any) -> None:
    """Take what a joint cannot do from the block of two effectors' positions.

    Parameters
    ----------
    joint : (JOINT_ROW,) float32
    weight : float32
        How easily it would turn freely.
    a, b : (EFFECTOR_ROW,) float32
        Effectors of the block's rows and columns.
    block : (144,) float32
        Block of J W J^T, in and out.
    """
    for lane in range(LANES):
        place = vector_at(joint, PLACE, lane)
        lever = subtract(vector_at(a, TIP, lane), place)
        other = subtract(vector_at(b, TIP, lane), place)
        share = a[WANTS_PLACE + lane] * b[WANTS_PLACE + lane]
        mx, my, mz = lost_mobility_at(joint, weight, lane)
        x, y, z = cross(mx, other), cross(my, other), cross(mz, other)
        u, v, w = lever[0] * share, lever[1] * share, lever[2] * share
        block[lane] -= w * y[0] - v * z[0]
        block[LANES + lane] -= w * y[1] - v * z[1]
        block[2 * LANES + lane] -= w * y[2] - v * z[2]
        block[3 * LANES + lane] -= u * z[0] - w * x[0]
        block[4 * LANES + lane] -= u * z[1] - w * x[1]
        block[5 * LANES + lane] -= u * z[2] - w * x[2]
        block[6 * LANES + lane] -= v * x[0] - u * y[0]
        block[7 * LANES + lane] -= v * x[1] - u * y[1]
        block[8 * LANES + lane] -= v * x[2] - u * y[2]


@inlined_kernel
def take_frame_row(joint: Any, weight: Any, a: Any, b: Any, blocks: Any) -> None:
    """Take what a joint cannot do from the blocks of an effector's rotation with another's row of blocks.

    Parameters
    ----------
    joint : (JOINT_ROW,) float32
    weight : float32
        How easily it would turn freely.
    a, b : (EFFECTOR_ROW,) float32
        Effectors of the blocks' rows and columns.
    blocks : (288,) float32
        Two neighbouring blocks of J W J^T, in and out.
    """
    for lane in range(LANES):
        other = subtract(vector_at(b, TIP, lane), vector_at(joint, PLACE, lane))
        mx, my, mz = lost_mobility_at(joint, weight, lane)
        x, y, z = cross(mx, other), cross(my, other), cross(mz, other)
        share = a[TURNS + lane] * b[WANTS_PLACE + lane]
        blocks[lane] -= share * x[0]
        blocks[LANES + lane] -= share * x[1]
        blocks[2 * LANES + lane] -= share * x[2]
        blocks[3 * LANES + lane] -= share * y[0]
        blocks[4 * LANES + lane] -= share * y[1]
        blocks[5 * LANES + lane] -= share * y[2]
        blocks[6 * LANES + lane] -= share * z[0]
        blocks[7 * LANES + lane] -= share * z[1]
        blocks[8 * LANES + lane] -= share * z[2]
        share = a[TURNS + lane] * b[TURNS + lane]
        blocks[9 * LANES + lane] -= share * mx[0]
        blocks[10 * LANES + lane] -= share * mx[1]
        blocks[11 * LANES + lane] -= share * mx[2]
        blocks[12 * LANES + lane] -= share * my[0]
        blocks[13 * LANES + lane] -= share * my[1]
        blocks[14 * LANES + lane] -= share * my[2]
        blocks[15 * LANES + lane] -= share * mz[0]
        blocks[16 * LANES + lane] -= share * mz[1]
        blocks[17 * LANES + lane] -= share * mz[2]


@inlined_kernel
def take_cross_row(joint: Any, weight: Any, a: Any, b: Any, block: Any) -> None:
    """Take what a joint cannot do from the block of one effector's position with another's rotation.

    Parameters
    ----------
    joint : (JOINT_ROW,) float32
    weight : float32
        How easily it would turn freely.
    a, b : (EFFECTOR_ROW,) float32
        Effectors of the block's rows and columns.
    block : (144,) float32
        Block of J W J^T, in and out.
    """
    for lane in range(LANES):
        lever = subtract(vector_at(a, TIP, lane), vector_at(joint, PLACE, lane))
        share = a[WANTS_PLACE + lane] * b[TURNS + lane]
        mx, my, mz = lost_mobility_at(joint, weight, lane)
        x, y, z = cross(mx, lever), cross(my, lever), cross(mz, lever)
        block[lane] -= share * x[0]
        block[LANES + lane] -= share * y[0]
        block[2 * LANES + lane] -= share * z[0]
        block[3 * LANES + lane] -= share * x[1]
        block[4 * LANES + lane] -= share * y[1]
        block[5 * LANES + lane] -= share * z[1]
        block[6 * LANES + lane] -= share * x[2]
        block[7 * LANES + lane] -= share * y[2]
        block[8 * LANES + lane] -= share * z[2]
