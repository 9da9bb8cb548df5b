"""Contacts that last: forces that hold touching bodies apart over a sub-step.

Over a sub-step of length h the contact forces f are constant. Row i of the contact has the velocity u_i + h a_i + W
p_i at the end, p = h f, with u the velocity now and a the acceleration the row would have without contact forces:

    a_n = n.(a_b + alpha_b x r_b + w_b x (w_b x r_b) - the same of a) - 2 n.(w_c x u) + |u_t|^2 / L

w x (w x r) is taken with the arm to the feature that moves with the body (the centre line of a rounded one); w_c is
the spin of the body that carries the normal; the last term, for two rounded bodies with centre lines L apart, is the
turning of the normal itself. The solver finds p >= 0 in Coulomb's cone so that no contact approaches at the end.
Positions follow x0 + v0 h + a h^2 / 2, so sliding and standing are exact.

A contact that carries load but leaves slowly (it would rise less than the gap it is held at) is captured first: its
normal velocity is set to zero in the metric of mass, which only dissipates; otherwise the force would do work on it
and it would hover for ever.
"""

import numpy as np

from rigidimpulse._jit import jit
from rigidimpulse.constrain.rolling import Rolling, add_rolling_wrench, count_rolling_rows, fill_rolling_rows
from rigidimpulse.constrain.rows import (
    FREE,
    Rows,
    change_velocities,
    contact_rows,
    contact_velocity,
    impulse_along,
    rows_of,
    solve_with_slip,
    take_rows,
)
from rigidimpulse.geometry import CYLINDER, ROUND

CAPTURE_PASSES = 4
# Residual asked of the solver and slip that counts, relative to the speed gained in the sub-step.
SOLVE_TOLERANCE = 1e-12
SLIP = 1e-9
TINY = 1e-300
# Which body carries the normal of a contact kind: vertex-face and face-vertex, half space; others share it.
CARRIER_B, CARRIER_A, SHARED = 0, 1, 2
# Cosine of normal and axis below which a cylinder lies on its side.
ON_ITS_SIDE = 0.7


@jit
def _cross_normal(w, r, n):
    """n.(w x (w x r))."""
    wr = w[0] * r[0] + w[1] * r[1] + w[2] * r[2]
    ww = w[0] * w[0] + w[1] * w[1] + w[2] * w[2]
    nr = n[0] * r[0] + n[1] * r[1] + n[2] * r[2]
    return (n[0] * w[0] + n[1] * w[1] + n[2] * w[2]) * wr - ww * nr


@jit
def _arm_velocity(bodies, i, r, out):
    v, w = bodies.velocity[i], bodies.angular_velocity[i]
    out[0] = v[0] + w[1] * r[2] - w[2] * r[1]
    out[1] = v[1] + w[2] * r[0] - w[0] * r[2]
    out[2] = v[2] + w[0] * r[1] - w[1] * r[0]


@jit
def turning_acceleration(bodies, contacts, c, carrier, rounding_a, rounding_b):
    """The part of a_n that comes from velocities alone [m/s2]."""
    n = contacts.normal[c]
    a, b = contacts.body_a[c], contacts.body_b[c]
    wa, wb = bodies.angular_velocity[a], bodies.angular_velocity[b]
    ra, rb, va, vb = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    both = rounding_a > 0.0 and rounding_b > 0.0
    for k in range(3):
        # To the feature that moves with its body: a centre line, or the point of a flat partner that lies there now.
        ra[k] = contacts.arm_a[c, k] - rounding_a * n[k] + (0.0 if both else rounding_b * n[k])
        rb[k] = contacts.arm_b[c, k] + rounding_b * n[k] - (0.0 if both else rounding_a * n[k])
    _arm_velocity(bodies, a, ra, va)
    _arm_velocity(bodies, b, rb, vb)
    x, y, z = vb[0] - va[0], vb[1] - va[1], vb[2] - va[2]
    total = _cross_normal(wb, rb, n) - _cross_normal(wa, ra, n)
    if both:
        normal = x * n[0] + y * n[1] + z * n[2]
        return total + max(x * x + y * y + z * z - normal * normal, 0.0) / (rounding_a + rounding_b)
    s = 1.0 if carrier == CARRIER_A else (0.0 if carrier == CARRIER_B else 0.5)
    cx = s * wa[0] + (1.0 - s) * wb[0]
    cy = s * wa[1] + (1.0 - s) * wb[1]
    cz = s * wa[2] + (1.0 - s) * wb[2]
    return total - 2.0 * (n[0] * (cy * z - cz * y) + n[1] * (cz * x - cx * z) + n[2] * (cx * y - cy * x))


@jit
def _rounding(geometry, shape, rotation, normal):
    """Radius of the rounded surface that a body of one primitive meets a contact with; 0 for flat ones."""
    p = geometry.shape_first[shape]
    if geometry.shape_first[shape + 1] - p != 1:
        return 0.0
    if geometry.kind[p] == CYLINDER:
        along = 0.0
        for k in range(3):
            for i in range(3):
                along += normal[k] * rotation[k, i] * geometry.frame[p, 3 + i]
        return geometry.radius[p] if abs(along) < ON_ITS_SIDE else 0.0
    return geometry.radius[p] if geometry.kind[p] == ROUND else 0.0


