"""The exact solver of rows for small islands: normal complementarity and the true Coulomb cone.

Problem. With J the Jacobian of m contacts (three rows each: normal n, tangents s, t), M the mass matrix, Jh = J
M^(-1/2) the mass-scaled Jacobian and b the velocity the contacts would have without impulses, find impulses p and
velocities u with

    u = b + Jh Jh^T p,      0 <= p_n  _|_  u_n >= 0,      |p_t| <= mu p_n,      p_t = -mu p_n u_t / |u_t| where u_t != 0.

Method. Outside a proximal method of multipliers (Rockafellar 1976) with regularisation R = k diag(Jh Jh^T), k driven
from 1e-3 to 1e-9, which makes redundant points harmless; inside a semi-smooth Newton method (Alart & Curnier 1991) on
y = Jh^T p:

    p(u) = projection of q - u / R on the cone of the current normal impulse,      F(y) = y - Jh^T p(b + Jh y) = 0,

with a halving line search on |F|. Where the line search fails k is raised; as the last resort one step is made with
the radius of the cone frozen, for which the problem is convex. The answer with the least natural-map residual is
returned, with that residual.
"""

from math import sqrt

import numpy as np

from rigidimpulse._jit import jit

MAX_OUTER = 60
MAX_INNER = 60
MAX_HALVINGS = 8
REGULARISATION_START = 1e-3
REGULARISATION_LEAST = 1e-9
TINY = 1e-300


@jit
def natural_residual(u, p, friction, weight_normal, weight_tangent):
    """Largest violation of the contact law, as a velocity [m/s]: 0 at a solution."""
    worst = 0.0
    for c in range(friction.shape[0]):
        i = 3 * c
        worst = max(worst, abs(min(u[i], p[i] * weight_normal[c])))
        x = p[i + 1] - u[i + 1] / weight_tangent[c]
        y = p[i + 2] - u[i + 2] / weight_tangent[c]
        length = sqrt(x * x + y * y)
        radius = friction[c] * max(p[i], 0.0)
        if length > radius:
            x *= radius / length
            y *= radius / length
        worst = max(worst, max(abs(p[i + 1] - x), abs(p[i + 2] - y)) * weight_tangent[c])
    return worst


@jit
def _impulse_law(u, q, friction, r_normal, r_tangent, frozen, p, slope):
    """p(u) and slope = -dp/du (3 x 3 a contact); frozen[c] >= 0 fixes the cone's radius."""
    for c in range(friction.shape[0]):
        i = 3 * c
        for a in range(3):
            for b in range(3):
                slope[c, a, b] = 0.0
        normal = q[i] - u[i] / r_normal[c]
        pressed = normal > 0.0
        if pressed:
            slope[c, 0, 0] = 1.0 / r_normal[c]
        else:
            normal = 0.0
        p[i] = normal
        x = q[i + 1] - u[i + 1] / r_tangent[c]
        y = q[i + 2] - u[i + 2] / r_tangent[c]
        length = sqrt(x * x + y * y)
        coupled = frozen[c] < 0.0
        radius = friction[c] * normal if coupled else frozen[c]
        if length <= radius:
            p[i + 1] = x
            p[i + 2] = y
            slope[c, 1, 1] = 1.0 / r_tangent[c]
            slope[c, 2, 2] = 1.0 / r_tangent[c]
        elif radius > 0.0:
            x /= length
            y /= length
            p[i + 1] = radius * x
            p[i + 2] = radius * y
            k = radius / (length * r_tangent[c])
            slope[c, 1, 1] = k * (1.0 - x * x)
            slope[c, 2, 2] = k * (1.0 - y * y)
            slope[c, 1, 2] = -k * x * y
            slope[c, 2, 1] = -k * x * y
            if coupled and pressed:
                slope[c, 1, 0] = friction[c] * x / r_normal[c]
                slope[c, 2, 0] = friction[c] * y / r_normal[c]
        else:
            p[i + 1] = 0.0
            p[i + 2] = 0.0


@jit
def multiply(matrix, vector, out):
    for i in range(matrix.shape[0]):
        total = 0.0
        for k in range(matrix.shape[1]):
            total += matrix[i, k] * vector[k]
        out[i] = total


@jit
def multiply_transposed(matrix, vector, out):
    for k in range(matrix.shape[1]):
        out[k] = 0.0
    for i in range(matrix.shape[0]):
        if vector[i] != 0.0:
            for k in range(matrix.shape[1]):
                out[k] += matrix[i, k] * vector[i]


@jit
def solve_linear(a, x):
    """Solve a x = x in place by Gaussian elimination with partial pivoting; a is overwritten."""
    n = a.shape[0]
    for k in range(n):
        pivot = k
        for i in range(k + 1, n):
            if abs(a[i, k]) > abs(a[pivot, k]):
                pivot = i
        if pivot != k:
            for j in range(n):
                a[k, j], a[pivot, j] = a[pivot, j], a[k, j]
            x[k], x[pivot] = x[pivot], x[k]
        for i in range(k + 1, n):
            if a[i, k] != 0.0:
                factor = a[i, k] / a[k, k]
                for j in range(k + 1, n):
                    a[i, j] -= factor * a[k, j]
                x[i] -= factor * x[k]
    for k in range(n - 1, -1, -1):
        for j in range(k + 1, n):
            x[k] -= a[k, j] * x[j]
        x[k] /= a[k, k]


