"""Rotations as unit quaternions (w, x, y, z) that take body coordinates to world coordinates.

First the compiled helpers for kernels, then the same algebra on numpy arrays, over any leading axes. With q = (c, u):
    q v q* = v + 2 c u x v + 2 u x (u x v),        exp(r) = (cos |r|/2, sin(|r|/2) r/|r|)
Sources: J. Diebel, Representing attitude, Stanford 2006; matrix to quaternion: S. Shepperd, J. Guid. Control 1, 1978.
"""

import math

import numpy as np
from numpy.typing import ArrayLike

from rigidimpulse.core.kernels import jit
from rigidimpulse.core.portable import arctangent2, cosine, sine
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.core.vector import cross_arrays

_SMALL_ANGLE = TOLERANCES.rotation.small_angle


# -- compiled: scalars in, tuples out ---------------------------------------------------------------------------------


@jit
def product(a0, a1, a2, a3, b0, b1, b2, b3):
    """The quaternion a b: first b, then a."""
    return (
        a0 * b0 - a1 * b1 - a2 * b2 - a3 * b3,
        a0 * b1 + a1 * b0 + a2 * b3 - a3 * b2,
        a0 * b2 + a2 * b0 + a3 * b1 - a1 * b3,
        a0 * b3 + a3 * b0 + a1 * b2 - a2 * b1,
    )


@jit
def rotated(q0, q1, q2, q3, x, y, z):
    """The vector (x, y, z) turned by the unit quaternion q."""
    tx = 2.0 * (q2 * z - q3 * y)
    ty = 2.0 * (q3 * x - q1 * z)
    tz = 2.0 * (q1 * y - q2 * x)
    return (
        x + q0 * tx + (q2 * tz - q3 * ty),
        y + q0 * ty + (q3 * tx - q1 * tz),
        z + q0 * tz + (q1 * ty - q2 * tx),
    )


@jit
def exponential(x, y, z):
    """The quaternion of the rotation by the vector (x, y, z), rad; its sign follows the vector continuously."""
    angle = math.sqrt(x * x + y * y + z * z)
    if angle < _SMALL_ANGLE:
        factor = 0.5 - angle * angle / 48.0
    else:
        factor = math.sin(0.5 * angle) / angle
    return math.cos(0.5 * angle), factor * x, factor * y, factor * z


@jit
def from_columns(x, y, z):
    """The unit quaternion, first component >= 0, of the rotation matrix with the columns x, y and z, each of three numbers."""
    r00, r10, r20 = x
    r01, r11, r21 = y
    r02, r12, r22 = z
    trace = r00 + r11 + r22
    if trace >= max(r00, r11, r22):
        q0, q1, q2, q3 = 1.0 + trace, r21 - r12, r02 - r20, r10 - r01
    elif r00 >= max(r11, r22):
        q0, q1, q2, q3 = r21 - r12, 1.0 + r00 - r11 - r22, r10 + r01, r02 + r20
    elif r11 >= r22:
        q0, q1, q2, q3 = r02 - r20, r10 + r01, 1.0 + r11 - r22 - r00, r21 + r12
    else:
        q0, q1, q2, q3 = r10 - r01, r02 + r20, r21 + r12, 1.0 + r22 - r00 - r11
    scale = 1.0 / math.sqrt(q0 * q0 + q1 * q1 + q2 * q2 + q3 * q3)
    if q0 < 0.0:
        scale = -scale
    return scale * q0, scale * q1, scale * q2, scale * q3


# -- compiled: on arrays ----------------------------------------------------------------------------------------------


@jit
def quaternion_to_matrix(q, R_out):
    """Write the matrix (3, 3) of the unit quaternion q (4,): its columns are the body axes in the world."""
    w, x, y, z = q[0], q[1], q[2], q[3]
    R_out[0, 0] = 1.0 - 2.0 * (y * y + z * z)
    R_out[0, 1] = 2.0 * (x * y - w * z)
    R_out[0, 2] = 2.0 * (x * z + w * y)
    R_out[1, 0] = 2.0 * (x * y + w * z)
    R_out[1, 1] = 1.0 - 2.0 * (x * x + z * z)
    R_out[1, 2] = 2.0 * (y * z - w * x)
    R_out[2, 0] = 2.0 * (x * z - w * y)
    R_out[2, 1] = 2.0 * (y * z + w * x)
    R_out[2, 2] = 1.0 - 2.0 * (x * x + y * y)


# -- numpy, over leading axes -----------------------------------------------------------------------------------------


def conjugate(q: ArrayLike) -> np.ndarray:
    """The inverse rotations of unit quaternions (..., 4)."""
    return np.asarray(q, dtype=float) * np.array([1.0, -1.0, -1.0, -1.0])


def normalize(q: ArrayLike) -> np.ndarray:
    """Quaternions (..., 4) scaled to unit length. Raises ValueError where the length is zero or not finite."""
    q = np.asarray(q, dtype=float)
    # Divided by the largest component first, so that no square over- or underflows.
    largest = np.max(np.abs(q), axis=-1, keepdims=True)
    if not (np.all(np.isfinite(largest)) and np.all(largest > 0.0)):
        raise ValueError("a quaternion must be finite and not zero")
    q = q / largest
    return q / np.linalg.norm(q, axis=-1, keepdims=True)


