"""Rotation of a body under a torque that is constant in the world or changes linearly with time.

Body frame, principal moments I, angular velocity w, tau(t) = tau0 + tau1 t; e = R^T d for two fixed directions d of the world:
    I1 w1' = (I2 - I3) w2 w3 + ((|tau0| + p t) e_1 + r t e_2).x (and cyclic),   e' = e x w,
    d_1 = tau0 / |tau0|,   d_2 normal to d_1,   tau1 = p d_1 + r d_2,
so that the angular momentum in the world is L0 + tau0 t + tau1 t^2 / 2. These equations are quadratic: the coefficients of the
power series of w, e_1, e_2 follow one from another by Cauchy products. The series up to ORDER is computed once; it serves for
any time up to `segment`, where its last terms reach round-off. From there on it is started again. Segments depend on the
start alone, never on the time asked for, so the path is one smooth function of time. The attitude follows from e_1, e_2
and e_1 x e_2.

If w is zero or parallel to the torque, tau0 and tau1 are parallel and all lie on a principal axis, that axis is kept:
angle = w t + tau0 t^2 / 2I + tau1 t^3 / 6I.

Source: A. Jorba and M. Zou, A software package for the numerical integration of ODEs by means of high-order Taylor
methods, Experimental Mathematics 14:99, 2005 (the segment from the last terms).
"""

import math

from rigidimpulse.core.kernels import jit, jit_making_arrays
from rigidimpulse.core.quaternion import exponential, from_columns, product, rotated
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.motion import free_rotation

ORDER = 18
"""order of the series: a higher one costs more at the start and less beyond the first segment, which grows with it"""
FORCED_AXIS, FORCED = 4.0, 5.0  # kinds of rotation, after those of free_rotation

KIND = 0
BASE = 1  # (4,) orientation at the start
RATE = 5  # (3,) world angular velocity at the start (axis)
_ACCELERATION = 8  # (3,) world angular acceleration at the start (axis)
_JERK = 11  # (3,) its rate (axis)

_INERTIA = 5  # (3,)
_TORQUE = 8  # |tau0|
_TIME_SCALE = 9  # 1/s, a power of two: the series is in (time * scale), and w is in units of the scale
SEGMENT = 10  # s
_TORQUE_RATE = 11  # |tau1|
_RATE_ALONG = 12  # p
_RATE_ACROSS = 13  # r
FORCED_ROTATION_SIZE = 14
_STRIDE = 9
"""coefficients of one order: of w, e_1, e_2"""
SERIES_SIZE = _STRIDE * (ORDER + 1)
"""coefficients in all; few bodies have a series, so that they lie apart from the other constants"""

_PARALLEL = TOLERANCES.rotation.parallel_torque
_NO_TORQUE = TOLERANCES.rotation.no_torque
_MOST_SEGMENTS = 100_000
"""segments after which the rotation is given up: some 30,000 rad, a tenth of a second of work"""
_LAST_TERM = TOLERANCES.rotation.last_term


@jit
def _fill_series(c, series):
    """Coefficients 1 to ORDER from coefficients 0, and the length of the segment."""
    i1, i2, i3 = c[_INERTIA], c[_INERTIA + 1], c[_INERTIA + 2]
    k1, k2, k3 = (i2 - i3) / i1, (i3 - i1) / i2, (i1 - i2) / i3
    scale = c[_TIME_SCALE]
    push = c[_TORQUE] / scale / scale
    g1, g2, g3 = push / i1, push / i2, push / i3
    varies = c[_TORQUE_RATE] != 0.0
    p, r = c[_RATE_ALONG] / scale / scale / scale, c[_RATE_ACROSS] / scale / scale / scale
    segment = math.inf
    for n in range(ORDER):
        w1, w2, w3, a1, a2, a3, b1, b2, b3 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        # One loop for all nine sums: apart, each would wait for its own additions.
        for j in range(n + 1):
            x = _STRIDE * j
            y = _STRIDE * (n - j)
            v1, v2, v3 = series[y], series[y + 1], series[y + 2]
            w1 += series[x + 1] * v3
            w2 += series[x + 2] * v1
            w3 += series[x] * v2
            e1, e2, e3 = series[x + 3], series[x + 4], series[x + 5]
            a1 += e2 * v3 - e3 * v2
            a2 += e3 * v1 - e1 * v3
            a3 += e1 * v2 - e2 * v1
            e1, e2, e3 = series[x + 6], series[x + 7], series[x + 8]
            b1 += e2 * v3 - e3 * v2
            b2 += e3 * v1 - e1 * v3
            b3 += e1 * v2 - e2 * v1
        share = 1.0 / (n + 1.0)
        here = _STRIDE * n
        e1, e2, e3 = series[here + 3], series[here + 4], series[here + 5]
        w1, w2, w3 = k1 * w1 + g1 * e1, k2 * w2 + g2 * e2, k3 * w3 + g3 * e3
        if varies and n > 0:
            before = here - _STRIDE
            w1 += (p * series[before + 3] + r * series[before + 6]) / i1
            w2 += (p * series[before + 4] + r * series[before + 7]) / i2
            w3 += (p * series[before + 5] + r * series[before + 8]) / i3
        here += _STRIDE
        series[here], series[here + 1], series[here + 2] = share * w1, share * w2, share * w3
        series[here + 3], series[here + 4], series[here + 5] = share * a1, share * a2, share * a3
        series[here + 6], series[here + 7], series[here + 8] = share * b1, share * b2, share * b3
        # The last terms stay below round-off for x <= (_LAST_TERM / |c_n|)^(1/n); some of them may vanish by symmetry.
        if n >= ORDER - 4:
            largest = 0.0
            for k in range(_STRIDE):
                largest = max(largest, abs(series[here + k]))
            if largest > 0.0:
                segment = min(segment, math.exp(math.log(_LAST_TERM / largest) / (n + 1.0)))
    c[SEGMENT] = segment / scale


