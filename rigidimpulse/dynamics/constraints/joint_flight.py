"""Joints of an island that touches nothing, over a sub-step: a Runge-Kutta method of order 8.

With x the poses of n bodies, v their velocities, M their mass matrix, F what acts on them besides (constant forces, gyroscopic terms), J
the Jacobian of the joints' rows and f their forces:

    M v' = F + J^T f,   J v = 0        so that        W f = -(J M^-1 F + c),   W = J M^-1 J^T,   c = (dJ/dt) v

F holds gravity, constant forces, the forces that vary (evaluated in Python, stage by stage: `take_stage`), and springs, dampers and drives
of joints: f = -k x - d (u - r), at most what the row may exert. What is too stiff for the method makes its steps too short to be worth it.

c is the change of the rates u along the present motion, v held constant; with e a time in which bodies turn by LOOK,

    c = (8 (u(e) - u(-e)) - (u(2e) - u(-2e))) / 12 e,   u(s) = J(x at s) v        off by (LOOK)^4 / 30 of itself: round-off

The method takes 12 such accelerations (Prince and Dormand 1981; Hairer, Norsett, Wanner, Solving ODEs I, II.5: DOP853); its coefficients
are those of scipy. It does not know that joints are closed: at the end poses are closed and velocities stopped by the least change in the
metric of mass, which is of the order of its error. Two embedded methods say how large that is.

Paths. Bodies go along lines of force and torque (`motion/trajectory.py`) that end where the method ends. With A = (v_1 - v_0) / h and
B = 2 (x_1 - x_0 - v_0 h) / h^2 the acceleration is 3 B - 2 A at the start and changes by 6 (A - B) / h a second. The moment M_0 of the
torque is the change of the angular momentum; where the path ends off by the rotation t, the line is turned about its middle,

    tau(s) += d (s - h / 2),   d = -12 I t / h^3,

until it ends there. On the way joints are open by what is of order 4 in h; that is measured in the middle.
"""

from math import ceil, inf, isfinite, nan, sqrt
from typing import NamedTuple

import numpy as np
from scipy.integrate import DOP853

from rigidimpulse.core.kernels import jit, jit_making_arrays
from rigidimpulse.core.quaternion import exponential, product, quaternion_to_matrix
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.core.vector import copy_matrix, turned, turned_back
from rigidimpulse.dynamics.constraints.joint import add_forces, is_linear, joint_rows, joint_values, relative_point_velocity
from rigidimpulse.dynamics.constraints.joint_limits import is_reached, joint_weights, limit_side, spring_of
from rigidimpulse.dynamics.constraints.jointed_island import JointedIsland, count_joint_rows
from rigidimpulse.dynamics.constraints.rows import (
    BOUNDED,
    FREE,
    Rows,
    change_velocities,
    changes_of,
    make_rows,
    move_bodies,
    multiply_transposed,
    scaled_wrench,
)
from rigidimpulse.dynamics.solvers.newton import solve_newton
from rigidimpulse.motion.body_state import BodyState
from rigidimpulse.motion.evaluate import gyroscopic_acceleration, refresh_pose, world_inverse_inertia
from rigidimpulse.motion.trajectory import FORCED, Load, pose_at, take
from rigidimpulse.scene.joint_coordinates import RADIUS

STAGES = 12
STAGE_TIMES, STAGE_WEIGHTS = DOP853.C[:STAGES], DOP853.B
BEGIN, END, PATHS, MOVE = -1, STAGES, STAGES + 1, STAGES + 2
_STAGE, _END = np.ascontiguousarray(DOP853.A[:STAGES, :STAGES]), np.ascontiguousarray(DOP853.B)
_THIRD, _FIFTH = np.ascontiguousarray(DOP853.E3), np.ascontiguousarray(DOP853.E5)
LOOK: float = 1e-3
"""rad, by which bodies turn from look to look at the rates of joints."""
RESIDUAL = TOLERANCES.joint.residual
UNSOLVED = TOLERANCES.joint.unsolved
STILL = 10.0
"""Errors of closed joints by which the gap of a taut string may change in a sub-step, and count as none."""
MOST_TURNS, MOST_CLOSINGS, MOST_TRIALS = 12, 3, 8
"""Times that a line of torque is turned, that poses are closed, and that a step is made shorter."""
SAFETY, LEAST_CHANGE, MOST_CHANGE = 0.9, 0.2, 3.0
"""How lengths follow errors."""
TINY = TOLERANCES.arithmetic.least_divisor


