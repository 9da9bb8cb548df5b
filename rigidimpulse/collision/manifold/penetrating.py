"""Contacts of convex bodies deeper inside each other than the smaller shapes allow: polyhedra, and prisms in place of cylinders.

The gap of two convex bodies along a unit normal n from a to b is  s(n) = min_b n.x - max_a n.x;  they are apart if and only if
some s is above 0, and the contacts of bodies that are apart have such a normal. If there is none, `convex_convex` gives the contacts.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import cos, inf, pi, sqrt

import numpy as np

from rigidimpulse.collision.geometry import CYLINDER, ROUND, CompiledShape, Geometry, build_geometry, compile_shape
from rigidimpulse.collision.manifold.convex_convex import hull_contacts
from rigidimpulse.collision.manifold.polyhedra import Pair, Polyhedra, Query, make_polyhedra
from rigidimpulse.core.kernels import jit
from rigidimpulse.core.portable import cosine, length, sine
from rigidimpulse.core.vector import cross_arrays
from rigidimpulse.scene.shape import Shape

FLUSH = 0.02
"""Gap, in inner radii, below which the points of a face are contacts, too."""
SIDES = 32
"""Sides of the prism in a cylinder. It is 0.5 % of the radius inside, less than the smaller cylinder of the search."""


def solids(
    shapes: Sequence[CompiledShape], geometry: Geometry, convex: np.ndarray, polyhedra: Polyhedra
) -> tuple[Polyhedra, np.ndarray, np.ndarray]:
    """Polyhedra in the shapes: `convex` ones (s,) bool, whose tables are there; prisms in cylinders, axes of capsules, centres of balls.

    Returns them; which shapes are cylinders (s,) bool; and how far each is inside its shape at most (s,), m. Other shapes have no corners.
    """
    first = geometry.shape_first
    single, kind, radius = np.diff(first) == 1, geometry.kind[first[:-1]], geometry.radius[first[:-1]]
    drum, ball = single & (kind == CYLINDER), single & (kind == ROUND) & (radius > 0.0)
    inset = np.where(drum, (1.0 - cos(pi / SIDES)) * radius, np.where(ball, radius, 0.0))
    if not inset.any():
        return polyhedra, drum, inset
    none = compile_shape(Shape.box(1.0), np.zeros(3), np.eye(3))
    known = [_prism(geometry, int(first[s])) if drum[s] else shape if convex[s] or ball[s] else none for s, shape in enumerate(shapes)]
    return make_polyhedra(build_geometry(known), convex | drum, ball), drum, inset


def _prism(geometry: Geometry, p: int) -> CompiledShape:
    """The prism of SIDES in a cylinder."""
    centre, axis, half = geometry.frame[p, :3], geometry.frame[p, 3:6], geometry.frame[p, 6]
    u = cross_arrays(axis, np.eye(3)[np.argmin(np.abs(axis))])
    u /= length(u)
    turn = 2.0 * np.pi * np.arange(SIDES)[:, None] / SIDES
    rim = centre + geometry.radius[p] * (cosine(turn) * u + sine(turn) * cross_arrays(axis, u))
    return compile_shape(Shape.convex_hull(np.vstack([rim - half * axis, rim + half * axis])), np.zeros(3), np.eye(3))


@jit
def support(geometry, p, x, r, n, sign):
    """Largest sign n.x over the finite primitive p at the pose x, r."""
    a = sign * (r[0, 0] * n[0] + r[1, 0] * n[1] + r[2, 0] * n[2])
    b = sign * (r[0, 1] * n[0] + r[1, 1] * n[1] + r[2, 1] * n[2])
    c = sign * (r[0, 2] * n[0] + r[1, 2] * n[1] + r[2, 2] * n[2])
    best = -inf
    if geometry.kind[p] == CYLINDER:
        f = geometry.frame
        along = a * f[p, 3] + b * f[p, 4] + c * f[p, 5]
        across = geometry.radius[p] * sqrt(max(a * a + b * b + c * c - along * along, 0.0))
        best = a * f[p, 0] + b * f[p, 1] + c * f[p, 2] + f[p, 6] * abs(along) + across
    for v in range(geometry.vertex_first[p], geometry.vertex_first[p + 1]):
        best = max(best, a * geometry.vertex[v, 0] + b * geometry.vertex[v, 1] + c * geometry.vertex[v, 2])
    if geometry.kind[p] == ROUND:
        best += geometry.radius[p]
    return best + sign * (n[0] * x[0] + n[1] * x[1] + n[2] * x[2])


@jit
def supports(geometry, s, x, r, n, out):
    """Largest n.x over the finite shape s at the pose x, r, for each direction n (k, 3), into out (k,)."""
    for k in range(n.shape[0]):
        out[k] = -inf
        for p in range(geometry.shape_first[s], geometry.shape_first[s + 1]):
            out[k] = max(out[k], support(geometry, p, x, r, n[k], 1.0))


@jit
def gap_along(geometry, bodies, a, b, shapes, n):
    """s(n) of bodies a and b with such shapes (two of them), each of one primitive, m."""
    p, q = geometry.shape_first[shapes[0]], geometry.shape_first[shapes[1]]
    low = -support(geometry, q, bodies.position[b], bodies.rotation[b], n, -1.0)
    return low - support(geometry, p, bodies.position[a], bodies.rotation[a], n, 1.0)


@jit
def overlap_contacts(polyhedra, bodies, a, b, size, scratch, points):
    """Write the contacts, in the world, of two bodies inside each other; returns their number.

    polyhedra: with prisms for cylinders; size: smaller inner radius, m.
    """
    between, real = scratch.between, points.real
    for k in range(3):
        between[k] = bodies.position[b, k] - bodies.position[a, k]
    pair = Pair(bodies.rotation, bodies.velocity, a, b, bodies.shape[a], bodies.shape[b])
    count, gap = hull_contacts(polyhedra, pair, Query(FLUSH * size, 0.0, size), scratch, points)
    if gap > 0.0:
        return np.int64(0)
    for n in range(count):
        for k in range(3):
            real[n, k] += bodies.position[a, k]
            real[n, 3 + k] += bodies.position[a, k]
    return count
