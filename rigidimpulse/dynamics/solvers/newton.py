"""The exact solver of rows, for islands of any mass ratio: true complementarity, true Coulomb cones.

Problem. Find impulses p and velocities  u = b + Jh Jh^T p  that satisfy the laws of all rows (see `rows`).

Method. Outside a proximal method of multipliers (Rockafellar 1976) with regularisation R = k diag(Jh Jh^T), k driven
from 1e-3 to 1e-12 (at most 1e-9 for FREE rows), which makes redundant rows harmless; inside a semi-smooth Newton method
(Alart & Curnier 1991) on y = Jh^T p:

    p(u) = projection of (R q - u) / (R + s) on the bounds, with the radius of discs from the current p_master
           (k p_master itself where the row is a SLIDE),
    F = (y - Jh^T q) - Jh^T (p(b + Jh y) - q) = 0,        F' = I + Jh^T (-dp/du) Jh,

with a halving line search on |F|. It is written in the changes of y and p since q: as u goes to 0 the round-off of u / R
goes with it. F' has a 6 x 6 block wherever two bodies share a row and is solved by sparse block elimination
(`sparse_lu`), so that chains and stacks cost in proportion to their length. Where the line search fails k is raised; as
the last resort one step is made with the radii frozen, for which the problem is convex. The answer with the least
residual of the natural map is returned, with that residual; one whose impulses are larger must have a residual that is
smaller in proportion. Rows that contradict each other have no answer: their impulses would grow without end.
"""

from math import sqrt
from typing import NamedTuple

import numpy as np

from rigidimpulse.core.kernels import jit, jit_making_arrays
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.core.vector import copy_matrix, copy_vector
from rigidimpulse.dynamics.constraints.rows import BOUNDED, DISC, DISC_SECOND, FREE, SEGMENT, SLIDE, multiply, multiply_transposed
from rigidimpulse.dynamics.solvers.sparse_lu import Elimination, factor, plan_elimination, solve_factored

MAX_OUTER = 60
MAX_INNER = 60
MAX_HALVINGS = 8
MOST_IDLE = 16
REGULARISATION_START = TOLERANCES.solver.regularisation_start
REGULARISATION_LEAST = TOLERANCES.solver.regularisation_least
REGULARISATION_FREE = TOLERANCES.solver.regularisation_free
TINY = TOLERANCES.arithmetic.least_divisor
ROUND_OFF = TOLERANCES.solver.round_off


@jit
def row_weights(rows, weight):
    """Diagonal of Jh Jh^T, into weight (r,); both rows of a disc get the larger one."""
    for i in range(weight.shape[0]):
        total = TINY
        for k in range(12):
            total += rows.jacobian[i, k] ** 2
        weight[i] = total
        if rows.kind[i] == DISC_SECOND:
            weight[i - 1] = weight[i] = max(weight[i - 1], total)


@jit
def natural_residual(rows, u, p, weight):
    """Largest violation of the rows' laws, as a velocity: 0 at a solution."""
    worst = 0.0
    for i in range(p.shape[0]):
        kind, w = rows.kind[i], weight[i]
        # The natural map: p less a step against u, projected on the bounds, is p itself at a solution.
        x = p[i] - (u[i] + rows.softness[i] * p[i]) / w
        if kind == DISC:
            z = p[i + 1] - (u[i + 1] + rows.softness[i + 1] * p[i + 1]) / w
            length, radius = sqrt(x * x + z * z), rows.coefficient[i] * max(p[rows.master[i]], 0.0)
            if length > radius:
                x *= radius / length
                z *= radius / length
            worst = max(worst, max(abs(p[i] - x), abs(p[i + 1] - z)) * w)
        elif kind == SEGMENT:
            radius = rows.coefficient[i] * max(p[rows.master[i]], 0.0)
            worst = max(worst, abs(p[i] - min(max(x, -radius), radius)) * w)
        elif kind == SLIDE:
            worst = max(worst, abs(p[i] - rows.coefficient[i] * p[rows.master[i]]) * w)
        elif kind == BOUNDED or kind == FREE:
            worst = max(worst, abs(p[i] - min(max(x, rows.lower[i]), rows.upper[i])) * w)
    return worst


