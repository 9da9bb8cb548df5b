"""Separating axis of two boxes, and the contacts of their faces and edges; see `polyhedra` for the method.

In the axes of a, with half sides h and k, d from centre to centre and C = R_a^T R_b, the gap along a face normal of a is

    s_i = |d_i| - h_i - sum_j |C_ij| k_j,

along one of b likewise, and along the common normal of the edges e_i of a and f_j of b, with i, i', i'' cyclic,

    s_ij = (|d_i'' C_i'j - d_i' C_i''j| - h_i' |C_i''j| - h_i'' |C_i'j| - k_j' |C_ij''| - k_j'' |C_ij'|) / sqrt(1 - C_ij^2).

Where a face has the largest gap, the face of the other box that faces it most squarely is cut by its sides, in the axes of its box.
Where two edges have it see `polyhedra`.
"""

from __future__ import annotations

from math import inf, sqrt
from typing import NamedTuple

import numpy as np

from rigidimpulse.collision.manifold.polyhedra import (
    ALIKE,
    EDGE_WINS,
    FROM_EDGE,
    MOST_CORNERS,
    POINTS,
    Query,
    along_edges,
    copy_contact,
    four_of,
)
from rigidimpulse.core.kernels import inlined
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.core.vector import turned_back_by, turned_by

PARALLEL = TOLERANCES.manifold.box_parallel_edges
SECOND_WINS = TOLERANCES.manifold.box_second_face
OTHER = MOST_CORNERS // 2
"""A polygon lies in the scratch memory from 0 or from here on."""


@inlined
def box_axis(half, pair, between, far, c):
    """The axis of largest gap: 0-2 faces of a, 3-5 of b, 6 + 3 i + j edges; and that gap, or some gap above `far`, m.

    half[s], half[t] (3,) m: half sides; between: from centre to centre, in world axes; c (3, 3) is set to C.
    """
    r, _, a, b, s, t = pair
    d = turned_back_by(r, a, between[0], between[1], between[2])
    h, k = (half[s, 0], half[s, 1], half[s, 2]), (half[t, 0], half[t, 1], half[t, 2])
    for i in range(3):
        for j in range(3):
            c[i, j] = r[a, 0, i] * r[b, 0, j] + r[a, 1, i] * r[b, 1, j] + r[a, 2, i] * r[b, 2, j]
    best, axis = -inf, np.int64(0)
    for i in range(3):
        gap = abs(d[i]) - h[i] - (abs(c[i, 0]) * k[0] + abs(c[i, 1]) * k[1] + abs(c[i, 2]) * k[2])
        if gap > best:
            best, axis = gap, i
    # A gap above `far` along any axis is enough to leave the pair out.
    if best > far:
        return best, axis
    size = min(h[0], h[1], h[2], k[0], k[1], k[2])
    for j in range(3):
        along = abs(c[0, j] * d[0] + c[1, j] * d[1] + c[2, j] * d[2])
        gap = along - k[j] - (abs(c[0, j]) * h[0] + abs(c[1, j]) * h[1] + abs(c[2, j]) * h[2])
        # A tie keeps the face of a.
        if gap > best + SECOND_WINS * size:
            best, axis = gap, 3 + j
    if best > far:
        return best, axis
    edge, edges = -inf, np.int64(-1)
    for i in range(3):
        i1, i2 = (i + 1) % 3, (i + 2) % 3
        for j in range(3):
            square = 1.0 - c[i, j] * c[i, j]
            # Parallel edges have no common normal; a face has the gap then.
            if square < PARALLEL:
                continue
            j1, j2 = (j + 1) % 3, (j + 2) % 3
            reach = h[i1] * abs(c[i2, j]) + h[i2] * abs(c[i1, j]) + k[j1] * abs(c[i, j2]) + k[j2] * abs(c[i, j1])
            gap = (abs(d[i2] * c[i1, j] - d[i1] * c[i2, j]) - reach) / sqrt(square)
            if gap > edge:
                edge, edges = gap, 6 + 3 * i + j
    # Edges must win clearly: faces give more points.
    if edges >= 0 and (edge > far or edge > best + EDGE_WINS * size):
        return edge, edges
    return best, axis


