"""Contacts of two surfaces of triangles (mesh on mesh, box on mesh, capsule on mesh): ROUND primitives, grown by a radius.

The features of two skeletons at distance d <= margin + r_a + r_b that are locally closest make the contacts; the radii are
then taken off along the normal: gap = d - r_a - r_b.
- vertex - face: the vertex projects into the face, and no edge that leaves it dives below by more than the margin
  (else the vertex of a box that stands flush on another one would meet its side). All corners within the margin
  count: a flat contact gives its corners. Near the bottom of a valley a vertex over one face meets the other one, too:
  it projects into its plane only when it is there, and what slides fast is through by the next look.
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
normals cannot oppose each other are left out (see `normal_cones`), unless any normal is to pass. Of the features in the leaves, pairs that
may touch are listed first (`near_features`); a list may be kept for the next looks (`kept_features`). Contacts come from the pairs listed.
"""

from __future__ import annotations

from math import cos, sin, sqrt
from typing import NamedTuple

import numpy as np

from rigidimpulse.collision.bvh import STACK_ROWS, NodeLimits, gather_leaf_pairs
from rigidimpulse.collision.distance.meshes import round_round_gap
from rigidimpulse.collision.distance.simplices import CORNER, FACE_VERTEX, VERTEX_FACE, edge_normals, in_edge_arc, inner
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
    Pose,
    View,
    append_contact,
)
from rigidimpulse.collision.manifold.kept_features import (
    BEGIN,
    END,
    IS_NEAR,
    LEAST,
    LEFT_OUT,
    LEVER,
    LOOKED,
    MARGIN,
    WAY,
    end_list,
    moved_by,
    next_way,
    note_list,
    place_of,
    rows_of_search,
)
from rigidimpulse.collision.manifold.mesh_edges import edge_contacts
from rigidimpulse.collision.manifold.near_features import (
    CREASE,
    EDGES,
    EVERY_NORMAL,
    FLIPPED,
    ON_FACE,
    in_vertex_cone,
    is_over_face,
    near_features,
)
from rigidimpulse.core.kernels import inlined, jit_making_arrays
from rigidimpulse.core.vector import along, dot, moved, row, subtract, turned

TURN = 1.05
"""At least 2 asin(f / 2) / f for f up to 1."""


class Meeting(NamedTuple):
    """Two ROUND primitives at a pose."""

    first: int
    second: int
    pose: Pose  # of the second in the frame of the first
    back: Pose  # the reverse
    margin: float  # m, greatest gap


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


@inlined
def _face_contact(geometry, view, found, count, vertex, triangle):
    """Append the contact of a vertex with a face, if it lies over it."""
    p, normal = moved(view.R, view.t, row(geometry.vertex, vertex)), row(geometry.triangle_normal, triangle)
    a, b = row(geometry.vertex, geometry.triangle[triangle, 0]), row(geometry.vertex, geometry.triangle[triangle, 1])
    height = dot(subtract(p, a), normal)
    if height > view.skeleton or height < -view.reach or (height < -view.depth and not view.two_sided):
        return count
    valley = view.skeleton if height >= 0.0 or not view.two_sided else 0.0
    if not is_over_face(geometry, p, triangle, height, 0.0, valley):
        return count
    side, foot = subtract(b, a), along(p, -height, normal)
    size, crease = sqrt(dot(side, side)), CREASE * abs(height)
    sense = 1.0 if height < 0.0 and view.two_sided else -1.0
    # Near an open surface the height does not tell on which side the body is, since it may be a little inside: its corner does.
    for _ in range(2 if view.two_sided and abs(height) <= view.depth else 1):
        outward = (sense * normal[0], sense * normal[1], sense * normal[2])
        if in_vertex_cone(geometry, vertex, turned(view.R_back, outward), view.skeleton, TILT):
            contact = Contact(p, foot, outward, -sense * height, FACE_VERTEX if view.flipped else VERTEX_FACE, vertex, triangle)
            return _append_vertex(view, found, count, contact, MERGE * size + 2.0 * crease)
        sense = -sense
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
    elif not in_vertex_cone(geometry, other, outward, view.slack, tolerance):
        return count
    if not in_vertex_cone(geometry, corner, turned(view.R_back, normal), view.slack, tolerance):
        return count
    return _append_vertex(view, found, count, Contact(p, foot, normal, distance, CORNER, 2 * corner, feature), MERGE * size)


