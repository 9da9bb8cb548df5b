"""The course of every body: its exact path since the last time that something acted on it.

    x(t) = x0 + v0 s + 1/2 a s^2,    v(t) = v0 + a s,    s = t - start
    rotation, by mode:
      FIXED        none, the body never moves
      PRESCRIBED   q(t) = exp(w0 s) q0, constant velocity and world angular velocity (its acceleration must be 0)
      FREE         no torque: closed form (free_top)
      FORCED       constant world torque: power series (forced_top)
      STEPPED      as PRESCRIBED: a straight way to a pose that a heap's solver found; the body's own velocities run from those
                   at the start to those at the end of the step

The sweep and the integration both read the path here, so the impact time and the motion cannot disagree. A row is set
by its owner (all columns but `top`), then made ready by `begin`. Evaluation only reads; it may be called in any order.
"""

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
    """(n, 3) m/s^2, constant"""
    torque: np.ndarray
    """(n, 3) N m, constant; read in mode FORCED only"""
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
        torque=vectors(),
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
    if mode == FORCED and forced_top.prepare(inertia, q, w, course.torque[i], top):
        return
    if mode == FREE or mode == FORCED:
        free_top.prepare(inertia, q, w, top)
    elif mode == PRESCRIBED or mode == STEPPED:
        free_top.keep_axis(q, w, top)


@jit
def take(course, i, time, bodies, acceleration, torque, mode):
    """Let body i go on from where it is now, at `time`, with a constant acceleration (3,) m/s^2 and torque (3,) N m, in a mode."""
    course.start[i] = time
    course.mode[i] = mode
    for k in range(3):
        course.position[i, k] = bodies.position[i, k]
        course.velocity[i, k] = bodies.velocity[i, k]
        course.angular_velocity[i, k] = bodies.angular_velocity[i, k]
        course.acceleration[i, k] = acceleration[k]
        course.torque[i, k] = torque[k]
    for k in range(4):
        course.orientation[i, k] = bodies.orientation[i, k]
    begin(course, i)


@jit
def _start_pose(course, i, x_out, q_out):
    for k in range(3):
        x_out[k] = course.position[i, k]
    for k in range(4):
        q_out[k] = course.orientation[i, k]


@jit
def _add_displacement(course, i, s, x_out):
    for k in range(3):
        displacement = s * (course.velocity[i, k] + 0.5 * s * course.acceleration[i, k])
        # Adding nothing could still turn -0 into 0: a body that stays keeps its very bits.
        if displacement != 0.0:
            x_out[k] += displacement


@jit
def place_at(course, i, t, x_out):
    """Write the position (3,) of body i at the time t >= start."""
    for k in range(3):
        x_out[k] = course.position[i, k]
    if course.mode[i] != FIXED:
        _add_displacement(course, i, t - course.start[i], x_out)


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
    for k in range(3):
        v_out[k] = course.velocity[i, k] + s * course.acceleration[i, k] if moves else 0.0
        w_out[k] = course.angular_velocity[i, k] if moves else 0.0
    if moves and s != 0.0:
        _add_displacement(course, i, s, x_out)
        q0, q1, q2, q3, wx, wy, wz = forced_top.rotation(course.top[i], s)
        q_out[0], q_out[1], q_out[2], q_out[3] = q0, q1, q2, q3
        w_out[0], w_out[1], w_out[2] = wx, wy, wz
