"""Keys of a body's motion: the frames of a run, more of them where it spins fast, fewer where nobody would see it.

Linear rotation keys alias where a body turns by pi or more from one to the next: a player takes the shorter way round.
Between two frames such a body is taken to turn evenly. Of all rotation vectors that lead from the first pose to the second,

    phi_k = (|phi_0| + 2 pi k) n,    phi_0 the shortest,    n its direction,

the one nearest to dt w is it, w = (w_0 + w_1) / 2, with the angular velocities w that the run has at its frames. Its centre of mass c moves
on the parabola of its flight where the velocities v of the run agree with one, else evenly, and its origin about that:

    c = c_0 + s (c_1 - c_0) - s (1 - s) b / 2,    b = dt (v_1 - v_0)    if    c_1 - c_0 = dt (v_0 + v_1) / 2,    else 0

at the share s of the way. Impacts between frames, which straight lines cut off, are keys where they are asked for.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rigidimpulse.core.quaternion import (
    angle_between,
    conjugate,
    multiply,
    quaternion_continuity,
    quaternion_from_rotation_vector,
    rotate,
    rotate_inverse,
    rotation_vector,
)

if TYPE_CHECKING:
    from rigidimpulse.recording.recording import Recording

ALIASING = 2.0
"""rad, turn from key to key from which on there are keys in between."""
TURN = 1.5
"""rad, greatest turn from key to key there."""
STRAIGHT = 1e-6
"""Sine of the half angle below which the direction of a rotation is that of the angular velocity."""


BEND, BEND_LEAST, TWIST = 0.01, 1e-4, 0.02
"""Share of the way from key to key, m, and rad, by which the middle may be off: more than the share and the length, or than the angle."""
HALVINGS = 10
MOST_KEYS = 1_000_000
AGREE = 0.02
"""Share of the way between two frames, and angle in rad, within which both sides agree on the pose at an impact."""
LEAST = 1e-3
"""Share of the time between two frames: an impact nearer to one of them has no key."""


class Keys(NamedTuple):
    """Poses of a body's origin at times: (k,) s, (k, 3) m, (k, 4) wxyz with continuous signs."""

    times: np.ndarray
    positions: np.ndarray
    orientations: np.ndarray


