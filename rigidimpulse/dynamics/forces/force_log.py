"""What every force does: its impulse, angular impulse and work, until each frame.

    J = integral of F ds,   H = integral of (tau + x x F) ds,   W = integral of (F.v + tau.w) ds

along the trajectory of the body, where the force and its torque tau about the centre of mass follow a line over the time s since its start.
J is the closed form of the line. H and W are Gauss's quadrature of three points: exact for H and for the work of F, as x is a cubic. Where
joints or contacts have moved the body from the end of its trajectory by dx and a turn, the force does the work F.dx + tau.turn there: a rod
that a motor presses against a limit stays where it is, and no work is done, though each sub-step leads it into the limit and back.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from rigidimpulse.core.kernels import jit_making_arrays
from rigidimpulse.core.portable import dot
from rigidimpulse.core.quaternion import conjugate, multiply, rotation_vector
from rigidimpulse.motion.body_state import BodyState
from rigidimpulse.motion.trajectory import Trajectories, pose_at, state_at

NODES = (0.5 - math.sqrt(0.15), 0.5, 0.5 + math.sqrt(0.15))
WEIGHTS = (5.0 / 18.0, 8.0 / 18.0, 5.0 / 18.0)


@jit_making_arrays
def add_line_integrals(trajectory, i, times, rows, value, rate, total):
    """Add J, H, W of lines to rows of total (k, 7).

    times: when the lines began, and from when to when they are integrated, s; value (k, 6) N and N m when they began, rate (k, 6) a second.
    """
    begin, start, end = times
    h = end - start
    x, q, v, w = np.empty(3), np.empty(4), np.empty(3), np.empty(3)
    # Gauss's quadrature of three points for H and W; J has the closed form of the line.
    for node in range(3):
        time = start + NODES[node] * h
        part = WEIGHTS[node] * h
        state_at(trajectory, i, time, x, q, v, w)
        for r in rows:
            f0 = value[r, 0] + rate[r, 0] * (time - begin)
            f1 = value[r, 1] + rate[r, 1] * (time - begin)
            f2 = value[r, 2] + rate[r, 2] * (time - begin)
            t0 = value[r, 3] + rate[r, 3] * (time - begin)
            t1 = value[r, 4] + rate[r, 4] * (time - begin)
            t2 = value[r, 5] + rate[r, 5] * (time - begin)
            out = total[r]
            out[3] += part * (t0 + x[1] * f2 - x[2] * f1)
            out[4] += part * (t1 + x[2] * f0 - x[0] * f2)
            out[5] += part * (t2 + x[0] * f1 - x[1] * f0)
            out[6] += part * (f0 * v[0] + f1 * v[1] + f2 * v[2] + t0 * w[0] + t1 * w[1] + t2 * w[2])
    middle = 0.5 * (start + end) - begin
    for r in rows:
        for k in range(3):
            total[r, k] += h * (value[r, k] + rate[r, k] * middle)


@dataclass(frozen=True)
class ForceWork:
    """What forces did until f frames.

    Attributes:
        names: of the forces. body, cause: (k,) of each row, the body it acts on and the force it belongs to.
        done: (f, k, 7) impulse [N s], angular impulse about the world's origin [N m s], work [J].
        potential: (f, forces) J. mass_share: (f, n), mass of each body over that at the end of the run, None where masses stay.

    """

    names: list[str]
    body: np.ndarray
    cause: np.ndarray
    done: np.ndarray
    potential: np.ndarray
    mass_share: np.ndarray | None

    def on_bodies(self, n: int) -> np.ndarray:
        """Work (f, n) J on each of n bodies."""
        total = np.zeros((n, len(self.done)))
        np.add.at(total, self.body, self.done[:, :, 6].T)
        return total.T

    def impulses_on(self, i: int) -> dict[str, np.ndarray]:
        """Impulses (f, 3) N s of each force on a body."""
        total: dict[str, np.ndarray] = {}
        for row in np.flatnonzero(self.body == i).tolist():
            name = self.names[self.cause[row]]
            total[name] = total.get(name, 0.0) + self.done[:, row, :3]
        return total

    def taken(self) -> dict[str, np.ndarray]:
        """Energy (f,) J that each force took from bodies and did not keep as potential energy."""
        total = np.zeros((len(self.names), len(self.done)))
        np.add.at(total, self.cause, self.done[:, :, 6].T)
        stored = (self.potential - self.potential[:1]).T
        return dict(zip(self.names, -total - stored, strict=True))


class ForceLog:
    """Integrals of forces, row by row.

    Attributes:
        at_frames: (f, k, 7) impulse [N s], angular impulse about the world's origin [N m s] and work [J] of each row until each frame.
        work: (n,) J that forces did on each body until the line that acts on it began.

    """

    def __init__(self, times: np.ndarray, body: np.ndarray, trajectory: Trajectories) -> None:
        """times (f,) s of the frames; body (k,) of each row."""
        n = len(trajectory.start)
        self.at_frames = np.zeros((len(times), len(body), 7))
        self.work = np.zeros(n)
        self._times, self._trajectory = times, trajectory
        self._rows = {int(i): np.flatnonzero(body == i) for i in np.unique(body)}
        self._value, self._rate, self._total = np.zeros((len(body), 6)), np.zeros((len(body), 6)), np.zeros((len(body), 7))
        self._begun = np.full(n, times[0])
        self._written = np.zeros(n, np.int64)

    def begin(self, members: np.ndarray, time: float, lines: tuple[np.ndarray, np.ndarray], length: np.ndarray, now: BodyState) -> None:
        """New lines act on members from `time` on: values (k, 6), and their changes (k, 6) over length (n,) s.

        Their trajectories must still be those that led here; now: where they are.
        """
        value, change = lines
        for i in members.tolist():
            self.end(i, time, now)
            rows = self._rows[i]
            self._value[rows], self._rate[rows] = value[rows], change[rows] / length[i]

    def wrench(self, rows: np.ndarray, body: np.ndarray, time: float) -> np.ndarray:
        """What acts on bodies (r,) by the lines of rows (r,) at `time`, (r, 6) N and N m."""
        return self._value[rows] + self._rate[rows] * (time - self._begun[body])[:, None]

    def end(self, i: int, time: float, now: BodyState | None = None) -> None:
        """The lines that act on body i end at `time`, if there are any; now: where it is then, None if its trajectory leads there."""
        start = self._begun[i]
        if i not in self._rows or time <= start:
            return
        rows = self._rows[i]
        first, last = int(self._written[i]), int(np.searchsorted(self._times, time, side="left"))
        for f in range(first, last):
            self.at_frames[f, rows] = self._total[rows]
            add_line_integrals(self._trajectory, i, (start, start, self._times[f]), rows, self._value, self._rate, self.at_frames[f])
        self._written[i] = last
        before = self._total[rows, 6].sum()
        add_line_integrals(self._trajectory, i, (start, start, time), rows, self._value, self._rate, self._total)
        if now is not None:
            x, q = np.empty(3), np.empty(4)
            pose_at(self._trajectory, i, time, x, q)
            moved = np.concatenate([now.position[i] - x, rotation_vector(multiply(now.orientation[i], conjugate(q)))])
            self._total[rows, 6] += dot(self._value[rows] + self._rate[rows] * (time - start), moved)
        self.work[i] += self._total[rows, 6].sum() - before
        self._begun[i] = time

    def add(self, members: np.ndarray, end: float, done: np.ndarray) -> None:
        """Members were moved to `end` [s] from where their lines ended; done (k, 7): what each row did on the way.

        No frame is on it, save by round-off at its start.
        """
        for i in members.tolist():
            rows, first = self._rows[i], int(self._written[i])
            last = int(np.searchsorted(self._times, end, side="left"))
            self.at_frames[first:last, rows] = self._total[rows]
            self._written[i] = max(first, last)
            self._total[rows] += done[rows]
            self.work[i] += done[rows, 6].sum()
            self._begun[i] = end

    def keep(self, count: int) -> None:
        """Leave the first `count` frames only."""
        self._times, self.at_frames = self._times[:count], self.at_frames[:count]
        self._written = np.minimum(self._written, count)

    def finish(self) -> None:
        """Write the frames that are left."""
        for i, rows in self._rows.items():
            for f in range(int(self._written[i]), len(self._times)):
                self.at_frames[f, rows] = self._total[rows]
                start = self._begun[i]
                add_line_integrals(self._trajectory, i, (start, start, self._times[f]), rows, self._value, self._rate, self.at_frames[f])
