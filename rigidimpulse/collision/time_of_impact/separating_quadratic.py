"""The quadratic under every safe time: the gap of a point or a cylinder along a direction that the other body carries.

With n fixed in the carrier, g the present gap along n and y the path of a point as seen from the carrier (see `bound`),

    gap(s) >= g + n.y' s + 1/2 n.y'' s^2 - J s^3 / 6 >= g - c s - 1/2 a s^2   for s <= h,
    c = -n.y',   a = -n.y'' + J h / 3,   J = J_c + J_r |r|

so the gap stays above a threshold until the first root of the right side. A point that is at or below its threshold
but leaving stays above its present gap until it comes back to it.

Both rates grow linearly with the arm, so that for many points along one n they cost two dot products each (`write_view`):

    n.y' = n.u + (n x w).r,    n.y'' = n.c + (n x beta + (n.w) w - w^2 n).r

A cylinder with unit axis e, half height H and rim radius R reaches from its centre by the support H |n.e| + R |n x e|
along -n. With q = n.e and N = n x e (q', q'', N', N'' from e' = w x e, e'' = beta x e + w x (w x e), |e'''| <= J_r),
over s in [0, h]:

    |q(s)|  <=  chord of |q + q' s|  + |q''| s^2 / 2 + J_r s^3 / 6      a convex function over [0, h] is below its chord
    |q(s)|  <=  sign(q) (q + q' s + q'' s^2 / 2) + J_r s^3 / 6          as long as q keeps its sign
    |N(s)|  <=  chord of |N + N' s|  + |N''| s^2 / 2 + J_r s^3 / 6      sharp for a cylinder that stands or lies
    |N(s)|  <=  (|N(s)|^2 + |N|^2) / (2 |N|),   |N(s)|^2 = 1 - q(s)^2   sharp for one that leans and rolls on its rim

(the last is the inequality of the means).

For centres of mass with a jerk j, of whose paths the gap along a fixed direction is known without error, the first root of the
cubic  g - c s - 1/2 a s^2 - 1/6 j s^3  is found between the points where it turns, by steps from quadratics below it.
"""

from __future__ import annotations

from math import sqrt

from rigidimpulse.collision.time_of_impact.motion_bound import (
    SEEN_ACCELERATION,
    SEEN_ARM_JERK,
    SEEN_JERK,
    SEEN_SPIN,
    SEEN_SPIN_SIZE,
    SEEN_TURN,
    SEEN_TURN_SIZE,
    SEEN_VELOCITY,
    put,
    seen_motion,
    vector,
)
from rigidimpulse.core.kernels import jit
from rigidimpulse.core.vector import along, cross, dot, length
from rigidimpulse.motion.trajectory import turning_points

_MAX_STEPS = 100  # on a cubic: 5 to 8, a few dozen where it grazes