class Path:
    """The motion of one body of a run: its frames, and its impacts where they are asked for and known.

    Between two of these it turns evenly, by the vector phi, and its centre of mass flies or moves evenly.
    """

    def __init__(self, run: Recording, name: str, impacts: np.ndarray | None = None, gravity: np.ndarray | None = None) -> None:
        """Take over the frames of a recording.

        Args:
            run: the recording. name: of the body.
            impacts: (k,) s, when impulses act on it: between frames they are found where the body flies freely before and after.
            gravity: (3,) m/s^2, of its flight.

        """
        i = run.index(name)
        self.times, self.positions = run.times, run.positions[:, i]
        self.orientations = quaternion_continuity(run.orientations[:, i])
        self._centers, spins = run.centers[:, i], run.angular_velocities[:, i]
        self._rates = 0.5 * (spins[:-1] + spins[1:])
        speed = np.linalg.norm(spins, axis=1)
        self._speeds = np.maximum(speed[:-1], speed[1:])
        self._bends = _bends(self.times, self._centers, run.velocities[:, i])
        if impacts is not None and len(impacts):
            assert gravity is not None
            self._split(impacts, run.velocities[:, i], spins, gravity)

    @property
    def moves(self) -> bool:
        """Whether any frame differs from the first."""
        return bool(np.any(self.positions != self.positions[0]) or np.any(self.orientations != self.orientations[0]))

    def _split(self, impacts: np.ndarray, velocities: np.ndarray, spins: np.ndarray, gravity: np.ndarray) -> None:
        """Put in the poses at the only impact between two frames, t after the one and u before the other,

            c_0 + v_0 t + g t^2 / 2 = c = c_1 - v_1 u + g u^2 / 2,    exp(w_0 t) q_0 = q = exp(-w_1 u) q_1

        where both sides agree: there the body flew freely.
        """
        f = np.searchsorted(self.times, impacts, side="right") - 1
        inside = (f >= 0) & (f < len(self.times) - 1) & (impacts > self.times[np.maximum(f, 0)])
        f, first, count = np.unique(f[inside], return_index=True, return_counts=True)
        time = impacts[inside][first]
        f, time = f[count == 1], time[count == 1]
        t, u = (time - self.times[f])[:, None], (self.times[f + 1] - time)[:, None]
        ahead = self._centers[f] + velocities[f] * t + 0.5 * gravity * t**2
        back = self._centers[f + 1] - velocities[f + 1] * u + 0.5 * gravity * u**2
        turned = multiply(quaternion_from_rotation_vector(spins[f] * t), self.orientations[f])
        returned = multiply(quaternion_from_rotation_vector(-spins[f + 1] * u), self.orientations[f + 1])
        way = np.linalg.norm(self._centers[f + 1] - self._centers[f], axis=1) + np.linalg.norm(gravity) * (t + u)[:, 0] ** 2
        agree = (np.linalg.norm(ahead - back, axis=1) <= AGREE * way) & (angle_between(turned, returned) <= AGREE)
        clear = agree & (np.minimum(t, u)[:, 0] > LEAST * (t + u)[:, 0])
        f, time, center, q = f[clear], time[clear], ahead[clear], turned[clear]
        arm = rotate_inverse(self.orientations[f], self.positions[f] - self._centers[f])
        bends = self._bends
        bends[f] = gravity * t[clear] ** 2
        self._bends = np.insert(bends, f + 1, gravity * u[clear] ** 2, axis=0)
        self._insert(f, time, center, center + rotate(q, arm), q, spins)

    def _insert(self, f: np.ndarray, time: np.ndarray, center: np.ndarray, place: np.ndarray, q: np.ndarray, spins: np.ndarray) -> None:
        """Put in poses between the frames f and the next, which turn at their own rate to and from there."""
        rates, speeds = self._rates.copy(), self._speeds.copy()
        rates[f], speeds[f] = spins[f], np.linalg.norm(spins[f], axis=1)
        self._rates = np.insert(rates, f + 1, spins[f + 1], axis=0)
        self._speeds = np.insert(speeds, f + 1, np.linalg.norm(spins[f + 1], axis=1))
        self.times = np.insert(self.times, f + 1, time)
        self.positions = np.insert(self.positions, f + 1, place, axis=0)
        self._centers = np.insert(self._centers, f + 1, center, axis=0)
        self.orientations = quaternion_continuity(np.insert(self.orientations, f + 1, q, axis=0))

    def key_times(self, samples: int = 1) -> np.ndarray:
        """Times of the frames and impacts, and of the keys in between (k,) s.

        Args:
            samples: keys from one frame to the next, at least: even shares of the way.

        """
        turn = np.diff(self.times) * self._speeds
        parts = np.maximum(np.where(turn > ALIASING, np.ceil(turn / TURN), 1.0), samples).astype(int)
        several = np.flatnonzero(parts > 1).tolist()
        if not several:
            return self.times
        between = [np.linspace(self.times[f], self.times[f + 1], parts[f] + 1)[1:-1] for f in several]
        return np.unique(np.concatenate([self.times, *between]))

    def at(self, times: np.ndarray) -> Keys:
        """Poses at times (t,) s within the run."""
        if times is self.times or len(self.times) < 2:
            return Keys(self.times, self.positions, self.orientations)
        f = np.clip(np.searchsorted(self.times, times, side="right") - 1, 0, len(self.times) - 2)
        dt = self.times[f + 1] - self.times[f]
        share = ((times - self.times[f]) / dt)[:, None]
        q = multiply(quaternion_from_rotation_vector(share * self._turns(f, dt)), self.orientations[f])
        arm = rotate_inverse(self.orientations[f], self.positions[f] - self._centers[f])
        x = (1.0 - share) * self._centers[f] + share * self._centers[f + 1] - 0.5 * share * (1.0 - share) * self._bends[f] + rotate(q, arm)
        on = np.isin(times, self.times)
        frame = np.searchsorted(self.times, times[on])
        x[on], q[on] = self.positions[frame], self.orientations[frame]
        return Keys(times, x, quaternion_continuity(q))

    def _turns(self, f: np.ndarray, dt: np.ndarray) -> np.ndarray:
        """Rotation vectors (t, 3) from frame or impact f to the next."""
        shortest = rotation_vector(multiply(self.orientations[f + 1], conjugate(self.orientations[f])))
        wanted = dt[:, None] * self._rates[f]
        angle = np.linalg.norm(shortest, axis=1)
        along = np.linalg.norm(wanted, axis=1)
        clear = angle > STRAIGHT
        unit = np.where(clear, angle, 1.0)
        instead = wanted / np.where(along > 0.0, along, 1.0)[:, None]
        n = np.where(clear[:, None], shortest / unit[:, None], instead)
        turns = np.round((np.sum(n * wanted, axis=1) - angle) / (2.0 * np.pi))
        return (angle + 2.0 * np.pi * turns)[:, None] * n


