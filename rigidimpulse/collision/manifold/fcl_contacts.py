"""Contacts of two meshes as FCL finds them, with its ghosts left out.

The meshes are a gap apart. FCL is asked for

    distance   the closest points, and the normal between them. At small gaps it is asked again with the second mesh moved away along the
               normal, where the difference of the points has its digits
    collide    the triangles that meet after the second mesh is moved in by a little more than the reach: along the normal, and along 13
               other directions where a mesh is concave, since its other contacts have other normals

A face on a face has more contacts than the closest points. They are among the triangles that meet, and so are many ghosts: a corner of a
triangle that lies beside the other triangle, the back of a corner, edges inside a flat face. Of each pair of triangles these stay:

    a corner of one over the other, if nothing of its body is deeper there: its edges lead away from the face
    two edges, where the closest points of both triangles (FCL's distance) lie on them, with a normal between the faces of either edge

and both only with a gap between the gap of the meshes, since nothing is nearer, and the reach. Edges inside flat faces and in hollows are
no edges, and corners on them no corners (`geometry`), as in the own manifolds. The closest points always stay, whatever lies there.

Where the surfaces meet, FCL gives no normal: there is no answer.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.spatial import ConvexHull

from rigidimpulse.collision.distance.fcl_trees import Nearest, TriangleTrees
from rigidimpulse.collision.distance.simplices import CORNER, EDGE_EDGE, FACE_VERTEX, VERTEX_FACE
from rigidimpulse.collision.geometry import EDGE_BOUNDARY, EDGE_HIDDEN
from rigidimpulse.collision.manifold.contact_points import ALIKE_NORMAL, INSIDE, MERGE, SAME_NORMAL, TILT
from rigidimpulse.core.tolerances import TOLERANCES

AWAY = 5.0
"""How far the second mesh is moved away to take the normal, over the contact margin."""
CLEAR = 0.1
"""Gap over the contact margin from which on the normal needs no second question: it is good to 1e-9."""
IN = 1.5
"""How far it is moved in, over the reach: what is within the reach meets, though its normal is up to 48 degrees off the direction."""
ROUND_OFF = TOLERANCES.arithmetic.round_off
MEETING = 30.0
"""Gap over round-off below which surfaces meet: the line between the points has no direction."""
NEARER = 1e-3
"""Part of the gap by which a contact may be nearer than FCL's distance, which is exact."""
SAME_PLACE = 1e-3
"""Distance below which two contacts are one, over the contact margin."""
FILLS = 1e-3
"""Part of its volume by which the hull of a convex mesh may differ."""
CORNERS = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)]) / np.sqrt(3.0)
FACE, EDGE, VERTEX = 0, 1, 2
"""What of a triangle a point lies on."""


@dataclass(frozen=True)
class Placed:
    """Two meshes: y_a = R y_b + t, m."""

    a: int
    b: int
    R: np.ndarray
    t: np.ndarray


@dataclass(frozen=True)
class Limits:
    """Gaps that count, m: contacts up to `reach` are wanted; margin: the contact margin of the pair."""

    reach: float
    margin: float


@dataclass(frozen=True)
class MeshContact:
    """A contact of meshes a and b, in the frame of a; kind and features as in `collision.distance.simplices`."""

    point_a: np.ndarray  # (3,) m
    point_b: np.ndarray
    normal: np.ndarray  # (3,) unit, from a to b
    gap: float  # m
    kind: int
    feature_a: int
    feature_b: int


