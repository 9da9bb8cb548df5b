"""Penetration depth of two convex polyhedra: the expanding polytope algorithm (van den Bergen 2001).

With X_a, X_b the corners of the bodies, 0 is inside the hull of all w = y - x. The shortest displacement to its surface separates the
bodies. A polytope inside that hull, at first the tetrahedron about 0 that the algorithm of Gilbert, Johnson and Keerthi found, has a face
n.w = h nearest to 0. The hull's farthest corner w along n is added where n.w > h: faces that it sees are replaced by those of w and the
edges around them. Where n.w = h, n is the axis of least depth, and the corners of the face bear it.
"""

from __future__ import annotations

from math import inf, sqrt
from typing import NamedTuple

import numpy as np

from rigidimpulse.collision.distance.gjk import farthest_of_both, reduce_simplex
from rigidimpulse.core.kernels import jit, jit_making_arrays
from rigidimpulse.core.tolerances import TOLERANCES

MOST_CORNERS, MOST_FACES = 64, 192
EXACT = TOLERANCES.distance.depth_converged
FLAT = TOLERANCES.distance.flat_polytope_face


class Polytope(NamedTuple):
    """Corners w of y - x, in the axes of a, and faces with outward normals."""

    w: np.ndarray  # (MOST_CORNERS, 3) m
    corner: np.ndarray  # (MOST_CORNERS, 2) of a and b
    face: np.ndarray  # (MOST_FACES, 3)
    plane: np.ndarray  # (MOST_FACES, 4) unit normal, distance from 0, m; inf for a flat face
    rim: np.ndarray  # (3 MOST_FACES, 2) edges of the faces that a corner sees
    inside: np.ndarray  # (3,) m, a point within


@jit_making_arrays
def make_polytope():
    """Scratch memory for one pair."""
    return Polytope(
        np.empty((MOST_CORNERS, 3)), np.empty((MOST_CORNERS, 2), np.int64), np.empty((MOST_FACES, 3), np.int64), np.empty((MOST_FACES, 4)),
        np.empty((3 * MOST_FACES, 2), np.int64), np.empty(3),
    )  # fmt: skip


@jit
def _start(polytope, simplex):
    """Begin with the tetrahedron of a simplex; returns the number of faces, 0 where it is flat or not about 0."""
    w, inside = polytope.w, polytope.inside
    for m in range(3):
        inside[m] = 0.0
        for n in range(4):
            w[n, m] = simplex.w[n, m]
            inside[m] += 0.25 * w[n, m]
    for n in range(4):
        polytope.corner[n, 0], polytope.corner[n, 1] = simplex.corner[n, 0], simplex.corner[n, 1]
        _set_face(polytope, n, (n + 1) % 4, (n + 2) % 4, (n + 3) % 4)
        if not 0.0 <= polytope.plane[n, 3] < inf:
            return 0
    return 4


@jit
def _set_face(polytope, f, i, j, k):
    """Let face f be that of three corners, with its normal away from the inside."""
    w, plane, inside = polytope.w, polytope.plane, polytope.inside
    polytope.face[f, 0], polytope.face[f, 1], polytope.face[f, 2] = i, j, k
    ex, ey, ez = w[j, 0] - w[i, 0], w[j, 1] - w[i, 1], w[j, 2] - w[i, 2]
    fx, fy, fz = w[k, 0] - w[i, 0], w[k, 1] - w[i, 1], w[k, 2] - w[i, 2]
    x, y, z = ey * fz - ez * fy, ez * fx - ex * fz, ex * fy - ey * fx
    square, sides = x * x + y * y + z * z, (ex * ex + ey * ey + ez * ez) * (fx * fx + fy * fy + fz * fz)
    if square <= FLAT * sides:
        plane[f, 0], plane[f, 1], plane[f, 2], plane[f, 3] = 0.0, 0.0, 0.0, inf
        return
    size = sqrt(square)
    if x * (inside[0] - w[i, 0]) + y * (inside[1] - w[i, 1]) + z * (inside[2] - w[i, 2]) > 0.0:
        size = -size
    plane[f, 0], plane[f, 1], plane[f, 2] = x / size, y / size, z / size
    plane[f, 3] = plane[f, 0] * w[i, 0] + plane[f, 1] * w[i, 1] + plane[f, 2] * w[i, 2]


