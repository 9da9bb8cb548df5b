"""Coulomb's law at the impact of a single contact point: how friction acts along the process of restitution.py.

K (3, 3) is the inverse effective mass of the contact (A9), u the relative velocity of the contact points before, n
the normal, k_t = K n along the tangents and K_t the tangential block of K, s the slip and d its direction. Per normal
impulse friction passes

    f = -mu d               while it slips,
    f = -K_t^-1 k_t         once the slip has stopped, where |f| <= mu_s: it sticks to the end,
    f = -mu d               once the slip has stopped, else: it slips on in the only direction in which slip can grow.

That direction is the d with k_t - mu K_t d = g d, g > 0: |(mu K_t + g)^-1 k_t| = 1 has one root because its left side
falls from more than 1 to 0 (Bhatt and Koechling 1995; Batlle 1996). So slip may stop, stop and go on, or reverse, and
friction may press so hard that u_n grows while it slips (jamb): all follow from the same three lines. Friction that
would have to be infinite does not exist: (n + f).K (n + f) > 0.

Whether a contact sticks is asked with static friction; an impact that still slips at its end is done again with
dynamic friction, as in blocks.

Without friction J = -(1 + e) u_n / (n.K n) n by any law. With tangential restitution e_t > 0 a contact that grips is
bilateral,

    J = -K^-1 (u + e u_n n + x u_t),    x the largest in [0, e_t] with J in the cone of static friction,

e and x reduced together where that would make energy (e <= 1); a contact that does not grip even with x = 0 has the process.
"""

from math import sqrt

import numpy as np

from rigidimpulse.core.kernels import jit, jit_making_arrays
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.core.vector import dot, tangents
from rigidimpulse.dynamics.impact.restitution import COMPRESSED, J1, J2, JN, PLACES, S1, S2, UN, PointMass, energy_change, go_straight
from rigidimpulse.dynamics.impact.slip_direction import turn

# How an impact ends.
SLIDES, STICKS, UNFINISHED = 0, 1, 2
DIRECTION_STEPS = 50
# Round-off of products: of K, relative to its normal part (below it the normal and the two tangents do not couple), and of u.
ROUND_OFF = TOLERANCES.impact.coupling_round_off
# Energy made by round-off, relative to the energy moved.
ENERGY_ROUND_OFF = TOLERANCES.impact.energy_round_off


@jit
def _form(x, k, y):
    """x.k y."""
    total = 0.0
    for a in range(3):
        total += x[a] * (k[a, 0] * y[0] + k[a, 1] * y[1] + k[a, 2] * y[2])
    return total


@jit
def _turn_to_slip(u, un, t1, t2):
    """Turn t1, t2 in their plane until t1 points along the tangential part of u; returns its length, 0 if it is round-off of u.n."""
    s1, s2 = dot(u, t1), dot(u, t2)
    slip = sqrt(s1 * s1 + s2 * s2)
    if slip <= ROUND_OFF * abs(un):
        slip = 0.0
    else:
        c, s = s1 / slip, s2 / slip
        for a in range(3):
            x, y = t1[a], t2[a]
            t1[a], t2[a] = c * x + s * y, c * y - s * x
    return slip


@jit
def _solve_tangents(a, b, c, x, y):
    """(a b; b c)^-1 (x, y) of a positive matrix by elimination, whose residual is round-off however slender the matrix."""
    ratio = b / a
    second = (y - ratio * x) / (c - ratio * b)
    return (x - b * second) / a, second


@jit
def _slip_direction(k, mu):
    """The direction d in which slip can grow from zero, for |K_t^-1 k_t| > mu > 0.

    Newton's method on 1 / |(mu K_t + g)^-1 k_t| = 1 from g = 0 rises to the root, exact at once where d is a principal direction.
    """
    g = d1 = d2 = 0.0
    for _ in range(DIRECTION_STEPS):
        a, b, c = mu * k.t11 + g, mu * k.t12, mu * k.t22 + g
        d1, d2 = _solve_tangents(a, b, c, k.n1, k.n2)
        slope1, slope2 = _solve_tangents(a, b, c, d1, d2)
        square = d1 * d1 + d2 * d2
        before = g
        g += square * (sqrt(square) - 1.0) / (d1 * slope1 + d2 * slope2)
        if not g > before:
            break
    size = sqrt(d1 * d1 + d2 * d2)
    return d1 / size, d2 / size


@jit
def _sticking(k):
    """f = -K_t^-1 k_t, with which slip stays zero."""
    return _solve_tangents(k.t11, k.t12, k.t22, -k.n1, -k.n2)


@jit
def _process(law, e, mu, mu_s, k, start, q):
    """The impact of a contact that slips along t1, with friction mu while it slips; returns how it ends."""
    for i in range(PLACES):
        q[i] = 0.0
    q[UN], q[S1], q[COMPRESSED] = start[0], start[1], 1.0
    if start[1] > 0.0:
        # First the part in which the slip turns (`slip_direction`); it hands back where the slip is straight.
        if mu > 0.0 and turn(law, e, k, start, mu, q):
            return SLIDES
        slip = sqrt(q[S1] * q[S1] + q[S2] * q[S2])
        d1, d2 = q[S1] / slip, q[S2] / slip
        rate = d1 * k.n1 + d2 * k.n2 - mu * (d1 * d1 * k.t11 + 2.0 * d1 * d2 * k.t12 + d2 * d2 * k.t22)
        # The normal impulse after which the slip has stopped.
        limit = -slip / rate if rate < 0.0 and mu > 0.0 else np.inf
        if go_straight(law, e, k, start, -mu * d1, -mu * d2, limit, q):
            return SLIDES
        q[S1] = q[S2] = 0.0
    # The slip has stopped: it sticks if -K_t^-1 k_t is within the static cone, else it slips on in the direction d of the head.
    f1, f2 = _sticking(k)
    if f1 * f1 + f2 * f2 <= mu_s * mu_s:
        return STICKS if go_straight(law, e, k, start, f1, f2, np.inf, q) else UNFINISHED
    if mu > 0.0:
        d1, d2 = _slip_direction(k, mu)
    else:
        d1, d2 = 0.0, 0.0
    return SLIDES if go_straight(law, e, k, start, -mu * d1, -mu * d2, np.inf, q) else UNFINISHED


