"""Rows of contacts that stick or slip: static friction where they stick, dynamic friction where they slip.

What slips from the start has its dynamic friction. All others are solved with the static one; those that come to slip are given the
dynamic one, and all are solved again.

Coulomb's law couples the radius of the friction disc to the normal force, so that Newton's method may go round in circles between two
branches (one contact sticks, another takes the load). Without friction the problem is convex, and for contacts alone it always has its
answer. From there the coefficients are raised in equal parts, each solved from the answer of the last one (continuation: Allgower &
Georg 1990, ch. 1).
"""

from collections.abc import Callable

import numpy as np

from rigidimpulse.core.kernels import jit, jit_making_arrays, jit_with_callbacks
from rigidimpulse.core.vector import copy_vector
from rigidimpulse.dynamics.constraints.rows import Rows, multiply, multiply_transposed, rows_of
from rigidimpulse.dynamics.solvers.newton import solve_newton

SLIP_PASSES = 3
POOR = 1e4
"""A residual that many times what was asked for is poor."""
FRICTION_PARTS = 8
"""In how many equal parts friction is raised from none where no other start led to an answer."""

RowSolver = Callable[[Rows, int, float], float]
"""A solver of rows: (rows, number of movable bodies, residual asked for) -> residual."""


@jit_with_callbacks
def solve_rows(solve, rows, n, target):
    """Solve the rows of an island of n movable bodies, see `newton.solve_newton`; solve: another `RowSolver`, or None."""
    if solve is None:
        return solve_newton(rows, n, target)
    return solve(rows, n, target)


@jit
def set_friction(of_contacts, contacts, slides):
    """Give contacts that slip, slides (m,) bool, their dynamic friction, all others the static one."""
    rows, first_row = of_contacts.rows, of_contacts.first_row
    for c in range(first_row.shape[0]):
        if contacts.static_friction[c] > 0.0:
            i = first_row[c] + 1
            rows.coefficient[i] = contacts.dynamic_friction[c] if slides[c] else contacts.static_friction[c]
            rows.coefficient[i + 1] = rows.coefficient[i]


@jit_making_arrays
def let_slip(rows, n, first_row, dynamic_friction, slow):
    """Give contacts that slip faster than `slow` [m/s] their dynamic friction (m,); returns whether any had another one."""
    y, after = np.empty((n, 6)), np.empty(rows.bias.shape[0])
    multiply_transposed(rows, rows.impulse, y)
    multiply(rows, y, after)
    changed = False
    for c in range(first_row.shape[0]):
        i = first_row[c] + 1
        if rows_of(rows, first_row[c]) < 3 or rows.coefficient[i] == dynamic_friction[c]:
            continue
        if abs(rows.bias[i] + after[i]) + abs(rows.bias[i + 1] + after[i + 1]) > slow:
            rows.coefficient[i] = rows.coefficient[i + 1] = dynamic_friction[c]
            changed = True
    return changed


@jit_with_callbacks
def solve_with_slip(solve, of_contacts, n, contacts, slides, target, slow):
    """Solve rows that begin with those of contacts; contacts that slip, or come to slip, have dynamic friction.

    solve: as in `solve_rows`; of_contacts: `ContactRows`; n: movable bodies; slides (m,) bool: contacts that slip from the start; target:
    residual asked for, m/s; slow: slip that is none, m/s. Returns the residual, m/s: inf where there is no finite answer, and then no
    impulse.
    """
    set_friction(of_contacts, contacts, slides)
    return solve_until_slip(solve, of_contacts, n, contacts, target, slow)


@jit_with_callbacks
def solve_until_slip(solve, of_contacts, n, contacts, target, slow):
    """The same with the friction that the rows have: what comes to slip is given its dynamic friction, and all is solved again."""
    rows, first_row = of_contacts.rows, of_contacts.first_row
    residual = 0.0
    for _ in range(SLIP_PASSES):
        residual = _solve_from_other_starts(solve, rows, n, target)
        if not let_slip(rows, n, first_row, contacts.dynamic_friction, slow):
            break
    for i in range(rows.impulse.shape[0]):
        if not np.isfinite(rows.impulse[i]):
            rows.impulse[:] = 0.0
            return np.inf
    return residual


@jit_with_callbacks
def _solve_from_other_starts(solve, rows, n, target):
    """Solve the rows from their impulses; if the answer is poor from none, and then from less friction. Keeps the best answer.

    Returns its residual, m/s.
    """
    warm = _has_impulse(rows)
    residual = solve_rows(solve, rows, n, target)
    best = rows.impulse.copy()
    if residual > POOR * target and warm:
        # A misleading start: once more from nothing.
        rows.impulse[:] = 0.0
        residual = _keep_better(rows, solve_rows(solve, rows, n, target), best, residual)
    if residual > POOR * target:
        residual = _keep_better(rows, _raise_friction(solve, rows, n, target), best, residual)
    return residual


@jit
def _keep_better(rows, found, best, residual):
    """Keep the impulses of the rows as the best ones (r,) if what was found is better, else give them back; returns the residual."""
    if found < residual:
        copy_vector(rows.impulse, best)
        return found
    copy_vector(best, rows.impulse)
    return residual


@jit_with_callbacks
def _raise_friction(solve, rows, n, target):
    """Solve the rows with more and more of their friction, from none on. Returns the residual, m/s: inf if the way ends before."""
    full = rows.coefficient.copy()
    rows.impulse[:] = 0.0
    found = 0.0
    for part in range(FRICTION_PARTS + 1):
        for i in range(full.shape[0]):
            rows.coefficient[i] = full[i] * (part / FRICTION_PARTS)
        found = solve_rows(solve, rows, n, target)
        if found > POOR * target and part < FRICTION_PARTS:
            found = np.inf
            break
    copy_vector(full, rows.coefficient)
    return found


@jit
def _has_impulse(rows):
    for i in range(rows.impulse.shape[0]):
        if rows.impulse[i] != 0.0:
            return True
    return False