@jit
def _direction(x, y, z):
    """Unit vector along a vector, and its size; zeros for a zero vector."""
    largest = max(abs(x), abs(y), abs(z))
    if largest == 0.0:
        return 0.0, 0.0, 0.0, 0.0
    x, y, z = x / largest, y / largest, z / largest
    size = math.sqrt(x * x + y * y + z * z)
    return x / size, y / size, z / size, size * largest


@jit
def _across(ex, ey, ez, ux, uy, uz):
    """Cosine and sine between the unit vectors e and u, and the part of u that is normal to e."""
    cosine = ex * ux + ey * uy + ez * uz
    ux, uy, uz = ux - cosine * ex, uy - cosine * ey, uz - cosine * ez
    # Once more: what is left of nearly parallel vectors is not normal to e yet.
    rest = ex * ux + ey * uy + ez * uz
    ux, uy, uz = ux - rest * ex, uy - rest * ey, uz - rest * ez
    return cosine, math.sqrt(ux * ux + uy * uy + uz * uz), ux, uy, uz


@jit
def _start_series(c, series, w, e, u):
    """Begin a series at body angular velocity w and unit directions e of tau0 and u of tau1; set scale and segment.

    |tau0| and |tau1| are read; e is u where tau0 is none, and u is not read where tau1 is none.
    """
    wx, wy, wz = w
    ex, ey, ez = e
    ux, uy, uz = u
    i1, i2, i3 = c[_INERTIA], c[_INERTIA + 1], c[_INERTIA + 2]
    coupling = max(1.0, abs(i2 - i3) / i1, abs(i3 - i1) / i2, abs(i1 - i2) / i3)
    rate = coupling * max(abs(wx), abs(wy), abs(wz)) + math.sqrt(c[_TORQUE] / min(i1, i2, i3))
    growth = c[_TORQUE_RATE]
    if growth != 0.0:
        rate += (growth / min(i1, i2, i3)) ** (1.0 / 3.0)
    # Times are scaled by a power of two, so that the scaling itself rounds nothing.
    scale = math.ldexp(1.0, math.frexp(rate)[1])
    c[_TIME_SCALE] = scale
    series[0], series[1], series[2] = wx / scale, wy / scale, wz / scale
    series[3], series[4], series[5] = ex, ey, ez
    # d_2 is normal to the torque and to the body axis x or y, whichever is farther from it.
    nx, ny, nz = (0.0, ez, -ey) if abs(ex) <= abs(ey) else (-ez, 0.0, ex)
    size = math.sqrt(nx * nx + ny * ny + nz * nz)
    if growth != 0.0:
        cosine, sine, mx, my, mz = _across(ex, ey, ez, ux, uy, uz)
        if sine > _PARALLEL:
            nx, ny, nz, size = mx, my, mz, sine
        else:
            sine = 0.0
        c[_RATE_ALONG], c[_RATE_ACROSS] = growth * cosine, growth * sine
    series[6], series[7], series[8] = nx / size, ny / size, nz / size
    _fill_series(c, series)


