"""The contacts of an island, as the impact laws and the constraint rows read them."""

from typing import NamedTuple

import numpy as np


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


def select(contacts: Contacts, which: np.ndarray) -> Contacts:
    """The contacts at the given places."""
    return Contacts(*(np.ascontiguousarray(column[which]) for column in contacts))
