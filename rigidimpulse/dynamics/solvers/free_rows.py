"""FREE rows, as most joints have them, solved directly.

Their law u + s p + du = 0 is regularised as in `newton`, R = k diag(Jh Jh^T) + s. From velocities u and impulses p on,

    dp = -R^-1 (u + s p + du),      du = Jh y,      y = Jh^T dp

    A y = -Jh^T R^-1 (u + s p),     A = I + Jh^T R^-1 Jh

A has the sparsity of the joints and is factored once for rows along the same directions. What R leaves of u is k parts of it, for a chain
by as much more as its joints hang on each other.
"""

from typing import NamedTuple

import numpy as np

from rigidimpulse.core.kernels import jit, jit_making_arrays
from rigidimpulse.dynamics.constraints.rows import FREE, multiply, multiply_transposed
from rigidimpulse.dynamics.solvers.newton import REGULARISATION_FREE, Factored, assemble, prepare, row_weights
from rigidimpulse.dynamics.solvers.sparse_lu import factor, solve_factored


class FreeRows(NamedTuple):
    """The FREE ones of r rows between n movable bodies, ready to be solved."""

    slope: np.ndarray  # (r, 3) first column: 1 / R of FREE rows, 0 for others
    factored: Factored  # A


@jit
def count_free(rows):
    """How many of the rows are FREE."""
    number = 0
    for i in range(rows.kind.shape[0]):
        if rows.kind[i] == FREE:
            number += 1
    return number


@jit_making_arrays
def factor_free(rows, n):
    """The `FreeRows` of rows between n movable bodies."""
    count, factored = rows.bias.shape[0], prepare(rows, n)
    slope, weight = np.zeros((count, 3)), np.empty(count)
    row_weights(rows, weight)
    for i in range(count):
        if rows.kind[i] == FREE:
            slope[i, 0] = 1.0 / (REGULARISATION_FREE * weight[i] + rows.softness[i])
    assemble(rows, slope, factored.elimination.slot, factored.blocks, factored.right, n)
    factor(factored.elimination, factored.blocks, factored.pivots)
    return FreeRows(slope, factored)


@jit_making_arrays
def take_free(free, which):
    """The `FreeRows` of the rows `which` (k,) alone, if they are all that are FREE: A stays the same."""
    slope = np.zeros((which.shape[0], 3))
    for k in range(which.shape[0]):
        slope[k, 0] = free.slope[which[k], 0]
    return FreeRows(slope, free.factored)


@jit
def follow(rows, free, u, change, y):
    """Changes of velocities (r,) that the FREE rows make by themselves; u (r,): velocities, for FREE rows with s p. y (n, 6) is written."""
    for i in range(u.shape[0]):
        change[i] = -free.slope[i, 0] * u[i]
    _answer(rows, free, change, y)


@jit
def give(rows, free, u, change, y):
    """Change the impulses of the rows: by change (r,) where they are not FREE, and as FREE ones follow; u and y as in `follow`."""
    for i in range(u.shape[0]):
        if rows.kind[i] == FREE:
            change[i] = -free.slope[i, 0] * u[i]
        else:
            rows.impulse[i] += change[i]
    _answer(rows, free, change, y)
    for i in range(u.shape[0]):
        rows.impulse[i] -= free.slope[i, 0] * (u[i] + change[i])


@jit
def _answer(rows, free, change, y):
    """From changes of impulses (r,) to changes of velocities (r,), in place, with what the FREE rows do about them."""
    multiply_transposed(rows, change, y)
    solve_factored(free.factored.elimination, free.factored.blocks, free.factored.pivots, y)
    multiply(rows, y, change)
