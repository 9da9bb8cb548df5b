"""Contacts of two convex polyhedra that are not both boxes: closest points, clipping, four points; see `heap_polyhedra`.

With X_a the points of body a less their centre c_a, the gap of the bodies is the least |v| of v = y - x, x in X_a + c_a, y in X_b + c_b,
and v / |v| the axis of largest gap. It is found by the algorithm of Gilbert, Johnson and Keerthi (1988): from simplices of corners,
w = argmin over y - x of v.w is added until |v|^2 - v.w is round-off, and corners that do not bear v are dropped. For bodies inside each
other it is done again with both taken smaller about their centres by SHRINK: normals of faces stay the same, and gaps are those of
the true bodies along them. Where these are inside each other, too, the axis is that of their least depth (`heap_depth`).

Where a face has the largest gap, but for EDGE_WINS of the smaller inner radius, it is cut with the face that looks at it; else the
closest points are the contact.
"""

from __future__ import annotations

from math import inf, sqrt
from typing import NamedTuple

import numpy as np

from rigidimpulse._jit import inlined, jit, jit_making_arrays
from rigidimpulse.constrain.heap_clip import clip_faces, face_like
from rigidimpulse.constrain.heap_depth import EXACT, MOST_CORNERS, add_corner, nearest_face, start
from rigidimpulse.constrain.heap_polyhedra import ALIKE, EDGE_WINS, POINTS, add_contact, along_edges, copy_contact, nearest_of
from rigidimpulse.constrain.heap_rows import turned, turned_back

SHRINK = 0.012
"""Part of their lengths by which bodies are taken smaller while their closest points are sought."""
MOST_ROUNDS = 64
CLOSE = 1e-12
"""Part of |v|^2 that is round-off."""
SECOND_WINS = 1e-6
"""Part of the inner radius by which a face of b must have the larger gap."""
CLOSEST, CORNER, CODE = -3, -4, 4096
"""First id of the contact of closest points, and of that of a corner and a plane; corners in a code of features."""


class Simplex(NamedTuple):
    """Up to four corners w of y - x, in the axes of a."""

    w: np.ndarray  # (4, 3) m
    corner: np.ndarray  # (4, 2) of a and b
    weight: np.ndarray  # (4,) of the point nearest to 0
    trial: np.ndarray  # (4,)


@jit_making_arrays
def make_simplex():
    """Room for one pair."""
    return Simplex(np.zeros((4, 3)), np.zeros((4, 2), np.int64), np.zeros(4), np.zeros(4))


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
def _reduce(simplex, count):
    """Weights of the point nearest to 0, and the corners that bear it first; returns their number, 5 where 0 is inside."""
    w, corner, weight, trial = simplex
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
        if weight[n] > 0.0:
            for m in range(3):
                w[kept, m] = w[n, m]
            corner[kept, 0], corner[kept, 1], weight[kept] = corner[n, 0], corner[n, 1], weight[n]
            kept += 1
    _clear(weight, kept)
    return kept


@jit
def _farthest(corner, first, last, x, y, z):
    """The corner farthest along (x, y, z) in its axes, and how far."""
    best, at = -inf, first
    for v in range(first, last):
        along = corner[v, 0] * x + corner[v, 1] * y + corner[v, 2] * z
        if along > best:
            best, at = along, v
    return at, best


@jit
def _farthest_of_both(corner, a0, a1, b0, b1, c, x, y, z):
    """The corner of a farthest along (x, y, z), and how far; that of b farthest the other way, and how far."""
    i, high = _farthest(corner, a0, a1, x, y, z)
    bx, by, bz = (
        c[0, 0] * x + c[1, 0] * y + c[2, 0] * z, c[0, 1] * x + c[1, 1] * y + c[2, 1] * z, c[0, 2] * x + c[1, 2] * y + c[2, 2] * z
    )  # fmt: skip
    j, low = _farthest(corner, b0, b1, -bx, -by, -bz)
    return i, high, j, low