class JointedFlight(NamedTuple):
    """The n bodies of a world on the way of a sub-step, and what was found of its j joints with k rows."""

    bodies: BodyState
    rotation: np.ndarray  # (n, 3, 3)
    size: float  # m, of what joints join
    value: np.ndarray  # (n, 6) N, N m by the joints at the start of the line
    rate: np.ndarray  # (n, 6) their change a second
    start: np.ndarray  # (j, 3) N on b at the start
    mean: np.ndarray  # (j, 3) N on b
    held: np.ndarray  # (k,) bool, rows that hold; of the others springs act, and the rest carries nothing
    load: np.ndarray  # (n, 6) N, N m of forces that vary, at the present stage


class Stages(NamedTuple):
    """Working memory of a step of n members with s rows."""

    rows: Rows
    direction: np.ndarray  # (s, 3)
    start: np.ndarray  # (n, 13) states at the start: pose and velocities
    at: np.ndarray  # (n, 13) states at the present stage
    slope: np.ndarray  # (STAGES, n, 13)


def make_flight(inv_mass: np.ndarray, size: float, num_joints: int, num_rows: int) -> JointedFlight:
    """Working memory for n bodies of inverse masses (n,) 1/kg; size: m, of what joints join."""
    n = len(inv_mass)
    bodies = BodyState(np.zeros((n, 3)), np.zeros((n, 4)), np.zeros((n, 3)), np.zeros((n, 3)), inv_mass, np.zeros((n, 3, 3)))
    return JointedFlight(
        bodies, np.zeros((n, 3, 3)), size, np.zeros((n, 6)), np.zeros((n, 6)), np.zeros((num_joints, 3)), np.zeros((num_joints, 3)),
        np.zeros(num_rows, bool), np.zeros((n, 6)),
    )  # fmt: skip


@jit_making_arrays
def make_stages(n, rows):
    """Working memory for a step of n members with these rows."""
    return Stages(rows, np.empty((rows.bias.shape[0], 3)), np.empty((n, 13)), np.empty((n, 13)), np.empty((STAGES, n, 13)))


@jit_making_arrays
def fly(island, flight, steady, span, pieces):
    """`fly_past` with pieces (allowed, plan), or `fly_jointed` where the plan is 0: returns what it returns, and 0 where that is less.

    Python calls both as one kernel: the steps of both are the same, and take 20 s to compile.
    """
    allowed, plan = pieces
    if plan == 0.0:
        return fly_jointed(island, flight, steady, span)
    flown, plan = fly_past(island, flight, steady, span, allowed, plan)
    return flown, plan, 0.0


@jit_making_arrays
def fly_jointed(island, flight, steady, h):
    """Fly the members of a `JointedIsland` for h s under steady accelerations (n, 3); the `JointedFlight` is written.

    Returns its error, as a part of the size, by how much joints are open on the way, m or rad, and by how much paths end elsewhere, rad: a
    torque that nearly vanishes counts as none, and turns nothing. The error is inf where the rows cannot be flown with, being soft or at a
    limit, and nan where they cannot be solved.
    """
    angles = island.memory.angle.copy()
    error, missed, open_by = _step(island, flight, steady, h), 0.0, 0.0
    if isfinite(error):
        missed, open_by = _lay_paths(island, flight, steady, h), _open_by(island, flight, h)
    island.memory.angle[:] = angles
    return error, open_by, missed


