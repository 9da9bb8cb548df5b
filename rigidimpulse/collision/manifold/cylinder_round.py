"""Contacts and least gap of a cylinder and a ROUND primitive (triangles, a segment or a point, grown by a radius).

See `cylinder`. The box tree is walked in the frame of the primitive, features are seen in the axes of the cylinder.
"""

from __future__ import annotations

from math import inf, sqrt
from typing import NamedTuple

from rigidimpulse.collision.distance.cylinder import ZERO, closest_on_curve, closest_on_triangle, flat_length, from_axes, to_axes
from rigidimpulse.collision.distance.simplices import edge_normals, in_edge_arc, inner
from rigidimpulse.collision.geometry import EDGE_HIDDEN
from rigidimpulse.collision.manifold.contact_points import Found
from rigidimpulse.collision.manifold.cylinder_rims import (
    BORDER,
    RIM,
    SIDE,
    TRIANGLE,
    append,
    closest_to_ring,
    rims_on_plane,
    ring_contact,
    solid_of,
    write_points,
)
from rigidimpulse.collision.manifold.near_features import across_valley
from rigidimpulse.core.vector import along, dot, row, subtract


class _View(NamedTuple):
    """How the axes of the cylinder see a ROUND primitive: rows of the turn, shift; its centre seen from there."""

    x: tuple[float, float, float]
    y: tuple[float, float, float]
    z: tuple[float, float, float]  # also the cylinder's axis in the frame of the primitive
    shift: tuple[float, float, float]
    centre: tuple[float, float, float]


class _Edge(NamedTuple):
    """An edge a + t d of a ROUND primitive in the axes of the cylinder, grown by a radius."""

    a: tuple[float, float, float]
    d: tuple[float, float, float]
    arc: tuple[tuple[float, float, float], tuple[float, float, float]]  # normals of its faces
    kind: int
    skeleton: float  # the radius, m


@inner
def _view(solid, R, t):
    x = _turned_back(R, solid.u)
    y = _turned_back(R, solid.v)
    z = _turned_back(R, solid.w)
    shift = to_axes(solid.u, solid.v, solid.w, (t[0] - solid.origin[0], t[1] - solid.origin[1], t[2] - solid.origin[2]))
    return _View(x, y, z, shift, along(ZERO, -1.0, from_axes(x, y, z, shift)))


@inner
def _turned_back(R, v):
    """Return the transpose of R times v."""
    return along(along(along(ZERO, v[0], row(R, 0)), v[1], row(R, 1)), v[2], row(R, 2))


@inner
def _seen(view, p):
    """Return a point of the ROUND primitive in the axes of the cylinder."""
    return along(to_axes(view.x, view.y, view.z, p), 1.0, view.shift)


@inner
def _box_gap(solid, view, low, high):
    """Return a lower bound of the distance of a box in the primitive's frame to the cylinder; < 0 if they may meet."""
    middle = (0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1]), 0.5 * (low[2] + high[2]))
    reach = (0.5 * (high[0] - low[0]), 0.5 * (high[1] - low[1]), 0.5 * (high[2] - low[2]))
    gap = -inf
    for k in range(3):
        extent = solid.half * abs(view.z[k]) + solid.radius * flat_length(view.z[(k + 1) % 3], view.z[(k + 2) % 3])
        gap = max(gap, abs(middle[k] - view.centre[k]) - reach[k] - extent)
    x, y, z = _seen(view, middle)
    along_axis = reach[0] * abs(view.z[0]) + reach[1] * abs(view.z[1]) + reach[2] * abs(view.z[2])
    rho = flat_length(x, y)
    if rho > 0.0:
        out = along(along(ZERO, x / rho, view.x), y / rho, view.y)
        across = reach[0] * abs(out[0]) + reach[1] * abs(out[1]) + reach[2] * abs(out[2])
        gap = max(gap, rho - across - solid.radius)
    return max(gap, abs(z) - along_axis - solid.half)


@inner
def _corners(geometry, view, triangle):
    """Return the corners of a triangle in the axes of the cylinder."""
    a = _seen(view, row(geometry.vertex, geometry.triangle[triangle, 0]))
    b = _seen(view, row(geometry.vertex, geometry.triangle[triangle, 1]))
    c = _seen(view, row(geometry.vertex, geometry.triangle[triangle, 2]))
    return a, b, c


@inner
def _corner_gap(solid, a, b, c):
    """Return a lower bound of the distance of a triangle to the cylinder; negative if they may meet."""
    x, y = a[0] + b[0] + c[0], a[1] + b[1] + c[1]
    size = max(flat_length(x, y), 1e-300)
    x, y = x / size, y / size
    beside = min(x * a[0] + y * a[1], x * b[0] + y * b[1], x * c[0] + y * c[1]) - solid.radius
    return max(beside, min(a[2], b[2], c[2]) - solid.half, -max(a[2], b[2], c[2]) - solid.half)