@jit
def closest(shapes, s, t, d, c, small, margin, simplex):
    """Axis of the largest gap in the axes of a, the gap along it, m, and how many corners bear it, 0 where that is above `margin`.

    d: centre of b in the axes of a; c = R_a^T R_b; small: factor of the bodies' lengths. 5 corners: they overlap, the axis is none.
    """
    corner, w = shapes.corner, simplex.w
    a0, a1, b0, b1 = shapes.corner_first[s], shapes.corner_first[s + 1], shapes.corner_first[t], shapes.corner_first[t + 1]
    count, square = np.int64(0), inf
    x, y, z, gap = d[0], d[1], d[2], 0.0
    for _ in range(MOST_ROUNDS):
        i, high, j, low = _farthest_of_both(corner, a0, a1, b0, b1, c, x, y, z)
        length = sqrt(x * x + y * y + z * z)
        if length == 0.0:
            return x, y, z, 0.0, np.int64(5)
        middle = d[0] * x + d[1] * y + d[2] * z
        gap = (middle - low - high) / length
        if gap > margin:
            return x / length, y / length, z / length, gap, np.int64(0)
        short = square - (middle - small * (low + high))
        known = False
        for n in range(count):
            known = known or (simplex.corner[n, 0] == i and simplex.corner[n, 1] == j)
        if count > 0 and (known or short <= CLOSE * square):
            break
        for m in range(3):
            turned_b = c[m, 0] * corner[j, 0] + c[m, 1] * corner[j, 1] + c[m, 2] * corner[j, 2]
            w[count, m] = d[m] + small * (turned_b - corner[i, m])
        simplex.corner[count, 0], simplex.corner[count, 1] = i, j
        count = _reduce(simplex, count + 1)
        if count == 5:
            return x, y, z, 0.0, count
        x, y, z = 0.0, 0.0, 0.0
        for n in range(count):
            x, y, z = x + simplex.weight[n] * w[n, 0], y + simplex.weight[n] * w[n, 1], z + simplex.weight[n] * w[n, 2]
        square = x * x + y * y + z * z
    length = sqrt(x * x + y * y + z * z)
    if length == 0.0:
        return x, y, z, 0.0, np.int64(5)
    return x / length, y / length, z / length, gap, count


@jit
def least_deep(shapes, s, t, d, c, small, exact, simplex, polytope):
    """Axis of the least depth of bodies inside each other, as `closest` gives it, from its simplex; 5 corners where there is none."""
    corner, w = shapes.corner, polytope.w
    a0, a1, b0, b1 = shapes.corner_first[s], shapes.corner_first[s + 1], shapes.corner_first[t], shapes.corner_first[t + 1]
    faces, gap = start(polytope, simplex), 0.0
    f = nearest_face(polytope, faces)
    for corners in range(4, MOST_CORNERS + 1):
        if faces == 0:
            return 1.0, 0.0, 0.0, 0.0, np.int64(5)
        f = nearest_face(polytope, faces)
        x, y, z = -polytope.plane[f, 0], -polytope.plane[f, 1], -polytope.plane[f, 2]
        i, high, j, low = _farthest_of_both(corner, a0, a1, b0, b1, c, x, y, z)
        middle = d[0] * x + d[1] * y + d[2] * z
        gap = middle - low - high
        if corners == MOST_CORNERS or -(middle - small * (low + high)) <= polytope.plane[f, 3] + exact:
            break
        for m in range(3):
            turned_b = c[m, 0] * corner[j, 0] + c[m, 1] * corner[j, 1] + c[m, 2] * corner[j, 2]
            w[corners, m] = d[m] + small * (turned_b - corner[i, m])
        polytope.corner[corners, 0], polytope.corner[corners, 1] = i, j
        faces = add_corner(polytope, corners, faces)
    for n in range(3):
        k = polytope.face[f, n]
        for m in range(3):
            simplex.w[n, m] = w[k, m]
        simplex.corner[n, 0], simplex.corner[n, 1] = polytope.corner[k, 0], polytope.corner[k, 1]
    count = _reduce(simplex, 3)
    return -polytope.plane[f, 0], -polytope.plane[f, 1], -polytope.plane[f, 2], gap, count


@jit
def _face_gap(shapes, s, t, face, d, c, sign):
    """Gap along the normal of a face of shape s, and the corner of t that has it.

    d, c: pose of t in the axes of s, or (sign -1) that of s in those of t.
    """
    nx, ny, nz = shapes.plane[face, 0], shapes.plane[face, 1], shapes.plane[face, 2]
    if sign > 0.0:
        x, y = c[0, 0] * nx + c[1, 0] * ny + c[2, 0] * nz, c[0, 1] * nx + c[1, 1] * ny + c[2, 1] * nz
        z = c[0, 2] * nx + c[1, 2] * ny + c[2, 2] * nz
        middle = nx * d[0] + ny * d[1] + nz * d[2]
    else:
        x, y = c[0, 0] * nx + c[0, 1] * ny + c[0, 2] * nz, c[1, 0] * nx + c[1, 1] * ny + c[1, 2] * nz
        z = c[2, 0] * nx + c[2, 1] * ny + c[2, 2] * nz
        middle = -(x * d[0] + y * d[1] + z * d[2])
    at, far = _farthest(shapes.corner, shapes.corner_first[t], shapes.corner_first[t + 1], -x, -y, -z)
    return middle - far - shapes.plane[face, 3], at