@jit_making_arrays
def take_stage(island, flight, stages, steady, h, stage):
    """A flight of h s stage by stage, for forces that vary: from BEGIN to END, with what acts at a stage in flight.load.

    Where a stage has been taken, flight.bodies are at the next one. At the END paths may be laid (PATHS), or the members be moved there
    (MOVE). Returns the error, by how much joints are open, and by how much paths end elsewhere, as `fly_jointed` does, of what is known by
    then: the error is 0 before the END if all is well. The caller restores memory.angle where it does not move the members.
    """
    if stage == BEGIN:
        return 0.0 if _begin(island, flight, stages, h) else inf, 0.0, 0.0
    if stage < END:
        return _take(island, flight, stages, steady, h, stage), 0.0, 0.0
    if stage == END:
        return _finish(island, flight, stages, h), 0.0, 0.0
    if stage == PATHS:
        missed = _lay_paths(island, flight, steady, h)
        return 0.0, _open_by(island, flight, h), missed
    _move(island, flight)
    return 0.0, 0.0, 0.0


@jit_making_arrays
def fly_past(island, flight, steady, span, allowed, plan):
    """Fly the members of a `JointedIsland` for `span` s, in as many steps as their errors ask for: nobody looks at them on the way.

    steady: (n, 3) m/s2. allowed: error of a step, as a part of the size. plan: s, length of the first step. The bodies are moved, and
    flight.mean is written. Returns for how long they were flown, less than `span` where a step cannot be taken, and the length that the
    next step may have.
    """
    which, flown, trials, total, angles = island.which, 0.0, 0, np.zeros_like(flight.mean), np.empty_like(island.memory.angle)
    while flown < span and trials < MOST_TRIALS:
        pieces = ceil((span - flown) / plan)
        h = (span - flown) / pieces
        angles[:] = island.memory.angle
        error = _step(island, flight, steady, h)
        if not isfinite(error):
            island.memory.angle[:] = angles
            break
        done, plan = next_length(h, plan, error / allowed)
        if not done:
            island.memory.angle[:] = angles
            trials += 1
            continue
        trials = 0
        _move(island, flight)
        for j in which:
            for c in range(3):
                total[j, c] += h * flight.mean[j, c]
        # The last one ends at the span, whatever was rounded.
        flown = span if pieces == 1 else flown + h
    if flown > 0.0:
        for j in which:
            for c in range(3):
                flight.mean[j, c] = total[j, c] / flown
    return flown, plan


@jit_making_arrays
def _move(island, flight):
    """Move the members to where the flight is."""
    bodies, ahead, value = island.bodies, flight.bodies, np.empty(count_joint_rows(island.joints, island.which))
    for i in island.members:
        for c in range(3):
            bodies.position[i, c], bodies.velocity[i, c] = ahead.position[i, c], ahead.velocity[i, c]
            bodies.angular_velocity[i, c] = ahead.angular_velocity[i, c]
        bodies.orientation[i] = ahead.orientation[i]
    refresh_pose(island.members, bodies, island.rotation, island.memory.trial.inertia)
    joint_values(island.joints, island.which, bodies.position, island.rotation, island.memory.angle, value)


@jit
def next_length(h, plan, error):
    """Whether a step of h s is good enough, and the length of the next one; plan: s, what it might have had; error: 1 at the bound."""
    way = error ** (1.0 / 8.0)
    follows = length_that_follows(h, way)
    if way > 1.0:
        return False, follows
    return True, max(follows, plan) if h < plan else follows


@jit
def length_that_follows(h, way):
    """Length of the step after one of h s whose error is `way` of the bound, as a length: 1 at the bound."""
    return h * min(max(SAFETY / max(way, TINY), LEAST_CHANGE), MOST_CHANGE)


@jit_making_arrays
def _step(island, flight, steady, h):
    """One step of h s: flight.bodies are moved, from where the members are; returns its error, see `fly_jointed`."""
    stages = make_stages(island.members.shape[0], make_rows(count_joint_rows(island.joints, island.which)))
    if not _begin(island, flight, stages, h):
        return inf
    for stage in range(STAGES):
        trouble = _take(island, flight, stages, steady, h, stage)
        if trouble != 0.0:
            return trouble
    return _finish(island, flight, stages, h)


@jit_making_arrays
def _ahead(island, flight):
    """The island where the flight is."""
    return JointedIsland(
        island.joints, island.which, flight.bodies, flight.rotation, island.members, island.number, island.memory, island.allowed
    )


