"""Contacts and least gaps of cylinders, in the frame of the cylinder's body (see `dispatch`).

    cylinder_half_space_contacts, cylinder_round_contacts, cylinder_cylinder_contacts    append contacts, return the new count
    cylinder_half_space_gap, cylinder_round_gap, cylinder_cylinder_gap                   least gap below a limit

Features within the margin make contacts; each normal comes from the surfaces that meet, not from the difference of
two points:
- rim - plane (half space, face, cap): the lowest point of each rim, so a lying cylinder has the two ends of its
  lowest line. Where the whole rim is within the margin, RIM_POINTS points fixed on the cylinder stand for it, and the
  lowest one too.
- vertex - cap, side or rim, the last two only if the normal lies in the cone of the vertex.
- edge - side: the common perpendicular of edge and axis; edge - rim: the local least distance of line and circle,
  normal to both. The normal must lie in the arc of the edge and between the normals of cap and side.
- two cylinders: side - side as two edges; rim - cap as rim - plane; rim - side and rim - rim at the local least
  distances.
Side against a parallel edge or side has its contacts at the ends of the overlap, which are vertices and rims. A
sphere or capsule is its skeleton grown by a radius; its closest point is a contact in any case. If nothing else is found,
the closest pair is.

The least distances of `distance.cylinder` can be imported from here as well:
    cylinder_support(axis, half_height, radius, n) -> greatest n . (p - centre)
    cylinder_triangle_distance(centre, axis, half_height, radius, triangle (3, 3), out (9,)) -> distance
    cylinder_cylinder_distance(first, second, out (9,)) -> distance, each a tuple (centre, axis, half_height, radius)
"""

from __future__ import annotations

from math import copysign

from rigidimpulse.collision.distance.cylinder import (
    AXIS,
    ZERO,
    closest_on_cylinder,
    closest_sides,
    cylinder_cylinder_distance,
    cylinder_support,
    cylinder_triangle_distance,
    flat_length,
    to_axes,
)
from rigidimpulse.collision.distance.simplices import inner
from rigidimpulse.collision.manifold.contact_points import Found
from rigidimpulse.collision.manifold.cylinder_rims import (
    CAP,
    RIM,
    SIDE,
    WHOLE_PLANE,
    append,
    carried,
    circle_contacts,
    rims_on_plane,
    solid_of,
    write_points,
)
from rigidimpulse.collision.manifold.cylinder_round import cylinder_round_contacts, cylinder_round_gap
from rigidimpulse.collision.manifold.plane import plane_in_frame
from rigidimpulse.core.vector import along, dot, subtract

__all__ = [
    "cylinder_cylinder_contacts",
    "cylinder_cylinder_distance",
    "cylinder_cylinder_gap",
    "cylinder_half_space_contacts",
    "cylinder_half_space_gap",
    "cylinder_round_contacts",
    "cylinder_round_gap",
    "cylinder_support",
    "cylinder_triangle_distance",
]


@inner
def _plane(geometry, solid, half_space, pose):
    """Return the unit normal of a half space and a point on its surface, in the axes of the cylinder."""
    normal, offset = plane_in_frame(geometry.frame, half_space, pose.R, pose.t)
    m = to_axes(solid.u, solid.v, solid.w, normal)
    return m, along(ZERO, offset - dot(normal, solid.origin), m)


@inner
def cylinder_half_space_contacts(geometry, cylinder, half_space, pose, margin, contacts, count):
    """Append the rim points of a cylinder within `margin` of a half space."""
    solid = solid_of(geometry.frame, geometry.radius, cylinder, margin)
    m, a = _plane(geometry, solid, half_space, pose)
    found = Found(contacts.real, contacts.integer, count)
    return rims_on_plane(solid, found, count, (m, (a, a, a), ZERO), WHOLE_PLANE, half_space)


@inner
def cylinder_half_space_gap(geometry, cylinder, half_space, pose, limit, _scratch, out):
    """Return the least gap, negative if they overlap, or `limit` with `out` untouched if it is not below."""
    solid = solid_of(geometry.frame, geometry.radius, cylinder, 0.0)
    m, a = _plane(geometry, solid, half_space, pose)
    gap = -dot(m, a) - cylinder_support(AXIS, solid.half, solid.radius, m)
    if gap < limit:
        flat = flat_length(m[0], m[1])
        scale = -solid.radius / flat if flat > 0.0 else 0.0
        p = (scale * m[0], scale * m[1], -copysign(solid.half, m[2]))
        write_points(solid, p, along(p, -gap, m), out)
        return gap
    return limit


@inner
def cylinder_cylinder_contacts(geometry, first, second, pose, margin, contacts, count):
    """Append every touching pair of features of two cylinders."""
    solid = solid_of(geometry.frame, geometry.radius, first, margin)
    other = carried(solid_of(geometry.frame, geometry.radius, second, margin), pose.R, pose.t)
    found = Found(contacts.real, contacts.integer, count)
    for turn in range(2):
        u, v, w = solid.u, solid.v, solid.w
        centre = to_axes(u, v, w, subtract(other.origin, solid.origin))
        axis, x, y = to_axes(u, v, w, other.w), to_axes(u, v, w, other.u), to_axes(u, v, w, other.v)
        if turn == 0:
            distance, p, q, n = closest_sides(centre, axis, other.radius, other.half, solid.radius, solid.half)
            if 0.0 < distance <= margin:
                count = append(solid, found, count, (p, q, n, distance), SIDE, other.feature + SIDE)
        for bottom in range(2):
            sign = 1.0 - 2.0 * bottom
            outward, across = along(ZERO, sign, axis), along(ZERO, sign, y)
            middle = along(centre, other.half, outward)
            cap, rim = other.feature + CAP + bottom, other.feature + RIM + bottom
            count = rims_on_plane(solid, found, count, (outward, (middle, middle, middle), ZERO), other.radius, cap)
            for target in range(-1, 2 - 2 * turn):  # the side; in the first turn both rims as well
                count = circle_contacts(solid, found, count, (middle, x, across, other.radius), target, rim)
        solid, other = other, solid
    if count == found.first:
        distance, p, q, n = _closest_pair(solid, other)
        if 0.0 < distance <= margin:
            count = append(solid, found, count, (p, q, n, distance), SIDE, other.feature + SIDE)
    return count


@inner
def _closest_pair(solid, other):
    centre = to_axes(solid.u, solid.v, solid.w, subtract(other.origin, solid.origin))
    axis = to_axes(solid.u, solid.v, solid.w, other.w)
    return closest_on_cylinder(centre, axis, other.radius, other.half, solid.radius, solid.half)


@inner
def cylinder_cylinder_gap(geometry, first, second, pose, limit, _scratch, out):
    """Return the least gap, 0 if they overlap, or `limit` with `out` untouched if it is not below."""
    solid = solid_of(geometry.frame, geometry.radius, first, 0.0)
    other = carried(solid_of(geometry.frame, geometry.radius, second, 0.0), pose.R, pose.t)
    distance, p, q, _ = _closest_pair(solid, other)
    if distance < limit:
        write_points(solid, p, q, out)
        return distance
    return limit
