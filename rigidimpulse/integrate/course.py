"""The course of every body: its exact path since the last time that something acted on it.

    x(t) = x0 + v0 s + 1/2 a s^2,    v(t) = v0 + a s,    s = t - start
    rotation, by mode:
      FIXED        none, the body never moves
      PRESCRIBED   q(t) = exp(w0 s) q0, constant velocity and world angular velocity (acceleration is not read)
      FREE         no torque: closed form (free_top)
      FORCED       constant world torque: power series (forced_top)

The sweep and the integration both read the path here, so the impact time and the motion cannot disagree. A row is set by
its owner (all columns but `top`), then made ready by `begin`. Evaluation reads only; it may be called in any order.
"""

from typing import NamedTuple

import numpy as np

from rigidimpulse._jit import jit
from rigidimpulse.integrate import forced_top, free_top
from rigidimpulse.rotation import rotated_by_vector

FIXED, PRESCRIBED, FREE, FORCED = 0, 1, 2, 3

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
    """(n, 3) m/s^2, constant"""
    torque: np.ndarray
    """(n, 3) N m, constant; read in mode FORCED only"""
    mode: np.ndarray
    """(n,) int64: FIXED, PRESCRIBED, FREE, FORCED"""
    inertia: np.ndarray
    """(n, 3) kg m^2, principal moments; read in modes FREE and FORCED"""
    top: np.ndarray
    """(n, TOP_SIZE) constants of the rotation, written by `begin`"""


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
        torque=vectors(),
        mode=np.zeros(num_bodies, dtype=np.int64),
        inertia=np.ones((num_bodies, 3)),
        top=np.zeros((num_bodies, TOP_SIZE)),
    )


@jit
def begin(course, i):
    """Prepare `course.top[i]`; call it after any other column of row i has changed."""
    mode = course.mode[i]
    if mode == FREE:
        free_top.prepare(course.inertia[i], course.orientation[i], course.angular_velocity[i], course.top[i])
    elif mode == FORCED:
        forced_top.prepare(
            course.inertia[i], course.orientation[i], course.angular_velocity[i], course.torque[i], course.top[i]
        )


@jit
def _rotation_at(course, i, s):
    """Quaternion and world angular velocity at s seconds after the start, seven numbers."""
    q = course.orientation[i]
    w = course.angular_velocity[i]
    mode = course.mode[i]
    if mode == FREE and s != 0.0:
        return free_top.rotation(course.top[i], s)
    if mode == FORCED and s != 0.0:
        return forced_top.rotation(course.top[i], s)
    if mode == PRESCRIBED and (w[0] != 0.0 or w[1] != 0.0 or w[2] != 0.0):
        q0, q1, q2, q3 = rotated_by_vector(s * w[0], s * w[1], s * w[2], q[0], q[1], q[2], q[3])
        return q0, q1, q2, q3, w[0], w[1], w[2]
    return q[0], q[1], q[2], q[3], w[0], w[1], w[2]


@jit
def _position_at(course, i, s, x_out):
    for k in range(3):
        displacement = 0.0
        if course.mode[i] == PRESCRIBED:
            displacement = s * course.velocity[i, k]
        elif course.mode[i] != FIXED:
            displacement = s * (course.velocity[i, k] + 0.5 * s * course.acceleration[i, k])
        # A body that stays keeps its very bits, the sign of a zero included.
        x_out[k] = course.position[i, k] if displacement == 0.0 else course.position[i, k] + displacement


@jit
def pose_at(course, i, t, x_out, q_out):
    """Write position (3,) and quaternion (4,) of body i at the time t >= start."""
    s = t - course.start[i]
    _position_at(course, i, s, x_out)
    q_out[0], q_out[1], q_out[2], q_out[3], _, _, _ = _rotation_at(course, i, s)


@jit
def state_at(course, i, t, x_out, q_out, v_out, w_out):
    """Write position, quaternion, velocity (3,) and world angular velocity (3,) of body i at the time t >= start."""
    s = t - course.start[i]
    _position_at(course, i, s, x_out)
    q_out[0], q_out[1], q_out[2], q_out[3], w_out[0], w_out[1], w_out[2] = _rotation_at(course, i, s)
    mode = course.mode[i]
    for k in range(3):
        v_out[k] = course.velocity[i, k]
        if mode == FREE or mode == FORCED:
            v_out[k] += s * course.acceleration[i, k]
        elif mode == FIXED:
            v_out[k] = 0.0
            w_out[k] = 0.0
