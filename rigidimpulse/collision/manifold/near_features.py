"""Pairs of features of two surfaces of triangles that may touch: now, and as long as the bodies have hardly moved past each other.

Points of the two bodies that are within reach of each other move past each other by at most s, and the bodies turn against each other by at
most theta. A pair of features is left out only if it has no contact (see `mesh_mesh`) in all that time:

- It is farther apart than what is looked at, and s.
- Edges d, e cross with the normal c = d x e. With q the sine between them, |change of c| <= theta |d| |e|, so that the direction of c turns
  by at most phi = asin(theta / q), seen from either body, and misses an arc by 2 phi less at best (`arc_miss` adds two products with
  c). The distance of the two lines along c changes by at most s + phi (reach + s): beyond that it is known on which side each body is.
- A vertex over a face, or over the other face of a valley: its way over the face and beyond its sides is at most s, and u.n changes by at
  most theta |u| for each edge u that leaves the vertex.
- A vertex beside an edge or a vertex: the way w from it to the line or the point changes by at most s. A contact has w.u <= tau |w| for
  some unit vectors u, or sums of two of them. So it had  n.u <= tau (1 + psi) + 2 psi  with n = w / |w| and psi = s / |w|; an edge of the
  vertex turns: theta (1 + psi) more.

Features are visited in the order in which `mesh_mesh` looks at them, so that the contacts are the same in the same order whatever s is.
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from rigidimpulse.collision.distance.simplices import closest_on_segments, edge_normals, in_edge_arc, inner, over_triangle
from rigidimpulse.collision.geometry import EDGE_HIDDEN
from rigidimpulse.collision.manifold.contact_points import INSIDE, ROUND_OFF, STRICT, TILT, outside_box
from rigidimpulse.collision.manifold.mesh_edges import CROSSING, NEARLY_PARALLEL, arcs_miss, edges_of
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.core.vector import along, cross, dot, moved, row, subtract, turned

EDGES, ON_FACE, ON_FEATURE, FLIPPED = (np.int64(kind) for kind in (0, 1, 2, 2))
"""Kinds of pairs: (edge of the first, edge of the second); (vertex, face) and (vertex, 2 * vertex or 2 * edge + 1), the vertex of the first
body, or, with FLIPPED added, of the second."""
CREASE = 2.0 * TOLERANCES.surface.flat_angle
"""How far outside a face beyond a hidden edge a point still counts as inside, relative to its height."""
VALLEY = 0.99
"""Cosine of the angle of two faces at a hidden edge up to which it is the bottom of a valley."""
EVERY_NORMAL = -1.0
"""In place of theta: all pairs in reach, whatever their normals."""
MOST_PHI = 0.5
"""theta / q beyond which the normal of crossing edges may be any; up to it asin(x) <= 1.05 x."""


@inner
def _write(rows, at, kind, one, other):
    """Write a pair if there is space; return where the next one goes in any case."""
    if at < rows.shape[0]:
        rows[at, 0], rows[at, 1], rows[at, 2] = kind, one, other
    return at + 1


@inner
def in_vertex_cone(geometry, corner, direction, slack, tolerance):
    """Tell whether no edge that leaves a vertex runs along the direction, with a tolerance of a length `slack` [m] or an angle."""
    vertex, edge = geometry.vertex, geometry.edge
    vertex_edge_first, vertex_edge = geometry.vertex_edge_first, geometry.vertex_edge
    origin = row(vertex, corner)
    for i in range(vertex_edge_first[corner], vertex_edge_first[corner + 1]):
        leaving = subtract(row(vertex, edge[vertex_edge[i], 0] + edge[vertex_edge[i], 1] - corner), origin)
        length = sqrt(dot(leaving, leaving))
        if dot(direction, leaving) > tolerance * length + min(slack, TILT * length):
            return False
    return True


@inner
def across_valley(geometry, triangle, side):
    """Return whether a side of a face is the bottom of a valley, and the normal of the face on the other side."""
    edge, normal = geometry.triangle_edge[triangle, side], row(geometry.triangle_normal, triangle)
    if geometry.edge_kind[edge] != EDGE_HIDDEN:
        return False, normal
    normal_0, normal_1 = edge_normals(geometry.edge_normal, edge)
    return dot(normal_0, normal_1) <= VALLEY, subtract(along(normal_0, 1.0, normal_1), normal)


@inner
def _slack_beyond(geometry, p, triangle, side, slack, reach):
    """How far beyond a side of a face a point at `p` is still over it, m.

    slack: (m beyond any side, m beyond hidden edges of what is flat); reach: see `is_over_face`.
    """
    further, crease = slack
    edge = geometry.triangle_edge[triangle, side]
    if geometry.edge_kind[edge] != EDGE_HIDDEN:
        return further
    is_valley, other_normal = across_valley(geometry, triangle, side)
    a = row(geometry.vertex, geometry.edge[edge, 0])
    d, x = subtract(row(geometry.vertex, geometry.edge[edge, 1]), a), subtract(p, a)
    # Behind the other face is the back of an open surface, from which the valley is a ridge.
    if reach <= 0.0 or not is_valley or dot(other_normal, x) < -further:
        return further + crease
    share = dot(x, d) / dot(d, d)
    off = along(x, -min(max(share, 0.0), 1.0), d)
    return further + crease + (reach if dot(off, off) <= reach * reach else 0.0)


@inner
def is_over_face(geometry, p, triangle, height, further, reach):
    """Tell whether a point at a height over the plane of a face [m] is over the face, or beside it by at most `further` [m].

    reach: m, how near the bottom of a valley points over the other face of it count, too.
    """
    a, b, c = (
        row(geometry.vertex, geometry.triangle[triangle, 0]),
        row(geometry.vertex, geometry.triangle[triangle, 1]),
        row(geometry.vertex, geometry.triangle[triangle, 2]),
    )
    side = subtract(b, a)
    # Across a hidden edge the faces may meet at up to the flat angle: their prisms overlap, so that no gap is between.
    slack = (INSIDE * sqrt(dot(side, side)) + further, CREASE * (abs(height) + further))
    slack_ab = _slack_beyond(geometry, p, triangle, 0, slack, reach)
    slack_bc = _slack_beyond(geometry, p, triangle, 1, slack, reach)
    slack_ca = _slack_beyond(geometry, p, triangle, 2, slack, reach)
    return over_triangle(p, a, b, c, row(geometry.triangle_normal, triangle), slack_ab, slack_bc, slack_ca)


@inner
def _may_cross(geometry, view, edges, motion):
    """Whether two edges within reach may have a contact; motion: (s, theta)."""
    d, e, turn = edges.d, edges.e, motion[1]
    c = cross(d, e)
    size = sqrt(dot(d, d) * dot(e, e))
    sine = sqrt(dot(c, c)) / size
    if sine <= CROSSING or sine < NEARLY_PARALLEL + turn or turn > MOST_PHI * sine:
        return True
    phi = 1.05 * turn / sine
    scale = 1.0 / (sine * size)
    normal = (c[0] * scale, c[1] * scale, c[2] * scale)
    distance = dot(subtract(edges.q, edges.p), normal)
    most = STRICT + 2.0 * ROUND_OFF / sine + TILT + 2.0 * phi
    # On which side the bodies are is known where the lines are far apart.
    sides = 2 if abs(distance) <= view.depth + phi * view.reach else 1
    sense = 1.0 if distance >= 0.0 else -1.0
    for _ in range(sides):
        miss, _ = arcs_miss(geometry, view, edges, (sense * normal[0], sense * normal[1], sense * normal[2]))
        if miss <= most:
            return True
        sense = -sense
    return False


@inner
def _near_edges(geometry, view, motion, pairs, span, rows, used):
    """Write the pairs of edges of both nodes of each pair in `span` that may touch; `view`, widened by s, is that of the second's vertices.

    Returns where the next pair goes, and whether any two edges are in reach.
    """
    vertex, edge, touching_first, touching = geometry.vertex, geometry.edge, geometry.touching_first, geometry.touching
    any_near, squared = False, view.reach * view.reach
    for pair in range(span[0], span[1]):
        a, b = pairs[pair, 0], pairs[pair, 1]
        low, high = row(geometry.node_min, a), row(geometry.node_max, a)
        start_a, start_b = geometry.node_start[a], geometry.node_start[b]
        first_a, last_a = touching_first[start_a], touching_first[start_a + geometry.node_count[a]]
        # Flat and concave edges touch no other edge; each edge is visited by its owner only.
        for j in range(touching_first[start_b], touching_first[start_b + geometry.node_count[b]]):
            if touching[j] % 2 == 0:
                continue
            edge_b = touching[j] // 2
            q = moved(view.R, view.t, row(vertex, edge[edge_b, 0]))
            q_end = moved(view.R, view.t, row(vertex, edge[edge_b, 1]))
            if outside_box(q, q_end, low, high, view.reach):
                continue
            for i in range(first_a, last_a):
                if touching[i] % 2 == 0:
                    continue
                edge_a = touching[i] // 2
                p, p_end = row(vertex, edge[edge_a, 0]), row(vertex, edge[edge_a, 1])
                least = (min(p[0], p_end[0]), min(p[1], p_end[1]), min(p[2], p_end[2]))
                most = (max(p[0], p_end[0]), max(p[1], p_end[1]), max(p[2], p_end[2]))
                if outside_box(q, q_end, least, most, view.reach):
                    continue
                edges = edges_of(edge_a, edge_b, (p, p_end), (q, q_end))
                s, t = closest_on_segments(p, edges.d, q, edges.e)
                off = subtract(along(q, t, edges.e), along(p, s, edges.d))
                if dot(off, off) > squared:
                    continue
                any_near = True
                if motion[1] < 0.0 or _may_cross(geometry, view, edges, motion):
                    used = _write(rows, used, EDGES, edge_a, edge_b)
    return used, any_near


@inner
def _may_touch_face(geometry, view, corner, p, face, motion):
    """Whether a vertex at `p` may touch a face; motion: (s, theta)."""
    way, turn = motion
    normal = row(geometry.triangle_normal, face)
    height = dot(subtract(p, row(geometry.vertex, geometry.triangle[face, 0])), normal)
    # A triangle with two equal corners is a segment or a point and has no face.
    if height > view.skeleton or height < -view.reach or geometry.triangle[face, 1] == geometry.triangle[face, 2]:
        return False
    if turn < 0.0:
        return True
    valley = view.skeleton if height >= -way or not view.two_sided else 0.0
    if (height < -view.depth and not view.two_sided) or not is_over_face(geometry, p, face, height, way, valley):
        return False
    inward = turned(view.R_back, (-normal[0], -normal[1], -normal[2]))
    if in_vertex_cone(geometry, corner, inward, view.skeleton, TILT + turn):
        return True
    outward = (-inward[0], -inward[1], -inward[2])
    return view.two_sided and in_vertex_cone(geometry, corner, outward, view.skeleton, TILT + turn)


@inner
def _near_faces(geometry, view, motion, pairs, span, rows, used):
    """Write the corners in one node of each pair, and the faces in the other that they may touch; returns where the next pair goes."""
    touching_first, touching, kind = geometry.touching_first, geometry.touching, ON_FACE + FLIPPED * view.flipped
    for pair in range(span[0], span[1]):
        node_v = pairs[pair, 1] if view.flipped else pairs[pair, 0]
        node_t = pairs[pair, 0] if view.flipped else pairs[pair, 1]
        low, high = row(geometry.node_min, node_t), row(geometry.node_max, node_t)
        start_t, start_v = geometry.node_start[node_t], geometry.node_start[node_v]
        for i in range(touching_first[start_v], touching_first[start_v + geometry.node_count[node_v]]):
            if touching[i] % 2 == 1:
                continue
            corner = touching[i] // 2
            p = moved(view.R, view.t, row(geometry.vertex, corner))
            if outside_box(p, p, low, high, view.reach):
                continue
            for face in range(start_t, start_t + geometry.node_count[node_t]):
                if _may_touch_face(geometry, view, corner, p, face, motion):
                    used = _write(rows, used, kind, corner, face)
    return used


@inner
def _way_to(geometry, p, feature):
    """Return (squared distance, w): of a point and a vertex (2 v) or an edge (2 e + 1), and the way to the vertex or the edge's line."""
    vertex, edge, other = geometry.vertex, geometry.edge, feature // 2
    if feature % 2 == 0:
        w = subtract(row(vertex, other), p)
        return dot(w, w), w
    a = row(vertex, edge[other, 0])
    side = subtract(row(vertex, edge[other, 1]), a)
    s = dot(subtract(p, a), side) / dot(side, side)
    off = subtract(along(a, min(max(s, 0.0), 1.0), side), p)
    return dot(off, off), subtract(along(a, s, side), p)


