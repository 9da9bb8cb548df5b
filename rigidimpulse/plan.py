"""The plan: which effects a scene calls for, bound to it, in the order of the loop.

An effect is a frozen dataclass of settings with a `stage` and `bind(world) -> function | Skip(reason)`. What is
skipped is not in the plan: it costs nothing, and `explain` says why.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from time import perf_counter
from typing import Protocol

STAGES = ("detect", "respond", "forces", "constrain", "sweep", "integrate", "observe")


@dataclass(frozen=True)
class Skip:
    """Why an effect is left out."""

    reason: str


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


class Plan:
    """The bound effects of a run. Call a stage by its name: `plan.respond(...)` runs all its effects in order."""

    def __init__(self, world, effects: Sequence[Effect]) -> None:
        """Bind the effects to a world."""
        self.lines: list[Line] = []
        self._stages: dict[str, list[tuple[Callable, Line]]] = {stage: [] for stage in STAGES}
        for effect in effects:
            bound = effect.bind(world)
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
