"""Lengths and times as people say them."""

from __future__ import annotations

import math

UNITS = ((1.0, "m"), (1e-3, "mm"), (1e-6, "µm"), (1e-9, "nm"))
LEAST = 1e-10
"""m; smaller lengths are called less than this."""
EQUAL = 1.25
"""Ratio below which two times are called the same: times of runs vary by as much."""


def length(value: float, up: bool = True) -> str:
    """A length in m with two digits, rounded up (an error is not larger than this) or down (it is not smaller)."""
    if not math.isfinite(value):
        return "infinitely far"
    if value < LEAST:
        return "0.1 nm"
    factor, unit = next(((factor, unit) for factor, unit in UNITS if value >= 0.9995 * factor), UNITS[-1])
    return f"{_two_digits(value / factor, up)} {unit}"


def seconds(value: float) -> str:
    """A time in s with two digits, not below a millisecond."""
    if value >= 10.0:
        return f"{value:.0f} s"
    return f"{value:.2g} s" if value >= 1e-3 else "less than 1 ms"


def motion_time(value: float) -> str:
    """A time of the motion in s, as exact as a frame."""
    return f"{value:.2f}".rstrip("0").rstrip(".") + " s"


def cost(own: float, other: float) -> str:
    """What a run took beside another, s both: the same time, or its seconds."""
    return "the same time" if max(own, other) < EQUAL * min(own, other) else seconds(own)


def _two_digits(value: float, up: bool) -> str:
    digits = 1 - math.floor(math.log10(value))
    scaled = value * 10.0**digits
    rounded = (math.ceil(scaled - 1e-9) if up else math.floor(scaled + 1e-9)) / 10.0**digits
    return f"{rounded:.{max(digits, 0)}f}".rstrip("0").rstrip(".") if digits > 0 else f"{rounded:.0f}"
