"""A point of one body on the surface of another.

    V = k d^2 / 2,    d(p) the signed distance of the point p from the surface, negative inside,    force on a  -k d n  at p

n is the direction from the nearest place of the surface, where b gets the opposite force. V is smooth but at points that have several
nearest places, in the middle of the solid. The second derivatives leave out how n turns.
Source: Witkin, Fleischer, Barr 1987, attachment to an implicit surface.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from rigidimpulse.collision.containment import points_inside
from rigidimpulse.collision.geometry import CYLINDER, ROUND, CompiledShape, Geometry, Primitive, build_geometry
from rigidimpulse.collision.manifold.dispatch import Posed, pair_gap
from rigidimpulse.core.errors import SceneError
from rigidimpulse.dynamics.forces.energy.term import Expansion, Poses, body_index, body_point, levers, positive
from rigidimpulse.model.world import World
from rigidimpulse.scene.body import vector

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
        parts = world.shapes[int(world.shape_of_body[b])].primitives
        geometries = [build_geometry([CompiledShape((part,)), _POINT]) for part in parts]
        return CompiledSurfacePoint(a, b, body_point(world, a, anchor), weight, geometries)


@dataclass(frozen=True, eq=False)
class CompiledSurfacePoint:
    """A point at `arm` (3,) m of body a (-1: the world) and body b; each part of b is shape 0 of a geometry whose shape 1 is a point."""

    a: int
    b: int
    arm: np.ndarray
    weight: float
    geometries: list[Geometry]

    def expand(self, at: Poses, total: Expansion) -> None:
        """Add the term to a sum."""
        c = at.rotation[self.a] @ self.arm if self.a >= 0 else np.zeros(3)
        p = at.position[self.a] + c if self.a >= 0 else self.arm
        local = (p - at.position[self.b]) @ at.rotation[self.b]
        # Of parts that overlap the least distance counts: it is 0 on the surface of all together, and not on what is inside.
        d, away = min((_distance(geometry, local) for geometry in self.geometries), key=lambda found: found[0])
        n = at.rotation[self.b] @ (away / d if d != 0.0 else away)
        c_b = p - at.position[self.b]
        motion = np.concatenate([n @ levers(c), -n @ levers(c_b)])
        bodies = np.array([self.a, self.b])
        kept = np.repeat(bodies >= 0, 6)
        gradient, hessian = self.weight * d * motion, self.weight * np.outer(motion, motion)
        value = 0.5 * self.weight * d * d
        total.add(value, bodies[bodies >= 0], gradient[kept].reshape(-1, 6), hessian[np.ix_(kept, kept)])


def _distance(geometry: Geometry, p: np.ndarray) -> tuple[float, np.ndarray]:
    """Return the signed distance of a point p (3,) m from shape 0, and the way (3,) m to it from the nearest place of the surface."""
    out = np.zeros(7)
    pair_gap(geometry, Posed(1, p, np.eye(3)), Posed(0, np.zeros(3), np.eye(3)), np.inf, out)
    if not points_inside(geometry, 0, p[None])[0]:
        away = p - out[3:6]
        return float(np.linalg.norm(away)), away
    away = -_way_out_of_cylinder(geometry, p) if geometry.kind[0] == CYLINDER else p - out[3:6]
    return -float(np.linalg.norm(away)), away


def _way_out_of_cylinder(geometry: Geometry, p: np.ndarray) -> np.ndarray:
    """Return the way (3,) m from a point p in a cylinder to its surface; the kernels take it as full."""
    centre, axis, half = geometry.frame[0, :3], geometry.frame[0, 3:6], float(geometry.frame[0, 6])
    height = float((p - centre) @ axis)
    across = p - centre - height * axis
    off, radius = float(np.linalg.norm(across)), float(geometry.radius[0])
    if radius - off < half - abs(height) and off > 0.0:
        return (radius / off - 1.0) * across
    return (np.copysign(half, height) - height) * axis
