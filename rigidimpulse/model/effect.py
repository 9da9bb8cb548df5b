"""What an effect of a scene is: whether the scene calls for it, why, and what `explain` prints about it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol


@dataclass(frozen=True)
class Skip:
    """Why an effect is out, and the function of its stage if it could be in all the same."""

    reason: str
    function: Callable | None = None


@dataclass(frozen=True)
class Bound:
    """An effect that is in: the function of its stage (None: others call it, by its clock), and why it is in."""

    function: Callable | None
    reason: str


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

    def bind(self, world) -> Bound | Skip:
        """Look at the compiled world once; return the function for the stage, or why there is none."""
        ...


@dataclass
class Line:
    """One line of `explain`."""

    stage: str
    name: str
    included: bool
    reason: str
    seconds: float = 0.0
    calls: int = 0
