"""Contacts of two shapes: dispatch over their primitives and kinds, world frame, reduction for solving.

Kernels of a pair of primitives work in the frame of their FIRST primitive's body. `R` (3, 3) and `t` (3,) carry the second
body's frame into it, y_first = R y_second + t; points, normal (from first to second) and gap are given in that frame. They
append rows with `features.write_contact`, which goes on counting when the buffer is full, and return the new count:

    features.write_contact(contact_real, contact_int, count, point_first, point_second, normal, gap, kind, feature_first,
        feature_second) -> count + 1     points and normal are 3-tuples of float; rows beyond the buffer are counted, not written

    cylinder_half_space_contacts(geometry, cylinder, half_space, R, t, margin, contact_real, contact_int, count) -> count
    cylinder_round_contacts(geometry, cylinder, round_, R, t, margin, scratch_pairs, contact_real, contact_int, count) -> count
    cylinder_cylinder_contacts(geometry, first, second, R, t, margin, contact_real, contact_int, count) -> count

where `cylinder`, `half_space`, `round_`, `first`, `second` are absolute primitive indices and scratch_pairs (> 128, 2) int64 is
free to use as the stack of a walk (a cylinder is always the first argument; `pair_contacts` swaps the result where needed).
Least distances return the gap, or `limit` with `out` untouched where the gap is not below it; out[0:3], out[3:6] are the points on
the first and the second surface:

    cylinder_half_space_gap(geometry, cylinder, half_space, R, t, limit, out) -> gap
    cylinder_round_gap(geometry, cylinder, round_, R, t, limit, scratch_pairs, out) -> gap
    cylinder_cylinder_gap(geometry, first, second, R, t, limit, out) -> gap

The buffers (see `pair_contacts`) belong to the caller: contact_real (cap, 10) holds point_a, point_b, normal, gap in the world,
contact_int (cap, 5) body_a, body_b, kind, feature_a, feature_b.
"""

from __future__ import annotations

from math import cos, pi, sin, sqrt

import numpy as np

from rigidimpulse._jit import jit
from rigidimpulse.detect.box_tree import STACK_ROWS
from rigidimpulse.detect.closed_form import (
    is_sphere,
    round_half_space_contacts,
    round_half_space_gap,
    sphere_sphere_contact,
)
from rigidimpulse.detect.closest import round_round_gap
from rigidimpulse.detect.cylinder import (
    cylinder_cylinder_contacts,
    cylinder_cylinder_gap,
    cylinder_half_space_contacts,
    cylinder_half_space_gap,
    cylinder_round_contacts,
    cylinder_round_gap,
)
from rigidimpulse.detect.features import along, cross, dot, inner, relative_pose, row
from rigidimpulse.detect.triangles import CORNER, FACE_VERTEX, VERTEX_FACE, round_round_contacts
from rigidimpulse.geometry import CYLINDER, HALF_SPACE, ROUND

SCRATCH_ROWS = 8 * STACK_ROWS
"""Rows of `scratch_pairs` that serve well; it needs more than `STACK_ROWS`."""

MAX_PER_NORMAL = 8
"""Directions in which the extreme contacts of one normal are kept."""
SAME_WALL = 0.999
"""Cosine of the angle below which normals belong to one wall."""
TIE = 1e-9
"""Difference of two positions along a direction, relative to the extent, below which they are equally extreme."""
STEEP = 0.77
"""|n_z| from which on the tangents of a normal are built on x instead of z (no common slope has this value)."""


@inner
def _out_of_reach(geometry, a, b, R, t, margin):
    """Tell whether the bounding spheres of two primitives are farther apart than `margin`."""
    squared = 0.0
    for i in range(3):
        offset = t[i] - geometry.bound_centre[a, i]
        for k in range(3):
            offset += R[i, k] * geometry.bound_centre[b, k]
        squared += offset * offset
    reach = margin + geometry.bound_radius[a] + geometry.bound_radius[b]
    return reach < 0.0 or squared > reach * reach


@inner
def _primitive_contacts(geometry, first, second, R, t, margin, scratch_pairs, contact_real, contact_int, count):
    """Append the contacts of two primitives, the kind of the first not below that of the second, in its frame."""
    kind_first = geometry.kind[first]
    kind_second = geometry.kind[second]
    if kind_first == HALF_SPACE:
        return count
    if kind_first == CYLINDER:
        if kind_second == HALF_SPACE:
            return cylinder_half_space_contacts(
                geometry, first, second, R, t, margin, contact_real, contact_int, count
            )
        if kind_second == ROUND:
            return cylinder_round_contacts(
                geometry, first, second, R, t, margin, scratch_pairs, contact_real, contact_int, count
            )
        return cylinder_cylinder_contacts(geometry, first, second, R, t, margin, contact_real, contact_int, count)
    if kind_second == HALF_SPACE:
        return round_half_space_contacts(
            geometry, first, second, R, t, margin, scratch_pairs, contact_real, contact_int, count
        )
    if is_sphere(geometry, first) and is_sphere(geometry, second):
        return sphere_sphere_contact(geometry, first, second, R, t, margin, contact_real, contact_int, count, CORNER)
    return round_round_contacts(geometry, first, second, R, t, margin, scratch_pairs, contact_real, contact_int, count)


