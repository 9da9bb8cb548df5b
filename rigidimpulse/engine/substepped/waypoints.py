"""Frames in the middle of a step of sub-stepped islands.

The trajectory of a member leads straight to where it is at the end of the step. Frames in between are written along waypoints, the looks at
contacts or the sub-steps of islands with joints, and from one to the next as `depart` goes.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.engine.substepped.contact_forces import Outcome
from rigidimpulse.engine.substepped.trajectories import depart
from rigidimpulse.motion.body_state import BodyState
from rigidimpulse.motion.trajectory import make_trajectories
from rigidimpulse.recording.recorder import Recorder

LAST = TOLERANCES.sub_stepping.last_sub_step


class Way(NamedTuple):
    """Where k bodies come by in a step."""

    bodies: np.ndarray  # (k,)
    time: np.ndarray  # (w,) s, from its start to its end
    state: np.ndarray  # (w, k, 13) position, orientation, velocity, angular velocity


def way_of(outcome: Outcome, now: BodyState, begin: float, end: float) -> Way | None:
    """The way of an outcome from the present state, at `begin`, to `end` [s]; None if no frames fall between."""
    members, waypoints = outcome.members, outcome.waypoints
    if waypoints is None:
        return None
    first = np.column_stack([now.position[members], now.orientation[members], now.velocity[members], now.angular_velocity[members]])
    last = np.column_stack([outcome.position, outcome.orientation, outcome.velocity])
    # The last of them is the end, before its energy was balanced.
    inside = waypoints.time < (end - begin) * (1.0 - LAST)
    time, state = begin + waypoints.time[inside], waypoints.state[inside]
    return Way(members, np.concatenate([[begin], time, [end]]), np.concatenate([[first], state, [last]]))


def part_of(way: Way, bodies: np.ndarray) -> Way:
    """The way of some of its bodies."""
    which = np.isin(way.bodies, bodies)
    return Way(way.bodies[which], way.time, way.state[:, which])


def write_frames(recorder: Recorder, way: Way, until: float) -> None:
    """Write the frames along a way before `until` [s]."""
    first, last = np.searchsorted(recorder.times, [way.time[0], until]).tolist()
    k = len(way.bodies)
    frames, trajectories, everyone = Recorder(recorder.times[first:last], k), make_trajectories(k), np.arange(k)
    for leg in range(len(way.time) - 1):
        begin, end = way.time[leg : leg + 2].tolist()
        position, orientation, velocity, angular_velocity = _columns(way.state[leg])
        now = BodyState(position, orientation, velocity, angular_velocity, np.zeros(k), np.zeros((k, 3, 3)))
        position, orientation, velocity, angular_velocity = _columns(way.state[leg + 1])
        depart(trajectories, everyone, begin, end - begin, now, position, orientation, np.column_stack([velocity, angular_velocity]))
        frames.flush_all(trajectories, everyone, end)
    recorder.put(way.bodies, first, frames.frames)


def _columns(state: np.ndarray) -> list[np.ndarray]:
    """Position, orientation, velocity and angular velocity of states (k, 13)."""
    return [np.ascontiguousarray(column) for column in np.split(state, [3, 7, 10], axis=1)]
