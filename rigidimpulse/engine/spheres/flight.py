"""Balls in free flight, from impact to impact.

Time is divided into intervals of many steps. For an interval the table (`table`) holds the time of the next contact of every body with
a plane, and of every pair whose boxes overlap. The earliest contact is taken and its bodies rebound (`impact`). Only the entries of these
bodies are timed again, so an impact costs as much as its bodies have neighbours, and log n for the queue. Times follow from the
trajectories alone. The length of the interval therefore changes no result; it is chosen such that bodies have a few neighbours.

The kernel ends as soon as something is not simple, at the instant where it happens, and the loop in Python goes on (`engine/step.py`).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rigidimpulse.core.kernels import jit
from rigidimpulse.engine.spheres.effect import ARRIVED, FULL, GO_ON, STEP
from rigidimpulse.engine.spheres.impact import simple_impact
from rigidimpulse.engine.spheres.layout import AT_BOUNDARY, AT_ONCE
from rigidimpulse.engine.spheres.motion import write_frames
from rigidimpulse.engine.spheres.paths import place_planes, write_path
from rigidimpulse.engine.spheres.table import fill_table, renew, time_waiting, touches_more
from rigidimpulse.model.contact_memory import has_capacity
from rigidimpulse.motion.trajectory import FIXED

LONGEST = 4096
"""Steps in an interval at most."""
FEW, MANY = 1.5, 6.0
"""Pairs per body below which intervals grow, and above which they shrink."""


_NO_PLANE, _FIRST = np.int64(-1), np.int64(0)


class Clock(NamedTuple):
    """Where a flight is."""

    step: float  # s, between boundaries
    live: float  # gap, relative to the contact margin, up to which contacts act; inf where even farther ones may
    now: float  # s
    end: float  # s, of the interval
    number: int  # of the next boundary after now
    at_boundary: bool


@jit
def _next_number(time, number, step):
    """Number of the first boundary after `time`, from `number` on."""
    number = max(number, np.int64(time / step))
    while number * step <= time:
        number += 1
    return number


@jit
def _rebound(fixed, motion, table, record, rebounds, p, time):
    """Deal with entry p, a contact, at `time`; returns False where that is not simple."""
    a, b = min(table.first[p], table.second[p]), max(table.first[p], table.second[p])
    for i, j in ((a, b), (b, a)):
        if fixed.dynamic[i] and touches_more(table, i, j, time):
            return False
    plane = table.plane[p] if p < len(table.paths) else _NO_PLANE
    return simple_impact(fixed, motion, record, rebounds, table.paths, table.planes, a, b, plane, time)


@jit
def _has_capacity(record, rebounds):
    """Whether one more impact can be kept."""
    return record.count[0] < len(record.energy) and has_capacity(rebounds, 1)


@jit
def _fly_interval(fixed, motion, table, record, rebounds, clock):
    """Go through the events of an interval; returns how it ends and the clock then."""
    while True:
        time_waiting(fixed.apart, table, clock)
        if table.queue.size[0] == 0:
            break
        p = table.queue.order[0]
        time, leaves = table.queue.key[p], table.leaves[p]
        # Something that is not simple: the loop in Python goes on from here.
        if leaves == AT_ONCE:
            return GO_ON, clock
        if leaves == AT_BOUNDARY:
            return STEP, Clock(clock.step, clock.live, time, clock.end, _next_number(time, clock.number, clock.step), True)
        # Python makes the buffer larger and calls again, from the same instant.
        if not _has_capacity(record, rebounds):
            return FULL, clock
        clock = Clock(clock.step, clock.live, time, clock.end, _next_number(time, clock.number, clock.step), False)
        if not _rebound(fixed, motion, table, record, rebounds, p, time):
            return GO_ON, clock
        a, b = table.first[p], table.second[p]
        for i in (a, b):
            if fixed.dynamic[i]:
                write_path(motion.trajectory, table.paths, i)
        # Only entries of bodies with a new path are timed again.
        for i in (a, b):
            if fixed.dynamic[i] and not renew(fixed.apart, table, i, clock):
                return FULL, clock
    return ARRIVED, Clock(clock.step, clock.live, clock.end, clock.end, _next_number(clock.end, clock.number, clock.step), True)


@jit
def fly(fixed, motion, table, record, rebounds, now, end, at_boundary, interval, live, interval_end):
    """Carry all bodies from `now` towards `end` [s].

    now, end: s; at_boundary: whether `now` is a boundary of steps; interval: steps of the first interval; live: see `Clock`;
    interval_end: s, end of the interval to go on with, where a flight ended because its buffer of impacts was full; a time before `now`
    begins a new interval.

    Returns how the flight ends, the time reached, whether that is a boundary, number of the next boundary, steps of the next interval, and
    the end of the present one.
    """
    trajectory, how = motion.trajectory, ARRIVED
    clock = Clock(fixed.step, live, now, interval_end, _next_number(now, np.int64(0), fixed.step), at_boundary)
    moving = 0
    for i in range(len(table.paths)):
        write_path(trajectory, table.paths, i)
        moving += trajectory.mode[i] != FIXED
    place_planes(trajectory, table.planes)
    while how == ARRIVED and clock.now < end:
        first = clock.number
        # A new interval; its length changes the cost and no result.
        if clock.end <= clock.now:
            clock = Clock(fixed.step, live, clock.now, min((first + interval - 1) * fixed.step, end), first, clock.at_boundary)
            if not fill_table(fixed, table, clock):
                return FULL, clock.now, clock.at_boundary, clock.number, interval, clock.end
        pairs = table.count[0] - len(table.paths)
        how, clock = _fly_interval(fixed, motion, table, record, rebounds, clock)
        write_frames(trajectory, record, _FIRST, len(table.paths), clock.now)
        # Long intervals have large boxes, and therefore many pairs; short ones are filled often.
        if how == ARRIVED and pairs <= FEW * moving:
            interval = min(2 * interval, LONGEST)
        elif how == ARRIVED and pairs > MANY * moving:
            interval = max(interval // 2, 1)
        elif (how == STEP or how == GO_ON) and clock.number <= first + 1:
            interval = max(interval // 2, 1)
    return how, clock.now, clock.at_boundary, clock.number, interval, clock.end
