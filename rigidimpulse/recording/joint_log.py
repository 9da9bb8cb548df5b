"""What joints give while a run goes on: their impulses until the frames, and their forces at the ends of sub-steps."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rigidimpulse.core.kernels import jit
from rigidimpulse.recording.impulses import ImpulseAccounts, add_force


@jit
def _add_forces(times, which, start, end, force, gains):
    """Add what constant forces (k, 3) N of joints `which` (k,) give from start to end (k,) s to their gains (j, f + 1, 3) N s."""
    for r in range(which.shape[0]):
        add_force(times, start[r], end[r], force[r], gains[which[r]])


class JointLog:
    """What each of j joints gives to its second body."""

    def __init__(self, times: np.ndarray, names: Sequence[str], bodies: np.ndarray) -> None:
        """times: (f,) s of the frames; names (j,) and both bodies (j, 2) of the joints."""
        self._times, self._names, self._bodies = times, names, bodies
        self._gains, self._acted = np.zeros((len(names), len(times) + 1, 3)), np.zeros(len(names), bool)
        self._at: list[float] = []
        self._joints: list[np.ndarray] = []
        self._forces: list[np.ndarray] = []

    def add(self, which: np.ndarray, start: np.ndarray, end: np.ndarray, force: np.ndarray) -> None:
        """Add the impulses of constant forces (k, 3) N of joints `which` (k,) from start to end (k,) s."""
        self._acted[which] = True
        _add_forces(self._times, which, start, end, force, self._gains)

    def add_at(self, which: np.ndarray, time: float, impulse: np.ndarray) -> None:
        """Add impulses (k, 3) N s of joints `which` (k,) at a time [s]."""
        self._acted[which] = True
        self._gains[which, np.searchsorted(self._times, time, side="left")] += impulse

    def note(self, time: float, which: np.ndarray, force: np.ndarray) -> None:
        """Note the forces (k, 3) N of joints `which` (k,) at a time [s]."""
        self._at.append(time)
        self._joints.append(which)
        self._forces.append(force)

    def keep(self, count: int) -> None:
        """Leave the first `count` frames only."""
        self._times, self._gains = self._times[:count], self._gains[:, : count + 1]

    def add_to(self, accounts: ImpulseAccounts) -> None:
        """Give the impulses of joints that acted to the accounts."""
        for j in np.flatnonzero(self._acted).tolist():
            accounts.put(f"joint {self._names[j]}", int(self._bodies[j, 0]), int(self._bodies[j, 1]), self._gains[j])

    def reactions(self, times: np.ndarray) -> dict[str, np.ndarray]:
        """Forces on their second bodies by joint name, (f, 3) N at the frame times."""
        table: dict[str, np.ndarray] = {}
        counts = [len(which) for which in self._joints]
        joints = np.concatenate([*self._joints, np.zeros(0, np.int64)])
        order = np.argsort(joints, kind="stable")
        at, force = np.repeat(np.array(self._at), counts)[order], np.concatenate([*self._forces, np.zeros((0, 3))])[order]
        first = np.searchsorted(joints[order], np.arange(len(self._names) + 1))
        for j, name in enumerate(self._names):
            mine = slice(int(first[j]), int(first[j + 1]))
            own = at[mine]
            if not len(own):
                table[name] = np.zeros((len(times), 3))
                continue
            # Of several at one instant the last one counts.
            last = np.append(np.flatnonzero(np.diff(own) > 0.0), len(own) - 1)
            table[name] = np.column_stack([np.interp(times, own[last], force[mine][last, k]) for k in range(3)])
        return table
