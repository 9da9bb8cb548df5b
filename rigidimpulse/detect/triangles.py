"""Contacts and least distance of two ROUND primitives: triangles, a segment or a point, grown by a radius.

The features of two cores c_a, c_b at distance d <= margin + r_a + r_b that are locally closest make the contacts; the radii
are then taken off along the normal: gap = d - r_a - r_b.
- vertex - face: the vertex projects into the face. All vertices within the margin count, so a flat contact gives its corners.
- edge - edge: the common normal c = d_a x d_b meets both edges and lies in the Gauss arcs of both.
- vertex - edge, vertex - vertex: the normal runs between the points; it must lie in the arc of the edge and in the cone of
  the vertex, u . n <= 0 for every edge u that leaves the vertex along which the other body could be approached.
- nearly parallel edges: both ends of their overlap, with the normal at its middle.
Normals of the first two kinds come from the surfaces, not from the difference of two points, and stay exact however small
the gap is; the others carry an error of round-off / d. Each vertex and edge is owned by one triangle, so a pair of features
is met once; flat or concave edges and vertices without a convex edge are left out (see `geometry`).

Both box trees are walked at once; pairs of leaves are gathered in chunks so that no scene needs a larger buffer.
"""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

import numpy as np

from rigidimpulse.conventions import TOLERANCES
from rigidimpulse.detect.box_tree import STACK_ROWS, gather_leaf_pairs
from rigidimpulse.detect.closest import round_round_gap
from rigidimpulse.detect.features import (
    along,
    cross,
    dot,
    inner,
    in_edge_arc,
    moved,
    over_triangle,
    row,
    set_contact,
    subtract,
    turned,
    write_contact,
)
from rigidimpulse.geometry import EDGE_HIDDEN

VERTEX_FACE, FACE_VERTEX, EDGE_EDGE, CORNER = 0, 1, 2, 3
"""Kinds of contact; the features of a CORNER are 2 * vertex or 2 * edge + 1, else vertex, triangle or edge."""

INSIDE = 1e-11
"""How far outside a face or an edge a point still counts as inside, relative to the edge."""
CREASE = 2.0 * TOLERANCES.flat_angle
"""How far outside a face beyond a hidden edge a point still counts as inside, relative to its height."""
STRICT = 1e-9
"""Sine of the angle by which a normal may miss an arc or a cone."""
ROUND_OFF = 1e-15
"""Error of a point, relative to its coordinates."""
MERGE = 1e-9
"""Distance below which two contacts are one, relative to the edge."""
SAME_NORMAL = 1.0 - 1e-9
"""Cosine of the angle below which normals at one place are one."""
ALIKE_NORMAL = 0.99
"""The same for a CORNER, whose normal is the less certain."""
PENETRATION = 1e-9
"""Depth down to which a contact of faces or edges is still recognised, relative to the edge."""
CROSSING = 1e-7
"""Least sine of the angle of two edges that are taken to cross at one point."""
NEARLY_PARALLEL = 0.02
"""Greatest sine of the angle of two edges that may touch along a length."""
SIDEWAYS = 0.5
"""Greatest offset across the normal, relative to the distance, of the ends of such a length."""
TILT = 0.02
"""Greatest sine of the angle by which a contact within the margin may miss being locally closest."""


class View(NamedTuple):
    """The vertices of one body seen from the triangles of the other: y_t = R y_v + t."""

    flipped: bool  # the vertices are those of the second body
    R: np.ndarray  # (3, 3) from the frame of the vertices to that of the triangles
    t: np.ndarray  # (3,)
    R_back: np.ndarray  # (3, 3) the other way
    t_back: np.ndarray  # (3,)
    radius_v: float
    radius_t: float
    margin: float
    core: float  # greatest distance of the cores: margin and radii
    slack: float  # how far a capsule may miss being locally closest, m
    two_sided: bool  # the triangles bound no solid: their back is outside too


