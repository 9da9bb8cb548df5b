"""The plan: which effects a scene calls for, bound to it, in the order of the loop.

An effect is a frozen dataclass of settings with a `stage` and `bind(world) -> function | Skip(reason)`. What is
skipped is not in the plan: it costs nothing, and `explain` says why.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from time import perf_counter
from typing import Protocol

from rigidimpulse.core.errors import SceneError
from rigidimpulse.scene.stages import STAGES

NEEDED = ("steady load", "varying load", "contact forces", "impact time", "exact flight", "forced flight")
"""Effects that the loop cannot do without where they are in: bodies would not move, or hit each other without end."""


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


def _as_chosen(bound: Bound | Skip, name: str, wanted: bool | None) -> Bound | Skip:
    """What `bind` said, or what the caller wants."""
    if wanted is False and isinstance(bound, Bound):
        if name in NEEDED:
            raise SceneError(f"effects: {name!r} cannot be out: {bound.reason}", "leave out 'contact detection', or what it works for")
        return Skip(f"left out by the caller; {bound.reason}")
    if wanted is True and isinstance(bound, Skip):
        if bound.function is None:
            raise SceneError(f"effects: {name!r} cannot be in: {bound.reason}", "give the scene what it needs, or leave it out")
        return Bound(bound.function, f"wanted by the caller; {bound.reason}")
    return bound


class Plan:
    """The bound effects of a run. Call a stage by its name: `plan.respond(...)` runs all its effects in order."""

    def __init__(self, world, effects: Sequence[Effect], chosen: Mapping[str, bool] | None = None) -> None:
        """Bind the effects to a world; chosen: names of effects that are to be in or out whatever the scene calls for.

        Raises:
            SceneError: an effect that is to be in has nothing to work on, or one that is to be out cannot be spared.

        """
        chosen = chosen or {}
        self.lines: list[Line] = []
        self._stages: dict[str, list[tuple[Callable, Line]]] = {stage: [] for stage in STAGES}
        for effect in effects:
            bound = _as_chosen(effect.bind(world), effect.name, chosen.get(effect.name))
            line = Line(effect.stage, effect.name, isinstance(bound, Bound), bound.reason)
            self.lines.append(line)
            if isinstance(bound, Bound) and bound.function is not None:
                self._stages[effect.stage].append((bound.function, line))
        self._inner = 0.0
        self.steps = bool(self._stages["detect"] or self._stages["constrain"])

    def run(self, stage: str, *arguments) -> None:
        """Run a stage's effects in order, adding up their time."""
        for function, line in self._stages[stage]:
            start, inner = perf_counter(), self._inner
            function(*arguments)
            line.seconds += perf_counter() - start - (self._inner - inner)
            line.calls += 1

    @contextmanager
    def clock(self, name: str) -> Iterator[None]:
        """Give the time spent inside to the effect of a name, and not to the one that runs."""
        start = perf_counter()
        yield
        spent = perf_counter() - start
        line = next(line for line in self.lines if line.name == name)
        line.seconds += spent
        line.calls += 1
        self._inner += spent

    def tell(self, name: str, reason: str) -> None:
        """Say of an effect what it did in the run, in the place of why it is in."""
        for line in self.lines:
            if line.name == name:
                line.reason = reason

    def explain(self) -> str:
        """Return a table: stage, effect, in or out, share of the time so far, why."""
        total = sum(line.seconds for line in self.lines)
        rows = [("stage", "effect", "in", "time", "why")]
        for line in sorted(self.lines, key=lambda entry: STAGES.index(entry.stage)):
            share = f"{100.0 * line.seconds / total:.0f} %" if total > 0.0 and line.included else "-"
            rows.append((line.stage, line.name, "in" if line.included else "out", share, line.reason))
        widths = [max(len(row[k]) for row in rows) for k in range(4)]
        return "\n".join(
            "  ".join([*(cell.ljust(width) for cell, width in zip(row, widths)), row[4]]).rstrip() for row in rows
        )
