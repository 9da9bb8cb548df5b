"""Events of a run: the impacts table, energy changes by cause, and reports with their times."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from rigidimpulse.core.kernels import jit

if TYPE_CHECKING:
    from rigidimpulse.model.contacts import Contacts

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
ROW_LENGTH = IMPACT_DTYPE.itemsize // 8
FIRST_ROWS = 64


@jit
def write_impacts(time, contacts, position, log, count, rows, first):
    """Write `count` rows of a log of impulses (see `dynamics.impact.point.log_impact`) into rows (k, ROW_LENGTH) from `first` on.

    contacts: those that the log numbers; position (n, 3) m of the centres of mass.
    """
    for s in range(count):
        row, c = rows[first + s], int(log[s, 0])
        a, b = contacts.body_a[c], contacts.body_b[c]
        row[0], row[1], row[2], row[9] = time, a, b, log[s, 1]
        for k in range(3):
            row[3 + k] = 0.5 * ((position[a, k] + contacts.arm_a[c, k]) + (position[b, k] + contacts.arm_b[c, k]))
            row[6 + k] = contacts.normal[c, k]
            row[10 + k] = log[s, 2 + k]
        row[13], row[14] = log[s, 5], log[s, 6]


class ImpactRows:
    """The impacts of a run, in a table of numbers that doubles when it is full; the columns are those of `IMPACT_DTYPE`."""

    def __init__(self) -> None:
        """Empty."""
        self.rows = np.empty((FIRST_ROWS, ROW_LENGTH))
        self.count = 0

    def add(self, time: float, contacts: Contacts, position: np.ndarray, log: np.ndarray, count: int) -> None:
        """Keep the impacts that `write_impacts` describes."""
        while self.count + count > len(self.rows):
            self.rows = np.concatenate([self.rows, np.empty_like(self.rows)])
        write_impacts(time, contacts, position, log, count, self.rows, self.count)
        self.count += count

    def extend(self, rows: np.ndarray) -> None:
        """Keep impacts (k, ROW_LENGTH) that are written already."""
        while self.count + len(rows) > len(self.rows):
            self.rows = np.concatenate([self.rows, np.empty_like(self.rows)])
        self.rows[self.count : self.count + len(rows)] = rows
        self.count += len(rows)

    def table(self) -> np.ndarray:
        """All impacts in order of time, `IMPACT_DTYPE`."""
        return impact_table(self.rows[: self.count])


def impact_table(rows: np.ndarray) -> np.ndarray:
    """Rows (k, ROW_LENGTH) as `IMPACT_DTYPE`."""
    table, column = np.empty(len(rows), IMPACT_DTYPE), 0
    for name in IMPACT_DTYPE.names or ():
        width = IMPACT_DTYPE[name].itemsize // 8
        table[name] = rows[:, column : column + width].reshape(table[name].shape)
        column += width
    return table


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
    stretches: trajectories under contact forces: start, end [s], body, energy at the start [J], work of the forces [J].
    """

    impacts: ImpactRows = field(default_factory=ImpactRows)
    energy: list[tuple[float, str, float]] = field(default_factory=list)
    spans: list[tuple[float, float, str, float]] = field(default_factory=list)
    stretches: list[tuple[float, float, int, float, float]] = field(default_factory=list)
    events: list[Event] = field(default_factory=list)

    def account(self, time: float, cause: str, change: float) -> None:
        """Keep a change of mechanical energy [J]; negative is dissipated."""
        if change != 0.0:
            self.energy.append((time, cause, change))

    def account_over(self, start: float, end: float, cause: str, change: float) -> None:
        """Keep a change of mechanical energy [J] that went on from start to end [s]."""
        if change != 0.0:
            self.spans.append((start, end, cause, change))

    def note(self, time: float, kind: str, bodies: tuple[str, ...], message: str) -> None:
        """Keep an event that is no problem: what the scene asked for."""
        self.events.append(Event(time, kind, bodies, message, is_problem=False))

    def report(self, time: float, kind: str, bodies: tuple[str, ...], message: str) -> None:
        """Keep an event; the same kind for the same bodies is kept once."""
        if not any(e.kind == kind and e.bodies == bodies for e in self.events):
            self.events.append(Event(time, kind, bodies, message))
