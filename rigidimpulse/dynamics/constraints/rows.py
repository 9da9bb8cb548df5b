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
    SLIDE      p = k p_master: friction of what slips in a known direction; k has a sign

The normal of a contact is BOUNDED with lower = 0; it is the master of its two rows of friction. Bodies of an island
are numbered from 0 on in order of their index; immovable ones have the number -1.
"""

from math import inf, sqrt
from typing import NamedTuple

import numpy as np

from rigidimpulse.core.kernels import jit, jit_making_arrays
from rigidimpulse.core.quaternion import exponential, product
from rigidimpulse.core.vector import tangents

FREE, BOUNDED, DISC, DISC_SECOND, SEGMENT, SLIDE = np.arange(6)
"""Kinds of rows."""


class Rows(NamedTuple):
    """r rows of an island of n movable bodies; see the module's head."""

    first: np.ndarray  # (r,) number of body a, -1 if immovable
    second: np.ndarray  # (r,) number of body b
    jacobian: np.ndarray  # (r, 12) Jh: six columns of a, six of b
    bias: np.ndarray  # (r,) b, m/s or rad/s
    kind: np.ndarray  # (r,)
    master: np.ndarray  # (r,) row whose impulse bounds a DISC or SEGMENT, or makes a SLIDE: an earlier row
    coefficient: np.ndarray  # (r,) k of a DISC, SEGMENT or SLIDE
    lower: np.ndarray  # (r,) N s or N m s
    upper: np.ndarray  # (r,)
    softness: np.ndarray  # (r,) s, velocity per impulse
    impulse: np.ndarray  # (r,) start and answer


class ContactRows(NamedTuple):
    """The rows of m contacts, which come first; rows of rolling friction and of joints follow them."""

    rows: Rows
    first_row: np.ndarray  # (m,) the normal row of each contact
    frames: np.ndarray  # (m, 3, 3) n, t1, t2


@jit_making_arrays
def make_rows(r):
    """Return r rows, all of them FREE and hard, with no impulse."""
    # Few arrays: for a body or two, to make one for each field took as long as to write it.
    whole, real = np.zeros((4, r), np.int64), np.zeros((6, r))
    first, second, kind, master = whole[0], whole[1], whole[2], whole[3]
    bias, coefficient, lower, upper, softness, impulse = real[0], real[1], real[2], real[3], real[4], real[5]
    for i in range(r):
        first[i], second[i], lower[i], upper[i] = -1, -1, -inf, inf
    return Rows(first, second, np.zeros((r, 12)), bias, kind, master, coefficient, lower, upper, softness, impulse)


@jit
def cholesky_3(a):
    """The numbers c00, c10, c11, c20, c21, c22 of the lower factor of a symmetric positive (3, 3)."""
    c00 = sqrt(a[0, 0])
    c10 = a[1, 0] / c00
    c11 = sqrt(a[1, 1] - c10 * c10)
    c20 = a[2, 0] / c00
    c21 = (a[2, 1] - c20 * c10) / c11
    return c00, c10, c11, c20, c21, sqrt(a[2, 2] - c20 * c20 - c21 * c21)


@jit
def write_body(bodies, i, line, direction, torque):
    """Write half a row, line (6,): a linear and an angular direction (tuples), scaled by the mass of body i."""
    (x, y, z), (tx, ty, tz) = direction, torque
    c00, c10, c11, c20, c21, c22 = cholesky_3(bodies.inv_inertia[i])
    root = sqrt(bodies.inv_mass[i])
    line[0], line[1], line[2] = root * x, root * y, root * z
    line[3], line[4], line[5] = tx * c00 + ty * c10 + tz * c20, ty * c11 + tz * c21, tz * c22