@inner
def _may_touch_feature(geometry, view, corner, feature, w, motion):
    """Whether a vertex may have a contact with an edge or a vertex to which the way is w; motion: (s, theta)."""
    (way, turn), distance, other = motion, sqrt(dot(w, w)), feature // 2
    if distance <= way:
        return True
    psi = way / distance
    most = (STRICT + 2.0 * TILT) * (1.0 + psi) + 2.0 * psi
    normal = (w[0] / distance, w[1] / distance, w[2] / distance)
    outward = (-normal[0], -normal[1], -normal[2])
    if feature % 2 == 1:
        side = subtract(row(geometry.vertex, geometry.edge[other, 1]), row(geometry.vertex, geometry.edge[other, 0]))
        size = sqrt(dot(side, side))
        direction = (side[0] / size, side[1] / size, side[2] / size)
        normal_0, normal_1 = edge_normals(geometry.edge_normal, other)
        if not in_edge_arc(outward, direction, normal_0, normal_1, geometry.edge_kind[other], most):
            return False
    elif not in_vertex_cone(geometry, other, outward, view.slack, most):
        return False
    return in_vertex_cone(geometry, corner, turned(view.R_back, normal), view.slack, most + turn * (1.0 + psi))


@inner
def _near_corners(geometry, view, motion, pairs, span, rows, used):
    """Write the corners in one node of each pair, and the edges and corners in the other that are in reach; returns as `_near_edges`."""
    touching_first, touching, kind = geometry.touching_first, geometry.touching, ON_FEATURE + FLIPPED * view.flipped
    any_near, squared = False, view.skeleton * view.skeleton
    for pair in range(span[0], span[1]):
        node_v = pairs[pair, 1] if view.flipped else pairs[pair, 0]
        node_t = pairs[pair, 0] if view.flipped else pairs[pair, 1]
        low, high = row(geometry.node_min, node_t), row(geometry.node_max, node_t)
        start_t, start_v = geometry.node_start[node_t], geometry.node_start[node_v]
        first_t, last_t = touching_first[start_t], touching_first[start_t + geometry.node_count[node_t]]
        for i in range(touching_first[start_v], touching_first[start_v + geometry.node_count[node_v]]):
            if touching[i] % 2 == 1:
                continue
            corner = touching[i] // 2
            p = moved(view.R, view.t, row(geometry.vertex, corner))
            if outside_box(p, p, low, high, view.skeleton):
                continue
            for j in range(first_t, last_t):
                # Two corners are compared once, from the side of the first body.
                if view.flipped and touching[j] % 2 == 0:
                    continue
                distance_squared, w = _way_to(geometry, p, touching[j])
                if distance_squared > squared:
                    continue
                any_near = True
                if motion[1] < 0.0 or _may_touch_feature(geometry, view, corner, touching[j], w, motion):
                    used = _write(rows, used, kind, corner, touching[j])
    return used, any_near


@inner
def near_features(geometry, views, motion, pairs, span, rows, used):
    """Write the pairs of features of the pairs of leaves in `span` (begin, end) that may touch to `rows`, from `used` on.

    views: `View` of the first body's vertices and of the second's, with s added to what is looked at. motion: (s, theta), m and rad; with a
    negative theta any normal is let through. Returns where the next pair goes, beyond the rows if they are too few, and whether any
    features are in reach of each other.
    """
    of_a, of_b = views
    used, any_near = _near_edges(geometry, of_b, motion, pairs, span, rows, used)
    for view in (of_a, of_b):
        used = _near_faces(geometry, view, motion, pairs, span, rows, used)
        used, near = _near_corners(geometry, view, motion, pairs, span, rows, used)
        any_near = any_near or near
    return used, any_near
