"""Arrays for kernels begin at cache lines."""

import numpy as np
import pytest

from crowd.state import State
from crowd_kernels.aligned import CACHE_LINE, aligned_copy, aligned_full, aligned_zeros


@pytest.mark.parametrize("dtype", [np.float64, np.float32, np.int32, np.uint8, np.bool_])
@pytest.mark.parametrize("shape", [0, 1, 7, (3, 5), (0, 4), (1000, 3)])
def test_arrays_are_plain_and_begin_at_a_cache_line(shape, dtype):
    for array in (aligned_zeros(shape, dtype), aligned_full(shape, 1, dtype)):
        assert array.size == 0 or array.ctypes.data % CACHE_LINE == 0
        assert array.shape == np.zeros(shape).shape
        assert array.dtype == dtype
        assert array.flags.c_contiguous
        assert array.flags.writeable
    assert not aligned_zeros(shape, dtype).any()
    assert (aligned_full(shape, 1, dtype) == 1).all()


def test_arrays_are_float64_unless_told():
    assert aligned_zeros(3).dtype == aligned_full(3, np.nan).dtype == np.float64
    assert np.isnan(aligned_full(3, np.nan)).all()


def test_copies_keep_values_and_share_nothing(rng):
    values = rng.normal(size=(9, 6))[:, ::2]
    copy = aligned_copy(values, np.float32)
    np.testing.assert_array_equal(copy, values.astype(np.float32))
    assert copy.ctypes.data % CACHE_LINE == 0
    copy[0, 0] = 99
    assert values[0, 0] != 99
    assert aligned_copy(values).dtype == np.float64


def test_arrays_stay_apart():
    arrays = [aligned_zeros(33, np.float32) for _ in range(20)]
    for number, array in enumerate(arrays):
        array[:] = number
    assert all((array == number).all() for number, array in enumerate(arrays))


def test_everything_that_changes_in_a_run_begins_at_a_cache_line():
    for name, array in State.create(37).arrays():
        assert array.ctypes.data % CACHE_LINE == 0, name
