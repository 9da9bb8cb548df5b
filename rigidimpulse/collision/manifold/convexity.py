"""Which shapes are convex, how deep their centre of mass lies inside, and which are polyhedra, or made of several."""

from __future__ import annotations

import numpy as np

from rigidimpulse.collision.geometry import CYLINDER, HALF_SPACE, ROUND, Geometry

FACES_AT_ONCE = 64
"""Faces whose planes are compared with all vertices at once: few, since the first ones tell that most meshes are not convex."""


def convex_depths(geometry: Geometry) -> np.ndarray:
    """Distance (s,) from the centre of mass of each convex shape to its nearest face, m; 0 for other shapes, and half spaces."""
    out = np.zeros(len(geometry.shape_first) - 1)
    for s in range(len(out)):
        p = int(geometry.shape_first[s])
        if geometry.shape_first[s + 1] == p + 1 and geometry.kind[p] != HALF_SPACE:
            out[s] = _convex_depth(geometry, p)
    return out


def inner_radii(geometry: Geometry, depths: np.ndarray) -> np.ndarray:
    """Distance (s,) from the centre of mass of each shape to its nearest face, m; inf for half spaces.

    For shapes that are not one convex piece it is a tenth of the radius that encloses them. depths: `convex_depths`.
    """
    out = np.full(len(geometry.shape_first) - 1, np.inf)
    for s in range(len(out)):
        first, last = int(geometry.shape_first[s]), int(geometry.shape_first[s + 1])
        if np.all(geometry.kind[first:last] == HALF_SPACE):
            continue
        reach = np.linalg.norm(geometry.bound_centre[first:last], axis=1) + geometry.bound_radius[first:last]
        out[s] = depths[s] if depths[s] > 0.0 else 0.1 * float(reach[np.isfinite(reach)].max())
    return out


def _convex_depth(geometry: Geometry, p: int) -> float:
    """Distance from the centre of mass to the nearest face of a convex primitive, m; 0 if it is not convex or the centre is outside."""
    if geometry.kind[p] == CYLINDER:
        centre, axis, half = geometry.frame[p, :3], geometry.frame[p, 3:6], geometry.frame[p, 6]
        along = float(centre @ axis)
        return float(min(half - abs(along), geometry.radius[p] - np.linalg.norm(centre - along * axis)))
    vertices = geometry.vertex[geometry.vertex_first[p] : geometry.vertex_first[p + 1]]
    if not _has_faces(geometry, p):
        # A ball or a capsule.
        return float(geometry.radius[p]) if np.abs(vertices.sum(0)).max() <= 1e-9 * geometry.bound_radius[p] else 0.0
    depth = _depth_of_faces(geometry, p, np.zeros(3))
    return depth + float(geometry.radius[p]) if depth > 0.0 else 0.0


def _has_faces(geometry: Geometry, p: int) -> bool:
    """Whether a primitive has triangles of some area; a ball and a capsule have one without."""
    return bool(np.any(geometry.triangle_normal[int(geometry.triangle_first[p]) : int(geometry.triangle_first[p + 1])]))


def _depth_of_faces(geometry: Geometry, p: int, centre: np.ndarray) -> float:
    """Distance from a centre (3,) to the nearest face of a triangulated primitive, m; 0 if it is not convex or the centre is outside."""
    vertices = geometry.vertex[geometry.vertex_first[p] : geometry.vertex_first[p + 1]] - centre
    triangles = slice(int(geometry.triangle_first[p]), int(geometry.triangle_first[p + 1]))
    normals = geometry.triangle_normal[triangles]
    depth = np.einsum("ij,ij->i", normals, geometry.vertex[geometry.triangle[triangles, 0]] - centre)
    if depth.min() <= 0.0:
        return 0.0
    size = float(geometry.bound_radius[p])
    for first in range(0, len(depth), FACES_AT_ONCE):
        some = slice(first, first + FACES_AT_ONCE)
        if np.any((vertices @ normals[some].T).max(axis=0) > depth[some] + 1e-9 * size):
            return 0.0
    return float(depth.min())


def convex_polyhedra(geometry: Geometry, depths: np.ndarray) -> np.ndarray:
    """Which shapes (s,) bool are one convex polyhedron around their centre of mass, with sharp edges; depths: `convex_depths`."""
    out = np.zeros(len(geometry.shape_first) - 1, bool)
    for s in range(len(out)):
        p = int(geometry.shape_first[s])
        single = geometry.shape_first[s + 1] == p + 1 and geometry.kind[p] == ROUND and geometry.radius[p] == 0.0
        out[s] = single and depths[s] > 0.0
    return out


def several_polyhedra(geometry: Geometry) -> np.ndarray:
    """Which shapes (s,) bool are made of several convex polyhedra with sharp edges: compounds of boxes and hulls."""
    out = np.zeros(len(geometry.shape_first) - 1, bool)
    for s in range(len(out)):
        parts = range(int(geometry.shape_first[s]), int(geometry.shape_first[s + 1]))
        out[s] = len(parts) > 1 and all(_is_polyhedron(geometry, p) for p in parts)
    return out


def _is_polyhedron(geometry: Geometry, p: int) -> bool:
    """Whether a primitive is a convex polyhedron with sharp edges, wherever it is."""
    if geometry.kind[p] != ROUND or geometry.radius[p] != 0.0 or not _has_faces(geometry, p):
        return False
    corners = geometry.vertex[geometry.vertex_first[p] : geometry.vertex_first[p + 1]]
    return _depth_of_faces(geometry, p, corners.sum(axis=0) / len(corners)) > 0.0
