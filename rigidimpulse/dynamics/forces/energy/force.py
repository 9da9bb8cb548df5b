"""Energy terms as forces in a run: the force is minus the gradient of the term.

    F_i = -dV/dx_i,   tau_i = -dV/dtheta_i,    ledger: V is potential energy
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np

from rigidimpulse.core.errors import SceneError
from rigidimpulse.core.quaternion import to_matrix
from rigidimpulse.dynamics.forces.energy.potential import GravityPotential
from rigidimpulse.dynamics.forces.energy.term import CompiledEnergy, Energy, Expansion, Poses, poses
from rigidimpulse.dynamics.forces.force import Force, ForceTable, Instant, named
from rigidimpulse.model.world import World


@dataclass(frozen=True, eq=False)
class EnergyForce(Force):
    """The force of an energy term on the poses of bodies: `PinPoints`, `PointOnSurface`, `RestoreShape`, `NoOverlap`.

    The same terms are minimised by `settle`. All bodies of a term move together in steps that follow its stiffness. `Drag` takes the energy
    out that a term keeps.

    Checked when the scene is compiled: a `SceneError` says what is wrong with the term, and refuses an infinite weight, which no force is.

    Attributes:
        term: what to minimise.
        name: what the ledger calls it; None: that of the term's class.

    """

    term: Energy
    name: str | None = None
    kind: ClassVar[str] = "energy terms"

    @classmethod
    def compile(cls, forces: Sequence[Self], world: World) -> EnergyForces:
        """Check and bind all terms."""
        terms = []
        for force in forces:
            if not callable(getattr(force.term, "compile", None)):
                raise SceneError(f"term is {force.term!r}", "give an energy term, such as ri.PinPoints(...)", "EnergyForce")
            if isinstance(force.term, GravityPotential):
                raise SceneError("GravityPotential acts in every run already", "leave it out", "EnergyForce")
            if getattr(force.term, "weight", 1.0) == math.inf:
                raise SceneError(f"the weight of {force.term!r} is infinite", "give a finite weight, or use a joint", "EnergyForce")
            terms.append(force.term.compile(world))
        names = named(cls.kind, [f.name for f in forces], [type(f.term).__name__ for f in forces])
        return EnergyForces(names, terms, world)


class EnergyForces(ForceTable):
    """Terms: a row for each dynamic body of each."""

    def __init__(self, names: list[str], terms: list[CompiledEnergy], world: World) -> None:
        """Compiled terms of a scene."""
        self.kind, self.names = EnergyForce.kind, names
        bodies = [i[(i >= 0) & world.dynamic[i]] for i in map(_bodies_of, terms)]
        self.body = np.concatenate(bodies)
        self.cause = np.repeat(np.arange(len(terms)), [len(i) for i in bodies])
        self.links = np.array([(i[0], j) for i in bodies for j in i[1:]], np.int64).reshape(-1, 2)
        everything = np.concatenate([_bodies_of(term) for term in terms])
        self._carried = np.unique(everything[(everything >= 0) & world.moving[everything]])
        self.is_steady = not len(self._carried)
        self.reason = f"{len(terms)} acting"
        self._terms, self._start = terms, poses(world.position, world.orientation)

    def wrench(self, at: Instant, rows: np.ndarray) -> np.ndarray:
        """Force and torque of rows."""
        wrench = np.zeros((len(rows), 6))
        for k in np.unique(self.cause[rows]).tolist():
            these = np.flatnonzero(self.cause[rows] == k)
            i = self.body[rows[these]]
            total = Expansion(len(at.time))
            self._terms[k].expand(self._poses(at, float(at.time[i[0]])), total)
            wrench[these] = -total.gradient[i]
        return wrench

    def _poses(self, at: Instant, time: float) -> Poses:
        """Poses of all bodies: those that forces move are at theirs, the others on their trajectories."""
        position, orientation, rotation = (values.copy() for values in self._start)
        i = self.body
        position[i], orientation[i], rotation[i] = at.bodies.position[i], at.bodies.orientation[i], at.rotation[i]
        for i in self._carried.tolist():
            position[i], orientation[i] = at.carried_pose(i, time)
            rotation[i] = to_matrix(orientation[i])
        return Poses(position, orientation, rotation)

    def potential(self, times: np.ndarray, position: np.ndarray, orientation: np.ndarray) -> np.ndarray:
        """Value of each term (f, terms)."""
        values = np.empty((len(times), len(self._terms)))
        for f in range(len(times)):
            where = poses(position[f], orientation[f])
            for k, term in enumerate(self._terms):
                total = Expansion(position.shape[1])
                term.expand(where, total)
                values[f, k] = total.value
        return values


def _bodies_of(term: CompiledEnergy) -> np.ndarray:
    """Bodies (b,) on which a term depends, -1 for the world."""
    for names in (("bodies",), ("pairs",), ("a", "b")):
        if all(hasattr(term, name) for name in names):
            return np.unique(np.concatenate([np.ravel(getattr(term, name)) for name in names])).astype(np.int64)
    raise SceneError(f"{type(term).__name__} is no term on poses of bodies", "give PinPoints, PointOnSurface, RestoreShape or NoOverlap")
