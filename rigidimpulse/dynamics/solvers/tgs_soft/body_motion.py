"""How bodies of sub-stepped islands move in a sub-step, see `solver`: gravity, free rotation, positions (kernels).

With h the length of the sub-step, v the velocity, w the spin, g gravity, x the position, q the orientation and I the inertia:

    kick    v <- v + h g,   w <- w + h I^-1 tau;     the torque tau of forces does the work  h tau.(w + h I^-1 tau / 2)
    move    x <- x + h v,   q <- exp(h w) q;   where no contact pushed also x <- x - h^2 g / 2, which makes it the parabola, and likewise
            q by the mean spin w - h I^-1 tau / 2
    bodies whose moments differ keep their angular momentum: w <- I(q')^-1 I(q) w, see `turn_freely`
"""

from math import sqrt

from rigidimpulse.collision.contact_records import MEMBER, OUTSIDE
from rigidimpulse.core.kernels import inlined, jit
from rigidimpulse.core.quaternion import exponential, product, quaternion_to_matrix
from rigidimpulse.core.vector import turned_back_by, turned_by
from rigidimpulse.dynamics.solvers.tgs_soft.bodies import set_inverse_inertia


@inlined
def set_orientation(bodies, i, x, y, z):
    """Turn body i by the vector (x, y, z), rad."""
    q = bodies.orientation[i]
    t0, t1, t2, t3 = exponential(x, y, z)
    q0, q1, q2, q3 = product(t0, t1, t2, t3, q[0], q[1], q[2], q[3])
    size = sqrt(q0 * q0 + q1 * q1 + q2 * q2 + q3 * q3)
    q[0], q[1], q[2], q[3] = q0 / size, q1 / size, q2 / size, q3 / size
    quaternion_to_matrix(q, bodies.rotation[i])


@inlined
def _spin_rate(moments, i, x0, x1, x2):
    """Euler's equations without torque: the rate of the spin x in principal axes."""
    a, b, c = moments[i, 0], moments[i, 1], moments[i, 2]
    return (b - c) / a * x1 * x2, (c - a) / b * x2 * x0, (a - b) / c * x0 * x1


@inlined
def turn_freely(bodies, i, h):
    """Turn body i of unlike moments by its spin over h, keeping its angular momentum; returns the mean spin.

    The spin x in the body's axes by the classical Runge-Kutta method, x_m half-way by Hermite's cubic, and the turn of fourth order
    (Magnus), h (x_0 + 4 x_m + x_1) / 6 + h^2 (x_0 x x_1) / 12: with that of second order spinning bodies gain energy.
    """
    moments, v, half = bodies.inertia, 8 * i + 3, 0.5 * h
    x0, x1, x2 = turned_back_by(bodies.rotation, i, bodies.velocity[v], bodies.velocity[v + 1], bodies.velocity[v + 2])
    lx, ly, lz = turned_by(bodies.rotation, i, moments[i, 0] * x0, moments[i, 1] * x1, moments[i, 2] * x2)
    a0, a1, a2 = _spin_rate(moments, i, x0, x1, x2)
    b0, b1, b2 = _spin_rate(moments, i, x0 + half * a0, x1 + half * a1, x2 + half * a2)
    c0, c1, c2 = _spin_rate(moments, i, x0 + half * b0, x1 + half * b1, x2 + half * b2)
    d0, d1, d2 = _spin_rate(moments, i, x0 + h * c0, x1 + h * c1, x2 + h * c2)
    y0 = x0 + h / 6.0 * (a0 + 2.0 * (b0 + c0) + d0)
    y1 = x1 + h / 6.0 * (a1 + 2.0 * (b1 + c1) + d1)
    y2 = x2 + h / 6.0 * (a2 + 2.0 * (b2 + c2) + d2)
    e0, e1, e2 = _spin_rate(moments, i, y0, y1, y2)
    twelfth = h / 12.0
    # h (x_0 + 4 x_m + x_1) / 6 over h, with x_m = (x_0 + x_1) / 2 + h (x_0' - x_1') / 8.
    m0 = 0.5 * (x0 + y0) + twelfth * (a0 - e0) + twelfth * (x1 * y2 - x2 * y1)
    m1 = 0.5 * (x1 + y1) + twelfth * (a1 - e1) + twelfth * (x2 * y0 - x0 * y2)
    m2 = 0.5 * (x2 + y2) + twelfth * (a2 - e2) + twelfth * (x0 * y1 - x1 * y0)
    wx, wy, wz = turned_by(bodies.rotation, i, m0, m1, m2)
    set_orientation(bodies, i, h * wx, h * wy, h * wz)
    set_inverse_inertia(bodies, i)
    m, o = bodies.mass, 8 * i
    bodies.velocity[v] = m[o] * lx + m[o + 1] * ly + m[o + 2] * lz
    bodies.velocity[v + 1] = m[o + 1] * lx + m[o + 3] * ly + m[o + 4] * lz
    bodies.velocity[v + 2] = m[o + 2] * lx + m[o + 4] * ly + m[o + 5] * lz
    return wx, wy, wz


@inlined
def is_twisted(bodies, i):
    """Whether a torque of forces acts on body i."""
    return bodies.torque[i, 0] != 0.0 or bodies.torque[i, 1] != 0.0 or bodies.torque[i, 2] != 0.0


