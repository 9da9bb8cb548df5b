"""Contacts of two convex polyhedra that are not both boxes: closest points, clipping, four points; see `polyhedra`.

The axis of largest gap is that of the closest points (`gjk`). For bodies inside each other it is searched for again with both shrunk
about their centres by SHRINK. Normals of faces stay the same, and gaps are those of the true bodies along them. Where the shrunk bodies
are inside each other, too, the axis is that of their least depth (`epa`).

Where a face has the largest gap, to EDGE_WINS of the smaller inner radius, it is cut with the face of the other body that faces it; else
the closest points are the contact.
"""

from __future__ import annotations

from math import inf

import numpy as np

from rigidimpulse.collision.distance.epa import EXACT, least_deep
from rigidimpulse.collision.distance.gjk import closest, farthest
from rigidimpulse.collision.manifold.clip import Side, clip_faces, face_like
from rigidimpulse.collision.manifold.polyhedra import ALIKE, EDGE_WINS, POINTS, Query, add_contact, along_edges, copy_contact, nearest_of
from rigidimpulse.core.kernels import inlined, jit
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.core.vector import turned_back_by, turned_by

SHRINK = 0.012
"""Part of their lengths by which bodies are shrunk while their closest points are searched for."""
SECOND_WINS = TOLERANCES.manifold.hull_second_face
CLOSEST, CORNER, CODE = -3, -4, 4096
"""First id of the contact of closest points, and of that of a corner and a plane; base of the code of several corners."""


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
    at, far = farthest(shapes, t, -x, -y, -z)
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
def _one_contact(shapes, pair, d, axis, count, scratch, points):
    """The contact of the closest points, half-way between those of the true bodies, along axis = (n, gap); returns 1."""
    c, simplex, rotation, a, (n, gap), (real, ids) = scratch.axes, scratch.simplex, pair.rotation, pair.a, axis, points
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
    m, n = turned_by(rotation, a, middle[0], middle[1], middle[2]), turned_by(rotation, a, n[0], n[1], n[2])
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
    return turned_back_by(rotation, a, between[0], between[1], between[2])


@jit
def hull_contacts(shapes, pair, query, scratch, points):
    """Contacts of two convex polyhedra relative to the first body; returns their number and a bound of the gap."""
    rotation, _, a, b, s, t = pair
    margin, ahead, size = query
    polygon, simplex, _, _, c, between, origin = scratch
    d = seen_from(rotation, a, b, between, c)
    nx, ny, nz, gap, count = closest(shapes, s, t, d, c, 1.0, margin, simplex)
    # They overlap: the axis is searched for with both shrunk about their centres, then by the least depth.
    if count == 5:
        nx, ny, nz, gap, count = closest(shapes, s, t, d, c, 1.0 - SHRINK, margin, simplex)
    if count == 5:
        nx, ny, nz, gap, count = least_deep(shapes, s, t, (d, c), 1.0 - SHRINK, EXACT * size, simplex, scratch.polytope)
    if count == 0:
        return count, gap
    x, y, z = turned_by(rotation, a, nx, ny, nz)
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
        _one_contact(shapes, pair, d, ((nx, ny, nz), gap), count, scratch, points)
        copy_contact(points, 0, POINTS)
    if edges:
        if cosine < ALIKE:
            return np.int64(1), gap
        # A part that hangs down beside a tilted face must not get a contact with it.
        ahead = 0.0
    if of_b:
        other = _face_at(shapes, s, corner_a, rotation, a, t, b, face_b)
        own, facing = Side(t, b, between, face_b), Side(s, a, origin, other)
        found = clip_faces(shapes, pair, own, facing, Query(margin, ahead, size), polygon, points)
    else:
        other = _face_at(shapes, t, corner_b, rotation, b, s, a, face_a)
        own, facing = Side(s, a, origin, face_a), Side(t, b, between, other)
        found = clip_faces(shapes, pair, own, facing, Query(margin, ahead, size), polygon, points)
    if edges:
        if not along_edges(points.real, found, POINTS, cosine, of_b, gap, size):
            copy_contact(points, POINTS, 0)
            found = np.int64(1)
    elif found == 0 and max(gap_a, gap_b) <= margin:
        # The other face lies completely beside it.
        face, corner = (face_b, corner_a) if gap_b > gap_a else (face_a, corner_b)
        found = _corner_contact(shapes, pair, face, corner, not gap_b > gap_a, (between, max(gap_a, gap_b)), points)
    elif count < 5 and found > 0 and cosine >= ALIKE and nearest_of(points.real, found) > max(gap_a, gap_b) + EDGE_WINS * size:
        # The deepest point lies beside the face.
        along_edges(points.real, found, POINTS, cosine, of_b, gap, size)
        found = add_contact(points, found, POINTS)
    return found, max(gap, gap_a, gap_b)


@inlined
def _cosine(shapes, face, r, i, n):
    """Cosine of the angle of n and the normal of a face of body i."""
    x, y, z = turned_by(r, i, shapes.plane[face, 0], shapes.plane[face, 1], shapes.plane[face, 2])
    return x * n[0] + y * n[1] + z * n[2]


@jit
def _corner_contact(shapes, pair, face, corner, of_a, apart, points):
    """The contact of a corner of one body with the plane of a face of the other; of_a: whether the face is a's; returns 1.

    apart: (from a to b in world axes, gap of the corner in m).
    """
    rotation, i, j = pair.rotation, pair.a if of_a else pair.b, pair.b if of_a else pair.a
    (between, gap), (real, ids) = apart, points
    n = turned_by(rotation, i, shapes.plane[face, 0], shapes.plane[face, 1], shapes.plane[face, 2])
    p = turned_by(rotation, j, shapes.corner[corner, 0], shapes.corner[corner, 1], shapes.corner[corner, 2])
    on_i, on_j, sign = (0, 3, 1.0) if of_a else (3, 0, -1.0)
    for k in range(3):
        place = p[k] + (between[k] if of_a else 0.0)
        real[0, on_i + k], real[0, on_j + k], real[0, 6 + k] = place - gap * n[k], place, sign * n[k]
    real[0, 9] = gap
    ids[0, 0], ids[0, 1], ids[0, 2] = CORNER, face, corner
    return np.int64(1)


@jit
def _face_at(shapes, s, corner, r, i, t, j, face):
    """The face of shape s, turned by r[i], at one of its corners that faces most squarely a face of shape t, turned by r[j]."""
    x, y, z = turned_by(r, j, shapes.plane[face, 0], shapes.plane[face, 1], shapes.plane[face, 2])
    x, y, z = turned_back_by(r, i, x, y, z)
    best, at = inf, shapes.face_first[s]
    for f in range(shapes.face_first[s], shapes.face_first[s + 1]):
        cosine = x * shapes.plane[f, 0] + y * shapes.plane[f, 1] + z * shapes.plane[f, 2]
        if cosine < best:
            for k in range(shapes.loop_first[f], shapes.loop_first[f + 1]):
                if shapes.loop[k] == corner:
                    best, at = cosine, f
    return at