@jit
def _advance(c, series, t):
    """The turn since the start of the series, body angular velocity, e_1 and e_2, t seconds after it: 13 numbers."""
    x = t * c[_TIME_SCALE]
    w1, w2, w3, a1, a2, a3, b1, b2, b3 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for n in range(ORDER, -1, -1):
        k = _STRIDE * n
        u1, u2, u3 = series[k], series[k + 1], series[k + 2]
        w1, w2, w3 = w1 * x + u1, w2 * x + u2, w3 * x + u3
        u1, u2, u3 = series[k + 3], series[k + 4], series[k + 5]
        a1, a2, a3 = a1 * x + u1, a2 * x + u2, a3 * x + u3
        u1, u2, u3 = series[k + 6], series[k + 7], series[k + 8]
        b1, b2, b3 = b1 * x + u1, b2 * x + u2, b3 * x + u3
    # Same directions, seen from the body at the start of the series (p, q, r = p x q) and now (a, b, n = a x b).
    p1, p2, p3 = series[3], series[4], series[5]
    q1, q2, q3 = series[6], series[7], series[8]
    r1, r2, r3 = p2 * q3 - p3 * q2, p3 * q1 - p1 * q3, p1 * q2 - p2 * q1
    n1, n2, n3 = a2 * b3 - a3 * b2, a3 * b1 - a1 * b3, a1 * b2 - a2 * b1
    g0, g1, g2, g3 = from_columns(
        (p1 * a1 + q1 * b1 + r1 * n1, p2 * a1 + q2 * b1 + r2 * n1, p3 * a1 + q3 * b1 + r3 * n1),
        (p1 * a2 + q1 * b2 + r1 * n2, p2 * a2 + q2 * b2 + r2 * n2, p3 * a2 + q3 * b2 + r3 * n2),
        (p1 * a3 + q1 * b3 + r1 * n3, p2 * a3 + q2 * b3 + r2 * n3, p3 * a3 + q3 * b3 + r3 * n3),
    )
    scale = c[_TIME_SCALE]
    return g0, g1, g2, g3, scale * w1, scale * w2, scale * w3, a1, a2, a3, b1, b2, b3


@jit
def _parallel(ax, ay, az, bx, by, bz):
    """Whether two vectors are parallel to round-off; a zero vector is parallel to any."""
    limit = _PARALLEL * max(abs(ax), abs(ay), abs(az)) * max(abs(bx), abs(by), abs(bz))
    return max(abs(ay * bz - az * by), abs(az * bx - ax * bz), abs(ax * by - ay * bx)) <= limit


@jit
def prepare(inertia, q, w_world, torque, torque_rate, constants_out, series_out):
    """Write constants (FORCED_ROTATION_SIZE,) and series (SERIES_SIZE,) of the motion from orientation q (4,) and spin (3,), rad/s.

    `w_world`, `torque` (3,), N m, and `torque_rate` (3,), N m/s, are in the world; `inertia` (3,): principal moments,
    kg m^2, all > 0. Returns False and writes nothing if torque and rate are 0: then the body rotates freely.
    """
    c = constants_out
    i1, i2, i3 = inertia[0], inertia[1], inertia[2]
    none = _NO_TORQUE * min(i1, i2, i3)
    has_torque = max(abs(torque[0]), abs(torque[1]), abs(torque[2])) > none
    has_rate = max(abs(torque_rate[0]), abs(torque_rate[1]), abs(torque_rate[2])) > none
    if not (has_torque or has_rate):
        return False
    q0, q1, q2, q3 = q[0], q[1], q[2], q[3]
    norm = 1.0 / math.sqrt(q0 * q0 + q1 * q1 + q2 * q2 + q3 * q3)
    q0, q1, q2, q3 = norm * q0, norm * q1, norm * q2, norm * q3
    c[BASE], c[BASE + 1], c[BASE + 2], c[BASE + 3] = q0, q1, q2, q3
    ux, uy, uz, growth, bx, by, bz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    if has_rate:
        ux, uy, uz, growth = _direction(torque_rate[0], torque_rate[1], torque_rate[2])
        ux, uy, uz = rotated(q0, -q1, -q2, -q3, ux, uy, uz)
        bx, by, bz = growth * ux / i1, growth * uy / i2, growth * uz / i3
    ex, ey, ez, magnitude = ux, uy, uz, 0.0
    if has_torque:
        ex, ey, ez, magnitude = _direction(torque[0], torque[1], torque[2])
        ex, ey, ez = rotated(q0, -q1, -q2, -q3, ex, ey, ez)
    vx, vy, vz = w_world[0], w_world[1], w_world[2]
    wx, wy, wz = rotated(q0, -q1, -q2, -q3, vx, vy, vz)
    ax, ay, az = magnitude * ex / i1, magnitude * ey / i2, magnitude * ez / i3
    # Torque, its rate and spin along one principal axis: that axis is kept, in closed form.
    if _parallel(ex, ey, ez, ax, ay, az) and _parallel(ex, ey, ez, wx, wy, wz) and _parallel(ex, ey, ez, bx, by, bz):
        c[KIND] = FORCED_AXIS
        ax, ay, az = rotated(q0, q1, q2, q3, ax, ay, az)
        bx, by, bz = rotated(q0, q1, q2, q3, bx, by, bz)
        c[RATE], c[RATE + 1], c[RATE + 2] = vx, vy, vz
        c[_ACCELERATION], c[_ACCELERATION + 1], c[_ACCELERATION + 2] = ax, ay, az
        c[_JERK], c[_JERK + 1], c[_JERK + 2] = bx, by, bz
    else:
        c[KIND] = FORCED
        c[_INERTIA], c[_INERTIA + 1], c[_INERTIA + 2] = i1, i2, i3
        c[_TORQUE], c[_TORQUE_RATE] = magnitude, growth
        _start_series(c, series_out, (wx, wy, wz), (ex, ey, ez), (ux, uy, uz))
    return True


