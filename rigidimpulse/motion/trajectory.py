"""The trajectory of every body: its exact path since the last time that something acted on it.

    x(t) = x0 + v0 s + 1/2 a s^2 + 1/6 j s^3,    v(t) = v0 + a s + 1/2 j s^2,    s = t - start
    rotation, by mode:
      FIXED        none, the body never moves
      PRESCRIBED   q(t) = exp(w0 s) q0, constant world angular velocity
      FREE         no torque: closed form (free_rotation)
      FORCED       world torque tau0 + tau1 s: power series (forced_rotation)
      LINEAR       as PRESCRIBED, with a constant acceleration: the path to a pose that the sub-stepped solver found; the body's own
                   velocities run from those at the start to those at the end of the step

The search for impacts and the motion both read the path here, so the impact time and the motion cannot disagree. A row is set
by its owner (all columns, and of `top` the rates at its end), then made ready by `begin`. Evaluation only reads; it may be called
in any order.

A force F(s) and a torque that vary over a stretch of length h enter by their two moments, F for instance by

    M0 = integral of F ds,   M1 = integral of (h - s) F ds,   m a = (6 M1 / h - 2 M0) / h,   m j = (6 M0 - 12 M1 / h) / h^2:

the line that has the same moments leaves v(h) and x(h) as they are, and the rotation to order 4. With forces F_1 ... F_4 of a
step of the classical Runge-Kutta method, M0 = h (F_1 + 2 F_2 + 2 F_3 + F_4) / 6 and M1 = h^2 (F_1 + F_2 + F_3) / 6.
"""

import math
from typing import NamedTuple

import numpy as np

from rigidimpulse.core.kernels import inlined, jit
from rigidimpulse.core.memory import reserve
from rigidimpulse.core.quaternion import exponential, product
from rigidimpulse.motion import forced_rotation, free_rotation

FIXED, PRESCRIBED, FREE, FORCED, LINEAR = 0, 1, 2, 3, 4

SPEEDS, LENGTH = 8, 20
"""Places in a row of `Trajectories.top` in mode LINEAR, after the constants of a fixed axis: see `Trajectories.linear`."""
JERK, TORQUE_RATE, TOP_SIZE = max(free_rotation.FREE_ROTATION_SIZE, forced_rotation.FORCED_ROTATION_SIZE) + np.array([0, 3, 6])
"""Places in a row of `Trajectories.top`, and its length. The constants of the rotation come first."""


class Trajectories(NamedTuple):
    """Paths of n bodies; see the head of the file. Vectors in the world frame, inertia in the principal frame."""

    start: np.ndarray
    """(n,) s, time of the last change of the trajectory"""
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
    torque: np.ndarray
    """(n, 3) N m at `start`; read in mode FORCED only"""
    mode: np.ndarray
    """(n,) int64: FIXED, PRESCRIBED, FREE, FORCED, LINEAR"""
    inertia: np.ndarray
    """(n, 3) kg m^2, principal moments; read where the mode is FREE or FORCED, to rotate the body"""
    top: np.ndarray
    """(n, TOP_SIZE) constants of the rotation, written by `begin`, and from SPEEDS on those of mode LINEAR, then jerk and torque rate
    (arrays of their own would cost every kernel that gets trajectories some 3 % of its time)"""
    series: np.ndarray
    """(n, SERIES_SIZE) the rotation in mode FORCED, written by `begin`; rows of others are never touched, so that they take no memory"""

    @property
    def linear(self) -> np.ndarray:
        """(n, 13) velocities at `start` (6), their changes until the step ends (6), and its length, s, a view; read in mode LINEAR"""
        return self.top[:, SPEEDS : LENGTH + 1]

    @property
    def jerk(self) -> np.ndarray:
        """(n, 3) m/s^3, constant, a view; 0 in modes FIXED and LINEAR: `begin` sets it."""
        return self.top[:, JERK:TORQUE_RATE]

    @property
    def torque_rate(self) -> np.ndarray:
        """(n, 3) N m/s, constant, a view; 0 except in mode FORCED: `begin` sets it."""
        return self.top[:, TORQUE_RATE:]


