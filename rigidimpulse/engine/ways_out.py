"""Ways out of an overlap: in which direction, and how far, a body has to move without turning until it is apart from another one.

With n from a to b, c = x_b - x_a, d the gap that is asked for, and the support function h(n) = max n.r over a body about its centre,
two bodies are on either side of a plane of normal n, and d apart, where

    n.c >= h_a(n) + h_b(-n) + d  =: level.

This stays right wherever else the bodies move, since they do not turn. Convex bodies that are apart have such a plane, and the least
n.c - level is their depth. It is looked for among the line of the centres, the principal axes and the faces; from the best of them the
search descends: it takes the normal where the bodies then touch, as long as that is better (expanding polytopes, van den Bergen 2001). Of
equally good directions the one nearest to the line of the centres is taken, else the first axis of a.

Bodies that are not convex may be apart without such a plane. There the way is that along n to the first place, coming from afar, where the
gap is d; it holds for the present places of the bodies only. Bodies that overlap again and again all the same, as the links of a chain do
that were put into each other, take the plane, if the way to it is no longer than the smaller body.

Bodies that were apart as given stay on their sides: n and level are those of the place where they first touch on the straight way from the
places given to the present ones.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rigidimpulse.collision.distance.fcl import Narrowphase, Separation
from rigidimpulse.collision.manifold.penetrating import supports
from rigidimpulse.core.portable import dot, length, matmul
from rigidimpulse.core.quaternion import to_matrix
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.model.world import World

DEPTH = TOLERANCES.initial_overlap.depth
EQUAL = TOLERANCES.initial_overlap.equal_ways
DIRECTIONS = np.vstack([np.eye(3), -np.eye(3)])
MAX_APPROACHES = 40
MAX_DESCENTS = 4
MOST_FACES = 256
"""Faces of a body whose normals are tried: of more, the descent finds the best."""
COARSE = 1e-3
"""Error of ways that are compared, relative to the size of the smaller body."""
PATIENCE = 3
"""Demands that do not last from which a pair takes a plane."""


@dataclass
class Demand:
    """Bodies a < b are apart where n.(x_b - x_a) >= level.

    Attributes:
        direction: n, (3,) unit; zeros where no way is known.
        level: m; inf where no way is known.
        lasting: whether this holds wherever the bodies move.
        push: what it has displaced its bodies by, kg m.

    """

    a: int
    b: int
    direction: np.ndarray
    level: float
    lasting: bool
    push: float = 0.0


class WaysOut:
    """Ways out for the bodies of a world, which do not turn."""

    def __init__(self, world: World) -> None:
        """Nothing is measured yet."""
        self._world = world
        self._narrowphase = Narrowphase(world.shapes, world.geometry)
        self._rotation = [to_matrix(q) for q in world.orientation]
        self._convex = (world.convex_depths > 0.0)[world.shape_of_body]
        # Bodies with a half space know their depth, and have no far side to come from.
        self._endless = ~np.isfinite(world.bound_radius)

    def size(self, a: int, b: int) -> float:
        """Size of the smaller body of a pair, m."""
        return float(min(self._world.size[a], self._world.size[b]))

    def meets(self, a: int, b: int, c: np.ndarray) -> bool:
        """Whether b at c (3,) m beside a has a point in common with it."""
        (shape_a, shape_b), (turn_a, turn_b) = self._shapes(a, b), self._world.orientation[[a, b]]
        return self._narrowphase.overlap(shape_a, (np.zeros(3), turn_a), shape_b, (c, turn_b))

    def overlaps(self, a: int, b: int, c: np.ndarray) -> bool:
        """Whether b at c (3,) m beside a overlaps it, and does not only touch it."""
        return self.meets(a, b, c) and self.is_deep(a, b, c)

    def is_deep(self, a: int, b: int, c: np.ndarray) -> bool:
        """Whether b, which meets a, does so deeply: it is not free when it is moved by DEPTH of its size along one of the axes."""
        moved = DEPTH * self.size(a, b)
        return all(self.meets(a, b, c + moved * step) for step in DIRECTIONS)

    def least(self, a: int, b: int, c: np.ndarray) -> Demand:
        """The least way out of an overlap of b, which is c (3,) m beside a."""
        if self._endless[a] or self._endless[b]:
            return self._out_of_half_space(a, b, c)
        if self._convex[a] and self._convex[b]:
            return self._least_plane(a, b, c)
        coarse = COARSE * self.size(a, b)
        tried = self._directions(a, b, c)
        n, way = _least_of(tried, np.array([self._way(a, b, c, n, coarse) for n in tried]), c, coarse)
        if not np.isfinite(way):
            return _nothing(a, b)
        for _ in range(MAX_DESCENTS):
            other = self._separation(a, b, c + (way + coarse) * n).normal
            reached = self._way(a, b, c, other, coarse) if np.all(np.isfinite(other)) else np.inf
            if not reached < way - coarse:
                break
            n, way = other, reached
        way = self._way(a, b, c, n, 0.1 * self._margin(a, b))
        return Demand(a, b, n, way + float(dot(n, c)), lasting=False)

    def _least_plane(self, a: int, b: int, c: np.ndarray) -> Demand:
        """The plane of the least way for b at c (3,) m beside a."""
        tried, equal = self._directions(a, b, c), EQUAL * self.size(a, b)
        n, way = _least_of(tried, self._levels(a, b, tried) - dot(tried, c), c, equal)
        for _ in range(MAX_DESCENTS):
            other = self._separation(a, b, c + (way + equal) * n).normal
            reached = float(self._levels(a, b, other[None])[0] - dot(other, c)) if np.all(np.isfinite(other)) else np.inf
            if not reached < way - equal:
                break
            n, way = other, reached
        return Demand(a, b, n, way + float(dot(n, c)), lasting=True)

    def on_its_side(self, a: int, b: int, before: np.ndarray, c: np.ndarray) -> Demand:
        """The way back of b, which was apart from a while `before` (3,) m beside it, and overlaps it while c beside it."""
        if self._endless[a] or self._endless[b]:
            return self._out_of_half_space(a, b, c)
        gap, path = self._margin(a, b), c - before
        part, found = 0.0, self._separation(a, b, before)
        if not (found.gap > gap and np.all(np.isfinite(found.normal))):
            # They touched.
            demand = self.least(a, b, before)
            if not demand.lasting and np.isfinite(demand.level):
                demand.level = self._way(a, b, c, demand.direction, 0.1 * gap) + float(dot(demand.direction, c))
            return demand
        for _ in range(MAX_APPROACHES):
            if found.gap <= 2.0 * gap:
                break
            # Not all of the gap: bodies that touch have no normal.
            closing, safe = -float(dot(found.normal, path)), part + (found.gap - gap) / float(length(path))
            ahead = part + (found.gap - gap) / closing if closing > 0.0 else np.inf
            further = self._separation(a, b, before + ahead * path) if ahead < 1.0 else found
            if not (ahead < 1.0 and np.all(np.isfinite(further.normal))):
                # Past the touch, which concave bodies do not forgive: the gap itself is always safe.
                ahead = safe
                further = self._separation(a, b, before + ahead * path)
            if not np.all(np.isfinite(further.normal)):
                break
            part, found = ahead, further
        n = found.normal
        lasting = bool(self._convex[a] and self._convex[b])
        level = float(self._levels(a, b, n[None])[0]) if lasting else float(dot(n, before + part * path)) - found.gap + gap
        return Demand(a, b, n, level, lasting)

    def again(self, a: int, b: int, before: np.ndarray, c: np.ndarray, known: int) -> Demand:
        """One more demand of a pair that overlaps with b at c (3,) m beside a, though a number of known ones are met that do not last."""
        if known >= PATIENCE and not (self._endless[a] or self._endless[b]):
            plane = self._least_plane(a, b, c)
            if plane.level - float(dot(plane.direction, c)) <= self.size(a, b):
                return plane
        return self.least(a, b, c) if self.overlaps(a, b, before) else self.on_its_side(a, b, before, c)

    def _shapes(self, a: int, b: int) -> tuple[int, int]:
        return int(self._world.shape_of_body[a]), int(self._world.shape_of_body[b])

    def _separation(self, a: int, b: int, c: np.ndarray) -> Separation:
        """Separation of a pair whose b is c (3,) m beside a."""
        shape_a, shape_b, (turn_a, turn_b) = *self._shapes(a, b), self._world.orientation[[a, b]]
        return self._narrowphase.separation(shape_a, (np.zeros(3), turn_a), shape_b, (c, turn_b))

    def _out_of_half_space(self, a: int, b: int, c: np.ndarray) -> Demand:
        """The way out of a pair that has a half space."""
        found = self._separation(a, b, c)
        if not np.all(np.isfinite(found.normal)):
            return _nothing(a, b)
        pieces = np.diff(self._world.geometry.shape_first)[self._world.shape_of_body[[a, b]]]
        lasting = bool(np.all(pieces[self._endless[[a, b]]] == 1))
        return Demand(a, b, found.normal, float(dot(found.normal, c)) + self._margin(a, b) - found.gap, lasting)

    def _margin(self, a: int, b: int) -> float:
        """The gap of lasting contacts, m."""
        return self._world.contact_margin * self.size(a, b)

    def _levels(self, a: int, b: int, n: np.ndarray) -> np.ndarray:
        """Levels (k,) m of planes of the normals n (k, 3)."""
        return self._support(a, n) + self._support(b, -n) + self._margin(a, b)

    def _support(self, i: int, n: np.ndarray) -> np.ndarray:
        """Support function (k,) m of a finite body for directions n (k, 3)."""
        out = np.empty(len(n))
        supports(self._world.geometry, self._world.shape_of_body[i], np.zeros(3), self._rotation[i], np.ascontiguousarray(n), out)
        return out

    def _directions(self, a: int, b: int, c: np.ndarray) -> np.ndarray:
        """Directions to try (k, 3): of the centres, which is enough for two balls, of the axes of both bodies, and of their faces."""
        distance = float(length(c))
        tried = [c[None] / distance] if distance > EQUAL * self.size(a, b) else []
        if tried and self._world.ball[a] and self._world.ball[b]:
            return tried[0]
        for i in (a, b):
            tried += [self._rotation[i].T, -self._rotation[i].T]
        for i, sign in ((a, 1.0), (b, -1.0)):
            if self._convex[a] and self._convex[b]:
                tried.append(sign * self._faces(i))
        return np.vstack(tried)

    def _faces(self, i: int) -> np.ndarray:
        """Normals (k, 3) of the faces of a body of one primitive, if they are few."""
        geometry, p = self._world.geometry, int(self._world.geometry.shape_first[self._world.shape_of_body[i]])
        normals = geometry.triangle_normal[geometry.triangle_first[p] : geometry.triangle_first[p + 1]]
        return matmul(normals[: MOST_FACES if normals.any() else 0], self._rotation[i].T)

    def _way(self, a: int, b: int, c: np.ndarray, n: np.ndarray, fine: float) -> float:
        """How far b has to move along n from c until it is apart from a, to `fine` m; inf where that cannot be found."""
        reach = float(self._world.bound_radius[a] + self._world.bound_radius[b])
        way, gap = reach - float(dot(n, c)), self._margin(a, b)
        free, careful = np.inf, False
        for _ in range(MAX_APPROACHES):
            found = self._separation(a, b, c + way * n)
            left = found.gap - gap
            if not np.all(np.isfinite(found.normal)):
                # One step too far, which a concave body does not forgive: the gap itself is always safe.
                way, careful = free, True
                if not np.isfinite(way):
                    return np.inf
                continue
            free = way
            rate = float(dot(n, found.normal))
            # Along a surface that is nearly parallel to n the rate tells nothing: steps of 1e10 m came of it. At c itself they overlap: a
            # step past it leads through a hole to the far side, and from there on and on.
            way -= left if careful or abs(left) >= 2.0 * reach * rate or left >= rate * way else left / rate
            if abs(left) <= fine:
                break
        return way


def _least_of(tried: np.ndarray, ways: np.ndarray, c: np.ndarray, equal: float) -> tuple[np.ndarray, float]:
    """Direction and way of the least of the ways (k,) along those tried (k, 3); of equal ones, that nearest to c (3,), else the first."""
    good = np.flatnonzero(ways <= ways.min() + equal)
    along = dot(tried[good], c)
    best = good[np.flatnonzero(along >= along.max() - equal)[0]]
    return tried[best], float(ways[best])


def _nothing(a: int, b: int) -> Demand:
    """The demand of a pair of which no way out is known."""
    return Demand(a, b, np.zeros(3), np.inf, lasting=False)
