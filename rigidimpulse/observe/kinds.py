"""What the stage observe works on: a line of the plan for triggers."""

from __future__ import annotations

from dataclasses import dataclass

from rigidimpulse.plan import Bound, Skip


@dataclass(frozen=True)
class TriggerVolumes:
    """Volumes that report overlap."""

    stage: str = "observe"
    name: str = "triggers"

    def bind(self, world) -> Bound | Skip:
        """In where the scene has one."""
        number = len(triggers_of(world))
        return Bound(None, f"{number} looked at after every step") if number else Skip("the scene has none")


def triggers_of(world) -> list:
    """The triggers of a scene that are not left out."""
    if "triggers" in world.left_out:
        return []
    return [effect for effect in world.scene.effects if effect.stage == "observe"]


def bind_triggers(context, plan) -> None:
    """Give a run its triggers, if the scene has any."""
    found = triggers_of(context.world)
    if found:
        from rigidimpulse.observe.trigger import Triggers

        with plan.clock(TriggerVolumes.name):
            context.triggers = Triggers(context, found)
