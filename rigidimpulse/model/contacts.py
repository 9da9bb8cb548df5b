"""The contacts of an island, as the impact laws and the constraint rows read them, and what touches at them."""

from typing import NamedTuple

import numpy as np

from rigidimpulse.core.kernels import jit_making_arrays


class Contacts(NamedTuple):
    """The m contacts of one island."""

    body_a: np.ndarray  # (m,)
    body_b: np.ndarray  # (m,)
    arm_a: np.ndarray  # (m, 3) m
    arm_b: np.ndarray  # (m, 3) m
    normal: np.ndarray  # (m, 3)
    gap: np.ndarray  # (m,) m
    restitution: np.ndarray  # (m,)
    tangential_restitution: np.ndarray  # (m,)
    static_friction: np.ndarray  # (m,)
    dynamic_friction: np.ndarray  # (m,)


class Touching(NamedTuple):
    """What touches at the m contacts of one island, as in `collision.distance.simplices`."""

    kind: np.ndarray  # (m,)
    feature: np.ndarray  # (m, 2) of body a and of body b


@jit_making_arrays
def select(contacts, which):
    """The contacts at the given places (k,)."""
    m = which.shape[0]
    body_a, body_b = np.empty(m, np.int64), np.empty(m, np.int64)
    arm_a, arm_b, normal, numbers = np.empty((m, 3)), np.empty((m, 3)), np.empty((m, 3)), np.empty((5, m))
    for s in range(m):
        c = which[s]
        body_a[s], body_b[s] = contacts.body_a[c], contacts.body_b[c]
        for k in range(3):
            arm_a[s, k], arm_b[s, k], normal[s, k] = contacts.arm_a[c, k], contacts.arm_b[c, k], contacts.normal[c, k]
        numbers[0, s], numbers[1, s], numbers[2, s] = contacts.gap[c], contacts.restitution[c], contacts.tangential_restitution[c]
        numbers[3, s], numbers[4, s] = contacts.static_friction[c], contacts.dynamic_friction[c]
    return Contacts(body_a, body_b, arm_a, arm_b, normal, numbers[0], numbers[1], numbers[2], numbers[3], numbers[4])
