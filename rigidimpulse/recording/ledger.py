"""The ledger: energy, momentum and angular momentum of the scene at every frame, and the energy that contacts took, by cause."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rigidimpulse.core.quaternion import rotate, rotate_inverse
from rigidimpulse.core.vector import cross_arrays

BLOCK = 4096
"""Frames times bodies that are summed up at once."""


@dataclass(frozen=True)
class Ledger:
    """Sums over the dynamic bodies, one row a frame.

    Attributes:
        times: (f,) s.
        kinetic: (f,) J.
        potential: (f,) J, of gravity and constant forces, zero at the world's origin.
        momentum: (f, 3) kg m/s.
        angular_momentum: (f, 3) kg m2/s about the world's origin.
        dissipated: by cause ("impact", "contact", "stick", "position correction", "joints", "energy correction", "sub-stepping",
            each force by its
            name, ...), (f,) J taken
            from the bodies until each frame; a negative value is energy fed in (a moving support, a lift out of the contact margin).

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

    def part(self, here: slice) -> Ledger:
        """The frames of a slice, with times from 0 on."""
        times = self.times[here]
        taken = {cause: lost[here] for cause, lost in self.dissipated.items()}
        return Ledger(
            times - times[0], self.kinetic[here], self.potential[here], self.momentum[here], self.angular_momentum[here], taken
        )


def make_ledger(times, position, orientation, velocity, angular_velocity, mass, inertia, steady_acceleration, log, work=None) -> Ledger:
    """Ledger of recorded principal-frame states.

    Arrays are (f, n, ...) for all bodies: centre of mass, principal orientation, velocity, world spin; mass (f, n) or (n,) with 0
    for bodies that are not dynamic yet, principal inertia (n, 3), acceleration by gravity and constant forces (n, 3); log: energy
    changes by cause and courses under contact forces; work: what varying forces did (`ForceWork`), if there are any.
    """
    share = None if work is None else work.mass_share
    shape = position.shape[:2]
    mass, kinetic, potential = np.broadcast_to(mass, shape), np.empty(shape), np.empty(shape)
    momentum, angular = np.empty((len(times), 3)), np.empty((len(times), 3))
    # Few frames at a time: arrays of all frames of thousands of bodies leave the caches.
    length = max(BLOCK // max(shape[1], 1), 1)
    frames = [position, orientation, velocity, angular_velocity, mass] + ([] if share is None else [share])
    for first in range(0, len(times), length):
        end = min(first + length, len(times))
        block = slice(first, end)
        if first and all(np.array_equal(one[block], one[first - 1 : end - 1]) for one in frames):  # all stands still
            for sums in (kinetic, potential, momentum, angular):
                sums[block] = sums[first - 1]
            continue
        kinetic[block], potential[block], momentum[block], angular[block] = _mechanics(
            position[block], orientation[block], velocity[block], angular_velocity[block], mass[block],
            inertia, steady_acceleration, np.ones((1, 1)) if share is None else share[block],
        )  # fmt: skip
    dissipated: dict[str, np.ndarray] = {}
    for cause in sorted({c for _, c, _ in log.energy}):
        stamps = np.array([t for t, c, _ in log.energy if c == cause])
        sums = np.concatenate([[0.0], np.cumsum([-e for _, c, e in log.energy if c == cause])])
        dissipated[cause] = sums[np.searchsorted(stamps, times, side="right")]
    for start, end, cause, change in log.spans:
        done = np.clip((times - start) / (end - start), 0.0, 1.0)
        dissipated[cause] = dissipated.get(cause, 0.0) - change * done
    if log.stretches:
        given = 0.0 if work is None else work.on_bodies(position.shape[1])
        dissipated["contact"] = _contact_work(times, kinetic + potential - given, log.stretches)
    stored = potential.sum(1)
    if work is not None:
        stored = stored + work.potential.sum(1)
        dissipated.update(work.taken())
        if work.mass_share is not None:
            total = kinetic.sum(1) + stored + sum(dissipated.values())
            dissipated["mass that left"] = total[0] - total
    return Ledger(times, kinetic.sum(1), stored, momentum, angular, dissipated)


def _mechanics(position, orientation, velocity, angular_velocity, mass, inertia, steady_acceleration, share):
    """Energies, kinetic and potential (f, n), momentum and angular momentum (f, 3) of frames; share (f, n): mass and inertia left."""
    mass, factor = share * mass, share * np.where(mass > 0.0, 1.0, 0.0)
    spin = (factor * inertia[:, 0])[:, :, None] * angular_velocity
    turned = np.flatnonzero(np.any(inertia != inertia[:, :1], axis=1))
    if len(turned):
        axes = orientation[:, turned]
        principal = inertia[turned] * rotate_inverse(axes, angular_velocity[:, turned])
        spin[:, turned] = factor[:, turned, None] * rotate(axes, principal)
    momenta = mass[:, :, None] * velocity
    kinetic = 0.5 * (_dot(velocity, momenta) + _dot(angular_velocity, spin))
    potential = -mass * np.einsum("fnk,nk->fn", position, steady_acceleration)
    return kinetic, potential, momenta.sum(1), (spin + cross_arrays(position, momenta)).sum(1)


def _dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Dot products (f, n) of vectors (f, n, 3)."""
    return np.einsum("fnk,fnk->fn", a, b)


def _contact_work(times: np.ndarray, energy: np.ndarray, stretches) -> np.ndarray:
    """Energy that contact forces took until each frame (f,); inside a stretch what the body, energy (f, n), lost since."""
    taken, steps = np.zeros(len(times)), np.zeros(len(times) + 1)
    for start, end, body, begun, work in stretches:
        first, last = np.searchsorted(times, start, "right"), np.searchsorted(times, end, "left")
        taken[first:last] += begun - energy[first:last, body]
        steps[last] -= work
    return taken + np.cumsum(steps)[:-1]