class FclManifolds:
    """Contacts of the meshes of a scene, by FCL."""

    def __init__(self, trees: TriangleTrees) -> None:
        """trees: of the scene."""
        self.trees, self.geometry = trees, trees.geometry
        self._is_convex: dict[int, bool] = {}

    def contacts(self, pair: Placed, limits: Limits) -> list[MeshContact] | None:
        """Contacts of two meshes, the closest points first; none where the gap is beyond the reach, None where the surfaces meet."""
        nearest = self.closest(pair, limits.margin)
        if nearest is None or nearest.gap > limits.reach:
            return None if nearest is None else []
        return _without_ties([nearest, *self._others(pair, limits, nearest)], SAME_PLACE * limits.margin)

    def closest(self, pair: Placed, margin: float) -> MeshContact | None:
        """The contact at the closest points of two meshes, None where the surfaces meet; margin: the contact margin, m."""
        return self._precise(lambda t: self.trees.nearest(pair.a, pair.b, pair.R, t), pair, margin)

    def _precise(self, ask: Callable[[np.ndarray], Nearest], pair: Placed, margin: float) -> MeshContact | None:
        """The contact at the closest points by `ask`, which gets the place of b; None where the surfaces meet."""
        nearest = ask(pair.t)
        between = nearest.point_b - nearest.point_a
        length = float(np.linalg.norm(between))
        size = float(np.abs(nearest.point_a).max() + np.abs(pair.t).max())
        if min(nearest.gap, length) <= MEETING * ROUND_OFF * size:
            return None
        contact, away = self._contact(pair, nearest, between / length), AWAY * margin
        if nearest.gap >= CLEAR * margin:
            return contact
        # The first normal may be off by round-off over the gap, the second one by what that moves the points.
        for _ in range(2):
            way = away * contact.normal
            moved = ask(pair.t + way)
            between = moved.point_b - moved.point_a
            back = Nearest(nearest.gap, moved.point_a, moved.point_b - way, moved.triangle_a, moved.triangle_b)
            better = self._contact(pair, back, between / np.linalg.norm(between))
            if _corners_and_edges(better) != _corners_and_edges(contact):
                break  # something else is nearest from there
            contact = better
        return contact

    def _contact(self, pair: Placed, nearest: Nearest, normal: np.ndarray) -> MeshContact:
        """The contact at the closest points, named by what they lie on."""
        on_a = self._feature(nearest.triangle_a, nearest.point_a)
        on_b = self._feature(nearest.triangle_b, (nearest.point_b - pair.t) @ pair.R)
        return MeshContact(nearest.point_a, nearest.point_b, normal, nearest.gap, *_names(on_a, on_b))

    def _feature(self, triangle: int, point: np.ndarray) -> tuple[int, int]:
        """What of a triangle a point on it lies on, and its number; edges and corners that touch nothing belong to the face."""
        geometry, corners = self.geometry, self.geometry.triangle[triangle]
        place = geometry.vertex[corners]
        sides = np.roll(place, -1, axis=0) - place
        lengths = np.linalg.norm(sides, axis=1)
        near, edges = MERGE * lengths.max(), geometry.triangle_edge[triangle]
        at = np.flatnonzero(np.linalg.norm(point - place, axis=1) <= near)
        if len(at) and geometry.vertex_corner[corners[at[0]]]:
            return VERTEX, int(corners[at[0]])
        distance = np.linalg.norm(np.cross(sides, point - place), axis=1)
        on = np.flatnonzero((distance <= near * lengths) & (geometry.edge_kind[edges] != EDGE_HIDDEN))
        return (EDGE, int(edges[on[0]])) if len(on) else (FACE, triangle)

    def _others(self, pair: Placed, limits: Limits, nearest: MeshContact) -> list[MeshContact]:
        """Contacts among the triangles that meet when b is moved in."""
        directions = nearest.normal[None, :]
        if not (self._convex(pair.a) and self._convex(pair.b)):
            directions = np.vstack([directions, _all_around(nearest.normal)])
        way = IN * limits.reach + nearest.gap
        meeting = [self.trees.meeting(pair.a, pair.b, pair.R, pair.t - way * direction) for direction in directions]
        pairs = np.unique(np.concatenate(meeting), axis=0)
        if not len(pairs):
            return []
        least = nearest.gap * (1.0 - NEARER)
        found = [*self._corners_of_b(pair, pairs, least, limits.reach), *self._corners_of_a(pair, pairs, least, limits.reach)]
        return found + self._edges(pair, pairs, least, limits)

    def _corners_of_b(self, pair: Placed, pairs: np.ndarray, least: float, reach: float) -> list[MeshContact]:
        """Corners of b over triangles of a."""
        out = []
        for corner, face, place, height in self._over(pairs[:, ::-1], pair.R, pair.t, least, reach):
            normal = self.geometry.triangle_normal[face]
            out.append(MeshContact(place - height * normal, place, normal, height, int(FACE_VERTEX), face, corner))
        return out

    def _corners_of_a(self, pair: Placed, pairs: np.ndarray, least: float, reach: float) -> list[MeshContact]:
        """Corners of a over triangles of b."""
        out = []
        for corner, face, place, height in self._over(pairs, pair.R.T, -pair.R.T @ pair.t, least, reach):
            normal = self.geometry.triangle_normal[face]
            point_a, point_b = pair.R @ place + pair.t, pair.R @ (place - height * normal) + pair.t
            out.append(MeshContact(point_a, point_b, -(pair.R @ normal), height, int(VERTEX_FACE), corner, face))
        return out

    def _over(
        self, pairs: np.ndarray, R: np.ndarray, t: np.ndarray, least: float, reach: float
    ) -> list[tuple[int, int, np.ndarray, float]]:
        """Corners of the first triangles of pairs (k, 2) over the second ones: corner, face, place in the face's frame, height.

        R, t: from the frame of the first triangles into that of the second.
        """
        geometry = self.geometry
        corners = geometry.triangle[pairs[:, 0]].ravel()
        candidates = np.unique(np.column_stack([corners, np.repeat(pairs[:, 1], 3)]), axis=0)
        candidates = candidates[geometry.vertex_corner[candidates[:, 0]]]
        place = geometry.vertex[candidates[:, 0]] @ R.T + t
        face = geometry.vertex[geometry.triangle[candidates[:, 1]]]
        normal = geometry.triangle_normal[candidates[:, 1]]
        height = np.sum((place - face[:, 0]) * normal, axis=1)
        sides = np.roll(face, -1, axis=1) - face
        lengths = np.linalg.norm(sides, axis=2)
        outside = -np.sum(np.cross(normal[:, None, :], sides) * (place[:, None, :] - face), axis=2)
        # A face goes on beyond the edges inside it: the triangle there may not be among those that meet.
        edges = geometry.triangle_edge[candidates[:, 1]]
        level = np.sum(geometry.edge_normal[edges, 0] * geometry.edge_normal[edges, 1], axis=2) > SAME_NORMAL
        slack = np.where(level & (geometry.edge_kind[edges] == EDGE_HIDDEN), reach, INSIDE * lengths)
        is_over = (height >= least) & (height <= reach) & np.all(outside <= slack * lengths, axis=1)
        out: list[tuple[int, int, np.ndarray, float]] = []
        for k in np.flatnonzero(is_over):
            corner, triangle = int(candidates[k, 0]), int(candidates[k, 1])
            if self._leads_away(corner, R.T @ normal[k]):
                out.append((corner, triangle, place[k], float(height[k])))
        return out

    def _leads_away(self, corner: int, direction: np.ndarray) -> bool:
        """Whether all edges of a corner lead along a unit direction, in its body's frame, or are at most tilted a little against it."""
        geometry = self.geometry
        edges = geometry.edge[geometry.vertex_edge[geometry.vertex_edge_first[corner] : geometry.vertex_edge_first[corner + 1]]]
        ways = geometry.vertex[edges.sum(axis=1) - corner] - geometry.vertex[corner]
        return bool(np.all(ways @ direction >= -TILT * np.linalg.norm(ways, axis=1)))

    def _edges(self, pair: Placed, pairs: np.ndarray, least: float, limits: Limits) -> list[MeshContact]:
        """Edges that cross, among pairs of triangles (k, 2)."""
        geometry, out = self.geometry, []
        has_edge = np.any(geometry.edge_kind[geometry.triangle_edge[pairs]] != EDGE_HIDDEN, axis=2).all(axis=1)
        for i, j in pairs[has_edge].tolist():
            contact = self._precise(lambda t, i=i, j=j: self.trees.nearest_of_triangles(i, j, pair.R, t), pair, limits.margin)
            if contact is None or contact.kind != EDGE_EDGE or not least <= contact.gap <= limits.reach:
                continue
            outward_b = -(contact.normal @ pair.R)
            if self._in_arc(contact.feature_a, contact.normal) and self._in_arc(contact.feature_b, outward_b):
                out.append(contact)
        return out

    def _in_arc(self, edge: int, direction: np.ndarray) -> bool:
        """Whether a unit direction, in the body's frame, leads out of both faces of an edge, or misses that by a little."""
        geometry = self.geometry
        tail, head = geometry.vertex[geometry.edge[edge]]
        along = (head - tail) / np.linalg.norm(head - tail)
        first, second = geometry.edge_normal[edge]
        if geometry.edge_kind[edge] == EDGE_BOUNDARY:
            return bool(direction @ np.cross(along, first) >= -TILT) or not np.array_equal(first, second)
        return bool(min(direction @ np.cross(along, first), direction @ np.cross(second, along)) >= -TILT)

    def _convex(self, shape: int) -> bool:
        """Whether a mesh is one closed surface without hollows: then all its contacts with another such mesh have nearly one normal."""
        if shape not in self._is_convex:
            self._is_convex[shape] = self._look_for_hollows(shape)
        return self._is_convex[shape]

    def _look_for_hollows(self, shape: int) -> bool:
        """Whether a mesh turns inwards at no edge, and fills its hull: it may be in several parts, or run through itself."""
        geometry = self.geometry
        first, last = geometry.shape_first[shape], geometry.shape_first[shape + 1]
        if last > first + 1 or not geometry.closed[first]:
            return False
        edges = slice(geometry.edge_first[first], geometry.edge_first[last])
        ends, normals = geometry.edge[edges], geometry.edge_normal[edges]
        along = geometry.vertex[ends[:, 1]] - geometry.vertex[ends[:, 0]]
        bend = np.sum(np.cross(normals[:, 0], normals[:, 1]) * along, axis=1)
        if np.any(bend < -TOLERANCES.surface.flat_angle * np.linalg.norm(along, axis=1)):
            return False
        corners = geometry.vertex[geometry.triangle[geometry.triangle_first[first] : geometry.triangle_first[last]]]
        volume = float(np.sum(corners[:, 0] * np.cross(corners[:, 1], corners[:, 2]))) / 6.0
        hull = ConvexHull(geometry.vertex[geometry.vertex_first[first] : geometry.vertex_first[last]])
        return abs(volume - hull.volume) <= FILLS * hull.volume


