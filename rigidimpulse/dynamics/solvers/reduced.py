"""A start for Newton's method where joints are: the rows of contacts, limits and drives alone, with the joints eliminated.

Joints are FREE rows f, which follow all others as `free_rows` says; the others are rows c, BOUNDED ones and those of a DISC. Changes of
their impulses change the velocities by

    du_c = G dp_c + (what joints do by themselves),      G = Jh_c A^-1 Jh_c^T

G is what the contacts of jointed bodies feel of each other (Delassus matrix; the inverse of the operational space inertia, Featherstone
2008, ch. 8). It is dense. Projected Gauss-Seidel (Jourdan, Alart & Jean 1998) goes over its rows in turn:

    p_i <- projection of p_i - OVER (u_i + s_i p_i) / (G_ii + s_i) on the bounds of row i, u <- u + G dp

It cannot go round in circles between two sets of contacts that stick or slip, as Newton's method may. It comes to its end slowly, as
Newton's method does not. So sweeps find who sticks, slips and parts, and Newton's method has little or nothing left to do. With
sweeps over contacts and joints together chains need hundreds; with joints eliminated a ragdoll on a stair needs twenty to sixty, and up to
200 where it lies flat.
"""

from math import sqrt
from typing import NamedTuple

import numpy as np

from rigidimpulse.core.kernels import jit, jit_making_arrays
from rigidimpulse.dynamics.constraints.rows import DISC, DISC_SECOND, FREE
from rigidimpulse.dynamics.solvers.free_rows import follow, give
from rigidimpulse.dynamics.solvers.newton import TINY, velocities_from_impulses
from rigidimpulse.dynamics.solvers.sparse_lu import solve_factored

MOST_ROWS, MOST_ROWS_A_BODY = 600, 12
"""With more rows than that, in all or over the number of bodies, G takes longer than what it saves."""
MOST_SWEEPS = 200
"""A sweep over the 60 rows of a ragdoll that lies on a stair takes 0.6 us, a step of Newton's method for its 100 rows 30 us. In a pile of
six ragdolls, with 480 rows, all of a sub-step takes 6 ms; without sweeps it took 13."""
OVER = 1.2
"""Successive over-relaxation (Young 1954): with 1.4 as many sweeps as with 1, here a fifth less."""
ENOUGH = 0.3
"""Sweeps end where no velocity changes by more than this part of the residual that is asked for."""
SINGLE, FIRST_OF_DISC, SECOND_OF_DISC = range(3)


class Reduced(NamedTuple):
    """The rows that are not FREE, with the joints eliminated."""

    which: np.ndarray  # (m,) rows
    place: np.ndarray  # (r,) of each row in them, -1 for FREE rows
    matrix: np.ndarray  # (m, m) 1/kg, G


class Laws(NamedTuple):
    """The laws of the m reduced rows, in their order."""

    part: np.ndarray  # (m,) SINGLE, or which row of a disc
    master: np.ndarray  # (m,) of rows of a disc: place of the row whose impulse bounds them
    step: np.ndarray  # (m,) kg, OVER / (G_ii + s_i): both rows of a disc have the smaller one
    coefficient: np.ndarray  # (m,)
    softness: np.ndarray  # (m,) 1/kg, s
    lower: np.ndarray  # (m,) N s
    upper: np.ndarray  # (m,) N s


@jit_making_arrays
def start_without_joints(rows, free, target):
    """Bring the impulses of the rows near the answer, where it pays; they are FREE, BOUNDED, or those of a DISC.

    free: `FreeRows` of them; target: residual that is asked for, m/s. Returns the number of sweeps.
    """
    count, n, m = rows.bias.shape[0], free.factored.pivots.shape[0], 0
    place = np.full(count, -1, np.int64)
    for i in range(count):
        if rows.kind[i] != FREE:
            place[i] = m
            m += 1
    if m > min(MOST_ROWS, MOST_ROWS_A_BODY * n):
        return 0
    y, u, change, p, line = np.empty((n, 6)), np.empty(count), np.empty(count), np.empty(m), np.empty(m)
    velocities_from_impulses(rows, rows.impulse, y, u)
    for i in range(count):
        if place[i] < 0:
            u[i] += rows.softness[i] * rows.impulse[i]
    # What joints do by themselves.
    follow(rows, free, u, change, y)
    reduced, sweeps = _reduce(rows, free, place, m), 0
    for c in range(m):
        i = reduced.which[c]
        line[c], p[c] = u[i] + change[i], rows.impulse[i]
    if m:
        sweeps = _sweep(_laws(rows, reduced), reduced.matrix, line, p, ENOUGH * target)
    for c in range(m):
        i = reduced.which[c]
        change[i] = p[c] - rows.impulse[i]
    give(rows, free, u, change, y)
    return sweeps


