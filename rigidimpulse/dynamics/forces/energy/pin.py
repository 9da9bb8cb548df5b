"""Two points together.

    V = k |r|^2 / 2,    r = p_b - p_a,    p = x + R c,    force on b  -k r  at p_b

With k = inf the points meet exactly at the minimum of all else: V = l.r + k |r|^2 / 2 is minimised again and again with l <- l + k r
(method of multipliers: M. Hestenes, J. Optim. Theory Appl. 4, 1969); l is then the force that holds them together.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from rigidimpulse.core.errors import SceneError
from rigidimpulse.dynamics.forces.energy.term import Expansion, Poses, body_index, body_point, levers, positive, turning
from rigidimpulse.model.world import World
from rigidimpulse.scene.body import vector


@dataclass(frozen=True, eq=False)
class PinPoints:
    """Pins a point of body a and a point of body b together: V = k |p_b - p_a|^2 / 2.

    Checked when it is used: a `SceneError` names an unknown body, two equal ones, anchors that are not three finite numbers, a weight
    that is not positive.

    Attributes:
        a, b: names of bodies; None is the world.
        anchor_a, anchor_b: (3,) m, the points, in world coordinates where the bodies are in the scene given.
        weight: k, N/m; inf, the default, lets the points meet exactly, whatever else acts.

    Source: Witkin, Fleischer, Barr 1987, attachment of points.

    """

    a: str | None
    b: str | None
    anchor_a: ArrayLike
    anchor_b: ArrayLike
    weight: float = math.inf

    def compile(self, world: World) -> CompiledPin:
        """Bind the pin to a compiled scene."""
        where = f"PinPoints({self.a!r}, {self.b!r})"
        bodies = [body_index(world, name, where) for name in (self.a, self.b)]
        if bodies[0] == bodies[1]:
            raise SceneError("both points belong to the same body", "name two bodies, or one and None, the world", where)
        try:
            anchors = vector(self.anchor_a, "anchor_a", "m"), vector(self.anchor_b, "anchor_b", "m")
        except SceneError as error:
            raise error.within(where) from None
        hard = self.weight == math.inf
        stiffness = 1.0 if hard else positive(self.weight, "weight", "N/m", where)
        arms = [body_point(world, body, anchor) for body, anchor in zip(bodies, anchors, strict=True)]
        return CompiledPin(where, hard, tuple(bodies), tuple(arms), stiffness)


@dataclass(eq=False)
class CompiledPin:
    """A pin of two bodies, -1 for the world; stiffness k and multiplier l as at the head of the module."""

    name: str
    hard: bool
    bodies: tuple[int, ...]
    arms: tuple[np.ndarray, ...]
    stiffness: float
    multiplier: np.ndarray = field(default_factory=lambda: np.zeros(3))

    def _point(self, at: Poses, side: int) -> tuple[np.ndarray, np.ndarray]:
        """Return the arm from the centre of mass and the place (3,) m of a point."""
        body, arm = self.bodies[side], self.arms[side]
        if body < 0:
            return np.zeros(3), arm
        turned = at.rotation[body] @ arm
        return turned, at.position[body] + turned

    def apart(self, at: Poses) -> np.ndarray:
        """Return r (3,) m."""
        return self._point(at, 1)[1] - self._point(at, 0)[1]

    def expand(self, at: Poses, total: Expansion) -> None:
        """Add the pin to a sum."""
        (c_a, p_a), (c_b, p_b) = self._point(at, 0), self._point(at, 1)
        r = p_b - p_a
        f = self.stiffness * r + self.multiplier
        motion = np.concatenate([-levers(c_a), levers(c_b)], axis=1)
        hessian = self.stiffness * motion.T @ motion
        hessian[3:6, 3:6] -= turning(c_a, f)
        hessian[9:, 9:] += turning(c_b, f)
        kept = np.repeat(np.array(self.bodies) >= 0, 6)
        bodies = np.array([body for body in self.bodies if body >= 0])
        value = float(self.multiplier @ r + 0.5 * self.stiffness * (r @ r))
        total.add(value, bodies, (f @ motion)[kept].reshape(-1, 6), hessian[np.ix_(kept, kept)])
