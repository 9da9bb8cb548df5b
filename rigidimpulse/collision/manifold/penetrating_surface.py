"""Surfaces of triangles as the penalty method sees them: prisms for cylinders, axes of corners, nearest points. See `penetrating_points`.

Source: Ericson, Real-Time Collision Detection, 2005, section 5.1.5 (nearest point of a triangle).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import inf
from typing import NamedTuple

import numpy as np

from rigidimpulse.collision.bvh import STACK_ROWS
from rigidimpulse.collision.geometry import CYLINDER, EDGE_CAPSULE, EDGE_HIDDEN, ROUND, CompiledShape, Geometry, Primitive, build_geometry
from rigidimpulse.core.kernels import jit, jit_making_arrays
from rigidimpulse.core.portable import cosine, length, sine
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.core.vector import along, dot, row, subtract

SIDES = 24
"""Sides of the prism that stands for a cylinder."""
ON_FACE = TOLERANCES.manifold.on_face
NUDGE = TOLERANCES.manifold.nudge


def solid_geometry(shapes: Sequence[CompiledShape]) -> Geometry:
    """Geometry of compiled shapes with a prism of SIDES sides in the place of each cylinder."""
    solids = [
        replace(shape, primitives=tuple(_prism(p) if p.kind == CYLINDER else p for p in shape.primitives)) for shape in shapes
    ]
    return build_geometry(solids)


def _prism(cylinder: Primitive) -> Primitive:
    """Prism inside a cylinder."""
    centre, axis, half = cylinder.frame[:3], cylinder.frame[3:6], cylinder.frame[6]
    u = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    u /= length(u)
    angle, k = 2.0 * np.pi * np.arange(SIDES) / SIDES, np.arange(SIDES)
    rim = cylinder.radius * (cosine(angle)[:, None] * u + sine(angle)[:, None] * np.cross(axis, u))
    following, zero = (k + 1) % SIDES, np.zeros(SIDES - 2, np.int64)
    side = [np.stack([k, following, following + SIDES], 1), np.stack([k, following + SIDES, k + SIDES], 1)]
    bottom, top = np.stack([zero, k[2:], k[1:-1]], 1), np.stack([zero, k[1:-1], k[2:]], 1) + SIDES
    vertices = np.concatenate([centre - half * axis + rim, centre + half * axis + rim])
    return Primitive(ROUND, vertices=vertices, faces=np.concatenate([*side, bottom, top]))


class Solids(NamedTuple):
    """The shapes of a scene as the penalty method reads them."""

    geometry: Geometry
    axes: np.ndarray  # (V, 3) and
    sizes: np.ndarray  # (V,) m, see `inward_axes`


class BodyPoses(NamedTuple):
    """Where n bodies are: centres of mass and principal frames."""

    position: np.ndarray  # (n, 3) m
    rotation: np.ndarray  # (n, 3, 3)


class PointBuffer(NamedTuple):
    """Points inside other bodies, as they are found."""

    real: np.ndarray  # (c, 7) a point of the line of action and the normal from a to b, world, and the depth, m
    integer: np.ndarray  # (c, 4) a, b, and what is in contact: a vertex of one; of the other a vertex, or a primitive p as -1 - p


def inward_axes(geometry: Geometry) -> tuple[np.ndarray, np.ndarray]:
    """Mean direction (V, 3) of the visible edges that leave each vertex of a surface, unit or 0, in the frame of its shape.

    And the length (V,) m of the shortest of them, 0 where there is none.
    """
    total = np.zeros_like(geometry.vertex)
    tail, head = geometry.edge[(geometry.edge_kind != EDGE_HIDDEN) & (geometry.edge_kind != EDGE_CAPSULE)].T
    way = geometry.vertex[head] - geometry.vertex[tail]
    long = np.linalg.norm(way, axis=1)
    way /= long[:, None]
    size = np.full(len(total), np.inf)
    np.minimum.at(size, tail, long)
    np.minimum.at(size, head, long)
    np.add.at(total, tail, way)
    np.add.at(total, head, -way)
    length = np.linalg.norm(total, axis=1)[:, None]
    return np.where(length > ON_FACE, total / np.maximum(length, ON_FACE), 0.0), np.where(np.isfinite(size), size, 0.0)


@jit
def _nearest_on_triangle(p, a, b, c):
    """Nearest point of triangle abc to p."""
    ab, ac, ap = subtract(b, a), subtract(c, a), subtract(p, a)
    d1, d2 = dot(ab, ap), dot(ac, ap)
    if d1 <= 0.0 and d2 <= 0.0:
        return a
    bp = subtract(p, b)
    d3, d4 = dot(ab, bp), dot(ac, bp)
    if d3 >= 0.0 and d4 <= d3:
        return b
    vc = d1 * d4 - d3 * d2
    if vc <= 0.0 and d1 >= 0.0 and d3 <= 0.0:
        return along(a, d1 / (d1 - d3), ab)
    cp = subtract(p, c)
    d5, d6 = dot(ab, cp), dot(ac, cp)
    if d6 >= 0.0 and d5 <= d6:
        return c
    vb = d5 * d2 - d1 * d6
    if vb <= 0.0 and d2 >= 0.0 and d6 <= 0.0:
        return along(a, d2 / (d2 - d6), ac)
    va = d3 * d6 - d5 * d4
    if va <= 0.0 and d4 - d3 >= 0.0 and d5 - d6 >= 0.0:
        return along(b, (d4 - d3) / ((d4 - d3) + (d5 - d6)), subtract(c, b))
    size = va + vb + vc
    return along(along(a, vb / size, ab), vc / size, ac)


@jit
def box_squared(geometry, node, p):
    """Squared distance of a point from the box of a node."""
    total = 0.0
    for k in range(3):
        off = max(0.0, geometry.node_min[node, k] - p[k], p[k] - geometry.node_max[node, k])
        total += off * off
    return total


@jit_making_arrays
def nearest_on_surface(geometry, primitive, p, axis):
    """Nearest point of a surface of triangles to p (x, y, z) in its frame: squared distance, point, triangle.

    axis: if not 0, triangles count whose normals do not point against it; the triangle is -1 if none does.
    """
    free = axis[0] == 0.0 and axis[1] == 0.0 and axis[2] == 0.0
    stack = np.empty(STACK_ROWS, np.int64)
    stack[0] = geometry.node_first[primitive]
    depth, best, nearest, place = 1, inf, p, np.int64(-1)
    while depth > 0:
        depth -= 1
        node = stack[depth]
        if box_squared(geometry, node, p) >= best:
            continue
        child = geometry.node_child[node]
        if child >= 0:
            # The nearer box is walked first, so that the farther one can be left out.
            first_is_nearer = box_squared(geometry, child, p) <= box_squared(geometry, child + 1, p)
            stack[depth] = child + 1 if first_is_nearer else child
            stack[depth + 1] = child if first_is_nearer else child + 1
            depth += 2
            continue
        start = geometry.node_start[node]
        for t in range(start, start + geometry.node_count[node]):
            if not (free or dot(axis, row(geometry.triangle_normal, t)) > 0.0):
                continue
            corner = geometry.triangle[t]
            a, b, c = row(geometry.vertex, corner[0]), row(geometry.vertex, corner[1]), row(geometry.vertex, corner[2])
            q = _nearest_on_triangle(p, a, b, c)
            off = subtract(q, p)
            if dot(off, off) < best:
                best, nearest, place = dot(off, off), q, t
    return best, nearest, place


@jit
def add_point(points, count, bodies, features, point, normal, depth):
    """Write a point if the buffer has space; bodies (a, b), normal from a to b; swapped where a is the larger. Returns count + 1."""
    real, integer = points
    if count < real.shape[0]:
        swap = bodies[0] > bodies[1]
        sign = -1.0 if swap else 1.0
        integer[count, 0], integer[count, 1] = (bodies[1], bodies[0]) if swap else bodies
        integer[count, 2], integer[count, 3] = (features[1], features[0]) if swap else features
        for k in range(3):
            real[count, k] = point[k]
            real[count, 3 + k] = sign * normal[k]
        real[count, 6] = depth
    return count + 1
