"""Symmetric matrices of three dimensions, as tuples xx, xy, xz, yy, yz, zz (kernels)."""

from math import sqrt

from rigidimpulse.core.kernels import jit


@jit
def symmetric_at(matrices, i):
    """Return matrices[i] of an array (n, 3, 3)."""
    return (matrices[i, 0, 0], matrices[i, 0, 1], matrices[i, 0, 2], matrices[i, 1, 1], matrices[i, 1, 2], matrices[i, 2, 2])


@jit
def times(A, b):
    """Return A b."""
    return (
        A[0] * b[0] + A[1] * b[1] + A[2] * b[2],
        A[1] * b[0] + A[3] * b[1] + A[4] * b[2],
        A[2] * b[0] + A[4] * b[1] + A[5] * b[2],
    )


@jit
def solved(A, b):
    """Return x, A x = b, of a positive definite A = C C^T, by Cholesky's factor C."""
    xx = sqrt(A[0])
    yx, zx = A[1] / xx, A[2] / xx
    yy = sqrt(A[3] - yx * yx)
    zy = (A[4] - zx * yx) / yy
    zz = sqrt(A[5] - zx * zx - zy * zy)
    p = b[0] / xx
    q = (b[1] - yx * p) / yy
    r = (b[2] - zx * p - zy * q) / zz
    z = r / zz
    y = (q - zy * z) / yy
    return (p - yx * y - zx * z) / xx, y, z


@jit
def inverse(A):
    """Return the inverse of a positive definite A."""
    x, y, z = solved(A, (1.0, 0.0, 0.0)), solved(A, (0.0, 1.0, 0.0)), solved(A, (0.0, 0.0, 1.0))
    return (x[0], x[1], x[2], y[1], y[2], z[2])