@inner
def _rows_to_world(contact_real, contact_int, start, end, R, x, swapped):
    """Move rows from a body's frame into the world; where first and second are b and a, swap them."""
    for i in range(start, end):
        for column in range(0, 9, 3):
            p0, p1, p2 = contact_real[i, column], contact_real[i, column + 1], contact_real[i, column + 2]
            for k in range(3):
                value = R[k, 0] * p0 + R[k, 1] * p1 + R[k, 2] * p2
                contact_real[i, column + k] = value + x[k] if column < 6 else value
        if swapped:
            for k in range(3):
                contact_real[i, k], contact_real[i, 3 + k] = contact_real[i, 3 + k], contact_real[i, k]
                contact_real[i, 6 + k] = -contact_real[i, 6 + k]
            contact_int[i, 3], contact_int[i, 4] = contact_int[i, 4], contact_int[i, 3]
            if contact_int[i, 2] == VERTEX_FACE:
                contact_int[i, 2] = FACE_VERTEX
            elif contact_int[i, 2] == FACE_VERTEX:
                contact_int[i, 2] = VERTEX_FACE


@jit
def pair_contacts(
    geometry, shape_a, x_a, R_a, shape_b, x_b, R_b, margin, scratch_pairs, contact_real, contact_int, count
):
    """Append every touching pair of features of two shapes with gap <= margin.

    Args:
        geometry: the shapes.
        shape_a, shape_b: their indices.
        x_a, R_a, x_b, R_b: (3,), (3, 3) poses of the principal frames in the world.
        margin: m, greatest gap of a contact.
        scratch_pairs: (> STACK_ROWS, 2) int64, see `SCRATCH_ROWS`.
        contact_real: (cap, 10) point_a, point_b on the surfaces, unit normal from a to b, gap; world, m.
        contact_int: (cap, 5); columns 2 to 4 are set: kind, feature_a, feature_b.
        count: rows in use.

    Returns:
        The new count; minus the rows needed if the buffers hold fewer, and then the rows from `count` on mean nothing.

    Bodies are taken to be apart. Overlap keeps its meaning (gap < 0, the right normal) for half spaces, and for spheres
    and capsules until an axis is touched; meshes allow only what round-off makes.

    """
    R = np.empty((3, 3))
    t = np.empty(3)
    R_back = np.empty((3, 3))
    t_back = np.empty(3)
    relative_pose(R_a, x_a, R_b, x_b, R, t)
    relative_pose(R_b, x_b, R_a, x_a, R_back, t_back)
    for a in range(geometry.shape_first[shape_a], geometry.shape_first[shape_a + 1]):
        for b in range(geometry.shape_first[shape_b], geometry.shape_first[shape_b + 1]):
            if _out_of_reach(geometry, a, b, R, t, margin):
                continue
            start = count
            swapped = geometry.kind[b] > geometry.kind[a]
            count = _primitive_contacts(
                geometry,
                b if swapped else a,
                a if swapped else b,
                R_back if swapped else R,
                t_back if swapped else t,
                margin,
                scratch_pairs,
                contact_real,
                contact_int,
                count,
            )
            _rows_to_world(
                contact_real,
                contact_int,
                start,
                min(count, contact_real.shape[0]),
                R_b if swapped else R_a,
                x_b if swapped else x_a,
                swapped,
            )
    return count if count <= contact_real.shape[0] else -count


@inner
def _primitive_gap(geometry, first, second, R, t, limit, stack, out):
    """Return the least gap of two primitives, the kind of the first not below that of the second, in its frame."""
    kind_first = geometry.kind[first]
    kind_second = geometry.kind[second]
    if kind_first == HALF_SPACE:
        return limit
    if kind_first == CYLINDER:
        if kind_second == HALF_SPACE:
            return cylinder_half_space_gap(geometry, first, second, R, t, limit, out)
        if kind_second == ROUND:
            return cylinder_round_gap(geometry, first, second, R, t, limit, stack, out)
        return cylinder_cylinder_gap(geometry, first, second, R, t, limit, out)
    if kind_second == HALF_SPACE:
        return round_half_space_gap(geometry, first, second, R, t, limit, stack, out)
    return round_round_gap(geometry, first, second, R, t, limit, stack, out)


