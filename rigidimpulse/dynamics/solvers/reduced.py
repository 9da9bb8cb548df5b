"""A start for Newton's method where joints are: the rows of contacts, limits and drives alone, with the joints eliminated.

Joints are FREE rows f, all others are rows c, BOUNDED ones and those of a DISC. From present impulses p and velocities u on, the law of
FREE rows, regularised as in `newton`, is  dp_f = -R^-1 (u_f + s p_f + du_f)  with R = k diag(Jh Jh^T) + s. So changes of the impulses of
the others change y = Jh^T p and u by

    A dy = Jh_c^T dp_c - Jh_f^T R^-1 (u_f + s p_f),      A = I + Jh_f^T R^-1 Jh_f
    du_c = G dp_c + (what joints do by themselves),      G = Jh_c A^-1 Jh_c^T

G is what the contacts of jointed bodies feel of each other (Delassus matrix; the inverse of the operational space inertia, Featherstone
2008, ch. 8). It is small and dense. Projected Gauss-Seidel (Jourdan, Alart & Jean 1998) goes over its rows in turn:

    p_i <- projection of p_i - (u_i + s_i p_i) / (G_ii + s_i) on the bounds of row i, u <- u + G dp

It cannot go round in circles between two sets of contacts that stick or slip, as Newton's method may. It comes to its end slowly, as
Newton's method does not. So a few sweeps find who sticks, slips and parts, and Newton's method has little or nothing left to do. With
sweeps over contacts and joints together chains need hundreds; with joints eliminated a ragdoll on a stair needs twenty.
"""

from math import sqrt
from typing import NamedTuple

import numpy as np

from rigidimpulse.core.kernels import jit, jit_making_arrays
from rigidimpulse.dynamics.constraints.rows import DISC, DISC_SECOND, FREE, multiply, multiply_transposed
from rigidimpulse.dynamics.solvers.newton import (
    REGULARISATION_FREE,
    TINY,
    Factored,
    assemble,
    prepare,
    row_weights,
    velocities_from_impulses,
)
from rigidimpulse.dynamics.solvers.sparse_lu import factor, solve_factored

MOST_ROWS, MOST_ROWS_A_BODY = 72, 4
"""With more rows than that, in all or over the number of bodies, G takes longer than what it saves."""
ROUNDS, MOST_SWEEPS = 2, 60
"""In the second round the joints' impulses are refined; most sweeps of a round."""
ENOUGH = 0.3
"""Sweeps end where no velocity changes by more than this part of the residual that is asked for."""


class Reduced(NamedTuple):
    """The rows that are not FREE, with the joints eliminated."""

    which: np.ndarray  # (m,) rows
    place: np.ndarray  # (r,) of each row in them, -1 for FREE rows
    matrix: np.ndarray  # (m, m) 1/kg, G
    slope: np.ndarray  # (r, 3) first column: 1 / R of FREE rows, 0 for others
    factored: Factored  # A


@jit_making_arrays
def start_without_joints(rows, n, target):
    """Bring the impulses of the rows of n movable bodies near the answer, where it pays; rows are FREE, BOUNDED, or those of a DISC.

    target: residual that is asked for, m/s. Returns the number of sweeps.
    """
    count, m = rows.bias.shape[0], 0
    place = np.full(count, -1, np.int64)
    for i in range(count):
        if rows.kind[i] != FREE:
            place[i] = m
            m += 1
    if m == 0 or m > min(MOST_ROWS, MOST_ROWS_A_BODY * n):
        return 0
    reduced, sweeps = _eliminate(rows, n, place, m), 0
    y, u, change, p, line = np.empty((n, 6)), np.empty(count), np.empty(count), np.empty((2, m)), np.empty(m)
    for _ in range(ROUNDS):
        velocities_from_impulses(rows, rows.impulse, y, u)
        for i in range(count):
            if place[i] < 0:
                u[i] += rows.softness[i] * rows.impulse[i]
        # What joints do by themselves.
        _follow(rows, reduced, u, change, y)
        for c in range(m):
            i = reduced.which[c]
            line[c] = u[i] + change[i]
            p[0, c] = p[1, c] = rows.impulse[i]
        sweeps += _sweep(rows, reduced, line, p[1], ENOUGH * target)
        for c in range(m):
            change[reduced.which[c]] = p[1, c] - p[0, c]
        _give(rows, reduced, u, change, y)
    return sweeps


