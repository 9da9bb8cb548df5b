"""How two bodies move past each other in the next instants, and how far the motion can stray from that.

Each body flies with constant acceleration and turns freely, under a constant world torque tau, or at a constant rate. One instant
of a body is a row of floats (the offsets `POSITION` ... `JERK_BOUND` below), written by `motion_bound`:

    x, v, acc     centre of mass, its velocity and acceleration      w, alpha   spin and its rate of change, world
    W >= |w|      A >= |alpha|      K >= rate of alpha in the body's own axes                   bounds over [t, t + h]

Spin bounds. With I the principal moments, T the kinetic energy of rotation, L = I w and kappa = max |I_i - I_j| / I_k,

    W^2  = max of sum x_i  under  sum I_i x_i <= (sqrt(2 T) + h |tau| / sqrt(I_min))^2,  sum I_i^2 x_i >= (|L| - h |tau|)^2,  x_i >= 0
    A   <= |tau| / I_min + kappa W^2 / sqrt(3)                K <= W |tau| / I_min + 2 kappa W A / sqrt(3)

(x_i = w_i^2; the constraints say that energy and angular momentum change no faster than the torque lets them).

Relative motion. Let d = x_b - x_a, w = w_b - w_a, and r a point of B from x_b. In the frame of A, at the instant (all exact),

    u   = v_b - v_a - w_a x d                                                            y'  = u + w x r
    c   = acc_b - acc_a - alpha_a x d - 2 w_a x (v_b - v_a) + w_a x (w_a x d)            y'' = c + beta x r + w x (w x r)
    beta = alpha_b - alpha_a - w_a x w_b                                                |y'''| <= J_c + J_r |r|

Both y' and y'' vanish for bodies that move as one. Capitals bound the letters over [0, h] (D: d, U: u, C: c, O: w, B: beta):

    J_c = W_a |acc_b - acc_a| + 3 A_a U + 2 W_a C + K_a D + 2 A_a W_a D + W_a^2 U
    J_r = B' + 3 O B + O^3,   B' = K_a + K_b + O (A_a + A_b) + W_a B

The bounds start from direct sums and are tightened by X <- min(X, |X(0)| + h X').
"""

from __future__ import annotations

from math import sqrt

from rigidimpulse._jit import jit
from rigidimpulse.conventions import TOLERANCES
from rigidimpulse.detect.features import along, cross, dot, subtract
from rigidimpulse.integrate.course import FIXED, PRESCRIBED, state_at
from rigidimpulse.rotation import quaternion_to_matrix

POSITION, VELOCITY, SPIN, ACCELERATION, SPIN_RATE, AXES, ORIENTATION = 0, 3, 6, 9, 12, 15, 24
SPIN_BOUND, SPIN_RATE_BOUND, JERK_BOUND = 28, 29, 30
MOTION_SIZE = 31
"""Offsets into the row of a body: x, v, w, acc, alpha (3 each), rotation matrix (9), quaternion (4), W, A, K."""

SEEN_VELOCITY, SEEN_SPIN, SEEN_ACCELERATION, SEEN_TURN, SEEN_JERK, SEEN_ARM_JERK = 0, 3, 6, 9, 18, 19
SEEN_SPIN_SIZE, SEEN_TURN_SIZE = 20, 21
SEEN_SIZE = 22
"""Offsets into the row of a relative motion: u, w, c (3 each), the matrix of r -> beta x r + w x (w x r) (9), J_c, J_r, |w|, and
|beta| + w^2, a bound of the size of that matrix."""

_TIGHTENINGS = 4
_WIDEN = 1.0 + 1e-12  # covers the rounding of the bounds themselves
_ROUND_OFF = TOLERANCES.round_off
_EQUAL_MOMENTS = TOLERANCES.equal_moments


@jit
def vector(row, first):
    """Three neighbouring entries of a row as a 3-tuple."""
    return row[first], row[first + 1], row[first + 2]


@jit
def length(a):
    """|a|."""
    return sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2])


@jit
def _fastest_spin_squared(moments, energy, momentum):
    """Largest sum x_i with sum I_i x_i <= energy (2 T), sum I_i^2 x_i >= momentum (|L|^2), x_i >= 0: a corner of that region."""
    best = 0.0
    for i in range(3):
        if moments[i] * energy >= momentum * (1.0 - _ROUND_OFF):
            best = max(best, energy / moments[i])
        first, second = moments[i], moments[(i + 1) % 3]
        if abs(first - second) > _EQUAL_MOMENTS * max(first, second):
            x_first = (energy * second - momentum) / (first * (second - first))
            x_second = (momentum - energy * first) / (second * (second - first))
            if x_first >= 0.0 and x_second >= 0.0:
                best = max(best, x_first + x_second)
    return best


