"""What the stage observe works on: a line of the plan for triggers."""

from __future__ import annotations

from dataclasses import dataclass

from rigidimpulse.engine.plan import Bound, Skip


@dataclass(frozen=True)
class TriggerVolumes:
    """Volumes that report overlap."""

    stage: str = "observe"
    name: str = "triggers"

    def bind(self, world) -> Bound | Skip:
        """In where the scene has one."""
        number = len(world.triggers)
        return Bound(None, f"{number} looked at after every step") if number else Skip("the scene has none")


def bind_triggers(run, plan) -> None:
    """Give a run its triggers, if the scene has any."""
    if run.world.triggers:
        from rigidimpulse.engine.triggers import Triggers

        with plan.clock(TriggerVolumes.name):
            run.triggers = Triggers(run, run.world.triggers)
