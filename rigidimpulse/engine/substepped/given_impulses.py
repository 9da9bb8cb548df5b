"""What contacts of sub-stepped islands with joints gave to bodies in a step, for the contact log.

Of each pair that pressed, one contact is logged: the mean force over the step, at the mean of the places of its points, weighted by their
impulses, along their mean normal.
"""

from __future__ import annotations

import numpy as np

from rigidimpulse.core.portable import dot, length
from rigidimpulse.core.vector import tangents
from rigidimpulse.engine.run import Run
from rigidimpulse.engine.substepped.contact_forces import ContactStepper
from rigidimpulse.model.island import empty_contacts


def log_given(run: Run, stepper: ContactStepper, given: np.ndarray, span: tuple[float, float]) -> None:
    """Log the contacts of the members over a span [s]; given (p, 10): of the stepper's pairs, see `sum_given`."""
    order, pairs, (time, end) = stepper.order, stepper.table.pairs, span
    pressed = np.flatnonzero(given[:, 9])
    contacts, force, now = empty_contacts(len(pressed)), np.zeros((len(pressed), 3)), run.state.now
    for k, p in enumerate(pressed.tolist()):
        total, (a, b) = given[p], (int(order[pairs.first[p]]), int(order[pairs.second[p]]))
        sign = 1.0 if a < b else -1.0
        a, b = min(a, b), max(a, b)
        normal, t1, t2 = sign * total[6:9] / length(total[6:9]), np.empty(3), np.empty(3)
        tangents(normal, t1, t2)
        contacts.body_a[k], contacts.body_b[k], contacts.normal[k] = a, b, normal
        place = total[3:6] / total[9]
        contacts.arm_a[k], contacts.arm_b[k] = place - now.position[a], place - now.position[b]
        force[k] = dot(np.array([normal, t1, t2]), sign * total[:3]) / (end - time)
    run.contact_log.replace(stepper.members, time, contacts, now.position, force)