@jit
def _nearest_face(polytope, faces):
    """The face nearest to 0."""
    best = 0
    for f in range(1, faces):
        if polytope.plane[f, 3] < polytope.plane[best, 3]:
            best = f
    return best


@jit
def _add_corner(polytope, corners, faces):
    """Take corner number `corners` in; returns the number of faces, 0 if the polytope is full."""
    w, face, plane, rim = polytope.w, polytope.face, polytope.plane, polytope.rim
    edges, f = 0, 0
    while f < faces:
        height = plane[f, 0] * w[corners, 0] + plane[f, 1] * w[corners, 1] + plane[f, 2] * w[corners, 2] - plane[f, 3]
        # The corner does not see this face: it stays.
        if not height > 0.0:
            f += 1
            continue
        for k in range(3):
            i, j = face[f, k], face[f, (k + 1) % 3]
            # Edges of two faces that go cancel out; the rim of what goes is left.
            edges = _toggle(rim, edges, min(i, j), max(i, j))
        faces -= 1
        for k in range(3):
            face[f, k] = face[faces, k]
        for k in range(4):
            plane[f, k] = plane[faces, k]
    if edges == 0 or faces + edges > MOST_FACES:
        return 0
    for e in range(edges):
        _set_face(polytope, faces + e, rim[e, 0], rim[e, 1], corners)
    return faces + edges


@jit
def _toggle(rim, edges, i, j):
    """Add an edge, or take it away where two of the faces have it; returns the number of edges."""
    for e in range(edges):
        if rim[e, 0] == i and rim[e, 1] == j:
            rim[e, 0], rim[e, 1] = rim[edges - 1, 0], rim[edges - 1, 1]
            return edges - 1
    rim[edges, 0], rim[edges, 1] = i, j
    return edges + 1


@jit
def least_deep(shapes, s, t, pose, small, exact, simplex, polytope):
    """Axis of the least depth of bodies inside each other, as `closest` gives it, from its simplex; 5 corners where there is none.

    pose: (d, c), see `closest`.
    """
    d, c = pose
    corner, w = shapes.corner, polytope.w
    faces, gap = _start(polytope, simplex), 0.0
    f = _nearest_face(polytope, faces)
    for corners in range(4, MOST_CORNERS + 1):
        if faces == 0:
            return 1.0, 0.0, 0.0, 0.0, np.int64(5)
        f = _nearest_face(polytope, faces)
        x, y, z = -polytope.plane[f, 0], -polytope.plane[f, 1], -polytope.plane[f, 2]
        i, high, j, low = farthest_of_both(shapes, s, t, c, x, y, z)
        middle = d[0] * x + d[1] * y + d[2] * z
        gap = middle - low - high
        # No corner of the hull lies beyond the face: n.w = h, its normal is the axis.
        if corners == MOST_CORNERS or -(middle - small * (low + high)) <= polytope.plane[f, 3] + exact:
            break
        for m in range(3):
            turned_b = c[m, 0] * corner[j, 0] + c[m, 1] * corner[j, 1] + c[m, 2] * corner[j, 2]
            w[corners, m] = d[m] + small * (turned_b - corner[i, m])
        polytope.corner[corners, 0], polytope.corner[corners, 1] = i, j
        faces = _add_corner(polytope, corners, faces)
    for n in range(3):
        k = polytope.face[f, n]
        for m in range(3):
            simplex.w[n, m] = w[k, m]
        simplex.corner[n, 0], simplex.corner[n, 1] = polytope.corner[k, 0], polytope.corner[k, 1]
    # The corners of the face that bear the point nearest to 0.
    count = reduce_simplex(simplex, 3)
    return -polytope.plane[f, 0], -polytope.plane[f, 1], -polytope.plane[f, 2], gap, count
