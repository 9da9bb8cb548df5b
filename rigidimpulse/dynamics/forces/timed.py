"""Forces that are given over time and keep their direction in the world, at points of bodies.

    F(t),    torque about the centre of mass  (R c) x F(t),    c: the point in the body

The base of constant, harmonic and sampled forces. Impulse over a time T: the integral of F.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from rigidimpulse.core.vector import cross_arrays
from rigidimpulse.dynamics.forces.force import ForceTable, Instant, no_links


class TimedForces(ForceTable):
    """Forces (k,) of one class, each on one body."""

    def __init__(
        self, kind: str, names: list[str], body: list[int], points: list[np.ndarray], strength: Callable, reason: str,
        breaks: np.ndarray | None = None, longest: np.ndarray | None = None,
    ) -> None:
        """body (k,), points (k, 3) m in principal frames; strength(time (r,), rows (r,)) -> (r, 3) N; breaks: s, sorted; longest (k,) s."""
        self.kind, self.names, self.reason = kind, names, reason
        self.body, self.cause = np.array(body, np.int64), np.arange(len(body))
        self.links, self.is_steady = no_links(), False
        self._points, self._strength = np.array(points).reshape(-1, 3), strength
        self._turns = bool(np.any(self._points))
        self._breaks = np.zeros(0) if breaks is None else breaks
        self._longest = np.full(len(body), np.inf) if longest is None else longest

    def wrench(self, at: Instant, rows: np.ndarray) -> np.ndarray:
        """Force and torque of rows."""
        i = self.body[rows]
        wrench = np.zeros((len(rows), 6))
        wrench[:, :3] = self._strength(at.time[i], rows)
        if self._turns:
            arm = np.einsum("ijk,ik->ij", at.rotation[i], self._points[rows])
            wrench[:, 3:] = cross_arrays(arm, wrench[:, :3])
        return wrench

    def longest_steps(self) -> np.ndarray:
        """A part of the period where there is one."""
        return self._longest

    def next_break(self, time: float) -> float:
        """Next kink."""
        k = int(np.searchsorted(self._breaks, time, side="right"))
        return float(self._breaks[k]) if k < len(self._breaks) else np.inf