@inner
def _feature_contact(geometry, view, found, count, corner, feature):
    """Append the contact of a corner with an edge or a corner, if they are in reach; returns the new count, and whether they are."""
    p, other = moved(view.R, view.t, row(geometry.vertex, corner)), feature // 2
    if feature % 2 == 1:
        a = row(geometry.vertex, geometry.edge[other, 0])
        side = subtract(row(geometry.vertex, geometry.edge[other, 1]), a)
        length_squared = dot(side, side)
        s = dot(subtract(p, a), side) / length_squared
        if s < -INSIDE or s > 1.0 + INSIDE:
            return count, False
        foot, size = along(a, s, side), sqrt(length_squared)
    else:
        foot = row(geometry.vertex, other)
        size = abs(p[0]) + abs(p[1]) + abs(p[2]) + abs(foot[0]) + abs(foot[1]) + abs(foot[2])
    off = subtract(foot, p)
    if dot(off, off) > view.skeleton * view.skeleton:
        return count, False
    return _corner_contact(geometry, view, found, count, corner, p, (foot, feature, size)), True


@inner
def _contacts_of_features(geometry, views, rows, span, found, count):
    """Append the contacts of the pairs of features in rows `span` (begin, end); returns the new count, and whether any are in reach."""
    of_a, of_b = views
    any_near = False
    for r in range(span[0], span[1]):
        kind, one, other = rows[r, 0], np.int64(rows[r, 1]), np.int64(rows[r, 2])
        view, near = of_b if kind > FLIPPED else of_a, False
        if kind == EDGES:
            count, near = edge_contacts(geometry, of_b, found, count, one, other)
        elif kind == ON_FACE or kind == ON_FACE + FLIPPED:
            count = _face_contact(geometry, view, found, count, one, other)
        else:
            count, near = _feature_contact(geometry, view, found, count, one, other)
        any_near = any_near or near
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
def _meet(geometry, meeting, pairs):
    """Whether the skeletons of two primitives cross or are nearer than what is left of normals by round-off."""
    first, second = meeting.first, meeting.second
    nearest = MERGE * min(geometry.bound_radius[first], geometry.bound_radius[second])
    pairs[0, 0], pairs[0, 1] = geometry.node_first[first], geometry.node_first[second]
    limits = NodeLimits(nearest, nearest, nearest, 1.0, 0.0)
    _, end, _ = gather_leaf_pairs(geometry, meeting.pose.R, meeting.pose.t, limits, True, pairs, np.int64(1))
    # Most pairs end here: no leaves meet.
    if end == STACK_ROWS:
        return False
    limit = nearest - geometry.radius[first] - geometry.radius[second]
    return round_round_gap(geometry, first, second, meeting.pose, limit, pairs, np.empty(7)) < limit


@jit_making_arrays
def _are_in_reach(geometry, meeting, pairs):
    """Whether the skeletons of two primitives are as near as contacts are looked for."""
    first, second, exact = meeting.first, meeting.second, _views(geometry, meeting, 0.0, 0.0)[0]
    limit = exact.reach * (1.0 + INSIDE) - exact.radius_v - exact.radius_t
    return round_round_gap(geometry, first, second, meeting.pose, limit, pairs, np.empty(7)) < limit


@jit_making_arrays
def _views(geometry, meeting, way, leeway):
    """The vertices of the first primitive seen from the second and the reverse; what is looked at reaches `way` m farther."""
    first, second, (R, t), (R_back, t_back), margin = meeting
    radius_a, radius_b = geometry.radius[first], geometry.radius[second]
    size = min(geometry.bound_radius[first], geometry.bound_radius[second])
    skeleton, depth = margin + radius_a + radius_b, min(DEPTH * margin, MOST_DEPTH * size)
    reach = max(skeleton, depth) + way
    skeleton, depth = skeleton + way, depth + way
    edges_a = geometry.edge_first[first + 1] - geometry.edge_first[first]
    edges_b = geometry.edge_first[second + 1] - geometry.edge_first[second]
    slack = margin if edges_a > 0 and edges_b > 0 and radius_a + radius_b > 0.0 else 0.0
    open_a, open_b = not geometry.closed[first], not geometry.closed[second]
    return (
        View(False, R_back, t_back, R, t, radius_a, radius_b, margin, depth, skeleton, reach, slack, leeway, open_b),
        View(True, R, t, R_back, t_back, radius_b, radius_a, margin, depth, skeleton, reach, slack, leeway, open_a),
    )


