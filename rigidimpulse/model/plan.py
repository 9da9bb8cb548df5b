"""The plan: which effects a scene calls for, bound to it, as the lists that a step goes through.

Every effect there is gets a line, in or out, with the reason (`explain`). The functions of those that are in stand in lists by verb, in the
order of the effects; a step performs the lists (`engine/step.py`). What is out is in no list and costs nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from time import perf_counter
from typing import Any

from rigidimpulse.core.errors import SceneError
from rigidimpulse.core.providers import provider
from rigidimpulse.model.effect import EXACT, STAGES, SUBSTEPPED, VERBS, Bound, Effect, Line, Skip
from rigidimpulse.model.world import World

NEEDED = ("steady load", "varying load", "contact forces", "impact time", "exact flight", "forced flight")
"""Effects that the loop cannot do without where they are in: bodies would not move, or would hit each other without end."""

Participants = list[tuple[Callable[..., Any], Line]]
"""Functions that take part in a verb, each with the line of its effect."""


def _as_chosen(bound: Bound | Skip, name: str, wanted: bool | None) -> Bound | Skip:
    """What `bind` said, or what the caller wants."""
    if wanted is False and isinstance(bound, Bound):
        if name in NEEDED:
            raise SceneError(
                f"effects: {name!r} cannot be left out: {bound.reason}", "leave out 'contact detection', or the effects that need this one"
            )
        return Skip(f"left out by the caller; {bound.reason}")
    if wanted is True and isinstance(bound, Skip):
        if bound.verbs is None:
            raise SceneError(f"effects: {name!r} cannot be enabled: {bound.reason}", "add what it needs to the scene, or do not enable it")
        return Bound(f"wanted by the caller; {bound.reason}", bound.verbs)
    return bound


class Regime:
    """What one regime does with an island at an instant, by verb."""

    def __init__(self) -> None:
        """Nothing takes part yet."""
        self.impacts: Participants = []
        self.loads: Participants = []
        self.contact_forces: Participants = []
        self.trajectories: Participants = []


class Plan:
    """The bound effects of a run.

    Attributes:
        lines: of all effects, in or out.
        pairs, time_of_impact, observe: functions of a step. exact, substepped: those of an island, by its regime.
        forecast: what a run will cost, lines for people at the end of `explain`; empty if nobody asked.

    """

    def __init__(self, world: World, effects: Sequence[Effect], chosen: Mapping[str, bool] | None = None) -> None:
        """Bind the effects to a world; chosen: names of effects that the caller enables (True) or leaves out (False).

        Raises:
            SceneError: an effect cannot be enabled because the scene has nothing for it, or cannot be left out because the run needs it.

        """
        chosen = chosen or {}
        self.lines: list[Line] = []
        self.pairs: Participants = []
        self.time_of_impact: Participants = []
        self.observe: Participants = []
        self.exact, self.substepped = Regime(), Regime()
        for effect in effects:
            bound = _as_chosen(effect.bind(world), effect.name, chosen.get(effect.name))
            line = Line(effect.stage, effect.name, isinstance(bound, Bound), bound.reason)
            self.lines.append(line)
            if isinstance(bound, Bound):
                for verb, function in bound.verbs.items():
                    for participants in self._lists(verb):
                        participants.append((function, line))
        self.forecast = ""
        self._inner = 0.0

    def __repr__(self) -> str:
        """Return the number of effects, and the names of those that are in."""
        included = [line.name for line in self.lines if line.included]
        return f"Plan({len(included)} of {len(self.lines)} effects: {', '.join(included)})"

    def _repr_html_(self) -> str:
        """Return the table of `explain`, for a cell of a notebook."""
        return str(provider("cell of plan")(self))

    def _lists(self, verb: str) -> list[Participants]:
        """The lists of a verb: of both regimes where none is named."""
        regime, _, name = verb.rpartition(".")
        if name not in VERBS or regime not in ("", EXACT, SUBSTEPPED):
            raise ValueError(f"{verb!r} is no verb of a step; they are {', '.join(VERBS)}")
        if hasattr(self, name):
            return [getattr(self, name)]
        return [getattr(owner, name) for key, owner in ((EXACT, self.exact), (SUBSTEPPED, self.substepped)) if regime in ("", key)]

    @property
    def steps(self) -> bool:
        """Whether a step does anything that could change the trajectories of rigid bodies."""
        return bool(self.pairs or self.exact.loads or self.exact.contact_forces or self.observe)

    def line(self, name: str) -> Line:
        """The line of an effect; a KeyError says that there is no effect of that name."""
        for line in self.lines:
            if line.name == name:
                return line
        raise KeyError(name)

    def includes(self, name: str) -> bool:
        """Whether the effect of a name is in."""
        return any(line.included for line in self.lines if line.name == name)

    def perform(self, participants: Participants, *arguments: Any) -> None:
        """Call functions in their order, adding up the time of each."""
        for function, line in participants:
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
        line = self.line(name)
        line.seconds += spent
        line.calls += 1
        self._inner += spent

    def tell(self, name: str, reason: str, counts: Mapping[str, int]) -> None:
        """Say of an effect what it did in the run, in the place of why it is in, and what it counted."""
        line = self.line(name)
        line.reason, line.counts = reason, dict(counts)

    def explain(self) -> str:
        """Return a table: stage, effect, in or out, share of the time so far, why; then the forecast of the cost, if there is one."""
        total = sum(line.seconds for line in self.lines)
        rows = [("stage", "effect", "in", "time", "why")]
        for line in sorted(self.lines, key=lambda entry: STAGES.index(entry.stage)):
            share = f"{100.0 * line.seconds / total:.0f} %" if total > 0.0 and line.included else "-"
            rows.append((line.stage, line.name, "in" if line.included else "out", share, line.reason))
        widths = [max(len(row[k]) for row in rows) for k in range(4)]
        lines = ["  ".join([*(cell.ljust(width) for cell, width in zip(row, widths)), row[4]]).rstrip() for row in rows]
        return "\n".join([*lines, self.forecast] if self.forecast else lines)
