"""Displacements of bodies that do not turn: the least ones that take them apart.

Of r demands on pairs of bodies, with n from a to b,

    min sum of m |D|^2 / 2 + s p^2 / 2    with    0 <= p _|_ n.(D_b - D_a) - asked + s p >= 0,    m D = sum of +- n p

gives the displacements D and the pushes p. s is small: demands that contradict each other end in a compromise.

Most crowds are shallow. There the sweeps of Gauss and Seidel, p_i <- max(0, p_i - u_i / w_i) for one demand after the other (Hildreth
1957), are enough, and cost some 10 ns a demand. What they leave in tall stacks Newton's method finds (`newton`), whose factors of a crowd
of 1,000 bodies take a second.
"""

from __future__ import annotations

import numpy as np

from rigidimpulse.core.kernels import inlined, jit_making_arrays
from rigidimpulse.dynamics.constraints.rows import BOUNDED, Rows, make_rows
from rigidimpulse.dynamics.solvers.newton import solve_newton

MOST_SWEEPS = 4000
SWEPT = 0.1
"""Part of the residual asked for that a sweep may change: what it changes after a demand is not in the residual of that one."""


def displacement_rows(
    inv_mass: np.ndarray, pair: tuple[np.ndarray, np.ndarray], n: np.ndarray, asked: np.ndarray, softness: float
) -> Rows:
    """Rows of the demands n.(D_b - D_a) >= asked.

    Bodies that do not turn need three of the six components of a body of rows: bodies 2 k and 2 k + 1 share the k-th, so that the matrix
    that is factored has half the size.

    inv_mass (k,) 1/kg, 0 for what cannot move; pair: a and b (r,) of each row; n (r, 3); asked (r,) m; softness: relative.
    """
    (first, second), root, rows, every = pair, np.sqrt(inv_mass), make_rows.py_func(len(asked)), np.arange(len(asked))
    moves, other_moves, same = root[first] > 0.0, root[second] > 0.0, first // 2 == second // 2
    rows.first[:], rows.second[:] = np.where(moves, first // 2, -1), np.where(other_moves, second // 2, -1)
    # Two bodies of one block are its first.
    rows.first[same & other_moves], rows.second[same] = second[same & other_moves] // 2, -1
    column, other_column = 3 * (first % 2), np.where(same, 0, 6) + 3 * (second % 2)
    for k in range(3):
        # In coordinates scaled by the root of the mass.
        rows.jacobian[every, column + k], rows.jacobian[every, other_column + k] = -root[first] * n[:, k], root[second] * n[:, k]
    rows.kind[:], rows.lower[:], rows.bias[:] = BOUNDED, 0.0, -asked
    rows.softness[:] = softness * (inv_mass[first] + inv_mass[second])
    return rows


def solve_displacements(rows: Rows, bodies: int, target: float) -> None:
    """Find the pushes, `rows.impulse`, that displace a number of bodies as asked for, to the residual `target` m."""
    blocks = (bodies + 1) // 2
    _sweep(rows, blocks, SWEPT * target)
    solve_newton(rows, blocks, target)


@jit_making_arrays
def _sweep(rows, blocks, enough):
    """Sweep over the rows of a number of blocks until no push changes its own displacement by more than `enough` m."""
    moved, weight = np.zeros((blocks, 6)), rows.softness.copy()
    for i in range(weight.shape[0]):
        for k in range(12):
            weight[i] += rows.jacobian[i, k] ** 2
        _push(rows, moved, i, rows.impulse[i])
    for _ in range(MOST_SWEEPS):
        worst = 0.0
        for i in range(weight.shape[0]):
            a, b, left = rows.first[i], rows.second[i], rows.bias[i] + rows.softness[i] * rows.impulse[i]
            for k in range(6):
                left += rows.jacobian[i, k] * moved[a, k] if a >= 0 else 0.0
                left += rows.jacobian[i, 6 + k] * moved[b, k] if b >= 0 else 0.0
            change = max(-rows.impulse[i], -left / weight[i]) if weight[i] > 0.0 else 0.0
            worst = max(worst, abs(change) * weight[i])
            rows.impulse[i] += change
            _push(rows, moved, i, change)
        if worst <= enough:
            break


@inlined
def _push(rows, moved, i, change):
    """Change the push of row i, and with it what its bodies moved (blocks, 6)."""
    a, b = rows.first[i], rows.second[i]
    for k in range(6):
        if a >= 0:
            moved[a, k] += change * rows.jacobian[i, k]
        if b >= 0:
            moved[b, k] += change * rows.jacobian[i, 6 + k]
