"""Impacts of several contact points resolved at once.

With W = Jh Jh^T the inverse effective mass of all contacts together (constrain/rows.py), u the velocities before,
find impulses p with u+ = u + W p, u_n+ >= target, complementary to p_n >= 0, and Coulomb's cone
(constrain/newton.py). Approaching contacts have e_c and the slip they reverse e_t c. Joints of the group hold: their
rows are part of every problem, with u = 0.

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
from rigidimpulse.constrain.joint_impact import apply_joint_impulses, copy_rows, number_all
from rigidimpulse.constrain.newton import solve_newton
from rigidimpulse.constrain.rows import (
    contact_rows,
    contact_velocity,
    count_contact_rows,
    impulse_along,
    make_rows,
    multiply,
    multiply_transposed,
    number_members,
    rows_of,
)
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
def _velocity_after(rows, n, u, p, after):
    """after = u + W p."""
    y = np.empty((n, 6))
    multiply_transposed(rows, p, y)
    multiply(rows, y, after)
    for i in range(u.shape[0]):
        after[i] += u[i]


@jit
def _solve(rows, n, first_row, b, static, dynamic, scale, p):
    """The cone problem for b (r,) [m/s], into p; static friction first, contacts that still slip again with dynamic friction."""
    after = np.empty(b.shape[0])
    rows.bias[:] = b
    rows.impulse[:] = 0.0
    for s in range(first_row.shape[0]):
        if rows_of(rows, first_row[s]) == 3:
            rows.coefficient[first_row[s] + 1] = rows.coefficient[first_row[s] + 2] = static[s]
    for _ in range(2):
        solve_newton(rows, n, SOLVE_TOLERANCE * scale)
        _velocity_after(rows, n, b, rows.impulse, after)
        changed = False
        for s in range(first_row.shape[0]):
            i = first_row[s] + 1
            if rows_of(rows, first_row[s]) < 3 or rows.coefficient[i] == dynamic[s]:
                continue
            if abs(after[i]) + abs(after[i + 1]) > SLIPLESS * scale:
                rows.coefficient[i] = rows.coefficient[i + 1] = dynamic[s]
                changed = True
        if not changed:
            break
    p[:] = rows.impulse


@jit
def _energy_change(rows, n, u, p):
    """p.u + |Jh^T p|^2 / 2, less the round-off of its terms [J]."""
    y = np.empty((n, 6))
    multiply_transposed(rows, p, y)
    linear = moved = quadratic = 0.0
    for i in range(p.shape[0]):
        linear += p[i] * u[i]
        moved += abs(p[i] * u[i])
    for i in range(n):
        for k in range(6):
            quadratic += 0.5 * y[i, k] * y[i, k]
    return linear + quadratic - ENERGY_ROUND_OFF * (moved + quadratic)


@jit
def _add(x, factor, y, total):
    """total = x + factor y."""
    for i in range(x.shape[0]):
        total[i] = x[i] + factor * y[i]


@jit
def _newton(rows, n, first_row, u, target, largest, static, dynamic, scale, p):
    """Newton's law, into p; largest is the largest e."""
    b = np.empty(u.shape[0])
    _add(u, -1.0, target, b)
    _solve(rows, n, first_row, b, static, dynamic, scale, p)
    if largest > 0.0 and _energy_change(rows, n, u, p) > 0.0:
        _solve(rows, n, first_row, u, static, dynamic, scale, p)
        for i in range(p.shape[0]):
            p[i] *= 1.0 + largest


@jit
def _measure(law, first_row, e, weight, p, before, after):
    """Normal impulse (Poisson) [N s] or work (energetic) [J] of a phase, over contacts with e > 0; times e or e^2 if weight is 1."""
    total = 0.0
    for s in range(e.shape[0]):
        if e[s] > 0.0:
            factor, i = 1.0 + weight * (e[s] - 1.0), first_row[s]
            if law == POISSON:
                total += factor * p[i]
            else:
                total += 0.5 * factor * factor * p[i] * (before[i] + after[i])
    return total


