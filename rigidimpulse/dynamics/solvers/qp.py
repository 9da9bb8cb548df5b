"""Rows solved by a convex solver library: the reference that `newton` is compared with.

With W = Jh Jh^T, u = b + W p and s the softness of the rows, the impulses of

    min  1/2 p^T (W + diag s) p + (b + c)^T p     under the bounds of p and |p_t| <= k p_master for every disc and segment

satisfy the laws of all rows (see `rows`) but one: slip would open the contact. With c_master = k |u_t|, found by the fixed
point  c <- k |u_t(p(c))|,  that is taken back, and the true Coulomb cone is met (De Saxce and Feng 1998; Acary, Cadoux, Lemarechal
and Malick, A formulation of the linear discrete Coulomb friction problem via convex optimization, ZAMM 91, 2011). Each convex
problem is solved by the interior-point method of Clarabel (Goulart and Chen 2024).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy import sparse

from rigidimpulse.core.errors import SceneError
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.dynamics.constraints.rows import BOUNDED, DISC, SEGMENT, Rows
from rigidimpulse.dynamics.constraints.slip import RowSolver
from rigidimpulse.dynamics.solvers.newton import natural_residual, row_weights

MOST_ROUNDS = 100
"""Fixed-point steps."""
MOST_STAGNANT = 4
"""Steps in a row that gain nothing: what is left is the precision of the convex solver, about 1e-6 of the speeds."""
PRECISION = TOLERANCES.solver.qp_precision
REGULAR = TOLERANCES.solver.qp_regularisation


def row_solver(name: str) -> RowSolver | None:
    """The solver of rows (rows, n, target) -> residual for a value of `Accuracy.contact_solver`; None: `newton.solve_newton`.

    Raises:
        SceneError: "qp" without the library it needs.

    """
    if name != "qp":
        return None
    try:
        import clarabel  # noqa: F401
    except ImportError:
        raise SceneError("contact_solver = 'qp' needs the library clarabel", "pip install rigidimpulse[qp], or use 'newton'") from None
    return solve_qp


def solve_qp(rows: Rows, n: int, target: float) -> float:
    """Solve rows of an island of n movable bodies; `rows.impulse` is the answer.

    target: residual asked for, m/s. Returns the residual of the natural map that was reached, m/s.
    """
    count = len(rows.bias)
    if not count:
        return 0.0
    jacobian = _matrix(rows, n)
    effective = (jacobian @ jacobian.T + sparse.diags(rows.softness)).tocsc()
    weight = np.empty(count)
    row_weights(rows, weight)
    discs = np.flatnonzero((rows.kind == DISC) | (rows.kind == SEGMENT))
    opening, best, stagnant = np.zeros(count), np.inf, 0
    for _ in range(MOST_ROUNDS):
        p = _convex_step(rows, effective, rows.bias + opening, discs)
        u = rows.bias + jacobian @ (jacobian.T @ p)
        residual = float(natural_residual(rows, u, p, weight))
        stagnant = 0 if residual < 0.9 * best else stagnant + 1
        if residual < best:
            best = residual
            rows.impulse[:] = p
        if best <= target or not len(discs) or stagnant == MOST_STAGNANT:
            break
        # The fixed point c = k |u_t| takes back the opening by slip.
        slip = np.where(rows.kind[discs] == DISC, np.hypot(u[discs], u[np.minimum(discs + 1, count - 1)]), np.abs(u[discs]))
        opening[:] = 0.0
        opening[rows.master[discs]] = rows.coefficient[discs] * slip
    return best


def _matrix(rows: Rows, n: int) -> sparse.csr_matrix:
    """Jh, (r, 6 n)."""
    count = len(rows.bias)
    place, column, value = [], [], []
    for body, block in ((rows.first, rows.jacobian[:, :6]), (rows.second, rows.jacobian[:, 6:])):
        movable = np.flatnonzero(body >= 0)
        place.append(np.repeat(movable, 6))
        column.append((6 * body[movable, None] + np.arange(6)).ravel())
        value.append(block[movable].ravel())
    return sparse.csr_matrix((np.concatenate(value), (np.concatenate(place), np.concatenate(column))), shape=(count, 6 * n))


def _convex_step(rows: Rows, effective: sparse.csc_matrix, bias: np.ndarray, discs: np.ndarray) -> np.ndarray:
    """Impulses (r,) of the convex problem for a given bias (r,), scaled to 1 in impulse and speed."""
    import clarabel as library

    clarabel: Any = library
    mass, speed = float(effective.diagonal().max()), max(float(np.abs(bias).max()), np.finfo(float).tiny)
    # Clarabel's tolerances are absolute, so the problem is scaled to 1.
    unit = speed / mass
    lines: list[tuple[list[int], list[float]]] = []
    limits: list[float] = []
    cones = []
    for sign, bound in ((-1.0, rows.lower), (1.0, rows.upper)):
        limited = np.flatnonzero((rows.kind == BOUNDED) & np.isfinite(bound))
        lines += [([i], [sign]) for i in limited.tolist()]
        limits += (sign * bound[limited] / unit).tolist()
    if lines:
        cones.append(clarabel.NonnegativeConeT(len(lines)))
    for i in discs.tolist():
        others = [i, i + 1] if rows.kind[i] == DISC else [i]
        # k p_master >= |p_t| as a second-order cone.
        lines += [([int(rows.master[i])], [-float(rows.coefficient[i])]), *(([j], [-1.0]) for j in others)]
        limits += [0.0] * (1 + len(others))
        cones.append(clarabel.SecondOrderConeT(1 + len(others)))
    place = np.repeat(np.arange(len(lines)), [len(columns) for columns, _ in lines])
    columns = np.array([c for line, _ in lines for c in line], np.int64)
    values = np.array([v for _, line in lines for v in line])
    constraints = sparse.csc_matrix((values, (place, columns)), shape=(len(lines), len(bias)))
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = PRECISION
    problem = clarabel.DefaultSolver(
        sparse.triu(effective / mass + REGULAR * sparse.identity(len(bias)), format="csc"), bias / speed, constraints,
        np.array(limits), cones, settings,
    )
    return unit * np.array(problem.solve().x)
