"""Contacts and gaps of two shapes: the ONE table of the kernels for every pair of kinds, and the kernels that ask it.

A shape is a list of primitives: half spaces, ROUND primitives (triangles, a segment or a point, grown by a radius) and cylinders. Shapes of
one primitive may belong to a closer kind: BALL (a ROUND primitive of one point), POLYHEDRON (convex, with sharp edges, around its centre of
mass) and BOX (a polyhedron along the principal axes). `TABLE` lists for each pair of kinds, the higher kind first, the kernel that finds
its contacts and the one that measures its least gap. Two dispatching kernels ask it:

- `convex_contacts`: pairs of the kinds BOX and POLYHEDRON, and of a POLYHEDRON and a half space, for gaps of EITHER sign. The sub-stepped
  regime finds the contacts of such pairs with it (`contact_cache`), and those of bodies made of several polyhedra (`convex_parts`).
- `pair_contacts`, and `pair_gap` for the least gap: any two shapes, primitive by primitive. Bodies are apart, or inside each other by a few
  margins at most; deeper overlap keeps its meaning for half spaces, and for spheres and capsules until an axis is touched. The exact regime
  uses them for all pairs, the sub-stepped regime for the pairs that are left, with smaller shapes (`contact_update`).

Numba cannot call a function by a number that it knows only at run time. So each dispatching kernel has one chain of tests, in the order
of the table, and takes its kernels from there.

Kernels for primitives work in the frame of the FIRST primitive's body. `pose` carries the second body's frame into it. Points, normal (from
first to second) and gap are given in that frame:
    ..._contacts(geometry, first, second, pose, margin, contacts, count) -> new count, which goes on when the buffers are full
    ..._gap(geometry, first, second, pose, limit, scratch, out) -> gap, or `limit` with `out` untouched where the gap is not below it;
        out[0:3], out[3:6] are points of the first and the second surface
where `first` and `second` are numbers of primitives of the kinds that the name tells. Kernels for convex shapes have the signature
    ..._contacts(shapes, pair, query, scratch, points) -> number of contacts, bound of the gap
with the records of `polyhedra`.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from rigidimpulse.collision.bvh import STACK_ROWS
from rigidimpulse.collision.distance.meshes import round_round_gap
from rigidimpulse.collision.distance.simplices import FACE_VERTEX, VERTEX_FACE, inner
from rigidimpulse.collision.geometry import CYLINDER, HALF_SPACE, ROUND
from rigidimpulse.collision.manifold.box_box import box_box_contacts
from rigidimpulse.collision.manifold.contact_points import Contact, Pose, write_contact
from rigidimpulse.collision.manifold.convex_convex import hull_contacts
from rigidimpulse.collision.manifold.cylinder import (
    cylinder_cylinder_contacts,
    cylinder_cylinder_gap,
    cylinder_half_space_contacts,
    cylinder_half_space_gap,
    cylinder_round_contacts,
    cylinder_round_gap,
)
from rigidimpulse.collision.manifold.mesh_mesh import round_round_contacts
from rigidimpulse.collision.manifold.plane import round_half_space_contacts, round_half_space_gap, sphere_sphere_contacts
from rigidimpulse.collision.manifold.polyhedra import polyhedron_half_space_contacts
from rigidimpulse.collision.manifold.reduce import reduce_contacts
from rigidimpulse.core.kernels import inlined, jit, jit_making_arrays
from rigidimpulse.core.vector import moved, relative_pose, turned

SCRATCH_ROWS = 8 * STACK_ROWS
"""A good number of rows of `ContactScratch.pairs`; it must be larger than `STACK_ROWS`."""

BALL, POLYHEDRON, BOX = 3, 4, 5
"""Kinds of whole shapes, beside the kinds of primitives HALF_SPACE, ROUND and CYLINDER."""


class PairKernels(NamedTuple):
    """What is known of a pair of kinds."""

    contacts: Any
    gap: Any


TABLE = {
    (BOX, BOX): PairKernels(box_box_contacts, None),
    (POLYHEDRON, HALF_SPACE): PairKernels(polyhedron_half_space_contacts, None),
    (POLYHEDRON, POLYHEDRON): PairKernels(hull_contacts, None),
    (BALL, BALL): PairKernels(sphere_sphere_contacts, round_round_gap),
    (ROUND, ROUND): PairKernels(round_round_contacts, round_round_gap),
    (ROUND, HALF_SPACE): PairKernels(round_half_space_contacts, round_half_space_gap),
    (CYLINDER, HALF_SPACE): PairKernels(cylinder_half_space_contacts, cylinder_half_space_gap),
    (CYLINDER, ROUND): PairKernels(cylinder_round_contacts, cylinder_round_gap),
    (CYLINDER, CYLINDER): PairKernels(cylinder_cylinder_contacts, cylinder_cylinder_gap),
}
"""The kernels of every pair of kinds. A BOX is a POLYHEDRON, a POLYHEDRON and a BALL are ROUND: the first pair that fits counts.

