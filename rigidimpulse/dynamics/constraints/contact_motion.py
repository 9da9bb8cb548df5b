"""How contacts move: the point of contact moves over the bodies, and the normal turns.

With r_a, r_b the arms of a contact, n its normal from a to b and u = v_b + w_b x r_b - v_a - w_a x r_a, the relative
velocity at the place of contact changes, at constant v and w, by

    du/dt = w_b x r_b' - w_a x r_a',        d(u.n)/dt = n.du/dt + u.n'

(' is the time derivative; u.n is the rate of the gap, as the place of contact is where the gap is least). The place of
contact moves with velocity p' in the world, and r_a' = p' - v_a, r_b' = p' - v_b:

    vertex of b on a face of a      n' = w_a x n,  r_b' = w_b x r_b
    ball (radius R) of b            the same for its centre:  r_b' = w_b x (r_b + R n) - R n'
    balls of both                   n' = the velocity of the centres across n over R_a + R_b
    ball on an edge (direction e)   the same across e;  n'.e = -n.(w x e), as n stays across the edge
    edges that cross                n'.e_a = -n.(w_a x e_a),  n'.e_b = -n.(w_b x e_b); the place runs along both
    cylinder b (radius R, axis k)   on a face of a: r_b = c - R e, e = (n - z k) / s, z = n.k, s^2 = 1 - z^2;  r_b' = w_b x c - R e'

and mirrored. The rates |r'| / |r| and |n'| say how long a force along these arms stays right.
"""

from math import sqrt
from typing import NamedTuple

import numpy as np

from rigidimpulse.collision.distance.simplices import CORNER, EDGE_EDGE, FACE_VERTEX, HALF_SPACE_CONTACT, VERTEX_FACE
from rigidimpulse.collision.geometry import CYLINDER, HALF_SPACE
from rigidimpulse.collision.manifold.rounding import only_primitive
from rigidimpulse.core.kernels import jit, jit_making_arrays
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.core.vector import cross, dot, length, scaled, subtract, turned

# The point of a round cylinder that is nearest to a face is the one found, or one found a moment ago: it is that near to it,
# relative to the radius. Where normal and axis are nearer than this sine there is none.
NEAR = 0.3
LEAST_LEAN = TOLERANCES.contact_forces.cylinder_lean
# Sine of the angle of two edges below which they count as parallel: the place of contact would run along them too fast to follow.
PARALLEL = 0.05
# Cosine of normal and axis of a cylinder, or one less it, that is none.
ALIGNED = TOLERANCES.contact_forces.aligned
POINT, LINE, FACE, UNKNOWN = np.arange(4)


@jit
def _cross(a, b, out):
    """out = a x b."""
    out[0] = a[1] * b[2] - a[2] * b[1]
    out[1] = a[2] * b[0] - a[0] * b[2]
    out[2] = a[0] * b[1] - a[1] * b[0]


@jit
def _rotated(rotation, x, out):
    for i in range(3):
        out[i] = rotation[i, 0] * x[0] + rotation[i, 1] * x[1] + rotation[i, 2] * x[2]


@jit
def _owner(first, index):
    """Place of the range of `first` that an index lies in."""
    low, high = 0, first.shape[0] - 1
    while high - low > 1:
        middle = (low + high) // 2
        if first[middle] <= index:
            low = middle
        else:
            high = middle
    return low


@jit
def _edge_direction(geometry, edge, rotation, direction):
    """Unit direction (3,) of an edge in the world."""
    d = subtract(geometry.vertex[geometry.edge[edge, 1]], geometry.vertex[geometry.edge[edge, 0]])
    size = length(d)
    _rotated(rotation, d, direction)
    for k in range(3):
        direction[k] /= size


@jit
def _cylinder_skeleton(geometry, p, rotation, normal, direction):
    """A cylinder is a face at its caps, a line with its radius at its side, and at its rims the line along them."""
    axis = turned(rotation, geometry.frame[p, 3:6])
    along = dot(normal, axis)
    if 1.0 - abs(along) < ALIGNED:
        return 0.0, FACE
    if abs(along) < ALIGNED:
        direction[0], direction[1], direction[2] = axis
        return geometry.radius[p], LINE
    _cross(axis, normal, direction)
    size = sqrt(dot(direction, direction))
    for k in range(3):
        direction[k] /= size
    return 0.0, LINE


