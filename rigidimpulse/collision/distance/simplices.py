"""Closest features of points, segments and triangles: scalar kernels on 3-tuples of float.

Segments are p + s d with s in [0, 1]. The closest points of two lines p + s d, q + t e follow from c = d x e:
    s = ((q - p) x e) . c / c^2,    t = ((q - p) x d) . c / c^2,
whose error grows as 1 / sin(angle); the usual determinant d^2 e^2 - (d . e)^2 loses twice as many digits (clamping to
the segments after Ericson, Real-Time Collision Detection, 2005, section 5.1.9).

A direction m across an edge points away from the wedge of its two faces when it lies in the arc between their normals
n_0, n_1 on the Gauss sphere: m . o_0 >= 0 and m . o_1 >= 0 with o_0 = e x n_0 and o_1 = n_1 x e, the directions that
leave each face across the edge (e: the unit direction of the edge in the winding of face 0).
"""

from __future__ import annotations

from math import inf, sqrt

import numpy as np

from rigidimpulse.collision.geometry import EDGE_BOUNDARY, EDGE_CAPSULE, EDGE_CONVEX
from rigidimpulse.core.kernels import jit
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.core.vector import along, cross, dot, subtract

inner = jit
"""Marks a kernel that is only ever a part of other kernels."""

VERTEX_FACE, FACE_VERTEX, EDGE_EDGE, CORNER, HALF_SPACE_CONTACT = (np.int64(kind) for kind in range(5))
"""Kinds of contact. Features: vertex and triangle, two edges, 2 * vertex or 2 * edge + 1, vertex and primitive.

(Plain integers would be literals, and kernels would be compiled once for each.)
"""

PARALLEL = TOLERANCES.distance.parallel_segments


@inner
def edge_normals(array, edge):
    """Return both normals of an edge from an array (E, 2, 3) as tuples."""
    return (
        (array[edge, 0, 0], array[edge, 0, 1], array[edge, 0, 2]),
        (array[edge, 1, 0], array[edge, 1, 1], array[edge, 1, 2]),
    )


@jit
def closest_on_segments(p, d, q, e):
    """Return (s, t) of the closest points p + s d and q + t e of two segments; either may be a point (zero length)."""
    d_squared = dot(d, d)
    e_squared = dot(e, e)
    between = subtract(q, p)
    if d_squared == 0.0:
        return 0.0, 0.0 if e_squared == 0.0 else min(1.0, max(0.0, -dot(between, e) / e_squared))
    s = 0.0
    if e_squared > 0.0:
        c = cross(d, e)
        c_squared = dot(c, c)
        if c_squared > PARALLEL * PARALLEL * d_squared * e_squared:
            s = min(1.0, max(0.0, dot(cross(between, e), c) / c_squared))
        t = (s * dot(d, e) - dot(between, e)) / e_squared
        if 0.0 <= t <= 1.0:
            return s, t
        t = min(1.0, max(0.0, t))
    else:
        t = 0.0
    return min(1.0, max(0.0, (dot(between, d) + t * dot(d, e)) / d_squared)), t


@jit
def over_triangle(p, a, b, c, normal, slack_ab, slack_bc, slack_ca):
    """Tell whether `p` projects into triangle abc along its unit normal, each side moved outwards by a slack [m]."""
    side = subtract(b, a)
    if dot(cross(normal, side), subtract(p, a)) < -slack_ab * sqrt(dot(side, side)):
        return False
    side = subtract(c, b)
    if dot(cross(normal, side), subtract(p, b)) < -slack_bc * sqrt(dot(side, side)):
        return False
    side = subtract(a, c)
    return dot(cross(normal, side), subtract(p, c)) >= -slack_ca * sqrt(dot(side, side))


@jit
def pierces_triangle(p, q, a, b, c, normal):
    """Tell whether the segment pq runs through triangle abc."""
    height_p = dot(subtract(p, a), normal)
    height_q = dot(subtract(q, a), normal)
    if height_p * height_q > 0.0 or height_p == height_q:
        return False
    return over_triangle(along(p, height_p / (height_p - height_q), subtract(q, p)), a, b, c, normal, 0.0, 0.0, 0.0)


@jit
def arc_miss(direction, edge_direction, normal_0, normal_1, kind):
    """Return (miss, end): how far a unit direction across an edge misses its arc, and the end of the arc next to it.

    `miss` is the sine of the angle, negative inside the arc; `edge_direction` is the unit direction of the edge in the
    winding of face 0. The arc of a boundary is the half circle beyond its one face; a capsule's is the whole circle.
    """
    beyond_0 = -dot(direction, cross(edge_direction, normal_0))
    if kind == EDGE_CONVEX:
        beyond_1 = -dot(direction, cross(normal_1, edge_direction))
        behind = -dot(direction, normal_0) - dot(direction, normal_1)
        return max(beyond_0, beyond_1, behind), normal_0 if beyond_0 > beyond_1 else normal_1
    if kind == EDGE_BOUNDARY:
        if normal_0[0] != normal_1[0] or normal_0[1] != normal_1[1] or normal_0[2] != normal_1[2]:
            return -1.0, direction  # more than two faces: any direction may be free
        back = (-normal_0[0], -normal_0[1], -normal_0[2])
        return beyond_0, normal_0 if dot(direction, normal_0) > 0.0 else back
    return -1.0 if kind == EDGE_CAPSULE else inf, direction


@inner
def in_edge_arc(direction, edge_direction, normal_0, normal_1, kind, tolerance):
    """Tell whether a unit direction across an edge misses its arc by no more than a tolerance (see `arc_miss`)."""
    return arc_miss(direction, edge_direction, normal_0, normal_1, kind)[0] <= tolerance