@jit
def _two_phases(law, rows, n, first_row, u, target, e, largest, static, dynamic, scale, p):
    """Poisson's or the energetic law, into p."""
    _solve(rows, n, first_row, u, static, dynamic, scale, p)
    count = u.shape[0]
    compressed, after, b = np.empty(count), np.empty(count), np.empty(count)
    r, total = np.empty(count), np.empty(count)
    _velocity_after(rows, n, u, p, compressed)
    asked = abs(_measure(law, first_row, e, 1.0, p, u, compressed))
    if asked == 0.0:
        return
    compression = p.copy()
    # Secants of the share made of what is asked; the size lies between low, which is allowed, and high, which is not.
    size, low, high = 1.0, 0.0, np.inf
    last_size = last_share = 0.0
    for _ in range(SIZES):
        _add(compressed, -size, target, b)
        _solve(rows, n, first_row, b, static, dynamic, scale, r)
        _velocity_after(rows, n, compressed, r, after)
        made = max(_measure(law, first_row, e, 0.0, r, compressed, after), 0.0)
        share = made / asked if law == POISSON else sqrt(made / asked)
        _add(compression, 1.0, r, total)
        lossy = largest > 1.0 or _energy_change(rows, n, u, total) <= 0.0
        if lossy and share <= 1.0 + SIZE_ACCURACY:
            low = size
            p[:] = total
            if share >= 1.0 - SIZE_ACCURACY:
                break
        else:
            high = size
        upper = min(high, 3.0 * size)
        guess = size + (1.0 - share) * (size - last_size) / (share - last_share) if share != last_share else upper
        last_size, last_share = size, share
        size = guess if lossy and low < guess < upper else 0.5 * (low + upper)


@jit
def solve_block(bodies, contacts, subset, rebound, law, rest_speed, scale, number, joints, log, count):
    """Resolve the contacts of subset together and apply the impulses; `rebound` 1, or 0 for an inelastic one. New log count.

    joints: None, or the `JointBlock` of the group.
    """
    m = subset.shape[0]
    members = number_members(bodies, contacts, subset, number) if joints is None else number_all(joints.members, number)
    n, start = members.shape[0], count_contact_rows(contacts, subset)
    rows = make_rows(start + (np.int64(0) if joints is None else joints.rows.bias.shape[0]))
    if joints is not None:
        copy_rows(joints.rows, rows, start)
    first_row, frames = np.empty(m, np.int64), np.empty((m, 3, 3))
    contact_rows(bodies, contacts, subset, number, rows, first_row, frames)
    r = rows.bias.shape[0]
    u, target, p, v = np.zeros(r), np.zeros(r), np.empty(r), np.empty(3)
    e, static, dynamic = np.zeros(m), np.empty(m), np.empty(m)
    largest = rough = 0.0
    for s in range(m):
        c, i = subset[s], first_row[s]
        contact_velocity(contacts, c, frames[s], bodies.velocity, bodies.angular_velocity, v)
        for k in range(rows_of(rows, i)):
            u[i + k] = v[k]
        approach = relative_velocity(bodies, contacts, c, v)
        static[s], dynamic[s] = contacts.static_friction[c], contacts.dynamic_friction[c]
        if approach < 0.0:
            e[s] = rebound * rebound_of(contacts, c, approach, rest_speed)
            e_t = contacts.tangential_restitution[c] if e[s] > 0.0 else 0.0
            target[i] = -e[s] * u[i]
            for k in range(1, rows_of(rows, i)):
                target[i + k] = -e_t * u[i + k]
        largest, rough = max(largest, e[s]), max(rough, static[s])
    if law == NEWTON or (law == AUTO and rough <= 0.0):
        _newton(rows, n, first_row, u, target, largest, static, dynamic, scale, p)
    else:
        _two_phases(law, rows, n, first_row, u, target, e, largest, static, dynamic, scale, p)
    rows.impulse[:] = p
    return _apply(bodies, contacts, members, subset, rows, first_row, frames, u, joints, log, count)


@jit
def _apply(bodies, contacts, members, subset, rows, first_row, frames, u, joints, log, count):
    impulse = np.empty(3)
    if joints is not None:
        apply_joint_impulses(bodies, members, rows, joints)
    first = count
    for s in range(subset.shape[0]):
        i = first_row[s]
        impulse_along(rows, i, frames[s], impulse)
        if rows.impulse[i] > 0.0:
            apply_impulse(bodies, contacts, subset[s], impulse[0], impulse[1], impulse[2])
            count = log_impact(bodies, contacts, subset[s], impulse, u[i], log, count)
    v = np.empty(3)
    for i in range(first, count):
        log[i, 6] = relative_velocity(bodies, contacts, int(log[i, 0]), v)
    return count