def _bends(times: np.ndarray, centers: np.ndarray, velocities: np.ndarray) -> np.ndarray:
    """b (f - 1, 3) m of the parabolas between frames; 0 where the velocities are not those of one."""
    dt = np.diff(times)[:, None]
    bend = dt * np.diff(velocities, axis=0)
    off = np.diff(centers, axis=0) - 0.5 * dt * (velocities[:-1] + velocities[1:])
    flies = np.linalg.norm(off, axis=1) <= AGREE * np.linalg.norm(bend, axis=1)
    return np.where(flies[:, None], bend, 0.0)


def refined(times: np.ndarray, poses: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]) -> Keys:
    """Return keys at times (k,) s, and more halfway between two as long as a straight way and an even turn miss the middle.

    poses: gives positions (t, 3) m and quaternions (t, 4) wxyz at times (t,) s.
    """
    x, q = poses(times)
    left = np.arange(len(times) - 1)
    for _ in range(HALVINGS):
        middle = 0.5 * (times[left] + times[left + 1])
        at, turned = poses(middle)
        way = np.linalg.norm(x[left + 1] - x[left], axis=1)
        off = np.linalg.norm(at - 0.5 * (x[left] + x[left + 1]), axis=1)
        half = 0.5 * rotation_vector(multiply(q[left + 1], conjugate(q[left])))
        astray = angle_between(multiply(quaternion_from_rotation_vector(half), q[left]), turned)
        bad = ((off > BEND * way) & (off > BEND_LEAST)) | (astray > TWIST)
        if not bad.any() or len(times) > MOST_KEYS:
            break
        place = left[bad] + 1
        times = np.insert(times, place, middle[bad])
        x, q = np.insert(x, place, at[bad], axis=0), np.insert(q, place, turned[bad], axis=0)
        new = place + np.arange(len(place))
        left = np.sort(np.concatenate([new - 1, new]))
    return Keys(times, x, quaternion_continuity(q))


def reduced(keys: Keys, reach: float, tolerance: float) -> np.ndarray:
    """Return the places of keys (m,) that are enough: no point of the body is off by more than the tolerance in between.

    The key that is off most is kept, as long as one is (Ramer 1972; Douglas & Peucker 1973). A pose is off by the distance of
    the origins and `reach` times the angle, a bound for all points within `reach` [m] of the origin. tolerance: m.
    """
    kept = np.array([0, len(keys.times) - 1])
    inside = np.arange(len(keys.times))  # frames between keys where some are still off
    while len(inside):
        part = np.minimum(np.searchsorted(kept, inside, side="right") - 1, len(kept) - 2)
        off = _off(keys, inside, kept[part], kept[part + 1], reach)
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


def _off(keys: Keys, i: np.ndarray, first: np.ndarray, last: np.ndarray, reach: float) -> np.ndarray:
    """How far the poses i (m,) are off [m] those in between the keys first and last (m,)."""
    times, x, q = keys
    h = times[last] - times[first]
    s = np.divide(times[i] - times[first], h, out=np.zeros(len(i)), where=h > 0.0)[:, None]
    turn = rotation_vector(multiply(q[last], conjugate(q[first])))
    between = multiply(quaternion_from_rotation_vector(s * turn), q[first])
    return np.linalg.norm((1.0 - s) * x[first] + s * x[last] - x[i], axis=1) + reach * angle_between(between, q[i])
