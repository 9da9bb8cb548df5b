"""When two balls, or a ball and a plane, meet: in closed form, from their trajectories alone.

With x, v, a the position, velocity and acceleration of b's centre as seen from a's at t0, the instant since which both
trajectories hold, and s = t - t0:

    ball and plane     g(s) = n.x - r + n.v s + 1/2 n.a s^2 = 0         the root at which g falls
    two balls, a = 0   |x + v s| = r,   s = s_c - sqrt(r^2 - |x + v s_c|^2) / |v|,   s_c = -x.v / v^2
    two balls          Newton's method from the safe side (`free_flight.spheres_safe_until`)

The distance of closest approach x + v s_c is small where it matters, so s has no cancellation. A pair that touches and
leaves needs no gap of its own: the root at which it came is not the one at which g falls again. So the time depends on
the trajectories alone, and not on the instant at which it is computed.
"""

from __future__ import annotations

from math import inf, nan, sqrt
from typing import NamedTuple

import numpy as np

from rigidimpulse.collision.time_of_impact.free_flight import relative_flight, spheres_safe_until
from rigidimpulse.collision.time_of_impact.motion_bound import put
from rigidimpulse.collision.time_of_impact.scratch_layout import FIRST, GAP, NORMAL, POINT_FIRST, POINT_SECOND, SECOND
from rigidimpulse.collision.time_of_impact.separating_quadratic import safe_until
from rigidimpulse.core.kernels import jit, jit_making_arrays
from rigidimpulse.core.quaternion import rotated
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.core.vector import along, dot, length, row, scaled, subtract
from rigidimpulse.motion.trajectory import FIXED, place_at

_ROUND_OFF = TOLERANCES.arithmetic.round_off
_APPROACH = TOLERANCES.contact.approach
DEEPEST = TOLERANCES.time_of_impact.sphere_depth
_NEWTON_ERROR = 10.0
"""Round-offs that may be left of the gap where Newton's method ends."""


class Pair(NamedTuple):
    """Two bodies and their shapes."""

    a: int
    b: int
    shape_a: int
    shape_b: int


@jit
def is_closed_form(trajectory, scratch, a, b, shape_a, shape_b, impact_margin):
    """Whether the pair is two balls, or a ball and a plane that stands, and is to meet at gap 0.

    Where it has just been in contact `impact_margin` [m] may be lower by round-off. Lower still, the pair was in contact without
    consequence.
    """
    plane_a, plane_b = scratch.plane[shape_a] >= 0, scratch.plane[shape_b] >= 0
    if not ((scratch.ball[shape_a] or plane_a) and (scratch.ball[shape_b] or plane_b)) or (plane_a and plane_b):
        return False
    if impact_margin > 0.0 or impact_margin < -DEEPEST * scratch.reach[shape_b if plane_a else shape_a]:
        return False
    return not ((plane_a and trajectory.mode[a] != FIXED) or (plane_b and trajectory.mode[b] != FIXED))


@jit
def plane_time(normal, level, x, v, acceleration, slack, still):
    """Seconds until a ball with its centre at `level` along the normal meets a plane, as `balls_time`."""
    gap, closing = dot(normal, x) - level, -dot(normal, v)
    if gap <= slack and abs(closing) <= still:
        return nan
    return safe_until(gap, closing, -dot(normal, acceleration), inf)


@jit
def balls_time(x, v, acceleration, reach, slack, still):
    """Seconds until two balls meet, inf if they do not; nan where they touch and hover, or no root is found."""
    distance, approach = length(x), -dot(x, v)
    if distance - reach <= slack and abs(approach) <= still * distance:
        return nan
    if length(acceleration) == 0.0:
        if approach <= 0.0:
            return inf
        square = dot(v, v)
        closest = approach / square
        beside = along(x, closest, v)
        left = reach * reach - dot(beside, beside)
        return closest - sqrt(left / square) if left > 0.0 else inf
    s = spheres_safe_until(x, v, acceleration, (0.0, 0.0, 0.0), reach, True, inf)
    if s < inf:
        gap = length(along(x, s, along(v, 0.5 * s, acceleration))) - reach
        if abs(gap) > _NEWTON_ERROR * (slack + _ROUND_OFF * s * (length(v) + s * length(acceleration))):
            return nan
    return s


