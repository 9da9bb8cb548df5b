"""Convex shapes: which shapes are convex, how deep their centre lies inside, and the same shapes shrunk for the search.

The mesh contact routines need a gap above 0, and soft contacts sink in. A convex shape around its centre of mass is therefore shrunk
about that centre by the factor f = 1 - SHRINK. With h the distance of a face from the centre, the face moves inwards by SHRINK h, and
normals stay the same. A corner p of the shrunk shape belongs to the corner p / f of the true one. The foot on a face of what touches it
does not: it is found again on the true face, see `contact_matching.write_point`. An edge far from the centre is met too early, by
1 - f of its distance from it.
"""

from __future__ import annotations

import numpy as np

from rigidimpulse.collision.geometry import CYLINDER, HALF_SPACE, ROUND, Geometry
from rigidimpulse.core.tolerances import TOLERANCES

SHRINK = 1.5 * TOLERANCES.sub_stepping.skin
"""Part of their lengths by which convex bodies are shrunk for the search."""
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


def shrunk_geometry(geometry: Geometry, depths: np.ndarray, dynamic_shapes: np.ndarray) -> tuple[Geometry, np.ndarray]:
    """The shapes for the search, and the factor (s,) of their lengths; 1 where a shape is unchanged.

    depths (s,) m: `convex_depths`, of the shapes without inset surfaces; dynamic_shapes (s,) bool: shapes of bodies that move freely.
    """
    factor = np.ones(len(geometry.shape_first) - 1)
    vertex, frame, radius = geometry.vertex.copy(), geometry.frame.copy(), geometry.radius.copy()
    low, high = geometry.node_min.copy(), geometry.node_max.copy()
    centre, bound = geometry.bound_centre.copy(), geometry.bound_radius.copy()
    for s in np.flatnonzero(dynamic_shapes):
        p = int(geometry.shape_first[s])
        rounded = geometry.kind[p] == ROUND and geometry.radius[p] > 0.0
        if rounded or depths[s] <= 0.0:
            continue
        factor[s] = 1.0 - SHRINK
        vertex[geometry.vertex_first[p] : geometry.vertex_first[p + 1]] *= factor[s]
        nodes = slice(int(geometry.node_first[p]), int(geometry.node_first[p + 1]))
        # The box tree and the bounding sphere shrink about the centre of mass like the vertices.
        low[nodes] *= factor[s]
        high[nodes] *= factor[s]
        centre[p] *= factor[s]
        bound[p] *= factor[s]
        if geometry.kind[p] == CYLINDER:
            frame[p, :3] *= factor[s]
            frame[p, 6] *= factor[s]
            radius[p] *= factor[s]
    return geometry._replace(
        vertex=vertex, frame=frame, radius=radius, node_min=low, node_max=high, bound_centre=centre, bound_radius=bound
    ), factor
