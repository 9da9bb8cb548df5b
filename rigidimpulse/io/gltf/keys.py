"""Keys of a body's motion: the frames of a run, more of them where it spins fast, fewer where nobody would see it.

Linear rotation keys alias where a body turns by pi or more from one to the next: a player takes the shorter way round.
Between two frames such a body is taken to turn evenly. Of all rotation vectors that lead from the first pose to the second,

    phi_k = (|phi_0| + 2 pi k) n,    phi_0 the shortest,    n its direction,

the one nearest to dt (w_0 + w_1) / 2 is it, with the angular velocities w that the run has at its frames; its centre of mass
moves evenly, and its origin about that.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rigidimpulse.rotation import (
    angle_between,
    conjugate,
    multiply,
    quaternion_continuity,
    quaternion_from_rotation_vector,
    rotate,
    rotate_inverse,
    rotation_vector,
)

ALIASING = 2.0
"""rad, turn from frame to frame from which on there are keys in between."""
TURN = 1.5
"""rad, greatest turn from key to key there."""
STRAIGHT = 1e-6
"""Sine of the half angle below which the direction of a rotation is that of the angular velocity."""


class Keys(NamedTuple):
    """Poses of a body's origin at times: (k,) s, (k, 3) m, (k, 4) wxyz with continuous signs."""

    times: np.ndarray
    positions: np.ndarray
    orientations: np.ndarray


class Path:
    """The motion of one body of a run."""

    def __init__(self, run, name: str) -> None:
        """Take over the frames of a recording."""
        i = run.index(name)
        self.times = run.times
        self.positions = run.positions[:, i]
        self.orientations = quaternion_continuity(run.orientations[:, i])
        self._centers, self._spins = run.centers[:, i], run.angular_velocities[:, i]

    @property
    def moves(self) -> bool:
        """Whether any frame differs from the first."""
        return bool(np.any(self.positions != self.positions[0]) or np.any(self.orientations != self.orientations[0]))

    def key_times(self) -> np.ndarray:
        """Times of the frames, and of the keys in between (k,) s."""
        if len(self.times) < 2:
            return self.times
        dt = np.diff(self.times)
        speed = np.linalg.norm(self._spins, axis=1)
        turn = dt * np.maximum(speed[:-1], speed[1:])
        fast = np.flatnonzero(turn > ALIASING)
        if not len(fast):
            return self.times
        between = [np.linspace(self.times[f], self.times[f + 1], int(np.ceil(turn[f] / TURN)) + 1)[1:-1] for f in fast.tolist()]
        return np.unique(np.concatenate([self.times, *between]))

    def at(self, times: np.ndarray) -> Keys:
        """Poses at times (t,) s within the run."""
        if times is self.times or len(self.times) < 2:
            return Keys(self.times, self.positions, self.orientations)
        f = np.clip(np.searchsorted(self.times, times, side="right") - 1, 0, len(self.times) - 2)
        dt = self.times[f + 1] - self.times[f]
        share = ((times - self.times[f]) / dt)[:, None]
        way = self._turns(f, dt)
        q = multiply(quaternion_from_rotation_vector(share * way), self.orientations[f])
        arm = rotate_inverse(self.orientations[f], self.positions[f] - self._centers[f])
        x = (1.0 - share) * self._centers[f] + share * self._centers[f + 1] + rotate(q, arm)
        on = np.isin(times, self.times)
        frame = np.searchsorted(self.times, times[on])
        x[on], q[on] = self.positions[frame], self.orientations[frame]
        return Keys(times, x, quaternion_continuity(q))

    def _turns(self, f: np.ndarray, dt: np.ndarray) -> np.ndarray:
        """Rotation vectors (t, 3) from frame f to the next."""
        shortest = rotation_vector(multiply(self.orientations[f + 1], conjugate(self.orientations[f])))
        wanted = 0.5 * dt[:, None] * (self._spins[f] + self._spins[f + 1])
        angle = np.linalg.norm(shortest, axis=1)
        along = np.linalg.norm(wanted, axis=1)
        clear = angle > STRAIGHT
        unit = np.where(clear, angle, 1.0)
        instead = wanted / np.where(along > 0.0, along, 1.0)[:, None]
        n = np.where(clear[:, None], shortest / unit[:, None], instead)
        turns = np.round((np.sum(n * wanted, axis=1) - angle) / (2.0 * np.pi))
        return (angle + 2.0 * np.pi * turns)[:, None] * n


def reduced(keys: Keys, reach: float, tolerance: float) -> np.ndarray:
    """Return the places of keys (m,) that are enough: no point of the body is off by more than the tolerance in between.

    The key that is off most is kept, as long as one is (Ramer 1972; Douglas & Peucker 1973). A pose is off by the distance of
    the origins and `reach` times the angle, a bound for all points within `reach` [m] of the origin. tolerance: m.
    """
    times, x, q = keys
    kept = np.array([0, len(times) - 1])
    inside = np.arange(len(times))  # frames between keys where some are still off
    while len(inside):
        part = np.minimum(np.searchsorted(kept, inside, side="right") - 1, len(kept) - 2)
        off = _off(times, x, q, inside, kept[part], kept[part + 1], reach)
        first = np.flatnonzero(np.diff(part, prepend=-1))
        worst = np.maximum.reduceat(off, first)
        which = np.cumsum(np.diff(part, prepend=-1) > 0) - 1
        candidates = np.flatnonzero((off == worst[which]) & (off > tolerance))
        _, once = np.unique(which[candidates], return_index=True)
        added = inside[candidates[once]]
        inside = inside[worst[which] > tolerance]
        inside = inside[~np.isin(inside, added)]
        kept = np.union1d(kept, added)
    return kept


def _off(times, x, q, i, first, last, reach: float) -> np.ndarray:
    """How far the poses i (m,) are off [m] those in between the keys first and last (m,)."""
    h = times[last] - times[first]
    s = np.divide(times[i] - times[first], h, out=np.zeros(len(i)), where=h > 0.0)[:, None]
    turn = rotation_vector(multiply(q[last], conjugate(q[first])))
    between = multiply(quaternion_from_rotation_vector(s * turn), q[first])
    return np.linalg.norm((1.0 - s) * x[first] + s * x[last] - x[i], axis=1) + reach * angle_between(between, q[i])