@jit
def until_contact(x, v, acceleration, reach, size, speed, normal, level):
    """Seconds until a pair meets whose relative flight is x, v, acceleration; as `balls_time`.

    reach: m, sum of the radii; size, speed: sums of the distances from the origin, m, and of the speeds, m/s; normal: that of a plane
    from a to b, zeros for two balls; level: m, of the plane along its own normal.
    """
    slack, still = _ROUND_OFF * (size + reach), _APPROACH * speed
    if normal[0] != 0.0 or normal[1] != 0.0 or normal[2] != 0.0:
        return plane_time(normal, level + reach, x, v, acceleration, slack, still)
    return balls_time(x, v, acceleration, reach, slack, still)


@jit
def ball_time(frame, trajectory, scratch, pair, start):
    """Time from `start` on at which a pair of `is_closed_form` meets, inf if it never does; nan where the general search must be used.

    frame (p, 7): that of the geometry; trajectory: paths of all bodies, since before `start` [s]; scratch: `SweepScratch`; pair: `Pair`.
    """
    a, b, shape_a, shape_b = pair
    # From the instant since which both trajectories hold: the time then does not depend on when it is computed.
    since = max(trajectory.start[a], trajectory.start[b])
    x, v, acceleration, jerk = relative_flight(trajectory, a, b, since)
    # Paths with jerk have no closed form.
    if jerk[0] != 0.0 or jerk[1] != 0.0 or jerk[2] != 0.0:
        return nan
    size = length(row(trajectory.position, a)) + length(row(trajectory.position, b))
    speed = length(row(trajectory.velocity, a)) + length(row(trajectory.velocity, b))
    plane_a, plane_b = scratch.plane[shape_a] >= 0, scratch.plane[shape_b] >= 0
    reach, normal, level = 0.0, (0.0, 0.0, 0.0), 0.0
    if plane_a or plane_b:
        i, p, sign = (a, scratch.plane[shape_a], 1.0) if plane_a else (b, scratch.plane[shape_b], -1.0)
        q = trajectory.orientation
        n = rotated(q[i, 0], q[i, 1], q[i, 2], q[i, 3], frame[p, 0], frame[p, 1], frame[p, 2])
        normal, level, reach = scaled(n, sign), frame[p, 3], scratch.reach[shape_b if plane_a else shape_a]
    else:
        reach = scratch.reach[shape_a] + scratch.reach[shape_b]
    s = until_contact(x, v, acceleration, reach, size, speed, normal, level)
    return s if s != s or s == inf else max(since + s, start)


@jit_making_arrays
def write_ball_witness(frame, trajectory, scratch, pair, t, witness):
    """Write points on a and b, the normal from a to b and the gap at t [s] into witness (10,); pairs of `is_closed_form`."""
    a, b, shape_a, shape_b = pair
    centre = np.empty((2, 3))
    place_at(trajectory, a, t, centre[0])
    place_at(trajectory, b, t, centre[1])
    x, y = row(centre, FIRST), row(centre, SECOND)
    plane_a, plane_b = scratch.plane[shape_a] >= 0, scratch.plane[shape_b] >= 0
    if plane_a or plane_b:
        i, p = (a, scratch.plane[shape_a]) if plane_a else (b, scratch.plane[shape_b])
        q, ball, radius = trajectory.orientation, y if plane_a else x, scratch.reach[shape_b if plane_a else shape_a]
        n = rotated(q[i, 0], q[i, 1], q[i, 2], q[i, 3], frame[p, 0], frame[p, 1], frame[p, 2])
        height = dot(n, subtract(ball, x if plane_a else y)) - frame[p, 3]
        on_plane, on_ball, gap = along(ball, -height, n), along(ball, -radius, n), height - radius
        put(witness, POINT_FIRST, on_plane if plane_a else on_ball)
        put(witness, POINT_SECOND, on_ball if plane_a else on_plane)
        put(witness, NORMAL, n if plane_a else scaled(n, -1.0))
        witness[GAP] = gap
        return
    distance = length(subtract(y, x))
    n = scaled(subtract(y, x), 1.0 / distance if distance > 0.0 else 0.0)
    put(witness, POINT_FIRST, along(x, scratch.reach[shape_a], n))
    put(witness, POINT_SECOND, along(y, -scratch.reach[shape_b], n))
    put(witness, NORMAL, n)
    witness[GAP] = distance - scratch.reach[shape_a] - scratch.reach[shape_b]