def _names(on_a: tuple[int, int], on_b: tuple[int, int]) -> tuple[int, int, int]:
    """Kind and features of a contact between what points lie on."""
    (what_a, a), (what_b, b) = on_a, on_b
    if what_a == VERTEX and what_b == FACE:
        return int(VERTEX_FACE), a, b
    if what_a == FACE and what_b == VERTEX:
        return int(FACE_VERTEX), a, b
    if what_a == EDGE and what_b == EDGE:
        return int(EDGE_EDGE), a, b
    return int(CORNER), _corner_name(what_a, a), _corner_name(what_b, b)


def _corners_and_edges(contact: MeshContact) -> tuple[int, int, int]:
    """What a contact is known by: of a corner on a face not the triangle, of which a face has several."""
    if contact.kind == VERTEX_FACE:
        return contact.kind, contact.feature_a, -1
    if contact.kind == FACE_VERTEX:
        return contact.kind, -1, contact.feature_b
    return contact.kind, contact.feature_a, contact.feature_b


def _corner_name(what: int, number: int) -> int:
    """The feature of a CORNER; -1 for a face."""
    return {VERTEX: 2 * number, EDGE: 2 * number + 1, FACE: -1}[what]


def _without_ties(contacts: list[MeshContact], near: float) -> list[MeshContact]:
    """Each contact once; of those at one place (`near` m) and with one normal the one of the lowest kind, as in the own manifolds.

    The closest points of faces in parallel planes may lie anywhere on them; they are left out where corners or edges are as near.
    """
    kept: list[MeshContact] = []
    for contact in contacts:
        known = [k for k, other in enumerate(kept) if _are_one(contact, other, near)]
        if not known:
            kept.append(contact)
        elif contact.kind < kept[known[0]].kind:
            kept[known[0]] = contact
    nearest, others = kept[0], kept[1:]
    is_tie = nearest.kind == CORNER and min(nearest.feature_a, nearest.feature_b) < 0
    return others if is_tie and any(other.normal @ nearest.normal > ALIKE_NORMAL for other in others) else kept


def _are_one(contact: MeshContact, other: MeshContact, near: float) -> bool:
    """Whether two contacts are of the same edges, or at one place, with one normal; a corner is there for several triangles of a face."""
    if contact.kind == EDGE_EDGE and _corners_and_edges(contact) == _corners_and_edges(other):
        return True
    return bool(np.abs(contact.point_a - other.point_a).max() <= near and contact.normal @ other.normal > ALIKE_NORMAL)


def _all_around(normal: np.ndarray) -> np.ndarray:
    """Unit directions (13, 3) that with a normal are within 37 degrees of any other: the other axes and the corners of a cube about it."""
    aside = np.eye(3)[int(np.argmin(np.abs(normal)))]
    first = np.cross(normal, aside)
    first /= np.linalg.norm(first)
    axes = np.array([normal, first, np.cross(normal, first)])
    return np.vstack([-axes[:1], axes[1:], -axes[1:], CORNERS @ axes])
