"""How the accuracy of a run was chosen to meet an accuracy target."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

from rigidimpulse.scene.accuracy import Accuracy
from rigidimpulse.scene.accuracy_targets import AccuracyTarget, Within


class Estimate(NamedTuple):
    """Estimated largest errors of a run, m and rad."""

    position: float
    angle: float

    def within(self, target: Within) -> bool:
        """Whether the errors are within the bounds of a target."""
        return (target.position is None or self.position <= target.position) and (target.angle is None or self.angle <= target.angle)


UNKNOWN = Estimate(math.nan, math.nan)


class Try(NamedTuple):
    """One run that was made to choose: its accuracy, the seconds it took, its estimated error (NaN where it was not estimated)."""

    accuracy: Accuracy
    seconds: float
    error: Estimate


@dataclass(frozen=True)
class Choice:
    """How an accuracy was chosen.

    Attributes:
        target: the accuracy target. accuracy: the one that was chosen. met: whether the target is met.
        error: estimated largest errors until `until` [s]. how: how they were estimated.
        tries: all runs that were made, coarse ones first.

    """

    target: AccuracyTarget
    accuracy: Accuracy
    met: bool
    error: Estimate
    until: float
    how: str
    tries: tuple[Try, ...]

    @property
    def message(self) -> str:
        """One line for people."""
        chosen = f"chose step {self.accuracy.step:.4g} s, tolerance {self.accuracy.tolerance:.0e}, of {len(self.tries)} measured settings"
        error = f"estimated error until {self.until:.4g} s: {self.error.position:.1e} m, {self.error.angle:.1e} rad ({self.how})"
        return f"{chosen}; {error}"
