"""Where bodies come by on their way through a step (kernels)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rigidimpulse.core.kernels import jit

STATE = 13
"""Numbers of a body: position, orientation, velocity, angular velocity."""


class Waypoints(NamedTuple):
    """Of n bodies, at most w."""

    number: np.ndarray  # (1,) how many there are
    time: np.ndarray  # (w,) s, from the start of the step
    state: np.ndarray  # (w, n, 13)


def make_waypoints(most: int, num_bodies: int) -> Waypoints:
    """Space for as many waypoints of as many bodies."""
    return Waypoints(np.zeros(1, np.int64), np.zeros(most), np.zeros((most, num_bodies, STATE)))


def grown_waypoints(waypoints: Waypoints, most: int) -> Waypoints:
    """The same with more space."""
    out, count = make_waypoints(most, waypoints.state.shape[1]), len(waypoints.time)
    out.number[:], out.time[:count], out.state[:count] = waypoints.number, waypoints.time, waypoints.state
    return out


def waypoints_of(waypoints: Waypoints, bodies: np.ndarray) -> Waypoints:
    """Those there are, of some bodies (k,)."""
    count = int(waypoints.number[0])
    return Waypoints(waypoints.number.copy(), waypoints.time[:count].copy(), waypoints.state[:count, bodies])


@jit
def add_waypoint(waypoints, time, bodies):
    """Add the poses of bodies at `time` [s]; returns its number, under which the caller writes the velocities. There must be space."""
    number, state = waypoints.number[0], waypoints.state
    waypoints.time[number] = time
    waypoints.number[0] = number + 1
    for i in range(state.shape[1]):
        for k in range(3):
            state[number, i, k] = bodies.position[i, k]
        for k in range(4):
            state[number, i, 3 + k] = bodies.orientation[i, k]
    return number
