"""The stage detect: which pairs may meet in a step."""

from __future__ import annotations

from dataclasses import dataclass

from rigidimpulse.engine.plan import Bound, Skip


@dataclass(frozen=True)
class BroadPhase:
    """Pairs of overlapping swept boxes; manifolds are looked for among them."""

    stage: str = "detect"
    name: str = "contact detection"

    def bind(self, world) -> Bound | Skip:
        """In where a dynamic body may meet another."""
        if not world.can_collide:
            springs = world.accuracy.response == "penalty"
            return Skip(world.why_no_impacts if springs else "a dynamic body and another are needed for contact")

        def detect(run, pair_events) -> None:
            if run.substepped is not None:
                run.substepped.gather(run, pair_events)
            pair_events.find_pairs()

        return Bound(detect, f"{world.num_bodies} bodies may touch")
