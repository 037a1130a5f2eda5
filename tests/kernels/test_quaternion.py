"""Quaternions against rotation matrices, also where they are delicate: no angle, half turns, both signs."""

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from crowd_kernels import quaternion as kernels
from tests.oracles import quaternion as oracle

IDENTITY = (1.0, 0.0, 0.0, 0.0)
HALF_TURNS = [(0.0, 1.0, 0.0, 0.0), (0.0, 0.0, 1.0, 0.0), (0.0, 0.0, 0.0, -1.0), (0.0, 0.6, 0.0, 0.8)]
number = st.floats(-10, 10, allow_subnormal=False)
vectors = st.tuples(number, number, number)
shares = st.floats(0, 1)
angles = st.floats(-math.pi, math.pi)


def unit(values):
    length = math.sqrt(sum(value * value for value in values))
    return tuple(value / length for value in values)


quaternions = (
    st.tuples(number, number, number, number).filter(lambda q: math.hypot(*q) > 1e-3).map(unit)
    | st.sampled_from([IDENTITY, (-1.0, 0.0, 0.0, 0.0), *HALF_TURNS])
    | st.builds(lambda tiny: unit((1.0, tiny, -tiny, 2 * tiny)), st.floats(1e-14, 1e-4))
)


def close(got, wanted, tolerance=1e-9):
    """The two quaternions are the same rotation."""
    return oracle.angle(oracle.matrix(got), oracle.matrix(wanted)) < tolerance


def distance(a, b):
    return np.linalg.norm(np.subtract(a, b))


@given(quaternions, quaternions)
def test_product_is_the_product_of_matrices(a, b):
    got = oracle.matrix(kernels.multiply(a, b))
    np.testing.assert_allclose(got, oracle.matrix(a) @ oracle.matrix(b), atol=1e-12)


@given(quaternions, vectors)
def test_rotate_multiplies_by_the_matrix_and_conjugate_undoes_it(q, v):
    turned = kernels.rotate(q, v)
    np.testing.assert_allclose(turned, oracle.matrix(q) @ v, atol=1e-12)
    np.testing.assert_allclose(kernels.rotate(kernels.conjugate(q), turned), v, atol=1e-12)


@given(vectors)
def test_rotation_vector_is_the_matrix_exponential(v):
    q = kernels.from_rotation_vector(v)
    assert math.hypot(*q) == pytest.approx(1, abs=1e-12)
    np.testing.assert_allclose(oracle.matrix(q), oracle.rotation_matrix(v), atol=1e-10)


@given(quaternions)
def test_rotation_vector_is_the_shortest_way_there(q):
    v = kernels.rotation_vector(q)
    assert np.linalg.norm(v) <= math.pi + 1e-12
    np.testing.assert_allclose(oracle.rotation_matrix(v), oracle.matrix(q), atol=1e-10)
    assert kernels.rotation_vector(tuple(-c for c in q)) == pytest.approx(v) or math.isclose(
        np.linalg.norm(v), math.pi
    )


@pytest.mark.parametrize("size", [0.0, 1e-12, 1e-9, 1e-8, 1e-7, 1e-4])
def test_small_rotation_vectors_keep_all_digits(size):
    v = (size, -2 * size, 0.5 * size)
    assert kernels.rotation_vector(kernels.from_rotation_vector(v)) == pytest.approx(v, rel=1e-12, abs=0)


@given(vectors, angles)
def test_axis_and_angle(axis, angle):
    assume(math.hypot(*axis) > 1e-3)
    wanted = oracle.rotation_matrix(np.multiply(unit(axis), angle))
    np.testing.assert_allclose(oracle.matrix(kernels.from_axis_angle(axis, angle)), wanted, atol=1e-10)


def test_no_axis_means_no_rotation():
    assert kernels.from_axis_angle((0.0, 0.0, 0.0), 1.0) == IDENTITY
    assert kernels.normalized((0.0, 0.0, 0.0, 0.0)) == IDENTITY


@given(angles)
def test_positive_yaw_turns_from_ahead_to_the_left(yaw):
    facing = kernels.rotate(kernels.from_yaw(yaw), (0.0, 0.0, 1.0))
    np.testing.assert_allclose(facing, (math.sin(yaw), 0, math.cos(yaw)), atol=1e-12)
    assert kernels.yaw_of(kernels.from_yaw(yaw)) == pytest.approx(yaw, abs=1e-9)


@given(quaternions)
def test_yaw_does_not_depend_on_the_sign_and_is_at_most_half_a_turn(q):
    assume(math.hypot(q[0], q[2]) > 1e-6 and abs(q[0]) > 1e-9)
    yaw = kernels.yaw_of(q)
    assert abs(yaw) <= math.pi
    assert kernels.yaw_of(tuple(-c for c in q)) == pytest.approx(yaw, abs=1e-12)