@jit_making_arrays
def _begin(island, flight, stages, h):
    """Place flight.bodies where the members are; returns whether their rows can be flown with for h s."""
    members = island.members
    for k in range(members.shape[0]):
        island.number[members[k]] = k
        _read_state(island.bodies, members[k], stages.start[k])
    _place_supports(island, flight)
    for j in island.which:
        for r in range(3):
            flight.start[j, r] = flight.mean[j, r] = 0.0
    ahead = _ahead(island, flight)
    _write_states(ahead, island.memory.trial.inertia, stages.start)
    copy_matrix(stages.start, stages.at)
    return _choose_rows(ahead, flight.held, stages.rows, stages.direction, h)


@jit_making_arrays
def _take(island, flight, stages, steady, h, stage):
    """Slopes at a stage, where flight.bodies are, and on to the next one; returns the trouble of `_slopes`."""
    ahead, rows, direction, joints, which = _ahead(island, flight), stages.rows, stages.direction, island.joints, island.which
    trouble = _slopes(ahead, flight, steady, stages.at, rows, direction, stages.slope[stage])
    if stage == 0:
        add_forces(joints, which, rows.impulse, direction, 1.0, flight.start)
        _note_wrenches(ahead, rows, flight)
        _remember(joints, which, rows, island.memory)
    add_forces(joints, which, rows.impulse, direction, _END[stage], flight.mean)
    if stage + 1 < STAGES:
        for k in range(island.members.shape[0]):
            for c in range(13):
                step = 0.0
                for s in range(stage + 1):
                    step += _STAGE[stage + 1, s] * stages.slope[s, k, c]
                stages.at[k, c] = stages.start[k, c] + h * step
        _write_states(ahead, island.memory.trial.inertia, stages.at)
    return trouble


@jit_making_arrays
def _finish(island, flight, stages, h):
    """Bring flight.bodies to the end by the slopes of all stages; returns the error."""
    ahead, inertia = _ahead(island, flight), island.memory.trial.inertia
    error = _take_end(stages.start, stages.slope, h, flight.size, stages.at)
    _write_states(ahead, inertia, stages.at)
    _end(ahead, flight.held, stages.rows, stages.direction, inertia)
    return error


@jit
def _take_end(y, slope, h, size, end):
    """Write the states (n, 13) after h s, from y (n, 13) by the slopes (STAGES, n, 13) of all stages; returns their error."""
    worst = 0.0
    for k in range(y.shape[0]):
        fifth, third = 0.0, 0.0
        for c in range(13):
            step, off_5, off_3 = 0.0, 0.0, 0.0
            for s in range(STAGES):
                step += _END[s] * slope[s, k, c]
                off_5 += _FIFTH[s] * slope[s, k, c]
                off_3 += _THIRD[s] * slope[s, k, c]
            end[k, c] = y[k, c] + h * step
            weight = _weight(c, h, size)
            fifth += (weight * off_5) ** 2
            third += (weight * off_3) ** 2
        worst = max(worst, h * fifth / sqrt(max(fifth + 0.01 * third, TINY)))
    return worst


@jit
def _weight(c, h, size):
    """What turns an error of place c of a state, y (13,), into a way relative to the size: velocities move it for h."""
    if c < 3:
        return 1.0 / size
    if c < 7:
        return 1.0
    return h / size if c < 10 else h


@jit
def _read_state(bodies, i, y):
    """Pose and velocities of body i as y (13,)."""
    for c in range(3):
        y[c], y[7 + c], y[10 + c] = bodies.position[i, c], bodies.velocity[i, c], bodies.angular_velocity[i, c]
    for c in range(4):
        y[3 + c] = bodies.orientation[i, c]


