"""Smaller shapes for the search of contacts of bodies that may be a little inside each other.

Soft contacts let bodies sink in, and the kernels of `dispatch` need bodies that are apart. So they are asked about smaller shapes with the
same corners, edges and faces. What they find is put back: the same corner, edge or face of the true shape makes the contact.

    polyhedra that are convex    all faces are d farther in, or more:  x_k (1 - f_k),  f_k = d / h_k, h_k their half length along axis k
                                 of the body, or more where faces are at an angle to the axes (`make_smaller_shapes`)
    cylinders                    d is taken off at both ends and all around
    other bodies that move       inset surfaces, see `inset_surface`; their rounded parts get thinner

A point p of the smaller shape moves by m(p) to its place on the true one: m is known at corners, on an edge or in a face it is the mean
of m at its corners there. The normal n is that of the true face, or across both true edges, else it stays. The gap is

    g = (p_b + m_b - p_a - m_a).n

and the place of the contact is that of the corner or rim on what it meets, or that where two edges cross.

What is convex has such shapes of several d. Where a heavy body presses a light one into a mesh, it may be deeper inside than the first d
allows. Then the next one is asked about. Before, thin boxes and rods on a floor that is a mesh fell through it when a heavier body landed
on them.

A ball, a capsule or a smaller cylinder can take up what bodies sink in. So a convex polyhedron that meets one is asked about as it is. Were
it smaller, a ball that rolls off the end of a plank would leave it too early.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rigidimpulse.collision.distance.simplices import CORNER, EDGE_EDGE, FACE_VERTEX, HALF_SPACE_CONTACT, VERTEX_FACE
from rigidimpulse.collision.geometry import HALF_SPACE, Geometry
from rigidimpulse.collision.manifold.cylinder_rims import FIRST_FEATURE, NUM_FEATURES, RIM
from rigidimpulse.core.kernels import jit
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.core.vector import along, cross, dot, length, row, scaled, subtract, turned_back_by, turned_by

SHRINK = 1.5 * TOLERANCES.sub_stepping.skin
"""Part of its inner radius that a body gives up at least: it may sink into the skin."""
PARTS = (SHRINK, 0.04, 0.2, 0.6)
"""d of the levels of what is convex, as parts of the inner radius: of cylinders beside what is convex, and of all beside meshes."""
LEVELS = 1 + len(PARTS)
"""Shapes of each body: its own, and smaller and smaller ones."""
BESIDE_MESHES = 2
"""The first level beside meshes. A corner that slides into a valley may sink into the far side before its smaller one is over that and
finds it. With the level of SHRINK a dozen of 160 bodies fell through landscapes and funnels at "preview", with this one two did."""
ENOUGH = 2.0
"""Depths of a contact that the level which is asked about must allow: it may be as much deeper at the next look."""
CROSSWISE, ALIKE = 0.1, 0.9
"""Sine of the angle of two edges from which the place where they cross is asked for; least cosine of the normal found and the true one."""
AT_CORNER, ON_RIM, ON_CYLINDER, ON_EDGE, IN_FACE = (np.int64(where) for where in range(5))
"""Where on a body a contact is. At a corner or on a rim the body has the place of the contact, the corner before the rim."""
ZERO = (0.0, 0.0, 0.0)


class SmallerShapes(NamedTuple):
    """The shapes that the search is asked about, of n bodies."""

    geometry: Geometry  # the shapes of the scene, and the smaller ones behind them
    number: int  # of shapes of the scene
    of_body: np.ndarray  # (L n,) by index: the shapes of the bodies; the smaller ones, or their own where there are none; the next levels
    back: np.ndarray  # (V, 4) m at each vertex, m, and how much thinner its rounding is, m
    growth: np.ndarray  # (P, 2) half height and radius that a cylinder has lost, as a part of those that it has
    taken_off: np.ndarray  # (L, n) m, by rank: how far points of each level are from those of the body at most
    slack: np.ndarray  # (L, n) m, by rank: how far the faces of each level of a convex body are inside
    depth: np.ndarray  # (n,) m, by rank: d of inset surfaces
    polyhedron: np.ndarray  # (n,) bool, by rank: convex polyhedra
    deeper: np.ndarray  # (n,) bool, by rank: these and cylinders, which have more levels than the first
    takes_up: np.ndarray  # (n,) bool, by rank: whether what meets the body may be asked about as it is


@jit
def level_of(smaller, i, other, depth):
    """The level of the shapes about which body i is asked beside another one; depth: m, of their contacts."""
    if smaller.polyhedron[i] and smaller.takes_up[other]:
        return 0
    if not smaller.deeper[i] or smaller.deeper[other]:
        return 1
    level = BESIDE_MESHES
    while level + 1 < LEVELS and smaller.slack[level, i] < ENOUGH * depth:
        level += 1
    return level


@jit
def put_back(smaller, bodies, a, b, real, integer, c):
    """Put the points of contact c of bodies a and b from the smaller shapes back to the true bodies, with its normal and gap.

    real (k, 10), in the world, and integer (k, 5): contacts; bodies: by their places in `smaller.of_body`.
    """
    found = (real[c, 6], real[c, 7], real[c, 8])
    where_a, p, rise_a, d_a = _true(smaller, bodies, a, found, real, integer, c, 0)
    where_b, q, _, d_b = _true(smaller, bodies, b, found, real, integer, c, 1)
    n = _true_normal(found, where_a, where_b, d_a, d_b)
    gap = dot(subtract(q, p), n)
    if where_b < ON_CYLINDER and where_b < where_a:
        p = along(q, -gap, n)
    elif where_a == ON_EDGE and where_b == ON_EDGE:
        across = cross(n, d_b)
        sine = dot(d_a, across)
        if sine * sine > CROSSWISE * CROSSWISE * dot(d_a, d_a) * dot(d_b, d_b):
            p = along(p, dot(subtract(q, p), across) / sine, d_a)
    elif not (where_a < ON_CYLINDER and where_a < where_b):
        p = along((real[c, 0], real[c, 1], real[c, 2]), rise_a, n)
    for k in range(3):
        real[c, k], real[c, 3 + k], real[c, 6 + k] = p[k], p[k] + gap * n[k], n[k]
    real[c, 9] = gap


@jit
def _true_normal(found, where_a, where_b, d_a, d_b):
    """The normal that faces or edges of the true bodies have, or the one that was found."""
    n = ZERO
    if where_a == IN_FACE:
        n = d_a
    if where_b == IN_FACE and dot(n, n) == 0.0:
        n = d_b
    if where_a == ON_EDGE and where_b == ON_EDGE:
        n = cross(d_a, d_b)
    size = length(n)
    along_found = dot(n, found)
    if not abs(along_found) > ALIKE * size:
        return found
    return scaled(n, 1.0 / size if along_found > 0.0 else -1.0 / size)


@jit
def _true(smaller, bodies, i, n, real, integer, c, side):
    """Where on body i, the first (side 0) or second of contact c, it is; its place on the true body and how far that is along n.

    Also the direction of the edge that it is on, or the normal of the face that it is in if that is one of a smaller shape, of any length.
    """
    geometry, back, x, at = smaller.geometry, smaller.back, bodies.position, 3 * side
    shape, place = smaller.of_body[integer[c, side]], (real[c, at], real[c, at + 1], real[c, at + 2])
    where, feature = _where(geometry, shape, integer[c, 2], side, integer[c, 3 + side])
    d = ZERO
    if where == ON_EDGE:
        d = _true_side(geometry, back, geometry.edge[feature, 0], geometry.edge[feature, 1])
    elif where == IN_FACE and shape >= smaller.number:
        corner = geometry.triangle[feature]
        d = cross(_true_side(geometry, back, corner[0], corner[1]), _true_side(geometry, back, corner[0], corner[2]))
    d = turned_by(bodies.rotation, i, d[0], d[1], d[2])
    if shape < smaller.number:
        return where, place, 0.0, d
    p = turned_back_by(bodies.rotation, i, place[0] - x[i, 0], place[1] - x[i, 1], place[2] - x[i, 2])
    if where == ON_CYLINDER or where == ON_RIM:
        m, thinner = _moved_on_cylinder(geometry.frame, smaller.growth, feature, p), 0.0
    else:
        m, thinner = _mean(geometry, back, where, feature, p)
    m = turned_by(bodies.rotation, i, m[0], m[1], m[2])
    m = along(m, thinner if side == 0 else -thinner, n)
    return where, along(place, 1.0, m), dot(m, n), d


@jit
def _true_side(geometry, back, i, j):
    """From vertex i to vertex j of the true shape, in the frame of the body."""
    return along(subtract(row(geometry.vertex, j), row(geometry.vertex, i)), 1.0, subtract(row(back, j), row(back, i)))


@jit
def _where(geometry, shape, kind, side, feature):
    """Where on a shape a feature of a contact is, and the vertex, edge, triangle or cylinder of it."""
    if geometry.kind[geometry.shape_first[shape]] == HALF_SPACE:
        return IN_FACE, feature
    if kind == VERTEX_FACE or kind == FACE_VERTEX:
        return AT_CORNER if (kind == VERTEX_FACE) == (side == 0) else IN_FACE, feature
    if kind == EDGE_EDGE:
        return ON_EDGE, feature
    if kind == CORNER:
        return AT_CORNER if feature % 2 == 0 else ON_EDGE, feature // 2
    if kind == HALF_SPACE_CONTACT:
        return AT_CORNER, feature
    if feature < FIRST_FEATURE:
        return AT_CORNER if feature % 3 == 0 else (ON_EDGE if feature % 3 == 1 else IN_FACE), feature // 3
    feature -= FIRST_FEATURE
    return ON_RIM if feature % NUM_FEATURES >= RIM else ON_CYLINDER, feature // NUM_FEATURES


@jit
def _moved_on_cylinder(frame, growth, p, x):
    """m of the place x on cylinder p, in the frame of the body: along the axis and out of it."""
    axis = (frame[p, 3], frame[p, 4], frame[p, 5])
    from_centre = subtract(x, row(frame, p))
    height = dot(from_centre, axis)
    return along(scaled(axis, growth[p, 0] * height), growth[p, 1], along(from_centre, -height, axis))


@jit
def _mean(geometry, back, where, feature, x):
    """m at the vertex `feature`, or at the place x on such an edge or triangle, in the frame of the body, and how much thinner it is."""
    if where == AT_CORNER:
        return row(back, feature), back[feature, 3]
    corner = geometry.edge[feature] if where == ON_EDGE else geometry.triangle[feature]
    i, j, k = corner[0], corner[1], corner[-1]
    origin = row(geometry.vertex, i)
    e, f, r = subtract(row(geometry.vertex, j), origin), subtract(row(geometry.vertex, k), origin), subtract(x, origin)
    ee, ef, ff, re, rf = dot(e, e), dot(e, f), dot(f, f), dot(r, e), dot(r, f)
    area = ee * ff - ef * ef
    if where == IN_FACE and area > 0.0:
        u, v = (ff * re - ef * rf) / area, (ee * rf - ef * re) / area
    else:
        u, v = min(max(re / ee, 0.0), 1.0) if ee > 0.0 else 0.0, 0.0
    w = 1.0 - u - v
    m = along(along(scaled(row(back, i), w), u, row(back, j)), v, row(back, k))
    return m, w * back[i, 3] + u * back[j, 3] + v * back[k, 3]
