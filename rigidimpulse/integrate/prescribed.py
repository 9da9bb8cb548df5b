"""Paths of kinematic bodies with keyframes: constant velocity and spin between keys, held after the last."""

from __future__ import annotations

import numpy as np

from rigidimpulse.integrate.course import PRESCRIBED, begin
from rigidimpulse.rotation import conjugate, multiply, rotate, rotation_vector


class KeyframePaths:
    """Key times and segments of all bodies with keyframes, in the principal frame.

    From key k to k + 1 the centre moves by v = (x1 - x0) / h and the body turns by w = log(q1 q0*) / h; it starts exactly at each key.
    """

    def __init__(self, world) -> None:
        """Segments of a compiled scene."""
        self.segments: list[tuple[float, int, np.ndarray, np.ndarray, np.ndarray, np.ndarray]] = []
        for i, body in enumerate(world.scene.bodies):
            if body.keyframes is not None:
                self._add(world, i, body.keyframes)
        self.segments.sort(key=lambda segment: (segment[0], segment[1]))
        self.times = np.array([segment[0] for segment in self.segments])
        self._next = 0

    def _add(self, world, i: int, keys) -> None:
        times, positions, turned = keys.arrays(world.scene.bodies[i].orientation)
        centre = positions + rotate(turned, world.offset[i])
        principal = multiply(turned, world.turn[i])
        for k in range(len(times)):
            v = w = np.zeros(3)
            if k + 1 < len(times):
                h = times[k + 1] - times[k]
                v = (centre[k + 1] - centre[k]) / h
                w = rotation_vector(multiply(principal[k + 1], conjugate(principal[k]))) / h
            self.segments.append((float(times[k]), i, centre[k], principal[k], v, w))

    def next_key(self, time: float) -> float:
        """The first key time after `time`, inf if there is none."""
        later = self.times[self.times > time]
        return float(later[0]) if len(later) else np.inf

    def start_segments(self, context, time: float) -> None:
        """Put bodies whose key is at or before `time` on their new course."""
        course = context.state.course
        while self._next < len(self.segments) and self.segments[self._next][0] <= time:
            start, i, x, q, v, w = self.segments[self._next]
            self._next += 1
            context.recorder.flush(course, i, start, np.zeros(6))
            course.start[i], course.mode[i] = start, PRESCRIBED
            course.position[i], course.orientation[i] = x, q
            course.velocity[i], course.angular_velocity[i] = v, w
            begin(course, i)