@jit
def _write_states(ahead, inertia, y):
    """Bring the members to y (n, 13): pose, velocities, inverse inertia."""
    bodies = ahead.bodies
    for k in range(ahead.members.shape[0]):
        i = ahead.members[k]
        norm = sqrt(y[k, 3] ** 2 + y[k, 4] ** 2 + y[k, 5] ** 2 + y[k, 6] ** 2)
        for c in range(3):
            bodies.position[i, c], bodies.velocity[i, c], bodies.angular_velocity[i, c] = y[k, c], y[k, 7 + c], y[k, 10 + c]
        for c in range(4):
            bodies.orientation[i, c] = y[k, 3 + c] / norm
        quaternion_to_matrix(bodies.orientation[i], ahead.rotation[i])
        world_inverse_inertia(ahead.rotation[i], inertia[i], bodies.inv_inertia[i])


@jit
def _place_supports(island, flight):
    """What stands at the joints stands where it is."""
    for j in island.which:
        for i in (island.joints.body_a[j], island.joints.body_b[j]):
            if i >= 0:
                for c in range(3):
                    flight.bodies.position[i, c] = island.memory.end_position[i, c] = island.bodies.position[i, c]
                    flight.bodies.velocity[i, c] = flight.bodies.angular_velocity[i, c] = 0.0
                    for d in range(3):
                        flight.rotation[i, c, d] = island.memory.end_rotation[i, c, d] = island.rotation[i, c, d]


@jit
def _remember(joints, which, rows, memory):
    """Keep the forces of hard rows.

    Sub-steps start their search from them. That of a stiff spring at one instant led astray over a step of ten of its periods.
    """
    i = 0
    for j in which:
        for k in range(joints.first[j], joints.first[j + 1]):
            if joints.stiffness[k] == inf:
                memory.force[k] = rows.impulse[i]
            i += 1


@jit_making_arrays
def _choose_rows(ahead, held, rows, direction, h):
    """Mark the rows that hold; coordinates and rates at the start are remembered.

    Returns whether the others are springs or carry nothing.
    """
    joints, memory, count = ahead.joints, ahead.memory, rows.bias.shape[0]
    value, u, weight, i = np.empty(count), np.empty(count), np.empty(count), 0
    joint_rows(ahead, rows, np.int64(0), value, direction)
    relative_point_velocity(ahead, direction, u)
    joint_weights(joints, ahead.which, rows, np.int64(0), weight)
    for j in ahead.which:
        for k in range(joints.first[j], joints.first[j + 1]):
            memory.start_value[k], memory.start_rate[k], side = value[i], u[i], limit_side(joints, k)
            memory.steepness[k] = sqrt(direction[i, 0] ** 2 + direction[i, 1] ** 2 + direction[i, 2] ** 2)
            hard, taut = joints.stiffness[k] == inf, is_reached(joints, k, value[i], ahead.allowed)
            # A string that is let loose carries nothing from here on.
            taut = taut and not (hard and side * u[i] * h > STILL * ahead.allowed)
            memory.slack[k] = side != 0.0 and not taut
            held[k] = hard and (taut or (joints.lower[k] == -inf and joints.upper[k] == inf))
            memory.weight[k] = weight[i]
            is_spring = not hard and side == 0.0
            memory.active[k] = held[k] or is_spring
            if not (memory.active[k] or memory.slack[k]) or (taut and abs(u[i]) * h > STILL * ahead.allowed):
                return False
            i += 1
    return True


@jit
def _hold_rows(ahead, held, rows):
    """Set the kinds of rows: those that hold are free, the others carry nothing."""
    i = 0
    for j in ahead.which:
        for k in range(ahead.joints.first[j], ahead.joints.first[j + 1]):
            rows.kind[i] = FREE if held[k] else BOUNDED
            rows.lower[i], rows.upper[i] = (-inf, inf) if held[k] else (0.0, 0.0)
            i += 1


@jit_making_arrays
def _press_springs(ahead, rows, value, direction):
    """Give the rows of springs, dampers and drives their forces; value (s,): coordinates less targets."""
    joints, count, i, soft = ahead.joints, rows.bias.shape[0], 0, False
    for j in ahead.which:
        for k in range(joints.first[j], joints.first[j + 1]):
            soft = soft or joints.stiffness[k] < inf
    if not soft:
        return
    u, weight = np.empty(count), np.empty(count)
    relative_point_velocity(ahead, direction, u)
    joint_weights(joints, ahead.which, rows, np.int64(0), weight)
    for j in ahead.which:
        for k in range(joints.first[j], joints.first[j + 1]):
            if joints.stiffness[k] < inf and not ahead.memory.slack[k]:
                stiffness, damping = spring_of(joints, k, weight[i])
                pull = -stiffness * value[i] - damping * (u[i] - joints.rate[k])
                rows.lower[i] = rows.upper[i] = rows.impulse[i] = min(max(pull, joints.lower[k]), joints.upper[k])
            i += 1


