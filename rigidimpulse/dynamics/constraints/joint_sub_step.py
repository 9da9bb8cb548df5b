"""Joints and lasting contacts of an island over a sub-step: forces at its start, velocities at its end.

Velocity Verlet with constraints (RATTLE: Andersen 1983; second order, symmetric and symplectic), along the trajectories that
all bodies take here. J_0, J_1 are the Jacobians at the start and at the end of a sub-step of length h.

    start   forces f = p / h along J_0, constant over the sub-step, such that the joints close at its end: x_1 = target
    end     half of them is taken back, and impulses nu along J_1 stop the joints:
            v_1 = v_0 + h M^-1 (F + J_0^T f) - h/2 M^-1 J_0^T f + M^-1 J_1^T nu,     J_1 v_1 = 0

The closing condition is not linear. As x_1(p) = x_1(0) + h/2 W p + O(h^3), W = J_0 M^-1 J_0^T, it is put to the row
solver, together with the rows of the contacts, as  u = b + W p  with  b = 2 x_1(p') / h - W p'  for the p' of the last
round, until x_1 is closed; each round gains a factor of about (h w)^2.
"""

import numpy as np

from rigidimpulse.core.kernels import jit, jit_making_arrays
from rigidimpulse.core.quaternion import quaternion_to_matrix, to_matrix
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.dynamics.constraints.contact import SLIP, ContactProblem, fill_contact_bias, start_contact_impulses
from rigidimpulse.dynamics.constraints.joint import add_forces, joint_rows, joint_values, relative_point_velocity
from rigidimpulse.dynamics.constraints.joint_limits import is_reached, joint_weights, limit_side, spring_of
from rigidimpulse.dynamics.constraints.jointed_island import JointedIsland, count_joint_rows
from rigidimpulse.dynamics.constraints.rolling_friction import Rolling, count_rolling_rows, fill_rolling_rows
from rigidimpulse.dynamics.constraints.rows import (
    BOUNDED,
    FREE,
    change_velocities,
    contact_rows,
    make_rows,
    move_bodies,
    multiply,
    multiply_transposed,
    response_to,
    rows_of,
    scaled_wrench,
)
from rigidimpulse.dynamics.constraints.slip import RowSolver, solve_with_slip
from rigidimpulse.dynamics.constraints.softness import end_rate, is_slow, soft_row
from rigidimpulse.dynamics.solvers.newton import solve_newton
from rigidimpulse.model.contacts import Contacts
from rigidimpulse.motion.trajectory import FORCED, Load, pose_at, take

MAX_ROUNDS = 20
MOST_FAILURES = 3
"""Rounds in a row that close joints no better or are not solved, after which the best is taken."""
UNSOLVED = TOLERANCES.joint.unsolved
# Residual asked of the solver, and of closing, relative to the speed gained in the sub-step.
SOLVE_TOLERANCE = TOLERANCES.joint.residual
TINY = TOLERANCES.arithmetic.least_divisor


def stop_joints(island: JointedIsland, elapsed: np.ndarray, moment: np.ndarray) -> None:
    """End of a sub-step: the impulses nu.

    elapsed (j,): length of the sub-step that ends, s; moment (j, 3): the impulse on b of each joint is added, N s.
    """
    rows, direction, scale = stop_rows(island, elapsed)
    solve_newton(rows, len(island.members), SOLVE_TOLERANCE * scale)
    change_velocities(island.bodies, island.members, rows)
    add_forces(island.joints, island.which, rows.impulse, direction, 1.0, moment)