@jit
def turning_of(geometry, shape_of_body, rotation, bodies, contacts, carrier):
    """`turning_acceleration` of all contacts, (m,); carrier (m,)."""
    out = np.empty(carrier.shape[0])
    for c in range(carrier.shape[0]):
        a, b = contacts.body_a[c], contacts.body_b[c]
        rounding_a = _rounding(geometry, shape_of_body[a], rotation[a], contacts.normal[c])
        rounding_b = _rounding(geometry, shape_of_body[b], rotation[b], contacts.normal[c])
        out[c] = turning_acceleration(bodies, contacts, c, carrier[c], rounding_a, rounding_b)
    return out


@jit
def start_contact_impulses(rows, first_row, force, h):
    """Impulses of the contact rows to start from, by the forces (m, 3) of last time."""
    for c in range(first_row.shape[0]):
        for k in range(rows_of(rows, first_row[c])):
            rows.impulse[first_row[c] + k] = force[c, k] * h


@jit
def fill_contact_bias(bodies, contacts, frames, turning, acceleration, angular_acceleration, h, rows, first_row):
    """b = u + h a of the contact rows; returns the largest speed h a gained [m/s], u.n (m,) and which contacts slip (m,)."""
    m = first_row.shape[0]
    u, a, scale = np.empty(3), np.empty((m, 3)), TINY
    leaving, slides = np.empty(m), np.empty(m, np.bool_)
    for c in range(m):
        contact_velocity(contacts, c, frames[c], acceleration, angular_acceleration, a[c])
        a[c, 0] += turning[c]
        for k in range(3):
            scale = max(scale, abs(a[c, k]) * h)
    for c in range(m):
        contact_velocity(contacts, c, frames[c], bodies.velocity, bodies.angular_velocity, u)
        for k in range(rows_of(rows, first_row[c])):
            rows.bias[first_row[c] + k] = u[k] + h * a[c, k]
        leaving[c] = u[0]
        slides[c] = abs(u[1]) + abs(u[2]) > SLIP * scale
    return scale, leaving, slides


def hold_contacts(
    solve, bodies, contacts, members, turning, acceleration, angular_acceleration, h: float, number, force, wrench,
    rolling: Rolling | None = None,
) -> float:
    """Contact forces of the sub-step for m contacts.

    solve: a solver of rows; members: movable bodies of the group; turning (m,) from `turning_acceleration`; acceleration,
    angular_acceleration (n, 3) of the bodies without contacts; force (m, 3) in (n, t1, t2) [N], start and answer; wrench (n, 6):
    force and torque on the members are added; rolling: their rolling friction, if any. May change velocities (capture).
    Returns the residual relative to the speed gained in the sub-step.
    """
    extra = count_rolling_rows(rolling)
    rows, first_row, frames = contact_rows(bodies, contacts, members, number, extra)
    start = len(rows.bias) - extra
    start_contact_impulses(rows, first_row, force, h)
    n, residual, scale = len(members), 0.0, 1.0
    for _ in range(CAPTURE_PASSES):
        scale, leaving, slides = fill_contact_bias(
            bodies, contacts, frames, turning, acceleration, angular_acceleration, h, rows, first_row
        )
        if rolling is not None:
            fill_rolling_rows(
                bodies, contacts, rolling, number, acceleration, angular_acceleration, frames, first_row, h, rows, start
            )
        target = SOLVE_TOLERANCE * scale
        residual = solve_with_slip(solve, rows, n, first_row, contacts, slides, target, SLIP * scale)
        loaded = np.flatnonzero(rows.impulse[first_row] > 0.0)
        if not np.any(leaving[loaded] > target):
            break
        capture(solve, bodies, members, rows, first_row[loaded], leaving[loaded], target)
    add_contact_wrench(contacts, rows, first_row, frames, h, force, wrench)
    if rolling is not None:
        add_rolling_wrench(contacts, rolling, rows, frames, h, start, wrench)
    return residual / scale


def capture(solve, bodies, members, rows: Rows, normals: np.ndarray, leaving: np.ndarray, target: float) -> None:
    """Stop load-bearing contacts that leave slowly; normals: their rows, leaving: their u.n [m/s]."""
    stops = take_rows(rows, normals)
    stops.kind[:], stops.bias[:], stops.impulse[:] = FREE, leaving, 0.0
    stops.lower[:] = -np.inf
    solve(stops, len(members), target)
    change_velocities(bodies, members, stops)


@jit
def add_contact_wrench(contacts, rows, first_row, frames, h, force, wrench):
    """The rows' impulses over h as forces (m, 3), and their sum on both bodies of each contact, added to wrench."""
    f = np.empty(3)
    for c in range(first_row.shape[0]):
        force[c] = 0.0
        for k in range(rows_of(rows, first_row[c])):
            force[c, k] = rows.impulse[first_row[c] + k] / h
        impulse_along(rows, first_row[c], frames[c], f)
        for body, r, sign in ((contacts.body_a[c], contacts.arm_a[c], -1.0), (contacts.body_b[c], contacts.arm_b[c], 1.0)):
            for k in range(3):
                i, j = (k + 1) % 3, (k + 2) % 3
                wrench[body, k] += sign * f[k] / h
                wrench[body, 3 + k] += sign * (r[i] * f[j] - r[j] * f[i]) / h
