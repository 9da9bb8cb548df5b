"""Uniform gravity, scaled by each body's gravity factor: a = factor g."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rigidimpulse.detect.touching import bring_gyroscopic
from rigidimpulse.plan import Bound, Skip


@dataclass(frozen=True)
class Gravity:
    """Acceleration of gravity of the group's bodies."""

    stage: str = "forces"
    name: str = "gravity"

    def bind(self, world) -> Bound | Skip:
        """In where a dynamic body feels it."""
        if not np.any(world.gravity):
            return Skip("no gravity, or no body feels it")

        def gravity(context, group) -> None:
            context.acceleration[group.members] += world.gravity[group.members]

        return Bound(gravity, f"{np.linalg.norm(world.scene.gravity):.6g} m/s2")


@dataclass(frozen=True)
class FreeRotation:
    """Angular acceleration of torque-free bodies, and the clean slate that forces add to."""

    stage: str = "forces"
    name: str = "gyroscopic term"

    def bind(self, world) -> Bound | Skip:
        """In where contacts or joints may act on bodies whose moments of inertia differ."""
        if not world.can_collide and not world.joints_of_scene:
            return Skip(f"{world.why_no_impacts}; free rotation is in closed form")

        def free(context, group) -> None:
            context.acceleration[group.members] = 0.0
            state = context.state
            bring_gyroscopic(
                group.members, state.now, state.rotation, state.course.inertia, context.angular_acceleration
            )

        return Bound(free, "spins change the load of contacts and joints")