@jit_making_arrays
def _last_segment(constants, coefficients, t):
    """Constants and series of the segment that holds the time t, and the time since its start (NaN: too many segments)."""
    c, series = constants.copy(), coefficients.copy()
    for _ in range(_MOST_SEGMENTS):
        # Segments depend on the start alone, never on the time asked for, so the path is one smooth function of time.
        if not t > c[SEGMENT]:
            return c, series, t
        h = c[SEGMENT]
        t -= h
        g0, g1, g2, g3, wx, wy, wz, ex, ey, ez, fx, fy, fz = _advance(c, series, h)
        q0, q1, q2, q3 = c[BASE], c[BASE + 1], c[BASE + 2], c[BASE + 3]
        q0, q1, q2, q3 = product(q0, q1, q2, q3, g0, g1, g2, g3)
        c[BASE], c[BASE + 1], c[BASE + 2], c[BASE + 3] = q0, q1, q2, q3
        ux, uy, uz, growth = 0.0, 0.0, 0.0, c[_TORQUE_RATE]
        if growth != 0.0:
            cosine, sine = c[_RATE_ALONG] / growth, c[_RATE_ACROSS] / growth
            ux, uy, uz = cosine * ex + sine * fx, cosine * ey + sine * fy, cosine * ez + sine * fz
            now, grown = c[_TORQUE], h * growth
            ex, ey, ez, c[_TORQUE] = _direction(now * ex + grown * ux, now * ey + grown * uy, now * ez + grown * uz)
            if c[_TORQUE] == 0.0:
                ex, ey, ez = ux, uy, uz
        _start_series(c, series, (wx, wy, wz), (ex, ey, ez), (ux, uy, uz))
    return c, series, math.nan


@jit_making_arrays
def rotation(constants, series, t):
    """Quaternion and world angular velocity t seconds after the start, as seven numbers; for rows of free_rotation too.

    NaN if the body turns so fast, for so long, that it would take more than _MOST_SEGMENTS.
    """
    c = constants
    if c[KIND] < FORCED_AXIS:
        return free_rotation.rotation(c, t)
    if c[KIND] == FORCED:
        if t > c[SEGMENT]:
            c, series, t = _last_segment(c, series, t)
        g0, g1, g2, g3, wx, wy, wz, _, _, _, _, _, _ = _advance(c, series, t)
        q0, q1, q2, q3 = product(c[BASE], c[BASE + 1], c[BASE + 2], c[BASE + 3], g0, g1, g2, g3)
        wx, wy, wz = rotated(q0, q1, q2, q3, wx, wy, wz)
        return q0, q1, q2, q3, wx, wy, wz
    wx, wy, wz = c[RATE], c[RATE + 1], c[RATE + 2]
    ax, ay, az = c[_ACCELERATION], c[_ACCELERATION + 1], c[_ACCELERATION + 2]
    bx, by, bz = c[_JERK], c[_JERK + 1], c[_JERK + 2]
    h = 0.5 * t
    mx, my, mz = ax, ay, az
    if bx != 0.0 or by != 0.0 or bz != 0.0:  # (adding nothing could turn -0 into 0)
        third = t / 3.0
        mx, my, mz = ax + third * bx, ay + third * by, az + third * bz
        ax, ay, az = ax + h * bx, ay + h * by, az + h * bz
    e0, e1, e2, e3 = exponential(t * (wx + h * mx), t * (wy + h * my), t * (wz + h * mz))
    q0, q1, q2, q3 = c[BASE], c[BASE + 1], c[BASE + 2], c[BASE + 3]
    q0, q1, q2, q3 = product(e0, e1, e2, e3, q0, q1, q2, q3)
    return q0, q1, q2, q3, wx + t * ax, wy + t * ay, wz + t * az


@jit_making_arrays
def evaluate(constants, series, t, q_out, w_out):
    """Write quaternion (4,) and world angular velocity (3,) t >= 0 seconds after the start."""
    q_out[0], q_out[1], q_out[2], q_out[3], w_out[0], w_out[1], w_out[2] = rotation(constants, series, t)
