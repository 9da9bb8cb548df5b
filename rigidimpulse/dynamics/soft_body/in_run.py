"""Flexible bodies in a run: nets step first, rigid bodies then follow under what the nets gave them.

At the beginning of each step of the run the nets are stepped over it, from where the rigid bodies are and where they would be at its end
without the nets: under all that accelerates them now but for the nets' own force,

    a = a(t) - F(t) / m,    tau = tau(t) - T(t)    constant over the step

What the nets gave comes back as a wrench that is linear in time, F0 + F1 (t - t0), see `flexibles`, which ends with the step. It is a force
like others: courses follow it exactly, impacts and contacts on the way meet it. Bodies that no net touches keep their courses.

A body that stands still on something is held: to the nets it is immovable, and their force on it constant. Else they would give way to it
as to a free body and sink in. Where they press it much harder than before it is free all the same, unless they lose as much energy as a
free body would get: no energy comes of nothing.

Between the ends of steps vertices are on straight lines, and sums of energy and momentum change evenly.
"""

from __future__ import annotations

import math
from copy import copy

import numpy as np

from rigidimpulse.core.quaternion import to_matrix
from rigidimpulse.core.vector import cross_arrays
from rigidimpulse.dynamics.forces.force import ForceTable, Instant, no_links
from rigidimpulse.dynamics.soft_body.contact_planes import RigidMotion
from rigidimpulse.dynamics.soft_body.soft_bodies import Flexibles, FlexibleStep
from rigidimpulse.dynamics.soft_body.track import FlexibleTrack
from rigidimpulse.motion.trajectory import FIXED, FORCED, FREE, begin, make_trajectories, pose_at, state_at

KIND = "flexible bodies"
SCHEME = "midpoint"
"""Nets that touch nothing fly on the parabolas of rigid bodies, and no energy leaves them but by their dampers."""
MOST_PIECES = 32
"""Parts into which a step of the run is cut at most where something fast comes near a net."""
SHORTEST = 1e-9
"""Part of the run's step below which nets are not stepped: what rounding leaves at the end of a run."""
STILL = 1e-3
"""Speed below which what a net presses stands still, relative to what gravity gives in a step."""
HARDER = 2.0
"""Times its last force that a net may press a body that is held, whatever the energy."""
MADE = 1e-6
"""Energy made of nothing, relative to that of the nets, that is reported."""


