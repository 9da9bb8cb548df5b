"""Keeps the forces of lasting contacts while a run goes on (see `contacts`).

A solution gives forces to the contacts of an island at an instant: a stretch. Its contacts stand in rows one after another, and each
body knows the first row of its own stretch. Kernels append rows, and set when contacts end. A contact may end before others of its
stretch do. Rows of contacts that have ended are taken out where the buffer is full, and at the end of the run.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rigidimpulse.core.kernels import jit, jit_making_arrays
from rigidimpulse.core.memory import longer, rows_of
from rigidimpulse.core.vector import tangents
from rigidimpulse.recording.contacts import CONTACT_DTYPE
from rigidimpulse.recording.impulses import ImpulseAccounts

if TYPE_CHECKING:
    from rigidimpulse.model.contacts import Contacts

ROW_DTYPE = np.dtype([*CONTACT_DTYPE.descr, ("stretch", np.int64), ("place", np.int64), ("visit", np.int64)])
"""Of a contact, too: first row of its stretch; place of its end among all ends; and in that first row, the last visit to the stretch."""
FIRST_ROWS = 4096


class ContactBuffers(NamedTuple):
    """What kernels write; `ContactLog.grow` makes it larger."""

    times: np.ndarray  # (f,) s of the frames
    rows: np.ndarray  # (k,) ROW_DTYPE, end inf while a contact lasts
    stretch: np.ndarray  # (n,) first row of the body's stretch that lasts, -1 without
    marked: np.ndarray  # (n,) bool, scratch: all False
    counts: np.ndarray  # (3,) rows in use, visits to stretches, and how many more rows were last asked for


@jit
def has_contact_capacity(buffers, rows):
    """Whether `rows` more contacts fit in; if not, `ContactLog.grow` makes the buffers larger."""
    buffers.counts[2] = rows
    return buffers.counts[0] + rows <= buffers.rows.shape[0]


@jit
def _is_over(buffers, time):
    """Whether `time` is that of the last frame, where no contact ends: or later."""
    last = buffers.times[buffers.times.shape[0] - 1]
    return 0.0 < last <= time


@jit
def _end_in_stretch(buffers, first, time):
    """End the contacts of marked bodies in the stretch that begins at row `first`."""
    rows, counts, marked = buffers.rows, buffers.counts, buffers.marked
    r, visit = first, counts[1]
    rows[first].visit = visit
    counts[1] += 1
    while r < counts[0] and rows[r].stretch == first:
        row = rows[r]
        if row.end == np.inf and (marked[row.body_a] or marked[row.body_b]):
            row.end, row.place = time, visit
        r += 1


@jit
def _end_contacts(buffers, bodies, time, latest):
    """End the contacts of the bodies, in stretches of theirs that began before `latest`, at `time` [s]."""
    rows, stretch, marked, before = buffers.rows, buffers.stretch, buffers.marked, buffers.counts[1]
    for i in bodies:
        marked[i] = True
    for i in bodies:
        first = stretch[i]
        if first >= 0 and rows[first].start < latest and rows[first].visit < before:
            _end_in_stretch(buffers, first, time)
    for i in bodies:
        marked[i] = False
        if stretch[i] >= 0 and rows[stretch[i]].start < latest:
            stretch[i] = -1


@jit
def close_contacts(buffers, bodies, time):
    """The contacts of the bodies (k,) end at `time` [s], except those that begin there. At the last frame, which is the end, none does."""
    if not _is_over(buffers, time):
        _end_contacts(buffers, bodies, time, time)


@jit_making_arrays
def replace_contacts(buffers, bodies, time, contacts, position, force):
    """The contacts of the bodies (k,) are these from `time` [s] on; there must be space.

    position (n, 3) m: centres of mass of all bodies; force (m, 3) N in (n, t1, t2). Contacts that do not press are left out.
    """
    if _is_over(buffers, time):
        return
    _end_contacts(buffers, bodies, time, np.inf)
    t1, t2 = np.empty(3), np.empty(3)
    first = buffers.counts[0]
    for c in range(force.shape[0]):
        if force[c, 0] > 0.0:
            row, a, b, n = buffers.rows[buffers.counts[0]], contacts.body_a[c], contacts.body_b[c], contacts.normal[c]
            buffers.counts[0] += 1
            row.start, row.end, row.body_a, row.body_b = time, np.inf, a, b
            row.stretch, row.place, row.visit = first, -1, -1
            tangents(n, t1, t2)
            for k in range(3):
                row.normal[k] = n[k]
                row.point[k] = 0.5 * (position[a, k] + contacts.arm_a[c, k] + position[b, k] + contacts.arm_b[c, k])
                row.force[k] = force[c, 0] * n[k] + force[c, 1] * t1[k] + force[c, 2] * t2[k]
    if buffers.counts[0] > first:
        for i in bodies:
            buffers.stretch[i] = first


def _closed_up(rows: np.ndarray, lasts: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rows (m,) without those that do not last, (m,) bool; by the first row of a stretch, or -1: its first row now, and whether it has one.

    Of a stretch, the first row that is left takes over.
    """
    left, number = rows[lasts], np.append(np.cumsum(lasts) - lasts, 0)
    stays = np.zeros(len(rows) + 1, bool)
    stays[left["stretch"]] = True
    left["stretch"] = number[left["stretch"]]
    return left, number, stays


