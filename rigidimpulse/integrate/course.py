"""The course of every body: its exact path since the last time that something acted on it.

    x(t) = x0 + v0 s + 1/2 a s^2 + 1/6 j s^3,    v(t) = v0 + a s + 1/2 j s^2,    s = t - start
    rotation, by mode:
      FIXED        none, the body never moves
      PRESCRIBED   q(t) = exp(w0 s) q0, constant velocity and world angular velocity (its acceleration must be 0)
      FREE         no torque: closed form (free_top)
      FORCED       world torque tau0 + tau1 s: power series (forced_top)
      STEPPED      as PRESCRIBED: a straight way to a pose that a heap's solver found; the body's own velocities run from those
                   at the start to those at the end of the step

The sweep and the integration both read the path here, so the impact time and the motion cannot disagree. A row is set
by its owner (all columns but `top`), then made ready by `begin`. Evaluation only reads; it may be called in any order.

A force F(s) and a torque that vary over a stretch of length h enter by their two moments, F for instance by

    M0 = integral of F ds,   M1 = integral of (h - s) F ds,   m a = (6 M1 / h - 2 M0) / h,   m j = (6 M0 - 12 M1 / h) / h^2:

the line that has the same moments leaves v(h) and x(h) as they are, and the rotation to order 4. With forces F_1 ... F_4 of a
step of the classical Runge-Kutta method, M0 = h (F_1 + 2 F_2 + 2 F_3 + F_4) / 6 and M1 = h^2 (F_1 + F_2 + F_3) / 6.
"""

import math
from typing import NamedTuple

import numpy as np

from rigidimpulse._jit import jit
from rigidimpulse.integrate import forced_top, free_top

FIXED, PRESCRIBED, FREE, FORCED, STEPPED = 0, 1, 2, 3, 4

TOP_SIZE = max(free_top.FREE_TOP_SIZE, forced_top.FORCED_TOP_SIZE)
"""Length of a row of `Course.top`."""


class Course(NamedTuple):
    """Paths of n bodies; see the head of the file. Vectors in the world frame, inertia in the principal frame."""

    start: np.ndarray
    """(n,) s, time of the last change of course"""
    position: np.ndarray
    """(n, 3) m, centre of mass at `start`"""
    orientation: np.ndarray
    """(n, 4) unit quaternion of the principal frame at `start`"""
    velocity: np.ndarray
    """(n, 3) m/s at `start`"""
    angular_velocity: np.ndarray
    """(n, 3) rad/s at `start`"""
    acceleration: np.ndarray
    """(n, 3) m/s^2 at `start`"""
    jerk: np.ndarray
    """(n, 3) m/s^3, constant; read in modes FREE and FORCED only"""
    torque: np.ndarray
    """(n, 3) N m at `start`; read in mode FORCED only"""
    torque_rate: np.ndarray
    """(n, 3) N m/s, constant; read in mode FORCED only"""
    mode: np.ndarray
    """(n,) int64: FIXED, PRESCRIBED, FREE, FORCED, STEPPED"""
    inertia: np.ndarray
    """(n, 3) kg m^2, principal moments; read in modes FREE and FORCED"""
    top: np.ndarray
    """(n, TOP_SIZE) constants of the rotation, written by `begin`"""
    stepped: np.ndarray
    """(n, 13) velocity and angular velocity at `start`, their changes until the end of the step, and its length, s; read in mode STEPPED"""


def make_course(num_bodies: int) -> Course:
    """A course of `num_bodies` bodies, all FIXED at the origin at time 0, with unit inertia."""
    orientation = np.zeros((num_bodies, 4))
    orientation[:, 0] = 1.0

    def vectors() -> np.ndarray:
        return np.zeros((num_bodies, 3))

    return Course(
        start=np.zeros(num_bodies),
        position=vectors(),
        orientation=orientation,
        velocity=vectors(),
        angular_velocity=vectors(),
        acceleration=vectors(),
        jerk=vectors(),
        torque=vectors(),
        torque_rate=vectors(),
        mode=np.zeros(num_bodies, dtype=np.int64),
        inertia=np.ones((num_bodies, 3)),
        top=np.zeros((num_bodies, TOP_SIZE)),
        stepped=np.zeros((num_bodies, 13)),
    )


@jit
def begin(course, i):
    """Prepare `course.top[i]`; call it after any other column of row i has changed."""
    mode = course.mode[i]
    inertia, q, w, top = course.inertia[i], course.orientation[i], course.angular_velocity[i], course.top[i]
    if mode == FORCED and forced_top.prepare(inertia, q, w, course.torque[i], course.torque_rate[i], top):
        return
    if mode == FREE or mode == FORCED:
        free_top.prepare(inertia, q, w, top)
    elif mode == PRESCRIBED or mode == STEPPED:
        free_top.keep_axis(q, w, top)