@inlined
def _cut_side(polygon, ids, base, count, axis, sign, limit, side):
    """Keep the part of the polygon where sign times coordinate `axis` is at most `limit`; returns its first place and number of corners.

    The polygon has `count` corners from place `base` on. If it is cut, the rest goes to the other places (from 0 or OTHER on).
    """
    outside = False
    for k in range(base, base + count):
        outside = outside or sign * polygon[k, axis] > limit
    if not outside:
        return base, count
    kept, j = OTHER - base, base + count - 1
    before = sign * polygon[j, axis] - limit
    for k in range(base, base + count):
        after = sign * polygon[k, axis] - limit
        if (before > 0.0) != (after > 0.0):
            t = before / (before - after)
            for m in range(3):
                polygon[kept, m] = polygon[j, m] + t * (polygon[k, m] - polygon[j, m])
            # The id of a new corner names the side that cuts and the corner that it cuts off.
            ids[kept] = FROM_EDGE * (side + 1) + (ids[j] if before > 0.0 else ids[k]) % FROM_EDGE
            kept += 1
        if after <= 0.0:
            for m in range(3):
                polygon[kept, m] = polygon[k, m]
            ids[kept] = ids[k]
            kept += 1
        j, before = k, after
    return OTHER - base, kept - (OTHER - base)


class _Face(NamedTuple):
    """A face of axis m of box i, m' = u and m'' = v the other axes, and the centre y of box j along u, v and m."""

    i: int
    j: int
    of_b: bool  # box i is b
    u: int
    v: int
    m: int
    yu: float  # m
    yv: float
    ym: float
    sign: float  # 1 where the face looks along its axis, else -1


@inlined
def _write_facing(half, other, c, face, polygon):
    """The face of the other box, of half sides half[other], that faces a face: writes its corners to polygon; returns its code.

    Corners are written along the axes m', m'' and as gaps less the half side of m, see `face_contacts`.
    """
    of_b, yu, yv, ym, m, sign = face.of_b, face.yu, face.yv, face.ym, face.m, face.sign
    q, most = np.int64(0), -inf
    for n in range(3):
        cosine = abs(c[n, m] if of_b else c[m, n])
        if cosine > most:
            q, most = n, cosine
    q1, q2 = (q + 1) % 3, (q + 2) % 3
    k, k1, k2 = half[other, q], half[other, q1], half[other, q2]
    side = -k if sign * (c[q, m] if of_b else c[m, q]) > 0.0 else k
    for n in range(3):
        row = (m + 1 + n) % 3
        x, x1, x2 = (c[q, row], c[q1, row], c[q2, row]) if of_b else (c[row, q], c[row, q1], c[row, q2])
        middle, x1, x2 = (yu if n == 0 else (yv if n == 1 else ym)) + side * x, k1 * x1, k2 * x2
        factor = sign if n == 2 else 1.0
        polygon[0, n], polygon[1, n] = factor * (middle + x1 + x2), factor * (middle - x1 + x2)
        polygon[2, n], polygon[3, n] = factor * (middle - x1 - x2), factor * (middle + x1 - x2)
    return 2 * q + np.int64(side > 0.0)


@inlined
def _along(r, i, axis, x, y, z):
    """Component of a vector along an axis of box i."""
    return r[i, 0, axis] * x + r[i, 1, axis] * y + r[i, 2, axis] * z


