"""Motion of bodies that turn about a fixed axis, or not at all: balls in free flight, and what stands or is driven evenly.

The operations are those of `integrate.course` and `detect.touching.bring`, so the results are the same bits, without the
paths of tops and of bodies under torques, which would have to be compiled into the kernel.
"""

from __future__ import annotations

import numpy as np

from rigidimpulse._jit import jit
from rigidimpulse.detect.touching import world_inverse_inertia
from rigidimpulse.integrate.course import FIXED, FREE, JERK
from rigidimpulse.integrate.free_top import BASE, FIXED_AXIS, KIND, RATE, REST, keep_axis
from rigidimpulse.rotation import exponential, product, quaternion_to_matrix


@jit
def keeps_axis(course, i):
    """Whether body i stands, or turns about a fixed axis."""
    return course.mode[i] == FIXED or course.top[i, KIND] <= FIXED_AXIS


@jit
def write_state(course, i, t, x_out, q_out, v_out, w_out):
    """As `course.state_at`, for a body that keeps its axis and whose forces do not change."""
    moves = course.mode[i] != FIXED
    s = t - course.start[i] if moves else 0.0
    for k in range(3):
        a, v = course.acceleration[i, k], course.velocity[i, k]
        displacement = s * (v + 0.5 * s * a)
        x_out[k] = course.position[i, k] + displacement if displacement != 0.0 else course.position[i, k]
        v_out[k] = v + s * a if moves else 0.0
        w_out[k] = course.angular_velocity[i, k] if moves else 0.0
    if s == 0.0:
        for k in range(4):
            q_out[k] = course.orientation[i, k]
        return
    c = course.top[i]
    q0, q1, q2, q3 = c[BASE], c[BASE + 1], c[BASE + 2], c[BASE + 3]
    if c[KIND] == REST:
        w_out[0] = w_out[1] = w_out[2] = 0.0
    else:
        wx, wy, wz = c[RATE], c[RATE + 1], c[RATE + 2]
        e0, e1, e2, e3 = exponential(s * wx, s * wy, s * wz)
        q0, q1, q2, q3 = product(e0, e1, e2, e3, q0, q1, q2, q3)
        w_out[0], w_out[1], w_out[2] = wx, wy, wz
    q_out[0], q_out[1], q_out[2], q_out[3] = q0, q1, q2, q3


@jit
def bring_ball(motion, i, time):
    """As `touching.bring`, for a body that keeps its axis; what accelerates it is left out."""
    now, course = motion.now, motion.course
    write_state(course, i, time, now.position[i], now.orientation[i], now.velocity[i], now.angular_velocity[i])
    quaternion_to_matrix(now.orientation[i], motion.rotation[i])
    if now.inv_mass[i] > 0.0:
        world_inverse_inertia(motion.rotation[i], course.inertia[i], now.inv_inertia[i])


@jit
def take_free_course(motion, i, time, acceleration):
    """As `course.take` in mode FREE, for a body of equal moments of inertia; acceleration (3,) m/s2."""
    now, course = motion.now, motion.course
    course.start[i], course.mode[i] = time, FREE
    for k in range(3):
        course.position[i, k], course.velocity[i, k] = now.position[i, k], now.velocity[i, k]
        course.angular_velocity[i, k] = now.angular_velocity[i, k]
        course.acceleration[i, k], course.torque[i, k] = acceleration[k], 0.0
    for k in range(4):
        course.orientation[i, k] = now.orientation[i, k]
    course.top[i, JERK:] = 0.0
    keep_axis(course.orientation[i], course.angular_velocity[i], course.top[i])


@jit
def write_frames(course, book, first_body, end_body, time):
    """Write the frames before `time` of bodies that keep their axis, frame by frame: that is the order in which they lie in memory."""
    first, last = np.int64(len(book.times)), np.int64(0)
    for i in range(first_body, end_body):
        if keeps_axis(course, i):
            first = min(first, book.written[i])
    last = first
    while last < len(book.times) and book.times[last] < time:
        last += 1
    for f in range(first, last):
        for i in range(first_body, end_body):
            if book.written[i] <= f and keeps_axis(course, i):
                write_state(
                    course, i, book.times[f], book.position[f, i], book.orientation[f, i], book.velocity[f, i],
                    book.angular_velocity[f, i],
                )  # fmt: skip
    for i in range(first_body, end_body):
        if keeps_axis(course, i):
            book.written[i] = max(book.written[i], last)
