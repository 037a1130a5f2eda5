"""Quaternions (w, x, y, z) as arrays, for everything that is prepared before a run."""

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

FloatArray = npt.NDArray[np.float64]


def multiply(first: FloatArray, second: FloatArray) -> FloatArray:
    """Compose rotations (..., 4): `second`, then `first`."""
    a, b = np.broadcast_arrays(first, second)
    w, x, y, z = np.moveaxis(a, -1, 0)
    v, p, q, r = np.moveaxis(b, -1, 0)
    return np.stack(
        [
            w * v - x * p - y * q - z * r,
            w * p + x * v + y * r - z * q,
            w * q - x * r + y * v + z * p,
            w * r + x * q - y * p + z * v,
        ],
        axis=-1,
    )


def conjugate(rotation: FloatArray) -> FloatArray:
    """Invert unit rotations (..., 4)."""
    return np.asarray(rotation * np.array([1.0, -1.0, -1.0, -1.0]))


def rotate(rotation: FloatArray, vector: npt.ArrayLike) -> FloatArray:
    """Rotate vectors (..., 3) by unit quaternions (..., 4)."""
    axis, start = rotation[..., 1:], np.asarray(vector, dtype=np.float64)
    twice = 2.0 * _cross(axis, start)
    return np.asarray(start + rotation[..., :1] * twice + _cross(axis, twice))


def _cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """Cross product of vectors (..., 3), with the bits of `numpy.cross` and a third of its time for few."""
    a_x, a_y, a_z = a[..., 0], a[..., 1], a[..., 2]
    b_x, b_y, b_z = b[..., 0], b[..., 1], b[..., 2]
    return np.stack([a_y * b_z - a_z * b_y, a_z * b_x - a_x * b_z, a_x * b_y - a_y * b_x], axis=-1)


def about(axis: int, angle: npt.ArrayLike) -> FloatArray:
    """Rotate about x (0), y (1) or z (2) by angles (...) in rad; gives (..., 4)."""
    half = 0.5 * np.asarray(angle, dtype=np.float64)
    rotation = np.zeros((*half.shape, 4))
    rotation[..., 0] = np.cos(half)
    rotation[..., 1 + axis] = np.sin(half)
    return rotation


def yaw_of(rotation: FloatArray) -> FloatArray:
    """Twist of rotations (..., 4) about +y, rad in (-pi, pi]."""
    sign = np.where(rotation[..., 0] < 0.0, -1.0, 1.0)
    return np.asarray(2.0 * np.arctan2(sign * rotation[..., 2], sign * rotation[..., 0]))


def from_axes(x: FloatArray, y: FloatArray, z: FloatArray) -> FloatArray:
    """Rotation whose columns are three unit axes (F, 3)."""
    return np.asarray(Rotation.from_matrix(np.stack([x, y, z], axis=-1)).as_quat()[..., [3, 0, 1, 2]])


def continuous(rotation: FloatArray) -> FloatArray:
    """Choose the signs of (F, J, 4) quaternions so that they change continuously over frames."""
    dots = np.einsum("fjc,fjc->fj", rotation[1:], rotation[:-1])
    sign = np.cumprod(np.where(dots < 0.0, -1.0, 1.0), axis=0)
    result = rotation.copy()
    result[1:] *= sign[..., None]
    return result


def slerp(first: FloatArray, second: FloatArray, share: npt.ArrayLike) -> FloatArray:
    """Turn from rotations (..., 4) towards others by a share (...), the short way round."""
    step = to_vector(multiply(conjugate(first), second))
    return multiply(first, from_vector(step * np.asarray(share, np.float64)[..., None]))


def to_vector(rotation: FloatArray) -> FloatArray:
    """Rotation vectors (..., 3), rad, of unit quaternions (..., 4); at most half a turn."""
    sign = np.where(rotation[..., :1] < 0.0, -1.0, 1.0)
    axis, cosine = sign * rotation[..., 1:], np.abs(rotation[..., 0])
    sine = np.linalg.norm(axis, axis=-1)
    angle = 2.0 * np.arctan2(sine, cosine)
    return np.asarray(axis * np.where(sine > 1e-12, angle / np.maximum(sine, 1e-12), 2.0)[..., None])


def from_vector(vector: FloatArray) -> FloatArray:
    """Unit quaternions (..., 4) of rotation vectors (..., 3), rad."""
    angle = np.linalg.norm(vector, axis=-1, keepdims=True)
    return np.concatenate([np.cos(0.5 * angle), vector * 0.5 * np.sinc(angle / (2.0 * np.pi))], axis=-1)


def swing(start: npt.ArrayLike, end: npt.ArrayLike) -> FloatArray:
    """Smallest rotation (..., 4) that takes the direction of vectors (..., 3) to that of others."""
    a, b = np.asarray(start, np.float64), np.asarray(end, np.float64)
    a = a / np.linalg.norm(a, axis=-1, keepdims=True)
    b = b / np.linalg.norm(b, axis=-1, keepdims=True)
    cosine = (a * b).sum(axis=-1, keepdims=True)
    axis = np.cross(a, b)
    # Opposite directions: any axis across will do.
    spare = np.cross(a, np.where(np.abs(a[..., :1]) < 0.9, [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]))
    rotation = np.concatenate([1.0 + cosine, np.where(cosine < -1.0 + 1e-9, spare, axis)], axis=-1)
    rotation[..., :1] = np.where(cosine < -1.0 + 1e-9, 0.0, rotation[..., :1])
    return np.asarray(rotation / np.linalg.norm(rotation, axis=-1, keepdims=True))
