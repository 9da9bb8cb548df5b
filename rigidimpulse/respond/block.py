"""Impacts of several contact points resolved at once.

With W = Jh Jh^T the inverse effective mass of all contacts together (constrain/rows.py), u the velocities before,
find impulses p with u+ = u + W p, u_n+ >= target, complementary to p_n >= 0, and Coulomb's cone
(constrain/newton.py). Approaching contacts have e_c and the slip they reverse e_t c.

Newton's law is one such problem, with targets -e_c u_n and -e_t u_t. If that made energy (Newton's law with friction
can), the fully inelastic answer p0 is taken (1 + e) times: the change of energy along s p0 is q s (s / 2 - 1) with q
= p0.W p0 >= 0, never positive for s <= 2.

Poisson's and the energetic law have two phases. Compression is the inelastic problem: p_c, u_c = u + W p_c.
Restitution begins at u_c and has targets -s e_c u_n and -s e_t u_t of the contacts that approached: the pattern of
Newton's law, its size s common to the block. It gives r(s) with r(0) = 0, and s is what the law asks of the block as
a whole:

    Poisson     sum of r_n = sum of e_c p_cn,
    energetic   W_r(s) = sum of r_n (u_cn + u_en) / 2 = -sum of e_c^2 p_cn (u_n + u_cn) / 2,    u_e = u_c + W r.

The sums are over contacts that approached. Both are one equation in s, and r(s) = s r(1) where nothing slips, so s =
1 by all laws without friction and with one e. One s keeps the symmetry of a block. At s = 0 the impact dissipates, so
if the law's s makes energy there is a lesser one that does not.
"""

from math import sqrt

import numpy as np

from rigidimpulse._jit import jit
from rigidimpulse.constrain.newton import multiply, multiply_transposed, solve_cone
from rigidimpulse.constrain.rows import contact_rows, number_columns
from rigidimpulse.respond.impulse import apply_impulse, log_impact, relative_velocity
from rigidimpulse.respond.restitution import AUTO, NEWTON, POISSON

# Residual asked of the solver, relative to the speed of the group.
SOLVE_TOLERANCE = 1e-14
# Slip that counts as none, relative to the speed of the group, and energy that counts as none, relative to the energy moved.
SLIPLESS = 1e-9
ENERGY_ROUND_OFF = 1e-13
# The size of the rebound: solutions tried and their relative accuracy.
SIZES = 12
SIZE_ACCURACY = 1e-10


@jit
def rebound_of(contacts, c, approach, rest_speed):
    """e, or 0 where the rebound would rise less than the gap the contact is held at (LOOP rule: no speed threshold)."""
    e = contacts.restitution[c]
    return e if e * abs(approach) > rest_speed[c] else 0.0


@jit
def _velocity_after(jacobian, u, p, after):
    """after = u + W p."""
    y = np.empty(jacobian.shape[1])
    multiply_transposed(jacobian, p, y)
    multiply(jacobian, y, after)
    for i in range(u.shape[0]):
        after[i] += u[i]


@jit
def _solve(jacobian, b, static, dynamic, scale, p):
    """The cone problem for b (3m,) [m/s], into p; static friction first, contacts that still slip again with dynamic friction."""
    mu = static.copy()
    after = np.empty(b.shape[0])
    for i in range(p.shape[0]):
        p[i] = 0.0
    for _ in range(2):
        solve_cone(jacobian, b, mu, p, SOLVE_TOLERANCE * scale)
        _velocity_after(jacobian, b, p, after)
        changed = False
        for s in range(mu.shape[0]):
            slip = abs(after[3 * s + 1]) + abs(after[3 * s + 2])
            if dynamic[s] != mu[s] and slip > SLIPLESS * scale:
                mu[s] = dynamic[s]
                changed = True
        if not changed:
            break


@jit
def _energy_change(jacobian, u, p):
    """p.u + |Jh^T p|^2 / 2, less the round-off of its terms [J]."""
    y = np.empty(jacobian.shape[1])
    multiply_transposed(jacobian, p, y)
    linear = moved = quadratic = 0.0
    for i in range(p.shape[0]):
        linear += p[i] * u[i]
        moved += abs(p[i] * u[i])
    for i in range(y.shape[0]):
        quadratic += 0.5 * y[i] * y[i]
    return linear + quadratic - ENERGY_ROUND_OFF * (moved + quadratic)


@jit
def _add(x, factor, y, total):
    """total = x + factor y."""
    for i in range(x.shape[0]):
        total[i] = x[i] + factor * y[i]


@jit
def _newton(jacobian, u, target, largest, static, dynamic, scale, p):
    """Newton's law, into p; largest is the largest e."""
    b = np.empty(u.shape[0])
    _add(u, -1.0, target, b)
    _solve(jacobian, b, static, dynamic, scale, p)
    if largest > 0.0 and _energy_change(jacobian, u, p) > 0.0:
        _solve(jacobian, u, static, dynamic, scale, p)
        for i in range(p.shape[0]):
            p[i] *= 1.0 + largest


