"""Contacts of two surfaces of triangles (mesh on mesh, box on mesh, capsule on mesh): ROUND primitives, grown by a radius.

The features of two skeletons at distance d <= margin + r_a + r_b that are locally closest make the contacts; the radii are
then taken off along the normal: gap = d - r_a - r_b.
- vertex - face: the vertex projects into the face, and no edge that leaves it dives below by more than the margin
  (else the vertex of a box that stands flush on another one would meet its side). All corners within the margin
  count: a flat contact gives its corners.
- edge - edge (see `mesh_edges`): the common normal meets both edges and lies in the Gauss arcs of both. Nearly parallel
  edges have both ends of their overlap, with the normal at its middle.
- vertex - edge, vertex - vertex: the normal n runs between the points; it must lie in the arc of the edge and in the
  cone of each vertex: u . n <= 0 for every edge u that leaves it (n away from its body).
Normals of faces and crossing edges come from the surfaces, not from the difference of two points, and stay exact
however small the gap is; the others carry an error of round-off / d. Each vertex and edge is owned by one triangle,
so a pair of features is met once; flat or concave edges and vertices without a convex edge are left out (see
`geometry`).

Contacts that miss being locally closest by less than the margin are kept in two cases: crossing edges, which are
corners of faces that lie on each other and get the normal at the end of the arc, and capsules, whose contacts at both
ends of a line are wanted though one end is a little farther away.

Both box trees are walked at once; pairs of leaves are gathered in chunks, so that no scene needs a larger buffer. Pairs of nodes whose
normals cannot oppose each other are left out (see `normal_cones`), unless any normal is to pass.
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from rigidimpulse.collision.bvh import STACK_ROWS, gather_leaf_pairs
from rigidimpulse.collision.distance.meshes import round_round_gap
from rigidimpulse.collision.distance.simplices import CORNER, FACE_VERTEX, VERTEX_FACE, edge_normals, in_edge_arc, inner, over_triangle
from rigidimpulse.collision.geometry import EDGE_HIDDEN
from rigidimpulse.collision.manifold.contact_points import (
    ANY,
    DEPTH,
    INSIDE,
    MERGE,
    MOST_DEPTH,
    ROUND_OFF,
    STRICT,
    TILT,
    Contact,
    Found,
    View,
    append_contact,
    outside_box,
)
from rigidimpulse.collision.manifold.mesh_edges import edge_contacts
from rigidimpulse.core.kernels import inlined, jit_making_arrays
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.core.vector import along, dot, moved, row, subtract, turned

CREASE = 2.0 * TOLERANCES.surface.flat_angle
"""How far outside a face beyond a hidden edge a point still counts as inside, relative to its height."""


@inner
def _append_vertex(view, found, count, nearest, merge):
    """Append a contact of a vertex with a triangle: `nearest` is that of their skeletons, vertex first, in the triangle's frame."""
    normal, kind = nearest.normal, nearest.kind
    gap = nearest.gap - view.radius_v - view.radius_t
    point_v = along(nearest.point_a, view.radius_v, normal)
    point_t = along(nearest.point_b, -view.radius_t, normal)
    if view.flipped:
        normal = (-normal[0], -normal[1], -normal[2])
        return append_contact(
            found, count, Contact(point_t, point_v, normal, gap, kind, nearest.feature_b, nearest.feature_a), merge
        )
    point_v = moved(view.R_back, view.t_back, point_v)
    point_t = moved(view.R_back, view.t_back, point_t)
    normal = turned(view.R_back, normal)
    return append_contact(found, count, Contact(point_v, point_t, normal, gap, kind, nearest.feature_a, nearest.feature_b), merge)


@inner
def _in_vertex_cone(geometry, corner, direction, slack, tolerance):
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


@inlined
def _face_contact(geometry, view, found, count, vertex, p, triangle, height):
    """Append the contact of a vertex at `p`, `height` over the plane of a face, if it lies over the face."""
    a, b, c = (
        row(geometry.vertex, geometry.triangle[triangle, 0]),
        row(geometry.vertex, geometry.triangle[triangle, 1]),
        row(geometry.vertex, geometry.triangle[triangle, 2]),
    )
    normal = row(geometry.triangle_normal, triangle)
    hidden = (
        geometry.edge_kind[geometry.triangle_edge[triangle, 0]] == EDGE_HIDDEN,
        geometry.edge_kind[geometry.triangle_edge[triangle, 1]] == EDGE_HIDDEN,
        geometry.edge_kind[geometry.triangle_edge[triangle, 2]] == EDGE_HIDDEN,
    )
    side = subtract(b, a)
    size = sqrt(dot(side, side))
    # Across a hidden edge the faces may meet at up to the flat angle: their prisms overlap, so that no gap is between.
    crease = CREASE * abs(height)
    slack_ab = INSIDE * size + (crease if hidden[0] else 0.0)
    slack_bc = INSIDE * size + (crease if hidden[1] else 0.0)
    slack_ca = INSIDE * size + (crease if hidden[2] else 0.0)
    if (height < -view.depth and not view.two_sided) or not over_triangle(p, a, b, c, normal, slack_ab, slack_bc, slack_ca):
        return count
    foot = along(p, -height, normal)
    sense = 1.0 if height < 0.0 and view.two_sided else -1.0
    # Near an open surface the height does not tell on which side the body is, since it may be a little inside: its corner does.
    for _ in range(2 if view.two_sided and abs(height) <= view.depth else 1):
        outward = (sense * normal[0], sense * normal[1], sense * normal[2])
        if _in_vertex_cone(geometry, vertex, turned(view.R_back, outward), view.skeleton, TILT):
            contact = Contact(p, foot, outward, -sense * height, FACE_VERTEX if view.flipped else VERTEX_FACE, vertex, triangle)
            return _append_vertex(view, found, count, contact, MERGE * size + 2.0 * crease)
        sense = -sense
    return count