def make_trajectories(num_bodies: int) -> Trajectories:
    """Trajectories of `num_bodies` bodies, all FIXED at the origin at time 0, with unit inertia."""
    orientation = np.zeros((num_bodies, 4))
    orientation[:, 0] = 1.0

    def vectors() -> np.ndarray:
        return np.zeros((num_bodies, 3))

    return Trajectories(
        start=np.zeros(num_bodies),
        position=vectors(),
        orientation=orientation,
        velocity=vectors(),
        angular_velocity=vectors(),
        acceleration=vectors(),
        torque=vectors(),
        mode=np.zeros(num_bodies, dtype=np.int64),
        inertia=np.ones((num_bodies, 3)),
        top=np.zeros((num_bodies, TOP_SIZE)),
        series=reserve((num_bodies, forced_rotation.SERIES_SIZE), np.float64),  # of most bodies never touched
    )


@jit
def begin(trajectory, i):
    """Prepare `trajectory.top[i]`; call it after any other column of row i has changed. Rates that the mode does not have are set to 0."""
    mode = trajectory.mode[i]
    if mode == PRESCRIBED or mode == LINEAR:
        begin_straight(trajectory, i)
        return
    if mode != FORCED:
        for k in range(TORQUE_RATE if mode == FREE else JERK, TOP_SIZE):
            trajectory.top[i, k] = 0.0
    inertia, q, w, top = trajectory.inertia[i], trajectory.orientation[i], trajectory.angular_velocity[i], trajectory.top[i]
    # A torque of round-off is none: the body then rotates freely.
    if mode == FORCED and forced_rotation.prepare(inertia, q, w, trajectory.torque[i], top[TORQUE_RATE:], top, trajectory.series[i]):
        return
    if mode == FREE or mode == FORCED:
        free_rotation.prepare(inertia, q, w, top)


@inlined
def begin_straight(trajectory, i):
    """The same in modes PRESCRIBED and LINEAR: apart, so that it is compiled into loops over thousands of bodies."""
    for k in range(TORQUE_RATE if trajectory.mode[i] == PRESCRIBED else JERK, TOP_SIZE):
        trajectory.top[i, k] = 0.0
    free_rotation.keep_axis(trajectory.orientation[i], trajectory.angular_velocity[i], trajectory.top[i])


class Load(NamedTuple):
    """What acts on one body from an instant on: it grows in proportion to time."""

    acceleration: np.ndarray  # (3,) m/s^2 at the instant
    torque: np.ndarray  # (3,) N m at the instant
    jerk: np.ndarray  # (3,) m/s^3
    torque_rate: np.ndarray  # (3,) N m/s


@jit
def take(trajectory, i, time, bodies, load, mode):
    """Let body i go on from its present state, at `time`, in a mode and under a `Load`."""
    trajectory.start[i] = time
    trajectory.mode[i] = mode
    for k in range(3):
        trajectory.position[i, k] = bodies.position[i, k]
        trajectory.velocity[i, k] = bodies.velocity[i, k]
        trajectory.angular_velocity[i, k] = bodies.angular_velocity[i, k]
        trajectory.acceleration[i, k] = load.acceleration[k]
        trajectory.torque[i, k] = load.torque[k]
        trajectory.top[i, JERK + k] = load.jerk[k]
        trajectory.top[i, TORQUE_RATE + k] = load.torque_rate[k]
    for k in range(4):
        trajectory.orientation[i, k] = bodies.orientation[i, k]
    begin(trajectory, i)


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
def rate_of(trajectory, i, which):
    """JERK or TORQUE_RATE of body i as three numbers."""
    return trajectory.top[i, which], trajectory.top[i, which + 1], trajectory.top[i, which + 2]


@jit
def row_at(values, i, rate, s):
    """Row i of an array (n, 3) that grows by `rate` (three numbers) a second, after s: three numbers."""
    x, y, z = values[i, 0], values[i, 1], values[i, 2]
    a, b, c = rate
    # Adding nothing could still turn -0 into 0.
    return (x + s * a, y + s * b, z + s * c) if a != 0.0 or b != 0.0 or c != 0.0 else (x, y, z)


@jit
def _moved(x, v, a, j, s):
    """x + v s + a s^2 / 2 + j s^3 / 6."""
    # Adding nothing could still turn -0 into 0: a body that stays keeps its very bits.
    if j != 0.0:
        a += s * j / 3.0
    displacement = s * (v + 0.5 * s * a)
    return x + displacement if displacement != 0.0 else x


@jit
def place_at(trajectory, i, t, x_out):
    """Write the position (3,) of body i at the time t >= start."""
    s = t - trajectory.start[i] if trajectory.mode[i] != FIXED else 0.0
    for k in range(3):
        a, jerk = trajectory.acceleration[i, k], trajectory.top[i, JERK + k]
        x_out[k] = _moved(trajectory.position[i, k], trajectory.velocity[i, k], a, jerk, s)