@jit
def _measure(law, e, weight, p, before, after):
    """Normal impulse (Poisson) [N s] or work (energetic) [J] of a phase, over contacts with e > 0; times e or e^2 if weight is 1."""
    total = 0.0
    for s in range(e.shape[0]):
        if e[s] > 0.0:
            factor = 1.0 + weight * (e[s] - 1.0)
            if law == POISSON:
                total += factor * p[3 * s]
            else:
                total += 0.5 * factor * factor * p[3 * s] * (before[3 * s] + after[3 * s])
    return total


@jit
def _two_phases(law, jacobian, u, target, e, largest, static, dynamic, scale, p):
    """Poisson's or the energetic law, into p."""
    _solve(jacobian, u, static, dynamic, scale, p)
    n = u.shape[0]
    compressed, after, b = np.empty(n), np.empty(n), np.empty(n)
    r, total = np.empty(n), np.empty(n)
    _velocity_after(jacobian, u, p, compressed)
    asked = abs(_measure(law, e, 1.0, p, u, compressed))
    if asked == 0.0:
        return
    compression = p.copy()
    # Secants of the share made of what is asked; the size lies between low, which is allowed, and high, which is not.
    size, low, high = 1.0, 0.0, np.inf
    last_size = last_share = 0.0
    for _ in range(SIZES):
        _add(compressed, -size, target, b)
        _solve(jacobian, b, static, dynamic, scale, r)
        _velocity_after(jacobian, compressed, r, after)
        made = max(_measure(law, e, 0.0, r, compressed, after), 0.0)
        share = made / asked if law == POISSON else sqrt(made / asked)
        _add(compression, 1.0, r, total)
        lossy = largest > 1.0 or _energy_change(jacobian, u, total) <= 0.0
        if lossy and share <= 1.0 + SIZE_ACCURACY:
            low = size
            for i in range(n):
                p[i] = total[i]
            if share >= 1.0 - SIZE_ACCURACY:
                break
        else:
            high = size
        upper = min(high, 3.0 * size)
        guess = size + (1.0 - share) * (size - last_size) / (share - last_share) if share != last_share else upper
        last_size, last_share = size, share
        size = guess if lossy and low < guess < upper else 0.5 * (low + upper)


@jit
def solve_block(bodies, contacts, subset, rebound, law, rest_speed, scale, column, log, count):
    """Resolve the contacts of subset together and apply the impulses; `rebound` 1, or 0 for an inelastic one. New log count."""
    m = subset.shape[0]
    members = number_columns(bodies, contacts, column)
    width = 6 * members.shape[0]
    jacobian = np.empty((3 * m, width))
    frames = np.empty((m, 3, 3))
    contact_rows(bodies, contacts, subset, column, width, jacobian, frames)
    u, target, p = np.empty(3 * m), np.zeros(3 * m), np.empty(3 * m)
    v = np.empty(3)
    e, static, dynamic = np.zeros(m), np.empty(m), np.empty(m)
    largest = rough = 0.0
    for s in range(m):
        c = subset[s]
        approach = relative_velocity(bodies, contacts, c, v)
        for k in range(3):
            u[3 * s + k] = v[0] * frames[s, k, 0] + v[1] * frames[s, k, 1] + v[2] * frames[s, k, 2]
        static[s], dynamic[s] = contacts.static_friction[c], contacts.dynamic_friction[c]
        if approach < 0.0:
            e[s] = rebound * rebound_of(contacts, c, approach, rest_speed)
            e_t = contacts.tangential_restitution[c] if e[s] > 0.0 else 0.0
            target[3 * s] = -e[s] * u[3 * s]
            target[3 * s + 1], target[3 * s + 2] = -e_t * u[3 * s + 1], -e_t * u[3 * s + 2]
        largest, rough = max(largest, e[s]), max(rough, static[s])
    if law == NEWTON or (law == AUTO and rough <= 0.0):
        _newton(jacobian, u, target, largest, static, dynamic, scale, p)
    else:
        _two_phases(law, jacobian, u, target, e, largest, static, dynamic, scale, p)
    return _apply(bodies, contacts, subset, frames, u, p, scale, log, count)


@jit
def _apply(bodies, contacts, subset, frames, u, p, scale, log, count):
    impulse = np.empty(3)
    first = count
    for s in range(subset.shape[0]):
        for a in range(3):
            impulse[a] = p[3 * s] * frames[s, 0, a] + p[3 * s + 1] * frames[s, 1, a] + p[3 * s + 2] * frames[s, 2, a]
        if p[3 * s] > 0.0:
            apply_impulse(bodies, contacts, subset[s], impulse[0], impulse[1], impulse[2])
            count = log_impact(bodies, contacts, subset[s], impulse, u[3 * s], log, count)
    v = np.empty(3)
    for i in range(first, count):
        log[i, 6] = relative_velocity(bodies, contacts, int(log[i, 0]), v)
    return count
