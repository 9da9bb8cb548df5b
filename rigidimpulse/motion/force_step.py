"""A step under forces that depend on time, pose and velocity.

Stages of Nystroem's method of order 4 (E. J. Nystroem 1925; Hairer, Norsett, Wanner, Solving ODEs I, II.14) over a step of length h:

    F_1 at (0, x, v),  F_2 and F_3 at h/2,  F_4 at h
    stage 2  flies h/2 under F_1,  stage 3 has the pose of stage 2 and the velocities of h/2 under F_2,  stage 4 flies h under F_3

"flies" is the exact motion of a rigid body under a constant force and torque, so that gravity and the gyroscopic term cost nothing and a
body without forces keeps its exact path. The forces of the step enter the trajectory by their two moments (see `trajectory`),

    M0 = h (F_1 + 2 F_2 + 2 F_3 + F_4) / 6,    M1 = h^2 (F_1 + F_2 + F_3) / 6,

which are those of the line  L(s) = (2 F_1 + F_2 + F_3 - F_4) / 3 + (F_4 - F_1) s / h.  The sweep follows the path of that line exactly.
Inside the step it leaves the true path by

    error = |d| h^2 / (12 m),    d = F_4 - L(h) = (F_1 - F_2 - F_3 + F_4) / 3,

of order 4 and larger than the error at the end, which is of order 5. This error chooses h.

In steps of one length the semi-implicit rule of Euler, v' = v + F h / m, x' = x + v' h, has the moments  M0 = h F, M1 = h^2 F  and so
the line

    L(s) = 4 F - 6 F s / h.

Mass that flows: m(t) enters by  F m(0) / m(t)  in the place of F, the mass in all else is that at the start of the step.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from rigidimpulse.core.kernels import jit_making_arrays
from rigidimpulse.motion.body_state import BodyState
from rigidimpulse.motion.evaluate import bring, bring_all
from rigidimpulse.motion.trajectory import FORCED, FREE, Load, Trajectories, make_trajectories, take

Stage = tuple[np.ndarray, np.ndarray]


class Moment(NamedTuple):
    """Bodies at one instant, and their accelerations then."""

    bodies: BodyState
    rotation: np.ndarray  # (n, 3, 3)
    acceleration: np.ndarray  # (n, 3) m/s^2
    angular_acceleration: np.ndarray  # (n, 3) rad/s^2


@jit_making_arrays
def fly(trajectory, members, elapsed, bodies, steady, wrench, out):
    """Where the members (k,) are after elapsed (n,) s under constant wrenches (n, 6) and steady accelerations (n, 3); from `bodies`.

    out: a `Moment`, written.
    """
    zero, pull = np.zeros(3), np.empty(3)
    for i in members:
        for k in range(3):
            pull[k] = steady[i, k] + bodies.inv_mass[i] * wrench[i, k]
        turned = wrench[i, 3] != 0.0 or wrench[i, 4] != 0.0 or wrench[i, 5] != 0.0
        take(trajectory, i, -elapsed[i], bodies, Load(pull, wrench[i, 3:], zero, zero), FORCED if turned else FREE)
        bring(trajectory, i, 0.0, out.bodies, out.rotation, out.acceleration, out.angular_acceleration)


@jit_making_arrays
def follow(trajectory, members, bodies, steady, value, rate):
    """Let the members (k,) go from `bodies`, at time 0, along lines of force (n, 6) that change by rate (n, 6) a second."""
    pull, jerk = np.empty(3), np.empty(3)
    for i in members:
        for k in range(3):
            pull[k] = steady[i, k] + bodies.inv_mass[i] * value[i, k]
            jerk[k] = bodies.inv_mass[i] * rate[i, k]
        turned = False
        for k in range(3, 6):
            turned = turned or value[i, k] != 0.0 or rate[i, k] != 0.0
        take(trajectory, i, 0.0, bodies, Load(pull, value[i, 3:], jerk, rate[i, 3:]), FORCED if turned else FREE)


class Workspace:
    """Arrays for the states of a step's stages."""

    def __init__(self, trajectory: Trajectories, inv_mass: np.ndarray) -> None:
        """For as many bodies as there are trajectories."""
        n = len(inv_mass)
        self.trajectory = make_trajectories(n)._replace(inertia=trajectory.inertia)
        self.bodies = BodyState(
            np.empty((n, 3)), np.empty((n, 4)), np.empty((n, 3)), np.empty((n, 3)), inv_mass, np.zeros((n, 3, 3))
        )
        self.rotation = np.empty((n, 3, 3))
        self._moment = Moment(self.bodies, self.rotation, np.empty((n, 3)), np.empty((n, 3)))

    def fly(self, members: np.ndarray, elapsed: np.ndarray, bodies: BodyState, steady: np.ndarray, wrench: np.ndarray) -> None:
        """Bring the members to where they are after elapsed (n,) s (see `fly`)."""
        fly(self.trajectory, members, elapsed, bodies, steady, wrench, self._moment)

    def stay(self, members: np.ndarray, bodies: BodyState, rotation: np.ndarray) -> None:
        """Leave the members where they are."""
        self.rotation[members] = rotation[members]
        for mine, theirs in zip(self.bodies, bodies, strict=True):
            if mine is not theirs:
                mine[members] = theirs[members]

    def follow(self, members: np.ndarray, bodies: BodyState, steady: np.ndarray, value: np.ndarray, rate: np.ndarray) -> None:
        """Let the members go along lines of force (see `follow`), for `look`."""
        follow(self.trajectory, members, bodies, steady, value, rate)

    def look(self, members: np.ndarray, elapsed: float) -> None:
        """Bring the members to where the lines lead them after a time."""
        bring_all(self.trajectory, members, elapsed, *self._moment)

    def fly_speeds(self, members: np.ndarray, elapsed: np.ndarray, bodies: BodyState, steady: np.ndarray, wrench: np.ndarray) -> None:
        """The same for the velocities alone."""
        kept = [values[members] for values in (self.bodies.position, self.bodies.orientation, self.bodies.inv_inertia, self.rotation)]
        self.fly(members, elapsed, bodies, steady, wrench)
        self.bodies.position[members], self.bodies.orientation[members] = kept[:2]
        self.bodies.inv_inertia[members], self.rotation[members] = kept[2:]


