"""The kinds of force that vary: a line of the plan each, in or out."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

from rigidimpulse.dynamics.forces import KINDS
from rigidimpulse.model.effect import Bound, Skip


@dataclass(frozen=True)
class KindOfForce:
    """All forces of one class; they are evaluated where bodies move."""

    name: str
    stage: str = "forces"

    def bind(self, world) -> Bound | Skip:
        """In where the scene has one."""
        for table in world.force_tables:
            if table.kind == self.name:
                return Bound(None, table.reason)
        return Skip("the scene has none")


def force_kinds(world) -> list[KindOfForce]:
    """The kinds there are, and those of the scene that are not among them."""
    names = [*KINDS.values(), *(table.kind for table in world.force_tables)]
    return [KindOfForce(name) for name in dict.fromkeys(names)]


def bind_forces(context, plan, times) -> None:
    """Give a run its varying forces, if the scene has any."""
    world = context.world
    if world.force_tables:
        from rigidimpulse.dynamics.forces.varying import VaryingForces

        clocks = {table.kind: partial(plan.clock, table.kind) for table in world.force_tables}
        context.forces = VaryingForces(world, context.state.trajectory, times, clocks)
        soft_bodies = [table for table in world.force_tables if table.kind == KINDS["FlexibleBody"]]
        if soft_bodies:
            from rigidimpulse.dynamics.soft_body.in_run import RunningSoftBodies

            context.soft_bodies = RunningSoftBodies(context, soft_bodies[0], times, clocks[soft_bodies[0].kind])
