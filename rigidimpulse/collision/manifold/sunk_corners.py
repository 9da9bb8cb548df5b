"""Contacts of corners of a mesh that are inside a convex polyhedron, deeper than smaller shapes can tell.

A corner p is inside where its height above every face f of the polyhedron, n_f.p - d_f, is below 0. The way out is the shortest along the
normal of the face above which it is least deep.
"""

from __future__ import annotations

from math import inf

import numpy as np

from rigidimpulse.collision.manifold.polyhedra import POINTS
from rigidimpulse.core.kernels import jit
from rigidimpulse.core.vector import along, row, turned_back_by, turned_by

SUNK = -5
"""First id of these contacts."""


@jit
def _height(solids, s, y, far):
    """Height of y (3,) above the highest of the faces of solid s, m, or more than `far`, and that face."""
    highest, at = -inf, solids.face_first[s]
    for f in range(solids.face_first[s], solids.face_first[s + 1]):
        plane = solids.plane[f]
        height = plane[0] * y[0] + plane[1] * y[1] + plane[2] * y[2] - plane[3]
        if height > highest:
            highest, at = height, f
            if highest > far:
                break
    return highest, at


@jit
def _insert(points, count, height, face, corner):
    """Put a corner among the `count` deepest ones, in order; returns how many there are."""
    real, ids = points
    place = min(count, POINTS - 1)
    if count == POINTS and height >= real[place, 9]:
        return count
    while place > 0 and real[place - 1, 9] > height:
        real[place, 9] = real[place - 1, 9]
        for k in range(3):
            ids[place, k] = ids[place - 1, k]
        place -= 1
    real[place, 9] = height
    ids[place, 0], ids[place, 1], ids[place, 2] = SUNK, face, corner
    return min(count + 1, POINTS)


@jit
def sunk_corners(geometry, solids, bodies, ends, allowed, points):
    """Write contacts, in the world, of the deepest corners of the mesh that is body ends[0] inside the solid that is body ends[1].

    allowed: depth up to which corners may be inside, m. points: `polyhedra.Points`; the first body of a contact is the one of lower rank.
    Returns their number; 0 if no corner is deeper than is allowed.
    """
    (i, j), (real, ids), count = ends, points, np.int64(0)
    s, shape = bodies.shape[j], bodies.shape[i]
    for p in range(geometry.shape_first[shape], geometry.shape_first[shape + 1]):
        for v in range(geometry.vertex_first[p], geometry.vertex_first[p + 1]):
            x, y, z = turned_by(bodies.rotation, i, geometry.vertex[v, 0], geometry.vertex[v, 1], geometry.vertex[v, 2])
            x, y, z = turned_back_by(
                bodies.rotation, j, x + bodies.position[i, 0] - bodies.position[j, 0], y + bodies.position[i, 1] - bodies.position[j, 1],
                z + bodies.position[i, 2] - bodies.position[j, 2],
            )  # fmt: skip
            height, face = _height(solids, s, (x, y, z), 0.0)
            if height <= 0.0:
                count = _insert(points, count, height, face, v)
    if count == 0 or real[0, 9] >= -allowed:
        return np.int64(0)
    for c in range(count):
        plane, corner = solids.plane[ids[c, 1]], geometry.vertex[ids[c, 2]]
        n = turned_by(bodies.rotation, j, plane[0], plane[1], plane[2])
        at = along(row(bodies.position, i), 1.0, turned_by(bodies.rotation, i, corner[0], corner[1], corner[2]))
        foot, sign, on_mesh, on_solid = along(at, -real[c, 9], n), -1.0 if i < j else 1.0, 0 if i < j else 3, 3 if i < j else 0
        for k in range(3):
            real[c, on_mesh + k], real[c, on_solid + k], real[c, 6 + k] = at[k], foot[k], sign * n[k]
    return count
