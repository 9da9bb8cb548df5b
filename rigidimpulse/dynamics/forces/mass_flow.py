"""Bodies that lose mass.

    m(t) = m_0 - integral of the flows

The mass is lost evenly all over the body: its centre stays, moments of inertia are in proportion, and what leaves has the velocity of its
place, so that it exerts nothing but the thrust. A centre of mass that moves is that of several bodies held by fixed joints, of which the
tank loses mass.
"""

from __future__ import annotations

from abc import abstractmethod

import numpy as np

from rigidimpulse.dynamics.forces.force import ForceTable
from rigidimpulse.model.world import World
from rigidimpulse.motion.trajectory import Trajectories


class BurningForces(ForceTable):
    """Forces that take mass from their bodies."""

    burns = True

    @abstractmethod
    def burnt(self, times: np.ndarray) -> np.ndarray:
        """Mass that each row has taken from its body until `times` (..., k), kg."""


class MassFlow:
    """Masses of the bodies of a run, brought up to date when a body is looked at."""

    def __init__(self, tables: list[BurningForces], world: World, trajectory: Trajectories) -> None:
        """Of forces that take mass."""
        self._tables, self._world, self._trajectory = tables, world, trajectory
        self.bodies = np.unique(np.concatenate([table.body for table in tables]))
        self._mass, self._inertia = world.mass.copy(), world.inertia.copy()
        self._weighed = np.ones(len(world.mass))

    def share(self, times: np.ndarray) -> np.ndarray:
        """Part of the mass of each body that is left at times (..., n): (..., n)."""
        left = np.ones(times.shape)
        for table in self._tables:
            for row, taken in zip(table.body, np.moveaxis(table.burnt(times[..., table.body]), -1, 0), strict=True):
                left[..., row] -= taken / self._mass[row]
        return left

    def since_weighed(self, time: np.ndarray) -> np.ndarray:
        """Mass in use over that at time (n,), of n bodies."""
        return self._weighed / self.share(time)

    def shares_at(self, times: np.ndarray) -> np.ndarray:
        """Mass at times (f,) over that in use, (f, n)."""
        return self.share(np.repeat(times[:, None], len(self._mass), axis=1)) / self._weighed

    def weigh(self, members: np.ndarray, time: float) -> None:
        """Give the members the mass and the inertia of `time`."""
        losing = np.intersect1d(members, self.bodies)
        if len(losing):
            share = self.share(np.full(len(self._mass), time))[losing]
            self._weighed[losing] = share
            self._world.mass[losing] = share * self._mass[losing]
            # What is held until its release gives way to nothing, whatever its mass.
            self._world.inv_mass[losing] = np.where(self._world.dynamic[losing], 1.0 / self._world.mass[losing], 0.0)
            self._trajectory.inertia[losing] = self._world.inertia[losing] = share[:, None] * self._inertia[losing]
