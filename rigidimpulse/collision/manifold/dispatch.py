"""Contacts of two shapes: dispatch over their primitives and kinds, world frame, reduction for solving.

The buffers belong to the caller:
    contact_real (cap, 10)     point_a on the surface of a, point_b on that of b, unit normal from a to b, gap; world, m
    contact_int (cap, 5)       body_a, body_b (left to the caller), kind, feature_a, feature_b (see `features`)
    scratch_pairs (P, 2)       int64, P > STACK_ROWS; `SCRATCH_ROWS` serves well

Kernels of a pair of primitives work in the frame of their FIRST primitive's body. `R` (3, 3) and `t` (3,) carry the
second body's frame into it, y_first = R y_second + t; points, normal (from first to second) and gap are given in that
frame. They append rows with `features.write_contact`, which goes on counting when the buffer is full, and return the
new count:
    round_half_space_contacts(geometry, first, second, R, t, margin, scratch_pairs, contact_real, contact_int, count)
    round_round_contacts(geometry, first, second, R, t, margin, scratch_pairs, contact_real, contact_int, count)
    cylinder_half_space_contacts(geometry, first, second, R, t, margin, contact_real, contact_int, count)
    cylinder_round_contacts(geometry, first, second, R, t, margin, scratch_pairs, contact_real, contact_int, count)
    cylinder_cylinder_contacts(geometry, first, second, R, t, margin, contact_real, contact_int, count)
where `first` and `second` are absolute indices of primitives, of the kinds that the name tells. Least distances
return the gap, or `limit` with `out` untouched where the gap is not below it; out[0:3], out[3:6] are points of the
first and the second surface:
    round_half_space_gap, round_round_gap, cylinder_round_gap(geometry, first, second, R, t, limit, scratch_pairs, out)
    cylinder_half_space_gap, cylinder_cylinder_gap(geometry, first, second, R, t, limit, out)
"""

from __future__ import annotations

from math import cos, pi, sin, sqrt

import numpy as np

from rigidimpulse.collision.bvh import STACK_ROWS
from rigidimpulse.collision.distance.meshes import round_round_gap
from rigidimpulse.collision.distance.simplices import FACE_VERTEX, VERTEX_FACE, inner, write_contact
from rigidimpulse.collision.geometry import CYLINDER, HALF_SPACE, ROUND
from rigidimpulse.collision.manifold.cylinder import (
    cylinder_cylinder_contacts,
    cylinder_cylinder_gap,
    cylinder_half_space_contacts,
    cylinder_half_space_gap,
    cylinder_round_contacts,
    cylinder_round_gap,
)
from rigidimpulse.collision.manifold.mesh_mesh import round_round_contacts
from rigidimpulse.collision.manifold.plane import round_half_space_contacts, round_half_space_gap, sphere_sphere_contact
from rigidimpulse.core.kernels import jit_making_arrays
from rigidimpulse.core.vector import along, cross, dot, moved, relative_pose, row, turned

SCRATCH_ROWS = 8 * STACK_ROWS
"""Rows of `scratch_pairs` that serve well; it needs more than `STACK_ROWS`."""

MAX_PER_NORMAL = 8
"""Directions in which the extreme contacts of one normal are kept."""
SAME_PATCH = 0.999
"""Cosine of the angle below which normals belong to one wall."""
TIE = 1e-9
"""Difference of two positions along a direction, relative to the extent, below which they are equally extreme."""
STEEP = 0.77
"""|n_z| from which on the tangents of a normal are built on x instead of z (no common slope has this value)."""


@inner
def _out_of_reach(bound_centre, bound_radius, a, b, R, t, margin):
    """Tell whether the bounding spheres of two primitives are farther apart than `margin`."""
    squared = 0.0
    for i in range(3):
        offset = t[i] - bound_centre[a, i]
        for k in range(3):
            offset += R[i, k] * bound_centre[b, k]
        squared += offset * offset
    reach = margin + bound_radius[a] + bound_radius[b]
    return reach < 0.0 or squared > reach * reach


@inner
def _rows_to_world(contact_real, contact_int, start, end, R, x, swapped):
    """Move rows from a body's frame into the world; where first and second are b and a, swap them."""
    for i in range(start, end):
        point_a = moved(R, x, (contact_real[i, 0], contact_real[i, 1], contact_real[i, 2]))
        point_b = moved(R, x, (contact_real[i, 3], contact_real[i, 4], contact_real[i, 5]))
        normal = turned(R, (contact_real[i, 6], contact_real[i, 7], contact_real[i, 8]))
        gap, kind, feature_a, feature_b = contact_real[i, 9], contact_int[i, 2], contact_int[i, 3], contact_int[i, 4]
        if swapped:
            point_a, point_b = point_b, point_a
            normal = (-normal[0], -normal[1], -normal[2])
            feature_a, feature_b = feature_b, feature_a
            if kind == VERTEX_FACE or kind == FACE_VERTEX:
                kind = VERTEX_FACE + FACE_VERTEX - kind
        write_contact(contact_real, contact_int, i, point_a, point_b, normal, gap, kind, feature_a, feature_b)


