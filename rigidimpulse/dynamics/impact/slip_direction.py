"""The part of an impact in which the slip turns: integrated by Taylor series.

While the contact slips, f = -mu d with d = s / |s|. Where K couples the tangents with each other or with n the slip
turns, and s has no closed form as a function of the normal impulse p. In the variable x with dp = |s| dx / F the
equations are homogeneous in s and stay regular however small the slip gets (it goes to zero exponentially, as x goes
to infinity):

    s' = (|s| k_t - mu K_t s) / F,    u_n' = (|s| k_n - mu k_t.s) / F,    J_t' = -mu s / F,    p' = |s| / F,    W' = u_n p',

with K = [[k_n, k_t], [k_t, K_t]] and F = |k_t| + mu |K_t| the scale of the right side. A step is the Taylor series of
order ORDER, by the recurrences of products and of |s|^2 = s.s, of such a length that the last terms are round-off
(Jorba and Zou 2005); phases of the impact that end within a step are found on the series. Directions d with d x (k_t
- mu K_t d) = 0 are invariant: there the slip is straight and this file hands back. Every other solution tends to one
of them, exponentially in x, so that few steps are needed; none in plane problems.
"""

from math import frexp, inf, ldexp, sqrt

import numpy as np

from rigidimpulse.core.kernels import jit, jit_making_arrays
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.dynamics.impact.restitution import COMPRESSED, J1, J2, JN, NEWTON, PC, POISSON, PR, S1, S2, UN, WC, WR, energy_change

ORDER = 20
# What counts as none: truncation of a step, relative to the slip; turning, relative to F; error of an impulse, relative to it.
TRUNCATION = TOLERANCES.impact.truncation
STRAIGHT = TOLERANCES.impact.straight
ERROR = TOLERANCES.impact.impulse_error
LONGEST_STEP = 100.0
MOST_STEPS = 400
BISECTIONS = 53
ROOT_STEPS = 20
# Rows of the table of coefficients: s, |s|, and the changes of u_n, p, J_t and W since the step began.
ROW_S1, ROW_S2, ROW_SLIP, ROW_UN, ROW_P, ROW_J1, ROW_J2, ROW_W = range(8)


@jit_making_arrays
def turn(law, e, k, start, mu, q):
    """Go on until the slip is straight or zero (False) or the impact is over (True); arguments as `restitution.go_straight`."""
    scale = sqrt(k.n1 * k.n1 + k.n2 * k.n2) + mu * (k.t11 + k.t22)
    reach = ERROR * max(sqrt(q[S1] * q[S1] + q[S2] * q[S2]), -scale * start[0] / k.nn)
    series = np.empty((8, ORDER + 1))
    for _ in range(MOST_STEPS):
        slip = sqrt(q[S1] * q[S1] + q[S2] * q[S2])
        d1, d2 = q[S1] / slip, q[S2] / slip
        g_1 = k.n1 - mu * (k.t11 * d1 + k.t12 * d2)
        g_2 = k.n2 - mu * (k.t12 * d1 + k.t22 * d2)
        turning, growth = abs(d1 * g_2 - d2 * g_1), d1 * g_1 + d2 * g_2
        # Slip that stops within |s| / growth turns by about turning / growth until then.
        if turning <= STRAIGHT * scale or (growth < 0.0 and turning * slip * scale <= reach * growth * growth):
            return False
        step = _expand(k, mu, scale, slip, q, series)
        if _take_step(law, e, k, start, step, series, q):
            return True
    return False