@inner
def _in_vertex_cone(geometry, vertex, direction, slack, tolerance):
    """Tell whether no edge that leaves `vertex` runs along the direction, but for a length `slack` [m] or an angle."""
    origin = row(geometry.vertex, vertex)
    for i in range(geometry.vertex_edge_first[vertex], geometry.vertex_edge_first[vertex + 1]):
        edge = geometry.vertex_edge[i]
        leaving = subtract(row(geometry.vertex, geometry.edge[edge, 0] + geometry.edge[edge, 1] - vertex), origin)
        length = sqrt(dot(leaving, leaving))
        if dot(direction, leaving) > tolerance * length + min(slack, TILT * length):
            return False
    return True


@inner
def _append(rows, count, point_a, point_b, normal, gap, kind, feature_a, feature_b, merge):
    """Append a contact unless it is there already; of two that coincide the one of the lower kind stays."""
    real, integer, first_row = rows
    for other in range(first_row, min(count, real.shape[0])):
        if (
            abs(real[other, 0] - point_a[0]) > merge
            or abs(real[other, 1] - point_a[1]) > merge
            or abs(real[other, 2] - point_a[2]) > merge
        ):
            continue
        cosine = real[other, 6] * normal[0] + real[other, 7] * normal[1] + real[other, 8] * normal[2]
        uncertain = kind == CORNER or integer[other, 2] == CORNER
        if cosine > (ALIKE_NORMAL if uncertain else SAME_NORMAL):
            if kind < integer[other, 2]:
                set_contact(real, integer, other, point_a, point_b, normal, gap, kind, feature_a, feature_b)
            return count
    return write_contact(real, integer, count, point_a, point_b, normal, gap, kind, feature_a, feature_b)


@inner
def _append_vertex(view, rows, count, core_v, core_t, normal, distance, kind, feature_v, feature_t, merge):
    """Append a contact of a vertex (core point `core_v`) with a triangle (`core_t`), given in the triangle's frame."""
    gap = distance - view.radius_v - view.radius_t
    point_v = along(core_v, view.radius_v, normal)
    point_t = along(core_t, -view.radius_t, normal)
    if view.flipped:
        normal = (-normal[0], -normal[1], -normal[2])
        return _append(rows, count, point_t, point_v, normal, gap, kind, feature_t, feature_v, merge)
    point_v = moved(view.R_back, view.t_back, point_v)
    point_t = moved(view.R_back, view.t_back, point_t)
    normal = turned(view.R_back, normal)
    return _append(rows, count, point_v, point_t, normal, gap, kind, feature_v, feature_t, merge)


