"""What contacts of sub-stepped islands with joints gave to bodies in a step, for the contact log.

Of each pair that pressed, one contact is logged: the mean force over the step, at the mean of the places of its points, weighted by their
impulses, along their mean normal.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rigidimpulse.collision.contact_records import MEMBER, OUTSIDE, SKELETON_B
from rigidimpulse.core.portable import dot, length
from rigidimpulse.core.vector import tangents
from rigidimpulse.dynamics.solvers.tgs_soft.records import normal_of
from rigidimpulse.dynamics.solvers.time_stepping.contact_points import GIVEN
from rigidimpulse.engine.run import Run
from rigidimpulse.engine.substepped.contact_forces import ContactStepper
from rigidimpulse.model.island import empty_contacts


@dataclass(frozen=True)
class _Points:
    """Rows of the table, with the ranks of their bodies."""

    row: np.ndarray  # (m,)
    first: np.ndarray  # (m,)
    second: np.ndarray  # (m,)
    carrier: np.ndarray  # (m,) bool, the second body carries the normal


class GivenImpulses:
    """Collects impulses between bodies, by rank, while an island is stepped."""

    def __init__(self, stepper: ContactStepper) -> None:
        """Nothing was given yet."""
        self._sums: dict[tuple[int, int], np.ndarray] = {}
        self._order = stepper.order
        self.forget(stepper)

    def forget(self, stepper: ContactStepper) -> None:
        """Begin to count again: contacts were looked for."""
        stepper.table.points[_in_play(stepper).row, GIVEN : GIVEN + 3] = 0.0

    def add(self, stepper: ContactStepper) -> None:
        """Add what the points in play have given."""
        at, table, bodies = _in_play(stepper), stepper.table.points, stepper.bodies
        impulse = table[at.row, GIVEN : GIVEN + 3]
        # Squares of impulses below 1e-160 N s are zero, and so is their length.
        sizes = length(impulse)
        for k in np.flatnonzero(sizes).tolist():
            a, b, r, size = int(at.first[k]), int(at.second[k]), int(at.row[k]), float(sizes[k])
            place = bodies.position[b] + dot(bodies.rotation[b], table[r, SKELETON_B : SKELETON_B + 3])
            normal = normal_of(bodies.position, bodies.rotation, table, r, a, b, at.carrier[k])
            self._sums[a, b] = self._sums.get((a, b), 0.0) + np.array([*impulse[k], *(size * place), *(size * np.array(normal)), size])

    def log(self, run: Run, members: np.ndarray, time: float, end: float) -> None:
        """Log the contacts of the members from `time` to `end`."""
        order, pairs = self._order, list(self._sums)
        contacts, force, now = empty_contacts(len(pairs)), np.zeros((len(pairs), 3)), run.state.now
        for k, (first, second) in enumerate(pairs):
            total, (a, b) = self._sums[first, second], (int(order[first]), int(order[second]))
            sign = 1.0 if a < b else -1.0
            a, b = min(a, b), max(a, b)
            normal, t1, t2 = sign * total[6:9] / length(total[6:9]), np.empty(3), np.empty(3)
            tangents(normal, t1, t2)
            contacts.body_a[k], contacts.body_b[k], contacts.normal[k] = a, b, normal
            place = total[3:6] / total[9]
            contacts.arm_a[k], contacts.arm_b[k] = place - now.position[a], place - now.position[b]
            force[k] = dot(np.array([normal, t1, t2]), sign * total[:3]) / (end - time)
        run.contact_log.replace(members, time, contacts, now.position, force)


def _in_play(stepper: ContactStepper) -> _Points:
    """Contact points of the pairs that take part."""
    pairs, part = stepper.table.pairs, stepper.bodies.part
    a, b = part[pairs.first], part[pairs.second]
    mine = np.flatnonzero((pairs.count > 0) & (a != OUTSIDE) & (b != OUTSIDE) & ((a == MEMBER) | (b == MEMBER)))
    count = pairs.count[mine]
    which = np.repeat(mine, count)
    row = pairs.start[which] + np.arange(len(which)) - np.repeat(np.cumsum(count) - count, count)
    return _Points(row, pairs.first[which], pairs.second[which], pairs.carrier[which])