@jit_making_arrays
def pair_contacts(
    geometry, shape_a, x_a, R_a, shape_b, x_b, R_b, margin, scratch_pairs, contact_real, contact_int, count, cylinders=1
):
    """Append every touching pair of features of two shapes with gap <= margin [m].

    x (3,), R (3, 3): poses of the principal frames; `count`: rows in use; buffers: see the top of this module;
    `cylinders`: None where no shape is a cylinder, which then is not compiled either. Returns the new count, or minus
    the rows needed if there are fewer: then the rows from `count` on mean nothing.

    Bodies are taken to be apart. Overlap keeps its meaning (gap < 0, the right normal) for half spaces, and for spheres
    and capsules until an axis is touched; meshes allow only what round-off makes.
    """
    kind, radius = geometry.kind, geometry.radius
    R, t, R_back, t_back = _relative_poses(x_a, R_a, x_b, R_b)
    for a in range(geometry.shape_first[shape_a], geometry.shape_first[shape_a + 1]):
        for b in range(geometry.shape_first[shape_b], geometry.shape_first[shape_b + 1]):
            if _out_of_reach(geometry.bound_centre, geometry.bound_radius, a, b, R, t, margin):
                continue
            start = count
            swapped = kind[b] > kind[a]
            i, j = (b, a) if swapped else (a, b)  # the kind of i is not below that of j
            U, s = (R_back, t_back) if swapped else (R, t)
            if kind[i] == ROUND and kind[j] == ROUND:
                p, q = geometry.vertex_first[i], geometry.vertex_first[j]
                if geometry.vertex_first[i + 1] == p + 1 and geometry.vertex_first[j + 1] == q + 1:
                    centre_a = row(geometry.vertex, p)
                    centre_b = moved(U, s, row(geometry.vertex, q))
                    count = sphere_sphere_contact(
                        centre_a, radius[i], p, centre_b, radius[j], q, margin, contact_real, contact_int, count
                    )
                else:
                    count = round_round_contacts(
                        geometry, i, j, U, s, margin, scratch_pairs, contact_real, contact_int, count
                    )
            elif kind[i] == ROUND:
                count = round_half_space_contacts(
                    geometry, i, j, U, s, margin, scratch_pairs, contact_real, contact_int, count
                )
            elif cylinders is not None:
                if kind[i] == CYLINDER and kind[j] == HALF_SPACE:
                    count = cylinder_half_space_contacts(geometry, i, j, U, s, margin, contact_real, contact_int, count)
                elif kind[i] == CYLINDER and kind[j] == ROUND:
                    count = cylinder_round_contacts(
                        geometry, i, j, U, s, margin, scratch_pairs, contact_real, contact_int, count
                    )
                elif kind[i] == CYLINDER:
                    count = cylinder_cylinder_contacts(geometry, i, j, U, s, margin, contact_real, contact_int, count)
            end = min(count, contact_real.shape[0])
            R_first, x_first = (R_b, x_b) if swapped else (R_a, x_a)
            _rows_to_world(contact_real, contact_int, start, end, R_first, x_first, swapped)
    return count if count <= contact_real.shape[0] else -count


@jit_making_arrays
def _relative_poses(x_a, R_a, x_b, R_b):
    """Return R, t with y_a = R y_b + t and the pose the other way."""
    R, t = np.empty((3, 3)), np.empty(3)
    R_back, t_back = np.empty((3, 3)), np.empty(3)
    relative_pose(R_a, x_a, R_b, x_b, R, t)
    relative_pose(R_b, x_b, R_a, x_a, R_back, t_back)
    return R, t, R_back, t_back