class Lines(NamedTuple):
    """Lines of forces over a step: value at its start, change until its end, and d."""

    value: np.ndarray
    change: np.ndarray
    off: np.ndarray


def nystroem(
    evaluate: Callable, workspace: Workspace, first: Stage, members: np.ndarray, h: np.ndarray, bodies: BodyState, steady: np.ndarray
) -> tuple[Lines, Lines]:
    """Lines of the forces over a step, of each row (k, 6) and of their sums (n, 6) on bodies.

    evaluate(share, bodies, rotation) -> the same as `first`, after that share of the step; first: forces of rows and their sums at the
    start; members: bodies that fly; h (n,) s; steady (n, 3) m/s^2.
    """
    half = 0.5 * h
    workspace.fly(members, half, bodies, steady, first[1])
    second = evaluate(0.5, workspace.bodies, workspace.rotation)
    # Stage 3 has the pose of stage 2: only velocities are flown again.
    workspace.fly_speeds(members, half, bodies, steady, second[1])
    third = evaluate(0.5, workspace.bodies, workspace.rotation)
    workspace.fly(members, h, bodies, steady, third[1])
    fourth = evaluate(1.0, workspace.bodies, workspace.rotation)
    rows, sums = (
        Lines((2.0 * f1 + f2 + f3 - f4) / 3.0, f4 - f1, (f1 - f2 - f3 + f4) / 3.0)
        for f1, f2, f3, f4 in zip(first, second, third, fourth, strict=True)
    )
    return rows, sums


def semi_implicit(first: Stage) -> tuple[Lines, Lines]:
    """The same of Euler's semi-implicit rule."""
    rows, sums = (Lines(4.0 * f, -6.0 * f, np.zeros_like(f)) for f in first)
    return rows, sums