@jit
def _write_spin_bounds(course, i, horizon, row):
    """Write alpha, W, A and K of a body that turns freely or under a torque."""
    moments = (course.inertia[i, 0], course.inertia[i, 1], course.inertia[i, 2])
    spin_world = vector(row, SPIN)
    torque_world = (course.torque[i, 0], course.torque[i, 1], course.torque[i, 2])
    axis_x, axis_y, axis_z = (row[15], row[18], row[21]), (row[16], row[19], row[22]), (row[17], row[20], row[23])
    spin = (dot(axis_x, spin_world), dot(axis_y, spin_world), dot(axis_z, spin_world))
    torque = (dot(axis_x, torque_world), dot(axis_y, torque_world), dot(axis_z, torque_world))
    momentum = (moments[0] * spin[0], moments[1] * spin[1], moments[2] * spin[2])
    moment_of_force = subtract(torque, cross(spin, momentum))
    rate = (moment_of_force[0] / moments[0], moment_of_force[1] / moments[1], moment_of_force[2] / moments[2])

    least = min(moments[0], moments[1], moments[2])
    kappa = 0.0
    for k in range(3):
        kappa = max(kappa, abs(moments[k] - moments[(k + 1) % 3]) / moments[(k + 2) % 3])
    torque_size, spin_now, rate_now = length(torque), length(spin), length(rate)
    kick = torque_size / least
    energy = (sqrt(dot(spin, momentum)) + horizon * torque_size / sqrt(least)) ** 2
    fastest = _fastest_spin_squared(moments, energy, max(length(momentum) - horizon * torque_size, 0.0) ** 2)
    spin_bound = max(sqrt(fastest), spin_now)
    rate_bound = 0.0
    jerk_bound = 0.0
    for _ in range(_TIGHTENINGS):
        rate_bound = kick + kappa * spin_bound * spin_bound / sqrt(3.0)
        jerk_bound = spin_bound * kick + 2.0 / sqrt(3.0) * kappa * spin_bound * rate_bound
        rate_bound = max(rate_now, min(rate_bound, rate_now + horizon * jerk_bound))
        spin_bound = max(spin_now, min(spin_bound, spin_now + horizon * rate_bound))
    for k in range(3):
        row[SPIN_RATE + k] = axis_x[k] * rate[0] + axis_y[k] * rate[1] + axis_z[k] * rate[2]
    row[SPIN_BOUND] = spin_bound * _WIDEN
    row[SPIN_RATE_BOUND] = rate_bound * _WIDEN
    row[JERK_BOUND] = jerk_bound * _WIDEN


@jit
def motion_bound(course, i, t, horizon, row):
    """Write the motion of body i at time t, with bounds that hold until t + horizon, into row (MOTION_SIZE,).

    Works for every mode of a course: fixed, prescribed, free, and turning under a constant world torque.
    """
    state_at(course, i, t, row[POSITION:VELOCITY], row[ORIENTATION:SPIN_BOUND], row[VELOCITY:SPIN], row[SPIN:ACCELERATION])
    quaternion_to_matrix(row[ORIENTATION:SPIN_BOUND], row[AXES:ORIENTATION].reshape((3, 3)))
    mode = course.mode[i]
    for k in range(3):
        row[ACCELERATION + k] = 0.0 if mode == FIXED or mode == PRESCRIBED else course.acceleration[i, k]
        row[SPIN_RATE + k] = 0.0
    if mode == FIXED or mode == PRESCRIBED:
        row[SPIN_BOUND] = length(vector(row, SPIN))
        row[SPIN_RATE_BOUND] = 0.0
        row[JERK_BOUND] = 0.0
    else:
        _write_spin_bounds(course, i, horizon, row)


@jit
def stop_turning(row):
    """Take the rotation out of a motion row: for a sphere about its own centre, on which no rotation can be seen."""
    for k in range(3):
        row[SPIN + k] = 0.0
        row[SPIN_RATE + k] = 0.0
    for k in range(9):
        row[AXES + k] = 1.0 if k % 4 == 0 else 0.0
    row[SPIN_BOUND] = 0.0
    row[SPIN_RATE_BOUND] = 0.0
    row[JERK_BOUND] = 0.0


@jit
def _centre_jerk(carrier, distance, speed, velocity, acceleration, pull, horizon):
    """J_c from |d|, the largest |v_b - v_a|, |u|, |c| and |acc_b - acc_a|, for the carrier's W, A and K."""
    spin, rate, jerk = carrier[SPIN_BOUND], carrier[SPIN_RATE_BOUND], carrier[JERK_BOUND]
    if spin == 0.0 and rate == 0.0:
        return 0.0
    far = distance + horizon * speed
    fast = speed + spin * far
    bend = pull + 2.0 * spin * speed + (rate + spin * spin) * far
    result = 0.0
    for _ in range(_TIGHTENINGS):
        far = min(far, distance + horizon * fast)
        result = spin * pull + 3.0 * rate * fast + 2.0 * spin * bend + (jerk + 2.0 * rate * spin) * far + spin * spin * fast
        bend = max(acceleration, min(bend, acceleration + horizon * result))
        fast = max(velocity, min(fast, velocity + horizon * bend))
    return result * _WIDEN


