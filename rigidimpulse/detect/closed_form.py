"""Pairs with closed forms: a half space against a ROUND primitive, and two spheres.

Half space: solid where n . x <= o. The gap of a vertex p of a core of radius r is n . p - o - r; all corners within the margin
are contacts, so a flat face gives its corners and nothing else. Spheres: gap = |c_b - c_a| - r_a - r_b.
Kernels work in the frame of their first primitive, as `manifold` describes.
"""

from __future__ import annotations

from math import sqrt

from rigidimpulse.detect.features import along, dot, inner, moved, row, subtract, write_contact

HALF_SPACE_CONTACT = 4
"""Kind of contact; its features are the vertex and, for the half space, the primitive."""


@inner
def plane_in_frame(geometry, half_space, R, t):
    """Return normal and offset of a half space given in a frame whose pose in the wanted frame is R, t."""
    frame = geometry.frame
    nx, ny, nz = frame[half_space, 0], frame[half_space, 1], frame[half_space, 2]
    normal = (
        R[0, 0] * nx + R[0, 1] * ny + R[0, 2] * nz,
        R[1, 0] * nx + R[1, 1] * ny + R[1, 2] * nz,
        R[2, 0] * nx + R[2, 1] * ny + R[2, 2] * nz,
    )
    return normal, frame[half_space, 3] + normal[0] * t[0] + normal[1] * t[1] + normal[2] * t[2]


@inner
def _least_height(geometry, node, normal, offset):
    """Return the least height of the box of a node over a plane."""
    height = -offset
    for k in range(3):
        height += min(normal[k] * geometry.node_min[node, k], normal[k] * geometry.node_max[node, k])
    return height


@inner
def round_half_space_contacts(
    geometry, round_, half_space, R, t, margin, stack, contact_real, contact_int, count
):
    """Append the corners of a ROUND primitive within `margin` of a half space, in the frame of the former."""
    normal, offset = plane_in_frame(geometry, half_space, R, t)
    inward = (-normal[0], -normal[1], -normal[2])
    radius = geometry.radius[round_]
    stack[0, 0] = geometry.node_first[round_]
    depth = 1
    while depth > 0:
        depth -= 1
        node = stack[depth, 0]
        if _least_height(geometry, node, normal, offset) > margin + radius:
            continue
        if geometry.node_child[node] >= 0:
            stack[depth, 0] = geometry.node_child[node] + 1
            stack[depth + 1, 0] = geometry.node_child[node]
            depth += 2
            continue
        for triangle in range(geometry.node_start[node], geometry.node_start[node] + geometry.node_count[node]):
            for k in range(3):
                vertex = geometry.triangle[triangle, k]
                if not (geometry.triangle_owns[triangle] >> k & 1 and geometry.vertex_corner[vertex]):
                    continue
                p = row(geometry.vertex, vertex)
                height = dot(p, normal) - offset
                if height - radius <= margin:
                    count = write_contact(
                        contact_real,
                        contact_int,
                        count,
                        along(p, -radius, normal),
                        along(p, -height, normal),
                        inward,
                        height - radius,
                        HALF_SPACE_CONTACT,
                        vertex,
                        half_space,
                    )
    return count


@inner
def round_half_space_gap(geometry, round_, half_space, R, t, limit, stack, out):
    """Return the least gap, or `limit` with `out` untouched if it is not below; out[0:6]: points, ROUND one's frame."""
    normal, offset = plane_in_frame(geometry, half_space, R, t)
    radius = geometry.radius[round_]
    best = limit + radius
    lowest = -1
    stack[0, 0] = geometry.node_first[round_]
    depth = 1
    while depth > 0:
        depth -= 1
        node = stack[depth, 0]
        if _least_height(geometry, node, normal, offset) >= best:
            continue
        if geometry.node_child[node] < 0:
            for triangle in range(geometry.node_start[node], geometry.node_start[node] + geometry.node_count[node]):
                for k in range(3):
                    height = dot(row(geometry.vertex, geometry.triangle[triangle, k]), normal) - offset
                    if height < best:
                        best = height
                        lowest = geometry.triangle[triangle, k]
            continue
        left = geometry.node_child[node]
        left_first = _least_height(geometry, left, normal, offset) <= _least_height(geometry, left + 1, normal, offset)
        stack[depth, 0] = left + 1 if left_first else left
        stack[depth + 1, 0] = left if left_first else left + 1
        depth += 2
    if lowest < 0:
        return limit
    p = row(geometry.vertex, lowest)
    for i in range(3):
        out[i] = p[i] - radius * normal[i]
        out[3 + i] = p[i] - best * normal[i]
    return best - radius


@inner
def is_sphere(geometry, primitive):
    """Tell whether a ROUND primitive is a single point with a radius."""
    return geometry.vertex_first[primitive + 1] - geometry.vertex_first[primitive] == 1


@inner
def sphere_sphere_contact(geometry, first, second, R, t, margin, contact_real, contact_int, count, corner):
    """Append the contact of two spheres with gap <= margin, in the first one's frame; `corner`: its kind."""
    vertex_a = geometry.vertex_first[first]
    vertex_b = geometry.vertex_first[second]
    radius_a = geometry.radius[first]
    radius_b = geometry.radius[second]
    centre_a = row(geometry.vertex, vertex_a)
    centre_b = moved(R, t, row(geometry.vertex, vertex_b))
    between = subtract(centre_b, centre_a)
    distance = sqrt(dot(between, between))
    gap = distance - radius_a - radius_b
    if gap > margin or distance == 0.0:
        return count
    normal = (between[0] / distance, between[1] / distance, between[2] / distance)
    point_a = along(centre_a, radius_a, normal)
    point_b = along(centre_b, -radius_b, normal)
    return write_contact(
        contact_real, contact_int, count, point_a, point_b, normal, gap, corner, 2 * vertex_a, 2 * vertex_b
    )
