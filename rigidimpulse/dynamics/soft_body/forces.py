"""Soft bodies as a force on rigid ones: the wrench of a step, linear in time, F0 + F1 (t - t0).

A body that stands still on something is held: to the soft bodies it is immovable, and their force on it constant. Otherwise it would
give way to them as a free body does, and sink in. Where they press it much harder than before it is free all the same, unless they lose
as much energy as a free body would get: no energy comes from nothing.
"""

from __future__ import annotations

from copy import copy
from typing import NamedTuple

import numpy as np

from rigidimpulse.core.vector import cross_arrays
from rigidimpulse.dynamics.forces.force import ForceTable, Instant, no_links
from rigidimpulse.dynamics.soft_body.contact_planes import RigidMotion
from rigidimpulse.dynamics.soft_body.soft_bodies import Flexibles, FlexibleStep
from rigidimpulse.model.world import World

KIND = "flexible bodies"
SCHEME = "midpoint"
"""Soft bodies that touch nothing fly on the parabolas of rigid bodies, and lose energy by their dampers only."""
HARDER = 2.0
"""Times its last force that a soft body may press a body that is held, whatever the energy."""


class SoftBodyState(NamedTuple):
    """What a step changes, so that it can be taken back."""

    soft_bodies: Flexibles
    value: np.ndarray  # (k, 6) N, N m
    rate: np.ndarray  # (k, 6) a second
    span: tuple[float, float]  # s, of the last step
    num_sums: int


class SoftBodyForces(ForceTable):
    """The wrenches of soft bodies on all dynamic bodies, in the present step of the run.

    Attributes:
        soft_bodies: the flexible bodies of the scene, at the end of the step.
        sums: by step, its end [s], kinetic, elastic plus gravity energy [J], momentum (3) [kg m/s], angular momentum (3) [kg m^2/s].

    """

    def __init__(self, world: World) -> None:
        """At the start of a run."""
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

    def begin_at(self, time: float, earlier: Flexibles | None) -> None:
        """Begin at `time` [s]; bodies that are the same in an earlier run are where they are there, and move as there."""
        if earlier is not None:
            self.soft_bodies.carry_on(earlier)
        self._start = self._end = time
        self.sums = [self._sums()]

    def wrench(self, at: Instant, rows: np.ndarray) -> np.ndarray:
        """Force and torque (r, 6) of rows."""
        return self._value[rows] + self._rate[rows] * (at.time[self.body[rows]] - self._start)[:, None]

    def next_break(self, time: float) -> float:
        """The end of the step."""
        return self._end if time < self._end else np.inf

    def potential(self, times: np.ndarray, position: np.ndarray, orientation: np.ndarray) -> np.ndarray:
        """All energy of the soft bodies, (f, 1) J: their motion, springs and weight."""
        del position, orientation
        return self.sums_at(times)[:, :2].sum(axis=1, keepdims=True)

    def sums_at(self, times: np.ndarray) -> np.ndarray:
        """Kinetic and stored energy, momentum and angular momentum, (f, 8), at f instants."""
        sums = np.array(self.sums)
        return np.column_stack([np.interp(times, sums[:, 0], column) for column in sums[:, 1:].T])

    def step(self, time: float, end: float, motion: RigidMotion, held: np.ndarray) -> tuple[FlexibleStep, np.ndarray]:
        """Step the soft bodies, with bodies that are held, (n,) bool; returns how it went and (n,) bool, the bodies that feel it."""
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

    def state(self) -> SoftBodyState:
        """What a step changes."""
        return SoftBodyState(copy(self.soft_bodies), self._value, self._rate, (self._start, self._end), len(self.sums))

    def go_back(self, state: SoftBodyState) -> None:
        """Take back the steps since then."""
        self.soft_bodies, (self._start, self._end) = copy(state.soft_bodies), state.span
        self._value, self._rate = state.value, state.rate
        del self.sums[state.num_sums :]

    def _might_move(self, impulse: np.ndarray, h: float, motion: RigidMotion) -> np.ndarray:
        """Bodies (n,) bool that would get more energy from impulses (n, 6) than the soft bodies lost, if nothing held them.

        Not those that soft bodies press no harder than before.
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
