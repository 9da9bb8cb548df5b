"""Laws of restitution: where the impact of one contact point ends.

An impact is a process in the normal impulse p that has passed so far (Routh 1877; Keller 1986). With n the normal, u
the relative velocity of the contact points (u_n along n, s its tangential part, the slip), K (3, 3) the inverse
effective mass and J the impulse so far

    dJ = (n + f) dp,    du = K (n + f) dp,    f the tangential impulse per normal impulse (see friction.py).

While u_n < 0 the contact is compressed, while u_n > 0 it restitutes. p_c, p_r are the normal impulses of all
compression and of all restitution, W_c = -integral of u_n dp and W_r = integral of u_n dp the works of the normal
impulse, a the approach speed. The impact ends

    Newton      where u_n = e a, or where all kinetic energy lost has come back if that is earlier,
    Poisson     where p_r = e p_c,
    energetic   where W_r = e^2 W_c (Stronge 1990).

Without friction, and where K does not couple n with tangents, these are the same. Energy never grows for e <= 1. With
energetic restitution it changes by (e^2 - 1) W_c plus the work of friction. For Poisson's law let T(p) be the kinetic
energy: T' = u_n - mu |s| is continuous, T'' = (n + f).K (n + f) never increases (it falls at the rate 2 mu |s| |d'|^2
while the slip direction d turns, and where the slip stops f becomes the minimiser of that form in Coulomb's disc), so
T' is concave; it is not positive at the end of compression, hence T(p_c + x) <= T(p_c - x). Newton's law alone does
make energy (Kane and Levinson 1985), hence its second end.

This file has what holds along a straight stretch, on which f does not change: u_n is linear and u_n dp quadratic in
p, all ends in closed form. `sequence` and `block` apply it; inside sub-stepped islands see `_rebound` in `solvers/tgs_soft/solver.py`.
"""

from math import inf, sqrt
from typing import NamedTuple

import numpy as np

from rigidimpulse.core.kernels import jit

NEWTON, POISSON, ENERGETIC, AUTO = 0, 1, 2, 3
LAWS = {"newton": NEWTON, "poisson": POISSON, "energetic": ENERGETIC, "auto": AUTO}
"""Numbers of the laws in kernels. "auto" is energetic where there is friction, Newton's law elsewhere."""

# Places in the array of a process: u_n, s, J; p_c, W_c, p_r, W_r; 1 while compressed, else 0.
UN, S1, S2, JN, J1, J2, PC, WC, PR, WR, COMPRESSED = range(11)
PLACES = 11


class ImpactRule(NamedTuple):
    """How the m contacts of an island rebound, and which speeds count."""

    law: int  # one of LAWS
    rest_speed: np.ndarray  # (m,) m/s, a slower rebound is none
    tolerance: float  # m/s, a slower approach is none
    scale: float  # m/s, speed of the island


class PairLaw(NamedTuple):
    """The law of one contact and its coefficients."""

    law: int  # one of LAWS
    e: float  # restitution
    e_t: float  # tangential restitution
    mu_s: float  # static friction
    mu_k: float  # dynamic friction


class PointMass(NamedTuple):
    """K in the frame of the contact (n, t1, t2) [1/kg]."""

    nn: float
    n1: float
    n2: float
    t11: float
    t12: float
    t22: float


@jit
def energy_change(k, start, jn, j1, j2):
    """Change of kinetic energy by an impulse (jn, j1, j2) [N s] on a contact with velocity start (3 numbers) [m/s]: J.u + J.K J / 2 [J]."""
    linear = jn * start[0] + j1 * start[1] + j2 * start[2]
    coupled = jn * (k.n1 * j1 + k.n2 * j2) + k.t12 * j1 * j2
    return linear + coupled + 0.5 * (k.nn * jn * jn + k.t11 * j1 * j1 + k.t22 * j2 * j2)


@jit
def _positive_root(constant, slope, bend):
    """The x > 0 with constant + slope x + bend x^2 / 2 = 0, for constant <= 0; inf if there is none."""
    square = slope * slope - 2.0 * bend * constant
    if square < 0.0:
        return inf
    root = sqrt(square)
    if slope < 0.0:
        return (root - slope) / bend if bend > 0.0 else inf
    return -2.0 * constant / (slope + root) if slope + root > 0.0 else inf


@jit
def _left_of_restitution(law, e, k, start, f, g, q):
    """Normal impulse until the law ends the impact, if it goes on along (1, f); inf if it never does. g = K (1, f)."""
    (f1, f2), (g_n, g_1, g_2) = f, g
    if law == POISSON:
        return max(e * q[PC] - q[PR], 0.0)
    if law == NEWTON:
        left = max((-e * start[0] - q[UN]) / g_n, 0.0) if g_n > 0.0 else inf
        if e > 1.0:
            return left
        # Newton's law ends early where all kinetic energy lost has come back.
        lost = min(energy_change(k, start, q[JN], q[J1], q[J2]), 0.0)
        return min(left, _positive_root(lost, q[UN] + f1 * q[S1] + f2 * q[S2], g_n + f1 * g_1 + f2 * g_2))
    return _positive_root(min(q[WR] - e * e * q[WC], 0.0), q[UN], g_n)


@jit
def go_straight(law, e, k, start, f1, f2, limit, q):
    """Go on with f = (f1, f2) for at most `limit` of normal impulse [N s]; returns True where the impact is over.

    start: (u_n, s_1, s_2) before the impact [m/s]; q (PLACES,): the process, changed in place.
    """
    g_n = k.nn + k.n1 * f1 + k.n2 * f2
    g_1 = k.n1 + k.t11 * f1 + k.t12 * f2
    g_2 = k.n2 + k.t12 * f1 + k.t22 * f2
    if q[JN] == 0.0 and g_n > 0.0 and -(1.0 + e) * start[0] <= limit * g_n:
        # Straight from start to end: all laws agree.
        q[JN] = -(1.0 + e) * start[0] / g_n
        q[J1], q[J2] = f1 * q[JN], f2 * q[JN]
        return True
    # u_n is linear: it changes its sign at most once.
    for _ in range(2):
        compressed = q[COMPRESSED] > 0.0
        if not compressed and e <= 0.0:
            return True
        if compressed:
            turn = max(-q[UN], 0.0) / g_n if g_n > 0.0 else inf
            end = inf
        else:
            turn = max(q[UN], 0.0) / -g_n if g_n < 0.0 else inf
            end = _left_of_restitution(law, e, k, start, (f1, f2), (g_n, g_1, g_2), q)
        step = min(min(turn, end), limit)
        if step == inf:
            return False
        work = step * (q[UN] + 0.5 * g_n * step)
        if compressed:
            q[PC] += step
            q[WC] -= work
        else:
            q[PR] += step
            q[WR] += work
        # At the turn u_n is 0 exactly, not to rounding.
        q[UN] = q[UN] + g_n * step if step < turn else 0.0
        q[S1] += g_1 * step
        q[S2] += g_2 * step
        q[JN] += step
        q[J1] += f1 * step
        q[J2] += f2 * step
        limit -= step
        if step == end:
            return True
        if step < turn:
            return False
        q[COMPRESSED] = 1.0 - q[COMPRESSED]
    return False
