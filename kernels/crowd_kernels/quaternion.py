"""Rotations as tuples (w, x, y, z), for scalar code inside kernels. Angles in rad; float64.

Arguments named `q`, `a` and `b` are unit quaternions unless stated otherwise; `q` and `-q` are one rotation.
"""

import math

from crowd_kernels._jit import kernel
from crowd_kernels.vector import Vector, add, cross, dot, norm, scaled, subtract

Quaternion = tuple[float, float, float, float]

TINY_SQUARE = 1e-30
SMALL_ANGLE = 1e-8
OPPOSITE = 1e-14


@kernel
def multiply(a: Quaternion, b: Quaternion) -> Quaternion:
    """Compose two rotations: first `b`, then `a`."""
    return (
        a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
        a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
        a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
        a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0],
    )


@kernel
def conjugate(q: Quaternion) -> Quaternion:
    """Invert a rotation."""
    return q[0], -q[1], -q[2], -q[3]


@kernel
def rotate(q: Quaternion, v: Vector) -> Vector:
    """Rotate a vector."""
    tx = q[2] * v[2] - q[3] * v[1]
    ty = q[3] * v[0] - q[1] * v[2]
    tz = q[1] * v[1] - q[2] * v[0]
    # Doubled by sums, which keep the precision of the arguments.
    tx += tx
    ty += ty
    tz += tz
    return (
        v[0] + q[0] * tx + q[2] * tz - q[3] * ty,
        v[1] + q[0] * ty + q[3] * tx - q[1] * tz,
        v[2] + q[0] * tz + q[1] * ty - q[2] * tx,
    )


@kernel
def normalized(q: Quaternion) -> Quaternion:
    """Scale a quaternion of any length to unit length; the zero quaternion becomes the identity."""
    square = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]
    if not square > TINY_SQUARE:
        return 1.0, 0.0, 0.0, 0.0
    scale = 1.0 / math.sqrt(square)
    return q[0] * scale, q[1] * scale, q[2] * scale, q[3] * scale


@kernel
def from_yaw(yaw: float) -> Quaternion:
    """Rotate about +y by `yaw` rad."""
    return math.cos(0.5 * yaw), 0.0, math.sin(0.5 * yaw), 0.0


@kernel
def yaw_of(q: Quaternion) -> float:
    """Find the twist of a rotation about +y, rad in [-pi, pi]; 0 where it has none."""
    sign = 1.0 if q[0] >= 0.0 else -1.0
    return 2.0 * math.atan2(sign * q[2], sign * q[0])


@kernel
def from_axis_angle(axis: Vector, angle: float) -> Quaternion:
    """Rotate about an axis of any nonzero length by `angle` rad; the zero axis gives the identity."""
    length = norm(axis)
    if not length > 0.0:
        return 1.0, 0.0, 0.0, 0.0
    scale = math.sin(0.5 * angle) / length
    return math.cos(0.5 * angle), axis[0] * scale, axis[1] * scale, axis[2] * scale


@kernel
def from_rotation_vector(v: Vector) -> Quaternion:
    """Rotate about the direction of a vector by its length in rad.

    Parameters
    ----------
    v : tuple of float
        Rotation vector, rad.

    Returns
    -------
    tuple of float
        Unit quaternion.

    Notes
    -----
    **Source:** exponential map (Grassia, "Practical parameterization of rotations using the exponential map",
    1998), with the limit at zero.
    """
    angle = norm(v)
    if angle < SMALL_ANGLE:
        return normalized((1.0, 0.5 * v[0], 0.5 * v[1], 0.5 * v[2]))
    scale = math.sin(0.5 * angle) / angle
    return math.cos(0.5 * angle), v[0] * scale, v[1] * scale, v[2] * scale


@kernel
def rotation_vector(q: Quaternion) -> Vector:
    """Find axis times angle of a rotation, the inverse of `from_rotation_vector`.

    Parameters
    ----------
    q : tuple of float
        Unit quaternion of either sign.

    Returns
    -------
    tuple of float
        Rotation vector of length 0 to pi, rad.

    Notes
    -----
    **Source:** logarithmic map, with the arc tangent of half the angle, which is exact for small ones.
    """
    sign = 1.0 if q[0] >= 0.0 else -1.0
    axis = (sign * q[1], sign * q[2], sign * q[3])
    sine = norm(axis)
    if sine < SMALL_ANGLE:
        return scaled(axis, 2.0)
    return scaled(axis, 2.0 * math.atan2(sine, sign * q[0]) / sine)


@kernel
def angular_velocity(v: Vector, rate: Vector) -> Vector:
    """Find how fast a rotation turns whose rotation vector changes.

    Parameters
    ----------
    v : tuple of float
        Rotation vector, at most half a turn, rad.
    rate : tuple of float
        How it changes, rad/s.

    Returns
    -------
    tuple of float
        Angular velocity in the frame around the rotation, rad/s.

    Notes
    -----
    **Source:** the left Jacobian of SO(3); Barfoot, "State estimation for robotics", 2017, equation 7.77.
    """
    angle = norm(v)
    across = cross(v, rate)
    # Limits for small angles; else they are differences of numbers that are nearly the same.
    once, twice = 0.5, 1.0 / 6.0
    if angle > 1e-3:
        once = (1.0 - math.cos(angle)) / (angle * angle)
        twice = (angle - math.sin(angle)) / (angle * angle * angle)
    return add(add(rate, scaled(across, once)), scaled(cross(v, across), twice))


