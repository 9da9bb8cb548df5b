"""Events of a run: the impacts table, energy changes by cause, and reports with their times."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rigidimpulse.core.kernels import jit
from rigidimpulse.core.memory import longer, rows_of

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
ENERGY_DTYPE = np.dtype([("time", np.float64), ("cause", np.int64), ("change", np.float64)])
"""One row a change of mechanical energy: s, number in `CAUSES`, J (negative is dissipated)."""
STRETCH_DTYPE = np.dtype(
    [("start", np.float64), ("end", np.float64), ("body", np.int64), ("energy", np.float64), ("work", np.float64), ("by_joints", np.bool_)]
)
"""One row a trajectory under contact forces: s, s, index, energy at the start [J], work of the forces [J], whether joints alone hold it."""
CAUSES = ("impact", "stick", "position correction", "energy correction", "joints", "sub-stepping", "overlap", "let go")
"""What changes mechanical energy at an instant, by the numbers that a log keeps."""
IMPACT, STICK, POSITION_CORRECTION, ENERGY_CORRECTION = np.arange(4)
"""Numbers of the first of them, for kernels."""
FIRST_ROWS = 8192
"""More than the compiled loop asks to have free before the first event of a small scene."""


class LogBuffers(NamedTuple):
    """What kernels append to; `EventLog.grow` makes new ones where these are full."""

    energy: np.ndarray  # (k,) ENERGY_DTYPE
    stretches: np.ndarray  # (k,) STRETCH_DTYPE
    impacts: np.ndarray  # (k, ROW_LENGTH), the columns of IMPACT_DTYPE
    counts: np.ndarray  # (6,) rows in use of the three, and how many more were last asked for


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


@jit
def has_capacity(buffers, energy, stretches, impacts):
    """Whether these numbers of rows fit in; if not, `EventLog.grow` makes the buffers larger."""
    counts = buffers.counts
    counts[3], counts[4], counts[5] = energy, stretches, impacts
    return (
        counts[0] + energy <= buffers.energy.shape[0]
        and counts[1] + stretches <= buffers.stretches.shape[0]
        and counts[2] + impacts <= buffers.impacts.shape[0]
    )


@jit
def log_energy(buffers, time, cause, change):
    """Append a change of mechanical energy [J], unless it is 0; there must be space."""
    if change != 0.0:
        row = buffers.energy[buffers.counts[0]]
        row.time, row.cause, row.change = time, cause, change
        buffers.counts[0] += 1


@jit
def log_stretch(buffers, start, end, body, energy, work, by_joints):
    """Append a trajectory under contact forces (see `STRETCH_DTYPE`); there must be space."""
    row = buffers.stretches[buffers.counts[1]]
    row.start, row.end, row.body, row.energy, row.work, row.by_joints = start, end, body, energy, work, by_joints
    buffers.counts[1] += 1


@jit
def log_impacts(buffers, time, contacts, position, log, count):
    """Append the impacts that `write_impacts` describes; there must be space."""
    write_impacts(time, contacts, position, log, count, buffers.impacts, buffers.counts[2])
    buffers.counts[2] += count


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


def _first_buffers() -> LogBuffers:
    """Empty ones."""
    impacts = np.zeros((FIRST_ROWS, ROW_LENGTH))
    return LogBuffers(rows_of(FIRST_ROWS, ENERGY_DTYPE), rows_of(FIRST_ROWS, STRETCH_DTYPE), impacts, np.zeros(6, np.int64))


def _doubled(rows: np.ndarray, least: int) -> np.ndarray:
    """Rows that double until there are enough."""
    while len(rows) < least:
        rows = longer(rows, len(rows)) if rows.dtype.names else np.concatenate([rows, np.zeros_like(rows)])
    return rows


@dataclass
class EventLog:
    """Collects impacts, energy changes by cause, and events while a run goes on.

    buffers: impacts, changes of energy at an instant, and trajectories under contact forces.
    spans: changes of energy that go on for a while: start, end [s], cause, change [J].
    """

    buffers: LogBuffers = field(default_factory=_first_buffers)
    spans: list[tuple[float, float, str, float]] = field(default_factory=list)
    events: list[Event] = field(default_factory=list)

    @property
    def energy(self) -> np.ndarray:
        """Changes of energy, `ENERGY_DTYPE`."""
        return self.buffers.energy[: self.buffers.counts[0]]

    @property
    def stretches(self) -> np.ndarray:
        """Trajectories under contact forces, `STRETCH_DTYPE`."""
        return self.buffers.stretches[: self.buffers.counts[1]]

    @property
    def impacts(self) -> np.ndarray:
        """Impacts (k, ROW_LENGTH); `impact_table` gives the columns names."""
        return self.buffers.impacts[: self.buffers.counts[2]]

    def forget(self) -> None:
        """Drop the impacts, changes of energy and trajectories that were kept."""
        self.buffers.counts[:] = 0

    def grow(self) -> None:
        """Make space for the rows that `has_capacity` was last asked about: buffers that are too small double."""
        energy, stretches, impacts, counts = self.buffers
        least = (counts[:3] + counts[3:]).tolist()
        self.buffers = LogBuffers(_doubled(energy, least[0]), _doubled(stretches, least[1]), _doubled(impacts, least[2]), counts)

    def reserve(self, energy: int = 0, stretches: int = 0, impacts: int = 0) -> None:
        """Make space for as many rows of each."""
        if not has_capacity.py_func(self.buffers, energy, stretches, impacts):
            self.grow()

    def account(self, time: float, cause: str, change: float) -> None:
        """Keep a change of mechanical energy [J] by one of the `CAUSES`; negative is dissipated."""
        self.reserve(energy=1)
        log_energy(self.buffers, time, CAUSES.index(cause), change)

    def add_stretch(self, start: float, end: float, body: int, energy: float, work: float, by_joints: bool) -> None:
        """Keep a trajectory under contact forces from start to end [s], see `STRETCH_DTYPE`: energy at the start and work [J]."""
        self.reserve(stretches=1)
        log_stretch(self.buffers, start, end, body, energy, work, by_joints)

    def add_impacts(self, time: float, contacts: Contacts, position: np.ndarray, log: np.ndarray, count: int) -> None:
        """Keep the impacts that `write_impacts` describes."""
        self.reserve(impacts=count)
        log_impacts(self.buffers, time, contacts, position, log, count)

    def extend_impacts(self, rows: np.ndarray, change: np.ndarray) -> None:
        """Keep impacts (k, ROW_LENGTH) that are written already, and the changes of energy (k,) J by them."""
        self.reserve(energy=len(rows), impacts=len(rows))
        buffers, counts, changed = self.buffers, self.buffers.counts, change != 0.0
        buffers.impacts[counts[2] : counts[2] + len(rows)] = rows
        energy = buffers.energy[counts[0] : counts[0] + np.count_nonzero(changed)]
        energy["time"], energy["cause"], energy["change"] = rows[changed, 0], IMPACT, change[changed]
        counts[2] += len(rows)
        counts[0] += len(energy)

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
