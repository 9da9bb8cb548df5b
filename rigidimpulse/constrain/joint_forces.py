"""Joints and lasting contacts of a group over a sub-step: forces at its start, velocities at its end.

Velocity Verlet with constraints (RATTLE: Andersen 1983; second order, symmetric and symplectic), in the courses that
all bodies take here. J_0, J_1 are the Jacobians at the start and at the end of a sub-step of length h.

    start   forces f = p / h along J_0, constant over the sub-step, such that the joints close at its end: x_1 = target
    end     half of them is taken back, and impulses nu along J_1 stop the joints:
            v_1 = v_0 + h M^-1 (F + J_0^T f) - h/2 M^-1 J_0^T f + M^-1 J_1^T nu,     J_1 v_1 = 0

The closing condition is not linear. As x_1(p) = x_1(0) + h/2 W p + O(h^3), W = J_0 M^-1 J_0^T, it is put to the row
solver, together with the rows of the contacts, as  u = b + W p  with  b = 2 x_1(p') / h - W p'  for the p' of the last
round, until x_1 is closed; each round gains a factor of about (h w)^2.
"""

from typing import NamedTuple

import numpy as np

from rigidimpulse._jit import jit
from rigidimpulse.constrain.joint_limits import is_reached, joint_weights, limit_side, spring_of
from rigidimpulse.constrain.joint_rows import is_linear, joint_rows, joint_values, relative_point_velocity
from rigidimpulse.constrain.newton import solve_newton
from rigidimpulse.constrain.resting import fill_contact_bias, solve_with_slip, start_contact_impulses
from rigidimpulse.constrain.rows import (
    BOUNDED,
    FREE,
    contact_rows,
    count_contact_rows,
    make_rows,
    multiply,
    multiply_transposed,
    rows_of,
    scaled_change,
    scaled_wrench,
)
from rigidimpulse.constrain.softness import end_rate, soft_row
from rigidimpulse.integrate.course import FORCED, Course, begin, make_course, pose_at
from rigidimpulse.rotation import quaternion_exp, quaternion_multiply, quaternion_to_matrix

MAX_ROUNDS = 20
# Residual asked of the solver, and of closing, relative to the speed gained in the sub-step.
SOLVE_TOLERANCE = 1e-12
TINY = 1e-300


class JointMemory(NamedTuple):
    """What joints keep from one sub-step to the next, and room to work in; n bodies, k rows."""

    angle: np.ndarray  # (k,) last coordinates
    force: np.ndarray  # (k,) N or N m
    active: np.ndarray  # (k,) bool, rows at work: not at a bound of theirs
    start_value: np.ndarray  # (k,) coordinate less target at the start of the sub-step
    start_rate: np.ndarray  # (k,)
    end_value: np.ndarray  # (k,) the same at its end
    slack: np.ndarray  # (k,) bool, limits that are not reached
    weight: np.ndarray  # (k,) W of soft rows, see `joint_limits`
    steepness: np.ndarray  # (k,) length of the direction: 1, but for a twist near where it is not defined
    wrench: np.ndarray  # (n, 6) half of the joints' part of the wrench, taken back at the end
    trial: Course
    end_position: np.ndarray  # (n, 3) at the end of the sub-step; right for what is no member of a group
    end_rotation: np.ndarray  # (n, 3, 3)


def make_memory(joints, inertia: np.ndarray) -> JointMemory:
    """Memory of joints that have not acted yet; inertia (n, 3), principal moments."""
    k, n = len(joints.coordinate), len(inertia)
    trial = make_course(n)
    trial.inertia[:] = inertia
    hard = (joints.stiffness == np.inf) & (joints.lower == -np.inf) & (joints.upper == np.inf)
    return JointMemory(
        angle=np.zeros(k),
        force=np.zeros(k),
        active=hard,
        start_value=np.zeros(k),
        start_rate=np.zeros(k),
        end_value=np.zeros(k),
        slack=np.zeros(k, bool),
        weight=np.zeros(k),
        steepness=np.ones(k),
        wrench=np.zeros((n, 6)),
        trial=trial,
        end_position=np.zeros((n, 3)),
        end_rotation=np.zeros((n, 3, 3)),
    )


