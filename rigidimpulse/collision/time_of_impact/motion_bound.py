"""How two bodies move past each other in the next instants, and how far the motion can stray from that.

Each body flies with an acceleration that changes at a constant rate (jerk) and turns freely, under a world torque tau that does the same
(tau'), or at a constant rate.

One instant of a body is a record of floats (the offsets `POSITION` ... `CENTRE_JERK` below), written by `motion_bound`:

    x, v, acc, jerk   of the centre of mass      w, alpha   spin and its rate of change, world
    W >= |w|      A >= |alpha|      K >= rate of alpha in the body's own axes                   bounds over [t, t + h]

Spin bounds. With I the principal moments, T the kinetic energy of rotation, L = I w, kappa = max |I_i - I_j| / I_k and |tau| the
greater one of both ends,

    W^2  = max of sum x_i  under  sum I_i x_i <= (sqrt(2 T) + h |tau| / sqrt(I_min))^2,
                                  sum I_i^2 x_i >= (|L| - h |tau|)^2,  x_i >= 0
    A   <= |tau| / I_min + kappa W^2 / sqrt(3)                K <= (W |tau| + |tau'|) / I_min + 2 kappa W A / sqrt(3)

(x_i = w_i^2; the constraints say that energy and angular momentum change no faster than the torque lets them).

Relative motion. Let d = x_b - x_a, w = w_b - w_a, and r a point of B from x_b. In the frame of A, at the instant (all
exact),

    u   = v_b - v_a - w_a x d                                                     y'  = u + w x r
    c   = acc_b - acc_a - alpha_a x d - 2 w_a x (v_b - v_a) + w_a x (w_a x d)     y'' = c + beta x r + w x (w x r)
    beta = alpha_b - alpha_a - w_a x w_b                                          |y'''| <= J_c + J_r |r|

Both y' and y'' vanish for bodies that move as one. Capitals bound the letters over [0, h] (D: d, U: u, C: c, O: w, B:
beta):

    J_c = |jerk_b - jerk_a| + W_a |acc_b - acc_a| + 3 A_a U + 2 W_a C + K_a D + 2 A_a W_a D + W_a^2 U
    J_r = B' + 3 O B + O^3,   B' = K_a + K_b + O (A_a + A_b) + W_a B

|acc_b - acc_a| is the greater one of both ends. The bounds start from direct sums and are tightened by X <- min(X, |X(0)| + h X').
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from rigidimpulse.core.kernels import jit, jit_making_arrays
from rigidimpulse.core.quaternion import quaternion_to_matrix
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.core.vector import along, cross, dot, length, subtract
from rigidimpulse.motion.trajectory import FIXED, FORCED, JERK, LINEAR, PRESCRIBED, TORQUE_RATE, motion_at, rate_of, row_at

# Offsets are numpy integers because numba would compile a kernel again for every literal int that it is called with.

POSITION, VELOCITY, SPIN, ACCELERATION, SPIN_RATE, AXES, ORIENTATION = np.array([0, 3, 6, 9, 12, 15, 24])
SPIN_BOUND, SPIN_RATE_BOUND, JERK_BOUND, CENTRE_JERK, MOTION_SIZE = np.array([28, 29, 30, 31, 34])
"""Offsets into the record of a body: x, v, w, acc, alpha (3 each), rotation matrix (9), quaternion (4), W, A, K, jerk (3)."""

SEEN_VELOCITY, SEEN_SPIN, SEEN_ACCELERATION, SEEN_TURN, SEEN_JERK, SEEN_ARM_JERK = np.array([0, 3, 6, 9, 12, 13])
SEEN_SPIN_SIZE, SEEN_TURN_SIZE, SEEN_SIZE = np.array([14, 15, 16])
"""Offsets into the record of a relative motion: u, w, c, beta (3 each), J_c, J_r, |w|, and |beta| + w^2, which bounds
the part of y'' that grows with r."""

_TIGHTENINGS = 4
_WIDEN = 1.0 + TOLERANCES.time_of_impact.bound_round_off
_ROUND_OFF = TOLERANCES.arithmetic.round_off
_EQUAL_MOMENTS = TOLERANCES.inertia.equal_moments


@jit
def vector(work, at):
    """Return three neighbouring entries of an array."""
    return work[at], work[at + 1], work[at + 2]


@jit
def put(work, at, v):
    """Write a vector to three neighbouring entries of an array."""
    work[at] = v[0]
    work[at + 1] = v[1]
    work[at + 2] = v[2]


@jit
def turned(work, at, v):
    """Return M v for the matrix stored row by row in nine neighbouring entries."""
    return (
        work[at] * v[0] + work[at + 1] * v[1] + work[at + 2] * v[2],
        work[at + 3] * v[0] + work[at + 4] * v[1] + work[at + 5] * v[2],
        work[at + 6] * v[0] + work[at + 7] * v[1] + work[at + 8] * v[2],
    )


@jit
def turned_back(work, at, v):
    """Return M^T v for the matrix stored row by row in nine neighbouring entries."""
    return (
        work[at] * v[0] + work[at + 3] * v[1] + work[at + 6] * v[2],
        work[at + 1] * v[0] + work[at + 4] * v[1] + work[at + 7] * v[2],
        work[at + 2] * v[0] + work[at + 5] * v[1] + work[at + 8] * v[2],
    )


@jit
def _edge_of_region(first, second, energy, momentum):
    """Sum of the x_i where both constraints are met and only two x_i are not zero; 0 if that is outside."""
    if abs(first - second) <= _EQUAL_MOMENTS * max(first, second):
        return 0.0
    x_first = (energy * second - momentum) / (first * (second - first))
    x_second = (momentum - energy * first) / (second * (second - first))
    return x_first + x_second if x_first >= 0.0 and x_second >= 0.0 else 0.0


@jit
def _fastest_spin(moments, energy, momentum):
    """W from the moments, the bound of 2 T and the bound of |L|^2: the largest sum lies at a corner of its region."""
    i, j, k = moments
    least = momentum * (1.0 - _ROUND_OFF)
    best = energy / i if i * energy >= least else 0.0
    best = max(best, energy / j if j * energy >= least else 0.0)
    best = max(best, energy / k if k * energy >= least else 0.0)
    best = max(best, _edge_of_region(i, j, energy, momentum), _edge_of_region(j, k, energy, momentum))
    return sqrt(max(best, _edge_of_region(k, i, energy, momentum)))


@jit
def _write_spin_bounds(moments, torque_world, torque_rate, horizon, record):
    """Write alpha, W, A and K of a body that turns freely or under a torque that changes at `torque_rate`."""
    spin, torque = turned_back(record, AXES, vector(record, SPIN)), turned_back(record, AXES, torque_world)
    i, j, k = moments
    momentum = (i * spin[0], j * spin[1], k * spin[2])
    moment_of_force = subtract(torque, cross(spin, momentum))
    rate = (moment_of_force[0] / i, moment_of_force[1] / j, moment_of_force[2] / k)
    put(record, SPIN_RATE, turned(record, AXES, rate))

    least = min(i, j, k)
    kappa = max(abs(i - j) / k, abs(j - k) / i, abs(k - i) / j)
    torque_size, spin_now, rate_now = length(torque), length(spin), length(rate)
    # |tau| is the greater one of both ends.
    torque_size = max(torque_size, length(turned_back(record, AXES, along(torque_world, horizon, torque_rate))))
    kick, kick_rate = torque_size / least, length(torque_rate) / least
    # Energy and angular momentum change no faster than the torque lets them.
    energy = (sqrt(dot(spin, momentum)) + horizon * torque_size / sqrt(least)) ** 2
    spin_bound = max(_fastest_spin(moments, energy, max(length(momentum) - horizon * torque_size, 0.0) ** 2), spin_now)
    rate_bound = 0.0
    jerk_bound = 0.0
    # Each bound tightens the others: X <- min(X, |X(0)| + h X').
    for _ in range(_TIGHTENINGS):
        rate_bound = kick + kappa * spin_bound * spin_bound / sqrt(3.0)
        jerk_bound = spin_bound * kick + 2.0 / sqrt(3.0) * kappa * spin_bound * rate_bound + kick_rate
        rate_bound = max(rate_now, min(rate_bound, rate_now + horizon * jerk_bound))
        spin_bound = max(spin_now, min(spin_bound, spin_now + horizon * rate_bound))
    record[SPIN_BOUND] = spin_bound * _WIDEN
    record[SPIN_RATE_BOUND] = rate_bound * _WIDEN
    record[JERK_BOUND] = jerk_bound * _WIDEN


@jit_making_arrays
def motion_bound(trajectory, i, t, horizon, record):
    """Write the motion of body i at time t, with bounds that hold until t + horizon, into record (MOTION_SIZE,).

    Works for every mode of a trajectory: fixed, prescribed, free, and turning under a world torque.
    """
    motion_at(
        trajectory, i, t, record[POSITION:VELOCITY], record[ORIENTATION:SPIN_BOUND], record[VELOCITY:SPIN], record[SPIN:ACCELERATION]
    )
    quaternion_to_matrix(record[ORIENTATION:SPIN_BOUND], record[AXES:ORIENTATION].reshape((3, 3)))
    mode, s = trajectory.mode[i], t - trajectory.start[i]
    none = (0.0, 0.0, 0.0)
    growth = rate_of(trajectory, i, JERK)
    put(record, ACCELERATION, none if mode == FIXED else row_at(trajectory.acceleration, i, growth, s))
    put(record, CENTRE_JERK, none if mode == FIXED else growth)
    if mode == FIXED or mode == PRESCRIBED or mode == LINEAR:
        # The spin is constant in the world.
        put(record, SPIN_RATE, none)
        record[SPIN_BOUND] = length(vector(record, SPIN))
        record[SPIN_RATE_BOUND] = 0.0
        record[JERK_BOUND] = 0.0
        return
    moments = (trajectory.inertia[i, 0], trajectory.inertia[i, 1], trajectory.inertia[i, 2])
    torque_rate = rate_of(trajectory, i, TORQUE_RATE)
    torque = row_at(trajectory.torque, i, torque_rate, s) if mode == FORCED else none
    _write_spin_bounds(moments, torque, torque_rate, horizon, record)


@jit
def stop_turning(record):
    """Take the rotation out of a motion record: for a sphere about its own centre, on which no rotation can be seen."""
    for k in range(SPIN_RATE, ORIENTATION):
        record[k] = 0.0
    put(record, SPIN, (0.0, 0.0, 0.0))
    record[AXES] = record[AXES + 4] = record[AXES + 8] = 1.0
    record[SPIN_BOUND] = record[SPIN_RATE_BOUND] = record[JERK_BOUND] = 0.0


@jit
def _centre_jerk(turning, seen, pulls, horizon):
    """J_c from turning = (W, A, K) of the carrier, seen = (|d|, largest |v_b - v_a|, |u|, |c|) and pulls.

    pulls: (largest |acc_b - acc_a|, |jerk_b - jerk_a|).
    """
    spin, rate, jerk = turning
    distance, speed, velocity, acceleration = seen
    pull, pull_rate = pulls
    # A frame that does not turn adds nothing.
    if spin == 0.0 and rate == 0.0:
        return pull_rate * _WIDEN
    far = distance + horizon * speed
    fast = speed + spin * far
    bend = pull + 2.0 * spin * speed + (rate + spin * spin) * far
    result = 0.0
    for _ in range(_TIGHTENINGS):
        far = min(far, distance + horizon * fast)
        result = (
            spin * pull + 3.0 * rate * fast + 2.0 * spin * bend + (jerk + 2.0 * rate * spin) * far + spin * spin * fast
        )
        result += pull_rate
        # Tightened by X <- min(X, |X(0)| + h X').
        bend = max(acceleration, min(bend, acceleration + horizon * result))
        fast = max(velocity, min(fast, velocity + horizon * bend))
    return result * _WIDEN


@jit
def _arm_jerk(spin_carrier, spin, rate, jerk, spin_now, turn_now, horizon):
    """J_r from W of the carrier, sums of W, A and K of both bodies, and the present |w| and |beta|."""
    turn = rate + spin_carrier * spin
    turn_rate = 0.0
    for _ in range(_TIGHTENINGS):
        turn_rate = jerk + spin * rate + spin_carrier * turn
        turn = max(turn_now, min(turn, turn_now + horizon * turn_rate))
        spin = max(spin_now, min(spin, spin_now + horizon * turn))
    return (turn_rate + 3.0 * spin * turn + spin * spin * spin) * _WIDEN


@jit
def relative_motion(work, carrier, other, axes, horizon, seen):
    """Write how the points of one body move as seen from another, its carrier, into the record at `seen`.

    Args:
        work: float array that holds all records.
        carrier: where the motion of the body begins that carries the frame (A above).
        other: where that of the body begins that is seen (B above).
        axes: likewise the body in whose axes the result is written; arms r are given in these axes too.
        horizon: s, the span over which the jerk bounds hold.
        seen: where the result begins.

    """
    d = subtract(vector(work, other + POSITION), vector(work, carrier + POSITION))
    dv = subtract(vector(work, other + VELOCITY), vector(work, carrier + VELOCITY))
    pull = subtract(vector(work, other + ACCELERATION), vector(work, carrier + ACCELERATION))
    spin_a, spin_b = vector(work, carrier + SPIN), vector(work, other + SPIN)
    rate_a, rate_b = vector(work, carrier + SPIN_RATE), vector(work, other + SPIN_RATE)
    u = subtract(dv, cross(spin_a, d))
    w = subtract(spin_b, spin_a)
    c = along(subtract(pull, cross(rate_a, d)), -1.0, cross(spin_a, along(u, 1.0, dv)))
    beta = subtract(subtract(rate_b, rate_a), cross(spin_a, spin_b))
    put(work, seen + SEEN_VELOCITY, turned_back(work, axes + AXES, u))
    put(work, seen + SEEN_SPIN, turned_back(work, axes + AXES, w))
    put(work, seen + SEEN_ACCELERATION, turned_back(work, axes + AXES, c))
    put(work, seen + SEEN_TURN, turned_back(work, axes + AXES, beta))

    spin, rate, jerk = work[carrier + SPIN_BOUND], work[carrier + SPIN_RATE_BOUND], work[carrier + JERK_BOUND]
    growth = subtract(vector(work, other + CENTRE_JERK), vector(work, carrier + CENTRE_JERK))
    most, growing = max(length(pull), length(along(pull, horizon, growth))), length(growth)
    speed = max(length(dv), length(along(dv, horizon, along(pull, 0.5 * horizon, growth))))
    speed += 0.125 * horizon * horizon * growing  # what the path of a velocity bulges beyond its chord
    distances = (length(d), speed, length(u), length(c))
    work[seen + SEEN_JERK] = _centre_jerk((spin, rate, jerk), distances, (most, growing), horizon)
    both_spins, both_rates = spin + work[other + SPIN_BOUND], rate + work[other + SPIN_RATE_BOUND]
    both_jerks, spin_now, turn_now = jerk + work[other + JERK_BOUND], length(w), length(beta)
    work[seen + SEEN_ARM_JERK] = _arm_jerk(spin, both_spins, both_rates, both_jerks, spin_now, turn_now, horizon)
    work[seen + SEEN_SPIN_SIZE] = spin_now
    work[seen + SEEN_TURN_SIZE] = turn_now + spin_now * spin_now


@jit
def seen_motion(work, seen, r):
    """Return y' and y'' of the point at arm r."""
    w = vector(work, seen + SEEN_SPIN)
    turning = cross(w, r)
    bending = along(cross(vector(work, seen + SEEN_TURN), r), 1.0, cross(w, turning))
    return (
        along(vector(work, seen + SEEN_VELOCITY), 1.0, turning),
        along(vector(work, seen + SEEN_ACCELERATION), 1.0, bending),
    )
