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

from collections.abc import Callable
from math import inf, sqrt
from typing import NamedTuple

import numpy as np

from rigidimpulse.core.kernels import jit, jit_making_arrays
from rigidimpulse.core.quaternion import multiply as quaternion_product
from rigidimpulse.core.quaternion import quaternion_from_rotation_vector
from rigidimpulse.core.vector import tangents
from rigidimpulse.model.contacts import Contacts
from rigidimpulse.motion.body_state import BodyState

FREE, BOUNDED, DISC, DISC_SECOND, SEGMENT = np.arange(5)
"""Kinds of rows."""
SLIP_PASSES = 3
POOR = 1e4
"""A residual that many times what was asked for is poor."""


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


class ContactRows(NamedTuple):
    """The rows of m contacts, which come first; rows of rolling friction and of joints follow them."""

    rows: Rows
    first_row: np.ndarray  # (m,) the normal row of each contact
    frames: np.ndarray  # (m, 3, 3) n, t1, t2


RowSolver = Callable[[Rows, int, float], float]
"""A solver of rows: (rows, number of movable bodies, residual asked for) -> residual."""


@jit_making_arrays
def make_rows(r):
    """Return r rows, all of them FREE and hard, with no impulse."""
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
def cholesky_3(a, c):
    """Lower factor c of a symmetric positive (3, 3)."""
    c[0, 0] = sqrt(a[0, 0])
    c[1, 0] = a[1, 0] / c[0, 0]
    c[1, 1] = sqrt(a[1, 1] - c[1, 0] * c[1, 0])
    c[2, 0] = a[2, 0] / c[0, 0]
    c[2, 1] = (a[2, 1] - c[2, 0] * c[1, 0]) / c[1, 1]
    c[2, 2] = sqrt(a[2, 2] - c[2, 0] * c[2, 0] - c[2, 1] * c[2, 1])
    c[0, 1] = c[0, 2] = c[1, 2] = 0.0


@jit_making_arrays
def write_body(bodies, i, line, direction, torque):
    """Write half a row, line (6,): a linear and an angular direction (tuples), scaled by the mass of body i."""
    (x, y, z), (tx, ty, tz) = direction, torque
    factor = np.empty((3, 3))
    cholesky_3(bodies.inv_inertia[i], factor)
    root = sqrt(bodies.inv_mass[i])
    line[0], line[1], line[2] = root * x, root * y, root * z
    for k in range(3):
        line[3 + k] = tx * factor[0, k] + ty * factor[1, k] + tz * factor[2, k]


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


def take_rows(rows: Rows, which: np.ndarray) -> Rows:
    """Copies of rows without masters."""
    return Rows(*(column[which] for column in rows))


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


@jit_making_arrays
def scaled_wrench(bodies, i, y, wrench):
    """Add C^-T y, the linear and angular impulse on body i that y = (Jh^T p)_i (6,) stands for, to wrench (6,)."""
    factor = np.empty((3, 3))
    root = sqrt(bodies.inv_mass[i])
    cholesky_3(bodies.inv_inertia[i], factor)
    # C^-T by back substitution: the angular part of C is a Cholesky factor.
    z = y[5] / factor[2, 2]
    x1 = (y[4] - factor[2, 1] * z) / factor[1, 1]
    x0 = (y[3] - factor[1, 0] * x1 - factor[2, 0] * z) / factor[0, 0]
    for k in range(3):
        wrench[k] += y[k] / root
    wrench[3] += x0
    wrench[4] += x1
    wrench[5] += z


@jit_making_arrays
def scaled_change(bodies, i, y, linear, angular):
    """C y of body i: the change of its velocity by impulses p with y = (Jh^T p)_i (6,), into linear and angular (3,)."""
    factor = np.empty((3, 3))
    root = sqrt(bodies.inv_mass[i])
    cholesky_3(bodies.inv_inertia[i], factor)
    for j in range(3):
        linear[j], angular[j] = root * y[j], 0.0
        for t in range(3):
            angular[j] += factor[j, t] * y[3 + t]


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


def move_bodies(bodies: BodyState, members: np.ndarray, rows: Rows) -> None:
    """Move bodies by what the rows' impulses make of a displacement (the metric of mass)."""
    change = changes_of(bodies, members, rows)
    bodies.position[members] += change[:, :3]
    turned = quaternion_from_rotation_vector(change[:, 3:])
    bodies.orientation[members] = quaternion_product(turned, bodies.orientation[members])


@jit_making_arrays
def response_to(rows, n, p):
    """W p (r,): the change of the rows' velocities by impulses p (r,)."""
    y, out = np.empty((n, 6)), np.empty(p.shape[0])
    multiply_transposed(rows, p, y)
    multiply(rows, y, out)
    return out


@jit_making_arrays
def let_slip(rows, n, first_row, dynamic_friction, slow):
    """Give contacts that slip faster than `slow` [m/s] their dynamic friction (m,); returns whether any had another one."""
    y, after = np.empty((n, 6)), np.empty(rows.bias.shape[0])
    multiply_transposed(rows, rows.impulse, y)
    multiply(rows, y, after)
    changed = False
    for c in range(first_row.shape[0]):
        i = first_row[c] + 1
        if rows_of(rows, first_row[c]) < 3 or rows.coefficient[i] == dynamic_friction[c]:
            continue
        # The velocity of the tangents after the impulses.
        if abs(rows.bias[i] + after[i]) + abs(rows.bias[i + 1] + after[i + 1]) > slow:
            rows.coefficient[i] = rows.coefficient[i + 1] = dynamic_friction[c]
            changed = True
    return changed


def solve_with_slip(
    solve: RowSolver, of_contacts: ContactRows, n: int, contacts: Contacts, slides: np.ndarray, target: float, slow: float
) -> float:
    """Solve rows that begin with those of contacts; contacts that slip, or come to slip, have dynamic friction.

    solve: a solver of rows, as `newton.solve_newton`; slides (m,) bool: contacts that slip from the start; target: residual
    asked for, m/s; slow: slip that is none, m/s. Returns the residual, m/s: inf where there is no finite answer, and then no impulse.
    """
    rows, first_row, _ = of_contacts
    rough = contacts.static_friction > 0.0
    disc = first_row[rough] + 1
    rows.coefficient[disc] = np.where(slides, contacts.dynamic_friction, contacts.static_friction)[rough]
    rows.coefficient[disc + 1] = rows.coefficient[disc]
    warm = bool(np.any(rows.impulse))
    residual = 0.0
    for _ in range(SLIP_PASSES):
        residual = solve(rows, n, target)
        if residual > POOR * target and warm:
            # A misleading start: once more from nothing.
            rows.impulse[:] = 0.0
            warm = False
        elif not let_slip(rows, n, first_row, contacts.dynamic_friction, slow):
            break
    if not np.all(np.isfinite(rows.impulse)):
        rows.impulse[:] = 0.0
        return np.inf
    return residual
