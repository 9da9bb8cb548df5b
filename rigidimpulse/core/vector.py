"""Vectors and matrices of three dimensions: the one library of them.

First come the kernels. Most take vectors as tuples of three floats or as arrays (3,), and return tuples: nothing is allocated. Those that
write into an array take it as their last argument. Then come functions on numpy arrays, over any leading axes.

The order of the additions is fixed: it decides the last bits of every run.
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from rigidimpulse.core.kernels import inlined, jit

# -- compiled: tuples of three floats ----------------------------------------------------------------------------------


@jit
def dot(a, b):
    """Return a . b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@jit
def cross(a, b):
    """Return a x b."""
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


@jit
def along(a, s, b):
    """Return a + s b."""
    return (a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2])


@jit
def subtract(a, b):
    """Return a - b."""
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


@jit
def scaled(a, factor):
    """Return a times a number."""
    return a[0] * factor, a[1] * factor, a[2] * factor


@jit
def length(a):
    """Return |a|."""
    return sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2])


@jit
def row(array, i):
    """Return row `i` of an array (k, 3) as a tuple."""
    return (array[i, 0], array[i, 1], array[i, 2])


# -- compiled: matrices and frames -------------------------------------------------------------------------------------


@jit
def turned(R, v):
    """Return R v."""
    return (
        R[0, 0] * v[0] + R[0, 1] * v[1] + R[0, 2] * v[2],
        R[1, 0] * v[0] + R[1, 1] * v[1] + R[1, 2] * v[2],
        R[2, 0] * v[0] + R[2, 1] * v[1] + R[2, 2] * v[2],
    )


@jit
def turned_back(R, v):
    """Return R^T v."""
    return (
        R[0, 0] * v[0] + R[1, 0] * v[1] + R[2, 0] * v[2],
        R[0, 1] * v[0] + R[1, 1] * v[1] + R[2, 1] * v[2],
        R[0, 2] * v[0] + R[1, 2] * v[1] + R[2, 2] * v[2],
    )


@jit
def moved(R, t, v):
    """Return R v + t."""
    return (
        R[0, 0] * v[0] + R[0, 1] * v[1] + R[0, 2] * v[2] + t[0],
        R[1, 0] * v[0] + R[1, 1] * v[1] + R[1, 2] * v[2] + t[1],
        R[2, 0] * v[0] + R[2, 1] * v[1] + R[2, 2] * v[2] + t[2],
    )


@inlined
def turned_by(rotation, i, x, y, z):
    """Return the vector (x, y, z) turned by the matrix rotation[i]."""
    return (
        rotation[i, 0, 0] * x + rotation[i, 0, 1] * y + rotation[i, 0, 2] * z,
        rotation[i, 1, 0] * x + rotation[i, 1, 1] * y + rotation[i, 1, 2] * z,
        rotation[i, 2, 0] * x + rotation[i, 2, 1] * y + rotation[i, 2, 2] * z,
    )


@inlined
def turned_back_by(rotation, i, x, y, z):
    """Return the vector (x, y, z) turned by the transpose of the matrix rotation[i]."""
    return (
        rotation[i, 0, 0] * x + rotation[i, 1, 0] * y + rotation[i, 2, 0] * z,
        rotation[i, 0, 1] * x + rotation[i, 1, 1] * y + rotation[i, 2, 1] * z,
        rotation[i, 0, 2] * x + rotation[i, 1, 2] * y + rotation[i, 2, 2] * z,
    )


@jit
def relative_pose(R_first, x_first, R_second, x_second, R, t):
    """Write the pose of the second frame in the first: y_first = R y_second + t."""
    for i in range(3):
        t[i] = 0.0
        for k in range(3):
            t[i] += R_first[k, i] * (x_second[k] - x_first[k])
        for j in range(3):
            R[i, j] = R_first[0, i] * R_second[0, j] + R_first[1, i] * R_second[1, j] + R_first[2, i] * R_second[2, j]


@jit
def tangents(n, t1, t2):
    """Write two unit vectors that complete the unit vector n to a right-handed frame.

    They change smoothly with n except at n = -z (Duff et al., Building an orthonormal basis, revisited, JCGT 6, 2017).
    """
    s = 1.0 if n[2] >= 0.0 else -1.0
    a = -1.0 / (s + n[2])
    b = n[0] * n[1] * a
    t1[0], t1[1], t1[2] = 1.0 + s * n[0] * n[0] * a, s * b, -s * n[0]
    t2[0], t2[1], t2[2] = b, s + n[1] * n[1] * a, -n[1]


# -- compiled: copies --------------------------------------------------------------------------------------------------
# Element by element. Where a kernel assigns an array to a slice, numba also compiles the text of its errors, which takes seconds.


@jit
def copy_vector(values, out):
    """Write the first values (k,), k the length of `out`, into out (k,)."""
    for i in range(out.shape[0]):
        out[i] = values[i]


@jit
def copy_matrix(values, out):
    """Write values (k, m) into out (k, m)."""
    for i in range(out.shape[0]):
        for j in range(out.shape[1]):
            out[i, j] = values[i, j]


# -- numpy, over leading axes ------------------------------------------------------------------------------------------


def cross_arrays(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return a x b of vectors (..., 3). The bits are those of `np.cross`, which spends ten times as long on checking its arguments."""
    x, y, z = a[..., 0], a[..., 1], a[..., 2]
    u, v, w = b[..., 0], b[..., 1], b[..., 2]
    first = y * w - z * v
    out = np.empty((*np.shape(first), 3))
    out[..., 0] = first
    out[..., 1] = z * u - x * w
    out[..., 2] = x * v - y * u
    return out
