"""The ledger: energy, momentum and angular momentum of the scene at every frame, and the energy that contacts took, by cause."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rigidimpulse.rotation import rotate, rotate_inverse


@dataclass(frozen=True)
class Ledger:
    """Sums over the dynamic bodies, one row a frame.

    Attributes:
        times: (f,) s.
        kinetic: (f,) J.
        potential: (f,) J, of gravity, zero at the world's origin.
        momentum: (f, 3) kg m/s.
        angular_momentum: (f, 3) kg m2/s about the world's origin.
        dissipated: by cause ("impact", "contact", "capture", "lift"), (f,) J taken from the bodies until each frame; a
            negative value is energy fed in (a moving support, a lift out of the contact margin).

    """

    times: np.ndarray
    kinetic: np.ndarray
    potential: np.ndarray
    momentum: np.ndarray
    angular_momentum: np.ndarray
    dissipated: dict[str, np.ndarray]

    @property
    def total(self) -> np.ndarray:
        """(f,) kinetic plus potential energy, J."""
        return self.kinetic + self.potential


def make_ledger(times, position, orientation, velocity, angular_velocity, mass, inertia, gravity, changes) -> Ledger:
    """Ledger of recorded principal-frame states.

    Arrays are (f, k, ...) for the k dynamic bodies: centre of mass, principal orientation, velocity, world spin; mass (k,),
    principal inertia (k, 3), gravity (k, 3); changes: (time, cause, energy) of contacts.
    """
    spin_body = rotate_inverse(orientation, angular_velocity)
    angular_body = spin_body * inertia
    kinetic = 0.5 * (mass * (velocity**2).sum(-1) + (spin_body * angular_body).sum(-1)).sum(-1)
    potential = -(mass[:, None] * gravity * position).sum((-1, -2))
    momentum = (mass[:, None] * velocity).sum(1)
    angular = (rotate(orientation, angular_body) + np.cross(position, mass[:, None] * velocity)).sum(1)
    dissipated: dict[str, np.ndarray] = {}
    for cause in sorted({c for _, c, _ in changes}):
        stamps = np.array([t for t, c, _ in changes if c == cause])
        sums = np.concatenate([[0.0], np.cumsum([-e for _, c, e in changes if c == cause])])
        dissipated[cause] = sums[np.searchsorted(stamps, times, side="right")]
    return Ledger(times, kinetic, potential, momentum, angular, dissipated)
