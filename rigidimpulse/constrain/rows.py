"""Rows: the one format in which contacts and joints, limits and motors, hard and soft, come before the solvers.

Row i acts between two bodies a and b. With d a direction at lever arms r_a and r_b its Jacobian is J = [-d, -(r_a x
d), d, r_b x d] (a row that acts on the rotation alone has J = [0, -d, 0, d]), and its velocity is u = b + J v. With M =
C^-T C^-1 a body's mass matrix (linear part C = m^(-1/2), angular part the Cholesky factor of the inverse inertia) the
rows hold Jh = J C, so that the inverse effective mass of the rows is Jh Jh^T and impulses p change velocities by
C Jh^T p. The law of a row, s its softness:

    FREE       u + s p = 0
    BOUNDED    lower <= p <= upper:  u + s p = 0 between the bounds, >= 0 at the lower one, <= 0 at the upper one
    DISC       this row and the next: |p| <= k p_master, against their velocity where it is not zero (Coulomb)
    SEGMENT    the same for a single row

The normal of a contact is BOUNDED with lower = 0; it is the master of its two rows of friction. Bodies of an island
are numbered from 0 on in order of their index; immovable ones have the number -1.
"""

from math import inf, sqrt
from typing import NamedTuple

import numpy as np

from rigidimpulse._jit import jit
from rigidimpulse.respond.friction import tangents

FREE, BOUNDED, DISC, DISC_SECOND, SEGMENT = np.arange(5)
"""Kinds of rows."""


class Rows(NamedTuple):
    """r rows of an island of n movable bodies; see the module's head."""

    first: np.ndarray  # (r,) number of body a, -1 if immovable
    second: np.ndarray  # (r,) number of body b
    jacobian: np.ndarray  # (r, 12) Jh: six columns of a, six of b
    bias: np.ndarray  # (r,) b, m/s or rad/s
    kind: np.ndarray  # (r,)
    master: np.ndarray  # (r,) row whose impulse bounds a DISC or SEGMENT: an earlier row
    coefficient: np.ndarray  # (r,) k of a DISC or SEGMENT
    lower: np.ndarray  # (r,) N s or N m s
    upper: np.ndarray  # (r,)
    softness: np.ndarray  # (r,) s, velocity per impulse
    impulse: np.ndarray  # (r,) start and answer


@jit
def make_rows(r):
    """Room for r rows, all of them FREE and hard, with no impulse."""
    return Rows(
        np.full(r, -1, np.int64),
        np.full(r, -1, np.int64),
        np.zeros((r, 12)),
        np.zeros(r),
        np.zeros(r, np.int64),
        np.zeros(r, np.int64),
        np.zeros(r),
        np.full(r, -inf),
        np.full(r, inf),
        np.zeros(r),
        np.zeros(r),
    )


@jit
def number_members(bodies, contacts, subset, number):
    """Movable bodies of the contacts listed in subset, in order of index; number (n_world,) of each is set to its place."""
    members = np.empty(2 * subset.shape[0], np.int64)
    count = 0
    for s in range(subset.shape[0]):
        for i in (contacts.body_a[subset[s]], contacts.body_b[subset[s]]):
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
        number[members[k]] = k
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
def write_body(bodies, i, line, x, y, z, tx, ty, tz):
    """Half a row, line (6,): linear direction (x, y, z), angular (tx, ty, tz), scaled by the mass of body i."""
    factor = np.empty((3, 3))
    cholesky_3(bodies.inv_inertia[i], factor)
    root = sqrt(bodies.inv_mass[i])
    line[0], line[1], line[2] = root * x, root * y, root * z
    for k in range(3):
        line[3 + k] = tx * factor[0, k] + ty * factor[1, k] + tz * factor[2, k]


@jit
def write_row(bodies, number, a, b, ra, rb, x, y, z, rows, i):
    """Row i for the relative velocity of two points along (x, y, z); ra, rb (3,) their arms on bodies a and b (-1: the world)."""
    if a >= 0 and bodies.inv_mass[a] > 0.0:
        tx, ty, tz = ra[1] * z - ra[2] * y, ra[2] * x - ra[0] * z, ra[0] * y - ra[1] * x
        rows.first[i] = number[a]
        write_body(bodies, a, rows.jacobian[i, :6], -x, -y, -z, -tx, -ty, -tz)
    if b >= 0 and bodies.inv_mass[b] > 0.0:
        tx, ty, tz = rb[1] * z - rb[2] * y, rb[2] * x - rb[0] * z, rb[0] * y - rb[1] * x
        rows.second[i] = number[b]
        write_body(bodies, b, rows.jacobian[i, 6:], x, y, z, tx, ty, tz)


