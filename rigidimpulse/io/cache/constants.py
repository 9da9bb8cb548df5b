"""The parts of a run that its checkpoints do not hold, by number.

They are the scene with all that people put into it (functions among it, which have no bytes), compiled shapes, their geometry and the like.
A run that goes on has compiled them again, and walks them in the same order.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable
from typing import Any, Self

ATOMS = (str, bytes, int, float, bool, complex, type(None), type)


class Constants:
    """Objects that a run does not change, and their numbers."""

    def __init__(self, roots: Iterable[Any]) -> None:
        """Walk the roots, depth first, by fields, items and array attributes."""
        self.objects: list[Any] = []
        self._number: dict[int, int] = {}
        waiting = list(roots)[::-1]
        while waiting:
            thing = waiting.pop()
            if isinstance(thing, ATOMS) or id(thing) in self._number:
                continue
            self._number[id(thing)] = len(self.objects)
            self.objects.append(thing)
            waiting.extend(_parts(thing)[::-1])

    @classmethod
    def of(cls, objects: Iterable[Any]) -> Self:
        """Just these objects, not what they consist of."""
        constants = cls(())
        constants.objects = list(objects)
        constants._number = {id(thing): number for number, thing in enumerate(constants.objects)}
        return constants

    def number(self, thing: Any) -> int | None:
        """Number of a constant, None for anything else."""
        return self._number.get(id(thing))


def _parts(thing: Any) -> list[Any]:
    """What a constant consists of, always in the same order; caches that fill up while it is used are no part of it."""
    if dataclasses.is_dataclass(thing):
        return [getattr(thing, field.name) for field in dataclasses.fields(thing)]
    if isinstance(thing, dict):
        return list(thing.values())
    return list(thing) if isinstance(thing, list | tuple) else []
