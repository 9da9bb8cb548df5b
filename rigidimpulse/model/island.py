"""An island: bodies joined by contacts, joints or forces at one instant, and all that is known of their contacts."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from rigidimpulse.core.kernels import jit
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.model.contacts import Contacts, Touching

CORRECTED = 10.0
"""Approach speed that a position correction may make, in contact margins of turning (margin over size) times the speed: arms and normals
turn a little."""
SLACK = TOLERANCES.contact.as_fast
MARGIN = TOLERANCES.contact.margin


@dataclass
class Island:
    """Bodies joined by contacts at `time`.

    Attributes:
        members: movable bodies, in order of index.
        contacts: all contacts within the margin; `place` (m,) their pairs in the table of pairs, `touching` what touches.
        contact_margin: (m,) gap at which lasting contacts are held, m.
        speeds: (2, m) m/s: `approach`, u.n, negative where contacts approach; `rest_speed`, a slower rebound is none.
        live: (m,) bool, near enough for an impact now.
        velocity, angular_velocity: of the members before anything happened at this instant.
        moved: whether a position correction has changed poses. shift: m, how far it moved points of the members at most.
        held: (m,) bool, contacts that carry forces. rests: whether all members stand still.
        zero_speed: m/s, approach speed that counts as none. scale: m/s, largest speed of a contact point.
        joints: the joints of the members.
        substepped: bodies that the sub-stepped regime advances with this island, None where the island is exact.
        free: accelerations and angular accelerations (k, 3) of the members without varying forces, None where these do not act.
        loaded: whether varying forces are constant over the sub-step of contacts or joints.

    """

    time: float
    members: np.ndarray
    contacts: Contacts
    place: np.ndarray
    touching: Touching
    contact_margin: np.ndarray
    speeds: np.ndarray
    live: np.ndarray
    velocity: np.ndarray
    angular_velocity: np.ndarray
    moved: bool = False
    shift: float = 0.0
    held: np.ndarray | None = None
    rests: bool = False
    zero_speed: float = 0.0
    scale: float = 0.0
    joints: np.ndarray = field(default_factory=lambda: np.zeros(0, np.int64))
    substepped: np.ndarray | None = None
    free: tuple[np.ndarray, np.ndarray] | None = None
    loaded: bool = False

    @property
    def approach(self) -> np.ndarray:
        """Approach speeds (m,) u.n, m/s."""
        return self.speeds[0]

    @property
    def rest_speed(self) -> np.ndarray:
        """Speeds (m,) below which a rebound is none, m/s."""
        return self.speeds[1]

    @property
    def is_exact(self) -> bool:
        """Whether the exact regime advances it."""
        return self.substepped is None

    def slow(self) -> np.ndarray:
        """Contacts (m,) that neither bounce nor come in fast: slower than the speed whose rise would be the contact margin."""
        return np.abs(self.approach) <= slow_speed.py_func(self.rest_speed, self.zero_speed, self.moved, self.scale)


@jit
def slow_speed(rest_speed, zero_speed, moved, scale):
    """Approach or separation speed, m/s, up to which a contact lasts; arguments as in `Island`."""
    if moved:
        zero_speed += CORRECTED * scale * MARGIN
    return rest_speed * (1.0 + SLACK) + zero_speed


def empty_contacts(m: int) -> Contacts:
    """Arrays for m contacts."""
    return Contacts(*np.empty((2, m), np.int64), *np.empty((3, m, 3)), *np.empty((5, m)))


_NONE, _NO_CONTACTS = np.zeros(0, np.int64), empty_contacts(0)
_NO_TOUCHING = Touching(_NONE, np.zeros((0, 2), np.int64))
_NO_SPEEDS, _NO_GAPS, _NOT_LIVE = np.zeros((2, 0)), np.zeros(0), np.zeros(0, bool)


def island_without_contacts(time: float, members: np.ndarray, velocity: np.ndarray, angular_velocity: np.ndarray) -> Island:
    """Bodies that touch nothing: what only forces hold, or what only the sub-stepped regime knows the contacts of."""
    return Island(
        time=time, members=members, contacts=_NO_CONTACTS, place=_NONE, touching=_NO_TOUCHING, contact_margin=_NO_GAPS, speeds=_NO_SPEEDS,
        live=_NOT_LIVE, velocity=velocity, angular_velocity=angular_velocity,
    )  # fmt: skip
