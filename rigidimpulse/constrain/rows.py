"""Rows of contacts: the mass-scaled Jacobian that the solvers see.

Contact c of bodies a, b gives three rows, for d in (n, t1, t2):   J = [ -d, -(r_a x d), d, r_b x d ].   With M = C^-T
C^-1 a body's mass matrix (linear part C = m^(-1/2), angular part the Cholesky factor of the inverse inertia), Jh = J
C, so that the contacts' inverse effective mass is W = Jh Jh^T and impulses p change velocities by C Jh^T p. Immovable
bodies have no columns.
"""

from math import sqrt

import numpy as np

from rigidimpulse._jit import jit
from rigidimpulse.respond.friction import tangents


@jit
def number_columns(bodies, contacts, column):
    """The movable bodies of the contacts in order of index; column[i] is set to the first of the six columns of body i."""
    m = contacts.gap.shape[0]
    members = np.empty(2 * m, np.int64)
    count = 0
    for c in range(m):
        for i in (contacts.body_a[c], contacts.body_b[c]):
            if bodies.inv_mass[i] == 0.0:
                continue
            place = count
            while place > 0 and members[place - 1] > i:
                place -= 1
            if place > 0 and members[place - 1] == i:
                continue
            for k in range(count, place, -1):
                members[k] = members[k - 1]
            members[place] = i
            count += 1
    for k in range(count):
        column[members[k]] = 6 * k
    return members[:count]


@jit
def cholesky_3(a, c):
    """Lower factor c of a symmetric positive (3, 3)."""
    c[0, 0] = sqrt(a[0, 0])
    c[1, 0] = a[1, 0] / c[0, 0]
    c[1, 1] = sqrt(a[1, 1] - c[1, 0] * c[1, 0])
    c[2, 0] = a[2, 0] / c[0, 0]
    c[2, 1] = (a[2, 1] - c[2, 0] * c[1, 0]) / c[1, 1]
    c[2, 2] = sqrt(a[2, 2] - c[2, 0] * c[2, 0] - c[2, 1] * c[2, 1])
    c[0, 1] = c[0, 2] = c[1, 2] = 0.0


@jit
def _fill(bodies, i, r, d, sign, row, first, factor):
    if first < 0:
        return
    cholesky_3(bodies.inv_inertia[i], factor)
    x, y, z = r[1] * d[2] - r[2] * d[1], r[2] * d[0] - r[0] * d[2], r[0] * d[1] - r[1] * d[0]
    root = sqrt(bodies.inv_mass[i])
    for k in range(3):
        row[first + k] = sign * root * d[k]
        row[first + 3 + k] = sign * (x * factor[0, k] + y * factor[1, k] + z * factor[2, k])


@jit
def contact_rows(bodies, contacts, subset, column, width, jacobian, frames):
    """Fill jacobian (3m, width) and frames (m, 3, 3) with rows n, t1, t2, for the contacts listed in subset (m,)."""
    factor = np.empty((3, 3))
    for s in range(subset.shape[0]):
        c = subset[s]
        for k in range(3):
            frames[s, 0, k] = contacts.normal[c, k]
        tangents(contacts.normal[c], frames[s, 1], frames[s, 2])
        a, b = contacts.body_a[c], contacts.body_b[c]
        first_a = column[a] if bodies.inv_mass[a] > 0.0 else -1
        first_b = column[b] if bodies.inv_mass[b] > 0.0 else -1
        for k in range(3):
            row = jacobian[3 * s + k]
            for i in range(width):
                row[i] = 0.0
            _fill(bodies, a, contacts.arm_a[c], frames[s, k], -1.0, row, first_a, factor)
            _fill(bodies, b, contacts.arm_b[c], frames[s, k], 1.0, row, first_b, factor)


@jit
def row_velocity(contacts, subset, frames, velocity, angular_velocity, out):
    """J applied to velocities (n, 3) and angular velocities (n, 3) of all bodies, into out (3m,)."""
    for s in range(subset.shape[0]):
        c = subset[s]
        a, b = contacts.body_a[c], contacts.body_b[c]
        ra, rb = contacts.arm_a[c], contacts.arm_b[c]
        va, vb, wa, wb = velocity[a], velocity[b], angular_velocity[a], angular_velocity[b]
        x = (vb[0] + wb[1] * rb[2] - wb[2] * rb[1]) - (va[0] + wa[1] * ra[2] - wa[2] * ra[1])
        y = (vb[1] + wb[2] * rb[0] - wb[0] * rb[2]) - (va[1] + wa[2] * ra[0] - wa[0] * ra[2])
        z = (vb[2] + wb[0] * rb[1] - wb[1] * rb[0]) - (va[2] + wa[0] * ra[1] - wa[1] * ra[0])
        for k in range(3):
            out[3 * s + k] = x * frames[s, k, 0] + y * frames[s, k, 1] + z * frames[s, k, 2]