@jit
def count_joint_rows(joints, which):
    """Rows of the joints listed in `which`."""
    count = np.int64(0)
    for j in which:
        count += joints.first[j + 1] - joints.first[j]
    return count


@jit
def stop_joints(joints, which, bodies, rotation, members, number, memory, elapsed, allowed, moment):
    """End of a sub-step: the impulses nu.

    memory: `JointMemory`; elapsed (j,): length of the sub-step that ends, s; allowed: closing error, m or rad. moment (j, 3):
    the impulse on b of each joint is added, N s.
    """
    count = count_joint_rows(joints, which)
    n = members.shape[0]
    for k in range(n):
        number[members[k]] = k
    rows, value, direction, u = make_rows(count), np.empty(count), np.empty((count, 3)), np.empty(count)
    joint_rows(joints, which, bodies, rotation, number, memory.angle, rows, np.int64(0), value, direction)
    relative_point_velocity(joints, which, bodies, rotation, direction, u)
    weight = np.empty(count)
    joint_weights(joints, which, rows, np.int64(0), weight)
    scale, i = TINY, 0
    for j in which:
        for k in range(joints.first[j], joints.first[j + 1]):
            rows.bias[i] = u[i]
            hard = joints.stiffness[k] == np.inf
            at_work = memory.active[k] or (hard and is_reached(joints, k, value[i], allowed))
            if not at_work or (not hard and elapsed[j] <= 0.0):
                rows.kind[i] = BOUNDED
                rows.lower[i] = rows.upper[i] = 0.0
            elif not hard:
                rows.kind[i] = FREE
                stiffness, damping = spring_of(joints, k, weight[i])
                rows.bias[i] -= end_rate(
                    stiffness, damping, weight[i], memory.start_value[k], memory.start_rate[k], value[i], elapsed[j]
                )
            elif rows.kind[i] == BOUNDED:
                rows.lower[i] = -np.inf if joints.lower[k] < 0.0 else 0.0
                rows.upper[i] = np.inf if joints.upper[k] > 0.0 else 0.0
            scale = max(scale, abs(rows.bias[i]))
            i += 1
    solve_newton(rows, n, SOLVE_TOLERANCE * scale)
    y = np.empty((n, 6))
    multiply_transposed(rows, rows.impulse, y)
    _change_velocities(bodies, members, y)
    _add_moments(joints, which, rows, np.int64(0), direction, moment)


@jit
def _change_velocities(bodies, members, y):
    linear, angular = np.empty(3), np.empty(3)
    for k in range(members.shape[0]):
        scaled_change(bodies, members[k], y[k], linear, angular)
        bodies.velocity[members[k]] += linear
        bodies.angular_velocity[members[k]] += angular


@jit
def _add_moments(joints, which, rows, start, direction, moment):
    """Add the linear impulse on b of each joint to moment (j, 3)."""
    i = 0
    for j in which:
        for k in range(joints.first[j], joints.first[j + 1]):
            if is_linear(joints.coordinate[k]):
                for r in range(3):
                    moment[j, r] += rows.impulse[start + i] * direction[i, r]
            i += 1