@jit_making_arrays
def stop_rows(island, elapsed):
    """Rows of the impulses nu, their directions (s, 3) and the largest speed to stop."""
    joints, which, members, number, memory = island.joints, island.which, island.members, island.number, island.memory
    count = count_joint_rows(joints, which)
    for k in range(members.shape[0]):
        number[members[k]] = k
    rows, value, direction, u = make_rows(count), np.empty(count), np.empty((count, 3)), np.empty(count)
    joint_rows(island, rows, np.int64(0), value, direction)
    relative_point_velocity(island, direction, u)
    weight = np.empty(count)
    joint_weights(joints, which, rows, np.int64(0), weight)
    scale, i = TINY, 0
    for j in which:
        for k in range(joints.first[j], joints.first[j + 1]):
            rows.bias[i] = u[i]
            hard = joints.stiffness[k] == np.inf
            # Limits that were not reached carry nothing; a spring needs time to give an impulse.
            if not memory.active[k] or (not hard and elapsed[j] <= 0.0):
                rows.kind[i] = BOUNDED
                rows.lower[i] = rows.upper[i] = 0.0
            elif not hard:
                rows.kind[i] = BOUNDED
                own, rate, resistance = _spring_impulse(joints, j, k, weight[i], value[i], memory, elapsed[j])
                if resistance == 0.0:
                    rows.lower[i] = rows.upper[i] = own
                else:
                    rows.lower[i], rows.upper[i], rows.softness[i] = -np.inf, np.inf, 1.0 / resistance
                    rows.bias[i] -= rate + own / resistance
            # The impulse has the signs that the force may have; its size is not bounded.
            elif rows.kind[i] == BOUNDED:
                rows.lower[i] = -np.inf if joints.lower[k] < 0.0 else 0.0
                rows.upper[i] = np.inf if joints.upper[k] > 0.0 else 0.0
            scale = max(scale, abs(rows.bias[i]))
            i += 1
    return rows, direction, scale


@jit
def _spring_impulse(joints, j, k, weight, value, memory, h):
    """Impulse nu of soft row k of joint j alone at the end of a sub-step of h s, its rate then, and its resistance Z; 0 if it is slow."""
    stiffness, damping = spring_of(joints, k, weight)
    rate, a = end_rate(stiffness, damping, weight, memory.start_value[k], memory.start_rate[k], value, h)
    own = (rate - memory.start_rate[k] - (a - damping * weight * joints.rate[k]) * h) / weight - 0.5 * h * memory.force[k]
    return own, rate, 0.0 if is_slow(stiffness, damping, weight, h) else damping * h + stiffness * h * h


def close_joints(island: JointedIsland, contacts: Contacts) -> bool:
    """Bring the joints' coordinates back to their targets by the least displacement in the metric of mass.

    Done only where one is off by more than the island allows. Contacts keep half of their gaps, if they have any. Returns whether bodies
    were moved.
    """
    joints, which, bodies, rotation, members = island.joints, island.which, island.bodies, island.rotation, island.members
    moved, last, m = False, np.inf, len(contacts.gap)
    smooth, slack = contacts._replace(static_friction=np.zeros(m)), 0.5 * np.maximum(contacts.gap, 0.0)
    before = bodies.position[members].copy(), bodies.orientation[members].copy()
    for _ in range(MAX_ROUNDS):
        rows, _, _ = contact_rows(bodies, smooth, members, island.number, count_joint_rows(joints, which))
        worst = fill_closing_rows(island, rows, m)
        if not worst < last:
            # No pose closes them; the one before was the best.
            bodies.position[members], bodies.orientation[members] = before
            rotation[members] = to_matrix(bodies.orientation[members])
            break
        if worst <= island.allowed:
            break
        moved, last = True, worst
        before = bodies.position[members].copy(), bodies.orientation[members].copy()
        rows.bias[:m] = slack
        solve_newton(rows, len(members), 1e-3 * island.allowed)
        slack += response_to(rows, len(members), rows.impulse)[:m]
        move_bodies(bodies, members, rows)
        rotation[members] = to_matrix(bodies.orientation[members])
    return moved