@jit_making_arrays
def _slopes(ahead, flight, steady, y, rows, direction, slope):
    """Write the slopes (n, 13) of the state y (n, 13), where the members are; rows.impulse: the forces of the rows, start and answer.

    Returns 0, inf if strings would have to push, nan if the rows could not be solved.
    """
    joints, bodies, members = ahead.joints, ahead.bodies, ahead.members
    count, value, change, spin = rows.bias.shape[0], np.empty(rows.bias.shape[0]), np.empty(rows.bias.shape[0]), np.empty(3)
    pull = np.empty(3)
    _changes_of_rates(ahead, y, change)
    joint_rows(ahead, rows, np.int64(0), value, direction)
    _hold_rows(ahead, flight.held, rows)
    _press_springs(ahead, rows, value, direction)
    for k in range(members.shape[0]):
        i, (w0, w1, w2), (q0, q1, q2, q3) = members[k], (y[k, 10], y[k, 11], y[k, 12]), (y[k, 3], y[k, 4], y[k, 5], y[k, 6])
        gyroscopic_acceleration(ahead.rotation[i], ahead.memory.trial.inertia[i], bodies.angular_velocity[i], (0.0, 0.0, 0.0), spin)
        t0, t1, t2 = flight.load[i, 3], flight.load[i, 4], flight.load[i, 5]
        for c in range(3):
            spin[c] += bodies.inv_inertia[i, c, 0] * t0 + bodies.inv_inertia[i, c, 1] * t1 + bodies.inv_inertia[i, c, 2] * t2
            pull[c] = steady[i, c] + bodies.inv_mass[i] * flight.load[i, c]
        d0, d1, d2, d3 = product(0.0, w0, w1, w2, q0, q1, q2, q3)
        slope[k, 3], slope[k, 4], slope[k, 5], slope[k, 6] = 0.5 * d0, 0.5 * d1, 0.5 * d2, 0.5 * d3
        for c in range(3):
            slope[k, c], slope[k, 7 + c], slope[k, 10 + c] = y[k, 7 + c], pull[c], spin[c]
            # Rates of accelerations: the bodies have no other velocities for a moment.
            bodies.velocity[i, c], bodies.angular_velocity[i, c] = pull[c], spin[c]
    relative_point_velocity(ahead, direction, value)
    largest = TINY
    for i in range(count):
        rows.bias[i] = value[i] + change[i]
        largest = max(largest, abs(rows.bias[i]))
    residual = solve_newton(rows, members.shape[0], RESIDUAL * largest)
    by_joints = changes_of(bodies, members, rows)
    for k in range(members.shape[0]):
        for c in range(3):
            slope[k, 7 + c] += by_joints[k, c]
            slope[k, 10 + c] += by_joints[k, 3 + c]
    if not residual <= UNSOLVED * largest:
        return nan
    return 0.0 if _may_pull(joints, ahead.which, flight.held, rows) else inf


@jit
def _may_pull(joints, which, held, rows):
    """Whether all forces are such as their rows may exert: strings do not push."""
    i = 0
    for j in which:
        for k in range(joints.first[j], joints.first[j + 1]):
            if held[k] and not joints.lower[k] <= rows.impulse[i] <= joints.upper[k]:
                return False
            i += 1
    return True


