"""Drift: contacts that last are kept at their gap by position alone.

Second-order paths leave a load-bearing contact slightly above or below the gap delta it is held at. When it has sunk
below SUNK delta, the bodies of the group are moved by the least displacement in the metric of mass,  dx = M^-1 J_n^T
p,  0 <= p _|_ g + J_n dx - target >= 0, that brings it back to delta and lets no other contact sink. Velocities do
not change; the potential energy it costs is booked in the ledger.
"""

import numpy as np

from rigidimpulse._jit import jit
from rigidimpulse.constrain.newton import multiply_transposed, solve_cone
from rigidimpulse.constrain.rows import cholesky_3, contact_rows, number_columns
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
def lift_contacts(bodies, contacts, held, delta, column):
    """Move the bodies of the group so that held contacts have their gap delta again."""
    m = contacts.gap.shape[0]
    members = number_columns(bodies, contacts, column)
    width = 6 * members.shape[0]
    jacobian = np.empty((3 * m, width))
    frames = np.empty((m, 3, 3))
    contact_rows(bodies, contacts, np.arange(m), column, width, jacobian, frames)
    b, p, friction = np.zeros(3 * m), np.zeros(3 * m), np.zeros(m)
    largest = 0.0
    for c in range(m):
        target = delta[c] if held[c] else min(contacts.gap[c], KEPT * delta[c])
        b[3 * c] = contacts.gap[c] - target
        largest = max(largest, delta[c])
    solve_cone(jacobian, b, friction, p, SOLVE_TOLERANCE * largest)
    y = np.empty(width)
    multiply_transposed(jacobian, p, y)
    factor = np.empty((3, 3))
    turn, q = np.empty(3), np.empty(4)
    for i in members:
        first = column[i]
        root = np.sqrt(bodies.inv_mass[i])
        cholesky_3(bodies.inv_inertia[i], factor)
        for k in range(3):
            bodies.position[i, k] += root * y[first + k]
            turn[k] = 0.0
            for j in range(3):
                turn[k] += factor[k, j] * y[first + 3 + j]
        quaternion_exp(turn, q)
        quaternion_multiply(q, bodies.orientation[i].copy(), bodies.orientation[i])
