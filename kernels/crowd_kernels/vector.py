"""Vectors as tuples (x, y, z), for scalar code inside kernels. Any unit; float64."""

import math

from crowd_kernels._jit import kernel

Vector = tuple[float, float, float]


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


@kernel
def unit(a: Vector) -> Vector:
    """Scale to length 1; a vector shorter than 1e-150 becomes the zero vector."""
    length = norm(a)
    if length < 1e-150:
        return 0.0, 0.0, 0.0
    return a[0] / length, a[1] / length, a[2] / length