@jit
def _skeleton_of(geometry, p, kind, feature, is_a, rotation, normal, direction):
    """What a body (of the single primitive p, or -1) is at a contact: its radius, and POINT, LINE (unit direction (3,)) or FACE.

    UNKNOWN where a pair was stopped by its sweep alone, and for cylinders that are parts of a body.
    """
    if feature < 0 or (kind > HALF_SPACE_CONTACT and p < 0):
        return 0.0, UNKNOWN
    if kind > HALF_SPACE_CONTACT:
        if geometry.kind[p] == CYLINDER:
            return _cylinder_skeleton(geometry, p, rotation, normal, direction)
        which, feature = feature % 3, feature // 3
        if geometry.radius[p] > 0.0:
            return geometry.radius[p], POINT
        point, line = which == 0, which == 1
    else:
        point = kind == HALF_SPACE_CONTACT or (kind == VERTEX_FACE and is_a) or (kind == FACE_VERTEX and not is_a)
        line = kind == EDGE_EDGE
        if kind == CORNER:
            point, line = feature % 2 == 0, feature % 2 == 1
            feature = feature // 2
    if point:
        return geometry.radius[_owner(geometry.vertex_first, feature)], POINT
    if not line:
        return geometry.radius[_owner(geometry.triangle_first, feature)], FACE
    # What is left is an edge: its direction in the world is needed for n'.e = -n.(w x e).
    _edge_direction(geometry, feature, rotation, direction)
    return geometry.radius[_owner(geometry.edge_first, feature)], LINE


@jit
def _rim_velocity(geometry, p, rotation, arm, outward, outward_rate, w, out):
    """r' of a point of a round cylinder, at a rim or on its side, into out. False where it is touched elsewhere.

    arm (3,): from the centre of mass; outward (3,): from the partner to the body.
    """
    k, centre = turned(rotation, geometry.frame[p, 3:6]), turned(rotation, geometry.frame[p, 0:3])
    radius, along = geometry.radius[p], 0.0
    for i in range(3):
        along += (arm[i] - centre[i]) * k[i]
    z = dot(outward, k)
    s2 = 1.0 - z * z
    # With the normal along the axis a whole cap touches, and no single point of the rim.
    if s2 < LEAST_LEAN * LEAST_LEAN:
        return False
    s, off = sqrt(s2), 0.0
    c = centre[0] + along * k[0], centre[1] + along * k[1], centre[2] + along * k[2]
    for i in range(3):
        off += (arm[i] - c[i] + radius * (outward[i] - z * k[i]) / s) ** 2
    # The contact found must be the point of the rim that the formula describes.
    if off > (NEAR * radius) ** 2:
        return False
    k_rate = cross(w, k)
    _cross(w, c, out)
    z_rate = dot(outward_rate, k) + dot(outward, k_rate)
    for i in range(3):
        # Derivative of e = (n - z k) / s.
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


class Side(NamedTuple):
    """What a body is at a contact: its rounded shape's skeleton there."""

    skeleton: np.int64  # POINT, LINE, FACE or UNKNOWN
    radius: float  # m, of the rounding
    velocity: np.ndarray  # (3,) m/s, of the place of the skeleton
    spin: np.ndarray  # (3,) rad/s
    direction: np.ndarray  # (3,) unit, of a LINE


@jit
def _on_face(geometry, p, rotation, body_velocity, side, arm, out, place):
    """p' of the place where a body (of the single primitive p, or -1) is in contact with a face that carries the normal.

    side: the body's `Side`; out: direction (3,) from the face to the body, and its rate (3,).
    """
    outward, outward_rate = out
    if p >= 0 and geometry.kind[p] == CYLINDER:
        if _rim_velocity(geometry, p, rotation, arm, outward, outward_rate, side.spin, place):
            for k in range(3):
                place[k] += body_velocity[k]
            return
    for k in range(3):
        place[k] = side.velocity[k] - side.radius * outward_rate[k]


