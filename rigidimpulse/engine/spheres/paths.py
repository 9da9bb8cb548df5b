"""Free paths as rows of numbers, and how near they bring bodies to each other.

A row holds the numbers of a body that the kernel reads most often. Separate arrays would have to be passed from kernel to kernel one
by one, which takes longer than the work with them.
"""

from __future__ import annotations

from math import inf, sqrt

import numpy as np

from rigidimpulse.collision.time_of_impact.spheres import until_contact
from rigidimpulse.core.kernels import jit
from rigidimpulse.core.quaternion import rotated
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.core.vector import along, dot, length, scaled, subtract
from rigidimpulse.engine.pair_table import MARGIN
from rigidimpulse.engine.spheres.layout import OTHER
from rigidimpulse.motion.trajectory import FIXED

START, PLACE, VELOCITY, PULL, MOVES, RADIUS, GAP, KIND, DYNAMIC, PATH_SIZE = np.array([0, 1, 4, 7, 10, 11, 12, 13, 14, 15])
"""Columns of the paths (n, PATH_SIZE): start of the trajectory; place, velocity and acceleration there; 1 where the body moves. From RADIUS
on constants: bounding radius, contact margin of the body alone, kind, 1 for movable bodies."""
LEVEL, NORMAL, HEIGHT, BODY, PLANE_SIZE = np.array([3, 4, 7, 8, 9])
"""Columns of the planes (q, PLANE_SIZE): normal in the body's frame, level along it from the body's centre; normal in the world, level
along it from the origin; the body."""
_WIDER = 1.01
"""How much farther away than the margin counts as near."""
_CURVED = TOLERANCES.time_of_impact.curved_path


@jit
def write_path(trajectory, paths, i):
    """Write the row of body i from its trajectory; its constants stay."""
    row = paths[i]
    row[START], row[MOVES] = trajectory.start[i], trajectory.mode[i] != FIXED
    for k in range(3):
        row[PLACE + k], row[VELOCITY + k] = trajectory.position[i, k], trajectory.velocity[i, k]
        row[PULL + k] = trajectory.acceleration[i, k]


@jit
def place_planes(trajectory, planes):
    """Write normals and levels of the planes in the world."""
    for p in range(len(planes)):
        row, i = planes[p], np.int64(planes[p, BODY])
        q, x = trajectory.orientation[i], trajectory.position[i]
        n = rotated(q[0], q[1], q[2], q[3], row[0], row[1], row[2])
        row[NORMAL], row[NORMAL + 1], row[NORMAL + 2] = n
        row[HEIGHT] = row[LEVEL] + n[0] * x[0] + n[1] * x[1] + n[2] * x[2]


@jit
def _three(array, i, column):
    return array[i, column], array[i, column + 1], array[i, column + 2]


@jit
def _relative(paths, a, b, t):
    """Position, velocity and acceleration of b less those of a, by the same operations as `free_flight.relative_flight`."""
    x, v, pull = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    for side in range(2):
        i, sign = b if side else a, 1.0 if side else -1.0
        x = along(x, sign, _three(paths, i, PLACE))
        if paths[i, MOVES] > 0.0:
            s, start_velocity, own = t - paths[i, START], _three(paths, i, VELOCITY), _three(paths, i, PULL)
            x = along(x, sign * s, along(start_velocity, 0.5 * s, own))
            v = along(v, sign, along(start_velocity, s, own))
            pull = along(pull, sign, own)
    return x, v, pull


@jit
def contact_time(paths, planes, i, other, plane, start):
    """As `ball_time` for a ball i and another one, or plane number `plane` if that is not -1."""
    a, b = min(i, other), max(i, other)
    since = max(paths[a, START], paths[b, START])
    x, v, pull = _relative(paths, a, b, since)
    size = length(_three(paths, a, PLACE)) + length(_three(paths, b, PLACE))
    speed = length(_three(paths, a, VELOCITY)) + length(_three(paths, b, VELOCITY))
    reach, normal, level = 0.0, (0.0, 0.0, 0.0), 0.0
    if plane >= 0:
        normal, level, reach = scaled(_three(planes, plane, NORMAL), 1.0 if other == a else -1.0), planes[plane, LEVEL], paths[i, RADIUS]
    else:
        reach = paths[a, RADIUS] + paths[b, RADIUS]
    s = until_contact(x, v, pull, reach, size, speed, normal, level)
    return s if s != s or s == inf else max(since + s, start)


@jit
def near_gap(paths, i, other):
    """Gap up to which the loop in Python looks at a pair, m."""
    return _WIDER * MARGIN * min(paths[i, GAP], paths[other, GAP])


@jit
def _centre(paths, i, time):
    """Centre of body i at `time`, as three numbers."""
    x = _three(paths, i, PLACE)
    if paths[i, MOVES] == 0.0:
        return x
    s = time - paths[i, START]
    return along(x, s, along(_three(paths, i, VELOCITY), 0.5 * s, _three(paths, i, PULL)))


@jit
def gap_at(paths, planes, i, other, plane, time):
    """Gap of the bounding spheres of bodies i and `other`, or of that of i and plane number `plane` if that is not -1, m."""
    x = _centre(paths, i, time)
    if plane >= 0:
        return dot(_three(planes, plane, NORMAL), x) - planes[plane, HEIGHT] - paths[i, RADIUS]
    return length(subtract(_centre(paths, other, time), x)) - paths[i, RADIUS] - paths[other, RADIUS]


