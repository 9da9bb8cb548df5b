"""Frames and impacts of a run while it goes on, as messages for the page.

The recorder writes a body's frames when its trajectory changes. Frames that are over but not written yet are sampled from the present
trajectories, as for a checkpoint; the recorder writes them again later, alike.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from time import perf_counter
from typing import Any

import numpy as np

from rigidimpulse.engine.run import Run
from rigidimpulse.recording.events import impact_table
from rigidimpulse.recording.recorder import sample_paths
from rigidimpulse.recording.recording import Recording
from rigidimpulse.scene.frames import own_frames
from rigidimpulse.view.live.messages import (
    Motion,
    frames_message,
    framing_message,
    impacts_message,
    movers_of,
    soft_body_message,
    soft_frames_message,
)

PAUSE = 1.0 / 60.0
"""Least time between two lots of frames, s."""
FRAMING_PAUSE = 0.5
"""The same between two views, which follow the motion."""

Send = Callable[[dict[str, Any]], None]


class Tap:
    """Hands on what a run has computed."""

    def __init__(self, run: Run, send: Send) -> None:
        """Of a run at its start."""
        self._run, self._send = run, send
        self._movers = movers_of(run.world.scene)
        self._dynamic = [body.motion == "dynamic" for body in run.world.scene.bodies]
        self._frames = self._impacts = self._arrows = 0
        self._last, self._last_framing = -np.inf, perf_counter()
        self._positions = np.empty((len(run.recorder.times), len(run.world.names), 3))
        self._orientations = np.empty((len(run.recorder.times), len(run.world.names), 4))
        num_coloured = len(self._movers)
        for number, track in enumerate(run.soft_bodies.tracks()):
            send(soft_body_message(track, number, num_coloured))

    def look(self, time: float) -> None:
        """Send what is new at the time of the run [s], if it is time to."""
        now = perf_counter()
        if now - self._last < PAUSE:
            return
        self._last = now
        recorder = self._run.recorder
        last = int(np.searchsorted(recorder.times, time, side="left"))
        behind = np.flatnonzero(recorder.written < last)
        written = np.maximum(recorder.written, self._frames)
        sample_paths(self._run.state.trajectory, behind, last, written, recorder.frames)
        self._send_frames(last)
        self._send_impacts(impact_table(self._run.log.impacts[self._impacts :]), time)
        if now - self._last_framing > FRAMING_PAUSE and last > 1:
            self._last_framing = now
            self._send(framing_message(self._motion(last)))

    def finish(self, recording: Recording) -> None:
        """Send what is left of a run that is finished."""
        self._send_frames(len(recording.times))
        # From the first one on: the impacts of a recording are sorted, and some are left out.
        self._impacts = self._arrows = 0
        self._send_impacts(recording.impacts, np.inf)
        self._send(framing_message(recording))

    def _send_frames(self, last: int) -> None:
        """Send the frames before `last`."""
        first, recorder, world = self._frames, self._run.recorder, self._run.world
        if last <= first:
            return
        position, orientation = own_frames(recorder.position[first:last], recorder.orientation[first:last], world.offset, world.turn)
        self._positions[first:last], self._orientations[first:last] = position, orientation
        for number, track in enumerate(self._run.soft_bodies.tracks()):
            self._send(soft_frames_message(number, first, track.vertices[first:last]))
        self._send(frames_message(first, position[:, self._movers], orientation[:, self._movers]))
        self._frames = last

    def _send_impacts(self, impacts: np.ndarray, time: float) -> None:
        """Send those of these impacts that are not later than a time [s]."""
        over = impacts[impacts["time"] <= time]
        if len(over):
            message, number = impacts_message(self._arrows, self._impacts, over, self._dynamic)
            self._send(message)
            self._impacts += len(over)
            self._arrows += number

    def _motion(self, frames: int) -> Motion:
        """The motion until now."""
        world, times = self._run.world, self._run.recorder.times
        tracks = [replace(track, vertices=track.vertices[:frames]) for track in self._run.soft_bodies.tracks()]
        return Motion(world.scene, times[:frames], self._positions[:frames], self._orientations[:frames], tracks)
