"""How contacts move: the point where bodies touch wanders over them, and the normal turns.

With r_a, r_b the arms of a contact, n its normal from a to b and u = v_b + w_b x r_b - v_a - w_a x r_a, the relative
velocity at the place of contact changes, at constant v and w, by

    du/dt = w_b x r_b' - w_a x r_a',        d(u.n)/dt = n.du/dt + u.n'

(' is the time derivative; u.n is the rate of the gap, as the place of contact is where the gap is least). The place of
contact moves with velocity p' in the world, and r_a' = p' - v_a, r_b' = p' - v_b:

    vertex of b on a face of a      n' = w_a x n,  r_b' = w_b x r_b
    ball (radius R) of b            the same for its centre:  r_b' = w_b x (r_b + R n) - R n'
    balls of both                   n' = the velocity of the centres across n over R_a + R_b
    cylinder b (radius R, axis k)   on a face of a: r_b = c - R e, e = (n - z k) / s, z = n.k, s^2 = 1 - z^2;  r_b' = w_b x c - R e'
    edges                           half of both

and mirrored. The rates |r'| / |r| and |n'| say how long a force along these arms stays right.
"""

from math import sqrt
from typing import NamedTuple

import numpy as np

from rigidimpulse._jit import jit
from rigidimpulse.detect.features import FACE_VERTEX, VERTEX_FACE
from rigidimpulse.geometry import CYLINDER, HALF_SPACE, ROUND

# The point of a round cylinder that is nearest to a face is the one found, or one found a moment ago: it is that near to it,
# relative to the radius. Where normal and axis are nearer than this sine there is none.
NEAR = 0.3
LEAST_LEAN = 1e-3
# Cosine of normal and axis below which a cylinder that is not touched at a rim is touched at its side.
ON_ITS_SIDE = 0.7


@jit
def _cross(a, b, out):
    """out = a x b."""
    out[0] = a[1] * b[2] - a[2] * b[1]
    out[1] = a[2] * b[0] - a[0] * b[2]
    out[2] = a[0] * b[1] - a[1] * b[0]


@jit
def _dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@jit
def _rotated(rotation, x, out):
    for i in range(3):
        out[i] = rotation[i, 0] * x[0] + rotation[i, 1] * x[1] + rotation[i, 2] * x[2]


@jit
def _radius(geometry, p, rotation, normal):
    """Radius of the rounded surface of a body with the single primitive p (-1: several); 0 for flat ones."""
    if p < 0 or geometry.kind[p] == HALF_SPACE:
        return 0.0
    if geometry.kind[p] == CYLINDER:
        k = np.empty(3)
        _rotated(rotation, geometry.frame[p, 3:6], k)
        return geometry.radius[p] if abs(_dot(normal, k)) < ON_ITS_SIDE else 0.0
    return geometry.radius[p] if geometry.kind[p] == ROUND else 0.0


@jit
def _single(geometry, shape):
    """The only primitive of a shape, or -1."""
    p = geometry.shape_first[shape]
    return p if geometry.shape_first[shape + 1] == p + 1 else -1


@jit
def _rim_velocity(geometry, p, rotation, arm, outward, outward_rate, w, out):
    """r' of a point of a round cylinder, at a rim or on its side, into out. False where it is touched elsewhere.

    arm (3,): from the centre of mass; outward (3,): from the partner to the body.
    """
    k, centre = np.empty(3), np.empty(3)
    _rotated(rotation, geometry.frame[p, 3:6], k)
    _rotated(rotation, geometry.frame[p, 0:3], centre)
    radius, along = geometry.radius[p], 0.0
    for i in range(3):
        along += (arm[i] - centre[i]) * k[i]
    z = _dot(outward, k)
    s2 = 1.0 - z * z
    if s2 < LEAST_LEAN * LEAST_LEAN:
        return False
    s, off = sqrt(s2), 0.0
    c = centre
    for i in range(3):
        c[i] += along * k[i]
        off += (arm[i] - c[i] + radius * (outward[i] - z * k[i]) / s) ** 2
    if off > (NEAR * radius) ** 2:
        return False
    k_rate = np.empty(3)
    _cross(w, k, k_rate)
    _cross(w, c, out)
    z_rate = _dot(outward_rate, k) + _dot(outward, k_rate)
    for i in range(3):
        e_rate = (outward_rate[i] - z_rate * k[i] - z * k_rate[i]) / s + (outward[i] - z * k[i]) * z * z_rate / (s * s2)
        out[i] -= radius * e_rate
    return True


@jit
def _centre_velocity(bodies, i, arm, n, radius, out):
    """Velocity of the point of body i at arm + radius n, into out."""
    w, v = bodies.angular_velocity[i], bodies.velocity[i]
    x, y, z = arm[0] + radius * n[0], arm[1] + radius * n[1], arm[2] + radius * n[2]
    out[0] = v[0] + w[1] * z - w[2] * y
    out[1] = v[1] + w[2] * x - w[0] * z
    out[2] = v[2] + w[0] * y - w[1] * x


