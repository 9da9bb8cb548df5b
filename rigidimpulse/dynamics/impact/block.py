"""Impacts of several contact points resolved at once.

With W = Jh Jh^T the inverse effective mass of all contacts together (dynamics/constraints/rows.py), u the velocities before,
find impulses p with u+ = u + W p, u_n+ >= target, complementary to p_n >= 0, and Coulomb's cone
(dynamics/solvers/newton.py). Approaching contacts have e_c and the slip they reverse e_t c. Joints of the island hold: their
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

from math import inf, sqrt
from typing import NamedTuple

import numpy as np

from rigidimpulse.core.kernels import jit, jit_making_arrays
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.core.vector import copy_vector
from rigidimpulse.dynamics.constraints.joint_impact import add_moments, copy_rows
from rigidimpulse.dynamics.constraints.rows import (
    ContactRows,
    change_velocities,
    contact_rows,
    impulse_along,
    response_to,
    row_velocities,
)
from rigidimpulse.dynamics.constraints.slip import solve_with_slip
from rigidimpulse.dynamics.impact.point import log_impact
from rigidimpulse.dynamics.impact.restitution import AUTO, NEWTON, POISSON, ImpactRule
from rigidimpulse.model.contacts import Contacts, select

# Residual asked of the solver, relative to the speed of the island.
SOLVE_TOLERANCE = TOLERANCES.impact.block_residual
# Slip that counts as none, relative to the speed of the island, and energy that counts as none, relative to the energy moved.
SLIPLESS = TOLERANCES.impact.block_no_slip
ENERGY_ROUND_OFF = TOLERANCES.impact.block_energy_round_off
# The size of the rebound: solutions tried and their relative accuracy.
SIZES = 12
SIZE_ACCURACY = TOLERANCES.impact.rebound_size


class Block(NamedTuple):
    """The problem of one block: its rows (r), those of m contacts first."""

    of_contacts: ContactRows
    n: int  # movable bodies
    contacts: Contacts
    u: np.ndarray  # (r,) velocities before, m/s
    target: np.ndarray  # (r,) velocities after that the rebound asks for
    e: np.ndarray  # (m,) restitution of the contacts that approached, else 0
    scale: float  # speed of the island, m/s


@jit_making_arrays
def _solve(block, u, size):
    """Impulses (r,) of the cone problem for velocities u (r,) [m/s] and `size` times the targets.

    Contacts have static friction first; those that still slip then are solved again with dynamic friction.
    """
    rows, scale = block.of_contacts.rows, block.scale
    for i in range(u.shape[0]):
        rows.bias[i], rows.impulse[i] = u[i] - size * block.target[i], 0.0
    sticks = np.zeros(block.e.shape[0], np.bool_)
    solve_with_slip(None, block.of_contacts, block.n, block.contacts, sticks, SOLVE_TOLERANCE * scale, SLIPLESS * scale)
    return rows.impulse.copy()


@jit_making_arrays
def _velocity_after(rows, n, u, p):
    """u + W p."""
    after = response_to(rows, n, p)
    for i in range(u.shape[0]):
        after[i] += u[i]
    return after


@jit_making_arrays
def _energy_change(rows, n, u, p):
    """p.u + p.W p / 2, less the round-off of its terms [J]; u, p (r,)."""
    response = response_to(rows, n, p)
    linear = quadratic = moved = 0.0
    for i in range(p.shape[0]):
        linear += p[i] * u[i]
        moved += abs(p[i] * u[i])
        quadratic += p[i] * response[i]
    quadratic *= 0.5
    return linear + quadratic - ENERGY_ROUND_OFF * (moved + quadratic)


@jit
def rebound_of(contacts, c, approach, rest_speed):
    """e, or 0 where the rebound would rise less than the contact margin. So no speed threshold is needed."""
    e = contacts.restitution[c]
    return e if e * abs(approach) > rest_speed[c] else 0.0


@jit
def _largest(e):
    largest = 0.0
    for c in range(e.shape[0]):
        largest = max(largest, e[c])
    return largest


@jit_making_arrays
def _newton(block):
    """Impulses (r,) by Newton's law."""
    largest = _largest(block.e)
    p = _solve(block, block.u, 1.0)
    if largest > 0.0 and _energy_change(block.of_contacts.rows, block.n, block.u, p) > 0.0:
        p = _solve(block, block.u, 0.0)
        for i in range(p.shape[0]):
            p[i] *= 1.0 + largest
    return p


@jit
def _measure(law, block, share, p, before, after):
    """Normal impulse (Poisson) [N s] or work (energetic) [J] of a phase, over contacts that rebound, times share or share^2 (m,).

    before, after (r,): velocities of the rows, m/s.
    """
    total = 0.0
    for c in range(share.shape[0]):
        i = block.of_contacts.first_row[c]
        if block.e[c] > 0.0 and law == POISSON:
            total += share[c] * p[i]
        elif block.e[c] > 0.0:
            total += 0.5 * (share[c] * share[c]) * p[i] * (before[i] + after[i])
    return total