@inner
def _corner_contact(geometry, view, rows, count, vertex, p, foot, feature, size):
    """Append the contact of a vertex at `p` with the point `foot` of an edge or a vertex if it is locally closest."""
    between = subtract(foot, p)
    distance = sqrt(dot(between, between))
    if distance > view.core or distance <= ROUND_OFF * size:
        return count
    normal = (between[0] / distance, between[1] / distance, between[2] / distance)
    outward = (-normal[0], -normal[1], -normal[2])
    tolerance = STRICT + ROUND_OFF * (size + abs(p[0]) + abs(p[1]) + abs(p[2])) / distance
    if feature % 2 == 1:
        edge = feature // 2
        direction = subtract(row(geometry.vertex, geometry.edge[edge, 1]), row(geometry.vertex, geometry.edge[edge, 0]))
        length = sqrt(dot(direction, direction))
        direction = (direction[0] / length, direction[1] / length, direction[2] / length)
        normal_0 = row(geometry.edge_normal[edge], 0)
        normal_1 = row(geometry.edge_normal[edge], 1)
        tilt = tolerance + min(TILT, view.slack / length)
        if not in_edge_arc(outward, direction, normal_0, normal_1, geometry.edge_kind[edge], tilt):
            return count
    elif not _in_vertex_cone(geometry, feature // 2, outward, view.slack, tolerance):
        return count
    if not _in_vertex_cone(geometry, vertex, turned(view.R_back, normal), view.slack, tolerance):
        return count
    return _append_vertex(view, rows, count, p, foot, normal, distance, CORNER, 2 * vertex, feature, MERGE * size)


@inner
def _face_contact(geometry, view, rows, count, vertex, p, triangle, height):
    """Append the contact of a vertex at `p` with a face if it lies over it; `height` is its distance from the plane."""
    a = row(geometry.vertex, geometry.triangle[triangle, 0])
    b = row(geometry.vertex, geometry.triangle[triangle, 1])
    c = row(geometry.vertex, geometry.triangle[triangle, 2])
    normal = row(geometry.triangle_normal, triangle)
    side = subtract(b, a)
    size = sqrt(dot(side, side))
    # Across a hidden edge the faces may meet at up to the flat angle: their prisms overlap, so that no gap is between.
    crease = CREASE * abs(height)
    slack = INSIDE * size
    slack_ab = slack + crease if geometry.edge_kind[geometry.triangle_edge[triangle, 0]] == EDGE_HIDDEN else slack
    slack_bc = slack + crease if geometry.edge_kind[geometry.triangle_edge[triangle, 1]] == EDGE_HIDDEN else slack
    slack_ca = slack + crease if geometry.edge_kind[geometry.triangle_edge[triangle, 2]] == EDGE_HIDDEN else slack
    if not over_triangle(p, a, b, c, normal, slack_ab, slack_bc, slack_ca):
        return count
    foot = along(p, -height, normal)
    if height < 0.0 and view.two_sided:
        height = -height
    elif height < -PENETRATION * size:
        return count
    else:
        normal = (-normal[0], -normal[1], -normal[2])
    kind = FACE_VERTEX if view.flipped else VERTEX_FACE
    merge = MERGE * size + 2.0 * crease
    return _append_vertex(view, rows, count, p, foot, normal, height, kind, vertex, triangle, merge)


@inner
def _vertex_triangle_contacts(geometry, view, rows, count, vertex, p, triangle):
    """Append the contacts of a vertex at `p` (the triangle's frame) with a face and with the edges and corners it owns."""
    a = row(geometry.vertex, geometry.triangle[triangle, 0])
    height = dot(subtract(p, a), row(geometry.triangle_normal, triangle))
    if abs(height) > view.core:
        return count
    owns = geometry.triangle_owns[triangle]
    if geometry.triangle[triangle, 1] != geometry.triangle[triangle, 2]:
        before = count
        count = _face_contact(geometry, view, rows, count, vertex, p, triangle, height)
        if count > before:
            return count
    for k in range(3):
        edge = geometry.triangle_edge[triangle, k]
        if owns >> (3 + k) & 1 and geometry.edge_kind[edge] != EDGE_HIDDEN:
            a = row(geometry.vertex, geometry.edge[edge, 0])
            side = subtract(row(geometry.vertex, geometry.edge[edge, 1]), a)
            length_squared = dot(side, side)
            s = dot(subtract(p, a), side) / length_squared
            if -INSIDE <= s <= 1.0 + INSIDE:
                size = sqrt(length_squared)
                count = _corner_contact(
                    geometry, view, rows, count, vertex, p, along(a, s, side), 2 * edge + 1, size
                )
        other = geometry.triangle[triangle, k]
        if not view.flipped and owns >> k & 1 and geometry.vertex_corner[other]:
            a = row(geometry.vertex, other)
            size = abs(a[0]) + abs(a[1]) + abs(a[2]) + abs(p[0]) + abs(p[1]) + abs(p[2])
            count = _corner_contact(geometry, view, rows, count, vertex, p, a, 2 * other, size)
    return count


@inner
def _vertex_contacts(geometry, view, pairs, end, rows, count):
    """Append the contacts of all corners in one node of each pair with the triangles in the other."""
    for pair in range(STACK_ROWS, end):
        node_v = pairs[pair, 1] if view.flipped else pairs[pair, 0]
        node_t = pairs[pair, 0] if view.flipped else pairs[pair, 1]
        start_t = geometry.node_start[node_t]
        start_v = geometry.node_start[node_v]
        for owner in range(start_v, start_v + geometry.node_count[node_v]):
            owns = geometry.triangle_owns[owner] & 7
            for k in range(3):
                vertex = geometry.triangle[owner, k]
                if not (owns >> k & 1 and geometry.vertex_corner[vertex]):
                    continue
                p = moved(view.R, view.t, row(geometry.vertex, vertex))
                if _outside_box(geometry, node_t, p, p, view.core):
                    continue
                for triangle in range(start_t, start_t + geometry.node_count[node_t]):
                    count = _vertex_triangle_contacts(geometry, view, rows, count, vertex, p, triangle)
    return count


@inner
def _outside_box(geometry, node, p, q, margin):
    """Tell whether the box around two points is farther than `margin` from the box of a node."""
    for k in range(3):
        if min(p[k], q[k]) > geometry.node_max[node, k] + margin or max(p[k], q[k]) < geometry.node_min[node, k] - margin:
            return True
    return False


@inner
def _edge_arcs_hold(geometry, view, edge_a, edge_b, direction_a, normal, tolerance_a, tolerance_b):
    """Tell whether a normal (first body's frame, from a to b) lies in the arcs of both edges."""
    normal_0 = row(geometry.edge_normal[edge_a], 0)
    normal_1 = row(geometry.edge_normal[edge_a], 1)
    if not in_edge_arc(normal, direction_a, normal_0, normal_1, geometry.edge_kind[edge_a], tolerance_a):
        return False
    inward = turned(view.R_back, normal)
    outward = (-inward[0], -inward[1], -inward[2])
    side = subtract(row(geometry.vertex, geometry.edge[edge_b, 1]), row(geometry.vertex, geometry.edge[edge_b, 0]))
    length = sqrt(dot(side, side))
    direction_b = (side[0] / length, side[1] / length, side[2] / length)
    normal_0 = row(geometry.edge_normal[edge_b], 0)
    normal_1 = row(geometry.edge_normal[edge_b], 1)
    return in_edge_arc(outward, direction_b, normal_0, normal_1, geometry.edge_kind[edge_b], tolerance_b)


@inner
def _crossing_contact(geometry, view, rows, count, edge_a, edge_b, p, d, q, e):
    """Append the contact of two edges p + s d and q + t e that cross (first body's frame)."""
    c = cross(d, e)
    c_squared = dot(c, c)
    between = subtract(q, p)
    s = dot(cross(between, e), c) / c_squared
    t = dot(cross(between, d), c) / c_squared
    if not (-INSIDE <= s <= 1.0 + INSIDE and -INSIDE <= t <= 1.0 + INSIDE):
        return count
    length_a = sqrt(dot(d, d))
    length_b = sqrt(dot(e, e))
    size = min(length_a, length_b)
    scale = 1.0 / sqrt(c_squared)
    point_a = along(p, s, d)
    point_b = along(q, t, e)
    distance = dot(subtract(point_b, point_a), c) * scale
    if distance < 0.0:
        distance = -distance
        scale = -scale
    if distance > view.core:
        return count
    direction = (d[0] / length_a, d[1] / length_a, d[2] / length_a)
    tolerance = STRICT + ROUND_OFF * length_a * length_b * abs(scale) + min(TILT, view.margin / size)
    # At a distance within round-off its sign tells nothing, and both senses of the normal are tried.
    for _ in range(2 if distance <= PENETRATION * size else 1):
        normal = (c[0] * scale, c[1] * scale, c[2] * scale)
        if _edge_arcs_hold(geometry, view, edge_a, edge_b, direction, normal, tolerance, tolerance):
            return _append(
                rows,
                count,
                along(point_a, view.radius_t, normal),
                along(point_b, -view.radius_v, normal),
                normal,
                distance - view.radius_t - view.radius_v,
                EDGE_EDGE,
                edge_a,
                edge_b,
                MERGE * size,
            )
        distance = -distance
        scale = -scale
    return count


@inner
def _parallel_contacts(geometry, view, rows, count, edge_a, edge_b, p, d, q, e):
    """Append both ends of the overlap of two nearly parallel edges of meshes (first body's frame)."""
    length = sqrt(dot(d, d))
    u = (d[0] / length, d[1] / length, d[2] / length)
    speed = dot(e, u)
    start = dot(subtract(q, p), u)
    low = max(0.0, min(start, start + speed))
    high = min(length, max(start, start + speed))
    if high - low <= MERGE * length:
        return count
    middle = 0.5 * (low + high)
    between = subtract(along(q, (middle - start) / speed, e), along(p, middle, u))
    distance = sqrt(dot(between, between))
    if distance > view.core or distance <= ROUND_OFF * length:
        return count
    normal = (between[0] / distance, between[1] / distance, between[2] / distance)
    tolerance = STRICT + ROUND_OFF * (length + abs(p[0]) + abs(p[1]) + abs(p[2])) / distance
    if not _edge_arcs_hold(geometry, view, edge_a, edge_b, u, normal, tolerance, tolerance):
        return count
    for end in range(2):
        place = high if end == 1 else low
        point_a = along(p, place, u)
        point_b = along(q, (place - start) / speed, e)
        between = subtract(point_b, point_a)
        gap = dot(between, normal)
        sideways = along(between, -gap, normal)
        if not 0.0 < gap <= view.core or dot(sideways, sideways) > (SIDEWAYS * gap) ** 2:
            continue
        # The end is a vertex of one edge, over the other edge.
        of_a = place == 0.0 or place == length
        vertex_a = geometry.edge[edge_a, end]
        vertex_b = geometry.edge[edge_b, end if speed > 0.0 else 1 - end]
        feature_a = 2 * vertex_a if of_a else 2 * edge_a + 1
        feature_b = 2 * edge_b + 1 if of_a else 2 * vertex_b
        count = _append(rows, count, point_a, point_b, normal, gap, CORNER, feature_a, feature_b, MERGE * length)
    return count


@inner
def _edge_contacts(geometry, view, pairs, end, rows, count):
    """Append the contacts of the edges in both nodes of each pair; `view` is that of the second body's vertices."""
    for pair in range(STACK_ROWS, end):
        a = pairs[pair, 0]
        b = pairs[pair, 1]
        for triangle_b in range(geometry.node_start[b], geometry.node_start[b] + geometry.node_count[b]):
            for l in range(3):
                edge_b = geometry.triangle_edge[triangle_b, l]
                if not geometry.triangle_owns[triangle_b] >> (3 + l) & 1 or geometry.edge_kind[edge_b] == EDGE_HIDDEN:
                    continue
                q = moved(view.R, view.t, row(geometry.vertex, geometry.edge[edge_b, 0]))
                r = moved(view.R, view.t, row(geometry.vertex, geometry.edge[edge_b, 1]))
                if not _outside_box(geometry, a, q, r, view.core):
                    count = _edge_node_contacts(geometry, view, rows, count, edge_b, q, r, a)
    return count


@inner
def _edge_node_contacts(geometry, view, rows, count, edge_b, q, r, node):
    """Append the contacts of one edge, qr, of the second body with the edges in a node of the first."""
    e = subtract(r, q)
    e_squared = dot(e, e)
    meshes = view.radius_v == 0.0 and view.radius_t == 0.0
    for triangle in range(geometry.node_start[node], geometry.node_start[node] + geometry.node_count[node]):
        for k in range(3):
            edge_a = geometry.triangle_edge[triangle, k]
            if not geometry.triangle_owns[triangle] >> (3 + k) & 1 or geometry.edge_kind[edge_a] == EDGE_HIDDEN:
                continue
            p = row(geometry.vertex, geometry.edge[edge_a, 0])
            d = subtract(row(geometry.vertex, geometry.edge[edge_a, 1]), p)
            apart = False
            for i in range(3):
                low = min(p[i], p[i] + d[i]) - view.core
                high = max(p[i], p[i] + d[i]) + view.core
                apart = apart or max(q[i], r[i]) < low or min(q[i], r[i]) > high
            if apart:
                continue
            c = cross(d, e)
            sine_squared = dot(c, c) / (dot(d, d) * e_squared)
            if sine_squared > CROSSING * CROSSING:
                count = _crossing_contact(geometry, view, rows, count, edge_a, edge_b, p, d, q, e)
            if meshes and sine_squared < NEARLY_PARALLEL * NEARLY_PARALLEL:
                count = _parallel_contacts(geometry, view, rows, count, edge_a, edge_b, p, d, q, e)
    return count


@inner
def _pose_back(R, t):
    """Return the inverse (R^T, -R^T t) of a pose."""
    R_back = np.empty((3, 3))
    t_back = np.empty(3)
    for i in range(3):
        t_back[i] = -(R[0, i] * t[0] + R[1, i] * t[1] + R[2, i] * t[2])
        for j in range(3):
            R_back[i, j] = R[j, i]
    return R_back, t_back


@inner
def round_round_contacts(geometry, first, second, R, t, margin, pairs, contact_real, contact_int, count):
    """Append the contacts of two ROUND primitives with gap <= margin, in the first one's frame; return the new count.

    R, t: pose of the second body in the frame of the first; `pairs`: scratch, more than `STACK_ROWS` rows.
    """
    R_back, t_back = _pose_back(R, t)
    radius_a = geometry.radius[first]
    radius_b = geometry.radius[second]
    core = margin + radius_a + radius_b
    edges_a = geometry.edge_first[first + 1] - geometry.edge_first[first]
    edges_b = geometry.edge_first[second + 1] - geometry.edge_first[second]
    slack = margin if edges_a > 0 and edges_b > 0 and radius_a + radius_b > 0.0 else 0.0
    of_a = View(
        False, R_back, t_back, R, t, radius_a, radius_b, margin, core, slack, not geometry.closed[second]
    )
    of_b = View(True, R, t, R_back, t_back, radius_b, radius_a, margin, core, slack, not geometry.closed[first])
    rows = (contact_real, contact_int, count)
    first_row = count
    pairs[0, 0] = geometry.node_first[first]
    pairs[0, 1] = geometry.node_first[second]
    depth = 1
    near = False
    while depth > 0:
        depth, end = gather_leaf_pairs(geometry, R, t, core, pairs, depth)
        near = near or end > STACK_ROWS
        count = _edge_contacts(geometry, of_b, pairs, end, rows, count)
        count = _vertex_contacts(geometry, of_a, pairs, end, rows, count)
        count = _vertex_contacts(geometry, of_b, pairs, end, rows, count)
    if near and count == first_row:
        count = _closest_contact(geometry, first, second, R, t, margin, pairs, rows, count)
    return count


@inner
def _closest_contact(geometry, first, second, R, t, margin, pairs, rows, count):
    """Append the closest pair of points as the one contact; its features are the primitives, as -1 - primitive."""
    out = np.empty(7)
    gap = round_round_gap(geometry, first, second, R, t, margin, pairs, out)
    normal = (out[3] - out[0], out[4] - out[1], out[5] - out[2])
    length = sqrt(dot(normal, normal))
    if gap >= margin or length == 0.0 or gap <= 0.0:
        return count
    normal = (normal[0] / length, normal[1] / length, normal[2] / length)
    point_a = (out[0], out[1], out[2])
    point_b = (out[3], out[4], out[5])
    return write_contact(rows[0], rows[1], count, point_a, point_b, normal, gap, CORNER, -1 - first, -1 - second)
