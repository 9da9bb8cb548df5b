"""Kinematic response: the normal velocity is reflected and damped, mass plays no part (A1).

    v' = v - (1 + k) (v.n) n,        k the restitution

for a body that meets an immovable one, v.n the speed of its contact point relative to it. Of two movable bodies each
takes half of the change, whatever their masses. Spins do not change and there is no friction. It is the cheapest
response; it conserves neither momentum nor, where bodies spin, energy.
"""

import numpy as np

from rigidimpulse.core.kernels import jit_making_arrays
from rigidimpulse.dynamics.impact.point import log_impact, relative_velocity


@jit_making_arrays
def respond_kinematic(bodies, contacts, rule, together, number, joints, log):
    """Each contact once, fastest approach first; arguments and answer as `respond_sequential`. The law and `together` do not matter."""
    m = contacts.gap.shape[0]
    done = np.zeros(m, np.bool_)
    u, impulse = np.empty(3), np.empty(3)
    count = np.int64(0)
    while count < m and count < log.shape[0]:
        best, fastest = np.int64(-1), -rule.tolerance
        for c in range(m):
            approach = relative_velocity(bodies, contacts, c, u)
            if not done[c] and approach < fastest:
                best, fastest = c, approach
        if best < 0:
            break
        done[best] = True
        a, b = contacts.body_a[best], contacts.body_b[best]
        n = contacts.normal[best]
        e = contacts.restitution[best]
        if e * -fastest <= rule.rest_speed[best]:
            e = 0.0
        change = -(1.0 + e) * fastest
        # Of two movable bodies each takes half of the change, whatever their masses.
        share_a = 0.0 if bodies.inv_mass[a] == 0.0 else (1.0 if bodies.inv_mass[b] == 0.0 else 0.5)
        share_b = 0.0 if bodies.inv_mass[b] == 0.0 else 1.0 - share_a
        for k in range(3):
            bodies.velocity[a, k] -= share_a * change * n[k]
            bodies.velocity[b, k] += share_b * change * n[k]
            # What the change of b (or of a) stands for.
            mass_change = share_b / bodies.inv_mass[b] if share_b > 0.0 else share_a / bodies.inv_mass[a]
            impulse[k] = mass_change * change * n[k]
        count = log_impact(bodies, contacts, best, impulse, fastest, log, count)
    return count, count, False
