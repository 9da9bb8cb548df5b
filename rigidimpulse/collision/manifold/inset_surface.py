"""Inset surfaces of meshes that are not convex: the surface moved inwards by a depth d.

A corner p of faces with normals n_f moves by d u. Here u is the shortest vector with  n_f.u = -1  for all of them, by least squares with
the angles as weights, so that every face moves by d. Where a part is too thin its corners move by a half of that, a quarter, or not at all.
"""

from __future__ import annotations

import numpy as np

from rigidimpulse.collision.containment import points_inside
from rigidimpulse.collision.geometry import ROUND, CompiledShape, Geometry, Primitive, build_geometry
from rigidimpulse.collision.manifold.dispatch import Posed, pair_gap

CLEAR = 0.7
"""Distance from the surface that a moved corner must have, as a part of its displacement, to count as moved into the body."""
LONGEST = 2.0
"""Length of u at most."""
SAME = 0.02
"""Part of the largest eigenvalue of sum n n^T below which faces are the same."""


def moved_in(p: Primitive, d: float) -> np.ndarray:
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
