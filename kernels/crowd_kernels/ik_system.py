"""The system of inverse kinematics, J W J^T + d I, solved by Cholesky in blocks of three rows."""

from typing import Any

import numpy as np

from crowd_kernels._jit import inlined_kernel, kernel
from crowd_kernels.ik_layout import ONE, PUSH, put_vector, vector_at
from crowd_kernels.lanes import LANES
from crowd_kernels.vector import dot

LEAST_PIVOT: Any = np.float32(1e-9)


@kernel
def block_of(row: int, column: int) -> int:
    """Find a block in the lower triangle of the system."""
    return row * (row + 1) // 2 + column


@kernel
def half_of(row: int, parts: int) -> int:
    """Find the half of an effector's push that belongs to a row of blocks."""
    return row // parts * 2 + row % parts


@inlined_kernel
def factor_block(damping: Any, block: Any) -> None:
    """Damp a block on the diagonal and factor it by Cholesky, in place.

    Parameters
    ----------
    damping : (16,) float32
        Added to the diagonal.
    block : (144,) float32
        Its lower triangle is read and written; the diagonal then holds the inverse pivots.
    """
    for lane in range(LANES):
        extra = damping[lane]
        a = ONE / np.sqrt(max(block[lane] + extra, LEAST_PIVOT))
        b = block[3 * LANES + lane] * a
        c = block[6 * LANES + lane] * a
        d = ONE / np.sqrt(max(block[4 * LANES + lane] + extra - b * b, LEAST_PIVOT))
        e = (block[7 * LANES + lane] - c * b) * d
        f = ONE / np.sqrt(max(block[8 * LANES + lane] + extra - c * c - e * e, LEAST_PIVOT))
        block[lane] = a
        block[3 * LANES + lane] = b
        block[4 * LANES + lane] = d
        block[6 * LANES + lane] = c
        block[7 * LANES + lane] = e
        block[8 * LANES + lane] = f


@inlined_kernel
def divide_block(pivot: Any, block: Any) -> None:
    """Divide a block below the diagonal by the factor of its column.

    Parameters
    ----------
    pivot : (144,) float32
        Block of the same column on the diagonal, after `factor_block`.
    block : (144,) float32
        In and out.
    """
    for lane in range(LANES):
        a, b, c = pivot[lane], pivot[3 * LANES + lane], pivot[6 * LANES + lane]
        d, e, f = pivot[4 * LANES + lane], pivot[7 * LANES + lane], pivot[8 * LANES + lane]
        x0 = block[lane] * a
        x1 = (block[LANES + lane] - x0 * b) * d
        x2 = (block[2 * LANES + lane] - x0 * c - x1 * e) * f
        y0 = block[3 * LANES + lane] * a
        y1 = (block[4 * LANES + lane] - y0 * b) * d
        y2 = (block[5 * LANES + lane] - y0 * c - y1 * e) * f
        z0 = block[6 * LANES + lane] * a
        z1 = (block[7 * LANES + lane] - z0 * b) * d
        z2 = (block[8 * LANES + lane] - z0 * c - z1 * e) * f
        put_vector(block, 0, lane, (x0, x1, x2))
        put_vector(block, 3 * LANES, lane, (y0, y1, y2))
        put_vector(block, 6 * LANES, lane, (z0, z1, z2))


@inlined_kernel
def subtract_block(left: Any, right: Any, block: Any) -> None:
    """Subtract the product of a block and the transpose of another.

    Parameters
    ----------
    left, right : (144,) float32
    block : (144,) float32
        In and out.
    """
    for lane in range(LANES):
        a = vector_at(right, 0, lane)
        b = vector_at(right, 3 * LANES, lane)
        c = vector_at(right, 6 * LANES, lane)
        x = vector_at(left, 0, lane)
        y = vector_at(left, 3 * LANES, lane)
        z = vector_at(left, 6 * LANES, lane)
        block[lane] -= dot(x, a)
        block[LANES + lane] -= dot(x, b)
        block[2 * LANES + lane] -= dot(x, c)
        block[3 * LANES + lane] -= dot(y, a)
        block[4 * LANES + lane] -= dot(y, b)
        block[5 * LANES + lane] -= dot(y, c)
        block[6 * LANES + lane] -= dot(z, a)
        block[7 * LANES + lane] -= dot(z, b)
        block[8 * LANES + lane] -= dot(z, c)