A mesh is ROUND, with radius 0. So a box on a mesh is a pair (ROUND, ROUND), and one of two POLYHEDRON in the sub-stepped regime if the
mesh is convex.
"""

BOXES, PLANE, GENERAL, HULLS, SEVERAL = 0, 1, 2, 3, 4
"""Kinds of pairs of bodies: (BOX, BOX), (POLYHEDRON, HALF_SPACE), any other pair, (POLYHEDRON, POLYHEDRON), and pairs of what is made of
several polyhedra with such a body, a POLYHEDRON or a HALF_SPACE."""
MOST_HULL_CORNERS = 256
"""Most corners of a polyhedron among which the farthest one is found by trying all."""

# Numba takes kernels from names of the module only.
_box_box, _polyhedron_half_space = TABLE[BOX, BOX].contacts, TABLE[POLYHEDRON, HALF_SPACE].contacts
_polyhedron_polyhedron = TABLE[POLYHEDRON, POLYHEDRON].contacts
_ball_ball = TABLE[BALL, BALL].contacts
_round_round, _round_round_gap = TABLE[ROUND, ROUND]
_round_half_space, _round_half_space_gap = TABLE[ROUND, HALF_SPACE]
_cylinder_half_space, _cylinder_half_space_gap = TABLE[CYLINDER, HALF_SPACE]
_cylinder_round, _cylinder_round_gap = TABLE[CYLINDER, ROUND]
_cylinder_cylinder, _cylinder_cylinder_gap = TABLE[CYLINDER, CYLINDER]


class Posed(NamedTuple):
    """A shape at a place."""

    shape: int
    position: np.ndarray  # (3,) m, of the principal frame
    rotation: np.ndarray  # (3, 3)
ALL = np.int64(0)
"""All contacts of a pair are wanted, however many have one normal. (Which of them carry may be known later, see `contact_update`.)"""


class PairQuery(NamedTuple):
    """Pairs of bodies (k,) whose contacts are wanted."""

    a: np.ndarray  # (k,)
    b: np.ndarray  # (k,)
    margin: np.ndarray  # (k,) m, greatest gap


@inlined
def is_half_space(half_space, s):
    """Whether shape s is a half space."""
    return half_space[s, 0] != 0.0 or half_space[s, 1] != 0.0 or half_space[s, 2] != 0.0


@inlined
def num_corners(shapes, s):
    """Number of corners of shape s."""
    return shapes.corner_first[s + 1] - shapes.corner_first[s]


@inlined
def num_parts(shapes, s):
    """Of how many polyhedra and half spaces shape s is made; 0 where it is anything else."""
    return shapes.part_first[s + 1] - shapes.part_first[s]


@inlined
def _few_corners(shapes, s):
    """Whether no part of shape s has too many corners."""
    few = True
    for p in range(shapes.part_first[s], shapes.part_first[s + 1]):
        few = few and num_corners(shapes, shapes.part[p]) <= MOST_HULL_CORNERS
    return few


@inlined
def pair_kind(shapes, s, t):
    """Kind of a pair of bodies with the shapes s and t, of `Polyhedra`."""
    solid_s, solid_t = shapes.face_first[s] < shapes.face_first[s + 1], shapes.face_first[t] < shapes.face_first[t + 1]
    half_space_s, half_space_t = is_half_space(shapes.half_space, s), is_half_space(shapes.half_space, t)
    if shapes.half[s, 0] > 0.0 and shapes.half[t, 0] > 0.0:
        return BOXES
    if (solid_s and half_space_t) or (half_space_s and solid_t):
        return PLANE
    if solid_s and solid_t and max(num_corners(shapes, s), num_corners(shapes, t)) <= MOST_HULL_CORNERS:
        return HULLS
    parts_s, parts_t = num_parts(shapes, s), num_parts(shapes, t)
    if min(parts_s, parts_t) > 0 and max(parts_s, parts_t) > 1 and _few_corners(shapes, s) and _few_corners(shapes, t):
        return SEVERAL
    return GENERAL


@inlined
def convex_contacts(kind, shapes, pair, query, scratch, points):
    """Contacts of two convex bodies, relative to the first, for a gap of either sign; returns their number and a bound of the gap.

    kind: of the pair, neither GENERAL nor SEVERAL.
    """
    if kind == PLANE:
        count, gap = _polyhedron_half_space(shapes, pair, query, scratch, points)
    elif kind == HULLS:
        count, gap = _polyhedron_polyhedron(shapes, pair, query, scratch, points)
    else:
        count, gap = _box_box(shapes, pair, query, scratch, points)
    return count, gap


@inner
def _out_of_reach(geometry, p, q, pose, margin):
    """Tell whether the bounding spheres of two primitives are farther apart than `margin`."""
    bound_centre, bound_radius, R, t = geometry.bound_centre, geometry.bound_radius, pose.R, pose.t
    squared = 0.0
    for i in range(3):
        offset = t[i] - bound_centre[p, i]
        for k in range(3):
            offset += R[i, k] * bound_centre[q, k]
        squared += offset * offset
    reach = margin + bound_radius[p] + bound_radius[q]
    return reach < 0.0 or squared > reach * reach


@inner
def _to_world(contacts, start, end, first, swapped):
    """Move contacts from the frame of the posed body `first` into the world; where first and second are b and a, swap them."""
    real, integer, R, x = contacts.real, contacts.integer, first.rotation, first.position
    for i in range(start, end):
        point_a = moved(R, x, (real[i, 0], real[i, 1], real[i, 2]))
        point_b = moved(R, x, (real[i, 3], real[i, 4], real[i, 5]))
        normal = turned(R, (real[i, 6], real[i, 7], real[i, 8]))
        gap, kind, feature_a, feature_b = real[i, 9], integer[i, 2], integer[i, 3], integer[i, 4]
        if swapped:
            point_a, point_b = point_b, point_a
            normal = (-normal[0], -normal[1], -normal[2])
            feature_a, feature_b = feature_b, feature_a
            # A vertex on a face, seen from the other body, is a face on a vertex.
            if kind == VERTEX_FACE or kind == FACE_VERTEX:
                kind = VERTEX_FACE + FACE_VERTEX - kind
        write_contact(real, integer, i, Contact(point_a, point_b, normal, gap, kind, feature_a, feature_b))


@inner
def _is_point(geometry, primitive):
    """Whether a ROUND primitive is one point with a radius."""
    return geometry.vertex_first[primitive + 1] == geometry.vertex_first[primitive] + 1


@inner
def _cylinder_contacts(geometry, i, j, pose, margin, contacts, count):
    """Append the contacts of a cylinder i with the primitive j."""
    if geometry.kind[j] == HALF_SPACE:
        return _cylinder_half_space(geometry, i, j, pose, margin, contacts, count)
    if geometry.kind[j] == ROUND:
        return _cylinder_round(geometry, i, j, pose, margin, contacts, count)
    return _cylinder_cylinder(geometry, i, j, pose, margin, contacts, count)


@inner
def _primitive_contacts(shapes, i, j, pose, margin, contacts, count):
    """Append the contacts of two primitives; the kind of i is not below that of j."""
    geometry, kind = shapes.geometry, shapes.geometry.kind
    if kind[i] == ROUND and kind[j] == ROUND:
        if _is_point(geometry, i) and _is_point(geometry, j):
            return _ball_ball(geometry, i, j, pose, margin, contacts, count)
        return _round_round(geometry, i, j, pose, margin, contacts, count)
    if kind[i] == ROUND:
        return _round_half_space(geometry, i, j, pose, margin, contacts, count)
    if kind[i] == CYLINDER:
        return _cylinder_contacts(geometry, i, j, pose, margin, contacts, count)
    return count


@inner
def _primitive_gap(geometry, i, j, pose, limit, scratch, out):
    """Return the least gap of two primitives, or `limit`; the kind of i is not below that of j."""
    kind = geometry.kind
    if kind[i] == ROUND and kind[j] == ROUND:
        return _round_round_gap(geometry, i, j, pose, limit, scratch, out)
    if kind[i] == ROUND:
        return _round_half_space_gap(geometry, i, j, pose, limit, scratch, out)
    if kind[i] == CYLINDER and kind[j] == HALF_SPACE:
        return _cylinder_half_space_gap(geometry, i, j, pose, limit, scratch, out)
    if kind[i] == CYLINDER and kind[j] == ROUND:
        return _cylinder_round_gap(geometry, i, j, pose, limit, scratch, out)
    if kind[i] == CYLINDER:
        return _cylinder_cylinder_gap(geometry, i, j, pose, limit, scratch, out)
    return limit


@jit_making_arrays
def _relative_poses(a, b):
    """Return the `Pose` of b in the frame of a, and that of a in the frame of b."""
    R, t = np.empty((3, 3)), np.empty(3)
    R_back, t_back = np.empty((3, 3)), np.empty(3)
    relative_pose(a.rotation, a.position, b.rotation, b.position, R, t)
    relative_pose(b.rotation, b.position, a.rotation, a.position, R_back, t_back)
    return Pose(R, t), Pose(R_back, t_back)


@jit_making_arrays
def pair_contacts(shapes, a, b, margin, contacts, count):
    """Append every touching pair of features of two posed shapes with gap <= margin [m].

    shapes: `geometry.Shapes`; a, b: `Posed`; contacts: `Contacts`; count: contacts in use. Returns the new count, or minus the contacts
    needed if the buffers are too small: then what is there from `count` on means nothing.
    """
    geometry, kind = shapes.geometry, shapes.geometry.kind
    pose, back = _relative_poses(a, b)
    for p in range(geometry.shape_first[a.shape], geometry.shape_first[a.shape + 1]):
        for q in range(geometry.shape_first[b.shape], geometry.shape_first[b.shape + 1]):
            if _out_of_reach(geometry, p, q, pose, margin):
                continue
            start = count
            # The table has the higher kind first.
            swapped = kind[q] > kind[p]
            i, j = (q, p) if swapped else (p, q)
            count = _primitive_contacts(shapes, i, j, back if swapped else pose, margin, contacts, count)
            _to_world(contacts, start, min(count, contacts.real.shape[0]), b if swapped else a, swapped)
    return count if count <= contacts.real.shape[0] else -count


@jit
def contacts_of_pairs(shapes, bodies, rotation, query, contacts, per_normal):
    """Find the manifolds of the pairs of a `PairQuery`; returns the number of contacts, or -(needed) if the buffers are too small.

    bodies: a record with `position` (n, 3) m; rotation (n, 3, 3); per_normal: contacts kept of one normal, see `reduce`; 0: all are.
    """
    # Not a literal: that would compile everything below twice.
    count = np.int64(0)
    real, integer = contacts.real, contacts.integer
    for k in range(query.a.shape[0]):
        a, b = query.a[k], query.b[k]
        first = count
        contacts.scratch.features.state[1], contacts.scratch.features.state[2] = a, b
        posed_a = Posed(shapes.of_body[a], bodies.position[a], rotation[a])
        posed_b = Posed(shapes.of_body[b], bodies.position[b], rotation[b])
        count = pair_contacts(shapes, posed_a, posed_b, query.margin[k], contacts, count)
        # The caller makes the buffers as large as needed and calls again.
        if count < 0:
            return count
        if per_normal > 0:
            count = reduce_contacts(real, integer, first, count, per_normal)
        for c in range(first, count):
            integer[c, 0] = a
            integer[c, 1] = b
    return count


@jit_making_arrays
def pair_gap(geometry, a, b, limit, out):
    """Return the least gap of two posed shapes [m], or `limit`, with `out` untouched, if it is not below.

    out (7,): a closest point of a in [0:3], of b in [3:6], world. Surfaces that cross have the distance 0 less their
    radii; one body inside another is not seen. Two half spaces are never near. Other arguments as for `pair_contacts`.
    """
    kind = geometry.kind
    pose, back = _relative_poses(a, b)
    stack = np.empty((STACK_ROWS + 1, 2), np.int64)
    points = np.empty(7)
    for p in range(geometry.shape_first[a.shape], geometry.shape_first[a.shape + 1]):
        for q in range(geometry.shape_first[b.shape], geometry.shape_first[b.shape + 1]):
            if _out_of_reach(geometry, p, q, pose, limit):
                continue
            swapped = kind[q] > kind[p]
            i, j = (q, p) if swapped else (p, q)
            gap = _primitive_gap(geometry, i, j, back if swapped else pose, limit, stack, points)
            if gap < limit:
                # The next primitives must be nearer than this.
                limit = gap
                R_first, x_first = (b.rotation, b.position) if swapped else (a.rotation, a.position)
                first = moved(R_first, x_first, (points[0], points[1], points[2]))
                second = moved(R_first, x_first, (points[3], points[4], points[5]))
                for k in range(3):
                    out[k] = second[k] if swapped else first[k]
                    out[3 + k] = first[k] if swapped else second[k]
    return limit
