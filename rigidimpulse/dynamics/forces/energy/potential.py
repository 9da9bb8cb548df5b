"""Heights of masses.

    V = -sum of m (g + F / m).x,    force  m g + F

g with each body's gravity factor, F the constant forces of the scene: what `ledger.potential` of a run counts.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rigidimpulse.dynamics.forces.energy.term import Expansion, Poses
from rigidimpulse.model.world import World


@dataclass(frozen=True)
class GravityPotential:
    """Potential of the scene's gravity and constant forces on all dynamic bodies, J: V = -sum of m (g + F / m).x.

    Something must hold the bodies, or there is no minimum.
    """

    def compile(self, world: World) -> CompiledPotential:
        """Bind the potential to a compiled scene."""
        bodies = np.flatnonzero(world.dynamic)
        return CompiledPotential(bodies, world.mass[bodies, None] * world.steady_acceleration[bodies])


@dataclass(frozen=True, eq=False)
class CompiledPotential:
    """Forces (b, 3) N on bodies (b,)."""

    bodies: np.ndarray
    force: np.ndarray

    def expand(self, at: Poses, total: Expansion) -> None:
        """Add the potential to a sum."""
        gradient = np.concatenate([-self.force, np.zeros_like(self.force)], axis=1)
        total.add(-float(np.sum(self.force * at.position[self.bodies])), self.bodies, gradient)