class ContactLog:
    """Collects contact forces while a run goes on; those that no frame sees are dropped."""

    def __init__(self, times: np.ndarray, num_bodies: int, accounts: ImpulseAccounts, first_rows: int = FIRST_ROWS) -> None:
        """times (f,) s, of the frames; accounts: where impulses go; first_rows: contacts that there is space for at first."""
        stretch, marked = np.full(num_bodies, -1), np.zeros(num_bodies, bool)
        self.buffers = ContactBuffers(times, rows_of(first_rows, ROW_DTYPE), stretch, marked, np.zeros(3, np.int64))
        self._accounts = accounts
        self._done: list[np.ndarray] = []

    def close(self, bodies: np.ndarray, time: float) -> None:
        """See `close_contacts`."""
        if (self.buffers.stretch[bodies] >= 0).any():
            close_contacts(self.buffers, bodies, time)

    def replace(self, bodies: np.ndarray, time: float, contacts: Contacts, position: np.ndarray, force: np.ndarray) -> None:
        """See `replace_contacts`."""
        if not has_contact_capacity.py_func(self.buffers, len(force)):
            self.grow()
        replace_contacts(self.buffers, bodies, time, contacts, position, force)

    def grow(self) -> None:
        """Make space for the contacts that `has_contact_capacity` was last asked about.

        Those that have ended go; if many last, the rows double.
        """
        self._take_out_ended()
        rows, (used, _, more) = self.buffers.rows, self.buffers.counts.tolist()
        size = len(rows)
        while used + more > size or 2 * used > size:
            size *= 2
        self.buffers = self.buffers._replace(rows=longer(rows, size - len(rows)))

    def keep(self, count: int) -> None:
        """Leave the first `count` frames only."""
        self.buffers = self.buffers._replace(times=self.buffers.times[:count])

    def lasting_pairs(self) -> np.ndarray:
        """Pairs (k, 2) of bodies whose contacts last."""
        rows = self.buffers.rows[: self.buffers.counts[0]]
        rows = rows[np.isinf(rows["end"])]
        return np.column_stack([rows["body_a"], rows["body_b"]])

    def carry_on(self, earlier: ContactLog, index: np.ndarray, time: float) -> None:
        """Let the contacts of an earlier log that last begin here at `time` [s]; index (n,): of its bodies here, -1 for those left out."""
        rows, stretch = earlier.buffers.rows[: earlier.buffers.counts[0]], earlier.buffers.stretch
        lasts = np.isinf(rows["end"]) & (index[rows["body_a"]] >= 0) & (index[rows["body_b"]] >= 0)
        left, first_of, here = _closed_up(rows, lasts)
        left["start"], left["visit"], left["place"] = time, -1, -1
        for name in ("body_a", "body_b"):
            left[name] = index[left[name]]
        buffers = self.buffers
        buffers.counts[2] = len(left)
        if not has_contact_capacity.py_func(buffers, len(left)):
            self.grow()
        self.buffers.rows[: len(left)], self.buffers.counts[0] = left, len(left)
        bodies = np.flatnonzero(index >= 0)
        self.buffers.stretch[index[bodies]] = np.where(here[stretch[bodies]], first_of[stretch[bodies]], -1)

    def table(self) -> np.ndarray:
        """All contacts that a frame sees, in order of their start. Those that last carry their forces to the last frame."""
        self._take_out_ended()
        lasting = self.buffers.rows[: self.buffers.counts[0]].copy()
        lasting["place"] = lasting["stretch"]
        self._keep(lasting)
        self._count(lasting, np.full(len(lasting), self.buffers.times[-1]))
        self.buffers.counts[0] = 0
        self.buffers.stretch[:] = -1
        if not self._done:
            return np.zeros(0, CONTACT_DTYPE)
        rows = np.concatenate(self._done)
        return rows[np.argsort(rows["start"], kind="stable")]

    def _take_out_ended(self) -> None:
        """Keep the contacts that have ended in the order in which they did, account for them, and close the gaps that they leave."""
        _, rows, stretch, _, counts = self.buffers
        rows = rows[: counts[0]]
        lasts = np.isinf(rows["end"])
        ended = rows[~lasts]
        ended = ended[np.argsort(ended["place"], kind="stable")]
        self._keep(ended)
        self._count(ended, ended["end"])
        left, first_of, stays = _closed_up(rows, lasts)
        stretch[:] = np.where(stays[stretch], first_of[stretch], -1)
        rows[: len(left)] = left
        counts[0] = len(left)

    def _count(self, rows: np.ndarray, end: np.ndarray) -> None:
        """Account for the impulses of contacts that carried their forces until `end` (k,); forces of a pair in a stretch act together."""
        if not len(rows):
            return
        order = np.lexsort((rows["place"], rows["body_b"], rows["body_a"]))
        rows, end = rows[order], end[order]
        of_pair = np.zeros(len(rows), np.int64)
        for name in ("body_a", "body_b", "place"):
            of_pair[1:] |= np.diff(rows[name]) != 0
        first, of_pair = np.flatnonzero(np.append(1, of_pair[1:])), np.cumsum(of_pair)
        force = np.stack([np.bincount(of_pair, rows["force"][:, k], len(first)) for k in range(3)], axis=1)
        rows = rows[first]
        self._accounts.add_many("contact with", rows["body_a"], rows["body_b"], rows["start"], end[first], force)

    def _keep(self, rows: np.ndarray) -> None:
        times = self.buffers.times
        seen = np.searchsorted(times, rows["start"]) < np.searchsorted(times, rows["end"])
        if seen.any():
            self._done.append(rows[list(CONTACT_DTYPE.names or ())][seen].astype(CONTACT_DTYPE))
