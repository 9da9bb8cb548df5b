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

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt

import numpy as np

from rigidimpulse.core.kernels import jit, jit_making_arrays
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.dynamics.constraints.joint_impact import JointBlock, add_moments, copy_rows
from rigidimpulse.dynamics.constraints.rows import (
    ContactRows,
    Rows,
    change_velocities,
    contact_rows,
    impulse_along,
    response_to,
    row_velocities,
    solve_with_slip,
)
from rigidimpulse.dynamics.impact.point import log_impact
from rigidimpulse.dynamics.impact.restitution import AUTO, NEWTON, POISSON, ImpactRule
from rigidimpulse.dynamics.solvers.newton import solve_newton
from rigidimpulse.model.contacts import Contacts, select
from rigidimpulse.motion.body_state import BodyState

# Residual asked of the solver, relative to the speed of the island.
SOLVE_TOLERANCE = TOLERANCES.impact.block_residual
# Slip that counts as none, relative to the speed of the island, and energy that counts as none, relative to the energy moved.
SLIPLESS = TOLERANCES.impact.block_no_slip
ENERGY_ROUND_OFF = TOLERANCES.impact.block_energy_round_off
# The size of the rebound: solutions tried and their relative accuracy.
SIZES = 12
SIZE_ACCURACY = TOLERANCES.impact.rebound_size


@dataclass
class Block:
    """The problem of one block: its rows (r), those of m contacts first."""

    of_contacts: ContactRows
    n: int
    contacts: Contacts
    u: np.ndarray  # (r,) velocities before, m/s
    target: np.ndarray  # (r,) velocities after that the rebound asks for
    e: np.ndarray  # (m,) restitution of the contacts that approached, else 0
    scale: float  # speed of the island, m/s

    @property
    def rows(self) -> Rows:
        """All rows."""
        return self.of_contacts.rows

    @property
    def first_row(self) -> np.ndarray:
        """Normal rows (m,) of the contacts."""
        return self.of_contacts.first_row

    def solve(self, b: np.ndarray) -> np.ndarray:
        """Impulses (r,) of the cone problem for b (r,) [m/s]; static friction first, contacts that still slip again with dynamic."""
        rows, m = self.rows, len(self.first_row)
        rows.bias[:] = b
        rows.impulse[:] = 0.0
        sticks = np.zeros(m, bool)
        solve_with_slip(
            solve_newton, self.of_contacts, self.n, self.contacts, sticks, SOLVE_TOLERANCE * self.scale, SLIPLESS * self.scale
        )
        return rows.impulse.copy()

    def velocity_after(self, u: np.ndarray, p: np.ndarray) -> np.ndarray:
        """u + W p."""
        return u + response_to(self.rows, self.n, p)

    def energy_change(self, p: np.ndarray) -> float:
        """p.u + p.W p / 2, less the round-off of its terms [J]."""
        quadratic = 0.5 * float(p @ response_to(self.rows, self.n, p))
        return float(p @ self.u) + quadratic - ENERGY_ROUND_OFF * (float(np.abs(p * self.u).sum()) + quadratic)


@jit
def rebound_of(contacts, c, approach, rest_speed):
    """e, or 0 where the rebound would rise less than the contact margin. So no speed threshold is needed."""
    e = contacts.restitution[c]
    return e if e * abs(approach) > rest_speed[c] else 0.0


def _newton(block: Block) -> np.ndarray:
    """Impulses (r,) by Newton's law."""
    largest = float(block.e.max())
    p = block.solve(block.u - block.target)
    if largest > 0.0 and block.energy_change(p) > 0.0:
        p = (1.0 + largest) * block.solve(block.u)
    return p


def _measure(law: int, block: Block, share: np.ndarray, p: np.ndarray, before: np.ndarray, after: np.ndarray) -> float:
    """Normal impulse (Poisson) [N s] or work (energetic) [J] of a phase, over contacts that rebound, times share or share^2 (m,)."""
    rebounds = block.e > 0.0
    i, share = block.first_row[rebounds], share[rebounds]
    if law == POISSON:
        return float(np.sum(share * p[i]))
    return float(np.sum(0.5 * share**2 * p[i] * (before[i] + after[i])))


