"""The quadratic under every safe time: the gap of a point along a direction that its carrier takes along.

With n fixed in the carrier, g the present gap along n and y the path of the point as seen from the carrier (see `bound`),

    gap(s) >= g + n.y' s + 1/2 n.y'' s^2 - J s^3 / 6 >= g - c s - 1/2 a s^2   for s <= h,
    c = -n.y',   a = -n.y'' + J h / 3,   J = J_c + J_r |r|

so the gap stays above a threshold until the first root of the right side. A point that is at or below its threshold but leaving stays
above its present gap until it comes back to it.
"""

from __future__ import annotations

from math import sqrt

from rigidimpulse._jit import jit
from rigidimpulse.detect.features import dot
from rigidimpulse.sweep.bound import SEEN_ARM_JERK, SEEN_JERK, length, seen_acceleration, seen_velocity


@jit
def safe_until(gap, closing, bend, horizon):
    """First s in [0, horizon] with gap - closing s - bend s^2 / 2 = 0, else horizon; `gap` is what is left above the threshold.

    Without anything left: 0 if closing, else the time of return to the present gap.
    """
    if gap <= 0.0:
        if closing > 0.0:
            return 0.0
        return min(horizon, -2.0 * closing / bend) if bend > 0.0 else horizon
    if gap - closing * horizon - 0.5 * max(bend, 0.0) * horizon * horizon > 0.0:
        return horizon
    square = closing * closing + 2.0 * bend * gap
    if square < 0.0 or (bend <= 0.0 and closing <= 0.0):
        return horizon
    if closing > 0.0:
        return min(horizon, 2.0 * gap / (closing + sqrt(square)))
    return min(horizon, (sqrt(square) - closing) / bend)


@jit
def jerk_term(seen, distance, horizon):
    """J h / 3 of a point at that distance from its body's centre of mass."""
    return (seen[SEEN_JERK] + seen[SEEN_ARM_JERK] * distance) * horizon / 3.0


@jit
def point_safe_until(seen, normal, arm, gap, horizon):
    """Safe time of the point at `arm` along `normal`, which its carrier takes along and which points at the moving body."""
    closing = -dot(normal, seen_velocity(seen, arm))
    bend = jerk_term(seen, length(arm), horizon) - dot(normal, seen_acceleration(seen, arm))
    return safe_until(gap, closing, bend, horizon)