@jit
def pair_gap(geometry, shape_a, x_a, R_a, shape_b, x_b, R_b, limit, out):
    """Return the least gap of two shapes, m, or `limit`, with `out` untouched, if it is not below.

    out (7,): a closest point of a in [0:3], of b in [3:6], world. Surfaces that cross have the distance 0 less their radii;
    one body inside another is not seen. Two half spaces are never near. Other arguments as for `pair_contacts`.
    """
    R = np.empty((3, 3))
    t = np.empty(3)
    R_back = np.empty((3, 3))
    t_back = np.empty(3)
    stack = np.empty((STACK_ROWS + 1, 2), np.int64)
    points = np.empty(7)
    relative_pose(R_a, x_a, R_b, x_b, R, t)
    relative_pose(R_b, x_b, R_a, x_a, R_back, t_back)
    for a in range(geometry.shape_first[shape_a], geometry.shape_first[shape_a + 1]):
        for b in range(geometry.shape_first[shape_b], geometry.shape_first[shape_b + 1]):
            if _out_of_reach(geometry, a, b, R, t, limit):
                continue
            swapped = geometry.kind[b] > geometry.kind[a]
            gap = _primitive_gap(
                geometry,
                b if swapped else a,
                a if swapped else b,
                R_back if swapped else R,
                t_back if swapped else t,
                limit,
                stack,
                points,
            )
            if gap >= limit:
                continue
            limit = gap
            R_first = R_b if swapped else R_a
            x_first = x_b if swapped else x_a
            for k in range(3):
                p = R_first[k, 0] * points[0] + R_first[k, 1] * points[1] + R_first[k, 2] * points[2] + x_first[k]
                q = R_first[k, 0] * points[3] + R_first[k, 1] * points[4] + R_first[k, 2] * points[5] + x_first[k]
                out[k] = q if swapped else p
                out[3 + k] = p if swapped else q
    return limit


@inner
def _deepest_left(contact_real, wall, first):
    """Return the deepest contact that has no wall yet, or -1."""
    deepest = -1
    for i in range(len(wall)):
        if wall[i] < 0 and (deepest < 0 or contact_real[first + i, 9] < contact_real[deepest, 9]):
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
def _extreme(contact_real, contact_int, wall, label, first, direction):
    """Return the contact of a wall that lies farthest along a direction; of equal ones that of the least features."""
    best = -1
    farthest = 0.0
    for i in range(len(wall)):
        if wall[i] != label:
            continue
        at = first + i
        place = dot(row(contact_real, at), direction)
        tie = TIE * (abs(place) + abs(farthest))
        earlier = best >= 0 and (contact_int[at, 3], contact_int[at, 4]) < (contact_int[best, 3], contact_int[best, 4])
        if best < 0 or place > farthest + tie or (place >= farthest - tie and earlier):
            best = at
            farthest = place
    return best


@jit
def reduce_contacts(contact_real, contact_int, first, count, max_per_normal=MAX_PER_NORMAL):
    """Keep the contacts that carry load, of rows [first, count), which belong to one pair of bodies.

    Contacts whose normals agree (`SAME_WALL`) form a wall. Of a wall with more than `max_per_normal` contacts the deepest
    and the extreme ones in that many directions stay, unchanged and in their order. Returns the new count.
    """
    if count - first <= max_per_normal:
        return count
    wall = np.full(count - first, -1, np.int64)
    kept = np.zeros(count - first, np.bool_)
    label = 0
    while True:
        leader = _deepest_left(contact_real, wall, first)
        if leader < 0:
            break
        normal = (contact_real[leader, 6], contact_real[leader, 7], contact_real[leader, 8])
        members = 0
        for i in range(len(wall)):
            at = first + i
            cosine = (
                normal[0] * contact_real[at, 6] + normal[1] * contact_real[at, 7] + normal[2] * contact_real[at, 8]
            )
            if wall[i] < 0 and (at == leader or cosine > SAME_WALL):
                wall[i] = label
                kept[i] = True
                members += 1
        if members > max_per_normal:
            for i in range(len(wall)):
                kept[i] = kept[i] and wall[i] != label
            kept[leader - first] = True
            u, v = _tangents(normal)
            for k in range(max_per_normal):
                angle = 2.0 * pi * k / max_per_normal
                direction = along((cos(angle) * u[0], cos(angle) * u[1], cos(angle) * u[2]), sin(angle), v)
                kept[_extreme(contact_real, contact_int, wall, label, first, direction) - first] = True
        label += 1
    end = first
    for i in range(len(wall)):
        if kept[i]:
            for column in range(contact_real.shape[1]):
                contact_real[end, column] = contact_real[first + i, column]
            for column in range(contact_int.shape[1]):
                contact_int[end, column] = contact_int[first + i, column]
            end += 1
    return end