@jit
def write_row(bodies, number, ends, arms, direction, rows, i):
    """Write row i for the relative velocity of two points along a direction (tuple).

    arms: the two points, (3,) m each, from the centres of mass of the bodies `ends` (-1: the world).
    """
    (a, b), (ra, rb), (x, y, z) = ends, arms, direction
    if a >= 0 and bodies.inv_mass[a] > 0.0:
        tx, ty, tz = ra[1] * z - ra[2] * y, ra[2] * x - ra[0] * z, ra[0] * y - ra[1] * x
        rows.first[i] = number[a]
        write_body(bodies, a, rows.jacobian[i, :6], (-x, -y, -z), (-tx, -ty, -tz))
    if b >= 0 and bodies.inv_mass[b] > 0.0:
        tx, ty, tz = rb[1] * z - rb[2] * y, rb[2] * x - rb[0] * z, rb[0] * y - rb[1] * x
        rows.second[i] = number[b]
        write_body(bodies, b, rows.jacobian[i, 6:], (x, y, z), (tx, ty, tz))


@jit_making_arrays
def contact_rows(bodies, contacts, members, number, extra):
    """The `ContactRows` of m contacts: rows n, t1, t2 of each, and `extra` (int) empty rows after them.

    Contacts without friction have the normal row only; friction coefficients are the static ones. members: movable bodies, in
    order; number (n_world,) gets the place of each.
    """
    for k in range(members.shape[0]):
        number[members[k]] = k
    m = contacts.gap.shape[0]
    first_row, frames = np.empty(m, np.int64), np.empty((m, 3, 3))
    r = np.int64(0)
    for c in range(m):
        first_row[c] = r
        # Smooth contacts need no tangents: fewer rows to solve.
        r += 3 if contacts.static_friction[c] > 0.0 else 1
    rows = make_rows(r + extra)
    for c in range(m):
        for k in range(3):
            frames[c, 0, k] = contacts.normal[c, k]
        tangents(contacts.normal[c], frames[c, 1], frames[c, 2])
        r = first_row[c]
        last = 3 if contacts.static_friction[c] > 0.0 else 1
        for k in range(last):
            d = frames[c, k]
            a, b = contacts.body_a[c], contacts.body_b[c]
            write_row(bodies, number, (a, b), (contacts.arm_a[c], contacts.arm_b[c]), (d[0], d[1], d[2]), rows, r + k)
        rows.kind[r], rows.lower[r] = BOUNDED, 0.0
        if last == 3:
            rows.kind[r + 1], rows.kind[r + 2] = DISC, DISC_SECOND
            rows.master[r + 1] = rows.master[r + 2] = r
            rows.coefficient[r + 1] = rows.coefficient[r + 2] = contacts.static_friction[c]
    return ContactRows(rows, first_row, frames)


@jit_making_arrays
def take_rows(rows, which):
    """Copies of the rows `which` (k,), without masters."""
    taken = make_rows(which.shape[0])
    for k in range(which.shape[0]):
        i = which[k]
        taken.first[k], taken.second[k], taken.kind[k] = rows.first[i], rows.second[i], rows.kind[i]
        for j in range(12):
            taken.jacobian[k, j] = rows.jacobian[i, j]
        taken.bias[k], taken.coefficient[k], taken.softness[k] = rows.bias[i], rows.coefficient[i], rows.softness[i]
        taken.lower[k], taken.upper[k], taken.impulse[k] = rows.lower[i], rows.upper[i], rows.impulse[i]
    return taken


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


@jit_making_arrays
def row_velocities(bodies, contacts, first_row, frames, u):
    """Velocities u (r,) of the contacts' rows."""
    v = np.empty(3)
    for c in range(first_row.shape[0]):
        contact_velocity(contacts, c, frames[c], bodies.velocity, bodies.angular_velocity, v)
        for k in range(3 if contacts.static_friction[c] > 0.0 else 1):
            u[first_row[c] + k] = v[k]


@jit
def rows_of(rows, i):
    """Rows of the contact whose normal is row i: 3, or 1 without friction."""
    return 3 if i + 1 < rows.kind.shape[0] and rows.kind[i + 1] == DISC and rows.master[i + 1] == i else 1


@jit_making_arrays
def impulse_along(rows, i, frame, out):
    """World impulse (3,) of a contact whose normal is row i, frame (3, 3)."""
    out[:] = 0.0
    for k in range(rows_of(rows, i)):
        for j in range(3):
            out[j] += rows.impulse[i + k] * frame[k, j]