class SoftBodyForces(ForceTable):
    """The wrenches of nets on all dynamic bodies, in the present step of the run.

    Attributes:
        nets: the flexible bodies of the scene, at the end of the step.
        sums: by step, its end [s], kinetic, elastic plus gravity energy [J], momentum (3) [kg m/s], angular momentum (3) [kg m^2/s].

    """

    def __init__(self, world) -> None:
        self.soft_bodies = Flexibles(world, SCHEME)
        self.kind, self.names = KIND, [KIND]
        self.body = np.flatnonzero(world.dynamic)
        self.cause = np.zeros(len(self.body), np.int64)
        self.links = no_links()
        self.is_steady, self.comes_and_goes = False, True
        count = f"{len(self.soft_bodies.bodies)} with {len(self.soft_bodies.position)} vertices"
        self.reason = f"{count}, stepped implicitly with what they touch"
        self._start = self._end = 0.0
        self._value, self._rate = np.zeros((2, len(self.body), 6))
        self.sums = [self._sums()]

    def wrench(self, at: Instant, rows: np.ndarray) -> np.ndarray:
        """Force and torque (r, 6) of rows."""
        return self._value[rows] + self._rate[rows] * (at.time[self.body[rows]] - self._start)[:, None]

    def next_break(self, time: float) -> float:
        """The end of the step."""
        return self._end if time < self._end else np.inf

    def potential(self, times: np.ndarray, position: np.ndarray, orientation: np.ndarray) -> np.ndarray:
        """All energy of the nets, (f, 1) J: their motion, springs and weight."""
        del position, orientation
        return self.sums_at(times)[:, :2].sum(axis=1, keepdims=True)

    def sums_at(self, times: np.ndarray) -> np.ndarray:
        """Kinetic and stored energy, momentum and angular momentum, (f, 8), at f instants."""
        sums = np.array(self.sums)
        return np.column_stack([np.interp(times, sums[:, 0], column) for column in sums[:, 1:].T])

    def step(self, time: float, end: float, motion: RigidMotion, held: np.ndarray) -> tuple[FlexibleStep, np.ndarray]:
        """Step the nets, with bodies that are held, (n,) bool; returns how it went and (n,) bool, the bodies that feel it."""
        h, before = end - time, copy(self.soft_bodies)
        done = self.soft_bodies.step(time, h, _fixed(motion, held) if held.any() else motion)
        moved = held & self._might_move(done.impulse, h, motion)
        if moved.any():
            self.soft_bodies, held = before, held & ~moved
            done = self.soft_bodies.step(time, h, _fixed(motion, held))
        self._value, self._rate = done.ramp[:, self.body]
        steady = held[self.body]
        self._value[steady], self._rate[steady] = done.impulse[self.body[steady]] / h, 0.0
        self._start, self._end = time, end
        self.sums.append(self._sums())
        return done, motion.movable & np.any(done.ramp, axis=(0, 2))

    def _might_move(self, impulse: np.ndarray, h: float, motion: RigidMotion) -> np.ndarray:
        """Bodies (n,) bool that would get more energy from impulses (n, 6) than the nets lost, if nothing held them.

        Not those that nets press no harder than before.
        """
        mean = np.zeros_like(impulse)
        mean[self.body] = self._value + 0.5 * (self._end - self._start) * self._rate
        size = np.linalg.norm(impulse.reshape(-1, 2, 3), axis=2)
        harder = np.any(size > HARDER * h * np.linalg.norm(mean.reshape(-1, 2, 3), axis=2), axis=1)
        gain = 0.5 * (motion.inv_mass * size[:, 0] ** 2 + np.einsum("ni,nij,nj->n", impulse[:, 3:], motion.inv_inertia, impulse[:, 3:]))
        return harder & (gain > self.sums[-1][1:3].sum() - self._sums()[1:3].sum())

    def _sums(self) -> np.ndarray:
        soft_bodies = self.soft_bodies
        momentum = soft_bodies.soft_body.mass[:, None] * soft_bodies.velocity
        kinetic = 0.5 * float(np.sum(momentum * soft_bodies.velocity))
        stored = soft_bodies.soft_body.energy(soft_bodies.position) - float(np.sum(soft_bodies.weight * soft_bodies.position))
        return np.array([self._end, kinetic, stored, *momentum.sum(axis=0), *cross_arrays(soft_bodies.position, momentum).sum(axis=0)])


