"""The pairs and contact points of all heaps, kept from step to step; see `heap_rows` for what the kernels read."""

from __future__ import annotations

import numpy as np

from rigidimpulse._jit import jit
from rigidimpulse.constrain.heap_rows import ROW_SIZE, UNKNOWN, HeapPairs
from rigidimpulse.constrain.lanes import ROW, aligned

FIRST_ROWS = 1024
LOW, FULL = 0.25, 0.6
"""Parts of the rows: free below which they are packed, in use beyond which it is not worth it."""


def empty_pairs(k: int) -> HeapPairs:
    """Pairs (k,) of which nothing is known."""

    def numbers() -> np.ndarray:
        return np.zeros(k, np.int32)

    return HeapPairs(
        first=numbers(), second=numbers(), carrier=np.zeros(k, bool), round=np.zeros(k, bool), kind=np.full(k, UNKNOWN, np.int8),
        start=numbers(), count=numbers(), room=numbers(), known=np.zeros(k, bool), apart=np.zeros(k), held=np.zeros(k),
        seen=np.zeros((k, 7)),
    )  # fmt: skip


@jit
def _carry_over(old, new):
    """Give new pairs what is known of the same old ones; both ascend."""
    o = 0
    for p in range(new.first.shape[0]):
        a, b = new.first[p], new.second[p]
        while o < old.first.shape[0] and (old.first[o] < a or (old.first[o] == a and old.second[o] < b)):
            o += 1
        if o < old.first.shape[0] and old.first[o] == a and old.second[o] == b:
            new.start[p], new.count[p], new.room[p] = old.start[o], old.count[o], old.room[o]
            new.known[p], new.apart[p], new.held[p] = old.known[o], old.apart[o], old.held[o]
            new.kind[p], new.carrier[p], new.round[p] = old.kind[o], old.carrier[o], old.round[o]
            for k in range(7):
                new.seen[p, k] = old.seen[o, k]


@jit
def _pack(pairs, rows, ids, new_rows, new_ids):
    """Put the rows of all pairs one after the other; returns their number."""
    used = 1
    for p in range(pairs.first.shape[0]):
        count = pairs.count[p]
        for c in range(count):
            for k in range(ROW_SIZE):
                new_rows[used + c, k] = rows[pairs.start[p] + c, k]
            for k in range(3):
                new_ids[used + c, k] = ids[pairs.start[p] + c, k]
        pairs.start[p], pairs.room[p] = used, count
        used += count
    return used


def _make_pool(number: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Lines, the same as rows, and ids of a pool of so many rows."""
    lines = aligned(number * ROW_SIZE // ROW)
    return lines, lines.reshape(number, ROW_SIZE), np.zeros((number, 3), np.int64)


def _parts(begin: int, end: int, shares: int) -> np.ndarray:
    """Begins and ends (shares, 2) of equal parts."""
    edges = np.linspace(begin, end, shares + 1).astype(np.int64)
    return np.column_stack([edges[:-1], edges[1:]])


class HeapTable:
    """Pairs and their rows in a pool.

    Attributes:
        pairs: ascending by first, then second.
        lines: (8 m,) the pool as lines of 8, and rows: (P, ROW_SIZE), the same memory. ids: (P, 3) kind and features of each row.
        free: (shares, 2) where the rows that are free for each share of the pairs begin and end; the first row of all is none.

    """

    def __init__(self, shares: int) -> None:
        """Nothing; shares: into which pairs are dealt out at most."""
        self.pairs = empty_pairs(0)
        self.lines, self.rows, self.ids = _make_pool(FIRST_ROWS)
        self.free = _parts(1, FIRST_ROWS, shares)

    def replace(self, first: np.ndarray, second: np.ndarray) -> None:
        """Let these (ascending) be the pairs; known ones keep what they have."""
        fresh = empty_pairs(len(first))
        fresh.first[:], fresh.second[:] = first, second
        _carry_over(self.pairs, fresh)
        self.pairs = fresh

    def make_room(self, needed: int) -> None:
        """Room for `needed` more rows in each share; all rows keep their numbers."""
        if (self.free[:, 1] - self.free[:, 0]).min() >= needed:
            return
        old, shares = len(self.rows), len(self.free)
        total = old + max(needed * shares, old // 4)
        lines, rows, ids = _make_pool(total)
        rows[:old], ids[:old] = self.rows, self.ids
        self.lines, self.rows, self.ids, self.free = lines, rows, ids, _parts(old, total, shares)

    def pack(self) -> None:
        """Put the rows of all pairs one after the other, with other numbers, where a share has little room left but rows are to be had."""
        total, shares = len(self.rows), len(self.free)
        least = int((self.free[:, 1] - self.free[:, 0]).min())
        if least * shares < LOW * total and int(self.pairs.count.sum()) < FULL * total:
            lines, rows, ids = _make_pool(total)
            used = _pack(self.pairs, self.rows, self.ids, rows, ids)
            self.lines, self.rows, self.ids, self.free = lines, rows, ids, _parts(used, total, shares)
