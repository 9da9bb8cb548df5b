"""The pairs and contact rows of all heaps, kept from step to step; see `heap_rows` for what the solver reads."""

from __future__ import annotations

import numpy as np

from rigidimpulse.constrain.heap_rows import ROW_SIZE

FIRST_ROWS = 1024


class HeapTable:
    """Pairs by key and their rows in a pool.

    Attributes:
        key: (k,) ascending: number of the first body times the number of bodies plus that of the second.
        start, count: (k,) rows of each pair. slide, turn: (k,), see `HeapPairs`.
        rows: (P, ROW_SIZE) and ids: (P, 3) kind and features of each. used: rows in use.

    """

    def __init__(self) -> None:
        """Nothing."""
        self.key = np.zeros(0, np.int64)
        self.start, self.count = np.zeros(0, np.int64), np.zeros(0, np.int64)
        self.slide, self.turn = np.zeros(0), np.zeros(0)
        self.rows, self.ids = np.zeros((FIRST_ROWS, ROW_SIZE)), np.zeros((FIRST_ROWS, 3), np.int64)
        self.used = 0

    def replace(self, mine: np.ndarray, key: np.ndarray) -> None:
        """Put the pairs `key` (ascending) in the place of those marked in `mine` (k,); known ones keep what they have."""
        every = np.union1d(self.key[~mine], key)
        if len(self.key) and len(every):
            at = np.minimum(np.searchsorted(self.key, every), len(self.key) - 1)
            known = self.key[at] == every
        else:
            at, known = np.zeros(len(every), np.int64), np.zeros(len(every), bool)
        for name, new in (("start", 0), ("count", 0), ("slide", 0.0), ("turn", 0.0)):
            old = getattr(self, name)
            fresh = np.full(len(every), new, old.dtype)
            fresh[known] = old[at[known]]
            setattr(self, name, fresh)
        self.key = every

    def make_room(self, needed: int) -> None:
        """Room for `needed` more rows; all rows may move."""
        if self.used + needed <= len(self.rows):
            return
        total = int(self.count.sum())
        first = np.concatenate([np.zeros(1, np.int64), np.cumsum(self.count)])[:-1]
        at = np.repeat(self.start - first, self.count) + np.arange(total)
        capacity = max(len(self.rows), 2 * (total + needed))
        rows, ids = np.zeros((capacity, ROW_SIZE)), np.zeros((capacity, 3), np.int64)
        rows[:total], ids[:total] = self.rows[at], self.ids[at]
        self.rows, self.ids, self.used = rows, ids, total
        self.start = first