def multiply(a: ArrayLike, b: ArrayLike) -> np.ndarray:
    """Quaternions a b (..., 4): first b, then a."""
    a, b = np.asarray(a, dtype=float), np.asarray(b, dtype=float)
    scalar = a[..., :1] * b[..., :1] - np.sum(a[..., 1:] * b[..., 1:], axis=-1, keepdims=True)
    vector = a[..., :1] * b[..., 1:] + b[..., :1] * a[..., 1:] + cross_arrays(a[..., 1:], b[..., 1:])
    return np.concatenate([scalar, vector], axis=-1)


def rotate(q: ArrayLike, v: ArrayLike) -> np.ndarray:
    """Vectors v (..., 3) turned by unit quaternions q (..., 4): body to world."""
    q, v = np.asarray(q, dtype=float), np.asarray(v, dtype=float)
    u = q[..., 1:]
    twice = 2.0 * cross_arrays(u, v)
    return v + q[..., :1] * twice + cross_arrays(u, twice)


def rotate_inverse(q: ArrayLike, v: ArrayLike) -> np.ndarray:
    """Vectors v (..., 3) turned back by unit quaternions q (..., 4): world to body."""
    return rotate(conjugate(q), v)


def quaternion_from_axis_angle(axis: ArrayLike, angle: ArrayLike) -> np.ndarray:
    """Quaternions (..., 4) of rotations by `angle` (...) rad about `axis` (..., 3).

    The axis need not have unit length. Raises ValueError where it is zero or not finite.
    """
    axis = np.asarray(axis, dtype=float)
    half = 0.5 * np.asarray(angle, dtype=float)[..., None]
    length = np.linalg.norm(axis, axis=-1, keepdims=True)
    if not (np.all(np.isfinite(length)) and np.all(length > 0.0)):
        raise ValueError("the axis of a rotation must be finite and not zero")
    vector = sine(half) * (axis / length)
    return np.concatenate([np.broadcast_to(cosine(half), (*vector.shape[:-1], 1)), vector], axis=-1)


def quaternion_from_rotation_vector(vector: ArrayLike) -> np.ndarray:
    """Quaternions (..., 4) of rotations by vectors (..., 3): the angle in rad times the unit axis."""
    vector = np.asarray(vector, dtype=float)
    half = 0.5 * np.linalg.norm(vector, axis=-1, keepdims=True)
    # The limit of sin(half) / half at no rotation is 1.
    factor = np.divide(sine(half), half, out=np.ones_like(half), where=half > 0.0)
    return np.concatenate([cosine(half), 0.5 * factor * vector], axis=-1)


def rotation_vector(q: ArrayLike) -> np.ndarray:
    """Rotation vectors (..., 3), rad, length at most pi, of unit quaternions (..., 4)."""
    q = np.asarray(q, dtype=float)
    q = np.where(q[..., :1] < 0.0, -q, q)
    size = np.linalg.norm(q[..., 1:], axis=-1, keepdims=True)
    angle = 2.0 * arctangent2(size, q[..., :1])
    # The limit of angle / sine at no rotation is 2.
    factor = np.divide(angle, size, out=np.full_like(size, 2.0), where=size > 0.0)
    return factor * q[..., 1:]


def to_matrix(q: ArrayLike) -> np.ndarray:
    """Matrices (..., 3, 3) of unit quaternions (..., 4): columns are the body axes in the world."""
    q = np.asarray(q, dtype=float)
    return np.stack([rotate(q, axis) for axis in np.eye(3)], axis=-1)


def from_matrix(R: ArrayLike) -> np.ndarray:
    """Unit quaternions (..., 4), first component >= 0, of rotation matrices (..., 3, 3)."""
    R = np.asarray(R, dtype=float)
    trace = np.trace(R, axis1=-2, axis2=-1)[..., None, None]
    # The symmetric matrix 4 q q^T; its row with the largest diagonal gives q without cancellation.
    outer = np.empty((*R.shape[:-2], 4, 4))
    outer[..., 1:, 1:] = R + np.swapaxes(R, -1, -2) + (1.0 - trace) * np.eye(3)
    outer[..., 0, 0] = 1.0 + trace[..., 0, 0]
    for k in range(3):
        i, j = (k + 1) % 3, (k + 2) % 3
        outer[..., 0, k + 1] = outer[..., k + 1, 0] = R[..., j, i] - R[..., i, j]
    largest = np.argmax(np.diagonal(outer, axis1=-2, axis2=-1), axis=-1)
    q = np.take_along_axis(outer, largest[..., None, None], axis=-2)[..., 0, :]
    return normalize(np.where(q[..., :1] < 0.0, -q, q))


def angle_between(q_a: ArrayLike, q_b: ArrayLike) -> np.ndarray:
    """Angles (...) in rad, from 0 to pi, between orientations (..., 4); exact to round-off for tiny angles too."""
    difference = multiply(conjugate(q_a), q_b)
    return 2.0 * arctangent2(np.linalg.norm(difference[..., 1:], axis=-1), np.abs(difference[..., 0]))


def quaternion_continuity(q: ArrayLike) -> np.ndarray:
    """The same orientations (f, 4) with signs chosen so that neighbours in time are near; the first is kept."""
    q = np.array(q, dtype=float)
    if len(q) > 1:
        turned = np.einsum("fk,fk->f", q[:-1], q[1:]) < 0.0
        q[1:][np.cumsum(turned) % 2 == 1] *= -1.0
    return q
