"""Edges of two surfaces that cross, as points of the penalty method: see `penetrating_points`.

    edges of a and b with ways e_a, e_b, p and q where their lines are nearest,  n = +- e_a x e_b / |e_a x e_b|,  d = (p - q).n > 0

count where n leaves the wedge of the edge of a, and -n that of b, and both solids hold the middle of p and q.
"""

from __future__ import annotations

from math import inf, sqrt

import numpy as np

from rigidimpulse.collision.containment import point_in_mesh
from rigidimpulse.collision.distance.simplices import closest_on_segments, edge_normals, in_edge_arc
from rigidimpulse.collision.geometry import EDGE_HIDDEN
from rigidimpulse.collision.manifold.penetrating_surface import NUDGE, add_point
from rigidimpulse.core.kernels import jit, jit_making_arrays
from rigidimpulse.core.vector import along, cross, dot, moved, row, subtract, turned, turned_back

MOST_DEPTH = 2.0
"""How much deeper than the corners of the pair, or than its least deep edges, edges may be."""
OUT_OF_WEDGE = 0.5
"""Sine of the angle by which the normal of crossing edges may be outside the arc between the normals of their faces."""
EDGE = np.int64(1 << 40)
"""Added to edges where they are told from vertices."""


@jit
def _ends(geometry, e, body, position, rotation):
    """Start and way of an edge, world."""
    p = moved(rotation[body], row(position, body), row(geometry.vertex, geometry.edge[e, 0]))
    return p, subtract(moved(rotation[body], row(position, body), row(geometry.vertex, geometry.edge[e, 1])), p)


@jit
def _edge_near(geometry, e, body, surface, other, position, rotation):
    """Whether an edge of a body may touch the box of a surface of another."""
    p, d = _ends(geometry, e, body, position, rotation)
    p = turned_back(rotation[other], subtract(p, row(position, other)))
    d, root = turned_back(rotation[other], d), geometry.node_first[surface]
    for k in range(3):
        if max(p[k], p[k] + d[k]) < geometry.node_min[root, k] or min(p[k], p[k] + d[k]) > geometry.node_max[root, k]:
            return False
    return geometry.edge_kind[e] != EDGE_HIDDEN


@jit
def _leaves_wedge(geometry, e, body, way, rotation, n):
    """Whether n points out of the wedge of an edge."""
    length = sqrt(dot(way, way))
    normal_0, normal_1 = edge_normals(geometry.edge_normal, e)
    way = (way[0] / length, way[1] / length, way[2] / length)
    normal_0, normal_1 = turned(rotation[body], normal_0), turned(rotation[body], normal_1)
    return in_edge_arc(n, way, normal_0, normal_1, geometry.edge_kind[e], OUT_OF_WEDGE)


@jit
def _holds(geometry, surface, e, body, way, middle, position, rotation):
    """Whether the solid of an edge holds a point, taken a little way into the edge's wedge."""
    normal_0, normal_1 = edge_normals(geometry.edge_normal, e)
    out = turned(rotation[body], along(normal_0, 1.0, normal_1))
    point = subtract(along(middle, -NUDGE * sqrt(dot(way, way)), out), row(position, body))
    return point_in_mesh(geometry, surface, turned_back(rotation[body], point))


@jit
def crossing_edges(geometry, first, second, bodies, poses, points, count):
    """Edges of two surfaces that cross where the solids overlap."""
    (position, rotation), (a, b) = poses, bodies
    if not (geometry.closed[first] and geometry.closed[second]):
        return count
    for e in range(geometry.edge_first[first], geometry.edge_first[first + 1]):
        if not _edge_near(geometry, e, a, second, b, position, rotation):
            continue
        p0, p_way = _ends(geometry, e, a, position, rotation)
        for f in range(geometry.edge_first[second], geometry.edge_first[second + 1]):
            if not _edge_near(geometry, f, b, first, a, position, rotation):
                continue
            q0, q_way = _ends(geometry, f, b, position, rotation)
            s, t = closest_on_segments(p0, p_way, q0, q_way)
            n = cross(p_way, q_way)
            length = sqrt(dot(n, n))
            # Edges whose ends are nearest, and parallel ones, do not cross.
            if not (0.0 < s < 1.0 and 0.0 < t < 1.0) or length == 0.0:
                continue
            p, q = along(p0, s, p_way), along(q0, t, q_way)
            n = (n[0] / length, n[1] / length, n[2] / length)
            depth = dot(subtract(p, q), n)
            # The normal leads out: the depth along it is positive.
            if depth < 0.0:
                n, depth = (-n[0], -n[1], -n[2]), -depth
            back = (-n[0], -n[1], -n[2])
            if (
                depth > 0.0
                and _leaves_wedge(geometry, e, a, p_way, rotation, n)
                and _leaves_wedge(geometry, f, b, q_way, rotation, back)
                and _holds(geometry, first, e, a, p_way, along(p, -0.5 * depth, n), position, rotation)
                and _holds(geometry, second, f, b, q_way, along(p, -0.5 * depth, n), position, rotation)
            ):
                count = add_point(points, count, bodies, (EDGE + e, EDGE + f), p, n, depth)
    return count


@jit_making_arrays
def drop_deep_edges(points, first, edges, end):
    """Drop points from `edges` to `end` that are much deeper than the corners from `first` on, or than the least deep edge: no way out."""
    real, integer = points
    if end > real.shape[0] or end == edges:
        return end
    limit = 0.0
    for c in range(first, edges):
        limit = max(limit, real[c, 6])
    # Without corners the least deep edge sets the limit.
    if first == edges:
        limit = inf
        for c in range(edges, end):
            limit = min(limit, real[c, 6])
    kept = edges
    for c in range(edges, end):
        if real[c, 6] <= MOST_DEPTH * limit:
            real[kept], integer[kept] = real[c], integer[c]
            kept += 1
    return kept
