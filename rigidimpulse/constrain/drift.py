"""Drift: contacts that last are kept at their gap by position alone.

Second-order paths leave a load-bearing contact slightly above or below the gap delta it is held at. When it has sunk
below SUNK delta, the bodies of the group are moved by the least displacement in the metric of mass,  dx = M^-1 J_n^T
p,  0 <= p _|_ g + J_n dx - target >= 0, that brings it back to delta and lets no other contact sink. Velocities do
not change; the potential energy it costs is booked in the ledger.
"""

import numpy as np

from rigidimpulse._jit import jit
from rigidimpulse.constrain.newton import solve_newton
from rigidimpulse.constrain.rows import BOUNDED, make_rows, multiply_transposed, number_members, scaled_change, write_row
from rigidimpulse.rotation import quaternion_exp, quaternion_multiply

SUNK = 0.7
# Other contacts of the group may not sink below this part of delta.
KEPT = 0.75
SOLVE_TOLERANCE = 1e-6


@jit
def needs_lift(contacts, held, delta):
    """Whether a held contact has sunk; held (m,) bool, delta (m,)."""
    for c in range(contacts.gap.shape[0]):
        if held[c] and contacts.gap[c] < SUNK * delta[c]:
            return True
    return False


@jit
def lift_contacts(bodies, contacts, held, delta, number):
    """Move the bodies of the group so that held contacts have their gap delta again."""
    m = contacts.gap.shape[0]
    members = number_members(bodies, contacts, np.arange(m), number)
    rows = make_rows(m)
    largest = 0.0
    for c in range(m):
        n = contacts.normal[c]
        a, b = contacts.body_a[c], contacts.body_b[c]
        write_row(bodies, number, a, b, contacts.arm_a[c], contacts.arm_b[c], n[0], n[1], n[2], rows, c)
        target = delta[c] if held[c] else min(contacts.gap[c], KEPT * delta[c])
        rows.kind[c], rows.lower[c], rows.bias[c] = BOUNDED, 0.0, contacts.gap[c] - target
        largest = max(largest, delta[c])
    solve_newton(rows, members.shape[0], SOLVE_TOLERANCE * largest)
    y = np.empty((members.shape[0], 6))
    multiply_transposed(rows, rows.impulse, y)
    shift, turn, q = np.empty(3), np.empty(3), np.empty(4)
    for k in range(members.shape[0]):
        i = members[k]
        scaled_change(bodies, i, y[k], shift, turn)
        for j in range(3):
            bodies.position[i, j] += shift[j]
        quaternion_exp(turn, q)
        quaternion_multiply(q, bodies.orientation[i].copy(), bodies.orientation[i])
