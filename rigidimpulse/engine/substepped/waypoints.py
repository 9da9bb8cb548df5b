"""Frames in the middle of a step of sub-stepped islands.

The trajectory of a member leads straight to where it is at the end of the step. Frames in between are written along waypoints, the looks at
contacts or the sub-steps of islands with joints, and from one to the next as `depart` goes.

Between two waypoints of an island with joints all bodies fly freely for h s: impulses act at the first of them. Where nothing else holds
the island, its frames have the velocities of that flight, with which momentum and angular momentum are constant to round-off:

    v = (x_1 - x_0) / h + g (t - (t_0 + t_1) / 2),      w = R I^-1 R^T l,   l = R_1 I R_1^T w_1

The frame at the start of the step has the velocities there, in which the joints are at rest. What stands or hangs has those of `depart`:
in its flight it would fall.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rigidimpulse.core.quaternion import rotate, rotate_inverse
from rigidimpulse.core.tolerances import TOLERANCES
from rigidimpulse.engine.substepped.contact_forces import Outcome
from rigidimpulse.engine.substepped.trajectories import depart
from rigidimpulse.motion.body_state import BodyState
from rigidimpulse.motion.trajectory import make_trajectories
from rigidimpulse.motion.waypoints import Waypoints
from rigidimpulse.recording.recorder import Frames, Recorder

LAST = TOLERANCES.sub_stepping.last_sub_step


class Way(NamedTuple):
    """Where k bodies come by in a step."""

    bodies: np.ndarray  # (k,)
    time: np.ndarray  # (w,) s, from its start to its end
    state: np.ndarray  # (w, k, 13) position, orientation, velocity, angular velocity
    landed: np.ndarray  # (w, k, 3) rad/s, where the flight from the waypoint before ends; empty where bodies do not fly
    pull: np.ndarray  # (k, 3) m/s2, by gravity and forces


def way_of(
    outcome: Outcome, waypoints: Waypoints, now: BodyState, span: tuple[float, float], flies: bool, pull: np.ndarray
) -> Way:
    """The way of an outcome from the present state by waypoints, over a span [s].

    flies: whether it is that of an island with joints that nothing else holds; pull: (n, 3) m/s2, what pulls bodies.
    """
    members, (begin, end) = outcome.members, span
    first = np.column_stack([now.position[members], now.orientation[members], now.velocity[members], now.angular_velocity[members]])
    last = np.column_stack([outcome.position, outcome.orientation, outcome.velocity])
    # The last of them is the end, before its energy was balanced.
    inside = waypoints.time < (end - begin) * (1.0 - LAST)
    time = np.concatenate([[begin], begin + waypoints.time[inside], [end]])
    state = np.concatenate([[first], waypoints.state[inside], [last]])
    landed = state[: len(state) if flies else 0, :, 10:].copy()
    if flies and not inside.all():
        landed[-1] = waypoints.state[len(state) - 2, :, 10:]
    return Way(members, time, state, landed, pull[members])


def part_of(way: Way, bodies: np.ndarray) -> Way:
    """The way of some of its bodies."""
    which = np.isin(way.bodies, bodies)
    return Way(way.bodies[which], way.time, way.state[:, which], way.landed[:, which], way.pull[which])


def write_frames(recorder: Recorder, way: Way, until: float, inertia: np.ndarray) -> None:
    """Write the frames along a way before `until` [s]; inertia: (k, 3) kg m2 of its bodies, along principal axes."""
    first, last = np.searchsorted(recorder.times, [way.time[0], until]).tolist()
    k = len(way.bodies)
    frames, trajectories, everyone = Recorder(recorder.times[first:last], k), make_trajectories(k), np.arange(k)
    for leg in range(len(way.time) - 1):
        begin, end = way.time[leg : leg + 2].tolist()
        if int(frames.written[0]) == int(np.searchsorted(frames.times, end)):
            continue
        position, orientation, velocity, angular_velocity = _columns(way.state[leg])
        now = BodyState(position, orientation, velocity, angular_velocity, np.zeros(k), np.zeros((k, 3, 3)))
        position, orientation, velocity, angular_velocity = _columns(way.state[leg + 1])
        depart(trajectories, everyone, begin, end - begin, now, position, orientation, np.column_stack([velocity, angular_velocity]))
        written = max(int(frames.written[0]), int(np.searchsorted(frames.times, way.time[0], side="right")))
        frames.flush_all(trajectories, everyone, end)
        if len(way.landed):
            _fly(frames.frames, slice(written, int(frames.written[0])), way, leg, inertia)
    recorder.put(way.bodies, first, frames.frames)


def _fly(frames: Frames, rows: slice, way: Way, leg: int, inertia: np.ndarray) -> None:
    """Give the frames in `rows`, which are on a leg of a way, the velocities of the flight."""
    (begin, end), (before, after) = way.time[leg : leg + 2], way.state[leg : leg + 2]
    since = frames.times[rows, None, None] - 0.5 * (begin + end)
    frames.velocity[rows] = (after[:, :3] - before[:, :3]) / (end - begin) + since * way.pull
    spin = rotate(after[:, 3:7], inertia * rotate_inverse(after[:, 3:7], way.landed[leg + 1]))
    turn = frames.orientation[rows]
    frames.angular_velocity[rows] = rotate(turn, rotate_inverse(turn, np.broadcast_to(spin, (*turn.shape[:-1], 3))) / inertia)


def _columns(state: np.ndarray) -> list[np.ndarray]:
    """Position, orientation, velocity and angular velocity of states (k, 13)."""
    return [np.ascontiguousarray(column) for column in np.split(state, [3, 7, 10], axis=1)]