@jit
def _impulse_law(rows, u, q, r, frozen, p, slope):
    """p(u), and slope (r, 3): -dp_i/du of the row itself, of its partner in a disc, of its master.

    frozen (r,) >= 0 fixes the radius of a disc or segment.
    """
    for i in range(p.shape[0]):
        kind = rows.kind[i]
        # The second row of a disc is done with its first.
        if kind == DISC_SECOND:
            continue
        if kind == SLIDE:
            p[i] = rows.coefficient[i] * p[rows.master[i]]
            slope[i, 0], slope[i, 1], slope[i, 2] = 0.0, 0.0, rows.coefficient[i] * slope[rows.master[i], 0]
            continue
        stiffness = 1.0 / (r[i] + rows.softness[i])
        x = (r[i] * q[i] - u[i]) * stiffness
        slope[i, 0], slope[i, 1], slope[i, 2] = stiffness, 0.0, 0.0
        if kind == FREE or kind == BOUNDED:
            p[i] = min(max(x, rows.lower[i]), rows.upper[i])
            # At a bound the impulse no longer depends on the velocity.
            if p[i] != x:
                slope[i, 0] = 0.0
            continue
        coupled = frozen[i] < 0.0
        master = rows.master[i]
        radius = rows.coefficient[i] * max(p[master], 0.0) if coupled else frozen[i]
        share = rows.coefficient[i] * slope[master, 0] if coupled else 0.0
        z = 0.0
        if kind == DISC:
            z = (r[i] * q[i + 1] - u[i + 1]) * stiffness
            slope[i + 1, 0], slope[i + 1, 1], slope[i + 1, 2] = stiffness, 0.0, 0.0
        length = sqrt(x * x + z * z)
        # Slip: the impulse is on the cone, whose radius moves with the normal impulse of the master.
        if length > radius:
            k = stiffness * radius / length
            x, z = x / length, z / length
            slope[i, 0], slope[i, 2] = k * (1.0 - x * x), share * x
            if kind == DISC:
                slope[i, 1] = slope[i + 1, 1] = -k * x * z
                slope[i + 1, 0], slope[i + 1, 2] = k * (1.0 - z * z), share * z
            x, z = radius * x, radius * z
        p[i] = x
        if kind == DISC:
            p[i + 1] = z


@jit
def _add_outer(blocks, place, jacobian, row, first, right, start):
    """Block `place` += left^T right, with left the six entries of a row of the Jacobian from `first` on, right from `start` on."""
    r0, r1, r2 = right[start], right[start + 1], right[start + 2]
    r3, r4, r5 = right[start + 3], right[start + 4], right[start + 5]
    for i in range(6):
        left = jacobian[row, first + i]
        blocks[place, i, 0] += left * r0
        blocks[place, i, 1] += left * r1
        blocks[place, i, 2] += left * r2
        blocks[place, i, 3] += left * r3
        blocks[place, i, 4] += left * r4
        blocks[place, i, 5] += left * r5


@jit
def assemble(rows, slope, slot, blocks, right, n):
    """I + Jh^T slope Jh; right (12,): working memory."""
    jacobian, kinds, masters = rows.jacobian, rows.kind, rows.master
    for place in range(blocks.shape[0]):
        for i in range(6):
            for j in range(6):
                blocks[place, i, j] = 0.0
    for i in range(n):
        place = slot[i, i]
        for k in range(6):
            blocks[place, k, k] = 1.0
    for i in range(slope.shape[0]):
        here, partner, master = slope[i, 0], slope[i, 1], slope[i, 2]
        # Rows at a bound add nothing to F'.
        if here == 0.0 and partner == 0.0 and master == 0.0:
            continue
        other = i + 1 if kinds[i] == DISC else (i - 1 if kinds[i] == DISC_SECOND else i)
        above, a, b = masters[i], rows.first[i], rows.second[i]
        for k in range(0 if a >= 0 else 6, 12 if b >= 0 else 6):
            # A row of (-dp/du) Jh: the row itself, its partner in the disc, and its master.
            right[k] = here * jacobian[i, k] + partner * jacobian[other, k] + master * jacobian[above, k]
        if a >= 0:
            _add_outer(blocks, slot[a, a], jacobian, i, 0, right, 0)
        if a >= 0 and b >= 0:
            _add_outer(blocks, slot[a, b], jacobian, i, 0, right, 6)
            _add_outer(blocks, slot[b, a], jacobian, i, 6, right, 0)
        if b >= 0:
            _add_outer(blocks, slot[b, b], jacobian, i, 6, right, 6)


