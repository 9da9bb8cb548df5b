"""Functions of arrays whose last bit is the same on every processor of a kind.

`@` and `np.linalg.norm` of one vector call BLAS, and `np.sin`, `np.power` and others have code of their own for processors with AVX-512:
both round otherwise there. What leads to a motion is computed with the functions of this file: `np.einsum` without `optimize`, which uses
what every processor has, and elementary functions of more digits (`np.longdouble`), rounded once. Kernels have `core/vector.py`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike


def dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Products of vectors (..., k) and (..., k); of a matrix (m, k) and a vector (k,), too."""
    return np.einsum("...i,...i->...", a, b)


def length(v: np.ndarray) -> np.ndarray:
    """Euclidean lengths of vectors (..., k)."""
    return np.sqrt(dot(v, v))


def matmul(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Products of matrices (..., m, k) and (..., k, n)."""
    return np.einsum("...ij,...jk->...ik", a, b)


def sine(x: ArrayLike) -> np.ndarray:
    """Sine of x rad."""
    return np.sin(np.asarray(x, np.longdouble)).astype(np.float64)


def cosine(x: ArrayLike) -> np.ndarray:
    """Cosine of x rad."""
    return np.cos(np.asarray(x, np.longdouble)).astype(np.float64)


def arctangent2(y: ArrayLike, x: ArrayLike) -> np.ndarray:
    """Angle of (x, y), rad, -pi to pi."""
    return np.arctan2(np.asarray(y, np.longdouble), np.asarray(x, np.longdouble)).astype(np.float64)


def power(x: ArrayLike, exponent: ArrayLike) -> np.ndarray:
    """Return x to a power, elementwise."""
    return np.power(np.asarray(x, np.longdouble), np.asarray(exponent, np.longdouble)).astype(np.float64)
