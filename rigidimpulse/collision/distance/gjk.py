"""Distance of two convex polyhedra: the algorithm of Gilbert, Johnson and Keerthi (1988).

With X_a the points of body a less their centre c_a, the gap of the bodies is the least |v| of v = y - x, x in X_a + c_a, y in X_b + c_b,
and v / |v| the axis of largest gap. From simplices of corners, w = argmin over y - x of v.w is added until |v|^2 - v.w is round-off, and
corners that do not bear v are dropped. Where faces or edges are parallel, w may lie in the plane of the simplex: its tetrahedron is flat
then, and which side of a face 0 is on is round-off. Therefore the search also ends where |v| does not decrease, with the previous simplex.
"""

from __future__ import annotations

from math import inf, sqrt
from typing import NamedTuple

import numpy as np

from rigidimpulse.core.kernels import inlined, jit, jit_making_arrays
from rigidimpulse.core.simd import EIGHT, eight, highest, load, spread, where_greater
from rigidimpulse.core.tolerances import TOLERANCES

MOST_ROUNDS = 64
CLOSE = TOLERANCES.distance.gjk_converged
ROUND = TOLERANCES.distance.gjk_round_off


class Simplex(NamedTuple):
    """Up to four corners w of y - x, in the axes of a."""

    w: np.ndarray  # (4, 3) m
    corner: np.ndarray  # (4, 2) of a and b
    weight: np.ndarray  # (4,) of the point nearest to 0
    trial: np.ndarray  # (4,)
    old_w: np.ndarray  # (3, 3), the simplex of before
    old_corner: np.ndarray  # (3, 2)
    old_weight: np.ndarray  # (4,)


@jit_making_arrays
def make_simplex():
    """Scratch memory for one pair."""
    return Simplex(
        np.zeros((4, 3)), np.zeros((4, 2), np.int64), np.zeros(4), np.zeros(4), np.zeros((3, 3)), np.zeros((3, 2), np.int64), np.zeros(4)
    )


@jit
def _dot(w, i, j):
    return w[i, 0] * w[j, 0] + w[i, 1] * w[j, 1] + w[i, 2] * w[j, 2]


@inlined
def _clear(weight, first):
    """Set weights to 0 from the first on."""
    for n in range(first, 4):
        weight[n] = 0.0


@jit
def _nearest_of_segment(w, i, j, weight):
    """Weights (4,) of the point of the segment nearest to 0."""
    _clear(weight, 0)
    along = _dot(w, i, i) - _dot(w, i, j)
    square = along + _dot(w, j, j) - _dot(w, i, j)
    t = min(max(along / square, 0.0), 1.0) if square > 0.0 else 0.0
    weight[i], weight[j] = 1.0 - t, t


@jit
def _nearest_of_triangle(w, i, j, k, weight):
    """Weights (4,) of the point of the triangle nearest to 0 (regions of a triangle; Ericson 2005)."""
    ii, ij, ik, jj, jk, kk = _dot(w, i, i), _dot(w, i, j), _dot(w, i, k), _dot(w, j, j), _dot(w, j, k), _dot(w, k, k)
    # Of 0 - w_i along e = w_j - w_i and f = w_k - w_i, then of 0 - w_j and 0 - w_k.
    d1, d2 = ii - ij, ii - ik
    d3, d4 = ij - jj, ij - jk
    d5, d6 = ik - jk, ik - kk
    vc, vb, va = d1 * d4 - d3 * d2, d5 * d2 - d1 * d6, d3 * d6 - d5 * d4
    _clear(weight, 0)
    if d1 <= 0.0 and d2 <= 0.0:
        weight[i] = 1.0
    elif d3 >= 0.0 and d4 <= d3:
        weight[j] = 1.0
    elif d6 >= 0.0 and d5 <= d6:
        weight[k] = 1.0
    elif vc <= 0.0 and d1 >= 0.0 and d3 <= 0.0:
        _nearest_of_segment(w, i, j, weight)
    elif vb <= 0.0 and d2 >= 0.0 and d6 <= 0.0:
        _nearest_of_segment(w, i, k, weight)
    elif va <= 0.0 and d4 - d3 >= 0.0 and d5 - d6 >= 0.0:
        _nearest_of_segment(w, j, k, weight)
    else:
        total = va + vb + vc
        weight[i], weight[j], weight[k] = va / total, vb / total, vc / total


