"""Position correction: lasting contacts are brought back to the contact margin d.

Paths of second order leave a load-bearing contact slightly above or below the gap d. When its gap g falls below SUNK d, the bodies of
the island are moved by the smallest displacement in the metric of mass that brings it back to d and lets no other contact sink:

    dx = M^-1 J_n^T p,    0 <= p _|_ g + J_n dx - target >= 0.

A contact of surfaces without a radius that is inside and leaves is met again and again on its way out. It is brought back to CLEAR d only:
what is inside by round-off moves by round-off. Velocities do not change. The ledger records the change of potential energy.
"""

from typing import NamedTuple

import numpy as np

from rigidimpulse.core.kernels import jit, jit_making_arrays
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.dynamics.constraints.rows import contact_rows, move_bodies, take_rows
from rigidimpulse.dynamics.solvers.newton import solve_newton

SUNK = 0.7
# Other contacts of the island may not sink below this part of the contact margin.
KEPT = 0.75
CLEAR = TOLERANCES.events.contact_margin_round_off
SOLVE_TOLERANCE = TOLERANCES.contact_forces.correction_residual


class Sunk(NamedTuple):
    """Which of m contacts are moved, and to where."""

    lifted: np.ndarray  # (m,) bool, to the contact margin
    inside: np.ndarray  # (m,) bool, only just apart
    contact_margin: np.ndarray  # (m,) m


@jit
def needs_correction(contacts, held, inside, contact_margin):
    """Whether a held contact has sunk, or another leaves from inside; held, inside (m,) bool, contact_margin (m,) m."""
    for c in range(contacts.gap.shape[0]):
        if inside[c] or (held[c] and contacts.gap[c] < SUNK * contact_margin[c]):
            return True
    return False


@jit_making_arrays
def correct_positions(bodies, contacts, sunk, members, number):
    """Move the members of the island so that contacts which are `Sunk` have their gaps again; other bodies do not move.

    number (n,): working memory.
    """
    contact_margin = sunk.contact_margin
    all_rows, first_row, _ = contact_rows(bodies, contacts, members, number, 0)
    rows, largest, fine = take_rows(all_rows, first_row), 0.0, 1.0
    for c in range(first_row.shape[0]):
        # Bodies that do not belong to the island are taken as immovable.
        if not _is_member(members, number, contacts.body_a[c]):
            rows.first[c] = -1
            rows.jacobian[c, :6] = 0.0
        if not _is_member(members, number, contacts.body_b[c]):
            rows.second[c] = -1
            rows.jacobian[c, 6:] = 0.0
        target = min(contacts.gap[c], KEPT * contact_margin[c])
        if sunk.lifted[c]:
            target = contact_margin[c]
        elif sunk.inside[c]:
            target, fine = CLEAR * contact_margin[c], CLEAR
        rows.bias[c] = contacts.gap[c] - target
        largest = max(largest, contact_margin[c])
    solve_newton(rows, members.shape[0], SOLVE_TOLERANCE * fine * largest)
    move_bodies(bodies, members, rows)


@jit
def _is_member(members, number, body):
    """Whether a body is a member; number (n,) is right for members, and anything for others."""
    k = number[body]
    return 0 <= k < members.shape[0] and members[k] == body