@jit
def _place_velocity(geometry, shape_of_body, rotation, bodies, contacts, c, kind, place, normal_rate):
    """p' and n' of contact c, into place and normal_rate."""
    a, b, n = contacts.body_a[c], contacts.body_b[c], contacts.normal[c]
    pa, pb = _single(geometry, shape_of_body[a]), _single(geometry, shape_of_body[b])
    ra, rb = _radius(geometry, pa, rotation[a], n), _radius(geometry, pb, rotation[b], n)
    flat_a = pa >= 0 and geometry.kind[pa] == HALF_SPACE
    flat_b = pb >= 0 and geometry.kind[pb] == HALF_SPACE
    va, vb = np.empty(3), np.empty(3)
    _centre_velocity(bodies, a, contacts.arm_a[c], n, -ra, va)
    _centre_velocity(bodies, b, contacts.arm_b[c], n, rb, vb)
    if ra > 0.0 and rb > 0.0 and not flat_a and not flat_b:
        across = (vb[0] - va[0]) * n[0] + (vb[1] - va[1]) * n[1] + (vb[2] - va[2]) * n[2]
        for k in range(3):
            normal_rate[k] = (vb[k] - va[k] - across * n[k]) / (ra + rb)
            place[k] = vb[k] - rb * normal_rate[k]
        return
    on_a = flat_a or (rb > 0.0 and ra == 0.0) or (kind == FACE_VERTEX and ra == 0.0)
    on_b = flat_b or (ra > 0.0 and rb == 0.0) or (kind == VERTEX_FACE and rb == 0.0)
    turn = np.empty(3)
    if on_a:
        _cross(bodies.angular_velocity[a], n, normal_rate)
        if pb >= 0 and geometry.kind[pb] == CYLINDER:
            if _rim_velocity(geometry, pb, rotation[b], contacts.arm_b[c], n, normal_rate, bodies.angular_velocity[b], place):
                for k in range(3):
                    place[k] += bodies.velocity[b, k]
                return
        for k in range(3):
            place[k] = vb[k] - rb * normal_rate[k]
    elif on_b:
        _cross(bodies.angular_velocity[b], n, normal_rate)
        if pa >= 0 and geometry.kind[pa] == CYLINDER:
            if _rim_velocity(geometry, pa, rotation[a], contacts.arm_a[c], -n, -normal_rate, bodies.angular_velocity[a], place):
                for k in range(3):
                    place[k] += bodies.velocity[a, k]
                return
        for k in range(3):
            place[k] = va[k] + ra * normal_rate[k]
    else:
        _cross(0.5 * (bodies.angular_velocity[a] + bodies.angular_velocity[b]), n, turn)
        for k in range(3):
            normal_rate[k] = turn[k]
            place[k] = 0.5 * (va[k] + vb[k])


class Motion(NamedTuple):
    """How m contacts move."""

    turning: np.ndarray
    """(m, 3) m/s2: du/dt across the normal and d(u.n)/dt along it, at constant velocities"""
    arm_rate_a: np.ndarray  # (m, 3) m/s
    arm_rate_b: np.ndarray
    normal_rate: np.ndarray  # (m, 3) 1/s
    fastest: float
    """rad/s, at which the fastest arm or normal turns"""


@jit
def contact_motion(geometry, shape_of_body, rotation, bodies, contacts, kinds):
    """The `Motion` of m contacts; kinds (m,) as `detect.features` has them."""
    m = contacts.gap.shape[0]
    turning, fastest = np.zeros((m, 3)), 0.0
    rate_a, rate_b, normal_rate = np.empty((m, 3)), np.empty((m, 3)), np.empty((m, 3))
    place, u, x = np.empty(3), np.empty(3), np.empty(3)
    for c in range(m):
        n = contacts.normal[c]
        _place_velocity(geometry, shape_of_body, rotation, bodies, contacts, c, kinds[c], place, normal_rate[c])
        u[:] = 0.0
        for side in range(2):
            i = contacts.body_b[c] if side else contacts.body_a[c]
            r = contacts.arm_b[c] if side else contacts.arm_a[c]
            arm_rate = rate_b[c] if side else rate_a[c]
            sign, w = 2.0 * side - 1.0, bodies.angular_velocity[i]
            for k in range(3):
                arm_rate[k] = place[k] - bodies.velocity[i, k]
            _cross(w, arm_rate, x)
            for k in range(3):
                turning[c, k] += sign * x[k]
            _cross(w, r, x)
            for k in range(3):
                u[k] += sign * (bodies.velocity[i, k] + x[k])
            if bodies.inv_mass[i] > 0.0:
                fastest = max(fastest, sqrt(_dot(arm_rate, arm_rate) / max(_dot(r, r), 1e-300)))
        along = _dot(u, normal_rate[c])
        for k in range(3):
            turning[c, k] += along * n[k]
        fastest = max(fastest, sqrt(_dot(normal_rate[c], normal_rate[c])))
    return Motion(turning, rate_a, rate_b, normal_rate, fastest)
