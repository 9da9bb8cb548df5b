"""Triangle surfaces: cleaning what people bring, and counting what is wrong with it.

Cleaning never moves a vertex. It joins vertices at the same place (texture seams), and where the surface is still open
also those closer than `Surfaces.weld` of `core.tolerances`; it drops triangles that have lost a corner or come twice; and it flips the
long edge of triangles without area (T-junctions), so that a closed surface stays closed.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rigidimpulse.core.errors import SceneError
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.core.triangles import unique_edges


class Surface(NamedTuple):
    """A clean triangle surface.

    `num_open_edges` counts edges with an odd number of faces, `num_twisted_edges` the other edges whose faces do not
    run along them as often one way as the other. Both are 0 for a closed surface, be it of several pieces.
    """

    vertices: np.ndarray  # (v, 3) m
    faces: np.ndarray  # (f, 3) counter-clockwise seen from outside
    num_open_edges: int
    num_twisted_edges: int

    @property
    def closed(self) -> bool:
        """Whether every edge is shared by faces of opposite direction."""
        return self.num_open_edges == 0 and self.num_twisted_edges == 0


FARTHEST = 1e60
"""m. Inertia goes with the fifth power of a length, and is a number up to there."""


def check_triangles(vertices: np.ndarray, faces: np.ndarray) -> None:
    """Raise a `SceneError` if the arrays are no triangle surface: wrong form, empty, not finite, bad indices."""
    if vertices.ndim != 2 or vertices.shape[1] != 3:
        raise SceneError(f"vertices have the form {vertices.shape}", "give an array (v, 3), in metres")
    if faces.size == 0 or len(vertices) == 0:
        raise SceneError(
            f"it is empty ({len(vertices)} vertices, {len(faces)} faces)",
            "give at least one triangle; points alone need Shape.convex_hull",
        )
    if faces.ndim != 2 or faces.shape[1] != 3:
        raise SceneError(f"faces have the form {faces.shape}", "give triangles, an array (f, 3) of vertex indices")
    bad = np.flatnonzero(~np.isfinite(vertices).all(axis=1))
    if len(bad):
        raise SceneError(
            f"vertex {bad[0]} is not finite: {vertices[bad[0]].tolist()} ({len(bad)} such vertices)",
            "remove or repair these vertices",
        )
    bad = np.flatnonzero((np.abs(vertices) > FARTHEST).any(axis=1))
    if len(bad):
        raise SceneError(
            f"vertex {bad[0]} is at {vertices[bad[0]].tolist()} m, farther than {FARTHEST:g} m ({len(bad)} such vertices)",
            "repair these vertices, or scale the mesh",
        )
    bad = np.flatnonzero(((faces < 0) | (faces >= len(vertices))).any(axis=1))
    if len(bad):
        raise SceneError(
            f"face {bad[0]} has indices {faces[bad[0]].tolist()}, but there are {len(vertices)} vertices",
            f"use indices from 0 to {len(vertices) - 1}",
        )


def clean_surface(vertices: np.ndarray, faces: np.ndarray) -> Surface:
    """Return the clean surface of vertices (v, 3) and faces (f, 3).

    Raises:
        SceneError: as `check_triangles`, or no triangle has an area.

    """
    check_triangles(vertices, faces)
    faces = _drop_repeated(_merged(vertices, faces))
    num_open, num_twisted = _count_bad_edges(faces, len(vertices))
    if num_open:
        faces = _drop_repeated(_welded(vertices, faces)[faces])
        num_open, num_twisted = _count_bad_edges(faces, len(vertices))
    faces = _flip_thin(vertices, faces)
    if len(faces) == 0:
        raise SceneError("none of its triangles has an area", "give triangles whose corners are not in one line")
    used, index = np.unique(faces, return_inverse=True)
    return Surface(np.ascontiguousarray(vertices[used]), index.reshape(-1, 3), num_open, num_twisted)


def _merged(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return the faces with one index, the lowest, for all vertices at the same place."""
    order = np.lexsort((np.arange(len(vertices)), *vertices.T))
    sorted_vertices = vertices[order]
    starts = np.concatenate([[True], (sorted_vertices[1:] != sorted_vertices[:-1]).any(axis=1)])
    representative = np.empty(len(vertices), dtype=np.int64)
    representative[order] = order[starts][np.cumsum(starts) - 1]
    return representative[faces]


