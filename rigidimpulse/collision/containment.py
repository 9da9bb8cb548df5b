"""Is a point inside a solid? Exact answers, also for points in line with vertices and edges.

Convex solid (animation notes: point in convex polyhedron): p is inside where orient(a, b, c, p) >= 0 for every face,

    orient(a, b, c, p) = (a - p) . ((b - p) x (c - p))    > 0 behind the face, 0 in its plane.

Any solid (point in concave polyhedron): a ray from p along +x leaves the surface as often as it enters it, plus the
winding number of p, so p is inside where the signed count of crossings is not zero. For one clean surface this is ray
parity; it also holds where parts of a mesh overlap. A ray through an edge or a vertex counts as moved by (0,
e^2, e) with e > 0 infinitely small (Edelsbrunner & Mücke 1990, simulation of simplicity): then it meets no edge, and
every crossing belongs to one face.

Points on the surface are inside. Signs of the two determinants (orientation in the plane, orientation in space) are
exact: plain floating point where its error bound allows, otherwise a sum of exact products (Shewchuk 1997, adaptive
precision arithmetic).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from rigidimpulse.collision.distance.simplices import inner
from rigidimpulse.collision.geometry import CYLINDER, HALF_SPACE, ROUND, Geometry, build_geometry, compile_shape
from rigidimpulse.core.kernels import jit, jit_making_arrays
from rigidimpulse.scene.shape import Shape

_EPSILON = 2.0**-53
_PLANE_BOUND = (3.0 + 16.0 * _EPSILON) * _EPSILON  # Shewchuk's bounds of the error of the two determinants
_SPACE_BOUND = (7.0 + 56.0 * _EPSILON) * _EPSILON
_SPLITTER = 2.0**27 + 1.0
_NUM_TERMS = 192  # terms of the determinant in space, written out
_ON_SURFACE = 2
_STACK_SIZE = 128  # a tree of leaves holding at least one triangle is less deep


def contains(shape: Shape, points: ArrayLike) -> np.ndarray:
    """Say which points lie inside a shape or on its surface.

    Args:
        shape: any shape; parts of a compound count as their union, open meshes contain nothing.
        points: (k, 3) m, in the frame of the shape.

    Returns:
        (k,) bool.

    Raises:
        SceneError: the shape has no valid surface (see `Shape.check`).

    """
    return points_inside(build_geometry([compile_shape(shape, np.zeros(3), np.eye(3))]), 0, points)


def points_inside(geometry: Geometry, shape: int, points: ArrayLike) -> np.ndarray:
    """The same, (k,) bool, for the shape of an index of compiled ones, in its own frame."""
    points = np.ascontiguousarray(points, dtype=np.float64).reshape(-1, 3)
    inside = np.zeros(len(points), dtype=np.bool_)
    points_in_shape(geometry, shape, points, inside)
    return inside


@jit
def points_in_shape(geometry, shape, points, inside):
    """Mark in `inside` (k,) bool which `points` (k, 3), in the shape's frame, lie in any primitive of the shape."""
    for k in range(points.shape[0]):
        point = (points[k, 0], points[k, 1], points[k, 2])
        inside[k] = False
        for primitive in range(geometry.shape_first[shape], geometry.shape_first[shape + 1]):
            if geometry.kind[primitive] != ROUND or geometry.radius[primitive] > 0.0:
                first, last = geometry.vertex_first[primitive], geometry.vertex_first[primitive + 1] - 1
                radius = geometry.radius[primitive]
                inside[k] = _in_curved(
                    geometry.kind[primitive], geometry.frame[primitive], radius, geometry.vertex, first, last, point
                )
            elif geometry.closed[primitive]:
                inside[k] = point_in_mesh(geometry, primitive, point)
            if inside[k]:
                break