class RegularisedLaw(NamedTuple):
    """The regularised laws of the rows about impulses q."""

    base: np.ndarray  # (r,) m/s, u at q
    q: np.ndarray  # (r,) N s
    r: np.ndarray  # (r,) 1/kg, regularisation
    frozen: np.ndarray  # (r,) radii of discs that are frozen, or -1


@jit
def _norm(v):
    total = 0.0
    for i in range(v.shape[0]):
        for k in range(6):
            total += v[i, k] * v[i, k]
    return sqrt(total)


@jit
def _evaluate(rows, law, change, u, p, slope, residual):
    """p and slope at y + change, and the residual F (n, 6); returns |F|. u (r,) is working memory for the velocities."""
    base, q, r, frozen = law.base, law.q, law.r, law.frozen
    multiply(rows, change, u)
    for i in range(u.shape[0]):
        u[i] += base[i]
    _impulse_law(rows, u, q, r, frozen, p, slope)
    for i in range(u.shape[0]):
        u[i] = p[i] - q[i]
    multiply_transposed(rows, u, residual)
    for i in range(change.shape[0]):
        for k in range(6):
            residual[i, k] = change[i, k] - residual[i, k]
    return _norm(residual)


@jit
def _largest(p):
    worst = 0.0
    for i in range(p.shape[0]):
        worst = max(worst, abs(p[i]))
    return worst


@jit
def _speed(rows, y, line):
    """Largest velocity of a row that y (n, 6) stands for."""
    multiply(rows, y, line)
    largest = 0.0
    for i in range(line.shape[0]):
        largest = max(largest, abs(line[i]))
    return largest


class Factored(NamedTuple):
    """F' as it was factored last: slopes are often the same again, wherever no row changes between its bounds and no contact slips."""

    elimination: Elimination
    blocks: np.ndarray  # (num_blocks, 6, 6) factors
    pivots: np.ndarray  # (n, 6)
    slope: np.ndarray  # (r, 3) of which they are; not a number before the first time
    right: np.ndarray  # (12,) working memory


class Search(NamedTuple):
    """Working memory of `_newton`, for all solves of a system."""

    change: np.ndarray  # (n, 6) y less what it is at q
    trial: np.ndarray  # (n, 6) of the line search
    residual: np.ndarray  # (n, 6) F
    step: np.ndarray  # (n, 6)
    u: np.ndarray  # (r,) m/s
    line: np.ndarray  # (r,) m/s
    slope: np.ndarray  # (r, 3) -dp/du


@jit
def _factor_again(rows, factored, slope):
    """See that F' with these slopes (r, 3) is factored."""
    known = factored.slope
    same = True
    for i in range(slope.shape[0]):
        same = same and slope[i, 0] == known[i, 0] and slope[i, 1] == known[i, 1] and slope[i, 2] == known[i, 2]
    if same:
        return
    assemble(rows, slope, factored.elimination.slot, factored.blocks, factored.right, factored.pivots.shape[0])
    factor(factored.elimination, factored.blocks, factored.pivots)
    copy_matrix(slope, known)


@jit_making_arrays
def _search(of_bodies, of_rows, count):
    """Working memory for `count` rows of n bodies, of (4, n, 6) and (2, count)."""
    return Search(of_bodies[0], of_bodies[1], of_bodies[2], of_bodies[3], of_rows[0], of_rows[1], np.empty((count, 3)))


@jit
def _newton(rows, factored, law, search, p, target):
    """Find p with F = 0. Returns whether it converged (or cannot be improved further)."""
    n, change, trial, residual, step = factored.pivots.shape[0], search.change, search.trial, search.residual, search.step
    u, line, slope = search.u, search.line, search.slope
    for i in range(n):
        for k in range(6):
            change[i, k] = 0.0
    size = _evaluate(rows, law, change, u, p, slope, residual)
    for _ in range(MAX_INNER):
        if _speed(rows, residual, line) <= target:
            return True
        _factor_again(rows, factored, slope)
        copy_matrix(residual, step)
        solve_factored(factored.elimination, factored.blocks, factored.pivots, step)
        # |F| carries the round-off of u divided by k; its step does not.
        is_last = _speed(rows, step, line) <= target
        scale, improved, trial_size = 1.0, False, size
        for _halving in range(MAX_HALVINGS):
            for i in range(n):
                for k in range(6):
                    trial[i, k] = change[i, k] - scale * step[i, k]
            trial_size = _evaluate(rows, law, trial, u, p, slope, residual)
            if is_last or trial_size < size * (1.0 - 0.1 * scale):
                improved = True
                break
            scale *= 0.5
        if not improved:
            return _speed(rows, step, line) <= 1e4 * target
        copy_matrix(trial, change)
        if is_last:
            return True
        size = trial_size
    return False