@jit_making_arrays
def _eliminate(rows, n, place, m):
    """The `Reduced` rows: A is factored, and G found column by column."""
    count, factored = rows.bias.shape[0], prepare(rows, n)
    which, slope, weight = np.empty(m, np.int64), np.zeros((count, 3)), np.empty(count)
    row_weights(rows, weight)
    for i in range(count):
        if place[i] < 0:
            slope[i, 0] = 1.0 / (REGULARISATION_FREE * weight[i] + rows.softness[i])
        else:
            which[place[i]] = i
    assemble(rows, slope, factored.elimination.slot, factored.blocks, factored.right, n)
    factor(factored.elimination, factored.blocks, factored.pivots)
    matrix, column = np.empty((m, m)), np.empty((n, 6))
    for c in range(m):
        _column(rows, which[c], factored, column)
        for d in range(c + 1):
            matrix[c, d] = matrix[d, c] = _along(rows, which[d], column)
    return Reduced(which, place, matrix, slope, factored)


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


@jit
def _follow(rows, reduced, u, change, y):
    """Changes of velocities (r,) that the FREE rows make by themselves; u (r,): velocities, for FREE rows with s p."""
    for i in range(u.shape[0]):
        change[i] = -reduced.slope[i, 0] * u[i]
    _answer(rows, reduced, change, y)


@jit
def _answer(rows, reduced, change, y):
    """From changes of impulses (r,) to changes of velocities (r,), in place, with what the joints do about them."""
    multiply_transposed(rows, change, y)
    solve_factored(reduced.factored.elimination, reduced.factored.blocks, reduced.factored.pivots, y)
    multiply(rows, y, change)


@jit
def _give(rows, reduced, u, change, y):
    """Change the impulses of the rows: by change (r,) where they are reduced, and as joints follow; u as in `_follow`."""
    for i in range(u.shape[0]):
        if reduced.place[i] < 0:
            change[i] = -reduced.slope[i, 0] * u[i]
        else:
            rows.impulse[i] += change[i]
    _answer(rows, reduced, change, y)
    for i in range(u.shape[0]):
        rows.impulse[i] -= reduced.slope[i, 0] * (u[i] + change[i])


@jit
def _sweep(rows, reduced, u, p, enough):
    """Sweep over the reduced rows until velocities u (m,) and impulses p (m,) obey their laws; returns the number of sweeps."""
    which, place, matrix, number = reduced.which, reduced.place, reduced.matrix, 0
    while number < MOST_SWEEPS:
        number += 1
        worst = 0.0
        for c in range(which.shape[0]):
            i = which[c]
            kind = rows.kind[i]
            # The second row of a disc is done with its first.
            if kind == DISC_SECOND:
                continue
            if kind == DISC:
                bound = rows.coefficient[i] * max(p[place[rows.master[i]]], 0.0)
                # One divisor for both rows: the projection on a disc wants a step along their velocity.
                divisor = max(matrix[c, c], matrix[c + 1, c + 1]) + max(rows.softness[i], rows.softness[i + 1]) + TINY
                x = p[c] - (u[c] + rows.softness[i] * p[c]) / divisor
                z = p[c + 1] - (u[c + 1] + rows.softness[i + 1] * p[c + 1]) / divisor
                length = sqrt(x * x + z * z)
                share = bound / length if length > bound else 1.0
                worst = max(worst, _set(matrix, c, share * x, p, u), _set(matrix, c + 1, share * z, p, u))
                continue
            x = p[c] - (u[c] + rows.softness[i] * p[c]) / (matrix[c, c] + rows.softness[i] + TINY)
            worst = max(worst, _set(matrix, c, min(max(x, rows.lower[i]), rows.upper[i]), p, u))
        if worst <= enough:
            break
    return number


@jit
def _set(matrix, c, x, p, u):
    """Set impulse c to x, with what velocities (m,) become of it; returns by how much its own velocity changed."""
    change = x - p[c]
    if change == 0.0:
        return 0.0
    p[c] = x
    for d in range(u.shape[0]):
        u[d] += matrix[c, d] * change
    return abs(change) * matrix[c, c]
