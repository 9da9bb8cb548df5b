"""Impulses on a body by their causes.

    m v(t) - m v(0) = sum over causes of the integral of F ds + sum of impulses

Causes: gravity, constant forces, each force that varies, each joint, each body touched (lasting contact and impacts apart), and the
rest: "corrections". These are the changes of velocity at the end of sub-steps (of second order in their length), the impulses by which
contacts stick, and what bodies of sub-stepped islands exchange. Of a body that loses mass the left side is the integral of m v'.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from rigidimpulse.core.errors import unknown_name
from rigidimpulse.core.kernels import jit
from rigidimpulse.core.sorted_values import place_in

if TYPE_CHECKING:
    from rigidimpulse.dynamics.forces.force_log import ForceWork


@jit
def add_force(times, start, end, force, gain):
    """Add what a constant force (3,) N gives from start to end [s] to the gains since the frame before (f + 1, 3) N s."""
    begin, last = start, place_in(times, end)
    for f in range(place_in(times, begin), last + 1):
        until = times[f] if f < last else end
        for k in range(3):
            gain[f, k] += (until - begin) * force[k]
        begin = until


@jit
def add_forces(times, start, end, force, gain):
    """The same of forces (m, 3) N, one by one; start, end (m,) s."""
    for r in range(force.shape[0]):
        add_force(times, start[r], end[r], force[r], gain)


class ImpulseAccounts:
    """Impulses between pairs until the frames, while a run goes on; body -1 is the world."""

    def __init__(self, times: np.ndarray) -> None:
        """times (f,) s of the frames."""
        self._times = times
        self._gains: dict[tuple[str, int, int], np.ndarray] = {}

    def put(self, cause: str, a: int, b: int, gain: np.ndarray) -> None:
        """What a cause gave to b since the frame before (f + 1, 3) N s, the opposite to a; the last row is after all frames."""
        self._gains[cause, a, b] = gain

    def add_many(self, cause: str, a: np.ndarray, b: np.ndarray, start: np.ndarray, end: np.ndarray, force: np.ndarray) -> None:
        """Constant forces (m, 3) N of a cause on b (m,), the opposite on a (m,), from start to end (m,) s; those of a pair one by one."""
        place = np.lexsort((b, a))
        a, b, start, end, force = a[place], b[place], start[place], end[place], force[place]
        new = np.flatnonzero(np.diff(a, prepend=-2) | np.diff(b, prepend=-2)).tolist()
        for first, last in pairwise([*new, len(place)]):
            gain = self._gain(cause, int(a[first]), int(b[first]))
            add_forces(self._times, start[first:last], end[first:last], force[first:last], gain)

    def add_at(self, cause: str, a: int, b: int, time: float, impulse: np.ndarray) -> None:
        """An impulse (3,) N s of a cause on b, the opposite on a, at `time`."""
        self._gain(cause, a, b)[np.searchsorted(self._times, time, side="left")] += impulse

    def keep(self, count: int) -> None:
        """Leave the first `count` frames only."""
        self._times = self._times[:count]
        self._gains = {key: gain[: count + 1] for key, gain in self._gains.items()}

    def _gain(self, cause: str, a: int, b: int) -> np.ndarray:
        """What is gained since the frame before (f + 1, 3); the last row is after all frames."""
        key = (cause, a, b)
        if key not in self._gains:
            self._gains[key] = np.zeros((len(self._times) + 1, 3))
        return self._gains[key]

    def of(self, body: int) -> dict[tuple[str, int], np.ndarray]:
        """By cause and the other body: impulses (f, 3) on a body."""
        found: dict[tuple[str, int], np.ndarray] = {}
        for (cause, a, b), gain in self._gains.items():
            if body in (a, b):
                total = np.cumsum(gain[:-1], axis=0)
                found[cause, a if body == b else b] = total if body == b else -total
        return found


@dataclass(frozen=True)
class Impulses:
    """Impulses of a run by body and cause.

    Attributes:
        names: of the bodies. times: (f,) s.
        pull: (n, 2, 3) N of gravity and of constant forces on each body, at its mass at the end.
        mass: (n,) kg at the end, 0 of bodies that are never dynamic. release: (n,) s, when bodies that are carried first are let go.
        velocity: (f, n, 3) m/s.
        accounts: what pairs exchange. forces: what varying forces did, None where there are none.
        impacts: the table of impacts.

    """

    names: list[str]
    times: np.ndarray
    pull: np.ndarray
    mass: np.ndarray
    release: np.ndarray
    velocity: np.ndarray
    accounts: ImpulseAccounts
    forces: ForceWork | None
    impacts: np.ndarray

    def __repr__(self) -> str:
        """Return the numbers of bodies, frames and impacts."""
        return f"Impulses({len(self.names)} bodies, {len(self.times)} frames, {len(self.impacts)} impacts)"

    def of(self, name: str) -> dict[str, np.ndarray]:
        """Impulses (f, 3) N s on a body by cause.

        Raises:
            SceneError: for an unknown name, listing the known ones.

        """
        if name not in self.names:
            raise unknown_name("body", name, self.names)
        i = self.names.index(name)
        lasted, gained = self._gain_of(i)
        parts: dict[str, np.ndarray] = {}
        for what, pull in zip(("gravity", "constant forces"), self.pull[i], strict=True):
            if np.any(pull):
                parts[what] = lasted[:, None] * pull
        if self.forces is not None:
            parts.update(self.forces.impulses_on(i))
        for (cause, other), impulse in sorted(self.accounts.of(i).items(), key=lambda item: item[0]):
            parts[cause if other < 0 or cause.startswith("joint ") else f"{cause} {self.names[other]}"] = impulse
        parts.update(self._impacts_on(i))
        rest = gained - sum(parts.values(), np.zeros_like(gained))
        if np.any(np.abs(rest) > 0.0):
            parts["corrections"] = rest
        return parts

    def _gain_of(self, i: int) -> tuple[np.ndarray, np.ndarray]:
        """Time until each frame (f,) s, each instant counted by the body's mass over that at the end, and what it gained (f, 3) N s."""
        share = np.ones(len(self.times))
        if self.forces is not None and self.forces.mass_share is not None:
            share = self.forces.mass_share[:, i]
        # Mass at the frames over that at the end of the run, in the middle between frames; and the part of that time in which it counts.
        middle = 0.5 * (share + np.concatenate([share[:1], share[:-1]]))
        counted = np.clip(self.times - self.release[i], 0.0, np.diff(self.times, prepend=self.times[:1]))
        gain = np.diff(self.velocity[:, i], axis=0, prepend=self.velocity[:1, i])
        weight = (counted > 0.0) * middle * self.mass[i]
        return np.cumsum(counted * middle), np.cumsum(weight[:, None] * gain, axis=0)

    def _impacts_on(self, i: int) -> dict[str, np.ndarray]:
        """Impulses (f, 3) of impacts with each other body."""
        parts: dict[str, np.ndarray] = {}
        for mine, other, sign in (("body_b", "body_a", 1.0), ("body_a", "body_b", -1.0)):
            rows = self.impacts[self.impacts[mine] == i]
            for j in np.unique(rows[other]).tolist():
                those = rows[rows[other] == j]
                impulse = sign * (those["impulse"][:, None] * those["normal"] + those["tangent_impulse"])
                sums = np.vstack([np.zeros(3), np.cumsum(impulse, axis=0)])
                key = f"impacts with {self.names[j]}"
                parts[key] = parts.get(key, 0.0) + sums[np.searchsorted(those["time"], self.times, side="right")]
        return parts
