"""A force of its own: F = q v x B on a body of charge q in a uniform magnetic field B."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np

from rigidimpulse.core.vector import cross_arrays
from rigidimpulse.dynamics.forces.force import Force, ForceTable, Instant, checked_vector, dynamic_body, named, no_links
from rigidimpulse.model.world import World


@dataclass(frozen=True, eq=False)
class MagneticForce(Force):
    """The force of a magnetic field on a charged body, at its centre of mass.

    Attributes:
        body: name of the body. strength: (3,) kg/s, its charge times the field.

    """

    body: str
    strength: tuple[float, float, float]
    kind: ClassVar[str] = "magnetic forces"

    @classmethod
    def compile(cls, forces: Sequence[Self], world: World) -> MagneticForces:
        """Check and bind all of them."""
        body = [dynamic_body(world, force.body, "MagneticForce") for force in forces]
        strength = [checked_vector(force.strength, "strength", "kg/s", "MagneticForce") for force in forces]
        names = named(cls.kind, [None] * len(forces), [f"magnetic force on {force.body}" for force in forces])
        return MagneticForces(names, np.array(body), np.array(strength))


class MagneticForces(ForceTable):
    """One row for each force."""

    kind = MagneticForce.kind
    is_steady = True
    reason = "charges in a magnetic field"

    def __init__(self, names: list[str], body: np.ndarray, strength: np.ndarray) -> None:
        """body (k,), strength (k, 3) kg/s."""
        self.names, self.body, self.cause, self.links = names, body, np.arange(len(body)), no_links()
        self._strength = strength

    def wrench(self, at: Instant, rows: np.ndarray) -> np.ndarray:
        """Force of rows."""
        force = cross_arrays(at.bodies.velocity[self.body[rows]], self._strength[rows])
        return np.hstack([force, np.zeros_like(force)])
