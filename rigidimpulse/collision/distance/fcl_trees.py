"""What FCL says of two meshes: how near they are, and which of their triangles meet when one is moved into the other.

A mesh is a shape of triangles without a radius: a mesh, a hull, a box, or a compound of these. FCL gets it as a tree of triangles, in the
order of the compiled geometry, so that a triangle that FCL names is one of `Geometry.triangle`.

Only the calls that are safe are made, as in `fcl`: unsigned distance and collision of non-empty trees, at finite poses, with coordinates
scaled so that no triangle is small. FCL's answers are used as follows:

    distance   gap and closest points are exact to round-off; the direction between the points is as good as the gap is large
    collide    the triangles that meet are exact; the points and normals of two trees are not. A point is a corner of one of the triangles,
               wherever that corner is, and two edges that cross have the normal of a face. So the triangles are used only, and
               `manifold.fcl_contacts` tells which of their corners and edges are contacts
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import fcl
import numpy as np

from rigidimpulse.collision.distance.fcl import objects_of, scale_of
from rigidimpulse.collision.geometry import CompiledShape, Geometry

Objects = tuple[fcl.CollisionObject, fcl.CollisionObject]
"""A tree as it is asked about, as the first and as the second of a pair: so that a mesh can be asked about itself."""
MOST_PAIRS = 100_000
"""Pairs of triangles that FCL may name at once."""


@dataclass(frozen=True)
class Nearest:
    """Where two meshes are nearest to each other, in the frame of the first."""

    gap: float  # m, 0 where the surfaces meet
    point_a: np.ndarray  # (3,) m
    point_b: np.ndarray  # (3,) m
    triangle_a: int
    triangle_b: int


class TriangleTrees:
    """The meshes of a scene as FCL has them. Trees are built when a mesh is first asked about.

    Args:
        shapes: the compiled shapes of the scene.
        geometry: the same shapes as `build_geometry` gives them.

    """

    def __init__(self, shapes: Sequence[CompiledShape], geometry: Geometry) -> None:
        """Nothing is built yet."""
        self.geometry = geometry
        self._scale = scale_of(shapes)
        self._trees: dict[int, Objects] = {}
        self._triangles: dict[int, Objects] = {}
        self._nearest_points = fcl.DistanceRequest(enable_nearest_points=True)
        self._only_gap = fcl.DistanceRequest()
        self._all_contacts = fcl.CollisionRequest(num_max_contacts=MOST_PAIRS, enable_contact=True)

    def nearest(self, a: int, b: int, R: np.ndarray, t: np.ndarray) -> Nearest:
        """Where meshes a and b are nearest; R (3, 3), t (3,) m: from the frame of b into that of a."""
        gap, point_a, point_b, result = self._ask(self._tree(a)[0], self._tree(b)[1], R, t)
        return Nearest(gap, point_a, point_b, self._first_triangle(a) + result.b1, self._first_triangle(b) + result.b2)

    def gap(self, a: int, b: int, R: np.ndarray, t: np.ndarray) -> float:
        """The least gap of meshes a and b, m, 0 where their surfaces meet; R, t as for `nearest`."""
        second = self._tree(b)[1]
        second.setTransform(fcl.Transform(R, t * self._scale))
        return max(0.0, fcl.distance(self._tree(a)[0], second, self._only_gap, fcl.DistanceResult()) / self._scale)

    def nearest_of_triangles(self, i: int, j: int, R: np.ndarray, t: np.ndarray) -> Nearest:
        """Where triangle i of the first mesh and j of the second are nearest."""
        gap, point_a, point_b, _ = self._ask(self._triangle(i)[0], self._triangle(j)[1], R, t)
        return Nearest(gap, point_a, point_b, i, j)

    def meeting(self, a: int, b: int, R: np.ndarray, t: np.ndarray) -> np.ndarray:
        """Pairs (k, 2) of triangles of meshes a and b that meet, ascending."""
        pairs = {(contact.b1, contact.b2) for contact in self._collide(a, b, R, t)}
        found = np.array(sorted(pairs), np.int64).reshape(-1, 2)
        return found + [self._first_triangle(a), self._first_triangle(b)]

    def raw_contacts(self, a: int, b: int, R: np.ndarray, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Points (k, 3) m and normals (k, 3) from a to b as FCL's collision gives them, ghosts included; for studies."""
        contacts = self._collide(a, b, R, t)
        points = np.array([contact.pos for contact in contacts]).reshape(-1, 3) / self._scale
        return points, np.array([contact.normal for contact in contacts]).reshape(-1, 3)

    def _collide(self, a: int, b: int, R: np.ndarray, t: np.ndarray) -> list[fcl.Contact]:
        second, result = self._tree(b)[1], fcl.CollisionResult()
        second.setTransform(fcl.Transform(R, t * self._scale))
        fcl.collide(self._tree(a)[0], second, self._all_contacts, result)
        return result.contacts

    def _ask(
        self, first: fcl.CollisionObject, second: fcl.CollisionObject, R: np.ndarray, t: np.ndarray
    ) -> tuple[float, np.ndarray, np.ndarray, fcl.DistanceResult]:
        """Gap and closest points of two trees, and FCL's result."""
        second.setTransform(fcl.Transform(R, t * self._scale))
        result = fcl.DistanceResult()
        distance = fcl.distance(first, second, self._nearest_points, result)
        point_a, point_b = (np.array(point) / self._scale for point in result.nearest_points)
        return max(0.0, distance / self._scale), point_a, point_b, result

    def _first_triangle(self, shape: int) -> int:
        geometry = self.geometry
        return int(geometry.triangle_first[geometry.shape_first[shape]])

    def _tree(self, shape: int) -> Objects:
        """The tree of a mesh."""
        if shape not in self._trees:
            geometry = self.geometry
            first, last = geometry.shape_first[shape], geometry.shape_first[shape + 1]
            vertices = slice(geometry.vertex_first[first], geometry.vertex_first[last])
            triangles = slice(geometry.triangle_first[first], geometry.triangle_first[last])
            faces = geometry.triangle[triangles] - geometry.vertex_first[first]
            self._trees[shape] = objects_of(geometry.vertex[vertices] * self._scale, faces)
        return self._trees[shape]

    def _triangle(self, triangle: int) -> Objects:
        """The tree of one triangle."""
        if triangle not in self._triangles:
            corners = self.geometry.vertex[self.geometry.triangle[triangle]]
            self._triangles[triangle] = objects_of(corners * self._scale, np.array([[0, 1, 2]]))
        return self._triangles[triangle]
