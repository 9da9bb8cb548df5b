"""Slips over a sub-step: it ends where the first one stops, as friction changes there; until then friction turns with the slip.

A slip is a velocity s (2,) along a pair of rows: the slip of a contact, its roll, or its spin (one row). What slips now goes on to slip
until it stops, so that only the load N of its friction is unknown: with d = s / |s| its direction now

    f_t = -k d N.

Rows of the kind SLIDE say so. All others keep their laws, but contacts that leave carry nothing. With u_n = 0 where contacts press and
no velocity where they stick, the forces f of these rows do not depend on the length h over which they are asked for: they are those
that act from now on, and no solve over a tiny time, whose speeds drown in round-off, is needed. Under them a slip changes at the rate
s' = a_t + W_t f and is smallest at

    t = -s.s' / |s'|^2    where s.s' < 0.

The same forces are held until the first such time. Where several points share a load in many ways each way has its own friction and its
own stop: the solver, from no impulse on, takes loads of least norm, which change smoothly with the state.

Where no slip stops, but one turns, its friction has the direction of its middle: with the end s_1 under the laws as they are, against s_1,

    s_m = s_1 + w (s_0 - s_1),   w = 1 / (2 + 2 k),   k = |W f h| / |(s_0 + s_1) / 2|    of all friction of slips

so d is off by O(h^2), and what slips along a bend is of second order. What is across the slip changes by (1 - w k^2) / (1 + k) in a
sub-step: slow slips that are driven against much friction, k >> 1, stay stable, where w = 1/2 would make it grow from round-off.
"""

from math import inf, sqrt
from typing import NamedTuple

import numpy as np

from rigidimpulse.core.kernels import jit, jit_making_arrays
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.dynamics.constraints.rolling_friction import add_rolling_slips
from rigidimpulse.dynamics.constraints.rows import SLIDE, response_to

STRAIGHT: float = 1e-12
"""Turn of a slip, rad, that counts as none."""
LEAST = TOLERANCES.arithmetic.least_divisor


class Slips(NamedTuple):
    """What slips at the start of a sub-step."""

    first: np.ndarray  # (s,) row
    second: np.ndarray  # (s,) the row after it; a single row is given twice
    velocity: np.ndarray  # (s, 2) m/s


@jit_making_arrays
def find_slips(problem, of_contacts, slides, velocity, rolling, slow):
    """The `Slips` of contacts that slip, slides (m,) bool, at velocity (m, 3) along their frames, and of their rolling friction.

    problem: a `ContactProblem`; of_contacts: `ContactRows`; rolling: a `Rolling`; slow: rolling that is none, m/s.
    """
    first_row, m, count = of_contacts.first_row, slides.shape[0], 0
    capacity = m + 2 * rolling.lever.shape[0]
    slips = Slips(np.empty(capacity, np.int64), np.empty(capacity, np.int64), np.empty((capacity, 2)))
    for c in range(m):
        if slides[c]:
            slips.first[count], slips.second[count] = first_row[c] + 1, first_row[c] + 2
            slips.velocity[count, 0], slips.velocity[count, 1] = velocity[c, 1], velocity[c, 2]
            count += 1
    count = add_rolling_slips(problem, rolling, of_contacts, slow, slips, count)
    return Slips(slips.first[:count], slips.second[:count], slips.velocity[:count])


@jit_making_arrays
def end_slips(rows, n, slips):
    """Slip (s, 2) at the end, after the rows' impulses on n movable bodies."""
    response, end = response_to(rows, n, rows.impulse), np.zeros((slips.first.shape[0], 2))
    for k in range(slips.first.shape[0]):
        i, j = slips.first[k], slips.second[k]
        end[k, 0] = rows.bias[i] + response[i]
        if j > i:
            end[k, 1] = rows.bias[j] + response[j]
    return end


@jit_making_arrays
def any_stops(rows, n, slips, none):
    """Whether one of the slips stops or turns back until the end; speeds up to `none` are none."""
    start, end = slips.velocity, end_slips(rows, n, slips)
    for k in range(end.shape[0]):
        if abs(end[k, 0]) + abs(end[k, 1]) <= none or start[k, 0] * end[k, 0] + start[k, 1] * end[k, 1] < 0.0:
            return True
    return False


@jit_making_arrays
def middle_of_slips(rows, n, slips):
    """The slips with their velocities s_m, and whether one of them turns on the way."""
    start, middle, friction, turns = slips.velocity, end_slips(rows, n, slips), np.zeros_like(rows.impulse), False
    for k in range(middle.shape[0]):
        i, j = slips.first[k], slips.second[k]
        friction[i], friction[j] = rows.impulse[i], rows.impulse[j]
        across = abs(start[k, 0] * middle[k, 1] - start[k, 1] * middle[k, 0])
        turns = turns or across > STRAIGHT * (start[k, 0] * start[k, 0] + start[k, 1] * start[k, 1])
    if not turns:
        return slips, turns
    change = response_to(rows, n, friction)
    for k in range(middle.shape[0]):
        i, j = slips.first[k], slips.second[k]
        x, y = 0.5 * (start[k, 0] + middle[k, 0]), 0.5 * (start[k, 1] + middle[k, 1])
        along = change[j] if j > i else 0.0
        much = sqrt((change[i] * change[i] + along * along) / max(x * x + y * y, LEAST))
        for c in range(2):
            middle[k, c] += 0.5 / (1.0 + much) * (start[k, c] - middle[k, c])
    return Slips(slips.first, slips.second, middle), turns


@jit_making_arrays
def start_slides(of_contacts, slips, velocity, slow):
    """Make the rows of the slips SLIDE rows, and let contacts that leave faster than `slow` [m/s] carry nothing.

    of_contacts: `ContactRows` with their friction set; velocity: as in `find_slips`. Returns the kinds (r,) that the rows had.
    """
    rows, first_row = of_contacts.rows, of_contacts.first_row
    kinds = rows.kind.copy()
    for k in range(slips.first.shape[0]):
        i, j, x, y = slips.first[k], slips.second[k], slips.velocity[k, 0], slips.velocity[k, 1]
        share = -rows.coefficient[i] / sqrt(x * x + y * y)
        rows.kind[i] = rows.kind[j] = SLIDE
        rows.coefficient[j] = share * y
        rows.coefficient[i] = share * x
    for c in range(first_row.shape[0]):
        if velocity[c, 0] > slow:
            rows.upper[first_row[c]] = 0.0
    return kinds


@jit
def end_slides(of_contacts, kinds):
    """Give the rows the kinds (r,) that they had before `start_slides`, and bounds again; their coefficients are to be set."""
    rows, first_row = of_contacts.rows, of_contacts.first_row
    for i in range(kinds.shape[0]):
        rows.kind[i] = kinds[i]
    for c in range(first_row.shape[0]):
        rows.upper[first_row[c]] = inf


@jit_making_arrays
def first_stop(rows, n, slips, h):
    """When the first of the slips stops [s], inf if none does, under the rows' impulses over h as forces that last."""
    start, end, stop = slips.velocity, end_slips(rows, n, slips), np.inf
    for k in range(end.shape[0]):
        x, y = (end[k, 0] - start[k, 0]) / h, (end[k, 1] - start[k, 1]) / h
        along = start[k, 0] * x + start[k, 1] * y
        if along < 0.0:
            stop = min(stop, -along / (x * x + y * y))
    return stop
