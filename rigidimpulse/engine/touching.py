"""Which bodies touch at one instant: poses brought to it, manifolds of the pairs in question, and what presses each
contact.

The acceleration that presses contact i together, without the force the contact itself carried before, is

    a_i = -n.(a_b + alpha_b x r_b - a_a - alpha_a x r_a) - d(u.n)/dt + f_i (n.K n)

with the present accelerations of the bodies (forces and contacts included), d(u.n)/dt what the gap gains at constant
velocities, as the place of contact wanders and the normal turns (dynamics/constraints/contact_motion.py), and f_i the normal force
it carried. It is what a rebound is measured against: one that rises less than delta, v^2 < 2 a delta, is none, and a
contact that leaves more slowly than that is held. So a ball that slides in a spinning hollow is held without gravity.
"""

from math import sqrt

import numpy as np

from rigidimpulse.core.kernels import jit, jit_making_arrays
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.dynamics.constraints.contact_motion import contact_motion
from rigidimpulse.dynamics.impact.point import inverse_effective_mass, relative_velocity
from rigidimpulse.motion.trajectory import place_at

# Part of bounding radii and of held gaps that rounding may take.
ROUND_OFF = TOLERANCES.events.reach_round_off


@jit_making_arrays
def near_pairs(trajectory, time, pairs, margin, radius, bodies, seen, near):
    """Write the pairs of the given bodies (k,) that are not `seen` (p,) yet and whose bounding spheres are near at `time`.

    margin: gap that counts as near, relative to that at which contacts are held; radius (n,) m. near (p,): their places, in order.
    Marks the pairs that were looked at as seen, and returns how many are near.
    """
    x, y = np.empty(3), np.empty(3)
    asked = np.zeros(radius.shape[0], np.bool_)
    for i in bodies:
        asked[i] = True
    count = 0
    for p in range(pairs.a.shape[0]):
        a, b = pairs.a[p], pairs.b[p]
        if seen[p] or not (asked[a] or asked[b]):
            continue
        seen[p] = True
        reach = (radius[a] + radius[b]) * (1.0 + ROUND_OFF) + margin * pairs.contact_margin[p]
        if reach < np.inf:
            place_at(trajectory, a, time, x)
            place_at(trajectory, b, time, y)
            if (y[0] - x[0]) ** 2 + (y[1] - x[1]) ** 2 + (y[2] - x[2]) ** 2 > reach * reach:
                continue
        near[count] = p
        count += 1
    return count


@jit
def fill_contacts(bodies, real, integer, rows, material_of_body, coefficients, contacts):
    """Contacts (see dynamics/impact/point.py) from the buffer rows; coefficients (k, k, 4): e, mu_s, mu_k, e_t of two materials."""
    for s in range(rows.shape[0]):
        c = rows[s]
        a, b = integer[c, 0], integer[c, 1]
        contacts.body_a[s] = a
        contacts.body_b[s] = b
        for k in range(3):
            contacts.arm_a[s, k] = real[c, k] - bodies.position[a, k]
            contacts.arm_b[s, k] = real[c, 3 + k] - bodies.position[b, k]
            contacts.normal[s, k] = real[c, 6 + k]
        contacts.gap[s] = real[c, 9]
        pair = coefficients[material_of_body[a], material_of_body[b]]
        contacts.restitution[s] = pair[0]
        contacts.static_friction[s] = pair[1]
        contacts.dynamic_friction[s] = pair[2]
        contacts.tangential_restitution[s] = pair[3]


@jit
def _point_acceleration(acceleration, angular_acceleration, i, r, n):
    """n.(a + alpha x r) of body i."""
    a, alpha = acceleration[i], angular_acceleration[i]
    x = a[0] + alpha[1] * r[2] - alpha[2] * r[1]
    y = a[1] + alpha[2] * r[0] - alpha[0] * r[2]
    z = a[2] + alpha[0] * r[1] - alpha[1] * r[0]
    return n[0] * x + n[1] * y + n[2] * z


@jit_making_arrays
def pressing(geometry, shape_of_body, rotation, bodies, contacts, touching, accelerations, limits):
    """Approach speeds (m,) u.n [m/s] and rest speeds (m,) sqrt(2 a delta) [m/s] of the contacts.

    touching: kinds (m,) and features (m, 2) of what touches, contact margins delta (m,) [m], and the normal forces (m,) [N] that the
    contacts carried. accelerations: of the bodies, linear and angular, both (n, 3). limits: the least a that counts [m/s2] and the step
    [s]. What the motion gives counts where it makes more than round-off of delta in a step: bodies that stand still do so by round-off.
    """
    kinds, features, contact_margin, normal_force = touching
    acceleration, angular_acceleration = accelerations
    least, step = limits
    turning = contact_motion(geometry, shape_of_body, rotation, bodies, contacts, kinds, features).turning
    m = contacts.gap.shape[0]
    approach, rest_speed = np.empty(m), np.empty(m)
    u = np.empty(3)
    k = np.empty((3, 3))
    for c in range(m):
        n = contacts.normal[c]
        approach[c] = relative_velocity(bodies, contacts, c, u)
        a = _point_acceleration(
            acceleration, angular_acceleration, contacts.body_a[c], contacts.arm_a[c], n
        ) - _point_acceleration(acceleration, angular_acceleration, contacts.body_b[c], contacts.arm_b[c], n)
        turn = turning[c, 0] * n[0] + turning[c, 1] * n[1] + turning[c, 2] * n[2]
        if abs(turn) * step * step > ROUND_OFF * contact_margin[c]:
            a -= turn
        if normal_force[c] > 0.0:
            inverse_effective_mass(bodies, contacts, c, k)
            for i in range(3):
                for j in range(3):
                    a += normal_force[c] * n[i] * k[i, j] * n[j]
        rest_speed[c] = sqrt(2.0 * max(a, least) * contact_margin[c])
    return approach, rest_speed
