"""Flights of jointed islands that touch nothing: how long they may be (see `dynamics/constraints/joint_flight.py`).

The error of a flight at its end is of order 8, that of the paths on the way of order 4. Each has its bound, and the one that is nearer to
its bound says how long the next flight is.

Where nothing can come near an island, nobody asks for the paths on the way. Then all that is left of the time, but the last flight, is
flown past in steps of the method, inside one kernel.
"""

from __future__ import annotations

import math

import numpy as np

from rigidimpulse.dynamics.constraints.joint_flight import fly, length_that_follows, make_flight
from rigidimpulse.dynamics.constraints.jointed_island import JointedIsland
from rigidimpulse.model.joint_table import Joints
from rigidimpulse.model.world import World

AT_END, ON_THE_WAY = 3.0, 1.0
"""Errors of a flight, relative to the size of what joints join: at its end in tolerances of the accuracy, on the way in roots of them.
3e-13 and 3e-7 by default."""
FIRST_TURN = 0.5
"""rad, how far bodies turn at most in the first flight."""
WORK, MOST_WORK = 0.1, 3.0
"""By how much for each body a flight, which solves the joints more often, costs more than a sub-step of the other method; and at most."""
WORTH = 1.0 / 2048.0
"""Part of the run's step for which a flight is always worth it. The other method is of second order: with 1/32, whips of a double pendulum
were left to it, and 3e-4 of the energy was made, at a higher cost."""
MISSED: float = 1e-11
"""rad, by which paths may end elsewhere than flights; the tolerance of the accuracy, if that is more: a gyroscope at
"preview" flew in a third of the length that its error allowed, and took longer than at "standard"."""
OTHERWISE, LONGER = 0.7, 1.05
"""Part of the length that is tried next where they do; and of that, by which the next flight may be longer."""
PAUSE = 16
"""Sub-steps that are not flown after a flight that was given up."""
WHOLE = 0.0, 0.0
"""A flight in one piece."""


class JointFlights:
    """The flights of a run.

    Attributes:
        flight: what was found of the last one. too_short: whether that was given up for how fast it turns, or bends.

    """

    def __init__(self, world: World, table: Joints) -> None:
        """Nothing has flown."""
        self.flight = make_flight(world.inv_mass, world.joint_size, len(table.body_a), len(table.coordinate))
        self._at_end = AT_END * world.accuracy.tolerance
        self._missed = max(MISSED, world.accuracy.tolerance)
        self._on_the_way = ON_THE_WAY * world.accuracy.tolerance**0.5 * world.joint_size
        self._worth = WORTH * world.accuracy.step
        self.too_short = False
        joint_of_row = np.repeat(np.arange(len(table.body_a)), np.diff(table.first))
        holds = np.isinf(table.stiffness) & np.isinf(table.lower) & np.isinf(table.upper)
        is_limit = (table.lower == 0.0) != (table.upper == 0.0)
        self._hard = np.bincount(joint_of_row[~(holds | is_limit)], minlength=len(table.body_a)) == 0
        self._pause = np.zeros(len(table.body_a), np.int64)
        self._plan, self._step, self._path = np.full((3, len(table.body_a)), np.inf)

    def may_fly(self, which: np.ndarray) -> bool:
        """Whether to try a flight of an island with these joints: no spring or motor is in it, and none was given up just before."""
        self._pause[which] -= 1
        return bool(self._hard[which].all()) and int(self._pause[which].max()) < 0

    def is_longer(self, which: np.ndarray, rest: float) -> bool:
        """Whether `rest` s takes the island of these joints several flights."""
        return rest > 2.0 * self._last(which)

    def _last(self, which: np.ndarray) -> float:
        """Length of a last flight, whose path is laid, s: what its errors allow, and no more than what paths missed lately."""
        return min(float(self._plan[which].min()), float(self._path[which].min()))

    def fly_past(self, jointed: JointedIsland, steady: np.ndarray, rest: float) -> float:
        """Move the bodies of an island that is alone to the start of the last flight of `rest` s; returns how far that is away, s.

        steady: (n, 3) m/s2. flight.mean has the mean forces on the way.
        """
        which = jointed.which
        last, plan = self._last(which), float(self._step[which].min())
        pieces = self._at_end, last if math.isinf(plan) else plan
        flown, self._step[which], _ = fly(jointed, self.flight, steady, rest - last, pieces)
        return flown

    def fly(self, jointed: JointedIsland, steady: np.ndarray, rest: float, other: float) -> float:
        """Fly an island over `rest` s at most, under steady accelerations (n, 3); returns for how long.

        0 where that cannot be done, or not for so long that it is worth it; other: s, length of a sub-step of the other method.
        """
        which, members, flight = jointed.which, jointed.members, self.flight
        plan = float(self._plan[which].min())
        if math.isinf(plan):
            fastest = float(np.sqrt((jointed.bodies.angular_velocity[members] ** 2).sum(1).max()))
            plan = FIRST_TURN / fastest if fastest > 0.0 else np.inf
        least = min(1.0 + WORK * len(members), MOST_WORK) * min(other, self._worth)
        most = min(plan, float(self._path[which].min()))
        h = rest / math.ceil(rest / most) if most < rest else rest
        error = 0.0
        while h >= min(least, rest):
            error, is_open, missed = fly(jointed, flight, steady, h, WHOLE)
            if not math.isfinite(error):
                break
            if missed > self._missed:
                # At another length its torque is another.
                h *= OTHERWISE
                self._path[which] = h
                continue
            way = max((error / self._at_end) ** (1.0 / 8.0), (is_open / self._on_the_way) ** 0.25)
            follows = length_that_follows(h, way)
            if way <= 1.0:
                self._path[which] *= LONGER
                # What ended early, at a limit or at the end of the step, says little about how long the next may be.
                self._plan[which] = max(follows, plan) if h < plan and not math.isinf(plan) else follows
                return h
            plan = follows
            h = rest / math.ceil(rest / plan)
        self.too_short = not math.isinf(error)
        self._plan[which], self._pause[which] = np.inf, PAUSE
        return 0.0
