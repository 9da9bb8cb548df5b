"""Forces that vary, on bodies that joints hold and nothing touches, over a flight (see `dynamics/constraints/joint_flight.py`).

The method of order 8 asks for them at its stages: F_i at the times c_i h, with the weights b_i. What a force does is kept as the line over
the flight that has its two moments,

    M0 = sum b_i F_i,   M1 = sum b_i c_i F_i,      L(s) = M0 + 12 (M1 - M0 / 2) (s / h - 1 / 2),

so that its impulse is of order 8. Between the ends bodies follow lines, as they do under all forces: a path is off by up to
|F - L| h^2 / 12 m. Where members are moved from end to end, and nobody looks at their paths, impulse, angular impulse and work of a force
are sums of its rates with the weights b_i.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rigidimpulse.dynamics.constraints.joint_flight import STAGE_TIMES, STAGE_WEIGHTS
from rigidimpulse.engine.run import Run
from rigidimpulse.model.island import Island
from rigidimpulse.motion.body_state import BodyState
from rigidimpulse.motion.force_step import Lines

if TYPE_CHECKING:
    from rigidimpulse.engine.varying_forces import VaryingForces

PART = 1.0 / 12.0


class FlightForces:
    """The forces on the members of an island, from its time on.

    Attributes:
        longest: s, how long a flight may be: until a force jumps, or as long as it still looks smooth.
        push: m/s2, by them at the start, at most.

    """

    def __init__(self, forces: VaryingForces, run: Run, island: Island, bounds: tuple[float, float]) -> None:
        """bounds: `longest` and `push`."""
        self.longest, self.push = bounds
        self._forces, self._now, self._time = forces, run.state.now, island.time
        self._members = island.members[forces.acts[island.members]]
        self._h, self._flown, self._done = 0.0, 0.0, np.zeros(())
        self._powers: list[np.ndarray] = []
        self._rows: list[np.ndarray] = []
        self._sums: list[np.ndarray] = []

    def begin(self, h: float) -> None:
        """A flight of h s begins."""
        self._h = h
        self._powers.clear()
        self._rows.clear()
        self._sums.clear()

    def at(self, share: float, bodies: BodyState, rotation: np.ndarray) -> np.ndarray:
        """Forces and torques (n, 6) on bodies after that share of the flight, where they are then; the next stage."""
        rows, total = self._forces.evaluate_within(self._time + self._flown, self._h, share, self._members, bodies, rotation)
        self._rows.append(rows)
        self._sums.append(total)
        self._powers.append(self._forces.powers(rows, bodies))
        return total

    def move_on(self, h: float) -> None:
        """The members were moved to the end of this flight of h s; the next one begins there."""
        self._done = self._done + h * np.tensordot(STAGE_WEIGHTS, np.stack(self._powers), 1)
        self._flown += h

    def note(self, end: float) -> None:
        """The members have been moved to `end` [s]: what forces did on the way is recorded."""
        self._forces.log.add(self._members, end, self._done)
        self._time, self._flown, self._done = end, 0.0, np.zeros(())

    def off(self) -> float:
        """By how much paths are off on the way, as a part of the size of bodies or in rad."""
        line, stages = _line(self._sums), zip(STAGE_TIMES.tolist(), self._sums, strict=True)
        h = np.full(len(self._members), self._h)
        off = [self._forces.errors(self._now, self._members, f - line.value - c * line.change, h, PART).max() for c, f in stages]
        return float(max(off))

    def share_until_break(self) -> float:
        """Share of the flight after which a force gives way, 1 if none does."""
        return self._forces.share_until_break(_line(self._rows))

    def keep(self) -> None:
        """From now on the forces of this flight act."""
        lines = _line(self._rows), _line(self._sums)
        self._forces.keep_flight(self._members, self._time, lines, self._h, self._now)


def _line(stages: list[np.ndarray]) -> Lines:
    """The line with the moments of forces (STAGES, k, 6)."""
    values = np.stack(stages)
    mean, moment = (np.tensordot(weights, values, 1) for weights in (STAGE_WEIGHTS, STAGE_WEIGHTS * STAGE_TIMES))
    change = 12.0 * (moment - 0.5 * mean)
    return Lines(mean - 0.5 * change, change, np.zeros_like(change))