@jit
def _root(x, i):
    """The i-th root of x >= 0, by Newton's method from above: the bits of powers in the C library depend on the processor."""
    if not 0.0 < x < inf:
        return x
    _, exponent = frexp(x)
    root = ldexp(1.0, -(-exponent // i))
    for _ in range(ROOT_STEPS):
        power = 1.0
        for _ in range(i - 1):
            power *= root
        root = ((i - 1) * root + x / power) / i
    return root


@jit
def _expand(k, mu, scale, slip, q, c):
    """Fill the table of Taylor coefficients c; returns the length of the step."""
    kn, k1, k2 = k.nn / scale, k.n1 / scale, k.n2 / scale
    m = mu / scale
    c[ROW_S1, 0], c[ROW_S2, 0], c[ROW_SLIP, 0], c[ROW_UN, 0] = q[S1], q[S2], slip, q[UN]
    c[ROW_P, 0] = c[ROW_J1, 0] = c[ROW_J2, 0] = c[ROW_W, 0] = 0.0
    for i in range(ORDER):
        # Recurrences of the equations of the head, divided by F (here `scale`).
        s1, s2, r = c[ROW_S1, i], c[ROW_S2, i], c[ROW_SLIP, i]
        share = 1.0 / (i + 1)
        c[ROW_S1, i + 1] = share * (k1 * r - m * (k.t11 * s1 + k.t12 * s2))
        c[ROW_S2, i + 1] = share * (k2 * r - m * (k.t12 * s1 + k.t22 * s2))
        c[ROW_UN, i + 1] = share * (kn * r - m * (k.n1 * s1 + k.n2 * s2))
        c[ROW_P, i + 1] = share * r / scale
        c[ROW_J1, i + 1] = -share * m * s1
        c[ROW_J2, i + 1] = -share * m * s2
        work = square = 0.0
        # W' = u_n p' is a Cauchy product.
        for j in range(i + 1):
            work += c[ROW_UN, j] * c[ROW_SLIP, i - j]
        c[ROW_W, i + 1] = share * work / scale
        # The series of |s| follows from |s|^2 = s.s.
        for j in range(i + 2):
            square += c[ROW_S1, j] * c[ROW_S1, i + 1 - j] + c[ROW_S2, j] * c[ROW_S2, i + 1 - j]
        for j in range(1, i + 1):
            square -= c[ROW_SLIP, j] * c[ROW_SLIP, i + 1 - j]
        c[ROW_SLIP, i + 1] = 0.5 * square / slip
    # Jorba and Zou: the step at which the last two terms are round-off.
    longest = 1.0 / LONGEST_STEP
    for i in range(ORDER - 1, ORDER + 1):
        size = max(sqrt(c[ROW_S1, i] * c[ROW_S1, i] + c[ROW_S2, i] * c[ROW_S2, i]), abs(c[ROW_SLIP, i]))
        longest = max(longest, _root(size / (TRUNCATION * slip), i))
    return 1.0 / longest


@jit
def _at(row, x):
    """The series of a row at x."""
    value = row[ORDER]
    for i in range(ORDER - 1, -1, -1):
        value = value * x + row[i]
    return value


@jit
def _excess(law, e, k, start, c, since, x, q):
    """Not negative once the law ends the impact; x in the step, `since` in it restitution lasts."""
    if law == POISSON:
        return q[PR] + _at(c[ROW_P], x) - _at(c[ROW_P], since) - e * q[PC]
    if law == NEWTON:
        short = _at(c[ROW_UN], x) + e * start[0]
        if e > 1.0:
            return short
        jn, j1, j2 = q[JN] + _at(c[ROW_P], x), q[J1] + _at(c[ROW_J1], x), q[J2] + _at(c[ROW_J2], x)
        # Two units, but only the sign counts.
        return max(short, energy_change(k, start, jn, j1, j2))
    return q[WR] + _at(c[ROW_W], x) - _at(c[ROW_W], since) - e * e * q[WC]


@jit
def _normal_root(c, low, high, sign):
    """Where sign u_n becomes positive in the step."""
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        if sign * _at(c[ROW_UN], middle) > 0.0:
            high = middle
        else:
            low = middle
    return high


@jit
def _take_step(law, e, k, start, step, c, q):
    """Go through the phases of the impact within a step; True where the impact is over."""
    since, over = 0.0, False
    # u_n' = |s| (k_n - mu k_t.d) changes its sign at most twice on the circle of directions.
    for _ in range(4):
        until = step
        compressed = q[COMPRESSED] > 0.0
        sign = 1.0 if compressed else -1.0
        changes = sign * _at(c[ROW_UN], step) > 0.0
        if changes:
            until = _normal_root(c, since, step, sign)
        if not compressed and (e <= 0.0 or _excess(law, e, k, start, c, since, until, q) >= 0.0):
            over = True
            low, until = since, until if e > 0.0 else since
            for _bisection in range(BISECTIONS):
                middle = 0.5 * (low + until)
                if _excess(law, e, k, start, c, since, middle, q) >= 0.0:
                    until = middle
                else:
                    low = middle
        passed, work = _at(c[ROW_P], until) - _at(c[ROW_P], since), _at(c[ROW_W], until) - _at(c[ROW_W], since)
        if compressed:
            q[PC] += passed
            q[WC] -= work
        else:
            q[PR] += passed
            q[WR] += work
        since = until
        if over or not changes:
            break
        q[COMPRESSED] = 1.0 - q[COMPRESSED]
    q[UN], q[S1], q[S2] = _at(c[ROW_UN], since), _at(c[ROW_S1], since), _at(c[ROW_S2], since)
    q[JN] += _at(c[ROW_P], since)
    q[J1] += _at(c[ROW_J1], since)
    q[J2] += _at(c[ROW_J2], since)
    return over