@jit
def _best_face(shapes, s, t, d, c, sign):
    """The face of shape s of largest gap, and that gap."""
    best, at = -inf, shapes.face_first[s]
    for face in range(shapes.face_first[s], shapes.face_first[s + 1]):
        gap, _ = _face_gap(shapes, s, t, face, d, c, sign)
        if gap > best:
            best, at = gap, face
    return at


@jit
def _one_contact(shapes, rotation, a, d, c, n, gap, count, simplex, real, ids):
    """The contact of the closest points, half-way between those of the true bodies; returns 1."""
    code_a, code_b = np.int64(0), np.int64(0)
    middle = (0.0, 0.0, 0.0)
    for k in range(count):
        i, j, share = simplex.corner[k, 0], simplex.corner[k, 1], 0.5 * simplex.weight[k]
        code_a, code_b = CODE * code_a + i + 1, CODE * code_b + j + 1
        p, q = shapes.corner[i], shapes.corner[j]
        middle = (
            middle[0] + share * (p[0] + d[0] + c[0, 0] * q[0] + c[0, 1] * q[1] + c[0, 2] * q[2]),
            middle[1] + share * (p[1] + d[1] + c[1, 0] * q[0] + c[1, 1] * q[1] + c[1, 2] * q[2]),
            middle[2] + share * (p[2] + d[2] + c[2, 0] * q[0] + c[2, 1] * q[1] + c[2, 2] * q[2]),
        )
    m, n = turned(rotation, a, middle[0], middle[1], middle[2]), turned(rotation, a, n[0], n[1], n[2])
    for k in range(3):
        real[0, k], real[0, 3 + k], real[0, 6 + k] = m[k] - 0.5 * gap * n[k], m[k] + 0.5 * gap * n[k], n[k]
    real[0, 9] = gap
    ids[0, 0], ids[0, 1], ids[0, 2] = CLOSEST, code_a, code_b
    return np.int64(1)


@jit
def seen_from(rotation, a, b, between, c):
    """The pose of b in the axes of a: writes R_a^T R_b to c (3, 3), returns its centre; between: from a to b, world."""
    for i in range(3):
        for j in range(3):
            c[i, j] = rotation[a, 0, i] * rotation[b, 0, j] + rotation[a, 1, i] * rotation[b, 1, j] + rotation[a, 2, i] * rotation[b, 2, j]
    return turned_back(rotation, a, between[0], between[1], between[2])