@inner
def _face_contacts(geometry, view, pairs, end, found, count):
    """Append the contacts of the corners in one node of each pair with the faces in the other."""
    vertex, triangle, touching_first, touching = geometry.vertex, geometry.triangle, geometry.touching_first, geometry.touching
    for pair in range(STACK_ROWS, end):
        node_v = pairs[pair, 1] if view.flipped else pairs[pair, 0]
        node_t = pairs[pair, 0] if view.flipped else pairs[pair, 1]
        low, high = row(geometry.node_min, node_t), row(geometry.node_max, node_t)
        start_t, count_t = geometry.node_start[node_t], geometry.node_count[node_t]
        start_v, count_v = geometry.node_start[node_v], geometry.node_count[node_v]
        for i in range(touching_first[start_v], touching_first[start_v + count_v]):
            if touching[i] % 2 == 1:
                continue
            corner = touching[i] // 2
            p = moved(view.R, view.t, row(vertex, corner))
            if outside_box(p, p, low, high, view.reach):
                continue
            for face in range(start_t, start_t + count_t):
                a = row(vertex, triangle[face, 0])
                normal = row(geometry.triangle_normal, face)
                height = dot(subtract(p, a), normal)
                # A triangle with two equal corners is a segment or a point and has no face.
                if height > view.skeleton or height < -view.reach or triangle[face, 1] == triangle[face, 2]:
                    continue
                count = _face_contact(geometry, view, found, count, corner, p, face, height)
    return count


@inlined
def _corner_contact(geometry, view, found, count, corner, p, touched):
    """Append the contact of a vertex at `p` with an edge or a vertex if it is locally closest.

    touched: (point of the edge or vertex, 2 * vertex or 2 * edge + 1, size of the feature in m).
    """
    vertex, edge = geometry.vertex, geometry.edge
    foot, feature, size = touched
    between = subtract(foot, p)
    distance = sqrt(dot(between, between))
    # Points that coincide give no normal.
    if distance <= ROUND_OFF * size:
        return count
    normal = (between[0] / distance, between[1] / distance, between[2] / distance)
    outward = (-normal[0], -normal[1], -normal[2])
    # The normal is a difference of two close points: its error is round-off over their distance.
    error = ROUND_OFF * (size + abs(p[0]) + abs(p[1]) + abs(p[2])) / distance
    # A normal that may point anywhere once pushed bricks into each other, whose corners were 1e-16 of their size apart.
    if error > TILT and view.leeway == 0.0:
        return count
    tolerance = STRICT + view.leeway + error
    other = feature // 2
    if feature % 2 == 1:
        direction = subtract(row(vertex, edge[other, 1]), row(vertex, edge[other, 0]))
        direction = (direction[0] / size, direction[1] / size, direction[2] / size)
        normal_0, normal_1 = edge_normals(geometry.edge_normal, other)
        tilt = tolerance + min(TILT, view.slack / size)
        if not in_edge_arc(outward, direction, normal_0, normal_1, geometry.edge_kind[other], tilt):
            return count
    elif not _in_vertex_cone(geometry, other, outward, view.slack, tolerance):
        return count
    if not _in_vertex_cone(geometry, corner, turned(view.R_back, normal), view.slack, tolerance):
        return count
    return _append_vertex(view, found, count, Contact(p, foot, normal, distance, CORNER, 2 * corner, feature), MERGE * size)