@jit
def _stop(k, f1, f2, x, y, z):
    """-K^-1 (x, y, z), with the ratio f of an impulse that sticks."""
    jn = -(x + f1 * y + f2 * z) / (k.nn + k.n1 * f1 + k.n2 * f2)
    j1, j2 = _solve_tangents(k.t11, k.t12, k.t22, -y, -z)
    return jn, f1 * jn + j1, f2 * jn + j2


@jit
def _grip(k, e, e_t, mu_s, start, q):
    """The bilateral impulse with tangential restitution, into q; False where the contact does not grip."""
    un, slip = start[0], start[1]
    f1, f2 = _sticking(k)
    an, a1, a2 = _stop(k, f1, f2, un, 0.0, 0.0)
    bn, b1, b2 = _stop(k, f1, f2, 0.0, slip, 0.0)
    jn, j1, j2 = (1.0 + e) * an + bn, (1.0 + e) * a1 + b1, (1.0 + e) * a2 + b2
    # |J_t|^2 - (mu_s J_n)^2 = outside + 2 x slope + x^2 bend.
    outside = j1 * j1 + j2 * j2 - (mu_s * jn) ** 2
    if outside > 0.0 or jn <= 0.0:
        return False
    slope = j1 * b1 + j2 * b2 - mu_s * mu_s * jn * bn
    bend = b1 * b1 + b2 * b2 - (mu_s * bn) ** 2
    x = e_t
    if outside + 2.0 * x * slope + x * x * bend > 0.0:
        root = sqrt(max(slope * slope - bend * outside, 0.0))
        x = min(e_t, (root - slope) / bend if slope < 0.0 else -outside / (slope + root))
    # Energy is kept where the velocity after, -(e u_n, x s), has the norm by K^-1 of the velocity before.
    before = -(an * un + bn * un + a1 * slip + b1 * slip)
    after = -(e * e * an * un + e * x * (bn * un + a1 * slip) + x * x * b1 * slip)
    kept = 1.0 if after <= before or e > 1.0 else sqrt(before / after)
    q[JN] = (1.0 + kept * e) * an + (1.0 + kept * x) * bn
    q[J1] = (1.0 + kept * e) * a1 + (1.0 + kept * x) * b1
    q[J2] = (1.0 + kept * e) * a2 + (1.0 + kept * x) * b2
    return q[JN] > 0.0 and (kept == 1.0 or sqrt(q[J1] * q[J1] + q[J2] * q[J2]) <= mu_s * q[JN])


@jit
def _makes_energy(k, start, q):
    """Whether the impulse in q makes energy worth the name."""
    moved = abs(q[JN] * start[0]) + sqrt(q[J1] * q[J1] + q[J2] * q[J2]) * start[1]
    return energy_change(k, start, q[JN], q[J1], q[J2]) > ENERGY_ROUND_OFF * moved


@jit_making_arrays
def contact_impulse(k, n, u, pair, t1, t2, impulse):
    """The impulse [N s] on body b of one impact, into `impulse` (3,).

    k (3, 3) 1/kg; n (3,); u (3,) m/s with u.n < 0; pair: `PairLaw`; t1, t2 (3,) are working memory.
    """
    law, e, e_t, mu_s, mu_k = pair.law, pair.e, pair.e_t, pair.mu_s, pair.mu_k
    un = dot(u, n)
    k_nn = 0.0
    for a in range(3):
        for b in range(3):
            k_nn += n[a] * k[a, b] * n[b]
    smooth = -(1.0 + e) * un / k_nn
    for a in range(3):
        impulse[a] = smooth * n[a]
    if mu_s <= 0.0 and mu_k <= 0.0:
        return
    tangents(n, t1, t2)
    start = (un, _turn_to_slip(u, un, t1, t2), 0.0)
    mass = PointMass(k_nn, _form(t1, k, n), _form(t2, k, n), _form(t1, k, t1), _form(t1, k, t2), _form(t2, k, t2))
    if e_t <= 0.0 and abs(mass.n1) + abs(mass.n2) + abs(mass.t12) <= ROUND_OFF * k_nn:
        stop = start[1] / mass.t11
        along = stop if stop <= mu_s * smooth else mu_k * smooth
        for a in range(3):
            impulse[a] -= along * t1[a]
        return
    q = np.empty(PLACES)
    if not (e_t > 0.0 and _grip(mass, e, e_t, mu_s, start, q)):
        mu, end = mu_s, SLIDES
        for _ in range(2):
            end = _process(law, e, mu, mu_s, mass, start, q)
            if end != SLIDES or mu == mu_k:
                break
            mu = mu_k
        if end == UNFINISHED or (e <= 1.0 and _makes_energy(mass, start, q)):
            # K is so slender that round-off decides: the frictionless impulse is safe.
            return
    for a in range(3):
        impulse[a] = q[JN] * n[a] + q[J1] * t1[a] + q[J2] * t2[a]
