"""Position correction: lasting contacts are brought back to the contact margin d.

Paths of second order leave a load-bearing contact slightly above or below the gap d. When its gap g falls below SUNK d, the bodies of
the island are moved by the smallest displacement in the metric of mass that brings it back to d and lets no other contact sink:

    dx = M^-1 J_n^T p,    0 <= p _|_ g + J_n dx - target >= 0.

Velocities do not change. The ledger records the change of potential energy.
"""

import numpy as np

from rigidimpulse.core.kernels import jit
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.dynamics.constraints.rows import contact_rows, move_bodies, take_rows
from rigidimpulse.dynamics.solvers.newton import solve_newton
from rigidimpulse.model.contacts import Contacts
from rigidimpulse.motion.body_state import BodyState

SUNK = 0.7
# Other contacts of the island may not sink below this part of the contact margin.
KEPT = 0.75
SOLVE_TOLERANCE = TOLERANCES.contact_forces.correction_residual


@jit
def needs_correction(contacts, held, contact_margin):
    """Whether a held contact has sunk; held (m,) bool, contact_margin (m,) m."""
    for c in range(contacts.gap.shape[0]):
        if held[c] and contacts.gap[c] < SUNK * contact_margin[c]:
            return True
    return False


def correct_positions(
    bodies: BodyState, contacts: Contacts, held: np.ndarray, contact_margin: np.ndarray, members: np.ndarray, number: np.ndarray
) -> None:
    """Move the bodies of the island so that held contacts have their contact margin again; other bodies do not move."""
    rows, first_row, _ = contact_rows(bodies, contacts, members, number, 0)
    rows = take_rows(rows, first_row)
    # Bodies that do not belong to the island are taken as immovable.
    for body, end, half in ((contacts.body_a, rows.first, slice(6)), (contacts.body_b, rows.second, slice(6, 12))):
        stands = ~np.isin(body, members)
        end[stands], rows.jacobian[stands, half] = -1, 0.0
    # Held contacts go to the contact margin; no other one may sink below a part of it.
    target = np.where(held, contact_margin, np.minimum(contacts.gap, KEPT * contact_margin))
    rows.bias[:] = contacts.gap - target
    solve_newton(rows, len(members), SOLVE_TOLERANCE * float(contact_margin.max()))
    move_bodies(bodies, members, rows)