def _welded(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return, for each vertex, the lowest of the used vertices joined to it by steps below the weld distance."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import KDTree

    used = np.unique(faces)
    points = vertices[used]
    size = float(np.max(np.ptp(points, axis=0), initial=0.0))
    pairs = KDTree(points).query_pairs(TOLERANCES.surface.weld * size, output_type="ndarray")
    links = coo_matrix((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(used), len(used)))
    _, label = connected_components(links, directed=False)
    _, lowest = np.unique(label, return_index=True)
    representative = np.arange(len(vertices))
    representative[used] = used[lowest[label]]
    return representative


def _drop_repeated(faces: np.ndarray) -> np.ndarray:
    """Drop faces with a repeated corner, and all but the first of faces that are the same, winding included.

    A face and its mirror image are both kept: they are the two sides of a sheet.
    """
    a, b, c = faces.T
    faces = faces[(a != b) & (b != c) & (c != a)]
    turn = (np.argmin(faces, axis=1)[:, None] + np.arange(3)) % 3
    canonical = np.take_along_axis(faces, turn, axis=1)
    _, first = np.unique(canonical, axis=0, return_index=True)
    return faces[np.sort(first)]


def _count_bad_edges(faces: np.ndarray, num_vertices: int) -> tuple[int, int]:
    """Return the numbers of open and of twisted edges (see `Surface`)."""
    edges = unique_edges(faces, num_vertices)
    is_open = edges.count % 2 == 1
    return int(np.sum(is_open)), int(np.sum(~is_open & (edges.balance != 0)))


def _thinness(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return (f,) the height of each triangle over its longest edge, 0 for a point."""
    corners = vertices[faces]
    sides = np.roll(corners, -1, axis=1) - corners
    longest = np.linalg.norm(sides, axis=2).max(axis=1)
    doubled_area = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)
    return doubled_area / np.maximum(longest, np.finfo(float).tiny) ** 2


def _flip_thin(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Flip the longest edge of thin triangles until none can be helped; drop those without any area."""
    faces = faces.copy()
    for _ in range(len(faces)):
        thin = np.flatnonzero(_thinness(vertices, faces) < TOLERANCES.surface.thin_triangle)
        if len(thin) == 0 or not _flip_once(vertices, faces, thin):
            break
        faces = _drop_repeated(faces)
    return faces[_thinness(vertices, faces) > TOLERANCES.arithmetic.round_off]


def _flip_once(vertices: np.ndarray, faces: np.ndarray, thin: np.ndarray) -> bool:
    """Flip the longest edges of thin triangles where it helps, in place; return whether any was flipped.

    Thin triangle (a, c, b) with longest edge a c and its neighbour (c, a, d) become (a, d, b) and (d, c, b).
    """
    half_edges = {
        (int(face[k]), int(face[(k + 1) % 3])): (index, int(face[(k + 2) % 3]))
        for index, face in enumerate(faces)
        for k in range(3)
    }
    touched: set[int] = set()
    for index in thin.tolist():
        face = faces[index]
        lengths = np.linalg.norm(vertices[np.roll(face, -1)] - vertices[face], axis=1)
        k = int(np.argmax(lengths))
        a, c, b = (int(face[(k + i) % 3]) for i in range(3))
        neighbour, d = half_edges.get((c, a), (-1, -1))
        if neighbour < 0 or touched & {index, neighbour} or (b, d) in half_edges or (d, b) in half_edges:
            continue
        flipped = np.array([[a, d, b], [d, c, b]])
        if b != d and _thinness(vertices, flipped).min() < TOLERANCES.surface.thin_triangle:
            continue
        faces[[index, neighbour]] = flipped  # b == d: two faces back to back, which lose a corner and are dropped
        touched |= {index, neighbour}
    return bool(touched)
