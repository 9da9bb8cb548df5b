"""Convex bodies of a heap that have sunk into each other farther than the contact kernels bear: polyhedra, and prisms for cylinders.

The gap of two convex bodies along a unit normal n from a to b is  s(n) = min_b n.x - max_a n.x;  they are apart just if some s is
above 0, and the contacts of bodies apart have one such normal. Where there is none the largest s among the normals of faces
and the cross products of edges (the separating axes; Gottschalk, Lin and Manocha 1996) tells how to push them apart.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import inf, sqrt

import numpy as np

from rigidimpulse._jit import jit
from rigidimpulse.geometry import CYLINDER, CompiledShape, Geometry, build_geometry, compile_shape
from rigidimpulse.shape import Shape

FLUSH = 0.02
"""Inner radii above the deepest point within which points of a face press, too."""
MOST_EDGES = 4096
"""Products of edges beyond which only faces are asked."""
OVERLAP = np.int64(9)
"""Kind of these contacts."""
SIDES = 32
"""Of the prism in a cylinder: 0.5 % of the radius inside it, less than what cylinders are made smaller by for the contact kernels."""


def solids(shapes: Sequence[CompiledShape], geometry: Geometry, convex: np.ndarray) -> tuple[Geometry, np.ndarray]:
    """The shapes with prisms for those that are one cylinder, and which these are (s,) bool.

    Shapes that are neither cylinders nor `convex` (s,) polyhedra are not asked for, and replaced by something small.
    """
    first = geometry.shape_first
    round_ = np.array([first[s + 1] == first[s] + 1 and geometry.kind[first[s]] == CYLINDER for s in range(len(shapes))], bool)
    if not round_.any():
        return geometry, round_
    none = compile_shape(Shape.box(1.0), np.zeros(3), np.eye(3))
    out = []
    for s, shape in enumerate(shapes):
        out.append(_prism(geometry, int(first[s])) if round_[s] else shape if convex[s] else none)
    return build_geometry(out), round_


def _prism(geometry: Geometry, p: int) -> CompiledShape:
    """The prism of SIDES in a cylinder."""
    centre, axis, half = geometry.frame[p, :3], geometry.frame[p, 3:6], geometry.frame[p, 6]
    u, v = np.linalg.svd(axis[None])[2][1:]
    turn = 2.0 * np.pi * np.arange(SIDES)[:, None] / SIDES
    rim = centre + geometry.radius[p] * (np.cos(turn) * u + np.sin(turn) * v)
    return compile_shape(Shape.convex_hull(np.vstack([rim - half * axis, rim + half * axis])), np.zeros(3), np.eye(3))


@jit
def support(geometry, p, x, r, n, sign):
    """Largest sign n.x over the vertices of primitive p at the pose x, r."""
    a = sign * (r[0, 0] * n[0] + r[1, 0] * n[1] + r[2, 0] * n[2])
    b = sign * (r[0, 1] * n[0] + r[1, 1] * n[1] + r[2, 1] * n[2])
    c = sign * (r[0, 2] * n[0] + r[1, 2] * n[1] + r[2, 2] * n[2])
    best = -inf
    for v in range(geometry.vertex_first[p], geometry.vertex_first[p + 1]):
        best = max(best, a * geometry.vertex[v, 0] + b * geometry.vertex[v, 1] + c * geometry.vertex[v, 2])
    return best + sign * (n[0] * x[0] + n[1] * x[1] + n[2] * x[2])


@jit
def gap_along(geometry, bodies, a, b, p, q, n):
    """s(n) of bodies a and b with the primitives p and q, m."""
    low = -support(geometry, q, bodies.position[b], bodies.rotation[b], n, -1.0)
    return low - support(geometry, p, bodies.position[a], bodies.rotation[a], n, 1.0)


@jit
def _try_faces(geometry, bodies, a, b, p, q, carrier, sign, best, normal):
    """The best s among the face normals of a (sign 1) or b (sign -1), the carrier; normal is set to it."""
    face = q if sign < 0.0 else p
    r = bodies.rotation[carrier]
    n = np.empty(3)
    for t in range(geometry.triangle_first[face], geometry.triangle_first[face + 1]):
        m = geometry.triangle_normal[t]
        for k in range(3):
            n[k] = sign * (r[k, 0] * m[0] + r[k, 1] * m[1] + r[k, 2] * m[2])
        s = gap_along(geometry, bodies, a, b, p, q, n)
        if best == -inf or s > best + 1e-12 * abs(best):
            best = s
            normal[:] = n
        if best > 0.0:
            break
    return best


@jit
def _edge(geometry, e, r, out):
    i, j = geometry.edge[e, 0], geometry.edge[e, 1]
    x = geometry.vertex[j, 0] - geometry.vertex[i, 0]
    y = geometry.vertex[j, 1] - geometry.vertex[i, 1]
    z = geometry.vertex[j, 2] - geometry.vertex[i, 2]
    for k in range(3):
        out[k] = r[k, 0] * x + r[k, 1] * y + r[k, 2] * z


@jit
def _try_edges(geometry, bodies, a, b, p, q, best, normal):
    """The same among the cross products of edges; an edge must win by a little over faces."""
    d, e, n = np.empty(3), np.empty(3), np.empty(3)
    between = bodies.position[b] - bodies.position[a]
    won = False
    for i in range(geometry.edge_first[p], geometry.edge_first[p + 1]):
        _edge(geometry, i, bodies.rotation[a], d)
        for j in range(geometry.edge_first[q], geometry.edge_first[q + 1]):
            _edge(geometry, j, bodies.rotation[b], e)
            n[0], n[1], n[2] = d[1] * e[2] - d[2] * e[1], d[2] * e[0] - d[0] * e[2], d[0] * e[1] - d[1] * e[0]
            square = n[0] * n[0] + n[1] * n[1] + n[2] * n[2]
            size = (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]) * (e[0] * e[0] + e[1] * e[1] + e[2] * e[2])
            if square <= 1e-6 * size:
                continue
            sign = 1.0 if n[0] * between[0] + n[1] * between[1] + n[2] * between[2] > 0.0 else -1.0
            for k in range(3):
                n[k] *= sign / sqrt(square)
            s = gap_along(geometry, bodies, a, b, p, q, n)
            if s > best + 0.05 * abs(best):
                best, won = s, True
                normal[:] = n
    return best, won


@jit
def deepest_normal(geometry, bodies, a, b, p, q, normal):
    """The normal of largest s, or any with s > 0, into normal (3,); returns s and whether the face, if it is one, is b's."""
    best = _try_faces(geometry, bodies, a, b, p, q, a, 1.0, -inf, normal)
    if best > 0.0:
        return best, False
    of_a = best
    best = _try_faces(geometry, bodies, a, b, p, q, b, -1.0, best, normal)
    of_b = best > of_a
    edges_a = geometry.edge_first[p + 1] - geometry.edge_first[p]
    if best < 0.0 and edges_a * (geometry.edge_first[q + 1] - geometry.edge_first[q]) <= MOST_EDGES:
        best, won = _try_edges(geometry, bodies, a, b, p, q, best, normal)
        of_b = of_b and not won
    return best, of_b