@jit_making_arrays
def _changes_of_rates(ahead, y, change):
    """Write c (s,): how the rates of the coordinates change along the present motion of the members, at y (n, 13)."""
    count, members = change.shape[0], ahead.members
    rows, value, direction, u = make_rows(count), np.empty(count), np.empty((count, 3)), np.empty(count)
    change[:] = 0.0
    fastest = _fastest(ahead)
    if fastest == 0.0:
        return
    e = LOOK / fastest
    for times, share in ((-2.0, 1.0), (-1.0, -8.0), (1.0, 8.0), (2.0, -1.0)):
        for k in range(members.shape[0]):
            _move_on(ahead, members[k], y[k], times * e)
        joint_rows(ahead, rows, np.int64(0), value, direction)
        relative_point_velocity(ahead, direction, u)
        for i in range(count):
            change[i] += share * u[i] / (12.0 * e)
    for k in range(members.shape[0]):
        _move_on(ahead, members[k], y[k], 0.0)


@jit
def _move_on(ahead, i, y, s):
    """Place of body i after s, from y (13,) on, with its present velocities."""
    bodies = ahead.bodies
    norm = sqrt(y[3] ** 2 + y[4] ** 2 + y[5] ** 2 + y[6] ** 2)
    e0, e1, e2, e3 = exponential(s * y[10], s * y[11], s * y[12])
    q = bodies.orientation[i]
    q[0], q[1], q[2], q[3] = product(e0, e1, e2, e3, y[3] / norm, y[4] / norm, y[5] / norm, y[6] / norm)
    quaternion_to_matrix(q, ahead.rotation[i])
    for c in range(3):
        bodies.position[i, c] = y[c] + s * y[7 + c]


@jit_making_arrays
def _fastest(ahead):
    """Fastest rate [rad/s] at which directions of rows turn: spins of members, and those of rods and strings."""
    joints, bodies, fastest = ahead.joints, ahead.bodies, 0.0
    for i in ahead.members:
        w = bodies.angular_velocity[i]
        fastest = max(fastest, sqrt(w[0] ** 2 + w[1] ** 2 + w[2] ** 2))
    for j in ahead.which:
        longest = 0.0
        for k in range(joints.first[j], joints.first[j + 1]):
            if RADIUS <= joints.coordinate[k] and is_linear(joints.coordinate[k]):
                longest = max(longest, abs(ahead.memory.angle[k]))
        if longest > 0.0:
            square, a, b = 0.0, joints.body_a[j], joints.body_b[j]
            for c in range(3):
                difference = bodies.velocity[b, c] if b >= 0 else 0.0
                difference -= bodies.velocity[a, c] if a >= 0 else 0.0
                square += difference * difference
            fastest = max(fastest, sqrt(square) / longest)
    return fastest


@jit_making_arrays
def _note_wrenches(ahead, rows, flight):
    """Write the wrenches of the rows' forces, and of those that vary, on the members."""
    y = np.empty((ahead.members.shape[0], 6))
    multiply_transposed(rows, rows.impulse, y)
    for k in range(ahead.members.shape[0]):
        i = ahead.members[k]
        flight.value[i] = flight.load[i]
        scaled_wrench(ahead.bodies, i, y[k], flight.value[i])


@jit_making_arrays
def _end(ahead, held, rows, direction, inertia):
    """Close poses and stop velocities of the members at the end."""
    count, members, bodies = rows.bias.shape[0], ahead.members, ahead.bodies
    value = np.empty(count)
    for _ in range(MOST_CLOSINGS):
        joint_rows(ahead, rows, np.int64(0), value, direction)
        _hold_rows(ahead, held, rows)
        worst = 0.0
        for i in range(count):
            rows.bias[i], rows.impulse[i] = value[i], 0.0
            if rows.kind[i] == FREE:
                worst = max(worst, abs(value[i]))
        if worst <= 0.1 * ahead.allowed:
            break
        solve_newton(rows, members.shape[0], 0.01 * ahead.allowed)
        move_bodies(bodies, members, rows)
        refresh_pose(members, bodies, ahead.rotation, inertia)
    joint_rows(ahead, rows, np.int64(0), value, direction)
    _hold_rows(ahead, held, rows)
    relative_point_velocity(ahead, direction, value)
    largest = TINY
    for i in range(count):
        rows.bias[i], rows.impulse[i] = value[i], 0.0
        if rows.kind[i] == FREE:
            largest = max(largest, abs(value[i]))
    solve_newton(rows, members.shape[0], RESIDUAL * largest)
    change_velocities(bodies, members, rows)