@jit
def velocities_from_impulses(rows, p, y, u):
    """From impulses p (r,): y (n, 6) = Jh^T p and velocities u (r,) = b + Jh y."""
    multiply_transposed(rows, p, y)
    multiply(rows, y, u)
    for i in range(u.shape[0]):
        u[i] += rows.bias[i]


@jit
def rounding_floor(rows, weight, p):
    """Velocity below which the residual of impulses p is round-off: what large opposite impulses leave where they cancel."""
    largest = 0.0
    for i in range(p.shape[0]):
        largest = max(largest, abs(rows.bias[i]), weight[i] * abs(p[i]))
    return ROUND_OFF * largest


@jit_making_arrays
def prepare(rows, n):
    """Nothing factored yet, of rows of n movable bodies."""
    elimination, count = plan_elimination(rows.first, rows.second, n), rows.bias.shape[0]
    known, right = np.empty((count, 3)), np.empty(12)
    for i in range(count):
        known[i, 0] = np.nan
    return Factored(elimination, np.empty((elimination.num_blocks, 6, 6)), np.empty((n, 6), np.int64), known, right)


@jit_making_arrays
def solve_newton(rows, n, target):
    """Solve the rows of an island of n movable bodies; `rows.impulse` is start and answer.

    target: residual asked for, m/s. Returns the residual of the natural map that was reached.
    """
    factored, count = prepare(rows, n), rows.bias.shape[0]
    # Few arrays: for a body or two, to make one for each took as long as a step of the search.
    of_bodies, of_rows = np.empty((5, n, 6)), np.empty((8, count))
    y, search = of_bodies[4], _search(of_bodies, of_rows, count)
    weight, u, r, trial, q, frozen = of_rows[2], of_rows[3], of_rows[4], of_rows[5], of_rows[6], of_rows[7]
    row_weights(rows, weight)
    copy_vector(rows.impulse, trial)
    copy_vector(rows.impulse, q)
    velocities_from_impulses(rows, q, y, u)
    best, largest = natural_residual(rows, u, q, weight), _largest(q)
    k, free_k, failures, stagnant, idle, previous, convex = REGULARISATION_START, REGULARISATION_FREE, 0, 0, 0, best, False
    for _ in range(MAX_OUTER):
        if best <= max(target, rounding_floor(rows, weight, rows.impulse)) or stagnant > 4:
            break
        for i in range(count):
            # With frozen radii the problem is convex: the last resort.
            frozen[i] = rows.coefficient[i] * max(q[rows.master[i]], 0.0) if convex else -1.0
            r[i] = weight[i] * (min(k, free_k) if rows.kind[i] == FREE else k)
        solved = _newton(rows, factored, RegularisedLaw(u, q, r, frozen), search, trial, 0.05 * target)
        # The line search failed: more regularisation, and at last a step with frozen radii.
        if not solved and not convex:
            failures += 1
            convex = k >= 0.5
            free_k *= 30.0
            k = min(30.0 * k, 1.0)
            continue
        copy_vector(trial, q)
        velocities_from_impulses(rows, q, y, u)
        reached = natural_residual(rows, u, q, weight)
        now = _largest(q)
        # Larger impulses are accepted only with a residual smaller in proportion: rows that contradict each other have none.
        if reached < best and (largest == 0.0 or reached * now <= best * largest):
            best, largest = reached, now
            copy_vector(q, rows.impulse)
        if reached > 0.5 * previous and k <= REGULARISATION_LEAST:
            stagnant += 1
        idle = idle + 1 if reached > 0.9 * previous else 0
        if idle > MOST_IDLE:
            break
        previous = reached
        k = max(k * 0.3, 1e-2) if convex else max(k * (0.1 if failures < 3 else 0.3), REGULARISATION_LEAST)
        convex = False
    return best