@inlined
def _reach(pair, face, ahead, polygon):
    """How far corners of box j come over the four sides of a face of box i, +m', -m', +m'', -m'', in `ahead` s: four numbers."""
    velocity, r, i, u, v, m, sign = pair.velocity, pair.rotation, face.i, face.u, face.v, face.m, face.sign
    yu, yv, ym = face.yu, face.yv, face.ym
    a, b = 8 * i, 8 * face.j
    x, y, z = velocity[b] - velocity[a], velocity[b + 1] - velocity[a + 1], velocity[b + 2] - velocity[a + 2]
    xu, xv = _along(r, i, u, x, y, z), _along(r, i, v, x, y, z)
    x, y, z = velocity[a + 3], velocity[a + 4], velocity[a + 5]
    wu, wv, wm = _along(r, i, u, x, y, z), _along(r, i, v, x, y, z), _along(r, i, m, x, y, z)
    x, y, z = velocity[b + 3], velocity[b + 4], velocity[b + 5]
    ou, ov, om = _along(r, i, u, x, y, z), _along(r, i, v, x, y, z), _along(r, i, m, x, y, z)
    low_u = high_u = low_v = high_v = 0.0
    for k in range(4):
        pu, pv, pm = polygon[k, 0], polygon[k, 1], sign * polygon[k, 2]
        su, sv, sm = pu - yu, pv - yv, pm - ym
        along_u = ahead * (xu + (ov * sm - om * sv) - (wv * pm - wm * pv))
        along_v = ahead * (xv + (om * su - ou * sm) - (wm * pu - wu * pm))
        low_u, high_u = min(low_u, along_u), max(high_u, along_u)
        low_v, high_v = min(low_v, along_v), max(high_v, along_v)
    return -low_u, high_u, -low_v, high_v