@jit
def contact_rows(bodies, contacts, subset, number, rows, first_row, frames):
    """Fill rows, from the first one on, with three rows n, t1, t2 for each contact listed in subset (m,).

    Contacts without friction have the normal row only. first_row (m,) and frames (m, 3, 3) are written; returns the
    number of rows. Friction coefficients are the static ones.
    """
    r = np.int64(0)
    for s in range(subset.shape[0]):
        c = subset[s]
        for k in range(3):
            frames[s, 0, k] = contacts.normal[c, k]
        tangents(contacts.normal[c], frames[s, 1], frames[s, 2])
        first_row[s] = r
        last = 3 if contacts.static_friction[c] > 0.0 else 1
        for k in range(last):
            d = frames[s, k]
            a, b = contacts.body_a[c], contacts.body_b[c]
            write_row(bodies, number, a, b, contacts.arm_a[c], contacts.arm_b[c], d[0], d[1], d[2], rows, r + k)
        rows.kind[r], rows.lower[r] = BOUNDED, 0.0
        if last == 3:
            rows.kind[r + 1], rows.kind[r + 2] = DISC, DISC_SECOND
            rows.master[r + 1] = rows.master[r + 2] = r
            rows.coefficient[r + 1] = rows.coefficient[r + 2] = contacts.static_friction[c]
        r += last
    return r


@jit
def count_contact_rows(contacts, subset):
    """Rows that `contact_rows` will fill."""
    r = np.int64(0)
    for s in range(subset.shape[0]):
        r += 3 if contacts.static_friction[subset[s]] > 0.0 else 1
    return r


@jit
def contact_velocity(contacts, c, frame, velocity, angular_velocity, out):
    """Relative velocity of contact c along the three directions of frame (3, 3), into out (3,)."""
    a, b = contacts.body_a[c], contacts.body_b[c]
    ra, rb = contacts.arm_a[c], contacts.arm_b[c]
    va, vb, wa, wb = velocity[a], velocity[b], angular_velocity[a], angular_velocity[b]
    x = (vb[0] + wb[1] * rb[2] - wb[2] * rb[1]) - (va[0] + wa[1] * ra[2] - wa[2] * ra[1])
    y = (vb[1] + wb[2] * rb[0] - wb[0] * rb[2]) - (va[1] + wa[2] * ra[0] - wa[0] * ra[2])
    z = (vb[2] + wb[0] * rb[1] - wb[1] * rb[0]) - (va[2] + wa[0] * ra[1] - wa[1] * ra[0])
    for k in range(3):
        out[k] = x * frame[k, 0] + y * frame[k, 1] + z * frame[k, 2]


@jit
def rows_of(rows, i):
    """Rows of the contact whose normal is row i: 3, or 1 without friction."""
    return 3 if i + 1 < rows.kind.shape[0] and rows.kind[i + 1] == DISC else 1


@jit
def impulse_along(rows, i, frame, out):
    """World impulse (3,) of a contact whose normal is row i, frame (3, 3)."""
    out[:] = 0.0
    for k in range(rows_of(rows, i)):
        for j in range(3):
            out[j] += rows.impulse[i + k] * frame[k, j]


@jit
def multiply(rows, y, out):
    """Jh y, into out (r,); y (n, 6)."""
    for i in range(out.shape[0]):
        total = 0.0
        line = rows.jacobian[i]
        if rows.first[i] >= 0:
            part = y[rows.first[i]]
            for k in range(6):
                total += line[k] * part[k]
        if rows.second[i] >= 0:
            part = y[rows.second[i]]
            for k in range(6):
                total += line[6 + k] * part[k]
        out[i] = total


@jit
def multiply_transposed(rows, p, out):
    """Jh^T p, into out (n, 6)."""
    out[:] = 0.0
    for i in range(p.shape[0]):
        if p[i] != 0.0:
            line = rows.jacobian[i]
            if rows.first[i] >= 0:
                part = out[rows.first[i]]
                for k in range(6):
                    part[k] += line[k] * p[i]
            if rows.second[i] >= 0:
                part = out[rows.second[i]]
                for k in range(6):
                    part[k] += line[6 + k] * p[i]


@jit
def scaled_wrench(bodies, i, y, wrench):
    """Add C^-T y, the linear and angular impulse on body i that y = (Jh^T p)_i (6,) stands for, to wrench (6,)."""
    factor = np.empty((3, 3))
    root = sqrt(bodies.inv_mass[i])
    cholesky_3(bodies.inv_inertia[i], factor)
    z = y[5] / factor[2, 2]
    x1 = (y[4] - factor[2, 1] * z) / factor[1, 1]
    x0 = (y[3] - factor[1, 0] * x1 - factor[2, 0] * z) / factor[0, 0]
    for k in range(3):
        wrench[k] += y[k] / root
    wrench[3] += x0
    wrench[4] += x1
    wrench[5] += z


@jit
def scaled_change(bodies, i, y, linear, angular):
    """C y of body i: the change of its velocity by impulses p with y = (Jh^T p)_i (6,), into linear and angular (3,)."""
    factor = np.empty((3, 3))
    root = sqrt(bodies.inv_mass[i])
    cholesky_3(bodies.inv_inertia[i], factor)
    for j in range(3):
        linear[j], angular[j] = root * y[j], 0.0
        for t in range(3):
            angular[j] += factor[j, t] * y[3 + t]