@inner
def _corner_contacts(geometry, view, pairs, end, found, count):
    """Append the contacts of the corners in one node of each pair with the edges and corners in the other.

    Returns the new count, and whether any two of these are in reach.
    """
    vertex, edge, touching_first, touching = geometry.vertex, geometry.edge, geometry.touching_first, geometry.touching
    skeleton_squared, any_near = view.skeleton * view.skeleton, False
    for pair in range(STACK_ROWS, end):
        node_v = pairs[pair, 1] if view.flipped else pairs[pair, 0]
        node_t = pairs[pair, 0] if view.flipped else pairs[pair, 1]
        low, high = row(geometry.node_min, node_t), row(geometry.node_max, node_t)
        start_t, start_v = geometry.node_start[node_t], geometry.node_start[node_v]
        first_t, last_t = touching_first[start_t], touching_first[start_t + geometry.node_count[node_t]]
        for i in range(touching_first[start_v], touching_first[start_v + geometry.node_count[node_v]]):
            if touching[i] % 2 == 1:
                continue
            corner = touching[i] // 2
            p = moved(view.R, view.t, row(vertex, corner))
            if outside_box(p, p, low, high, view.skeleton):
                continue
            for j in range(first_t, last_t):
                feature = touching[j]
                if feature % 2 == 1:
                    e = feature // 2
                    a = row(vertex, edge[e, 0])
                    side = subtract(row(vertex, edge[e, 1]), a)
                    length_squared = dot(side, side)
                    s = dot(subtract(p, a), side) / length_squared
                    foot = along(a, s, side)
                    off = subtract(foot, p)
                    if -INSIDE <= s <= 1.0 + INSIDE and dot(off, off) <= skeleton_squared:
                        size, any_near = sqrt(length_squared), True
                        count = _corner_contact(geometry, view, found, count, corner, p, (foot, feature, size))
                # Two corners are compared once, from the side of the first body.
                elif not view.flipped:
                    foot = row(vertex, feature // 2)
                    off = subtract(foot, p)
                    if dot(off, off) <= skeleton_squared:
                        size, any_near = abs(p[0]) + abs(p[1]) + abs(p[2]) + abs(foot[0]) + abs(foot[1]) + abs(foot[2]), True
                        count = _corner_contact(geometry, view, found, count, corner, p, (foot, feature, size))
    return count, any_near


@jit_making_arrays
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
def _keep_closest(found, end):
    """Keep the contact of least gap of those found up to `end`; return the new count."""
    real, integer, first = found
    closest = first
    for other in range(first + 1, min(end, real.shape[0])):
        if real[other, 9] < real[closest, 9]:
            closest = other
    if closest > first:
        for column in range(real.shape[1]):
            real[first, column] = real[closest, column]
        for column in range(integer.shape[1]):
            integer[first, column] = integer[closest, column]
    return min(end, first + 1)


@jit_making_arrays
def _meet(geometry, first, second, pose, pairs):
    """Whether the skeletons of two primitives cross or are nearer than what is left of normals by round-off."""
    nearest = MERGE * min(geometry.bound_radius[first], geometry.bound_radius[second])
    pairs[0, 0] = geometry.node_first[first]
    pairs[0, 1] = geometry.node_first[second]
    _, end, _ = gather_leaf_pairs(geometry, pose.R, pose.t, nearest, nearest, True, pairs, np.int64(1))
    # Most pairs end here: no leaves meet.
    if end == STACK_ROWS:
        return False
    limit = nearest - geometry.radius[first] - geometry.radius[second]
    return round_round_gap(geometry, first, second, pose, limit, pairs, np.empty(7)) < limit


@jit_making_arrays
def round_round_contacts(geometry, first, second, pose, margin, contacts, count):
    """Append the contacts of two ROUND primitives with gap <= margin, in the first one's frame; return the new count.

    Where round-off lets no normal pass, the closest pair of features is the one contact.
    """
    R, t, pairs = pose.R, pose.t, contacts.scratch
    R_back, t_back = _pose_back(R, t)
    radius_a, radius_b = geometry.radius[first], geometry.radius[second]
    size = min(geometry.bound_radius[first], geometry.bound_radius[second])
    skeleton, depth = margin + radius_a + radius_b, min(DEPTH * margin, MOST_DEPTH * size)
    reach = max(skeleton, depth)
    edges_a = geometry.edge_first[first + 1] - geometry.edge_first[first]
    edges_b = geometry.edge_first[second + 1] - geometry.edge_first[second]
    slack = margin if edges_a > 0 and edges_b > 0 and radius_a + radius_b > 0.0 else 0.0
    open_a, open_b = not geometry.closed[first], not geometry.closed[second]
    found = Found(contacts.real, contacts.integer, count)
    any_near, any_left_out = False, False
    for leeway in (0.0, ANY):
        of_a = View(False, R_back, t_back, R, t, radius_a, radius_b, margin, depth, skeleton, reach, slack, leeway, open_b)
        of_b = View(True, R, t, R_back, t_back, radius_b, radius_a, margin, depth, skeleton, reach, slack, leeway, open_a)
        pairs[0, 0] = geometry.node_first[first]
        pairs[0, 1] = geometry.node_first[second]
        stacked = np.int64(1)  # (a literal would compile the walk twice)
        while stacked > 0:
            stacked, end, left_out = gather_leaf_pairs(geometry, R, t, reach, depth + INSIDE * reach, leeway == ANY, pairs, stacked)
            any_left_out = any_left_out or left_out
            count, near = edge_contacts(geometry, of_b, pairs, end, found, count)
            any_near = any_near or near
            for view in (of_a, of_b):
                count = _face_contacts(geometry, view, pairs, end, found, count)
                count, near = _corner_contacts(geometry, view, pairs, end, found, count)
                any_near = any_near or near
        if leeway == ANY:
            return _keep_closest(found, count)
        # Without any two features in reach there is no contact that round-off could have cost its normal.
        if count > found.first or not (any_near or (any_left_out and _meet(geometry, first, second, pose, pairs))):
            return count
    return count