@inlined
def face_contacts(half, pair, axis, query, scratch, points):
    """Contacts of the face of `axis` (0-2 of a, 3-5 of b) with the face of the other box that faces it; returns their number.

    Parts beside the face that come over it in `query.ahead` s count as well. Points are written relative to a.
    """
    polygon, ids, _, _, paths, height, chosen = scratch.polygon
    r, _, a, b, s, t = pair
    between, (real, out_ids) = scratch.between, points
    of_b = axis >= 3
    i, j, m, own, other = (b, a, axis - 3, t, s) if of_b else (a, b, axis, s, t)
    turn, u, v = -1.0 if of_b else 1.0, (m + 1) % 3, (m + 2) % 3
    x, y, z = turn * between[0], turn * between[1], turn * between[2]
    yu, yv, ym = _along(r, i, u, x, y, z), _along(r, i, v, x, y, z), _along(r, i, m, x, y, z)
    sign = 1.0 if ym > 0.0 else -1.0
    face = _Face(i, j, of_b, u, v, m, yu, yv, ym, sign)
    code = _write_facing(half, other, scratch.axes, face, polygon)
    for k in range(4):
        ids[k] = k
    # Sides are moved outwards by what may come over the face in `ahead` s.
    paths[0, 0], paths[1, 0], paths[2, 0], paths[3, 0] = _reach(pair, face, query.ahead, polygon)
    base, count = np.int64(0), np.int64(4)
    for side in range(4):
        limit = half[own, u if side < 2 else v] + paths[side, 0]
        base, count = _cut_side(polygon, ids, base, count, side // 2, 1.0 if side % 2 == 0 else -1.0, limit, side)
    kept = np.int64(0)
    for k in range(base, base + count):
        gap = polygon[k, 2] - half[own, m]
        if gap <= query.margin:
            polygon[kept, 0], polygon[kept, 1], polygon[kept, 2] = polygon[k, 0], polygon[k, 1], polygon[k, 2]
            height[kept], ids[kept] = gap, ids[k]
            kept += 1
    if kept == 0:
        return kept
    # Four points can carry the load of all.
    number = four_of(polygon, height, kept, chosen)
    at_own, at_other = (3, 0) if of_b else (0, 3)
    for n in range(number):
        k = chosen[n]
        pu, pv, pm, gap = polygon[k, 0], polygon[k, 1], polygon[k, 2], height[k]
        for row in range(3):
            normal = sign * r[i, row, m]
            place = r[i, row, u] * pu + r[i, row, v] * pv + normal * pm + (between[row] if of_b else 0.0)
            real[n, at_own + row], real[n, at_other + row] = place - gap * normal, place
            real[n, 6 + row] = turn * normal
        real[n, 9] = gap
        out_ids[n, 0], out_ids[n, 1], out_ids[n, 2] = 2 * axis + np.int64(sign > 0.0), code, ids[k]
    return number


@inlined
def edge_contact(half, pair, axis, gap, scratch, points):
    """The contact of two edges of boxes, with the gap found for their axis; returns 1."""
    r, _, a, _, s, t = pair
    c, work, (real, ids) = scratch.axes, scratch.work, points
    i, j = (axis - 6) // 3, (axis - 6) % 3
    i1, i2 = (i + 1) % 3, (i + 2) % 3
    d = turned_back_by(r, a, scratch.between[0], scratch.between[1], scratch.between[2])
    n, p, o = work[0], work[1], work[2]
    length = sqrt(1.0 - c[i, j] * c[i, j])
    # e_i x f_j in the axes of a.
    n[i], n[i1], n[i2] = 0.0, -c[i2, j] / length, c[i1, j] / length
    if n[0] * d[0] + n[1] * d[1] + n[2] * d[2] < 0.0:
        n[i1], n[i2] = -n[i1], -n[i2]
    p[i], code = 0.0, 0
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
    nx, ny, nz = turned_by(r, a, n[0], n[1], n[2])
    ax, ay, az = turned_by(r, a, p[0], p[1], p[2])
    bx, by, bz = turned_by(r, a, o[0], o[1], o[2])
    real[0, 0], real[0, 1], real[0, 2] = ax, ay, az
    real[0, 3], real[0, 4], real[0, 5] = bx, by, bz
    real[0, 6], real[0, 7], real[0, 8], real[0, 9] = nx, ny, nz, gap
    ids[0, 0], ids[0, 1], ids[0, 2] = -2, axis, code
    return np.int64(1)


@inlined
def face_along(n, c):
    """The face, 0-2 of a and 3-5 of b, whose normal is nearest to the line n (3,), in the axes of a, and the cosine of their angle."""
    face, most = np.int64(0), -1.0
    for m in range(3):
        if abs(n[m]) > most:
            face, most = m, abs(n[m])
    for m in range(3):
        cosine = abs(n[0] * c[0, m] + n[1] * c[1, m] + n[2] * c[2, m])
        if cosine > most + SECOND_WINS:
            face, most = 3 + m, cosine
    return face, most


@inlined
def box_box_contacts(shapes, pair, query, scratch, points):
    """Contacts of two boxes relative to the first body; returns their number and a bound of the gap."""
    half, c, work, ahead = shapes.half, scratch.axes, scratch.work, query.ahead
    gap, axis = box_axis(half, pair, scratch.between, query.margin, c)
    if gap > query.margin:
        return np.int64(0), gap
    cosine, edges = 1.0, axis
    if edges >= 6:
        edge_contact(half, pair, edges, gap, scratch, points)
        axis, cosine = face_along(work[0], c)
        if cosine < ALIKE:
            return np.int64(1), gap
        copy_contact(points, 0, POINTS)
        # A part that hangs down beside a tilted face must not get a contact with it.
        ahead = 0.0
    count = face_contacts(half, pair, axis, Query(query.margin, ahead, query.size), scratch, points)
    if edges >= 6:
        s, t = pair.s, pair.t
        size = min(half[s, 0], half[s, 1], half[s, 2], half[t, 0], half[t, 1], half[t, 2])
        if not along_edges(points.real, count, POINTS, cosine, axis >= 3, gap, size):
            copy_contact(points, POINTS, 0)
            count = np.int64(1)
    return count, gap
