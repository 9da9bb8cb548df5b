"""Effects: what a scene may call for, and how each takes part in a step.

An effect is a frozen dataclass of settings with a `stage`, a `name` and `bind(world)`. It is asked once, when the scene is compiled. Either
the scene calls for it: then it is `Bound` to the verbs of the loop that it takes part in. Or it does not: then it is a `Skip` with a
reason, is in no list, is not run, not imported and not compiled.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol

STAGES = ("detect", "respond", "forces", "constrain", "sweep", "integrate", "observe")
"""The stages of a step, in the order in which the state of a body meets them."""
VERBS = ("pairs", "time_of_impact", "impacts", "loads", "contact_forces", "trajectories", "observe")
"""What a step does, in order (`engine/step.py`). The two regimes of islands have impacts, loads, contact forces and trajectories each."""
EXACT, SUBSTEPPED = "exact", "substepped"
"""The two regimes: from event to event, and by sub-steps."""


@dataclass(frozen=True)
class Skip:
    """Why an effect is out, and how it would take part if it were in all the same."""

    reason: str
    verbs: Mapping[str, Callable[..., Any]] | None = None


@dataclass(frozen=True)
class Bound:
    """An effect that is in.

    Attributes:
        reason: why.
        verbs: functions by verb. "contact_forces" is of both regimes, "exact.contact_forces" of one. Empty: other effects call it.

    """

    reason: str
    verbs: Mapping[str, Callable[..., Any]] = field(default_factory=dict)


class Effect(Protocol):
    """One effect of one stage."""

    @property
    def stage(self) -> str:
        """One of STAGES."""
        ...

    @property
    def name(self) -> str:
        """What `explain` calls it."""
        ...

    def bind(self, world: Any) -> Bound | Skip:
        """Look at the compiled world once; say why the effect is in and what it does, or why it is out."""
        ...


@dataclass
class Line:
    """One line of `explain`: an effect, whether it is in and why, the time it took [s], how often it was called, and what it counted."""

    stage: str
    name: str
    included: bool
    reason: str
    seconds: float = 0.0
    calls: int = 0
    counts: dict[str, int] = field(default_factory=dict)