@jit
def overlap_contacts(geometry, bodies, a, b, p, q, normal, depth, of_b, flush, real, integer):
    """Contacts of the points of one body that lie deepest in the other, as the contact kernels write them; returns their number.

    depth: s(normal); of_b: the normal belongs to b, so the points are a's. real (cap, 10), integer (cap, 3).
    """
    points, i, sign = (p, a, 1.0) if of_b else (q, b, -1.0)
    x, r = bodies.position[i], bodies.rotation[i]
    far = support(geometry, points, x, r, normal, sign)
    count = 0
    for v in range(geometry.vertex_first[points], geometry.vertex_first[points + 1]):
        if count == real.shape[0]:
            break
        at = r @ geometry.vertex[v] + x
        short = far - sign * (at[0] * normal[0] + at[1] * normal[1] + at[2] * normal[2])
        if short > flush:
            continue
        gap = depth + short
        for k in range(3):
            real[count, k] = at[k] if of_b else at[k] - gap * normal[k]
            real[count, 3 + k] = at[k] + gap * normal[k] if of_b else at[k]
            real[count, 6 + k] = normal[k]
        real[count, 9] = gap
        integer[count, 0], integer[count, 1], integer[count, 2] = OVERLAP, v, np.int64(of_b)
        count += 1
    return count
