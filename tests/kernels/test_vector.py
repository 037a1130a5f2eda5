"""Vectors as tuples against NumPy."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from crowd_kernels import vector as kernels

number = st.floats(-1e3, 1e3)
vectors = st.tuples(number, number, number)


@given(vectors, vectors, number)
def test_sums_and_products(a, b, factor):
    np.testing.assert_array_equal(kernels.add(a, b), np.add(a, b))
    np.testing.assert_array_equal(kernels.subtract(a, b), np.subtract(a, b))
    np.testing.assert_array_equal(kernels.scaled(a, factor), np.multiply(a, factor))
    assert kernels.dot(a, b) == pytest.approx(np.dot(a, b), abs=1e-9)
    np.testing.assert_allclose(kernels.cross(a, b), np.cross(a, b), atol=1e-9)


@given(vectors)
def test_unit_has_length_one_and_the_same_direction(a):
    length = kernels.norm(a)
    assert length == pytest.approx(np.linalg.norm(a), abs=1e-12)
    if length > 1e-100:
        assert kernels.norm(kernels.unit(a)) == pytest.approx(1, abs=1e-12)
        np.testing.assert_allclose(np.multiply(kernels.unit(a), length), a, atol=1e-9)


def test_unit_of_nothing_is_nothing():
    assert kernels.unit((0.0, 0.0, 0.0)) == (0.0, 0.0, 0.0)
