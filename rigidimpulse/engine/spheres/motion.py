"""Motion of bodies that turn about a fixed axis, or not at all: balls in free flight, and what stands or is driven evenly.

The operations are those of `motion.trajectory` and `motion.evaluate.bring`, so the results are the same bits, without the
rotation of asymmetric bodies and of bodies under torques, which would have to be compiled into the kernel.
"""

from __future__ import annotations

import numpy as np

from rigidimpulse.core.kernels import inlined, jit, jit_making_arrays
from rigidimpulse.core.quaternion import exponential, product, quaternion_to_matrix
from rigidimpulse.motion.evaluate import world_inverse_inertia
from rigidimpulse.motion.free_rotation import BASE, FIXED_AXIS, KIND, RATE, REST, keep_axis
from rigidimpulse.motion.trajectory import FIXED, FREE, JERK


@jit
def keeps_axis(trajectory, i):
    """Whether body i stands, or turns about a fixed axis."""
    return trajectory.mode[i] == FIXED or trajectory.top[i, KIND] <= FIXED_AXIS


@inlined
def _coordinate(trajectory, i, k, s, moves):
    """Coordinate k of the place and of the velocity after s."""
    # The operations, and their order, are those of `motion.trajectory`: the same bits.
    a, v, x = trajectory.acceleration[i, k], trajectory.velocity[i, k], trajectory.position[i, k]
    displacement = s * (v + 0.5 * s * a)
    return (x + displacement if displacement != 0.0 else x), (v + s * a if moves else 0.0)


@inlined
def _turn(trajectory, i, s, moves):
    """Quaternion and angular velocity after s, as seven numbers."""
    top = trajectory.top
    if s == 0.0:
        q = trajectory.orientation
        q0, q1, q2, q3 = q[i, 0], q[i, 1], q[i, 2], q[i, 3]
        if not moves:
            return q0, q1, q2, q3, 0.0, 0.0, 0.0
        return q0, q1, q2, q3, trajectory.angular_velocity[i, 0], trajectory.angular_velocity[i, 1], trajectory.angular_velocity[i, 2]
    q0, q1, q2, q3 = top[i, BASE], top[i, BASE + 1], top[i, BASE + 2], top[i, BASE + 3]
    if top[i, KIND] == REST:
        return q0, q1, q2, q3, 0.0, 0.0, 0.0
    wx, wy, wz = top[i, RATE], top[i, RATE + 1], top[i, RATE + 2]
    e0, e1, e2, e3 = exponential(s * wx, s * wy, s * wz)
    q0, q1, q2, q3 = product(e0, e1, e2, e3, q0, q1, q2, q3)
    return q0, q1, q2, q3, wx, wy, wz


@inlined
def state_of(trajectory, i, t):
    """As `trajectory.state_at`, for a body that keeps its axis and whose forces do not change; numbers, since views are slower."""
    moves = trajectory.mode[i] != FIXED
    s = t - trajectory.start[i] if moves else 0.0
    x0, v0 = _coordinate(trajectory, i, 0, s, moves)
    x1, v1 = _coordinate(trajectory, i, 1, s, moves)
    x2, v2 = _coordinate(trajectory, i, 2, s, moves)
    q0, q1, q2, q3, w0, w1, w2 = _turn(trajectory, i, s, moves)
    return (x0, x1, x2), (q0, q1, q2, q3), (v0, v1, v2), (w0, w1, w2)


@jit
def bring_ball(motion, i, time):
    """As `touching.bring`, for a body that keeps its axis; what accelerates it is left out."""
    now, trajectory = motion.now, motion.trajectory
    x, q, v, w = state_of(trajectory, i, time)
    now.position[i, 0], now.position[i, 1], now.position[i, 2] = x
    now.orientation[i, 0], now.orientation[i, 1], now.orientation[i, 2], now.orientation[i, 3] = q
    now.velocity[i, 0], now.velocity[i, 1], now.velocity[i, 2] = v
    now.angular_velocity[i, 0], now.angular_velocity[i, 1], now.angular_velocity[i, 2] = w
    quaternion_to_matrix(now.orientation[i], motion.rotation[i])
    if now.inv_mass[i] > 0.0:
        world_inverse_inertia(motion.rotation[i], trajectory.inertia[i], now.inv_inertia[i])


@jit_making_arrays
def begin_free_trajectory(motion, i, time, acceleration):
    """As `trajectory.take` in mode FREE, for a body of equal moments of inertia; acceleration (3,) m/s2."""
    now, trajectory = motion.now, motion.trajectory
    trajectory.start[i], trajectory.mode[i] = time, FREE
    for k in range(3):
        trajectory.position[i, k], trajectory.velocity[i, k] = now.position[i, k], now.velocity[i, k]
        trajectory.angular_velocity[i, k] = now.angular_velocity[i, k]
        trajectory.acceleration[i, k], trajectory.torque[i, k] = acceleration[k], 0.0
    for k in range(4):
        trajectory.orientation[i, k] = now.orientation[i, k]
    trajectory.top[i, JERK:] = 0.0
    keep_axis(trajectory.orientation[i], trajectory.angular_velocity[i], trajectory.top[i])


@jit
def write_frames(trajectory, record, first_body, end_body, time):
    """Write the frames before `time` of bodies that keep their axis, frame by frame: that is the order in which they lie in memory."""
    first, last = np.int64(len(record.times)), np.int64(0)
    for i in range(first_body, end_body):
        if keeps_axis(trajectory, i):
            first = min(first, record.written[i])
    last = first
    while last < len(record.times) and record.times[last] < time:
        last += 1
    position, orientation, velocity, angular_velocity = record.position, record.orientation, record.velocity, record.angular_velocity
    for f in range(first, last):
        for i in range(first_body, end_body):
            if record.written[i] <= f and keeps_axis(trajectory, i):
                x, q, v, w = state_of(trajectory, i, record.times[f])
                position[f, i, 0], position[f, i, 1], position[f, i, 2] = x
                orientation[f, i, 0], orientation[f, i, 1], orientation[f, i, 2], orientation[f, i, 3] = q
                velocity[f, i, 0], velocity[f, i, 1], velocity[f, i, 2] = v
                angular_velocity[f, i, 0], angular_velocity[f, i, 1], angular_velocity[f, i, 2] = w
    for i in range(first_body, end_body):
        if keeps_axis(trajectory, i):
            record.written[i] = max(record.written[i], last)
