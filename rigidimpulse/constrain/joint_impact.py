"""Joints at an impact: they hold while impulses act, so their rows take part in every block of impulses."""

from typing import NamedTuple

import numpy as np

from rigidimpulse._jit import jit
from rigidimpulse.constrain.joint_limits import is_reached
from rigidimpulse.constrain.joint_rows import is_linear, joint_rows
from rigidimpulse.constrain.rows import BOUNDED, Rows, make_rows, multiply_transposed, scaled_change


class JointBlock(NamedTuple):
    """Rows of the joints of a group at an impact."""

    members: np.ndarray  # (n,) movable bodies of the group
    rows: Rows
    joint: np.ndarray  # (s,) joint of each row
    direction: np.ndarray  # (s, 3) of the force on b; zeros for rows that turn
    moment: np.ndarray  # (j, 3) N s on b by joint, added to


@jit
def number_all(members, number):
    """Number the members from 0 on; returns them."""
    for k in range(members.shape[0]):
        number[members[k]] = k
    return members


@jit
def impact_rows(joints, which, bodies, rotation, members, number, memory, allowed, moment):
    """The `JointBlock` of the joints listed in `which`: hard rows hold, limits that are reached stop, soft rows are too slow.

    allowed: closing error, m or rad.
    """
    number_all(members, number)
    count = np.int64(0)
    for j in which:
        count += joints.first[j + 1] - joints.first[j]
    rows, value, direction, joint = make_rows(count), np.empty(count), np.empty((count, 3)), np.empty(count, np.int64)
    joint_rows(joints, which, bodies, rotation, number, memory.angle, rows, np.int64(0), value, direction)
    i = 0
    for j in which:
        for k in range(joints.first[j], joints.first[j + 1]):
            joint[i] = j
            if not is_linear(joints.coordinate[k]):
                direction[i] = 0.0
            if rows.kind[i] == BOUNDED or joints.stiffness[k] < np.inf:
                rows.kind[i] = BOUNDED
                holds = joints.stiffness[k] == np.inf and (memory.active[k] or is_reached(joints, k, value[i], allowed))
                rows.lower[i] = -np.inf if holds and joints.lower[k] < 0.0 else 0.0
                rows.upper[i] = np.inf if holds and joints.upper[k] > 0.0 else 0.0
            i += 1
    return JointBlock(members, rows, joint, direction, moment)


@jit
def copy_rows(source, rows, start):
    """Copy rows without masters to the places from `start` on."""
    for i in range(source.bias.shape[0]):
        r = start + i
        rows.first[r], rows.second[r], rows.kind[r] = source.first[i], source.second[i], source.kind[i]
        rows.jacobian[r] = source.jacobian[i]
        rows.lower[r], rows.upper[r] = source.lower[i], source.upper[i]


@jit
def apply_joint_impulses(bodies, members, rows, joints):
    """Apply the impulses of the joints' rows, which are the last ones of `rows`."""
    start = rows.bias.shape[0] - joints.rows.bias.shape[0]
    p = rows.impulse.copy()
    p[:start] = 0.0
    y, linear, angular = np.empty((members.shape[0], 6)), np.empty(3), np.empty(3)
    multiply_transposed(rows, p, y)
    for k in range(members.shape[0]):
        scaled_change(bodies, members[k], y[k], linear, angular)
        bodies.velocity[members[k]] += linear
        bodies.angular_velocity[members[k]] += angular
    for i in range(joints.joint.shape[0]):
        joints.moment[joints.joint[i]] += p[start + i] * joints.direction[i]