@jit
def close_joints(joints, which, bodies, rotation, members, number, angle, allowed):
    """Bring the joints' coordinates back to their targets by the least displacement in the metric of mass.

    Done only where one is off by more than `allowed` [m or rad]; returns whether bodies were moved.
    """
    count = count_joint_rows(joints, which)
    n = members.shape[0]
    for k in range(n):
        number[members[k]] = k
    moved = False
    y, shift, turn, q = np.empty((n, 6)), np.empty(3), np.empty(3), np.empty(4)
    for _ in range(MAX_ROUNDS):
        rows, value, direction = make_rows(count), np.empty(count), np.empty((count, 3))
        joint_rows(joints, which, bodies, rotation, number, angle, rows, np.int64(0), value, direction)
        worst, i = 0.0, 0
        for j in which:
            for k in range(joints.first[j], joints.first[j + 1]):
                rows.bias[i], rows.lower[i], rows.upper[i] = value[i], joints.lower[k], joints.upper[k]
                if joints.stiffness[k] < np.inf:
                    rows.kind[i] = BOUNDED
                    rows.lower[i] = rows.upper[i] = 0.0
                elif joints.lower[k] < 0.0 and (joints.upper[k] > 0.0 or value[i] > 0.0):
                    worst = max(worst, abs(value[i]))
                elif joints.upper[k] > 0.0 and value[i] < 0.0:
                    worst = max(worst, abs(value[i]))
                i += 1
        if worst <= allowed:
            break
        moved = True
        solve_newton(rows, n, 1e-3 * allowed)
        multiply_transposed(rows, rows.impulse, y)
        for k in range(n):
            i = members[k]
            scaled_change(bodies, i, y[k], shift, turn)
            bodies.position[i] += shift
            quaternion_exp(turn, q)
            quaternion_multiply(q, bodies.orientation[i].copy(), bodies.orientation[i])
            quaternion_to_matrix(bodies.orientation[i], rotation[i])
    return moved


@jit
def _end_values(joints, which, bodies, acceleration, members, wrench, h, memory, value):
    """Coordinates - targets (s,) after h under the wrenches (n_world, 6)."""
    course, q = memory.trial, np.empty(4)
    for i in members:
        course.position[i], course.orientation[i] = bodies.position[i], bodies.orientation[i]
        course.velocity[i], course.angular_velocity[i] = bodies.velocity[i], bodies.angular_velocity[i]
        course.acceleration[i] = acceleration[i] + bodies.inv_mass[i] * wrench[i, :3]
        course.torque[i] = wrench[i, 3:]
        course.mode[i] = FORCED
        begin(course, i)
        pose_at(course, i, h, memory.end_position[i], q)
        quaternion_to_matrix(q, memory.end_rotation[i])
    joint_values(joints, which, memory.end_position, memory.end_rotation, memory.angle, value)


@jit
def hold_jointed(
    bodies, contacts, subset, turning, acceleration, angular_acceleration, h, members, number, force, joints, which,
    rotation, memory, allowed, wrench, moment,
):
    """Forces of joints and lasting contacts over a sub-step of length h.

    As `resting.hold_contacts`, with joints listed in `which`; memory: `JointMemory`; allowed: closing error, m or rad;
    moment (j, 3): half of the joints' impulses on b is added. Returns (residual relative to the speed gained, worst
    closing error).
    """
    n, m = members.shape[0], subset.shape[0]
    for k in range(n):
        number[members[k]] = k
    count, start = count_joint_rows(joints, which), count_contact_rows(contacts, subset)
    rows = make_rows(start + count)
    first_row, frames, slides = np.empty(m, np.int64), np.empty((m, 3, 3)), np.zeros(m, np.bool_)
    contact_rows(bodies, contacts, subset, number, rows, first_row, frames)
    value, direction, beta = np.empty(count), np.empty((count, 3)), np.zeros(count)
    joint_rows(joints, which, bodies, rotation, number, memory.angle, rows, start, value, direction)
    start_contact_impulses(rows, first_row, force, h)
    _start_joint_rows(joints, which, bodies, rotation, memory, value, direction, h, allowed, rows, start, beta)
    scale = fill_contact_bias(
        bodies, contacts, subset, frames, turning, acceleration, angular_acceleration, h, rows, first_row, slides
    )
    for i in members:
        scale = max(scale, h * np.sqrt(np.sum(acceleration[i] ** 2)))
    y, u = np.empty((n, 6)), np.empty(start + count)
    residual = worst = 0.0
    for round_ in range(MAX_ROUNDS):
        multiply_transposed(rows, rows.impulse, y)
        multiply(rows, y, u)
        _write_wrenches(bodies, members, y, h, wrench)
        _end_values(joints, which, bodies, acceleration, members, wrench, h, memory, value)
        worst = _violation(joints, which, memory, value, rows.impulse[start:])
        if round_ > 1 and worst <= allowed:
            break
        for i in range(count):
            rows.bias[start + i] = 2.0 / h * value[i] - u[start + i] - beta[i]
            scale = max(scale, abs(rows.bias[start + i]))
        residual = solve_with_slip(rows, n, first_row, slides, contacts, subset, scale)
    for s in range(m):
        force[s] = 0.0
        for k in range(rows_of(rows, first_row[s])):
            force[s, k] = rows.impulse[first_row[s] + k] / h
    _remember(joints, which, rows, start, h, memory)
    multiply_transposed(rows, rows.impulse, y)
    _write_wrenches(bodies, members, y, h, memory.wrench)
    _add_moments(joints, which, rows, start, direction, moment)
    return residual / scale, worst


