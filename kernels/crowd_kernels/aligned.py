"""Arrays that begin at a cache line.

Kernels read and write rows of 16 numbers, one vector register of 64 bytes. NumPy begins an array at any
multiple of 16 bytes; then every such access touches two cache lines, and row leaves take up to 1.4 times as
long. Kernels take any array, and give equal bits.
"""

import math
from typing import Any

import numpy as np
import numpy.typing as npt

CACHE_LINE = 64
"""Bytes."""


def aligned_zeros(shape: int | tuple[int, ...], dtype: npt.DTypeLike = np.float64) -> npt.NDArray[Any]:
    """Make an array of zeros that begins at a cache line.

    Parameters
    ----------
    shape : int or tuple of int
    dtype : dtype-like, optional
        Plain numbers or bool; float64 when left out.

    Returns
    -------
    ndarray
        C-contiguous. Its rows begin at cache lines too where they are multiples of 64 bytes long.
    """
    kind = np.dtype(dtype)
    length = math.prod(shape) if isinstance(shape, tuple) else shape
    room = np.zeros(length * kind.itemsize + CACHE_LINE, np.uint8)
    begin = -room.ctypes.data % CACHE_LINE
    return room[begin : begin + length * kind.itemsize].view(kind).reshape(shape)


def aligned_full(
    shape: int | tuple[int, ...], fill: float, dtype: npt.DTypeLike = np.float64
) -> npt.NDArray[Any]:
    """Make an array of one value that begins at a cache line; see `aligned_zeros`."""
    array = aligned_zeros(shape, dtype)
    if fill:
        array.fill(fill)
    return array


def aligned_copy(array: npt.NDArray[Any], dtype: npt.DTypeLike | None = None) -> npt.NDArray[Any]:
    """Copy an array to one that begins at a cache line, optionally as another type; see `aligned_zeros`."""
    copy = aligned_zeros(array.shape, array.dtype if dtype is None else dtype)
    copy[...] = array
    return copy
