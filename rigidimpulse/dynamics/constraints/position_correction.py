"""Drift: contacts that last are kept at their gap by position alone.

Second-order paths leave a load-bearing contact slightly above or below the gap delta it is held at. When it has sunk
below SUNK delta, the bodies of the group are moved by the least displacement in the metric of mass,  dx = M^-1 J_n^T
p,  0 <= p _|_ g + J_n dx - target >= 0, that brings it back to delta and lets no other contact sink. Velocities do
not change; the potential energy it costs is booked in the ledger.
"""

import numpy as np

from rigidimpulse.core.kernels import jit
from rigidimpulse.dynamics.constraints.rows import contact_rows, move_bodies, take_rows
from rigidimpulse.dynamics.solvers.newton import solve_newton

SUNK = 0.7
# Other contacts of the group may not sink below this part of delta.
KEPT = 0.75
SOLVE_TOLERANCE = 1e-6


@jit
def needs_correction(contacts, held, contact_margin):
    """Whether a held contact has sunk; held (m,) bool, delta (m,)."""
    for c in range(contacts.gap.shape[0]):
        if held[c] and contacts.gap[c] < SUNK * contact_margin[c]:
            return True
    return False


def correct_positions(bodies, contacts, held, contact_margin, members, number) -> None:
    """Move the bodies of the group so that held contacts have their gap delta again; others stand."""
    rows, first_row, _ = contact_rows(bodies, contacts, members, number, 0)
    rows = take_rows(rows, first_row)
    for body, end, half in ((contacts.body_a, rows.first, slice(6)), (contacts.body_b, rows.second, slice(6, 12))):
        stands = ~np.isin(body, members)
        end[stands], rows.jacobian[stands, half] = -1, 0.0
    target = np.where(held, contact_margin, np.minimum(contacts.gap, KEPT * contact_margin))
    rows.bias[:] = contacts.gap - target
    solve_newton(rows, len(members), SOLVE_TOLERANCE * float(contact_margin.max()))
    move_bodies(bodies, members, rows)