@jit
def _between_lines(first, second, n, distance, place, normal_rate):
    """Two crossing lines: n' turns with both, and their crossing runs along both. False if they are parallel."""
    va, wa, ea, ra = first.velocity, first.spin, first.direction, first.radius
    vb, wb, eb = second.velocity, second.spin, second.direction
    cosine = dot(ea, eb)
    determinant = 1.0 - cosine * cosine
    if determinant < PARALLEL * PARALLEL:
        return False
    ca, cb = -dot(n, cross(wa, ea)), -dot(n, cross(wb, eb))
    alpha, beta = (ca - cosine * cb) / determinant, (cb - cosine * ca) / determinant
    across = dot(vb, n) - dot(va, n)
    for k in range(3):
        normal_rate[k] = alpha * ea[k] + beta * eb[k]
    # The part of the relative velocity of the lines' points that they have to run for.
    x = subtract(subtract(subtract(vb, va), scaled(n, across)), scaled(normal_rate, distance))
    run = (dot(x, ea) - cosine * dot(x, eb)) / determinant
    for k in range(3):
        place[k] = va[k] + run * ea[k] + ra * normal_rate[k]
    return True


@jit
def _between_skeletons(first, second, n, distance, place, normal_rate):
    """Points and lines with a rounding."""
    va, wa, ea, ra, skeleton_a = first.velocity, first.spin, first.direction, first.radius, first.skeleton
    vb, wb, eb, rb, skeleton_b = second.velocity, second.spin, second.direction, second.radius, second.skeleton
    if skeleton_a == LINE and skeleton_b == LINE and _between_lines(first, second, n, distance, place, normal_rate):
        return
    across = dot(vb, n) - dot(va, n)
    for k in range(3):
        # Two points: n turns with the part of their relative velocity across it.
        normal_rate[k] = (vb[k] - va[k] - across * n[k]) / distance
    if skeleton_a == LINE or skeleton_b == LINE:
        e, w = (ea, wa) if skeleton_a == LINE else (eb, wb)
        # A line stays across n: n'.e = -n.(w x e).
        change = -dot(n, cross(w, e)) - dot(normal_rate, e)
        for k in range(3):
            normal_rate[k] += change * e[k]
    for k in range(3):
        place[k] = va[k] + ra * normal_rate[k] if skeleton_a == POINT else vb[k] - rb * normal_rate[k]


@jit
def _place_velocity(geometry, primitives, rotation, bodies, contacts, c, features, memory):
    """p' and n' of contact c, into the first two rows of memory (8, 3); features: kind, and the features of both bodies."""
    (pa, pb), (kind, feature_a, feature_b), place, normal_rate = primitives, features, memory[0], memory[1]
    a, b, n = contacts.body_a[c], contacts.body_b[c], contacts.normal[c]
    ea, eb, va, vb, outward, outward_rate = memory[2], memory[3], memory[4], memory[5], memory[6], memory[7]
    flat_a = pa >= 0 and geometry.kind[pa] == HALF_SPACE
    flat_b = pb >= 0 and geometry.kind[pb] == HALF_SPACE
    ra, skeleton_a = (0.0, FACE) if flat_a else _skeleton_of(geometry, pa, kind, feature_a, True, rotation[a], n, ea)
    rb, skeleton_b = (0.0, FACE) if flat_b else _skeleton_of(geometry, pb, kind, feature_b, False, rotation[b], n, eb)
    _centre_velocity(bodies, a, contacts.arm_a[c], n, -ra, va)
    _centre_velocity(bodies, b, contacts.arm_b[c], n, rb, vb)
    distance = ra + rb + contacts.gap[c]
    first = Side(skeleton_a, ra, va, bodies.angular_velocity[a], ea)
    second = Side(skeleton_b, rb, vb, bodies.angular_velocity[b], eb)
    if skeleton_a == FACE:
        _cross(bodies.angular_velocity[a], n, normal_rate)
        _on_face(geometry, pb, rotation[b], bodies.velocity[b], second, contacts.arm_b[c], (n, normal_rate), place)
    elif skeleton_b == FACE:
        _cross(bodies.angular_velocity[b], n, normal_rate)
        for k in range(3):
            outward[k], outward_rate[k] = -n[k], -normal_rate[k]
        _on_face(geometry, pa, rotation[a], bodies.velocity[a], first, contacts.arm_a[c], (outward, outward_rate), place)
    elif ra + rb > 0.0 and skeleton_a != UNKNOWN and skeleton_b != UNKNOWN:
        _between_skeletons(first, second, n, distance, place, normal_rate)
    elif not (skeleton_a == LINE and skeleton_b == LINE and _between_lines(first, second, n, distance, place, normal_rate)):
        # Sharp corners: half of both.
        for k in range(3):
            place[k] = 0.5 * (va[k] + vb[k])
            outward_rate[k] = 0.5 * (bodies.angular_velocity[a, k] + bodies.angular_velocity[b, k])
        _cross(outward_rate, n, normal_rate)


