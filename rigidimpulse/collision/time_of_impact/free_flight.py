"""Safe time of bounding spheres and planes: from the centres of mass alone, exact on their parabolas and cubics.

It clears most pairs before their shapes are looked at, and for two balls, or a ball and a plane, it is the answer
itself.
"""

from __future__ import annotations

from math import inf

from rigidimpulse.collision.time_of_impact.separating_quadratic import cubic_safe_until
from rigidimpulse.core.kernels import jit
from rigidimpulse.core.quaternion import rotated
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.core.vector import along, dot, length, row, scaled
from rigidimpulse.motion.trajectory import FIXED, JERK, rate_of

_MAX_STEPS = 100  # Newton's method on spheres: 5 to 6 steps, a few dozen where they graze
_ROUND_OFF = TOLERANCES.arithmetic.round_off


@jit
def relative_flight(trajectory, a, b, t):
    """Position, velocity, acceleration and jerk of b's centre of mass less those of a."""
    x, v, acceleration, jerk = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    for side in range(2):
        i, sign = b if side else a, 1.0 if side else -1.0
        x = along(x, sign, row(trajectory.position, i))
        if trajectory.mode[i] != FIXED:
            s = t - trajectory.start[i]
            pull, growth = row(trajectory.acceleration, i), rate_of(trajectory, i, JERK)
            start_velocity = row(trajectory.velocity, i)
            x = along(x, sign * s, along(start_velocity, 0.5 * s, along(pull, s / 3.0, growth)))
            v = along(v, sign, along(start_velocity, s, along(pull, 0.5 * s, growth)))
            acceleration = along(acceleration, sign, along(pull, s, growth))
            jerk = along(jerk, sign, growth)
    return x, v, acceleration, jerk


@jit
def rounding_slack(trajectory, reach, a, b, shape_a, shape_b, end):
    """How far rounding can move the gap of a pair until `end`, m: relative to the coordinates of its path."""
    size = 0.0
    for side in range(2):
        i, shape = b if side else a, shape_b if side else shape_a
        s = end - trajectory.start[i]
        size += length(row(trajectory.position, i))
        if trajectory.mode[i] != FIXED:
            mean = along(row(trajectory.acceleration, i), s / 3.0, rate_of(trajectory, i, JERK))
            size += s * length(along(row(trajectory.velocity, i), 0.5 * s, mean))
        if reach[shape] < inf:
            size += reach[shape]
    return _ROUND_OFF * size


@jit
def spheres_safe_until(x, v, a, jerk, reach, exact, horizon):
    """Safe time of two spheres whose centres are `reach` apart at the threshold; `exact`: carried to the very end.

    Newton's method from the safe side: along the fixed line of centres the distance is bounded by a cubic without
    error, so no step passes the root, and the steps converge to it quadratically.
    """
    s = 0.0
    for _ in range(_MAX_STEPS):
        between = along(x, s, along(v, 0.5 * s, along(a, s / 3.0, jerk)))
        distance = length(between)
        if distance <= reach and (s > 0.0 or not exact):
            return s
        normal = scaled(between, -1.0 / distance if distance > 0.0 else 0.0)
        speed, pull = along(v, s, along(a, 0.5 * s, jerk)), along(a, s, jerk)
        # Along the fixed line of centres the distance is at least a cubic: its root is a safe step.
        step = cubic_safe_until(distance - reach, dot(normal, speed), dot(normal, pull), dot(normal, jerk), horizon - s)
        if s + step >= horizon:
            return horizon
        if s + step == s:
            return s
        s += step
    return s


@jit
def plane_safe_until(trajectory, i, plane, ball, flight, horizon):
    """Safe time of a plane of body i, which does not turn, and a sphere.

    plane: (normal in the axes of the body, height of the sphere's centre at the threshold); ball: whether the sphere is the shape; flight:
    the sphere's `relative_flight` from the plane's body.
    """
    (normal_x, normal_y, normal_z), level = plane
    x, v, a, jerk = flight
    q = trajectory.orientation
    normal = rotated(q[i, 0], q[i, 1], q[i, 2], q[i, 3], normal_x, normal_y, normal_z)
    gap = dot(normal, x) - level
    if gap <= 0.0 and not ball:
        return 0.0
    return cubic_safe_until(gap, -dot(normal, v), -dot(normal, a), -dot(normal, jerk), horizon)
