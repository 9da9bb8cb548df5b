"""A point of one body on the surface of another.

    V = k d^2 / 2,    d(p) the signed distance of the point p from the surface, negative inside,    force on a  -k d n  at p

n is the direction from the nearest place of the surface, where b gets the opposite force. V is smooth but at points that have several nearest
places (in the middle of the solid) and at its edges from inside. The second derivatives leave out how n turns.
Source: Witkin, Fleischer, Barr 1987, attachment to an implicit surface.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from rigidimpulse.body import vector
from rigidimpulse.detect.inside import contains
from rigidimpulse.detect.manifold import pair_gap
from rigidimpulse.errors import SceneError
from rigidimpulse.forces.energy.term import Expansion, Poses, body_index, body_point, levers, positive
from rigidimpulse.geometry import CYLINDER, ROUND, CompiledShape, Geometry, Primitive, build_geometry
from rigidimpulse.world import World

_POINT = CompiledShape((Primitive(ROUND, vertices=np.zeros((1, 3))),))


@dataclass(frozen=True, eq=False)
class PointOnSurface:
    """Draws a point of body a to the surface of body b: V = k d^2 / 2, d the distance between them.

    Checked when it is used: a `SceneError` names an unknown body, two equal ones, an anchor or a weight that makes no sense.

    Attributes:
        a, b: names of bodies; a may be None, the world.
        anchor: (3,) m, the point of a, in world coordinates where the bodies are in the scene given.
        weight: k, N/m.

    Source: Witkin, Fleischer, Barr 1987.
    """

    a: str | None
    b: str
    anchor: ArrayLike
    weight: float = 1.0

    def compile(self, world: World) -> CompiledSurfacePoint:
        """Bind the term to a compiled scene."""
        where = f"PointOnSurface({self.a!r}, {self.b!r})"
        a, b = body_index(world, self.a, where), body_index(world, self.b, where)
        if b < 0 or a == b:
            raise SceneError("it needs a surface of another body", "name the body with the surface as b", where)
        try:
            anchor = vector(self.anchor, "anchor", "m")
        except SceneError as error:
            raise error.within(where) from None
        weight = positive(self.weight, "weight", "N/m", where)
        shape = int(world.shape_of_body[b])
        geometry = build_geometry([world.shapes[shape], _POINT])
        return CompiledSurfacePoint(a, b, body_point(world, a, anchor), weight, geometry)


@dataclass(frozen=True, eq=False)
class CompiledSurfacePoint:
    """A point at `arm` (3,) m of body a (-1: the world) and body b, shape 0 of `geometry`; its shape 1 is a point."""

    a: int
    b: int
    arm: np.ndarray
    weight: float
    geometry: Geometry

    def expand(self, at: Poses, total: Expansion) -> None:
        """Add the term to a sum."""
        c = at.rotation[self.a] @ self.arm if self.a >= 0 else np.zeros(3)
        p = at.position[self.a] + c if self.a >= 0 else self.arm
        local = (p - at.position[self.b]) @ at.rotation[self.b]
        out = np.zeros(7)
        pair_gap(self.geometry, 1, local, np.eye(3), 0, np.zeros(3), np.eye(3), np.inf, out)
        inside = bool(contains(self.geometry, 0, local[None])[0])
        away = at.rotation[self.b] @ (local - (_from_inside(self.geometry, local, out[3:6]) if inside else out[3:6]))
        d = float(np.linalg.norm(away)) * (-1.0 if inside else 1.0)
        n = away / d if d != 0.0 else away
        c_b = p - at.position[self.b]
        motion = np.concatenate([n @ levers(c), -n @ levers(c_b)])
        bodies = np.array([self.a, self.b])
        kept = np.repeat(bodies >= 0, 6)
        gradient, hessian = self.weight * d * motion, self.weight * np.outer(motion, motion)
        value = 0.5 * self.weight * d * d
        total.add(value, bodies[bodies >= 0], gradient[kept].reshape(-1, 6), hessian[np.ix_(kept, kept)])


def _from_inside(geometry: Geometry, p: np.ndarray, nearest: np.ndarray) -> np.ndarray:
    """Return the place (3,) m of the surface nearest to a point p inside: for cylinders, which the kernels take as full, it is found here."""
    for k in range(int(geometry.shape_first[0]), int(geometry.shape_first[1])):
        if geometry.kind[k] != CYLINDER:
            continue
        centre, axis, half = geometry.frame[k, :3], geometry.frame[k, 3:6], float(geometry.frame[k, 6])
        height = float((p - centre) @ axis)
        across = p - centre - height * axis
        off, radius = float(np.linalg.norm(across)), float(geometry.radius[k])
        if abs(height) > half or off > radius:
            continue
        if radius - off < half - abs(height) and off > 0.0:
            return p + (radius / off - 1.0) * across
        return p + (np.copysign(half, height) - height) * axis
    return nearest
