"""Springs, dampers and drives as rows: exact for the oscillator that the row alone would be, at any step size.

A row of stiffness k, damping c and target rate r acts on the coordinate x (less its target) with W = J M^-1 J^T:

    x'' = -w^2 x - 2 s x' + a,     w^2 = k W,   2 s = c W,   a = other accelerations + c W r
    x(h) = A x_0 + B u_0 + R a,    x'(h) = A' x_0 + B' u_0 + B a
    R'' = 1 - 2 s R' - w^2 R,  R(0) = R'(0) = 0,     B = R',   A = 1 - w^2 R,   A' = -w^2 B,   B' = R''

Over a sub-step the force p / h is constant and x(h) = x_0 + h u_0 + h^2 / 2 (a + W p / h). Both agree for every a if p
obeys, with z = 2 x(h) / h (the velocity of the row in `joint_sub_step`) and q = 1 - 2 R / h^2,

    z + softness p = beta,     softness = W (1 - q) / q,
    beta = 2 / (h q) [(A - 1) x_0 + (B - h) u_0 + R c W r] + 2 x_0 / h + 2 u_0

The a that x(h) shows gives the velocity at the end, x'(h), and the impulse of the row over the sub-step,

    int f dt = (x'(h) - u_0 - (a - c W r) h) / W.

A row that is slow over h (w h and 2 s h below SLOW) is given that impulse: rows that pull at each other then stay of second
order, for the others' pull that grows on the way is in theirs. A faster one, whose bodies end at the rate u, gets

    int f dt - Z (u - x'(h)),     Z = c h + k h^2

which is stable however stiff it is, as if it were stopped at x'(h). That alone would be wrong where rows pull at each other: of a chain
with strong dampers each is fast, and x'(h) is the mean of its rate, but all links together fall slowly, and would gain half of their speed
in each sub-step. So a soft joint is the damped oscillator it stands for, drives are implicit, and k -> infinity is the hard joint.
"""

from math import cos, exp, expm1, sin, sqrt

from rigidimpulse.core.kernels import jit

SERIES = 0.5
TERMS = 24
CRITICAL = 1e-2
SLOW = 1.0


@jit
def response(square, twice_s, h):
    """R(h), B(h) and q(h); square: w^2 [1/s^2], twice_s: 2 s [1/s]."""
    # The closed forms lose digits for slow oscillators.
    if square * h * h < SERIES and twice_s * h < SERIES:
        before, term = 0.0, 0.5 * h * h
        total, rate, lack = term, h, 0.0
        for n in range(2, TERMS):
            # term n is c_n h^n;  (n + 1) c_{n+1} = -2 s c_n - w^2 c_{n-1} / n
            following = -(twice_s * h * term + square * h * h * before / n) / (n + 1)
            before, term = term, following
            total += term
            rate += (n + 1) * term / h
            lack -= 2.0 * term / (h * h)
        return total, rate, lack
    s = 0.5 * twice_s
    inside = s * s - square
    if abs(inside) * h * h < CRITICAL:
        even, odd = _cosh_and_sinhc(inside * h * h)
        rate = exp(-s * h) * h * odd
        total = (1.0 - exp(-s * h) * even - s * rate) / square
    elif inside < 0.0:
        w = sqrt(-inside)
        decay = exp(-s * h)
        rate = decay * sin(w * h) / w
        total = (1.0 - decay * (cos(w * h) + s / w * sin(w * h))) / square
    else:
        root = sqrt(inside)
        # The slow root as a quotient: the difference would cancel.
        fast, slow = -s - root, -square / (s + root)
        rate = (exp(slow * h) - exp(fast * h)) / (2.0 * root)
        rising = expm1(slow * h) / slow if slow < 0.0 else h
        total = (rising - expm1(fast * h) / fast) / (2.0 * root)
    return total, rate, 1.0 - 2.0 * total / (h * h)


@jit
def _cosh_and_sinhc(x):
    """cosh(z) and sinh(z) / z for a small x = z^2 of either sign."""
    even = odd = term = 1.0
    for n in range(1, 6):
        term *= x / (2 * n)
        odd += term / (2 * n + 1)
        even += term
        term /= 2 * n + 1
    return even, odd


@jit
def soft_row(stiffness, damping, rate, weight, x, u, h):
    """(softness, beta) of the module's head; weight: W, x, u: coordinate less target and its rate at the start."""
    square, twice_s = stiffness * weight, damping * weight
    total, first, lack = response(square, twice_s, h)
    lack = max(lack, 1e-30)
    push = (-square * total) * x + (first - h) * u + total * twice_s * rate
    return weight * (1.0 - lack) / lack, 2.0 / (h * lack) * push + 2.0 * x / h + 2.0 * u


@jit
def is_slow(stiffness, damping, weight, h):
    """Whether a row's own oscillation is slow over h."""
    return stiffness * weight * h * h < SLOW and damping * weight * h < SLOW


@jit
def end_rate(stiffness, damping, weight, x, u, x_end, h):
    """x'(h) of the module's head, and the acceleration a that took x, u to x_end in h."""
    square, twice_s = stiffness * weight, damping * weight
    total, first, _ = response(square, twice_s, h)
    a = (x_end - (1.0 - square * total) * x - first * u) / total
    return -square * first * x + (1.0 - twice_s * first - square * total) * u + first * a, a