class RunningSoftBodies:
    """The nets of a run, between it and their table.

    Attributes:
        pressed: (n,) bool, bodies that feel a net in the present step.

    """

    def __init__(self, context, table: SoftBodyForces, times: np.ndarray, clock) -> None:
        """times (f,) s of the frames; clock: of the line of the plan."""
        self._table, self._times, self._clock = table, times, clock
        self.pressed = np.zeros(context.world.num_bodies, bool)
        self._frames = np.empty((len(times), *table.soft_bodies.position.shape))
        self._frames[:] = table.soft_bodies.position
        self._scratch = make_trajectories(context.world.num_bodies)

    def advance(self, context, end: float) -> float:
        """Step the nets from the run's time to `end` [s], or less far where something fast is near; returns how far."""
        time, step = context.state.time, context.world.accuracy.step
        if end - time <= SHORTEST * step:
            return end
        with self._clock():
            motion = self._motion(context, time, end)
            limit = max(self._table.soft_bodies.step_limit(motion, end - time), (end - time) / MOST_PIECES)
            if limit < end - time:
                end = time + (end - time) / math.ceil((end - time) / limit)
                motion = self._motion(context, time, end)
            before = self._table.soft_bodies.position.copy()
            done, pressed = self._table.step(time, end, motion, self._held(context, motion))
            context.forces.let_act(self.pressed | pressed)  # those that are let go need a course without
            self.pressed = pressed
            self._write(time, end, before)
        self._report(context, time, done)
        return end

    def tracks(self) -> list[FlexibleTrack]:
        """Frames of each flexible body."""
        soft_bodies = self._table.soft_bodies
        parts = zip(soft_bodies.bodies, soft_bodies.first[:-1], soft_bodies.first[1:], strict=True)
        return [FlexibleTrack(body.name, self._frames[:, first:last].copy(), body.surface()[1]) for body, first, last in parts]

    def add_to(self, ledger) -> None:
        """Give the ledger the nets' kinetic energy (it has all their energy as potential) and momenta."""
        sums = self._table.sums_at(self._times)
        ledger.kinetic[:] += sums[:, 0]
        ledger.potential[:] -= sums[:, 0]
        ledger.momentum[:] += sums[:, 2:5]
        ledger.angular_momentum[:] += sums[:, 5:]

    def _held(self, context, motion: RigidMotion) -> np.ndarray:
        """Bodies (n,) bool that stand still on something."""
        world, state = context.world, context.state
        limit = STILL * world.accuracy.step * world.steady_strength
        radius = np.where(world.dynamic, world.bound_radius, 0.0)
        speed = np.linalg.norm(motion.velocity, axis=1) + radius * np.linalg.norm(motion.angular_velocity, axis=1)
        return world.dynamic & (state.under_contact | (state.trajectory.mode == FIXED)) & (speed <= limit)

    def _motion(self, context, time: float, end: float) -> RigidMotion:
        """All rigid bodies from `time` to `end`, without the nets."""
        world, trajectory = context.world, context.state.trajectory
        n = world.num_bodies
        x, v, w, x1 = np.empty((4, n, 3))
        q, q1 = np.empty((2, n, 4))
        held = np.zeros((n, 6))
        held[self._table.body] = context.forces.present(self._table, time)
        for i in range(n):
            state_at(trajectory, i, time, x[i], q[i], v[i], w[i])
            path = trajectory
            if held[i].any():
                path = self._scratch
                self._let_go(context, i, time, held[i], (x[i], q[i], v[i], w[i]))
            pose_at(path, i, end, x1[i], q1[i])
        rotation, rotation1 = (np.array([to_matrix(turn) for turn in orientation]) for orientation in (q, q1))
        inv_inertia = np.einsum("nij,nj,nkj->nik", rotation, world.dynamic[:, None] / trajectory.inertia, rotation)
        return RigidMotion(x, rotation, v, w, x1, rotation1, context.state.now.inv_mass, inv_inertia, world.dynamic)

    def _let_go(self, context, i: int, time: float, wrench: np.ndarray, state) -> None:
        """Write a course without the nets' wrench (6,) for body i, from its state (x, q, v, w) at `time`."""
        trajectory, free = context.state.trajectory, self._scratch
        free.start[i] = time
        free.position[i], free.orientation[i], free.velocity[i], free.angular_velocity[i] = state
        since = time - trajectory.start[i]
        free.acceleration[i] = trajectory.acceleration[i] + since * trajectory.jerk[i] - context.state.now.inv_mass[i] * wrench[:3]
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

    def _report(self, context, time: float, done: FlexibleStep) -> None:
        names = tuple(body.name for body in self._table.soft_bodies.bodies)
        report = context.log.report
        if not done.converged:
            report(time, "nets jammed", names, "a step was solved without friction, or not to its tolerance; use a smaller step")
        if done.unresolved:
            report(time, "nets inside bodies", names, "contacts were left over; use a smaller step, or start nets clear of bodies")
        if done.energy_made > MADE * max(self._table.soft_bodies.energy(), 0.0):
            report(time, "nets made energy", names, f"{done.energy_made:.3g} J of nothing; use a smaller step or more damping")


def _fixed(motion: RigidMotion, held: np.ndarray) -> RigidMotion:
    """The motion with the held bodies, (n,) bool, where they are, immovable."""
    return motion._replace(
        end_position=np.where(held[:, None], motion.position, motion.end_position),
        end_rotation=np.where(held[:, None, None], motion.rotation, motion.end_rotation),
        velocity=np.where(held[:, None], 0.0, motion.velocity),
        angular_velocity=np.where(held[:, None], 0.0, motion.angular_velocity),
        inv_mass=np.where(held, 0.0, motion.inv_mass),
        inv_inertia=np.where(held[:, None, None], 0.0, motion.inv_inertia),
        movable=motion.movable & ~held,
    )