@given(quaternions)
def test_swing_after_twist_is_the_rotation(q):
    swing, twist = kernels.swing_twist_y(q)
    assert close(kernels.multiply(swing, twist), q)
    np.testing.assert_allclose(kernels.rotate(twist, (0.0, 1.0, 0.0)), (0, 1, 0), atol=1e-12)
    if math.hypot(q[0], q[2]) > 1e-6:
        assert swing[2] == pytest.approx(0, abs=1e-9)
        assert close(twist, kernels.from_yaw(kernels.yaw_of(q)))


def test_upside_down_has_no_twist():
    swing, twist = kernels.swing_twist_y((0.0, 0.6, 0.0, 0.8))
    assert twist == IDENTITY
    assert swing == (0.0, 0.6, 0.0, 0.8)


@given(vectors, vectors)
def test_between_turns_one_direction_to_the_other_by_their_angle(a, b):
    assume(min(math.hypot(*a), math.hypot(*b)) > 1e-2)
    a_unit, b_unit = unit(a), unit(b)
    q = kernels.between(a, b)
    np.testing.assert_allclose(kernels.rotate(q, a_unit), b_unit, atol=1e-6)
    angle = 2 * math.atan2(distance(a_unit, b_unit), distance(a_unit, np.negative(b_unit)))
    assert np.linalg.norm(kernels.rotation_vector(q)) == pytest.approx(angle, abs=1e-6)


@pytest.mark.parametrize("a", [(1.0, 0.0, 0.0), (0.0, 2.0, 0.0), (0.0, 0.0, -3.0), (1.0, 1.0, 1.0)])
def test_between_opposite_directions_is_half_a_turn(a):
    q = kernels.between(a, tuple(-c for c in a))
    np.testing.assert_allclose(kernels.rotate(q, a), np.negative(a), atol=1e-12)


@pytest.mark.parametrize("gap", [1e-2, 1e-4, 1e-6, 1e-8])
def test_between_nearly_opposite_directions_still_meets_the_other(gap):
    a, b = (0.0, 0.0, 2.0), (math.sin(gap), 0.0, -math.cos(gap))
    np.testing.assert_allclose(kernels.rotate(kernels.between(a, b), unit(a)), b, atol=1e-6)


def test_between_nothing_is_no_rotation():
    assert kernels.between((0.0, 0.0, 0.0), (1.0, 0.0, 0.0)) == IDENTITY


@given(quaternions, quaternions, shares)
def test_slerp_divides_the_angle(a, b, share):
    whole = oracle.angle(oracle.matrix(a), oracle.matrix(b))
    assume(whole < math.pi - 1e-3)
    mixed = oracle.matrix(kernels.slerp(a, b, share))
    assert oracle.angle(oracle.matrix(a), mixed) == pytest.approx(share * whole, abs=1e-7)
    assert oracle.angle(mixed, oracle.matrix(b)) == pytest.approx((1 - share) * whole, abs=1e-7)


@given(quaternions, quaternions, shares)
def test_nlerp_stays_on_the_way_of_slerp(a, b, share):
    whole = oracle.angle(oracle.matrix(a), oracle.matrix(b))
    assume(whole < 2.0)
    mixed = kernels.nlerp(a, b, share)
    assert math.hypot(*mixed) == pytest.approx(1, abs=1e-12)
    parts = [oracle.angle(oracle.matrix(end), oracle.matrix(mixed)) for end in (a, b)]
    assert sum(parts) == pytest.approx(whole, abs=1e-7)
    # A chord is passed at uneven speed: at 2 rad it is at most 0.06 of the way off.
    assert parts[0] == pytest.approx(share * whole, abs=0.06 * whole + 1e-7)


@pytest.mark.parametrize("mix", [kernels.nlerp, kernels.slerp])
@given(a=quaternions, b=quaternions)
def test_mixing_starts_at_one_and_ends_at_the_other(mix, a, b):
    assert close(mix(a, b, 0.0), a, 1e-7)
    assert close(mix(a, b, 1.0), b, 1e-7)


@given(quaternions)
def test_axes_are_turned_back_into_their_rotation(q):
    axes = [tuple(column) for column in oracle.matrix(q).T]
    assert abs(np.dot(kernels.from_axes(*axes), q)) == pytest.approx(1, abs=1e-12)


turns = st.tuples(number, number, number).map(lambda v: tuple(np.multiply(v, 0.9 * math.pi / 20.0)))


@given(v=turns, rate=st.tuples(number, number, number))
def test_angular_velocity_is_that_of_the_rotation_whose_vector_changes(v, rate):
    wanted = oracle.angular_velocity(v, rate)
    np.testing.assert_allclose(kernels.angular_velocity(v, rate), wanted, atol=1e-5)


@given(
    v=turns | st.just((0.0, 0.0, 0.0)) | st.just((1e-4, 0.0, -1e-4)), rate=st.tuples(number, number, number)
)
def test_rates_of_rotation_vectors_and_angular_velocities_are_inverse(v, rate):
    velocity = kernels.angular_velocity(v, rate)
    np.testing.assert_allclose(kernels.rotation_vector_rate(v, velocity), rate, atol=1e-6)