@jit
def _start_pose(course, i, x_out, q_out):
    for k in range(3):
        x_out[k] = course.position[i, k]
    for k in range(4):
        q_out[k] = course.orientation[i, k]


@jit
def jerk_of(course, i):
    """Jerk of body i as three numbers, m/s^3."""
    if course.mode[i] == FREE or course.mode[i] == FORCED:
        return course.jerk[i, 0], course.jerk[i, 1], course.jerk[i, 2]
    return 0.0, 0.0, 0.0


@jit
def torque_rate_of(course, i):
    """Rate of the torque on body i as three numbers, N m/s."""
    if course.mode[i] == FORCED:
        return course.torque_rate[i, 0], course.torque_rate[i, 1], course.torque_rate[i, 2]
    return 0.0, 0.0, 0.0


@jit
def turning_points(rate, bend, growth):
    """Roots of rate + bend s + growth s^2 / 2, growth not 0, the lower one first; inf where there is none.

    They are where a coordinate of a path turns. One may be nan where both are 0.
    """
    square = bend * bend - 2.0 * growth * rate
    if square < 0.0:
        return math.inf, math.inf
    q = -(bend + math.copysign(math.sqrt(square), bend))  # no cancellation
    first, second = q / growth, 2.0 * rate / q
    return (first, second) if first < second else (second, first)


@jit
def _with_rate(values, i, rate, s):
    """Row i of an array (n, 3) plus `rate` (three numbers) times s."""
    x, y, z = values[i, 0], values[i, 1], values[i, 2]
    # Adding nothing could still turn -0 into 0.
    if rate[0] != 0.0 or rate[1] != 0.0 or rate[2] != 0.0:
        return x + s * rate[0], y + s * rate[1], z + s * rate[2]
    return x, y, z


@jit
def acceleration_at(course, i, t):
    """Acceleration of body i at the time t as three numbers, m/s^2; that of a FIXED body is not looked at."""
    return _with_rate(course.acceleration, i, jerk_of(course, i), t - course.start[i])


@jit
def torque_at(course, i, t):
    """Torque on body i at the time t as three numbers, N m; it acts in mode FORCED only."""
    return _with_rate(course.torque, i, torque_rate_of(course, i), t - course.start[i])


@jit
def _add_displacement(course, i, s, x_out):
    varies = course.mode[i] == FREE or course.mode[i] == FORCED
    for k in range(3):
        mean = course.acceleration[i, k]
        if varies and course.jerk[i, k] != 0.0:
            mean += s * course.jerk[i, k] / 3.0
        displacement = s * (course.velocity[i, k] + 0.5 * s * mean)
        # Adding nothing could still turn -0 into 0: a body that stays keeps its very bits.
        if displacement != 0.0:
            x_out[k] += displacement


@jit
def pose_at(course, i, t, x_out, q_out):
    """Write position (3,) and quaternion (4,) of body i at the time t >= start."""
    _start_pose(course, i, x_out, q_out)
    s = t - course.start[i]
    if course.mode[i] != FIXED and s != 0.0:
        _add_displacement(course, i, s, x_out)
        q_out[0], q_out[1], q_out[2], q_out[3], _, _, _ = forced_top.rotation(course.top[i], s)


@jit
def state_at(course, i, t, x_out, q_out, v_out, w_out):
    """Write position, quaternion, velocity (3,) and world angular velocity (3,) of body i at the time t >= start."""
    motion_at(course, i, t, x_out, q_out, v_out, w_out)
    if course.mode[i] == STEPPED:
        line = course.stepped[i]
        share = min((t - course.start[i]) / line[12], 1.0)
        for k in range(3):
            v_out[k] = line[k] + share * line[6 + k]
            w_out[k] = line[3 + k] + share * line[9 + k]


@jit
def motion_at(course, i, t, x_out, q_out, v_out, w_out):
    """The same, with the velocities of the path: those by which pose changes. They differ in mode STEPPED only."""
    _start_pose(course, i, x_out, q_out)
    s = t - course.start[i]
    moves = course.mode[i] != FIXED
    varies = course.mode[i] == FREE or course.mode[i] == FORCED
    for k in range(3):
        mean = course.acceleration[i, k]
        if varies and course.jerk[i, k] != 0.0:
            mean += 0.5 * s * course.jerk[i, k]
        v_out[k] = course.velocity[i, k] + s * mean if moves else 0.0
        w_out[k] = course.angular_velocity[i, k] if moves else 0.0
    if moves and s != 0.0:
        _add_displacement(course, i, s, x_out)
        q0, q1, q2, q3, wx, wy, wz = forced_top.rotation(course.top[i], s)
        q_out[0], q_out[1], q_out[2], q_out[3] = q0, q1, q2, q3
        w_out[0], w_out[1], w_out[2] = wx, wy, wz
