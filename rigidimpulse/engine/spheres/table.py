"""When bodies meet next: the table of events and how its entries are timed.

Two balls, or a ball and a plane, have the time of their contact in closed form (`collision/time_of_impact/spheres.py`). Everything
else is left to the loop in Python, so an entry may also be a time at which that loop takes over:

    AT_BOUNDARY   a boundary of steps at which the pair is within the margin of contacts, where the loop looks at it, or
                  the last one before bounding spheres of other shapes may be within it
    AT_ONCE       the same, between boundaries, for a pair of which a body has just got a new trajectory

Boundaries at which a pair is near are found by safe steps: a pair whose gap is g above the margin is not near before g / (fastest speed).
"""

from __future__ import annotations

from math import inf

import numpy as np

from rigidimpulse.core.kernels import jit, jit_making_arrays
from rigidimpulse.core.sorted_values import is_among
from rigidimpulse.engine.spheres.layout import AT_BOUNDARY, AT_ONCE, CONTACT, OTHER, PLANE
from rigidimpulse.engine.spheres.paths import (
    BODY,
    DYNAMIC,
    KIND,
    MOVES,
    contact_time,
    gap_at,
    is_passing,
    last_apart,
    near_boundary,
    near_gap,
    swept_box,
)
from rigidimpulse.engine.spheres.queue import clear, schedule
from rigidimpulse.engine.spheres.tree import build_tree, overlapping, replace_box

_NO_PLANE = np.int64(-1)
_EACH_ONCE, _FRESH = np.int64(0), np.int64(1)


@jit
def meeting(paths, planes, i, other, plane, clock):
    """Time and kind of the next event of a pair, of which `other` is a plane if `plane` is its number and not -1."""
    near, at_once = near_gap(paths, i, other), AT_BOUNDARY if clock.at_boundary else AT_ONCE
    if paths[i, MOVES] == 0.0 and paths[other, MOVES] == 0.0:
        return inf, CONTACT
    # Other shapes have no closed form: only the time until which their bounding spheres are apart.
    if paths[i, KIND] == OTHER or paths[other, KIND] == OTHER:
        time = last_apart(paths, planes, i, other, plane, near, clock)
        return time, at_once if time == clock.now else AT_BOUNDARY
    time = contact_time(paths, planes, i, other, plane, clock.now)
    # No closed form for this contact (nan): the loop decides.
    if time != time:
        return clock.now, at_once
    if clock.at_boundary:
        gap = gap_at(paths, planes, i, other, plane, clock.now)
        if gap <= near and not is_passing(paths, planes, i, other, plane, clock.now, gap, clock.live):
            return clock.now, AT_BOUNDARY
    boundary = near_boundary(paths, planes, i, other, plane, near, time, clock)
    if boundary < inf:
        return boundary, AT_BOUNDARY
    return (time if time < clock.end else inf), CONTACT


@jit
def _is_apart(apart, num_bodies, i, j):
    """Whether two bodies do not touch each other by order."""
    return is_among(apart, min(i, j) * num_bodies + max(i, j))


@jit
def time_waiting(apart, table, clock):
    """Time the entries that wait for it: that of a body and the plane that it meets first, or that of a pair."""
    paths, planes, n = table.paths, table.planes, len(table.paths)
    for w in range(table.count[2]):
        p = table.waiting[w]
        i = p if p < n else table.first[p]
        best, kind = inf, CONTACT
        for number in range(len(planes) if p < n else 1):
            plane = np.int64(number) if p < n else _NO_PLANE
            other = np.int64(planes[number, BODY]) if p < n else table.second[p]
            if p < n and (paths[i, DYNAMIC] == 0.0 or _is_apart(apart, n, i, other)):
                continue
            time, leaves = meeting(paths, planes, i, other, plane, clock)
            if time < best or (time == best and leaves != CONTACT):
                best, kind = time, leaves
                table.second[p] = other
                if p < n:
                    table.plane[i] = plane
        table.leaves[p] = kind
        schedule(table.queue, p, best, i if paths[i, DYNAMIC] > 0.0 else table.second[p])
    table.count[2] = 0


