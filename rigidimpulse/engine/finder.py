"""Buffers for the contacts that are found at an instant; see `touching` for the kernels and `islands` for who asks."""

from __future__ import annotations

import numpy as np

from rigidimpulse.collision.contact_buffer import ContactBuffer
from rigidimpulse.engine.touching import Found


class Finder:
    """Buffers for the contacts of an instant.

    Attributes:
        links: (l, 2) bodies that joints and forces join, as they were when islands were looked for last.

    """

    def __init__(self, num_bodies: int) -> None:
        """Buffers for a small scene."""
        self.buffer = ContactBuffer()
        self.links = np.zeros((0, 2), np.int64)
        self._marks = np.zeros((2, num_bodies), bool)
        self._take()

    def _take(self) -> None:
        buffers = self.buffer.contacts
        self.found = Found(buffers, np.empty(len(buffers.real), np.int64), *self._marks)

    def grow(self, needed: int) -> None:
        """Make space for `needed` contacts."""
        self.buffer.grow(needed)
        self._take()