@jit_making_arrays
def fill_closing_rows(island, rows, start):
    """Fill the rows, from `start` on, of the displacement that closes the joints. Returns the worst error of a coordinate."""
    joints, which = island.joints, island.which
    count = rows.bias.shape[0] - start
    value, direction = np.empty(count), np.empty((count, 3))
    joint_rows(island, rows, start, value, direction)
    worst, i = 0.0, 0
    for j in which:
        for k in range(joints.first[j], joints.first[j + 1]):
            r = start + i
            rows.bias[r], rows.lower[r], rows.upper[r] = value[i], joints.lower[k], joints.upper[k]
            if joints.stiffness[k] < np.inf:
                rows.kind[r] = BOUNDED
                # Springs are not closed by position.
                rows.lower[r] = rows.upper[r] = 0.0
            elif joints.lower[k] < 0.0 and (joints.upper[k] > 0.0 or value[i] > 0.0):
                worst = max(worst, abs(value[i]))
            elif joints.upper[k] > 0.0 and value[i] < 0.0:
                worst = max(worst, abs(value[i]))
            i += 1
    return worst


@jit_making_arrays
def _end_values(island, acceleration, wrench, h, value):
    """Write coordinates - targets (s,) after h under the wrenches (n_world, 6)."""
    bodies, members, memory = island.bodies, island.members, island.memory
    trajectory, q, zero, pull = memory.trial, np.empty(4), np.zeros(3), np.empty(3)
    for i in members:
        for k in range(3):
            pull[k] = acceleration[i, k] + bodies.inv_mass[i] * wrench[i, k]
        take(trajectory, i, 0.0, bodies, Load(pull, wrench[i, 3:], zero, zero), FORCED)
        pose_at(trajectory, i, h, memory.end_position[i], q)
        quaternion_to_matrix(q, memory.end_rotation[i])
    joint_values(island.joints, island.which, memory.end_position, memory.end_rotation, memory.angle, value)


def hold_jointed(
    solve: RowSolver | None, problem: ContactProblem, island: JointedIsland, h: float, force: np.ndarray, wrench: np.ndarray,
    moment: np.ndarray, rolling: Rolling,
) -> tuple[float, float]:
    """Forces of joints and lasting contacts over a sub-step of length h.

    force, wrench and rolling as of `contact.hold_contacts`, with the joints of the island; moment (j, 3): half of the joints' impulses on b
    is added. Returns (residual relative to the speed gained, worst closing error).
    """
    contacts, acceleration, allowed = problem.contacts, problem.acceleration, island.allowed
    n, count, extra = len(island.members), count_joint_rows(island.joints, island.which), count_rolling_rows(rolling)
    of_contacts = contact_rows(island.bodies, contacts, island.members, island.number, extra + count)
    rows, first_row, _ = of_contacts
    start = len(rows.bias) - count
    fill_rolling_rows(problem, rolling, h, of_contacts, start - extra)
    start_contact_impulses(rows, first_row, force, h)
    direction, beta = start_joint_rows(island, h, rows, start)
    scale, u = fill_contact_bias(problem, np.zeros(len(first_row)), h, of_contacts)
    slides = np.abs(u[:, 1]) + np.abs(u[:, 2]) > SLIP * scale
    scale = max(scale, h * float(np.sqrt(np.max(np.sum(acceleration[island.members] ** 2, axis=1)))))
    residual, best, kept, failures = 0.0, np.inf, rows.impulse, 0
    for round_ in range(MAX_ROUNDS):
        worst, largest = close_at_end(island, acceleration, h, rows, start, beta, wrench)
        # Rounds may diverge where no impulses close the joints: the best ones so far are kept.
        closer = worst <= max(best, allowed) and residual <= UNSOLVED * scale
        failures = 0 if closer else failures + 1
        if worst <= max(best, allowed):
            best, kept = worst, rows.impulse.copy()
        if (round_ > 1 and worst <= allowed) or failures == MOST_FAILURES or not np.isfinite(worst):
            break
        scale = max(scale, largest)
        residual = solve_with_slip(solve, of_contacts, n, contacts, slides, SOLVE_TOLERANCE * scale, SLIP * scale)
    rows.impulse[:] = kept
    worst, _ = close_at_end(island, acceleration, h, rows, start, beta, wrench)
    _finish(island, rows, first_row, start, h, direction, force, moment)
    return residual / scale, worst


