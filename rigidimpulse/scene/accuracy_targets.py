"""Accuracy targets: bounds on the errors of a run, or on its time, instead of an `Accuracy`."""

from __future__ import annotations

import math
from dataclasses import dataclass

from rigidimpulse.core.errors import SceneError


@dataclass(frozen=True)
class Within:
    """An accuracy target: errors within bounds.

    Attributes:
        position: m, of any dynamic body's origin. angle: rad, of its orientation. At least one is given.
        until: s, how long the bounds are to hold; all of the run if None.

    """

    position: float | None = None
    angle: float | None = None
    until: float | None = None

    def __post_init__(self) -> None:
        """Check the numbers."""
        if self.position is None and self.angle is None:
            raise SceneError("Within() sets no bound", "give position=... in m, or angle=... in rad")
        for name, unit in (("position", "m"), ("angle", "rad"), ("until", "s")):
            _check_positive(f"Within({name}=...)", getattr(self, name), unit)


@dataclass(frozen=True)
class InTime:
    """An accuracy target: as accurate as the time allows.

    Attributes:
        per_frame: s that a frame may take to compute, on this machine and under its present load, in the mean over the run.

    """

    per_frame: float

    def __post_init__(self) -> None:
        """Check the number."""
        _check_positive("InTime(per_frame=...)", self.per_frame, "s")


AccuracyTarget = Within | InTime


def _check_positive(what: str, value: object, unit: str) -> None:
    if value is not None and not (isinstance(value, int | float) and math.isfinite(value) and value > 0.0):
        raise SceneError(f"{what}: {value!r}", f"give a positive finite number, {unit}")
