"""Soft bodies in a run: they are stepped first, and rigid bodies then move under their forces.

At the start of each step of the run the soft bodies are stepped over it. This takes the poses of the rigid bodies at the start, and those
that they would have at the end without the soft bodies' force:

    a = a(t) - F(t) / m,    tau = tau(t) - T(t)    constant over the step

The impulses of the soft bodies act on the rigid ones as a force like others (`dynamics/soft_body/forces.py`): trajectories follow it
exactly, and impacts and contacts in the step include it. Bodies that no soft body touches keep their trajectories. Between the ends of
steps vertices are on straight lines, and sums of energy and momentum change evenly.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from rigidimpulse.core.quaternion import to_matrix
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.dynamics.soft_body.contact_planes import RigidMotion
from rigidimpulse.dynamics.soft_body.forces import SoftBodyForces
from rigidimpulse.dynamics.soft_body.soft_bodies import FlexibleStep
from rigidimpulse.dynamics.soft_body.track import FlexibleTrack
from rigidimpulse.engine.run import Run
from rigidimpulse.motion.trajectory import FIXED, FORCED, FREE, LINEAR, begin, make_trajectories, pose_at, state_at
from rigidimpulse.recording.ledger import Ledger

MOST_PIECES = 32
"""Parts into which a step of the run is cut at most where something fast comes near a soft body."""
MOST_HALVED = 8
"""Parts of the run's step to which a step is halved at most where soft bodies are jammed."""
SHORTEST = TOLERANCES.soft_body.shortest_step
STILL = TOLERANCES.soft_body.still
MADE = TOLERANCES.soft_body.energy_reported