@inner
def _in_curved(kind, frame, radius, vertex, first, last, point):
    """Say whether a point lies in a half space, a cylinder, or within `radius` of the segment between two vertices."""
    x, y, z = point
    if kind == HALF_SPACE:
        return frame[0] * x + frame[1] * y + frame[2] * z <= frame[3]
    if kind == CYLINDER:
        x, y, z = x - frame[0], y - frame[1], z - frame[2]
        dx, dy, dz = frame[3], frame[4], frame[5]
        along = x * dx + y * dy + z * dz
        # Beyond a cap; between the caps the distance from the axis decides.
        if abs(along) > frame[6]:
            return False
    else:
        dx = vertex[last, 0] - vertex[first, 0]
        dy = vertex[last, 1] - vertex[first, 1]
        dz = vertex[last, 2] - vertex[first, 2]
        x, y, z = x - vertex[first, 0], y - vertex[first, 1], z - vertex[first, 2]
        length_squared = dx * dx + dy * dy + dz * dz
        along = min(max((x * dx + y * dy + z * dz) / length_squared, 0.0), 1.0) if length_squared > 0.0 else 0.0
    x, y, z = x - along * dx, y - along * dy, z - along * dz
    return x * x + y * y + z * z <= radius * radius


@jit_making_arrays
def point_in_convex(geometry, primitive, point):
    """Say whether `point` (x, y, z) lies behind all face planes of a convex polyhedron."""
    terms = np.empty(_NUM_TERMS)
    for t in range(geometry.triangle_first[primitive], geometry.triangle_first[primitive + 1]):
        a, b, c = _corners(geometry.vertex, geometry.triangle, t)
        if space_orientation(a, b, c, point, terms) < 0:
            return False
    return True


@jit_making_arrays
def point_in_mesh(geometry, primitive, point):
    """Say whether `point` (x, y, z) lies in a closed polyhedron, by the signed crossings of the ray along +x."""
    terms = np.empty(_NUM_TERMS)
    stack = np.empty(_STACK_SIZE, np.int64)
    stack[0] = geometry.node_first[primitive]
    depth = 1
    winding = 0
    while depth > 0:
        depth -= 1
        node = stack[depth]
        low, high = geometry.node_min[node], geometry.node_max[node]
        beside = point[1] < low[1] or point[1] > high[1] or point[2] < low[2] or point[2] > high[2]
        # The ray runs along +x: boxes beside it or behind its start are not met.
        if beside or point[0] > high[0]:
            continue
        child = geometry.node_child[node]
        if child >= 0:
            stack[depth] = child
            stack[depth + 1] = child + 1
            depth += 2
            continue
        first = geometry.node_start[node]
        for t in range(first, first + geometry.node_count[node]):
            a, b, c = _corners(geometry.vertex, geometry.triangle, t)
            crossing = _crossing(a, b, c, point, terms)
            if crossing == _ON_SURFACE:
                return True
            winding += crossing
    return winding != 0


@inner
def _corners(vertex, triangle, t):
    i, j, k = triangle[t, 0], triangle[t, 1], triangle[t, 2]
    a = (vertex[i, 0], vertex[i, 1], vertex[i, 2])
    b = (vertex[j, 0], vertex[j, 1], vertex[j, 2])
    c = (vertex[k, 0], vertex[k, 1], vertex[k, 2])
    return a, b, c


@inner
def _crossing(a, b, c, p, terms):
    """Return how often the ray p + s x, s > 0, leaves through a triangle: 1, 0 or -1; or _ON_SURFACE."""
    if p[0] > max(a[0], b[0], c[0]):
        return 0
    outward = 0  # sign of the normal's x if the ray's line meets the triangle, else 0
    u = c
    for v in (a, b, c):
        if (u[1] <= p[1]) != (v[1] <= p[1]):  # the edge passes p in y: count it if it does so above p, in z
            upward = u[1] <= p[1]
            low, high = (u, v) if upward else (v, u)
            if plane_orientation(low[1], low[2], high[1], high[2], p[1], p[2], terms) < 0:
                outward += -1 if upward else 1
        u = v
    if p[0] < min(a[0], b[0], c[0]):
        return outward
    side = space_orientation(a, b, c, p, terms)
    if side == 0 and _in_triangle(a, b, c, p, terms):
        return _ON_SURFACE
    return outward if side == outward else 0


@inner
def _in_triangle(a, b, c, p, terms):
    """Say whether a point of the triangle's plane lies in the closed triangle: it does if in all three projections."""
    for _ in range(3):
        if p[0] < min(a[0], b[0], c[0]) or p[0] > max(a[0], b[0], c[0]):
            return False
        lowest, highest = 0, 0
        u = c
        for v in (a, b, c):
            side = plane_orientation(u[1], u[2], v[1], v[2], p[1], p[2], terms)
            lowest, highest = min(lowest, side), max(highest, side)
            u = v
        if lowest < 0 and highest > 0:
            return False
        a, b, c, p = (a[1], a[2], a[0]), (b[1], b[2], b[0]), (c[1], c[2], c[0]), (p[1], p[2], p[0])
    return True


