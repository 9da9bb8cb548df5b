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
from rigidimpulse.constrain.newton import solve_newton
from rigidimpulse.constrain.rows import (
    FREE,
    contact_rows,
    contact_velocity,
    count_contact_rows,
    impulse_along,
    make_rows,
    multiply,
    multiply_transposed,
    number_members,
    rows_of,
    write_row,
)
from rigidimpulse.geometry import CYLINDER, ROUND
from rigidimpulse.respond.impulse import apply_impulse, relative_velocity

CAPTURE_PASSES = 4
# Residual asked of the solver and slip that counts, relative to the speed gained in the sub-step.
SOLVE_TOLERANCE = 1e-12
SLIP = 1e-9
POOR = 1e-8
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
def _capture(bodies, contacts, subset, number, n, normal_velocity, pressed, scale):
    """Stop load-bearing contacts that leave slowly; True if any was stopped. pressed (m,) bool, normal_velocity (m,)."""
    loaded = np.flatnonzero(pressed)
    leaving = False
    for s in loaded:
        leaving = leaving or normal_velocity[s] > SOLVE_TOLERANCE * scale
    if not leaving:
        return False
    rows = make_rows(loaded.shape[0])
    for i in range(loaded.shape[0]):
        c = subset[loaded[i]]
        d = contacts.normal[c]
        a, b = contacts.body_a[c], contacts.body_b[c]
        write_row(bodies, number, a, b, contacts.arm_a[c], contacts.arm_b[c], d[0], d[1], d[2], rows, i)
        rows.kind[i], rows.bias[i] = FREE, normal_velocity[loaded[i]]
    solve_newton(rows, n, SOLVE_TOLERANCE * scale)
    for i in range(loaded.shape[0]):
        c = subset[loaded[i]]
        d, x = contacts.normal[c], rows.impulse[i]
        apply_impulse(bodies, contacts, c, x * d[0], x * d[1], x * d[2])
    return True


@jit
def solve_with_slip(rows, n, first_row, slides, contacts, subset, scale):
    """Impulses of the sub-step; contacts that slip, or come to slip, with dynamic friction. Returns the residual.

    slides (m,) bool: contacts that slip now.
    """
    count = rows.bias.shape[0]
    y, after = np.empty((n, 6)), np.empty(count)
    for s in range(first_row.shape[0]):
        i = first_row[s] + 1
        if rows_of(rows, first_row[s]) == 3:
            c = subset[s]
            mu = contacts.dynamic_friction[c] if slides[s] else contacts.static_friction[c]
            rows.coefficient[i] = rows.coefficient[i + 1] = mu
    residual = 0.0
    for attempt in range(3):
        residual = solve_newton(rows, n, SOLVE_TOLERANCE * scale)
        if residual > POOR * scale and attempt == 0:
            # A misleading start: once more from nothing.
            rows.impulse[:] = 0.0
            continue
        multiply_transposed(rows, rows.impulse, y)
        multiply(rows, y, after)
        changed = False
        for s in range(first_row.shape[0]):
            i = first_row[s] + 1
            if rows_of(rows, first_row[s]) < 3:
                continue
            slip = abs(rows.bias[i] + after[i]) + abs(rows.bias[i + 1] + after[i + 1])
            mu = contacts.dynamic_friction[subset[s]]
            if rows.coefficient[i] != mu and slip > SLIP * scale:
                rows.coefficient[i] = rows.coefficient[i + 1] = mu
                changed = True
        if not changed:
            break
    return residual


@jit
def start_contact_impulses(rows, first_row, force, h):
    """Impulses of the contact rows to start from, by the forces (m, 3) of last time."""
    for s in range(first_row.shape[0]):
        for k in range(rows_of(rows, first_row[s])):
            rows.impulse[first_row[s] + k] = force[s, k] * h


@jit
def fill_contact_bias(
    bodies, contacts, subset, frames, turning, acceleration, angular_acceleration, h, rows, first_row, slides
):
    """b = u + h a of the contact rows, and which contacts slip; returns the largest speed h a gained [m/s]."""
    m = subset.shape[0]
    u, a, scale = np.empty(3), np.empty((m, 3)), TINY
    for s in range(m):
        contact_velocity(contacts, subset[s], frames[s], acceleration, angular_acceleration, a[s])
        a[s, 0] += turning[s]
        for k in range(3):
            scale = max(scale, abs(a[s, k]) * h)
    for s in range(m):
        contact_velocity(contacts, subset[s], frames[s], bodies.velocity, bodies.angular_velocity, u)
        for k in range(rows_of(rows, first_row[s])):
            rows.bias[first_row[s] + k] = u[k] + h * a[s, k]
        slides[s] = abs(u[1]) + abs(u[2]) > SLIP * scale
    return scale


@jit
def hold_contacts(bodies, contacts, subset, turning, acceleration, angular_acceleration, h, number, force, wrench):
    """Contact forces of the sub-step for the contacts in subset (m,).

    turning (m,) from `turning_acceleration`; acceleration, angular_acceleration (n, 3) of the bodies without contacts;
    force (m, 3) in (n, t1, t2) [N], start and answer; wrench (n, 6) force and torque on the bodies, only rows of involved
    bodies are written.
    May change velocities (capture). Returns the residual relative to the speed gained in the sub-step.
    """
    m = subset.shape[0]
    n = number_members(bodies, contacts, subset, number).shape[0]
    rows = make_rows(count_contact_rows(contacts, subset))
    first_row, frames = np.empty(m, np.int64), np.empty((m, 3, 3))
    contact_rows(bodies, contacts, subset, number, rows, first_row, frames)
    slides, pressed, leaving, u = np.empty(m, np.bool_), np.empty(m, np.bool_), np.empty(m), np.empty(3)
    start_contact_impulses(rows, first_row, force, h)
    residual, scale = 0.0, 0.0
    for _ in range(CAPTURE_PASSES):
        scale = fill_contact_bias(
            bodies, contacts, subset, frames, turning, acceleration, angular_acceleration, h, rows, first_row, slides
        )
        residual = solve_with_slip(rows, n, first_row, slides, contacts, subset, scale)
        for s in range(m):
            pressed[s] = rows.impulse[first_row[s]] > 0.0
            leaving[s] = relative_velocity(bodies, contacts, subset[s], u)
        if not _capture(bodies, contacts, subset, number, n, leaving, pressed, scale):
            break
    for s in range(m):
        force[s] = 0.0
        for k in range(rows_of(rows, first_row[s])):
            force[s, k] = rows.impulse[first_row[s] + k] / h
    _write_wrench(contacts, subset, rows, first_row, frames, h, wrench)
    return residual / scale


@jit
def _write_wrench(contacts, subset, rows, first_row, frames, h, wrench):
    for c in range(contacts.gap.shape[0]):
        for k in range(6):
            wrench[contacts.body_a[c], k] = 0.0
            wrench[contacts.body_b[c], k] = 0.0
    f = np.empty(3)
    for s in range(subset.shape[0]):
        c = subset[s]
        impulse_along(rows, first_row[s], frames[s], f)
        for body, r, sign in ((contacts.body_a[c], contacts.arm_a[c], -1.0), (contacts.body_b[c], contacts.arm_b[c], 1.0)):
            for k in range(3):
                i, j = (k + 1) % 3, (k + 2) % 3
                wrench[body, k] += sign * f[k] / h
                wrench[body, 3 + k] += sign * (r[i] * f[j] - r[j] * f[i]) / h