@inlined_kernel
def solve_lower(pivot: Any, out_values: Any) -> None:
    """Divide three elements of the right side by a factored block.

    Parameters
    ----------
    pivot : (144,) float32
        After `factor_block`.
    out_values : (48,) float32
        In and out.
    """
    for lane in range(LANES):
        x, y, z = vector_at(out_values, 0, lane)
        x *= pivot[lane]
        y = (y - pivot[3 * LANES + lane] * x) * pivot[4 * LANES + lane]
        z = (z - pivot[6 * LANES + lane] * x - pivot[7 * LANES + lane] * y) * pivot[8 * LANES + lane]
        put_vector(out_values, 0, lane, (x, y, z))


@inlined_kernel
def solve_upper(pivot: Any, out_values: Any) -> None:
    """Divide three elements of the right side by the transpose of a factored block.

    Parameters
    ----------
    pivot : (144,) float32
        After `factor_block`.
    out_values : (48,) float32
        In and out.
    """
    for lane in range(LANES):
        x, y, z = vector_at(out_values, 0, lane)
        z *= pivot[8 * LANES + lane]
        y = (y - pivot[7 * LANES + lane] * z) * pivot[4 * LANES + lane]
        x = (x - pivot[3 * LANES + lane] * y - pivot[6 * LANES + lane] * z) * pivot[lane]
        put_vector(out_values, 0, lane, (x, y, z))


@inlined_kernel
def subtract_lower(block: Any, values: Any, out_values: Any) -> None:
    """Subtract the product of a block and three elements.

    Parameters
    ----------
    block : (144,) float32
    values : (48,) float32
    out_values : (48,) float32
        In and out.
    """
    for lane in range(LANES):
        v = vector_at(values, 0, lane)
        x, y, z = vector_at(out_values, 0, lane)
        x -= dot(vector_at(block, 0, lane), v)
        y -= dot(vector_at(block, 3 * LANES, lane), v)
        z -= dot(vector_at(block, 6 * LANES, lane), v)
        put_vector(out_values, 0, lane, (x, y, z))


@inlined_kernel
def subtract_upper(block: Any, values: Any, out_values: Any) -> None:
    """Subtract the product of a block's transpose and three elements.

    Parameters
    ----------
    block : (144,) float32
    values : (48,) float32
    out_values : (48,) float32
        In and out.
    """
    for lane in range(LANES):
        a, b, c = vector_at(values, 0, lane)
        u = vector_at(block, 0, lane)
        v = vector_at(block, 3 * LANES, lane)
        w = vector_at(block, 6 * LANES, lane)
        x, y, z = vector_at(out_values, 0, lane)
        x -= u[0] * a + v[0] * b + w[0] * c
        y -= u[1] * a + v[1] * b + w[1] * c
        z -= u[2] * a + v[2] * b + w[2] * c
        put_vector(out_values, 0, lane, (x, y, z))


@kernel
def solve_system(count: int, parts: int, damping: Any, system: Any, out_push: Any) -> None:
    """Solve the system by Cholesky in blocks of 3 rows.

    Parameters
    ----------
    count : int
        Rows of blocks.
    parts : int
        Rows of blocks of an effector: 1 position, 2 position and rotation.
    damping : (32,) float32
        Added to the diagonal, of positions and of rotations.
    system : (count * (count + 1) / 2, 144) float32
        Blocks of the lower triangle, replaced by the factor.
    out_push : (E, PUSH) float32
        In: the right side. Out: the solution.
    """
    halves = out_push.reshape(2 * out_push.shape[0], PUSH // 2)
    for row in range(count):
        for column in range(row):
            for inner in range(column):
                subtract_block(
                    system[block_of(row, inner)],
                    system[block_of(column, inner)],
                    system[block_of(row, column)],
                )
            divide_block(system[block_of(column, column)], system[block_of(row, column)])
        for inner in range(row):
            subtract_block(
                system[block_of(row, inner)], system[block_of(row, inner)], system[block_of(row, row)]
            )
        part = row % parts * LANES
        factor_block(damping[part : part + LANES], system[block_of(row, row)])
    for row in range(count):
        for column in range(row):
            subtract_lower(
                system[block_of(row, column)], halves[half_of(column, parts)], halves[half_of(row, parts)]
            )
        solve_lower(system[block_of(row, row)], halves[half_of(row, parts)])
    for row in range(count - 1, -1, -1):
        for column in range(row + 1, count):
            subtract_upper(
                system[block_of(column, row)], halves[half_of(column, parts)], halves[half_of(row, parts)]
            )
        solve_upper(system[block_of(row, row)], halves[half_of(row, parts)])
