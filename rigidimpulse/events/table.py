"""When bodies meet next: the table of events and how its entries are timed.

Two balls, or a ball and a plane, have the time of their contact in closed form (`sweep.ball_time`). All that may happen
besides is left to the loop in Python, so an entry may also be a time at which it takes over:

    AT_BOUNDARY   a boundary of steps at which the pair is within the margin of contacts, where the loop looks at it, or
                  the last one before bounding spheres of other shapes may be within it
    AT_ONCE       the same, between boundaries, for a pair of which a body has just changed course

Boundaries at which a pair is near are found by steps that its gap, g > margin, allows for certain: g / (fastest speed).
"""

from __future__ import annotations

from math import inf, sqrt

import numpy as np

from rigidimpulse._jit import jit
from rigidimpulse.detect.groups import MARGIN
from rigidimpulse.detect.pair_table import path_box
from rigidimpulse.events.layout import AT_BOUNDARY, AT_ONCE, CONTACT, OTHER, PLANE
from rigidimpulse.events.queue import clear, schedule
from rigidimpulse.events.tree import build_tree, overlapping, replace_box
from rigidimpulse.integrate.course import FIXED, place_at
from rigidimpulse.sweep.ball_time import ball_time

_WIDER = 1.01
"""How much farther away than the margin counts as near."""


@jit
def near_gap(fixed, a, b):
    """Gap up to which the loop in Python looks at a pair, m."""
    return _WIDER * MARGIN * fixed.contact_gap * min(fixed.size[a], fixed.size[b])


@jit
def gap_at(fixed, course, i, other, plane, time):
    """Gap of the bounding spheres of bodies i and `other`, or of that of i and plane number `plane` if that is not -1, m."""
    x, y = np.empty(3), np.empty(3)
    place_at(course, i, time, x)
    if plane >= 0:
        n = fixed.normal[plane]
        return n[0] * x[0] + n[1] * x[1] + n[2] * x[2] - fixed.level[plane] - fixed.radius[i]
    place_at(course, other, time, y)
    square = (y[0] - x[0]) ** 2 + (y[1] - x[1]) ** 2 + (y[2] - x[2]) ** 2
    return sqrt(square) - fixed.radius[i] - fixed.radius[other]


@jit
def _fastest(fixed, course, i, other, plane, time, end):
    """Bound of the speed at which that gap changes until `end`, m/s."""
    speed = bend = along = pull = 0.0
    for k in range(3):
        v = course.velocity[i, k] + (time - course.start[i]) * course.acceleration[i, k] if course.mode[i] != FIXED else 0.0
        a = course.acceleration[i, k] if course.mode[i] != FIXED else 0.0
        if plane >= 0:
            along += v * fixed.normal[plane, k]
            pull += a * fixed.normal[plane, k]
        elif course.mode[other] != FIXED:
            v -= course.velocity[other, k] + (time - course.start[other]) * course.acceleration[other, k]
            a -= course.acceleration[other, k]
        speed += v * v
        bend += a * a
    return abs(along) + abs(pull) * (end - time) if plane >= 0 else sqrt(speed) + sqrt(bend) * (end - time)


@jit
def _near_boundary(fixed, course, i, other, plane, near, number, limit, clock):
    """The first boundary, from number `number` up to the time `limit`, at which a gap is at most `near`; inf if there is none."""
    fastest = _fastest(fixed, course, i, other, plane, clock.now, clock.end)
    while True:
        time = min(number * fixed.step, clock.end)
        if time > limit:
            return inf
        left = gap_at(fixed, course, i, other, plane, time) - near
        if left <= 0.0:
            return time
        if left >= fastest * (limit - time):
            return inf
        number = max(number + 1, np.int64((time + left / fastest) / fixed.step))


@jit
def _last_apart(fixed, course, i, other, plane, near, clock):
    """The last boundary, or now, before which bounding spheres are surely not near; inf if not until the end of the window."""
    fastest = _fastest(fixed, course, i, other, plane, clock.now, clock.end)
    time = clock.now
    while True:
        left = gap_at(fixed, course, i, other, plane, time) - near
        if left <= 0.0:
            return time
        if left >= fastest * (clock.end - time):
            return inf
        boundary = np.int64((time + left / fastest) / fixed.step) * fixed.step
        if boundary <= time:
            return time
        time = boundary


@jit
def meeting(fixed, course, i, other, plane, clock):
    """Time and kind of the next event of a pair, of which `other` is a plane if `plane` is its number and not -1."""
    near, at_once = near_gap(fixed, i, other), AT_BOUNDARY if clock.at_boundary else AT_ONCE
    if course.mode[i] == FIXED and course.mode[other] == FIXED:
        return inf, CONTACT
    if fixed.kind[i] == OTHER or fixed.kind[other] == OTHER:
        time = _last_apart(fixed, course, i, other, plane, near, clock)
        return time, at_once if time == clock.now else AT_BOUNDARY
    a, b = min(i, other), max(i, other)
    time = ball_time(
        fixed.geometry.frame, course, fixed.scratch, a, b, fixed.shape_of_body[a], fixed.shape_of_body[b], clock.now
    )
    if time != time or (clock.at_boundary and gap_at(fixed, course, i, other, plane, clock.now) <= near):
        return clock.now, at_once
    boundary = _near_boundary(fixed, course, i, other, plane, near, clock.number, min(time, clock.end), clock)
    if boundary < inf:
        return boundary, AT_BOUNDARY
    return (time if time < clock.end else inf), CONTACT