@jit
def _spin_up(bodies, i, h):
    """h I^-1 tau of body i, rad/s."""
    m, o, t = bodies.mass, 8 * i, bodies.torque[i]
    return (
        h * (m[o] * t[0] + m[o + 1] * t[1] + m[o + 2] * t[2]),
        h * (m[o + 1] * t[0] + m[o + 3] * t[1] + m[o + 4] * t[2]),
        h * (m[o + 2] * t[0] + m[o + 4] * t[1] + m[o + 5] * t[2]),
    )


@jit
def _turn_evenly(bodies, i, h):
    """Turn body i, which no contact pushed, over h s by the mean spin of the sub-step; then its spin is that at the end."""
    v, moved, drift, o = bodies.velocity, bodies.moved, bodies.drift, 8 * i + 3
    x, y, z = _spin_up(bodies, i, 0.5 * h)
    v[o] -= x
    v[o + 1] -= y
    v[o + 2] -= z
    wx, wy, wz = v[o], v[o + 1], v[o + 2]
    if not bodies.alike[i]:
        wx, wy, wz = turn_freely(bodies, i, h)
    for k, turn in ((0, h * wx), (1, h * wy), (2, h * wz)):
        moved[o + k] += turn
        drift[o + k] += turn
    v[o] += x
    v[o + 1] += y
    v[o + 2] += z


@jit
def kick(bodies, begin, end, h):
    """Let gravity and the torque of forces act over h s on the bodies from `begin` to `end`; supports get what their paths gain."""
    v, before = bodies.velocity, bodies.before
    for i in range(begin, end):
        if bodies.part[i] == OUTSIDE:
            continue
        o = 8 * i
        for k in range(3):
            # Adding nothing could still turn -0 into 0.
            if bodies.part[i] == MEMBER or bodies.gravity[i, k] != 0.0:
                v[o + k] += h * bodies.gravity[i, k]
        if bodies.part[i] != MEMBER:
            continue
        if is_twisted(bodies, i):
            x, y, z = _spin_up(bodies, i, h)
            t = bodies.torque[i]
            bodies.work[i] += h * (t[0] * (v[o + 3] + 0.5 * x) + t[1] * (v[o + 4] + 0.5 * y) + t[2] * (v[o + 5] + 0.5 * z))
            v[o + 3] += x
            v[o + 4] += y
            v[o + 5] += z
        for k in range(6):
            before[o + k] = v[o + k]


@jit
def move(bodies, begin, end, h):
    """Move the bodies from `begin` to `end` by their velocities over h s; those that no contact pushed, and supports, on their parabola."""
    v, before, moved, drift = bodies.velocity, bodies.before, bodies.moved, bodies.drift
    for i in range(begin, end):
        if bodies.part[i] == OUTSIDE:
            continue
        o = 8 * i
        member = bodies.part[i] == MEMBER
        # Velocities that no contact changed to the bit: the body flies on its parabola.
        loose = member
        for k in range(6):
            loose = loose and v[o + k] == before[o + k]
        back = 0.5 * h * h if loose or not member else 0.0
        for k in range(3):
            step = h * v[o + k] - back * bodies.gravity[i, k]
            bodies.position[i, k] += step
            moved[o + k] += step
            drift[o + k] += step
        wx, wy, wz = v[o + 3], v[o + 4], v[o + 5]
        if loose and is_twisted(bodies, i):
            _turn_evenly(bodies, i, h)
            continue
        if wx == 0.0 and wy == 0.0 and wz == 0.0:
            continue
        # Bodies whose moments differ keep their angular momentum, not their spin.
        if member and not bodies.alike[i]:
            wx, wy, wz = turn_freely(bodies, i, h)
        for k, turn in ((3, h * wx), (4, h * wy), (5, h * wz)):
            moved[o + k] += turn
            drift[o + k] += turn


@inlined
def _length(a, o):
    return sqrt(a[o] * a[o] + a[o + 1] * a[o + 1] + a[o + 2] * a[o + 2])


@jit
def mark_quick(bodies, ahead, limit):
    """Mark members as quick that have drifted by more than `limit` inner radii, or will have in `ahead` s; returns the share that is."""
    v, drift, members, quick = bodies.velocity, bodies.drift, 0, 0
    for i in range(bodies.part.shape[0]):
        if bodies.part[i] != MEMBER:
            continue
        o = 8 * i
        way = _length(drift, o) + ahead * _length(v, o) + bodies.reach[i] * (_length(drift, o + 3) + ahead * _length(v, o + 3))
        bodies.quick[i] = bodies.quick[i] or way > limit * bodies.inner[i]
        members += 1
        quick += bodies.quick[i]
    return quick / members


@jit
def finish(bodies):
    """Orientations at the end of sub-steps of those that have not been turned in them; what has moved counts from here on."""
    for i in range(bodies.part.shape[0]):
        if bodies.part[i] != OUTSIDE and (bodies.part[i] != MEMBER or bodies.alike[i]):
            o = 8 * i + 3
            set_orientation(bodies, i, bodies.moved[o], bodies.moved[o + 1], bodies.moved[o + 2])
        for k in range(8 * i, 8 * i + 6):
            bodies.moved[k] = 0.0


@jit
def note_pressed(bodies, order, pressed):
    """Mark the members, in pressed (n,) by index, that contacts acted on in the last sub-step; order (n,) indices by rank."""
    for i in range(order.shape[0]):
        if bodies.part[i] == MEMBER:
            acted = False
            for k in range(8 * i, 8 * i + 6):
                acted = acted or bodies.velocity[k] != bodies.before[k]
            pressed[order[i]] = acted