@jit
def _assemble(jacobian, slope, matrix):
    """I + Jh^T slope Jh."""
    m, n = slope.shape[0], jacobian.shape[1]
    for i in range(n):
        for j in range(n):
            matrix[i, j] = 1.0 if i == j else 0.0
    for c in range(m):
        for a in range(3):
            for b in range(3):
                s = slope[c, a, b]
                if s == 0.0:
                    continue
                for i in range(n):
                    left = s * jacobian[3 * c + a, i]
                    if left != 0.0:
                        for j in range(n):
                            matrix[i, j] += left * jacobian[3 * c + b, j]


@jit
def _norm(v):
    total = 0.0
    for i in range(v.shape[0]):
        total += v[i] * v[i]
    return sqrt(total)


@jit
def _newton(jacobian, b, q, friction, r_normal, r_tangent, frozen, y, u, p, slope, target):
    """Solve F(y) = 0 from y; returns whether it converged (or cannot be improved further)."""
    rows, n = jacobian.shape
    residual = np.empty(n)
    step = np.empty(n)
    trial_y = np.empty(n)
    row = np.empty(rows)
    matrix = np.empty((n, n))
    multiply(jacobian, y, u)
    for i in range(rows):
        u[i] += b[i]
    _impulse_law(u, q, friction, r_normal, r_tangent, frozen, p, slope)
    multiply_transposed(jacobian, p, residual)
    for i in range(n):
        residual[i] = y[i] - residual[i]
    size = _norm(residual)
    for _ in range(MAX_INNER):
        multiply(jacobian, residual, row)
        error = 0.0
        for i in range(rows):
            error = max(error, abs(row[i]))
        if error <= target:
            return True
        _assemble(jacobian, slope, matrix)
        for i in range(n):
            step[i] = -residual[i]
        solve_linear(matrix, step)
        scale = 1.0
        improved = False
        for _halving in range(MAX_HALVINGS):
            for i in range(n):
                trial_y[i] = y[i] + scale * step[i]
            multiply(jacobian, trial_y, u)
            for i in range(rows):
                u[i] += b[i]
            _impulse_law(u, q, friction, r_normal, r_tangent, frozen, p, slope)
            multiply_transposed(jacobian, p, residual)
            for i in range(n):
                residual[i] = trial_y[i] - residual[i]
            trial_size = _norm(residual)
            if trial_size < size * (1.0 - 0.1 * scale):
                improved = True
                break
            scale *= 0.5
        if not improved:
            return error <= 1e4 * target or size <= 1e-13 * _norm(y)
        for i in range(n):
            y[i] = trial_y[i]
        size = trial_size
    return False


@jit
def solve_cone(jacobian, b, friction, p, target):
    """Solve the contact problem of the module's head in place; returns the natural residual reached [m/s].

    jacobian (3m, N) mass-scaled, b (3m,), friction (m,), p (3m,) start and answer, target [m/s] the residual asked for.
    """
    m = friction.shape[0]
    rows, n = jacobian.shape
    weight_normal = np.empty(m)
    weight_tangent = np.empty(m)
    for c in range(m):
        for a in range(3):
            total = 0.0
            for k in range(n):
                total += jacobian[3 * c + a, k] ** 2
            if a == 0:
                weight_normal[c] = max(total, TINY)
                weight_tangent[c] = TINY
            else:
                weight_tangent[c] = max(weight_tangent[c], total)
    y = np.empty(n)
    y_start = np.empty(n)
    u = np.empty(rows)
    trial = p.copy()
    q = p.copy()
    slope = np.empty((m, 3, 3))
    frozen = np.full(m, -1.0)
    multiply_transposed(jacobian, p, y)
    multiply(jacobian, y, u)
    for i in range(rows):
        u[i] += b[i]
    best = natural_residual(u, p, friction, weight_normal, weight_tangent)
    k = REGULARISATION_START
    failures = 0
    stagnant = 0
    previous = best
    convex = False
    for _ in range(MAX_OUTER):
        if best <= target or stagnant > 4:
            break
        for i in range(n):
            y_start[i] = y[i]
        for c in range(m):
            frozen[c] = friction[c] * max(q[3 * c], 0.0) if convex else -1.0
        solved = _newton(
            jacobian, b, q, friction, k * weight_normal, k * weight_tangent, frozen, y, u, trial, slope, 0.05 * target
        )
        if not solved and not convex:
            failures += 1
            for i in range(n):
                y[i] = y_start[i]
            convex = k >= 0.5
            k = min(30.0 * k, 1.0)
            continue
        multiply_transposed(jacobian, trial, y)
        multiply(jacobian, y, u)
        for i in range(rows):
            u[i] += b[i]
        reached = natural_residual(u, trial, friction, weight_normal, weight_tangent)
        if reached < best:
            best = reached
            for i in range(rows):
                p[i] = trial[i]
        if reached > 0.5 * previous:
            stagnant += 1
        previous = reached
        for i in range(rows):
            q[i] = trial[i]
        k = max(k * 0.3, 1e-2) if convex else max(k * (0.1 if failures < 3 else 0.3), REGULARISATION_LEAST)
        convex = False
    return best