@jit
def _fastest(paths, planes, i, other, plane, time, end):
    """Bound of the speed at which that gap changes until `end`, m/s."""
    _, v, pull = _relative(paths, other, i, time)
    if plane >= 0:
        n = _three(planes, plane, NORMAL)
        return abs(dot(n, v)) + abs(dot(n, pull)) * (end - time)
    return length(v) + length(pull) * (end - time)


@jit
def is_passing(paths, planes, i, other, plane, time, gap, live):
    """Whether the loop in Python would do nothing for two balls, or a ball and a plane, that are near at `time`.

    That is so where two things hold. Their gap is more than `live` contact margins, so that no contact acts. And they approach or part
    faster than twice sqrt(2 a delta), the speed of a contact that would be held; a is more than all accelerations that may press them.
    """
    contact_margin = min(paths[i, GAP], paths[other, GAP])
    if paths[i, KIND] == OTHER or paths[other, KIND] == OTHER or not gap > live * contact_margin:
        return False
    a, b = min(i, other), max(i, other)
    x, v, _ = _relative(paths, a, b, time)
    n = _three(planes, plane, NORMAL) if plane >= 0 else scaled(x, 1.0 / length(x))
    speed, fast = abs(dot(n, v)), length(v)
    pull = length(_three(paths, i, PULL)) + length(_three(paths, other, PULL)) + _CURVED * fast * fast / paths[i, RADIUS]
    return speed > 2.0 * sqrt(2.0 * pull * contact_margin) + _CURVED * fast


@jit
def _march(paths, planes, i, other, plane, near, number, last, clock):
    """The first boundary from number `number` to `last` at which a gap is at most `near` and the loop may act; inf if there is none."""
    fastest = _fastest(paths, planes, i, other, plane, clock.now, clock.end)
    while number <= last:
        time = number * clock.step
        left = gap_at(paths, planes, i, other, plane, time) - near
        if left <= 0.0:
            if not is_passing(paths, planes, i, other, plane, time, left + near, clock.live):
                return time
            left = 0.0
        if left >= fastest * (last * clock.step - time):
            return inf
        number = max(number + 1, np.int64((time + left / fastest) / clock.step))
    return inf


@jit
def near_boundary(paths, planes, i, other, plane, near, until, clock):
    """The first boundary after now, up to the time `until` and before the end of the interval, with a gap of at most `near`; else inf.

    Most pairs need no march: over a plane without a pull away from it the least gap is that of the first or of the last boundary; two
    balls without relative acceleration come nearer until they are closest, and part after it.
    """
    first, last = clock.number, np.int64(min(until, clock.end) / clock.step)
    # Round-off of the division may put the last boundary too late.
    while last * clock.step > until or last * clock.step >= clock.end:
        last -= 1
    if first > last:
        return inf
    begin, final = first * clock.step, last * clock.step
    if plane >= 0:
        if dot(_three(planes, plane, NORMAL), _three(paths, i, PULL)) <= 0.0:
            # The gap over a plane is concave in time, so it is least at an end.
            least = gap_at(paths, planes, i, other, plane, begin)
            if min(least, gap_at(paths, planes, i, other, plane, final)) > near:
                return inf
    else:
        x, v, pull = _relative(paths, i, other, begin)
        if dot(pull, pull) == 0.0:
            square = dot(v, v)
            # Without relative acceleration |x + v s| is least at s = -x.v / v^2.
            closest = min(max(-dot(x, v), 0.0) / square if square > 0.0 else 0.0, final - begin)
            if length(along(x, closest, v)) - paths[i, RADIUS] - paths[other, RADIUS] > near:
                return inf
    return _march(paths, planes, i, other, plane, near, first, last, clock)


@jit
def last_apart(paths, planes, i, other, plane, near, clock):
    """The last boundary, or now, before which bounding spheres are surely not near; inf if that is not until the interval ends."""
    fastest = _fastest(paths, planes, i, other, plane, clock.now, clock.end)
    time = clock.now
    while True:
        left = gap_at(paths, planes, i, other, plane, time) - near
        if left <= 0.0:
            return time
        if left >= fastest * (clock.end - time):
            return inf
        boundary = np.int64((time + left / fastest) / clock.step) * clock.step
        if boundary <= time:
            return time
        time = boundary


@jit
def swept_box(paths, i, clock, low, high):
    """Write the box of body i's bounding sphere on its way from now to the end of the interval, wide enough for all that is near."""
    x, h = _centre(paths, i, clock.now), clock.end - clock.now
    s, wide = clock.now - paths[i, START], paths[i, RADIUS] + near_gap(paths, i, i)
    for k in range(3):
        a = paths[i, PULL + k] if paths[i, MOVES] > 0.0 else 0.0
        v = paths[i, VELOCITY + k] + s * a if paths[i, MOVES] > 0.0 else 0.0
        last = x[k] + h * (v + 0.5 * h * a)
        least, most = min(x[k], last), max(x[k], last)
        if 0.0 < -v < a * h or a * h < -v < 0.0:
            apex = x[k] - 0.5 * v * v / a
            least, most = min(least, apex), max(most, apex)
        low[i, k], high[i, k] = least - wide, most + wide

