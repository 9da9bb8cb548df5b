"""Pairs with closed forms: a half space against a ROUND primitive, and two spheres.

Half space: solid where n . x <= o. The gap of a vertex p of a skeleton with radius r is n . p - o - r; all corners within the
margin are contacts, so a flat face gives its corners and nothing else. Spheres: gap = |c_b - c_a| - r_a - r_b.
Kernels work in the frame of their first primitive, as `dispatch` describes.
"""

from __future__ import annotations

from math import sqrt

from rigidimpulse.collision.distance.simplices import CORNER, HALF_SPACE_CONTACT, inner
from rigidimpulse.collision.manifold.contact_points import Contact, write_contact
from rigidimpulse.core.vector import along, dot, moved, row, subtract


@inner
def plane_in_frame(frame, half_space, R, t):
    """Return normal and offset of a half space given in a frame whose pose in the wanted frame is R, t."""
    nx, ny, nz = frame[half_space, 0], frame[half_space, 1], frame[half_space, 2]
    normal = (
        R[0, 0] * nx + R[0, 1] * ny + R[0, 2] * nz,
        R[1, 0] * nx + R[1, 1] * ny + R[1, 2] * nz,
        R[2, 0] * nx + R[2, 1] * ny + R[2, 2] * nz,
    )
    return normal, frame[half_space, 3] + normal[0] * t[0] + normal[1] * t[1] + normal[2] * t[2]


@inner
def _least_height(low, high, normal, offset):
    """Return the least height of a box over a plane."""
    height = -offset
    for k in range(3):
        height += min(normal[k] * low[k], normal[k] * high[k])
    return height


@inner
def round_half_space_contacts(geometry, round_, half_space, pose, margin, contacts, count):
    """Append the corners of a ROUND primitive within `margin` of a half space, in the frame of the former."""
    node_min, node_max, node_child = geometry.node_min, geometry.node_max, geometry.node_child
    node_start, node_count = geometry.node_start, geometry.node_count
    triangle, owns, corner = geometry.triangle, geometry.triangle_owns, geometry.vertex_corner
    normal, offset = plane_in_frame(geometry.frame, half_space, pose.R, pose.t)
    stack = contacts.scratch.pairs
    inward = (-normal[0], -normal[1], -normal[2])
    radius = geometry.radius[round_]
    stack[0, 0] = geometry.node_first[round_]
    depth = 1
    while depth > 0:
        depth -= 1
        node = stack[depth, 0]
        if _least_height(row(node_min, node), row(node_max, node), normal, offset) > margin + radius:
            continue
        if node_child[node] >= 0:
            stack[depth, 0] = node_child[node] + 1
            stack[depth + 1, 0] = node_child[node]
            depth += 2
            continue
        for slot in range(3 * node_start[node], 3 * (node_start[node] + node_count[node])):
            vertex = triangle[slot // 3, slot % 3]
            # Corners only: a flat face gives its corners and nothing else; each is visited by its owner.
            if not (owns[slot // 3] >> (slot % 3) & 1 and corner[vertex]):
                continue
            p = row(geometry.vertex, vertex)
            height = dot(p, normal) - offset
            if height - radius <= margin:
                surface = along(p, -radius, normal)
                foot = along(p, -height, normal)
                contact = Contact(surface, foot, inward, height - radius, HALF_SPACE_CONTACT, vertex, half_space)
                count = write_contact(contacts.real, contacts.integer, count, contact)
    return count


@inner
def round_half_space_gap(geometry, round_, half_space, pose, limit, stack, out):
    """Return the least gap, or `limit` with `out` untouched if it is not below; out[0:6]: points, ROUND one's frame."""
    node_min, node_max, node_child = geometry.node_min, geometry.node_max, geometry.node_child
    normal, offset = plane_in_frame(geometry.frame, half_space, pose.R, pose.t)
    radius = geometry.radius[round_]
    best = limit + radius
    lowest = -1
    stack[0, 0] = geometry.node_first[round_]
    depth = 1
    while depth > 0:
        depth -= 1
        node = stack[depth, 0]
        if _least_height(row(node_min, node), row(node_max, node), normal, offset) >= best:
            continue
        left = node_child[node]
        if left < 0:
            start = geometry.node_start[node]
            for slot in range(3 * start, 3 * (start + geometry.node_count[node])):
                vertex = geometry.triangle[slot // 3, slot % 3]
                height = dot(row(geometry.vertex, vertex), normal) - offset
                if height < best:
                    best = height
                    lowest = vertex
            continue
        height_left = _least_height(row(node_min, left), row(node_max, left), normal, offset)
        height_right = _least_height(row(node_min, left + 1), row(node_max, left + 1), normal, offset)
        # The lower box is walked first, so that the higher one can be left out.
        left_first = height_left <= height_right
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
def sphere_sphere_contacts(geometry, first, second, pose, margin, contacts, count):
    """Append the contact of two spheres with gap <= margin, in the frame of the first, if their centres differ."""
    vertex_a, vertex_b = geometry.vertex_first[first], geometry.vertex_first[second]
    radius_a, radius_b = geometry.radius[first], geometry.radius[second]
    centre_a, centre_b = row(geometry.vertex, vertex_a), moved(pose.R, pose.t, row(geometry.vertex, vertex_b))
    between = subtract(centre_b, centre_a)
    distance = sqrt(dot(between, between))
    gap = distance - radius_a - radius_b
    if gap > margin or distance == 0.0:
        return count
    normal = (between[0] / distance, between[1] / distance, between[2] / distance)
    point_a = along(centre_a, radius_a, normal)
    point_b = along(centre_b, -radius_b, normal)
    contact = Contact(point_a, point_b, normal, gap, CORNER, 2 * vertex_a, 2 * vertex_b)
    return write_contact(contacts.real, contacts.integer, count, contact)
