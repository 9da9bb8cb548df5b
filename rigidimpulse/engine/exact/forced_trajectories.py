"""The stage integrate where forces vary: courses follow lines of force (see `force_step`)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rigidimpulse.engine.exact.trajectories import integrate
from rigidimpulse.engine.islands import Island
from rigidimpulse.engine.plan import Bound, Skip

WHOLE = 1.0 - 1e-9
"""Part of the rest of a step that counts as all of it."""


@dataclass(frozen=True)
class VaryingLoad:
    """Marks the groups that varying forces act on."""

    stage: str = "forces"
    name: str = "varying load"

    def bind(self, world) -> Bound | Skip:
        """In where a force varies."""
        if not world.force_tables:
            return Skip("no force varies")
        return Bound(note_free, "where contacts or joints hold bodies it is constant over a sub-step")


@dataclass(frozen=True)
class ForcedFlight:
    """Steps of order 4 where nothing holds bodies; forces of the middle of the sub-step where contacts or joints do."""

    stage: str = "integrate"
    name: str = "forced flight"

    def bind(self, world) -> Bound | Skip:
        """In where a force varies."""
        if not world.force_tables:
            return Skip("no force varies")
        if world.accuracy.integrator != "exact":
            return Bound(integrate_forced, f"{world.accuracy.integrator}: steps of the accuracy's length, whatever their error")
        impacts = "; impacts are exact on them" if world.can_collide else ""
        return Bound(integrate_forced, f"steps of order 4, as long as their error allows{impacts}")


def note_free(run, _window, island: Island) -> None:
    """Keep the members' accelerations without varying forces, if these act on one of them."""
    if run.forces.acts[island.members].any():
        island.free = run.acceleration[island.members], run.angular_acceleration[island.members]


def integrate_forced(run, pair_events, island: Island) -> None:
    """Give new courses to members, under varying forces where they feel them."""
    if island.free is not None and not island.loaded:
        members = island.members[run.forces.acts[island.members]]
        h = run.forces.fly(run, members, island.time, pair_events.end)
        pair_events.wake[members] = np.where(h < (pair_events.end - island.time) * WHOLE, island.time + h, np.inf)
    integrate(run, pair_events, island)