@jit
def _square_of(w, weight):
    """Square of the point of these weights."""
    square = 0.0
    for m in range(3):
        x = weight[0] * w[0, m] + weight[1] * w[1, m] + weight[2] * w[2, m] + weight[3] * w[3, m]
        square += x * x
    return square


@jit
def _nearest_of_tetrahedron(w, weight, trial):
    """The same of a tetrahedron; whether 0 is outside."""
    best, outside = inf, False
    for n in range(4):
        i, j, k = (n + 1) % 4, (n + 2) % 4, (n + 3) % 4
        ex, ey, ez = w[j, 0] - w[i, 0], w[j, 1] - w[i, 1], w[j, 2] - w[i, 2]
        fx, fy, fz = w[k, 0] - w[i, 0], w[k, 1] - w[i, 1], w[k, 2] - w[i, 2]
        nx, ny, nz = ey * fz - ez * fy, ez * fx - ex * fz, ex * fy - ey * fx
        own = nx * (w[n, 0] - w[i, 0]) + ny * (w[n, 1] - w[i, 1]) + nz * (w[n, 2] - w[i, 2])
        origin = -(nx * w[i, 0] + ny * w[i, 1] + nz * w[i, 2])
        if own * origin > 0.0:
            continue
        outside = True
        _nearest_of_triangle(w, i, j, k, trial)
        square = _square_of(w, trial)
        if square < best:
            best = square
            weight[0], weight[1], weight[2], weight[3] = trial[0], trial[1], trial[2], trial[3]
    return outside


@jit
def reduce_simplex(simplex, count):
    """Weights of the point nearest to 0, and the corners that bear it first; returns their number, 5 where 0 is inside."""
    w, corner, weight, trial, _, _, _ = simplex
    if count == 1:
        _clear(weight, 0)
        weight[0] = 1.0
    elif count == 2:
        _nearest_of_segment(w, 0, 1, weight)
    elif count == 3:
        _nearest_of_triangle(w, 0, 1, 2, weight)
    elif not _nearest_of_tetrahedron(w, weight, trial):
        return np.int64(5)
    kept = np.int64(0)
    for n in range(count):
        # Corners that do not bear the nearest point are dropped.
        if weight[n] > 0.0:
            for m in range(3):
                w[kept, m] = w[n, m]
            corner[kept, 0], corner[kept, 1], weight[kept] = corner[n, 0], corner[n, 1], weight[n]
            kept += 1
    _clear(weight, kept)
    return kept


@inlined
def _keep(simplex, count):
    """Store a simplex of `count` corners."""
    for n in range(count):
        for m in range(3):
            simplex.old_w[n, m] = simplex.w[n, m]
        simplex.old_corner[n, 0], simplex.old_corner[n, 1] = simplex.corner[n, 0], simplex.corner[n, 1]
        simplex.old_weight[n] = simplex.weight[n]


@inlined
def _take_back(simplex, count):
    """Let the simplex be what it was; returns its number of corners."""
    _clear(simplex.weight, count)
    for n in range(count):
        for m in range(3):
            simplex.w[n, m] = simplex.old_w[n, m]
        simplex.corner[n, 0], simplex.corner[n, 1] = simplex.old_corner[n, 0], simplex.old_corner[n, 1]
        simplex.weight[n] = simplex.old_weight[n]
    return count


