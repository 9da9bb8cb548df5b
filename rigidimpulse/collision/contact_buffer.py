"""Buffers for the contacts that `contacts_of_pairs` finds; they grow when they are too small."""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np

from rigidimpulse.collision.geometry import Shapes
from rigidimpulse.collision.manifold.contact_points import Contacts
from rigidimpulse.collision.manifold.dispatch import ALL, PairQuery, contacts_of_pairs
from rigidimpulse.collision.manifold.kept_features import FEW_ROWS, MANY_PAIRS, MANY_ROWS, PLACES, make_contact_scratch

CONTACT_CAPACITY, PAIR_CAPACITY = 1024, 4096


class PosedBodies(Protocol):
    """Where n bodies are."""

    @property
    def position(self) -> np.ndarray:
        """(n, 3) m, of the principal frames."""
        ...


class Question(NamedTuple):
    """Pairs of bodies whose contacts are wanted, at their poses."""

    shapes: Shapes
    bodies: PosedBodies
    rotation: np.ndarray  # (n, 3, 3)
    pairs: PairQuery


class ContactBuffer:
    """Contacts as they are found.

    Attributes:
        contacts: as kernels take them, until they grow. real: (c, 10) and integer: (c, 5) of them, see `manifold.dispatch`.

    """

    def __init__(self, contacts: int = CONTACT_CAPACITY, keeps: bool = False) -> None:
        """Buffers for a small scene.

        Args:
            contacts: that they hold at first.
            keeps: whether features that are near are kept from question to question (`kept_features`): all are about the same shapes.

        """
        scratch = make_contact_scratch.py_func(*((MANY_PAIRS, PLACES, MANY_ROWS) if keeps else (PAIR_CAPACITY, 0, FEW_ROWS)))
        self.contacts = Contacts(np.empty((contacts, 10)), np.empty((contacts, 5), np.int64), scratch)

    def find(self, question: Question) -> int:
        """Find the contacts of pairs; returns their number."""
        count = contacts_of_pairs(*question, self.contacts, ALL)
        while count < 0:
            self.grow(-count)
            count = contacts_of_pairs(*question, self.contacts, ALL)
        return count

    def grow(self, needed: int) -> None:
        """Grow to at least `needed` contacts, and to twice the present capacity."""
        capacity = max(needed, 2 * len(self.real))
        self.contacts = Contacts(np.empty((capacity, 10)), np.empty((capacity, 5), np.int64), self.contacts.scratch)

    @property
    def real(self) -> np.ndarray:
        """(c, 10)."""
        return self.contacts.real

    @property
    def integer(self) -> np.ndarray:
        """(c, 5)."""
        return self.contacts.integer


def find_together(buffers: list[ContactBuffer], questions: list[Question]) -> list[int]:
    """Numbers of contacts found for each question, each in its own buffer, on several cores."""
    asked = list(zip(buffers, questions, strict=True))
    counts = contacts_of_pairs.together([(*question, buffer.contacts, ALL) for buffer, question in asked])
    for k, (buffer, question) in enumerate(asked):
        if counts[k] < 0:
            buffer.grow(-counts[k])
            counts[k] = buffer.find(question)
    return counts