@jit
def _arm_jerk(carrier, other, spin_now, turn_now, horizon):
    """J_r from the present |w| and |beta|."""
    spin = carrier[SPIN_BOUND] + other[SPIN_BOUND]
    rate = carrier[SPIN_RATE_BOUND] + other[SPIN_RATE_BOUND]
    turn = rate + carrier[SPIN_BOUND] * spin
    turn_rate = 0.0
    for _ in range(_TIGHTENINGS):
        turn_rate = carrier[JERK_BOUND] + other[JERK_BOUND] + spin * rate + carrier[SPIN_BOUND] * turn
        turn = max(turn_now, min(turn, turn_now + horizon * turn_rate))
        spin = max(spin_now, min(spin, spin_now + horizon * turn))
    return (turn_rate + 3.0 * spin * turn + spin**3) * _WIDEN


@jit
def relative_motion(carrier, other, axes, horizon, seen):
    """Write how the points of one body move as seen from another, its carrier, into seen (SEEN_SIZE,).

    Args:
        carrier: motion row of the body that carries the frame (A above).
        other: motion row of the body that is seen (B above).
        axes: motion row of the body in whose axes the result is written; arms r are given in these axes too.
        horizon: s, the span over which the jerk bounds hold.
        seen: written.

    """
    d = subtract(vector(other, POSITION), vector(carrier, POSITION))
    dv = subtract(vector(other, VELOCITY), vector(carrier, VELOCITY))
    pull = subtract(vector(other, ACCELERATION), vector(carrier, ACCELERATION))
    spin_a, spin_b = vector(carrier, SPIN), vector(other, SPIN)
    rate_a, rate_b = vector(carrier, SPIN_RATE), vector(other, SPIN_RATE)
    u = subtract(dv, cross(spin_a, d))
    w = subtract(spin_b, spin_a)
    c = subtract(pull, cross(rate_a, d))
    c = along(c, -2.0, cross(spin_a, dv))
    c = along(c, 1.0, cross(spin_a, cross(spin_a, d)))
    beta = subtract(subtract(rate_b, rate_a), cross(spin_a, spin_b))

    speed = max(length(dv), length(along(dv, horizon, pull)))
    seen[SEEN_JERK] = _centre_jerk(carrier, length(d), speed, length(u), length(c), length(pull), horizon)
    seen[SEEN_ARM_JERK] = _arm_jerk(carrier, other, length(w), length(beta), horizon)
    seen[SEEN_SPIN_SIZE] = length(w)
    seen[SEEN_TURN_SIZE] = length(beta) + dot(w, w)
    turn = (0.0, 0.0, 0.0)
    for k in range(3):
        axis = (axes[AXES + k], axes[AXES + 3 + k], axes[AXES + 6 + k])
        seen[SEEN_VELOCITY + k] = dot(axis, u)
        seen[SEEN_SPIN + k] = dot(axis, w)
        seen[SEEN_ACCELERATION + k] = dot(axis, c)
        turn = (turn[1], turn[2], dot(axis, beta))
    _write_turn_matrix(vector(seen, SEEN_SPIN), turn, seen)


@jit
def _write_turn_matrix(w, beta, seen):
    """Matrix of r -> beta x r + w x (w x r) = beta x r + w (w . r) - w^2 r."""
    square = dot(w, w)
    for i in range(3):
        for j in range(3):
            seen[SEEN_TURN + 3 * i + j] = w[i] * w[j] - (square if i == j else 0.0)
    seen[SEEN_TURN + 1] -= beta[2]
    seen[SEEN_TURN + 2] += beta[1]
    seen[SEEN_TURN + 3] += beta[2]
    seen[SEEN_TURN + 5] -= beta[0]
    seen[SEEN_TURN + 6] -= beta[1]
    seen[SEEN_TURN + 7] += beta[0]


@jit
def seen_velocity(seen, r):
    """y' of the point at arm r."""
    return along(vector(seen, SEEN_VELOCITY), 1.0, cross(vector(seen, SEEN_SPIN), r))


@jit
def seen_acceleration(seen, r):
    """y'' of the point at arm r."""
    return (
        seen[SEEN_ACCELERATION] + dot(vector(seen, SEEN_TURN), r),
        seen[SEEN_ACCELERATION + 1] + dot(vector(seen, SEEN_TURN + 3), r),
        seen[SEEN_ACCELERATION + 2] + dot(vector(seen, SEEN_TURN + 6), r),
    )