@jit
def safe_until(gap, closing, bend, horizon):
    """First s in [0, horizon] with gap - closing s - bend s^2 / 2 = 0, else horizon.

    `gap` is what is left above the threshold. Without anything left: 0 if closing, else the time of return to the
    present gap.
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
        # The form of the root without cancellation.
        return min(horizon, 2.0 * gap / (closing + sqrt(square)))
    return min(horizon, (sqrt(square) - closing) / bend)


@jit
def cubic_safe_until(gap, closing, bend, jerk, horizon):
    """First s in [0, horizon] with gap - closing s - bend s^2 / 2 - jerk s^3 / 6 = 0, else horizon; as `safe_until`."""
    if jerk == 0.0:
        return safe_until(gap, closing, bend, horizon)
    if gap <= 0.0:
        return 0.0 if closing > 0.0 else safe_until(-closing, 0.5 * bend, jerk / 3.0, horizon)
    first, second = turning_points(closing, bend, jerk)
    s = 0.0
    for trial in range(3):
        end = min(first if trial == 0 else (second if trial == 1 else horizon), horizon)
        if not end > s:
            continue
        if gap - end * (closing + end * (0.5 * bend + end * jerk / 6.0)) > 0.0:
            s = end
            continue
        # Along a span on which the gap falls; a quadratic that bends by the most of it stays below.
        for _ in range(_MAX_STEPS):
            left = gap - s * (closing + s * (0.5 * bend + s * jerk / 6.0))
            speed, most = closing + s * (bend + 0.5 * s * jerk), bend + s * jerk + max(jerk * (end - s), 0.0) / 3.0
            step = safe_until(left, speed, most, end - s) if left > 0.0 else 0.0
            if s + step == s:
                return s
            s += step
        return s
    return horizon


@jit
def point_safe_until(work, seen, normal, arm, reach, gap, horizon):
    """Safe time of all points within `reach` of the one at `arm`, along a carried normal that points at them.

    `seen`: place in `work` of their motion as seen from the carrier; `gap`: what is left above the threshold, m.
    """
    velocity, acceleration = seen_motion(work, seen, arm)
    jerk = work[seen + SEEN_JERK] + work[seen + SEEN_ARM_JERK] * (length(arm) + reach)
    closing = work[seen + SEEN_SPIN_SIZE] * reach - dot(normal, velocity)
    bend = work[seen + SEEN_TURN_SIZE] * reach - dot(normal, acceleration)
    return safe_until(gap, closing, bend + jerk * horizon / 3.0, horizon)


@jit
def write_view(work, seen, normal, view):
    """Write how points seen move along a carried normal: n.u, n x w, n.c and the vector of n.y'', VIEW_SIZE numbers at `view`."""
    w = vector(work, seen + SEEN_SPIN)
    across = cross(normal, vector(work, seen + SEEN_TURN))
    work[view] = dot(normal, vector(work, seen + SEEN_VELOCITY))
    put(work, view + 1, cross(normal, w))
    work[view + 4] = dot(normal, vector(work, seen + SEEN_ACCELERATION))
    put(work, view + 5, along(along(across, dot(normal, w), w), -dot(w, w), normal))


@jit
def viewed_safe_until(work, seen, view, sign, ball, gap, horizon):
    """As `point_safe_until`, along the normal of a view (sign 1) or against it (-1); ball: (arm, |arm|, reach), m."""
    arm, far, reach = ball
    speed = work[view] + dot(vector(work, view + 1), arm)
    bend = work[view + 4] + dot(vector(work, view + 5), arm)
    closing = work[seen + SEEN_SPIN_SIZE] * reach - sign * speed
    bend = work[seen + SEEN_TURN_SIZE] * reach - sign * bend
    jerk = work[seen + SEEN_JERK] + work[seen + SEEN_ARM_JERK] * (far + reach)
    return safe_until(gap, closing, bend + jerk * horizon / 3.0, horizon)


@jit
def _end_growth(q, rate, bend, rest, horizon):
    """Return (rate, bend) of a quadratic above |q(s)| - |q| on [0, horizon]; `rest`: J_r h / 3."""
    if abs(q) > horizon * (abs(rate) + 0.5 * horizon * (abs(bend) + rest)):
        sign = 1.0 if q > 0.0 else -1.0
        return sign * rate, sign * bend + rest
    return (abs(q + rate * horizon) - abs(q)) / horizon, abs(bend) + rest


@jit
def cylinder_safe_until(work, seen, normal, cylinder, gap, horizon):
    """Safe time of a cylinder, as `point_safe_until`; cylinder: (arm of its centre, unit axis, half height, radius), axes of `seen`."""
    arm, axis, half_height, radius = cylinder
    if horizon <= 0.0:
        return 0.0
    w = vector(work, seen + SEEN_SPIN)
    axis_rate = cross(w, axis)
    axis_bend = along(cross(vector(work, seen + SEEN_TURN), axis), 1.0, cross(w, axis_rate))
    jerk = work[seen + SEEN_ARM_JERK]
    rest = jerk * horizon / 3.0
    q, q_rate, q_bend = dot(normal, axis), dot(normal, axis_rate), dot(normal, axis_bend)
    end_rate, end_bend = _end_growth(q, q_rate, q_bend, rest, horizon)
    velocity, acceleration = seen_motion(work, seen, arm)
    closing = half_height * end_rate - dot(normal, velocity)
    bend = (
        half_height * end_bend - dot(normal, acceleration) + rest * length(arm) + work[seen + SEEN_JERK] * horizon / 3.0
    )

    side = cross(normal, axis)
    size = length(side)
    rim_rate = (length(along(side, horizon, cross(normal, axis_rate))) - size) / horizon
    rim_bend = length(cross(normal, axis_bend)) + rest
    best = safe_until(gap, closing + radius * rim_rate, bend + radius * rim_bend, horizon)
    if best >= horizon or size == 0.0:
        return best
    fastest_bend = abs(q_bend) + jerk * horizon
    third = 6.0 * (abs(q_rate) + fastest_bend * horizon) * fastest_bend + 2.0 * jerk  # of q(s)^2
    rim_rate = -q * q_rate / size
    rim_bend = (third * horizon / 6.0 - q_rate * q_rate - q * q_bend) / size
    return max(best, safe_until(gap, closing + radius * rim_rate, bend + radius * rim_bend, horizon))