@jit
def _wait(table, p):
    """Let an entry wait to be timed; it may do so twice."""
    if table.count[2] < len(table.waiting):
        table.waiting[table.count[2]] = p
        table.count[2] += 1


@jit
def _add_pair(table, i, j):
    """Add an entry for two bodies; returns False if the table is full."""
    p = table.count[0]
    if p == len(table.first):
        return False
    table.first[p], table.second[p] = min(i, j), max(i, j)
    for side in range(2):
        body = table.second[p] if side else table.first[p]
        table.after[2 * p + side] = table.head[body]
        table.head[body] = 2 * p + side
    table.count[0] = p + 1
    _wait(table, p)
    return True


@jit
def _add_pairs(apart, table, i, which):
    """Add entries for i, which moves, and whom it may meet: _FRESH, pairs without one, or _EACH_ONCE; False if the table is full."""
    paths, n = table.paths, len(table.paths)
    reached = overlapping(table.tree, i, table.low, table.high, table.found)
    for k in range(reached):
        j = table.found[k]
        if table.mark[j] == table.count[1] if which == _FRESH else (j < i and paths[j, MOVES] > 0.0):
            continue
        if (paths[i, DYNAMIC] > 0.0 or paths[j, DYNAMIC] > 0.0) and not _is_apart(apart, n, i, j):
            if not _add_pair(table, i, j):
                return False
    return True


@jit_making_arrays
def fill_table(fixed, table, clock):
    """Find who may meet until the end of the interval; returns False if the pairs are more than the table holds."""
    paths, n = table.paths, len(table.paths)
    clear(table.queue)
    table.count[0], table.count[2] = n, 0
    table.head[:] = -1
    bodies, count = np.empty(n, np.int64), 0
    for i in range(n):
        # Planes have an entry for each body instead of a box.
        if paths[i, KIND] == PLANE:
            continue
        bodies[count] = i
        count += 1
        if paths[i, MOVES] == 0.0 and paths[i, DYNAMIC] == 0.0:
            table.low[i], table.high[i] = fixed.static_min[i], fixed.static_max[i]
        else:
            swept_box(paths, i, clock, table.low, table.high)
    build_tree(table.tree, table.low, table.high, bodies[:count])
    for at in range(count):
        i = bodies[at]
        if paths[i, MOVES] > 0.0:
            table.first[i] = i
            _wait(table, i)
            # Moving pairs are entered once, by the body of lower index.
            if not _add_pairs(fixed.apart, table, i, _EACH_ONCE):
                return False
    return True


@jit
def renew(apart, table, i, clock):
    """Body i has a new path: let its entries, and those of bodies that it may now meet, wait; returns False if the table is full."""
    swept_box(table.paths, i, clock, table.low, table.high)
    replace_box(table.tree, i, table.low, table.high)
    table.count[1] += 1
    mark, entry = table.count[1], table.head[i]
    while entry >= 0:
        p = entry // 2
        table.mark[table.first[p]] = table.mark[table.second[p]] = mark
        _wait(table, p)
        entry = table.after[entry]
    table.first[i] = i
    _wait(table, i)
    return _add_pairs(apart, table, i, _FRESH)


@jit
def touches_more(table, i, partner, time):
    """Whether body i is near another one than its partner."""
    paths, planes = table.paths, table.planes
    for plane in range(len(planes)):
        other = np.int64(planes[plane, BODY])
        if other != partner and gap_at(paths, planes, i, other, plane, time) <= near_gap(paths, i, other):
            return True
    entry = table.head[i]
    while entry >= 0:
        p = entry // 2
        other = table.second[p] if table.first[p] == i else table.first[p]
        if other != partner and gap_at(paths, planes, i, other, _NO_PLANE, time) <= near_gap(paths, i, other):
            return True
        entry = table.after[entry]
    return False
