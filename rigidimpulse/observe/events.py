"""Events of a run: the impacts table, and what else happened and when."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

IMPACT_DTYPE = np.dtype(
    [
        ("time", np.float64),
        ("body_a", np.int64),
        ("body_b", np.int64),
        ("point", np.float64, (3,)),
        ("normal", np.float64, (3,)),
        ("impulse", np.float64),
        ("tangent_impulse", np.float64, (3,)),
        ("approach_speed", np.float64),
        ("separation_speed", np.float64),
    ]
)
"""One row an impulse at a contact point: s, indices, m, unit (a to b), N s >= 0, N s on b, m/s, m/s."""


@dataclass(frozen=True)
class Event:
    """Something a user should know of: `kind`, time in s, names of the bodies, and the text with the remedy."""

    time: float
    kind: str
    bodies: tuple[str, ...]
    message: str
    is_problem: bool = True


@dataclass
class EventLog:
    """Collects impacts, energy changes by cause, and events while a run goes on.

    spans: changes of energy that go on for a while: start, end [s], cause, change [J].
    stretches: courses under contact forces: start, end [s], body, energy at the start [J], work of the forces [J].
    """

    impacts: list[np.ndarray] = field(default_factory=list)
    energy: list[tuple[float, str, float]] = field(default_factory=list)
    spans: list[tuple[float, float, str, float]] = field(default_factory=list)
    stretches: list[tuple[float, float, int, float, float]] = field(default_factory=list)
    events: list[Event] = field(default_factory=list)

    def impact_table(self) -> np.ndarray:
        """All impacts in order of time, `IMPACT_DTYPE`."""
        if not self.impacts:
            return np.zeros(0, IMPACT_DTYPE)
        return np.concatenate(self.impacts)

    def book(self, time: float, cause: str, change: float) -> None:
        """Book a change of mechanical energy [J]; negative is dissipated."""
        if change != 0.0:
            self.energy.append((time, cause, change))

    def book_over(self, start: float, end: float, cause: str, change: float) -> None:
        """Book a change of mechanical energy [J] that went on from start to end [s]."""
        if change != 0.0:
            self.spans.append((start, end, cause, change))

    def note(self, time: float, kind: str, bodies: tuple[str, ...], message: str) -> None:
        """Keep an event that is no problem: what the scene asked for."""
        self.events.append(Event(time, kind, bodies, message, is_problem=False))

    def report(self, time: float, kind: str, bodies: tuple[str, ...], message: str) -> None:
        """Keep an event; the same kind for the same bodies is kept once."""
        if not any(e.kind == kind and e.bodies == bodies for e in self.events):
            self.events.append(Event(time, kind, bodies, message))
