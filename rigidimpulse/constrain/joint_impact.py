"""Joints at an impact: they hold while impulses act, so their rows take part in every block of impulses."""

from typing import NamedTuple

import numpy as np

from rigidimpulse._jit import jit
from rigidimpulse.constrain.joint_rows import is_linear, joint_rows
from rigidimpulse.constrain.rows import BOUNDED, Rows, make_rows


class JointBlock(NamedTuple):
    """Rows of the joints of a group at an impact."""

    members: np.ndarray  # (n,) movable bodies of the group
    rows: Rows
    joint: np.ndarray  # (s,) joint of each row
    direction: np.ndarray  # (s, 3) of the force on b; zeros for rows that turn
    moment: np.ndarray  # (j, 3) N s on b by joint, added to


@jit
def impact_rows(joints, which, bodies, rotation, members, number, memory, moment):
    """The `JointBlock` of the joints listed in `which`: hard rows hold, limits that are reached stop, soft rows are too slow."""
    for k in range(members.shape[0]):
        number[members[k]] = k
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
                holds = memory.active[k] and joints.stiffness[k] == np.inf
                rows.lower[i] = -np.inf if holds and joints.lower[k] < 0.0 else 0.0
                rows.upper[i] = np.inf if holds and joints.upper[k] > 0.0 else 0.0
            i += 1
    return JointBlock(members, rows, joint, direction, moment)


def copy_rows(source: Rows, rows: Rows, start: int) -> None:
    """Copy rows without masters to the places from `start` on."""
    for name in ("first", "second", "kind", "jacobian", "lower", "upper"):
        getattr(rows, name)[start:] = getattr(source, name)


def add_moments(joints: JointBlock, impulse: np.ndarray) -> None:
    """Add the joints' part of the impulses (r,) of a block to their moments; their rows are the last ones."""
    last = impulse[len(impulse) - len(joints.joint) :]
    np.add.at(joints.moment, joints.joint, last[:, None] * joints.direction)