@jit_making_arrays
def close_at_end(island, acceleration, h, rows, start, beta, wrench):
    """Write the bias of the joints' rows for the next round; wrench: that of the present impulses.

    Returns the violation at the end under that wrench, inf if there is no end, and the largest bias.
    """
    joints, which, members, memory = island.joints, island.which, island.members, island.memory
    n, count = members.shape[0], beta.shape[0]
    y, u, value, largest = np.empty((n, 6)), np.empty(rows.bias.shape[0]), np.empty(count), 0.0
    multiply_transposed(rows, rows.impulse, y)
    multiply(rows, y, u)
    _write_wrenches(island.bodies, members, y, h, wrench)
    _end_values(island, acceleration, wrench, h, value)
    for i in range(count):
        rows.bias[start + i] = 2.0 / h * value[i] - u[start + i] - beta[i]
        largest = max(largest, abs(rows.bias[start + i]))
    return _violation(joints, which, memory, value, rows.impulse[start:]), largest


@jit_making_arrays
def _finish(island, rows, first_row, start, h, direction, force, moment):
    """Write the forces of the contacts (m, 3), remember the joints, and add half of the joints' impulses to their moments."""
    joints, which, members, memory = island.joints, island.which, island.members, island.memory
    for s in range(first_row.shape[0]):
        force[s] = 0.0
        for k in range(rows_of(rows, first_row[s])):
            force[s, k] = rows.impulse[first_row[s] + k] / h
    _remember(joints, which, rows, start, h, memory)
    y = np.empty((members.shape[0], 6))
    multiply_transposed(rows, rows.impulse, y)
    _write_wrenches(island.bodies, members, y, h, memory.wrench)
    add_forces(joints, which, rows.impulse[start:], direction, 1.0, moment)


@jit_making_arrays
def start_joint_rows(island, h, rows, start):
    """Fill the joints' rows from `start` on, with bounds, softness and first impulses; their coordinates and rates are remembered.

    Limits that are not reached carry nothing. Returns their directions (s, 3) and the terms beta (s,) of soft ones.
    """
    joints, which, memory = island.joints, island.which, island.memory
    count = rows.bias.shape[0] - start
    value, direction, u, beta = np.empty(count), np.empty((count, 3)), np.empty(count), np.zeros(count)
    weight = np.empty(count)
    joint_rows(island, rows, start, value, direction)
    relative_point_velocity(island, direction, u)
    joint_weights(joints, which, rows, start, weight)
    i = 0
    for j in which:
        for k in range(joints.first[j], joints.first[j + 1]):
            r = start + i
            rows.lower[r], rows.upper[r], rows.impulse[r] = joints.lower[k] * h, joints.upper[k] * h, memory.force[k] * h
            # The end of the sub-step compares its coordinates with these.
            memory.start_value[k], memory.start_rate[k], memory.weight[k] = value[i], u[i], weight[i]
            memory.steepness[k] = np.sqrt(np.sum(direction[i] ** 2))
            memory.slack[k] = limit_side(joints, k) != 0.0 and not is_reached(joints, k, value[i], island.allowed)
            if memory.slack[k]:
                rows.lower[r] = rows.upper[r] = rows.impulse[r] = 0.0
            elif joints.stiffness[k] < np.inf:
                stiffness, damping = spring_of(joints, k, weight[i])
                rows.softness[r], beta[i] = soft_row(stiffness, damping, joints.rate[k], weight[i], value[i], u[i], h)
            i += 1
    return direction, beta


@jit_making_arrays
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


@jit_making_arrays
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
            if not np.isfinite(x):
                worst = np.inf
            if joints.stiffness[k] < np.inf or memory.slack[k]:
                # Soft rows have no place to be at; limits that were slack belong to `next_switch`.
                x = 0.0
            if joints.lower[k] < 0.0 < joints.upper[k] or impulse[i] != 0.0:
                worst = max(worst, abs(x))
            elif joints.upper[k] > 0.0:
                worst = max(worst, -x)
            else:
                worst = max(worst, x)
            i += 1
    return worst
