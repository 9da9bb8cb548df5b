"""Forces that are steady: uniform gravity, scaled by each body's gravity factor, and constant forces; and the gyroscopic term.

    a = factor g + sum F / m,    alpha = -I^-1 (w x I w)
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rigidimpulse.model.effect import Bound, Skip
from rigidimpulse.motion.evaluate import bring_gyroscopic


@dataclass(frozen=True)
class Gravity:
    """Uniform gravity; it is in all courses."""

    stage: str = "forces"
    name: str = "gravity"

    def bind(self, world) -> Bound | Skip:
        """In where a dynamic body feels it."""
        if not np.any(world.gravity):
            return Skip("no gravity, or no body feels it")
        return Bound(None, f"{np.linalg.norm(world.scene.gravity):.6g} m/s2")


@dataclass(frozen=True)
class SteadyLoad:
    """Accelerations of a group's bodies without contacts, joints and forces that vary, for those that add to them."""

    stage: str = "forces"
    name: str = "steady load"

    def bind(self, world) -> Bound | Skip:
        """In where something may add."""
        if not (world.can_collide or world.joints_of_scene or world.force_tables):
            return Skip("nothing can collide, no joints, no force varies")
        return Bound(set_steady, "what contacts, joints and other forces work against")


def set_steady(context, _window, island) -> None:
    """Gravity and constant forces."""
    context.acceleration[island.members] = context.world.steady_acceleration[island.members]
    context.angular_acceleration[island.members] = 0.0


@dataclass(frozen=True)
class FreeRotation:
    """Angular acceleration of torque-free bodies."""

    stage: str = "forces"
    name: str = "gyroscopic term"

    def bind(self, world) -> Bound | Skip:
        """In where contacts or joints may act on bodies whose moments of inertia differ."""
        if not world.can_collide and not world.joints_of_scene:
            return Skip(f"{world.why_no_impacts}; free rotation is in closed form", turn)
        moments = world.inertia[world.dynamic]
        if np.all(moments == moments[:, :1]):
            return Skip("all bodies have equal moments of inertia", turn)
        return Bound(turn, "spins change the load of contacts and joints")


def turn(context, _window, island) -> None:
    """Gyroscopic term of the members."""
    state = context.state
    bring_gyroscopic(island.members, state.now, state.rotation, state.trajectory.inertia, context.angular_acceleration)
