"""Random cases as lists of the numbers that were chosen for them: they can be kept, made again, and made simpler.

A generator asks a `Source` for its choices (`scene_plans.py`). `Recorded` notes what dice choose. `Replayed` gives these numbers again, as
far as they go, and the simplest ones after them. So any shorter list, and any list with other numbers, is a case, too.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any

from scene_plans import Dice

DIGITS = 2
"""Of real numbers, that are tried first."""


class Recorded(Dice):
    """Dice whose choices are noted.

    Attributes:
        chosen: all numbers so far; of options, their places.

    """

    def __init__(self, seed: int) -> None:
        super().__init__(seed)
        self.chosen: list[float] = []

    def real(self, low: float, high: float) -> float:
        """See `scene_plans.Source`."""
        self.chosen.append(super().real(low, high))
        return self.chosen[-1]

    def integer(self, low: int, high: int) -> int:
        """See `scene_plans.Source`."""
        self.chosen.append(super().integer(low, high))
        return int(self.chosen[-1])


class Replayed:
    """Choices from a list, brought into the limits; beyond its end the simplest: the first option, the number nearest to 0."""

    def __init__(self, chosen: Sequence[float]) -> None:
        self._left = iter(chosen)

    def real(self, low: float, high: float) -> float:
        """See `scene_plans.Source`."""
        return min(max(float(next(self._left, 0.0)), low), high)

    def integer(self, low: int, high: int) -> int:
        """See `scene_plans.Source`."""
        return min(max(int(next(self._left, low)), low), high)

    def pick(self, options: Sequence[Any]) -> Any:
        """See `scene_plans.Source`."""
        return options[self.integer(0, len(options) - 1)]


def simpler(chosen: Sequence[float]) -> Iterator[list[float]]:
    """Lists that are simpler than this one, the most daring ones first: ends cut off, pieces left out, zeros, fewer digits."""
    values = list(chosen)
    size = len(values)
    while size > 0:
        for first in range(0, len(values), size):
            yield values[:first] + values[first + size :]
            if any(values[first : first + size]):
                yield values[:first] + [0] * len(values[first : first + size]) + values[first + size :]
        size //= 2
    for k, value in enumerate(values):
        for other in dict.fromkeys([float(round(value)), round(value, DIGITS), int(value) - 1 if value == int(value) > 0 else value]):
            if other != value:
                yield [*values[:k], other, *values[k + 1 :]]


def smallest(chosen: Sequence[float], still_fails: Callable[[list[float]], bool], may_go_on: Callable[[], bool]) -> list[float]:
    """The simplest list found that still fails, while time is left; each that is found is made simpler in its turn."""
    best = list(chosen)
    found = True
    while found:
        found = False
        for candidate in simpler(best):
            if not may_go_on():
                return best
            if still_fails(candidate):
                best, found = candidate, True
                break
    return best