@jit_making_arrays
def _search(geometry, meeting, motion, leeway, scratch, found, count):
    """Append the contacts of two primitives, and write the pairs of features that may touch at poses within `motion` (see `near_features`).

    Returns the new count, whether any features are in reach, whether normals have left out boxes in reach, and how many rows were written;
    -1 if leaves or rows were too many to be looked at together.
    """
    exact, wide, (way, turn) = _views(geometry, meeting, 0.0, leeway), _views(geometry, meeting, motion[0], leeway), motion
    begin, last_row = rows_of_search(scratch.features)
    rows, pairs, reach, pose = scratch.features.rows[begin:last_row], scratch.pairs, exact[0].reach, meeting.pose
    angle = max(turn, 0.0)
    limits = NodeLimits(reach, reach + way, exact[0].depth + exact[0].skeleton + INSIDE * reach + way, cos(angle), sin(angle))
    pairs[0, 0], pairs[0, 1] = geometry.node_first[meeting.first], geometry.node_first[meeting.second]
    used, together, any_near, any_left_out = np.int64(0), True, False, False
    stacked = np.int64(1)  # (a literal would compile the walk twice)
    while stacked > 0:
        stacked, end, left_out = gather_leaf_pairs(geometry, pose.R, pose.t, limits, leeway == ANY, pairs, stacked)
        any_left_out, together = any_left_out or left_out, together and stacked == 0
        at, most = np.int64(STACK_ROWS), end - STACK_ROWS
        while at < end:
            last = min(at + most, end)
            after, near = near_features(geometry, wide, motion, pairs, (at, last), rows, used)
            if after > rows.shape[0]:
                # What was written is done with; if that is not enough, fewer leaves are looked at together.
                most = most if used > 0 else (most + 1) // 2
                used, together = np.int64(0), False
                continue
            count, is_near = _contacts_of_features(geometry, exact, rows, (used, after), found, count)
            any_near = any_near or (is_near if turn < 0.0 else near)
            at, used = last, after if together else np.int64(0)
    return count, any_near, any_left_out, used if together else np.int64(-1)


@jit_making_arrays
def _of_list(geometry, meeting, contacts, found, count):
    """Append the contacts of the features that are kept of two primitives, or are now found to be near.

    Returns the new count, whether any may be in reach, and whether normals may have left out boxes in reach.
    """
    scratch, lists, (first, second) = contacts.scratch, contacts.scratch.features, (meeting.first, meeting.second)
    views, size = _views(geometry, meeting, 0.0, 0.0), min(geometry.bound_radius[first], geometry.bound_radius[second])
    least, pose, smaller = (LEAST * size, 2.0 * LEAST), meeting.pose, second
    if geometry.bound_radius[first] < geometry.bound_radius[second]:
        pose, smaller = meeting.back, first
    if lists.integer.shape[0] == 0:
        count, near, left_out, _ = _search(geometry, meeting, least, 0.0, scratch, found, count)
        return count, near, left_out
    way = least[0]
    place, known = place_of(lists, first, second)
    if known:
        kept, bounds, looks = lists.integer[place], lists.real[place], lists.integer[place, LOOKED]
        gone = moved_by(lists.real, place, pose.R, pose.t, row(geometry.bound_centre, smaller), bounds[LEVER])
        if gone <= bounds[WAY] and meeting.margin <= bounds[MARGIN]:
            kept[LOOKED] = looks + 1
            count, _ = _contacts_of_features(geometry, views, lists.rows, (kept[BEGIN], kept[END]), found, count)
            return count, kept[IS_NEAR] != 0, kept[LEFT_OUT] != 0
        way = next_way(gone, looks, size)
    lever = geometry.bound_radius[smaller] + views[0].reach + way
    note_list(lists, place, (first, second), (way, meeting.margin, lever), pose.R, pose.t)
    after, near, left_out, rows = _search(geometry, meeting, (way, TURN * way / lever), 0.0, scratch, found, count)
    end_list(lists, place, rows, near, left_out)
    if rows < 0 and way > least[0]:
        # The order of contacts tells what was looked at together: it must not depend on s, which what happened before decides.
        after, near, left_out, _ = _search(geometry, meeting, least, 0.0, scratch, found, count)
    return after, near, left_out


@jit_making_arrays
def round_round_contacts(geometry, first, second, pose, margin, contacts, count):
    """Append the contacts of two ROUND primitives with gap <= margin, in the first one's frame; return the new count.

    Where round-off lets no normal pass, the closest pair of features is the one contact.
    """
    R_back, t_back = _pose_back(pose.R, pose.t)
    meeting, scratch = Meeting(first, second, pose, Pose(R_back, t_back), margin), contacts.scratch
    found = Found(contacts.real, contacts.integer, count)
    count, near, left_out = _of_list(geometry, meeting, contacts, found, count)
    if count > found.first:
        return count
    at_once = (LEAST * min(geometry.bound_radius[first], geometry.bound_radius[second]), EVERY_NORMAL)
    # A list holds features, too, that come into reach later.
    near = near and _are_in_reach(geometry, meeting, scratch.pairs)
    if near:
        count, near, left_out, _ = _search(geometry, meeting, at_once, 0.0, scratch, found, count)
    # Without any two features in reach there is no contact that round-off could have cost its normal.
    if count > found.first or not (near or (left_out and _meet(geometry, meeting, scratch.pairs))):
        return count
    count, _, _, _ = _search(geometry, meeting, at_once, ANY, scratch, found, count)
    return _keep_closest(found, count)
