"""What the stage constrain works on, each a line of the plan: joints, friction, rolling friction, heaps."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rigidimpulse.engine.plan import Bound, Skip
from rigidimpulse.engine.regime import MANY, only_expensive, why_not_substepped


@dataclass(frozen=True)
class JointRows:
    """Rows of joints."""

    stage: str = "constrain"
    name: str = "joints"

    def bind(self, world) -> Bound | Skip:
        """In where the scene has joints."""
        if not world.joints_of_scene:
            return Skip("the scene has none")
        return Bound(None, ", ".join(dict.fromkeys(type(joint).__name__ for joint in world.joints_of_scene)))


@dataclass(frozen=True)
class Friction:
    """Tangential rows of contacts, and tangential impulses."""

    stage: str = "constrain"
    name: str = "friction"

    def bind(self, world) -> Bound | Skip:
        """In where a pair of materials that may meet has a coefficient."""
        if not world.can_collide:
            return Skip("nothing can collide")
        greatest = float(world.coefficients[:, :, 1:3].max())
        return Bound(None, f"coefficients up to {greatest:g}") if greatest > 0.0 else Skip("no pair of materials has a coefficient")


@dataclass(frozen=True)
class RollingFriction:
    """Rows of moments at contacts."""

    stage: str = "constrain"
    name: str = "rolling friction"

    def bind(self, world) -> Bound | Skip:
        """In where a pair of materials has a length."""
        if world.rolling is None or not world.can_collide:
            return Skip("no material asks for it")
        return Bound(None, f"lengths up to {float(np.max(world.rolling)):g} m")


@dataclass(frozen=True)
class SubsteppedContact:
    """Contact inside heaps."""

    stage: str = "constrain"
    name: str = "sub-stepped islands"

    def bind(self, world) -> Bound | Skip:
        """In where heaps are possible; the reason is told anew when the run is over."""
        reason = why_not_substepped(world)
        if reason:
            return Skip(reason)
        when = f"once exact contact gets dear: fewer than {MANY} bodies" if only_expensive(world) else "bodies may heap up"
        return Bound(step_substepped, f"sub-stepped: {when}")


def step_substepped(run, pair_events, island) -> None:
    """Step the heap of a group to the end of the window."""
    if island.substepped is not None:
        run.substepped.step(run, pair_events, island)
