"""Bodies outside each other.

    V = k/2 sum over pairs of  min over planes of  sum of r^2

with the depths r by which points of the two bodies are on the wrong side of a plane between them (see `separating_plane`). Force on a point
of b  k r n,  of a  -k r n,  n the normal of the best plane from a to b; as it is the best, these are the exact gradient, and the second
derivatives are those of V(poses, plane) with the plane eliminated. V is 0 exactly if the bodies are apart, by `gap` or more.

Bodies are taken as convex pieces: boxes and hulls with their corners, spheres and capsules exactly, cylinders as prisms of `SIDES` sides
around them, meshes as their convex hull (give a compound for a concave body). The contacts of `detect` do not serve here: they want bodies
apart.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from rigidimpulse.collision.distance.separating_plane import best_plane, tangents
from rigidimpulse.collision.geometry import CYLINDER, HALF_SPACE, Geometry
from rigidimpulse.core.errors import SceneError
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.dynamics.forces.energy.term import Expansion, Poses, body_indices, eliminated, levers, positive, turning
from rigidimpulse.model.world import World
from rigidimpulse.scene.body import number

SIDES = 32
MOST_EDGES = 24
"""Directions of edges of a piece beyond which their products are not tried as axes."""
SAME_DIRECTION = TOLERANCES.energy.same_direction


class Piece(NamedTuple):
    """A convex piece of a body, principal frame."""

    points: np.ndarray  # (v, 3) m
    radius: float
    normals: np.ndarray  # (f, 3) unit, outward, of its faces
    edges: np.ndarray  # (e, 3) unit directions of its edges, either sense


class Plane(NamedTuple):
    """A half space, principal frame: normal.y <= offset."""

    normal: np.ndarray
    offset: float


@dataclass(frozen=True, eq=False)
class NoOverlap:
    """Pushes bodies out of each other: V = k/2 sum of squares of the depths of their points beyond the best plane between them.

    Checked when it is used: a `SceneError` names unknown bodies, a weight that is not positive, a negative gap.

    Attributes:
        weight: k, N/m for each point that overlaps; n corners that carry a load F sink by F / (n k).
        gap: m, the distance kept.
        bodies: names; None, all bodies. Pairs of which neither is dynamic are left out.

    Source: see the head of the module.
    """

    weight: float = 1.0
    gap: float = 0.0
    bodies: Sequence[str] | None = None

    def compile(self, world: World) -> CompiledNoOverlap:
        """Bind the term to a compiled scene."""
        where = "NoOverlap"
        bodies = np.sort(body_indices(world, world.names if self.bodies is None else self.bodies, where))
        weight = positive(self.weight, "weight", "N/m", where)
        try:
            gap = number(self.gap, "gap", "m")
            if gap < 0.0:
                raise SceneError(f"gap is {self.gap!r}", "give a distance >= 0, in m")
        except SceneError as error:
            raise error.within(where) from None
        shapes = {int(shape): _pieces(world.geometry, int(shape)) for shape in world.shape_of_body[bodies]}
        pieces = {int(i): shapes[int(world.shape_of_body[i])] for i in bodies}
        a, b = (bodies[k] for k in np.triu_indices(len(bodies), 1))
        pairs = np.stack([a, b], axis=1)[world.dynamic[a] | world.dynamic[b]]
        return CompiledNoOverlap(pairs, pieces, world.bound_radius, weight, gap)


@dataclass(frozen=True, eq=False)
class CompiledNoOverlap:
    """Pairs (p, 2) of bodies, the pieces of each, and the radii (n,) of all bodies about their centres of mass."""

    pairs: np.ndarray
    pieces: dict[int, list[Piece | Plane]]
    radius: np.ndarray
    weight: float
    gap: float

    def expand(self, at: Poses, total: Expansion) -> None:
        """Add all pairs to a sum."""
        a, b = self.pairs.T
        reach = self.radius[a] + self.radius[b] + self.gap
        near = np.linalg.norm(at.position[b] - at.position[a], axis=1) < reach
        for i, j in self.pairs[near].tolist():
            for first in self.pieces[i]:
                for second in self.pieces[j]:
                    if isinstance(second, Plane):
                        self._above(at, (j, i), second, first, total)
                    elif isinstance(first, Plane):
                        self._above(at, (i, j), first, second, total)
                    else:
                        self._between(at, (i, j), (first, second), total)

    def _above(self, at: Poses, bodies: tuple[int, int], plane: Plane, piece: Piece | Plane, total: Expansion) -> None:
        """Add a piece over a half space, whose body does not move."""
        if isinstance(piece, Plane):
            return
        i, j = bodies
        n = at.rotation[i] @ plane.normal
        c = piece.points @ at.rotation[j].T
        r = plane.offset + piece.radius + self.gap - (c + at.position[j] - at.position[i]) @ n
        deep = r > 0.0
        if not np.any(deep):
            return
        c, r = c[deep], r[deep]
        slope = -n @ levers(c)
        hessian = slope.T @ slope
        hessian[3:, 3:] += turning(c, -r[:, None] * n).sum(0)
        k = self.weight
        total.add(0.5 * k * float(r @ r), np.array([j]), k * (r @ slope)[None], k * hessian)

    def _between(self, at: Poses, bodies: tuple[int, int], pieces: tuple[Piece, Piece], total: Expansion) -> None:
        """Add two pieces."""
        arms = [piece.points @ at.rotation[i].T for piece, i in zip(pieces, bodies, strict=True)]
        middle = 0.5 * (at.position[bodies[0]] + at.position[bodies[1]])
        y = [c + (at.position[i] - middle) for c, i in zip(arms, bodies, strict=True)]
        radii = [piece.radius + 0.5 * self.gap for piece in pieces]
        axes = _axes(pieces, (at.rotation[bodies[0]], at.rotation[bodies[1]]), y)
        if not len(axes):
            return
        low, high = (axes @ y[1].T).min(1) - radii[1], (axes @ y[0].T).max(1) + radii[0]
        best = int(np.argmax(low - high))
        # A separating axis: the pieces are apart and have no energy.
        if low[best] >= high[best]:
            return
        size = float(max(np.abs(y[0]).max(), np.abs(y[1]).max()))
        n = axes[best].copy()
        # Scaled to the size 1, as `best_plane` asks.
        d, energy = best_plane(y[0] / size, radii[0] / size, y[1] / size, radii[1] / size, n, 0.5 * (low[best] + high[best]) / size)
        if energy > 0.0:
            self._add(arms, y, radii, bodies, n, d * size, total)

    def _add(
        self, arms: list[np.ndarray], y: list[np.ndarray], radii: list[float], bodies: tuple[int, int], n: np.ndarray, d: float,
        total: Expansion,
    ) -> None:
        """Add two pieces with the best plane n (3,), d between them."""
        u, v = np.empty(3), np.empty(3)
        tangents(n, u, v)
        # Variables: six of each body, two angles of the plane, d.
        value, gradient, hessian = 0.0, np.zeros(15), np.zeros((15, 15))
        for side, sign in ((0, 1.0), (1, -1.0)):
            r = sign * (y[side] @ n - d) + radii[side]
            deep = r > 0.0
            r, c, place = r[deep], arms[side][deep], y[side][deep]
            own = slice(6 * side, 6 * side + 6)
            motion = levers(c)
            slope = np.zeros((len(r), 15))
            slope[:, own] = sign * (n @ motion)
            slope[:, 12], slope[:, 13], slope[:, 14] = sign * (place @ u), sign * (place @ v), -sign
            value += 0.5 * float(r @ r)
            gradient += r @ slope
            hessian += slope.T @ slope
            hessian[own, own][3:, 3:] += turning(c, sign * r[:, None] * n).sum(0)
            mixed = sign * np.stack([r @ (u @ motion), r @ (v @ motion)])
            hessian[12:14, own] += mixed
            hessian[own, 12:14] += mixed.T
            hessian[[12, 13], [12, 13]] -= sign * float(r @ (place @ n))
        k = self.weight
        total.add(k * value, np.array(bodies), k * gradient[:12].reshape(2, 6), k * eliminated(hessian, 12))


def _axes(pieces: tuple[Piece, Piece], rotations: tuple[np.ndarray, np.ndarray], y: list[np.ndarray]) -> np.ndarray:
    """Return unit directions (k, 3) from the first to the second piece that may part them."""
    between = y[1].mean(0) - y[0].mean(0)
    edges = [piece.edges @ R.T for piece, R in zip(pieces, rotations, strict=True)]
    across = np.cross(edges[0][:, None], edges[1][None]).reshape(-1, 3)
    beside = [between - (e @ between)[:, None] * e for e in edges]
    other = np.concatenate([across, *beside, between[None]])
    length = np.linalg.norm(other, axis=1)
    other = other[length > SAME_DIRECTION * max(float(length.max()), 1e-300)]
    other = other / np.linalg.norm(other, axis=1)[:, None]
    other = np.where((other @ between < 0.0)[:, None], -other, other)
    return np.concatenate([pieces[0].normals @ rotations[0].T, -pieces[1].normals @ rotations[1].T, other])


def _pieces(geometry: Geometry, shape: int) -> list[Piece | Plane]:
    """Return the convex pieces of a compiled shape."""
    pieces: list[Piece | Plane] = []
    for p in range(int(geometry.shape_first[shape]), int(geometry.shape_first[shape + 1])):
        frame, radius = geometry.frame[p], float(geometry.radius[p])
        vertices = geometry.vertex[geometry.vertex_first[p] : geometry.vertex_first[p + 1]]
        if geometry.kind[p] == HALF_SPACE:
            pieces.append(Plane(frame[:3].copy(), float(frame[3])))
        elif geometry.kind[p] == CYLINDER:
            pieces.append(_prism(frame[:3], frame[3:6], float(frame[6]), radius))
        elif len(vertices) <= 2:
            edge = np.diff(vertices, axis=0)
            pieces.append(Piece(vertices, radius, np.zeros((0, 3)), edge / np.linalg.norm(edge, axis=1)[:, None]))
        else:
            pieces.append(_hull(vertices, radius))
    return pieces


def _prism(centre: np.ndarray, axis: np.ndarray, half: float, radius: float) -> Piece:
    """Return the prism around a cylinder."""
    u, v = np.empty(3), np.empty(3)
    tangents(axis, u, v)
    angle = 2.0 * np.pi * np.arange(SIDES) / SIDES
    rim = radius / np.cos(np.pi / SIDES) * (np.cos(angle)[:, None] * u + np.sin(angle)[:, None] * v)
    points = np.concatenate([centre + half * axis + rim, centre - half * axis + rim])
    return Piece(points, 0.0, np.stack([axis, -axis]), axis[None])


def _hull(vertices: np.ndarray, radius: float) -> Piece:
    """Return the convex hull of the vertices of a surface."""
    from scipy.spatial import ConvexHull, QhullError

    try:
        hull = ConvexHull(vertices)
    except QhullError:
        # A flat sheet: its corners alone; the directions tried are those of what it meets.
        return Piece(np.unique(vertices, axis=0), radius, np.zeros((0, 3)), np.zeros((0, 3)))
    normals = hull.equations[:, :3]
    ends = []
    for face, (corners, neighbours) in enumerate(zip(hull.simplices, hull.neighbors, strict=True)):
        for k, other in enumerate(neighbours):
            if other > face and normals[face] @ normals[other] < 1.0 - SAME_DIRECTION:
                ends.append(np.delete(corners, k))
    directions = np.array([vertices[i] - vertices[j] for i, j in ends]).reshape(-1, 3)
    edges = _distinct(directions / np.linalg.norm(directions, axis=1)[:, None], both=True)
    if len(edges) > MOST_EDGES:
        edges = np.zeros((0, 3))
    return Piece(vertices[np.sort(hull.vertices)], radius, _distinct(normals, both=False), edges)


def _distinct(directions: np.ndarray, both: bool) -> np.ndarray:
    """Return the unit directions (k, 3) without repetitions; opposite ones are the same if `both`."""
    kept: list[np.ndarray] = []
    for n in directions:
        cosines = np.array(kept) @ n if kept else np.zeros(0)
        if not np.any((np.abs(cosines) if both else cosines) > 1.0 - SAME_DIRECTION):
            kept.append(n)
    return np.array(kept).reshape(-1, 3)