@jit
def plane_orientation(ax, ay, bx, by, px, py, terms):
    """Return the exact sign of (b - a) x (p - a) in the plane: 1 where p lies left of the line from a to b.

    `terms` (192,) is free to be written to.
    """
    left = (bx - ax) * (py - ay)
    right = (by - ay) * (px - ax)
    determinant = left - right
    bound = _PLANE_BOUND * (abs(left) + abs(right))
    if determinant > bound:
        return 1
    if determinant < -bound:
        return -1
    count = _add_products(terms, 0, 1.0, _difference(bx, ax), _difference(py, ay), (1.0, 0.0))
    count = _add_products(terms, count, -1.0, _difference(by, ay), _difference(px, ax), (1.0, 0.0))
    return _sign_of_sum(terms, count)


@jit
def space_orientation(a, b, c, p, terms):
    """Return the exact sign of (a - p) . ((b - p) x (c - p)): 1 where p lies behind the triangle a, b, c.

    `terms` (192,) is free to be written to.
    """
    ax, ay, az = a[0] - p[0], a[1] - p[1], a[2] - p[2]
    bx, by, bz = b[0] - p[0], b[1] - p[1], b[2] - p[2]
    cx, cy, cz = c[0] - p[0], c[1] - p[1], c[2] - p[2]
    bc, cb, ca, ac, ab, ba = by * cz, bz * cy, cy * az, cz * ay, ay * bz, az * by
    determinant = ax * (bc - cb) + bx * (ca - ac) + cx * (ab - ba)
    size = abs(ax) * (abs(bc) + abs(cb)) + abs(bx) * (abs(ca) + abs(ac)) + abs(cx) * (abs(ab) + abs(ba))
    # The error bound decides most cases; only the others need exact products.
    if determinant > _SPACE_BOUND * size:
        return 1
    if determinant < -_SPACE_BOUND * size:
        return -1
    count = 0
    for _ in range(3):
        x = _difference(a[0], p[0])
        count = _add_products(terms, count, 1.0, x, _difference(b[1], p[1]), _difference(c[2], p[2]))
        count = _add_products(terms, count, -1.0, x, _difference(b[2], p[2]), _difference(c[1], p[1]))
        a, b, c, p = (a[1], a[2], a[0]), (b[1], b[2], b[0]), (c[1], c[2], c[0]), (p[1], p[2], p[0])
    return _sign_of_sum(terms, count)


@inner
def _difference(a, b):
    """Return (d, e), d + e = a - b exactly."""
    difference = a - b
    lost = a - difference
    return difference, (a - (difference + lost)) + (lost - b)


@inner
def _product(a, b):
    """Return (p, e), p + e = a b exactly (Dekker), without underflow."""
    product = a * b
    high = _SPLITTER * a
    a_high = high - (high - a)
    a_low = a - a_high
    high = _SPLITTER * b
    b_high = high - (high - b)
    b_low = b - b_high
    return product, a_low * b_low - (((product - a_high * b_high) - a_low * b_high) - a_high * b_low)


@inner
def _add_products(terms, count, sign, x, y, z):
    """Append the exact terms of sign x y z, each factor a sum of two floats, without zeros; return the new count."""
    for i in range(2):
        for j in range(2):
            product, rest = _product(x[i], y[j])
            for k in range(2):
                high, low = _product(product, z[k])
                higher, lower = _product(rest, z[k])
                for term in (high, low, higher, lower):
                    if term != 0.0:
                        terms[count] = sign * term
                        count += 1
    return count


@inner
def _sign_of_sum(terms, count):
    """Return the exact sign of the sum of `count` floats: Shewchuk's growing expansion, in place."""
    for i in range(count):
        total = terms[i]
        for k in range(i):
            part = terms[k]
            grown = total + part
            virtual = grown - total
            terms[k] = (total - (grown - virtual)) + (part - virtual)
            total = grown
        terms[i] = total
    for i in range(count - 1, -1, -1):
        if terms[i] != 0.0:
            return 1 if terms[i] > 0.0 else -1
    return 0