class Motion(NamedTuple):
    """How m contacts move."""

    turning: np.ndarray
    """(m, 3) m/s2: du/dt across the normal and d(u.n)/dt along it, at constant velocities"""
    arm_rate_a: np.ndarray  # (m, 3) m/s
    arm_rate_b: np.ndarray
    normal_rate: np.ndarray  # (m, 3) 1/s
    fastest: float
    """rad/s, at which the fastest arm or normal turns"""


def no_motion() -> Motion:
    """That of no contacts."""
    none = np.zeros((0, 3))
    return Motion(none, none, none, none, 0.0)


@jit_making_arrays
def contact_motion(geometry, shape_of_body, rotation, bodies, contacts, kinds, features):
    """The `Motion` of m contacts; kinds (m,) and features (m, 2) name what is in contact, as in `collision.distance.simplices`."""
    m = contacts.gap.shape[0]
    rates, memory, fastest = np.zeros((4, m, 3)), np.empty((10, 3)), 0.0
    turning, rate_a, rate_b, normal_rate = rates[0], rates[1], rates[2], rates[3]
    place, u, x = memory[0], memory[8], memory[9]
    for c in range(m):
        n = contacts.normal[c]
        a, b = contacts.body_a[c], contacts.body_b[c]
        primitives = only_primitive(geometry, shape_of_body[a]), only_primitive(geometry, shape_of_body[b])
        at_contact = kinds[c], features[c, 0], features[c, 1]
        _place_velocity(geometry, primitives, rotation, bodies, contacts, c, at_contact, memory)
        for k in range(3):
            u[k], normal_rate[c, k] = 0.0, memory[1, k]
        for side in range(2):
            i = contacts.body_b[c] if side else contacts.body_a[c]
            r = contacts.arm_b[c] if side else contacts.arm_a[c]
            arm_rate = rate_b[c] if side else rate_a[c]
            sign, w = 2.0 * side - 1.0, bodies.angular_velocity[i]
            for k in range(3):
                # r' = p' - v.
                arm_rate[k] = place[k] - bodies.velocity[i, k]
            _cross(w, arm_rate, x)
            for k in range(3):
                turning[c, k] += sign * x[k]
            _cross(w, r, x)
            for k in range(3):
                u[k] += sign * (bodies.velocity[i, k] + x[k])
            if bodies.inv_mass[i] > 0.0:
                # Forces change the motion of movable bodies only, so only their arms limit how long a force stays right.
                fastest = max(fastest, sqrt(dot(arm_rate, arm_rate) / max(dot(r, r), 1e-300)))
        # The part of the gap's second derivative from the turning normal: n (u.n').
        along = dot(u, normal_rate[c])
        for k in range(3):
            turning[c, k] += along * n[k]
        fastest = max(fastest, sqrt(dot(normal_rate[c], normal_rate[c])))
    return Motion(turning, rate_a, rate_b, normal_rate, fastest)
