"""The ledger: energy, momentum and angular momentum of the scene at every frame, and the energy that contacts took, by cause."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rigidimpulse.core.quaternion import rotate, rotate_inverse
from rigidimpulse.core.vector import cross_arrays
from rigidimpulse.recording.events import CAUSES, EventLog
from rigidimpulse.recording.recorder import Frames

if TYPE_CHECKING:
    from rigidimpulse.dynamics.forces.force_log import ForceWork

BLOCK = 4096
"""Frames times bodies that are summed up at once."""


class Masses(NamedTuple):
    """Of n bodies."""

    mass: np.ndarray  # (f, n) or (n,) kg, 0 for bodies that are not dynamic yet
    inertia: np.ndarray  # (n, 3) kg m2, principal
    steady_acceleration: np.ndarray  # (n, 3) m/s2 by gravity and constant forces


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
            each force by its name, ...), (f,) J taken from the bodies until each frame; a negative value is energy fed in (by a moving
            support, or by a position correction out of the contact margin).

    """

    times: np.ndarray
    kinetic: np.ndarray
    potential: np.ndarray
    momentum: np.ndarray
    angular_momentum: np.ndarray
    dissipated: dict[str, np.ndarray]

    def __repr__(self) -> str:
        """Return the number of frames, and the causes of dissipation."""
        return f"Ledger({len(self.times)} frames, dissipated by: {', '.join(self.dissipated) or 'nothing'})"

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


def make_ledger(frames: Frames, masses: Masses, log: EventLog, work: ForceWork | None = None) -> Ledger:
    """Ledger of recorded states; log: energy changes by cause and trajectories under contact forces; work: of varying forces, if any."""
    times, position, orientation, velocity, angular_velocity = frames
    share = None if work is None else work.mass_share
    shape = position.shape[:2]
    mass, kinetic, potential = np.broadcast_to(masses.mass, shape), np.empty(shape), np.empty(shape)
    momentum, angular = np.empty((len(times), 3)), np.empty((len(times), 3))
    # Few frames at a time: arrays of all frames of thousands of bodies leave the caches.
    length = max(BLOCK // max(shape[1], 1), 1)
    states = [position, orientation, velocity, angular_velocity, mass] + ([] if share is None else [share])
    for first in range(0, len(times), length):
        end = min(first + length, len(times))
        block = slice(first, end)
        if first and all(np.array_equal(one[block], one[first - 1 : end - 1]) for one in states):  # nothing moves
            for sums in (kinetic, potential, momentum, angular):
                sums[block] = sums[first - 1]
            continue
        kinetic[block], potential[block], momentum[block], angular[block] = mechanics(
            Frames(*(one[block] for one in frames)),
            masses._replace(mass=mass[block]),
            np.ones((1, 1)) if share is None else share[block],
        )
    dissipated: dict[str, np.ndarray] = {}
    energy = log.energy
    for cause, number in sorted((CAUSES[number], number) for number in np.unique(energy["cause"]).tolist()):
        changes = energy[energy["cause"] == number]
        sums = np.concatenate([[0.0], np.cumsum(-changes["change"])])
        count = np.searchsorted(changes["time"], times, side="right")
        # The first frame is the state as it is given: what happens at that time shows from the next on.
        count[times == times[0]] = 0
        dissipated[cause] = sums[count]
    for cause, taken in _work_of_spans(times, log.spans).items():
        dissipated[cause] = dissipated.get(cause, 0.0) + taken
    if len(log.stretches):
        given = 0.0 if work is None else work.on_bodies(position.shape[1])
        for cause, some in (("joints", log.stretches["by_joints"]), ("contact", ~log.stretches["by_joints"])):
            if some.any():
                taken = _work_of_stretches(times, kinetic + potential - given, log.stretches[some])
                dissipated[cause] = dissipated.get(cause, 0.0) + taken
    stored = potential.sum(1)
    if work is not None:
        stored = stored + work.potential.sum(1)
        dissipated.update(work.taken())
        if work.mass_share is not None:
            total = kinetic.sum(1) + stored + sum(dissipated.values())
            dissipated["mass that left"] = total[0] - total
    return Ledger(times, kinetic.sum(1), stored, momentum, angular, dissipated)


def mechanics(frames: Frames, masses: Masses, share: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Energies, kinetic and potential (f, n), momentum and angular momentum (f, 3) of frames; share (f, n): mass and inertia left."""
    _, position, orientation, velocity, angular_velocity = frames
    mass, inertia, steady_acceleration = masses
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


def _work_of_spans(times: np.ndarray, spans: list[tuple[float, float, str, float]]) -> dict[str, np.ndarray]:
    """Energy that was taken in spans of time (start, end, cause, change) until each frame (f,), by cause: evenly in each of them."""
    out: dict[str, np.ndarray] = {}
    for cause in dict.fromkeys(span[2] for span in spans):
        start, end, change = np.array([(span[0], span[1], span[3]) for span in spans if span[2] == cause]).T
        # Where frames fall into a span they show its part; those after it show all of it.
        first, last = np.searchsorted(times, start, "right"), np.searchsorted(times, end, "left")
        taken = np.cumsum(np.bincount(last, -change, len(times) + 1))[:-1]
        for k in np.flatnonzero(last > first).tolist():
            inside = slice(first[k], last[k])
            taken[inside] -= change[k] * (times[inside] - start[k]) / (end[k] - start[k])
        out[cause] = taken
    return out


def _work_of_stretches(times: np.ndarray, energy: np.ndarray, stretches: np.ndarray) -> np.ndarray:
    """Energy that forces took along trajectories until each frame (f,); inside a stretch what the body, energy (f, n), lost since."""
    first, last = np.searchsorted(times, stretches["start"], "right"), np.searchsorted(times, stretches["end"], "left")
    count = np.maximum(last - first, 0)
    frames = np.repeat(first - np.cumsum(count) + count, count) + np.arange(count.sum())
    lost = np.repeat(stretches["energy"], count) - energy[frames, np.repeat(stretches["body"], count)]
    steps = np.bincount(last, -stretches["work"], len(times) + 1)
    return np.bincount(frames, lost, len(times)) + np.cumsum(steps)[:-1]