@inner
def cylinder_round_contacts(geometry, cylinder, round_, pose, margin, contacts, count):
    """Append every touching pair of features of a cylinder and a ROUND primitive."""
    vertex, edge_kind = geometry.vertex, geometry.edge_kind
    solid = solid_of(geometry.frame, geometry.radius, cylinder, margin)
    view = _view(solid, pose.R, pose.t)
    skeleton, stack = geometry.radius[round_], contacts.scratch.pairs
    found = Found(contacts.real, contacts.integer, count)
    stack[0, 0] = geometry.node_first[round_]
    depth = 1
    while depth > 0:
        depth -= 1
        node = stack[depth, 0]
        if _box_gap(solid, view, row(geometry.node_min, node), row(geometry.node_max, node)) > margin + skeleton:
            continue
        child = geometry.node_child[node]
        if child >= 0:
            stack[depth, 0] = child + 1
            stack[depth + 1, 0] = child
            depth += 2
            continue
        start = geometry.node_start[node]
        for slot in range(3 * start, 3 * (start + geometry.node_count[node])):
            triangle, k = slot // 3, slot % 3
            if k == 0:
                a, b, c = _corners(geometry, view, triangle)
                near = _corner_gap(solid, a, b, c) <= margin + skeleton
            if not near:
                continue
            owns = geometry.triangle_owns[triangle] >> k
            corner, edge = geometry.triangle[triangle, k], geometry.triangle_edge[triangle, k]
            if owns & 1 and geometry.vertex_corner[corner]:
                count = _vertex_contact(geometry, solid, view, found, count, corner, skeleton)
            if owns >> 3 & 1 and edge_kind[edge] != EDGE_HIDDEN:
                tail = _seen(view, row(vertex, geometry.edge[edge, 0]))
                d = subtract(_seen(view, row(vertex, geometry.edge[edge, 1])), tail)
                normal_0, normal_1 = edge_normals(geometry.edge_normal, edge)
                arc = (to_axes(view.x, view.y, view.z, normal_0), to_axes(view.x, view.y, view.z, normal_1))
                seen_edge = _Edge(tail, d, arc, edge_kind[edge], skeleton)
                count = _edge_contacts(solid, found, count, seen_edge, 3 * edge + 1)
            if skeleton == 0.0 and k == 0:
                m, corners = to_axes(view.x, view.y, view.z, row(geometry.triangle_normal, triangle)), (a, b, c)
                # An open surface has two sides: the centre, 0 here, tells on which one the cylinder is. Asked about both, a rim that was
                # level with the surface had contacts that pressed it to either, and most cylinders fell through a landscape.
                if not geometry.closed[round_] and dot(m, a) > 0.0:
                    m, corners, beyond = along(ZERO, -1.0, m), (b, a, c), ZERO
                else:
                    beyond = _beyond_sides(geometry, solid, view, triangle, corners)
                count = rims_on_plane(solid, found, count, (m, corners, beyond), TRIANGLE, 3 * triangle + 2)
    if skeleton > 0.0 or count == found.first:  # the closest point of a smooth body is a contact in any case
        pair, triangle = _closest_triangle(geometry, solid, view, round_, margin + skeleton, stack)
        distance, p, q, n = pair
        if triangle >= 0 and dot(n, n) > 0.0:
            touch = (p, along(q, -skeleton, n), n, distance - skeleton)
            count = append(solid, found, count, touch, SIDE, 3 * triangle + 2)
    return count


@inner
def _beyond_sides(geometry, solid, view, triangle, corners):
    """Return how far beyond each side of a face a rim may meet it, m: in valleys that the centre is in (see `mesh_mesh`)."""
    beyond = ZERO
    for k in range(3):
        is_valley, normal = across_valley(geometry, triangle, k)
        reach = solid.margin if is_valley and dot(to_axes(view.x, view.y, view.z, normal), corners[k]) <= 0.0 else 0.0
        beyond = (beyond[1], beyond[2], reach)
    return beyond


@inner
def _vertex_contact(geometry, solid, view, found, count, vertex, skeleton):
    """Append the contact of a vertex if no edge that leaves it comes closer; over a cap that needs not be so."""
    q = _seen(view, row(geometry.vertex, vertex))
    border = BORDER * solid.radius
    rho = flat_length(q[0], q[1])
    if solid.radius < rho <= solid.radius + border and abs(q[2]) > solid.half:  # in line with the rim: over the cap
        q = (q[0] * solid.radius / rho, q[1] * solid.radius / rho, q[2])
    distance, p, _, n = closest_on_curve(q, ZERO, solid.radius, solid.half)
    depth = max(border, solid.depth)
    if distance == 0.0 and skeleton == 0.0 and solid.half - abs(q[2]) <= min(depth, solid.radius - rho + border):
        # In the very plane of the cap, or a little inside.
        n, distance = (0.0, 0.0, 1.0 if q[2] > 0.0 else -1.0), abs(q[2]) - solid.half
        p = (q[0], q[1], n[2] * solid.half)
    elif distance == 0.0 and skeleton == 0.0 and solid.radius - rho <= depth:
        n, distance = (q[0] / rho, q[1] / rho, 0.0), rho - solid.radius
        p = (solid.radius * n[0], solid.radius * n[1], q[2])
    elif distance > solid.margin + skeleton or distance == 0.0:
        return count
    flat = skeleton == 0.0 and abs(n[2]) == 1.0
    for k in range(geometry.vertex_edge_first[vertex], geometry.vertex_edge_first[vertex + 1]):
        edge = geometry.vertex_edge[k]
        other = geometry.edge[edge, 0] + geometry.edge[edge, 1] - vertex
        leaving = subtract(_seen(view, row(geometry.vertex, other)), q)
        length = sqrt(dot(leaving, leaving))
        if not flat and dot(n, leaving) < -min(solid.margin, solid.tilt * length):
            return count
    return append(solid, found, count, (p, along(q, -skeleton, n), n, distance - skeleton), RIM, 3 * vertex)


