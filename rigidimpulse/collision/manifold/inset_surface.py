"""Inset surfaces of bodies that are not one convex piece: the surface moved inwards by a depth d.

Soft contacts let bodies sink into each other a little, and the contact kernels need bodies that are apart. So the search uses the inset
surfaces, and the points found are put back along the normal. Contacts stay right until the inset surfaces touch. A corner p of faces with
normals n_f moves by d u. Here u is the shortest vector with  n_f.u = -1  for all of them, by least squares with the angles as weights, so
that every face moves by d. Where a part is too thin its corners move by a half of that, a quarter, or not at all. A contact with normal n
at a corner is put back by the rise  -d u.n,  on an edge or in a face by the mean of the rises of its corners at that place.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import sqrt

import numpy as np

from rigidimpulse.collision.containment import points_inside
from rigidimpulse.collision.distance.simplices import CORNER, EDGE_EDGE, FACE_VERTEX, HALF_SPACE_CONTACT, VERTEX_FACE
from rigidimpulse.collision.geometry import CYLINDER, ROUND, CompiledShape, Geometry, Primitive, build_geometry
from rigidimpulse.collision.manifold.cylinder_rims import CYLINDER_CONTACT, FIRST_FEATURE, NUM_FEATURES
from rigidimpulse.collision.manifold.dispatch import Posed, pair_gap
from rigidimpulse.core.kernels import jit
from rigidimpulse.core.vector import turned_back_by

DEPTH = 0.012
"""d, as a part of the radius that encloses a body."""
THIN = 0.25
"""Part of the radius of a ball, capsule or cylinder that d may be."""
CLEAR = 0.7
"""Distance from the surface that a moved corner must have, as a part of its displacement, to count as moved into the body."""
LONGEST = 2.0
"""Length of u at most."""
SAME = 0.02
"""Part of the largest eigenvalue of sum n n^T below which faces are the same."""


def inset_surfaces(
    shapes: Sequence[CompiledShape], geometry: Geometry, convex: np.ndarray, dynamic_shapes: np.ndarray
) -> tuple[Geometry, np.ndarray, np.ndarray]:
    """The shapes, with inset surfaces for those that move freely (s,) bool and are not one convex piece.

    Args:
        shapes: all shapes of the scene; geometry: their arrays.
        convex: (s,) bool, convex polyhedra; dynamic_shapes: (s,) bool.

    Returns:
        The arrays with inset surfaces; their depths (s,), m, 0 for none; and (V, 4) m, in the frame of the body, from every inset vertex
        to where it was, and by how much its rounding radius is less.

    """
    out, depth = list(shapes), np.zeros(len(shapes))
    for s in np.flatnonzero(dynamic_shapes & ~convex).tolist():
        primitives = shapes[s].primitives
        if len(primitives) == 1 and not len(primitives[0].faces):
            continue
        first, last = int(geometry.shape_first[s]), int(geometry.shape_first[s + 1])
        reach = np.linalg.norm(geometry.bound_centre[first:last], axis=1) + geometry.bound_radius[first:last]
        # A ball, capsule or cylinder can give up only a part of its radius, which limits the depth of all.
        d = min([DEPTH * float(reach.max()), *(THIN * _radius(p) for p in primitives if not len(p.faces))])
        out[s], depth[s] = CompiledShape(tuple(_inset(p, d) for p in primitives)), d
    back = np.zeros((len(geometry.vertex), 4))
    if not depth.any():
        return geometry, depth, back
    inset = build_geometry(out)
    back[:, :3] = geometry.vertex - inset.vertex
    for p in range(len(geometry.kind)):
        back[geometry.vertex_first[p] : geometry.vertex_first[p + 1], 3] = geometry.radius[p] - inset.radius[p]
    return inset, depth, back


def _radius(p: Primitive) -> float:
    """Smallest radius of a ball, capsule or cylinder, m."""
    return min(p.radius, float(p.frame[6])) if p.kind == CYLINDER else p.radius


def _inset(p: Primitive, d: float) -> Primitive:
    """The inset surface of a primitive, at a depth of d m."""
    if p.kind == CYLINDER:
        return replace(p, radius=p.radius - d, frame=np.append(p.frame[:6], p.frame[6] - d))
    return replace(p, vertices=_moved_in(p, d)) if len(p.faces) else replace(p, radius=p.radius - d)


def _moved_in(p: Primitive, d: float) -> np.ndarray:
    """Vertices (v, 3) of a triangulated primitive moved inwards by d m, or less where it is thin."""
    x, faces = p.vertices, p.faces
    displacement = d * _directions(x, faces)
    surface = build_geometry([CompiledShape((Primitive(ROUND, vertices=np.zeros((1, 3))),)), CompiledShape((p,))])
    share, normals = np.ones(len(x)), _area_vectors(x, faces)
    for factor in (0.5, 0.25, 0.0):
        y = x + share[:, None] * displacement
        length = share * np.linalg.norm(displacement, axis=1)
        wrong = (length > 0.0) & ~points_inside(surface, 1, y)
        for v in np.flatnonzero((length > 0.0) & ~wrong):
            wrong[v] = _distance(surface, y[v], length[v]) < CLEAR * min(share[v] * d, length[v])
        turned = np.einsum("ij,ij->i", _area_vectors(y, faces), normals) < 0.0
        wrong[faces[turned]] = True
        share[wrong] = factor
    return x + share[:, None] * displacement


def _distance(surface: Geometry, point: np.ndarray, limit: float) -> float:
    """Distance of a point to the second shape, at most `limit` m."""
    return pair_gap(surface, Posed(0, point, np.eye(3)), Posed(1, np.zeros(3), np.eye(3)), limit, np.zeros(7))


def _area_vectors(x: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Normals (f, 3) of triangles, as long as twice their area."""
    return np.cross(x[faces[:, 1]] - x[faces[:, 0]], x[faces[:, 2]] - x[faces[:, 0]])