@jit_making_arrays
def _reduce(rows, free, place, m):
    """The m `Reduced` rows, in their place (r,); G is found column by column."""
    which, matrix, column = np.empty(m, np.int64), np.empty((m, m)), np.empty((free.factored.pivots.shape[0], 6))
    for i in range(place.shape[0]):
        if place[i] >= 0:
            which[place[i]] = i
    for c in range(m):
        _column(rows, which[c], free.factored, column)
        for d in range(c + 1):
            matrix[c, d] = matrix[d, c] = _along(rows, which[d], column)
    return Reduced(which, place, matrix)


@jit
def _column(rows, i, factored, column):
    """Column (n, 6) = A^-1 Jh_i^T."""
    for body in range(column.shape[0]):
        for k in range(6):
            column[body, k] = 0.0
    a, b = rows.first[i], rows.second[i]
    for k in range(6):
        if a >= 0:
            column[a, k] += rows.jacobian[i, k]
        if b >= 0:
            column[b, k] += rows.jacobian[i, 6 + k]
    solve_factored(factored.elimination, factored.blocks, factored.pivots, column)


@jit
def _along(rows, i, y):
    """Velocity Jh_i y of row i, y (n, 6)."""
    a, b, total = rows.first[i], rows.second[i], 0.0
    for k in range(6):
        if a >= 0:
            total += rows.jacobian[i, k] * y[a, k]
        if b >= 0:
            total += rows.jacobian[i, 6 + k] * y[b, k]
    return total


@jit_making_arrays
def _laws(rows, reduced):
    """The `Laws` of the reduced rows."""
    m = reduced.which.shape[0]
    whole, real = np.zeros((2, m), np.int64), np.empty((5, m))
    laws = Laws(whole[0], whole[1], real[0], real[1], real[2], real[3], real[4])
    for c in range(m):
        i = reduced.which[c]
        laws.coefficient[c], laws.softness[c] = rows.coefficient[i], rows.softness[i]
        laws.lower[c], laws.upper[c] = rows.lower[i], rows.upper[i]
        laws.step[c] = OVER / (reduced.matrix[c, c] + rows.softness[i] + TINY)
        if rows.kind[i] == DISC or rows.kind[i] == DISC_SECOND:
            laws.part[c] = FIRST_OF_DISC if rows.kind[i] == DISC else SECOND_OF_DISC
            laws.master[c] = reduced.place[rows.master[i]]
        if rows.kind[i] == DISC_SECOND:
            # The projection on a disc wants a step along the velocity.
            laws.step[c - 1] = laws.step[c] = min(laws.step[c - 1], laws.step[c])
    return laws


@jit
def _sweep(laws, matrix, u, p, enough):
    """Sweep over the reduced rows until velocities u (m,) and impulses p (m,) obey their laws; returns the number of sweeps."""
    number = 0
    while number < MOST_SWEEPS:
        number += 1
        worst = 0.0
        for c in range(u.shape[0]):
            if laws.part[c] == SINGLE:
                x = p[c] - (u[c] + laws.softness[c] * p[c]) * laws.step[c]
                change = min(max(x, laws.lower[c]), laws.upper[c]) - p[c]
                if change != 0.0:
                    p[c] += change
                    for d in range(u.shape[0]):
                        u[d] += matrix[c, d] * change
                    worst = max(worst, abs(change) * matrix[c, c])
            elif laws.part[c] == FIRST_OF_DISC:
                bound = laws.coefficient[c] * max(p[laws.master[c]], 0.0)
                x = p[c] - (u[c] + laws.softness[c] * p[c]) * laws.step[c]
                z = p[c + 1] - (u[c + 1] + laws.softness[c + 1] * p[c + 1]) * laws.step[c]
                length = x * x + z * z
                share = bound / sqrt(length) if length > bound * bound else 1.0
                x, z = share * x - p[c], share * z - p[c + 1]
                if x != 0.0 or z != 0.0:
                    p[c] += x
                    p[c + 1] += z
                    for d in range(u.shape[0]):
                        u[d] += matrix[c, d] * x + matrix[c + 1, d] * z
                    worst = max(worst, abs(x) * matrix[c, c], abs(z) * matrix[c + 1, c + 1])
        if worst <= enough:
            break
    return number
