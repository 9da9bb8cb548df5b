"""Displacements of bodies that do not turn: the least ones that take them apart.

Of r demands on pairs of bodies, with n from a to b,

    min sum of m |D|^2 / 2 + s p^2 / 2    with    0 <= p _|_ n.(D_b - D_a) - asked + s p >= 0,    m D = sum of +- n p

gives the displacements D and the pushes p. s is small: demands that contradict each other end in a compromise.

Newton's method solves the rows (`solvers.newton`), but the factors of a crowd of 1,000 bodies take seconds. Crowds are shallow: the sweeps
of Gauss and Seidel, p_i <- max(0, p_i - u_i / w_i) for one demand after the other (Hildreth 1957), get near the answer, at some 10 ns a
demand. What they leave in tall stacks is Newton's.
"""

from __future__ import annotations

import numpy as np

from rigidimpulse.core.kernels import inlined, jit_making_arrays
from rigidimpulse.dynamics.constraints.rows import BOUNDED, Rows, make_rows

MOST_SWEEPS = 4000


def displacement_rows(
    inv_mass: np.ndarray, pair: tuple[np.ndarray, np.ndarray], n: np.ndarray, asked: np.ndarray, softness: float
) -> Rows:
    """Rows of the demands n.(D_b - D_a) >= asked.

    inv_mass (k,) 1/kg, 0 for what cannot move; pair: a and b (r,) of each row; n (r, 3); asked (r,) m; softness: relative.
    """
    (first, second), root, rows = pair, np.sqrt(inv_mass), make_rows.py_func(len(asked))
    rows.first[:], rows.second[:] = np.where(root[first] > 0.0, first, -1), np.where(root[second] > 0.0, second, -1)
    # In coordinates scaled by the root of the mass.
    rows.jacobian[:, :3], rows.jacobian[:, 6:9] = -root[first, None] * n, root[second, None] * n
    rows.kind[:], rows.lower[:], rows.bias[:] = BOUNDED, 0.0, -asked
    rows.softness[:] = softness * (inv_mass[first] + inv_mass[second])
    return rows


@jit_making_arrays
def sweep(rows, bodies, enough):
    """Find the pushes, `rows.impulse`, of a number of bodies by sweeps until none changes its own displacement by more than `enough` m."""
    moved, weight = np.zeros((bodies, 3)), rows.softness.copy()
    for i in range(weight.shape[0]):
        for k in range(3):
            weight[i] += rows.jacobian[i, k] ** 2 + rows.jacobian[i, 6 + k] ** 2
        _push(rows, moved, i, rows.impulse[i])
    for _ in range(MOST_SWEEPS):
        worst = 0.0
        for i in range(weight.shape[0]):
            a, b, left = rows.first[i], rows.second[i], rows.bias[i] + rows.softness[i] * rows.impulse[i]
            for k in range(3):
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
    """Change the push of row i, and with it what its bodies moved (bodies, 3)."""
    a, b = rows.first[i], rows.second[i]
    for k in range(3):
        if a >= 0:
            moved[a, k] += change * rows.jacobian[i, k]
        if b >= 0:
            moved[b, k] += change * rows.jacobian[i, 6 + k]
