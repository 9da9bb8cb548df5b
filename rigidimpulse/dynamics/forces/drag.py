"""Drag of what a scene is filled with.

    F = -(c1 + c2 |v|) v    at the centre of mass

From v0 on, without other forces: c2 = 0: v = v0 exp(-c1 t / m); c1 = 0: v = v0 / (1 + c2 v0 t / m). Falling, the speed tends to the root of
c1 v + c2 v^2 = m g.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np

from rigidimpulse.core.errors import SceneError
from rigidimpulse.dynamics.forces.force import Force, ForceTable, Instant, checked_number, dynamic_bodies, named, no_links
from rigidimpulse.model.world import World


@dataclass(frozen=True, eq=False)
class Drag(Force):
    """Drag on bodies: -(linear + quadratic |v|) v, without torque.

    Checked when the scene is compiled: a `SceneError` names bodies that are unknown or not dynamic, and coefficients that are negative,
    not finite, or both zero.

    Attributes:
        linear: c1, N s/m. quadratic: c2, N s2/m2: half of density, frontal area and drag coefficient.
        bodies: names; None: all dynamic bodies.
        name: what the ledger calls it; None: "drag".

    """

    linear: float = 0.0
    quadratic: float = 0.0
    bodies: Sequence[str] | None = None
    name: str | None = None
    kind: ClassVar[str] = "drag"

    @classmethod
    def compile(cls, forces: Sequence[Self], world: World) -> DragForces:
        """Check and bind all drags."""
        body, cause, linear, quadratic = [], [], [], []
        for k, force in enumerate(forces):
            where = f"Drag({force.linear!r}, {force.quadratic!r})"
            c1 = checked_number(force.linear, "linear", "N s/m", where, least=0.0)
            c2 = checked_number(force.quadratic, "quadratic", "N s2/m2", where, least=0.0)
            if c1 == c2 == 0.0:
                raise SceneError("both coefficients are 0", "give one that is not, or leave the drag out", where)
            for i in dynamic_bodies(world, force.bodies, where).tolist():
                body.append(i)
                cause.append(k)
                linear.append(c1)
                quadratic.append(c2)
        names = named(cls.kind, [f.name for f in forces], ["drag"] * len(forces))
        return DragForces(names, np.array(body, np.int64), np.array(cause, np.int64), np.array(linear), np.array(quadratic))


class DragForces(ForceTable):
    """Drags, one row for each body of each."""

    def __init__(self, names: list[str], body: np.ndarray, cause: np.ndarray, linear: np.ndarray, quadratic: np.ndarray) -> None:
        """All (k,)."""
        self.kind, self.names, self.body, self.cause = Drag.kind, names, body, cause
        self.links, self.is_steady = no_links(), True
        self.reason = f"on {len(np.unique(body))} bodies"
        self._linear, self._quadratic = linear, quadratic

    def wrench(self, at: Instant, rows: np.ndarray) -> np.ndarray:
        """Force of rows."""
        v = at.bodies.velocity[self.body[rows]]
        strength = self._linear[rows] + self._quadratic[rows] * np.linalg.norm(v, axis=1)
        return np.hstack([-strength[:, None] * v, np.zeros((len(rows), 3))])
