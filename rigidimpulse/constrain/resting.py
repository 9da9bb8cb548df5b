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
from rigidimpulse.constrain.newton import multiply, multiply_transposed, solve_cone, solve_linear
from rigidimpulse.constrain.rows import contact_rows, number_columns, row_velocity
from rigidimpulse.geometry import CYLINDER, ROUND
from rigidimpulse.respond.impulse import apply_impulse

CAPTURE_PASSES = 4
# Residual asked of the solver and slip that counts, relative to the speed gained in the sub-step.
SOLVE_TOLERANCE = 1e-12
SLIP = 1e-9
POOR = 1e-8
BILATERAL_REGULARISATION = 1e-13
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
def _capture(bodies, contacts, subset, jacobian, u, p, scale):
    """Stop load-bearing contacts that leave slowly; True if any was stopped."""
    m = subset.shape[0]
    width = jacobian.shape[1]
    loaded = np.empty(m, np.int64)
    count = 0
    leaving = False
    for s in range(m):
        if p[3 * s] > 0.0:
            loaded[count] = s
            count += 1
            leaving = leaving or u[3 * s] > SOLVE_TOLERANCE * scale
    if not leaving:
        return False
    w = np.empty((count, count))
    x = np.empty(count)
    trace = 0.0
    for i in range(count):
        x[i] = -u[3 * loaded[i]]
        for j in range(count):
            total = 0.0
            for k in range(width):
                total += jacobian[3 * loaded[i], k] * jacobian[3 * loaded[j], k]
            w[i, j] = total
        trace += w[i, i]
    for i in range(count):
        w[i, i] += BILATERAL_REGULARISATION * trace
    solve_linear(w, x)
    for i in range(count):
        c = subset[loaded[i]]
        n = contacts.normal[c]
        apply_impulse(bodies, contacts, c, x[i] * n[0], x[i] * n[1], x[i] * n[2])
    return True


@jit
def _solve(jacobian, u, a, h, contacts, subset, scale, p):
    """Impulses of the sub-step; contacts that slip, or come to slip, with dynamic friction. Returns the residual."""
    m = subset.shape[0]
    b = np.empty(3 * m)
    mu = np.empty(m)
    y = np.empty(jacobian.shape[1])
    after = np.empty(3 * m)
    for i in range(3 * m):
        b[i] = u[i] + h * a[i]
    for s in range(m):
        c = subset[s]
        slips = abs(u[3 * s + 1]) + abs(u[3 * s + 2]) > SLIP * scale
        mu[s] = contacts.dynamic_friction[c] if slips else contacts.static_friction[c]
    residual = 0.0
    for attempt in range(3):
        residual = solve_cone(jacobian, b, mu, p, SOLVE_TOLERANCE * scale)
        if residual > POOR * scale and attempt == 0:
            # A misleading start: once more from nothing.
            for i in range(3 * m):
                p[i] = 0.0
            continue
        multiply_transposed(jacobian, p, y)
        multiply(jacobian, y, after)
        changed = False
        for s in range(m):
            slip = abs(b[3 * s + 1] + after[3 * s + 1]) + abs(b[3 * s + 2] + after[3 * s + 2])
            if mu[s] != contacts.dynamic_friction[subset[s]] and slip > SLIP * scale:
                mu[s] = contacts.dynamic_friction[subset[s]]
                changed = True
        if not changed:
            break
    return residual


@jit
def hold_contacts(bodies, contacts, subset, turning, acceleration, angular_acceleration, h, column, force, wrench):
    """Contact forces of the sub-step for the contacts in subset (m,).

    turning (m,) from `turning_acceleration`; acceleration, angular_acceleration (n, 3) of the bodies without contacts;
    force (m, 3) in (n, t1, t2) [N], start and answer; wrench (n, 6) force and torque on the bodies, only rows of involved
    bodies are written.
    May change velocities (capture). Returns the residual relative to the speed gained in the sub-step.
    """
    m = subset.shape[0]
    members = number_columns(bodies, contacts, column)
    width = 6 * members.shape[0]
    jacobian = np.empty((3 * m, width))
    frames = np.empty((m, 3, 3))
    contact_rows(bodies, contacts, subset, column, width, jacobian, frames)
    u, a, p = np.empty(3 * m), np.empty(3 * m), np.empty(3 * m)
    row_velocity(contacts, subset, frames, acceleration, angular_acceleration, a)
    scale = 1e-300
    for s in range(m):
        a[3 * s] += turning[s]
        for k in range(3):
            p[3 * s + k] = force[s, k] * h
            scale = max(scale, abs(a[3 * s + k]) * h)
    residual = 0.0
    for _ in range(CAPTURE_PASSES):
        row_velocity(contacts, subset, frames, bodies.velocity, bodies.angular_velocity, u)
        residual = _solve(jacobian, u, a, h, contacts, subset, scale, p)
        if not _capture(bodies, contacts, subset, jacobian, u, p, scale):
            break
    _write_wrench(contacts, subset, frames, p, h, force, wrench)
    return residual / scale


@jit
def _write_wrench(contacts, subset, frames, p, h, force, wrench):
    for c in range(contacts.gap.shape[0]):
        for k in range(6):
            wrench[contacts.body_a[c], k] = 0.0
            wrench[contacts.body_b[c], k] = 0.0
    for s in range(subset.shape[0]):
        c = subset[s]
        f = np.zeros(3)
        for k in range(3):
            force[s, k] = p[3 * s + k] / h
            for i in range(3):
                f[i] += force[s, k] * frames[s, k, i]
        for body, r, sign in ((contacts.body_a[c], contacts.arm_a[c], -1.0), (contacts.body_b[c], contacts.arm_b[c], 1.0)):
            for k in range(3):
                i, j = (k + 1) % 3, (k + 2) % 3
                wrench[body, k] += sign * f[k]
                wrench[body, 3 + k] += sign * (r[i] * f[j] - r[j] * f[i])
