"""The recorder: samples every body's exact path at the frame times, whatever the frame rate, without touching the motion.

A body's path is known from one change of its trajectory to the next. Before a trajectory changes at time t, the body's frames before t are
written. A frame at exactly the time of an impact shows the state after it. Frame 0 is the state as given.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rigidimpulse.core.kernels import inlined, jit
from rigidimpulse.core.sorted_values import place_in
from rigidimpulse.motion.trajectory import FIXED, LINEAR, Trajectories, motion_at, stepped_at


class Frames(NamedTuple):
    """States of n bodies at f times, world frame."""

    times: np.ndarray  # (f,) s, increasing
    position: np.ndarray  # (f, n, 3) m, centres of mass
    orientation: np.ndarray  # (f, n, 4) wxyz, principal frames
    velocity: np.ndarray  # (f, n, 3) m/s
    angular_velocity: np.ndarray  # (f, n, 3) rad/s


@inlined
def _write_linear(trajectory, i, f, frames):
    """Write frame f of body i in mode LINEAR."""
    position, orientation, velocity, angular_velocity = frames.position, frames.orientation, frames.velocity, frames.angular_velocity
    x, q, v, w = stepped_at(trajectory, i, frames.times[f])
    position[f, i, 0], position[f, i, 1], position[f, i, 2] = x
    orientation[f, i, 0], orientation[f, i, 1], orientation[f, i, 2], orientation[f, i, 3] = q
    velocity[f, i, 0], velocity[f, i, 1], velocity[f, i, 2] = v
    angular_velocity[f, i, 0], angular_velocity[f, i, 1], angular_velocity[f, i, 2] = w


@inlined
def _write_fixed(trajectory, i, f, frames):
    """Write frame f of body i in mode FIXED."""
    position, orientation, velocity, angular_velocity = frames.position, frames.orientation, frames.velocity, frames.angular_velocity
    for k in range(3):
        position[f, i, k] = trajectory.position[i, k]
        # Only where it is not 0: zeros that nobody has written take no memory.
        if velocity[f, i, k] != 0.0:
            velocity[f, i, k] = 0.0
        if angular_velocity[f, i, k] != 0.0:
            angular_velocity[f, i, k] = 0.0
    for k in range(4):
        orientation[f, i, k] = trajectory.orientation[i, k]


@jit
def sample_path(trajectory, i, last, written, frames):
    """Write the frames of body i from written[i] to last - 1, on its present trajectory, and say so in `written` (n,)."""
    times, position, orientation = frames.times, frames.position, frames.orientation
    velocity, angular_velocity = frames.velocity, frames.angular_velocity
    for f in range(written[i], last):
        if trajectory.mode[i] == LINEAR:
            _write_linear(trajectory, i, f, frames)
        elif trajectory.mode[i] == FIXED:
            _write_fixed(trajectory, i, f, frames)
        else:
            motion_at(trajectory, i, times[f], position[f, i], orientation[f, i], velocity[f, i], angular_velocity[f, i])
    written[i] = max(written[i], last)


@jit
def sample_paths(trajectory, bodies, last, written, frames):
    """Write the frames of these bodies before `last`, as `sample_path` does."""
    for i in bodies:
        sample_path(trajectory, i, last, written, frames)


@jit
def flush_frames(trajectory, i, time, correction, written, frames):
    """Write the frames of body i before `time` [s]; its trajectory must still be the one that led there.

    correction (6,): change of velocity [m/s] and spin [rad/s] that it got at the end of its trajectory, for the error of
    the trajectory, which grew with the square of the time.
    """
    first, last = written[i], place_in(frames.times, time)
    if last <= first:
        return
    sample_path(trajectory, i, last, written, frames)
    corrected = False
    for k in range(6):
        corrected = corrected or correction[k] != 0.0
    if not corrected:
        return
    start, velocity, angular_velocity = trajectory.start[i], frames.velocity, frames.angular_velocity
    for f in range(first, last):
        share = (frames.times[f] - start) / (time - start)
        share *= share
        for k in range(3):
            velocity[f, i, k] += share * correction[k]
            angular_velocity[f, i, k] += share * correction[3 + k]


AT_ONCE = 16
"""Frames of all bodies that are written at once, since those of one body are far apart in memory."""


class Recorder:
    """Frames of n bodies in the principal frame: position (f, n, 3), orientation (f, n, 4), velocities (f, n, 3).

    Attributes:
        frames: all of them, written or not. written: (n,) how many of each body are.

    """

    def __init__(self, times: np.ndarray, num_bodies: int) -> None:
        """times (f,) s, increasing."""
        self.times = times
        self.position = np.empty((len(times), num_bodies, 3))
        self.orientation = np.empty((len(times), num_bodies, 4))
        self.velocity = np.zeros((len(times), num_bodies, 3))
        self.angular_velocity = np.zeros((len(times), num_bodies, 3))
        self.written = np.zeros(num_bodies, np.int64)
        self._everyone = np.arange(num_bodies)
        # The same tuple in all calls: they are quicker by it.
        self.frames = Frames(times, self.position, self.orientation, self.velocity, self.angular_velocity)

    def start(self, trajectory: Trajectories) -> None:
        """Write frame 0, the state as given."""
        self._write(trajectory, self._everyone, 1)

    def has_frames(self, begin: float, end: float) -> bool:
        """Whether frames fall between these times [s], both excluded."""
        return bool(np.searchsorted(self.times, end, side="left") > np.searchsorted(self.times, begin, side="right"))

    def flush(self, trajectory: Trajectories, i: int, time: float, correction: np.ndarray) -> None:
        """Write the frames of body i before `time` [s], with what it was corrected by (6,) then; see `flush_frames`."""
        due = self.written[i]
        if due < len(self.times) and self.times[due] < time:
            flush_frames(trajectory, i, time, correction, self.written, self.frames)

    def flush_all(self, trajectory: Trajectories, bodies: np.ndarray, time: float) -> None:
        """Write the frames of all these bodies before `time`, as `flush` does."""
        self._write(trajectory, bodies, int(np.searchsorted(self.times, time, side="left")))

    def put(self, bodies: np.ndarray, first: int, frames: Frames) -> None:
        """Write the next frames of these bodies (k,), from frame `first` on: those of a recorder of k bodies."""
        last = first + len(frames.times)
        self.position[first:last, bodies], self.orientation[first:last, bodies] = frames.position, frames.orientation
        self.velocity[first:last, bodies], self.angular_velocity[first:last, bodies] = frames.velocity, frames.angular_velocity
        self.written[bodies] = last

    def keep(self, count: int) -> None:
        """Leave the first `count` frames only."""
        self.times, self.position, self.orientation = self.times[:count], self.position[:count], self.orientation[:count]
        self.velocity, self.angular_velocity = self.velocity[:count], self.angular_velocity[:count]
        self.frames = Frames(self.times, self.position, self.orientation, self.velocity, self.angular_velocity)
        self.written = np.minimum(self.written, count)

    def finish(self, trajectory: Trajectories) -> None:
        """Write what is left of all bodies."""
        for last in range(int(self.written.min(initial=0)), len(self.times), AT_ONCE):
            self.flush_all(trajectory, self._everyone, self.times[last])
        self.flush_all(trajectory, self._everyone, np.inf)

    def _write(self, trajectory: Trajectories, bodies: np.ndarray, last: int) -> None:
        if len(bodies) and self.written[bodies].min() < last:
            sample_paths(trajectory, bodies, last, self.written, self.frames)