@jit
def pose_at(trajectory, i, t, x_out, q_out):
    """Write position (3,) and quaternion (4,) of body i at the time t >= start."""
    place_at(trajectory, i, t, x_out)
    s = t - trajectory.start[i] if trajectory.mode[i] != FIXED else 0.0
    if s == 0.0:
        for k in range(4):
            q_out[k] = trajectory.orientation[i, k]
    else:
        q_out[0], q_out[1], q_out[2], q_out[3], _, _, _ = forced_rotation.rotation(trajectory.top[i], trajectory.series[i], s)


@jit
def state_at(trajectory, i, t, x_out, q_out, v_out, w_out):
    """Write position, quaternion, velocity (3,) and world angular velocity (3,) of body i at the time t >= start."""
    if trajectory.mode[i] == LINEAR:
        x, q, v, w = stepped_at(trajectory, i, t)
        x_out[0], x_out[1], x_out[2] = x
        q_out[0], q_out[1], q_out[2], q_out[3] = q
        v_out[0], v_out[1], v_out[2] = v
        w_out[0], w_out[1], w_out[2] = w
    else:
        motion_at(trajectory, i, t, x_out, q_out, v_out, w_out)


@inlined
def stepped_at(trajectory, i, t):
    """Position, quaternion, velocity and angular velocity, three and four numbers each, of body i in mode LINEAR.

    Sub-stepped islands have thousands of such bodies. It returns numbers, because a view of an array costs more than the computation.
    """
    s = t - trajectory.start[i]
    top = trajectory.top
    # The body's own velocities change evenly over the step, while the path runs straight to the pose.
    share = min(s / top[i, LENGTH], 1.0)
    x = (
        _moved(trajectory.position[i, 0], trajectory.velocity[i, 0], trajectory.acceleration[i, 0], 0.0, s),
        _moved(trajectory.position[i, 1], trajectory.velocity[i, 1], trajectory.acceleration[i, 1], 0.0, s),
        _moved(trajectory.position[i, 2], trajectory.velocity[i, 2], trajectory.acceleration[i, 2], 0.0, s),
    )
    q = (trajectory.orientation[i, 0], trajectory.orientation[i, 1], trajectory.orientation[i, 2], trajectory.orientation[i, 3])
    wx, wy, wz = trajectory.angular_velocity[i, 0], trajectory.angular_velocity[i, 1], trajectory.angular_velocity[i, 2]
    if s != 0.0 and (wx != 0.0 or wy != 0.0 or wz != 0.0):
        e0, e1, e2, e3 = exponential(s * wx, s * wy, s * wz)
        norm = math.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
        q = product(e0, e1, e2, e3, q[0] / norm, q[1] / norm, q[2] / norm, q[3] / norm)
    v = (
        top[i, SPEEDS] + share * top[i, SPEEDS + 6],
        top[i, SPEEDS + 1] + share * top[i, SPEEDS + 7],
        top[i, SPEEDS + 2] + share * top[i, SPEEDS + 8],
    )
    w = (
        top[i, SPEEDS + 3] + share * top[i, SPEEDS + 9],
        top[i, SPEEDS + 4] + share * top[i, SPEEDS + 10],
        top[i, SPEEDS + 5] + share * top[i, SPEEDS + 11],
    )
    return x, q, v, w


@jit
def motion_at(trajectory, i, t, x_out, q_out, v_out, w_out):
    """The same, with the velocities of the path: those by which pose changes. They differ in mode LINEAR only."""
    moves = trajectory.mode[i] != FIXED
    s = t - trajectory.start[i] if moves else 0.0
    mean = row_at(trajectory.acceleration, i, rate_of(trajectory, i, JERK), 0.5 * s)
    for k in range(3):
        a, jerk = trajectory.acceleration[i, k], trajectory.top[i, JERK + k]
        x_out[k] = _moved(trajectory.position[i, k], trajectory.velocity[i, k], a, jerk, s)
        v_out[k] = trajectory.velocity[i, k] + s * mean[k] if moves else 0.0
        w_out[k] = trajectory.angular_velocity[i, k] if moves else 0.0
    if s == 0.0:
        for k in range(4):
            q_out[k] = trajectory.orientation[i, k]
    else:
        q0, q1, q2, q3, wx, wy, wz = forced_rotation.rotation(trajectory.top[i], trajectory.series[i], s)
        q_out[0], q_out[1], q_out[2], q_out[3] = q0, q1, q2, q3
        w_out[0], w_out[1], w_out[2] = wx, wy, wz
