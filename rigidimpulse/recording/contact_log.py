"""Keeps the forces of lasting contacts while a run goes on (see `contacts`)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from rigidimpulse.core.kernels import jit_making_arrays
from rigidimpulse.core.vector import tangents
from rigidimpulse.recording.contacts import CONTACT_DTYPE
from rigidimpulse.recording.impulses import ImpulseAccounts

if TYPE_CHECKING:
    from rigidimpulse.model.contacts import Contacts


@jit_making_arrays
def fill_contacts_and_forces(contacts, position, force, point, total):
    """Points (m, 3) and forces on b (m, 3) in the world, of forces (m, 3) in (n, t1, t2) and centres of mass position (n, 3)."""
    t1, t2 = np.empty(3), np.empty(3)
    for c in range(contacts.gap.shape[0]):
        a, b, n = contacts.body_a[c], contacts.body_b[c], contacts.normal[c]
        tangents(n, t1, t2)
        for k in range(3):
            point[c, k] = 0.5 * (position[a, k] + contacts.arm_a[c, k] + position[b, k] + contacts.arm_b[c, k])
            total[c, k] = force[c, 0] * n[k] + force[c, 1] * t1[k] + force[c, 2] * t2[k]


@dataclass(eq=False)
class Stretch:
    """Contacts that one solution gave forces to at `start`; rows (m,) `CONTACT_DTYPE`, end inf while they last; movable bodies."""

    start: float
    bodies: frozenset[int]
    rows: np.ndarray


class ContactLog:
    """Collects contact forces while a run goes on; those that no frame sees are dropped."""

    def __init__(self, times: np.ndarray, accounts: ImpulseAccounts) -> None:
        """times (f,) s, of the frames; accounts: where impulses go."""
        self.times, self._accounts = times, accounts
        self._open: dict[int, Stretch] = {}
        self._done: list[np.ndarray] = []

    def close(self, bodies: list[int], time: float) -> None:
        """The contacts of the bodies end at `time`, except those that begin there. At the last frame, which is the end, none does."""
        if 0.0 < self.times[-1] <= time:
            return
        for stretch in {id(s): s for s in map(self._open.get, bodies) if s is not None and s.start < time}.values():
            self._end(stretch, bodies, time)
        for i in bodies:
            if i in self._open and self._open[i].start < time:
                del self._open[i]

    def replace(self, bodies: list[int], time: float, contacts: Contacts, position: np.ndarray, force: np.ndarray) -> None:
        """The contacts of the bodies are these from `time` on; position (n, 3) of all bodies, force (m, 3) in (n, t1, t2)."""
        if 0.0 < self.times[-1] <= time:
            return
        for stretch in {id(s): s for s in map(self._open.get, bodies) if s is not None}.values():
            self._end(stretch, bodies, time)
        rows = np.empty(len(force), CONTACT_DTYPE)
        rows["start"], rows["end"] = time, np.inf
        rows["body_a"], rows["body_b"], rows["normal"] = contacts.body_a, contacts.body_b, contacts.normal
        point, total = np.empty((len(force), 3)), np.empty((len(force), 3))
        fill_contacts_and_forces(contacts, position, force, point, total)
        rows["point"], rows["force"] = point, total
        self._open.update(dict.fromkeys(bodies, Stretch(time, frozenset(bodies), rows[force[:, 0] > 0.0])))

    def table(self) -> np.ndarray:
        """All contacts that a frame sees, in order of their start."""
        for stretch in {id(s): s for s in self._open.values()}.values():
            lasting = stretch.rows[np.isinf(stretch.rows["end"])]
            self._keep(lasting)
            self._count(lasting, self.times[-1])
        self._open.clear()
        if not self._done:
            return np.zeros(0, CONTACT_DTYPE)
        rows = np.concatenate(self._done)
        return rows[np.argsort(rows["start"], kind="stable")]

    def _end(self, stretch: Stretch, bodies: list[int], time: float) -> None:
        rows = stretch.rows
        ends = np.isinf(rows["end"])
        if not stretch.bodies.issubset(bodies):
            ends &= np.isin(rows["body_a"], bodies) | np.isin(rows["body_b"], bodies)
        rows["end"][ends] = time
        self._keep(rows[ends])
        self._count(rows[ends], time)

    def _count(self, rows: np.ndarray, end: float) -> None:
        """Account for the impulses of contacts that carried their forces until `end`."""
        total: dict[tuple[int, int], np.ndarray] = {}
        for a, b, force in zip(rows["body_a"].tolist(), rows["body_b"].tolist(), rows["force"], strict=True):
            total[a, b] = total.get((a, b), 0.0) + force
        for (a, b), force in total.items():
            self._accounts.add("contact with", a, b, float(rows["start"][0]), end, force)

    def _keep(self, rows: np.ndarray) -> None:
        seen = np.searchsorted(self.times, rows["start"]) < np.searchsorted(self.times, rows["end"])
        if seen.any():
            self._done.append(rows[seen])