@jit
def hull_contacts(shapes, velocity, rotation, a, b, s, t, between, origin, size, margin, ahead, c, simplex, polytope, scratch, real, ids):
    """Contacts of two convex polyhedra relative to the first body; returns their number and a bound of the gap.

    between: from a to b, world; origin: (0, 0, 0); size: smaller inner radius, m; c: room (3, 3); real, ids: POINTS + 1 rows.
    """
    d = seen_from(rotation, a, b, between, c)
    nx, ny, nz, gap, count = closest(shapes, s, t, d, c, 1.0, margin, simplex)
    if count == 5:
        nx, ny, nz, gap, count = closest(shapes, s, t, d, c, 1.0 - SHRINK, margin, simplex)
    if count == 5:
        nx, ny, nz, gap, count = least_deep(shapes, s, t, d, c, 1.0 - SHRINK, EXACT * size, simplex, polytope)
    if count == 0:
        return count, gap
    x, y, z = turned(rotation, a, nx, ny, nz)
    if count < 5:
        face_a, face_b = face_like(shapes, s, rotation, a, x, y, z), face_like(shapes, t, rotation, b, -x, -y, -z)
    else:
        face_a, face_b, gap = _best_face(shapes, s, t, d, c, 1.0), _best_face(shapes, t, s, d, c, -1.0), -inf
    (gap_a, corner_b), (gap_b, corner_a) = _face_gap(shapes, s, t, face_a, d, c, 1.0), _face_gap(shapes, t, s, face_b, d, c, -1.0)
    edges, of_b = gap > max(gap_a, gap_b) + EDGE_WINS * size, gap_b > gap_a + SECOND_WINS * size
    cosine, cosine_b = _cosine(shapes, face_a, rotation, a, (x, y, z)), -_cosine(shapes, face_b, rotation, b, (x, y, z))
    if edges:
        of_b = cosine_b > cosine + SECOND_WINS
    cosine = cosine_b if of_b else cosine
    if count < 5:
        _one_contact(shapes, rotation, a, d, c, (nx, ny, nz), gap, count, simplex, real, ids)
        copy_contact(real, ids, 0, POINTS)
    if edges:
        if cosine < ALIKE:
            return np.int64(1), gap
        # What hangs down beside a tilted face is not to be held up by it.
        ahead = 0.0
    if of_b:
        other = _face_at(shapes, s, corner_a, rotation, a, t, b, face_b)
        found = clip_faces(shapes, velocity, rotation, t, b, between, face_b, s, a, origin, other, margin, ahead, -1.0, scratch, real, ids)
    else:
        other = _face_at(shapes, t, corner_b, rotation, b, s, a, face_a)
        found = clip_faces(shapes, velocity, rotation, s, a, origin, face_a, t, b, between, other, margin, ahead, 1.0, scratch, real, ids)
    if edges:
        if not along_edges(real, found, POINTS, cosine, of_b, gap, size):
            copy_contact(real, ids, POINTS, 0)
            found = np.int64(1)
    elif found == 0 and max(gap_a, gap_b) <= margin:
        # The face that looks at it lies wholly beside it.
        face, corner, i, j = (face_b, corner_a, b, a) if gap_b > gap_a else (face_a, corner_b, a, b)
        found = _corner_contact(shapes, rotation, face, corner, i, j, i == a, between, max(gap_a, gap_b), real, ids)
    elif count < 5 and found > 0 and cosine >= ALIKE and nearest_of(real, found) > max(gap_a, gap_b) + EDGE_WINS * size:
        # What is deepest lies beside the face.
        along_edges(real, found, POINTS, cosine, of_b, gap, size)
        found = add_contact(real, ids, found, POINTS)
    return found, max(gap, gap_a, gap_b)


@inlined
def _cosine(shapes, face, r, i, n):
    """Cosine of the angle of n and the normal of a face of body i."""
    x, y, z = turned(r, i, shapes.plane[face, 0], shapes.plane[face, 1], shapes.plane[face, 2])
    return x * n[0] + y * n[1] + z * n[2]


@jit
def _corner_contact(shapes, rotation, face, corner, i, j, of_a, between, gap, real, ids):
    """The contact of a corner of body j at `gap` from the plane of a face of body i; of_a: whether i is the first; returns 1."""
    n = turned(rotation, i, shapes.plane[face, 0], shapes.plane[face, 1], shapes.plane[face, 2])
    p = turned(rotation, j, shapes.corner[corner, 0], shapes.corner[corner, 1], shapes.corner[corner, 2])
    on_i, on_j, sign = (0, 3, 1.0) if of_a else (3, 0, -1.0)
    for k in range(3):
        place = p[k] + (between[k] if of_a else 0.0)
        real[0, on_i + k], real[0, on_j + k], real[0, 6 + k] = place - gap * n[k], place, sign * n[k]
    real[0, 9] = gap
    ids[0, 0], ids[0, 1], ids[0, 2] = CORNER, face, corner
    return np.int64(1)


@jit
def _face_at(shapes, s, corner, r, i, t, j, face):
    """The face of shape s, turned by r[i], at one of its corners that looks most squarely at a face of shape t, turned by r[j]."""
    x, y, z = turned(r, j, shapes.plane[face, 0], shapes.plane[face, 1], shapes.plane[face, 2])
    x, y, z = turned_back(r, i, x, y, z)
    best, at = inf, shapes.face_first[s]
    for f in range(shapes.face_first[s], shapes.face_first[s + 1]):
        cosine = x * shapes.plane[f, 0] + y * shapes.plane[f, 1] + z * shapes.plane[f, 2]
        if cosine < best:
            for k in range(shapes.loop_first[f], shapes.loop_first[f + 1]):
                if shapes.loop[k] == corner:
                    best, at = cosine, f
    return at
