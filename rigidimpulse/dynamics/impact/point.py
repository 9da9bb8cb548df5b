"""Impulses at contacts: the kinematics of a contact, the single impact, and the speed of an island.

A contact has arms r_a, r_b from the centres of mass to its points and the unit normal n from a to b. With

    u = v_b + w_b x r_b - v_a - w_a x r_a                                  relative velocity of the contact points
    K = (1/m_a + 1/m_b) 1 - [r_a]x I_a^-1 [r_a]x - [r_b]x I_b^-1 [r_b]x     inverse effective mass
    j = -(1 + e) u.n / (n.K n)                                             frictionless impulse, A9 (Hahn 1988; Baraff 1989)

the impulse J acts + on b and - on a at the contact: v_b += J / m_b, w_b += I_b^-1 (r_b x J), and the mirror for a.
Immovable bodies have zero inverse mass and inertia. The arrays hold all bodies of the scene; a
kernel reads and writes only the bodies of its contacts.
"""

from math import sqrt

import numpy as np

from rigidimpulse.core.kernels import jit, jit_making_arrays
from rigidimpulse.dynamics.impact.friction import contact_impulse
from rigidimpulse.dynamics.impact.restitution import PairLaw


@jit
def relative_velocity(bodies, contacts, c, u):
    """u (3,) of contact c; returns u.n."""
    a, b = contacts.body_a[c], contacts.body_b[c]
    ra, rb = contacts.arm_a[c], contacts.arm_b[c]
    va, vb = bodies.velocity[a], bodies.velocity[b]
    wa, wb = bodies.angular_velocity[a], bodies.angular_velocity[b]
    u[0] = (vb[0] + wb[1] * rb[2] - wb[2] * rb[1]) - (va[0] + wa[1] * ra[2] - wa[2] * ra[1])
    u[1] = (vb[1] + wb[2] * rb[0] - wb[0] * rb[2]) - (va[1] + wa[2] * ra[0] - wa[0] * ra[2])
    u[2] = (vb[2] + wb[0] * rb[1] - wb[1] * rb[0]) - (va[2] + wa[0] * ra[1] - wa[1] * ra[0])
    n = contacts.normal[c]
    return u[0] * n[0] + u[1] * n[1] + u[2] * n[2]


@jit
def add_body(inv_mass, inv_inertia, r, k):
    """k += inv_mass 1 - [r]x inv_inertia [r]x."""
    for i in range(3):
        k[i, i] += inv_mass
    for i in range(3):
        i1, i2 = (i + 1) % 3, (i + 2) % 3
        for j in range(3):
            j1, j2 = (j + 1) % 3, (j + 2) % 3
            # Row i of [r]x is r[i2] (-e_i1)... written out: ([r]x s)_i = r[i1] s[i2] - r[i2] s[i1].
            k[i, j] += r[i1] * (inv_inertia[i2, j2] * r[j1] - inv_inertia[i2, j1] * r[j2]) - r[i2] * (
                inv_inertia[i1, j2] * r[j1] - inv_inertia[i1, j1] * r[j2]
            )


@jit
def inverse_effective_mass(bodies, contacts, c, k):
    """K (3, 3) of contact c."""
    a, b = contacts.body_a[c], contacts.body_b[c]
    for i in range(3):
        for j in range(3):
            k[i, j] = 0.0
    add_body(bodies.inv_mass[a], bodies.inv_inertia[a], contacts.arm_a[c], k)
    add_body(bodies.inv_mass[b], bodies.inv_inertia[b], contacts.arm_b[c], k)


@jit
def _push(bodies, i, r, x, y, z):
    m = bodies.inv_mass[i]
    if m == 0.0:
        return
    v, w, inv_i = bodies.velocity[i], bodies.angular_velocity[i], bodies.inv_inertia[i]
    v[0] += m * x
    v[1] += m * y
    v[2] += m * z
    tx, ty, tz = r[1] * z - r[2] * y, r[2] * x - r[0] * z, r[0] * y - r[1] * x
    for k in range(3):
        w[k] += inv_i[k, 0] * tx + inv_i[k, 1] * ty + inv_i[k, 2] * tz


@jit
def apply_impulse(bodies, contacts, c, x, y, z):
    """Impulse (x, y, z) on b and its opposite on a, at contact c."""
    _push(bodies, contacts.body_b[c], contacts.arm_b[c], x, y, z)
    _push(bodies, contacts.body_a[c], contacts.arm_a[c], -x, -y, -z)


@jit_making_arrays
def resolve_contact(bodies, contacts, c, restitution, law, log, count):
    """One impact at contact c with the given restitution by a law of it; appends a row to log and returns the new count."""
    k = np.empty((3, 3))
    u = np.empty(3)
    t1, t2, impulse = np.empty(3), np.empty(3), np.empty(3)
    approach = relative_velocity(bodies, contacts, c, u)
    inverse_effective_mass(bodies, contacts, c, k)
    # Without rebound nothing is reversed along the surface either.
    e_t = contacts.tangential_restitution[c] if restitution > 0.0 else 0.0
    mu_s, mu_k = contacts.static_friction[c], contacts.dynamic_friction[c]
    contact_impulse(k, contacts.normal[c], u, PairLaw(law, restitution, e_t, mu_s, mu_k), t1, t2, impulse)
    apply_impulse(bodies, contacts, c, impulse[0], impulse[1], impulse[2])
    return log_impact(bodies, contacts, c, impulse, approach, log, count)


@jit_making_arrays
def log_impact(bodies, contacts, c, impulse, approach, log, count):
    """Row of log: contact, normal impulse, tangential impulse (3), approach speed, separation speed."""
    if count >= log.shape[0]:
        return count
    n = contacts.normal[c]
    j = impulse[0] * n[0] + impulse[1] * n[1] + impulse[2] * n[2]
    u = np.empty(3)
    log[count, 0] = c
    log[count, 1] = j
    for a in range(3):
        log[count, 2 + a] = impulse[a] - j * n[a]
    log[count, 5] = -approach
    log[count, 6] = relative_velocity(bodies, contacts, c, u)
    return count + 1


@jit
def speed_scale(bodies, contacts):
    """Largest speed of a contact point of the island's bodies [m/s]; what 'approaching' is measured against."""
    scale = 0.0
    for c in range(contacts.gap.shape[0]):
        for i, r in ((contacts.body_a[c], contacts.arm_a[c]), (contacts.body_b[c], contacts.arm_b[c])):
            v, w = bodies.velocity[i], bodies.angular_velocity[i]
            speed = sqrt(v[0] ** 2 + v[1] ** 2 + v[2] ** 2)
            spin = sqrt(w[0] ** 2 + w[1] ** 2 + w[2] ** 2) * sqrt(r[0] ** 2 + r[1] ** 2 + r[2] ** 2)
            scale = max(scale, speed + spin)
    return scale
