"""Paths of kinematic bodies with keyframes: constant velocity and spin between keys, held after the last; and bodies that are let go.

The velocity is that of the body's origin. Where that is not the centre of mass and the body turns, the centre goes along an arc. It is
followed along chords, each of which turns by PIECE at most: they leave the arc by PIECE^2 / 8 of its radius.

A body with a `release_time` T is compiled as a dynamic one, with its mass, and made immovable when the run begins. At T, between two
steps, it gets its mass back and goes on freely with the pose, velocity and spin of its path just before T. In the ledger it counts from
then on.
"""

from __future__ import annotations

import numpy as np

from rigidimpulse.core.portable import length
from rigidimpulse.core.quaternion import conjugate, multiply, quaternion_from_rotation_vector, rotate, rotation_vector
from rigidimpulse.dynamics.energy import mechanical_energy
from rigidimpulse.engine.run import Run
from rigidimpulse.model.world import World
from rigidimpulse.motion.trajectory import FREE, PRESCRIBED, begin, state_at
from rigidimpulse.scene.keyframes import Keyframes

PIECE = 0.02
"""rad."""
CENTRED: float = 1e-9
"""Part of the bounding radius up to which a centre of mass is at the origin: that of a mesh is there up to round-off."""


class KeyframePaths:
    """Key times and segments of all bodies with keyframes, in the principal frame.

    From key k to k + 1 the origin moves by v = (x1 - x0) / h and the body turns by w = log(q1 q0*) / h; it starts exactly at each key.
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
        if length(world.offset[i]) > CENTRED * world.bound_radius[i]:
            times, positions, turned = _in_pieces(times, positions, turned)
        centre = positions + rotate(turned, world.offset[i])
        principal = multiply(turned, world.turn[i])
        for k in np.flatnonzero(times < release).tolist():
            v = w = np.zeros(3)
            if k + 1 < len(times):
                h = times[k + 1] - times[k]
                v = (centre[k + 1] - centre[k]) / h
                w = rotation_vector(multiply(principal[k + 1], conjugate(principal[k]))) / h
            self.segments.append((float(times[k]), i, (centre[k], principal[k], v, w)))
            if times[k] <= 0.0:
                # Frame 0 has the velocity with which the body sets out.
                world.velocity[i], world.angular_velocity[i] = v, w

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


def _in_pieces(times: np.ndarray, positions: np.ndarray, turned: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Keys (k,), (k, 3), (k, 4) of an origin with others between them, so that no two are turned by more than PIECE."""
    turn = rotation_vector(multiply(turned[1:], conjugate(turned[:-1])))
    number = np.maximum(np.ceil(length(turn) / PIECE).astype(np.int64), 1)
    key = np.repeat(np.arange(len(number)), number)
    share = ((np.arange(len(key)) - (np.cumsum(number) - number)[key]) / number[key])[:, None]
    last = [len(times) - 1]
    between = (1.0 - share) * positions[key] + share * positions[key + 1]
    on_the_way = multiply(quaternion_from_rotation_vector(share * turn[key]), turned[key])
    time = times[key] + share[:, 0] * np.diff(times)[key]
    # Keys themselves stay as they are.
    at = share[:, 0] == 0.0
    on_the_way[at] = turned[key[at]]
    return np.append(time, times[last]), np.vstack([between, positions[last]]), np.vstack([on_the_way, turned[last]])


def _let_go(run: Run, i: int, time: float) -> None:
    """Body i is dynamic from `time` on."""
    world, trajectory, now = run.world, run.state.trajectory, run.state.now
    state_at(trajectory, i, time, now.position[i], now.orientation[i], now.velocity[i], now.angular_velocity[i])
    world.dynamic[i], world.moving[i] = True, False
    run.forces.weigh(np.array([i]), time)  # it may have burnt fuel since it was weighed
    world.inv_mass[i] = 1.0 / world.mass[i]
    trajectory.position[i], trajectory.orientation[i] = now.position[i], now.orientation[i]
    trajectory.velocity[i], trajectory.angular_velocity[i] = now.velocity[i], now.angular_velocity[i]
    trajectory.acceleration[i], trajectory.start[i], trajectory.mode[i] = world.steady_acceleration[i], time, FREE
    begin(trajectory, i)
    run.substepped.let_go(np.array([i]))
    run.log.account(time, "let go", mechanical_energy(now, world.constants, np.array([i])))