def _two_phases(law: int, block: Block) -> np.ndarray:
    """Impulses (r,) by Poisson's or the energetic law."""
    u, e = block.u, block.e
    compression = block.solve(u)
    compressed = block.velocity_after(u, compression)
    asked = abs(_measure(law, block, e, compression, u, compressed))
    if asked == 0.0:
        return compression
    p, whole = compression, np.ones(len(e))
    # Secant method for the share of what the law asks. `low` is a size that makes no energy, `high` one that does or is too large.
    size, low, high = 1.0, 0.0, np.inf
    last_size = last_share = 0.0
    for _ in range(SIZES):
        r = block.solve(compressed - size * block.target)
        after = block.velocity_after(compressed, r)
        made = max(_measure(law, block, whole, r, compressed, after), 0.0)
        share = made / asked if law == POISSON else sqrt(made / asked)
        total = compression + r
        lossy = float(e.max()) > 1.0 or block.energy_change(total) <= 0.0
        if lossy and share <= 1.0 + SIZE_ACCURACY:
            low, p = size, total
            if share >= 1.0 - SIZE_ACCURACY:
                break
        else:
            high = size
        upper = min(high, 3.0 * size)
        guess = size + (1.0 - share) * (size - last_size) / (share - last_share) if share != last_share else upper
        last_size, last_share = size, share
        size = guess if lossy and low < guess < upper else 0.5 * (low + upper)
    return p


def solve_block(
    bodies: BodyState, contacts: Contacts, subset: np.ndarray, rebound: float, rule: ImpactRule, number: np.ndarray,
    joints: JointBlock | None, log: np.ndarray,
) -> int:
    """Resolve the contacts of subset together and apply the impulses; `rebound` 1, or 0 for an inelastic one.

    joints: None, or the `JointBlock` of the island; log (k, 7): rows not yet written. Returns how many rows of the log were written.
    """
    law, rest_speed = rule.law, rule.rest_speed
    if len(subset) < len(contacts.gap):
        contacts, rest_speed = select(contacts, subset), rest_speed[subset]
    if joints is None:
        ends = np.unique(np.concatenate([contacts.body_a, contacts.body_b]))
        members, extra = ends[bodies.inv_mass[ends] > 0.0], 0
    else:
        members, extra = joints.members, len(joints.rows.bias)
    of_contacts = contact_rows(bodies, contacts, members, number, extra)
    rows, first_row, frames = of_contacts
    if joints is not None:
        copy_rows(joints.rows, rows, len(rows.bias) - extra)
    u = np.zeros(len(rows.bias))
    row_velocities(bodies, contacts, first_row, frames, u)
    approach = u[first_row]
    # A rebound that rises less than the contact margin counts as none.
    e = np.where((approach < 0.0) & (contacts.restitution * -approach > rest_speed), rebound * contacts.restitution, 0.0)
    target = np.zeros(len(rows.bias))
    target[first_row] = -e * approach
    rough = contacts.static_friction > 0.0
    e_t = np.where(e > 0.0, contacts.tangential_restitution, 0.0)[rough]
    for k in (1, 2):
        target[first_row[rough] + k] = -e_t * u[first_row[rough] + k]
    block = Block(of_contacts, len(members), contacts, u, target, e, rule.scale)
    # Newton's law can make energy with friction only, so "auto" takes it for smooth contacts.
    smooth = not rough.any()
    rows.impulse[:] = _newton(block) if law == NEWTON or (law == AUTO and smooth) else _two_phases(law, block)
    change_velocities(bodies, members, rows)
    if joints is not None:
        add_moments(joints, rows.impulse)
    count = log_block(bodies, contacts, rows, first_row, frames, u, log, 0)
    # The block numbers its own contacts, the log those of the island.
    log[:count, 0] = subset[log[:count, 0].astype(np.int64)]
    return count


@jit_making_arrays
def log_block(bodies, contacts, rows, first_row, frames, u, log, count):
    """Log the impacts of a block, whose velocities before were u (r,); returns the new count."""
    impulse = np.empty(3)
    for c in range(first_row.shape[0]):
        i = first_row[c]
        if rows.impulse[i] > 0.0:
            impulse_along(rows, i, frames[c], impulse)
            count = log_impact(bodies, contacts, c, impulse, u[i], log, count)
    return count
