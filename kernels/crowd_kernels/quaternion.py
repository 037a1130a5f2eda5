"""Quaternions (w, x, y, z) and vectors as tuples, for scalar code inside kernels."""

import math

from crowd_kernels._jit import kernel

Quaternion = tuple[float, float, float, float]
Vector = tuple[float, float, float]


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
    """Invert a unit rotation."""
    return q[0], -q[1], -q[2], -q[3]


@kernel
def rotate(q: Quaternion, v: Vector) -> Vector:
    """Rotate a vector by a unit quaternion."""
    tx = 2.0 * (q[2] * v[2] - q[3] * v[1])
    ty = 2.0 * (q[3] * v[0] - q[1] * v[2])
    tz = 2.0 * (q[1] * v[1] - q[2] * v[0])
    return (
        v[0] + q[0] * tx + q[2] * tz - q[3] * ty,
        v[1] + q[0] * ty + q[3] * tx - q[1] * tz,
        v[2] + q[0] * tz + q[1] * ty - q[2] * tx,
    )


@kernel
def normalized(q: Quaternion) -> Quaternion:
    """Scale to unit length; the zero quaternion becomes the identity."""
    square = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]
    if not square > 1e-30:
        return 1.0, 0.0, 0.0, 0.0
    scale = 1.0 / math.sqrt(square)
    return q[0] * scale, q[1] * scale, q[2] * scale, q[3] * scale


@kernel
def from_yaw(yaw: float) -> Quaternion:
    """Rotate about +y by `yaw` rad."""
    return math.cos(0.5 * yaw), 0.0, math.sin(0.5 * yaw), 0.0


@kernel
def yaw_of(q: Quaternion) -> float:
    """Find the twist of a rotation about +y, rad in (-pi, pi]."""
    sign = 1.0 if q[0] >= 0.0 else -1.0
    return 2.0 * math.atan2(sign * q[2], sign * q[0])


@kernel
def between(a: Vector, b: Vector) -> Quaternion:
    """Find the shortest rotation that takes direction `a` to direction `b`; both of any nonzero length."""
    length = math.sqrt((a[0] * a[0] + a[1] * a[1] + a[2] * a[2]) * (b[0] * b[0] + b[1] * b[1] + b[2] * b[2]))
    w = length + a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
    if not w > 1e-9 * length:
        # Opposite directions: half a turn about any axis across `a`.
        if abs(a[0]) > abs(a[2]):
            return normalized((0.0, -a[1], a[0], 0.0))
        return normalized((0.0, 0.0, -a[2], a[1]))
    return normalized((w, a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]))


@kernel
def nlerp(a: Quaternion, b: Quaternion, weight: float) -> Quaternion:
    """Mix two rotations the short way: `a` at weight 0, `b` at 1."""
    dot = a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3]
    other = weight if dot >= 0.0 else -weight
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
def add(a: Vector, b: Vector) -> Vector:
    """Add two vectors."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@kernel
def subtract(a: Vector, b: Vector) -> Vector:
    """Subtract `b` from `a`."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@kernel
def scaled(a: Vector, factor: float) -> Vector:
    """Multiply a vector by a number."""
    return a[0] * factor, a[1] * factor, a[2] * factor


@kernel
def dot(a: Vector, b: Vector) -> float:
    """Find the scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@kernel
def cross(a: Vector, b: Vector) -> Vector:
    """Find the vector product."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@kernel
def norm(a: Vector) -> float:
    """Find the length."""
    return math.sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2])