class RunningSoftBodies:
    """The soft bodies of a run, between it and their table.

    Attributes:
        pressed: (n,) bool, bodies that feel a soft body in the present step.

    """

    moves = True

    def __init__(self, run: Run, table: SoftBodyForces, times: np.ndarray, clock: Callable[[], Any]) -> None:
        """times (f,) s of the frames; clock: of the line of the plan."""
        self._table, self._times, self._clock = table, times, clock
        self.pressed = np.zeros(run.world.num_bodies, bool)
        self._frames = np.empty((len(times), *table.soft_bodies.position.shape))
        self._frames[:] = table.soft_bodies.position
        self._scratch = make_trajectories(run.world.num_bodies)

    def advance(self, run: Run, end: float) -> float:
        """Step the soft bodies from the run's time to `end` [s], or less far where something fast is near; returns how far."""
        time, step = run.state.time, run.world.accuracy.step
        if end - time <= SHORTEST * step:
            return end
        with self._clock():
            motion = self._motion(run, time, end)
            limit = max(self._table.soft_bodies.step_limit(motion, end - time), (end - time) / MOST_PIECES)
            if limit < end - time:
                end = time + (end - time) / math.ceil((end - time) / limit)
                motion = self._motion(run, time, end)
            before, state = self._table.soft_bodies.position.copy(), self._table.state()
            done, pressed = self._table.step(time, end, motion, self._held(run, motion))
            while not done.converged and end - time > step / MOST_HALVED:
                # Jammed: in shorter steps surfaces turn less, and planes leave a place more often.
                self._table.go_back(state)
                end = time + 0.5 * (end - time)
                motion = self._motion(run, time, end)
                done, pressed = self._table.step(time, end, motion, self._held(run, motion))
            run.forces.let_act(self.pressed | pressed)  # those that are let go need a trajectory without
            self.pressed = pressed
            self._write(time, end, before)
        self._report(run, time, done)
        return end

    def keep(self, count: int) -> None:
        """Leave the first `count` frames only."""
        self._times, self._frames = self._times[:count], self._frames[:count]

    def carry_on(self, run: Run, earlier: Run) -> None:
        """Begin at the time of the run; bodies that an earlier run had, too, are where they are there."""
        before = earlier.soft_bodies
        self._table.begin_at(run.state.time, before._table.soft_bodies if isinstance(before, RunningSoftBodies) else None)
        self._frames[:] = self._table.soft_bodies.position

    def tracks(self) -> list[FlexibleTrack]:
        """Frames of each flexible body."""
        soft_bodies = self._table.soft_bodies
        parts = zip(soft_bodies.bodies, soft_bodies.first[:-1], soft_bodies.first[1:], strict=True)
        return [FlexibleTrack(body.name, self._frames[:, first:last].copy(), body.surface()[1]) for body, first, last in parts]

    def add_to(self, ledger: Ledger) -> None:
        """Give the ledger the soft bodies' kinetic energy (it has all their energy as potential) and momenta."""
        sums = self._table.sums_at(self._times)
        ledger.kinetic[:] += sums[:, 0]
        ledger.potential[:] -= sums[:, 0]
        ledger.momentum[:] += sums[:, 2:5]
        ledger.angular_momentum[:] += sums[:, 5:]

    def _held(self, run: Run, motion: RigidMotion) -> np.ndarray:
        """Bodies (n,) bool that stand still on something; all that is sub-stepped may do so."""
        world, state = run.world, run.state
        limit = STILL * world.accuracy.step * world.steady_strength
        radius = np.where(world.dynamic, world.bound_radius, 0.0)
        speed = np.linalg.norm(motion.velocity, axis=1) + radius * np.linalg.norm(motion.angular_velocity, axis=1)
        stands = state.under_contact | (state.trajectory.mode == FIXED) | (state.trajectory.mode == LINEAR)
        return world.dynamic & stands & (speed <= limit)

    def _motion(self, run: Run, time: float, end: float) -> RigidMotion:
        """All rigid bodies from `time` to `end`, without the soft bodies."""
        world, trajectory = run.world, run.state.trajectory
        n = world.num_bodies
        x, v, w, x1 = np.empty((4, n, 3))
        q, q1 = np.empty((2, n, 4))
        held = np.zeros((n, 6))
        held[self._table.body] = run.forces.present(self._table, time)
        for i in range(n):
            state_at(trajectory, i, time, x[i], q[i], v[i], w[i])
            path = trajectory
            # The soft bodies' own force is taken off: a = a(t) - F(t) / m.
            if held[i].any():
                path = self._scratch
                self._let_go(run, i, time, held[i], (x[i], q[i], v[i], w[i]))
            pose_at(path, i, end, x1[i], q1[i])
        rotation, rotation1 = (np.array([to_matrix(turn) for turn in orientation]).reshape(n, 3, 3) for orientation in (q, q1))
        inv_inertia = np.einsum("nij,nj,nkj->nik", rotation, world.dynamic[:, None] / trajectory.inertia, rotation)
        return RigidMotion(x, rotation, v, w, x1, rotation1, run.state.now.inv_mass, inv_inertia, world.dynamic)

    def _let_go(self, run: Run, i: int, time: float, wrench: np.ndarray, state: tuple[np.ndarray, ...]) -> None:
        """Write a trajectory without the soft bodies' wrench (6,) for body i, from its state (x, q, v, w) at `time`."""
        trajectory, free = run.state.trajectory, self._scratch
        free.start[i] = time
        free.position[i], free.orientation[i], free.velocity[i], free.angular_velocity[i] = state
        since = time - trajectory.start[i]
        free.acceleration[i] = trajectory.acceleration[i] + since * trajectory.jerk[i] - run.state.now.inv_mass[i] * wrench[:3]
        free.torque[i] = -wrench[3:]
        if trajectory.mode[i] == FORCED:
            free.torque[i] += trajectory.torque[i] + since * trajectory.torque_rate[i]
        free.jerk[i] = free.torque_rate[i] = 0.0
        free.inertia[i] = trajectory.inertia[i]
        free.mode[i] = FORCED if free.torque[i].any() else FREE
        begin(free, i)

    def _write(self, time: float, end: float, before: np.ndarray) -> None:
        """Frames in the step, and from its end on, until more is known, what is there."""
        first, last = np.searchsorted(self._times, (time, end), side="left")
        now = self._table.soft_bodies.position
        for f in range(first, last):
            self._frames[f] = before + (self._times[f] - time) / (end - time) * (now - before)
        self._frames[last : last + 2] = now

    def _report(self, run: Run, time: float, done: FlexibleStep) -> None:
        names = tuple(body.name for body in self._table.soft_bodies.bodies)
        report = run.log.report
        if not done.converged:
            report(time, "soft bodies jammed", names, "a step was solved without friction, or not to its tolerance; use a smaller step")
        if done.unresolved:
            report(time, "soft bodies inside bodies", names, "contacts were left over; use a smaller step, or start them clear of bodies")
        # Not only what is left: an inelastic landing takes all motion, and any round-off would be much of the rest.
        if done.energy_made > MADE * max(self._table.soft_bodies.energy(), done.energy_turned):
            report(time, "soft bodies made energy", names, f"{done.energy_made:.3g} J of nothing; use a smaller step or more damping")
