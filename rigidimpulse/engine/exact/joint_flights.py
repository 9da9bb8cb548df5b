"""Flights of jointed islands that touch nothing: how long they may be (see `dynamics/constraints/joint_flight.py`).

The error of a flight at its end is of order 8, that of the paths on the way of order 4. Each has its bound, and the one that is nearer to
its bound says how long the next flight is.

Where nothing can come near an island, nobody asks for the paths on the way. Then all that is left of the time, but the last flight, is
flown past in steps of the method, inside one kernel.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from rigidimpulse.dynamics.constraints.joint_flight import (
    BEGIN,
    END,
    MOST_TRIALS,
    MOVE,
    PATHS,
    STAGE_TIMES,
    STAGES,
    Stages,
    fly,
    length_that_follows,
    make_flight,
    make_stages,
    next_length,
    take_stage,
)
from rigidimpulse.dynamics.constraints.jointed_island import JointedIsland, count_joint_rows
from rigidimpulse.dynamics.constraints.rows import make_rows
from rigidimpulse.model.joint_table import Joints
from rigidimpulse.model.world import World

if TYPE_CHECKING:
    from rigidimpulse.engine.flight_forces import FlightForces

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
SPRUNG = 1.0 / 16.0
"""The same where a soft row is overdamped, or at the only joint: the other method has the closed form of each, however stiff it is."""
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
        self._size = world.joint_size
        self._on_the_way = ON_THE_WAY * world.accuracy.tolerance**0.5 * self._size
        joint_of_row = np.repeat(np.arange(len(table.body_a)), np.diff(table.first))
        self._soft = np.flatnonzero(np.isfinite(table.stiffness))
        self._joint_of_soft, self._step_of_run = joint_of_row[self._soft], world.accuracy.step
        self.too_short = False
        holds = np.isinf(table.stiffness) & np.isinf(table.lower) & np.isinf(table.upper)
        is_limit = (table.lower == 0.0) != (table.upper == 0.0)
        can_fly = holds | is_limit | np.isfinite(table.stiffness)
        self._can_fly = np.bincount(joint_of_row[~can_fly], minlength=len(table.body_a)) == 0
        self._pause = np.zeros(len(table.body_a), np.int64)
        self._plan, self._step, self._path = np.full((3, len(table.body_a)), np.inf)

    def may_fly(self, which: np.ndarray) -> bool:
        """Whether to try a flight of an island with these joints: no hard motor is in it, and none was given up just before."""
        self._pause[which] -= 1
        return bool(self._can_fly[which].all()) and int(self._pause[which].max()) < 0

    def is_longer(self, which: np.ndarray, rest: float) -> bool:
        """Whether `rest` s takes the island of these joints several flights."""
        return rest > 2.0 * self._last(which)

    def _last(self, which: np.ndarray) -> float:
        """Length of a last flight, whose path is laid, s: what its errors allow, and no more than what paths missed lately."""
        return min(float(self._plan[which].min()), float(self._path[which].min()))

    def _worth(self, jointed: JointedIsland) -> float:
        """Length of a flight that is always worth it, s."""
        table, soft = jointed.joints, self._soft[np.isin(self._joint_of_soft, jointed.which)]
        # c^2 W > 4 k, or c^2 > 4 k where both are those of a unit of mass.
        square = table.damping[soft] ** 2 * np.where(table.per_mass[soft], 1.0, jointed.memory.weight[soft])
        sprung = len(soft) > 0 and (len(jointed.which) == 1 or bool(np.any(square > 4.0 * table.stiffness[soft])))
        return (SPRUNG if sprung else WORTH) * self._step_of_run

    def fly_past(self, jointed: JointedIsland, steady: np.ndarray, forces: FlightForces | None, rest: float) -> float:
        """Move the bodies of an island that is alone to the start of the last flight of `rest` s; returns how far that is away, s.

        steady: (n, 3) m/s2. flight.mean has the mean forces on the way.
        """
        which = jointed.which
        last, plan = self._last(which), float(self._step[which].min())
        plan = last if math.isinf(plan) else plan
        if forces is None:
            flown, self._step[which], _ = fly(jointed, self.flight, steady, rest - last, (self._at_end, plan))
        else:
            flown, self._step[which] = self._fly_past_with(forces, jointed, steady, rest - last, plan)
        return flown

    def _fly_past_with(
        self, forces: FlightForces, jointed: JointedIsland, steady: np.ndarray, span: float, plan: float
    ) -> tuple[float, float]:
        """`fly_past` of the kernel under forces that vary: they are asked for at each stage."""
        which, angle = jointed.which, jointed.memory.angle
        flown, trials, total = 0.0, 0, np.zeros_like(self.flight.mean)
        while flown < span and trials < MOST_TRIALS:
            pieces = math.ceil((span - flown) / plan)
            h, before = (span - flown) / pieces, angle.copy()
            stages = self._stages(jointed)
            error = self._take_stages(stages, jointed, steady, forces, h)
            if not math.isfinite(error) or forces.share_until_break() < 1.0:
                angle[:] = before
                break
            done, plan = next_length(h, plan, error / self._at_end)
            if not done:
                angle[:] = before
                trials += 1
                continue
            trials = 0
            take_stage(jointed, self.flight, stages, steady, h, MOVE)
            total[which] += h * self.flight.mean[which]
            flown = span if pieces == 1 else flown + h
            forces.move_on(h)
        if flown > 0.0:
            self.flight.mean[which] = total[which] / flown
        return flown, plan

    def _stages(self, jointed: JointedIsland) -> Stages:
        """Working memory of a step of an island."""
        rows = make_rows.py_func(int(count_joint_rows.py_func(jointed.joints, jointed.which)))
        return make_stages.py_func(len(jointed.members), rows)

    def _take_stages(self, stages: Stages, jointed: JointedIsland, steady: np.ndarray, forces: FlightForces, h: float) -> float:
        """Take the stages of a step of h s under forces that vary; returns its error, see `fly_jointed`."""
        members, flight = jointed.members, self.flight
        forces.begin(h)
        error, _, _ = take_stage(jointed, flight, stages, steady, h, BEGIN)
        for stage in range(STAGES):
            if error != 0.0:
                return error
            flight.load[members] = forces.at(float(STAGE_TIMES[stage]), flight.bodies, flight.rotation)[members]
            error, _, _ = take_stage(jointed, flight, stages, steady, h, stage)
            flight.load[members] = 0.0
        return error if error != 0.0 else take_stage(jointed, flight, stages, steady, h, END)[0]

    def _take(self, jointed: JointedIsland, steady: np.ndarray, forces: FlightForces | None, h: float) -> tuple[float, float, float]:
        """Fly an island for h s; returns what `fly_jointed` does. Forces that vary are asked for at each stage."""
        if forces is None:
            return fly(jointed, self.flight, steady, h, WHOLE)
        stages, angle, is_open, missed = self._stages(jointed), jointed.memory.angle.copy(), 0.0, 0.0
        error = self._take_stages(stages, jointed, steady, forces, h)
        if math.isfinite(error):
            _, is_open, missed = take_stage(jointed, self.flight, stages, steady, h, PATHS)
            is_open = max(is_open, self._size * forces.off())
        jointed.memory.angle[:] = angle
        return error, is_open, missed

    def fly(self, jointed: JointedIsland, steady: np.ndarray, forces: FlightForces | None, lengths: tuple[float, float]) -> float:
        """Fly an island under steady accelerations (n, 3) and forces that vary, if there are any; returns for how long.

        0 where that cannot be done, or not for so long that it is worth it. lengths: s, at most, and of a sub-step of the other method.
        """
        which, members, (rest, other) = jointed.which, jointed.members, lengths
        plan = float(self._plan[which].min())
        if math.isinf(plan):
            fastest = float(np.sqrt((jointed.bodies.angular_velocity[members] ** 2).sum(1).max()))
            plan = FIRST_TURN / fastest if fastest > 0.0 else np.inf
        least = min(1.0 + WORK * len(members), MOST_WORK) * min(other, self._worth(jointed))
        most = min(plan, float(self._path[which].min()))
        h = rest / math.ceil(rest / most) if most < rest else rest
        error = 0.0
        while h >= min(least, rest):
            error, is_open, missed = self._take(jointed, steady, forces, h)
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