@jit
def multiply(rows, y, out):
    """Jh y, into out (r,); y (n, 6)."""
    jacobian, first, second = rows.jacobian, rows.first, rows.second
    for i in range(out.shape[0]):
        total, a, b = 0.0, first[i], second[i]
        if a >= 0:
            for k in range(6):
                total += jacobian[i, k] * y[a, k]
        if b >= 0:
            for k in range(6):
                total += jacobian[i, 6 + k] * y[b, k]
        out[i] = total


@jit
def multiply_transposed(rows, p, out):
    """Jh^T p, into out (n, 6)."""
    jacobian, first, second = rows.jacobian, rows.first, rows.second
    for i in range(out.shape[0]):
        for k in range(6):
            out[i, k] = 0.0
    for i in range(p.shape[0]):
        size, a, b = p[i], first[i], second[i]
        if size == 0.0:
            continue
        if a >= 0:
            for k in range(6):
                out[a, k] += jacobian[i, k] * size
        if b >= 0:
            for k in range(6):
                out[b, k] += jacobian[i, 6 + k] * size


@jit
def scaled_wrench(bodies, i, y, wrench):
    """Add C^-T y, the linear and angular impulse on body i that y = (Jh^T p)_i (6,) stands for, to wrench (6,)."""
    root = sqrt(bodies.inv_mass[i])
    c00, c10, c11, c20, c21, c22 = cholesky_3(bodies.inv_inertia[i])
    # C^-T by back substitution: the angular part of C is a Cholesky factor.
    z = y[5] / c22
    x1 = (y[4] - c21 * z) / c11
    x0 = (y[3] - c10 * x1 - c20 * z) / c00
    for k in range(3):
        wrench[k] += y[k] / root
    wrench[3] += x0
    wrench[4] += x1
    wrench[5] += z


@jit
def scaled_change(bodies, i, y, linear, angular):
    """C y of body i: the change of its velocity by impulses p with y = (Jh^T p)_i (6,), into linear and angular (3,)."""
    root = sqrt(bodies.inv_mass[i])
    c00, c10, c11, c20, c21, c22 = cholesky_3(bodies.inv_inertia[i])
    for j in range(3):
        linear[j] = root * y[j]
    angular[0], angular[1], angular[2] = c00 * y[3], c10 * y[3] + c11 * y[4], c20 * y[3] + c21 * y[4] + c22 * y[5]


@jit_making_arrays
def changes_of(bodies, members, rows):
    """Changes (n, 6) of the members' velocities, linear and angular, by the rows' impulses."""
    n = members.shape[0]
    y, change = np.empty((n, 6)), np.empty((n, 6))
    multiply_transposed(rows, rows.impulse, y)
    for k in range(n):
        scaled_change(bodies, members[k], y[k], change[k, :3], change[k, 3:])
    return change


@jit_making_arrays
def change_velocities(bodies, members, rows):
    """Apply the rows' impulses."""
    change = changes_of(bodies, members, rows)
    for k in range(members.shape[0]):
        for j in range(3):
            bodies.velocity[members[k], j] += change[k, j]
            bodies.angular_velocity[members[k], j] += change[k, 3 + j]


@jit_making_arrays
def move_bodies(bodies, members, rows):
    """Move bodies by what the rows' impulses make of a displacement (the metric of mass)."""
    change = changes_of(bodies, members, rows)
    for k in range(members.shape[0]):
        i = members[k]
        for j in range(3):
            bodies.position[i, j] += change[k, j]
        q, (t0, t1, t2, t3) = bodies.orientation[i], exponential(change[k, 3], change[k, 4], change[k, 5])
        q[0], q[1], q[2], q[3] = product(t0, t1, t2, t3, q[0], q[1], q[2], q[3])


@jit_making_arrays
def response_to(rows, n, p):
    """W p (r,): the change of the rows' velocities by impulses p (r,)."""
    y, out = np.empty((n, 6)), np.empty(p.shape[0])
    multiply_transposed(rows, p, y)
    multiply(rows, y, out)
    return out