@kernel
def rotation_vector_rate(v: Vector, velocity: Vector) -> Vector:
    """Find how a rotation vector changes as the rotation turns: the inverse of `angular_velocity`.

    Parameters
    ----------
    v : tuple of float
        Rotation vector, at most half a turn, rad.
    velocity : tuple of float
        Angular velocity in the frame around the rotation, rad/s.

    Returns
    -------
    tuple of float
        rad/s.

    Notes
    -----
    **Source:** the inverse of the left Jacobian of SO(3); Barfoot, as above, equation 7.76.
    """
    angle = norm(v)
    half = 0.5 * angle
    share = 1.0 / 12.0 if angle < 1e-3 else (1.0 - half / math.tan(half)) / (angle * angle)
    across = cross(v, velocity)
    return add(subtract(velocity, scaled(across, 0.5)), scaled(cross(v, across), share))


@kernel
def between(a: Vector, b: Vector) -> Quaternion:
    """Find the shortest rotation that takes direction `a` to direction `b`.

    Parameters
    ----------
    a, b : tuple of float
        Vectors of any nonzero length.

    Returns
    -------
    tuple of float
        Unit quaternion; half a turn about some axis across `a` for opposite directions, the identity where a
        length is zero.
    """
    length = math.sqrt(dot(a, a) * dot(b, b))
    w = length + dot(a, b)
    if not w > OPPOSITE * length:
        if abs(a[0]) > abs(a[2]):
            return normalized((0.0, -a[1], a[0], 0.0))
        return normalized((0.0, 0.0, -a[2], a[1]))
    x, y, z = cross(a, b)
    return normalized((w, x, y, z))


@kernel
def from_axes(x: Vector, y: Vector, z: Vector) -> Quaternion:
    """Find the rotation that takes the coordinate axes to three others.

    Parameters
    ----------
    x, y, z : tuple of float
        Unit vectors, right-handed and perpendicular to each other.

    Returns
    -------
    tuple of float
        Unit quaternion.

    Notes
    -----
    **Source:** Shepperd, "Quaternion from rotation matrix", 1978: the largest component is found first.
    """
    trace = x[0] + y[1] + z[2]
    if trace >= max(x[0], y[1], z[2]):
        return normalized((1.0 + trace, y[2] - z[1], z[0] - x[2], x[1] - y[0]))
    if x[0] >= max(y[1], z[2]):
        return normalized((y[2] - z[1], 1.0 + 2.0 * x[0] - trace, x[1] + y[0], z[0] + x[2]))
    if y[1] >= z[2]:
        return normalized((z[0] - x[2], x[1] + y[0], 1.0 + 2.0 * y[1] - trace, y[2] + z[1]))
    return normalized((x[1] - y[0], z[0] + x[2], y[2] + z[1], 1.0 + 2.0 * z[2] - trace))


@kernel
def nlerp(a: Quaternion, b: Quaternion, weight: float) -> Quaternion:
    """Mix two rotations the short way along a chord: `a` at weight 0, `b` at 1.

    Parameters
    ----------
    a, b : tuple of float
    weight : float
        0 to 1.

    Returns
    -------
    tuple of float
        Unit quaternion.
    """
    cosine = a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3]
    other = weight if cosine >= 0.0 else -weight
    own = 1.0 - weight
    return normalized(
        (
            own * a[0] + other * b[0],
            own * a[1] + other * b[1],
            own * a[2] + other * b[2],
            own * a[3] + other * b[3],
        )
    )


@kernel
def slerp(a: Quaternion, b: Quaternion, weight: float) -> Quaternion:
    """Mix two rotations the short way at constant angular velocity: `a` at weight 0, `b` at 1.

    Parameters
    ----------
    a, b : tuple of float
    weight : float
        0 to 1; values outside go on along the same great circle.

    Returns
    -------
    tuple of float
        Unit quaternion.

    Notes
    -----
    **Source:** Shoemake, "Animating rotation with quaternion curves", 1985.
    **Differs from the source:** written as a share of the rotation vector, which is exact for small angles.
    """
    way = rotation_vector(multiply(b, conjugate(a)))
    return multiply(from_rotation_vector(scaled(way, weight)), a)


@kernel
def swing_twist_y(q: Quaternion) -> tuple[Quaternion, Quaternion]:
    """Split a rotation into a twist about +y and the swing that follows it.

    Parameters
    ----------
    q : tuple of float
        Unit quaternion.

    Returns
    -------
    swing : tuple of float
        Rotation about a horizontal axis.
    twist : tuple of float
        Rotation about +y by `yaw_of(q)`; `multiply(swing, twist)` is `q`. The identity where the y axis is
        turned upside down and the twist is not determined.

    Notes
    -----
    **Source:** Dobrowolski, "Swing-twist decomposition in Clifford algebra", 2015.
    """
    sign = 1.0 if q[0] >= 0.0 else -1.0
    twist = normalized((sign * q[0], 0.0, sign * q[2], 0.0))
    return multiply(q, conjugate(twist)), twist