@jit_making_arrays
def pair_gap(geometry, shape_a, x_a, R_a, shape_b, x_b, R_b, limit, out):
    """Return the least gap of two shapes [m], or `limit`, with `out` untouched, if it is not below.

    out (7,): a closest point of a in [0:3], of b in [3:6], world. Surfaces that cross have the distance 0 less their
    radii; one body inside another is not seen. Two half spaces are never near. Other arguments as for `pair_contacts`.
    """
    kind = geometry.kind
    R, t, R_back, t_back = _relative_poses(x_a, R_a, x_b, R_b)
    stack = np.empty((STACK_ROWS + 1, 2), np.int64)
    points = np.empty(7)
    for a in range(geometry.shape_first[shape_a], geometry.shape_first[shape_a + 1]):
        for b in range(geometry.shape_first[shape_b], geometry.shape_first[shape_b + 1]):
            if _out_of_reach(geometry.bound_centre, geometry.bound_radius, a, b, R, t, limit):
                continue
            swapped = kind[b] > kind[a]
            i, j = (b, a) if swapped else (a, b)  # the kind of i is not below that of j
            U, s = (R_back, t_back) if swapped else (R, t)
            gap = limit
            if kind[i] == ROUND and kind[j] == ROUND:
                gap = round_round_gap(geometry, i, j, U, s, limit, stack, points)
            elif kind[i] == ROUND:
                gap = round_half_space_gap(geometry, i, j, U, s, limit, stack, points)
            elif kind[i] == CYLINDER and kind[j] == HALF_SPACE:
                gap = cylinder_half_space_gap(geometry, i, j, U, s, limit, points)
            elif kind[i] == CYLINDER and kind[j] == ROUND:
                gap = cylinder_round_gap(geometry, i, j, U, s, limit, stack, points)
            elif kind[i] == CYLINDER:
                gap = cylinder_cylinder_gap(geometry, i, j, U, s, limit, points)
            if gap < limit:
                limit = gap
                R_first, x_first = (R_b, x_b) if swapped else (R_a, x_a)
                p = moved(R_first, x_first, (points[0], points[1], points[2]))
                q = moved(R_first, x_first, (points[3], points[4], points[5]))
                for k in range(3):
                    out[k] = q[k] if swapped else p[k]
                    out[3 + k] = p[k] if swapped else q[k]
    return limit


@inner
def _deepest_left(contact_real, patch, first):
    """Return the deepest contact that has no wall yet, or -1."""
    deepest = -1
    for i in range(len(patch)):
        if patch[i] < 0 and (deepest < 0 or contact_real[first + i, 9] < contact_real[deepest, 9]):
            deepest = first + i
    return deepest


@inner
def _tangents(normal):
    """Return two unit tangents of a normal, the same for all normals near it."""
    pole = (1.0, 0.0, 0.0) if abs(normal[2]) > STEEP else (0.0, 0.0, 1.0)
    tangent = cross(pole, normal)
    length = sqrt(dot(tangent, tangent))
    tangent = (tangent[0] / length, tangent[1] / length, tangent[2] / length)
    return tangent, cross(normal, tangent)


@inner
def _extreme(contact_real, contact_int, patch, label, first, direction):
    """Return the contact of a wall that lies farthest along a direction; of equal ones that of the least features."""
    best = -1
    farthest = 0.0
    for i in range(len(patch)):
        if patch[i] != label:
            continue
        at = first + i
        place = dot(row(contact_real, at), direction)
        tie = TIE * (abs(place) + abs(farthest))
        earlier = best >= 0 and (contact_int[at, 3], contact_int[at, 4]) < (contact_int[best, 3], contact_int[best, 4])
        if best < 0 or place > farthest + tie or (place >= farthest - tie and earlier):
            best = at
            farthest = place
    return best


@jit_making_arrays
def reduce_contacts(contact_real, contact_int, first, count, max_per_normal=MAX_PER_NORMAL):
    """Keep the contacts that carry load, of rows [first, count), which belong to one pair of bodies.

    Contacts whose normals agree (`SAME_PATCH`) form a wall. Of a wall with more than `max_per_normal` contacts the
    deepest and the extreme ones in that many directions stay, unchanged and in their order. Returns the new count.
    """
    if count - first <= max_per_normal:
        return count
    patch = np.full(count - first, -1, np.int64)
    kept = np.zeros(count - first, np.bool_)
    label = np.int64(0)  # (a literal would compile `_extreme` twice)
    while True:
        leader = _deepest_left(contact_real, patch, first)
        if leader < 0:
            break
        normal = (contact_real[leader, 6], contact_real[leader, 7], contact_real[leader, 8])
        members = 0
        for i in range(len(patch)):
            at = first + i
            cosine = normal[0] * contact_real[at, 6] + normal[1] * contact_real[at, 7] + normal[2] * contact_real[at, 8]
            if patch[i] < 0 and (at == leader or cosine > SAME_PATCH):
                patch[i] = label
                kept[i] = True
                members += 1
        if members > max_per_normal:
            for i in range(len(patch)):
                kept[i] = kept[i] and patch[i] != label
            kept[leader - first] = True
            u, v = _tangents(normal)
            for k in range(max_per_normal):
                angle = 2.0 * pi * k / max_per_normal
                direction = along((cos(angle) * u[0], cos(angle) * u[1], cos(angle) * u[2]), sin(angle), v)
                kept[_extreme(contact_real, contact_int, patch, label, first, direction) - first] = True
        label += 1
    end = first
    for i in range(len(patch)):
        if kept[i]:
            for column in range(contact_real.shape[1]):
                contact_real[end, column] = contact_real[first + i, column]
            for column in range(contact_int.shape[1]):
                contact_int[end, column] = contact_int[first + i, column]
            end += 1
    return end