@jit_making_arrays
def _two_phases(law, block):
    """Impulses (r,) by Poisson's or the energetic law."""
    rows, n, u = block.of_contacts.rows, block.n, block.u
    compression = _solve(block, u, 0.0)
    compressed = _velocity_after(rows, n, u, compression)
    asked = abs(_measure(law, block, block.e, compression, u, compressed))
    if asked == 0.0:
        return compression
    p, whole, may_gain = compression, np.ones(block.e.shape[0]), _largest(block.e) > 1.0
    # Secant method for the share of what the law asks. `low` is a size that makes no energy, `high` one that does or is too large.
    size, low, high = 1.0, 0.0, inf
    last_size = last_share = 0.0
    for _ in range(SIZES):
        r = _solve(block, compressed, size)
        after = _velocity_after(rows, n, compressed, r)
        made = max(_measure(law, block, whole, r, compressed, after), 0.0)
        share = made / asked if law == POISSON else sqrt(made / asked)
        for i in range(r.shape[0]):
            r[i] += compression[i]
        lossy = may_gain or _energy_change(rows, n, u, r) <= 0.0
        if lossy and share <= 1.0 + SIZE_ACCURACY:
            low, p = size, r
            if share >= 1.0 - SIZE_ACCURACY:
                break
        else:
            high = size
        upper = min(high, 3.0 * size)
        guess = size + (1.0 - share) * (size - last_size) / (share - last_share) if share != last_share else upper
        last_size, last_share = size, share
        size = guess if lossy and low < guess < upper else 0.5 * (low + upper)
    return p


@jit_making_arrays
def _movable(bodies, contacts, number):
    """Movable bodies (n,) of the contacts, in order; number (n_world,): working memory."""
    first = last = contacts.body_a[0]
    for c in range(contacts.gap.shape[0]):
        first = min(first, contacts.body_a[c], contacts.body_b[c])
        last = max(last, contacts.body_a[c], contacts.body_b[c])
    number[first : last + 1] = 0
    for c in range(contacts.gap.shape[0]):
        number[contacts.body_a[c]] = number[contacts.body_b[c]] = 1
    members, n = np.empty(min(2 * contacts.gap.shape[0], last + 1 - first), np.int64), 0
    for i in range(first, last + 1):
        if number[i] == 1 and bodies.inv_mass[i] > 0.0:
            members[n] = i
            n += 1
    return members[:n]


@jit_making_arrays
def _make_block(bodies, contacts, members, rebound, rule, number, joints):
    """The `Block` of contacts: velocities now, and those that the rebound asks for; arguments as in `solve_block`."""
    extra = joints.joint.shape[0]
    of_contacts = contact_rows(bodies, contacts, members, number, extra)
    rows, first_row = of_contacts.rows, of_contacts.first_row
    copy_rows(joints.rows, rows, rows.bias.shape[0] - extra)
    u, target, e = np.zeros(rows.bias.shape[0]), np.zeros(rows.bias.shape[0]), np.zeros(first_row.shape[0])
    row_velocities(bodies, contacts, first_row, of_contacts.frames, u)
    for c in range(e.shape[0]):
        i = first_row[c]
        if u[i] < 0.0:
            e[c] = rebound * rebound_of(contacts, c, u[i], rule.rest_speed)
        target[i] = -e[c] * u[i]
        if e[c] > 0.0 and contacts.static_friction[c] > 0.0:
            for k in range(i + 1, i + 3):
                target[k] = -contacts.tangential_restitution[c] * u[k]
    return Block(of_contacts, members.shape[0], contacts, u, target, e, rule.scale)


@jit
def _any_friction(contacts):
    for c in range(contacts.gap.shape[0]):
        if contacts.static_friction[c] > 0.0:
            return True
    return False


@jit_making_arrays
def solve_block(bodies, contacts, subset, rebound, rule, number, joints, log):
    """Resolve the contacts of subset (k,) together and apply the impulses.

    rebound: 1, or 0 for an inelastic one; rule: the `ImpactRule` of all contacts; number (n_world,): working memory; joints: the
    `JointBlock` of the island; log (k, 7): rows not yet written. Returns how many rows of the log were written.
    """
    if subset.shape[0] < contacts.gap.shape[0]:
        contacts, rest_speed = select(contacts, subset), np.empty(subset.shape[0])
        for s in range(subset.shape[0]):
            rest_speed[s] = rule.rest_speed[subset[s]]
        rule = ImpactRule(rule.law, rest_speed, rule.tolerance, rule.scale)
    members = joints.members if joints.members.shape[0] else _movable(bodies, contacts, number)
    block = _make_block(bodies, contacts, members, rebound, rule, number, joints)
    if rule.law == NEWTON or (rule.law == AUTO and not _any_friction(contacts)):
        p = _newton(block)
    else:
        p = _two_phases(rule.law, block)
    rows = block.of_contacts.rows
    copy_vector(p, rows.impulse)
    change_velocities(bodies, members, rows)
    add_moments(joints, rows.impulse)
    count = log_block(bodies, block, log)
    for k in range(count):
        log[k, 0] = subset[np.int64(log[k, 0])]
    return count


@jit_making_arrays
def log_block(bodies, block, log):
    """Log the impacts of a block, whose rows have the impulses; returns their number."""
    rows, first_row, impulse, count = block.of_contacts.rows, block.of_contacts.first_row, np.empty(3), np.int64(0)
    for c in range(first_row.shape[0]):
        i = first_row[c]
        if rows.impulse[i] > 0.0:
            impulse_along(rows, i, block.of_contacts.frames[c], impulse)
            count = log_impact(bodies, block.contacts, c, impulse, block.u[i], log, count)
    return count