@jit
def _time_wall(fixed, course, table, i, clock):
    """Time the entry of body i: the plane that it meets first."""
    best, kind = inf, CONTACT
    for plane in range(len(fixed.planes)):
        if not (fixed.dynamic[i] or fixed.dynamic[fixed.planes[plane]]):
            continue
        if _is_apart(fixed, i, fixed.planes[plane]):
            continue
        time, leaves = meeting(fixed, course, i, fixed.planes[plane], plane, clock)
        if time < best or (time == best and leaves != CONTACT):
            best, kind = time, leaves
            table.first[i], table.second[i] = i, fixed.planes[plane]
    table.leaves[i] = kind
    schedule(table.queue, i, best, i)


@jit
def _time_pair(fixed, course, table, p, clock):
    """Time the entry of a pair."""
    a, b = table.first[p], table.second[p]
    time, table.leaves[p] = meeting(fixed, course, a, b, np.int64(-1), clock)
    schedule(table.queue, p, time, a if fixed.dynamic[a] else b)


@jit
def _is_apart(fixed, i, j):
    """Whether two bodies do not touch each other by order."""
    if len(fixed.apart) == 0:
        return False
    key = min(i, j) * len(fixed.kind) + max(i, j)
    low, high = 0, len(fixed.apart)
    while low < high:
        middle = (low + high) // 2
        if fixed.apart[middle] < key:
            low = middle + 1
        else:
            high = middle
    return low < len(fixed.apart) and fixed.apart[low] == key


@jit
def _add_pair(fixed, course, table, i, j, clock):
    """Add an entry for two bodies; returns False if there is no room."""
    p = table.count[0]
    if p == len(table.first):
        return False
    table.first[p], table.second[p] = min(i, j), max(i, j)
    for side in range(2):
        body = table.second[p] if side else table.first[p]
        table.after[2 * p + side] = table.head[body]
        table.head[body] = 2 * p + side
    table.count[0] = p + 1
    _time_pair(fixed, course, table, p, clock)
    return True


@jit
def _meets(fixed, course, i, j):
    """Whether i, which moves, and j may ever touch."""
    return (fixed.dynamic[i] or fixed.dynamic[j]) and not _is_apart(fixed, i, j)


@jit
def fill_table(fixed, course, table, clock):
    """Find who may meet until the end of the window, and when; returns False if there is no room for all pairs."""
    n = len(fixed.kind)
    clear(table.queue)
    table.count[0] = n
    table.head[:] = -1
    bodies, count = np.empty(n, np.int64), 0
    for i in range(n):
        if fixed.kind[i] == PLANE:
            continue
        bodies[count] = i
        count += 1
        if course.mode[i] == FIXED and not fixed.dynamic[i]:
            table.low[i], table.high[i] = fixed.static_min[i], fixed.static_max[i]
        else:
            path_box(course, i, clock.now, clock.end, fixed.radius[i] + near_gap(fixed, i, i), table.low, table.high)
    build_tree(table.tree, table.low, table.high, bodies[:count])
    for at in range(count):
        i = bodies[at]
        if course.mode[i] == FIXED:
            continue
        _time_wall(fixed, course, table, i, clock)
        reached = overlapping(table.tree, i, table.low, table.high, table.found)
        for k in range(reached):
            j = table.found[k]
            if (j > i or course.mode[j] == FIXED) and _meets(fixed, course, i, j) and not _add_pair(fixed, course, table, i, j, clock):
                return False
    return True


@jit
def renew(fixed, course, table, i, clock):
    """Body i has a new course: time its entries anew and add those of bodies that it may now meet; returns False if there is no room."""
    path_box(course, i, clock.now, clock.end, fixed.radius[i] + near_gap(fixed, i, i), table.low, table.high)
    replace_box(table.tree, i, table.low, table.high)
    table.count[1] += 1
    mark, entry = table.count[1], table.head[i]
    while entry >= 0:
        p = entry // 2
        table.mark[table.first[p]] = table.mark[table.second[p]] = mark
        _time_pair(fixed, course, table, p, clock)
        entry = table.after[entry]
    _time_wall(fixed, course, table, i, clock)
    reached = overlapping(table.tree, i, table.low, table.high, table.found)
    for k in range(reached):
        j = table.found[k]
        if table.mark[j] != mark and _meets(fixed, course, i, j) and not _add_pair(fixed, course, table, i, j, clock):
            return False
    return True


@jit
def touches_more(fixed, course, table, i, partner, time):
    """Whether body i is near another one than its partner."""
    for plane in range(len(fixed.planes)):
        other = fixed.planes[plane]
        if other != partner and gap_at(fixed, course, i, other, plane, time) <= near_gap(fixed, i, other):
            return True
    entry = table.head[i]
    while entry >= 0:
        p = entry // 2
        other = table.second[p] if table.first[p] == i else table.first[p]
        if other != partner and gap_at(fixed, course, i, other, np.int64(-1), time) <= near_gap(fixed, i, other):
            return True
        entry = table.after[entry]
    return False