@inner
def _edge_contacts(solid, found, count, edge, other):
    """Append the contacts of an edge with the side and the rims."""
    a, d, arc, kind, skeleton = edge
    radius, half, reach = solid.radius, solid.half, solid.margin + skeleton
    length = sqrt(dot(d, d))
    direction = along(ZERO, 1.0 / length, d)
    across = d[0] * d[0] + d[1] * d[1]
    nearest = -(a[0] * d[0] + a[1] * d[1]) / across if across > 0.0 else 0.0
    q = along(a, nearest, d)
    rho = flat_length(q[0], q[1])
    if rho > radius + reach:
        return count
    if 0.0 < nearest < 1.0 and abs(q[2]) <= half and rho >= radius + skeleton - solid.depth:
        n = (q[0] / rho, q[1] / rho, 0.0)
        if in_edge_arc((-n[0], -n[1], 0.0), direction, arc[0], arc[1], kind, solid.tilt):
            p = (radius * n[0], radius * n[1], q[2])
            count = append(solid, found, count, (p, along(q, -skeleton, n), n, rho - radius - skeleton), SIDE, other)
    chord = sqrt((radius - rho) * (radius + rho) / across) if rho < radius and across > 0.0 else 0.0
    steep = d[2] * d[2] >= across
    for start in range(4):  # both rims; both places where a shallow line crosses the side
        level = half if start < 2 else -half
        if min(a[2], a[2] + d[2]) > level + reach or max(a[2], a[2] + d[2]) < level - reach:
            continue
        if start % 2 == 1 and (steep or chord == 0.0):
            continue
        t = (level - a[2]) / d[2] if steep else nearest + (chord if start % 2 else -chord)
        t, curvature = closest_to_ring(a, d, d, 0.0, t, radius, level, 1.0)
        if curvature < 0.0 or not 0.0 < t < 1.0:
            continue
        q = along(a, t, d)
        met, p, n, distance = ring_contact(q, d, curvature, solid, level, skeleton)
        if met and in_edge_arc((-n[0], -n[1], -n[2]), direction, arc[0], arc[1], kind, solid.tilt):
            feature = RIM + (0 if start < 2 else 1) + (2 if q[0] * d[0] + q[1] * d[1] > 0.0 else 0)
            count = append(solid, found, count, (p, along(q, -skeleton, n), n, distance - skeleton), feature, other)
    return count


@inner
def _closest_triangle(geometry, solid, view, round_, limit, stack):
    """Return the closest pair of the cylinder and a skeleton, and its triangle, -1 if it is not below `limit`."""
    best, near = (limit, ZERO, ZERO, ZERO), -1
    stack[0, 0] = geometry.node_first[round_]
    depth = 1
    while depth > 0:
        depth -= 1
        node = stack[depth, 0]
        if _box_gap(solid, view, row(geometry.node_min, node), row(geometry.node_max, node)) >= best[0]:
            continue
        child = geometry.node_child[node]
        if child >= 0:
            left = _box_gap(solid, view, row(geometry.node_min, child), row(geometry.node_max, child))
            right = _box_gap(solid, view, row(geometry.node_min, child + 1), row(geometry.node_max, child + 1))
            stack[depth, 0] = child + 1 if left < right else child
            stack[depth + 1, 0] = child if left < right else child + 1
            depth += 2
            continue
        first = geometry.node_start[node]
        for triangle in range(first, first + geometry.node_count[node]):
            a, b, c = _corners(geometry, view, triangle)
            if _corner_gap(solid, a, b, c) < best[0]:
                pair = closest_on_triangle(a, b, c, solid.radius, solid.half)
                if pair[0] < best[0]:
                    best, near = pair, triangle
    return (best, near) if near >= 0 else ((inf, ZERO, ZERO, ZERO), near)


@inner
def cylinder_round_gap(geometry, cylinder, round_, pose, limit, stack, out):
    """Return the least gap, minus the radius if the skeleton is inside; `limit` with `out` untouched if not below."""
    solid = solid_of(geometry.frame, geometry.radius, cylinder, 0.0)
    skeleton = geometry.radius[round_]
    pair, near = _closest_triangle(geometry, solid, _view(solid, pose.R, pose.t), round_, limit + skeleton, stack)
    if near < 0:
        return limit
    distance, p, q, n = pair
    write_points(solid, p, along(q, -skeleton, n), out)
    return distance - skeleton
