"""What contacts of sub-stepped islands with joints gave to bodies in a step, for the contact log.

Of each pair that pressed, one contact is logged: the mean force over the step, at the mean of the places of its points, weighted by their
impulses, along their mean normal.
"""

from __future__ import annotations

import numpy as np

from rigidimpulse.core.kernels import jit
from rigidimpulse.core.vector import dot, length, row, scaled, tangents
from rigidimpulse.engine.run import Run
from rigidimpulse.engine.substepped.contact_forces import ContactStepper
from rigidimpulse.model.island import empty_contacts


@jit
def _fill_contacts(order, pairs, position, given, span, contacts, force):
    """Write the contacts (m,) of the pairs that pressed, and their forces (m, 3) N in (n, t1, t2); span: s, that they pressed in."""
    k = 0
    for p in range(given.shape[0]):
        if given[p, 9] == 0.0:
            continue
        a, b, sign, weight = order[pairs.first[p]], order[pairs.second[p]], 1.0, given[p, 9]
        if a > b:
            a, b, sign = b, a, -1.0
        normal, t1, t2 = contacts.normal[k], contacts.arm_a[k], contacts.arm_b[k]
        size = length(row(given[:, 6:9], p))
        for c in range(3):
            normal[c] = sign * given[p, 6 + c] / size
        # The arms' places serve for the tangents before they are written.
        tangents(normal, t1, t2)
        impulse = scaled(row(given, p), sign)
        force[k, 0], force[k, 1], force[k, 2] = dot(normal, impulse) / span, dot(t1, impulse) / span, dot(t2, impulse) / span
        contacts.body_a[k], contacts.body_b[k] = a, b
        for c in range(3):
            place = given[p, 3 + c] / weight
            contacts.arm_a[k, c], contacts.arm_b[k, c] = place - position[a, c], place - position[b, c]
        k += 1


def log_given(run: Run, stepper: ContactStepper, given: np.ndarray, span: tuple[float, float]) -> None:
    """Log the contacts of the members over a span [s]; given (p, 10): of the stepper's pairs, see `sum_given`."""
    number, position, (time, end) = int(np.count_nonzero(given[:, 9])), run.state.now.position, span
    contacts, force = empty_contacts(number), np.zeros((number, 3))
    if number:
        _fill_contacts(stepper.order, stepper.table.pairs, position, given, end - time, contacts, force)
    run.contact_log.replace(stepper.members, time, contacts, position, force)
