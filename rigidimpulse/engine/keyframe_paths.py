"""Paths of kinematic bodies with keyframes: constant velocity and spin between keys, held after the last; and bodies that are let go.

The velocity is that of the body's origin. Where that is not the centre of mass and the body turns, the centre goes along an arc of a radius
R. It is followed along cubics that have the place and the velocity of the arc at both ends, so that no velocity jumps. A cubic that turns
by an angle b leaves the arc by R b^4 / 384: b is so small that this is the part CUBIC of the bounding radius at most.

A body with a `release_time` T is compiled as a dynamic one, with its mass, and made immovable when the run begins. At T, between two
steps, it gets its mass back and goes on freely with the pose, velocity and spin of its path just before T. In the ledger it counts from
then on.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rigidimpulse.core.portable import length
from rigidimpulse.core.quaternion import conjugate, multiply, quaternion_from_rotation_vector, rotate, rotation_vector
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.core.vector import cross_arrays
from rigidimpulse.dynamics.energy import mechanical_energy
from rigidimpulse.engine.run import Run
from rigidimpulse.model.world import World
from rigidimpulse.motion.trajectory import FREE, PRESCRIBED, begin, state_at
from rigidimpulse.scene.keyframes import Keyframes

CUBIC: float = 1e-8
"""Part of the bounding radius by which a cubic may leave the arc."""
MOST_TURN: float = 1.5
"""rad, of a piece."""
TINY = TOLERANCES.arithmetic.least_divisor
CENTRED: float = 1e-9
"""Part of the bounding radius up to which a centre of mass is at the origin: that of a mesh is there up to round-off."""


class Segment(NamedTuple):
    """A piece of a path of a centre of mass: what a trajectory starts from."""

    position: np.ndarray  # (3,) m
    orientation: np.ndarray  # (4,) of the principal frame
    velocity: np.ndarray  # (3,) m/s
    angular_velocity: np.ndarray  # (3,) rad/s
    acceleration: np.ndarray  # (3,) m/s2
    jerk: np.ndarray  # (3,) m/s3


class KeyframePaths:
    """Key times and segments of all bodies with keyframes, in the principal frame.

    From key k to k + 1 the origin moves by v = (x1 - x0) / h and the body turns by w = log(q1 q0*) / h; it starts exactly at each key.
    """

    def __init__(self, world: World) -> None:
        """Segments of a compiled scene; bodies that are let go later are immovable from here on."""
        self.segments: list[tuple[float, int, Segment | None]] = []
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
        off_centre = float(length(world.offset[i])) > CENTRED * world.bound_radius[i]
        if off_centre:
            times, positions, turned = _in_pieces((times, positions, turned), world.offset[i], float(world.bound_radius[i]))
        arm = rotate(turned, world.offset[i])
        centre, principal = positions + arm, multiply(turned, world.turn[i])
        none = np.zeros(3)
        for k in np.flatnonzero(times < release).tolist():
            v = w = acceleration = jerk = none
            if k + 1 < len(times):
                h = times[k + 1] - times[k]
                v = mean = (centre[k + 1] - centre[k]) / h
                w = rotation_vector(multiply(principal[k + 1], conjugate(principal[k]))) / h
                if off_centre and np.any(w):
                    straight = (positions[k + 1] - positions[k]) / h
                    v, last = straight + cross_arrays(w, arm[k]), straight + cross_arrays(w, arm[k + 1])
                    acceleration = (6.0 * mean - 4.0 * v - 2.0 * last) / h
                    jerk = (6.0 * (v + last) - 12.0 * mean) / h**2
            self.segments.append((float(times[k]), i, Segment(centre[k], principal[k], v, w, acceleration, jerk)))
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
            start, i, segment = self.segments[self._next]
            self._next += 1
            run.recorder.flush(trajectory, i, start, np.zeros(6))
            if segment is None:
                _let_go(run, i, start)
            else:
                trajectory.start[i], trajectory.mode[i] = start, PRESCRIBED
                trajectory.position[i], trajectory.orientation[i] = segment.position, segment.orientation
                trajectory.velocity[i], trajectory.angular_velocity[i] = segment.velocity, segment.angular_velocity
                trajectory.acceleration[i], trajectory.jerk[i] = segment.acceleration, segment.jerk
                begin(trajectory, i)


Keys = tuple[np.ndarray, np.ndarray, np.ndarray]
"""Times (k,), positions (k, 3) and orientations (k, 4) of an origin."""


def _in_pieces(keys: Keys, offset: np.ndarray, size: float) -> Keys:
    """Keys with others between them, close enough for a centre of mass at an offset (3,) m; size: m, the bounding radius."""
    times, positions, turned = keys
    turn = rotation_vector(multiply(turned[1:], conjugate(turned[:-1])))
    angle = length(turn)
    radius = length(cross_arrays(turn, rotate(turned[:-1], offset))) / np.maximum(angle, TINY)
    most = np.sqrt(np.sqrt(384.0 * CUBIC / np.maximum(radius / size, TINY)))
    number = np.maximum(np.ceil(angle / np.minimum(most, MOST_TURN)).astype(np.int64), 1)
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
    trajectory.jerk[i] = 0.0
    begin(trajectory, i)
    run.substepped.let_go(np.array([i]))
    run.log.account(time, "let go", mechanical_energy(now, world.constants, np.array([i])))
