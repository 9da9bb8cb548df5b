"""Joints at an impact: they hold while impulses act, so their rows take part in every block of impulses.

The rows are those of `joint` in the present pose, with velocities u = J v in place of coordinates: u = 0 for hard rows, u >= 0 for lower
limits that are reached and u <= 0 for upper ones. Soft rows have no impulse: an impact takes no time.
"""

from typing import NamedTuple

import numpy as np

from rigidimpulse.core.kernels import jit, jit_making_arrays
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.dynamics.constraints.joint import is_linear, joint_rows, relative_point_velocity
from rigidimpulse.dynamics.constraints.joint_limits import is_reached, limit_side
from rigidimpulse.dynamics.constraints.jointed_island import JointedIsland
from rigidimpulse.dynamics.constraints.rows import BOUNDED, Rows, change_velocities, make_rows
from rigidimpulse.dynamics.solvers.newton import solve_newton

# Residual asked of the solver, relative to the fastest rate.
SOLVE_TOLERANCE = TOLERANCES.joint.impact_residual


class JointBlock(NamedTuple):
    """Rows of the joints of an island at an impact: of none of them, and no members, where it has no joints."""

    members: np.ndarray  # (n,) movable bodies of the island
    rows: Rows
    joint: np.ndarray  # (s,) joint of each row
    direction: np.ndarray  # (s, 3) of the force on b; zeros for rows that turn
    moment: np.ndarray  # (j, 3) N s on b by joint, added to


NO_JOINTS = JointBlock(np.zeros(0, np.int64), make_rows.py_func(0), np.zeros(0, np.int64), np.zeros((0, 3)), np.zeros((0, 3)))
"""Of an island without joints. Another type, None, would have all of an impact compiled twice."""


@jit_making_arrays
def impact_rows(island, moment):
    """The `JointBlock` of a `JointedIsland`: hard rows hold, limits that are reached stop, soft rows are too slow to act."""
    joints, which, members, number, memory = island.joints, island.which, island.members, island.number, island.memory
    for k in range(members.shape[0]):
        number[members[k]] = k
    count = np.int64(0)
    for j in which:
        count += joints.first[j + 1] - joints.first[j]
    rows, value, direction, joint = make_rows(count), np.empty(count), np.empty((count, 3)), np.empty(count, np.int64)
    joint_rows(island, rows, np.int64(0), value, direction)
    i = 0
    for j in which:
        for k in range(joints.first[j], joints.first[j + 1]):
            joint[i] = j
            # Torques apply no force at the anchors.
            if not is_linear(joints.coordinate[k]):
                direction[i] = 0.0
            if rows.kind[i] == BOUNDED or joints.stiffness[k] < np.inf:
                rows.kind[i] = BOUNDED
                # Springs cannot act in an impact; a limit acts only where it is reached.
                holds = joints.stiffness[k] == np.inf and (memory.active[k] or is_reached(joints, k, value[i], island.allowed))
                rows.lower[i] = -np.inf if holds and joints.lower[k] < 0.0 else 0.0
                rows.upper[i] = np.inf if holds and joints.upper[k] > 0.0 else 0.0
            i += 1
    return JointBlock(members, rows, joint, direction, moment)


@jit_making_arrays
def fill_rates(island, rows):
    """Write the rates of all rows to their bias. Returns the fastest approach to a hard limit that is reached, m/s or rad/s."""
    joints, count = island.joints, rows.bias.shape[0]
    again, value, direction = make_rows(count), np.empty(count), np.empty((count, 3))
    joint_rows(island, again, np.int64(0), value, direction)
    relative_point_velocity(island, direction, rows.bias)
    fastest, i = 0.0, 0
    for j in island.which:
        for k in range(joints.first[j], joints.first[j + 1]):
            if joints.stiffness[k] == np.inf and is_reached(joints, k, value[i], island.allowed):
                fastest = max(fastest, -limit_side(joints, k) * rows.bias[i])
            i += 1
    return fastest


def stop_at_limits(island: JointedIsland, moment: np.ndarray) -> None:
    """Impacts without rebound on the hard limits that are reached; moment (j, 3) N s on b by joint, added to."""
    block = impact_rows(island, moment)
    if fill_rates(island, block.rows) > 0.0:
        fastest = float(np.abs(block.rows.bias).max())
        solve_newton(block.rows, len(island.members), SOLVE_TOLERANCE * fastest)
        change_velocities(island.bodies, island.members, block.rows)
        add_moments(block, block.rows.impulse)


@jit
def copy_rows(source, rows, start):
    """Copy rows without masters to the places from `start` on."""
    for i in range(source.bias.shape[0]):
        k = start + i
        rows.first[k], rows.second[k], rows.kind[k] = source.first[i], source.second[i], source.kind[i]
        rows.lower[k], rows.upper[k] = source.lower[i], source.upper[i]
        for j in range(12):
            rows.jacobian[k, j] = source.jacobian[i, j]


@jit
def add_moments(joints, impulse):
    """Add the joints' part of the impulses (r,) of a block to the moments of a `JointBlock`; its rows are the last ones."""
    start = impulse.shape[0] - joints.joint.shape[0]
    for i in range(joints.joint.shape[0]):
        for k in range(3):
            joints.moment[joints.joint[i], k] += impulse[start + i] * joints.direction[i, k]