@jit
def farthest(shapes, s, x, y, z):
    """The corner of polyhedron s farthest along (x, y, z) in its axes, and how far; of equal ones the first."""
    simd, column, first = eight(), shapes.column, shapes.column_first[s]
    length = (shapes.column_first[s + 1] - first) // 3
    wx, wy, wz = spread(simd, x), spread(simd, y), spread(simd, z)
    best, at = spread(simd, -inf), spread(simd, 0.0)
    for k in range(first, first + length, EIGHT):
        along = load(simd, column, k) * wx + load(simd, column, k + length) * wy + load(simd, column, k + 2 * length) * wz
        at = where_greater(along, best, spread(simd, float(k - first)), at)
        best = where_greater(along, best, along, best)
    far, place = highest(best, at)
    return shapes.corner_first[s] + np.int64(place), far


@jit
def farthest_of_both(shapes, s, t, c, x, y, z):
    """The corner of s farthest along (x, y, z), and how far; that of t farthest the other way, and how far; c: see `closest`."""
    i, high = farthest(shapes, s, x, y, z)
    bx, by, bz = (
        c[0, 0] * x + c[1, 0] * y + c[2, 0] * z, c[0, 1] * x + c[1, 1] * y + c[2, 1] * z, c[0, 2] * x + c[1, 2] * y + c[2, 2] * z
    )  # fmt: skip
    j, low = farthest(shapes, t, -bx, -by, -bz)
    return i, high, j, low


@jit
def closest(shapes, s, t, d, c, small, margin, simplex):
    """Axis of the largest gap in the axes of a, the gap along it, m, and how many corners bear it, 0 where that is above `margin`.

    d: centre of b in the axes of a; c = R_a^T R_b; small: factor of the bodies' lengths. 5 corners: they overlap, the axis is none.
    """
    corner, w = shapes.corner, simplex.w
    count, square, greatest = np.int64(0), inf, 0.0
    x, y, z, gap = d[0], d[1], d[2], 0.0
    for _ in range(MOST_ROUNDS):
        i, high, j, low = farthest_of_both(shapes, s, t, c, x, y, z)
        length = sqrt(x * x + y * y + z * z)
        if length == 0.0:
            return x, y, z, 0.0, np.int64(5)
        middle = d[0] * x + d[1] * y + d[2] * z
        gap = (middle - low - high) / length
        # The gap along any axis is a lower bound of the distance: this is far enough.
        if gap > margin:
            return x / length, y / length, z / length, gap, np.int64(0)
        short = square - (middle - small * (low + high))
        known = False
        for n in range(count):
            known = known or (simplex.corner[n, 0] == i and simplex.corner[n, 1] == j)
        # No corner gets nearer to 0 by more than round-off.
        if count > 0 and (known or short <= CLOSE * square + ROUND * greatest):
            break
        for m in range(3):
            turned_b = c[m, 0] * corner[j, 0] + c[m, 1] * corner[j, 1] + c[m, 2] * corner[j, 2]
            w[count, m] = d[m] + small * (turned_b - corner[i, m])
        simplex.corner[count, 0], simplex.corner[count, 1] = i, j
        greatest = max(greatest, _dot(w, count, count))
        before = count
        _keep(simplex, before)
        count = reduce_simplex(simplex, before + 1)
        if count == 5:
            return x, y, z, 0.0, count
        nx, ny, nz = 0.0, 0.0, 0.0
        for n in range(count):
            nx, ny, nz = nx + simplex.weight[n] * w[n, 0], ny + simplex.weight[n] * w[n, 1], nz + simplex.weight[n] * w[n, 2]
        # Parallel faces make flat tetrahedra, where the side of 0 is round-off: the previous simplex is the answer.
        if before > 0 and nx * nx + ny * ny + nz * nz >= square:
            count = _take_back(simplex, before)
            break
        x, y, z, square = nx, ny, nz, nx * nx + ny * ny + nz * nz
    length = sqrt(x * x + y * y + z * z)
    # The direction of a v that is round-off is none: two cubes, one flush on the other, were 1 m inside each other along it.
    if length == 0.0 or square <= ROUND * greatest:
        return x, y, z, 0.0, np.int64(5)
    return x / length, y / length, z / length, gap, count
