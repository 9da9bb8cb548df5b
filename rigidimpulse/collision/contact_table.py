"""The contact table: pairs and contact points, kept from step to step; see `contact_records` for their fields.

More memory is reserved (`reserve`) than most scenes need. It is taken from the front, so that growing copies nothing. Packing is done in
place.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rigidimpulse.collision.contact_records import POINT_FIELDS, UNKNOWN, ContactPairs
from rigidimpulse.core.kernels import jit, jit_making_arrays
from rigidimpulse.core.memory import reserve
from rigidimpulse.core.simd import ROW, aligned

FIRST_POINTS, POINTS_OF_A_BODY = 1024, 32
"""Points that are taken at first, and at least when more are needed; points that are reserved for each body."""
MORE = 1.0 / 8.0
"""Part of the points by which their number grows."""
LOW, FULL = 0.03, 0.9
"""Parts of the points taken: they are packed where fewer than LOW are free and fewer than FULL are in use."""


class Table(NamedTuple):
    """The arrays of a `ContactTable`, for kernels."""

    pairs: ContactPairs
    points: np.ndarray  # (P, POINT_FIELDS)
    ids: np.ndarray  # (P, 3)
    free: np.ndarray  # (shares, 2)


def empty_pairs(k: int) -> ContactPairs:
    """Pairs (k,) of which nothing is known."""

    def numbers() -> np.ndarray:
        return np.zeros(k, np.int32)

    return ContactPairs(
        first=numbers(), second=numbers(), carrier=np.zeros(k, bool), round=np.zeros(k, bool), kind=np.full(k, UNKNOWN, np.int8),
        start=numbers(), count=numbers(), capacity=numbers(), known=np.zeros(k, bool), apart=np.zeros(k), contact_margin=np.zeros(k),
        seen=np.zeros((k, 7)),
    )  # fmt: skip


@jit
def _carry_over(old, new, places):
    """Copy what is known of old pairs to new ones (k,), except `seen`, and write the places of the old ones, -1: none. Both ascend."""
    o = 0
    for p in range(new.first.shape[0]):
        a, b = new.first[p], new.second[p]
        while o < old.first.shape[0] and (old.first[o] < a or (old.first[o] == a and old.second[o] < b)):
            o += 1
        places[p] = -1
        if o < old.first.shape[0] and old.first[o] == a and old.second[o] == b:
            places[p] = o
            new.start[p], new.count[p], new.capacity[p] = old.start[o], old.count[o], old.capacity[o]
            new.known[p], new.apart[p], new.contact_margin[p] = old.known[o], old.apart[o], old.contact_margin[o]
            new.kind[p], new.carrier[p], new.round[p] = old.kind[o], old.carrier[o], old.round[o]


@jit
def _carry_seen(seen, places, new_seen):
    """Copy `seen` in the same way."""
    for p in range(places.shape[0]):
        if places[p] >= 0:
            for k in range(7):
                new_seen[p, k] = seen[places[p], k]


@jit_making_arrays
def _pack(pairs, points, ids, target):
    """Move the points of all pairs one behind the other, in place; target (taken,): zeros. Returns where they end."""
    used = 1
    for p in range(pairs.first.shape[0]):
        for r in range(pairs.start[p], pairs.start[p] + pairs.count[p]):
            target[r] = used
            used += 1
        pairs.start[p], pairs.capacity[p] = used - pairs.count[p], pairs.count[p]
    point, kind = np.empty(POINT_FIELDS), np.empty(3, ids.dtype)
    for r in range(1, target.shape[0]):
        # A point that moves displaces the one at its target, which moves next, until a target is free.
        t, target[r] = target[r], 0
        if t == 0 or t == r:
            continue
        point[:], kind[:] = points[r], ids[r]
        while t > 0:
            for k in range(POINT_FIELDS):
                point[k], points[t, k] = points[t, k], point[k]
            for k in range(3):
                kind[k], ids[t, k] = ids[t, k], kind[k]
            following, target[t] = target[t], 0
            t = following
    return used


def _make_points(number: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Lines, the same memory as points, and ids of `number` points."""
    lines = aligned(number * POINT_FIELDS // ROW)
    return lines, lines.reshape(number, POINT_FIELDS), reserve((number, 3), np.int32)


def _parts(begin: int, end: int, shares: int) -> np.ndarray:
    """Begins and ends (shares, 2) of equal parts."""
    edges = np.linspace(begin, end, shares + 1).astype(np.int64)
    return np.column_stack([edges[:-1], edges[1:]])


class ContactTable:
    """Pairs and their contact points.

    Attributes:
        pairs: ascending by first, then second.
        points: (P, POINT_FIELDS) contact points. lines: (8 m,) the same memory as lines of 8. ids: (P, 3) kind and features of each point.
        taken: points that are in use or free; those behind are reserved.
        free: (shares, 2) begin and end of the points that are free for each share of the pairs. Point 0 stands for none.

    """

    def __init__(
        self, shares: int, bodies: int, first_points: int = FIRST_POINTS, points_of_a_body: int = POINTS_OF_A_BODY
    ) -> None:
        """An empty table.

        Args:
            shares: number of parts into which the pairs are divided at most.
            bodies: of the scene.
            first_points: points that are taken at first, and at least when more are needed.
            points_of_a_body: points that are reserved for each body.

        """
        self.pairs, self.taken, self._least = empty_pairs(0), first_points, first_points
        self.lines, self.points, self.ids = _make_points(max(first_points, points_of_a_body * bodies))
        self.free = _parts(1, first_points, shares)
        self._arrays = Table(self.pairs, self.points, self.ids, self.free)

    @property
    def arrays(self) -> Table:
        """The arrays as they are now: growing replaces them. The same tuple as long as they are the same: calls are quicker by it."""
        now, last = (self.pairs, self.points, self.ids, self.free), self._arrays
        if any(array is not other for array, other in zip(now, last, strict=True)):
            self._arrays = last = Table(*now)
        return last

    def replace(self, first: np.ndarray, second: np.ndarray) -> None:
        """Replace the pairs by these, ascending; pairs that stay keep what is known of them."""
        fresh, places = empty_pairs(len(first)), np.empty(len(first), np.int32)
        fresh.first[:], fresh.second[:] = first, second
        _carry_over(self.pairs, fresh, places)
        # The rest of the old pairs is freed first.
        seen, self.pairs = self.pairs.seen, fresh
        _carry_seen(seen, places, fresh.seen)

    def grow(self, needed: int) -> None:
        """Make space for at least `needed` more points in each share; all points keep their numbers."""
        if (self.free[:, 1] - self.free[:, 0]).min() >= needed:
            return
        old, shares = self.taken, len(self.free)
        self.taken = old + max(needed * shares, self._least, int(MORE * old))
        if self.taken > len(self.points):
            lines, points, ids = _make_points(2 * self.taken)
            points[:old], ids[:old] = self.points[:old], self.ids[:old]
            self.lines, self.points, self.ids = lines, points, ids
        self.free = _parts(old, self.taken, shares)

    def pack(self) -> None:
        """Move the points of all pairs one behind the other where a share has little space left and enough of the points are free."""
        shares, least = len(self.free), int((self.free[:, 1] - self.free[:, 0]).min())
        if least * shares < LOW * self.taken and int(self.pairs.count.sum()) < FULL * self.taken:
            used = _pack(self.pairs, self.points, self.ids, np.zeros(self.taken, np.int32))
            self.free = _parts(used, self.taken, shares)