@jit_making_arrays
def _lay_paths(island, flight, steady, h):
    """Write the lines of force and torque of the members, along which they go from where they are to where the flight ends.

    Returns by how much one of them ends elsewhere, rad.
    """
    start, end, trial, x, q = island.bodies, flight.bodies, island.memory.trial, np.empty(3), np.empty(4)
    pull, jerk, torque, torque_rate, best, missed = np.empty(3), np.empty(3), np.empty(3), np.empty(3), np.empty(6), 0.0
    for i in island.members:
        for c in range(3):
            mean = (end.velocity[i, c] - start.velocity[i, c]) / h
            bend = 2.0 * (end.position[i, c] - start.position[i, c] - start.velocity[i, c] * h) / (h * h)
            pull[c], jerk[c] = 3.0 * bend - 2.0 * mean, 6.0 * (mean - bend) / h
            flight.value[i, c], flight.rate[i, c] = (pull[c] - steady[i, c]) / start.inv_mass[i], jerk[c] / start.inv_mass[i]
        before = _angular_momentum(island.rotation[i], trial.inertia[i], start.angular_velocity[i])
        after = _angular_momentum(flight.rotation[i], trial.inertia[i], end.angular_velocity[i])
        for c in range(3):
            torque[c] = flight.value[i, 3 + c]
            torque_rate[c] = 2.0 * ((after[c] - before[c]) / h - torque[c]) / h
        least = inf
        for _ in range(MOST_TURNS):
            take(trial, i, 0.0, start, Load(pull, torque, jerk, torque_rate), FORCED)
            pose_at(trial, i, h, x, q)
            q0, q1, q2, q3 = product(*_row_4(end.orientation[i]), q[0], -q[1], -q[2], -q[3])
            sign = 2.0 if q0 >= 0.0 else -2.0
            off = sqrt(q1 * q1 + q2 * q2 + q3 * q3)
            if not off < least:
                break
            least = off
            for c in range(3):
                best[c], best[3 + c] = torque[c], torque_rate[c]
            turn = _angular_momentum(flight.rotation[i], trial.inertia[i], (sign * q1, sign * q2, sign * q3))
            for c in range(3):
                d = -12.0 * turn[c] / (h * h * h)
                torque[c] -= 0.5 * h * d
                torque_rate[c] += d
        for c in range(3):
            torque[c], torque_rate[c] = best[c], best[3 + c]
            flight.value[i, 3 + c], flight.rate[i, 3 + c] = torque[c], torque_rate[c]
        take(trial, i, 0.0, start, Load(pull, torque, jerk, torque_rate), FORCED)
        missed = max(missed, 2.0 * least)
    return missed


@jit
def _row_4(q):
    return q[0], q[1], q[2], q[3]


@jit
def _angular_momentum(rotation, inertia, w):
    """R diag(I) R^T w of a spin w, three numbers."""
    x, y, z = turned_back(rotation, w)
    return turned(rotation, (inertia[0] * x, inertia[1] * y, inertia[2] * z))


@jit_making_arrays
def _open_by(island, flight, h):
    """By how much joints are open in the middle of the paths; remembers the coordinates at the end."""
    joints, memory, trial, flown, held = island.joints, island.memory, island.memory.trial, flight.bodies, flight.held
    value, q, worst, i = np.empty(count_joint_rows(joints, island.which)), np.empty(4), 0.0, 0
    for m in island.members:
        pose_at(trial, m, 0.5 * h, memory.end_position[m], q)
        quaternion_to_matrix(q, memory.end_rotation[m])
    joint_values(joints, island.which, memory.end_position, memory.end_rotation, memory.angle, value)
    for j in island.which:
        for k in range(joints.first[j], joints.first[j + 1]):
            if held[k]:
                worst = max(worst, abs(value[i]))
            i += 1
    joint_values(joints, island.which, flown.position, flight.rotation, memory.angle, value)
    i = 0
    for j in island.which:
        for k in range(joints.first[j], joints.first[j + 1]):
            memory.end_value[k] = value[i]
            i += 1
    return worst
