"""Paths of kinematic bodies with keyframes: constant velocity and spin between keys, held after the last; and bodies that are let go.

A body with a `release_time` T is compiled as a dynamic one, with its mass, and made immovable when the run begins. At T, between two
steps, it gets its mass back and goes on freely with the pose, velocity and spin of its path just before T. In the ledger it counts from
then on.
"""

from __future__ import annotations

import numpy as np

from rigidimpulse.core.quaternion import conjugate, multiply, rotate, rotation_vector
from rigidimpulse.dynamics.energy import mechanical_energy
from rigidimpulse.engine.run import Run
from rigidimpulse.model.world import World
from rigidimpulse.motion.trajectory import FREE, PRESCRIBED, begin, state_at
from rigidimpulse.scene.keyframes import Keyframes


class KeyframePaths:
    """Key times and segments of all bodies with keyframes, in the principal frame.

    From key k to k + 1 the centre moves by v = (x1 - x0) / h and the body turns by w = log(q1 q0*) / h; it starts exactly at each key.
    """

    def __init__(self, world: World) -> None:
        """Segments of a compiled scene; bodies that are let go later are immovable from here on."""
        self.segments: list[tuple[float, int, tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray] | None]] = []
        for i, body in enumerate(world.scene.bodies):
            release = np.inf if body.release_time is None else float(body.release_time)
            if body.keyframes is not None:
                self._add(world, i, body.keyframes, release)
            if body.release_time is not None:
                self.segments.append((release, i, None))
                world.dynamic[i], world.moving[i], world.inv_mass[i] = False, True, 0.0
        self.segments.sort(key=lambda segment: segment[:2])
        self.times = np.array([segment[0] for segment in self.segments])
        self._next = 0

    def _add(self, world: World, i: int, keys: Keyframes, release: float) -> None:
        times, positions, turned = keys.arrays(world.scene.bodies[i].orientation)
        centre = positions + rotate(turned, world.offset[i])
        principal = multiply(turned, world.turn[i])
        for k in np.flatnonzero(times < release).tolist():
            v = w = np.zeros(3)
            if k + 1 < len(times):
                h = times[k + 1] - times[k]
                v = (centre[k + 1] - centre[k]) / h
                w = rotation_vector(multiply(principal[k + 1], conjugate(principal[k]))) / h
            self.segments.append((float(times[k]), i, (centre[k], principal[k], v, w)))

    def next_key(self, time: float) -> float:
        """The first key time after `time`, inf if there is none."""
        later = self.times[self.times > time]
        return float(later[0]) if len(later) else np.inf

    def start_segments(self, run: Run, time: float) -> None:
        """Put bodies whose key is at or before `time` on their new trajectory, and let go those whose time it is."""
        trajectory = run.state.trajectory
        while self._next < len(self.segments) and self.segments[self._next][0] <= time:
            start, i, pose = self.segments[self._next]
            self._next += 1
            run.recorder.flush(trajectory, i, start, np.zeros(6))
            if pose is None:
                _let_go(run, i, start)
            else:
                x, q, v, w = pose
                trajectory.start[i], trajectory.mode[i] = start, PRESCRIBED
                trajectory.position[i], trajectory.orientation[i] = x, q
                trajectory.velocity[i], trajectory.angular_velocity[i] = v, w
                begin(trajectory, i)


def _let_go(run: Run, i: int, time: float) -> None:
    """Body i is dynamic from `time` on."""
    world, trajectory, now = run.world, run.state.trajectory, run.state.now
    state_at(trajectory, i, time, now.position[i], now.orientation[i], now.velocity[i], now.angular_velocity[i])
    world.dynamic[i], world.moving[i], world.inv_mass[i] = True, False, 1.0 / world.mass[i]
    trajectory.position[i], trajectory.orientation[i] = now.position[i], now.orientation[i]
    trajectory.velocity[i], trajectory.angular_velocity[i] = now.velocity[i], now.angular_velocity[i]
    trajectory.acceleration[i], trajectory.start[i], trajectory.mode[i] = world.steady_acceleration[i], time, FREE
    begin(trajectory, i)
    run.log.account(time, "let go", mechanical_energy(now, world.constants, np.array([i])))
