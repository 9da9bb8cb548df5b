"""Collision filters: who collides with whom, by names of systems (KHR_physics_rigid_bodies, draft of the Khronos group, 2024).

A body belongs to systems S, and says with which it collides, C (all if not stated), and with which it does not, N.
It accepts another one if S' meets C and does not meet N; two bodies collide if each accepts the other. A body without a
filter belongs to no system and accepts all.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from rigidimpulse.core.errors import SceneError


@dataclass(frozen=True)
class CollisionFilter:
    """Systems of a body or trigger, and those it collides with.

    Attributes:
        systems: names of the systems that it belongs to.
        collide_with: only members of one of these collide with it; None: all.
        not_collide_with: no member of one of these collides with it.

    Raises:
        SceneError: a list is no list of names.

    """

    systems: Sequence[str] = ()
    collide_with: Sequence[str] | None = None
    not_collide_with: Sequence[str] = ()

    def __post_init__(self) -> None:
        """Keep the names as tuples, so that filters can be compared."""
        for name in ("systems", "collide_with", "not_collide_with"):
            value = getattr(self, name)
            if value is None and name == "collide_with":
                continue
            if not isinstance(value, list | tuple | set | frozenset) or not all(isinstance(entry, str) for entry in value):
                raise SceneError(f"{name} is {value!r}", "give a list of names", "collision filter")
            object.__setattr__(self, name, tuple(value))

    def accepts(self, other: CollisionFilter) -> bool:
        """Whether this side lets the other one touch it."""
        if self.collide_with is not None and not set(self.collide_with) & set(other.systems):
            return False
        return not set(self.not_collide_with) & set(other.systems)


NO_FILTER = CollisionFilter()


def may_meet(first: CollisionFilter | None, second: CollisionFilter | None) -> bool:
    """Whether two filters let each other touch; None belongs to no system and accepts all."""
    a, b = first or NO_FILTER, second or NO_FILTER
    return a.accepts(b) and b.accepts(a)


def pairs_filtered(filters: Iterable[CollisionFilter | None], dynamic: np.ndarray) -> np.ndarray:
    """Keys a * n + b, a < b, ascending, of the pairs of n bodies, at least one dynamic, whose filters do not let them meet.

    Args:
        filters: n of them. dynamic: (n,) bool.

    """
    given = list(filters)
    kinds = list(dict.fromkeys(given))
    if kinds in ([], [None]):
        return np.zeros(0, np.int64)
    apart = np.array([[not may_meet(a, b) for b in kinds] for a in kinds])
    kind = np.array([kinds.index(entry) for entry in given])
    n = len(given)
    keys = [np.zeros(0, np.int64)]
    for a in range(n):
        b = np.arange(a + 1, n)
        keys.append(a * n + b[apart[kind[a], kind[b]] & (dynamic[a] | dynamic[b])])
    return np.concatenate(keys)