@jit
def _start_joint_rows(joints, which, bodies, rotation, memory, value, direction, h, allowed, rows, start, beta):
    """Bounds, softness and first impulses of the joints' rows; their coordinates and rates are remembered.

    Limits that are not reached carry nothing.
    """
    u, weight = np.empty(value.shape[0]), np.empty(value.shape[0])
    relative_point_velocity(joints, which, bodies, rotation, direction, u)
    joint_weights(joints, which, rows, start, weight)
    i = 0
    for j in which:
        for k in range(joints.first[j], joints.first[j + 1]):
            r = start + i
            rows.lower[r], rows.upper[r], rows.impulse[r] = joints.lower[k] * h, joints.upper[k] * h, memory.force[k] * h
            memory.start_value[k], memory.start_rate[k], memory.weight[k] = value[i], u[i], weight[i]
            memory.steepness[k] = np.sqrt(np.sum(direction[i] ** 2))
            memory.slack[k] = limit_side(joints, k) != 0.0 and not is_reached(joints, k, value[i], allowed)
            if memory.slack[k]:
                rows.lower[r] = rows.upper[r] = rows.impulse[r] = 0.0
            elif joints.stiffness[k] < np.inf:
                stiffness, damping = spring_of(joints, k, weight[i])
                rows.softness[r], beta[i] = soft_row(stiffness, damping, joints.rate[k], weight[i], value[i], u[i], h)
            i += 1


@jit
def _remember(joints, which, rows, start, h, memory):
    """Keep the rows' forces, and which of them are at work; leave in rows the impulses that are half taken back."""
    rows.impulse[:start] = 0.0
    i = start
    for j in which:
        for k in range(joints.first[j], joints.first[j + 1]):
            p = rows.impulse[i]
            memory.force[k] = p / h
            if joints.stiffness[k] < np.inf:
                memory.active[k] = rows.lower[i] < p < rows.upper[i]
            else:
                memory.active[k] = rows.kind[i] == FREE or p != 0.0
            # What is at its bound stays as it is: no oscillator, no rod.
            rows.impulse[i] = 0.5 * p if memory.active[k] else 0.0
            i += 1


@jit
def _write_wrenches(bodies, members, y, h, wrench):
    """Wrenches (n_world, 6) over h that y = Jh^T p (n, 6) stands for."""
    for k in range(members.shape[0]):
        wrench[members[k]] = 0.0
        scaled_wrench(bodies, members[k], y[k] / h, wrench[members[k]])


@jit
def _violation(joints, which, memory, value, impulse):
    """Largest distance of a row from its law: coordinates that must be at their target, or are on the wrong side of it.

    The values are remembered; limits that were slack at the start are the business of `next_switch`.
    """
    worst, i = 0.0, 0
    for j in which:
        for k in range(joints.first[j], joints.first[j + 1]):
            x = memory.end_value[k] = value[i]
            if joints.stiffness[k] < np.inf or memory.slack[k]:
                x = 0.0
            if joints.lower[k] < 0.0 < joints.upper[k] or impulse[i] != 0.0:
                worst = max(worst, abs(x))
            elif joints.upper[k] > 0.0:
                worst = max(worst, -x)
            else:
                worst = max(worst, x)
            i += 1
    return worst