def _directions(x: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """u (v, 3) of every vertex."""
    normal = _area_vectors(x, faces)
    normal /= np.maximum(np.linalg.norm(normal, axis=1), np.finfo(float).tiny)[:, None]
    outer, total = np.zeros((len(x), 3, 3)), np.zeros((len(x), 3))
    for k in range(3):
        v, e, f = faces[:, k], x[faces[:, (k + 1) % 3]] - x[faces[:, k]], x[faces[:, (k + 2) % 3]] - x[faces[:, k]]
        angle = np.arctan2(np.linalg.norm(np.cross(e, f), axis=1), np.einsum("ij,ij->i", e, f))
        np.add.at(outer, v, angle[:, None, None] * normal[:, :, None] * normal[:, None, :])
        np.add.at(total, v, angle[:, None] * normal)
    u = -np.einsum("vij,vj->vi", np.linalg.pinv(outer, rcond=SAME, hermitian=True), total)
    return u * np.minimum(1.0, LONGEST / np.maximum(np.linalg.norm(u, axis=1), 1e-300))[:, None]


@jit
def put_back(smaller, bodies, a, b, real, integer, c):
    """Move the points of contact c of bodies a and b from the inset surfaces to the true bodies, along the normal, with its gap.

    smaller: `contact_update.SmallerShapes`; real (k, 10), in the world, and integer (k, 5): contacts.
    """
    geometry, back, depth = smaller.geometry, smaller.back, smaller.depth
    kind = integer[c, 2]
    for side in range(2):
        i, sign, at = (a, 1.0, 0) if side == 0 else (b, -1.0, 3)
        if depth[i] == 0.0:
            continue
        x, feature, rise = bodies.position, integer[c, 3 + side], depth[i]
        n = turned_back_by(bodies.rotation, i, sign * real[c, 6], sign * real[c, 7], sign * real[c, 8])
        p = turned_back_by(bodies.rotation, i, real[c, at] - x[i, 0], real[c, at + 1] - x[i, 1], real[c, at + 2] - x[i, 2])
        if kind == VERTEX_FACE or kind == FACE_VERTEX:
            rise = _rise(back, feature, n) if (kind == VERTEX_FACE) == (side == 0) else _rise_of_face(geometry, back, feature, p, n)
        elif kind == EDGE_EDGE:
            rise = _rise_of_edge(geometry, back, feature, p, n)
        elif kind == CORNER:
            rise = _rise(back, feature // 2, n) if feature % 2 == 0 else _rise_of_edge(geometry, back, feature // 2, p, n)
        elif kind == HALF_SPACE_CONTACT:
            rise = _rise(back, feature, n)
        elif kind == CYLINDER_CONTACT and feature >= FIRST_FEATURE:
            rise = _rise_of_cylinder(geometry, depth[i], (feature - FIRST_FEATURE) // NUM_FEATURES, n)
        elif kind == CYLINDER_CONTACT:
            f = feature // 3
            if feature % 3 == 2:
                rise = _rise_of_face(geometry, back, f, p, n)
            else:
                rise = _rise(back, f, n) if feature % 3 == 0 else _rise_of_edge(geometry, back, f, p, n)
        for k in range(3):
            real[c, at + k] += sign * rise * real[c, 6 + k]
        real[c, 9] -= rise


@jit
def _rise(back, v, n):
    """How far vertex v is put back along the normal n of its body, m."""
    return back[v, 0] * n[0] + back[v, 1] * n[1] + back[v, 2] * n[2] + back[v, 3]


@jit
def _rise_of_cylinder(geometry, d, p, n):
    """The same of cylinder p, whose radius and half height are less by d: a rim moves by d out of the axis and by d along it."""
    frame = geometry.frame
    along = abs(frame[p, 3] * n[0] + frame[p, 4] * n[1] + frame[p, 5] * n[2])
    return d * (along + sqrt(max(1.0 - along * along, 0.0)))


@jit
def _rise_of_edge(geometry, back, e, p, n):
    """The same of the place p on edge e."""
    i, j, x = geometry.edge[e, 0], geometry.edge[e, 1], geometry.vertex
    along, square = 0.0, 0.0
    for k in range(3):
        along += (p[k] - x[i, k]) * (x[j, k] - x[i, k])
        square += (x[j, k] - x[i, k]) ** 2
    share = min(max(along / square, 0.0), 1.0) if square > 0.0 else 0.0
    return (1.0 - share) * _rise(back, i, n) + share * _rise(back, j, n)


@jit
def _rise_of_face(geometry, back, t, p, n):
    """The same of the place p in triangle t."""
    x, corner = geometry.vertex, geometry.triangle
    i, j, k = corner[t, 0], corner[t, 1], corner[t, 2]
    ee, ef, ff, pe, pf = 0.0, 0.0, 0.0, 0.0, 0.0
    for m in range(3):
        e, f, r = x[j, m] - x[i, m], x[k, m] - x[i, m], p[m] - x[i, m]
        ee, ef, ff, pe, pf = ee + e * e, ef + e * f, ff + f * f, pe + r * e, pf + r * f
    area = ee * ff - ef * ef
    if not area > 0.0:
        return _rise(back, i, n)
    u, v = (ff * pe - ef * pf) / area, (ee * pf - ef * pe) / area
    return (1.0 - u - v) * _rise(back, i, n) + u * _rise(back, j, n) + v * _rise(back, k, n)
