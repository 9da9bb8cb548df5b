"""The pairs and contact points of all heaps, kept from step to step; see `heap_rows` for what the kernels read.

More room is reserved (`reserve`) than most scenes ever need, and taken from the front bit by bit: growing copies nothing. Packing is done
in place.
"""

from __future__ import annotations

import numpy as np

from rigidimpulse.collision.contact_records import ROW_SIZE, UNKNOWN, ContactPairs
from rigidimpulse.core.kernels import jit, jit_making_arrays
from rigidimpulse.core.memory import reserve
from rigidimpulse.core.simd import ROW, aligned

FIRST_ROWS, ROWS_OF_A_BODY = 1024, 32
"""Rows that are taken at first, and at least when more are needed; rows that are reserved for each body."""
MORE = 1.0 / 8.0
"""Part of the rows by which they become more."""
LOW, FULL = 0.03, 0.9
"""Parts of the rows taken: free below which they are packed, in use beyond which it is not worth it."""


def empty_pairs(k: int) -> ContactPairs:
    """Pairs (k,) of which nothing is known."""

    def numbers() -> np.ndarray:
        return np.zeros(k, np.int32)

    return ContactPairs(
        first=numbers(), second=numbers(), carrier=np.zeros(k, bool), round=np.zeros(k, bool), kind=np.full(k, UNKNOWN, np.int8),
        start=numbers(), count=numbers(), capacity=numbers(), known=np.zeros(k, bool), apart=np.zeros(k), held=np.zeros(k),
        seen=np.zeros((k, 7)),
    )  # fmt: skip


@jit
def _carry_over(old, new, places):
    """Give new pairs (k,) what is known of the same old ones, but for `seen`, and write where they were, -1: nowhere. Both ascend."""
    o = 0
    for p in range(new.first.shape[0]):
        a, b = new.first[p], new.second[p]
        while o < old.first.shape[0] and (old.first[o] < a or (old.first[o] == a and old.second[o] < b)):
            o += 1
        places[p] = -1
        if o < old.first.shape[0] and old.first[o] == a and old.second[o] == b:
            places[p] = o
            new.start[p], new.count[p], new.capacity[p] = old.start[o], old.count[o], old.capacity[o]
            new.known[p], new.apart[p], new.held[p] = old.known[o], old.apart[o], old.held[o]
            new.kind[p], new.carrier[p], new.round[p] = old.kind[o], old.carrier[o], old.round[o]


@jit
def _carry_seen(seen, places, new_seen):
    """The same for `seen` alone."""
    for p in range(places.shape[0]):
        if places[p] >= 0:
            for k in range(7):
                new_seen[p, k] = seen[places[p], k]


@jit_making_arrays
def _pack(pairs, rows, ids, target):
    """Put the rows of all pairs one after the other, in place; target (taken,): zeros. Returns where they end."""
    used = 1
    for p in range(pairs.first.shape[0]):
        for r in range(pairs.start[p], pairs.start[p] + pairs.count[p]):
            target[r] = used
            used += 1
        pairs.start[p], pairs.capacity[p] = used - pairs.count[p], pairs.count[p]
    row, kind = np.empty(ROW_SIZE), np.empty(3, ids.dtype)
    for r in range(1, target.shape[0]):
        # A row pushes the one that lies at its place on to its own, until it comes to a place that is free.
        t, target[r] = target[r], 0
        if t == 0 or t == r:
            continue
        row[:], kind[:] = rows[r], ids[r]
        while t > 0:
            for k in range(ROW_SIZE):
                row[k], rows[t, k] = rows[t, k], row[k]
            for k in range(3):
                kind[k], ids[t, k] = ids[t, k], kind[k]
            following, target[t] = target[t], 0
            t = following
    return used


def _make_pool(number: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Lines, the same as rows, and ids of a pool of so many rows."""
    lines = aligned(number * ROW_SIZE // ROW)
    return lines, lines.reshape(number, ROW_SIZE), reserve((number, 3), np.int32)


def _parts(begin: int, end: int, shares: int) -> np.ndarray:
    """Begins and ends (shares, 2) of equal parts."""
    edges = np.linspace(begin, end, shares + 1).astype(np.int64)
    return np.column_stack([edges[:-1], edges[1:]])


class ContactTable:
    """Pairs and their rows in a pool.

    Attributes:
        pairs: ascending by first, then second.
        lines: (8 m,) the pool as lines of 8, and rows: (P, ROW_SIZE), the same memory. ids: (P, 3) kind and features of each row.
        taken: rows of the pool that are in use or free; those behind are reserved.
        free: (shares, 2) where the rows that are free for each share of the pairs begin and end; the first row of all is none.

    """

    def __init__(self, shares: int, bodies: int) -> None:
        """Nothing; shares: into which pairs are dealt out at most."""
        self.pairs, self.taken = empty_pairs(0), FIRST_ROWS
        self.lines, self.rows, self.ids = _make_pool(max(FIRST_ROWS, ROWS_OF_A_BODY * bodies))
        self.free = _parts(1, FIRST_ROWS, shares)

    def replace(self, first: np.ndarray, second: np.ndarray) -> None:
        """Let these (ascending) be the pairs; known ones keep what they have."""
        fresh, places = empty_pairs(len(first)), np.empty(len(first), np.int32)
        fresh.first[:], fresh.second[:] = first, second
        _carry_over(self.pairs, fresh, places)
        # The rest of the old pairs is let go first.
        seen, self.pairs = self.pairs.seen, fresh
        _carry_seen(seen, places, fresh.seen)

    def grow(self, needed: int) -> None:
        """Room for at least `needed` more rows in each share; all rows keep their numbers."""
        if (self.free[:, 1] - self.free[:, 0]).min() >= needed:
            return
        old, shares = self.taken, len(self.free)
        self.taken = old + max(needed * shares, FIRST_ROWS, int(MORE * old))
        if self.taken > len(self.rows):
            lines, rows, ids = _make_pool(2 * self.taken)
            rows[:old], ids[:old] = self.rows[:old], self.ids[:old]
            self.lines, self.rows, self.ids = lines, rows, ids
        self.free = _parts(old, self.taken, shares)

    def pack(self) -> None:
        """Put the rows of all pairs one after the other, with other numbers, where a share has little room left but rows are to be had."""
        shares, least = len(self.free), int((self.free[:, 1] - self.free[:, 0]).min())
        if least * shares < LOW * self.taken and int(self.pairs.count.sum()) < FULL * self.taken:
            used = _pack(self.pairs, self.rows, self.ids, np.zeros(self.taken, np.int32))
            self.free = _parts(used, self.taken, shares)
