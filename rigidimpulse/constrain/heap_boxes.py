"""Separating axis of two boxes, and the contact of two of their edges; see `heap_polyhedra`.

In the axes of a, with half sides h and k, d from centre to centre and C = R_a^T R_b, the gap along a face normal of a is

    s_i = |d_i| - h_i - sum_j |C_ij| k_j,

along one of b likewise, and along the common normal of the edges e_i of a and f_j of b, with i, i', i'' cyclic,

    s_ij = (|d_i'' C_i'j - d_i' C_i''j| - h_i' |C_i''j| - h_i'' |C_i'j| - k_j' |C_ij''| - k_j'' |C_ij'|) / sqrt(1 - C_ij^2).
"""

from __future__ import annotations

from math import inf, sqrt

import numpy as np

from rigidimpulse._jit import jit
from rigidimpulse.constrain.heap_polyhedra import EDGE_WINS
from rigidimpulse.constrain.heap_rows import turned, turned_back

PARALLEL = 1e-6
"""Square of the sine of the angle of two edges below which they have no normal."""
SECOND_WINS = 1e-6
"""Part of the sides by which a face of b must have the larger gap."""


@jit
def box_axis(half, s, t, r, a, b, dx, dy, dz, far, c):
    """The axis of largest gap: 0-2 faces of a, 3-5 of b, 6 + 3 i + j edges; and that gap, or some gap above `far`, m.

    half[s], half[t] (3,) m: half sides; r[a], r[b]: rotations; d: from centre to centre, world; c (3, 3) is set to C.
    """
    d = turned_back(r, a, dx, dy, dz)
    h, k = (half[s, 0], half[s, 1], half[s, 2]), (half[t, 0], half[t, 1], half[t, 2])
    for i in range(3):
        for j in range(3):
            c[i, j] = r[a, 0, i] * r[b, 0, j] + r[a, 1, i] * r[b, 1, j] + r[a, 2, i] * r[b, 2, j]
    best, axis = -inf, np.int64(0)
    for i in range(3):
        gap = abs(d[i]) - h[i] - (abs(c[i, 0]) * k[0] + abs(c[i, 1]) * k[1] + abs(c[i, 2]) * k[2])
        if gap > best:
            best, axis = gap, i
    if best > far:
        return best, axis
    size = min(h[0], h[1], h[2], k[0], k[1], k[2])
    for j in range(3):
        along = abs(c[0, j] * d[0] + c[1, j] * d[1] + c[2, j] * d[2])
        gap = along - k[j] - (abs(c[0, j]) * h[0] + abs(c[1, j]) * h[1] + abs(c[2, j]) * h[2])
        if gap > best + SECOND_WINS * size:
            best, axis = gap, 3 + j
    if best > far:
        return best, axis
    edge, edges = -inf, np.int64(-1)
    for i in range(3):
        i1, i2 = (i + 1) % 3, (i + 2) % 3
        for j in range(3):
            square = 1.0 - c[i, j] * c[i, j]
            if square < PARALLEL:
                continue
            j1, j2 = (j + 1) % 3, (j + 2) % 3
            reach = h[i1] * abs(c[i2, j]) + h[i2] * abs(c[i1, j]) + k[j1] * abs(c[i, j2]) + k[j2] * abs(c[i, j1])
            gap = (abs(d[i2] * c[i1, j] - d[i1] * c[i2, j]) - reach) / sqrt(square)
            if gap > edge:
                edge, edges = gap, 6 + 3 * i + j
    if edges >= 0 and (edge > far or edge > best + EDGE_WINS * size):
        return edge, edges
    return best, axis


@jit
def axis_normal(axis, r, a, b, dx, dy, dz):
    """The unit normal of an axis that is no pair of edges, from a to b."""
    m, i = (a, axis) if axis < 3 else (b, axis - 3)
    x, y, z = r[m, 0, i], r[m, 1, i], r[m, 2, i]
    return (x, y, z) if x * dx + y * dy + z * dz > 0.0 else (-x, -y, -z)


@jit
def edge_contact(half, s, t, r, a, dx, dy, dz, axis, gap, c, real, ids):
    """The contact of two edges of boxes, with the gap found for their axis; returns 1."""
    i, j = (axis - 6) // 3, (axis - 6) % 3
    i1, i2 = (i + 1) % 3, (i + 2) % 3
    d = turned_back(r, a, dx, dy, dz)
    n = np.zeros(3)
    length = sqrt(1.0 - c[i, j] * c[i, j])
    # e_i x f_j in the axes of a.
    n[i1], n[i2] = -c[i2, j] / length, c[i1, j] / length
    if n[0] * d[0] + n[1] * d[1] + n[2] * d[2] < 0.0:
        n[i1], n[i2] = -n[i1], -n[i2]
    p, o, code = np.zeros(3), np.empty(3), 0
    for m in (i1, i2):
        p[m] = half[s, m] if n[m] > 0.0 else -half[s, m]
        code = 2 * code + int(n[m] > 0.0)
    for m in range(3):
        o[m] = d[m]
    for m in range(3):
        if m != j:
            cosine = n[0] * c[0, m] + n[1] * c[1, m] + n[2] * c[2, m]
            side = -half[t, m] if cosine > 0.0 else half[t, m]
            code = 2 * code + int(cosine > 0.0)
            for row in range(3):
                o[row] += side * c[row, m]
    # Closest points of the lines p + s e_i and o + t f_j.
    along = c[i, j]
    u = p[i] - o[i]
    v = (p[0] - o[0]) * c[0, j] + (p[1] - o[1]) * c[1, j] + (p[2] - o[2]) * c[2, j]
    p[i] += (along * v - u) / (length * length)
    for m in range(3):
        o[m] += (v - along * u) / (length * length) * c[m, j]
    nx, ny, nz = turned(r, a, n[0], n[1], n[2])
    ax, ay, az = turned(r, a, p[0], p[1], p[2])
    bx, by, bz = turned(r, a, o[0], o[1], o[2])
    real[0, 0], real[0, 1], real[0, 2] = ax, ay, az
    real[0, 3], real[0, 4], real[0, 5] = bx, by, bz
    real[0, 6], real[0, 7], real[0, 8], real[0, 9] = nx, ny, nz, gap
    ids[0, 0], ids[0, 1], ids[0, 2] = -2, axis, code
    return np.int64(1)
